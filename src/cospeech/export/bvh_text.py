"""The text of a BVH: its header into joints, its rows into numbers; `cospeech.export.bvh_reader` finds what the numbers mean.

Nothing in the header is trusted: rows are counted (``Frames:`` is not used), and each fault is reported with its line.
"""

from __future__ import annotations

import math
import re
import warnings
from collections import deque
from collections.abc import Iterator
from itertools import islice
from typing import TextIO

import numpy as np

from ..errors import InputError
from ..limits import JOINTS, LINE_CHARACTERS
from ..motion.rotations import Array
from .bvh_hierarchy import Header

__all__ = ["MAX_VALUE", "format_rows", "read_header", "read_rows"]

MAX_VALUE = 1e7  # ours: of a position or angle; keeps every product finite
_BLOCK = 1 << 19  # ours: numbers, or joints, at once
_CHANNEL = re.compile(r"([xyz])(position|rotation)", re.IGNORECASE)


def number(word: str, line: int) -> float:
    """A finite number of sensible size, or an `InputError` with the line."""
    try:
        value = float(word) if word.isascii() and "_" not in word else math.nan
    except ValueError:
        value = math.nan
    if not abs(value) <= MAX_VALUE:
        hint = "write decimals with points, not commas" if "," in word else "is the file damaged?"
        raise InputError(f"line {line}: {word[:40]!r} is not a usable number", hint)
    return value


def _lines(file: TextIO) -> Iterator[tuple[int, str]]:
    """Numbered lines that are not blank."""
    count = 0
    while line := file.readline(LINE_CHARACTERS):
        count += 1
        if len(line) == LINE_CHARACTERS:
            raise InputError(f"line {count} is longer than {LINE_CHARACTERS} characters", "is it a BVH?")
        if line.strip():
            yield count, line


def read_header(file: TextIO) -> Header:
    """Read up to and including the line ``Frame Time: …``.

    Raises:
        InputError: with the line, for anything that is not a BVH's header.
    """
    header, lines = Header(), _lines(file)
    _read_hierarchy(header, lines)
    for line, text in lines:
        key, colon, value = text.partition(":")
        words = key.lower().split()
        if colon and words == ["frame", "time"]:
            word = value.strip()
            header.frame_time, header.lines = number(word, line), line
            mantissa, _, exponent = word.lower().partition("e")
            digits = float(exponent or 0) - len(mantissa.partition(".")[2])  # an exponent may have any number of digits
            header.precision = 10.0 ** min(max(digits, -20.0), 0.0)
            return header
        if not colon or words != ["frames"]:
            raise InputError(f"line {line}: {text.strip()[:40]!r} where 'Frame Time:' was expected", "is the file damaged?")
    raise InputError("the file ends before 'Frame Time:'", "is it cut short?")


def _read_hierarchy(header: Header, lines: Iterator[tuple[int, str]]) -> None:
    """Fill ``header`` with joints, up to and including the line ``MOTION``."""
    open_blocks: list[int] = []  # joint indices; −1 for an End Site
    waiting: int | None = None  # a joint whose brace is not opened yet
    is_started = False
    for line, text in lines:
        words = deque(text.replace("{", " { ").replace("}", " } ").split())
        while words:
            word = words.popleft().upper()
            if word == "HIERARCHY" and not is_started:
                is_started = True
            elif not is_started:
                raise InputError(f"line {line}: {text.strip()[:40]!r} where 'HIERARCHY' was expected", "is it a BVH?")
            elif word in ("ROOT", "JOINT") and waiting is None:
                waiting = _declare(header, word, words, open_blocks, line)
            elif word == "END" and waiting is None and open_blocks and open_blocks[-1] >= 0:
                waiting = -1
                _upto_brace(words)
            elif word == "{" and waiting is not None:
                open_blocks.append(waiting)
                waiting = None
            elif word == "}" and open_blocks and waiting is None:
                open_blocks.pop()
            elif word == "OFFSET" and open_blocks and waiting is None and len(words) >= 3:
                x, y, z = (number(words.popleft(), line) for _ in range(3))
                if open_blocks[-1] >= 0:
                    header.offsets[open_blocks[-1]] = (x, y, z)
                else:
                    header.ends[open_blocks[-2]] = (x, y, z)
            elif word == "CHANNELS" and open_blocks and open_blocks[-1] >= 0 and waiting is None:
                header.channels[open_blocks[-1]] = _channels(words, line)
            elif word == "MOTION" and not open_blocks and waiting is None and header.names:
                return
            else:
                raise InputError(f"line {line}: {word[:40]!r} is out of place", "is the file damaged?")
    raise InputError("the file ends before 'MOTION'", "is it cut short?" if is_started else "is it a BVH?")


