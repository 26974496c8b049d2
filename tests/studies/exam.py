"""The field's exam on the public file "Electric Motor Temperature": `make study-exam FILE=…`.

W. Kirchgässner, O. Wallscheid, J. Böcker, Electric Motor Temperature, Paderborn University, 2021:
one machine on the bench, 69 profiles at 2 Hz. Stator windings of the profiles 60, 62 and 74 are
predicted by a network that was calibrated on others; of a profile that is predicted only its first
40 s are read, for the start. Published figures stand beside. The file is no part of the project:
without it, nothing is done.
"""

import argparse
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from study_runs import put

import heatrun
from heatrun.calibration import Refused
from heatrun.errors import InputError
from heatrun.posterior.driven import virtual_record
from heatrun.posterior.predict import Prediction
from heatrun.readers.joined import read_test

RATE_HZ = 2.0
TESTS = (60, 62, 74)
NETWORKS = ("second", "three", "four")
COLUMNS = (
    *("u_q", "coolant", "stator_winding", "u_d", "stator_tooth", "motor_speed", "i_d", "i_q"),
    *("pm", "stator_yoke", "ambient", "torque"),
)
"""Of the public file, beside `profile_id`; heatrun knows them by name."""

MOTOR = """[motor]
name = "Electric Motor Temperature"
losses = "balance"
sink = "coolant"
rated_speed_rpm = 6000
[winding]
phase_resistance_ohm = 0.0146
reference_temperature_degC = 70.0
"""

PUBLISHED = {
    "convolutional network": "4.8 | 1.1 | 3.4",
    "thermal neural network, 537 parameters": "about 7 on average | |",
    "plain RC network": "163 | 18 | 181",
}
"""MSE of the stator winding on profiles 60, 62, 74 [K^2]."""

FEW = 4
"""Profiles of the set that is taken where none is asked for: what the whole costs is in
`CONTRIBUTING.md`."""


@dataclass(frozen=True)
class Score:
    """How well a profile was predicted that was not fitted."""

    profile: int  # Its id.
    mse_K2: float  # Mean squared error of the winding over all its samples [K^2].
    max_K: float  # Maximum absolute error of a sample [K].
    coverage_95: float  # Share of the block means inside the 95 % band [1].


@dataclass(frozen=True)
class Outcome:
    trained: tuple[int, ...]  # Ids of the profiles that were fitted.
    left_out: dict[int, str]  # Why others of the set were not, by id.
    network: str  # Its name.
    scores: tuple[Score, ...]  # Of the profiles that were predicted; empty if refused.
    seconds: float  # Wall-clock time of calibration and prediction [s].
    processor_s: float  # Processor time of the same [s].
    refused: str = ""  # Why there is no fit.


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path, nargs="?", default=Path("measures_v2.csv"))
    parser.add_argument(
        "--train", action="append", metavar="SET",
        help=f"ids with commas between; 'few' ({FEW} spread over the file), 'all' (all but the "
        "held-out ones). May be given several times",
    )  # fmt: skip
    parser.add_argument("--test", default=",".join(map(str, TESTS)), help="ids that are predicted")
    parser.add_argument("--networks", default=",".join(NETWORKS))
    parser.add_argument("--out", type=Path, default=Path("results") / "real")
    options = parser.parse_args(arguments)
    if not options.file.is_file():
        print(
            f"{options.file} is not there: nothing is done. It is measures_v2.csv of the public "
            'set "Electric Motor Temperature" (Paderborn University): make study-exam FILE=PATH.'
        )
        return
    parts = profiles(options.file)
    tests = _ids(options.test)
    outcomes = []
    with tempfile.TemporaryDirectory() as name:
        bench = Bench(Path(name), parts)
        for wanted in options.train or ["few"]:
            chosen = training(wanted, parts, tests)
            for network in options.networks.split(","):
                outcomes.append(examined(bench, chosen, tests, network))
                print("\n".join(rows(outcomes[-1])), flush=True)
                put(options.out / "exam.md", table(outcomes))


def profiles(file: Path) -> dict[int, pd.DataFrame]:
    """Return the profiles of a file by their id, columns and samples in the order of the file."""
    present = pd.read_csv(file, nrows=0).columns
    missing = [name for name in ("profile_id", *COLUMNS) if name not in present]
    if missing:
        sys.exit(f"{file}: expected the columns of the public file; missing: {', '.join(missing)}.")
    whole = pd.read_csv(file, usecols=["profile_id", *COLUMNS])
    return {
        int(number): part.drop(columns="profile_id").reset_index(drop=True)
        for number, part in whole.groupby("profile_id", sort=True)
    }


def training(wanted: str, parts: dict[int, pd.DataFrame], tests: Sequence[int]) -> tuple[int, ...]:
    """Return the profiles of a training set."""
    absent = [number for number in tests if number not in parts]
    others = [number for number in parts if number not in tests]
    if wanted == "all":
        chosen = others
    elif wanted == "few":
        picked = np.linspace(0, len(others) - 1, min(FEW, len(others))).round().astype(int)
        chosen = [others[index] for index in picked]
    else:
        chosen = _ids(wanted)
        absent += [number for number in chosen if number not in parts]
        both = [number for number in chosen if number in tests]
        if both:
            sys.exit(f"Profile {both[0]} is held out: it cannot be fitted too.")
    if absent:
        sys.exit(f"The file has no profile {absent[0]}; it has {', '.join(map(str, parts))}.")
    return tuple(chosen)


