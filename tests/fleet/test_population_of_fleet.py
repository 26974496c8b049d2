"""From the rows of a fleet to the populations of its types, their files and the next machine."""

import json

import duckdb
import jsonschema
import numpy as np
import pytest
from rows_of_machines import MEDIAN, NAMES, SPREAD, machine, refused, write_rows

import heatrun
from heatrun import cli
from heatrun.errors import InputError
from heatrun.motor.file import parse_motor
from heatrun.results import from_json
from heatrun.results.schema import schema_of
from heatrun_fleet.population.gathered import covariates_of, designed
from heatrun_fleet.population.of_fleet import gathered_of_fleet, read_fleet
from heatrun_fleet.population.table import COLUMNS, schema
from heatrun_fleet.results import SCHEMAS, PopulationResult

NUM = 40
SUPPLIER, DRIFT = 0.08, 0.10
"""What the supplier does to Req_sr, and a year to Ceq_w, by the logarithm."""


def of_type_a(number):
    supplier = "north" if number % 3 else "south"
    month, day = 1 + number % 12, 1 + number % 28
    year = (month - 1) / 12.0 + (day - 1) / 365.25
    shift = [DRIFT * year, 0.0, 0.5 * (number == 7), SUPPLIER * (supplier == "south")]
    said = {"supplier": supplier, "date": f"2026-{month:02d}-{day:02d}", "rate": "2.5"}
    return machine(number, shift=shift, covariates=said)


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    """Two types: A with two suppliers, a drift, an outlier and four machines that do not count."""
    rows = [of_type_a(number) for number in range(NUM)]
    rows += [
        refused(50, "Column winding_degC jumps 41 K in 1 s."),
        machine(51, is_converged=False, result="the search has not ended"),
        machine(52, parameters=["Req_w", "Req_sr", "Ceq_w", "tooth"]),
        machine(53, covariates={"date": "2026-01-01", "rate": "2.5"}),
    ]
    rows += [machine(number, 1, type="B") for number in range(100, 106)]
    rows += [machine(200, 2, type="C")]
    return write_rows(tmp_path_factory.mktemp("fleet") / "out", rows)


@pytest.fixture(scope="module")
def known(fleet, tmp_path_factory):
    out = tmp_path_factory.mktemp("type") / "a"
    return heatrun.population(
        fleet, type="A", covariates=["supplier", "date", "rate"], out=out
    ), out


def test_median_and_spread_are_found(known):
    result = known[0].result
    for place, name in enumerate(NAMES[1:3], start=1):
        low, high = result.parameters[name].median.interval_95
        assert 0.97 * low < MEDIAN[place] < 1.03 * high
        low, high = result.parameters[name].spread.interval_95
        assert 0.9 * low < SPREAD[place] < 1.1 * high
    assert result.num_machines == NUM
    assert list(known[0].summary().unit) == ["J/K", "J/K", "K/W", "K/W"]


def test_machines_that_cannot_count_are_left_out_and_named(known):
    reasons = {each.name: each.reason for each in known[0].result.left_out}
    assert set(reasons) == {"M050", "M051", "M052", "M053"}
    assert reasons["M050"] == "refused: Column winding_degC jumps 41 K in 1 s."
    assert reasons["M051"] == "not converged: the search has not ended"
    assert reasons["M052"] == "other parameters than most: has tooth and lacks Ceq_sr"
    assert reasons["M053"] == "has no supplier"
    assert list(known[0].left_out().machine) == list(reasons)


def test_supplier_and_drift_are_found(known):
    result = known[0].result
    supplier = result.covariate_columns["supplier=south"]
    assert (supplier.kind, supplier.reference) == ("category", "north")
    low, high = supplier.over_range["Req_sr"].interval_95
    assert 0.0 < low < np.expm1(SUPPLIER) < high
    date = result.covariate_columns["date"]
    assert (date.first, date.last) == ("2026-01-01", "2026-12-24")
    per_year = result.covariates["date"]["Ceq_w"]
    low, high = per_year.interval_95
    assert 0.0 < low < np.expm1(DRIFT) < high
    # over 51 weeks the same, to within what they are short of a year
    over = date.over_range["Ceq_w"].value
    assert np.log1p(over) == pytest.approx(np.log1p(per_year.value) * 357 / 365.25, rel=1e-6)


