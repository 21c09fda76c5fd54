"""SMPL-X motion as the BEAT2 data set and EMAGE write it: a ``.npz`` that opens without pickle.

``betas (300,)``, ``poses (T, 165)`` axis-angles of 55 joints, ``expressions (T, 100)``, ``trans (T, 3)``,
``model 'smplx2020'``, ``gender 'neutral'``, ``mocap_frame_rate`` (PantoMatrix, ``emage_utils/motion_io.py``). Strings are
``<U`` arrays, so that ``allow_pickle=False`` reads them.

FLAME's expression coefficients cannot be derived without the licensed face model: ``expressions`` is zero, the jaw joint opens
by ``jawOpen`` × 0.35 rad, and the whole face is in two keys of our own, ``arkit (T, 52)`` and ``arkit_names``. ``trans`` is the
pelvis minus its place in SMPL-X's neutral template, because SMPL-X adds that itself. AMASS' files are read, too: see
`smpl_bodies`.
"""

from __future__ import annotations

import math
import zipfile
from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import IO

import numpy as np

from ..errors import InputError
from ..limits import MOTION_RATES
from ..motion.motion import Motion
from ..motion.rotations import Array, quat_continuous, quat_to_rotvec, rotvec_to_quat
from ..motion.skeleton import find_skeleton
from ..motion.skeletons.arkit import ARKIT, ARKIT_INDEX
from . import Writer as BaseWriter
from .frame_buffer import FrameBuffer
from .npz_arrays import Arrays, open_arrays
from .reading import check_frames, open_file, size_of
from .smpl_bodies import JOINTS, WIDTHS, find_pelvis, stand_upright, to_smplx

__all__ = ["Writer", "load"]

_MOST_NAMES = 1000  # columns of a face; ours: ARKit has 52
_JAW = 22  # SMPL-X joint order, see ecosystem of `smplx` joint_names
_JAW_OPEN = 0.35  # radians at jawOpen = 1; ours: FLAME's mouth is wide open at some 20 degrees


