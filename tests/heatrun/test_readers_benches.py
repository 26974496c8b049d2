"""Text tables as loggers of many makes write them, in members that `tests/readings` has not."""

import io

import numpy as np
import pandas as pd
import pytest

from heatrun.errors import InputError
from heatrun.init.survey import survey
from heatrun.readers.read import read_record
from heatrun.readers.text.reader import read_text
from heatrun.record.motor import Motor

N = 12
TEMPERATURE = np.round(23.4 + 31.0 * (1.0 - np.exp(-np.arange(N) / 5.0)), 2)
CURRENT = np.where(np.arange(N) < 8, 17.5, 0.0)


def rows(times, form="{time},{T:.2f},{I:.1f}", **more):
    """Return lines of data."""
    return "\n".join(
        form.format(i=i + 1, time=time, T=TEMPERATURE[i], I=CURRENT[i], **more)
        for i, time in enumerate(times)
    )


def written(tmp_path, content, name="test.csv"):
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def by_name(path):
    table = read_text(path.read_bytes(), str(path))
    return {column.name: column for column in table.columns}


SECONDS = [f"{5 * i}" for i in range(N)]

SIGNS_APART = {
    "minus alone": ("{time},{T:.2f},-    {I:.1f}", ","),
    "full-width digits": ("{time},+ {T:.2f},{I:.1f}", ","),
    "columns of one width": ("{time:>6}  +{T:>8.2f}  -{I:>8.1f}", "  "),
}


@pytest.mark.parametrize("member", SIGNS_APART)
def test_blanks_between_sign_and_digits(tmp_path, member):
    form, delimiter = SIGNS_APART[member]
    text = rows(SECONDS, form)
    if member == "full-width digits":
        text = text.translate({ord(c): ord(c) + 0xFEE0 for c in "0123456789.+-"})
    found = by_name(written(tmp_path, delimiter.join(("t [s]", "CH1", "CH2")) + "\n" + text))
    np.testing.assert_array_equal(found["CH1"].values, TEMPERATURE)
    sign = -1.0 if "- " in form or "-{I:>" in form else 1.0
    np.testing.assert_array_equal(found["CH2"].values, sign * CURRENT)


ENCODED = {
    "Windows-1251": ("cp1251", "Номер,Время,Температура обмотки [°C],Ток [A]\n"),
    "code page 850": ("cp850", "Nr,Zeit,Wicklung [°C],Strom für Phase U [A]\n"),
    "Mac Roman": ("mac_roman", "Nr,Zeit,Wicklung [°C],Strom über U [A]\n"),
    "Windows-1250, Polish": ("cp1250", "Nr,Czas,Temperatura uzwojenia [°C],Prąd fazowy [A]\n"),
    "Windows-1250, Czech": ("cp1250", "Nr,Čas,Teplota vinutí [°C],Proud měřený [A]\n"),
    "Windows-1252, French": ("cp1252", "Nr,Temps,Température relevée [°C],Régime arrêté à [A]\n"),
    "Windows-1252 stays": ("cp1252", "Nr,Zeit,Kühlung Größe [°C],Höhe [A]\n"),
    "ISO-2022-JP": ("iso2022_jp", "番号,時刻,巻線温度[°C],電流[A]\n"),
    "full-width forms": ("utf-8", "Ｎｏ,時刻,巻線温度［℃］,電流（Ａ）\n"),
    "units in words": ("gb18030", "序号,时间,绕组温度(摄氏度),相电流(安培)\n"),
}


@pytest.mark.parametrize("member", ENCODED)
def test_encodings_of_the_world(tmp_path, member):
    codec, head = ENCODED[member]
    clock = [f"2025/03/04 13:{i:02d}:30" for i in range(N)]
    text = head + rows(clock, "{i},{time},{T:.2f},{I:.1f}")
    path = written(tmp_path, text.encode(codec))
    found = by_name(path)
    assert list(found) == head.partition("\n")[0].split(",")
    temperature = list(found.values())[2]
    record = read_record(path, Motor("M", columns={"winding_degC": temperature.name}))
    np.testing.assert_array_equal(record["winding_degC"], TEMPERATURE)
    np.testing.assert_array_equal(record.time_s, 60.0 * np.arange(N))
    assert record.mapping[0].unit_from == "stated"


@pytest.mark.parametrize(
    "sign", ["°C", "℃", "ﾟC", "゜C", "ºC", "˚C", "∘C", "°Ｃ", "Â°C", "°С", "&deg;C"]
)
def test_every_form_of_the_degree_celsius(tmp_path, sign):
    head = f"Time,T 1,I 1\ns,{sign},A\n"
    path = written(tmp_path, head + rows(SECONDS))
    record = read_record(path, Motor("M", columns={"winding_degC": "T 1"}))
    np.testing.assert_array_equal(record["winding_degC"], TEMPERATURE)
    assert any("in degC" in note for note in record.notes)


