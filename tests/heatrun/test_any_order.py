"""Files may stand before, between and behind the options of a command."""

from __future__ import annotations

from pathlib import Path

import pytest

from heatrun import cli


def parsed(*words: str):
    return cli._parser().parse_args(list(words))


@pytest.mark.parametrize(
    "words",
    [
        ["export", "run", "new.csv", "--to", "mat"],
        ["export", "run", "--to", "mat", "new.csv"],
        ["export", "--to", "mat", "run", "new.csv"],
        ["export", "--to=mat", "run", "--force", "new.csv"],
        ["export", "run", "--to", "mat", "--", "new.csv"],
    ],
)
def test_a_test_may_be_named_behind_an_option(words):
    options = parsed(*words)
    assert (options.source, options.tests, options.to) == (Path("run"), [Path("new.csv")], "mat")


def test_a_run_alone_is_exported_as_before():
    assert parsed("export", "run", "--to", "mat").tests == []


@pytest.mark.parametrize(
    ("words", "tests"),
    [
        (["check", "motor.toml", "a.csv", "--json", "b.csv"], ["a.csv", "b.csv"]),
        (["calibrate", "motor.toml", "a.csv", "--quick", "b.csv", "--seed", "3"],
         ["a.csv", "b.csv"]),
        (["calibrate", "motor.toml", "a.csv", "--holdout", "c.csv", "--quick", "b.csv"],
         ["a.csv", "b.csv"]),
        (["init", "a.csv", "--out", "m.toml", "b.csv"], ["a.csv", "b.csv"]),
        (["discover", "motor.toml", "a.csv", "--quick", "b.csv"], ["a.csv", "b.csv"]),
        (["report", "motor.toml", "a.csv", "--type", "general", "b.csv"], ["a.csv", "b.csv"]),
    ],
)  # fmt: skip
def test_so_do_the_tests_of_every_command(words, tests):
    assert [str(test) for test in parsed(*words).tests] == tests


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["export", "run"], "required: --to"),
        (["check", "--json"], "required: MOTOR.toml, TEST"),
        (["check", "motor.toml", "a.csv", "--jsn"], "unrecognized arguments: --jsn"),
        (["sheet", "run", "--dcc", "other"], "unrecognized arguments: other"),
    ],
)
def test_what_is_wrong_is_said_as_before(words, said, capsys):
    with pytest.raises(SystemExit) as end:
        parsed(*words)
    assert end.value.code == 2
    assert said in capsys.readouterr().err
