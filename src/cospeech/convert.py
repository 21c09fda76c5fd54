"""One motion file into another: the call behind ``cospeech convert`` and ``cospeech render``."""

from __future__ import annotations

from pathlib import Path

from .errors import InputError, nearest
from .export import format_of, load
from .generate import FPS_RANGE, File, check_avatar, check_files, check_range
from .motion import Motion
from .recognise import load_map
from .skeletons import SKELETONS

__all__ = ["convert_file"]


def convert_file(
    source: File,
    target: File,
    *,
    skeleton: str | None = None,
    fps: float | None = None,
    names: File | None = None,
    audio: File | None = None,
    camera: str | None = None,
    avatar: File | None = None,
) -> Motion:
    """Read a motion file and write it in another format; what was written is returned.

    Args:
        source, target: motion files; the suffixes pick the formats.
        skeleton: retarget to this one first.
        fps: resample to this rate first.
        names: a TOML file that says which joint of ``source`` is which of ours.
        audio: the speech, for pictures.
        camera: for pictures, the name of a view: ``body``, ``full``, ``face`` or ``hands``.
        avatar: a VRM or GLB character for ``.glb``.

    Raises:
        InputError: a file cannot be read or written, or the skeleton is not recognised.
    """
    format_of(target)
    inputs = [path for path in (names, audio, avatar) if path]
    check_files(source, [Path(target)], inputs, None)
    if fps is not None:
        check_range("fps", fps, FPS_RANGE)
    if skeleton is not None and skeleton not in SKELETONS:
        raise InputError(f"no skeleton is called {skeleton!r}", nearest(skeleton, SKELETONS))
    motion = load(source)
    options: dict[str, object] = {}
    if skeleton is not None or names is not None:
        motion = motion.retarget(skeleton or "humanoid", bone_map=load_map(names) if names else None)
    if fps is not None:
        motion = motion.resample(fps)
    if audio is not None:
        options["audio"] = audio
    if camera is not None:
        options["camera"] = camera
    if avatar is not None:
        check_avatar(avatar, {Path(target).suffix.lower()})
        options["avatar"] = avatar
    motion.save(target, **options)
    return motion
