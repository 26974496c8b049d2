"""Ratings against speed: permitted currents, and what a stated load leads to.

A load is the copper loss, which follows current and temperature, and the other losses, which a
balance tells at the speeds that were run under load. Between these they are interpolated linearly:
a loss that grows with a power of the speed above 1 lies below that, so that the current errs to the
safe side. Below the lowest they are held, for they do not grow towards standstill. Above the
highest nothing tells them, and they must be given. They are held at every current: below the one
that was run at a speed that errs to the safe side, above it the current is extrapolated.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np
import pandas as pd

from lptn import Drive, time_constants
from lptn.effects import AbstractEffect

from ..errors import InputError
from ..results.model import DerivedFigure
from ..results.values import known
from .duties import NO_CLASS, NO_CURRENT, Limit, Rated, continuous, limits_of
from .figures_of_draws import DrawValues, alone, extrapolated, with_effects
from .machine import RAD_PER_S, SAME_LOAD, Machine, Tested, machines
from .ratings_figures import rates, rating
from .run import Run
from .stated_duty import Stated, parse_rating

SHORT = ("S2-60", "S2-30", "S2-10")
"""Time-limited duties, from cold: those of a map where none are asked for."""

SAME_SPEED = 0.02
"""Relative distance above the highest tested speed at which its losses still count [1]."""

MIN_BLOCKS = 3
"""Blocks of 20 s under load from which a speed counts as tested."""


@dataclass(frozen=True, kw_only=True)
class Permitted:
    """The permitted current of a duty at a speed."""

    speed_rpm: float  # Speed [rpm].
    duty: str  # `"S1"` or as in `--rating`.
    other_losses_W: float  # Losses other than copper, median [W].
    other_losses_from: str  # Where they come from, in words.
    current: DerivedFigure  # Current [A], or why there is none.


@dataclass(frozen=True, kw_only=True)
class Endured:
    """What a load whose current is stated leads to at a speed."""

    speed_rpm: float  # Speed [rpm].
    name: str  # As in `fit.json`, such as `"time_to_limit_150A_cold_s"`.
    found: DerivedFigure  # Time [s], number of starts [1] or pause [s], or why there is none.


@dataclass(frozen=True, kw_only=True)
class RatingMap:
    """Ratings of a run at several speeds."""

    network: str  # Name of the network.
    # What the winding is held at: the permitted rise, else the temperature of the class.
    limit: str
    tested_rpm: tuple[float, ...]  # Speeds that were run under load [rpm].
    rows: tuple[Permitted, ...]  # The currents.
    endured: tuple[Endured, ...] = ()  # What stated loads lead to.


def rating_map(
    run: Run,
    speeds: Mapping[float, float | None] | None = None,
    network: str | None = None,
    duties: Sequence[str] = SHORT,
) -> RatingMap:
    """Return the ratings of a run at several speeds.

    Args:
        run: The run.
        speeds: Speeds [rpm], each with its losses other than copper [W] or None for those of the
            tests; None for the speeds of the tests.
        network: Its name; the last one if None.
        duties: What is rated beside S1, as `heatrun.runs.stated_duty.parse_rating`.

    Raises:
        InputError: If the run does not know speed, limit or copper loss, or a speed has losses or
            a cooling that its tests do not tell.
        UsageError: If a duty is none.
    """
    name = run.choose(network)
    load = known(run.result.models[name].load)
    seen = None if load is None else Tested.of(load)
    by_class, by_rise = (None, None) if seen is None else limits_of(run.motor, seen.sink_degC)
    limit = by_rise or by_class
    if seen is None or seen.loaded.speed_rad is None or limit is None:
        why, remedy = (
            ("it is of an earlier version", "Calibrate again with this version.")
            if seen is None
            else (NO_CLASS.partition(":")[0], "Give [motor] insulation_class and calibrate again.")
            if limit is None
            else ("its tests do not tell the speed", "Record speed_rpm and calibrate again.")
        )
        raise InputError(f"no map of ratings: {why}.", where=str(run.path), remedy=remedy)
    draws = run.draws(name)
    base, rated_A = alone(draws), run.motor.rated_current_A
    nodes = [base.model.form.nodes]
    for text in duties:  # wrong use is said before anything is computed
        parse_rating(text, 1.0, rated_A, nodes)
    draw_values = with_effects(draws, base, seen)
    levels = list(_levels(run, seen))
    tested = np.asarray([rpm for rpm, _, _ in levels])
    watts = np.asarray([_median_other(draw_values, drive, degC) for _, drive, degC in levels])
    amperes = [float(np.sqrt(drive.current_squared)) for _, drive, _ in levels]
    asked = speeds or dict.fromkeys(np.round(tested).tolist())
    _refuse_unknown(run, (*base.model.effects, *draw_values.likely), seen, tested, asked)
    rows, endured = list[Permitted](), list[Endured]()
    for rpm, given in sorted(asked.items()):
        at = _at(seen, rpm)
        wanted = float(np.interp(rpm, tested, watts)) if given is None else given
        own = _median_other(draw_values, at, seen.loaded_winding_degC)
        # they keep their uncertainty, and their median alone is moved
        moved = replace(at, losses=at.losses + (wanted - own))
        beyond = "" if _is_near(rpm, tested) else f"tested at {_span(tested)}"
        run_A = seen.current_A if given is not None else float(np.interp(rpm, tested, amperes))
        there = replace(seen, loaded=moved, current_A=run_A)
        currents = dict[str, DerivedFigure]()
        machine, by_S1, fast_s = _at_speed(base, draw_values, there, limit, rated_A)
        for text in ("S1", *duties):
            asked_for, found = rating(machine, text, by_S1, rated_A, fast_s, nodes)
            for figure_name, entry in found.items():
                entry = extrapolated(entry, beyond)
                if isinstance(asked_for, Stated):
                    endured.append(Endured(speed_rpm=rpm, name=figure_name, found=entry))
                else:
                    currents[figure_name.removesuffix("_current_A")] = entry
        rows += [
            Permitted(
                speed_rpm=rpm, duty=duty, other_losses_W=wanted,
                other_losses_from=_from(rpm, given, tested),
                current=entry,
            )
            for duty, entry in currents.items()
        ]  # fmt: skip
    if all(known(row.current.refused) == NO_CURRENT for row in rows):
        raise InputError(f"no map of ratings: {NO_CURRENT}.", where=str(run.path))
    return RatingMap(
        network=name, limit=str(limit), tested_rpm=tuple(tested.tolist()), rows=tuple(rows),
        endured=tuple(endured),
    )  # fmt: skip


def _levels(run: Run, seen: Tested) -> Iterator[tuple[float, Drive, float]]:
    """Yield the speeds that were run under load [rpm], with means of load and winding there."""
    pairs = zip(run.tests, run.courses(), strict=True)
    rows = pd.concat([table for test, table in pairs if test.role == "calibration"])
    rpm, squared = rows["speed_rpm"].abs().to_numpy(), rows["phase_current_A"].to_numpy() ** 2
    losses, Tw = rows["losses_W"].to_numpy(), rows["measured_degC"].to_numpy()
    loaded = np.flatnonzero((squared >= 0.5 * np.nanmax(squared)) & np.isfinite(Tw))
    # courses have the loss channel as it was read, the load what its own errors leave
    losses = losses + (float(seen.loaded.losses) - np.mean(losses[loaded]))
    loaded = loaded[np.argsort(rpm[loaded], kind="stable")]
    parts = [loaded[:1]]
    for row in loaded[1:]:
        if rpm[row] > (1.0 + SAME_LOAD) * rpm[parts[-1][0]]:
            parts.append(loaded[:0])
        parts[-1] = np.append(parts[-1], row)
    enough = [part for part in parts if part.size >= MIN_BLOCKS] or [loaded]
    for part in enough:
        speed, I2, W, T = (float(np.mean(each[part])) for each in (rpm, squared, losses, Tw))
        yield speed, _at(seen, speed, W, I2), T


def _at(
    seen: Tested, rpm: float, losses: float | None = None, squared: float | None = None
) -> Drive:
    """Return the load of the tests at another speed, with other losses and current if given."""
    speed, of_load = rpm * RAD_PER_S, seen.loaded
    drive = replace(of_load, speed=jnp.asarray(speed / seen.rated_speed),
                    speed_rad=jnp.asarray(speed))  # fmt: skip
    if losses is not None:
        drive = replace(drive, losses=jnp.asarray(losses))
    return drive if squared is None else drive.scale_current(squared / of_load.current_squared)


def _machine(
    draw_values: DrawValues, drive: Drive, degC: float, limit: Limit | None = None
) -> Machine:
    end = np.nan if limit is None else limit.degC
    at = map(np.asarray, (degC, end, 1.0, end))
    return machines(draw_values.model, draw_values.values, drive, *at)


def _median_other(draw_values: DrawValues, drive: Drive, degC: float) -> float:
    return float(np.median(_machine(draw_values, drive, degC).other))


def _at_speed(
    base: DrawValues, draw_values: DrawValues, seen: Tested, limit: Limit, rated_A: float | None
) -> tuple[Rated, DerivedFigure, float]:
    """Return the machine at a speed, to be rated, its continuous current, and the fastest time
    constant of its network alone [s].
    """
    winding = seen.loaded_winding_degC
    drawn = _machine(draw_values, seen.loaded, winding, limit)
    alone, network = (
        rates(each.model, each.values, seen.loaded, np.asarray(winding))
        for each in (base, draw_values)
    )
    around = seen.surroundings(
        base.model.effects, follows_time=bool(np.any(alone.follows_time)),
        second_sink=base.model.form.second_sink, likely=draw_values.likely,
    )  # fmt: skip
    heated = f"other losses {np.median(drawn.other):.0f} W, sink {seen.sink_degC:.0f} °C{around}"
    by_S1 = continuous(drawn, drawn.limit_squared, seen, limit, f"{limit}, {heated}")
    hot_A = rated_A or seen.current_A
    rated = Rated(draw_values, drawn, time_constants(network.A), seen, limit, around, hot_A)
    return rated, by_S1, float(np.median(time_constants(alone.A)[:, 0]))


def _is_near(rpm: float, tested: np.ndarray) -> bool:
    return tested[0] / (1.0 + SAME_LOAD) <= rpm <= tested[-1] * (1.0 + SAME_LOAD)


def _span(tested: np.ndarray) -> str:
    ends = dict.fromkeys((f"{tested[0]:.0f}", f"{tested[-1]:.0f}"))
    return f"{' … '.join(ends)} rpm"


def _from(rpm: float, given: float | None, tested: np.ndarray) -> str:
    """Return where the other losses come from."""
    if given is not None:
        return "given"
    if np.min(np.abs(tested - rpm)) <= SAME_SPEED * rpm:
        return "of the tests"
    return "as at the lowest tested speed" if rpm < tested[0] else "interpolated between tests"


def _refuse_unknown(
    run: Run,
    effects: Sequence[type[AbstractEffect]],
    seen: Tested,
    tested: np.ndarray,
    asked: Mapping[float, float | None],
) -> None:
    """Refuse speeds whose losses or cooling nothing tells.

    Raises:
        InputError: With the speeds.
    """
    cooling = [kind for kind in effects if kind.card.family == "cooling"]
    follows = any("speed" in kind.card.needs for kind in cooling)
    is_apart = run.motor.sink != "ambient" or seen.loaded.fan is not None
    above = [n for n, W in asked.items() if W is None and n > (1.0 + SAME_SPEED) * tested[-1]]
    below = [n for n in asked if n < tested[0] / (1.0 + SAME_LOAD) and not (follows or is_apart)]
    for found, what, remedy in (
        (above, "how large the other losses are",
         "Give them: --speeds FILE.csv with the columns speed_rpm and other_losses_W, or add a "
         "loaded test at that speed."),
        (below, "how the machine cools",
         "Add a loaded test at a lower speed, from which its effect is found (speed_cooling), or "
         "record the flow of a fan of its own."),
    ):  # fmt: skip
        if found:
            said = ", ".join(f"{n:.0f}" for n in sorted(found))
            raise InputError(
                f"no test tells {what} at {said} rpm: under load they ran at {_span(tested)}.",
                where=str(run.path),
                remedy=remedy,
            )
