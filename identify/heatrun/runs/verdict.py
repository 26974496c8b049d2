"""Whether a result can be used, in words that a customer understands."""

import math
from collections.abc import Sequence
from dataclasses import replace

from ..checks.suitability import SIMULATED, doubts
from ..io.quantities import clean, enumerated, rounded
from ..record.findings import FAILED, ORDER, with_doubt
from ..record.record import Finding
from ..results import FitResult
from ..results.model import AT_REST, LOADED, FittedModel, FittedParameter, UseVerdict
from ..results.values import known, number

USES: dict[str, str] = {
    "Ceq": "warm-up and time to a limit",
    "Req": "steady temperatures and continuous current",
    "Ceq_w": "overloads of minutes",
    "Ceq_sr": "warm-up and time to a limit",
    "Req_w": "the rise of the winding above the stator",
    "Req_sr": "steady temperatures and continuous current",
}
"""What a parameter of the networks of the thesis is needed for."""

CAPACITY, RESISTANCE = "loads that change", "steady temperatures"
"""What the parameters of other networks are needed for."""

LOW_COVERAGE = 0.8
"""Share of held-out readings inside the 95 % band below which predictions are doubted [1]."""

NOT_FOLLOWED = 0.05
"""RMSE of a fitted test over the rise of its winding from which on a network does not follow it
[1]; in a good fit it is some thousandths."""

INCOMPLETE = with_doubt("network")
"""Findings that the tests show more than the network has."""

LEFT_OUT, AMBIGUOUS = "effects_left_out", "effect_ambiguous"
"""Of them, the finding of a run with --plain; and that of effects that the tests do not part. The
intervals allow for each of these, so that it restricts nothing (`docs/trust.md`)."""

TAKEN_UP = ("instrument_beyond_prior", "prior_conflict")
"""Findings that a parameter stands where nobody expects it."""

BEFORE_PARAMETERS = with_doubt("parameters")
"""Findings that leave no parameter to be used."""

DECIDING = with_doubt(*filter(None, ORDER))
"""Findings that restrict the use of a result, the gravest first."""

BEYOND = 3.0
"""Prior standard deviations from which on such a parameter makes all others worthless [1]."""


def favoured(result: FitResult) -> str:
    """Return the name of the network that a certificate states: the favoured one, or the last."""
    order = result.verdict.order
    return order if order in result.models else list(result.models)[-1]


def headline(result: FitResult) -> UseVerdict:
    """Return whether the network that the data favour can be used, and for what not."""
    model = result.models[favoured(result)]
    title = _title(model)
    free = {name: entry for name, entry in thermal(model).items() if not entry.fixed}
    lost = [name for name, entry in free.items() if entry.identifiability == "not identifiable"]
    weak = [name for name, entry in free.items() if entry.identifiability == "weak"]
    reasons = (
        *restrictions(result), *not_told_apart(result), *against_others(result), *_warnings(result),
        *_accuracy(model),
    )  # fmt: skip
    if model.result != "converged":
        return UseVerdict(
            "not usable",
            f"{title}. The fit did not converge: do not use these parameters.",
            reasons,
        )
    simulated = [one.test for one in result.findings if one.id == SIMULATED]
    if simulated:
        return UseVerdict(
            "not usable",
            f"{title}. No measurement: {_listed(simulated)} was simulated by heatrun. These are "
            "the parameters of that simulation, not of a machine.",
            reasons,
        )
    astray = _not_followed(result, model) or _taken_up(result)
    if astray:
        return UseVerdict("not usable", f"{title}. {astray}", reasons)
    only = _time_constants_only(result, model)
    if only and len(lost) == len(free):
        return UseVerdict("not usable", f"{title}. {only}", reasons)
    if lost:
        are = "is" if len(lost) == 1 else "are"
        return UseVerdict(
            "not usable" if len(lost) == len(free) else "restricted",
            f"{title}. {len(lost)} of {len(free)} parameters {are} not identifiable from these "
            f"tests ({', '.join(lost)}): do not use for {_uses(lost)}.",
            reasons,
        )
    if weak:
        are = "is" if len(weak) == 1 else "are"
        return UseVerdict(
            "restricted",
            f"{title}. {len(weak)} of {len(free)} parameters {are} known only roughly "
            f"({', '.join(f'{n} ± {_percent(free[n])}' for n in weak)}): allow for it in "
            f"{_uses(weak)}.",
            reasons,
        )
    is_restricted = not model.posterior.is_sound or bool(_inputs(result)) or _unjudged(result)
    if is_restricted or _fails_held_out(model) or _incomplete(result):
        return UseVerdict(
            "restricted",
            f"{title}. All {len(free)} parameters are identified, with the restrictions below.",
            reasons,
        )
    return UseVerdict(
        "usable",
        f"{title}. All {len(free)} parameters are identified: the network can be used within the "
        "conditions of the tests.",
        reasons,
    )


