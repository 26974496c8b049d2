"""Clock times, dates, and the grid behind 32-bit times."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from heatrun.readers.clock import parse_time_format, read_clock
from heatrun.readers.dates import read_dates
from heatrun.record.timegrid import exact_grid, from_first_sample


@pytest.mark.parametrize(
    ("cells", "seconds"),
    [
        (["0:00.0", "0:00.7", "2:13.2"], [0.0, 0.7, 133.2]),
        (["59:59.5", "1:00:00.0"], [3599.5, 3600.0]),
        (["75:12,25", "75:13"], [4512.25, 4513.0]),
        (["1:59:59.999", "25:00:00.000"], [7199.999, 90000.0]),
    ],
)
def test_clock_times(cells, seconds):
    assert read_clock(pd.Series(cells)).seconds.tolist() == seconds


def test_clock_times_that_are_none():
    seconds = read_clock(pd.Series(["0:00.0", "1:75:00", "noon"])).seconds
    assert np.isnan(seconds).tolist() == [False, True, True]


@pytest.mark.parametrize(
    ("cells", "seconds", "order"),
    [
        (["2025-11-20T18:02:33.123Z", "2025-11-20T18:02:33.223Z"], [0, 0.1], "year-month-day"),
        (["2025-11-20 23:59:59,5", "2025-11-21 00:00:00,0"], [0, 0.5], "year-month-day"),
        (["20/11/2025 18:02:33.0", "21/11/2025 18:02:33.0"], [0, 86400], "day/month/year"),
        (["11/20/2025 11:59:59 PM", "11/21/2025 12:00:00 AM"], [0, 1], "month/day/year"),
        (["05.11.2025 18:02", "06.11.2025 18:03"], [0, 86460], "day/month/year"),
        # On one day the order makes no difference, with a short year neither
        (["01/02/25 23:59:58", "01/02/25 23:59:59"], [0, 1], "makes no difference"),
        # The other orders run backwards, or skip a year
        (["12/01/2025 23:59:59", "01/02/2026 00:00:00"], [0, 31 * 86400 + 1], "month/day/year"),
        (["25-11-20 23:59:59", "25-11-21 00:00:00"], [0, 1], "year-month-day"),
        (["20-11-25 23:59:59", "21-11-25 00:00:00"], [0, 1], "day/month/year"),
        (["31/12/25 23:59:59", "01/01/26 00:00:00"], [0, 1], "day/month/year"),
        # Clocks go back on this night; the zone tells
        (["2025-10-26T02:59:59+02:00", "2025-10-26T02:00:00+01:00"], [0, 1], "year-month-day"),
    ],
)
def test_dates(cells, seconds, order):
    column = read_dates(pd.Series(cells))
    assert column.seconds.tolist() == seconds
    assert order in column.note


@pytest.mark.parametrize(
    ("cells", "first", "second"),
    [
        # Neither number is above 12, and both orders run forward
        (["01/02/2025 23:59:59", "02/02/2025 00:00:01"], "2 s in all", "30 days in all"),
        (["02/01/2025 23:59:59", "02/02/2025 00:00:01"], "30 days in all", "2 s in all"),
        (["05/06/25 10:00", "05/07/25 10:00"], "30 days in all", "24 h in all"),
    ],
)
def test_dates_of_two_readings_are_a_question(cells, first, second):
    column = read_dates(pd.Series(cells), "Time")
    assert column.question is not None
    assert f"day/month/year ({first})" in column.question.problem
    assert f"month/day/year ({second})" in column.question.problem
    for answer in column.question.answers:
        stated = parse_time_format(answer.removeprefix("Time [").removesuffix("]"))
        assert stated is not None
        answered = read_dates(pd.Series(cells), "Time", stated.order)
        assert answered.question is None
        assert "as stated" in answered.note


def test_a_day_that_is_none():
    seconds = read_dates(pd.Series(["30/01/2025 00:00:00", "30/02/2025 00:00:00"])).seconds
    assert np.isnan(seconds).tolist() == [False, True]


@pytest.mark.parametrize("start", [0.0, 1.1, 512.3])
@pytest.mark.parametrize("step", [0.1, 0.3, 0.02])
def test_grid_behind_32_bit_times(start, step):
    index = np.arange(18_000)
    stored = (np.float32(start) + (index * step).astype(np.float32)).astype(np.float32)
    times, _ = from_first_sample(stored.astype(float))
    grid, note = exact_grid(times)
    assert np.array_equal(grid, np.round(index * step, 2))
    # Half a second is exact in 32 bits, so there is nothing to say when nothing moved.
    assert (f"{step:g} s" in note) == (not np.array_equal(times, grid))


def test_grid_of_the_thesis_records():
    times = np.array([0.0, 0.100000143, 0.200000048, 0.300000191, 0.400000095])
    grid, note = exact_grid(times)
    assert grid.tolist() == [0.0, 0.1, 0.2, 0.3, 0.4]
    assert "32-bit" in note


def test_gaps_and_repeats_stay_on_the_grid():
    index = np.array([0, 1, 2, 2, 3, 500, 501, 502])
    times = (index * 0.1).astype(np.float32).astype(float)
    assert exact_grid(times)[0].tolist() == np.round(index * 0.1, 1).tolist()


@pytest.mark.parametrize(
    "times",
    [
        np.arange(100) * 0.5,
        np.round(np.arange(100) * 0.1, 1),
        np.round(np.arange(100) * 0.30193, 1),  # a clock that shows tenths of an odd step
        np.arange(100) * 0.1 + np.random.default_rng(1).normal(0.0, 1e-3, 100),
        np.array([0.0, 0.1]),
        np.array([0.0, np.nan, 0.2, 0.3]),
        np.arange(10)[::-1] * 1.0,
        np.zeros(5),
        np.arange(1000.0) * 1e-5 + np.random.default_rng(2).normal(0.0, 3e-6, 1000),
    ],
)
def test_other_times_stay_as_they_are(times):
    same, note = exact_grid(times)
    assert same is times
    assert note == ""


def test_time_from_first_sample():
    shifted, note = from_first_sample(np.array([np.nan, 5.0, 6.5]))
    assert shifted[1:].tolist() == [0.0, 1.5]
    assert "5 s" in note
    assert from_first_sample(np.array([0.0, 1.0]))[1] == ""
