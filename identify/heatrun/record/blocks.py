"""A reduced record: mean inputs on an even grid, block means to compare.

Two grids are nested. The *steps* (about 2 s) carry the simulation: over each, current squared,
losses and sink enter as means, so energy is conserved. The *blocks* (about 20 s) carry the
comparison: over each, the mean of the measured samples is set against the mean of the model at
the same sample times. Half a sample of misalignment between the two would look like a delay of
the sensor.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jaxtyping import Float

if TYPE_CHECKING:
    from lptn import Inputs

    from .balance_errors import Told
    from .observation import Observation


def length_class(num: int, *, is_seldom: bool = False) -> int:
    """Return the least of the numbers 4, 5, 6 and 7 times a power of two that is not below one.

    Compiled programs hold for one number of blocks; with these, a few serve the tests of all. What
    runs seldom takes the least power of two from 8 on: compiling takes longer than idle blocks.
    """
    if is_seldom:
        return max(8, 1 << (num - 1).bit_length())
    step = 2 ** max(0, num.bit_length() - 3)
    return -(-num // step) * step


class Logger(NamedTuple):
    """What a test's readings were recorded with: tests that agree in it share their noise."""

    sample_s: float  # Sampling period to two digits [s].
    resolution_K: float  # Resolution of the readings to two digits [K]; 0 if none is seen.
    sensor: str  # Column of the file that holds the readings; empty where it is not known.


@dataclass(frozen=True, kw_only=True)
class Readings:
    """Readings of a sensor, reduced to blocks, each a row."""

    # Mean of the readings of each block [degC], shape (row,); NaN without any.
    measured: Float[np.ndarray, " row"]
    # Share of each step in the mean of its block [1], shape (row, step per block); the same for
    # each where nothing was read.
    weight: Float[np.ndarray, "row step"]
    # Mean position of the samples within each step, 0 its start and 1 its end [1], shape (row, step
    # per block).
    position: Float[np.ndarray, "row step"]
    count: Float[np.ndarray, " row"]  # Readings per block, shape (row,).
    time: Float[np.ndarray, " row"]  # Mean time of the readings of each block [s], shape (row,).
    rounding_K: float  # Resolution of the readings [K]; 0 if none is seen.
    start_degC: float  # Mean of the first few readings, or where the first block begins [degC].
    sensor: str = ""  # Column of the file that holds the readings; empty where it is not known.

    @property
    def is_observed(self) -> np.ndarray:
        """Which rows hold a reading, shape (row,)."""
        return self.count > 0


@dataclass(frozen=True, kw_only=True)
class Body(Readings):
    """Readings of a body beside the winding, reduced to the same blocks."""

    channel: str  # Its channel, such as `"stator_degC"`.


