"""`heatrun calibrate`: parameters with 95 % intervals, bands, verdict and parameter sheet."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import words
from .console import DONE, NOT_ALLOWED, bar, printable, say
from .init import motor_of_tests

if TYPE_CHECKING:
    from ..calibration import BenchTest
    from ..model.network_form import NetworkForm
    from ..record.motor import Motor
    from ..results import FitResult


def add_parser(commands: Any) -> argparse.ArgumentParser:
    """Add the command's words to the subparsers `commands`."""
    parser = commands.add_parser(
        "calibrate", help="parameters with 95 %% intervals, bands, verdict and parameter sheet"
    )
    words.add_inputs(parser, may_lack_motor=True)
    words.add(parser, "--holdout")
    parser.add_argument(
        "--model",
        action=words.Joined,
        default="both",
        metavar="first|second|both|cooled|three|four|FILE.toml",
        help="network: one or both of the thesis, one with a coolant beside the air or with more "
        "measured bodies, or your own from a TOML file; several with commas between, such as "
        "second,mine.toml (default: both)",
    )
    words.add(parser, "--with")
    parser.add_argument(
        "--plain",
        action="store_true",
        help="keep the network without the effects that the tests ask for; the verdict says what "
        "that costs",
    )
    words.add(
        parser, "--rating", "--seed", "--quick", "--meta", "--language",
        "--out: run folder (default: results/runs/NAME)", "--force",
        "--verbose: all networks, how they were sampled, columns and notes", "--json",
    )  # fmt: skip
    return parser


def run(options: argparse.Namespace) -> int:
    """Calibrate and write the run folder."""
    from ..model.network_text import networks_of
    from ..motor.certificate import stated_in_all
    from ..motor.file import load_motor

    networks = networks_of(options.model)
    if options.motor is None:
        tests = [*options.tests, *options.holdout]
        has_winding = any(len(network.nodes) > 1 for network in networks)
        options.motor = motor_of_tests(tests, options.command_line, has_winding=has_winding)
    motor = load_motor(options.motor)
    stated = stated_in_all(motor.certificate, options.meta, options.language)
    motor = replace(motor, certificate=stated)
    return calibrate_into_folder(options, motor, options.tests, options.holdout, networks)


def calibrate_into_folder(
    options: argparse.Namespace,
    motor: Motor,
    calibration: Sequence[Path],
    holdout: Sequence[Path],
    networks: Sequence[NetworkForm],
    default: Path | None = None,
    compared: Callable[[FitResult], Sequence[str]] | None = None,
) -> int:
    """Calibrate, write the run folder and print what was found.

    Args:
        options: With `out`, `force`, `quick`, `seed`, `json`, `command_line`; `effects_known` and
            `rating` are optional.
        motor: The motor.
        calibration: Paths of the tests that are fitted.
        holdout: Paths of the tests that are predicted.
        networks: What is calibrated.
        default: Run folder where none is named; None for one named after motor and test.
        compared: How the networks compare, in sentences that follow the result.
    """
    from ..calibration import Settings
    from ..io.ahead import remember
    from ..jobs import Place, calibrate_into
    from ..model.catalogue import known_effects
    from ..model.network_text import BUILT_IN
    from ..reports.terminal import result_text
    from ..results import to_json, to_plain
    from ..runs.run_folder import default_folder

    begun = time.monotonic()
    tests = load(options, motor, calibration, holdout)
    if tests is None:
        return NOT_ALLOWED
    names = [network.name for network in networks]
    name = "both" if names == list(BUILT_IN) else "-".join(names)
    path = options.out or default or default_folder(motor, tests[0].record, name)
    place = Place(path, is_named=options.out is not None, is_replacing=options.force)
    settings = Settings(
        networks=networks,
        effects=known_effects(motor, getattr(options, "effects_known", "")),
        method="quick" if options.quick else "emcee",
        seed=options.seed,
        command=options.command_line,
        duties=getattr(options, "rating", ()),
        is_plain=getattr(options, "plain", False),
    )
    with bar() as progress:
        found, written = calibrate_into(place, motor, tests, settings, say=say, progress=progress)
    remember(options.command)
    if options.quick and options.verbose:
        total_s, sampling_s = time.monotonic() - begun, found.sampling_s
        say(f"--quick shortens the sampling alone, here {sampling_s:.0f} of {total_s:.0f} s; the "
            f"other {total_s - sampling_s:.0f} s (reading, fits, missing effects, predictions, "
            "figures) the full run takes as well")  # fmt: skip
    if options.json:
        print(to_json({**to_plain(found.result), "run": str(written)}))
    else:
        sheet = written / "sheet.pdf"
        at = str(sheet if sheet.exists() else written)
        print(result_text(found.result, str(written), sheet=at, verbose=options.verbose))
        for sentence in compared(found.result) if compared else ():
            print(printable(sentence))
    return DONE


def load(
    options: argparse.Namespace, motor: Motor, calibration: Sequence[Path], holdout: Sequence[Path]
) -> tuple[BenchTest, ...] | None:
    """Return the tests, or None after the findings that forbid them were printed.

    Args:
        options: With `command` and `json`.
        motor: The motor.
        calibration: Paths of the tests that are fitted.
        holdout: Paths of the tests that are predicted.
    """
    count = len(calibration) + len(holdout)
    from ..calibration import Refused, load_tests
    from ..checks.suitability import other_tests
    from ..io.ahead import load_ahead
    from ..io.programs import executable
    from ..reports.terminal import findings_text
    from ..results import to_json

    load_ahead(options.command, executable)
    try:
        with bar() as progress:
            progress(f"reading {count} test{'s' if count > 1 else ''}", 0.0)
            tests = load_tests(motor, calibration, holdout)
    except Refused as refusal:
        if options.json:
            print(to_json({"findings": refusal.findings}))
        print(findings_text(refusal.findings), file=sys.stderr)
        print("heatrun: the data do not allow a calibration.", file=sys.stderr)
        return None
    for finding in other_tests(motor, [test.record.name for test in tests]):
        say(f"{finding.severity}: {finding.sentence()}")
    return tests
