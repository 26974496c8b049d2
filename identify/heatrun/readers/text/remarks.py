"""Units in comment lines of a text table, "# P in kW", "# units: s, A, kW", and in rows of units.

A line is read as one of these, where NAME is the name of a column and UNIT a unit that is known:

    "units:" UNIT "," UNIT …          in the order of the columns, one for each
    NAME ("in" | ":" | "=" | "is in") UNIT, NAME "[" UNIT "]", several with "," or ";" between
    "column" NUMBER ":" UNIT
    NAME ";" … UNIT …                 a list of channels, one a line, with one unit in each
    "Y_Unit_Label" UNIT UNIT …        of LabVIEW: of all columns but that of the time
    "all temperatures in" UNIT        words of a quantity: every column of it that has no unit
    NAME (":" | "is" | "in") "peak value", also "currents are amplitudes": a doubt about its kind

A unit behind anything else is about none of the columns for sure. It matters only where a column
of its quantity has no unit and would be read in another one; then it is a question. Lines with a
number, as in "Rated power [kW]; 50", are no statements about columns.
"""

import itertools
import re
from collections.abc import Container, Iterator, Sequence

from ...record.header import LONGEST_NAME, is_name, plain, read_heading, split_name, unit_of_cell
from ...record.table import Stated
from ...record.units import LONGEST_UNIT, is_unit, looks_like_unit
from ..labels import without_sure_unit

COMMENT = re.compile(r"\s*(?:#+|%+(?=\s|%)|//+|!+)\s*")
LEAD_WORDS = frozenset(
    ("unit", "units", "einheit", "einheiten", "unità", "unita", "unité", "unités", "unidad")
)
NO_UNITS = frozenset(
    ("time", "date", "date/time", "datetime", "date&time", "clock", "zeit", "datum", "uhrzeit",
     "ora", "data", "heure", "时间", "時間", "時刻", "시간", "no", "no.", "nr", "nr.", "#")
)  # fmt: skip
"""What loggers write in a row of units over columns that have none."""

RULE = frozenset("-=_")


def is_comment(line: str) -> bool:
    """Return whether a line is marked as a comment."""
    return COMMENT.match(line) is not None


def uncommented(row: Sequence[str]) -> list[str]:
    """Return the cells of a row without a sign of comments in front."""
    cells = list(row)
    found = COMMENT.match(f"{cells[0]} ") if cells else None
    if found is None:
        return cells
    cells[0] = cells[0][found.end() :].strip()
    return cells if cells[0] or len(cells) < 2 else cells[1:]


def units_of_row(row: Sequence[str], names: Sequence[str] | None = None) -> list[str | None] | None:
    """Return the units of a row without numbers by column, None if it is no row of units.

    Below a row of names most of the cells need to be units, and a cell that is not understood
    counts as a unit that is not known; without names all of them.
    """
    cells = [plain(cell) for cell in uncommented(row)]
    if names is not None and len(cells) < len(row) == len(names):
        cells = ["", *cells]  # the sign is a cell of its own, over a column of numbers of samples
    if cells and cells[0].strip("[]():").casefold() in LEAD_WORDS:
        cells[0] = ""
    if names is not None:
        cells = ["" if cell.strip("[]()").casefold() in NO_UNITS else cell for cell in cells]
    units = [unit_of_cell(cell) for cell in cells]
    pairs = zip(cells, units, strict=True)
    filled = [(cell, unit) for cell, unit in pairs if cell and not set(cell) <= RULE]
    unknown = [cell for cell, unit in filled if unit is None]
    num_known = len(filled) - len(unknown)
    if num_known < 1 or any(len(cell) > LONGEST_UNIT for cell in unknown):
        return None
    if unknown:
        alike = sum(looks_like_unit(cell) for cell in unknown) + num_known
        if names is None or 2 * alike <= len(filled) or len(filled) < 2 or _is_names(row, names):
            return None
    return [unit or cell or None for unit, cell in zip(units, cells, strict=True)]


def _is_names(row: Sequence[str], above: Sequence[str]) -> bool:
    """Return whether a row is rather one of names, given the row above it."""
    num_above = sum(bool(cell.strip()) for cell in above)
    return num_above < sum(bool(cell.strip()) for cell in row) or units_of_row(above) is not None


Index = dict[str, list[int]]

UNIT_WORDS = r"(?:units?|einheit(?:en)?|unità|unités?|unidad(?:es)?)"
UNIT_LIST = re.compile(rf"(?:column\s+)?{UNIT_WORDS}\s*[:=;,\t| ]\s*(?P<rest>\S.*)", re.IGNORECASE)
Y_UNITS = "y_unit_label"
"""Begins the units of a LabVIEW measurement file, whose first column is the time."""

