"""A store for the studio: it keeps things with random names and a folder each, and drops the oldest ones."""

from __future__ import annotations

import secrets
import shutil
import threading
from dataclasses import dataclass, field
from pathlib import Path
from typing import Generic, Protocol, TypeVar

__all__ = ["Kept", "Shelf", "TakeSource"]


class Kept(Protocol):
    """Something that a `Shelf` keeps."""

    folder: Path

    @property
    def in_use(self) -> bool:
        """Whether it must not be dropped now."""
        ...


@dataclass
class TakeSource:
    """Something that takes are made from, in a folder of its own. It is in use while one of them waits or is made."""

    _takes: list[Kept] = field(default_factory=list, init=False, repr=False)

    def add_take(self, take: Kept) -> None:
        """Note a take that is made from it."""
        self._takes = [*(each for each in self._takes if each.in_use), take]

    @property
    def in_use(self) -> bool:
        """Whether a take that is made from it is in use."""
        return any(take.in_use for take in self._takes)


T = TypeVar("T", bound=Kept)


class Shelf(Generic[T]):
    """Keeps things by name. It makes the names itself, so that a name from outside is never a path.

    Things that are in use are kept beyond the limits, until a new thing comes after their use.

    Args:
        kind: kind of the things, one word for messages.
        parent: an existing folder; each thing has a folder in it.
        most: number of things that are kept.
        most_bytes: bytes of the files of all things; a single larger thing is kept until the next one comes.
    """

    def __init__(self, kind: str, parent: Path, most: int, most_bytes: int) -> None:
        self._kind = kind
        self._parent, self._most, self._most_bytes = parent, most, most_bytes
        self._things: dict[str, T] = {}
        self._lock = threading.Lock()
        parent.mkdir()

    def make_folder(self) -> tuple[str, Path]:
        """Make a new name, and an empty folder for a thing of this name."""
        name = secrets.token_hex(8)
        folder = self._parent / name
        folder.mkdir()
        return name, folder

    def put(self, name: str, thing: T) -> list[str]:
        """Keep a thing under a name of `make_folder`; returns the names of dropped things."""
        with self._lock:
            self._things[name] = thing
            names = self._choose_oldest(name)
            things = [self._things.pop(each) for each in names]
        for each in things:
            shutil.rmtree(each.folder, ignore_errors=True)
        return names

    def find(self, name: str) -> T:
        """Find a thing by its name.

        Raises:
            LookupError: there is none; the message tells the kind.
        """
        with self._lock:
            return self._find(name)

    def _find(self, name: str) -> T:
        if name not in self._things:
            raise LookupError(f"this {self._kind} is no longer here")
        return self._things[name]

    @property
    def things(self) -> list[T]:
        """All things, the oldest one first."""
        with self._lock:
            return list(self._things.values())

    def remove(self, name: str) -> None:
        """Forget a thing, and delete its files.

        Raises:
            LookupError: as in `find`.
        """
        with self._lock:
            thing = self._find(name)
            del self._things[name]
        shutil.rmtree(thing.folder, ignore_errors=True)

    def _choose_oldest(self, new: str) -> list[str]:
        """Names of the things that must be dropped to keep the limits."""
        sizes = {name: _count_bytes(thing.folder) for name, thing in self._things.items()}
        names: list[str] = []
        for name, thing in self._things.items():
            if len(sizes) <= self._most and sum(sizes.values()) <= self._most_bytes:
                break
            if name != new and not thing.in_use:
                names.append(name)
                del sizes[name]
        return names


def _count_bytes(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.glob("*") if path.is_file())
