"""Does the clock of the record run forwards, evenly and without holes?"""

import itertools
from collections.abc import Iterator

import numpy as np

from ..record.header import split_name
from ..record.motor import Motor
from ..record.record import Finding, Record
from ..record.samples import SLOW_LOGGER_S, is_measured, median_step, place, samples
from .advice import MOST_PARTS, MotorFileLine, Remedy, section_of, use_line

GAP_STEPS = 3.0
"""A distance above this many usual steps is a gap [1]: a logger that skips one sample makes two."""

MAX_GAP_S = 300.0
MAX_GAP_SHARE = 0.1
"""A single gap of `MAX_GAP_S` is three time constants of a winding, whose state after it is
unknown; a test that lacks more than `MAX_GAP_SHARE` of its duration is another test."""

MAX_DUPLICATE_SHARE = 0.01
"""Above this share of repeated stamps [1] it is not a row written twice: the stamps are coarser
than the sampling, and where inside the step a sample lies is lost."""

HARMLESS = "The block averages are hardly affected."

MAX_JITTER = 0.1
"""Relative spread of the sampling step [1] from which an average over samples is no longer an
average over time to better than about 1 % in blocks of 100 samples."""

COARSE_S = 10.0
"""A winding's time constant is about 100 s; its answer to a step needs ten samples."""

FOLLOWS = 0.8
"""Correlation with the place of the row [1] from which a column is what the rows are sorted by."""

CREEPS_S = 100.0
"""No logger of a heat run is as slow, but one of 10 Hz whose milliseconds are read as seconds
looks so."""


HOUR_S, AT_NIGHT_S = 3600.0, (3600.0, 4.0 * 3600.0)
"""What daylight saving sets a clock by, and the time of day about which it does [s]."""


def by_daylight_saving(record: Record, at_s: float, step_s: float, usual_s: float) -> bool:
    """Return whether a step of a clock, behind a time of the record, is an hour at night [s]."""
    if record.clock_s is None:
        return False
    is_hour = abs(abs(step_s - usual_s) - HOUR_S) <= GAP_STEPS * usual_s
    return is_hour and AT_NIGHT_S[0] <= (record.clock_s + at_s) % 86400.0 <= AT_NIGHT_S[1]


def _clock(record: Record) -> np.ndarray:
    time_s = np.asarray(record.time_s, dtype=float)
    return time_s[is_measured(time_s)]


def time_backwards(record: Record, motor: Motor) -> Iterator[Finding]:
    """Report stamps that lie before their predecessor; which part is right is unknown."""
    time_s = _clock(record)
    steps = np.diff(time_s)
    back = np.flatnonzero(steps < 0.0)
    if back.size == 0:
        return
    if is_sorted_otherwise(record):
        yield _sorted_otherwise(record, back.size)
        return
    first = int(back[0])
    measured = np.flatnonzero(is_measured(np.asarray(record.time_s, dtype=float)))
    row, rows = int(measured[first]) + 1, len(record.time_s)
    is_again = any(is_told_by_clock(one, record, row) for one in record.findings)
    again = " The header stands there again: the logger was started again." if is_again else ""
    is_saved = by_daylight_saving(record, time_s[first], steps[first], float(np.median(steps)))
    again += " It falls by an hour, as where daylight saving ends." if is_saved else ""
    ends = [0, *(int(measured[each]) + 1 for each in back), rows]
    above = max(record.first_row - 1, 0)  # rows of the file that do not count
    parts = tuple((above + a + 1, above + b) for a, b in itertools.pairwise(ends))
    line = MotorFileLine(section_of(record), "use_rows", parts, bool(record.part_of))
    is_by_time = record.stretch and "row" not in record.stretch
    doubt = "Check whether the clock was set, or the file holds two tests. If so, read"
    if is_saved:
        doubt = "Export the times in UTC. Else read"
    yield Finding(
        "time_backwards",
        "error",
        f"Expected increasing time; at sample {first + 1} it falls from {time_s[first]:.3f} s "
        f"to {time_s[first + 1]:.3f} s ({back.size} such steps): the order of the samples is "
        f"not known.{again}",
        place(record, "time_s", float(time_s[first])),
        Remedy(
            "Read" if is_again else doubt,
            " the parts as tests: ",
            line,
            ", in place of use." if is_by_time else ".",
        ),
        values={
            "num_steps": float(back.size),
            "sample": float(first + 1),
            "from_s": float(time_s[first]),
            "largest_s": float(-steps.min()),
        },
    )