def test_a_covariate_that_is_the_same_everywhere_is_said(known):
    result = known[0].result
    assert "rate" not in result.covariate_columns
    assert result.notes == ["rate is '2.5' for all machines: it explains nothing here."]


def test_the_outlier_is_named_with_what_is_different(known):
    by_name = {each.name: each for each in known[0].result.machines}
    assert by_name["M007"].is_outlier
    assert by_name["M007"].different == ["Req_w"]
    assert sum(each.is_outlier for each in by_name.values()) <= 2


def test_the_file_holds_to_its_schema_and_reads_back(known):
    content = (known[1] / "population.json").read_bytes()
    validator = jsonschema.Draft202012Validator(schema_of("population-1.json", SCHEMAS))
    assert [error.message for error in validator.iter_errors(json.loads(content))] == []
    read = from_json(content, PopulationResult, "population.json", "here")
    assert read == known[0].result


def test_the_table_is_what_its_schema_says(known):
    table = duckdb.sql(f"select * from '{known[1]}/population.parquet'").to_arrow_table()
    assert table.column_names == [name for name, *_ in COLUMNS]
    for name, _, unit, meaning in COLUMNS:
        said = schema().field(name).metadata
        assert said[b"meaning"].decode() == meaning
        assert said.get(b"unit", b"").decode() == unit
    rows = {row["machine"]: row for row in table.to_pylist()}
    assert (rows["M053"]["status"], rows["M053"]["reason"]) == ("left out", "has no supplier")
    machine = known[0].result.machines[3]
    row = rows[machine.name]
    for name, own in machine.parameters.items():
        place = row["parameters"].index(name)
        assert row["given_values"][place] == own.value
        assert (row["given_low_95"][place], row["given_high_95"][place]) == own.interval_95
        assert row["alone_values"][place] == own.alone_value
        # what the other machines say makes the interval narrower
        given, alone = (end - start for start, end in (own.interval_95, own.alone_interval_95))
        assert given < alone


def test_the_folder_of_several_types_is_refused_with_their_names(known):
    folder = known[1].parent
    text = f'[motor]\nname = "next"\n[population]\nrun = "../{folder.name}"\n'
    with pytest.raises(InputError, match="Name one of the types in it: a"):
        parse_motor(text.encode(), str(folder / "motor.toml"))


def test_one_type_of_several_has_to_be_chosen(fleet):
    with pytest.raises(InputError, match=r"found 3: 'A' \(44 machines\), 'B' \(6 machines\)"):
        heatrun.population(fleet)
    with pytest.raises(InputError, match="no machine of type 'D'"):
        heatrun.population(fleet, type="D")


@pytest.mark.slow
def test_all_types_are_written_and_the_small_one_is_named(fleet, tmp_path, capsys):
    words = ["population", str(fleet), "--out", str(tmp_path / "types"), "--json"]
    assert cli.main(words) == 0
    found = json.loads(capsys.readouterr().out)["populations"]
    assert [each["type"] for each in found] == ["A", "B", "C"]
    assert "3 machines or more, got 1" in found[2]["error"]["problem"]
    assert not (tmp_path / "types" / "c").exists()
    names = {"population.json", "population.parquet", "type_sheet.pdf"}
    for each, folder in zip(found[:2], ("a", "b"), strict=True):
        assert {path.name for path in (tmp_path / "types" / folder).iterdir()} == names
        assert len(each["files"]) == 3
    # again it does nothing, with other settings it is refused
    assert cli.main(words) == 0
    capsys.readouterr()
    assert cli.main([*words[:4], "--seed", "1", "--type", "B"]) == 0
    alone = (tmp_path / "types" / "population.json").read_bytes()
    assert cli.main([*words[:4], "--seed", "2", "--type", "B"]) == 1
    assert "--force" in capsys.readouterr().err
    assert (tmp_path / "types" / "population.json").read_bytes() == alone


