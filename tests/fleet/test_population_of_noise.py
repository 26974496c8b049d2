"""Noise and unmodelled heat over the machines of a type: a population beside the parameters'."""

import json

import numpy as np
import pytest
from pyarrow.parquet import read_table
from rows_of_machines import NOISE_MEDIAN, NOISE_NAMES, NOISE_SPREAD, machine, write_rows

import heatrun
from heatrun.errors import InputError
from heatrun.motor.file import parse_motor
from heatrun.record.motor import HEAT_LIMITS
from heatrun_fleet.population.sheet import type_sheet_content

NUM = 60
LOOSE, LATENT, SILENT = "M005", "M009", "M012"
"""A machine with a loose sensor, one with much unmodelled heat, one whose noise is not known."""

EFFECT = "speed_cooling.g"


def row(number):
    name = f"M{number:03d}"
    if name == LOOSE:
        return machine(number, noise_shift=(2.5, 0.0, 2.0, 0.0))
    if name == LATENT:
        return machine(number, noise_shift=(0.0, 0.0, 0.0, 4.0))
    if name == SILENT:
        return machine(number, noise_log_covariance=[float("nan")] * 16)
    return machine(number)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("type")


@pytest.fixture(scope="module")
def known(tmp_path_factory, folder):
    fleet = write_rows(tmp_path_factory.mktemp("fleet"), [row(number) for number in range(NUM)])
    return heatrun.population(fleet, out=folder)


def test_median_and_spread_are_found(known):
    found = known.result.noise.parameters
    assert tuple(found) == NOISE_NAMES
    for place, name in enumerate(NOISE_NAMES):
        said = found[name]
        # the medians drawn are half a spread off the law's at most: three standard errors
        within = 3.0 * NOISE_SPREAD[place] / np.sqrt(NUM) + 0.1
        assert abs(np.log(said.median.value / NOISE_MEDIAN[place])) < within, name
        low, high = said.spread.interval_95
        assert low < np.expm1(NOISE_SPREAD[place]) < high, name


def test_a_machine_with_another_noise_is_another_in_its_noise_alone(known):
    noise = {each.name: each for each in known.result.noise.machines}
    assert noise[LOOSE].is_outlier
    assert {"noise_sd", "noise_white"} <= set(noise[LOOSE].different)
    assert noise[LATENT].is_outlier
    assert noise[LATENT].different == ["unmodelled_heat"]
    assert sum(each.is_outlier for each in noise.values()) == 2
    assert not any(each.is_outlier for each in known.result.machines)


def test_a_machine_without_a_sound_noise_counts_for_its_parameters(known):
    assert known.result.num_machines == NUM
    assert known.result.noise.num_machines == NUM - 1
    table = known.machines().set_index("machine")
    assert np.isnan(table.loc[SILENT, "noise_outlier_probability"])
    assert table.loc[LOOSE, "noise_outlier_probability"] > 0.9


def test_the_table_has_the_noise_of_each_machine(folder):
    rows = {each["machine"]: each for each in read_table(folder / "population.parquet").to_pylist()}
    assert rows[SILENT]["status"] == "used"
    assert rows[SILENT]["noise"] == []
    loose = rows[LOOSE]
    assert loose["noise"] == list(NOISE_NAMES)
    assert loose["noise_outlier_probability"] > 0.9
    given, low, high = (np.array(loose[f"noise_given_{key}"])
                        for key in ("values", "low_95", "high_95"))  # fmt: skip
    assert np.all((low < given) & (given < high))


def test_tables_and_sheet_say_it(known):
    summary = known.noise().set_index("parameter")
    assert list(summary.index) == list(NOISE_NAMES)
    content = type_sheet_content(known.result)
    assert [line[0] for line in content["noise"]] == list(NOISE_NAMES)
    said = {line[0]: line[2] for line in content["noise_outliers"]}
    assert set(said) == {LOOSE, LATENT}
    assert said[LATENT].startswith("unmodelled_heat")
    assert "times the median" in said[LATENT]


