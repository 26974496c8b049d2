"""The report on several prototypes: one view of virtual, semi-real, real and repeats."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from itertools import combinations
from pathlib import Path

from heatrun.motor import Motor

from ..analysis.compare_signals import VERDICTS
from ..analysis.tolerances import PERCENT, RULE
from ..card import PROTOTYPES
from ..figures import prototypes as figures
from ..figures.plot import wording
from ..independence import before, fitted_by, same_file, simulated_as
from ..report import Drawing, Report
from .confront import Confrontation, confront
from .on_network import judge_network
from .prototype import Prototype, is_virtual
from .summary import summary
from .tables import rows, signals_of, tables

DEFINITIONS = (
    ("Difference", "The later prototype less the earlier one, as the pair is named; means are "
                   "weighted by time."),
    ("Clocks", "Each pair of clocks is aligned by the signals that the two records share; the "
               "offset is what is added to the earlier one's clock to give the later one's. All "
               "comparisons are over the time common to all prototypes."),
    ("Tolerance", RULE),
    ("Decided by", "rise, magnitude: the share of it; instruments: the combined uncertainty, which "
                   "is the larger limit; given: by --tolerance."),
    *((verdict.capitalize(), text) for verdict, text in VERDICTS.items()),
    ("Figures", f"Energy, distance and consumption agree within {PERCENT} of the earlier one's."),
)  # fmt: skip

NETWORK = (
    "Network",
    "The network of the run, driven by the currents, losses and sink of the record itself or, "
    "where it lacks them, of the one that is named; its reading against the measured winding, with "
    "the 95 % band of the prediction in the tolerance.",
)


def prototypes_report(
    motor: Motor,
    prototypes: tuple[Prototype, ...],
    *,
    run: Path | None = None,
    tolerances: Mapping[str, float] | None = None,
) -> Report:
    """Return the comparison of any number of prototypes.

    Args:
        motor: The machine.
        prototypes: Two or more.
        run: Folder of a calibration whose network is held against each; None for none.
        tolerances: By channel or figure, in its unit (K for temperatures).

    Raises:
        InputError: If they cannot be aligned, or the run cannot be read.
    """
    found = confront(prototypes, motor, tolerances)
    if run is not None:
        networks, findings = judge_network(run, prototypes, found.shift_s, motor, tolerances)
        found = replace(found, networks=networks, findings=(*found.findings, *findings))
    roles = [prototype.role for prototype in prototypes]
    return Report(
        kind="prototypes",
        title=PROTOTYPES.title,
        test=f"{', '.join(roles[:-1])} and {roles[-1]}",
        motor=motor.name,
        summary=before(_first(found, run), summary(found)),
        rows=rows(found),
        tables=tables(found),
        drawings=_drawings(found, motor),
        findings=_findings(found),
        definitions=(*DEFINITIONS, *((NETWORK,) if found.networks else ())),
        channels=signals_of(found),
        sources=tuple(source for p in prototypes for source in p.record.sources),
        result=found,
    )


def _first(found: Confrontation, run: Path | None) -> list[str]:
    """What makes the comparison weaker than it looks."""
    sentences = []
    for prototype in found.prototypes:
        if not is_virtual(prototype.role):
            sentences.append(simulated_as(prototype.role, prototype.record))
        if prototype.simulated is not None and prototype.simulated.is_seen:
            sentences.append(fitted_by(Path(prototype.reference.run), found.base.record))
    for first, second in combinations(found.prototypes, 2):
        sentences.append(same_file(first.record, second.record))
    if run is not None:
        sentences += [fitted_by(run, one.prototype.record) for one in found.networks if one.is_seen]
    return sentences


def _drawings(found: Confrontation, motor: Motor) -> tuple[Drawing, ...]:
    drawings = [
        Drawing(
            f"signal_{channel}",
            f"Above, {wording(channel)} of all prototypes on the clock of {found.base.role}; "
            "below, the differences of the pairs, with their tolerances as broken lines.",
            partial(figures.overlay, found, motor, channel),
        )
        for channel in signals_of(found)
    ]
    if found.networks:
        drawings.append(
            Drawing(
                "network",
                "Measured winding of each prototype with the prediction of the run's network and "
                "its 95 % band; below, measured less predicted.",
                partial(figures.networks, found),
            )
        )
    return tuple(drawings)


def _findings(found: Confrontation):
    of_records = [finding for p in found.prototypes for finding in p.record.findings]
    of_pairs = [finding for pair in found.pairs for finding in pair.validation.findings]
    unused = [f for f in of_pairs if f.id == "tolerance_not_used"]
    # a tolerance may be meant for one pair alone
    never = unused[:1] if len(unused) == len(found.pairs) else []
    rest = [f for f in of_pairs if f.id not in ("tolerance_not_used", "not_compared")]
    return (*of_records, *found.findings, *rest, *never)
