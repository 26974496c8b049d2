"""Two clocks of one test: the offset is found within its own uncertainty, and heat is kept."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import chi2

from heatrun.errors import InputError
from heatrun.readers.align import find_alignment, join
from heatrun.readers.read import read_record
from heatrun.record.motor import Motor
from heatrun.record.record import Record

TASS = Path(__file__).resolve().parents[3] / "shared" / "bench" / "tass"
STEP_S = 0.1
NUM_SEEDS = 12


def two_logs(
    seed: int,
    *,
    levels: int = 6,
    rounding: float = 0.1,
    noise_K: float = 0.05,
    drive_from_s: float = 25.0,
    thermometer_from_s: float = 5.0,
    minutes: float = 15.0,
) -> tuple[Record, Record, float]:
    """A thermometer, a drive, and what the drive's clock lacks of the thermometer's [s]."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(round(minutes * 60.0 / STEP_S)) * STEP_S
    level = (time_s / (time_s[-1] + STEP_S) * levels).astype(int)
    current = rng.uniform(30.0, 160.0, levels)[level]
    speed = rng.uniform(1000.0, 6000.0, levels)[level]
    P_ol = 100.0 + 0.05 * speed
    T_w = T_sr = 22.0
    winding, P_d = [], []
    # numbers of Python: those of NumPy take five times as long one by one
    for amperes, other_W in zip(current.tolist(), P_ol.tolist(), strict=True):
        P_js = 3.0 * 0.0062 * amperes**2 * (234.5 + T_w) / 259.5
        winding.append(T_w)
        P_d.append(P_js + other_W)
        flow = (T_w - T_sr) / 0.14485
        T_w += STEP_S * (P_js - flow) / 666.75
        T_sr += STEP_S * (other_W + flow - (T_sr - 22.0) / 0.11625) / 15060.1
    read_s = np.arange(thermometer_from_s, time_s[-1], rng.choice([0.7, 1.0, 1.3]))
    usual_s = read_s[1] - read_s[0]
    # Ornstein-Uhlenbeck noise of 20 s beside the rounding, as bench residuals have it.
    decay = np.exp(-usual_s / 20.0)
    noise = lfilter([noise_K * np.sqrt(1 - decay**2)], [1, -decay], rng.normal(size=read_s.size))
    reading = np.interp(read_s, time_s, winding) + noise
    thermometer = Record(
        "thermometer",
        {
            "time_s": read_s - thermometer_from_s,
            "winding_degC": np.round(reading / rounding) * rounding,
            "ambient_degC": np.full(read_s.size, 22.0),
        },
    )
    logged = time_s >= drive_from_s
    drive = Record(
        "drive",
        {
            # A sample holds for its interval, so that its stamp belongs in the middle.
            "time_s": time_s[logged] + 0.5 * STEP_S - drive_from_s,
            "losses_W": np.array(P_d)[logged] + 5.0 * rng.normal(size=logged.sum()),
            "phase_current_A": current[logged],
            "speed_rpm": speed[logged],
        },
    )
    return thermometer, drive, drive_from_s - thermometer_from_s


def with_channels(record: Record, **channels: np.ndarray) -> Record:
    return replace(record, channels={**record.channels, **channels})


@pytest.fixture(scope="module")
def alignments():
    rng = np.random.default_rng(99)
    found = []
    for seed in range(NUM_SEEDS):
        begins = rng.uniform(0.0, 25.0, 2)
        thermometer, drive, truth = two_logs(
            seed,
            rounding=float(rng.choice([0.01, 0.1, 1.0])),
            drive_from_s=float(begins[0]),
            thermometer_from_s=float(begins[1]),
        )
        found.append((find_alignment(thermometer, drive, max_offset_s=30.0), truth))
    return found


def test_offset_lies_within_its_own_uncertainty(alignments):
    z = [(found.offset_s - truth) / found.fit_sd_s for found, truth in alignments]
    # The stamps of these logs are exact, so the part of the fit has to stand alone; both tails at
    # 0.1 %: neither overconfident nor hidden behind a wide interval.
    low, high = chi2.ppf([0.001, 0.999], NUM_SEEDS)
    assert low < np.sum(np.square(z)) < high
    inside = [a.interval_95_s[0] <= truth <= a.interval_95_s[1] for a, truth in alignments]
    # Eight or fewer of twelve would happen by chance once in 500.
    assert sum(inside) >= 9


def test_a_good_alignment_raises_no_doubt(alignments):
    for found, _ in alignments:
        assert [f.id for f in found.findings] == ["alignment"]
        assert found.fit_sd_s < found.sd_s < 1.0
        assert found.interval_95_s[0] < found.offset_s < found.interval_95_s[1]
        assert found.explained > 0.9


def test_join_keeps_the_heat_and_the_thermometer():
    thermometer, drive, truth = two_logs(3)
    joined, found = join(thermometer, drive, max_offset_s=30.0)
    assert found.findings == joined.findings
    kept = np.isin(thermometer.time_s, joined.time_s)
    np.testing.assert_array_equal(joined["winding_degC"], thermometer["winding_degC"][kept])
    step_s = joined.time_s[1] - joined.time_s[0]
    begin, end = joined.time_s[0] - 0.5 * step_s, joined.time_s[-1] + 0.5 * step_s
    clock = drive.time_s + found.offset_s
    inside = (clock > begin) & (clock < end)
    for channel, power in (("losses_W", 1.0), ("phase_current_A", 2.0)):
        given = np.sum(drive[channel][inside] ** power) * STEP_S
        got = np.sum(joined[channel] ** power) * step_s
        # Two half samples of the drive at the ends may fall in or out.
        assert got == pytest.approx(given, rel=2.0 * STEP_S / (end - begin))
    assert any("lose" in note for note in joined.notes)
    assert abs(found.offset_s - truth) < 4.0 * found.sd_s


