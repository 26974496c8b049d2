"""The copper loss at the winding's temperature, from the motor file."""

from __future__ import annotations

import numpy as np
import pytest

from heatrun.record.motor import Motor


def test_the_resistance_of_copper_rises_as_its_tables_say():
    # IEC 60034-1: (235 + T2)/(235 + T1); 20 degC to 75 degC is 1.2157
    motor = Motor("m", resistance_coefficient_degC=235.0, reference_temperature_degC=20.0)
    assert motor.resistance_ratio(np.array(75.0)) == pytest.approx(1.21569, rel=1e-5)
    assert motor.resistance_ratio(np.array(20.0)) == 1.0


def test_the_loss_is_that_of_all_phases():
    motor = Motor("m", phases=3, phase_resistance_ohm=0.2, reference_temperature_degC=25.0)
    loss = motor.copper_loss_W(np.array([10.0, -10.0]), np.array([25.0, 154.75]))
    np.testing.assert_allclose(loss, [60.0, 90.0])


def test_no_loss_is_made_up_without_a_resistance():
    with pytest.raises(ValueError, match="phase_resistance_ohm"):
        Motor("m").copper_loss_W(np.ones(1), np.ones(1))
