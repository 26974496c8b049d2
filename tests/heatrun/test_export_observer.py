"""The observer of an exported C: a Kalman filter that judges its sensor, within its stated band."""

import ctypes
import io
import re
import shutil
import subprocess
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from c_programs import (
    COMPILER,
    LEAD_OHM,
    MISSED,
    STRICT,
    VALUES,
    build,
    checked,
    half_hour,
    hidden_machine,
    in_both_precisions,
    needs_compiler,
    observed,
    run_observer,
    source,
    through_a_lag,
)
from scipy.linalg import expm
from scipy.stats import norm
from simulators import vectors_text

from heatrun.export import export_source, mat_bytes, simulate_network
from heatrun.export.laws import links_of
from heatrun.export.missed import least_told
from heatrun.export.rerun import read_run_test
from heatrun.export.sources import faults, with_outputs, without_false_alarms
from heatrun.export.vectors import observer_courses, readings
from heatrun.record.record import Record
from heatrun.runs.run import open_run

pytestmark = needs_compiler


ASIDE = {"Ceq_w": 1.02, "Ceq_sr": 0.97, "Req_w": 1.05, "Req_sr": 0.96, "Rs0": 1.01}


@pytest.fixture(scope="module")
def observer_vectors(tmp_path_factory):
    """A source with errors that stay, a folder with its files, and the courses of its vectors."""
    aside = {n: factor * VALUES[n] for n, factor in ASIDE.items()}
    made = replace(source(), aside=source(**aside).of_run, missed=replace(
        MISSED, sensor_K=0.4, sink_K=0.5, share=0.01, losses=0.02, answer=0.05))  # fmt: skip
    folder = tmp_path_factory.mktemp("observer_vectors")
    courses = observer_courses(made, "duty")
    text, notes = with_outputs({**made.texts(), "observer_vectors.csv": courses})
    assert not notes
    (folder / "observer_vectors.csv").write_bytes(text)
    (folder / "vectors.csv").write_bytes(vectors_text(made))
    rows = np.genfromtxt(io.BytesIO(text), delimiter=",", names=True, skip_header=1)
    return made, folder, np.split(rows, np.flatnonzero(rows["time_s"] == 0.0)[1:])


def test_the_vectors_of_the_observer_hold_what_a_port_must_show(observer_vectors):
    _, _, (sound, lost, stuck, wrong) = observer_vectors
    assert {len(each) for each in (sound, lost, stuck, wrong)} == {1801}
    told = np.repeat([0, 6, 1, 0], [601, 59, 541, 600])
    for course, expected in ((sound, 0), (lost, told), (wrong, 0)):
        assert np.all(course["sensor"] == expected)
    assert np.all(stuck["sensor"][700:1200] == 2)
    assert stuck["sensor"][-1] == 0
    for node in ("winding", "stator"):
        T, sd = wrong[f"{node}_degC"], wrong[f"{node}_sd_K"]
        assert sound[f"{node}_degC"][0] - T[0] == pytest.approx(30.0)
        assert np.all(np.abs(T - sound[f"{node}_degC"])[900:] < 2.0 * sd[900:])
        assert lost[f"{node}_sd_K"][1200] > 1.1 * sound[f"{node}_sd_K"][1200]
    asked = sound[sound["permitted_A"] >= 0.0]
    assert len(asked) == 30
    assert np.ptp(asked["time_to_limit_s"]) > 100.0


