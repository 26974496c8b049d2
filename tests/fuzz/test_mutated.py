"""Files with bytes changed, cut, doubled: our error or a record; none against what it states."""

import random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

NAMES = ("statement", "text", "gzip", "mat5", "mat5 packed", "hdf5", "parquet", "netcdf", "excel",
         "motor file", "channel map", "fit.json", "manifest.json", "parameters", "network",
         "checkpoint", "mdf", "tdms")  # fmt: skip
TOKENS = (b"\x00", b"\xff\xff\xff\xff", b"1e999", b"nan", b"9" * 400, b'"', b"[", b"{", b"\n",
          b"\x1b[2J", b"=cmd()", "１²".encode(), b"-0", b"null", b"]]]]", b"\xed\xa0")  # fmt: skip
"""Pieces at which readers stumble."""


@st.composite
def mutations(draw):
    """A list of changes, each a place in the file (as a share), what is cut and what is put in."""
    place = st.floats(0.0, 1.0, exclude_max=True)
    piece = st.one_of(st.sampled_from(TOKENS), st.binary(max_size=6))
    return draw(st.lists(st.tuples(place, st.integers(0, 40), piece), min_size=1, max_size=5))


def mutated(seed: bytes, changes) -> bytes:
    for share, cut, piece in changes:
        start = int(share * len(seed))
        seed = seed[:start] + piece + seed[start + cut :]
    return seed


def test_every_target_is_named(targets):
    assert set(NAMES) == set(targets)


@pytest.mark.parametrize("name", NAMES)
def test_a_changed_file_gives_our_error_or_a_result(name, targets):
    target = targets[name]

    @settings(suppress_health_check=[HealthCheck.too_slow])
    @given(st.sampled_from(target.seeds), mutations())
    def holds(seed, changes):
        target.run(mutated(seed, changes))

    holds()


@pytest.mark.parametrize("name", NAMES)
def test_the_whole_files_are_read(name, targets):
    for seed in targets[name].seeds:
        targets[name].run(seed)


@pytest.mark.parametrize("seed", range(4))
def test_no_reading_departs_from_what_the_file_states(seed, targets):
    rng = random.Random(seed)
    faults = []
    for _ in range(20):
        try:
            targets["statement"].run(rng.randbytes(rng.choice((3, 8, 20, 40))))
        except AssertionError as fault:
            faults.append(str(fault))
    assert not faults, "\n".join(faults)
