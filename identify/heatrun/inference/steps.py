"""Are the steps of a test short enough for the fastest node of every draw?"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from ..bench.blocks import Blocks
from ..errors import InputError

ABSURD = 1e9
"""No reading and no error over its noise is larger [K or 1]: the march has left the numbers."""


def refuse_unstable(courses: Float[np.ndarray, "draw ..."], test: Blocks) -> None:
    """Refuse a test whose steps are too long for some of the draws.

    Args:
        courses: What the model says of the test, draw by draw.
        test: A reduced record.

    Raises:
        InputError: With their share.
    """
    of_draws = courses.reshape(courses.shape[0], -1)
    is_lost = ~np.all(np.abs(of_draws) < ABSURD, axis=1)  # NaN too
    if is_lost.any():
        raise InputError(
            f"the network has a node that is too fast for the steps of this test, "
            f"{float(np.max(np.asarray(test.inputs.step))):.3g} s, in "
            f"{100.0 * np.mean(is_lost):.2g} % of the draws.",
            where=test.name,
            remedy="A network with fewer nodes will do (--model first), or record at a shorter "
            "interval.",
        )
