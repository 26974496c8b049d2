"""Several loggers, one motor: lists of alternatives in `[columns]`, and `[tests.NAME.columns]`."""

from __future__ import annotations

import numpy as np
import pytest
from drafted import BEARING, CURRENT, HOUSING, LOSSES, ROOM, TIME_S, WINDING, named, text_of

from heatrun import cli
from heatrun.errors import InputError
from heatrun.motor.file import load_motor, parse_motor
from heatrun.readers.joined import read_test
from heatrun.runs.motor_text import motor_text

BASE = {"time_s": TIME_S, "losses_W": LOSSES, "phase_current_A": CURRENT, "ambient_degC": ROOM}
HEAD = '[motor]\nname = "M"\n'


def motor_of(text: str):
    return parse_motor(f"{HEAD}{text}".encode(), "motor.toml")


def test_the_first_counts_whose_column_a_file_has(tmp_path):
    one = named(tmp_path, BASE | {"TE_7 [degC]": WINDING, "TE_8 [degC]": HOUSING}, "one.csv")
    two = named(tmp_path, BASE | {"Kanal 3": WINDING - 1.0}, "two.csv")
    motor = motor_of('[columns]\nwinding_degC = ["TE_7 [degC]", "Kanal 3 [degC]"]\n')
    np.testing.assert_allclose(read_test(one, motor)["winding_degC"], WINDING, rtol=1e-4)
    np.testing.assert_allclose(read_test(two, motor)["winding_degC"], WINDING - 1.0, rtol=1e-4)
    np.testing.assert_allclose(
        read_test(two, parse_motor(motor_text(motor), "run"))["winding_degC"],
        WINDING - 1.0,
        rtol=1e-4,
    )


def test_a_mean_and_a_rate_may_be_choices(tmp_path):
    three = {f"Z{n} [degC]": WINDING + n for n in (1, 2, 3)}
    del (rest := dict(BASE))["time_s"]
    path = named(tmp_path, rest | three)
    motor = motor_of(
        '[columns]\ntime_s = ["tick [s]", "rate 0.1 Hz"]\n'
        'winding_degC = ["coil [degC]", "mean(Z1, Z2, Z3) [degC]"]\n'
    )
    record = read_test(path, motor)
    np.testing.assert_allclose(record["winding_degC"], WINDING + 2.0, rtol=1e-4)
    np.testing.assert_allclose(record.time_s, TIME_S)


def test_a_test_may_have_columns_of_its_own(tmp_path):
    one = named(tmp_path, BASE | {"K1 [degC]": WINDING, "K2 [degC]": HOUSING}, "one.csv")
    two = named(tmp_path, BASE | {"K1 [degC]": HOUSING, "K2 [degC]": WINDING}, "two.csv")
    motor = motor_of(
        '[columns]\nwinding_degC = "K1"\n[tests.two]\nmask = [[100, 200]]\n'
        '[tests.two.columns]\nwinding_degC = "K2"\n'
    )
    for path in (one, two):
        np.testing.assert_allclose(read_test(path, motor)["winding_degC"][0], 22.0, rtol=1e-4)
        np.testing.assert_allclose(
            read_test(path, motor)["winding_degC"][-1], WINDING[-1], rtol=1e-4
        )
    kept = parse_motor(motor_text(motor), "run")
    np.testing.assert_allclose(read_test(two, kept)["winding_degC"], WINDING, rtol=1e-4)


@pytest.mark.parametrize(
    ("line", "match"),
    [
        ("winding_degC = []", "1 to 20 columns"),
        ("winding_degC = [1]", "winding_degC"),
        ('wnding_degC = ["K1"]', "not known"),
    ],
)
@pytest.mark.parametrize("section", ["columns", "tests.two.columns"])
def test_what_is_no_list_of_columns_is_refused(section, line, match):
    with pytest.raises(InputError, match=match):
        motor_of(f"[{section}]\n{line}\n")


def test_none_of_the_choices_leaves_the_channel_missing(tmp_path, capsys):
    path = named(tmp_path, BASE | {"K1 [degC]": WINDING})
    motor = tmp_path / "motor.toml"
    motor.write_text(f'{HEAD}[columns]\nwinding_degC = ["K7 [degC]", "K8 [degC]"]\n')
    assert cli.main(["check", str(motor), str(path)]) == 1
    assert "winding_degC" in capsys.readouterr().out


def test_init_writes_one_line_for_several_loggers(tmp_path, monkeypatch):
    one = named(tmp_path, BASE | {"TE_7 [degC]": WINDING, "TE_8 [degC]": BEARING}, "one.csv")
    two = named(tmp_path, BASE | {"Kanal 3 [K]": WINDING + 273.15}, "two.csv")
    text = text_of(one, two)
    assert '# winding_degC = ["TE_7 [degC]", "Kanal 3 [K]"]' in text
    monkeypatch.chdir(tmp_path)
    assert cli.main(["init", "one.csv", "two.csv", "--accept"]) == 0
    motor = load_motor("motor.toml")
    for path in (one, two):
        np.testing.assert_allclose(read_test(path, motor)["winding_degC"], WINDING, rtol=1e-3)


def test_init_tells_apart_files_whose_columns_are_called_alike(tmp_path, monkeypatch):
    one = named(tmp_path, BASE | {"K1 [degC]": WINDING, "K2 [degC]": BEARING}, "one.csv")
    two = named(tmp_path, BASE | {"K1 [degC]": BEARING, "K2 [degC]": WINDING}, "two.csv")
    monkeypatch.chdir(tmp_path)
    assert cli.main(["init", "one.csv", "two.csv", "--accept"]) == 0
    motor = load_motor("motor.toml")
    assert '[tests."two".columns]' in (tmp_path / "motor.toml").read_text()
    for path in (one, two):
        np.testing.assert_allclose(read_test(path, motor)["winding_degC"], WINDING, rtol=1e-4)


def test_a_logger_that_is_recognised_beside_one_that_is_not(tmp_path, monkeypatch):
    one = named(tmp_path, BASE | {"winding_degC": WINDING}, "one.csv")
    two = named(tmp_path, BASE | {"Kanal 3 [degC]": WINDING}, "two.csv")
    monkeypatch.chdir(tmp_path)
    assert cli.main(["init", "one.csv", "two.csv", "--accept"]) == 0
    motor = load_motor("motor.toml")
    for path in (one, two):
        np.testing.assert_allclose(read_test(path, motor)["winding_degC"], WINDING, rtol=1e-4)
