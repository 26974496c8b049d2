"""The table of the kill campaign as `results/faults/table.md`."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import Any

from heatrun.run_folder import environment

PHASES = ("reading", "fitting", "sampling", "writing")


def write_table(tally: Any, folder: Path, kills: int, seed: int, minutes: float) -> None:
    """Write `table.md`.

    Args:
        tally: What the campaign saw.
        folder: Where the table goes.
        kills: How many signals were asked for.
        seed: Of the campaign.
        minutes: How long it took.
    """
    versions = environment()
    lines = [
        "# Calibrations killed and interrupted at random moments",
        "",
        f"`make study-faults` (`python tests/faults/campaign.py --kills {kills} --seed {seed}`), "
        f"{minutes:.0f} minutes, {datetime.date.today().isoformat()}, Python {versions['python']}, "
        + ", ".join(f"{name} {version}" for name, version in versions["packages"].items())
        + ".",
        "",
        "Record: the bundled 30-minute duty at 1 Hz, both orders. A run is disturbed up to three "
        "times, started again with the same command each time, and then left to end. The moments "
        "hang on the machine's load, so another run of the campaign hits other ones.",
        "",
        "| sampler | signal | " + " | ".join(PHASES) + " | all |",
        "|---|---|" + "---:|" * (len(PHASES) + 1),
    ]
    for method in ("quick", "emcee"):
        for sent in ("SIGKILL", "SIGINT"):
            counts = [tally.kills[method, phase, sent] for phase in PHASES]
            cells = " | ".join(str(count) for count in (*counts, sum(counts)))
            lines.append(f"| {method} | {sent} | {cells} |")
    lines += [
        "",
        f"- {sum(tally.kills.values())} signals struck a running command; "
        f"{tally.num_finished} runs were brought to an end, {tally.num_resumed} of them from the "
        "folder of a disturbed one.",
        f"- {tally.num_early} interrupts came while Python itself started, before any line of the "
        "package; they are not counted above.",
        "- Faults (a half-written run at the destination, a traceback, a wrong exit code, a "
        "posterior that differs in any bit from that of the undisturbed run, something left "
        f"behind): {len(tally.faults)}.",
    ]
    lines += [f"    - {fault}" for fault in tally.faults]
    folder.mkdir(parents=True, exist_ok=True)
    cases = Path(__file__).with_name("cases.md").read_text(encoding="utf-8")
    text = "\n".join(lines) + "\n\n" + cases
    (folder / "table.md").write_text(text, encoding="utf-8")