def is_told_by_clock(finding: Finding, record: Record, row: int) -> bool:
    """Return whether a finding is that of a restart behind a row, or behind one that the record
    does not go beyond: the clock that falls there, or the cut, tells it.
    """
    if finding.id != "logger_restarted" or finding.values.get("count") != 1:
        return False
    begin, at = record.first_row, finding.values["first_sample"] or 0
    is_cut = begin > 0 and not begin <= at < begin + len(record.time_s) - 1
    return is_cut or at == max(begin - 1, 0) + row


def is_sorted_otherwise(record: Record) -> bool:
    """Return whether the rows stand in another order than that of time.

    Time then falls often, or the rows sorted by time are one even record: neither a clock that was
    set nor two tests in a file leave that.
    """
    time_s = _clock(record)
    num_falls = int(np.sum(np.diff(time_s) < 0.0))
    steps = np.diff(np.sort(time_s))
    usual = float(np.median(steps)) if num_falls else 0.0
    is_even = usual > 0.0 and bool((np.abs(steps - usual) < MAX_JITTER * usual).all())
    falls = np.flatnonzero(np.diff(time_s) < 0.0)
    is_set = num_falls == 1 and by_daylight_saving(
        record, float(time_s[falls[0]]), float(np.diff(time_s)[falls[0]]), usual
    )
    return num_falls > MOST_PARTS or (is_even and not is_set)


def _sorted_otherwise(record: Record, num_steps: int) -> Finding:
    place_of_row = np.arange(len(record.time_s))
    follows = {}
    for name, values in record.channels.items():
        known = is_measured(np.asarray(values, dtype=float))
        if name != "time_s" and known.sum() > 2 and np.ptp(values[known]) > 0.0:
            steps = np.diff(values[known])
            is_sorted = (steps >= 0.0).all() or (steps <= 0.0).all()
            likeness = abs(np.corrcoef(place_of_row[known], values[known])[0, 1])
            follows[name] = 1.0 if is_sorted else likeness
    by = max(follows, key=lambda name: follows[name], default="")
    column = f", column '{name}'" if (name := record.column_of(by)) else ""
    if num_steps == place_of_row.size - 1:
        order = "the last sample stands first"
    elif by and follows[by] > FOLLOWS:
        order = f"they follow {by}{column}, as in a map of operating points"
    else:
        order = "they stand in another order, as in a map of operating points"
    return Finding(
        "time_backwards",
        "error",
        f"Expected rows in the order of time; time falls {num_steps} times in {place_of_row.size} "
        f"rows: {order}.",
        place(record, "time_s", float(_clock(record)[0])),
        "Sort the rows by time, or take the logger's own file.",
        values={"num_steps": float(num_steps)},
    )


def time_duplicate(record: Record, motor: Motor) -> Iterator[Finding]:
    """Report stamps equal to their predecessor.

    A few are a warning: rows written twice, which a block average takes in without harm. Many are
    an error: the stamps are coarser than the sampling, so the time axis is not the one of the data.
    """
    time_s = _clock(record)
    same = np.flatnonzero(np.diff(time_s) == 0.0)
    if same.size == 0:
        return
    share = same.size / time_s.size
    is_coarse = share > MAX_DUPLICATE_SHARE
    yield Finding(
        "time_duplicate",
        "error" if is_coarse else "warning",
        f"Expected increasing time; {same.size} samples ({100.0 * share:.1f} %) repeat the "
        f"time stamp before them, the first is sample {int(same[0]) + 1}. "
        f"{'The time stamps are coarser than the sampling.' if is_coarse else HARMLESS}",
        place(record, "time_s", float(time_s[same[0]])),
        "Export the time with more decimals." if is_coarse else "Check for rows written twice.",
        values={"num_samples": float(same.size), "share": share, "from_s": float(time_s[same[0]])},
    )


