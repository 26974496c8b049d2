"""The main job: from bench files to a run folder with parameters, bands and a verdict."""

import math
import platform
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from lptn.effects import AbstractEffect

from .checks import check_record, current_scale_unchecked
from .checks.load_moments import with_load_moments
from .checks.suitability import as_holdout
from .effects.found import Found, asked_findings, find
from .effects.small_effects import SmallEffects, averaged, missing_finding, small_effects
from .errors import InputError, did_you_mean
from .fit.fit import fit
from .fit.fit_result import Fit
from .io.whole_files import moment
from .model.kernels import at_once, beside
from .model.model import Model
from .model.network_form import NetworkForm
from .model.network_text import network_named
from .model.problem import Problem
from .posterior.fit_checks import changes_finding, fit_findings, fit_with_changes, holding_heat
from .posterior.identifiability import check_reduction
from .posterior.posterior import Posterior, normal_draws, sample
from .posterior.predict import Prediction, predict, unpredicted
from .readers.joined import read_tests
from .record.blocks import Blocks
from .record.findings import Attempts
from .record.motor import Motor
from .record.record import Finding, Record
from .record.reduction import reduce, with_scales
from .results.model import DescribedTest, FitResult, FittedModel
from .results.values import Role
from .runs.figures_of_draws import DrawValues
from .runs.result import assemble, describe_model, describe_test, with_network_rise
from .runs.run_folder import RunFolder, environment
from .work import SILENT, USUAL_MCMC_S, Work

Method = Literal["emcee", "quick"]


class Refused(Exception):
    """The data do not allow the job; the findings say why. Exit code 1.

    Args:
        findings: At least one of severity `"error"`.
    """

    def __init__(self, findings: Sequence[Finding]) -> None:
        self.findings = tuple(findings)
        errors = [finding.sentence() for finding in findings if finding.severity == "error"]
        super().__init__("; ".join(errors))


@dataclass(frozen=True)
class BenchTest:
    """A record with its reduction and what it is used for."""

    record: Record
    blocks: Blocks
    role: Role
    findings: tuple[Finding, ...]


@dataclass(frozen=True)
class Calibration:
    """Everything that a calibration found."""

    motor: Motor  # The machine.
    tests: tuple[BenchTest, ...]  # Records, calibration first.
    posteriors: dict[str, Posterior]  # By name of the network.
    predictions: dict[str, list[Prediction]]  # Likewise, one per test.
    result: FitResult  # What stands in `fit.json`.
    sampling_s: float = math.nan  # What sampling took, of networks at once the longest [s].
    # Which effects the tests ask for beside the last network; None where that could not be
    # searched.
    asked: Found | None = None
    screened: SmallEffects | None = None  # Which small ones it may lack, likewise.


def load_tests(
    motor: Motor, calibration: Sequence[Path], holdout: Sequence[Path] = ()
) -> tuple[BenchTest, ...]:
    """Read, check and reduce records.

    Args:
        motor: The machine.
        calibration: Files to calibrate on.
        holdout: Files to predict only.

    Raises:
        InputError: If a file cannot be read.
        Refused: If a check forbids a fit.
    """
    records = [(each, "calibration") for path in calibration for each in read_tests(path, motor)]
    records += [(each, "holdout") for path in holdout for each in read_tests(path, motor)]
    records = _with_distinct_names(records)
    checked = [
        (record, role, found if role == "calibration" else as_holdout(found))
        for record, role in records
        for found in (check_record(record, motor),)
    ]
    findings = [finding for _, _, found in checked for finding in found]
    if any(finding.severity == "error" for finding in findings):
        raise Refused(findings)
    motor = with_scales(motor, [record for record, role in records if role == "calibration"])
    return tuple(BenchTest(r, _reduced(r, motor, role), role, f) for r, role, f in checked)


def with_scales_of(tests: Sequence[BenchTest], motor: Motor) -> Motor:
    """Return the motor with what its effects are scaled with in the tests that are fitted."""
    return with_scales(motor, [test.record for test in tests if test.role == "calibration"])


