"""Licences of every package of the lock file, from the metadata of what is installed.

What no installed package states stands in `by_hand.toml`, read from the packages' own files, each
entry bound to the lock file by the digest of the file that it was read from. Vulnerabilities are
asked of `pip-audit` where it is installed and its data can be had; this file never reaches the
network itself.

    python tests/audit/licences.py [--pip-audit PROGRAM] [--results results/audit]
"""

import argparse
import json
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections import Counter
from collections.abc import Mapping, Sequence
from importlib.metadata import Distribution, PackageNotFoundError, distribution, requires
from itertools import chain
from pathlib import Path

ROOT = Path(__file__).parents[2]
LOCK = ROOT / "requirements.lock"
PIN = re.compile(r"^([A-Za-z0-9._-]+)==([^\s;\\]+)", re.M)
STRONG = re.compile(
    r"\b(?<!L)(A?GPL|GNU (AFFERO )?GENERAL PUBLIC)|SSPL|BUSL|CC-BY-NC|PROPRIETARY", re.I
)
WEAK = re.compile(r"\bLGPL|LESSER GENERAL PUBLIC|\bMPL|MOZILLA PUBLIC|\bEPL|\bCDDL", re.I)
EXCEPTION = re.compile(r"GCC-exception|with.{0,40}exception", re.I)
"""Run-time libraries of the compiler inside wheels: the exception lets any program use them."""

BY_HAND = Path(__file__).with_name("by_hand.toml")
FLOORS = {"bokeh": ("3.8.2", "CVE-2026-21883")}
"""Lowest version of a package that may be used, and why."""

SERVICES = {"pypi": "the package index", "osv": "the OSV database"}
"""What `pip-audit` can ask."""


def read_by_hand(lock: str) -> dict[tuple[str, str], str]:
    """Return the licences that were read from files of packages, by name and version.

    Args:
        lock: Text of the lock file; an entry whose file it does not list any more counts no
            longer.
    """
    entries = tomllib.loads(BY_HAND.read_text(encoding="utf-8"))["package"]
    return {
        (entry["name"], entry["version"]): f"{entry['licence']} ({entry['evidence']})"
        for entry in entries
        if f"sha256:{entry['sha256']}" in lock
    }


def licence_of(name: str, version: str, by_hand: Mapping[tuple[str, str], str]) -> str:
    """Return the licence that a package's metadata state, or why there is none."""
    if (name, version) in by_hand:
        return by_hand[name, version]
    try:
        installed = distribution(name)
    except PackageNotFoundError:
        return "not installed here"
    stated = _stated(installed)
    is_other = installed.version != version and stated != "not stated"
    return f"{stated} (as version {installed.version} states)" if is_other else stated


def _stated(installed: Distribution) -> str:
    found = installed.metadata
    if "License-Expression" in found:
        return found["License-Expression"]
    classes = [
        line.split("::")[-1].strip()
        for line in found.get_all("Classifier", [])
        if line.startswith("License ::") and line.count("::") > 1
    ]
    text = found.get_all("License", [""])[0].strip().splitlines()
    return " / ".join(classes) or (text[0][:80] if text else "not stated")


def verdict(licence: str) -> str:
    """Return how a licence goes with Apache-2.0 for a package that is imported, not copied."""
    bare = EXCEPTION.sub("", licence)
    alternatives = re.split(r"\bOR\b", bare)
    if all(STRONG.search(part) for part in alternatives):
        return "compiler's run-time exception" if bare != licence else "INCOMPATIBLE"
    if all(STRONG.search(part) or WEAK.search(part) for part in alternatives):
        return "weak copyleft: import only, never copy"
    if licence in ("not stated", "not installed here"):
        return "look by hand"
    return "fits"


def users_of() -> dict[str, str]:
    """Return for each direct requirement whether it is core or which extra asks for it."""
    users = {}
    for line in requires("heatrun") or []:
        name = re.match(r"[A-Za-z0-9._-]+", line)
        extra = re.search(r"extra == ['\"]([^'\"]+)", line)
        if name:
            users[name.group().lower().replace("_", "-")] = extra.group(1) if extra else "core"
    return users


def vulnerabilities(program: str | None) -> list[str]:
    """Return what pip-audit says of the lock file, by service, or why it was not asked.

    Args:
        program: `pip-audit`; None if there is none.
    """
    if program is None:
        return ["pip-audit is not installed: known vulnerabilities were not asked for."]
    return [
        f"pip-audit for the lock file, of {title}: {_answer(program, service)}"
        for service, title in SERVICES.items()
    ]


