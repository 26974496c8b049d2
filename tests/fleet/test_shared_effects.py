"""Effects that the machines of a type share: on scores that are drawn, and the path to them."""

import json
from dataclasses import replace

import jax.numpy as jnp
import jsonschema
import numpy as np
import pyarrow
import pyarrow.parquet
import pytest
from simulated_fleet import planned, write_fleet

from heatrun import cli
from heatrun.errors import InputError
from heatrun.fit.fit import fit
from heatrun.fit.restricted import whiten_fit
from heatrun.model.problem import Problem, linearise
from heatrun.results import to_json
from heatrun.results.schema import schema_of
from heatrun_fleet.machine import Prepared, prepare
from heatrun_fleet.results import SCHEMAS
from heatrun_fleet.rows import effect_columns, evidence_in
from heatrun_fleet.shared_effects.job import NAME, discover_fleet, discovery_text, read_discovery
from heatrun_fleet.shared_effects.pooled import Evidence, evidence_of, pool
from heatrun_fleet.shared_effects.search import FEWEST, discover_type
from lptn.effects import EFFECTS as EFFECTS_OF_CATALOGUE

PARAMETERS = ("Req_sr", "power_gain", "sensor_gain", "Tsr_start[1]")
EFFECTS = ("radiation.eA", "natural_convection.f|n=0.29", "speed_cooling.g|m=0.75",
           "ac_copper_loss.k", "loss_gain.g", "contact_drift.d")  # fmt: skip
NUM_P = len(PARAMETERS)


def prior_sd(id):
    """Half the reach of an effect's amplitude [its unit]."""
    kind = next(kind for kind in EFFECTS_OF_CATALOGUE if kind.card.id == id)
    quantity = next(q for q in kind.card.parameters.values() if q.null is not None)
    null = quantity.null or 0.0
    return 0.5 * max(quantity.high - null, null - quantity.low)


SCALE = np.array([prior_sd(each.partition(".")[0]) for each in EFFECTS])


def information(seed=0):
    """What one machine's tests say: 40 whitened blocks; loss_gain is nearly the power meter."""
    rng = np.random.default_rng([125, seed])
    J = rng.standard_normal((40, NUM_P)) * [8.0, 1.0, 1.0, 2.0]
    h = rng.standard_normal((40, len(EFFECTS)))
    h[:, 1] = h[:, 0] + 0.1 * rng.standard_normal(40)  # twins
    h[:, 4] = 5.0 * J[:, 1] + 0.02 * rng.standard_normal(40)
    columns = np.column_stack([J, h])
    V = np.linalg.inv(np.eye(40) + J @ J.T)
    return columns.T @ V @ columns


def machines(num, seed, shared=None, effect=None, size=0.0, spread=0.2):
    """Evidence of machines with errors that they share, each with an own spread of the effect."""
    rng = np.random.default_rng([126, seed])
    L = information()
    root = np.linalg.cholesky(L + 1e-9 * np.eye(len(L)))
    x = np.zeros(len(L))
    x[:NUM_P] = rng.standard_normal(NUM_P) if shared is None else shared
    evidence = []
    for _ in range(num):
        own = x.copy()
        if effect is not None:
            own[NUM_P + EFFECTS.index(effect)] = size * (1.0 + spread * rng.standard_normal())
        score = L @ own + np.exp(0.3 * rng.standard_normal()) * root @ rng.standard_normal(len(L))
        evidence.append(Evidence(PARAMETERS, EFFECTS, SCALE, score, L, np.full(len(EFFECTS), 0.3)))
    return [f"M{i}" for i in range(num)], evidence


def found(num, seed, *settings, **more):
    _, evidence = machines(num, seed, *settings, **more)
    return discover_type("A", evidence, {"Req_sr"}, seed=seed)