class Bench:
    """The profiles as bench files of their own."""

    def __init__(self, folder: Path, parts: dict[int, pd.DataFrame]) -> None:
        self.folder, self.parts = folder, parts
        self.motor = folder / "motor.toml"
        self.motor.write_text(MOTOR, encoding="utf-8")

    def test(self, number: int) -> str:
        """Return a profile as heatrun takes it; the file has no column of time."""
        path = self.folder / f"profile_{number}.csv"
        if not path.exists():
            self.parts[number].to_csv(path, index=False)
        return f"{path}@{RATE_HZ:g}Hz"

    def refusal(self, number: int) -> str:
        try:
            found = heatrun.check(self.motor, self.test(number))
        except InputError as error:
            return first_sentence(str(error))
        errors = [finding.message for finding in found if finding.severity == "error"]
        return first_sentence(errors[0]) if errors else ""


def examined(
    bench: Bench,
    train: Sequence[int],
    tests: Sequence[int],
    network: str,
    *,
    out: Path | None = None,
) -> Outcome:
    """Return how a network predicts profiles that it was not calibrated on."""
    began, processor = time.monotonic(), time.process_time()
    refusals = {number: bench.refusal(number) for number in train}
    left_out = {number: why for number, why in refusals.items() if why}
    fitted = tuple(number for number in train if number not in left_out)
    scores: tuple[Score, ...] = ()
    refused = "" if fitted else "every profile of the set is refused"
    if fitted:
        try:
            run = heatrun.calibrate(
                bench.motor, [bench.test(number) for number in fitted],
                holdout=[bench.test(number) for number in tests], model=network, method="quick",
                out=out,
            )  # fmt: skip
            scores = tuple(_score(run, bench, number) for number in tests)
        except (Refused, InputError) as error:
            refused = first_sentence(str(error))
    return Outcome(
        fitted, left_out, network, scores,
        time.monotonic() - began, time.process_time() - processor, refused,
    )  # fmt: skip


def _score(run: heatrun.Run, bench: Bench, number: int) -> Score:
    part = bench.parts[number]
    record = read_test(bench.test(number), run.motor)
    found = run.predict(record)
    course = virtual_record(found, record, run.motor)
    measured = part["stator_winding"].to_numpy()
    time_s = np.arange(measured.size) / RATE_HZ
    mse, largest = errors(measured, reading(found, course, time_s))
    return Score(number, mse, largest, found.coverage_95())


def reading(found: Prediction, course: pd.DataFrame, time_s: np.ndarray) -> np.ndarray:
    """Return what the network says that the winding's sensor reads at each sample [degC]."""
    node = found.model.form.measured_node
    of_sensor = np.interp(time_s, found.time_s, found.median - found.nodes[node])
    return np.interp(time_s, course["time_s"], course[f"{node}_degC"]) + of_sensor


def errors(measured: np.ndarray, predicted: np.ndarray) -> tuple[float, float]:
    error = measured - predicted
    return float(np.mean(error**2)), float(np.max(np.abs(error)))


def first_sentence(text: str) -> str:
    end = min((at for stop in (". ", "; ", "\n") if (at := text.find(stop)) > 0), default=len(text))
    return text[:end].rstrip(".")


def table(outcomes: Sequence[Outcome]) -> str:
    numbers = [score.profile for outcome in outcomes for score in outcome.scores]
    heads = [str(number) for number in dict.fromkeys(numbers)] or ["test"]
    lines = [
        "# Stator winding on unseen profiles",
        "",
        '`make study-exam`: the public file "Electric Motor Temperature", through '
        "`heatrun calibrate --holdout --quick`. MSE of the winding over all samples of a profile "
        "[K²]; in brackets coverage of the 95 % band (block means of 20 s) and maximum error. "
        "Only the first 40 s of a held-out profile are read, for the start. The sink is the "
        "coolant; losses are 1.5(u_d·i_d + u_q·i_q) − torque·ω; a phase has 14.6 mΩ at 70 °C.",
        "",
        f"| trained on | network | {' | '.join(f'profile {head}' for head in heads)} | mean MSE "
        "| time | processor |",
        f"|---|---|{'---|' * len(heads)}---|---|---|",
    ]
    for outcome in outcomes:
        lines += rows(outcome, len(heads))
    lines += [
        "",
        "Published, MSE on profiles 60, 62, 74 [K²]; none comes with a coverage:",
        "",
        "| model | 60 | 62 | 74 |",
        "|---|---|---|---|",
        *(f"| {name} | {figures} |" for name, figures in PUBLISHED.items()),
    ]
    left_out = {number: why for each in outcomes for number, why in each.left_out.items()}
    if left_out:
        lines += ["", "Refused by a check and left out of the training:", ""]
        lines += [f"- profile {number}: {why}." for number, why in left_out.items()]
    return "\n".join([*lines, ""])


def rows(outcome: Outcome, num: int = 1) -> list[str]:
    many = len(outcome.trained) > 8
    trained = f"{len(outcome.trained)} profiles" if many else ", ".join(map(str, outcome.trained))
    head = f"| {trained or '–'} | {outcome.network}"
    tail = f"{outcome.seconds:.0f} s | {outcome.processor_s:.0f} s |"
    if not outcome.scores:
        return [f"{head} | refused: {outcome.refused} |{' |' * num} {tail}"]
    cells = [
        f"{score.mse_K2:.3g} ({100 * score.coverage_95:.0f} %, {score.max_K:.1f} K)"
        for score in outcome.scores
    ]
    mean = np.mean([score.mse_K2 for score in outcome.scores])
    return [f"{head} | {' | '.join(cells)} | {mean:.3g} | {tail}"]


def _ids(text: str) -> list[int]:
    try:
        return [int(part) for part in text.split(",")]
    except ValueError:
        sys.exit(f"Expected ids of profiles with commas between, got '{text}'.")


if __name__ == "__main__":
    main()
