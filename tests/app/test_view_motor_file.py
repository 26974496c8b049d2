"""The motor file's text on the page: the line of a fault, and what is written when."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from heatrun.errors import InputError
from heatrun.motor.file import parse_motor
from heatrun_view.motor_text import fault_html, file_of_text, has_mixed_ends, line_of, text_of_file
from heatrun_view.reading import Reader
from heatrun_view.store import RecordStore
from heatrun_view.tabs.editing import Editing, Start

# The page runs on Panel 1.6 too, which knows only the names that 2.0 will drop.
pytestmark = pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")

MOTOR = b'[motor]\r\nname = "x"  # keep me\r\n\r\n[winding]\r\nmaterial = "copper"\r\n'

HOSTILE = "</textarea><img src=x onerror=window.hacked=1>"

FAULTS = {
    "[motor]\nname = 'x'\nphases = = 3\n": 3,
    "[motor]\nname = 'x'\nphases = 'three'\n": 3,
    "[motor]\nname = 'x'\nphases = 3\nphasess = 3\n": 4,
    "[motor]\nphases = 3\n": 1,
    "[motor]\nname = 'x'\n\n[moter]\nname = 'y'\n": 4,
    "[motor]\nname = 'x'\n[tests.\"duty 30\"]\nmask = [[1, 2]]\nuse = [[1, 2, 3]]\n": 5,
    "[motor]\nname = 'x'\n[parameters.Req_sr]\n# fixed\nfixed = 'a'\n": 5,
    "[motor]\nname = 'x'\n[columns]\nlosses_W = 'a [W]'\nwindin_degC = 'T'\n": 5,
    "[motor]\nname = 'x'\n[columns]\nlosses_W = 'a [W]'\ntime_s = 'rate 0 Hz'\n": 5,
    "[motor]\nname = 'x'\n[[certificate.instruments]]\nquantity = 3\n": 4,
}


@pytest.mark.parametrize("text", FAULTS)
def test_a_fault_names_its_line(text):
    with pytest.raises(InputError) as caught:
        parse_motor(text.encode(), "motor.toml")
    assert line_of(text, caught.value) == FAULTS[text], caught.value
    assert f"<b>Line {FAULTS[text]}</b>" in fault_html(text, caught.value)


def test_line_ends_and_mark_of_the_file_stay():
    for data in (MOTOR, b"\xef\xbb\xbf" + MOTOR, MOTOR.replace(b"\r", b""), b"", b"a = 1"):
        assert file_of_text(text_of_file(data, "m"), data) == data
    assert "\r" not in text_of_file(MOTOR, "m")
    assert file_of_text("a\nb\n", b"x\r\ny\r\nz\n") == b"a\r\nb\r\n"
    assert has_mixed_ends(b"x\r\ny\n")
    assert not has_mixed_ends(MOTOR)
    with pytest.raises(InputError, match="Expected UTF-8 text"):
        text_of_file(b"\xff\xfe", "m")
    with pytest.raises(InputError, match="half of a character"):
        file_of_text("a\ud800", MOTOR)


class Page:
    """As much of a page as the editor asks for."""

    def __init__(self, root: Path, name: str | None) -> None:
        self.root, self.motor_name, self.chosen, self.num_read = root, name, ["duty"], 0
        self.reader = SimpleNamespace(check=lambda names, motor: f"{names} with {motor.name}")

    def path(self, name: str) -> Path:
        return self.root / name

    def open_tests(self) -> None:
        self.num_read += 1


@pytest.fixture
def page(tmp_path: Path) -> Page:
    (tmp_path / "motor.toml").write_bytes(MOTOR)
    return Page(tmp_path.resolve(), "motor.toml")


@pytest.fixture
def editor(page: Page) -> Editing:
    editor = Editing(page)
    editor.choose()
    return editor


def _type(editor: Editing, before: str, after: str) -> None:
    editor._text.value = editor._text.value.replace(before, after)


def test_a_text_is_checked_and_saved(editor, page):
    motor = page.path("motor.toml")
    _type(editor, '"x"', '"y"')
    editor._check.clicks += 1
    assert "is a motor file" in editor._said.object
    assert "['duty'] with y" in editor._said.object
    assert motor.read_bytes() == MOTOR
    editor._save.clicks += 1
    assert "Written into motor.toml" in editor._said.object
    assert motor.read_bytes() == MOTOR.replace(b'"x"', b'"y"')
    assert page.num_read == 1
    editor._save.clicks += 1
    assert "Nothing was changed" in editor._said.object
    assert sorted(each.name for each in page.root.iterdir()) == ["motor.toml"]


def test_what_is_no_motor_file_is_saved_only_when_asked_for(editor, page):
    motor = page.path("motor.toml")
    _type(editor, '"copper"', f'"{HOSTILE}"')
    editor._check.clicks += 1
    assert not editor._anyway.visible
    assert "<img" not in editor._said.object
    editor._save.clicks += 1
    assert "Not saved" in editor._said.object
    assert "<b>Line 5</b>" in editor._said.object
    assert "<img" not in editor._said.object
    assert motor.read_bytes() == MOTOR
    assert editor._anyway.visible
    editor._text.value_input = editor._text.value + "# more"  # as it is typed
    assert not editor._anyway.visible
    editor._save.clicks += 1
    editor._anyway.clicks += 1
    assert motor.read_bytes() == MOTOR.replace(b"copper", HOSTILE.encode()) + b"# more"
    _type(editor, editor._text.value, "[model]\neffects = ['no_such']\n[motor]\nname = 'z'\n")
    editor._save.clicks += 1
    assert "there is no effect" in editor._said.object
    assert "<b>Line 2</b>" in editor._said.object


def test_a_file_that_has_changed_is_not_written_over_and_the_text_is_kept(editor, page):
    motor = page.path("motor.toml")
    _type(editor, '"x"', '"mine"')
    mine = editor._text.value
    motor.write_bytes(MOTOR + b"# theirs\r\n")
    editor.look()
    assert "has changed since it was read" in editor._changed.object
    assert editor._text.value == mine
    for button in (editor._save, editor._anyway):
        button.clicks += 1
        assert "has changed since it was read" in editor._said.object
        assert motor.read_bytes() == MOTOR + b"# theirs\r\n"
    editor._reload.clicks += 1
    assert editor._text.value.endswith("# theirs\n")
    _type(editor, "# theirs", "# ours")
    ours = editor._text.value
    editor._back.clicks += 1
    assert editor._text.value == mine
    editor._back.clicks += 1
    assert editor._text.value == ours
    editor._back.clicks += 1
    editor._save.clicks += 1  # over the file that the user has seen
    assert motor.read_bytes() == MOTOR.replace(b'"x"', b'"mine"')
    assert editor._back.visible


def test_a_file_that_has_changed_is_shown_where_nothing_was_typed(editor, page):
    page.path("motor.toml").write_bytes(MOTOR + b"# theirs\r\n")
    editor.look()
    assert editor._text.value.endswith("# theirs\n")
    editor._text.value_input = editor._text.value + "# x"  # being typed, not sent as a whole yet
    page.path("motor.toml").write_bytes(MOTOR)
    editor.look()
    assert editor._text.value.endswith("# theirs\n")
    assert "has changed" in editor._changed.object
    page.path("motor.toml").unlink()
    editor.look()
    assert "Expected a file" in editor._changed.object
    editor._save.clicks += 1
    assert "Expected a file" in editor._said.object
    assert not page.path("motor.toml").exists()


def test_a_text_that_is_not_saved_stays_when_another_file_is_chosen(editor, page):
    (page.root / "other.toml").write_bytes(b"[motor]\nname = 'other'\n")
    _type(editor, '"x"', '"mine"')
    page.motor_name = "other.toml"
    editor.choose()
    assert editor._text.value == "[motor]\nname = 'other'\n"
    page.motor_name = None
    editor.choose()
    assert not editor._form.visible
    page.motor_name = "motor.toml"
    editor.choose()
    assert '"mine"' in editor._text.value
    editor._save.clicks += 1
    assert page.path("motor.toml").read_bytes() == MOTOR.replace(b'"x"', b'"mine"')


def test_files_that_were_sent_and_links_are_not_written(page, tmp_path):
    sent = Editing(page)
    page.root = tmp_path / "elsewhere"
    page.path = lambda name: tmp_path / name
    sent.choose()
    assert "was sent to the page" in sent._head.object
    assert sent._save.disabled
    _type(sent, '"x"', '"y"')
    sent._save.clicks += 1
    sent._check.clicks += 1
    assert sent._save.disabled
    sent._anyway.clicks += 1
    assert (tmp_path / "motor.toml").read_bytes() == MOTOR


def test_a_file_that_is_no_text_is_not_shown(page):
    page.path("motor.toml").write_bytes(b"[motor]\nname = '\xff'\n")
    editor = Editing(page)
    editor.choose()
    assert "Expected UTF-8 text" in editor._head.object
    assert not editor._form.visible
    page.path("motor.toml").write_bytes(MOTOR)
    editor.choose()
    assert editor._form.visible
    assert "Expected" not in editor._head.object


def test_the_start_leads_to_another_motor_file_where_the_chosen_one_describes_other_tests(tmp_path):
    rows = [f"{t},{20 + 0.1 * t:.1f},20,{10 * (t > 5)},{300 * (t > 5)}" for t in range(100)]
    (tmp_path / "run.csv").write_text("\n".join(["t [s],TC1,TC2,I [A],P [W]", *rows]))
    motor = tmp_path / "motor.toml"
    motor.write_text('[motor]\nname = "other"\n[columns]\nwinding_degC = "Wicklung [degC]"\n')
    reader = Reader(tmp_path.joinpath, RecordStore(), lambda path: path.open("rb"))
    start = Start(reader, tmp_path, lambda _: None, lambda: None)
    start.offer(["run.csv"], "motor.toml")
    assert "motor.toml does not describe these tests." in start._tests.object  # it cannot be read
    assert start._form.visible
    assert not start._fit.visible
    motor.write_text('[motor]\nname = "other"\n')
    start.offer(["run.csv"], "motor.toml")
    assert "It leaves out losses_W, ambient_degC, winding_degC." in start._tests.object
    assert start._form.visible
    columns = ["phase_current_A = 'I [A]'", "losses_W = 'P [W]'", "ambient_degC = 'TC2 [degC]'",
               "winding_degC = 'TC1 [degC]'"]  # fmt: skip
    motor.write_text("\n".join(["[motor]", 'name = "this"', "[columns]", *columns]))
    start.offer(["run.csv"], "motor.toml")  # mended meanwhile
    assert "motor.toml describes both" in start._said.object
    assert start._fit.visible
    assert not start._form.visible
