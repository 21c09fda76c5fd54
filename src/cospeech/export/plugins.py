"""Registries: name → row; our own rows, and those that other installed packages add through entry points.

A package adds a row by a line of its metadata, ``NAME = module:OBJECT``, in the group of the registry: ``cospeech.formats`` or
``cospeech.models``. Its module is imported when that name, or the list of all names, is needed; never for a name of ours.
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
"""The plug-ins of this process whose rows were read, in words: an error may come from them."""


class Registry(Mapping[str, Row], Generic[Row]):
    """Name → row, ours first. A plug-in that cannot be used causes a warning of one line, and is left out.

    Args:
        ours: the rows of this package; they take precedence where a plug-in has the same name.
        group: of the entry points.
        kind: the class of the rows.
        prefix: of the names in the registry, before the name of an entry point: the dot of a suffix.
    """

    def __init__(self, ours: Mapping[str, Row], *, group: str, kind: type[Row], prefix: str = "") -> None:
        self.ours = dict(ours)
        self._group, self._kind, self._prefix = group, kind, prefix
        self._rows: dict[EntryPoint, Row | None] = {}
        self._notes: set[str] = set()

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
        names = set(self.ours)
        for entry in self._entries():
            name = self._name(entry)
            if name in names:
                who = "cospeech has" if name in self.ours else "another package has"
                self._tell(f"{_describe(entry)} is not used: {who} {name!r} already")
            elif self._load(entry) is not None:
                names.add(name)
                yield name

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def find_code(self, name: str, module: str, attribute: str) -> Any:
        """Get an attribute of the module that the row of that name gives.

        Raises:
            InputError: the row is of another package, and there is no such module or no such attribute.
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
        """The name of a row in the registry; a suffix is in small letters."""
        return self._prefix + entry.name.removeprefix(self._prefix).lower() if self._prefix else entry.name

    def _entries(self) -> tuple[EntryPoint, ...]:
        return _find_entries(self._group, tuple(sys.path))

    def _load(self, entry: EntryPoint) -> Row | None:
        if entry not in self._rows:
            self._rows[entry] = None
            try:
                row = entry.load()
            except (Exception, SystemExit) as error:  # a module of others may do anything when it is imported
                self._tell(_say_unusable(entry, error))
            else:
                if isinstance(row, self._kind):
                    self._rows[entry] = row
                    USED.append(_describe(entry))
                else:
                    self._tell(f"{_describe(entry)} cannot be used: {entry.value} is no {self._kind.__name__}")
        return self._rows[entry]

    def _tell(self, text: str) -> None:
        """Warn, once per process."""
        if text not in self._notes:
            self._notes.add(text)
            warnings.warn(text, CospeechWarning, stacklevel=4)


def check_row(row: object, texts: Iterable[str], choices: Mapping[str, Iterable[str]]) -> None:
    """Check fields of a row that all lists of rows rely on.

    Args:
        row: an instance of a dataclass of rows.
        texts: fields that are text.
        choices: field that is a tuple → what it may hold.

    Raises:
        InputError: a field has another type or another value.
    """
    what = f"of a {type(row).__name__} is"
    for name in texts:
        if not isinstance(value := getattr(row, name), str):
            raise InputError(f"{name} {what} {value!r:.60}", "it is text")
    for name, values in choices.items():
        if not isinstance(value := getattr(row, name), tuple) or not {*value} <= {*values}:
            raise InputError(f"{name} {what} {value!r:.60}", f"a tuple of some of {', '.join(values)}")


def _describe(entry: EntryPoint) -> str:
    owner = f" of {entry.dist.name}" if entry.dist is not None else ""
    return f"plug-in {entry.name!r}{owner} ({entry.group})"


def _say_unusable(entry: EntryPoint, error: BaseException) -> str:
    return f"{_describe(entry)} cannot be used: {type(error).__name__}: {error}"


@lru_cache(maxsize=8)  # ours: two groups, and some changes of the path
def _find_entries(group: str, path: tuple[str, ...]) -> tuple[EntryPoint, ...]:
    """Entry points in order of their names, whatever the order of the folders; ``path``: where they are looked for."""
    from importlib.metadata import entry_points  # it takes longer to import than all of `cospeech --help`

    return tuple(sorted(entry_points(group=group), key=lambda entry: (entry.name, entry.value)))
