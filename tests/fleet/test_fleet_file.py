"""The fleet file and the table of its machines: what is read, and what is refused with words."""

import datetime

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from heatrun.errors import InputError
from heatrun_fleet.fleet_file import load_fleet

HEAD = '[fleet]\nname = "line"\nmotor = "motor.toml"\n'
TABLE = """machine,type,test,role,supplier
M1,A,a.csv,,north
M2,A,b.csv,calibration,south
M1,,c.csv,holdout,
M2,A,d.csv,,south
"""


def of_text(folder, text, name="FLEET.toml", **files):
    for file, content in files.items():
        (folder / file.replace("_csv", ".csv")).write_text(content)
    (folder / name).write_text(text)
    return load_fleet(folder / name)


def ids(entry):
    return [finding.id for finding in entry.findings]


def test_table_and_toml_give_the_same_machines(tmp_path):
    by_table = of_text(tmp_path, f'{HEAD}manifest = "m.csv"\n', m_csv=TABLE)
    by_toml = of_text(
        tmp_path,
        f'{HEAD}type = "A"\n'
        '[[machines]]\nid = "M1"\ntests = ["a.csv"]\nholdout = ["c.csv"]\nsupplier = "north"\n'
        '[[machines]]\nid = "M2"\ntests = ["b.csv", "d.csv"]\nsupplier = "south"\n',
    )
    assert by_table.entries == by_toml.entries
    first, second = by_table.entries
    assert (first.machine, first.type, first.motor) == ("M1", "A", "motor.toml")
    assert (first.tests, first.holdout) == (("a.csv",), ("c.csv",))
    assert second.tests == ("b.csv", "d.csv")
    assert first.covariates == (("supplier", "north"),)
    assert first.findings == second.findings == ()
    assert by_table.network.name == "second"


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
def test_a_table_alone_names_its_motor_files(tmp_path, delimiter):
    rows = ["id,motor,tests,date", "M1,m.toml,a.csv|b.csv,2026-03-01", "", "M2,m.toml,c.csv,"]
    fleet = of_text(tmp_path, "\n".join(rows).replace(",", delimiter), "line7.csv")
    assert fleet.name == "line7"
    assert [entry.tests for entry in fleet.entries] == [("a.csv", "b.csv"), ("c.csv",)]
    assert fleet.entries[0].covariates == (("date", "2026-03-01"),)
    assert fleet.entries[1].covariates == ()


def test_a_covariate_may_resemble_a_known_column(tmp_path):
    fleet = of_text(tmp_path, "machine,motor,test,rotor\nM1,m.toml,a.csv,cast\n", "m.csv")
    assert fleet.entries[0].covariates == (("rotor", "cast"),)


def test_parquet_holds_lists_dates_and_numbers(tmp_path):
    table = pa.table({
        "machine": ["M1", "M2"], "motor": ["m.toml"] * 2, "tests": [["a.csv", "b.csv"], ["c.csv"]],
        "date": [datetime.date(2026, 3, 1), None], "winder": [4, 5],
    })  # fmt: skip
    pq.write_table(table, tmp_path / "m.parquet")
    first, second = load_fleet(tmp_path / "m.parquet").entries
    assert first.tests == ("a.csv", "b.csv")
    assert first.covariates == (("date", "2026-03-01"), ("winder", "4"))
    assert second.covariates == (("winder", "5"),)


def test_a_date_of_toml_is_a_covariate(tmp_path):
    text = f'{HEAD}[[machines]]\nid = "M1"\ntests = "a.csv"\ndate = 2026-03-01\n'
    assert of_text(tmp_path, text).entries[0].covariates == (("date", "2026-03-01"),)


BAD_ROWS = {
    "contradictory_rows": "M1,A,a.csv,,north\nM1,B,b.csv,,north",
    "duplicate_test": "M1,A,a.csv,,north\nM1,A,a.csv,holdout,north",
    "unknown_role": "M1,A,a.csv,hold-out,north",
    "no_test": "M1,A,,,north",
    "no_machine": ",A,a.csv,,north",
    "bad_row": "M1,A,a.csv,,north,and,more",
}


@pytest.mark.parametrize("expected", BAD_ROWS)
def test_a_bad_row_is_its_machines_alone(tmp_path, expected):
    table = f"machine,type,test,role,supplier\n{BAD_ROWS[expected]}\nM2,A,good.csv,,south\n"
    bad, good = of_text(tmp_path, f'{HEAD}manifest = "m.csv"\n', m_csv=table).entries
    assert expected in ids(bad)
    assert bad.is_refused
    assert all(finding.where.startswith("m.csv, line") for finding in bad.findings)
    assert (good.machine, good.findings) == ("M2", ())


def test_no_motor_file_anywhere_is_said_of_the_machine(tmp_path):
    fleet = of_text(tmp_path, '[fleet]\nname = "x"\n[[machines]]\nid = "M1"\ntests = "a.csv"\n')
    assert ids(fleet.entries[0]) == ["no_motor"]


REFUSED = {
    "not known. Did you mean 'manifest'": f'{HEAD}manifets = "m.csv"\n',
    "Expected the name of the fleet": '[fleet]\nmanifest = "m.csv"\n',
    "either a manifest or": HEAD,
    "got both": f'{HEAD}manifest = "m.csv"\n[[machines]]\nid = "M1"\n',
    "cannot be opened": f'{HEAD}manifest = "gone.csv"\n',
    "no network": f'{HEAD}manifest = "m.csv"\nmodel = "fifth"\n',
    "no valid TOML": "[fleet\n",
    "has a meaning of its own": f'{HEAD}manifest = "m.csv"\ncovariates = ["type"]\n',
    "'supplier' is not known": f'{HEAD}manifest = "m.csv"\ncovariates = ["winder"]\n',
    "Expected a text for motor": '[fleet]\nname = "x"\nmotor = 3\nmanifest = "m.csv"\n',
}


@pytest.mark.parametrize("sentence", REFUSED)
def test_a_wrong_fleet_file_is_refused_with_words(tmp_path, sentence):
    with pytest.raises(InputError) as refusal:
        of_text(tmp_path, REFUSED[sentence], m_csv=TABLE)
    assert sentence in str(refusal.value)


TABLES = {
    "column machine": "name,test\nM1,a.csv\n",
    "column test": "machine,motor\nM1,m.toml\n",
    "Did you mean 'holdout'": "machine,test,motor,holdouts\nM1,a.csv,m.toml,b.csv\n",
    "stands there twice": "machine,test,motor,id\nM1,a.csv,m.toml,1\n",
    "at least one row": "machine,test,motor\n\n",
    "column motor": "machine,test\nM1,a.csv\n",
    "UTF-8": b"machine,test,motor\n\xff,a,b\n",
    "cannot be read": 'machine,test,motor\n"M1,a.csv,' + "x" * 200_000,
    "Parquet table": b"PAR1 and no more",
    "something else": b"\x00\x01\x02",
    "found none": "",
}


@pytest.mark.parametrize("sentence", TABLES)
def test_a_wrong_table_is_refused_with_words(tmp_path, sentence):
    content = TABLES[sentence]
    data = content if isinstance(content, bytes) else content.encode()
    (tmp_path / "m.csv").write_bytes(data)
    with pytest.raises(InputError) as refusal:
        load_fleet(tmp_path / "m.csv")
    assert sentence in str(refusal.value)
