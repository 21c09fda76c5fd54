"""The table of formats: one row with all facts about each format, for all other modules.

Nothing heavy is imported here: the command line's help is made from it.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from ..errors import InputError
from ..motion.parts import PARTS
from .plugins import Registry, check_row

__all__ = ["FORMATS", "Format", "check_parts", "format_of", "reads_body", "suffixes"]


@dataclass(frozen=True)
class Format:
    """A row of the table of formats."""

    module: str
    """Has the class ``Writer`` and, where the format can be read, the function ``load``."""
    what: str
    """One line of description."""
    opens: str
    """Programs that open such a file, and how; printed after each run."""
    readable: bool = False
    holds: tuple[str, ...] = PARTS
    """Parts of a character."""
    any_skeleton: bool = False
    """Whether a file holds any skeleton as it is; the other formats prescribe theirs. ``load`` then has ``bone_map``."""
    wears_avatar: bool = False
    """Whether somebody's character can take the place of ours: the Writer has the keyword ``avatar``."""
    clips: bool = False
    """Whether a file holds a character with any joints and clips: ``load`` then has ``bone_map`` and ``animation``."""
    picture: bool = False
    """Whether it is drawn: the Writer has the keywords of `cospeech.export.pictures.render_motion`."""
    sound: str = ""
    """What the file does with the speech: it is "heard" or "drawn"; empty: neither."""
    words: bool = False
    """Whether words are drawn: the Writer has the keyword ``words``."""
    needs: str = ""
    """The module that it needs, and that an extra installs."""

    def __post_init__(self) -> None:
        check_row(self, ("module", "what", "opens", "sound", "needs"), {"holds": PARTS})
        if not self.holds:
            raise InputError("holds of a Format is ()", f"a tuple of some of {', '.join(PARTS)}")


_OURS = {
    ".bvh": Format(
        "cospeech.export.bvh", "skeleton animation: centimetres and a T-pose, or as in your rig's file",
        "Blender: File > Import > Motion Capture (.bvh), Scale 0.01 (or the rig's), tick Update Scene FPS; "
        "or MotionBuilder, Maya, iClone",
        readable=True, holds=("body", "hands"), any_skeleton=True,
    ),
    ".glb": Format(
        "cospeech.export.glb", "animated character with skin and 52 morph targets",
        "Blender: File > Import > glTF 2.0; Windows: 3D Viewer; Unity, Unreal, Godot: drop it into the project",
        readable=True, wears_avatar=True, clips=True,
    ),
    ".fbx": Format(
        "cospeech.export.fbx.writer", "animated character with skin and 52 blendshapes, or the bones of your rig",
        "Unreal, Unity: drop it into the project; Maya, MotionBuilder, 3ds Max, Blender: File > Import > FBX",
        readable=True, any_skeleton=True, wears_avatar=True, clips=True,
    ),
    ".vrma": Format(
        "cospeech.export.vrma", "VRM animation 1.0, for any VRM avatar",
        "play it on any VRM avatar: three-vrm, UniVRM, VRM add-on for Blender", readable=True,
    ),
    ".csv": Format(
        "cospeech.export.live_link_csv", "Live Link Face recording, 61 channels",
        "Unreal: plugin Live Link Face Importer, then drop it into the Content Browser; Blender: Faceit",
        readable=True, holds=("face",),
    ),
    ".json": Format(
        "cospeech.export.arkit_json", "ARKit-52 weights in BEAT's face layout",
        "52 ARKit weights per frame, for your own program", readable=True, holds=("face",),
    ),
    ".npz": Format(
        "cospeech.export.npz", "SMPL-X poses in BEAT2's layout",
        "SMPL-X: numpy.load, or the SMPL-X add-on for Blender", readable=True,
    ),
    ".mp4": Format(
        "cospeech.export.mp4", "preview video with the speech", "any video player",
        wears_avatar=True, picture=True, sound="heard", needs="av",
    ),
    ".gif": Format("cospeech.export.gif", "animated preview picture", "any web browser", wears_avatar=True, picture=True),
    ".png": Format(
        "cospeech.export.png", "strip of frames with the waveform", "any picture viewer: a strip of frames",
        wears_avatar=True, picture=True, sound="drawn", words=True,
    ),
    ".html": Format(
        "cospeech.export.html_page", "viewer, character and speech in one page", "any web browser; it needs no network",
        wears_avatar=True, sound="heard",
    ),
}  # fmt: skip
FORMATS: Registry[Format] = Registry(_OURS, group="cospeech.formats", kind=Format, prefix=".")
"""Suffix → row, those of other packages too; `cospeech list formats`, the documentation and the tests iterate over it."""


def suffixes(has: Callable[[Format], bool]) -> list[str]:
    """Suffixes of the formats for which ``has`` is true, in the order of the table."""
    return [suffix for suffix in FORMATS if has(FORMATS[suffix])]


_ELSEWHERE = {".vrm": "a .vrm is a character without motion; motion for it is a .vrma, or a .glb that shows it"}
"""Suffix of files that people take for motion → the hint."""


def format_of(path: str | PathLike[str]) -> Format:
    """Look up the format of ``path`` by its suffix.

    Raises:
        InputError: unknown suffix; the message lists those that are known.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in FORMATS:
        hint = _ELSEWHERE.get(suffix) or f"known suffixes: {' '.join(FORMATS)}"
        if suffix.endswith("'") and suffix[:-1] in FORMATS:
            hint = "to cmd.exe of Windows, single quotes are part of a name: use double quotes"
        raise InputError(f"cannot tell the format of {str(path)!r}", hint)
    return FORMATS[suffix]


def reads_body(entry: Format) -> bool:
    """Whether motion of a body can be read from its files."""
    return entry.readable and "body" in entry.holds


def check_parts(path: str | PathLike[str], parts: Collection[str], whose: str) -> None:
    """Check that a file can show at least one of some parts of a character.

    Args:
        path: of the file to be.
        parts: the parts to show, of face, body and hands.
        whose: the beginning of the message: ``"--parts face makes"``, say.

    Raises:
        InputError: its format holds none of them; the message names those that do.
    """
    holds = format_of(path).holds
    if not {*parts} & {*holds}:
        fit = " ".join(suffixes(lambda entry: bool({*parts} & {*entry.holds})))
        suffix, content = Path(path).suffix, _join_names(holds)
        problem = f"{str(path)!r} would not move: {whose} {_join_names(parts)} only, {suffix} files hold {content}"
        raise InputError(problem, f"for {_join_names(parts)}: {fit}")


def _join_names(parts: Collection[str]) -> str:
    return " and ".join(parts)
