"""What must not grow: compilations, calls, memory, and the ratio to the same arithmetic in C."""

import json
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

HERE = Path(__file__).parent
HEAVY = {
    "jit(_solve)": 1,  # the search: all starts, under white and under settled noise, share it
    "jit(_objective)": 3,  # of the fit; of the screening, with and without room for the catalogue
    "jit(log_posterior_batch)": 1,
    "jit(linearise)": 1,
    "jit(whiten)": 2,  # residual with Jacobian; a prediction with its spread
    "jit(information)": 1,  # the record imagined longer
    "jit(_place)": 1,
    "jit(predict_batch)": 2,  # the steps of the record, and finer ones
}
"""Most compilations of a calibration by function."""


@pytest.fixture(scope="module")
def counts():
    done = subprocess.run(
        [sys.executable, str(HERE / "counts.py")], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.slow
def test_a_calibration_compiles_each_function_once(counts):
    found = counts["first"]["compilations"]
    grown = {name: found.get(name, 0) for name, most in HEAVY.items() if found.get(name, 0) > most}
    assert not grown, f"compiled more often than {HEAVY}: {grown}"
    assert found["jit(_solve)"] == 1  # else the names have changed and nothing is watched
    # the rest are single operations of about 15 ms each
    assert sum(found.values()) <= 90, found  # 80 with the screening


@pytest.mark.slow
def test_a_second_record_of_the_same_shape_compiles_nothing(counts):
    assert counts["second"]["compilations"] == {}


@pytest.mark.parametrize("record", ["first", "second"])
@pytest.mark.slow
def test_a_fit_takes_no_more_searches_and_steps_than_it_needs(record, counts):
    found = counts[record]
    # 16 starts, one or two rounds of noise and least squares, a last look from distinct optima
    assert found["calls"]["search"] <= 21, found["calls"]
    assert found["steps"] <= 40, found["steps"]  # 24 and 20 of 120
    # three starts of about 25 evaluations in each round, and in both of the screening
    assert found["calls"]["noise"] <= 320, found["calls"]


@pytest.mark.slow
def test_the_likelihood_is_called_for_the_draws_alone(counts):
    """4096 draws, moved at most three times; ensembles of 64 walkers and their starts."""
    proposal = 4 * 4096 + 64
    assert counts["first"]["method"] == "importance"
    assert counts["first"]["calls"]["likelihood rows"] <= proposal
    assert counts["emcee"]["calls"]["likelihood rows"] <= proposal + 2 * 64 * (500 + 1)


@pytest.mark.slow
def test_no_array_of_steps_by_walkers_is_written_out(counts):
    memory = counts["memory"]
    by_steps = 8 * memory["num_steps"] * memory["num_rows"]
    by_blocks = 8 * memory["num_blocks"] * memory["num_rows"]
    # a few arrays of blocks by walkers: modelled means, residuals, whitened ones, what the slow
    # noise leaves in each; the compiler of JAX 0.12 keeps one more of them than that of 0.10
    major, minor = (int(part) for part in version("jax").split(".")[:2])
    most = 8 if (major, minor) < (0, 12) else 9
    assert memory["temporary_bytes"] < most * by_blocks < by_steps, memory
    # a few arrays of blocks by walkers for each column of heat, as filtered and as read
    assert memory["temporary_bytes_with_heat"] < 4 * (memory["num_heat"] + 1) * by_blocks, memory


@pytest.mark.slow
def test_one_likelihood_and_its_jacobian_keep_up_with_c(tmp_path):
    """Fastest of twenty turns, so that other users of the machine do not count.

    Typical are 0.5 and 2.5. The bounds are generous for slow or wide processors; where the loops
    are not compiled whole the Jacobian takes a hundred times as long as C, the likelihood no more.
    """
    import heatrun  # isort: skip  (before JAX)
    import jax.numpy as jnp
    import ours
    import rivals
    from duty_record import TRUTH, record
    from rows import in_turns

    assert heatrun.__version__
    made = record(20_000)
    in_c = rivals.c_likelihood(made, tmp_path)
    if in_c is None:
        pytest.skip("no C compiler")
    mine, both = ours.likelihood(made), ours.jacobian(made)
    one = jnp.asarray(TRUTH)
    for what, call, most in (
        ("one likelihood", lambda: mine(one[None]), 3.0),
        ("residual and Jacobian", lambda: both(one), 12.0),
    ):
        here, there = in_turns(call, lambda: in_c(TRUTH[None]), 20).min(axis=0)
        assert here / there < most, f"{what} takes {here / there:.1f} times as long as C"
