"""The texts of sheets and reports in the languages that they are printed in, from one table.

`texts.toml` holds each sentence in all languages under a key. What a page says itself (`[page]`,
`[discovery]`) is asked for by its key. What runs, reports, discoveries and findings state in
English (`[run]`, `[workbook]`, `[report]`, `[discovered]`, `[shutdown]`, `[sentence]`) is known by
the English text of the table, and said `again` in the language of the page; of findings sentence by
sentence.

A field of a text is `{name}`, as it is given; `{name:n}`, numbers, with the decimal sign of the
language, `{name:v}` names with such numbers; `{name:t}` or, without commas or colons in it,
`{name:w}`, words that are said again, `{name:u}` a unit, which may be the same in all; `{name:m}`,
a network with its effects; `{name:i}`, an id; `{name:d}`, a day.
"""

import re
import tomllib
from collections.abc import Sequence
from functools import cache
from importlib import resources

SENTENCES = re.compile(r"(?<=\.) (?=[A-Z`])")
"""Between two of them."""

LANGUAGES = ("en", "de", "it")
"""In the order of the columns of the table."""

FIELD = re.compile(r"\{(\w+)(?::(\w))?\}")

NUMBER = r"[-+±]?\d[\d.]*(?:e[-+]\d+)?(?:(?: … | ± )[-+]?\d[\d.]*)*"
WORDS = re.compile("[a-z]{2} [a-z]{2}")
"""Of a text that is more than a name or a formula."""

KINDS = {"n": NUMBER, "d": r"\d{4}-\d\d-\d\d", "i": "[a-z_]+", "w": "[^,;:]+?", "u": r"[^\[\]]+?"}
"""What a field may hold where a text is recognised, by its kind; of other kinds, anything."""


@cache
def _sections() -> dict[str, dict[str, list[str]]]:
    text = (resources.files("heatrun.io") / "texts.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


@cache
def table() -> dict[str, list[str]]:
    """Return the texts by key, one for each of `LANGUAGES`."""
    return {key: text for section in _sections().values() for key, text in section.items()}


@cache
def _whole() -> dict[str, str]:
    """Return the keys of the texts without fields, by their English text."""
    return {row[0]: key for key, row in table().items() if not FIELD.search(row[0])}


STATED = ("run", "workbook", "report", "discovered", "shutdown")
OF_FINDINGS = ("sentence",)
"""Sections in which a text is recognised."""


@cache
def _patterns(sections: tuple[str, ...]) -> list[tuple[str, re.Pattern[str]]]:
    """Return key and pattern of the texts with fields, those that say most themselves first."""
    stated = {key: row for name in sections for key, row in _sections()[name].items()}
    rows = [(key, row[0]) for key, row in stated.items() if FIELD.search(row[0])]
    rows.sort(key=lambda row: -len(FIELD.sub("", row[1])))
    return [(key, re.compile(_pattern(text))) for key, text in rows]


def _pattern(text: str) -> str:
    parts = FIELD.split(text)  # words, name, kind, words, …
    pattern = re.escape(parts[0])
    for name, kind, words in zip(parts[1::3], parts[2::3], parts[3::3], strict=True):
        pattern += f"(?P<{name}>{KINDS.get(kind, '.+?')}){re.escape(words)}"
    return pattern


class Texts:
    """The texts in one language.

    Attributes:
        language: One of `LANGUAGES`.
        unknown: English texts that were to be said again and are not in the table.
    """

    def __init__(self, language: str = "en") -> None:
        self.language = language
        self.unknown: set[str] = set()
        self._column = LANGUAGES.index(language)

    @property
    def is_whole(self) -> bool:
        """Whether all that was to be said again and is more than a name has been."""
        return not any(WORDS.search(text) for text in self.unknown)

    def __call__(self, key: str, /, **fields: object) -> str:
        """Return a text of the table with what stands in its fields, texts or whole numbers."""
        text = table()[key][self._column]
        return FIELD.sub(lambda found: self._printed(str(fields[found[1]]), found[2]), text)

    def again(self, text: str) -> str:
        """Return an English text in this language; one that the table has not, as it is."""
        if self.language == LANGUAGES[0]:
            return text
        if not any(c.isalpha() for c in text):
            return self.number(text)
        said = self._known(text)
        if said is None:
            self.unknown.add(text)
        return text if said is None else said

    def sentences(self, text: str) -> str | None:
        """Return English sentences in this language, or None where the table lacks one of them."""
        if self.language == LANGUAGES[0] or not text:
            return text
        return " ".join(self._all_known(SENTENCES.split(text), OF_FINDINGS)) or None

    def number(self, text: str) -> str:
        """Return a text with the decimal sign of this language in its numbers."""
        return text if self.language == LANGUAGES[0] else re.sub(r"(?<=\d)\.(?=\d)", ",", text)

    def _known(self, text: str, sections: tuple[str, ...] = STATED) -> str | None:
        """Return a text again, or None: as a whole, as a list, by its pattern."""
        small = text[:1].lower() + text[1:]
        for each in (text, small):
            if each in _whole():
                said = self(_whole()[each])
                return said if each == text else said[:1].upper() + said[1:]
        if text.endswith(".") and (said := self._known(text[:-1], sections)):
            return f"{said}."
        for sign in ("; ", ", "):
            if sign in text and (parts := self._all_known(text.split(sign), sections)):
                return sign.join(parts)
        for key, pattern in _patterns(sections):
            if found := pattern.fullmatch(text):
                return self(key, **found.groupdict())
        for between in re.finditer(" and ", text):
            halves = text[: between.start()], text[between.end() :]
            if parts := self._all_known(halves, sections):
                return f" {self('and')} ".join(parts)
        return None

    def _all_known(self, parts: Sequence[str], sections: tuple[str, ...] = STATED) -> list[str]:
        """Return texts again; none at all where one of them is not known."""
        said, before = [], set(self.unknown)
        for part in parts:
            if (each := self._known(part, sections)) is None:
                self.unknown &= before
                return []
            said.append(each)
        return said

    def _printed(self, text: str, kind: str | None) -> str:
        if kind in ("n", "v"):
            return self.number(text)
        if kind in ("w", "t"):
            return self.again(text)
        if kind == "u":
            return self._known(text) or text
        if kind == "e":
            for words, key in ((" and ", "and"), (" allowing for ", "allowing_for")):
                text = text.replace(words, f" {self(key)} ")
            return text
        if kind == "m":
            title, between, effects = text.partition(" with ")
            effects = self._printed(effects, "e")
            return f"{self.again(title)} {self('with')} {effects}" if between else self.again(title)
        return text
