"""`heatrun export`: a run's model and record for other programs, drives and simulators."""

import argparse
import sys
from pathlib import Path
from typing import Any

from ..errors import UsageError
from . import words
from .console import DONE, printable, say

OF_RUN = {
    "c": "its noise goes into the observer",
    "fmu": "its intervals go with it",
    "modelica": "its intervals go with it",
    "drive": "simpler bodies follow its tests",
    "mujoco": "simpler bodies follow its tests",
    "ratings": "its tests tell the losses",
}
"""What takes a run folder alone, and why."""

OF_TEST = ("c", "fmu", "modelica")
"""Those that follow the laws, with vectors of a test."""


def add_parser(commands: Any) -> argparse.ArgumentParser:
    """Add the command's words to the subparsers `commands`."""
    parser = commands.add_parser(
        "export", help="a run for MATLAB, Simulink, Octave, FMI, Modelica, MuJoCo, or for a drive"
    )
    parser.add_argument(
        "source",
        metavar="RUN_OR_PARAMETERS",
        type=Path,
        help="run folder; or a TOML file of parameters or a prova.mat, with --motor and TEST",
    )
    parser.add_argument(
        "tests",
        nargs="*",
        type=Path,
        metavar="TEST",
        help="any bench files; without one a test of the run is exported",
    )
    parser.add_argument(
        "--to",
        choices=("mat", *OF_RUN),
        required=True,
        help="mat: prova.mat for the built-in networks, with run_prova.m and with build_models.m, "
        "which builds the Simulink models (never run in MATLAB); network.mat with run_network.m "
        "for any other and for models with effects. c: C99 of the network of a run with an "
        "observer, and vectors to verify it. fmu: the same C as an FMU (FMI 3.0, co-simulation), "
        "with parameter sets at the ends of the intervals. modelica: parts of the standard library "
        "and equations. drive: time constants, resistances and I2t for the "
        "motor protection of a drive, as a sheet and TOML. mujoco: a <dcmotor> with its thermal "
        "model. ratings: permitted currents against speed, continuous and for 60, 30 and 10 "
        "minutes or as --rating asks, as CSV, JSON and figure",
    )
    parser.add_argument(
        "--step",
        type=float,
        metavar="SECONDS",
        help="step of the C and of the vectors, longest of the FMU (default: 1 s)",
    )
    parser.add_argument(
        "--speeds",
        metavar="RPM,RPM|FILE.csv",
        help="speeds of the ratings (default: those tested under load); a file has speed_rpm and, "
        "where no test tells them, other_losses_W",
    )
    words.add(
        parser, "--rating:  (default: S2-60, S2-30, S2-10; S1 is always there)",
        "--language: of the ratings",
    )  # fmt: skip
    parser.add_argument(
        "--motor-constant",
        type=float,
        metavar="NM_PER_A",
        help="torque per rms ampere for MuJoCo, which no thermal test tells",
    )
    parser.add_argument(
        "--motor",
        type=Path,
        metavar="MOTOR.toml",
        help="motor file of the bench files (default: the run's own copy)",
    )
    parser.add_argument(
        "--test", metavar="NAME", help="test of the run (default: the first calibrated on)"
    )
    parser.add_argument(
        "--model", metavar="NAME", help="network of the run (default: its last one)"
    )
    parser.add_argument(
        "--replica",
        action="store_true",
        help="the plain network nearest to a model with effects, for tools that take four numbers; "
        "--to c, fmu and modelica keep the effects whose laws they hold",
    )
    parser.add_argument(
        "--corrected",
        action="store_true",
        help="correct Is, Pd and Te by the estimated errors of current, losses, sink and timing",
    )
    words.add(
        parser,
        "--out: folder for the files (default: the run itself; of the kind's name in it for all "
        "but mat; for bench files NAME_mat here)", "--force", "--json",
    )  # fmt: skip
    return parser


def run(options: argparse.Namespace) -> int:
    """Write the files and print what is in them."""
    from ..results import to_json

    _refuse_mixed(options)
    exports = _of_tests(options) if options.tests else [_of_run(options)]
    for written in exports:
        for note in written["notes"]:
            say(note)
        for finding in () if options.json else written["findings"]:  # which the JSON holds
            sentence = f"{finding.where}: {finding.message} {finding.remedy}"
            print(f"warning {printable(sentence)}", file=sys.stderr)
    if options.json:
        print(to_json(exports[0] if len(exports) == 1 else {"exports": exports}))
    else:
        print("\n".join(_text(written) for written in exports))
    return DONE


def _refuse_mixed(options: argparse.Namespace) -> None:
    """Refuse words of one kind of file where the other is wanted."""
    to = f"--to {options.to}"
    if options.to not in OF_TEST and options.step is not None:
        raise UsageError(
            "--step is for --to c, fmu and modelica; a MAT file holds the samples of the test"
        )
    if options.to != "mujoco" and options.motor_constant is not None:
        raise UsageError("--motor-constant is for --to mujoco; nothing else simulates a torque")
    if options.to != "ratings" and options.speeds is not None:
        raise UsageError("--speeds is for --to ratings; the other exports take speeds as they come")
    if options.to != "ratings" and options.rating:
        raise UsageError("--rating is for --to ratings; the other exports hold the network")
    if options.to != "ratings" and options.language:
        raise UsageError("--language is for --to ratings; the other exports are for programs")
    if options.to not in OF_RUN:
        return
    if options.tests:
        raise UsageError(f"{to} exports a run; --test NAME chooses that of the vectors")
    if options.source.exists() and not options.source.is_dir():
        raise UsageError(f"{to} takes a run folder: {OF_RUN[options.to]}")
    if options.corrected:
        raise UsageError("--corrected is for --to mat: a drive has its own instruments")
    if options.to not in OF_TEST and (options.replica or options.test is not None):
        raise UsageError(f"{to} follows all tests of the run: leave --replica and --test out")


