"""The documents lead where they say: links, places in the code, measured numbers."""

import re
import shlex
from importlib import import_module
from pathlib import Path
from pkgutil import resolve_name

import pytest
from studies import STUDIES

ROOT = Path(__file__).parents[1]
STUDY_FILES = sorted((ROOT / "tests" / "studies").glob("*.py"))
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "SECURITY.md", "VISION.md")),
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "results").glob("*/README.md")),
]


def in_words(path: Path) -> str:
    return str(path.relative_to(ROOT))


def anchors(page: Path) -> set[str]:
    """The names by which headings are linked to."""
    heads = re.findall(r"^#+ (.+)$", page.read_text("utf-8"), re.M)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


@pytest.mark.parametrize("page", PAGES, ids=in_words)
def test_every_link_leads_somewhere(page):
    links = re.findall(r"\]\(([^)\s]+)\)", page.read_text("utf-8"))
    broken = []
    for link in links:
        if re.match(r"https?:", link):
            continue
        name, _, anchor = link.partition("#")
        target = page.parent / name if name else page
        if not target.exists() or (anchor and anchor not in anchors(target)):
            broken.append(link)
    assert not broken


@pytest.mark.parametrize("page", PAGES, ids=in_words)
def test_every_place_in_the_code_is_there(page):
    text = page.read_text("utf-8")
    names = set(re.findall(r"(?<![\w/])(?:heatrun(?:_\w+)?|lptn)(?:\.\w+)+", text))
    paths = set(
        re.findall(
            r"(?<=`)(?!results/runs/)(?:identify|models|tests|data|results)/[^`]+(?=`)", text
        )
    )
    lost = [path for path in paths if not (ROOT / path).exists()]
    for name in names:
        try:
            resolve_name(name)
        except (ImportError, AttributeError):
            lost.append(name)
    assert not lost


@pytest.mark.parametrize("page", PAGES, ids=in_words)
def test_every_make_target_is_there(page):
    said = set(re.findall(r"(?<=`make )[a-z][a-z-]*", page.read_text("utf-8")))
    targets = set(re.findall(r"^([a-z-]+)\b.*:", (ROOT / "Makefile").read_text("utf-8"), re.M))
    assert said <= targets | {f"study-{name}" for name in STUDIES}


def test_every_script_of_a_study_is_there():
    scripts = [shlex.split(each)[0] for study in STUDIES.values() for each in study.scripts]
    assert all(script == "-m" or (ROOT / script).is_file() for script in scripts)


@pytest.mark.parametrize("name", [each.stem for each in STUDY_FILES if "test_" not in each.stem])
def test_a_study_finds_what_it_imports(name):
    import_module(name)


def test_the_figures_of_the_readme_are_those_of_the_tables():
    rows = re.findall(r"^\| .*\]\((results/\w+/table\.md)\).*?\| (.*?) \|", readme(), re.M)
    assert len(rows) == 6
    for table, said in rows:
        text = (ROOT / table).read_text("utf-8")
        # "9 of 206" in one piece where the table has it so, number by number where it has columns
        for figure in re.findall(r"\d+ of \d+|\d+\.\d %", said):
            parts = [figure] if figure in text else figure.split(" of ")
            assert all(re.search(rf"(?<!\d){re.escape(part)}(?!\d)", text) for part in parts), (
                figure
            )


@pytest.mark.parametrize(
    ("page", "study"),
    [("docs/shutdown.md", "shutdown"), ("results/observer/README.md", "observer")],
)
def test_what_a_page_says_of_its_study_stands_in_the_table(page, study):
    table = (ROOT / "results" / study / "table.md").read_text("utf-8")
    said = re.findall(r"\d+ of \d+|\d+\.\d %|\d+ in \d+ h", (ROOT / page).read_text("utf-8"))
    assert said
    assert [figure for figure in said if figure not in table] == []


def readme() -> str:
    return (ROOT / "README.md").read_text("utf-8")
