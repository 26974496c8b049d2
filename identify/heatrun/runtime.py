"""Settings of JAX that must stand before its first use; imported first by `heatrun`.

The first option is internal to XLA:CPU and makes it compile a small loop body as one function
instead of dispatching operation by operation (10x on the gradient of a 45,000-step scan). An
unknown option name aborts the process, so it is set only for versions of jaxlib that are known
to take it, and never over an XLA_FLAGS of the user's.
"""

import atexit
import gc
import os
import sys
from importlib.metadata import version

KNOWN_JAXLIB = ((0, 10), (0, 12))
"""Versions (major, minor) of jaxlib, first and last, with which `OPTIONS` were seen to work."""

QUICKER_TO_COMPILE = "--xla_cpu_use_fusion_emitters=false --xla_cpu_parallel_codegen_split_count=4"
"""Compile in two thirds of the time and run as fast, but for least squares, which take a fifth
longer: nearly all of the time of a first `calibrate` is compiling."""

SEEN_QUICKER = ((0, 10), (0, 10))
"""Versions of jaxlib, first and last, with which these were seen to work."""

OPTIONS = (
    "--xla_backend_extra_options=xla_cpu_small_while_loop_byte_threshold=100000000 "
    "--xla_cpu_prefer_vector_width=512"
)
"""The first makes small loops compile whole; the second fills the vector registers: another third
on the likelihood of 64 parameter sets, nothing on processors that have no wide ones."""


def configure() -> None:
    """Set float64 and, where it is known to be safe, the XLA options."""
    os.environ.setdefault("JAX_ENABLE_X64", "1")
    # `io.programs` keeps programs whole, and no second time what the compiler made of them
    os.environ.setdefault("JAX_ENABLE_COMPILATION_CACHE", "false")
    # XLA warns of each program that it takes from the cache: it was compiled to "prefer no gather",
    # which no processor lists among its features
    os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "3")
    if "jax" in sys.modules:  # too late for the environment, not for the settings
        config = sys.modules["jax"].config
        config.update("jax_enable_x64", True)
        if os.environ["JAX_ENABLE_COMPILATION_CACHE"] == "false":
            config.update("jax_enable_compilation_cache", False)
    major_minor = tuple(int(part) for part in version("jaxlib").split(".")[:2])
    if KNOWN_JAXLIB[0] <= major_minor <= KNOWN_JAXLIB[1]:
        is_seen = SEEN_QUICKER[0] <= major_minor <= SEEN_QUICKER[1]
        options = f"{OPTIONS} {QUICKER_TO_COMPILE}" if is_seen else OPTIONS
        os.environ.setdefault("XLA_FLAGS", options)


def one_thread_for_small_matrices() -> None:
    """Keep the linear algebra of NumPy and SciPy on one thread; for commands, before NumPy is used.

    Its matrices are small here, such as the three parameters of the noise in SciPy's L-BFGS-B:
    on two threads a step spends most of its time waiting for the other one. JAX has threads of
    its own. Nothing changes where the user has set OPENBLAS_NUM_THREADS.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def collect_garbage_seldom() -> None:
    """Let Python look for cycles less often; for commands.

    A full collection visits the million objects of JAX, pandas and matplotlib, and a calibration
    met 30 of them: a second of ten. What is large here is freed without it.
    """
    gc.set_threshold(50_000, 20, 50)


def leave_garbage_at_the_end() -> None:
    """Let a process that ends with its command not look for cycles then: half a second more."""
    atexit.register(gc.freeze)


M_ARENA_MAX = -8
"""Option of glibc's `mallopt`: how many heaps threads share at the most."""


def share_one_heap() -> None:
    """Have all threads take memory from one heap; for commands.

    By default the C library gives each thread a heap of its own, and what one of them has freed is
    none for another: a million samples took 170 MB more. The threads here compute long between two
    arrays. Other C libraries than glibc are left as they are.
    """
    import ctypes  # no part of `import heatrun`

    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if mallopt is not None:
        mallopt(M_ARENA_MAX, 1)


configure()
