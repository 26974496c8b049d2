"""Licences of every package of the lock file, from the metadata of what is installed.

Vulnerabilities are asked of `pip-audit` where it is installed and its data can be had; this file
never reaches the network itself.

    python tests/audit/licences.py [--results results/audit]
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import subprocess
import sys
import sysconfig
from collections import Counter
from importlib.metadata import PackageNotFoundError, distribution, requires
from pathlib import Path

ROOT = Path(__file__).parents[2]
PIN = re.compile(r"^([A-Za-z0-9._-]+)==([^\s;\\]+)", re.M)
STRONG = re.compile(
    r"\b(?<!L)(A?GPL|GNU (AFFERO )?GENERAL PUBLIC)|SSPL|BUSL|CC-BY-NC|PROPRIETARY", re.I
)
WEAK = re.compile(r"\bLGPL|LESSER GENERAL PUBLIC|\bMPL|MOZILLA PUBLIC|\bEPL|\bCDDL", re.I)
EXCEPTION = re.compile(r"GCC-exception|with.{0,40}exception", re.I)
"""Run-time libraries of the compiler inside wheels: the exception lets any program use them."""


def licence_of(name: str) -> str:
    """Return the licence that a package's metadata state, or why there is none.

    Args:
        name: As in the lock file.
    """
    try:
        found = distribution(name).metadata
    except PackageNotFoundError:
        return "not installed here"
    if found.get("License-Expression"):
        return found["License-Expression"]
    classes = [
        line.split("::")[-1].strip()
        for line in found.get_all("Classifier", [])
        if line.startswith("License ::") and line.count("::") > 1
    ]
    text = (found.get("License") or "").strip().splitlines()
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


def vulnerabilities() -> str:
    """Return what pip-audit says of the installed packages, or why it was not asked."""
    program = shutil.which("pip-audit")
    if program is None:
        return "pip-audit is not installed: known vulnerabilities were not asked for."
    words = [program, "--path", sysconfig.get_path("purelib"), "--format", "json"]
    words += ["--progress-spinner", "off"]
    try:
        done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=600)
        packages = json.loads(done.stdout)["dependencies"]
    except (subprocess.TimeoutExpired, ValueError, KeyError):
        return "pip-audit did not answer: its data cannot be had here."
    answered = [package for package in packages if "skip_reason" not in package]
    if not answered:
        return f"pip-audit knows none of the {len(packages)} packages: its data cannot be had here."
    known = [
        f"{package['name']} {package['version']}: "
        + ", ".join(each["id"] for each in package["vulns"])
        for package in answered
        if package["vulns"]
    ]
    return (
        f"pip-audit: data for {len(answered)} of {len(packages)} installed packages could be had; "
        f"known vulnerabilities: {'; '.join(known) or 'none among those'}."
    )


def main() -> int:
    """Write the table; exit code 1 if a licence does not fit."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--results", type=Path, default=ROOT / "results" / "audit")
    options = parser.parse_args()
    pins = sorted(
        set(PIN.findall((ROOT / "requirements.lock").read_text())), key=lambda pin: pin[0].lower()
    )
    users = users_of()
    rows = []
    for name, version in pins:
        licence = licence_of(name)
        rows.append((name, version, users.get(name.lower(), ""), licence, verdict(licence)))
    counts = Counter(row[-1] for row in rows)
    lines = [
        "# Packages of the lock file",
        "",
        "`make audit` (`python tests/audit/licences.py`). Licences as the installed packages' "
        "metadata state them; heatrun is Apache-2.0 and imports these packages, it copies none.",
        "",
        *(f"- {count} {word}" for word, count in counts.most_common()),
        "",
        vulnerabilities(),
        "",
        "| package | version | asked for by | licence | |",
        "|---|---|---|---|---|",
        *(" | ".join(["", *row, ""]).strip() for row in rows),
    ]
    options.results.mkdir(parents=True, exist_ok=True)
    (options.results / "packages.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return 1 if counts["INCOMPATIBLE"] else 0


if __name__ == "__main__":
    sys.exit(main())