def test_vectors_of_a_sound_sensor_are_the_kalman_filter_of_a_textbook(observer_vectors):
    """Exact steps by the exponential of the matrix; errors that stay are not estimated."""
    made, _, (sound, *_) = observer_vectors
    v, constants = VALUES, made._observer()

    def slopes(v, T, row):
        copper = (
            3 * v["Rs0"] / (234.5 + made.found["Tref"]) * row["current_A"] ** 2 * (234.5 + T[0])
        )
        across, out = (T[0] - T[1]) / v["Req_w"], (T[1] - row["sink_degC"]) / v["Req_sr"]
        return np.array([copper - across, row["losses_W"] - copper + across - out]) / [
            v["Ceq_w"], v["Ceq_sr"]]  # fmt: skip

    C, k = np.array([v["Ceq_w"], v["Ceq_sr"]]), 3 * v["Rs0"] / (234.5 + made.found["Tref"])
    names = ("heat_sd", "slow_sd", "heat_decay", "slow_decay", "reading_sd")
    heat, slow, keeps, keeps_slow, white = (float(constants[name]) for name in names)
    decays, sds = (
        [keeps, keeps, keeps_slow],
        np.array([5, 5, heat, heat, slow, 0.4, 0.5, np.hypot(0.01, 0.02), 1.0]),
    )
    P = np.diag(sds**2)
    Q = np.diag([0.0, 0.0, *(sds[2:5] ** 2 * (1.0 - np.square(decays))), *np.zeros(4)])
    H = np.array([1.0, 0, 0, 0, 1, 1, 0, 0, 0])
    x = np.array([sound["winding_degC"][0], sound["stator_degC"][0], 0.0, 0.0, 0.0])
    for step, row in enumerate(sound[1:]):
        copper = k * row["current_A"] ** 2
        A = np.zeros((10, 10))  # T, heat, slow, sensor, sink, heat as a share, path, 1
        A[0, :3] = copper - 1 / v["Req_w"], 1 / v["Req_w"], 1.0
        A[1, :2] = 1 / v["Req_w"] - copper, -1 / v["Req_w"] - 1 / v["Req_sr"]
        A[1, [3, 6]] = 1.0, 1 / v["Req_sr"]
        A[:2, 9] = copper * 234.5, (row["losses_W"] - copper * 234.5
                                    + row["sink_degC"] / v["Req_sr"])  # fmt: skip
        A[:2] /= C[:, None]
        T = (expm(A) @ [*x[:4], 0, 0, 0, 0, 0, 1.0])[:2]
        own = copper * (234.5 + T[0])
        # the part of the losses, whose square is four times that of all heat
        A[:2, 7] = (np.array([0.2 * own, row["losses_W"] - 0.2 * own]) + 0.2 * x[2:4]) / C
        other = {n: v[n] * factor for n, factor in ASIDE.items()}
        A[:2, 8] = slopes(v | other, T, row) - slopes(v, T, row)
        F = expm(A)[:9, :9]
        F[[2, 3, 4], [2, 3, 4]] = decays
        by_moment = 0.29 * (T[0] - x[0])
        x, P = np.array([*T, *(x[2:] * decays)]), F @ P @ F.T + Q
        if step > 0:  # the first reading is looked at alone
            seen = H @ P
            S = seen @ H + white**2 + by_moment**2
            x = x + seen[:5] / S * (row["reading_degC"] - x[0] - x[4])
            P[:5], P[5:, :5] = (
                P[:5] - np.outer(seen[:5], seen) / S,
                P[5:, :5] - np.outer(seen[5:], seen[:5]) / S,
            )
        found = [row["winding_degC"], row["winding_sd_K"], row["stator_degC"], row["stator_sd_K"]]
        sd = np.sqrt(np.diag(P))
        np.testing.assert_allclose(found, [x[0], sd[0], x[1], sd[1]], rtol=0.0, atol=2e-6)


@in_both_precisions
def test_the_harness_replays_both_and_names_the_line_that_differs_first(observer_vectors, words):
    made, folder, _ = observer_vectors
    command = [build(folder, made, *words), "vectors.csv", "observer_vectors.csv"]
    status, said = checked(folder, *command)
    assert (status, said.count("largest difference")) == (0, 2), said
    lines = (folder / "observer_vectors.csv").read_text().splitlines()
    heading = lines[1].split(",")
    for at, column in ((2345, "stator_sd_K"), (4000, "sensor"), (120 + 3, "permitted_A")):
        wrong = lines.copy()
        for line in (at, at + 60):
            row = wrong[line - 1].split(",")
            row[heading.index(column)] = repr(float(row[heading.index(column)]) + 2.0)
            wrong[line - 1] = ",".join(row)
        (folder / "wrong.csv").write_text("\n".join(wrong) + "\n")
        status, said = checked(folder, *command, "wrong.csv")
        assert status == 1
        assert said.count("expected") == 1
        assert f"wrong.csv, line {at}: {column} is " in said