def time_gap(record: Record, motor: Motor) -> Iterator[Finding]:
    """Report holes in the time axis: a warning, and an error if they hide what the winding did.

    Of one that is bridged (`heatrun.readers.joined`) its own finding speaks.
    """
    time_s = samples(record)[0]
    steps = np.diff(time_s)
    usual = median_step(time_s)
    gaps = np.flatnonzero(steps > GAP_STEPS * usual)
    bridged = [(time_s[k], time_s[k + 1]) in record.masks for k in gaps]
    gaps = gaps[~np.asarray(bridged, dtype=bool)]
    if gaps.size == 0:
        return
    longest = int(gaps[np.argmax(steps[gaps])])
    missing_s = float(np.sum(steps[gaps] - usual))
    share = missing_s / float(time_s[-1] - time_s[0])
    is_error = steps[longest] > MAX_GAP_S or share > MAX_GAP_SHARE
    ends = [float(time_s[k]) for k in (0, longest, longest + 1, -1)]
    parts = (ends[0], ends[1]), (ends[2], ends[3])
    is_saved = by_daylight_saving(record, ends[1], float(steps[longest]), usual)
    saved = " It is an hour, as where daylight saving begins." if is_saved else ""
    split = "If it is, export the times in UTC. Else split" if is_saved else "Split"
    yield Finding(
        "time_gap",
        "error" if is_error else "warning",
        f"Expected a sample every {usual:.3g} s; in {gaps.size} gaps {missing_s:.1f} s are "
        f"missing ({100.0 * share:.1f} % of the test), the longest "
        f"gap is {steps[longest]:.1f} s. "
        f"The load in a gap is not known, and is interpolated.{saved}",
        place(record, "time_s", float(time_s[longest]), float(time_s[longest + 1])),
        Remedy(f"{split} the test at the gap: ", use_line(record, *parts), ".")
        if is_error
        else "Check the logger and its storage.",
        values={
            "num_gaps": float(gaps.size),
            "missing_s": missing_s,
            "longest_s": float(steps[longest]),
            "from_s": float(time_s[longest]),
            "to_s": float(time_s[longest + 1]),
        },
    )


def time_jitter(record: Record, motor: Motor) -> Iterator[Finding]:
    """Note an uneven sampling step, gaps left aside."""
    time_s = samples(record)[0]
    steps = np.diff(time_s)
    usual = median_step(time_s)
    steps = steps[steps <= GAP_STEPS * usual]
    if steps.size < 2:
        return
    spread = float(np.std(steps) / usual)
    if not spread > MAX_JITTER:
        return
    yield Finding(
        "time_jitter",
        "note",
        f"Expected an even sampling interval; it varies by {100.0 * spread:.0f} % (standard "
        f"deviation) about {usual:.3g} s. The fit uses the time stamps as they are.",
        place(record, "time_s", float(time_s[0]), float(time_s[-1])),
        values={"relative_spread": spread, "step_s": usual},
    )


def _suspected_unit(record: Record, step_s: float) -> str:
    """Name milliseconds or microseconds where nothing states the unit of a time that creeps."""
    column = record.read_of("time_s")
    if column is None or column.unit_from == "stated" or step_s < CREEPS_S:
        return ""
    unit = "ms" if step_s < 1e3 * CREEPS_S else "us"
    return (
        f" Nothing states the unit of the time, read as {column.unit}: if it is in {unit}, write "
        f'time_s = "{split_name(column.column)[0]} [{unit}]" into [columns].'
    )


def sampling(record: Record, motor: Motor) -> Iterator[Finding]:
    """Note how the record is sampled; warn if too coarse to see the winding answer a step."""
    time_s = samples(record)[0]
    if time_s.size < 2:
        return
    usual = median_step(time_s)
    duration_s = float(time_s[-1] - time_s[0])
    is_coarse = usual > COARSE_S
    message = f"{time_s.size} samples at {usual:.3g} s over {duration_s / 60.0:.1f} min."
    if is_coarse:
        message += f" Expected at most {COARSE_S:.0f} s: Ceq_w shows in the first minute after a "
        message += "step."
    if usual >= SLOW_LOGGER_S:
        message += f" The instant of a load step is known to ±{usual / 2.0:.3g} s only; the fit "
        message += "estimates it as load_timing."
    yield Finding(
        "sampling",
        "warning" if is_coarse else "note",
        message + (_suspected_unit(record, usual) if is_coarse else ""),
        place(record, "time_s", float(time_s[0]), float(time_s[-1])),
        "Export at the logger's full sampling rate." if is_coarse else "",
        values={"num_samples": float(time_s.size), "step_s": usual, "duration_s": duration_s},
    )
