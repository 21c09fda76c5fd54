"""PATS' tables of intervals: CSV with a row per interval, read row by row and written as pandas does."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import isfinite
from pathlib import Path

from ...errors import InputError
from ...files import atomic, open_regular
from ...limits import CORPUS_TABLE_BYTES
from ..clip import Dropped

__all__ = ["TABLE", "TRANSFORMS", "Interval", "read_table", "write_table"]

TABLE, TRANSFORMS = "cmu_intervals_df.csv", "cmu_intervals_df_transforms.csv"
COLUMNS = ("dataset", "delta_time", "end_time", "interval_id", "speaker", "start_time", "video_fn", "video_link")
SPLITS = {"train": "train", "dev": "validation", "test": "test"}
_LONGEST = 3600.0  # seconds; ours: intervals last some ten seconds
_LATEST = 1e6  # seconds; ours: no video is that long
_PART = re.compile(r"[^\x00-\x1f/\\:*?\"<>]{1,200}")  # of a path; "|" is in the names of transforms


@dataclass(frozen=True)
class Interval:
    """A row: its id, its speaker, one of our splits, length and start in the video in seconds, the video."""

    name: str
    speaker: str
    split: str
    seconds: float
    start: float
    video: str = ""
    link: str = ""


def read_table(path: Path) -> Iterator[Interval | Dropped]:
    """Row after row; one that makes no sense, or comes again, is a drop.

    Raises:
        InputError: not a table with the eight columns, not UTF-8, or damaged beyond a row.
    """
    names: set[str] = set()
    line = 1
    try:
        with (
            open_regular(path, "a table of intervals", CORPUS_TABLE_BYTES) as binary,
            io.TextIOWrapper(binary, "utf-8-sig", newline="") as file,
        ):
            rows = csv.reader(file, strict=True)
            head = next(rows, [])
            absent = [name for name in COLUMNS if name not in head]
            if absent:
                raise InputError(f"{path.name!r} has no column {absent[0]!r}", f"it has {', '.join(head)[:80]}")
            for cells in rows:
                line = rows.line_num
                if len(cells) != len(head):
                    yield Dropped(f"{path.name}:{line}", f"line {line} of {path.name} has {len(cells)} cells of {len(head)}")
                    continue
                item = _interval(dict(zip(head, cells, strict=True)), f"line {line} of {path.name}")
                if item.name in names and isinstance(item, Interval):
                    item = Dropped(item.name, f"line {line} of {path.name}: the interval stands there twice")
                names.add(item.name)
                yield item
    except UnicodeDecodeError as error:
        raise InputError(f"{path.name!r} is not UTF-8 text after line {line}: byte 0x{error.object[error.start]:02x}") from None
    except csv.Error as error:
        raise InputError(f"{path.name!r} is damaged after line {line}: {error}", "was it copied whole?") from None


def _interval(row: dict[str, str], place: str) -> Interval | Dropped:
    name, speaker = row["interval_id"], row["speaker"]
    for what, value in (("interval_id", name), ("speaker", speaker)):
        if not _PART.fullmatch(value) or value in (".", ".."):
            return Dropped(place, f"{place}: the {what} {value[:40]!r} is no name")
    if row["dataset"] not in SPLITS:
        return Dropped(name, f"{place}: the dataset {row['dataset'][:20]!r} is none of {', '.join(SPLITS)}")
    times = [_seconds(row[column]) for column in ("delta_time", "start_time", "end_time")]
    for column, time in zip(("delta_time", "start_time", "end_time"), times, strict=True):
        if time is None:
            return Dropped(name, f"{place}: the {column} {row[column][:30]!r} is no time")
    delta, start, end = (time or 0.0 for time in times)
    if not 0 < delta <= _LONGEST or abs(end - start - delta) > 1.0:  # a second: ours, times may be rounded
        return Dropped(name, f"{place}: {delta:g} s from {start:g} to {end:g} s")
    return Interval(name, speaker, SPLITS[row["dataset"]], delta, start, row["video_fn"], row["video_link"])


def _seconds(text: str) -> float | None:
    """Seconds of "12.5" or "0:01:23.4" (also "0 days 00:01:23.4", as pandas writes spans); None of anything else."""
    parts = re.sub(r"^0 days,? ", "", text.strip()).split(":")
    try:
        numbers = [float(part) for part in parts]
    except ValueError:
        return None
    if len(numbers) > 3 or not all(isfinite(n) and n >= 0 for n in numbers):
        return None
    value = sum(n * 60**k for k, n in enumerate(reversed(numbers)))
    return value if value <= _LATEST else None


def write_table(path: Path, rows: Iterable[Interval]) -> None:
    """The table with its eight columns, times as "H:MM:SS.ffffff"."""
    names = {ours: theirs for theirs, ours in SPLITS.items()}
    with atomic(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(COLUMNS)
        for row in rows:
            times = repr(row.seconds), _clock(row.start + row.seconds), _clock(row.start)
            table.writerow((names[row.split], times[0], times[1], row.name, row.speaker, times[2], row.video, row.link))


def _clock(seconds: float) -> str:
    micro = round(seconds * 1e6)
    hours, rest = divmod(micro, 3_600_000_000)
    minutes, rest = divmod(rest, 60_000_000)
    return f"{hours}:{minutes:02}:{rest // 1_000_000:02}.{rest % 1_000_000:06}"
