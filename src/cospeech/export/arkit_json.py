"""ARKit-52 weights as JSON in the face layout of the BEAT data set (Liu et al. 2022).

``{"names": [...], "frames": [{"weights": [...], "time": seconds, "rotation": []}, ...]}``; BEAT lists 51 names in
alphabetical order (without ``tongueOut``); ours are these 51 and ``tongueOut`` last. Any subset in any order is read, and so
is the layout of NVIDIA's Audio2Face: ``{"exportFps": 30, "facsNames": [...], "weightMat": [[...], ...], ...}``.
"""

from __future__ import annotations

import json
from os import PathLike
from pathlib import Path
from typing import IO, Any

import numpy as np

from ..errors import InputError
from ..files import parse_json
from ..limits import FACE_JSON_BYTES, JSON_VALUES, MOTION_RATES, PLAUSIBLE_SECONDS
from ..motion.motion import Motion
from ..motion.rotations import Array
from ..motion.skeleton import humanoid
from ..motion.skeletons.arkit import ARKIT, ARKIT_INDEX
from . import Writer as BaseWriter
from .reading import check_frames, read_bytes
from .timing import frame_rate, frames_of, on_grid
from .to_humanoid import make_standing

__all__ = ["NAMES", "Writer", "load"]

NAMES = (*sorted(name for name in ARKIT if name != "tongueOut"), "tongueOut")
"""Order of the weights in our files."""

_ORDER = np.array([ARKIT_INDEX[name] for name in NAMES])
_LOWER = {name.lower(): k for name, k in ARKIT_INDEX.items()}
_DEFAULT_FPS = 60.0  # BEAT's face data, for a file of one frame


class Writer(BaseWriter):
    """Writes frame after frame; only the face is in this format."""

    _file: IO[str] | None = None

    def _begin(self, temporary: Path) -> None:
        self._file = temporary.open("w", encoding="ascii", newline="")
        self._file.write('{"names": ' + json.dumps(NAMES) + ', "frames": [')

    def _write(self, motion: Motion) -> None:
        assert self._file is not None
        face = np.zeros((len(motion), len(ARKIT))) if motion.face is None else motion.face
        rows = (np.round(face[:, _ORDER].astype(np.float64), 5) + 0.0).tolist()
        for k, weights in enumerate(rows, start=self.frames):
            frame = {"weights": weights, "time": round(k / self.fps, 6), "rotation": []}
            self._file.write(("," if k else "") + "\n" + json.dumps(frame))

    def _finish(self) -> None:
        assert self._file is not None
        self._file.write("\n]}\n")
        self._file.close()

    def _discard(self) -> None:
        if self._file is not None:
            self._file.close()


def load(path: str | PathLike[str]) -> Motion:
    """Read face weights by name, on a standing body; names that are not ARKit's are left out, missing ones are zero.

    Uneven clocks are put on a constant rate; in a gap the weights change linearly.

    Raises:
        InputError: not JSON, neither layout, no known name, uneven rows, values that are not finite, or times so far apart
            that the motion would be too large.
    """
    name = repr(str(path))
    text = read_bytes(path, limit=FACE_JSON_BYTES)
    data = parse_json(text, name, JSON_VALUES)
    names, frames = _names_and_frames(data, name) if isinstance(data, dict) else (None, None)
    if not isinstance(names, list) or not isinstance(frames, list) or not all(isinstance(n, str) for n in names):
        raise InputError(f"{name} holds no ARKit weights", 'expected {"names": [...], "frames": [...]}')
    columns = {_LOWER[n.lower()]: k for k, n in enumerate(names) if n.lower() in _LOWER}  # of two columns the last
    if not columns:
        raise InputError(f"{name} names none of ARKit's 52 shapes", f"first names: {', '.join(names[:3])[:80]}")
    if not frames:
        raise InputError(f"{name} has no frames", "was the export interrupted?")
    check_frames(name, len(frames), len(humanoid()), len(text))
    times, weights = _rows(frames, len(names), list(columns.values()), name)
    fps = frame_rate(times, _DEFAULT_FPS)
    check_frames(name, frames_of(times, fps), len(humanoid()), len(text))
    weights = on_grid(times, weights, fps)
    face = np.zeros((len(weights), len(ARKIT)))
    face[:, list(columns)] = np.clip(weights, 0, 1)
    return make_standing(len(face), fps=fps, face=face)


def _names_and_frames(data: dict[str, Any], name: str) -> tuple[Any, Any]:
    """Names and frames as BEAT's layout has them; the matrix of Audio2Face is turned into such frames."""
    rows = data.get("weightMat")
    if "names" in data or not isinstance(rows, list):
        return data.get("names"), data.get("frames")
    fps = data.get("exportFps")
    if isinstance(fps, bool) or not isinstance(fps, int | float) or not MOTION_RATES[0] <= fps <= MOTION_RATES[1]:
        raise InputError(f"{name} has exportFps {str(fps)[:40]}", "frames per second, such as 30")
    return data.get("facsNames"), [{"weights": row, "time": k / fps} for k, row in enumerate(rows)]


def _rows(frames: list, width: int, columns: list[int], name: str) -> tuple[Array, Array]:
    """Checked times (T,) of the frames, and their weights (T, K) in ``columns``; a frame has ``width`` columns."""
    times, weights = np.empty(len(frames)), np.empty((len(frames), len(columns)))
    for k, frame in enumerate(frames):
        try:
            row, time = frame["weights"], frame["time"]
            if len(row) != width or isinstance(row, str):
                raise InputError(f"frame {k} of {name} has {len(row)} weights for {width} names", "is it damaged?")
            weights[k], times[k] = [row[column] for column in columns], time
        except (TypeError, KeyError, IndexError, ValueError, OverflowError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(f"frame {k} of {name} cannot be read", 'expected {"weights": [...], "time": …}') from None
    if not (np.isfinite(weights).all() and np.all(np.abs(times) < PLAUSIBLE_SECONDS)):
        raise InputError(f"{name} holds values or times that are not finite", "is it damaged?")
    return times, weights
