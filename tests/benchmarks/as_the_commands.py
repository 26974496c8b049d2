"""Set up the process as the commands do; to be imported before anything that uses NumPy."""

from heatrun.runtime import one_thread_for_small_matrices

one_thread_for_small_matrices()
