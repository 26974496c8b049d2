"""What the tests have seen: the range that figures hold in, and the load they are told for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lptn import Drive
from lptn.effects import AbstractEffect

from ..bench.blocks import Blocks
from ..inference.instruments import corrected_losses

REACH = 1.2
"""A current may lie this much above the largest one tested [1] before a figure is refused."""

REACH_K = 15.0
"""A temperature may lie this far above the highest one measured [K]."""


@dataclass(frozen=True)
class Tested:
    """What the tests have seen.

    Attributes:
        current_A: Largest rms current of a block [A].
        winding_degC: Highest reading of a block [degC].
        loaded_winding_degC: Mean reading of the loaded part [degC].
        loaded: Means over the loaded part: current, loss channel, speed, coolant and fan; the
            sinks are those of all tests. Speed, coolant, fan and second sink only if every test
            has them. Effects that follow the time stand as at the start of the first test.
    """

    current_A: float
    winding_degC: float
    loaded_winding_degC: float
    loaded: Drive

    @property
    def sink_degC(self) -> float:
        """Mean temperature of the sink [degC]."""
        return float(self.loaded.ambient)

    @property
    def amperes(self) -> float:
        """Root of the mean squared current of the loaded part [A]."""
        return float(np.sqrt(self.loaded.current_squared))

    def beyond_limit(self, limit: float) -> str | None:
        """Return why a limit [degC] is outside the tested range, or None."""
        if limit <= self.winding_degC + REACH_K:
            return None
        return (
            f"the limit of {limit:.0f} °C is outside the tested range: the highest "
            f"temperature measured is {self.winding_degC:.0f} °C"
        )

    def surroundings(
        self,
        effects: Sequence[type[AbstractEffect]],
        *,
        follows_time: bool,
        second_sink: str = "",
        likely: Sequence[type[AbstractEffect]] = (),
    ) -> str:
        """Return what the figures of a model with effects hold under, to follow a condition.

        Args:
            effects: Effects in the model.
            follows_time: Whether one of them depends on the time since the start of a test.
            second_sink: Name of the network's second sink; empty where it has none.
            likely: Effects that the network is likely to miss, which the figures count.
        """
        needs = {need for kind in (*effects, *likely) for need in kind.card.needs}
        parts = []
        if second_sink and self.loaded.second_sink is not None:
            parts.append(f"{second_sink} {float(self.loaded.second_sink):.0f} °C")
        if "speed" in needs and self.loaded.speed_rad is not None:
            parts.append(f"{float(self.loaded.speed_rad) * 30.0 / np.pi:.0f} rpm")
        if "coolant" in needs and self.loaded.coolant is not None:
            parts.append(f"coolant {float(self.loaded.coolant):.0f} °C")
        if "fan" in needs and self.loaded.fan is not None:
            parts.append(f"fan or flow {100.0 * float(self.loaded.fan):.0f} % of rated")
        if follows_time:
            parts.append("as at the start of the first test")
        parts += [f"with {kind.card.id}" for kind in likely]
        return "".join(f", {part}" for part in parts)


def tested(tests: Sequence[Blocks]) -> Tested:
    """Return the range of the tests; loaded means above half of the largest squared current."""

    def means(name: str) -> np.ndarray | None:
        rows = []
        for test in tests:
            values = corrected_losses(test) if name == "losses" else getattr(test.inputs, name)
            if values is None:
                return None
            rows.append(np.asarray(values).reshape(test.weight.shape).mean(axis=1))
        return np.concatenate(rows)

    I2, losses, T0 = (np.asarray(means(n)) for n in ("current_squared", "losses", "ambient"))
    second = means("second_sink")
    Tw = np.concatenate([test.measured for test in tests])
    loaded = (0.5 * np.max(I2) <= I2) & np.isfinite(Tw)

    def of_load(name: str) -> float | None:
        values = means(name)
        return None if values is None else float(np.mean(values[loaded]))

    first = tests[0].inputs
    return Tested(
        current_A=float(np.sqrt(np.max(I2))),
        winding_degC=float(np.nanmax(Tw)),
        loaded_winding_degC=float(np.mean(Tw[loaded])),
        loaded=Drive.constant(
            current_squared=float(np.mean(I2[loaded])),
            losses=float(np.mean(losses[loaded])),
            ambient=float(np.mean(T0)),
            speed=of_load("speed"),
            coolant=of_load("coolant"),
            fan=of_load("fan"),
            second_sink=None if second is None else float(np.mean(second)),
            rated_speed=float(first.rated_speed),
            rated_current=float(first.rated_current),
        ),
    )