def restrictions(result: FitResult) -> list[str]:
    """Return what restricts the use of the favoured network, apart from its own parameters."""
    return [*_inputs(result), *_doubts(result, result.models[favoured(result)])]


def deciding(result: FitResult) -> list[Finding]:
    """Return the findings that restrict the use of the favoured network, the gravest first; of
    parameters, the one that stands farthest from its prior.
    """
    ranks = {id: rank for rank, id in enumerate(DECIDING)}
    return sorted(
        (f for f in _warned(result) if f.id in ranks),
        key=lambda f: (ranks[f.id], -abs(f.values.get("prior_sd") or 0.0)),
    )


def judged(result: FitResult) -> FitResult:
    """Return a result with its verdict.

    Where an error of an instrument has taken up what the network lacks, no parameter is identified,
    however narrow its interval.

    Args:
        result: With all its findings.
    """
    because = _taken_up(result)
    if because:
        model = result.models[favoured(result)]
        entries = {
            name: replace(entry, identifiability="weak", why=because)
            if entry.identifiability == "identified"
            else entry
            for name, entry in model.parameters.items()
        }
        derived = {
            name: replace(figure, identifiability="weak")
            if known(figure.identifiability) == "identified"
            else figure
            for name, figure in model.derived.items()
        }
        changed = replace(model, parameters=entries, derived=derived)
        models = {**result.models, favoured(result): changed}
        result = replace(result, models=models)
    return replace(result, use=headline(result))


def _time_constants_only(result: FitResult, model: FittedModel) -> str:
    """Return what a cooling curve says, as a sentence; empty where the tests are none."""
    found = (model.derived.get(name) for name in ("tau_s", "tau_fast_s", "tau_slow_s"))
    told = [f"{rounded(tau.median)} s" for tau in found if tau and math.isfinite(tau.median)]
    is_cooling = any(f.id == "no_heating" and f.severity == "warning" for f in result.findings)
    if not told or not is_cooling:
        return ""
    return f"The tests give time constants only: {' and '.join(told)}."


def _title(model: FittedModel) -> str:
    """Return the network with the effects in it, to begin a sentence."""
    return f"{model.title.capitalize()} {model.effects_in_words()}".rstrip()


def _taken_up(result: FitResult) -> str:
    """Return which parameter stands far from its prior, as a sentence; empty if none does."""
    far = [
        (abs(score), finding)
        for finding in result.findings
        if finding.id in TAKEN_UP and concerns(finding, result)
        if abs(score := finding.values.get("prior_sd") or 0.0) > BEYOND
    ]
    if not far:
        return ""
    score, worst = max(far, key=lambda each: each[0])
    name = next(each for each in worst.values if each not in ("prior_sd", "familywise_p"))
    return (
        f"{clean(name)} stands {score:.1f} standard deviations from its prior: it may have taken "
        "up what the network lacks, and no parameter is identified."
    )


def thermal(model: FittedModel) -> dict[str, FittedParameter]:
    """Return the parameters of the network itself, without those of the winding and of effects.

    One that effects change is judged as it is printed: at stated conditions, the least known of
    them.
    """
    own = {n: p for n, p in model.parameters.items() if p.unit != "ohm" and "." not in n}
    return {name: _as_stated(model, name, entry) for name, entry in own.items()}


def _as_stated(model: FittedModel, name: str, entry: FittedParameter) -> FittedParameter:
    figures = [model.derived.get(f"{name}{ending}") for ending in (LOADED, AT_REST)]
    stated = [each for each in figures if each is not None and known(each.identifiability)]
    if not stated:
        return entry
    worst = max(stated, key=lambda each: number(known(each.sd)) / each.median)
    return replace(
        entry,
        value=worst.median,
        sd=number(known(worst.sd)),
        identifiability=worst.identifiability,
    )


def _uses(names: Sequence[str]) -> str:
    """Return what parameters are needed for, in words."""
    return enumerated(dict.fromkeys(
        USES.get(name, CAPACITY if name.startswith("Ceq") else RESISTANCE) for name in names
    ))  # fmt: skip


def _percent(entry: FittedParameter) -> str:
    return f"{rounded(200.0 * entry.sd / abs(entry.value), 2)} %" if entry.value else "unknown"