def _upto_brace(words: deque[str]) -> list[str]:
    parts = []  # words before the next brace
    while words and words[0] not in "{}":
        parts.append(words.popleft())
    return parts


def _declare(header: Header, word: str, words: deque[str], open_blocks: list[int], line: int) -> int:
    """Add the joint that ``ROOT name`` or ``JOINT name`` announces."""
    name = "_".join(_upto_brace(words))
    if not name:
        raise InputError(f"line {line}: a joint without a name", "is the file damaged?")
    if (word == "ROOT") != (not header.names) or (word == "JOINT" and (not open_blocks or open_blocks[-1] < 0)):
        hint = "one character per file" if word == "ROOT" else "is the file damaged?"
        raise InputError(f"line {line}: '{word} {name[:40]}' is out of place", hint)
    if len(header.names) == JOINTS:
        raise InputError(f"line {line}: more than {JOINTS} joints", "is the file damaged?")
    header.names.append(name)
    header.parents.append(open_blocks[-1] if open_blocks else -1)
    header.offsets.append((0.0, 0.0, 0.0))
    header.channels.append(())
    return len(header.names) - 1


def _channels(words: deque[str], line: int) -> tuple[str, ...]:
    """Take ``n name …`` of a CHANNELS line."""
    count = words.popleft() if words else ""
    if count not in {"0", "1", "2", "3", "4", "5", "6"} or len(words) < int(count):
        raise InputError(f"line {line}: CHANNELS {count[:40]} with {len(words)} names", "0 to 6 are possible")
    names = []
    for word in [words.popleft() for _ in range(int(count))]:
        match = _CHANNEL.fullmatch(word)
        if not match:
            raise InputError(f"line {line}: unknown channel {word[:40]!r}", "known: Xposition … Zrotation")
        names.append(match[1].upper() + match[2].lower())
    if len(set(names)) != len(names):
        raise InputError(f"line {line}: a channel stands twice", "is the file damaged?")
    return tuple(names)


def read_rows(file: TextIO, header: Header) -> Iterator[Array]:
    """Blocks ``(T, columns)`` of the rows after the header.

    Raises:
        InputError: with the line, for a row of another length or a value that is not a usable number.
    """
    line, count = header.lines, max(1, _BLOCK // max(1, header.columns, len(header.names)))
    while batch := list(islice(iter(lambda: file.readline(LINE_CHARACTERS), ""), count)):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # a block of blank lines
            try:
                rows = np.loadtxt(batch, comments=None, ndmin=2)
            except ValueError:
                rows = np.zeros((1, 0))
        sound = rows.size == 0 and not any(text.strip() for text in batch)
        if not sound and (rows.shape[1] != header.columns or not (np.abs(rows) <= MAX_VALUE).all()):
            _blame(batch, line, header.columns)
        if len(rows):
            yield rows.reshape(-1, header.columns)
        line += len(batch)


def format_rows(rows: Array, decimals: Array) -> str:
    """Lines of rows (T, columns), each column with its number of ``decimals`` (columns,)."""
    values = np.empty(rows.shape)
    for count in {*decimals.tolist()}:
        values[:, decimals == count] = np.round(rows[:, decimals == count], count) + 0.0  # no "-0.00000"
    template = " ".join(f"%.{count}f" for count in decimals) + "\n"
    return template * len(rows) % tuple(values.ravel().tolist())


def _blame(batch: list[str], line: int, columns: int) -> None:
    """Raise for the first bad row; the fast reader has found that there is one."""
    for k, text in enumerate(batch, line + 1):
        words = text.split() if len(text) < LINE_CHARACTERS else []
        if words and len(words) != columns:
            raise InputError(f"line {k}: {len(words)} values where {columns} channels are declared", "is the file cut short?")
        _ = [number(word, k) for word in words]
    raise InputError(f"line {line + 1} or later: rows that cannot be read", "is the file damaged?")