X_NAME, X_KIND = "x_value", "x_dimension"
X_START, X_STEP = ("x0", "hoffset"), ("delta_x", "hresolution")
"""Name of the time in such a file, and the lines that say what it counts and how it runs, as
oscilloscopes write them, too."""

COMMENTS = frozenset(("comment", "comments", "remark", "remarks", "kommentar", "bemerkung"))
"""Names of a column of remarks, in lower case, which lines of data may leave out."""

CALLED = COMMENTS | frozenset(
    ("signal name", "signal", "signalname", "name", "names", "channel name", "kanalname", "label",
     "labels", "tag", "tag name", "tracename", "path",
     "description", "bezeichnung", "beschreibung", "nome", "nom")
)  # fmt: skip
"""Heads, in lower case, under which a logger's table of channels holds what it calls each."""

INPUT = re.compile(r"[^\W\d_]{0,9}[ _.\-]?[0-9]+(?:[ _.:/\-][0-9]+)*")
"""An input of a logger, such as CH-8 or U1-2: it says nothing of what is measured."""

PIECE = re.compile(r"[;,\t|]")
CELL = re.compile(r"\s*[;,:=\t|]\s*")
SINCE = re.compile(r"(?P<unit>[A-Za-zµ]+)\s+since\b.*", re.IGNORECASE)
PAIR = re.compile(
    r"(?P<label>\S.*?)(?:\s+(?:is|are|ist|sind|given|measured|recorded|logged|angegeben|expressed))*"
    r"(?:\s+in\s+|\s*[:=]\s*(?:in\s+)?|\s+/\s+)(?P<unit>\S.{0,38})",
    re.IGNORECASE,
)
BRACKET = re.compile(r"(?P<label>\S[^\[(]*?)\s*[\[(]\s*(?P<unit>[^\[\]()]{1,40})[\])]")
KIND = re.compile(
    r"(?P<label>\S[^:=]*?)(?:\s*[:=]|\s+(?:is|are|ist|sind|in|as|als|given|logged|recorded)\b)+"
    r"\s*(?:(?:an?|the|der|die)\s+)?"
    r"(?:peak|amplitud|crest|scheitel|spitzen|valeurs? (?:de )?crête|\^|0-p)[\w\s\-]*\.?",
    re.IGNORECASE,
)
"""A line that calls a current an amplitude."""

CURRENT = frozenset(("current", "currents", "phase", "strom", "ströme", "correnti",
                     "courants", "i", "all", "alle", "the"))  # fmt: skip

LONGEST_LINE = 20_000
LONGEST_PIECE = 120
"""Characters; what is longer is prose."""

NUMBER = re.compile(r"[+-]?[0-9]+(?:[.,][0-9]+)?(?:[eE][+-]?[0-9]+)?")
COUNTED = re.compile(
    r"(?:(?:column|col|spalte|channel|ch|kanal)\.?\s*)?(?P<number>[0-9]{1,4})\s*[:.)=-]?\s*",
    re.IGNORECASE,
)
ABOUT_UNIT = re.compile(rf"\b{UNIT_WORDS}\b(?:\s+(?:of|der|des|von|for|für))?", re.IGNORECASE)

OF = re.compile(r"^(?:of|der|des|von|for|für)\s+", re.IGNORECASE)

GENERAL = frozenset(
    ("all", "alle", "the", "data", "values", "werte", "columns", "channels", "and", "und", "of",
     "temperature", "temperatures", "temp", "temps", "temperatur", "temperaturen", "températures",
     "power", "powers", "leistung", "leistungen", "potenze", "puissances", "current", "currents",
     "strom", "ströme", "correnti", "courants", "phase", "voltage", "voltages", "spannung",
     "spannungen", "speed", "speeds", "drehzahl", "drehzahlen", "torque", "torques", "drehmoment",
     "drehmomente", "time", "times", "zeit", "zeiten", "tempo", "flow", "flows")
)  # fmt: skip
"""Words of which a line about every column of a quantity is made."""