def motor(folder, further=""):
    text = f'[motor]\nname = "next"\n[population]\nrun = "{folder}"\n{further}'
    return parse_motor(text.encode(), "motor.toml")


def test_the_next_machine_takes_the_heat_that_its_sisters_miss(known, folder):
    said = known.result.noise.parameters["unmodelled_heat"].next_median
    assert motor(folder).adequacy.unmodelled_heat == pytest.approx(said)
    assert abs(np.log(said / NOISE_MEDIAN[3])) < 0.3


def test_the_motor_file_goes_before_its_sisters(folder):
    own = motor(folder, "[adequacy]\nunmodelled_heat = 0.01\n")
    assert own.adequacy.unmodelled_heat == 0.01


def test_the_heat_stays_within_its_limits(folder, tmp_path):
    content = json.loads((folder / "population.json").read_text())
    content["noise"]["parameters"]["unmodelled_heat"]["next_median"] = 0.9
    (tmp_path / "population.json").write_text(json.dumps(content))
    assert motor(tmp_path).adequacy.unmodelled_heat == HEAT_LIMITS[1]


@pytest.mark.parametrize("wrong", [-0.1, float("nan"), "much"])
def test_a_heat_that_is_none_is_refused(folder, tmp_path, wrong):
    content = json.loads((folder / "population.json").read_text())
    content["noise"]["parameters"]["unmodelled_heat"]["next_median"] = wrong
    (tmp_path / "population.json").write_text(json.dumps(content))
    with pytest.raises(InputError):
        motor(tmp_path)


def test_a_population_without_noise_is_one_all_the_same(tmp_path):
    rows = [machine(number, noise=[], noise_log_mean=[]) for number in range(6)]
    known = heatrun.population(write_rows(tmp_path / "fleet", rows), out=tmp_path / "type")
    assert not known.result.noise
    assert "noise" not in json.loads((tmp_path / "type" / "population.json").read_text())
    assert known.noise().empty
    assert motor(tmp_path / "type").adequacy.unmodelled_heat == 0.0015


def with_effect(number):
    """Return a machine that was calibrated with an effect which the fleet file named."""
    good = machine(number)
    # with one parameter of the network fixed there are four, as in `known`: nothing compiles anew
    kept = {key: good[key][1:] for key in ("parameters", "parameter_units", "parameter_values",
                                           "parameter_sd", "log_mean", "prior_mean",
                                           "prior_sd")}  # fmt: skip
    rng = np.random.default_rng([3, number])
    covariance = np.zeros((4, 4))
    covariance[:3, :3] = np.reshape(good["log_covariance"], (4, 4))[1:, 1:]
    covariance[3, 3] = 0.05**2
    true = np.log(0.4) + 0.1 * rng.standard_normal()
    mean = true + 0.05 * rng.standard_normal()
    return {
        **good,
        "parameters": [*kept["parameters"], EFFECT],
        "parameter_units": [*kept["parameter_units"], "1"],
        "transforms": ["log"] * 4, "parameter_values": [*kept["parameter_values"], np.exp(mean)],
        "parameter_sd": [*kept["parameter_sd"], 0.02],
        "log_mean": [*kept["log_mean"], mean], "log_covariance": covariance.ravel().tolist(),
        "prior_mean": [*kept["prior_mean"], np.log(0.3)], "prior_sd": [*kept["prior_sd"], 1.0],
    }  # fmt: skip


def test_a_named_effect_is_pooled_and_handed_to_the_next_machine(tmp_path):
    fleet = write_rows(tmp_path / "fleet", [with_effect(number) for number in range(NUM)])
    known = heatrun.population(fleet, out=tmp_path / "type")
    said = known.result.parameters[EFFECT]
    assert said.median.value == pytest.approx(0.4, rel=0.1)
    next_one = motor(tmp_path / "type")
    assert next_one.effects == ("speed_cooling",)
    assert next_one.parameters[EFFECT].value == pytest.approx(said.next_median)
    both = motor(tmp_path / "type", '[model]\neffects = ["sensor_lag"]\n')
    assert both.effects == ("sensor_lag", "speed_cooling")
