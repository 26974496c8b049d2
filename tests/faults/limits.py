"""Commands on full disks and under limits of memory: a sentence and exit code 1, or success."""

import random
import re
import shutil
import signal
import subprocess
from functools import cache
from pathlib import Path

from bench import Bench, Fault, said_wrongly
from commands import DISK, Case
from kills import Row
from started import End, run_plain

MEMORY_MB = (512, 1024, 1536, 2048, 3072, 4096, 8192)
"""Limits of the address space."""

DISKS = ("file size", "operation", "small disk")
"""No file beyond a size; no file made from an operation on; a tmpfs of few pages."""

FULL = re.compile(r"No space left|File too large|cannot be written|could not be read or written")
MEMORY = re.compile(r"memory", re.I)
ABORTED = (-signal.SIGABRT, -signal.SIGSEGV)
ROOM_KB = 400_000
SMALLEST = 200

SCRIPT = """
set -e
mount -t tmpfs -o size="$1"k tmpfs disk
cp -a ../base/disk/. disk/
shift
code=0; "$@" > ../stdout 2> ../said_1 || code=$?
echo $code > ../code_1
rm -rf ../kept_1 ../kept_2
cp -a disk ../kept_1
mount -o remount,size=ROOMk disk
code=0; "$@" > ../stdout_2 2> ../said_2 || code=$?
echo $code > ../code_2
cp -a disk ../kept_2
""".replace("ROOM", str(ROOM_KB))


@cache
def namespace() -> tuple[str, ...]:
    """Return the words that give a process mounts of its own; none where that is not allowed."""
    if shutil.which("unshare") is None:
        return ()
    for words in (("unshare", "-m"), ("unshare", "-Urm")):
        test = [*words, "sh", "-c", "mount -t tmpfs -o size=64k tmpfs /mnt"]
        if subprocess.run(test, capture_output=True, check=False).returncode == 0:
            return words
    return ()


def fill(bench: Bench, case: Case, way: str, draw: random.Random) -> list[Row]:
    """Run a case on a full disk, and again where there is room."""
    known = bench.known(case)
    bench.fresh()
    row: Row = {"kind": "full", "way": way}
    if way == "small disk":
        return [{**row, **_on_small_disk(bench, case, draw)}]
    if way == "operation":
        end = bench.run(case, full_from=draw.randint(1, max(1, known.num_operations)))
    else:
        size = round(SMALLEST * (known.largest / SMALLEST) ** draw.random())
        end = bench.run(case, file_limit=size)
    faults = _refused_wrongly(bench, end, FULL) + bench.faults_at(case, known.expected)
    again = bench.run(case)
    row |= {"code": end.code, "faults": faults + _again(bench, case, again, None)}
    bench.clear_temporary()
    return [row]


def _on_small_disk(bench: Bench, case: Case, draw: random.Random) -> Row:
    words = namespace()
    if not words:
        return {"kind": "skipped", "code": None, "faults": []}
    known = bench.known(case)
    taken = sum(p.stat().st_size for p in (bench.base / DISK).rglob("*") if p.is_file())
    taken += 4096 * sum(1 for _ in (bench.base / DISK).rglob("*"))
    needed = sum(p.stat().st_size for p in (bench.home / DISK).rglob("*") if p.is_file())
    more = draw.uniform(4_096, max(3 * known.largest, needed - taken, 40_000))
    size_kb = round((taken + more) / 1024)
    command = [*words, "sh", "-c", SCRIPT, "sh", str(size_kb), *bench.command_line(case)]
    whole = run_plain(command, bench.home, bench.environment(), {})
    if whole.code != 0:
        raise SystemExit(f"the small disk could not be made: {whole.said}")
    first, second = (_ended(bench.folder, number) for number in (1, 2))
    kept = bench.folder / "kept_1"
    faults = _refused_wrongly(bench, first, FULL) + bench.faults_at(case, known.expected, kept)
    faults += _again(bench, case, second, bench.folder / "kept_2")
    return {"code": first.code, "faults": faults, "size_kB": size_kb}


def _ended(folder: Path, number: int) -> End:
    said = (folder / f"said_{number}").read_text(errors="replace")
    return End(int((folder / f"code_{number}").read_text()), said, "")


def squeeze(bench: Bench, case: Case, size_mb: int) -> list[Row]:
    """Run a case with so much address space, started as a user does."""
    known = bench.known(case)
    bench.fresh()
    limit = f'ulimit -v {size_mb * 1024}; exec "$@"'
    command = ["bash", "-c", limit, "bash", *bench.command_line(case)]
    end = run_plain(command, bench.home, bench.environment(), {})
    # compiled code for which there is no room is aborted by itself; nothing half-written may stay
    faults = [] if end.code in ABORTED else _refused_wrongly(bench, end, MEMORY)
    faults += bench.faults_at(case, known.expected)
    if end.code == 0:
        faults += bench.finally_at(case, known.expected)
    row: Row = {"kind": "memory", "size_MB": size_mb, "code": end.code}
    row["faults"] = faults + bench.orphans()
    bench.clear_temporary()
    return [row]


def _refused_wrongly(bench: Bench, end: End, sentence: re.Pattern[str]) -> list[Fault]:
    # reports say in their table on stdout why one could not be made
    said = end.said + (bench.folder / "stdout").read_text(errors="replace")
    faults = said_wrongly(end)
    if end.code not in (0, 1):
        faults.append(("exit code", f"{end.code}: {end.said[-300:]}"))
    elif end.code == 1 and not sentence.search(said):
        faults.append(("no sentence", end.said[-300:]))
    return faults


def _again(bench: Bench, case: Case, end: End, disk: Path | None) -> list[Fault]:
    if end.code != 0:
        return [("did not go on", f"exit code {end.code}: {end.said[-300:]}")]
    return said_wrongly(end) + bench.finally_at(case, bench.known(case).expected, disk)