def test_without_a_compiler_the_vectors_hold_the_courses_and_a_note(monkeypatch):
    made = source()
    courses = observer_courses(made, "duty")
    texts = {**made.texts(), "observer_vectors.csv": courses}
    monkeypatch.setenv("PATH", "")
    text, notes = with_outputs(texts)
    assert text == courses
    assert "no C compiler built it here" in notes[0]
    monkeypatch.undo()
    monkeypatch.setattr("heatrun.export.sources.LONGEST_BUILD_S", 0.0)  # one that never ends
    assert with_outputs(texts) == (courses, notes)


def read_late(made, seconds, seed=0):
    """What drives a source, with readings that follow its winding late, as if it missed a part."""
    plain = {name: value for name, value in made.of_run.items() if not name.startswith("__")}
    time, winding = made.found["t"], simulate_network(mat_bytes(plain)).sensed
    read = winding.copy()
    keep = np.exp(-np.diff(time) / seconds) if seconds else np.zeros(time.size - 1)
    for k, share in enumerate(keep):
        read[k + 1] = share * read[k] + (1.0 - share) * winding[k + 1]
    noise = np.random.default_rng(seed).normal(0.0, MISSED.reading(1.0), time.size)
    names = [name for name in ("t", "Is", "Pd", "Pol", "Te", "start") if name in made.of_run]
    return {name: made.of_run[name] for name in names} | {"Tw_m": read + noise}


def test_an_observer_that_takes_a_missing_part_for_a_fault_is_given_more():
    made = source()
    sound, late = read_late(made, 0.0), read_late(made, 2.0)
    assert without_false_alarms(made, {"sound": sound}) == (made, [])
    told = faults(made, [readings(replace(made, of_run={**made.of_run, **late}))])
    assert told > 0
    widened, (note,) = without_false_alarms(made, {"late": late, "sound": sound})
    assert f"told {told} faults" in note
    assert widened.missed.misfit_K > made.missed.misfit_K
    assert faults(widened, [readings(replace(widened, of_run={**made.of_run, **late}))]) == 0
    stuck = {**sound, "Tw_m": np.full_like(sound["Tw_m"], sound["Tw_m"][900])}
    assert faults(widened, [readings(replace(widened, of_run={**made.of_run, **stuck}))]) > 0


def test_what_the_bench_alone_picks_up_is_no_fault_of_the_drives_sensor():
    plain = source()
    sound = read_late(plain, 0.0)
    added = 6.0 * (sound["Is"] / 100.0) ** 0.8
    T0, T = sound["Te"], sound["Tw_m"]
    read = sound | {"Tw_m": added + T0 + 1.01 * (T - T0)}
    assert faults(plain, [readings(replace(plain, of_run={**plain.of_run, **read}))]) > 0
    picked = source("second", ("sensor_gain", "sensor_pickup"), **{
        "sensor_gain.g": 0.01, "sensor_pickup.p": 6.0, "sensor_pickup.n": 0.8})  # fmt: skip
    assert without_false_alarms(picked, {"read": read}) == (picked, [])


@cache
def steady_record():
    """The record whose mean loss scales the heat that is missed: 625 W."""
    record = half_hour()
    channels = {**record.channels, "losses_W": np.full(record.time_s.size, 625.0)}
    return Record(record.name, channels)


def steady(*model, **values):
    return source(*model, record=steady_record(), **values)


def fitted_with(sensor_K):
    """Return it with a sensor and a sink that may be so far off [K]."""
    return replace(steady(), missed=replace(MISSED, sensor_K=sensor_K, sink_K=sensor_K))


def test_a_node_that_is_not_read_is_in_its_band_where_the_way_to_it_is_not_as_the_run_has_it(
    tmp_path,
):
    course, rows = hidden_machine(seed=3)
    off = {"Req_w": 0.97 * VALUES["Req_w"], "Req_sr": 1.03 * VALUES["Req_sr"]}
    known = replace(steady(**off), missed=replace(MISSED, sensor_K=0.5))
    open_ = replace(known, aside=steady().of_run)
    error, told = {}, {}
    for name, made in (("known", known), ("open", open_)):
        (tmp_path / name).mkdir()
        T, sd, _, sensor = observed(tmp_path / name, made, 57.0, 5.0, rows)
        assert not sensor.any()
        error[name], told[name] = np.abs(T - course)[900:, 1], sd[900:]
    assert np.mean(error["known"] < 1.96 * told["known"][:, 1]) < 0.5
    assert np.mean(error["open"] < 1.96 * told["open"][:, 1]) > 0.9
    # the winding is read, and hardly less certain
    assert np.mean(told["open"][:, 0]) < 1.2 * np.mean(told["known"][:, 0])


