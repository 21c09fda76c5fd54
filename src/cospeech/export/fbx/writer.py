"""FBX, binary, version 7.4: our mannequin or somebody's character, moving; or the bones of another skeleton without a figure.

Autodesk's Maya, 3ds Max and MotionBuilder, Unreal, Unity and Blender read it. Our files are in centimetres, Y up; the character
faces +Z, and its pose without animation is the T-pose. With another skeleton than ours, the file holds its bones, and the 52
weights of a face as properties of the root bone, with ARKit's names: Unreal turns those into curves. A character that is an FBX
itself is copied with all that it has; only its clips are replaced by ours.
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Any, BinaryIO

from ... import __version__
from ...motion.motion import Motion
from .. import Writer as BaseWriter
from ..avatar import Avatar, load_avatar
from ..glb import load
from .character_copy import CharacterCopy
from .curve_writer import FrameRecorder
from .figure import FbxFigure
from .node_writer import CREATION_TIME, FILE_ID, VERSION, Long, NodeWriter
from .scene_writer import SceneWriter
from .time_modes import find_mode

__all__ = ["Writer", "load"]

_NAME = "speech"  # of the animation, as in our GLB
_MOVING = ("Model", "AnimationStack", "AnimationLayer", "AnimationCurveNode", "AnimationCurve")  # kinds of objects
_CREATION_DATE = (1970, 1, 1, 10, 0, 0)  # as `CREATION_TIME`


class Writer(BaseWriter):
    """Writes an ``.fbx``; frames wait in a temporary file, so that hours of motion fit in memory.

    Args:
        skeleton: ours gets the mannequin; another is written as bones alone.
        avatar: somebody's character in place of both: an ``.fbx`` file, or one that `load_avatar` has read.

    Raises:
        InputError: the avatar is no FBX.
    """

    _recorder: FrameRecorder | None = None

    def __init__(self, path: str | PathLike[str], *, avatar: Avatar | str | PathLike[str] | None = None, **common: Any) -> None:
        super().__init__(path, **common)
        self._subject: FbxFigure | CharacterCopy
        if avatar is None:
            self._subject = FbxFigure(self.skeleton)
        else:
            self._subject = CharacterCopy(avatar if isinstance(avatar, Avatar) else load_avatar(avatar))

    def _begin(self, temporary: Path) -> None:
        self._temporary = temporary
        self._recorder = FrameRecorder(self._subject.widths, self.fps, temporary.parent)

    def _write(self, motion: Motion) -> None:
        assert self._recorder is not None
        self._recorder.add(self._subject.rows(motion))

    def _finish(self) -> None:
        assert self._recorder is not None
        with self._temporary.open("wb") as file:
            self._write_file(file, self._recorder)

    def _write_file(self, file: BinaryIO, recorder: FrameRecorder) -> None:
        nodes = NodeWriter(file)
        scene = SceneWriter(nodes, self._subject.last_number)
        self._write_head(nodes, recorder.end)
        counts_at = file.tell()
        self._write_counts(nodes, scene)
        with nodes.node("Objects"):
            recorder.write_curves(nodes, scene, _NAME, self._subject.write(nodes, scene, _NAME))
        end = file.tell()
        file.seek(counts_at)
        self._write_counts(nodes, scene)  # as many bytes as before: now the counts are known
        file.seek(end)
        with nodes.node("Connections"):
            self._subject.write_connections(nodes)
            for connection in scene.connections:
                nodes.leaf("C", *connection)
        with nodes.node("Takes"):
            nodes.leaf("Current", _NAME)
            with nodes.node("Take", _NAME):
                nodes.leaf("FileName", f"{_NAME}.tak")
                for what in ("LocalTime", "ReferenceTime"):
                    nodes.leaf(what, Long(0), Long(recorder.end))
        nodes.finish()

    def _write_head(self, nodes: NodeWriter, end: int) -> None:
        """Everything before the counts of objects; the animation ends at ``end`` ticks."""
        creator = f"cospeech {__version__}"
        with nodes.node("FBXHeaderExtension"):
            nodes.leaf("FBXHeaderVersion", 1003)
            nodes.leaf("FBXVersion", VERSION)
            nodes.leaf("EncryptionType", 0)
            with nodes.node("CreationTimeStamp"):
                nodes.leaf("Version", 1000)
                for what, value in zip(("Year", "Month", "Day", "Hour", "Minute", "Second"), _CREATION_DATE, strict=True):
                    nodes.leaf(what, value)
                nodes.leaf("Millisecond", 0)
            nodes.leaf("Creator", creator)
        nodes.leaf("FileId", FILE_ID)
        nodes.leaf("CreationTime", CREATION_TIME)
        nodes.leaf("Creator", creator)
        mode, rate = find_mode(self.fps)
        with nodes.node("GlobalSettings"):
            nodes.leaf("Version", 1000)
            nodes.properties(
                *((name, "int", "Integer", "", value) for name, value in self._subject.axes.items()),
                ("UnitScaleFactor", "double", "Number", "", self._subject.unit),
                ("OriginalUnitScaleFactor", "double", "Number", "", self._subject.unit),
                ("TimeMode", "enum", "", "", mode), ("CustomFrameRate", "double", "Number", "", rate),
                ("TimeSpanStart", "KTime", "Time", "", Long(0)), ("TimeSpanStop", "KTime", "Time", "", Long(end)),
            )  # fmt: skip
        with nodes.node("Documents"):
            nodes.leaf("Count", 1)
            with nodes.node("Document", Long(1), "", "Scene"):
                nodes.properties(("ActiveAnimStackName", "KString", "", "", _NAME))
                nodes.leaf("RootNode", Long(0))
        with nodes.node("References"):
            pass

    def _write_counts(self, nodes: NodeWriter, scene: SceneWriter) -> None:
        kinds = dict.fromkeys((*_MOVING, *self._subject.kinds))
        counts = {"GlobalSettings": 1} | {kind: scene.counts.get(kind, 0) for kind in kinds}
        with nodes.node("Definitions"):
            nodes.leaf("Version", 100)
            nodes.leaf("Count", sum(counts.values()))
            for kind, count in counts.items():
                with nodes.node("ObjectType", kind):
                    nodes.leaf("Count", count)
                    for template in self._subject.templates.get(kind, ()):
                        nodes.copy(template)

    def _discard(self) -> None:
        if self._recorder is not None:
            self._recorder.close()
