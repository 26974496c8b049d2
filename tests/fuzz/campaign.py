"""Coverage-guided fuzzing of everything that reads bytes, a process and a time budget for each.

    python tests/fuzz/campaign.py [--seconds 20] [--only NAME] [--results results/fuzz]

A target that raises anything but our own error, hangs for ten seconds or ends its process stops
there; its input is kept under `found` in the folder of results, to become a test.
"""

import argparse
import datetime
import json
import platform
import re
import subprocess
import sys
import tempfile
import time
from importlib.metadata import version
from pathlib import Path

HANG_S = 10
MEMORY_MB = 3000
LARGEST_INPUT = 8192


def fuzz(name: str, corpus: Path, seconds: int, seed: int, prefix: str) -> None:
    """Fuzz one target in this process until the time is up or it fails; does not return."""
    import atheris

    with atheris.instrument_imports(include=["heatrun", "tomllib", "json", "zipfile"]):
        from targets import TARGETS

    target = TARGETS[name]
    for number, content in enumerate(target.seeds):
        (corpus / f"seed_{number}").write_bytes(content)
    words = [
        sys.argv[0],
        str(corpus),
        f"-max_total_time={seconds}",
        f"-seed={seed}",
        f"-timeout={HANG_S}",
        f"-rss_limit_mb={MEMORY_MB}",
        f"-max_len={LARGEST_INPUT}",
        f"-artifact_prefix={prefix}",
        "-print_final_stats=1",
    ]
    atheris.Setup(words, target.run)
    atheris.Fuzz()


def campaign(names: list[str], seconds: int, seed: int, folder: Path) -> list[dict]:
    """Fuzz each target in a process of its own and return what came."""
    rows = []
    found = folder / "found"
    for name in names:
        began = time.monotonic()
        with tempfile.TemporaryDirectory() as corpus:
            found.mkdir(parents=True, exist_ok=True)
            prefix = f"{found}/{name.replace(' ', '_').replace('.', '_')}-"
            words = [sys.executable, __file__, "--target", name, "--corpus", corpus]
            words += ["--seconds", str(seconds), "--seed", str(seed), "--prefix", prefix]
            done = subprocess.run(words, capture_output=True, text=True, errors="replace")
            said = done.stdout + done.stderr
        counts = re.findall(r"stat::number_of_executed_units:\s*(\d+)", done.stderr)
        edges = re.findall(r"cov: (\d+)", done.stderr)
        error = re.findall(r"=== Uncaught Python exception: ===\n(.*)", said)
        rows.append(
            {
                "target": name,
                "inputs": int(counts[-1]) if counts else 0,
                "edges": int(edges[-1]) if edges else 0,
                "seconds": time.monotonic() - began,
                "fault": "" if done.returncode == 0 else (error or [done.stderr[-300:]])[0],
            }
        )
        if rows[-1]["fault"]:
            print(f"{name}: {said[-2500:]}", file=sys.stderr)
        print(json.dumps(rows[-1]), file=sys.stderr, flush=True)
    return rows


def write_table(rows: list[dict], folder: Path, seconds: int, seed: int) -> None:
    packages = ("atheris", "heatrun", "numpy", "pandas", "h5py", "pyarrow")
    versions = ", ".join(f"{name} {version(name)}" for name in packages)
    lines = [
        "# Hostile bytes",
        "",
        f"`make study-fuzz` (`python tests/fuzz/campaign.py --seconds {seconds} --seed {seed}`), "
        f"{datetime.date.today().isoformat()}, Python {platform.python_version()}, {versions}.",
        "",
        "Coverage-guided mutation of whole files. A fault is anything but our own error: another "
        f"exception, more than {HANG_S} s for one input, more than {MEMORY_MB} MB, the end of the "
        "process, or a number that is infinite or of another length than the time. For the target "
        "`statement` bytes choose a file from the grammar of the corpus of readings (forms of "
        "headers, units, numbers, rows) with what it states kept beside it: a value that differs "
        "from the statement without a question is a fault, too.",
        "",
        "| target | inputs | edges reached | seconds | fault |",
        "|---|---:|---:|---:|---|",
        *(
            f"| {row['target']} | {row['inputs']} | {row['edges']} | {row['seconds']:.0f} | "
            f"{row['fault'].replace('|', '/') or 'none'} |"
            for row in rows
        ),
        f"| all | {sum(row['inputs'] for row in rows)} | | "
        f"{sum(row['seconds'] for row in rows):.0f} | {sum(bool(row['fault']) for row in rows)} |",
    ]
    history = Path(__file__).with_name("cases.md")
    folder.mkdir(parents=True, exist_ok=True)
    text = "\n".join(lines) + "\n\n" + history.read_text(encoding="utf-8")
    (folder / "table.md").write_text(text, encoding="utf-8")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=int, default=20, help="for each target")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", action="append", default=[], metavar="NAME")
    parser.add_argument("--results", type=Path, default=Path("results") / "fuzz")
    parser.add_argument("--target", help=argparse.SUPPRESS)
    parser.add_argument("--corpus", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--prefix", default="", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.target:
        fuzz(options.target, options.corpus, options.seconds, options.seed, options.prefix)
    from targets import TARGETS

    rows = campaign(options.only or list(TARGETS), options.seconds, options.seed, options.results)
    if not options.only:
        write_table(rows, options.results, options.seconds, options.seed)
    return 1 if any(row["fault"] for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