def test_the_way_to_a_node_that_is_not_read_is_as_open_as_the_draws_have_it(
    finished_day, monkeypatch
):
    monkeypatch.chdir(finished_day)
    draws = open_run(Path("run")).draws("second")
    test = read_run_test(Path("run"), network="second").blocks
    aside, _ = least_told(draws, test, ["winding", "stator"])
    v = draws.values()
    across = np.std(np.log(v["Rs0"] * v["Req_w"]))  # of the rise from stator to winding, at rest
    assert abs(np.log(aside["Rs0"] * aside["Req_w"])) == pytest.approx(across, rel=0.2)


@pytest.mark.parametrize("eA", [0.0, 0.6], ids=["linear", "radiating"])
@in_both_precisions
def test_an_observer_that_starts_30_K_wrong_is_right_within_its_band(tmp_path, words, eA):
    course, rows = hidden_machine(seed=1, eA=eA)
    effects = ("radiation",) if eA else ()
    made = steady("second", effects, **{"radiation.eA": eA})
    T, sd, status, sensor = observed(tmp_path, made, 30.0, 30.0, rows, *words)
    assert not status.any()
    assert not sensor.any()
    assert course[0, 1] - T[0, 1] > 15.0  # the first reading says little of the stator
    late = slice(900, None)
    assert np.all(sd[late] < 1.5)
    assert np.all(np.abs(T - course)[late] < 3.0 * sd[late])


def test_the_band_holds_with_the_sensor_pulled_for_ten_minutes(tmp_path):
    made, within, grown = steady(), [], []
    for seed in range(10, 22):
        course, rows = hidden_machine(seed, num=2700)
        rows[1800:2400, 3] = np.nan
        T, sd, _, sensor = observed(tmp_path, made, 57.0, 5.0, rows)
        assert np.all(sensor[1800:1859] == 6)
        assert np.all(sensor[1859:2400] == 1)
        assert not sensor[2400:].any(), "nothing spoke against it"
        within.append((np.abs(T - course) < 1.96 * sd)[1800:2400])
        grown.append(sd[2399, 0] > 1.5 * sd[1799, 0])
    assert np.mean(within) > 0.88  # twelve tests of correlated errors: 95 % in the long run
    assert all(grown)


@pytest.mark.parametrize(
    ("fault", "named", "within_s"),
    [("stuck", 2, 120), ("off", 3, 20), ("noisy", 3, 60), ("lagging", 5, 60)],
)
def test_a_sensor_that_lies_is_found_and_counts_again_later(tmp_path, fault, named, within_s):
    course, rows = hidden_machine(seed=3, num=3000)
    late = rows[1800:2400, 3]  # from the change of load on
    if fault == "stuck":
        late[:] = rows[1799, 3]
    elif fault == "off":
        late += 15.0
    elif fault == "noisy":  # ten times the noise of `hidden_machine`
        late += np.random.default_rng(1).normal(0.0, 2.4, late.size)
    else:
        late += through_a_lag(course[1800:2400, 0], 60.0) - course[1800:2400, 0]
    T, sd, _, sensor = observed(tmp_path, steady(), 57.0, 5.0, rows)
    assert not sensor[:1800].any()
    assert np.any(sensor[1800 : 1800 + within_s] == named)
    if fault in ("stuck", "off", "noisy"):
        assert np.all(sensor[1800 + within_s : 2400] == named)
    assert np.all(sensor[1800 + within_s : 2400] > 0), "a lag is seen while the load changes alone"
    assert np.all(np.abs(T - course)[1800:] < 4.0 * sd[1800:])
    back_s = 2500 if fault in ("off", "noisy") else 2780  # the others need a change of load
    assert np.all(sensor[2400:2410] > 0)
    assert not sensor[back_s:].any()