def _reduced(record: Record, motor: Motor, role: str) -> Blocks:
    """Return the blocks of a test; of one that is predicted, readings must not tell the noise."""
    blocks = reduce(record, motor)
    return with_load_moments(blocks, record, motor) if role == "calibration" else blocks


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What is asked of a calibration or a discovery, beside the machine and its tests."""

    # What is calibrated, the simpler first: by name, TOML file or form.
    networks: Sequence[str | NetworkForm]
    effects: tuple[type[AbstractEffect], ...] = ()  # Known effects that each of them has.
    # Effects that the last of them may lack; None for the catalogue and installed ones, as far as a
    # calibration goes into them.
    kinds: Sequence[type[AbstractEffect]] | None = None
    files: Sequence[Path] = ()  # Python files that some of the effects came from.
    method: Method = "emcee"  # Sampler, as `heatrun.posterior.posterior.sample`.
    seed: int = 0  # Random seed.
    duties: Sequence[str] = ()  # Ratings asked for, as `heatrun.runs.ratings_figures.derive`.
    command: str = ""  # As it is to stand in the result.
    # Whether the last network stays without the effects that the tests ask for.
    is_plain: bool = False

    @property
    def forms(self) -> tuple[NetworkForm, ...]:
        """The networks, each as its form."""
        return tuple(network_named(n) if isinstance(n, str) else n for n in self.networks)


def calibrate(
    motor: Motor,
    tests: Sequence[BenchTest],
    settings: Settings,
    *,
    folder: RunFolder | None = None,
    work: Work = SILENT,
) -> Calibration:
    """Calibrate a motor's networks on tests.

    Args:
        motor: The machine.
        tests: From `load_tests`.
        settings: What is asked.
        folder: Where checkpoints go; None for none.
        work: Told how far it is, by the thread that does it; as `heatrun.work.work_of_calibration`.

    Raises:
        InputError: If something that the model needs is not given.
    """
    kinds, seed, is_plain = settings.kinds, settings.seed, settings.is_plain
    motor = with_scales_of(tests, motor)
    fitted = [test.blocks for test in tests if test.role == "calibration"]
    predicted_only = [test.blocks for test in tests if test.role != "calibration"]
    findings = [finding for test in tests for finding in test.findings]
    findings += current_scale_unchecked(motor, [test.record for test in tests])

    roles: list[Role] = [test.role for test in tests]
    models = [
        Model.of(network, motor, settings.effects).scaled(motor, fitted)
        for network in settings.forms
    ]
    names = [model.name for model in models]
    if len(set(names)) < len(names):
        raise InputError(
            f"two networks have one name: {', '.join(names)}.", remedy="Rename one in its file."
        )
    refuse_unplaced_bodies(motor, models)
    for model in models:
        model.refuse_unusable([test.blocks for test in tests])

    def fitted_one(model: Model) -> _Fitted:
        name = model.name
        attempts = Attempts()
        work.at((name, "fit"), f"{model.title}: least squares from many starts")
        rows = [model.with_bodies(test) for test in fitted]
        found = fit(Problem.of(model, motor, rows), seed=seed)
        work.done((name, "fit"), f"{model.title}: fitted")
        is_last = name == names[-1]  # a network that another one extends is known to miss it
        screened, asked = None, None
        # one node alone is a simplification that was asked for; only a discovery goes beyond it
        if is_last and (kinds is not None or len(model.form.nodes) > 1):
            searching = f"{model.title}: looking for effects that it misses"
            work.at((name, "missing"), searching)
            asked = attempts.of(
                "the search for effects",
                lambda: find(model, motor, rows, kinds=kinds, held_out=predicted_only, start=found),
                None,
                where=model.title,
            )
        if asked is not None and asked.core.effects and not is_plain:
            found = asked.fit
        else:
            found = holding_heat(found, seed=seed)
        if is_last and not is_plain:
            found, screened = _searched(found, kinds, seed, work, attempts)
        return _Fitted(found, asked, screened, attempts)

    fits = beside(fitted_one, models)
    last = fits[-1].fit

    def one(model: Model, of: _Fitted) -> _Outcome:
        name = model.name
        found, asked, screened, attempts = of.fit, of.asked, of.screened, of.attempts
        is_last = name == names[-1]
        work.done((name, "missing"), f"{model.title}: sampling the posterior")

        def report(sentence: str, share: float) -> None:
            part, words = (name, "sample"), f"{model.title}: {sentence}"
            if share == 0.0:
                work.replan(part, USUAL_MCMC_S, words)
            else:  # averaging over effects that may be missing comes after it
                work.at(part, words, 0.9 * share)

        begun = time.monotonic()
        behind = last.log_evidence - found.log_evidence
        if behind > REFUSED and _of_same_readings(found, last):
            posterior = normal_draws(found, seed=seed, behind=behind)
        else:
            posterior = _sampled(found, screened, settings, folder, report, attempts)
        sampling_s = time.monotonic() - begun
        work.done((name, "sample"), f"{model.title}: predicting the tests")
        predicted = at_once(
            lambda test: (
                attempts.of(
                    "the prediction",
                    lambda: predict(posterior, test.blocks, seed=seed),
                    None,
                    where=f"{model.title}, {test.record.name}",
                    test=test.record.name,
                )
                or unpredicted(posterior, test.blocks)
            ),
            tests,
        )
        over = None if asked is None or is_plain else asked.undecided(seed=seed)
        undecided = None if over is None else DrawValues(*over, ())
        if settings.duties:
            work.done((name, "predict"), f"{model.title}: ratings")
        described = describe_model(
            posterior, predicted, roles, settings.duties, attempts, undecided
        )
        last_part = (name, "ratings" if settings.duties else "predict")
        work.done(last_part, f"{model.title}: done")
        seen = [*found.findings, *_sampling_findings(posterior)]
        if asked is not None and not is_plain:
            described = described.allowing_for(asked.allowed_for)
        if screened is not None:
            stats = {**described.stats, "missing_effect_p": screened.p}
            described = replace(described, stats=stats)
        seen += attempts.of(
            "the check of the fit",
            lambda: _fit_findings(posterior, screened, predicted, is_last=is_last),
            [],
            where=model.title,
        )
        if asked is not None:
            seen += asked_findings(asked, is_plain=is_plain)
        seen = [replace(each, network=name) for each in [*seen, *attempts.findings]]
        return _Outcome(posterior, predicted, described, seen, sampling_s, asked, screened)

    found = beside(lambda pair: one(*pair), list(zip(models, fits, strict=True)))
    outcomes = dict(zip(names, found, strict=True))
    posteriors = {name: outcome.posterior for name, outcome in outcomes.items()}
    predictions = {name: outcome.predictions for name, outcome in outcomes.items()}
    findings += [finding for outcome in outcomes.values() for finding in outcome.findings]
    attempts = Attempts()
    rows, found = describe_tests(last, tests, motor, attempts, work)
    rows = [
        attempts.of("the steady rise of the network", lambda row=row, by=by: (
            with_network_rise(row, by) if by.is_there else row), row, where=row.name, test=row.name)
        for row, by in zip(rows, predictions[names[-1]], strict=True)
    ]  # fmt: skip
    work.done("reduction")
    described = {name: outcome.described for name, outcome in outcomes.items()}
    findings += [*found, *attempts.findings]
    result = assemble(
        motor, rows, findings, described, predictions, command=settings.command, seed=seed
    )
    final = outcomes[names[-1]]
    in_model = () if final.asked is None or is_plain else final.asked.ids
    result = replace(result, effects=in_model)
    sampling_s = max(outcome.sampling_s for outcome in outcomes.values())
    return Calibration(
        motor, tuple(tests), posteriors, predictions, result, sampling_s, final.asked,
        final.screened,
    )  # fmt: skip


REFUSED = 20.0
"""Log Bayes factor of a larger network from which on a smaller one is not sampled [nat]: what the
tests refuse needs no intervals of its own."""


def _of_same_readings(one: Fit, other: Fit) -> bool:
    """Whether two networks were fitted to the same readings, so that evidence holds them apart."""
    seen = [[test.fitted for test in each.problem.tests] for each in (one, other)]
    return seen[0] == seen[1]


@dataclass(frozen=True)
class _Fitted:
    """What was fitted for one network, and what it was found to miss."""

    fit: Fit
    asked: Found | None
    screened: SmallEffects | None
    attempts: Attempts


@dataclass(frozen=True)
class _Outcome:
    """What was found for one network."""

    posterior: Posterior
    predictions: list[Prediction]
    described: FittedModel
    findings: list[Finding]
    sampling_s: float
    asked: Found | None
    screened: SmallEffects | None


def _searched(
    found: Fit,
    kinds: Sequence[type[AbstractEffect]] | None,
    seed: int,
    work: Work,
    attempts: Attempts,
) -> tuple[Fit, SmallEffects | None]:
    """Return the fit and what it misses; with several tests, the fit may change between them."""
    title = found.problem.model.title

    def search(fit: Fit) -> SmallEffects | None:
        return attempts.of(
            "the search for missing effects", lambda: small_effects(fit, kinds), None, where=title
        )

    screened = search(found)
    if len(found.problem.tests) > 1:
        name = found.problem.model.name
        work.at((name, "missing"), f"{title}: comparing the tests with each other")
        best = max(() if screened is None else screened.log_bayes, default=-math.inf)
        changed = attempts.of(
            "the comparison of the tests",
            lambda: fit_with_changes(found, beyond=best, seed=seed),
            found,
            where=title,
        )
        if changed is not found:
            return changed, search(changed)
    return found, screened


def _fit_findings(
    posterior: Posterior,
    screened: SmallEffects | None,
    predicted: Sequence[Prediction],
    *,
    is_last: bool,
) -> list[Finding]:
    """Return what a posterior, its missing effects and its predictions show of a network."""
    lacks = None if screened is None else missing_finding(posterior.fit, screened)
    seen = [each for each in (lacks, changes_finding(posterior)) if each is not None]
    return seen + (fit_findings(posterior, predicted) if is_last else [])


def _sampled(
    found: Fit,
    screened: SmallEffects | None,
    settings: Settings,
    folder: RunFolder | None,
    progress: Callable[[str, float], None],
    attempts: Attempts,
) -> Posterior:
    """Return the posterior of a fit, averaged over the effects that its network may miss."""
    name, title = found.problem.model.name, found.problem.model.title
    checkpoints = None if folder is None else folder.checkpoints / name
    method, seed = settings.method, settings.seed

    posterior = attempts.of(
        "the sampling of the posterior",
        lambda: sample(found, method=method, seed=seed, folder=checkpoints, progress=progress),
        None,
        where=title,
    )
    if posterior is None:
        posterior = normal_draws(found, seed=seed)
    if screened is None or not screened.effects:
        return posterior
    return attempts.of(
        "the average over effects that may be missing",
        lambda: averaged(posterior, screened, seed=seed),
        posterior,
        where=title,
    )


def describe_tests(
    fit: Fit, tests: Sequence[BenchTest], motor: Motor, attempts: Attempts, work: Work = SILENT
) -> tuple[list[DescribedTest], list[Finding]]:
    """Return what is said of each test, and what reducing them to blocks has cost.

    Args:
        fit: That the error of the reduction is judged by.
        tests: All tests.
        motor: The machine.
        attempts: Told which check failed.
        work: Told how far it is.
    """
    rows, findings = [], []
    for number, test in enumerate(tests):
        doing = f"checking the reduction of test {number + 1} of {len(tests)}"
        work.at("reduction", doing, number / len(tests))
        error, found = attempts.of(
            "the check of the reduction",
            lambda test=test: check_reduction(fit, test.record, test.blocks, motor),
            (math.nan, []),
            where=test.record.name,
            test=test.record.name,
        )
        rows.append(describe_test(test.record, test.blocks, motor, test.role, error))
        findings += found
    return rows, findings


def identity(motor: Motor, tests: Sequence[BenchTest], **settings: Any) -> dict[str, Any]:
    """Return what makes an unfinished run the same as this one: inputs, settings and versions."""
    return {
        "motor": motor.sha256,
        # the reader names the sheet of a workbook, which holds several tests
        "tests": [
            [part for s in test.record.sources for part in (s.sha256, s.reader)]
            + [test.role, test.record.stretch]
            for test in tests
        ],
        **settings,
        **environment(),
    }


def manifest(calibration: Calibration, settings: Settings) -> dict[str, Any]:
    """Return what a run folder's manifest says."""
    return {
        "format": "heatrun-run/1",
        "command": settings.command,
        "seed": settings.seed,
        "date": moment().isoformat(timespec="seconds"),
        "platform": platform.system(),
        "inputs": [
            {"path": calibration.motor.path, "sha256": calibration.motor.sha256},
            *(
                {"path": source.path, "sha256": source.sha256, "role": test.role}
                for test in calibration.tests
                for source in test.record.sources
            ),
        ],
        **environment(),
    }


