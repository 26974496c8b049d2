"""Arguments that several commands share, and their parser, which takes files behind options too."""

import argparse
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ..errors import UsageError
from ..io.texts import LANGUAGES

LARGEST_SEED = 2**32 - 1
"""What every generator of random numbers here takes."""

LONGEST_SEED = 40
"""Digits, leading zeros included."""


def seed(text: str) -> int:
    """Return a seed from the word after `--seed`.

    Raises:
        ArgumentTypeError: If it is no whole number in the range; exit code 2.
    """
    if (
        text.isascii()
        and text.isdigit()
        and len(text) <= LONGEST_SEED
        and int(text) <= LARGEST_SEED
    ):
        return int(text)
    raise argparse.ArgumentTypeError(
        f"expected a whole number from 0 to {LARGEST_SEED}, got {text[:40]!r}"
    )


class Joined(argparse.Action):
    """Names with commas between; given again, an option adds to them."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: str | None = None,
    ) -> None:
        """Add the names, behind those of the same option before."""
        before = getattr(namespace, self.dest)
        is_first = before in (None, self.default)
        setattr(namespace, self.dest, values if is_first else f"{before},{values}")


OPTIONS: dict[str, tuple[str, dict[str, Any]]] = {
    "--holdout": ("tests that are predicted, not fitted",
        {"action": "extend", "nargs": "+", "type": Path, "default": [], "metavar": "TEST"}),
    "--with": ("known effects in the model beside those of the motor file's [model], such as "
        "speed_cooling,sensor_lag",
        {"action": Joined, "dest": "effects_known", "default": "", "metavar": "EFFECT,…"}),
    "--rating": ("largest current of a duty within the permitted rise, such as S2-30 (30 min), "
        "S3-40 (40 %% of 10 min), S6-40, S4-40:5x2 (starts of 5 times the current for 2 s), "
        "S5-40:5x2,3x1 and S7:5x2,3x1 (start, braking), S8:1x300@3000,0.7x300@1500 (phases with "
        "their rpm), 60/h for the cycles in an hour, or a CSV file with seconds and current_A of "
        "each phase of the cycle, speed_rpm and other_losses_W where they differ; time:150A:hot "
        "and starts:600Ax5@0 are the time to the limit and the permissible starts at stated "
        "currents; may be given several times{}",
        {"action": "append", "default": [],
         "metavar": "S1|S2-MIN|S3-PCT|S4-PCT:START|…|time:A|starts:AxS|DUTY.csv"}),
    "--seed": (f"random seed, a whole number from 0 to {LARGEST_SEED} (default: 0)",
        {"type": seed, "default": 0, "metavar": "NUMBER"}),
    "--quick": ("importance sampling instead of MCMC where its diagnostics allow, else a shorter "
        "MCMC", {"action": "store_true"}),
    "--meta": ("what the certificate says beside the results (laboratory, customer, machine, days, "
        "instruments): the keys of [certificate], before those of the motor file",
        {"type": Path, "metavar": "FILE.toml"}),
    "--language": ("language {} (default: that of [certificate], or English)",
        {"choices": LANGUAGES, "default": ""}),
    "--dcc": ("write dcc.xml too, a Digital Calibration Certificate (DCC 3.3.0)",
        {"action": "store_true"}),
    "--dcc-schema": ("validate it against your copy of the schema, with SI_Format.xsd and "
        "xmldsig-core-schema.xsd in the same folder (needs heatrun[dcc])",
        {"type": Path, "metavar": "DCC.xsd"}),
    "--out": ("{}", {"type": Path, "metavar": "DIR"}),
    "--force": ("replace {}", {"action": "store_true"}),
    "--verbose": ("also print {}", {"action": "store_true"}),
    "--json": ("one JSON object on stdout", {"action": "store_true"}),
}  # fmt: skip
"""Options of several commands: what is said of each, and how it is read."""

USUAL = {"--language": "of the sheet", "--force": "a result that stands in --out"}
"""What an option is said to do if a command says no more."""


def add(parser: argparse.ArgumentParser, *wanted: str) -> None:
    """Add some of the `OPTIONS`, such as `"--json"`, or `"--out: run folder"` with what it does."""
    for each in wanted:
        name, _, said = each.partition(": ")
        text, how = OPTIONS[name]
        flags = ("-v", name) if name == "--verbose" else (name,)
        parser.add_argument(*flags, help=text.format(said or USUAL.get(name, "")), **how)


def add_inputs(
    parser: argparse.ArgumentParser,
    tests: str = "bench files",
    motor: str = "the motor file",
    *,
    may_lack_motor: bool = False,
) -> None:
    """Add the motor file, which may be lacking, and the tests, described by `motor` and `tests`."""
    lacking = "; without one it is drafted from the tests" if may_lack_motor else ""
    parser.set_defaults(may_lack_motor=may_lack_motor)
    parser.add_argument("motor", type=Path, metavar="MOTOR.toml", help=f"{motor}{lacking}")
    parser.add_argument(
        "tests",
        nargs="*" if may_lack_motor else "+",
        type=Path,
        metavar="TEST",
        help=f"{tests}; TEMPERATURES+DRIVE@10Hz joins two loggers, "
        "FILE@10min..90min is a part of one",
    )
    for option, meaning in (("from", "begin"), ("until", "end")):
        parser.add_argument(
            f"--{option}",
            dest=f"{option}_time",
            default="",
            metavar="TIME",
            help=f"{meaning} of the part of the tests that is used, such as 600s, 10min or 1.5h",
        )


def tell_tests(options: argparse.Namespace) -> None:
    """Take the first file for a test where it is no motor file; `motor` is then None.

    Raises:
        UsageError: If there is no test.
    """
    if not getattr(options, "may_lack_motor", False):
        return
    first: Path = options.motor
    is_motor = first.suffix.lower() == ".toml"
    if not is_motor and first.is_file():
        with first.open("rb") as file:
            is_motor = b"[motor]" in file.read(4096)
    elif not is_motor:
        is_motor = bool(options.tests) and not first.suffix
    if not is_motor:
        options.motor, options.tests = None, [first, *options.tests]
    if not options.tests:
        raise UsageError(f"no test is given: heatrun {options.command} {first} TEST…")


def cut_tests(options: argparse.Namespace) -> None:
    """Write `--from` and `--until` behind each of the tests, where they were given.

    Raises:
        UsageError: If a test has a part of its own.
    """
    start, end = (getattr(options, f"{name}_time", "") for name in ("from", "until"))
    if not start and not end:
        return
    from ..record.stretch import split_stretch  # bench is slow to import

    for test in options.tests:
        if split_stretch(str(test))[1] and not test.exists():
            raise UsageError(f"{test} names its part already; leave out --from and --until.")
        if test.is_dir():
            raise UsageError(f"{test} is a folder; --from and --until are for files.")
    options.tests = [Path(f"{test}@{start}..{end}") for test in options.tests]


class AnyOrder(argparse.ArgumentParser):
    """As argparse, whose own parser takes a list of files in one piece only.

    A list that may be empty is taken for empty at the first option, and files behind it are then
    "unrecognized". `parse_intermixed_args` would do, but a parser with subcommands cannot call it;
    so each subcommand does.
    """

    _is_intermixing = False

    def parse_known_args(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, args: Iterable[str] | None = None, namespace: Any = None
    ) -> tuple[Any, list[str]]:
        """Parse options first, then what is left as one row of files."""
        words = None if args is None else list(args)
        if self._is_intermixing:  # called by the very method that is called below
            return super().parse_known_args(words, namespace)
        self._is_intermixing = True
        try:
            return self.parse_known_intermixed_args(words, namespace)
        finally:
            self._is_intermixing = False
