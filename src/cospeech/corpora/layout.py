"""Files as the corpora's own tools wrote them: BVH with a given order of channels, float32 WAV, long TextGrids."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..audio.speech import Speech, Word
from ..export.bvh_frames import RowEncoder
from ..export.bvh_hierarchy import format_hierarchy
from ..export.bvh_layout import make_layout
from ..export.bvh_text import format_rows
from ..motion.motion import Motion
from ..motion.rotations import Array, quat_identity

__all__ = ["on_rate", "textgrid", "write_bvh", "write_float_wav"]

_BLOCK = 512  # ours: frames formatted at once, bounds the memory
_CM = 100.0
_DECIMALS = 6


def write_bvh(path: Path, motion: Motion, *, order: str, root: Array, frame_time: str) -> None:
    """One BVH in centimetres and degrees, six decimals, tabs; angles run on without jumps.

    Args:
        path: the file to be.
        motion: its local rotations are written as they are, on its skeleton's zero pose.
        order: of the rotation channels, such as ``"XYZ"``; the root's positions stand before them.
        root: (T, 3) metres, the root's position channels.
        frame_time: as it is to stand in the file: ``"0.008333"``.
    """
    layout = make_layout(replace(motion.skeleton, rest=quat_identity(len(motion.skeleton))), _CM, _DECIMALS, order)
    encoder, decimals = RowEncoder(layout.header, layout.places), np.full(layout.header.columns, _DECIMALS)
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write("\n".join(format_hierarchy(layout.header, _DECIMALS)) + "\n")
        file.write(f"MOTION\nFrames: {len(motion)}\nFrame Time: {frame_time}\n")
        for start in range(0, len(motion), _BLOCK):
            piece = slice(start, start + _BLOCK)
            rows = encoder.encode(*layout.convert_frames(motion.rotations[piece], root[piece]))
            file.write(format_rows(rows, decimals))


def write_float_wav(path: Path, samples: Array, rate: int) -> None:
    """Mono IEEE float WAV (format tag 3), without the dated PEAK chunk of libsndfile: the same sound gives the same bytes."""
    data = np.ascontiguousarray(samples, "<f4").tobytes()
    head = b"WAVEfmt " + struct.pack("<IHHIIHH", 16, 3, 1, rate, 4 * rate, 4, 32)
    head += b"fact" + struct.pack("<II", 4, len(samples)) + b"data" + struct.pack("<I", len(data))
    with path.open("wb") as file:
        file.write(b"RIFF" + struct.pack("<I", len(head) + len(data)) + head + data)


def on_rate(speech: Speech, rate: int) -> Array:
    """The samples of a speech at ``rate``, float32; exactly as many as ceil(duration × rate)."""
    if speech.rate == rate:
        return speech.samples
    from soxr import resample

    samples = resample(speech.samples, speech.rate, rate, "HQ")
    count = speech.frames(rate)
    return np.pad(samples, (0, max(count - len(samples), 0)))[:count].astype(np.float32)


def textgrid(tiers: dict[str, Sequence[Word]], seconds: float) -> str:
    """A TextGrid in the long form; silences are intervals with empty text, each tier is filled from 0 to its end."""
    lines = ['File type = "ooTextFile"', 'Object class = "TextGrid"', "", "xmin = 0", f"xmax = {_time(seconds)}"]
    lines += ["tiers? <exists>", f"size = {len(tiers)}", "item []:"]
    for number, (name, words) in enumerate(tiers.items(), 1):
        rows = _fill_gaps(words, seconds)
        lines += [f"    item [{number}]:", '        class = "IntervalTier"', f'        name = "{name}"']
        lines += ["        xmin = 0", f"        xmax = {_time(seconds)}", f"        intervals: size = {len(rows)}"]
        for k, word in enumerate(rows, 1):
            text = word.text.replace('"', '""')
            lines += [f"        intervals [{k}]:", f"            xmin = {_time(word.start)}"]
            lines += [f"            xmax = {_time(word.end)}", f'            text = "{text}"']
    return "\n".join(lines) + "\n"


def _time(seconds: float) -> str:
    return f"{seconds:.6f}".rstrip("0").rstrip(".")


def _fill_gaps(words: Sequence[Word], seconds: float) -> list[Word]:
    """The words with empty intervals between them."""
    rows, at = [], 0.0
    for word in words:
        start = max(word.start, at)  # intervals of a tier may not overlap
        if start > at + 1e-6:  # 1e-6: the precision of the times
            rows.append(Word("", at, start))
        if word.end > start:
            rows.append(Word(" ".join(word.text.split()), start, word.end))
            at = word.end
    if seconds > at + 1e-6 or not rows:
        rows.append(Word("", at, seconds))
    return rows
