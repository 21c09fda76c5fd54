"""Files that were made to hurt: small, and wanting gigabytes or minutes; and what it takes to watch a reader at work on them.

`OPERATORS` are ways of making a good file of text hostile, the same for all formats; `TREE_OPERATORS` are those for what has a
structure (JSON, manifests, glTF). The tests of the readers run them over a good file of every format.
"""

from __future__ import annotations

import contextlib
import io
import json
import random
import re
import struct
import subprocess
import sys
import time
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from cospeech.errors import InputError
from cospeech.export import save
from cospeech.export.glb_container import split_glb
from tests.support.motions import gesturing, stand_in

__all__ = [
    "FAR", "OPERATORS", "TREE_OPERATORS", "answer", "bent_tree", "bounded_memory", "face_csv", "face_json", "far_glb",
    "glb_of", "hostile_text", "npz_of", "peak_of",
]  # fmt: skip

SECONDS = 5.0  # processor time that one small file may take; far above what any does, far below what a quadratic reader takes
ROOM = 1 << 30  # bytes of address space that one small file may take beyond what the process has
FAR = ("1e7", "9999999", "1e300", "-1e-300", "1e-300", "1" * 400, "0." + "0" * 400 + "1", "nan", "inf", "-1", "99:59:59:29")
NUMBER = re.compile(r"[+-]?\d+(?:[.,:]\d+)*(?:[eE][+-]?\d+)?")

# ---- operators: text in, hostile text out ----


def _at(text: str, chance: random.Random) -> int:
    """A place, mostly near the beginning, where heads are."""
    return chance.randrange(min(len(text), 200) + 1) if chance.random() < 0.6 else chance.randrange(len(text) + 1)


def digits(text: str, chance: random.Random) -> str:
    """A long run of digits, with or without something behind that is none."""
    at, run = _at(text, chance), chance.choice("0193") * chance.choice((20, 400, 4301, 20_000))
    return text[:at] + run + chance.choice(("", "x", ".", "e", "e5", '"')) + text[at:]


def far_number(text: str, chance: random.Random) -> str:
    """Replace one number by a far, tiny, endless or impossible one."""
    numbers = list(NUMBER.finditer(text))
    if not numbers:
        return text + chance.choice(FAR)
    match = chance.choice(numbers)
    return text[: match.start()] + chance.choice(FAR) + text[match.end() :]


def far_tail(text: str, chance: random.Random) -> str:
    """The last number becomes a far one: times and keys ascend."""
    numbers = list(NUMBER.finditer(text))
    match = chance.choice(numbers[-4:]) if numbers else None
    return text if match is None else text[: match.start()] + chance.choice(FAR) + text[match.end() :]