def test_a_row_gives_the_evidence_back():
    _, (evidence,) = machines(1, 0)
    again = evidence_in(effect_columns(evidence))
    assert (again.parameters, again.effects) == (evidence.parameters, evidence.effects)
    assert again.score == pytest.approx(evidence.score, rel=1e-15)
    assert again.information == pytest.approx(evidence.information, rel=1e-12)


def test_fleets_without_effects_show_one_in_twenty_times():
    hits = sum(bool(found(30, seed).effects) for seed in range(150))
    assert hits <= 15  # of 150 at 5 %: more has a probability of 0.4 %


def test_an_effect_that_hardly_a_machine_shows_is_found_over_many():
    every = [found(60, s, effect="ac_copper_loss.k", size=0.15) for s in range(10)]
    assert sum(bool(f.effects) and f.effects[0].id == "ac_copper_loss" for f in every) >= 9
    assert np.mean([f.num_alone / f.num_machines for f in every]) < 0.25
    size = [effect.size for f in every for effect in f.effects if effect.id == "ac_copper_loss"]
    scale = 0.15 * prior_sd("ac_copper_loss")
    assert sum(s.interval_95[0] < scale < s.interval_95[1] for s in size) >= 8


def test_twins_are_named_together():
    every = [found(60, s, effect="radiation.eA", size=0.25) for s in range(10)]
    sets = [{f.effects[0].id, *f.effects[0].equivalents} for f in every if f.effects]
    assert len(sets) >= 9
    assert sum({"radiation", "natural_convection"} <= each for each in sets) >= 8
    assert {f.verdict for f in every} <= {"ambiguous", "named", "nothing_found", "unexplained"}


@pytest.mark.parametrize("off", [-3.0, 3.0])
def test_an_instrument_that_is_off_for_all_machines_is_no_effect(off):
    every = [found(100, s, shared=np.array([0.0, off, 0.0, 0.0])) for s in range(20)]
    assert not any(f.verdict in ("named", "ambiguous") for f in every)
    said = [f.effects[0].instruments[0].name for f in every if f.effects]
    assert set(said) <= {"power_gain"}


def test_what_only_an_instrument_could_be_told_from_says_the_instrument():
    every = [found(100, s, np.zeros(4), "loss_gain.g", 0.7) for s in range(10)]
    assert sum(bool(f.effects) for f in every) >= 8
    assert all(f.verdict == "instrument" for f in every if f.effects)
    rivals = {rival.name for f in every for e in f.effects for rival in e.instruments}
    assert rivals == {"power_gain"}


def test_what_no_plausible_size_explains_is_no_find_and_is_said():
    every = [found(40, s, effect="contact_drift.d", size=8.0, spread=0.02) for s in range(3)]
    assert all(f.verdict == "unexplained" for f in every)
    assert not any(e.id == "contact_drift" for f in every for e in f.effects)


def test_a_few_machines_that_are_far_off_make_no_find():
    hits = 0
    for seed in range(40):
        _, evidence = machines(40, seed)
        for each in evidence[:2]:
            each.score[NUM_P + 3] += 60.0 * np.sqrt(each.information[NUM_P + 3, NUM_P + 3])
        hits += bool(discover_type("A", evidence, {"Req_sr"}, seed=seed).effects)
    assert hits <= 6  # of 40 at 5 %: more has a probability of 0.3 %


def test_machines_may_differ_in_tests_and_channels():
    _, evidence = machines(40, 3, effect="contact_drift.d", size=0.6)
    keep = [0, 1, 2, *(NUM_P + i for i in (0, 3, 5))]  # no second start, three effects alone
    short = [
        Evidence(PARAMETERS[:3], tuple(EFFECTS[i] for i in (0, 3, 5)), SCALE[[0, 3, 5]],
                 e.score[keep], e.information[np.ix_(keep, keep)], e.visible_K[[0, 3, 5]])
        for e in evidence[:15]
    ]  # fmt: skip
    whole = pool([*short, *evidence[15:]])
    assert tuple(each.label for each in whole.columns[:3]) == short[0].effects
    result = discover_type("A", [*short, *evidence[15:]], {"Req_sr"})
    assert result.effects[0].id == "contact_drift"
    counts = {each.id: each.num_machines for each in result.screened}
    assert counts["contact_drift"] == 40
    assert counts["speed_cooling"] == 25


