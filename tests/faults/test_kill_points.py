"""Killed before any file operation, a run is whole, absent or the earlier one; it can go on."""

SCRIPT = "kill_points.py"


def test_every_operation_was_killed_and_the_last_run_was_not(outcomes):
    by_start = {start: [o for o in outcomes if o["earlier"] == start] for start in (None, "old")}
    for each in by_start.values():
        assert [o["status"] for o in each[:-1]] == [-9] * (len(each) - 1)
        assert each[-1]["status"] == 0
        assert len(each) > 20  # a run of three chunks and three files has at least so many


def test_what_lies_at_the_place_is_whole(outcomes):
    for outcome in outcomes:
        assert outcome["after"] in ("nothing", "old", "new"), outcome


def test_the_same_command_again_ends_with_the_same_result(outcomes):
    expected = outcomes[-1]["fit"]
    for outcome in outcomes:
        assert outcome["resumed"] == 0, outcome
        assert outcome["finally"] == "new", outcome
        assert outcome["fit"] == expected, outcome


def test_no_kill_leaves_anything_behind_in_the_end(outcomes):
    for outcome in outcomes:
        assert outcome["left"] == ["run"], outcome


def test_an_earlier_run_is_there_until_the_new_one_takes_its_name(outcomes):
    states = [o["after"] for o in outcomes if o["earlier"] == "old"]
    # between two renames the place is empty for a moment; the next start brings the old one back
    assert states.count("nothing") <= 1
    assert states == sorted(states, key=("old", "nothing", "new").index)