def units_of_remarks(lines: Sequence[str], names: Sequence[str]) -> tuple[tuple[Stated, ...], ...]:
    """Return for each column what comment lines and the preamble say about its unit."""
    found: list[list[Stated]] = [[] for _ in names]
    known: tuple[Index, Index] | None = None
    for line in lines:
        text = COMMENT.sub("", plain(line), count=1).strip(' "')
        if not 3 <= len(text) <= LONGEST_LINE or NUMBER.fullmatch(PIECE.split(text)[-1].strip()):
            continue
        source = f"the line '{text if len(text) <= 60 else text[:59] + '…'}'"
        if known is None:
            known = _index(names)
        _add_kind(found, text, known, source)
        head, *units = PIECE.split(line)  # blanks are part of units here, as in "Deg C"
        key = head.strip().casefold()
        if key == Y_UNITS:
            channels = _of_channels(found, names)
            # where each channel has a time of its own, an empty cell stands for that
            said = units if len(units) == len(channels) else filter(str.strip, units)
            if _add_list(channels, ";".join(said), source):
                continue
        if key == X_KIND and units[:1] == ["Time"]:
            for said, name in zip(found, names, strict=True):
                said += [Stated("s", source)] if name.casefold() == X_NAME else []
            continue
        _add_described(found, text, known, source)
        listed = UNIT_LIST.fullmatch(text)
        if listed and _add_list(found, listed["rest"], source):
            continue
        for label, unit in _pairs(listed["rest"] if listed else text):
            _add_pair(found, label, unit, known, source)
    return tuple(tuple(said) for said in found)


def names_of_inputs(rows: Sequence[Sequence[str]], names: Sequence[str]) -> dict[int, str]:
    """Return by column what a table of channels above the names calls the inputs of a logger.

    It has a row for each channel, or one for each property with the channels in another.
    """
    labels = (read_heading(name).label if len(name) <= LONGEST_NAME else "" for name in names)
    inputs = {one.casefold(): k for k, one in enumerate(labels) if INPUT.fullmatch(one)}
    found: dict[int, str] = {}
    for table in (rows, _by_property(rows, inputs)):
        place = None
        for row in table:
            column = inputs.get(row[0].casefold()) if row else None
            if column is None:
                heads = [k for k, cell in enumerate(row) if k and cell.casefold() in CALLED]
                place = heads[0] if heads else None
            elif place is not None and place < len(row):
                found.setdefault(column, row[place])
    return {
        column: called
        for column, called in found.items()
        if re.search(r"[^\W\d_]{2}", called) and called.casefold() not in inputs
        and len(called) <= LONGEST_NAME
    }  # fmt: skip


def _by_property(rows: Sequence[Sequence[str]], inputs: Container[str]) -> list[tuple[str, ...]]:
    """Return a table of channels with a row for each property, turned; empty without one."""
    for first, row in enumerate(rows):
        cells = [cell for cell in row[1:] if cell]
        if len(cells) > 1 and all(cell.casefold() in inputs for cell in cells):
            below = itertools.takewhile(lambda one: len(one) > 1, rows[first:])
            return list(itertools.zip_longest(*below, fillvalue=""))
    return []


def stated_raster(lines: Sequence[str]) -> tuple[float, float] | None:
    """Return start and step of the time [s] where a header states them in place of a column."""
    found = {}
    for line in lines:
        head, *cells = line.split("\t") if "\t" in line else PIECE.split(line)
        key = head.strip(' "').casefold()
        numbers = {cell.strip() for cell in cells if NUMBER.fullmatch(cell.strip())}
        if key in X_START + X_STEP and len(numbers) == 1:
            found[key in X_STEP] = float(numbers.pop().replace(",", "."))
    return (found.get(False, 0.0), found[True]) if found.get(True, 0.0) > 0.0 else None


def _of_channels(found: list[list[Stated]], names: Sequence[str]) -> list[list[Stated]]:
    """Return what is said of the columns that are neither a time nor remarks."""
    folded = [name.casefold() for name in names]
    times = {X_NAME} if X_NAME in folded else set(folded[:1])
    return [said for said, name in zip(found, folded, strict=True) if name not in times | COMMENTS]


def is_remark(line: str, above: Sequence[str]) -> bool:
    """Return whether a comment below a row of names speaks of these and names no columns itself."""
    names = {split_name(cell)[0] for cell in above if len(cell) <= LONGEST_PIECE}
    labels = [label for label, _ in _pairs(COMMENT.sub("", plain(line), count=1))]
    return bool(labels) and all(label in names for label in labels)


def _index(names: Sequence[str]) -> tuple[Index, Index]:
    """Return the columns by what they may be called, as written and in lower case."""
    exact: Index = {}
    folded: Index = {}
    for column, name in enumerate(names):
        label = split_name(name)[0]
        texts = {plain(name), label, without_sure_unit(label)} - {""}
        for text in texts:
            exact.setdefault(text, []).append(column)
        for text in {text.casefold() for text in texts}:
            folded.setdefault(text, []).append(column)
    return exact, folded


