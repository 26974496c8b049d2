"""Files that belong together, killed before any file operation: all of them, or none."""

import os
import signal
import subprocess
import sys
import threading

import pytest

from heatrun.io.whole_files import FileSet, names_begun, together, undisturbed

NUM_FILES, SCRIPT = 5, "set_kill_points.py"


def test_every_operation_was_killed_and_the_last_set_was_not(outcomes):
    for earlier in (None, "old"):
        each = [o for o in outcomes if o["earlier"] == earlier]
        assert [o["status"] for o in each[:-1]] == [-9] * (len(each) - 1)
        assert each[-1]["status"] == 0
        assert len(each) > 3 * NUM_FILES  # making, writing and moving of each


def test_a_killed_set_is_the_earlier_one_or_the_new_one(outcomes):
    for outcome in outcomes:
        assert outcome["started"] == 0
        assert outcome["settled"] in ([outcome["earlier"]] * NUM_FILES, ["new"] * NUM_FILES)
    seen = [outcome["settled"][0] for outcome in outcomes if outcome["earlier"] == "old"]
    assert seen == sorted(seen, key=["old", "new"].index)


def test_between_the_two_there_is_a_mark(outcomes):
    for outcome in outcomes:
        if not outcome["is_ready"]:
            assert len(set(outcome["after"])) == 1
        else:
            assert outcome["settled"] == ["new"] * NUM_FILES
        if outcome["after"][-1] == "new":  # the PDF comes last
            assert outcome["after"] == ["new"] * NUM_FILES


def test_the_next_start_clears_everything_away_and_nothing_else(outcomes):
    for outcome in outcomes:
        assert outcome["hidden"] == []
        whole = ["figures/one.png", "figures/two.png", "report.json", "report.pdf", "table.csv"]
        assert outcome["left"] in (sorted([*whole, "figures/mine.txt"]), ["figures/mine.txt"])


def test_a_set_that_fails_leaves_nothing(tmp_path):
    def fail():
        with together(tmp_path / "out", "report") as files:
            (files.aside / "half").write_text("half")
            raise OSError(28, "No space left on device")

    with pytest.raises(OSError, match="No space left"):
        fail()
    assert not list((tmp_path / "out").iterdir())


def test_a_living_process_keeps_what_it_is_writing(tmp_path):
    mine = FileSet.begin(tmp_path, "mine")
    (mine.aside / "a").write_text("a")
    program = (
        "import pathlib\n"
        "from heatrun.io.whole_files import together\n"
        f"with together(pathlib.Path({str(tmp_path)!r}), 'other') as files:\n"
        "    (files.aside / 'b').write_text('b')\n"
    )
    subprocess.run([sys.executable, "-c", program], check=True)
    assert names_begun(tmp_path, "m") == ["mine"]
    assert mine.finish() == [tmp_path / "a"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "b"]


def test_links_that_look_like_ours_are_left_alone(tmp_path):
    other, folder = tmp_path / "other", tmp_path / "folder"
    other.mkdir()
    folder.mkdir()
    (other / "precious").write_text("keep me")
    (folder / ".x.y.heatrun.ready").symlink_to(other)
    (folder / ".x.y.heatrun.partial").symlink_to(other)
    with together(folder, "report") as files:
        (files.aside / "a").write_text("a")
    assert (other / "precious").read_text() == "keep me"
    assert not (folder / "precious").exists()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_waits_for_the_end_of_what_belongs_together(number):
    came = []
    before = signal.signal(number, lambda *_: came.append("later"))
    try:
        with undisturbed():
            os.kill(os.getpid(), number)
            came.append("work")
        assert came == ["work", "later"]
    finally:
        signal.signal(number, before)


def test_a_thread_of_its_own_changes_no_signal():
    done = []

    def work():
        with undisturbed():
            done.append(signal.getsignal(signal.SIGTERM))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert done == [signal.getsignal(signal.SIGTERM)]