@in_both_precisions
def test_no_input_or_reading_locks_the_observer_up(tmp_path, words):
    course, rows = hidden_machine(seed=7, num=6000)
    made = steady()
    rng = np.random.default_rng(1)
    for column, value, seconds in ((0, 2500.0, 600), (0, 600.0, 900), (1, 12700.0, 600),
                                   (2, 500.0, 600), (3, 400.0, 300), (3, -100.0, 1)):  # fmt: skip
        wrong = rows.copy()
        wrong[600 : 600 + seconds, column] = value
        T, sd, status, _ = observed(tmp_path, made, 57.0, 5.0, wrong, *words)
        assert not status[-1800:].any()
        assert np.all(np.isfinite(T) & np.isfinite(sd))
        assert np.mean(np.abs(T - course)[-3600:] < 1.96 * sd[-3600:]) > 0.9
    for _ in range(12):
        wrong = rows.copy()
        for _ in range(40):
            at, long = rng.integers(0, 2500), int(rng.integers(1, 200))
            values = [np.nan, np.inf, -np.inf, 0.0, -100.0, 500.0, 2500.0, 1e9, 300 * rng.normal()]
            wrong[at : at + long, rng.integers(0, 4)] = rng.choice(values)
        T, sd, status, _ = observed(tmp_path, made, 57.0, 5.0, wrong, *words)
        assert not status[-600:].any()
        assert np.all(np.abs(T - course)[-600:] < 3.0 * sd[-600:])


def test_where_the_model_may_be_wrong_the_band_has_both_in_it(tmp_path):
    course, rows = hidden_machine(seed=8, num=5400)
    made = steady()
    T, sd, _, sensor = observed(tmp_path, made, 30.0, 5.0, rows)
    assert np.all(np.abs(T - course)[:, 0] < 1.96 * sd[:, 0] + 1.0), "the start was wrong"
    assert set(sensor[:60]) == {0, 4, 5}
    assert not sensor[90:].any()
    for column in (0, 1):
        wrong = rows.copy()
        wrong[1000:2600, column] = 0.0
        T, sd, status, sensor = observed(tmp_path, made, 57.0, 5.0, wrong)
        assert not status.any()
        assert not np.isin(sensor, (2, 3)).any(), "the sensor is right"
        assert np.any(sensor == 5)
        told = np.flatnonzero(sensor)[0]
        assert np.abs(T - course)[told:2600, 0].max() > 10.0
        assert np.mean(np.abs(T - course)[told:2600, 0] < 1.96 * sd[told:2600, 0]) > 0.9


def test_one_bad_reading_at_the_start_is_not_believed(tmp_path):
    course, rows = hidden_machine(seed=9, num=1800)
    for num in (1, 5, 12):
        wrong = rows.copy()
        wrong[:num, 3] = 150.0
        T, sd, *_ = observed(tmp_path, steady(), 57.0, 30.0, wrong)
        assert np.all(np.abs(T - course)[100:, 0] < 3.0 * sd[100:, 0])
        assert np.all(sd[600:, 0] < 1.0)


@pytest.mark.parametrize("every_s", [2, 10, 30])
def test_readings_that_come_seldom_are_used(tmp_path, every_s):
    course, rows = hidden_machine(seed=11, num=3600)
    rows[np.arange(3600) % every_s != 0, 3] = np.nan
    T, sd, _, sensor = observed(tmp_path, steady(), 30.0, 30.0, rows)
    assert set(sensor[2:]) == {0, 6}
    assert np.all(np.abs(T - course)[900:] < 3.5 * sd[900:])
    assert np.all(sd[900:, 0] < 0.8)


def test_an_offset_that_was_told_is_not_believed_later(tmp_path):
    made = fitted_with(0.5)
    course, rows = hidden_machine(seed=22, num=5400)
    rows[1400:4400, 3] += 3.0
    T, sd, _, sensor = observed(tmp_path, made, 57.0, 5.0, rows)
    assert np.all(np.isin(sensor[1412:4400], (3, 4)))
    assert np.mean(np.abs(T - course)[:, 0] < 1.96 * sd[:, 0]) > 0.95
    assert not sensor[4900:].any(), "it has jumped back"


