"""Convert a motion file to another format, with edits: the call behind ``cospeech convert`` and ``cospeech render``."""

from __future__ import annotations

import shlex
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from .errors import CospeechWarning, InputError
from .export import FORMATS, check_parts, format_of, load, read, suffixes
from .export.checks import File, check_avatar, check_files, check_map, check_skeleton
from .export.clips import holds_other_figure
from .export.render.camera import find_view
from .export.sound_file import cut_sound_file
from .export.target_skeleton import rig_files
from .motion import edit
from .motion.bone_mapping import load_map, names_joints
from .motion.motion import Motion
from .motion.parts import PARTS
from .motion.skeleton import Skeleton
from .rules.options import FPS_RANGE, check_range

__all__ = ["Edits", "convert_file", "read_as_humanoid"]

_FACE_TOLERANCE = 0.1  # seconds by which a face may be shorter than a body without a note [ours: files round their rates]


@dataclass(frozen=True)
class Edits:
    """Edits of a motion between reading and writing, in this order; see `cospeech.motion.edit`."""

    continuations: tuple[File, ...] = ()
    """Motion files that follow the motion."""
    start: float | None = None
    """Begin of the stretch that stays, seconds."""
    end: float | None = None
    """End of the stretch that stays, seconds."""
    face: File | None = None
    """A motion file whose face replaces the motion's own."""
    mirror: bool = False
    """Whether left and right are exchanged."""
    loop: bool = False
    """Whether the end leads into the beginning."""
    blend: float | None = None
    """Seconds of a transition."""

    @property
    def files(self) -> list[File]:
        """Files that are read for the edits."""
        return [*self.continuations, *([self.face] if self.face is not None else [])]

    def apply(self, motion: Motion, source: File) -> Motion:
        """Edit a motion, and return the result.

        Args:
            motion: the motion to edit.
            source: its file, for messages.

        Raises:
            InputError: an edit is impossible with this motion.
        """
        if self.blend is not None:
            edit.check_blend(self.blend)
            if not self.continuations and not self.loop:
                warnings.warn("the blend changes nothing: it is for --join and --loop", CospeechWarning, stacklevel=2)
        if self.continuations:
            if self.end is not None and self.end * motion.fps <= len(motion):
                problem = f"--to {self.end:g} leaves nothing of what is joined: clips are joined before they are cut"
                warnings.warn(f"{problem}; cut {str(source)!r} first", CospeechWarning, stacklevel=2)
            motion = _join([(source, motion), *((path, load(path)) for path in self.continuations)], self.blend)
        if self.start is not None or self.end is not None:
            motion = edit.cut(motion, self.start, self.end)
        if self.face is not None:
            face = load(self.face)
            if face.duration < motion.duration - _FACE_TOLERANCE:
                problem = (
                    f"the face of {str(self.face)!r} ends at {face.duration:.4g} s, and rests until {motion.duration:.4g} s"
                )
                warnings.warn(problem, CospeechWarning, stacklevel=2)
            motion = edit.replace_face(motion, face)
        if self.mirror:
            skeleton = motion.skeleton
            motion = motion.mirror() if skeleton.kind == "humanoid" else motion.retarget("humanoid").mirror().retarget(skeleton)
        return edit.loop(motion, blend=self.blend) if self.loop else motion


def _join(clips: Sequence[tuple[File, Motion]], blend: float | None) -> Motion:
    """Join clips, one after the other.

    Raises:
        InputError: they have different skeletons; the hint is the command that retargets one of them.
    """
    (first, head), *others = clips
    for path, other in others:
        if other.skeleton != head.skeleton:
            foreign = next((each for each, clip in clips if clip.skeleton.kind != "humanoid"), path)
            target = Path(foreign).with_name(f"{Path(foreign).stem}-humanoid.bvh")
            raise InputError(
                f"{str(first)!r} and {str(path)!r} have different skeletons, and cannot be joined",
                f"retarget first: cospeech convert {shlex.quote(str(foreign))} {shlex.quote(str(target))} --skeleton humanoid; "
                f"then name {shlex.quote(str(target))} in its place",
            )
    return edit.join([motion for _, motion in clips], blend=blend)