def _accuracy(model: FittedModel) -> list[str]:
    """Return how well the network follows the tests, held-out ones first: the worst of each."""
    words = []
    for role, named in (("holdout", "Held-out test"), ("calibration", "Fitted test")):
        rows = [row for row in model.residuals if row.role == role]
        if rows:
            worst = max(rows, key=lambda row: row.rmse_K)
            among = f", the worst of {len(rows)}" if len(rows) > 1 else ""
            words.append(
                f"{named} {worst.test}{among}: RMSE {worst.rmse_K:.2f} K, maximum error "
                f"{max(row.max_K for row in rows):.1f} K, "
                f"{100 * min(row.coverage_95 for row in rows):.0f} % of the readings in the 95 % "
                "band."
            )
    return words


def _inputs(result: FitResult) -> list[str]:
    """Return what is in doubt about the inputs themselves, in a sentence for each test."""
    names = dict.fromkeys(finding.test for finding in result.findings)
    words = []
    for name in names:
        about_test = [one for one in result.findings if one.test == name]
        found = doubts([one for one in about_test if one.id != SIMULATED])
        if found:
            about = f"In doubt about {clean(name)}" if name else "In doubt"
            words.append(f"{about}: {'; '.join(found)}. See Findings.")
    return words


def _listed(names: Sequence[str]) -> str:
    return ", ".join(clean(name) for name in dict.fromkeys(names))


def _fails_held_out(model: FittedModel) -> bool:
    return any(row.role == "holdout" and row.coverage_95 < LOW_COVERAGE for row in model.residuals)


def _not_followed(result: FitResult, model: FittedModel) -> str:
    """Return which fitted test the network does not follow, as a sentence; empty if it does."""
    tests = {test.name: test for test in result.tests}
    for row in model.residuals:
        test = tests.get(row.test)
        if row.role != "calibration" or test is None:
            continue
        if test.winding_degC is None or test.sink_degC is None:
            continue
        rise = test.winding_degC[1] - test.sink_degC[0]
        if rise > 0 and row.rmse_K > NOT_FOLLOWED * rise:
            return (
                f"The network does not follow the fitted test {clean(row.test)} (RMSE "
                f"{row.rmse_K:.1f} K, {100 * row.rmse_K / rise:.0f} % of the rise): do not use it."
            )
    return ""


def _incomplete(result: FitResult) -> set[str]:
    """Return the ids of the findings that the network is not complete."""
    return {f.id for f in _warned(result) if f.id in INCOMPLETE}


def not_told_apart(result: FitResult) -> list[str]:
    """Return that the tests do not tell effects apart, in a sentence."""
    if all(finding.id != AMBIGUOUS for finding in _warned(result)):
        return []
    return [
        "The tests do not tell which of several effects the machine has: the intervals allow for "
        "each."
    ]


def _unjudged(result: FitResult) -> bool:
    """Return whether a step that judges the result failed."""
    return any(f.id == FAILED and concerns(f, result) for f in result.findings)


def _doubts(result: FitResult, model: FittedModel) -> list[str]:
    """Return what restricts the use, in sentences."""
    words = []
    if _fails_held_out(model):
        words.append(
            "The 95 % band misses too many readings of a held-out test: do not rely on it for "
            "predictions of other tests."
        )
    if not model.posterior.is_sound:
        words.append("The intervals are indicative: the diagnostics of the sampling are not met.")
    incomplete = _incomplete(result)
    if LEFT_OUT in incomplete:
        words.append(
            "The network lacks effects that the tests ask for: its intervals are wider for it."
        )
    elif incomplete:
        words.append(
            "The network lacks something that the tests show: its intervals are wider for it, and "
            "`heatrun discover` searches for what it is."
        )
    if _unjudged(result):
        words.append("A step that judges the result failed: it may be worse than it looks.")
    return words


def _warned(result: FitResult) -> list[Finding]:
    """Return the warnings and errors that are about the stated network."""
    return [f for f in result.findings if f.severity != "note" and concerns(f, result)]


def _warnings(result: FitResult) -> list[str]:
    warnings = _warned(result)
    number = "1 warning" if len(warnings) == 1 else f"{len(warnings)} warnings"
    return [f"{number} of the checks: see Findings."] if warnings else []


def against_others(result: FitResult) -> list[str]:
    """Return how sure the choice of the network is, in plain words."""
    factor = result.verdict.log_bayes_factor
    if len(result.models) != 2 or factor is None or not math.isfinite(factor):
        return []
    small, large = (model.title for model in result.models.values())
    if result.verdict.order == "undecided":
        return [f"The data do not decide between {small} and {large}."]
    chance = 1.0 / (1.0 + math.exp(min(abs(factor), 700.0)))
    other = large if factor < 0 else small
    spoken = "below 0.1 %" if chance < 0.001 else f"{rounded(100.0 * chance, 2)} %"
    return [f"Chance that the {other} describes the fitted tests better: {spoken}."]


def concerns(finding: Finding, result: FitResult) -> bool:
    """Return whether a finding is not about another network than the one that is stated."""
    return known(finding.network) in (None, favoured(result))