@pytest.mark.parametrize("early_s", [-0.8, 0.8], ids=["late", "early"])
def test_a_reading_of_another_moment_than_the_inputs_is_no_fault(tmp_path, early_s):
    """The winding moves by 1.3 K/s as the load changes, and its readings are good to 0.02 K."""
    made = replace(steady(), missed=replace(MISSED, slow_K=0.05, white_K=0.004))
    course, rows = hidden_machine(seed=16)
    seconds, noise = np.arange(len(rows)), np.random.default_rng(1).normal(0.0, 0.02, len(rows))
    rows[:, 3] = np.interp(seconds + early_s, seconds, course[:, 0]) + noise
    T, sd, _, sensor = observed(tmp_path, made, 60.0, 5.0, rows)
    assert not sensor.any()
    assert np.all(np.abs(T - course)[300:] < 3.0 * sd[300:] + 1.1)
    rows[2650:, 3] += 2.0
    *_, sensor = observed(tmp_path, made, 60.0, 5.0, rows)
    assert np.all(sensor[2665:2700] == 3), "an offset is"


def test_a_lag_is_told_of_a_slow_winding_too():
    """What it leaves within some minutes is less than the constant errors of sensor and model."""
    slow = source("second", Ceq_w=2e4, Req_w=0.2)
    more = {"sensor_K": 0.5, "sink_K": 0.5, "share": 0.02, "answer": 0.04}
    made = replace(slow, missed=replace(MISSED, slow_K=0.1, white_K=0.01, **more))
    read = {lag_s: readings(replace(made, of_run={**made.of_run, **read_late(made, lag_s)}))
            for lag_s in (0.0, 60.0)}  # fmt: skip
    assert faults(made, [read[0.0]]) == 0
    assert faults(made, [read[60.0]]) > 0


def test_a_drift_is_told_by_the_mean_of_what_remains(tmp_path):
    _, rows = hidden_machine(seed=13, num=7200)
    made = fitted_with(0.5)
    rows[1400:, 3] += 10.0 / 3600.0 * np.arange(5800)
    _, _, _, sensor = observed(tmp_path, made, 57.0, 5.0, rows)
    assert not sensor[:1400].any()
    assert np.flatnonzero(sensor)[0] < 1400 + 5400
    assert 5 in sensor


def by_resistance(T):
    """Return what an ohmmeter shows of winding and leads [ohm], by the rule of IEC 60034-1."""
    return VALUES["Rs0"] * (234.5 + T) / (234.5 + 25.0) + LEAD_OHM


@in_both_precisions
def test_the_winding_by_its_resistance(tmp_path, words):
    real = ctypes.c_float if words else ctypes.c_double
    shared = build(tmp_path, source(), *words, "-shared", "-fPIC")
    library = ctypes.CDLL(str(shared))
    library.heatrun_winding_degC.restype = real
    of_run = (4 * real).in_dll(library, "heatrun_cold_winding")
    given = [by_resistance(25.0), by_resistance(100.0), by_resistance(-40.0), np.nan, np.inf,
             -0.006, 0.0, LEAD_OHM, 0.02, 1e37]  # fmt: skip
    found = [library.heatrun_winding_degC(of_run, real(ohm)) for ohm in given]
    np.testing.assert_allclose(found[:3], [25.0, 100.0, -40.0], atol=2e-4 if words else 1e-9)
    found.append(library.heatrun_winding_degC((4 * real)(), real(0.006)))
    assert set(found[3:]) == {-1000.0}, "no reading"


