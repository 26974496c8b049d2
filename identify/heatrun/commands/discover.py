"""`heatrun discover`: where model and measurement disagree, and which effect is missing."""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

from . import words
from .calibrate import load
from .console import DONE, NOT_ALLOWED, bar, printable, say


def add_parser(commands: Any) -> argparse.ArgumentParser:
    """Add the command's words to the subparsers `commands`."""
    parser = commands.add_parser(
        "discover", help="where model and measurement disagree, and which effect is missing"
    )
    words.add_inputs(parser)
    words.add(parser, "--holdout")
    parser.add_argument(
        "--model",
        default="second",
        metavar="first|second|FILE.toml",
        help="base network: a built-in one, or your own from a TOML file (default: second)",
    )
    words.add(parser, "--with")
    parser.add_argument(
        "--effects",
        action="append",
        type=Path,
        default=[],
        metavar="FILE.py",
        help="your own effects, searched beside the catalogue; the file is executed",
    )
    words.add(
        parser, "--seed", "--quick", "--language: of report and sheet",
        "--out: run folder (default: results/runs/NAME)", "--force",
        "--verbose: how each column was read", "--json",
    )  # fmt: skip
    return parser


def run(options: argparse.Namespace) -> int:
    """Search, write the run folder and print the verdict."""
    from ..calibration import Settings
    from ..io.ahead import remember
    from ..jobs import Place, discover_into
    from ..model.catalogue import all_effects, known_effects
    from ..model.network_text import network_named
    from ..motor.certificate import stated_in_all
    from ..motor.file import load_motor
    from ..readers.mapping import describe_columns, mapping_text
    from ..reports.terminal import discovery_text
    from ..results import to_json, to_plain
    from ..runs.run_folder import default_folder

    motor = load_motor(options.motor)
    stated = stated_in_all(motor.certificate, language=options.language)
    motor = replace(motor, certificate=stated)
    kinds = all_effects(options.effects)
    network = network_named(options.model)
    known = known_effects(motor, options.effects_known)
    tests = load(options, motor, options.tests, options.holdout)
    if tests is None:
        return NOT_ALLOWED
    path = options.out or default_folder(motor, tests[0].record, "discovery")
    place = Place(path, is_named=options.out is not None, is_replacing=options.force)
    settings = Settings(
        networks=(network,),
        effects=known,
        kinds=kinds,
        files=options.effects,
        method="quick" if options.quick else "emcee",
        seed=options.seed,
        command=options.command_line,
    )
    with bar() as progress:
        job = discover_into(place, motor, tests, settings, say=say, progress=progress)
    remember(options.command)
    if options.json:
        print(to_json({**to_plain(job.result), "run": str(job.path)}))
    else:
        print(discovery_text(job.result))
        if options.verbose:
            print(printable(mapping_text([describe_columns(test.record) for test in tests])))
        print(printable(f"Report: {job.path / 'discovery.pdf'}"))
    return DONE
