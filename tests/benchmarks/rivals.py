"""The same likelihood in C and in numba, written by hand, walkers in the inner loop."""

import ctypes
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
from rows import needs

Likelihood = Callable[[np.ndarray], np.ndarray]


def c_likelihood(record: dict[str, np.ndarray], folder: Path) -> Likelihood | None:
    """Return the sum of squares in C over rows of parameters, or None without a compiler."""
    compiler = shutil.which("cc")
    if compiler is None:
        print("a C compiler is not there: skipped")
        return None
    library = folder / "rival.so"
    source = Path(__file__).with_name("rival.c")
    flags = ["-O3", "-march=native", "-shared", "-fPIC"]
    subprocess.run([compiler, *flags, str(source), "-o", str(library)], check=True)
    function = ctypes.CDLL(str(library)).sum_of_squares
    pointer = np.ctypeslib.ndpointer(dtype=np.float64, flags="C_CONTIGUOUS")
    function.argtypes = [pointer] * 4 + [ctypes.c_size_t, ctypes.c_double, pointer,
                                         ctypes.c_size_t, pointer, pointer]  # fmt: skip
    function.restype = None

    def likelihood(theta: np.ndarray) -> np.ndarray:
        columns = np.ascontiguousarray(theta.T)
        out, work = np.empty(theta.shape[0]), np.empty(7 * theta.shape[0])
        function(record["current_squared"], record["losses"], record["ambient"],
                 record["measured"], record["measured"].size, record["step"], columns,
                 theta.shape[0], work, out)  # fmt: skip
        return out

    return likelihood


@needs("numba")
def numba_reading(record: dict[str, np.ndarray]) -> Callable | None:
    """Return the reading at the samples by numba."""
    from numba import njit

    @njit(cache=False)
    def run(I2, P, T0, h, p):
        a, b, gw, gs, c = 1.0 / p[0], 1.0 / p[1], 1.0 / p[2], 1.0 / p[3], 3.0 * p[4] / 259.5
        Tw = Ts = p[5]
        out = np.empty(P.size)
        for n in range(P.size):
            k = c * I2[n]
            copper, flow = k * (234.5 + Tw), gw * (Tw - Ts)
            w1, s1 = a * (copper - flow), b * (P[n] - copper + flow - gs * (Ts - T0[n]))
            mw, ms = Tw + 0.5 * h * w1, Ts + 0.5 * h * s1
            copper, flow = k * (234.5 + mw), gw * (mw - ms)
            w2, s2 = a * (copper - flow), b * (P[n] - copper + flow - gs * (ms - T0[n]))
            ew, es = Tw + h * (2.0 * w2 - w1), Ts + h * (2.0 * s2 - s1)
            copper, flow = k * (234.5 + ew), gw * (ew - es)
            w3, s3 = a * (copper - flow), b * (P[n] - copper + flow - gs * (es - T0[n]))
            Tw += h / 6.0 * (w1 + 4.0 * w2 + w3)
            Ts += h / 6.0 * (s1 + 4.0 * s2 + s3)
            out[n] = Tw
        return out

    return lambda p: run(record["current_squared"], record["losses"], record["ambient"],
                         record["step"], np.asarray(p))  # fmt: skip


@needs("numba")
def numba_likelihood(record: dict[str, np.ndarray]) -> Likelihood | None:
    """As `c_likelihood`, compiled by numba."""
    from numba import njit

    @njit(fastmath=False, cache=False)
    def run(I2, P, T0, y, h, theta):
        num = theta.shape[0]
        a, b = 1.0 / theta[:, 0], 1.0 / theta[:, 1]
        gw, gs = 1.0 / theta[:, 2], 1.0 / theta[:, 3]
        c = 3.0 * theta[:, 4] / 259.5
        Tw, Ts = theta[:, 5].copy(), theta[:, 5].copy()
        out = np.zeros(num)
        for n in range(y.size):
            for w in range(num):
                k = c[w] * I2[n]
                copper, flow = k * (234.5 + Tw[w]), gw[w] * (Tw[w] - Ts[w])
                w1 = a[w] * (copper - flow)
                s1 = b[w] * (P[n] - copper + flow - gs[w] * (Ts[w] - T0[n]))
                mw, ms = Tw[w] + 0.5 * h * w1, Ts[w] + 0.5 * h * s1
                copper, flow = k * (234.5 + mw), gw[w] * (mw - ms)
                w2 = a[w] * (copper - flow)
                s2 = b[w] * (P[n] - copper + flow - gs[w] * (ms - T0[n]))
                ew, es = Tw[w] + h * (2.0 * w2 - w1), Ts[w] + h * (2.0 * s2 - s1)
                copper, flow = k * (234.5 + ew), gw[w] * (ew - es)
                w3 = a[w] * (copper - flow)
                s3 = b[w] * (P[n] - copper + flow - gs[w] * (es - T0[n]))
                Tw[w] += h / 6.0 * (w1 + 4.0 * w2 + w3)
                Ts[w] += h / 6.0 * (s1 + 4.0 * s2 + s3)
                r = y[n] - Tw[w]
                out[w] += r * r
        return out

    def likelihood(theta: np.ndarray) -> np.ndarray:
        return run(record["current_squared"], record["losses"], record["ambient"],
                   record["measured"], record["step"], np.ascontiguousarray(theta))  # fmt: skip

    return likelihood
