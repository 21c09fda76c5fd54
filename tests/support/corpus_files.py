"""What the tests of corpus readers share: a small clip, damage of many kinds, and the results that are allowed."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from cospeech.audio.speech import Speech, Word
from cospeech.corpora import Clip, Dropped, Semantic
from cospeech.errors import CospeechWarning
from tests.support.motions import gesturing

__all__ = ["UNUSABLE", "WORDS", "clip", "damage", "same_turns", "sort_out", "tone", "unusable"]

UNUSABLE = ["gone", "file", "empty", "other"]
WORDS = (Word("well", 0.1, 0.3), Word("don't", 0.3, 0.55), Word("relax", 0.7, 0.95))
_NASTY = (
    b"nan", b"inf", b"-inf", b"1e999", b"", b"{", b"}", b"]", b"\0", b"9" * 400, b"--1", b"1,5", b"\xff", b"null", b"true",
    b'"', b"\\", b"-5", b"99999999", b"\r", b"\t", b"JOINT", b"\xd9\xa3", b"[[", b"0x10", b"1_0",
)  # fmt: skip


def tone(seconds: float = 1.0, rate: int = 16_000) -> Speech:
    """A voice-like sound with words."""
    t = np.arange(round(seconds * rate)) / rate
    wave = 0.2 * np.sin(2 * np.pi * 140 * t) * (1 + np.sin(2 * np.pi * 4 * t))
    return Speech(wave.astype(np.float32), rate, words=WORDS)


def clip(name: str = "first", frames: int = 30, **changes: object) -> Clip:
    """A second of our humanoid with everything that a clip can have."""
    motion = gesturing(frames)
    values: dict[str, object] = {
        "speaker": "scott",
        "corpus": "synthetic",
        "speech": tone(frames / 30),
        "motion": motion,
        "emotion": "anger",
        "semantics": (Semantic(0, 0.319, 0.1, "01_beat_align"), Semantic(0.319, 0.785, 0.7, "07_iconic_h", "relax well")),
    }
    return Clip(name=name, **{**values, **changes})  # type: ignore[arg-type]


def unusable(folder: Path, kind: str, other: str = "notes/a.md") -> Path:
    """A root that holds no corpus; of the kind ``other`` it holds this file."""
    root = folder / "root"
    if kind == "file":
        root.write_text("x")
    elif kind != "gone":
        root.mkdir()
    if kind == "other":
        (root / other).parent.mkdir(exist_ok=True)
        (root / other).write_text("nothing")
    return root


def same_turns(a: np.ndarray, b: np.ndarray) -> float:
    """The largest difference of two arrays of quaternions, whatever their signs."""
    assert a.shape == b.shape
    return float(np.minimum(np.abs(a - b).max(-1), np.abs(a + b).max(-1)).max())


def damage(data: bytes, rng: np.random.Generator) -> bytes:
    """Damage data once or twice: cut it off, change bytes, put a bad word for a word, drop or double lines, write zeros."""
    for _ in range(rng.integers(1, 3)):
        kind, at = int(rng.integers(7)), int(rng.integers(max(len(data), 1)))
        if kind == 0:
            data = data[:at]
        elif kind == 1:
            place = bytearray(data)
            for k in rng.integers(0, max(len(data), 1), 8):
                if len(place):
                    place[k] = int(rng.integers(256))
            data = bytes(place)
        elif kind in (2, 3):
            words = data.split(b" ")
            words[int(rng.integers(len(words)))] = _NASTY[int(rng.integers(len(_NASTY)))]
            data = b" ".join(words)
        elif kind in (4, 5):
            lines = data.split(b"\n")
            k = int(rng.integers(len(lines)))
            data = b"\n".join([*lines[:k], *([lines[k]] * 2 if kind == 4 else []), *lines[k + 1 :]])
        else:
            data = data[:at] + bytes(min(64, len(data) - at)) + data[at + 64 :]
    return data


def sort_out(items: Iterable[Clip | Dropped], expected: Iterable[str]) -> tuple[dict[str, Clip], dict[str, str]]:
    """Clips and reasons by name; every expected name is there once, values are finite and the reasons are single lines."""
    clips: dict[str, Clip] = {}
    reasons: dict[str, str] = {}
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".* is cut short", CospeechWarning)  # a note, and no reason to drop it
        results = list(items)
    for item in results:
        assert item.name not in clips
        assert item.name not in reasons
        if isinstance(item, Dropped):
            assert item.reason.strip()
            assert "\n" not in item.reason
            assert "Traceback" not in item.reason
            reasons[item.name] = item.reason
            continue
        clips[item.name] = item
        if item.motion is not None:
            assert np.isfinite(item.motion.rotations).all()
            assert np.abs(np.linalg.norm(item.motion.rotations, axis=-1) - 1).max() < 1e-6
            assert np.isfinite(item.motion.root).all()
        if item.face is not None:
            assert item.face.shape[1] == 52
            assert item.face.min() >= 0
            assert item.face.max() <= 1
        for row in item.semantics or ():
            assert 0 <= row.start <= row.end
            assert 0 <= row.score <= 1
        for word in (item.speech.words if item.speech is not None else None) or ():
            assert 0 <= word.start < word.end
    assert {*clips, *reasons} == set(expected)
    return clips, reasons
