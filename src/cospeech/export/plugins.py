"""Registries: name → row; our own rows, and those that other installed packages add through entry points.

A package adds a row by a line of its metadata, ``NAME = module:OBJECT``, in the group of the registry: ``cospeech.formats`` or
``cospeech.models``. Its module is imported when that name is asked for, or when all names are; never for a name of ours.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache
from importlib import import_module
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from ..errors import CospeechWarning, InputError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

__all__ = ["USED", "Registry", "check_row"]

Row = TypeVar("Row")
USED: list[str] = []
"""The plug-ins of this process whose rows were read, in words: what goes wrong may come from them."""


class Registry(Mapping[str, Row], Generic[Row]):
    """Name → row, ours first. A plug-in that cannot be used is told of in one line, and is as if it were not there.

    Args:
        ours: the rows of this package; they win where a plug-in has the same name.
        group: of the entry points.
        kind: what an entry point must lead to.
        prefix: what stands before the name of an entry point in the registry: the dot of a suffix.
    """

    def __init__(self, ours: Mapping[str, Row], *, group: str, kind: type[Row], prefix: str = "") -> None:
        self.ours = dict(ours)
        self._group, self._kind, self._prefix = group, kind, prefix
        self._loaded: dict[EntryPoint, Row | None] = {}
        self._told: set[str] = set()

    def __getitem__(self, name: str) -> Row:
        if name in self.ours:
            return self.ours[name]
        entry = self._find_entry(name)
        row = None if entry is None else self._load(entry)
        if row is None:
            raise KeyError(name)
        return row

    def __iter__(self) -> Iterator[str]:
        yield from self.ours
        seen = set(self.ours)
        for entry in self._entries():
            name = self._name(entry)
            if name in seen:
                who = "cospeech has" if name in self.ours else "another package has"
                self._tell(f"{_describe(entry)} is not used: {who} {name!r} already")
            elif self._load(entry) is not None:
                seen.add(name)
                yield name

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def find_code(self, name: str, module: str, attribute: str) -> Any:
        """What the row of that name says that a module has.

        Raises:
            InputError: the row is of another package, and there is no such module, or nothing of that name in it.
        """
        try:
            return getattr(import_module(module), attribute)
        except (ImportError, AttributeError) as error:
            entry = None if name in self.ours else self._find_entry(name)
            if entry is None:
                raise
            raise InputError(_say_unusable(entry, error), f"its row says that {module} has {attribute}") from error

    def _find_entry(self, name: str) -> EntryPoint | None:
        return next((entry for entry in self._entries() if self._name(entry) == name), None)

    def _name(self, entry: EntryPoint) -> str:
        """Under which a row is found; a suffix has small letters, as files are told by."""
        return self._prefix + entry.name.removeprefix(self._prefix).lower() if self._prefix else entry.name

    def _entries(self) -> tuple[EntryPoint, ...]:
        return _find_entries(self._group, tuple(sys.path))

    def _load(self, entry: EntryPoint) -> Row | None:
        if entry not in self._loaded:
            self._loaded[entry] = None
            try:
                row = entry.load()
            except (Exception, SystemExit) as error:  # whatever a stranger's module does when it is imported
                self._tell(_say_unusable(entry, error))
            else:
                if isinstance(row, self._kind):
                    self._loaded[entry] = row
                    USED.append(_describe(entry))
                else:
                    self._tell(f"{_describe(entry)} cannot be used: {entry.value} is no {self._kind.__name__}")
        return self._loaded[entry]

    def _tell(self, text: str) -> None:
        """Once per process."""
        if text not in self._told:
            self._told.add(text)
            warnings.warn(text, CospeechWarning, stacklevel=4)


def check_row(row: object, texts: Iterable[str], choices: Mapping[str, Iterable[str]]) -> None:
    """Whether a row has what lists of rows take for granted.

    Args:
        row: an instance of a dataclass of rows.
        texts: fields that are text.
        choices: field that is a tuple → what it may hold.

    Raises:
        InputError: it has not.
    """
    what = f"of a {type(row).__name__} is"
    for name in texts:
        if not isinstance(value := getattr(row, name), str):
            raise InputError(f"{name} {what} {value!r:.60}", "it is text")
    for name, known in choices.items():
        if not isinstance(value := getattr(row, name), tuple) or not {*value} <= {*known}:
            raise InputError(f"{name} {what} {value!r:.60}", f"a tuple of some of {', '.join(known)}")


def _describe(entry: EntryPoint) -> str:
    owner = f" of {entry.dist.name}" if entry.dist is not None else ""
    return f"plug-in {entry.name!r}{owner} ({entry.group})"


def _say_unusable(entry: EntryPoint, error: BaseException) -> str:
    return f"{_describe(entry)} cannot be used: {type(error).__name__}: {error}"


@lru_cache(maxsize=8)  # ours: two groups, and some changes of the path
def _find_entries(group: str, path: tuple[str, ...]) -> tuple[EntryPoint, ...]:
    """In order of their names, whatever the order of the folders; ``path`` is what they are looked for on."""
    from importlib.metadata import entry_points  # it takes longer to import than all of `cospeech --help`

    return tuple(sorted(entry_points(group=group), key=lambda entry: (entry.name, entry.value)))