def _of_run(options: argparse.Namespace) -> dict[str, Any]:
    from ..export import export_drive, export_mat, export_mujoco, export_ratings, export_source

    if not options.source.is_dir() and options.source.exists():
        raise UsageError("a file of parameters holds no test: name a bench file after it")
    if options.motor is not None:
        raise UsageError("--motor is for bench files that are named; a run has its own motor file")
    where = {"folder": options.out, "network": options.model, "is_replacing": options.force}
    if options.to == "drive":
        return export_drive(options.source, **where)
    if options.to == "mujoco":
        return export_mujoco(options.source, motor_constant=options.motor_constant, **where)
    if options.to == "ratings":
        words_of = {"speeds": options.speeds, "language": options.language,
                    "duties": options.rating}  # fmt: skip
        return export_ratings(options.source, **words_of, **where)
    if options.to in OF_TEST:
        return export_source(
            options.source,
            to=options.to,
            test=options.test,
            is_replica=options.replica,
            **where,
            **({} if options.step is None else {"step": options.step}),
        )
    return export_mat(
        options.source,
        test=options.test,
        is_replica=options.replica,
        is_corrected=options.corrected,
        **where,
    )


def _of_tests(options: argparse.Namespace) -> list[dict[str, Any]]:
    """Export bench files; several go to folders of their own names."""
    from ..export import export_test
    from ..motor.file import load_motor

    if options.test is not None:
        raise UsageError("give either bench files or --test, the name of a test of the run")
    motor = None if options.motor is None else load_motor(options.motor)
    several = len(options.tests) > 1
    exports = []
    for test in options.tests:
        folder = options.out
        if folder is not None and several:
            folder = folder / f"{test.name.partition('.')[0]}_mat"
        exports.append(
            export_test(
                options.source,
                test,
                motor=motor,
                folder=folder,
                network=options.model,
                is_replica=options.replica,
                is_corrected=options.corrected,
                is_replacing=options.force,
            )
        )
    return exports


def _text(written: dict[str, Any]) -> str:
    if "ratings" in written:
        return "\n".join(map(printable, [*written["table"], *written["files"]]))
    if "step_s" in written:
        return _text_of_network(written)
    if "variables" not in written:
        return _text_of_bodies(written)
    samples = written["variables"]["t"]["shape"][0]
    effects = f" with {', '.join(written['effects'])}" if written["effects"] else ""
    lines = [
        f"{len(written['variables'])} variables, {samples} samples of "
        f"{printable(written['test'])}, {printable(written['title'])}{effects}"
    ]
    if written["rmse_K"] is None:
        lines.append("The winding was not measured: Tw_m is NaN.")
    elif Path(written["files"][0]).name == "prova.mat":
        lines.append(
            f"RMSE of Tw to Tw_m: {written['rmse_K']:.4f} K by heatrun "
            f"({written['rmse_reading_K']:.4f} K with the sensor's error that the run found)"
        )
    else:
        lines.append(
            f"RMSE of the reading to Tw_m: {written['rmse_reading_K']:.4f} K by heatrun, sample by "
            "sample (a report gives that of block means)"
        )
    return "\n".join([*lines, *(printable(path) for path in written["files"])])


def _text_of_network(written: dict[str, Any]) -> str:
    effects = f" with {', '.join(written['effects'])}" if written["effects"] else ""
    network = f"{printable(written['title'])}{effects}"
    verify = f"{written['vector_steps']} steps of {printable(written['test'])} to verify it"
    if "has_observer" in written:
        how = "with an observer" if written["has_observer"] else "without an observer"
        first = f"C99 of {network}, {how}"
        verify += ": compile main.c with thermal_network.c and run it on vectors.csv"
        verify += " and observer_vectors.csv" if written["has_observer"] else ""
    elif "is_compiled" not in written:
        first = f"Modelica of {network}"
        verify += ": vectors.csv holds inputs and temperatures"
    else:
        how = "compiled for this platform" if written["is_compiled"] else "sources only"
        first = f"FMU (FMI 3.0, co-simulation, {how}) of {network}"
        verify += ": vectors.csv holds inputs and temperatures"
    nodes = printable(", ".join(written["nodes"]))
    return "\n".join([
        f"{first}: nodes {nodes}; steps of {written['step_s']:g} s",
        verify,
        *(printable(path) for path in written["files"]),
    ])  # fmt: skip


def _text_of_bodies(written: dict[str, Any]) -> str:
    bodies = written["parameters"]["bodies"] if "parameters" in written else {"one": written}
    return "\n".join([
        f"Bodies that the current heats, nearest to the {printable(written['title'])} model:",
        *(
            f"{name.replace('_', ' ')}: RMS {body['bias']['rms_K']:.1f} K, at most "
            f"{body['bias']['colder_at_most_K']:.1f} K colder and "
            f"{body['bias']['warmer_at_most_K']:.1f} K warmer at the tested loads"
            for name, body in bodies.items()
        ),
        *(printable(path) for path in written["files"]),
    ])  # fmt: skip