@dataclass(frozen=True, kw_only=True)
class Blocks(Readings):
    """A record, reduced.

    With `with_bodies`, the rows of further sensors follow those of the winding: then `row` stands
    for the blocks of the winding, and then of each body in turn.
    """

    name: str  # Name of the test.
    # Means over the steps, all of one length, by the names of `lptn.Inputs`; shape (step,). What
    # was not recorded is not among them.
    means: Mapping[str, Float[np.ndarray, "..."]]
    block_s: float  # Length of a block [s].
    sample_s: float  # Median sampling period [s].
    bodies: tuple[Body, ...] = ()  # Readings of other bodies than the winding.
    fitted: tuple[str, ...] = ()  # Channels of those whose rows follow the winding's.
    first_s: float = 0.0  # Time on the record's own axis at which the grid begins [s].
    # Whether the phase current was recorded or stated; if not, it enters as 0.
    has_current: bool = True
    # Standard uncertainty of a winding temperature that no sensor reads: offset [K], and relative
    # error of the rise [1]; None for a sensor.
    sensor_sd: tuple[float, float] | None = None
    # Variance of each block's mean of the winding, from load steps at unknown moments between two
    # samples [K^2], shape (block,); None for none. What `load_columns` holds is not in it.
    load_variance: Float[np.ndarray, " block"] | None = None
    # What the largest of those steps do to the means of the winding [K], as columns whose outer
    # product is its covariance, shape (block, column); None for none.
    load_columns: Float[np.ndarray, "block column"] | None = None
    jumps_with_load: bool = False  # Whether the winding's samples jump as the current steps.
    notes: tuple[str, ...] = ()  # Sentences on what was interpolated or held.
    # Errors of its balance of powers that the inputs tell by themselves.
    told: tuple[Told, ...] = ()
    _winding: Blocks | None = None

    @cached_property
    def inputs(self) -> Inputs:
        """`means` as the numerics take them."""
        from lptn import Inputs

        return Inputs(**{name: np.asarray(each, float) for name, each in self.means.items()})

    def with_bodies(self, channels: Sequence[str]) -> Blocks:
        """Return the record with the rows of some of its bodies behind those of the winding."""
        alone = self.winding
        parts = [alone, *(alone.body(channel) for channel in channels)]
        if len(parts) == 1:
            return alone

        def joined(name: str) -> np.ndarray:
            return np.concatenate([getattr(part, name) for part in parts])

        names = ("measured", "weight", "position", "count", "time")
        rows = {name: joined(name) for name in names}
        return replace(alone, **rows, fitted=tuple(channels), _winding=alone)

    @property
    def winding(self) -> Blocks:
        """The record with the rows of the winding alone."""
        return self._winding or self

    def body(self, channel: str) -> Body:
        """Return the readings of a body.

        Raises:
            KeyError: If the record has none of that channel.
        """
        for body in self.bodies:
            if body.channel == channel:
                return body
        raise KeyError(channel)

    @property
    def num_blocks(self) -> int:
        """Number of blocks of one sensor."""
        return self.weight.shape[0] // (1 + len(self.fitted))

    def by_sensor(self, rows: Float[np.ndarray, "row ..."]) -> list[np.ndarray]:
        """Split rows into those of the winding and of each fitted body."""
        return np.split(rows, 1 + len(self.fitted))

    def lengthened(
        self, rows: Float[np.ndarray, "row ..."], *, is_seldom: bool = False
    ) -> Float[np.ndarray, "more ..."]:
        """Return rows with zeros where `Observation.padded` has more of them."""
        whole = length_class(self.num_blocks, is_seldom=is_seldom)
        return with_more(np.asarray(rows), 1 + len(self.fitted), whole, 0)

    def by_block(self, steps: Float[np.ndarray, " step"]) -> Float[np.ndarray, " block"]:
        """Return the means over the blocks of what is given over the steps; without bodies."""
        return np.asarray(steps).reshape(self.weight.shape).mean(axis=1)

    def own(self, rows: Float[Any, "more ..."], axis: int = 0) -> Float[np.ndarray, "row ..."]:
        """Return rows of `Observation.padded`, along an axis, without those that were added."""
        rows, num = np.asarray(rows), 1 + len(self.fitted)
        before, after = rows.shape[:axis], rows.shape[axis + 1 :]
        by_sensor = rows.reshape(*before, num, rows.shape[axis] // num, *after)
        cut = by_sensor[(slice(None),) * (axis + 1) + (slice(self.num_blocks),)]
        return cut.reshape(*before, self.measured.size, *after)

    @property
    def duration_s(self) -> float:
        """Length of the grid [s]."""
        return float(self.means["step"]) * self.means["losses"].size

    @property
    def loggers(self) -> tuple[Logger, ...]:
        """What the readings of the winding, and of each fitted body, were recorded with."""
        parts = [self.winding, *(self.body(channel) for channel in self.fitted)]
        return tuple(
            Logger(float(f"{self.sample_s:.2g}"), float(f"{p.rounding_K:.2g}"), p.sensor)
            for p in parts
        )

    @property
    def known_variance(self) -> Float[np.ndarray, " row"]:
        """Variance of each row's mean that is known beforehand [K^2].

        A reading rounded to a step q errs by q^2/12; what does not average out of a block, because
        the temperature moves slowly, is left to the slow part of the noise. A load step between two
        samples shows in the winding (`load_variance`), too late and too little in other bodies.
        """
        steps = [self.rounding_K, *(self.body(channel).rounding_K for channel in self.fitted)]
        rounding_K = np.repeat(steps, self.num_blocks)
        variance = rounding_K**2 / 12.0 / np.maximum(self.count, 1.0)
        if self.load_variance is not None:
            variance[: self.num_blocks] += self.load_variance
        return variance

    @property
    def moments(self) -> Float[np.ndarray, "row column"]:
        """`load_columns` of all rows [K]: no column for none, 0 for other bodies."""
        columns = np.zeros((0, 0)) if self.load_columns is None else self.load_columns
        return np.pad(columns, ((0, self.measured.size - columns.shape[0]), (0, 0)))

    def observation(
        self,
        heat: Float[np.ndarray, "row column"] | None = None,
        noise_scale: Sequence[float] | None = None,
    ) -> Observation:
        """Return the arrays that the numerics need: by default without heat, on one noise scale."""
        from .observation import Observation

        alike = [1.0] * (1 + len(self.fitted))
        return Observation(
            inputs=self.inputs,
            measured=np.nan_to_num(self.measured),
            is_observed=self.is_observed,
            weight=self.weight,
            position=self.position,
            count=np.asarray(self.count, dtype=float),
            known_variance=self.known_variance,
            block_s=np.asarray(self.block_s, dtype=float),
            heat=np.zeros((self.measured.size, 0)) if heat is None else heat,
            moments=self.moments,
            noise_scale=np.asarray(alike if noise_scale is None else noise_scale, dtype=float),
            fitted=self.fitted,
        )


def strongest(columns: Float[np.ndarray, "block column"], num: int) -> np.ndarray:
    """Return the `num` columns, or all, whose outer product is nearest to that of many.

    They are the strongest directions, orthogonal, the longest first. They come by the eigenvectors
    of the inner products: LAPACK's singular values by divide and conquer (gesdd) find no end for
    some matrices that are as good as any (seen with 360 x 200, once in some hundred records).
    """
    _, axes = np.linalg.eigh(columns.T @ columns)
    return columns @ axes[:, ::-1][:, :num]


def with_more(rows: np.ndarray, num_sensors: int, num: int, value: float | bool) -> np.ndarray:
    """Return rows with as many blocks for each sensor."""
    by_sensor = rows.reshape(num_sensors, rows.shape[0] // num_sensors, *rows.shape[1:])
    width = [(0, 0), (0, num - by_sensor.shape[1]), *[(0, 0)] * (rows.ndim - 1)]
    padded = np.pad(by_sensor, width, constant_values=value)
    return padded.reshape(num_sensors * num, *rows.shape[1:])