def _add_list(found: list[list[Stated]], text: str, source: str) -> bool:
    """Take a list of units in the order of the columns; return whether it is one."""
    cells = [cell.strip() for cell in PIECE.split(text)]
    if len(cells) == 1:
        cells = text.split()
    units = [unit_of_cell(cell) for cell in cells]
    num_known = sum(unit is not None for unit in units)
    if len(cells) == len(found) and 2 * num_known > len(cells):
        for said, cell, unit in zip(found, cells, units, strict=True):
            if unit or cell:
                said.append(Stated(unit or cell, source))
        return True
    if num_known == len(cells):
        for unit in dict.fromkeys(unit for unit in units if unit):
            _add_to_all(found, Stated(unit, source, "unclear"))
        return True
    return False


def _add_described(
    found: list[list[Stated]], text: str, known: tuple[Index, Index], source: str
) -> None:
    """Take a line that begins with a name and holds one unit among its cells."""
    first, *cells = CELL.split(text)
    columns = _columns(first, known, 0) if len(cells) > 1 or SINCE.search(text) else []
    if not columns:
        return
    since = (SINCE.fullmatch(cell) for cell in cells)
    units = [cell for cell in cells if is_unit(cell)] + [each["unit"] for each in since if each]
    if len(units) == 1 and is_unit(units[0]):
        for column in columns:
            found[column].append(Stated(units[0], source))


def _pairs(text: str) -> Iterator[tuple[str, str]]:
    """Yield the names and units of a line, none of a line with a number."""
    pieces = [piece.strip() for piece in PIECE.split(text)]
    if any(NUMBER.fullmatch(piece) for piece in pieces):
        return
    for piece in [text] if _pair(text) else pieces:
        if pair := _pair(piece):
            yield pair


def _add_pair(
    found: list[list[Stated]], label: str, unit: str, known: tuple[Index, Index], source: str
) -> None:
    columns = _columns(label, known, len(found))
    for column in columns:
        found[column].append(Stated(unit, source))
    if columns or not is_unit(unit):
        return
    if _is_made_of(GENERAL, ABOUT_UNIT.sub("", label)):
        _add_to_all(found, Stated(unit, source, "quantity"))
    elif len(unit) > 1:
        _add_to_all(found, Stated(unit, source, "unclear"))


def _add_kind(
    found: list[list[Stated]], text: str, known: tuple[Index, Index], source: str
) -> None:
    """Note what a line calls an amplitude; it is of interest for currents alone."""
    match = KIND.fullmatch(text) if len(text) <= LONGEST_PIECE else None
    if match is None:
        return
    said = Stated("amplitude", source, "kind")
    for column in _columns(match["label"], known, len(found)):
        found[column].append(said)
    if _is_made_of(CURRENT, match["label"]):
        _add_to_all(found, said)


def _is_made_of(known: Container[str], text: str) -> bool:
    words = re.findall(r"[^\W\d_]+", text.casefold())
    return bool(words) and all(word in known for word in words)


def _pair(text: str) -> tuple[str, str] | None:
    """Return name and unit of a piece of a line, None if it does not end in a unit."""
    if len(text) > LONGEST_PIECE:
        return None
    for pattern in (BRACKET, PAIR):
        match = pattern.fullmatch(text)
        if match is None:
            continue
        unit = match["unit"].strip()
        if unit[:1] + unit[-1:] in ("[]", "()"):
            unit = unit[1:-1].strip()
        if not any(sign.isalpha() or sign in "%°" for sign in unit):
            continue
        # behind "in" and in square brackets a unit may also be one that is not known
        is_marked = " in " in f" {text[match.end('label') :]}" or text.endswith("]")
        if is_unit(unit) or (is_marked and not is_name(unit) and len(unit.split()) == 1):
            return match["label"], unit
    return None


def _columns(label: str, known: tuple[Index, Index], size: int) -> list[int]:
    """Return the columns that a line names, by name or by number."""
    subject = OF.sub("", ABOUT_UNIT.sub("", label).strip(" :"))
    counted = COUNTED.match(subject)
    texts = (label, subject, subject[counted.end() :] if counted else "")
    exact, folded = known
    for text in texts:
        if columns := exact.get(text.strip(" '\"")):
            return columns
    for text in texts:  # only then, for t and T may both be columns
        if columns := folded.get(text.strip(" '\"").casefold()):
            return columns
    if counted and counted.end() == len(subject) and 0 < int(counted["number"]) <= size:
        return [int(counted["number"]) - 1]
    return []


def _add_to_all(found: list[list[Stated]], said: Stated) -> None:
    for column in found:
        column.append(said)
