"""Clock times, dates and epochs: what the header says about them decides."""

from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta, timezone

import numpy as np

from .case import Case, Truth
from .table import Layout, Sheet, sheet
from .units import FIVE

CLOCK, DATE, EPOCH = "clock format", "dates", "epochs and serial days"
SUBJECT = r"hh:mm|mm:ss|h:mm|clock|format|back|reads? as|unit|column"
SEMICOLON = Layout(delimiter=";")
MORNING = datetime(2024, 5, 17, 9, 58, 20)


def clock(form: str, start_s: float = 0.0) -> Callable[[float], str]:
    """Return a function that writes seconds as a clock, as `{h:02}:{m:02}:{s:02}`.

    Known names: d (days), h (0..23), H (all hours), g and a (12-hour clock and AM/PM), m, M (all
    minutes), s, f (milliseconds).
    """

    def write(time_s: float) -> str:
        total_ms = round((time_s + start_s) * 1000)
        seconds, f = divmod(total_ms, 1000)
        minutes, s = divmod(seconds, 60)
        H, m = divmod(minutes, 60)
        d, h = divmod(H, 24)
        return form.format(
            d=d, h=h, H=H, m=m, M=minutes, s=s, f=f, g=(h - 1) % 12 + 1, a="AM" if h < 12 else "PM",
            c=f // 10, e=f // 100,
        )  # fmt: skip

    return write


def clocked(
    number: int, header: str, form: str, *, start_s: float = 0.0, step_s: float = 1.0,
    rows: int = 300, written_s: float = 1e-4,
) -> Sheet:  # fmt: skip
    """Return a heat run whose time is a clock."""
    return sheet(
        number, rows=rows, step_s=step_s, headers={"time_s": header},
        cells={"time_s": clock(form, start_s)}, written_s=written_s,
    )  # fmt: skip


def moment(
    number: int, header: str, write: Callable[[datetime], str], *,
    start: datetime = MORNING, step_s: float = 1.0, rows: int = 300,
    channels: tuple[str, ...] = FIVE,
) -> Sheet:  # fmt: skip
    """Return a heat run whose time is written by a function of the moment."""
    return sheet(
        number, rows=rows, step_s=step_s, headers={"time_s": header}, channels=channels,
        cells={"time_s": lambda time_s: write(start + timedelta(seconds=time_s))}, written_s=1e-4,
    )  # fmt: skip


