"""Tables (.tsv, .csv): a row for each word, between tabs, semicolons, commas or blanks. A first row may name the columns.

Without names, columns are start, end and word, as in GENEA and in Audacity's labels.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from io import StringIO
from itertools import islice
from typing import NamedTuple

from ...errors import InputError
from ..word_entries import Entry, Note, read_clock, read_time

__all__ = ["fits", "read"]

# Names of columns, in small letters: English, and what people write in German, French and Spanish
_STARTS = ("start", "begin", "from", "xmin", "tmin", "onset", "in", "anfang", "beginn", "von", "début", "debut", "inicio")
_ENDS = ("end", "stop", "to", "xmax", "tmax", "offset", "out", "ende", "bis", "fin", "final")
_LENGTHS = ("duration", "dur", "length", "dauer", "durée", "duree", "duración")
_TEXTS = (
    "word", "text", "token", "transcript", "label", "transcription", "utterance", "content", "subtitle", "sentence", "phrase",
    "wort", "wörter", "mot", "texte", "palabra", "texto", "words",
)  # fmt: skip
# Behind the name of a time: "_time", and its unit: "start_ms", "end (s)"
_UNIT = re.compile(
    r"(?:[ _-]?(?:time|zeit))?(?:[ _-]*[(\[]|[ _-]+)?(?:(?<=[ _(\[-])(?:(ms|msec|milliseconds?)|s|secs?|seconds?))?[)\]]?$"
)
_PLAIN_COLUMNS = 3  # columns that need no names: start, end, word
_HINT = "start, end and word belong there, separated by tabs or commas"


class _Columns(NamedTuple):
    """Which cell holds what, and seconds of a unit of its times."""

    start: int = 0
    end: int | None = 1
    length: int | None = None
    text: int = 2
    scale: float = 1.0


def fits(text: str) -> bool:
    """Whether rows of a text begin with two times, or its first row names a start and a text."""
    lines = [line for _, line in islice(_lines(text), 20)]
    if lines and all(re.match(r"\s*[-+\d.,:eE]+\t\s*[-+\d.,:eE]+(\t|$)", line) for line in lines[1:] or lines):
        return True
    if len(lines) > 1 and len(lines[0]) < 400 and _find_columns(_split(lines[0], -1)) is not None:
        return True
    rows = [row for row in map(_ROW.match, lines[1:] or lines) if row]
    return len(rows) == max(len(lines) - 1, 1) and any("." in row[0] for row in rows)


def read(text: str, note: Note) -> Iterator[Entry]:
    """The words. A first row that holds no time is skipped; if it names the columns, they may be in any order.

    Whole numbers under the names start, end and text are milliseconds, as Whisper writes them; so are times of columns such as
    start_ms.

    Raises:
        InputError: a row has no times.
    """
    columns, most, first = _Columns(), _PLAIN_COLUMNS - 1, True
    for number, line in _lines(text):
        head, first = first, False
        cells = _split(line, -1 if head else most)
        if head and not any(map(_is_time, cells)):
            header = _find_columns(cells)
            if header is None and len(cells) > _PLAIN_COLUMNS:
                raise InputError(f"a table with the columns {', '.join(cells)[:60]}", "its first row names start, end and word")
            columns = header or columns
            most = -1 if header else most
            if [cell.lower() for cell in cells] == ["start", "end", "text"]:
                others = islice(_lines(text), 1, None)
                whole = all(cell.isdigit() for _, other in others for cell in _split(other, _PLAIN_COLUMNS - 1)[:2])
                columns = columns._replace(scale=0.001 if whole else 1.0)
            continue
        yield _read_row(_split(line, most) if head else cells, columns, f"line {number} is {line[:60]!r}")


def _read_row(cells: Sequence[str], columns: _Columns, where: str) -> Entry:
    def cell(place: int | None) -> str:
        return "" if place is None or place >= len(cells) else cells[place]

    until = columns.end if columns.end is not None else columns.length
    if not (_is_time(cell(columns.start)) and _is_time(cell(until))):
        raise InputError(where, _HINT)
    start, end = (_read(cell(place)) * columns.scale for place in (columns.start, until))
    places = [place for place in columns[:4] if place is not None]
    text = cell(columns.text)
    if columns.text == max(places) and not any(map(_is_time, cells[columns.text + 1 :])):  # commas of a text without quotes
        text = ", ".join(cells[columns.text :])
    return text, start, end if columns.end is not None else start + end


def _find_columns(cells: Sequence[str]) -> _Columns | None:
    """Columns by their names; None where they do not name a start, an end or a length, and a text."""
    names = [cell.lower().strip("\"' \ufeff") for cell in cells]
    start, end, length = (_find(names, terms, is_time=True) for terms in (_STARTS, _ENDS, _LENGTHS))
    text = _find(names, _TEXTS, is_time=False)
    if start is None or text is None or (end is None and length is None):
        return None
    unit = _unit(names[start])
    return _Columns(start, end, length, text, 0.001 if unit and unit[1] else 1.0)


def _find(names: Sequence[str], terms: Sequence[str], *, is_time: bool) -> int | None:
    """The column that has the first of these terms as its name; behind the name of a time, its unit may stand."""
    plain = [name[: unit.start()] if is_time and (unit := _unit(name)) else name for name in names]
    return next((plain.index(name) for name in terms if name in plain), None)


def _unit(name: str) -> re.Match[str] | None:
    return _UNIT.search(name[:40])


# start and end in front of a line without tabs: separated by blanks; or by a comma or a semicolon, too
_BLANKS = re.compile(r"\s*+[-+]?\d[\d.:]*+ ++[-+]?\d[\d.:]*+(?: |$)")
_ROW = re.compile(r"\s*+[-+]?\d[\d.:]*+(?: ++|[,;] *+)[-+]?\d[\d.:]*+(?:[ ,;]|$)")


_QUOTES = re.compile(r'"[^"]*+"')


def _split(line: str, most: int) -> list[str]:
    """Cells of a line; in quotes, a comma or a semicolon is part of a cell. Of tabs, only the first ``most`` split; -1: all."""
    mark = "\t" if "\t" in line else None if _BLANKS.match(line) else ";" if ";" in _QUOTES.sub("", line) else ","
    try:
        cells = (
            line.split(mark, maxsplit=2 if mark is None else most)
            if mark in (None, "\t")
            else next(csv.reader([line], delimiter=mark))
        )
    except csv.Error as error:
        raise InputError(f"{line[:60]!r}: {error}", "start, end and word belong there") from None
    return [cell.strip() for cell in cells]


def _lines(text: str) -> Iterator[tuple[int, str]]:
    """Numbered lines that are not blank, one at a time."""
    return ((number, line) for number, line in enumerate(map(str.rstrip, StringIO(text)), 1) if line)


def _is_time(cell: str) -> bool:
    try:
        _read(cell)
    except InputError:
        return False
    return True


def _read(cell: str) -> float:
    """A time in seconds, or of a clock.

    Raises:
        InputError: it is none.
    """
    clock = read_clock(cell) if ":" in cell else None
    return read_time(cell) if clock is None else clock
