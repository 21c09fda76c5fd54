"""Render motion files as comparable videos: with one length, rate, camera and loudness, and faces in all or in none.

Any other difference between clips would tell raters which system they see.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...audio.level import loudest_level
from ...audio.speech import Speech
from ...errors import CospeechWarning, InputError
from ...export import load
from ...export.render.camera import View, find_view
from ...export.render.framing import PoseStage, box_of
from ...export.sound_file import as_sound_file
from ...export.to_humanoid import as_humanoid
from ...motion import edit
from ...motion.motion import Motion

__all__ = ["FACES", "FPS", "StudyScene", "find_speech", "render_scenes"]

SOUNDS = (".wav", ".flac", ".ogg", ".mp3", ".aiff", ".m4a")
FPS = 30.0
"""Pictures per second of a study's videos [ours: the rate of most systems]."""
FACES = ("auto", "show", "hide")
"""How faces are treated: ``auto`` hides them if a clip has none."""
LEVEL = -16.0
"""Level of the loudest .4 s of every speech, dB of full scale [ours: that of speech at about −23 LUFS, as in broadcasts]."""
_PEAK = 0.99  # highest peak to which a speech is amplified, of full scale [ours]
_RATE = 48_000  # Hz of the sound in videos
_SHORT = 0.1  # seconds by which a motion may be shorter than its speech without a note [ours: files round their ends]


class StudyScene(NamedTuple):
    """A video to render.

    Args:
        motion: its motion file.
        stimulus: name of the speech that is heard.
        target: the video.
    """

    motion: Path
    stimulus: str
    target: Path


def find_speech(source: Path, folder: Path | None) -> Path:
    """Find the sound file of a motion file: it has the same name, and is beside it or in the folder of the speech.

    Raises:
        InputError: there is none.
    """
    candidates = [(folder or source.parent) / f"{source.stem}{suffix}" for suffix in SOUNDS]
    if path := next((path for path in candidates if path.is_file()), None):
        return path
    raise InputError(f"no speech for {str(source)!r}", "--speech FOLDER with sound files of the same names, or --variant mute")


def render_scenes(
    scenes: Sequence[StudyScene],
    voices: Mapping[str, Path],
    *,
    camera: str,
    faces: str = "auto",
    fps: float = FPS,
    progress: Callable[[], None] | None = None,
) -> None:
    """Render motion files as videos in which only the motion differs.

    Args:
        scenes: what to render. All scenes of a speech get the length of the shortest of them, or of the speech.
        voices: speech → sound file; the videos of other speeches have no sound.
        camera: name of a view; the camera stands still, and is the same in all videos.
        faces: one of `FACES`.
        fps: pictures per second.
        progress: called after each video.

    Raises:
        InputError: a file cannot be read.
    """
    motions = {path: as_humanoid(load(path)).resample(fps) for path in dict.fromkeys(scene.motion for scene in scenes)}
    sounds = {name: Speech.load(path, rate=_RATE) for name, path in voices.items()}
    motions = _treat_faces(motions, faces)
    lengths = _find_lengths(scenes, motions, sounds)
    cut = {(scene.motion, scene.stimulus): _cut(motions[scene.motion], lengths[scene.stimulus]) for scene in scenes}
    view = _fit_camera(find_view(camera), list(cut.values()))
    with ExitStack() as stack:
        sound_files = {
            name: stack.enter_context(as_sound_file(_level(speech.window(0.0, lengths[name]))))
            for name, speech in sounds.items()
        }
        for scene in scenes:
            options = {"audio": sound_files[scene.stimulus]} if scene.stimulus in sound_files else {}
            cut[scene.motion, scene.stimulus].save(scene.target, camera=view, **options)
            if progress is not None:
                progress()


def _treat_faces(motions: Mapping[Path, Motion], faces: str) -> dict[Path, Motion]:
    """The motions with or without their faces; a note tells if faces are hidden because some have none."""
    without = [path for path, motion in motions.items() if motion.face is None]
    if faces == "show" or len(without) == len(motions) or (faces == "auto" and not without):
        return dict(motions)
    if faces == "auto":
        problem = f"faces are hidden in all clips, because {str(without[0])!r} has none (--faces show keeps the others)"
        warnings.warn(problem, CospeechWarning, stacklevel=3)
    return {path: replace(motion, face=None) for path, motion in motions.items()}


def _find_lengths(
    scenes: Sequence[StudyScene], motions: Mapping[Path, Motion], sounds: Mapping[str, Speech]
) -> dict[str, float]:
    """Speech → length of all its videos in seconds."""
    lengths: dict[str, float] = {}
    for name in dict.fromkeys(scene.stimulus for scene in scenes):
        own = [scene.motion for scene in scenes if scene.stimulus == name]
        lengths[name] = float(min(motions[path].duration for path in own))
        if name in sounds:
            seconds = float(sounds[name].duration)
            for path in own:  # motion of another speech may be shorter, and nothing is wrong
                if path.stem == name and motions[path].duration == lengths[name] < seconds - _SHORT:
                    problem = (
                        f"clips of {name!r} end at {lengths[name]:.4g} s, with {str(path)!r}; its speech has {seconds:.4g} s"
                    )
                    warnings.warn(problem, CospeechWarning, stacklevel=3)
                    break
            lengths[name] = min(lengths[name], seconds)
    return lengths


def _cut(motion: Motion, seconds: float) -> Motion:
    """Cut the beginning of a motion, to the nearest frame."""
    return edit.cut(motion, None, seconds) if round(seconds * motion.fps) < len(motion) else motion


def _fit_camera(view: View, motions: Sequence[Motion]) -> View:
    """The view with room for its joints in all of the motions, so that the camera does not have to move."""
    if view.follows:
        return view
    boxes = []
    for motion in motions:
        stage = PoseStage(motion.skeleton, motion.fps)
        boxes.append(box_of(view, motion.skeleton, stage.place(motion).positions))
    low, high = np.min([box[:3] for box in boxes], 0), np.max([box[3:] for box in boxes], 0)
    return replace(view, low=tuple(low.tolist()), high=tuple(high.tolist()))


def _level(speech: Speech) -> Speech:
    """Amplify a speech to `LEVEL`, or as near to it as its peaks allow."""
    level, peak = loudest_level(speech), float(np.abs(speech.samples).max(initial=0.0))
    if not np.isfinite(level) or peak == 0:
        return speech
    gain = min(10 ** ((LEVEL - level) / 20), _PEAK / peak)
    return Speech((speech.samples * np.float32(gain)).astype(np.float32), speech.rate)
