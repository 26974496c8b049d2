"""Measured bodies beside the winding: which node each stands for, and what a model says of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ..bench.blocks import Blocks
from ..bench.channels.schema import body_name
from .instruments import BODY_PARTS
from .networks.form import NetworkForm

STANDS_FOR = {
    "tooth_degC": ("stator",),
    "yoke_degC": ("stator",),
    "housing_degC": ("stator",),
    "rotor_degC": ("stator",),
    "magnet_degC": ("rotor", "stator"),
}
"""Nodes that a body is held against where the network has none of its own, the first that it has:
the stator node of the second order stands for stator and rotor."""


@dataclass(frozen=True)
class BodyCourse:
    """A measured body, and what a model says of it, block by block.

    Attributes:
        channel: Its channel.
        node: The node that it is compared with.
        is_fitted: Whether its readings were fitted, with the errors of its sensor; if not, the
            node's own temperature stands here.
        measured: Mean reading of each block [degC], shape (block,); NaN where nothing was read.
        median: What the model says [degC], shape (block,).
        limits_95: The 95 % limits [degC], with noise where it is fitted.
    """

    channel: str
    node: str
    is_fitted: bool
    measured: Float[np.ndarray, " block"]
    median: Float[np.ndarray, " block"]
    limits_95: tuple[np.ndarray, np.ndarray]

    @property
    def residual(self) -> np.ndarray:
        """Measured minus median [K], shape (block,); NaN where nothing was read."""
        return self.measured - self.median

    @property
    def error(self) -> np.ndarray:
        """The residuals of the blocks that hold a reading [K]."""
        return self.residual[np.isfinite(self.measured)]

    def coverage_95(self) -> float:
        """Return the share of readings inside the 95 % limits [1]."""
        seen = np.isfinite(self.measured)
        low, high = self.limits_95
        return float(np.mean(((self.measured >= low) & (self.measured <= high))[seen]))


def told_bodies(values: Mapping[str, object], test: Blocks) -> list[str]:
    """Return the channels of a test's bodies for whose sensors there are values of parameters."""
    return [b.channel for b in test.bodies if f"{body_name(b.channel)}_{BODY_PARTS[0]}" in values]


def node_of(form: NetworkForm, channel: str) -> str | None:
    """Return the node that a body is compared with, None if the network has none for it."""
    own = form.sensed(channel)
    for node in (own, body_name(channel), *STANDS_FOR.get(channel, ())):
        if node in form.nodes:
            return node
    return None


def body_courses(
    form: NetworkForm,
    test: Blocks,
    fitted: Mapping[str, tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]],
    nodes: Mapping[str, np.ndarray],
    nodes_95: Mapping[str, tuple[np.ndarray, np.ndarray]],
) -> tuple[BodyCourse, ...]:
    """Return the bodies of a test against what a model says.

    Args:
        form: The network.
        test: A reduced record.
        fitted: Median and 95 % limits of the reading by channel, where its sensor is in the model.
        nodes: Median of each node [degC].
        nodes_95: Its 95 % limits [degC].
    """
    rows = []
    for body in test.bodies:
        node = node_of(form, body.channel)
        if node is None or node not in nodes:
            continue
        is_fitted = body.channel in fitted
        median, limits = fitted[body.channel] if is_fitted else (nodes[node], nodes_95[node])
        rows.append(BodyCourse(body.channel, node, is_fitted, body.measured, median, limits))
    return tuple(rows)