def test_machines_of_other_sizes_speak_of_one_amplitude():
    """What twice as large a machine says of a score is as much as half of it says elsewhere."""
    _, evidence = machines(40, 3, effect="contact_drift.d", size=0.6)

    def twice(each):
        shrunk = np.ones(each.score.size)
        shrunk[NUM_P:] = 2.0
        longer = tuple(label.replace("m=0.75", "m=1.5") for label in each.effects)
        return replace(
            each, effects=longer, scale=2.0 * each.scale, score=shrunk * each.score,
            information=shrunk[:, None] * each.information * shrunk, visible_K=2.0 * each.visible_K,
        )  # fmt: skip

    alike = pool(evidence)
    mixed = pool([*evidence[:25], *map(twice, evidence[25:])])
    assert mixed.columns == alike.columns
    assert mixed.score == pytest.approx(alike.score)
    assert mixed.information == pytest.approx(alike.information)
    assert mixed.visible_K == pytest.approx(alike.visible_K)


def rows_of(type, names, evidence):
    """Rows of a fleet with what its tests say; the fit of a machine `M0` did not converge."""
    return [
        {"machine": n, "type": type, "status": "fitted", "is_converged": not n.endswith("M0"),
         "parameters": ["Req_sr"], **effect_columns(e)}
        for n, e in zip(names, evidence, strict=True)
    ]  # fmt: skip


def discovered(folder, table):
    rows = folder / "machines.parquet"
    pyarrow.parquet.write_table(pyarrow.Table.from_pylist(table), rows)
    return discover_fleet(rows, "line")


def test_too_few_machines_say_so(tmp_path):
    _, evidence = machines(FEWEST - 1, 0)
    table = rows_of("A", [f"M{i}" for i in range(1, FEWEST)], evidence)
    table.append({**table[0], "machine": "M99", "status": "refused", "effects": []})
    (said,) = discovered(tmp_path, table).types
    assert (said.verdict, said.num_machines) == ("too_few", FEWEST - 1)
    assert [(each.machine, each.reason) for each in said.left_out] == [("M99", "refused")]
    assert "10" in said.sentence


def test_the_result_holds_to_its_schema_and_reads_as_words(tmp_path):
    table = []
    for type, settings in (("A", {"effect": "radiation.eA", "size": 0.8}), ("B", {})):
        names, evidence = machines(30, 5, **settings)
        table += rows_of(type, [type + n for n in names], evidence)
    result = discovered(tmp_path, table)
    jsonschema.validate(json.loads(to_json(result)), schema_of("fleet-discovery-1.json", SCHEMAS))
    (tmp_path / NAME).write_text(to_json(result))
    assert to_json(read_discovery(tmp_path)) == to_json(result)
    with pytest.raises(InputError, match="--discover"):
        read_discovery(tmp_path / "nowhere")
    text = discovery_text(result)
    assert "Type A: The 29 machines share one of radiation, natural_convection" in text
    assert "Type B: No effect that matters is shared by the 29 machines" in text
    assert "without AM0 (the fit did not converge)" in text
    assert "what would tell: a cool-down at standstill" in text