def test_current_is_averaged_as_heat():
    thermometer, drive, _ = two_logs(4)
    pulses = np.where(np.arange(drive.time_s.size) % 2, 100.0, 0.0)
    joined, found = join(thermometer, with_channels(drive, phase_current_A=pulses), offset_s=20.0)
    # Half the time 100 A is 70.7 A rms; trapezoids over 0.1 s and a ragged edge leave 10 %.
    np.testing.assert_allclose(joined["phase_current_A"], 100.0 / np.sqrt(2.0), rtol=0.1)
    assert (found.offset_s, found.sd_s, found.method) == (20.0, 0.0, "given")


def test_what_the_drive_lacks_stays_missing():
    thermometer, drive, _ = two_logs(4)
    losses = drive["losses_W"].copy()
    lost = (drive.time_s > 100.0) & (drive.time_s < 130.0)
    losses[lost] = np.nan
    joined, _ = join(thermometer, with_channels(drive, losses_W=losses), offset_s=20.0)
    missing = np.isnan(joined["losses_W"])
    assert np.all((joined.time_s[missing] > 118.0) & (joined.time_s[missing] < 152.0))
    assert missing.sum() == pytest.approx(30.0 / np.median(np.diff(joined.time_s)), abs=3)
    assert np.isfinite(joined["phase_current_A"]).all()


def test_channels_in_both_logs_come_from_the_thermometer():
    thermometer, drive, _ = two_logs(4)
    doubled = with_channels(drive, ambient_degC=np.full(drive.time_s.size, 99.0))
    joined, _ = join(thermometer, doubled, offset_s=20.0)
    assert joined["ambient_degC"].max() == 22.0
    assert any("ambient_degC" in note for note in joined.notes)


def test_a_drive_of_another_test_is_refused():
    thermometer, drive, _ = two_logs(5)
    _, other, _ = two_logs(6)
    found = find_alignment(thermometer, other, max_offset_s=30.0)
    assert "error" in {f.severity for f in found.findings}
    assert drive.name == other.name


def test_without_a_step_the_offset_is_uncertain():
    thermometer, drive, _ = two_logs(7, levels=1)
    found = find_alignment(thermometer, drive, max_offset_s=30.0)
    assert "alignment_uncertain" in {f.id for f in found.findings}
    assert found.sd_s > 1.0


def test_lost_rows_are_told_by_the_clock_rate():
    thermometer, drive, _ = two_logs(8)
    # One row in six was never written, and the times were counted from the rows.
    kept = np.arange(drive.time_s.size) % 6 != 0
    channels = {name: values[kept] for name, values in drive.channels.items()}
    channels["time_s"] = drive.time_s[: kept.sum()]
    found = find_alignment(thermometer, replace(drive, channels=channels), max_offset_s=30.0)
    (rate,) = [f for f in found.findings if f.id == "alignment_rate"]
    # 6/5, on a grid of 0.05.
    assert rate.values["rate"] == pytest.approx(1.2, abs=0.05)
    assert rate.severity == "error"


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (lambda T, D: (T, with_channels(D, time_s=D.time_s[::-1])), "clock that runs forwards"),
        (lambda T, D: (replace(T, channels={"time_s": T.time_s}), D), "winding_degC"),
        (lambda T, D: (T, replace(D, channels={"time_s": D.time_s})), "power or a current"),
        (lambda T, D: (T, with_channels(D, time_s=D.time_s + 1e4)), "overlap"),
        (lambda T, D: (with_channels(T, time_s=T.time_s * np.nan), D), "clock that runs forwards"),
    ],
)
def test_what_cannot_be_aligned_is_refused_in_words(change, problem):
    thermometer, drive, _ = two_logs(9)
    with pytest.raises(InputError, match=problem) as caught:
        join(*change(thermometer, drive), max_offset_s=30.0)
    assert caught.value.remedy


@pytest.mark.skipif(not TASS.is_dir(), reason="the measured records are not here")
@pytest.mark.parametrize(
    ("run", "earliest_s", "latest_s"),
    [
        # Read off by eye: the winding starts to rise at 9 s and falls at 206 s, while the drive's
        # log lasts 198.3 s and goes off 0.9 s before its end.
        ("Run3", 7.0, 10.0),
        # The winding starts to rise at 16 s and does not fall before the end at 133.9 s, while the
        # drive goes off after 117.4 s of its log.
        ("Run13", 15.0, 19.0),
    ],
)
def test_measured_runs_are_aligned_as_the_eye_does(run, earliest_s, latest_s):
    thermometer, drive = _measured(run)
    joined, found = join(thermometer, drive)
    assert earliest_s < found.offset_s < latest_s
    assert found.sd_s < 1.0
    assert not [f for f in found.findings if f.severity == "error"]
    assert joined.duration_s > 0.9 * min(thermometer.duration_s, drive.duration_s)


@pytest.mark.skipif(not TASS.is_dir(), reason="the measured records are not here")
def test_a_measured_run_with_lost_rows_is_refused():
    # The winding warms for 167 s; the log of the drive that heats it lasts 136 s.
    _, found = join(*_measured("Run2"))
    assert "alignment_rate" in {f.id for f in found.findings if f.severity == "error"}


def _measured(run: str) -> tuple[Record, Record]:
    (folder,) = TASS.glob(f"{run}-*")
    (thermometer,), (drive,) = folder.glob("DAQ*.csv"), folder.glob("Export*.csv")
    return (
        read_record(str(thermometer), Motor("small")),
        read_record(str(drive), Motor("small", columns={"time_s": "rate 10 Hz"})),
    )