def gap(text: str, chance: random.Random) -> str:
    """Remove some lines."""
    lines = text.split("\n")
    first = chance.randrange(len(lines))
    return "\n".join(lines[:first] + lines[first + chance.choice((1, 2, 5, len(lines) // 2)) :])


def repeat_piece(text: str, chance: random.Random) -> str:
    """Repeat a token, a line or a piece many times."""
    kind = chance.randrange(3)
    pieces = text.split("\n") if kind == 0 else text.split() if kind == 1 else [text[(at := _at(text, chance)) : at + 8]]
    piece = chance.choice(pieces or ["x"])[:400]
    between = "\n" if kind == 0 else chance.choice((" ", "", "\t"))
    count = max(1, min(20_000, 60_000 // max(len(piece), 1)))
    at = text.find(piece)
    return text[:at] + (piece + between) * chance.choice((2, count // 10 + 1, count)) + text[at:]


def sign_run(text: str, chance: random.Random) -> str:
    """A long run of one sign of the format, or of two in turn."""
    signs = (*'"([{<&-.,:=\\\t \n', "{}", "()", "<>", '""', "&#", " -", "a.", "・")
    at, sign = _at(text, chance), chance.choice(signs)
    return text[:at] + sign * chance.choice((3, 300, 10_000)) + text[at:]


def unclose(text: str, chance: random.Random) -> str:
    """Take out a quote, bracket or brace, or put in one too many."""
    places = [k for k, letter in enumerate(text) if letter in "\"'()[]{}<>"]
    if places and chance.random() < 0.7:
        at = chance.choice(places)
        return text[:at] + text[at + 1 :]
    at = _at(text, chance)
    return text[:at] + chance.choice("\"'([{<") + text[at:]


def swap_lines(text: str, chance: random.Random) -> str:
    """Swap two lines, or double one: times go backwards or stand still."""
    lines = text.split("\n")
    a, b = chance.randrange(len(lines)), chance.randrange(len(lines))
    lines[a], lines[b] = lines[b], lines[a] if chance.random() < 0.7 else lines[b]
    return "\n".join(lines)


def long_line(text: str, chance: random.Random) -> str:
    """Join all lines to one."""
    return text.replace("\n", chance.choice((" ", "", "\t", ",")))


def long_word(text: str, chance: random.Random) -> str:
    """A name or a word becomes endless."""
    words = sorted(set(re.findall(r"[A-Za-z]{2,}", text)))
    word = chance.choice(words) if words else ""
    return text.replace(word, word + chance.choice(("a", "a1", "a-", "é", "。", "_")) * 5000, 1) if word else text


OPERATORS: tuple[Callable[[str, random.Random], str], ...] = (
    digits, far_number, far_tail, gap, repeat_piece, sign_run, unclose, swap_lines, long_line, long_word,
)  # fmt: skip


def hostile_text(text: str, chance: random.Random) -> str:
    """The text after one or two operators."""
    for _ in range(chance.choice((1, 1, 2))):
        text = chance.choice(OPERATORS)(text, chance)
    return text


# ---- operators: values in a tree ----

ODD = (
    10**400, -(10**18), 1e308, 1e-300, 0, -1, True, None, "", "x" * 5000, "1" * 5000, [], [[]] * 50, {}, {"a": {}}, 2**31,
    2**53 + 2, 0.5,
)  # fmt: skip


def _gesture_space(tree: object) -> list[tuple[object, object]]:
    pairs: list[tuple[object, object]] = []
    stack = [tree]
    while stack:
        node = stack.pop()
        keys = list(node) if isinstance(node, dict) else range(len(node)) if isinstance(node, list) else ()
        for key in keys:
            pairs.append((node, key))
            stack.append(node[key])
    return pairs


def odd_value(node: object, key: object, chance: random.Random) -> None:
    """Another value, of another type or far from all others."""
    node[key] = chance.choice(ODD)  # type: ignore[index]


def scale(node: object, key: object, chance: random.Random) -> None:
    """Make a number a million times as large or small."""
    if isinstance(value := node[key], int | float) and not isinstance(value, bool):  # type: ignore[index]
        node[key] = value * chance.choice((10**6, 10**12, 1e-12, -1))  # type: ignore[index]


def multiply(node: object, key: object, chance: random.Random) -> None:
    """Make a list many times as long, or give an object many more entries like one of its own."""
    value, times = node[key], chance.choice((2, 50, 1000))  # type: ignore[index]
    if isinstance(value, list) and len(value) * times < 50_000:
        node[key] = value * times  # type: ignore[index]
    elif isinstance(value, dict) and value:
        first = next(iter(value.values()))
        value |= {f"k{k}": first for k in range(times)}


def nest(node: object, key: object, chance: random.Random) -> None:
    """Put a value inside many lists."""
    value = node[key]  # type: ignore[index]
    for _ in range(chance.choice((1, 30, 600))):
        value = [value]
    node[key] = value  # type: ignore[index]


TREE_OPERATORS: tuple[Callable[[object, object, random.Random], None], ...] = (odd_value, scale, multiply, nest)


def bent_tree(tree: object, chance: random.Random) -> object:
    """A copy with one to three hostile values."""
    tree = json.loads(json.dumps(tree))
    for _ in range(chance.choice((1, 1, 2, 3))):
        node, key = chance.choice(_gesture_space(tree))
        try:
            chance.choice(TREE_OPERATORS)(node, key, chance)
        except (KeyError, IndexError):  # an earlier one has taken the place away
            continue
    return tree


# ---- files that were small and cost gigabytes ----


def face_json(names: list[str], times: list[float]) -> bytes:
    """BEAT's layout, all weights a half."""
    frames = [{"weights": [0.5] * len(names), "time": time, "rotation": []} for time in times]
    return json.dumps({"names": names, "frames": frames}, separators=(",", ":")).encode()


def face_csv(clocks: list[str]) -> bytes:
    """A recording of Live Link Face whose weights count the rows."""
    buffer = io.BytesIO()
    from cospeech.export.live_link_csv import COLUMNS

    buffer.write((",".join(COLUMNS) + "\n").encode())
    for k, clock in enumerate(clocks):
        buffer.write((f"{clock},61" + f",{min(k / 10, 1):.3f}" * 61 + "\n").encode())
    return buffer.getvalue()


def glb_of(document: object, data: bytes) -> bytes:
    """A container around any JSON, sensible or not."""
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    header = struct.pack("<5I", 0x46546C67, 2, 28 + len(text) + len(data), len(text), 0x4E4F534A)
    return header + text + struct.pack("<II", len(data), 0x004E4942) + data


def far_glb(folder: Path, suffix: str, frames: int, last: float) -> bytes:
    """An animation of so many frames whose last key lies ``last`` seconds from the first."""
    path = folder / f"good{suffix}"
    save(gesturing(frames), path, **({"character": stand_in()} if suffix == ".glb" else {}))
    document, data = split_glb(path.read_bytes(), "")
    binary = bytearray(data)
    clock = document["accessors"][document["animations"][0]["samplers"][0]["input"]]
    at = document["bufferViews"][clock["bufferView"]].get("byteOffset", 0) + clock.get("byteOffset", 0)
    struct.pack_into("<f", binary, at + 4 * (frames - 1), last)
    clock["max"] = [last]
    return glb_of(document, bytes(binary))


def npz_of(heads: dict[str, tuple[str | bytes, bytes]]) -> bytes:
    """An ``.npz`` of arrays whose heads are written as they are given: name → (head, numbers)."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, (head, data) in heads.items():
            raw = head if isinstance(head, bytes) else head.encode("latin-1", "replace")
            archive.writestr(f"{name}.npy", b"\x93NUMPY\x02\x00" + struct.pack("<I", len(raw)) + raw + data)
    return out.getvalue()


# ---- watching a reader ----


@contextlib.contextmanager
def bounded_memory(room: int = ROOM) -> Iterator[None]:
    """Not more than ``room`` bytes of address space beyond what there is; more is a MemoryError (Linux only)."""
    try:
        import resource

        size = int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[0]) * resource.getpagesize()
    except (ImportError, OSError):
        yield
        return
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (size + room, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def answer(read: Callable[[], object]) -> str:
    """ "read" or "refused"; a late answer, one of several lines, or any other error fails the test."""
    began = time.process_time()
    try:
        read()
        outcome = "read"
    except InputError as error:
        text = str(error)
        assert "\n" not in text and len(text) < 5000, text  # noqa: PT018
        assert "nested too deeply" not in text or "large" not in text, text  # what a MemoryError is turned into
        outcome = "refused"
    took = time.process_time() - began
    assert took < SECONDS, f"{took:.1f} s"
    return outcome


def peak_of(path: Path, call: str = "cospeech.Motion.load(path)") -> tuple[str, float, int]:
    """What a process of its own says to a file: its answer, seconds of processor time, and the most memory, in MiB.

    Skipped where no system tells the memory.
    """
    if not Path("/proc/self/status").exists():
        pytest.skip("this system does not tell the memory of a process")
    program = (
        "import sys, time\n"
        "import cospeech, cospeech.audio.transcripts, cospeech.audio.emotions, cospeech.motion.bone_mapping\n"
        "import cospeech.training.recipe\n"
        "path, began = sys.argv[1], time.process_time()\n"
        f"try:\n    {call}\n    said = 'read'\n"
        "except cospeech.InputError as error:\n    said = str(error)\n"
        "status = dict(line.split(':') for line in open('/proc/self/status'))\n"
        "peak = int(status['VmHWM'].split()[0]) >> 10\n"
        "print(f'{time.process_time() - began}\\n{peak}\\n{said}')\n"
    )
    run = subprocess.run([sys.executable, "-c", program, str(path)], capture_output=True, text=True, timeout=120)
    assert run.returncode == 0, run.stderr[-2000:]
    seconds, peak, result = run.stdout.split("\n", 2)
    return result.strip(), float(seconds), int(peak)
