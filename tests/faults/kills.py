"""One command, struck several times, started again each time, and then left to end."""

import random
import signal
from typing import Any

from bench import Bench, Fault, Known, ended_wrongly, said_wrongly
from commands import Case
from started import EARLY, End, Strike, run_plain
from wholeness import is_moving

SIGNALS = (signal.SIGKILL, signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
MOST_STRIKES = 6
SHARE_AT_OPERATIONS = 0.5
SHARE_PLAIN = 0.15
"""Of the commands, started by the interpreter as a user does."""

PYTHON_S = 2.5
"""What the interpreter and its imports take more than a fork [s]; moments are drawn over it."""

Row = dict[str, Any]


def disturb(bench: Bench, case: Case, draw: random.Random) -> list[Row]:
    """Return a row for each signal and one for the end, each with its faults."""
    known = bench.known(case)
    bench.fresh()
    bench.clear_temporary()
    rows: list[Row] = []
    seen: list[Fault] = []
    resumes = False
    end = None
    for _ in range(draw.randint(3, MOST_STRIKES)):
        is_plain = draw.random() < SHARE_PLAIN
        strike = _strike(draw, known, is_plain=is_plain)
        end = _run(bench, case, strike, is_plain=is_plain)
        row: Row = {"kind": "kill", "signal": strike.signal.name, "phase": end.phase,
                    "start": "plain" if is_plain else "forked", "code": end.code}  # fmt: skip
        faults: list[Fault] = []
        if _is_early(strike, end):
            row["kind"] = "early"
        else:
            faults = ended_wrongly(end, strike.signal)
            faults += bench.faults_at(case, known.expected)
            if end.code == 0 or not end.was_struck:
                row["kind"] = "late"
        # what lies there since an earlier strike of this trial is counted once
        row["faults"] = [f for f in faults if f not in seen] + bench.orphans()
        seen += faults
        row["moving"] = is_moving(bench.home / case.place)
        row["temporary"] = bench.clear_temporary()
        rows.append(row)
        resumes = (bench.home / f"{case.place}.partial" / "identity").exists()
        if case.phases and end.code == 0:
            break
    assert end is not None
    if not (case.phases and end.code == 0):
        end = bench.run(case)
    rows.append(_at_the_end(bench, case, known, end, resumes=resumes))
    return rows


def _run(bench: Bench, case: Case, strike: Strike, *, is_plain: bool) -> End:
    if not is_plain:
        return bench.run(case, strike)
    env = bench.environment()
    return run_plain(bench.command_line(case), bench.home, env, case.phases, strike)


def _strike(draw: random.Random, known: Known, *, is_plain: bool) -> Strike:
    sent = draw.choice(SIGNALS)
    if not is_plain and known.num_operations and draw.random() < SHARE_AT_OPERATIONS:
        return Strike(sent, "operation", operation=draw.randint(1, known.num_operations))
    spans = dict(known.spans)
    if is_plain and "fitting" not in spans:  # no file operation is seen: one span for all
        spans = {"reading": PYTHON_S + sum(spans.values())}
    elif is_plain:
        spans["reading"] += PYTHON_S
    phase = draw.choice(list(spans))
    return Strike(sent, phase, draw.uniform(0.0, spans[phase]))


def _is_early(strike: Strike, end: End) -> bool:
    """Whether an interrupt struck while Python started, before any line of the package ran."""
    if strike.signal is not signal.SIGINT:
        return False
    in_python = "Traceback" in end.said and "heatrun" not in end.said
    return end.code == EARLY or (end.code in (-2, 1) and (in_python or not end.said))


def _at_the_end(bench: Bench, case: Case, known: Known, end: End, *, resumes: bool) -> Row:
    faults = said_wrongly(end)
    if end.code != 0:
        faults.append(("did not go on", f"exit code {end.code}: {end.said[-300:]}"))
        return {"kind": "end", "code": end.code, "faults": faults}
    is_resumed = "taking up the unfinished run" in end.said
    if resumes and not is_resumed:
        faults.append(("did not go on", f"began anew: {end.said[-300:]}"))
    faults += bench.finally_at(case, known.expected) + bench.orphans()
    return {"kind": "end", "code": 0, "resumed": is_resumed, "faults": faults}