def convert_file(
    source: File,
    target: File,
    *,
    skeleton: File | Skeleton | None = None,
    fps: float | None = None,
    names: File | None = None,
    audio: File | None = None,
    camera: str | None = None,
    avatar: File | None = None,
    clip: str | int | None = None,
    edits: Edits | None = None,
) -> Motion:
    """Read a motion file, write it in another format, and return the written motion.

    Args:
        source, target: motion files; the suffixes choose the formats.
        skeleton: retarget to this one first: a name, or the file of a rig (``my_rig.bvh``, ``.glb``, ``.vrm``).
        fps: resample to this rate first.
        names: a TOML file that says which joint of ``source``, of the rig or of the avatar is which of ours.
        audio: the speech, for pictures; if ``edits`` cut the motion, the sound is cut in the same way.
        camera: for pictures, the name of a view: ``body``, ``full``, ``face`` or ``hands``.
        avatar: a VRM, GLB or FBX character for ``.glb`` and for pictures, or an FBX for ``.fbx``, in place of our mannequin.
        clip: one of several animations of ``source``: its name, or its number from 0; the default is the first.
        edits: edits of the motion before everything else.

    Raises:
        InputError: a file cannot be read or written, or the skeleton is not recognised.
    """
    target_format, edits = format_of(target), edits or Edits()
    inputs = [*(path for path in (names, audio, avatar) if path), *rig_files(skeleton), *edits.files]
    check_files(source, [Path(target)], inputs, None)
    if fps is not None:
        check_range("fps", fps, FPS_RANGE)
    if camera is not None:
        find_view(camera)
    bones = load_map(names) if names else None
    goal = None if skeleton is None else check_skeleton(skeleton, {Path(target).suffix.lower()}, bones)
    character = None if avatar is None else check_avatar(avatar, {Path(target).suffix.lower()}, bones)
    motion = edits.apply(_read(source, bones, clip), source)
    holds = {*format_of(source).holds} | ({"face"} if edits.face is not None else set())
    parts = [part for part in PARTS if part in holds and (part != "face" or motion.face is not None)]
    check_parts(target, parts, f"{str(source)!r} holds")
    options: dict[str, object] = {}
    if "body" not in parts and target_format.picture:
        if camera not in (None, "face"):
            raise InputError(f"camera {camera!r} would show nothing that moves: {str(source)!r} holds a face only", "face does")
        options["camera"] = "face"
    if bones and ("body" in parts or goal or character):
        check_map(bones, {str(source): motion.skeleton} | ({} if goal is None else {str(skeleton): goal}), character)
    elif names is not None:
        warnings.warn(f"the map changes nothing: {str(source)!r} has no joints", CospeechWarning, stacklevel=2)
    _note_losses(source, target, audio=audio is not None, face=edits.face is not None, avatar=character is not None)
    bone_map = bones if bones and names_joints(bones, motion.skeleton) else None
    if goal is not None or bone_map:
        motion = motion.retarget(goal or "humanoid", bone_map=bone_map)
    if fps is not None:
        motion = motion.resample(fps)
    if camera is not None:
        options["camera"] = camera
    if character is not None:
        options["avatar"] = character
    if target_format.sound == "drawn" and edits.start is not None:
        options["start"] = motion.start
    with _cut_sound(audio, edits, motion.start) as sound:
        if sound is not None:
            options["audio"] = sound
        motion.save(target, **options)
    return motion


@contextmanager
def _cut_sound(audio: File | None, edits: Edits, start: float) -> Iterator[File | None]:
    """Yield a file of the speech that fits the edited motion; None if none of the speech is left.

    The sound begins with the first frame that is left, at ``start`` seconds.
    """
    if audio is None or (edits.start is None and edits.end is None):
        yield audio
        return
    with cut_sound_file(audio, start, edits.end) as path:
        yield path


def read_as_humanoid(source: File, bones: Mapping[str, str] | None = None) -> Motion:
    """Read the motion of a file, and retarget it to our humanoid if a map is given.

    Args:
        source: a motion file.
        bones: our name → name of a joint of ``source``.

    Raises:
        InputError: the file cannot be read, or the map is not of its joints.
    """
    motion = _read(source, bones, None)
    if not bones:
        return motion
    check_map(bones, {str(source): motion.skeleton}, None)
    return motion.retarget("humanoid", bone_map=bones)


def _note_losses(source: File, target: File, *, audio: bool, face: bool, avatar: bool) -> None:
    """Warn if the target holds no speech, no face, or not the figure of the source, although it was given."""
    target_format, suffix, problems = format_of(target), Path(target).suffix.lower(), list[str]()
    if audio and target_format.picture and not target_format.sound:
        problems.append(f"the speech changes nothing: a {suffix} has neither sound nor a waveform")
    if face and "face" not in target_format.holds:
        problems.append(f"the face changes nothing: a {suffix} holds none")
    if not avatar and (target_format.picture or suffix == ".glb") and holds_other_figure(source):
        problem = f"{str(target)!r} shows our mannequin: the figure of {str(source)!r} is not taken over"
        problems.append(f"{problem} (--avatar {source} does; avatar= in Python)")
    for problem in problems:
        warnings.warn(problem, CospeechWarning, stacklevel=3)


def _read(source: File, bones: Mapping[str, str] | None, clip: str | int | None) -> Motion:
    """Read the motion of a file; a map and the name of a clip are passed to its reader if the reader takes them."""
    entry = FORMATS.get(Path(source).suffix.lower())
    options: dict[str, object] = {}
    if clip is not None:
        if entry is None or not entry.clips:
            holders = " ".join(suffixes(lambda entry: entry.clips))
            raise InputError(f"{str(source)!r} has no clips to choose from", f"{holders} files have")
        options["animation"] = clip
    if bones and entry is not None and (entry.any_skeleton or entry.clips):
        options["bone_map"] = bones
    return read(source, **options)  # the map may be that of the target