def _answer(program: str, service: str) -> str:
    """Ask one service about all packages that the lock file names for this Python."""
    with tempfile.TemporaryDirectory() as name:
        out = Path(name) / "answer.json"
        words = [program, "-r", str(LOCK), "--require-hashes", "--disable-pip", "-s", service]
        words += ["--format", "json", "--output", str(out), "--progress-spinner", "off"]
        try:
            done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=600)
        except subprocess.TimeoutExpired:
            return "no answer within 10 minutes."
        try:
            packages = json.loads(out.read_text())["dependencies"]
        except (OSError, ValueError, KeyError):
            said = done.stderr.strip().splitlines() or [""]
            kind = re.split(r"[:(]", said[-1])[0].rpartition(".")[2]
            reason = ": its name is not known here" if "NameResolution" in said[-1] else ""
            return f"not to be reached ({kind}{reason}); nothing is known from there."
    answered = [package for package in packages if "skip_reason" not in package]
    reasons = Counter(
        re.sub(r":.*", "", package["skip_reason"])
        for package in packages
        if package not in answered
    )
    known = [
        f"{package['name']} {package['version']}: "
        + ", ".join(each["id"] for each in package["vulns"])
        for package in answered
        if package["vulns"]
    ]
    text = f"data for {len(answered)} of {len(packages)} packages"
    if reasons:
        text += "; for the others " + ", ".join(
            f"{n} x '{reason}'" for reason, n in reasons.items()
        )
    if not answered:
        return f"{text}; its data cannot be had here."
    return f"{text}; known vulnerabilities: {'; '.join(known) or 'none among those'}."


def floors(pins: Sequence[tuple[str, str]]) -> list[tuple[bool, str]]:
    """Return for each floor whether lock file and requirements keep it, in words too."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = [*project["dependencies"], *chain(*project["optional-dependencies"].values())]
    result = []
    for name, (lowest, why) in FLOORS.items():
        locked = [version for pin, version in pins if pin == name]
        bounds = [m[1] for line in wanted if (m := re.match(rf"{name}\s*>=\s*([\d.]+)", line))]
        is_kept = bool(bounds) and all(_parts(v) >= _parts(lowest) for v in (*locked, *bounds))
        text = f"{name} >= {lowest} ({why}): locked {' and '.join(locked)}, required {bounds}"
        result.append((is_kept, text.replace("['", ">= ").replace("']", "")))
    return result


def _parts(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in version.split("."))


def main() -> int:
    """Write the table; exit code 1 if a licence does not fit or a floor is not kept."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--results", type=Path, default=ROOT / "results" / "audit")
    parser.add_argument("--pip-audit", default=shutil.which("pip-audit"), help="the program")
    options = parser.parse_args()
    lock = LOCK.read_text(encoding="utf-8")
    pins = sorted(set(PIN.findall(lock)), key=lambda pin: (pin[0].lower(), pin[1]))
    users, by_hand = users_of(), read_by_hand(lock)
    rows = []
    for name, version in pins:
        licence = licence_of(name, version, by_hand)
        rows.append((name, version, users.get(name.lower(), ""), licence, verdict(licence)))
    counts = Counter(row[-1] for row in rows)
    kept = floors(pins)
    lines = [
        "# Packages of the lock file",
        "",
        "`make audit` (`python tests/audit/licences.py`). Licences as the installed packages' "
        "metadata state them, or where that is said, their files (`tests/audit/by_hand.toml`); "
        "heatrun is Apache-2.0 and imports these packages, it copies none.",
        "",
        *(f"- {count} {word}" for word, count in counts.most_common()),
        "",
        *(f"- {text}" for text in vulnerabilities(options.pip_audit)),
        *(f"- {'floor kept' if is_kept else 'BELOW THE FLOOR'}: {text}" for is_kept, text in kept),
        "",
        "| package | version | asked for by | licence | |",
        "|---|---|---|---|---|",
        *(" | ".join(["", *row, ""]).strip() for row in rows),
    ]
    options.results.mkdir(parents=True, exist_ok=True)
    (options.results / "packages.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return 1 if counts["INCOMPATIBLE"] or not all(is_kept for is_kept, _ in kept) else 0


if __name__ == "__main__":
    sys.exit(main())