def test_the_command_says_it_in_words(fleet, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = ["population", str(fleet / "machines.parquet"), "--type", "A"]
    for covariate in ("supplier", "date", "rate"):  # as `known` has it: nothing compiles anew
        words += ["--covariate", covariate]
    for _ in range(2):
        assert cli.main(words) == 0
    assert [path.name for path in (tmp_path / "results" / "populations").iterdir()] == ["a"]
    said = capsys.readouterr().out
    assert "Type A: 40 machines count of the fleet" in said
    assert "4 left out; 1 of them does not fit the type." in said
    assert "does not fit: M007 (probability 1.00; different: Req_w " in said
    assert "supplier: south against north: Changes " in said
    assert cli.main([*words, "--seed", "3"]) == 0
    assert (tmp_path / "results" / "populations" / "a-2").is_dir()


def test_words_that_do_not_go_together(fleet, tmp_path, capsys):
    assert cli.main(["population", str(fleet), "--type", "A", "--covariate", "suplier"]) == 1
    assert "Did you mean 'supplier'?" in capsys.readouterr().err
    assert cli.main(["population", str(tmp_path)]) == 1
    assert "no fleet" in capsys.readouterr().err
    assert cli.main(["population", str(fleet), str(fleet)]) == 1
    assert "one fleet alone" in capsys.readouterr().err
    assert cli.main(["population", str(tmp_path), str(fleet), "--covariate", "date"]) == 2
    (tmp_path / "machines.parquet").write_bytes(b"PAR1 and no more")
    assert cli.main(["population", str(tmp_path)]) == 1
    assert "could not be read" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("texts", "kind"),
    [
        (["1", "2.5", "-3e2"], "number"),
        (["2026-03-01", "2026-03-01T12:00", "2025-12-31T23:00+01:00"], "date"),
        (["north", "south", "north", "north", "south", "2"], "category"),
    ],
)
def test_what_a_column_is_taken_for(texts, kind):
    found = covariates_of("c", texts, "here")
    assert {each.kind for each in found} == {kind}


def test_a_column_that_is_nothing_is_refused_with_the_odd_one():
    texts = ["2026-03-01", "2026-03-02", "31.03.2026", "2026-04-01"]
    with pytest.raises(InputError, match=r"such as '31\.03\.2026'"):
        covariates_of("date", texts, "here")


def test_parameters_that_are_normal_by_their_value(tmp_path):
    """A share of losses lies between 0 and 1 and is normal itself."""
    rows = []
    for number in range(12):
        own = machine(number, 5)
        share = 0.4 + 0.05 * np.random.default_rng(number).standard_normal()
        # four, as the noise has: one program for both
        own["parameters"][3], own["parameter_units"][3] = "share_yoke", "1"
        own["transforms"] = ["log", "log", "log", "linear"]
        own["log_mean"][3] = share
        own["log_covariance"][-1] = 1e-4
        own["prior_mean"][3], own["prior_sd"][3] = 0.5, 0.25
        rows.append(own)
    write_rows(tmp_path, rows)
    said = heatrun.population(tmp_path, out=tmp_path).result.parameters["share_yoke"]
    assert 0.35 < said.median.value < 0.45
    assert 0.03 < said.spread.value < 0.09
    assert said.next_log_sd is None
    text = '[motor]\nname = "next"\n[population]\nrun = "."\n'
    motor = parse_motor(text.encode(), str(tmp_path / "motor.toml"))
    override = motor.parameters["share_yoke"]
    assert (override.value, override.sd) == (said.next_median, said.next_sd)
    assert override.relative_sd is None


def test_covariates_that_go_together_are_said(tmp_path):
    rows = [
        machine(n, 3, covariates={"supplier": "north" if n < 6 else "south", "line": str(n // 6)})
        for n in range(12)
    ]
    gathered = gathered_of_fleet(read_fleet(write_rows(tmp_path, rows)), "A")
    (note,) = designed(gathered, ["supplier", "line"], "here").notes
    assert note.startswith("supplier=south and line change together")
    assert "cannot be told apart" in note


def test_covariates_that_explain_everything_are_refused(tmp_path):
    rows = [machine(n, 3, covariates={"line": str(n % 2)}) for n in range(3)]
    with pytest.raises(InputError, match=r"4 machines or more .* covariates line, got 3"):
        heatrun.population(write_rows(tmp_path, rows), covariates="line")
