"""`heatrun compare`: first against second order, or two networks, on the same records."""

from __future__ import annotations

import argparse
from typing import Any

from . import words
from .calibrate import calibrate_into_folder
from .console import DONE, NOT_ALLOWED, bar, printable
from .loading import load


def add_parser(commands: Any) -> argparse.ArgumentParser:
    """Add the command's words to the subparsers `commands`."""
    parser = commands.add_parser(
        "compare",
        help="first against second order, or two networks of your own, on the same records",
    )
    words.add_inputs(parser)
    words.add_holdout(parser)
    parser.add_argument(
        "--model",
        default="both",
        metavar="both|FILE.toml|A,B",
        help="the two networks; a single one is compared with the second order (default: both, "
        "the first and the second order)",
    )
    words.add_with(parser)
    words.add_sampling(parser)
    words.add_out(parser, "run folder (default: none is written)")
    words.add_force(parser)
    words.add_verbose(parser, "both networks, how they were sampled, columns and notes")
    words.add_json(parser)
    return parser


def run(options: argparse.Namespace) -> int:
    """Fit both networks; a run folder is written only where one is named."""
    from ..calibration import Settings, calibrate
    from ..model.catalogue import known_effects
    from ..model.network_text import pair_of
    from ..motor.file import load_motor
    from ..reports.terminal import result_text, verdict_lines
    from ..results import to_json
    from ..runs.verdict import against_others
    from ..work import work_of_calibration

    pair = pair_of(options.model)
    motor = load_motor(options.motor)
    if options.out is not None:
        return calibrate_into_folder(options, motor, options.tests, options.holdout, pair)
    tests = load(motor, options.tests, options.holdout, as_json=options.json)
    if tests is None:
        return NOT_ALLOWED
    method = "quick" if options.quick else "emcee"
    names = [form.name for form in pair]
    settings = Settings(
        networks=pair,
        effects=known_effects(motor, options.effects_known),
        method=method,
        seed=options.seed,
        command=options.command_line,
    )
    with bar() as progress, work_of_calibration(names, len(tests), method, progress) as work:
        found = calibrate(motor, tests, settings, work=work)
        work.finish()
    if options.json:
        result = found.result
        print(
            to_json(
                {
                    "verdict": result.verdict,
                    "comparison": result.comparison,
                    "findings": result.findings,
                    "tests": result.tests,
                }
            )
        )
    else:
        assert found.result.comparison is not None  # two networks were fitted
        chance = against_others(found.result) or [found.result.verdict.sentence]
        sentences = [*verdict_lines(found.result), *chance, *found.result.comparison.words]
        print("\n".join(printable(sentence) for sentence in sentences))
        if options.verbose:
            print(f"\n{result_text(found.result, verbose=True)}")
    return DONE