def test_the_band_of_an_observer_by_resistance_holds(tmp_path):
    """A resistance that is 0.2 % wrong for good, at noise of 0.1 %, each ten seconds."""
    made, rng = steady(), np.random.default_rng(3)
    header = made.texts()["thermal_network.h"].decode()
    K_per_ohm = float(re.search(r"one of (\S+) K/ohm", header)[1])
    assert K_per_ohm == pytest.approx((234.5 + 25.0) / VALUES["Rs0"])
    ohm = by_resistance(410.0)  # as warm as this machine becomes
    words = ["-DBY_RESISTANCE", "-DHEATRUN_SLOW_SD_K=0.0",
             f"-DHEATRUN_READING_SD_K={0.001 * ohm * K_per_ohm:.3f}",
             f"-DHEATRUN_SENSOR_SD_K={0.002 * ohm * K_per_ohm:.3f}"]  # fmt: skip
    held, bare = [], []
    for seed, error in enumerate(norm.ppf((np.arange(8) + 0.5) / 8)):
        course, rows = hidden_machine(seed + 30, num=2700)
        ohm = by_resistance(course[:, 0]) * (1.0 + 0.002 * error)
        rows[:, 3] = ohm * (1.0 + 0.001 * rng.normal(size=len(rows)))
        rows[np.arange(len(rows)) % 10 != 0, 3] = np.nan
        rows[1500, 3] = -1.0  # the meter is off for a moment
        for names, within in ((words, held), (words[:1], bare)):
            T, sd, status, sensor = observed(tmp_path, made, 57.0, 5.0, rows, *names)
            within.append(np.abs(T - course)[600:, 0] < 1.96 * sd[600:, 0])
            if names is words:
                assert not status.any()
                assert set(sensor) <= {0, 6}
                assert sd[600:, 0].max() < 2.0
    assert np.mean(held) > 0.93
    assert np.mean(bare) < np.mean(held) - 0.2


def test_readings_by_resistance_are_refused_by_name(tmp_path):
    unknown = replace(source(), cold=(0.0, 0.0))
    assert "the run has no resistance" in unknown.not_by_resistance[0]
    build(tmp_path, unknown)
    assert "heatrun_winding_degC is left out" in (tmp_path / "thermal_network.h").read_text()
    assert not source().not_by_resistance
    lagging = source("second", ("sensor_lag",))
    assert "expects another reading (sensor_lag)" in lagging.not_by_resistance[0]


def test_a_lag_that_the_run_knows_is_no_fault(tmp_path):
    course, rows = hidden_machine(seed=5)
    rows[:, 3] += through_a_lag(course[:, 0], 25.0) - course[:, 0]
    known = steady("second", ("sensor_lag",), **{"sensor_lag.tau": 25.0})
    T, sd, _, sensor = observed(tmp_path, known, 57.0, 5.0, rows)
    assert not sensor.any()
    assert np.all(np.abs(T - course)[900:] < 3.0 * sd[900:])
    _, _, _, sensor = observed(tmp_path, steady(), 57.0, 5.0, rows)
    assert sensor.any(), "one that is not known is"


