from __future__ import annotations

import numpy as np
import pytest

from heatrun import cli
from heatrun.errors import UsageError
from heatrun.runs.duties import current_at_limit, parse_duty


def test_a_heat_capacity_alone_gives_the_closed_form():
    """Adiabatic S2: T = T0 + R I^2 t/C, so I = sqrt((T - T0) C/(R t))."""
    duty = parse_duty("S2-10", 1000.0)

    def highest(current, duty):
        return 20.0 + 0.02 * current**2 * duty.on_s / 600.0

    found = current_at_limit(duty, highest, 155.0, 300.0, 3)
    np.testing.assert_allclose(found, np.sqrt(135.0 * 600.0 / (0.02 * 600.0)), rtol=1e-3)
    assert np.all(np.isinf(current_at_limit(duty, highest, 1e6, 300.0, 3)))


def test_names_are_read():
    duty = parse_duty("S3-40", 1800.0)
    assert (duty.on_s, duty.off_s) == (240.0, 360.0)
    assert duty.num_cycles * 600.0 >= 4 * 1800.0
    for wrong in ("S3-140", "S2-0", "S1", "S2", "S2-x"):
        with pytest.raises(UsageError, match="expected S2-MINUTES"):
            parse_duty(wrong, 1.0)


def test_a_wrong_rating_is_wrong_use(tmp_path, capsys):
    from heatrun.bundled import bundled

    data = bundled("synthetic")
    words = ["calibrate", str(data / "motor.toml"), str(data / "step_30min.csv.gz"), "--rating",
             "S9-1", "--out", str(tmp_path / "run")]  # fmt: skip
    assert cli.main(words) == 2
    assert "S9-1" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