def test_a_fleet_that_is_told_to_discover_keeps_what_its_tests_say(tmp_path, capsys):
    write_fleet(tmp_path, num=2)
    words = ["fleet", str(tmp_path / "FLEET.toml"), "--workers", "0", "--discover",
             "--out", str(tmp_path / "out")]  # fmt: skip
    assert cli.main(words) == 0
    said = capsys.readouterr().out
    assert "Type A: Effects that machines share are sought from 10 machines on" in said
    assert "fleet_discovery.json" in said
    row = pyarrow.parquet.read_table(tmp_path / "out" / "machines.parquet").to_pylist()[0]
    evidence = evidence_in(row)
    assert set(evidence.parameters) >= set(row["parameters"])
    assert any(name.startswith("natural_convection.f|n=") for name in evidence.effects)
    assert not any(name.startswith("speed_cooling") for name in evidence.effects)  # no channel
    assert not any(name.startswith("cooling_step") for name in evidence.effects)  # an event
    assert np.linalg.eigvalsh(evidence.information).min() > -1e-6 * evidence.information.max()
    assert (read_discovery(tmp_path / "out").types[0].verdict) == "too_few"
    # without the word there are none, and an older find does not stay beside other rows
    assert cli.main([w for w in words if w != "--discover"] + ["--force"]) == 0
    row = pyarrow.parquet.read_table(tmp_path / "out" / "machines.parquet").to_pylist()[0]
    assert row["effects"] == []
    assert not (tmp_path / "out" / NAME).exists()


@pytest.mark.slow
def test_the_evidence_is_that_of_the_model_with_the_effect(tmp_path):
    """The slope of the log likelihood by an effect is that of finite differences."""
    write_fleet(tmp_path, num=1)
    fitted = fit_of(tmp_path)
    evidence = evidence_of(fitted)
    place = evidence.effects.index("contact_drift.d")
    kind = next(kind for kind in EFFECTS_OF_CATALOGUE if kind.card.id == "contact_drift")
    problem = fitted.problem
    model = replace(problem.model, effects=(kind,))
    extended = replace(
        Problem.of(model, problem.motor, problem.tests, searched=(kind,)), heat=problem.heat
    )
    names = extended.parameters.names
    at = names.index("contact_drift.d")
    assert [n for n in names if n != "contact_drift.d"] == list(problem.parameters.names)

    def marginal(amplitude, shared):
        """Log likelihood of an amplitude, everything else integrated out about the best fit."""
        z = np.insert(fitted.z, at, amplitude)
        own = misfit = fitted.z
        for _ in range(6):
            residual, jacobian = linearise(extended.structure, extended.data, jnp.asarray(z))
            white = whiten_fit(extended, fitted.noise_z, np.asarray(residual),
                               np.asarray(jacobian))  # fmt: skip
            J = np.delete(white.jacobian, at, axis=1)
            own = np.delete(z, at)
            precision = J.T @ J + np.eye(own.size)
            misfit = np.concatenate([white.stacked, own - shared])
            own = own - np.linalg.solve(precision, J.T @ white.stacked + own - shared)
            z = np.insert(own, at, amplitude)
        return -0.5 * float(np.sum(misfit**2))

    step = 0.02
    num = len(evidence.parameters)
    none = np.zeros(num)
    low, middle, high = (marginal(x, none) for x in (-step, 0.0, step))
    curvature = evidence.information[num + place, num + place]
    slope = (high - low) / (2.0 * step)
    assert slope == pytest.approx(evidence.score[num + place], abs=0.02 * np.sqrt(curvature))
    assert -(high - 2.0 * middle + low) / step**2 == pytest.approx(curvature, rel=0.05)
    # and by a shift of where a parameter that all machines share is
    shift = np.zeros(num)
    shift[evidence.parameters.index("sensor_gain")] = 0.05
    slope = (marginal(0.0, shift) - marginal(0.0, -shift)) / 0.1
    assert slope == pytest.approx(evidence.score[evidence.parameters.index("sensor_gain")],
                                  abs=0.02)  # fmt: skip


def fit_of(folder):
    """The fit of the first machine of a fleet on disk."""
    (batch,) = planned(folder, 1)
    ready = prepare(batch.entries[0], batch)
    assert isinstance(ready, Prepared)
    return fit(ready.problem, seed=0)
