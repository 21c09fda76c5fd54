"""The HIERARCHY section of a BVH: its joints, and its lines."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

__all__ = ["Header", "file_names", "format_hierarchy"]


class Header:
    """Joints in the order and the units of the file, parents first; ``ends``: joint index → offset of its End Site."""

    def __init__(self) -> None:
        self.names: list[str] = []
        self.parents: list[int] = []
        self.offsets: list[tuple[float, float, float]] = []
        self.channels: list[tuple[str, ...]] = []
        self.ends: dict[int, tuple[float, float, float]] = {}
        self.frame_time, self.precision = 0.0, 0.0  # seconds, and the value of the last digit
        self.lines = 0  # of the file up to here

    @property
    def columns(self) -> int:
        """Numbers per row."""
        return sum(len(channels) for channels in self.channels)


def file_names(names: Iterable[str]) -> list[str]:
    """Make names that a BVH may hold: blanks and braces become ``_``, and a name that is taken gets a number."""
    counts: dict[str, int] = {}  # name → the number that was tried last for it
    result = []
    for name in names:
        clean = unique = re.sub(r"[\s{}]+", "_", name.strip()) or "joint"
        while unique in counts:
            counts[clean] += 1
            unique = f"{clean}_{counts[clean]}"
        counts[unique] = 1
        result.append(unique)
    return result


def format_hierarchy(header: Header, decimals: int) -> Iterator[str]:
    """Lines of the HIERARCHY section.

    Args:
        header: joints depth first, as the format wants them.
        decimals: of lengths; a length that needs more gets them.
    """

    def numbers(values: Iterable[float]) -> str:
        pairs = [(value + 0.0, f"{value + 0.0:.{decimals}f}") for value in values]  # no "-0.000000"
        return " ".join(text if float(text) == value else repr(value) for value, text in pairs)

    yield "HIERARCHY"
    stack: list[int] = []
    for joint, parent in enumerate(header.parents):
        while stack and stack[-1] != parent:
            stack.pop()
            yield "\t" * len(stack) + "}"
        indent, channels = "\t" * len(stack), header.channels[joint]
        yield f"{indent}{'JOINT' if stack else 'ROOT'} {header.names[joint]}"
        yield f"{indent}{{"
        yield f"{indent}\tOFFSET {numbers(header.offsets[joint])}"
        yield " ".join([f"{indent}\tCHANNELS {len(channels)}", *channels])
        stack.append(joint)
        if joint in header.ends:
            yield f"{indent}\tEnd Site\n{indent}\t{{\n{indent}\t\tOFFSET {numbers(header.ends[joint])}\n{indent}\t}}"
    while stack:
        stack.pop()
        yield "\t" * len(stack) + "}"
