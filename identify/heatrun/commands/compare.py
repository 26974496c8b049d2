"""`heatrun compare`: two networks on the same records, or two runs of one machine."""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING, Any

from ..errors import UsageError
from . import words
from .calibrate import calibrate_into_folder, load
from .console import DONE, NOT_ALLOWED, bar, printable

if TYPE_CHECKING:
    from ..results import FitResult


def add_parser(commands: Any) -> argparse.ArgumentParser:
    """Add the command's words to the subparsers `commands`."""
    parser = commands.add_parser(
        "compare",
        help="first against second order, or two networks of your own, on the same records; or two "
        "run folders of one machine, before and after",
    )
    words.add_inputs(
        parser, "bench files; or the run folder after", "the motor file; or the run folder before"
    )
    words.add(parser, "--holdout")
    parser.add_argument(
        "--model",
        action=words.Joined,
        default="both",
        metavar="both|FILE.toml|A,B",
        help="the two networks; a single one is compared with the second order (default: both, "
        "the first and the second order); of two run folders a network that both hold (default: "
        "the favoured one)",
    )
    parser.add_argument(
        "--change",
        type=float,
        default=None,
        metavar="PERCENT",
        help="of two run folders: by how much a quantity must differ to count (default: 5)",
    )
    words.add(
        parser, "--with", "--seed", "--quick", "--out: run folder (default: none is written)",
        "--force", "--verbose: both networks, how they were sampled, columns and notes", "--json",
    )  # fmt: skip
    return parser


def run(options: argparse.Namespace) -> int:
    """Fit both networks, or set two runs beside each other."""
    if options.motor.is_dir():
        return _compare_runs(options)
    if options.change is not None:
        raise UsageError("--change is for two run folders: heatrun compare RUN_BEFORE RUN_AFTER.")
    return _compare_networks(options)


def _compare_runs(options: argparse.Namespace) -> int:
    """Print what changed from one run of a machine to another."""
    from ..reports.terminal import changes_text
    from ..results import to_json
    from ..runs.before_after import SIZE, compare_runs
    from ..runs.run import open_run

    if len(options.tests) != 1 or not options.tests[0].is_dir():
        raise UsageError(
            f"{options.motor} is a folder, so one run folder more is expected: heatrun compare "
            "RUN_BEFORE RUN_AFTER."
        )
    unused = {"--holdout": options.holdout, "--with": options.effects_known, "--out": options.out,
              "--quick": options.quick}  # fmt: skip
    if wrong := [word for word, value in unused.items() if value]:
        raise UsageError(f"{wrong[0]} is for a calibration; two run folders are only read.")
    size = 100.0 * SIZE if options.change is None else options.change
    if not (math.isfinite(size) and size > 0.0):
        raise UsageError(f"--change is a number of per cent above 0, got {size:g}.")
    network = None if options.model == "both" else options.model
    before, after = open_run(options.motor), open_run(options.tests[0])
    found = compare_runs(before, after, network=network, size=size / 100.0)
    print(to_json(found) if options.json else changes_text(found))
    return DONE


def _compare_networks(options: argparse.Namespace) -> int:
    from ..calibration import Settings, calibrate
    from ..model.catalogue import known_effects
    from ..model.network_text import pair_of
    from ..motor.file import load_motor
    from ..reports.terminal import result_text, verdict_lines
    from ..results import to_json
    from ..work import work_of_calibration

    pair = pair_of(options.model)
    motor = load_motor(options.motor)
    if options.out is not None:
        return calibrate_into_folder(
            options, motor, options.tests, options.holdout, pair, compared=_compared
        )
    tests = load(options, motor, options.tests, options.holdout)
    if tests is None:
        return NOT_ALLOWED
    method, orders = "quick" if options.quick else "emcee", [form.name for form in pair]
    settings = Settings(
        networks=pair,
        effects=known_effects(motor, options.effects_known),
        method=method,
        seed=options.seed,
        command=options.command_line,
    )
    with bar() as progress, work_of_calibration(orders, len(tests), method, progress) as work:
        found = calibrate(motor, tests, settings, work=work)
        work.finish()
    if options.json:
        names = ("verdict", "comparison", "findings", "tests")
        print(to_json({name: getattr(found.result, name) for name in names}))
    else:
        sentences = [*verdict_lines(found.result), *_compared(found.result)]
        print("\n".join(printable(sentence) for sentence in sentences))
        if options.verbose:
            print(f"\n{result_text(found.result, verbose=True)}")
    return DONE


def _compared(result: FitResult) -> list[str]:
    """Return how the two networks compare, in sentences."""
    from ..runs.verdict import against_others

    assert result.comparison is not None  # two networks were fitted
    return [*(against_others(result) or [result.verdict.sentence]), *result.comparison.words]
