"""The reading at the samples by general solvers, written as their users would write it.

Each entry of `SOLVERS` takes the record and returns a function from one row of parameters to the
reading, or None where the package is not installed.
"""

from collections.abc import Callable

import numpy as np
from rows import needs

B = 234.5


def _slope(T, drive, p):
    I2, P, T0 = drive
    copper = 3.0 * p[4] / (B + 25.0) * I2 * (B + T[0])
    flow = (T[0] - T[1]) / p[2]
    return (copper - flow) / p[0], (P - copper + flow - (T[1] - T0) / p[3]) / p[1]


def _times(made: dict) -> np.ndarray:
    return made["step"] * np.arange(made["measured"].size + 1)


def _columns(made: dict) -> np.ndarray:
    return np.stack([made["current_squared"], made["losses"], made["ambient"]], axis=1)


def scipy_solver(made: dict) -> Callable:
    """`solve_ivp` with its defaults but rtol 1e-6, inputs looked up by time."""
    from scipy.integrate import solve_ivp

    times, columns, step = _times(made), _columns(made), made["step"]
    last = len(columns) - 1

    def reading(p):
        def slope(t, T):
            return _slope(T, columns[min(int(t / step), last)], p)

        solution = solve_ivp(slope, (0.0, times[-1]), [p[5], p[5]], t_eval=times, rtol=1e-6,
                             max_step=10.0)  # fmt: skip
        return solution.y[0, 1:]

    return reading


@needs("diffrax")
def _diffrax(made: dict, controller: Callable, solver: Callable) -> Callable | None:
    import diffrax
    import jax
    import jax.numpy as jnp

    times, columns, step = jnp.asarray(_times(made)), jnp.asarray(_columns(made)), made["step"]

    def rate(t, T, p):
        index = jnp.clip((t / step + 1e-9).astype(int), 0, len(columns) - 1)
        return jnp.stack(_slope(T, columns[index], p))

    @jax.jit
    def reading(p):
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(rate), solver(diffrax), times[0], times[-1], None,
            jnp.stack([p[5], p[5]]), args=p, saveat=diffrax.SaveAt(ts=times),
            stepsize_controller=controller(diffrax, times), max_steps=4 * len(columns),
        )  # fmt: skip
        return solution.ys[1:, 0]

    return lambda p: reading(jnp.asarray(p))


def diffrax_adaptive(made: dict) -> Callable | None:
    """Tsit5 with a PID controller that knows nothing of the jumps."""
    return _diffrax(
        made,
        lambda diffrax, times: diffrax.PIDController(rtol=1e-6, atol=1e-6, dtmax=10.0),
        lambda diffrax: diffrax.Tsit5(),
    )


def diffrax_at_samples(made: dict) -> Callable | None:
    """Heun's third-order method on the grid of the samples."""
    return _diffrax(
        made, lambda diffrax, times: diffrax.StepTo(ts=times), lambda diffrax: diffrax.Bosh3()
    )


@needs("casadi")
def casadi_integrator(made: dict) -> Callable | None:
    """Kutta's step in casadi, accumulated over the record."""
    import casadi as ca

    T, u, p, h = ca.SX.sym("T", 2), ca.SX.sym("u", 3), ca.SX.sym("p", 6), made["step"]

    def slope(T):
        return ca.vertcat(*_slope([T[0], T[1]], [u[0], u[1], u[2]], [p[i] for i in range(6)]))

    first = slope(T)
    second = slope(T + 0.5 * h * first)
    third = slope(T + h * (2 * second - first))
    after = T + h / 6 * (first + 4 * second + third)
    step = ca.Function("step", [T, u, p], [after])
    march = step.mapaccum("march", made["measured"].size, 1)
    columns = _columns(made).T

    def reading(values):
        return np.asarray(march([values[5]] * 2, columns, ca.DM(values))).reshape(2, -1)[0]

    return reading


SOLVERS = {
    "casadi, Kutta's step": casadi_integrator,
    "diffrax Tsit5, adaptive": diffrax_adaptive,
    "diffrax Bosh3 at the samples": diffrax_at_samples,
    "scipy solve_ivp": scipy_solver,
}