def refuse_unplaced_bodies(motor: Motor, models: Sequence[Model]) -> None:
    """Refuse a motor file that fits a body as a node that no network has.

    Raises:
        InputError: With the nodes that there are.
    """
    nodes = list(dict.fromkeys(node for model in models for node in model.form.nodes))
    for channel, node in motor.sensors.items():
        if node not in (*nodes, "none"):
            raise InputError(
                f'{channel} = "{node}" names no node of the networks; there are '
                f"{', '.join(nodes)}.",
                where=f"{motor.path or motor.name}, [sensors]",
                remedy=did_you_mean(node, nodes)
                or 'Write "none" to hold the body against the model without fitting it.',
            )


def _with_distinct_names(records: list[tuple[Record, str]]) -> list[tuple[Record, Any]]:
    """Number records that share a name, since parameters of a test carry it."""
    seen: dict[str, int] = {}
    result = []
    for record, role in records:
        seen[record.name] = seen.get(record.name, 0) + 1
        count = seen[record.name]
        named = record if count == 1 else replace(record, name=f"{record.name} ({count})")
        result.append((named, role))
    return result


def _sampling_findings(posterior: Posterior) -> list[Finding]:
    if posterior.is_sound or posterior.behind is not None:
        return []
    return [
        Finding(
            id="sampling_not_converged",
            severity="warning",
            message=f"{posterior.fit.problem.model.title}: {posterior.sentence()}",
            where=posterior.fit.problem.label,
            remedy="Add a test that makes the parameters distinguishable, or fix one of them in "
            "the motor file.",
        )
    ]
