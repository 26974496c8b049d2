"""The stages of discovery, each alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

from heatrun.discovery.run import folds, left_out_errors, rmse
from heatrun.effects.engine import Engine, library, white
from heatrun.errors import InputError
from heatrun.model.catalogue import all_effects
from heatrun.model.model import Model
from heatrun.model.problem import Problem, linearise
from lptn import EFFECTS, second_order

MINE = Path(__file__).with_name("cabinet_heater.py")
USER_EFFECT = MINE.read_text()


@pytest.fixture(scope="module")
def engine(blocks, motor):
    found = library(EFFECTS, second_order(1.0, 1.0, 1.0, 1.0), [blocks])
    return Engine(Problem.of(Model.of("second", motor, found.kinds), motor, [blocks], found.kinds))


@pytest.fixture(scope="module")
def base(engine):
    return engine.refit(np.zeros(len(engine.slots)), engine.base, white(0.3))


def test_all_effects_at_their_null_are_the_base_model(engine, base, fitted):
    names = [slot.name for slot in engine.slots]
    z = np.zeros(len(engine.slots))
    for position, slot in enumerate(fitted.slots):
        z[names.index(slot.name)] = fitted.z[position]
    columns = [names.index(slot.name) for slot in fitted.slots]
    residual, jacobian = engine.linearise(z, columns)
    problem = fitted.problem
    expected, slopes = linearise(problem.structure, problem.data, jnp.asarray(fitted.z))
    # general against affine step: both third order, equal to rounding; nulls within 1e-8 K
    np.testing.assert_allclose(residual, expected, atol=1e-7)
    np.testing.assert_allclose(jacobian, slopes, atol=1e-6)


def test_derivatives_by_effects_are_true(engine, base):
    columns = [
        engine.find("speed_cooling.g"), engine.find("sensor_lag.tau"), engine.find("radiation.eA"),
    ]  # fmt: skip
    z = base.z.copy()
    z[columns] = 0.4
    _, jacobian = engine.linearise(z, columns)
    for place, slot in enumerate(columns):
        ahead, behind = z.copy(), z.copy()
        ahead[slot] += 1e-4
        behind[slot] -= 1e-4
        slope = (engine.linearise(ahead, [])[0] - engine.linearise(behind, [])[0]) / 2e-4
        np.testing.assert_allclose(jacobian[:, place], slope, atol=1e-4)


def test_parts_left_out_of_a_single_test_are_predicted(engine, base):
    masks = folds(engine)
    assert len(masks) == 4
    errors = left_out_errors(engine, base, masks)
    assert np.all(np.isfinite(errors[engine.is_observed]))
    inside = rmse(base.residual[engine.is_observed])
    assert inside < rmse(errors) < 4.0 * inside


def test_effects_without_their_channel_are_said_to_be_unavailable(blocks):
    found = library(EFFECTS, second_order(1.0, 1.0, 1.0, 1.0), [blocks])
    assert "coolant_degC" in found.unavailable["coolant_sink"]
    assert "fan" in found.unavailable["fan_cooling"]
    events = [c for c in found.candidates if c.id == "cooling_step"]
    assert [c.test for c in events] == [0]


def test_a_users_file_of_effects_is_taken_in():
    kinds = all_effects([MINE])
    assert kinds[-1].card.id == "cabinet_heater"
    assert kinds[:-1] == EFFECTS


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x = 1\n", "no effect"),
        ("raise OSError('no')\n", "does not run"),
        (USER_EFFECT.replace("cabinet_heater", "radiation"), "taken"),
        (USER_EFFECT.replace('Quantity("W", 0.0', 'Quantity("W", None'), "null value"),
    ],
)
def test_a_users_file_that_cannot_be_used_is_refused(tmp_path, text, said):
    path = tmp_path / "mine.py"
    path.write_text(text)
    with pytest.raises(InputError, match=said):
        all_effects([path])
    with pytest.raises(InputError, match="not there"):
        all_effects([tmp_path / "nowhere.py"])


def test_an_effect_of_an_installed_package_is_taken_in(monkeypatch):
    (kind,) = [k for k in all_effects([MINE]) if k.card.id == "cabinet_heater"]

    class Entry:
        name = "cabinet"

        def load(self):
            return kind

    monkeypatch.setattr("heatrun.model.catalogue.entry_points", lambda group: [Entry()])
    assert all_effects()[-1] is kind


def test_what_a_held_out_test_lacks_is_not_searched(blocks):
    silent = replace(blocks, means={k: v for k, v in blocks.means.items() if k != "speed"})
    network = second_order(1.0, 1.0, 1.0, 1.0)
    found = library(EFFECTS, network, [blocks, silent], num_events=1)
    assert "speed_rpm" in found.unavailable["speed_cooling"]
    assert [c.test for c in found.candidates if c.id == "cooling_step"] == [0]