AM = {"es": "a.m.", "el": "πμ"}


def clocks(form):
    """Return times of 0.25 s steps from 11:59:58 on, by means that the reader does not share."""
    out = []
    for i in range(N):
        ms = 250 * i
        second = 58 + ms // 1000
        hour, minute = (12, 0) if second >= 60 else (11, 59)
        word = "오후" if hour == 12 else "오전"
        ms %= 1000
        halves = {"h12": hour, "es": "p. m.", "el": "μμ"} if hour == 12 else {"h12": hour, **AM}
        out.append(
            form.format(h=hour, m=minute, s=second % 60, ms=ms, cs=ms // 10, word=word, **halves)
        )
    return out


CLOCKS = {
    "thousandths without zeros": "2025/03/17 {h:02d}:{m:02d}:{s:02d}:{ms}",
    "a blank before the thousandths": "2025/03/17 {h:02d}:{m:02d}:{s:02d} {ms:03d}",
    "a hyphen behind the date": "2025/03/17-{h:02d}:{m:02d}:{s:02d}.{ms:03d}",
    "day of the week": "Mon 17-Mar-2025 {h:02d}:{m:02d}:{s:02d}.{ms:03d}",
    "Korean": "2025년 3월 17일 {word} {h}:{m:02d}:{s:02d}.{ms:03d}",
    "letters": "{h}h {m:02d}m {s:02d}.{ms:03d}s",
    "a zone behind the thousandths": "2025-03-17T{h:02d}:{m:02d}:{s:02d}:{ms:03d}Z",
    "in brackets": "[{h:02d}:{m:02d}:{s:02d}.{ms:03d}]",
    "behind a plus": "T+{h:02d}:{m:02d}:{s:02d}.{ms:03d}",
    "with days by letter": "2d {h:02d}:{m:02d}:{s:02d}.{ms:03d}",
    "without zeros": "3/17/2025 {h}:{m}:{s}.{ms:03d}",
    "Spanish": "17/03/2025 {h12}:{m:02d}:{s:02d}.{ms:03d} {es}",
    "Greek": "17/03/2025 {h12}:{m:02d}:{s:02d}.{ms:03d} {el}",
    "UTC": "2025-03-17 {h:02d}:{m:02d}:{s:02d}.{ms:03d} UTC",
    "UTC without a date": "{h:02d}:{m:02d}:{s:02d}.{ms:03d} UTC",
    "the year last": "Mon Mar 17 {h:02d}:{m:02d}:{s:02d}.{ms:03d} 2025",
    "day of the year": "2025-076T{h:02d}:{m:02d}:{s:02d}.{ms:03d}",
    "days of three digits": "001:{h:02d}:{m:02d}:{s:02d}.{ms:03d}",
    "an apostrophe": "'25-03-17 {h:02d}:{m:02d}:{s:02d}.{ms:03d}",
}


@pytest.mark.parametrize("member", CLOCKS)
def test_clocks_of_many_makes(tmp_path, member):
    text = "Scan,When,101 (C),301 (AAC)\n" + rows(clocks(CLOCKS[member]), "{i},{time},{T},{I}")
    record = read_record(written(tmp_path, text))
    np.testing.assert_allclose(record.time_s, 0.25 * np.arange(N), atol=1e-9)


@pytest.mark.parametrize(
    "form",
    [
        "{h:02d}:{m:02d}:{s:02d}:{cs:02d}",
        "{h:02d}.{m:02d}.{s:02d}.{ms:03d}",
        "{h:02d}-{m:02d}-{s:02d}.{ms:03d}",
        "3.{h:02d}:{m:02d}:{s:02d}.{ms:03d}",
    ],
)
def test_a_text_that_looks_like_a_clock_is_offered_for_the_time(tmp_path, form):
    text = rows(clocks(form), "{i},{time},{T}")
    path = written(tmp_path, f"No,Clock,T1 [degC]\n{text}")
    column = next(one for one in survey(path).free if one.name == "Clock")
    line = column.proposals[0].line
    record = read_record(path, Motor("M", columns={"time_s": line}))
    np.testing.assert_allclose(record.time_s, 0.25 * np.arange(N), atol=1e-9)


def test_a_rate_that_is_said_goes_before_a_clock_that_was_found(tmp_path):
    clock = [f"2025/03/04 13:{i:02d}:30" for i in range(N)]
    path = written(tmp_path, "No,Stamp,Coil [degC]\n" + rows(clock, "{i},{time},{T}"))
    by_rate = read_record(path, rate_Hz=2.0).time_s
    by_columns = read_record(path, Motor("M", columns={"time_s": "rate 2 Hz"})).time_s
    np.testing.assert_array_equal(by_rate, 0.5 * np.arange(N))
    np.testing.assert_array_equal(by_columns, by_rate)


UNITS_OF_TIME = {
    "date and time": "No.,Stamp,Coil,Room\n#,Date/Time,°C,°C\n",
    "a word that is no unit": "No,Moment,Coil,Room\n-,local,degC,degC\n",
}


@pytest.mark.parametrize("member", UNITS_OF_TIME)
def test_words_of_time_in_the_row_of_units(tmp_path, member):
    clock = [f"2025/03/04 13:{i:02d}:30" for i in range(N)]
    path = written(tmp_path, UNITS_OF_TIME[member] + rows(clock, "{i},{time},{T},22.5"))
    record = read_record(path, Motor("M", columns={"winding_degC": "Coil"}))
    np.testing.assert_array_equal(record.time_s, 60.0 * np.arange(N))
    np.testing.assert_array_equal(record["winding_degC"], TEMPERATURE)


def test_a_column_of_milliseconds_belongs_to_the_clock_beside_it(tmp_path):
    ms = 200 * np.arange(N)
    clock = [f"2025/03/04 13:00:{k // 1000:02d},{k % 1000}" for k in ms]
    head = "No.,Date&Time,ms,Coil\nNO.,time,ms,degC\n"
    record = read_record(written(tmp_path, head + rows(clock, "{i},{time},{T}")))
    np.testing.assert_allclose(record.time_s, 1e-3 * ms)


def test_clock_times_under_a_unit_of_temperature_are_no_time(tmp_path):
    path = written(
        tmp_path, "a,Start\ns,degC\n" + "\n".join(f"{i},12:00:{i:02d}" for i in range(N))
    )
    assert by_name(path)["Start"].unit == "degC"


LVM = """LabVIEW Measurement\t
Writer_Version\t2
Separator\tTab
Decimal_Separator\t.
X_Columns\tOne
Date\t2025/03/04
***End_of_Header***\t
\t
Channels\t2\t\t
Samples\t12\t12\t
Date\t2025/03/04\t2025/03/04\t
Y_Unit_Label\tdegC\tA\t
X_Dimension\tTime\tTime\t
X0\t0.0E+0\t0.0E+0\t
Delta_X\t5.000000\t5.000000\t
***End_of_Header***\t\t\t
X_Value\tCoil\tPhase\tComment
"""


def test_labview_measurement_without_times_and_with_a_decimal_comma(tmp_path):
    head = LVM.replace(".", ",").replace("One", "No")
    text = rows(SECONDS, "\t{T}\t{I}\t").replace(".", ",")
    record = read_record(written(tmp_path, head + text, "test.lvm"))
    np.testing.assert_array_equal(record.time_s, 5.0 * np.arange(N))
    np.testing.assert_array_equal(record["winding_degC"], TEMPERATURE)


def test_labview_measurement_with_a_comment_at_one_sample(tmp_path):
    text = rows(SECONDS, "{time}\t{T}\t{I}").replace("\t17.5\n", "\t17.5\tload on\n", 1)
    path = written(tmp_path, LVM + text, "test.lvm")
    motor = Motor("M", columns={"winding_degC": "Coil", "phase_current_A": "Phase"})
    record = read_record(path, motor)
    np.testing.assert_array_equal(record.time_s, 5.0 * np.arange(N))
    np.testing.assert_array_equal(record["winding_degC"], TEMPERATURE)
    np.testing.assert_array_equal(record["phase_current_A"], CURRENT)
    assert record.start == "2025-03-04"
    assert all(reading.unit_from == "stated" for reading in record.mapping)


def test_full_width_commas_between_the_cells(tmp_path):
    text = "t [s]，T [°C]，I [A]\n" + rows(SECONDS, "{time}，{T}，{I}")
    found = by_name(written(tmp_path, text.encode("gb18030")))
    np.testing.assert_array_equal(found["T [°C]"].values, TEMPERATURE)


@pytest.mark.parametrize(
    "footer", ["\nMin;20;1\nMax;80;2\n", "Average;50;1.5\n", "\nEnd of data;;\n"]
)
def test_words_below_the_table_are_no_samples(tmp_path, footer):
    path = written(
        tmp_path, "t [s];T [degC];I [A]\n" + rows(SECONDS, "{time};{T};{I}") + "\n" + footer
    )
    record = read_record(path, Motor("M", columns={"winding_degC": "T"}))
    np.testing.assert_array_equal(record["winding_degC"], TEMPERATURE)
    assert [finding.id for finding in record.findings] == ["ragged_rows"]


@pytest.mark.parametrize("preamble", ["Unit 7\n1;2;3\n4;5;6\n", "Channel;Gain;Offset\n1;0.5;0\n\n"])
def test_a_preamble_of_numbers_is_not_the_table(tmp_path, preamble):
    text = f"{preamble}t [s];T [degC];I [A]\n" + rows(SECONDS, "{time};{T};{I}")
    path = written(tmp_path, text)
    np.testing.assert_array_equal(by_name(path)["T [degC]"].values, TEMPERATURE)
    told = [finding.id for finding in survey(path).findings]
    assert told == (["rows_above"] if preamble.startswith("Channel;") else [])


def test_the_same_header_again_is_a_restart_of_the_logger(tmp_path):
    head = "Analyzer 3\nlog restarted\nt [s]\tT [degC]\tI [A]\n"
    lines = rows(SECONDS, "{time}\t{T}\t{I}").split("\n")
    text = head + "\n".join(lines[:7]) + "\n" + head + "\n".join(lines[7:]) + "\n"
    path = written(tmp_path, text)
    record = read_record(path)
    np.testing.assert_array_equal(record.time_s, 5.0 * np.arange(N))
    (finding,) = record.findings
    assert (finding.id, finding.values["first_sample"]) == ("logger_restarted", 7)
    assert "[tests.test] use_rows = [[1, 7], [8, 12]]" in finding.remedy
    assert survey(path).findings[0].id == "logger_restarted"


@pytest.mark.parametrize("units", ["s\t°C\tA\n", "Units\t°C\tA\n"])
def test_the_same_header_with_other_units_is_refused(tmp_path, units):
    lines = rows(SECONDS, "{time}\t{T}\t{I}").split("\n")
    names = "t\tCoil\tPhase\n"

    def text(*heads):
        return "\n".join([heads[0] + "\n".join(lines[:7]), heads[1] + "\n".join(lines[7:])])

    again = written(tmp_path, text(names + units, names + units))
    assert by_name(again)["Coil"].values.size == N
    other = written(tmp_path, text(names + units, names + units.replace("°C", "°F")))
    with pytest.raises(InputError, match="units"):
        by_name(other)


TABLES_OF_CHANNELS = {
    "a row for each channel": (
        'CH,Signal name,Input,Span\nCH1,"Coil U",TEMP,-200,1370,degC\n'
        'CH2,"Phase current",DC,0,20,A\n'
        "Number,Time,CH1,CH2\nNO.,s,degC,A\n",
        "CH1",
    ),
    "the name behind the range": (
        '"Ch","Mode","Range","Comment"\n"CH-1","Tc","2000 C","Winding U"\n'
        '"CH-2","Voltage","10V","Phase current rms"\n"No","Time","CH-1[C]","CH-2[A]"\n',
        "CH-1[C]",
    ),
    "a row for each property": (
        '"CH","U1-1","U1-2"\n"Mode","Tc","Voltage"\n"Comment","Wicklung","Strangstrom eff"\n'
        '"Ratio","1.0E+00","1.0E+00"\n"No","Time","U1-1[C]","U1-2[A]"\n',
        "U1-1",
    ),
}


@pytest.mark.parametrize("member", TABLES_OF_CHANNELS)
def test_names_in_the_table_of_channels_of_a_logger(tmp_path, member):
    head, as_written = TABLES_OF_CHANNELS[member]
    path = written(tmp_path, head + rows(SECONDS, "{i},{time},{T},{I}"))
    record = read_record(path)
    np.testing.assert_array_equal(record["winding_degC"], TEMPERATURE)
    np.testing.assert_array_equal(record["phase_current_A"], CURRENT)
    for name in (as_written, as_written.partition("[")[0]):
        record = read_record(path, Motor("M", columns={"housing_degC": name}))
        np.testing.assert_array_equal(record["housing_degC"], TEMPERATURE)
        assert "housing_degC" not in record.decided


def test_names_that_say_something_are_not_replaced_by_a_comment(tmp_path):
    head = "Channel,Comment\nTime,base\nCoil,Housing of U\nCH2,-\nTime,Coil [degC],CH2 [degC]\n"
    path = written(tmp_path, head + rows(SECONDS, "{time},{T},{I}"))
    assert list(by_name(path)) == ["Time", "Coil [degC]", "CH2 [degC]"]


@pytest.mark.parametrize(
    ("epoch", "count"), [(".NET", 638452123200000000), ("Windows", 133540963200000000)]
)
def test_counts_of_100_ns_are_known_by_their_value(tmp_path, epoch, count):
    ticks = [f"{count + 2_500_000 * i}" for i in range(N)]
    path = written(tmp_path, "Stamp,Coil [degC]\n" + rows(ticks, "{time},{T}"))
    record = read_record(path)
    np.testing.assert_array_equal(record.time_s, 0.25 * np.arange(N))
    assert epoch in by_name(path)["Stamp"].note
    assert by_name(path)["Stamp"].start.startswith("2024-03-05T")


def test_a_datenum_counts_days(tmp_path):
    days = [f"{739316.375 + i / 1024}" for i in range(N)]
    path = written(tmp_path, "datenum,Coil [degC]\n" + rows(days, "{time},{T}"))
    record = read_record(path, Motor("M", columns={"time_s": "datenum"}))
    np.testing.assert_allclose(record.time_s, 84.375 * np.arange(N), atol=1e-3)


@pytest.mark.parametrize("name", ["Timestamp", "time", "Time [s]"])
@pytest.mark.parametrize("per_second", [10**3, 10**6, 10**9])
def test_counts_since_1970_are_read_without_a_unit(tmp_path, name, per_second):
    first = 1_741_093_200 * per_second  # 2025-03-04 13:00
    counts = [f"{first + i * per_second // 4}" for i in range(N)]
    record = read_record(written(tmp_path, f"{name},Coil [degC]\n" + rows(counts, "{time},{T}")))
    np.testing.assert_array_equal(record.time_s, 0.25 * np.arange(N))
    assert (record.start, record.clock_s) == ("2025-03-04", 13 * 3600.0)


def test_days_of_three_digits_may_be_hours_of_a_clock_with_hundredths(tmp_path):
    clock = [f"000:00:{i:02d}:00" for i in range(N)]
    path = written(tmp_path, "No,Clock,T1 [degC]\n" + rows(clock, "{i},{time},{T}"))
    assert "Clock" not in by_name(path)


def by_tag(*clocks, head="TagName,TimeStamp,Value,Quality"):
    """Return a row for each sample of a tag, whose clocks are given in seconds."""
    values = {"M1.WINDING_TEMP": TEMPERATURE, "M1.MOTOR_CURRENT": CURRENT}
    lines = [
        f"{tag},2025-03-04 13:00:{clock[i]:06.3f},{values[tag][i]},192"
        for i in range(N)
        for tag, clock in zip(values, clocks, strict=True)
    ]
    return "\n".join((head, *lines))


COLUMNS = {"winding_degC": "M1.WINDING_TEMP [degC]", "phase_current_A": "M1.MOTOR_CURRENT [A]"}


def test_a_row_for_each_sample_of_a_tag(tmp_path):
    clock = 2.0 * np.arange(N)
    path = written(tmp_path, by_tag(clock, clock))
    record = read_record(path, Motor("M", columns=COLUMNS))
    np.testing.assert_array_equal(record.time_s, clock)
    np.testing.assert_array_equal(record["winding_degC"], TEMPERATURE)
    np.testing.assert_array_equal(record["phase_current_A"], CURRENT)


def test_a_row_for_each_sample_of_a_tag_in_parquet(tmp_path):
    clock = 2.0 * np.arange(N)
    table = pd.read_csv(io.StringIO(by_tag(clock, clock)), parse_dates=["TimeStamp"])
    table["Quality"] = np.where(table.index == 10, "Bad", "Good")  # the sixth of the winding
    table.to_parquet(tmp_path / "run.parquet")
    record = read_record(tmp_path / "run.parquet", Motor("M", columns=COLUMNS))
    np.testing.assert_array_equal(record.time_s, clock)
    assert np.flatnonzero(np.isnan(record["winding_degC"])).tolist() == [5]
    np.testing.assert_array_equal(record["phase_current_A"], CURRENT)


def test_tags_with_clocks_of_their_own_are_joined_at_the_readings(tmp_path):
    clock = 2.0 * np.arange(N)
    late = clock + 0.5 * (np.arange(N) % 3)
    path = written(tmp_path, by_tag(clock, late))
    record = read_record(path, Motor("M", columns=COLUMNS))
    np.testing.assert_array_equal(record.time_s, clock)
    np.testing.assert_array_equal(record["winding_degC"], TEMPERATURE)
    np.testing.assert_allclose(record["phase_current_A"], np.interp(clock, late, CURRENT))


def test_two_values_of_a_tag_at_one_time_are_refused(tmp_path):
    clock = 2.0 * np.arange(N)
    clock[7] = clock[6]
    path = written(tmp_path, by_tag(clock, clock))
    with pytest.raises(InputError, match="two values at one time"):
        read_record(path)


def test_pairs_of_a_time_and_a_value_keep_their_clocks(tmp_path):
    fast = "\n".join(f"{2 * i},{TEMPERATURE[i]},{i + 0.5},{CURRENT[i]}" for i in range(N))
    record = read_record(written(tmp_path, f"Time [s],Coil [°C],Time [s],I_rms [A]\n{fast}"))
    np.testing.assert_array_equal(record.time_s, 2.0 * np.arange(N))
    np.testing.assert_array_equal(record["winding_degC"], TEMPERATURE)
    inside = (record.time_s > 0.5) & (record.time_s < N - 0.5)
    truth = np.interp(record.time_s, np.arange(N) + 0.5, CURRENT)
    np.testing.assert_allclose(record["phase_current_A"][inside], truth[inside])
    assert np.isnan(record["phase_current_A"][-3:]).all()


def test_a_clock_that_runs_back_in_a_pair_is_left_as_a_question(tmp_path):
    lines = "\n".join(f"{2 * i},{TEMPERATURE[i]},{i % 5},{CURRENT[i]}" for i in range(N))
    with pytest.raises(InputError, match="both stand for time_s"):
        read_record(written(tmp_path, f"Time [s],Coil [°C],Time [s],I_rms [A]\n{lines}"))


MARKED = slice(5, 8)
"""Readings that the historian marks."""


def marked(good, bad, num=N):
    """Return a column of marks, of which the readings `MARKED` are not good."""
    marks = [good] * num
    marks[MARKED] = [bad] * (MARKED.stop - MARKED.start)
    return marks


@pytest.mark.parametrize(
    ("head", "good", "bad"),
    [("Time [s],Coil [°C],Coil Quality,I_rms [A],I_rms Quality", "Good", "Bad - Comm Failure"),
     ("Time [s],Coil [°C],Coil.Quality,I_rms [A],I_rms.Quality", "192", "24"),
     ("Time [s],Coil [°C],Quality,I_rms [A],Quality", "Good [Annotated]", "Uncertain"),
     ("Time [s],Coil [°C],Coil_valid,I_rms [A],I_rms_valid", "1", "0"),
     ("Time [s],Coil [°C],Status Coil,I_rms [A],Status I_rms", "gut", "schlecht"),
     ("Time [s],Coil [°C],Coil StatusCode quality,I_rms [A],I_rms StatusCode quality", "0",
      "2147483648")],
)  # fmt: skip
def test_a_reading_marked_as_not_good_is_missing(tmp_path, head, good, bad):
    marks = marked(good, bad)
    body = "\n".join(f"{2 * i},{TEMPERATURE[i]},{marks[i]},{CURRENT[i]},{good}" for i in range(N))
    record = read_record(written(tmp_path, f"{head}\n{body}"))
    assert np.flatnonzero(np.isnan(record["winding_degC"])).tolist() == [5, 6, 7]
    np.testing.assert_array_equal(record["phase_current_A"], CURRENT)
    (finding,) = [one for one in record.findings if one.id == "unreadable_cells"]
    assert finding.severity == "warning"
    assert finding.values == {"count": 3, "first_line": 7}
    assert f"3 of {N} readings are marked" in finding.message
    assert bad in finding.message


def test_marks_of_no_column_are_told(tmp_path):
    marks = marked("Good", "Bad")
    body = "\n".join(f"{2 * i},{TEMPERATURE[i]},{marks[i]},Good,{CURRENT[i]}" for i in range(N))
    record = read_record(
        written(tmp_path, f"Time [s],Coil [°C],x Quality,y Quality,I_rms [A]\n{body}")
    )
    assert np.flatnonzero(np.isnan(record["winding_degC"])).tolist() == [5, 6, 7]  # to its left
    body = "\n".join(f"{2 * i},{TEMPERATURE[i]},Good,{marks[i]},{CURRENT[i]}" for i in range(N))
    record = read_record(
        written(tmp_path, f"Time [s],Coil [°C],x Quality,y Quality,I_rms [A]\n{body}")
    )
    np.testing.assert_array_equal(record["winding_degC"], TEMPERATURE)
    (finding,) = [one for one in record.findings if one.id == "unreadable_cells"]
    assert "none of its readings is left out" in finding.message


def test_one_column_of_marks_is_that_of_its_line(tmp_path):
    marks = marked("OK", "Bad")
    body = "\n".join(f"{2 * i},{TEMPERATURE[i]},{CURRENT[i]},{marks[i]}" for i in range(N))
    record = read_record(written(tmp_path, f"Time [s],Coil [°C],I_rms [A],State\n{body}"))
    for channel in ("winding_degC", "phase_current_A"):
        assert np.flatnonzero(np.isnan(record[channel])).tolist() == [5, 6, 7]
    np.testing.assert_array_equal(record.time_s, 2.0 * np.arange(N))
    (finding,) = record.findings
    assert finding.where.endswith("columns Coil [°C], I_rms [A]")


@pytest.mark.parametrize(
    ("name", "good", "bad"),
    [
        ("Status", "OK", "Fault"),
        ("Relay", "1", "0"),
        ("valid runs", "3", "4"),
        ("Quality", "7", "9"),
    ],
)
def test_other_states_say_nothing_of_a_reading(tmp_path, name, good, bad):
    marks = marked(good, bad)
    body = "\n".join(f"{2 * i},{TEMPERATURE[i]},{CURRENT[i]},{marks[i]}" for i in range(N))
    record = read_record(written(tmp_path, f"Time [s],Coil [°C],I_rms [A],{name}\n{body}"))
    np.testing.assert_array_equal(record["winding_degC"], TEMPERATURE)


def test_the_mark_of_a_sample_of_a_tag_is_its_own(tmp_path):
    clock = 2.0 * np.arange(N)
    lines = by_tag(clock, clock).split("\n")
    lines[11] = lines[11].removesuffix("192") + "0"  # the sixth reading of the winding
    record = read_record(written(tmp_path, "\n".join(lines)), Motor("M", columns=COLUMNS))
    assert np.flatnonzero(np.isnan(record["winding_degC"])).tolist() == [5]
    assert any("1 of" in one.message for one in record.findings if one.id == "unreadable_cells")
    np.testing.assert_array_equal(record["phase_current_A"], CURRENT)


def of_values(columns):
    """Return the columns that hold the temperature and the current."""
    return [
        name for name, one in columns.items()
        if any(np.array_equal(one.values, each) for each in (TEMPERATURE, CURRENT))
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("head", "names"),
    [
        ("t;MX1 coil;MX2 I\ns;°C;A\n;Type K;Type K\n", ["MX1 coil", "MX2 I"]),
        ("Tag,coil,current\nTime [s],Value,Value\n", ["coil Value", "current Value"]),
    ],
)
def test_a_word_over_several_columns_is_no_name(tmp_path, head, names):
    form = "{time};{T:.2f};{I:.1f}" if ";" in head else "{time},{T:.2f},{I:.1f}"
    columns = by_name(written(tmp_path, head + rows(SECONDS, form)))
    assert of_values(columns) == names


OSCILLOSCOPE = (
    '"Model","DL"\n"TraceName","Coil","Current"\n"BlockSize",12,12\n"VUnit","C","A"\n'
    '"HResolution",5.0,5.0\n"HUnit","s","s"\n"Points",1,1\n"Time","08:15:20.0","08:15:20.0"\n\n'
)
EXPERIMENT = (
    "sampling,5\npath,,Root/Coil,Root/Current\ndescription,,,\nunit,s,C,A\n"
)  # fmt: skip


@pytest.mark.parametrize(
    ("content", "names"),
    [
        (OSCILLOSCOPE + rows(SECONDS, ",{T:.2f},{I:.1f}"), ["Coil", "Current"]),
        (EXPERIMENT + "trace_values" + rows(SECONDS, ",{time},{T:.2f},{I:.1f}"),
         ["Root/Coil", "Root/Current"]),
    ],
)  # fmt: skip
def test_a_header_of_lines_that_begin_with_what_they_say(tmp_path, content, names):
    columns = by_name(written(tmp_path, content))
    assert of_values(columns) == names
    assert [columns[name].unit for name in names] == ["C", "A"]
    times = next(iter(columns.values()))
    assert times.unit == "s"
    np.testing.assert_allclose(times.values, 5.0 * np.arange(N))


def test_tags_with_names_of_a_panel(tmp_path):
    lines = [
        f'"{tag}";"13.05.2024 08:00:{5 * i:02d}";{f"{values[i]:.2f}".replace(".", ",")};1;{i},5'
        for i in range(N)
        for tag, values in (("T_coil", TEMPERATURE), ("I_motor", CURRENT))
    ]
    head = '"VarName";"TimeString";"VarValue";"Validity";"Time_ms"\n'
    columns = by_name(written(tmp_path, head + "\n".join(lines)))
    assert of_values(columns) == ["T_coil", "I_motor"]
    np.testing.assert_array_equal(columns["TimeString"].values, 5.0 * np.arange(N))


def test_tables_of_tags_below_each_other_are_no_restart(tmp_path):
    head = "time,field,value\n"
    coil, current = (
        head + rows(SECONDS, f"{{time}},{name},{{{key}:.2f}}") + "\n"
        for name, key in (("coil", "T"), ("current", "I"))
    )
    table = read_text((coil + "\n" + current).encode(), "test.csv")
    assert [one.name for one in table.columns] == ["time", "coil", "current"]
    assert not table.findings


@pytest.mark.parametrize(
    "content",
    [
        "\n".join(
            f'{{"t": {5 * i}, "motor": {{"coil": {TEMPERATURE[i]}, "amps": {CURRENT[i]}}}}}'
            for i in range(N)
        ),
        pd.DataFrame({"t": 5 * np.arange(N), "coil": TEMPERATURE, "amps": CURRENT}).to_json(
            orient="records"
        ),
    ],
)
def test_json(tmp_path, content):
    columns = by_name(written(tmp_path, content, "test.json"))
    assert [name.rpartition(".")[2] for name in of_values(columns)] == ["coil", "amps"]


@pytest.mark.parametrize(("separator", "sign"), [(",", "."), (";", ",")])
def test_units_in_the_cells(tmp_path, separator, sign):
    """A display writes 850 W and 1.2 kW in one column."""
    power = np.where(np.arange(N) % 2, 850.0, 1200.0)
    cells = [(f"{5 * i}", f"{TEMPERATURE[i]} °C", "850 W" if i % 2 else "1.2 kW") for i in range(N)]
    lines = [separator.join(f'"{cell}"' for cell in row).replace(".", sign) for row in cells]
    columns = by_name(written(tmp_path, f"t{separator}Coil{separator}P\n" + "\n".join(lines)))
    assert columns["Coil [°C]"].unit == "°C"
    np.testing.assert_array_equal(columns["Coil [°C]"].values, TEMPERATURE)
    np.testing.assert_allclose(columns["P [kW]"].values, power / 1e3)


def test_html_is_named(tmp_path):
    with pytest.raises(InputError, match=r"got HTML or XML.*read_html"):
        by_name(written(tmp_path, "<html><table><tr><td>1</td></tr></table></html>", "test.xls"))


def test_milliseconds_of_a_day_go_on_past_midnight(tmp_path):
    day = [f"{(86400_000 - 30_000 + 5000 * i) % 86400_000}" for i in range(N)]
    path = written(tmp_path, "ms_today;amp_hours;temp_motor;I\n" + rows(day, "{time};{i};{T};{I}"))
    motor = Motor("m", columns={"time_s": "ms_today [ms]", "winding_degC": "temp_motor"})
    np.testing.assert_allclose(read_record(path, motor).time_s, 5.0 * np.arange(N))
    lines = {one.name: [each.line for each in one.proposals] for one in survey(path).free}
    assert "ms_today [ms]" in lines["ms_today"]
    assert not lines["amp_hours"]


@pytest.mark.parametrize("jitter", [False, True])
def test_a_temperature_that_is_repeated_until_its_next_sample(tmp_path, jitter):
    """Rows come each second, the temperature every twelve; what is repeated is no reading."""
    num = 400
    comes = np.arange(0, num, 12)
    comes[1:] += np.arange(1, comes.size) % 2 if jitter else 0
    coil = np.round(20.0 + 40.0 * -np.expm1(-np.arange(num) / 150.0), 3)
    last = comes[np.searchsorted(comes, np.arange(num), side="right") - 1]
    lines = [f"{i},{coil[last[i]]},{17.5 + 0.01 * (i % 3):.2f}" for i in range(num)]
    path = written(tmp_path, "t [s],winding_degC,I [A_rms]\n" + "\n".join(lines))
    record = read_record(path, Motor("M", columns={"phase_current_A": "I"}))
    is_known = np.isfinite(record["winding_degC"])
    np.testing.assert_array_equal(record.time_s[is_known], comes)
    np.testing.assert_array_equal(record["winding_degC"][is_known], coil[comes])


def test_a_rounded_temperature_is_not_repeated(tmp_path):
    coil = np.round(20.0 + 40.0 * -np.expm1(-np.arange(400) / 150.0))
    lines = "\n".join(f"{i},{one}" for i, one in enumerate(coil))
    record = read_record(written(tmp_path, f"t [s],winding_degC\n{lines}"), Motor("M"))
    np.testing.assert_array_equal(record["winding_degC"], coil)


def test_the_mean_goes_before_the_least_and_the_largest(tmp_path):
    head = "t [s],Phase current Min [A],Phase current Max [A],Phase current Avg [A]\n"
    path = written(tmp_path, head + rows(SECONDS, "{time},{I},{T},{I}"))
    assert all(one.score < 3 for each in survey(path).free for one in each.proposals)
    np.testing.assert_array_equal(read_record(path, Motor("M"))["phase_current_A"], CURRENT)


def test_cells_of_a_column_that_no_channel_claims_are_a_note(tmp_path):
    lines = rows(SECONDS, "{time},{T},--INF--").replace("--INF--", "0.8", 9)
    path = written(tmp_path, f"t [s],winding_degC,LAMBDA\n{lines}")
    (found,) = read_record(path, Motor("M")).findings
    assert (found.id, found.severity) == ("unreadable_cells", "note")