@pytest.mark.parametrize("lag_s", [0.0, 15.0], ids=["at once", "lagging"])
def test_a_sensor_between_slots_and_overhang_is_read_as_such(tmp_path, lag_s):
    """By Euler steps of 0.1 s: 40 % of the winding is overhang, 30 s behind, half of it read."""
    f, tau, p, v, k = 0.4, 30.0, 0.5, VALUES, 3 * VALUES["Rs0"] / (234.5 + 25.0)
    rng, T, course, rows = np.random.default_rng(8), np.array([60.0, 55.0, 60.0]), [], []
    for second in range(2700):
        current, loss = (130.0, 600.0) if (second // 600) % 2 == 0 else (60.0, 150.0)
        for _ in range(10):
            slots, end = np.array([1.0 - f, f]) * k * current**2 * (234.5 + T[[0, 2]])
            across, hers = (T[0] - T[1]) / v["Req_w"], f * v["Ceq_w"] * (T[2] - T[0]) / tau
            heat = [
                slots - across + hers,
                loss - slots - end + across - (T[1] - 20.0) / v["Req_sr"],
                end - hers,
            ]
            T = T + 0.1 * np.array(heat) / [(1.0 - f) * v["Ceq_w"], v["Ceq_sr"], f * v["Ceq_w"]]
        course.append(T)
        rows.append([current, loss, 20.0, T[0] + p * (T[2] - T[0])])
    course, rows = np.array(course), np.array(rows)
    assert np.max(np.abs(course[:, 2] - course[:, 0])) > 5.0
    if lag_s:
        rows[:, 3] = through_a_lag(rows[:, 3], lag_s)
    rows[:, 3] += rng.normal(0.0, 0.13, len(rows))
    laws = ("end_winding_node", *(["sensor_lag"] if lag_s else []))
    values = {"end_winding_node.f": f, "end_winding_node.tau": tau, "end_winding_node.p": p,
              "sensor_lag.tau": lag_s}  # fmt: skip
    own = {name: value for name, value in values.items() if name.startswith(laws)}
    made = steady("second", laws, **own)
    T, sd, _, sensor = observed(tmp_path, made, 58.0, 5.0, rows)
    assert not sensor.any()
    assert np.all(np.abs(T - course)[900:] < 3.0 * sd[900:])
    at_its_node = steady()
    T, sd, _, _ = observed(tmp_path, at_its_node, 58.0, 5.0, rows)
    assert np.any(np.abs(T - course[:, :2])[900:] > 3.0 * sd[900:]), "without it, it is not"


def test_without_inputs_the_band_grows(tmp_path):
    _, rows = hidden_machine(seed=4, num=900)
    rows[600:, 0] = np.nan
    rows[600:, 3] = np.nan
    T, sd, status, _ = observed(tmp_path, steady(), 57.0, 5.0, rows)
    assert np.all(status[600:] == 1)
    assert np.ptp(T[600:, 0]) == 0.0
    assert np.all(np.diff(sd[600:, 0]) > 0.1)


def test_an_observer_that_is_too_large_is_left_out():
    made = source()
    of_run = made.of_run | {
        name: np.append(made.of_run[name], np.full(8, value))
        for name, value in (
            ("capacitance", 1e3),
            ("resistance", 1.0),
            ("share", 0.0),
            ("start", 20.0),
        )
    }
    of_run["nodes"] = [*made.nodes, *"abcdefgh"]
    of_run["links"] = [*links_of(made.found), *(("winding", node) for node in "abcdefgh")]
    large = replace(made, of_run=of_run)
    assert not large.has_observer


@pytest.mark.parametrize("effects", [(), ("sensor_lag",)], ids=["at once", "lagging"])
def test_the_size_of_an_observer_is_known_before_it_is_compiled(tmp_path, effects):
    (tmp_path / "size.c").write_text("""#include <stdio.h>
#include "thermal_network.h"
int main(void) { printf("%lu", (unsigned long)sizeof(heatrun_observer)); return 0; }
""")
    made = source("second", effects)
    program = build(tmp_path, made, harness="size.c")
    said = subprocess.run([program], capture_output=True, text=True, check=True).stdout
    assert int(said) == made.state_bytes < 1024


def test_the_band_of_a_run_holds_on_other_loads(day, generator):
    """The simulated bench is code of its own; the sensor is pulled for ten minutes, twice."""
    export_source(Path("run"), folder=Path("drive"))
    shutil.copy(Path(__file__).with_name("observe.c"), "drive")
    command = [str(COMPILER), *STRICT, "observe.c", "thermal_network.c", "-o", "observe"]
    subprocess.run(command, cwd="drive", check=True)
    for seed, profile in enumerate([generator.staircase(3600.0), generator.drive_cycle(3600.0)]):
        truth = generator.simulate(
            generator.reference_motor(), profile, sample_s=1.0, steps_per_sample=20
        )
        said = generator.measure(truth, np.random.default_rng(seed), generator.Instruments())
        before, after = slice(None, -1), slice(1, None)
        held = [said["Is"] ** 2, said["Pd"], said["Te"]]
        held = [0.5 * (np.asarray(each)[before] + np.asarray(each)[after]) for each in held]
        rows = np.column_stack([np.sqrt(held[0]), *held[1:], np.asarray(said["Tw_m"])[after]])
        is_pulled = np.zeros(len(rows), bool)
        is_pulled[1200:1800] = is_pulled[2700:3300] = True
        rows[is_pulled, 3] = np.nan
        T, sd, status, sensor = run_observer(Path("drive/observe"), 19.0, 2.0, rows)
        course = np.column_stack([truth.winding_degC, truth.stator_degC])[after]
        assert not status.any()
        assert set(sensor) == {0, 1, 6}  # no fault but the missing readings
        assert np.mean(np.abs(T - course)[is_pulled] < 1.96 * sd[is_pulled]) > 0.93
        # half of it the drive's own losses, of the bench's class; 1.505 at the most, an overhang
        # among what it allows for
        assert np.all(sd[is_pulled] < 1.6)
