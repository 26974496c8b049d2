"""The table of the campaign: signals by command and phase, faults with the limit of their rate."""

import datetime
from collections import Counter
from collections.abc import Sequence
from pathlib import Path, PurePath

from commands import CASES, PAGE
from tally import Row, Tally, num_kills, upper_limit

from heatrun.runs.run_folder import environment

SIGNALS = ("SIGKILL", "SIGINT", "SIGTERM", "SIGHUP", "cancelled")
PHASES = ("reading", "fitting", "sampling", "writing", "operation", "idle")
ORDER = (*dict.fromkeys(case.command for case in (*CASES, *PAGE)), "view")
MOST_LEAVES = 8
MOST_SHOWN = 3
"""Examples of a kind of fault."""

HEAD = """# Commands killed, on full disks and short of memory

`make study-faults` (`python tests/faults/campaign.py`), tally of {num} trials in `kills.jsonl`, \
{date}, Python {python}, {packages}; digest of the packages {product}.

Each trial takes a command on a short record (30 minutes at 0.1 Hz), strikes it three to six \
times (the page's jobs two to four times), starts it again each time and lets it end. Half of the \
moments are drawn over the phases of the command (as long as each took undisturbed), half are \
the instant before a drawn file operation below the destination. {forked} commands were forked \
from a process that had imported the packages but had not started JAX (helper threads of pyarrow \
stood idle in it), {plain} started by the interpreter as a user does, {page} by `heatrun view`, \
whose queue was told the words that its buttons send; a browser is not part of it.
"""


def write_table(tally: Tally, path: Path) -> int:
    """Write the table and return the number of faults."""
    rows = tally.rows()
    versions = environment()
    starts = Counter(row["start"] for row in rows if row["kind"] == "kill")
    packages = ", ".join(f"{name} {version}" for name, version in versions["packages"].items())
    lines = [
        HEAD.format(
            num=len(rows), date=datetime.date.today().isoformat(), python=versions["python"],
            packages=packages, product=tally.product, forked=starts["forked"],
            plain=starts["plain"], page=starts["page"],
        ),
        *_kills([row for row in rows if row["kind"] == "kill"]),
        *_summary(rows),
        *_learnt(rows),
        *_limits(rows),
        *_faults(rows),
    ]  # fmt: skip
    if others := tally.others():
        said = ", ".join(f"{num} of {product}" for product, num in others.items())
        lines += ["", f"Trials of other versions of the packages, not counted here: {said}."]
    cases = Path(__file__).with_name("cases.md").read_text(encoding="utf-8")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n\n" + cases, encoding="utf-8")
    return sum(len(row["faults"]) for row in rows)


def _kills(rows: Sequence[Row]) -> list[str]:
    counts = Counter((row["command"], row["signal"], row["phase"]) for row in rows)
    lines = [
        "| command | signal | " + " | ".join(PHASES) + " | all |",
        "|---|---|" + "---:|" * (len(PHASES) + 1),
    ]
    for command in ORDER:
        for sent in SIGNALS:
            cells = [counts[command, sent, phase] for phase in PHASES]
            if any(cells):
                lines.append(f"| {command} | {sent} | {_cells([*cells, sum(cells)])} |")
    totals = [sum(row["phase"] == phase for row in rows) for phase in PHASES]
    return [*lines, f"| **all** | | {_cells([*totals, sum(totals)])} |", ""]


def _cells(values: Sequence[int]) -> str:
    return " | ".join(str(value) if value else "" for value in values)


def _summary(rows: Sequence[Row]) -> list[str]:
    ends = [row for row in rows if row["kind"] == "end"]
    struck = [row for row in rows if row["kind"] == "kill"]
    kinds = Counter(row["kind"] for row in rows)
    of_kills = [row for row in rows if row["kind"] in ("kill", "early", "late", "end")]
    took, used = (sum(row[key] for row in of_kills) / max(1, num_kills(rows))
                  for key in ("seconds", "cpu_s"))  # fmt: skip
    resumed = sum(bool(row.get("resumed")) for row in ends)
    moving = sum(bool(row.get("moving")) for row in rows)
    pieces = sum(bool(row.get("temporary")) for row in struck)
    return [
        f"- {num_kills(rows)} signals struck a running command; {len(ends)} commands were then "
        f"brought to their end, {resumed} of them from the folder of a disturbed one. "
        f"{took:.1f} s of one worker and {used:.1f} s of processor time for each signal.",
        f"- {kinds['late']} signals came after the work or changed nothing, {kinds['early']} "
        "interrupts before the first line of the package ran; neither is counted above.",
        f"- After {moving} of the signals a complete set of files lay ready, and not all of them "
        "were at their places; the next start in the folder ended that.",
        f"- After {pieces} of the signals a piece lay in the system's folder for temporary files, "
        "which is for the system to clear; not a fault here.",
        "",
    ]


