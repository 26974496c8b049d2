"""`heatrun fleet`: the calibrations of many machines, one row each."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from heatrun.commands import words
from heatrun.commands.console import DONE, NOT_ALLOWED, bar, printable, say
from heatrun.errors import UsageError

if TYPE_CHECKING:
    from .job import FleetResult


def add_parser(commands: Any) -> argparse.ArgumentParser:
    """Add the command's words to the subparsers `commands`."""
    parser = commands.add_parser("fleet", help="the calibrations of many machines, one row each")
    parser.add_argument(
        "fleet",
        type=Path,
        metavar="FLEET.toml",
        help="the fleet file, or the table of its machines alone (CSV or Parquet) with columns "
        "machine, type, motor, test, role; other columns are covariates",
    )
    parser.add_argument(
        "--model",
        default=None,
        metavar="first|second|FILE.toml",
        help="network of all machines (default: that of the fleet file, or second)",
    )
    words.add(parser, "--out: folder of the fleet (default: results/fleets/NAME)", "--force")
    parser.add_argument(
        "--workers",
        type=_count,
        default=None,
        metavar="NUMBER",
        help="processes of this machine, 0 for this one alone (default: one per core)",
    )
    parser.add_argument(
        "--batch",
        type=_count,
        default=None,
        metavar="NUMBER",
        help="machines in a batch, the unit of work and of what a killed run keeps (default: 64)",
    )
    parser.add_argument(
        "--memory",
        default="auto",
        metavar="SIZE",
        help="memory that a process may take, such as 4GB (default: its share of the machine's)",
    )
    parser.add_argument(
        "--scheduler",
        default="",
        metavar="ADDRESS",
        help="address of a Dask scheduler that runs already, such as tls://host:8786; its workers "
        "read the tests under the same paths and need the same versions",
    )
    for key, meaning in (("ca", "certificate authority"), ("cert", "certificate"), ("key", "key")):
        parser.add_argument(
            f"--tls-{key}",
            default="",
            metavar="FILE",
            help=f"{meaning} for a scheduler under TLS (default: Dask's own configuration)",
        )
    parser.add_argument(
        "--discover",
        action="store_true",
        help="seek effects that the machines of a type share and no single one need show "
        "(fleet_discovery.json); needs ten machines of a type, and a tenth of a second or more "
        "for each",
    )
    words.add(parser, "--seed", "--json")
    return parser


def run(options: argparse.Namespace) -> int:
    """Calibrate the machines and write their rows."""
    from .cluster import Workers
    from .fleet_file import load_fleet
    from .job import BATCH, calibrate_fleet_into, default_folder

    workers = Workers(options.workers, options.scheduler, options.memory, _tls(options))
    if options.batch == 0:
        raise UsageError("--batch takes a whole number from 1 on")
    fleet = load_fleet(options.fleet, options.model)
    with bar() as progress:
        result = calibrate_fleet_into(
            options.out or default_folder(fleet),
            fleet,
            workers=workers,
            batch=options.batch or BATCH,
            discover=options.discover,
            seed=options.seed,
            command=options.command_line,
            is_named=options.out is not None,
            is_replacing=options.force,
            say=say,
            progress=progress,
        )
    _print(result, discovers=options.discover, as_json=options.json)
    return DONE if result.manifest["machines"].get("fitted") else NOT_ALLOWED


def _print(result: FleetResult, *, discovers: bool, as_json: bool) -> None:
    from heatrun.results import to_json

    from .job import summary, summary_text
    from .shared_effects.job import discovery_text

    found = summary(result)
    shared = result.discovery() if discovers else None
    if as_json:
        print(to_json(found if shared is None else {**found, "discovery": shared}))
        return
    print(printable(summary_text(found)))
    files = ["machines.parquet", "timing.json", "manifest.json"]
    if shared is not None:
        print("\n" + printable(discovery_text(shared)))
        files.insert(1, "fleet_discovery.json")
    print(f"\nFolder:          {printable(str(result.path))}")
    for name in files:
        print(f"  {name:<20} {printable(str(result.path / name))}")


def _tls(options: argparse.Namespace) -> dict[str, str] | None:
    given = {key: getattr(options, f"tls_{key}") for key in ("ca", "cert", "key")}
    if any(given.values()) and not (all(given.values()) and options.scheduler):
        raise UsageError("--tls-ca, --tls-cert and --tls-key belong together, and to --scheduler")
    if options.scheduler and options.workers is not None:
        raise UsageError("--workers starts processes of this machine; leave it out, or --scheduler")
    return given if any(given.values()) else None


def _count(text: str) -> int:
    if text.isascii() and text.isdigit() and len(text) < 7:
        return int(text)
    raise argparse.ArgumentTypeError(f"expected a whole number, got {text[:40]!r}")