class Writer(BaseWriter):
    """Spools the frames and packs them at the end; motion of another skeleton is retargeted to SMPL-X piece by piece."""

    _spool: FrameBuffer | None = None

    def _begin(self, temporary: Path) -> None:
        self._temporary = temporary
        self._spool = FrameBuffer((JOINTS * 3, 3, len(ARKIT)), temporary.parent)
        self._has_face = True

    def _write(self, motion: Motion) -> None:
        assert self._spool is not None
        body = motion if motion.skeleton.kind == "smplx" else motion.retarget("smplx")
        poses = quat_to_rotvec(body.rotations.astype(np.float64)).reshape(len(motion), -1)
        face = np.zeros((len(motion), len(ARKIT))) if motion.face is None else motion.face
        self._has_face &= motion.face is not None
        if motion.face is not None:
            poses[:, _JAW * 3 : _JAW * 3 + 3] = face[:, ARKIT_INDEX["jawOpen"], None] * (_JAW_OPEN, 0, 0)
        self._spool.add(np.concatenate([poses, body.root - find_pelvis(JOINTS * 3), face], 1))

    def _finish(self) -> None:
        assert self._spool is not None
        spool, frames = self._spool, self._spool.frames
        with zipfile.ZipFile(self._temporary, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
            _pack(archive, "betas", (300,), [np.zeros(300, "<f4")])
            _pack(archive, "poses", (frames, JOINTS * 3), spool.blocks(0))
            _pack(archive, "expressions", (frames, 100), (np.zeros((len(b), 100), "<f4") for b in spool.blocks(1)))
            _pack(archive, "trans", (frames, 3), spool.blocks(1))
            for key, value in (("model", "smplx2020"), ("gender", "neutral")):
                _pack(archive, key, (), [np.array(value)])
            rate = int(self.fps) if self.fps.is_integer() else self.fps
            _pack(archive, "mocap_frame_rate", (), [np.array(rate)])
            if self._has_face:
                _pack(archive, "arkit", (frames, len(ARKIT)), spool.blocks(2))
                _pack(archive, "arkit_names", (len(ARKIT),), [np.array(ARKIT)])

    def _discard(self) -> None:
        if self._spool is not None:
            self._spool.close()


def _pack(archive: zipfile.ZipFile, key: str, shape: tuple[int, ...], blocks: Iterable[Array]) -> None:
    """Write one ``.npy`` member of ``shape``, in blocks."""
    with archive.open(f"{key}.npy", "w", force_zip64=True) as out:  # dated 1980: the same motion gives the same bytes
        header = False
        for block in blocks:
            if not header:
                _write_header(out, block.dtype, shape)
                header = True
            out.write(np.ascontiguousarray(block).tobytes())
        if not header:
            _write_header(out, np.dtype("<f4"), shape)


def _write_header(out: IO[bytes], dtype: np.dtype, shape: tuple[int, ...]) -> None:
    description = {"descr": np.lib.format.dtype_to_descr(dtype), "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(out, description)  # type: ignore[arg-type]


def load(path: str | PathLike[str]) -> Motion:
    """Read motion in BEAT2's layout of SMPL-X, or in AMASS' of SMPL-X, SMPL-H or SMPL, onto the SMPL-X skeleton, with Y up.

    The face is our ``arkit`` key where there is one; else a moving jaw gives ``jawOpen``; else there is none. Where there is
    a face the jaw joint rests.

    Raises:
        InputError: not a zip of arrays, arrays that need pickle, missing or misshapen ``poses`` or ``trans``, members that
            unpack to more than 1 GiB.
    """
    name = repr(str(path))
    with open_file(path) as file, open_arrays(file, name) as arrays:
        for key in ("poses", "trans"):
            if key not in arrays:
                raise InputError(f"{name} has no {key!r}", f"its arrays: {', '.join(sorted(arrays))[:100] or 'none'}")
        rate_key = "mocap_frame_rate" if "mocap_frame_rate" in arrays else "mocap_framerate"
        if rate_key not in arrays:
            raise InputError(f"{name} has no 'mocap_frame_rate'", "BEAT2 files of SMPL-X carry it")
        _check_shapes(arrays, rate_key, size_of(file), name)
        poses, trans, rate = arrays.read("poses"), arrays.read("trans"), arrays.read(rate_key)
        face = _face(arrays, name)
    return _motion(poses, trans, rate, face, name)


def _check_shapes(arrays: Arrays, rate_key: str, size: int, name: str) -> None:
    """Check, by their heads, that the arrays of a file of ``size`` bytes fit together, before any of them is unpacked."""
    poses, trans = arrays.shape("poses"), arrays.shape("trans")
    frames = poses[0] if poses else 0
    if len(poses) != 2 or poses[1] not in WIDTHS or trans != (frames, 3):
        hint = "expected (frames, 165) of SMPL-X, 156 of SMPL-H or 72 of SMPL, and (frames, 3)"
        raise InputError(f"{name}: poses {poses}, trans {trans}"[:200], hint)
    check_frames(name, frames, JOINTS, size)
    if math.prod(arrays.shape(rate_key)) != 1:
        raise InputError(f"{name} has frames per second of shape {arrays.shape(rate_key)}"[:200], "expected one number")
    face = arrays.shape("arkit") if "arkit" in arrays else (frames, len(ARKIT))
    names = arrays.shape("arkit_names") if "arkit_names" in arrays else (len(ARKIT),)
    if len(face) != 2 or face[0] != frames or face[1] > _MOST_NAMES or (face[1],) != names:
        raise InputError(f"'arkit' of {name} is of shape {face}, its names {names}"[:200], f"expected ({frames}, 52)")


def _face(arrays: Arrays, name: str) -> Array | None:
    if "arkit" not in arrays:
        return None
    weights = arrays.read("arkit")
    names = [str(n) for n in arrays.read("arkit_names")] if "arkit_names" in arrays else list(ARKIT)
    if weights.dtype.kind != "f":
        raise InputError(f"'arkit' of {name} is {weights.dtype}", "expected floats")
    face = np.zeros((len(weights), len(ARKIT)))
    for k, shape in enumerate(names):
        if shape in ARKIT_INDEX:
            face[:, ARKIT_INDEX[shape]] = weights[:, k]
    if not np.isfinite(face).all():
        raise InputError(f"'arkit' of {name} holds values that are not finite", "is it damaged?")
    return np.clip(face, 0, 1)


def _motion(poses: np.ndarray, trans: np.ndarray, rate: np.ndarray, face: Array | None, name: str) -> Motion:
    if {poses.dtype.kind, trans.dtype.kind} != {"f"}:
        raise InputError(f"{name}: poses are {poses.dtype}, trans {trans.dtype}", "expected floats")
    if rate.dtype.kind not in "fiu" or not (
        np.isfinite(rate).all() and MOTION_RATES[0] <= float(rate.reshape(())) <= MOTION_RATES[1]
    ):
        raise InputError(f"{name} has {str(rate)[:40]} frames per second", "is it damaged?")
    vectors = to_smplx(poses)
    if not (np.isfinite(vectors).all() and np.isfinite(trans).all() and np.abs(vectors).max(initial=0) < 1e3):
        raise InputError(f"{name} holds values that are not finite", "is it damaged?")
    if face is None and np.abs(vectors[:, _JAW]).max(initial=0) > 0:
        face = np.zeros((len(poses), len(ARKIT)))
        face[:, ARKIT_INDEX["jawOpen"]] = np.clip(vectors[:, _JAW, 0] / _JAW_OPEN, 0, 1)
    if face is not None:
        vectors[:, _JAW] = 0  # the face has it now; both together would open the mouth twice
    rotations, root = rotvec_to_quat(vectors), trans.astype(np.float64) + find_pelvis(poses.shape[1])
    rotations[:, 0], root = stand_upright(rotations[:, 0], root)
    rotations = quat_continuous(rotations)
    return Motion(fps=float(rate.reshape(())), rotations=rotations, root=root, face=face, skeleton=find_skeleton("smplx"))