def _learnt(rows: Sequence[Row]) -> list[str]:
    """Return which files two undisturbed commands wrote with other bytes, and in what."""
    learnt = [row for row in rows if row["kind"] == "learnt"]
    same = {(row["case"], name) for row in learnt for name in row["same"]}
    varying: dict[str, set[str]] = {}
    for row in learnt:
        for name, leaves in row["varying"].items():
            varying.setdefault(PurePath(name).name, set()).update(leaves or ["bytes alone"])
            same.discard((row["case"], name))
    lines = [
        f"- Results are compared with those of two undisturbed commands: {len(same)} files byte by "
        "byte. "
        + ("The others differed between these two, and are compared in all but this:"
           if varying else "There are no others.")
    ]  # fmt: skip
    for name, leaves in sorted(varying.items()):
        shown = ", ".join(f"`{leaf}`" for leaf in sorted(leaves)[:MOST_LEAVES])
        more = f" and {len(leaves) - MOST_LEAVES} more" if len(leaves) > MOST_LEAVES else ""
        lines.append(f"    - {name}: {shown}{more}")
    return [*lines, ""]


def _limits(rows: Sequence[Row]) -> list[str]:
    disks = [row for row in rows if row["kind"] == "full"]
    skipped = sum(row["kind"] == "skipped" for row in rows)
    lines = ["| full disk | commands | refused with a sentence | succeeded | faults |",
             "|---|---:|---:|---:|---:|"]  # fmt: skip
    for way in sorted({row["way"] for row in disks}):
        lines.append(f"| {way} | {_outcomes([r for r in disks if r['way'] == way])} |")
    if skipped:
        lines.append(f"\n{skipped} trials on a small disk skipped: no disk can be mounted here.")
    memory = [row for row in rows if row["kind"] == "memory"]
    lines += ["", "| address space [MB] | commands | refused with a sentence | succeeded "
              "| faults |",
              "|---:|---:|---:|---:|---:|"]  # fmt: skip
    for size in sorted({row["size_MB"] for row in memory}):
        lines.append(f"| {size} | {_outcomes([r for r in memory if r['size_MB'] == size])} |")
    return [*lines, ""]


def _outcomes(rows: Sequence[Row]) -> str:
    good = [row for row in rows if not row["faults"]]
    refused = sum(row["code"] == 1 for row in good)
    return f"{len(rows)} | {refused} | {len(good) - refused} | {len(rows) - len(good)}"


def _faults(rows: Sequence[Row]) -> list[str]:
    """Return the faults by kind of trial, with the upper limit of their rate."""
    num = {
        "kill": num_kills(rows),
        "end": sum(row["kind"] == "end" for row in rows),
        "full": sum(row["kind"] == "full" for row in rows),
        "memory": sum(row["kind"] == "memory" for row in rows),
    }
    names = {"kill": "signals", "end": "commands brought to their end", "full": "full disks",
             "memory": "limits of memory"}  # fmt: skip
    counts: dict[str, Counter[str]] = {kind: Counter() for kind in num}
    examples: dict[tuple[str, str], list[str]] = {}
    where: Counter[tuple[str, str, str]] = Counter()
    for row in rows:
        kind = row["kind"] if row["kind"] in num else "kill"
        for fault in {fault for fault, _ in row["faults"]}:
            counts[kind][fault] += 1
            where[kind, fault, row["case"]] += 1
        for fault, detail in row["faults"]:
            examples.setdefault((kind, fault), []).append(f"{row['case']}: {detail}")
    lines = ["| trials | with a fault | of | rate, upper 95 % limit |", "|---|---:|---:|---:|"]
    for kind, all_ in num.items():
        same = (kind, "late", "early") if kind == "kill" else (kind,)
        bad = sum(bool(row["faults"]) for row in rows if row["kind"] in same)
        rate = f"{100 * upper_limit(bad, all_):.2g} %" if all_ else "–"
        lines.append(f"| {names[kind]} | {bad} | {all_} | {rate} |")
    for kind, found in counts.items():
        for fault, count in found.most_common():
            cases = ", ".join(f"{case} {n}" for (k, f, case), n in where.most_common()
                              if (k, f) == (kind, fault))  # fmt: skip
            lines += ["", f"**{fault}** ({names[kind]}): {count} ({cases})", ""]
            shown = list(dict.fromkeys(examples[kind, fault]))[:MOST_SHOWN]
            lines += [f"- `{' '.join(text.split())[-240:].replace('`', '')}`" for text in shown]
    return lines
