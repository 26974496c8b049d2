"""What a reading of a file is worth, judged by the truth that the file was made of."""

import re
import tempfile
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from heatrun.checks import check_record
from heatrun.errors import InputError
from heatrun.motor.file import load_motor
from heatrun.readers.joined import read_test
from heatrun.record.motor import Motor

from .case import Case, Truth

RIGHT, ASKED, WARNED, SHOWN, REFUSED = "right", "asked", "warned", "shown", "refused"
NEEDLESS, MISREAD, TRACEBACK = "needless question", "misread", "traceback"
VERDICTS = (RIGHT, ASKED, WARNED, SHOWN, REFUSED, NEEDLESS, MISREAD, TRACEBACK)


@dataclass(frozen=True)
class Outcome:
    """What came of one file."""

    case: Case  # The file.
    verdict: str  # One of `VERDICTS`.
    said: str  # What heatrun said, or how far the reading is off.
    named: bool = True  # A question or warning named the doubt (see `Case.subject`).
    beneath: bool = False  # What a check stopped was a wrong reading of what the file states.


@cache
def motor_of(text: str) -> Motor:
    """Return the machine of a motor file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "motor.toml"
        path.write_text(text, encoding="utf-8")
        return load_motor(path)


def judge(case: Case, folder: Path, number: int = 0, *, physics: bool = True) -> Outcome:
    """Write the file, read it and compare.

    Without physics the readers stand alone: of the checks only that of missing channels is made.
    """
    path = case.write(folder, number)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            motor = motor_of(case.machine.motor_file(case.columns, resistance=case.has_resistance))
            record = read_test(f"{path}{case.at}", motor)
            findings = check_record(record, motor) if physics else record.findings
    except InputError as error:
        return asked(case, str(error))
    except Exception as error:  # whatever it is, it must not reach the user
        return Outcome(case, TRACEBACK, f"{type(error).__name__}: {error}"[:300])
    finally:
        path.unlink(missing_ok=True)
    # Cells that are called no numbers are missing, not misread; the checks then stop the record.
    halting = () if physics else ("unreadable_cells",)
    stops = [f for f in findings if f.severity == "error" or f.id in halting]
    stops = [stop for stop in stops if stop.id not in case.true_faults]
    said = " / ".join(f"({stop.id}) {stop.sentence()}" for stop in stops)
    if case.truth is Truth.REFUSE:
        return (
            asked(case, said)
            if stops
            else Outcome(case, MISREAD, f"read as {len(record.time_s)} samples")
        )
    if not physics and (missing := [name for name in case.channels if name not in record]):
        return asked(case, f"{', '.join(missing)} is missing")
    off, channel = differences(case, record.channels)
    if stops:
        return replace(asked(case, said), beneath=bool(off) and case.truth is Truth.READ)
    doubts = [
        f"({finding.id}) {finding.sentence()}"
        for finding in findings
        if finding.severity == "warning" and is_named(case, f"{finding.id} {finding.sentence()}")
    ]
    if not off and case.truth is not Truth.CONFLICT:
        return Outcome(case, RIGHT, "")
    if doubts and case.truth in (Truth.ASK, Truth.OPEN, Truth.CONFLICT):
        return Outcome(case, WARNED, doubts[0])
    sources = {reading.channel: reading.unit_from for reading in record.mapping}
    if case.truth is Truth.OPEN and sources.get(channel) == "assumed":
        return Outcome(case, SHOWN, f"{off}; its unit is shown as assumed")
    return Outcome(case, MISREAD, off or "one of two statements is taken without a word")


def asked(case: Case, said: str) -> Outcome:
    """Return the outcome of a file that was not let through."""
    named = is_named(case, said)
    verdict = {
        Truth.READ: NEEDLESS, Truth.PLAIN: NEEDLESS, Truth.REFUSE: REFUSED,
    }.get(case.truth, ASKED)  # fmt: skip
    return Outcome(case, verdict, said, named)


def is_named(case: Case, said: str) -> bool:
    """Whether words name what is in doubt."""
    return not case.subject or re.search(case.subject, said, re.IGNORECASE) is not None


def differences(case: Case, channels: Mapping[str, np.ndarray]) -> tuple[str, str]:
    """Return in words where a reading differs from the truth, and the channel; empty if nowhere."""
    if missing := [name for name in case.channels if name not in channels]:
        return f"{', '.join(missing)} is left out", missing[0]
    true = kept(case.channels)
    got = kept({name: channels[name] for name in case.channels})
    if case.held and len(got["time_s"]) > len(true["time_s"]):
        true = filled(kept(case.held), true, got)
    if len(true["time_s"]) != len(got["time_s"]):
        return f"{len(got['time_s'])} samples instead of {len(true['time_s'])}", "time_s"
    for name, values in true.items():
        mine = got[name]
        if name == "time_s":
            values, mine = values - values[0], mine - mine[0]
        # The offset of a temperature and the factor of a unit are exact; float64 is not quite.
        limit = case.tolerance.get(name, 0.0) * (2 if name == "time_s" else 1)
        limit += 1e-9 * float(np.nanmax(np.abs(values), initial=0.0)) + 1e-12
        if case.held:
            values = np.where(np.isnan(mine), values, np.where(np.isnan(values), mine, values))
        if (np.isnan(values) != np.isnan(mine)).any():
            return (
                f"{name}: {np.isnan(mine).sum()} missing instead of {np.isnan(values).sum()}",
                name,
            )
        apart = np.nan_to_num(np.abs(values - mine))
        if (apart > limit).any():
            i = int(apart.argmax())
            return f"{name}: {mine[i]:g} instead of {values[i]:g}", name
    return "", ""


def kept(channels: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the samples that hold a value beside the time: an empty row may stay or go."""
    rest = [np.isfinite(values) for name, values in channels.items() if name != "time_s"]
    held = np.any(rest, axis=0) & np.isfinite(channels["time_s"])
    return {name: values[held] for name, values in channels.items()}


def filled(
    held: Mapping[str, np.ndarray], true: Mapping[str, np.ndarray], got: Mapping[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """Return the truth with those samples of `held` that were read though they need not be."""
    shift = held["time_s"][0] - got["time_s"][0]
    extra = np.isclose(held["time_s"][:, None], got["time_s"] + shift, atol=1e-6).any(axis=1)
    needed = np.isclose(held["time_s"][:, None], true["time_s"], atol=1e-6).any(axis=1)
    return {name: values[extra | needed] for name, values in held.items()}