# Header, form of a cell, start [s], step [s], layout.
STATED: tuple[tuple[str, str, str, float, float, Layout | None], ...] = (
    ("hh:mm:ss", "Time", "{h:02}:{m:02}:{s:02}", 0, 1, None),
    ("hh:mm:ss, morning", "Time", "{h:02}:{m:02}:{s:02}", 29730, 2, None),
    ("hh:mm:ss, German", "Zeit", "{h:02}:{m:02}:{s:02}", 29730, 5, SEMICOLON),
    ("h:mm:ss", "Time", "{h}:{m:02}:{s:02}", 32390, 1, None),
    ("hh:mm:ss.f", "Time", "{h:02}:{m:02}:{s:02}.{e}", 0, 0.5, None),
    ("hh:mm:ss.fff", "Elapsed time", "{h:02}:{m:02}:{s:02}.{f:03}", 0, 0.25, None),
    ("hh:mm:ss,fff", "Zeit", "{h:02}:{m:02}:{s:02},{f:03}", 40000, 0.5, SEMICOLON),
    ("hh:mm:ss under its format", "Time [hh:mm:ss]", "{h:02}:{m:02}:{s:02}", 0, 1, None),
    ("h:mm:ss under its format", "Time (h:mm:ss)", "{H}:{m:02}:{s:02}", 0, 10, None),
    ("HH:MM:SS under its format", "Time HH:MM:SS", "{H:02}:{m:02}:{s:02}", 0, 2, None),
    ("hours beyond 24", "Elapsed time", "{H:02}:{m:02}:{s:02}", 85000, 10, None),
    ("hours beyond 100", "Elapsed time [hh:mm:ss]", "{H:02}:{m:02}:{s:02}", 359000, 10, None),
    ("[hh:mm]", "Time [hh:mm]", "{H:02}:{m:02}", 0, 60, None),
    ("[hh:mm], a duty of 100 min", "time [hh:mm]", "{H:02}:{m:02}", 0, 60, None),
    ("[h:mm]", "Time [h:mm]", "{H}:{m:02}", 0, 60, None),
    ("(hh:mm)", "Zeit (hh:mm)", "{H:02}:{m:02}", 0, 60, SEMICOLON),
    ("(HH:MM)", "Elapsed time (HH:MM)", "{H:02}:{m:02}", 0, 120, None),
    ("hh:mm bare", "Time hh:mm", "{H:02}:{m:02}", 0, 60, None),
    ("hh:mm in front", "[hh:mm] Time", "{H:02}:{m:02}", 0, 60, None),
    ("h:min", "time [h:min]", "{H}:{m:02}", 0, 60, None),
    ("hh:mm across midnight hour", "Time [hh:mm]", "{H:02}:{m:02}", 82000 // 60 * 60, 60, None),
    ("[mm:ss]", "Time [mm:ss]", "{M:02}:{s:02}", 0, 1, None),
    ("[m:ss]", "Time [m:ss]", "{M}:{s:02}", 0, 2, None),
    ("(mm:ss)", "time (mm:ss)", "{M:02}:{s:02}", 0, 1, None),
    ("MM:SS", "Time [MM:SS]", "{M:02}:{s:02}", 0, 1, None),
    ("min:s", "Time [min:s]", "{M:02}:{s:02}", 0, 2, None),
    ("mm:ss beyond an hour", "Time [mm:ss]", "{M:02}:{s:02}", 0, 20, None),
    ("mm:ss.f", "Time [mm:ss.f]", "{M:02}:{s:02}.{e}", 0, 0.5, None),
    ("mm:ss.fff without a format", "Elapsed time", "{M:02}:{s:02}.{f:03}", 0, 0.5, None),
    ("[d:hh:mm]", "Time [d:hh:mm]", "{d}:{h:02}:{m:02}", 0, 60, None),
    ("[d:hh:mm] over days", "Time [d:hh:mm]", "{d}:{h:02}:{m:02}", 80000 // 60 * 60, 300, None),
    ("[dd:hh:mm]", "Elapsed time [dd:hh:mm]", "{d:02}:{h:02}:{m:02}", 0, 120, None),
    ("[d:hh:mm:ss]", "Time [d:hh:mm:ss]", "{d}:{h:02}:{m:02}:{s:02}", 86000, 10, None),
    ("[ddd:hh:mm:ss]", "Time [ddd:hh:mm:ss]", "{d:03}:{h:02}:{m:02}:{s:02}", 86000, 2, None),
    ("[d hh:mm:ss]", "Time [d hh:mm:ss]", "{d} {h:02}:{m:02}:{s:02}", 86000, 5, None),
    ("[d.hh:mm:ss]", "Time [d.hh:mm:ss]", "{d}.{h:02}:{m:02}:{s:02}", 86000, 5, None),
    ("pandas, days", "time", "{d} days {h:02}:{m:02}:{s:02}", 86000, 2, None),
    ("[hh:mm:ss:ms]", "Time [hh:mm:ss:ms]", "{h:02}:{m:02}:{s:02}:{f:03}", 36000, 0.25, None),
    ("AM and PM over noon", "Time", "{g}:{m:02}:{s:02} {a}", 43000, 2, None),
    ("AM and PM, padded", "Time", "{g:02}:{m:02}:{s:02} {a}", 46700, 1, None),
    ("am and pm, first hour of the day", "Time", "{g:02}:{m:02}:{s:02} {a}", 60, 20, None),
)  # fmt: skip

OPEN: tuple[tuple[str, str, str, float, float], ...] = (
    ("a:b, truth hh:mm", "Time", "{H:02}:{m:02}", 0, 60),
    ("a:b, truth hh:mm, short", "time", "{H}:{m:02}", 0, 60),
    ("a:b, truth mm:ss", "Time", "{M:02}:{s:02}", 0, 1),
    ("a:b, truth mm:ss, t", "t", "{M}:{s:02}", 0, 2),
    ("a:b, truth hh:mm from the clock", "Zeit", "{h:02}:{m:02}", 36000, 60),
    ("a:b, truth hh:mm over midnight", "Time", "{h:02}:{m:02}", 79200, 60),
    ("a:b, timestamp", "timestamp", "{h:02}:{m:02}", 28800, 60),
    ("a:b:c, truth d:hh:mm", "Time", "{d}:{h:02}:{m:02}", 79200, 60),
    ("a:b:c, truth mm:ss:hundredths", "Time", "{M:02}:{s:02}:{c:02}", 0, 0.5),
    ("a:b:c:d, truth hh:mm:ss:ms", "Time", "{h:02}:{m:02}:{s:02}:{f:03}", 36000, 0.25),
    ("a:b:c:d, truth d:hh:mm:ss", "Time", "{d}:{h:02}:{m:02}:{s:02}", 80000, 60),
    ("over midnight without a date", "Time", "{h:02}:{m:02}:{s:02}", 86100, 2),
    ("AM and PM over midnight", "Time", "{g}:{m:02}:{s:02} {a}", 86100, 2),
    ("letters h m s", "Time", "{H}h{m:02}m{s:02}s", 0, 10),
    ("letters min s", "Time", "{M} min {s} s", 0, 1),
    ("quote marks", "Time", "{H:02}:{m:02}'{s:02}", 0, 10),
    ("hyphens", "Time", "{H:02}-{m:02}-{s:02}", 3600, 10),
    ("dots", "Time", "{h:02}.{m:02}.{s:02}", 36000, 10),
    ("hhmmss", "Time", "{h:02}{m:02}{s:02}", 36000, 10),
    ("format says hh:mm, cells have three parts", "Time [hh:mm]", "{h:02}:{m:02}:{s:02}", 0, 10),
    ("format says mm:ss, cells have three parts", "Time [mm:ss]", "{h:02}:{m:02}:{s:02}", 0, 10),
    ("unit says s, cells are clocks", "Time [s]", "{h:02}:{m:02}:{s:02}", 0, 10),
    ("unit says min, cells are mm:ss", "Time [min]", "{M:02}:{s:02}", 0, 2),
    ("unit says h, cells are hh:mm", "Time [h]", "{H:02}:{m:02}", 0, 60),
    ("format says hh:mm:ss, cells are seconds", "Time [hh:mm:ss]", "{M}", 0, 60),
)  # fmt: skip


def clocks() -> Iterator[Case]:
    """Times of day and elapsed times."""
    for number, (name, header, form, start, step, layout) in enumerate(STATED):
        made = clocked(number, header, form, start_s=start, step_s=step)
        yield made.case(CLOCK, name, Truth.READ, layout, subject=SUBJECT)
    for number, (name, header, form, start, step) in enumerate(OPEN):
        # Gentle loads alone: no jump stops the wrong reading by accident.
        gentle = number % 4 + 8 * (number // 4)
        made = clocked(gentle, header, form, start_s=start, step_s=step)
        yield made.case(CLOCK, name, Truth.ASK, subject=SUBJECT)
    made = clocked(3, "Time", "{h:02}:{m:02}:{s:02}", start_s=36000, step_s=0.5, written_s=1.0)
    made.tolerance["time_s"] = 1e-4
    yield made.case(CLOCK, "2 Hz on a clock of seconds", Truth.ASK,
                    subject="repeat|twice|same|duplicate|equal")  # fmt: skip
    made = clocked(4, "Zeit bei Prüfung", "{H:02}:{m:02}", step_s=60)
    said = {"time_s": "Zeit bei Prüfung [hh:mm]"}
    yield made.case(CLOCK, "format in [columns]", Truth.READ, columns=said)


def strftime(form: str) -> Callable[[datetime], str]:
    """Return a function that writes a moment by `strftime`."""
    return lambda when: when.strftime(form)


LATE = datetime(2024, 5, 17, 23, 55, 10)
EARLY = datetime(2024, 4, 3, 23, 55, 10)
NEW_YEAR = datetime(2024, 12, 31, 23, 55, 10)
DATES: tuple[tuple[str, str, str, datetime, Layout | None], ...] = (
    ("ISO", "timestamp", "%Y-%m-%dT%H:%M:%S", LATE, None),
    ("ISO with a space", "Timestamp", "%Y-%m-%d %H:%M:%S", LATE, None),
    ("ISO with milliseconds", "time", "%Y-%m-%dT%H:%M:%S.000", LATE, None),
    ("ISO with Z", "time", "%Y-%m-%dT%H:%M:%SZ", LATE, None),
    ("ISO with a zone", "datetime", "%Y-%m-%dT%H:%M:%S+02:00", LATE, None),
    ("ISO compact", "time", "%Y%m%dT%H%M%S", LATE, None),
    ("ISO minutes", "Date Time", "%Y-%m-%d %H:%M", LATE, None),
    ("slashes, year first", "Date/Time", "%Y/%m/%d %H:%M:%S", LATE, None),
    ("German dots", "Zeit", "%d.%m.%Y %H:%M:%S", LATE, SEMICOLON),
    ("German dots, early day", "Zeit", "%d.%m.%Y %H:%M:%S", EARLY, SEMICOLON),
    ("German dots, short year", "Zeit", "%d.%m.%y %H:%M:%S", LATE, SEMICOLON),
    ("American", "Date Time", "%m/%d/%Y %H:%M:%S", LATE, None),
    ("American with AM and PM", "Date Time", "%m/%d/%Y %I:%M:%S %p", LATE, None),
    ("American over New Year", "Time", "%m/%d/%Y %H:%M:%S", NEW_YEAR, None),
    ("British", "Date Time", "%d/%m/%Y %H:%M:%S", LATE, None),
    ("British over New Year", "Time", "%d/%m/%Y %H:%M:%S", NEW_YEAR, None),
    ("hyphens, day first", "Time", "%d-%m-%Y %H:%M:%S", LATE, None),
    ("MATLAB's datestr", "Time", "%d-%b-%Y %H:%M:%S", LATE, None),
    ("month in letters, with comma", "Time", "%b %d %Y %H:%M:%S", LATE, None),
)


def dates() -> Iterator[Case]:
    """Dates of all orders, over midnight."""
    for number, (name, header, form, start, layout) in enumerate(DATES):
        step = 60.0 if not form.endswith(("S", "p", "0", "Z")) else 2.0
        made = moment(number, header, strftime(form), start=start, step_s=step)
        yield made.case(DATE, name, Truth.READ, layout, subject=SUBJECT)
    # One file may be read both ways until the date changes; then a month would have passed.
    for number, form in enumerate(("%d/%m/%Y %H:%M:%S", "%m/%d/%Y %H:%M:%S", "%d-%m-%y %H:%M:%S")):
        made = moment(number, "Time", strftime(form), start=EARLY, step_s=2.0)
        name = f"open order over midnight, {form[:8]}"
        yield made.case(DATE, name, Truth.ASK, subject="time|date")
    for number, form in enumerate(("%d/%m/%Y %H:%M:%S", "%m/%d/%Y %H:%M:%S", "%d.%m.%Y %H:%M")):
        start = datetime(2024, 4, 3, 9, 0, 0)
        made = moment(number, "Time", strftime(form), start=start, step_s=60.0, rows=200)
        yield made.case(DATE, f"open order within a day, {form[:8]}", Truth.PLAIN)
    split = "%Y-%m-%d,%H:%M:%S"
    for name, number, header, form, start, layout in (
        ("date and time in two columns", 5, "Date,Time", split, LATE, None),
        ("Datum and Zeit in two columns", 6, "Datum;Zeit", "%d.%m.%Y;%H:%M:%S", LATE, SEMICOLON),
        ("time before date", 7, "Time,Date", "%H:%M:%S,%m/%d/%Y", LATE, None),
        ("date and time within a day", 0, "Date,Time", split, MORNING, None),
    ):
        made = moment(number, header, strftime(form), start=start, step_s=2.0)
        yield made.case(DATE, name, Truth.READ, layout, subject=SUBJECT)
    summer = timezone(timedelta(hours=2))
    shift = datetime(2024, 10, 27, 0, 55, 0, tzinfo=UTC)

    def local(when: datetime) -> datetime:
        winter = when >= datetime(2024, 10, 27, 1, 0, 0, tzinfo=UTC)
        return when.astimezone(timezone(timedelta(hours=1)) if winter else summer)

    made = moment(1, "time", lambda when: local(when).isoformat(), start=shift, step_s=2.0)
    yield made.case(DATE, "clocks put back, with zones", Truth.READ, subject=SUBJECT)
    bare = strftime("%Y-%m-%d %H:%M:%S")
    made = moment(2, "time", lambda when: bare(local(when)), start=shift, step_s=2.0)
    yield made.case(DATE, "clocks put back, without zones", Truth.ASK, subject="time|clock|back")
    made = moment(3, "time", strftime("%H:%M:%S %d.%m.%Y"), start=LATE, step_s=2.0)
    yield made.case(DATE, "time before the date in one cell", Truth.ASK, SEMICOLON, subject=SUBJECT)


def counted(
    number: int, header: str, start: float, factor: float, decimals: int, *, step_s: float = 2.0,
    rows: int = 300,
) -> Sheet:  # fmt: skip
    """Return a heat run whose time counts from an epoch: start + seconds * factor."""
    return sheet(
        number, rows=rows, step_s=step_s, headers={"time_s": header},
        cells={"time_s": lambda time_s: f"{start + time_s * factor:.{decimals}f}"},
        # Two roundings of the cell, and the last bit of a number of that size.
        written_s=(0.51 * 10.0**-decimals + 2 * np.spacing(start)) / factor,
    )  # fmt: skip


UNIX, LABVIEW, EXCEL, DATENUM = 1715940000.0, 3798784800.0, 45429.41666667, 739388.41666667


def epochs() -> Iterator[Case]:
    """Numbers that count from an epoch, in seconds, milliseconds or days."""
    day = 1 / 86400
    doubt = r"unit|factor|days|millisec|microsec|nanosec|\[(ms|us|ns|d)\]|epoch"
    for number, (name, truth, header, start, factor, decimals) in enumerate((
        ("Unix time", Truth.PLAIN, "timestamp", UNIX, 1, 0),
        ("Unix time with decimals", Truth.PLAIN, "time", UNIX, 1, 3),
        ("Unix time [s]", Truth.ASK, "Unix time [s]", UNIX, 1, 1),
        ("timestamp [ms]", Truth.READ, "timestamp [ms]", UNIX * 1e3, 1e3, 0),
        ("timestamp_ms", Truth.READ, "timestamp_ms", UNIX * 1e3, 1e3, 0),
        ("time (us)", Truth.READ, "time (us)", UNIX * 1e6, 1e6, 0),
        ("Unix time in ms, unsaid", Truth.ASK, "timestamp", UNIX * 1e3, 1e3, 0),
        ("Unix time in us, unsaid", Truth.ASK, "timestamp", UNIX * 1e6, 1e6, 0),
        ("Unix time in ns, unsaid", Truth.ASK, "time", UNIX * 1e9, 1e9, 0),
        ("LabVIEW, since 1904", Truth.PLAIN, "Time", LABVIEW, 1, 3),
        ("LabVIEW, whole seconds", Truth.PLAIN, "Timestamp", LABVIEW, 1, 0),
        ("Excel serial days, unsaid", Truth.ASK, "Time", EXCEL, day, 8),
        ("Excel serial days, timestamp", Truth.ASK, "timestamp", EXCEL, day, 10),
        ("Excel serial days [d]", Truth.READ, "Time [d]", EXCEL, day, 8),
        ("Excel serial days (days)", Truth.READ, "Time (days)", EXCEL, day, 8),
        ("Excel serial date", Truth.ASK, "Date Time (Excel)", EXCEL, day, 8),
        ("MATLAB datenum, unsaid", Truth.ASK, "time", DATENUM, day, 8),
        ("MATLAB datenum [d]", Truth.READ, "time [d]", DATENUM, day, 8),
        ("part of a day, unsaid", Truth.ASK, "Time", 0.41666667, day, 8),
        ("part of a day [d]", Truth.READ, "Time [d]", 0.41666667, day, 8),
        ("Julian day", Truth.ASK, "time", 2460447.91666667, day, 8),
    )):  # fmt: skip
        made = counted(number, header, start, factor, decimals)
        yield made.case(EPOCH, name, truth, subject=doubt)
    made = counted(3, "Zeitstempel", UNIX * 1e3, 1e3, 0)
    said = {"time_s": "Zeitstempel [ms]"}
    yield made.case(EPOCH, "unit in [columns]", Truth.READ, columns=said)
