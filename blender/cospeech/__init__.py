"""Blender add-on: a sound strip becomes an action of the selected armature, made by cospeech."""

from __future__ import annotations

import importlib.util
import json
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np
from bpy.props import EnumProperty, FloatProperty, IntProperty, StringProperty

from .bvh import read_bvh, rig_to_bvh
from .errors import CospeechError
from .rig import Rig, check_tweaks, key_shapes

bl_info = {"name": "cospeech", "blender": (4, 4, 0), "category": "Animation", "version": (0, 1, 0)}

EMOTIONS = ("auto", "neutral", "happiness", "anger", "sadness", "contempt", "surprise", "fear", "disgust")
LONGEST = 3600  # seconds of work after which something must be wrong


class CospeechPreferences(bpy.types.AddonPreferences):
    """Where cospeech is."""

    bl_idname = __package__
    command: StringProperty(  # type: ignore[valid-type]
        name="Command", description="How to start cospeech; empty: it is looked for", default=""
    )

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.prop(self, "command")


def find_command(setting: str) -> list[str]:
    """How to start cospeech: by the setting; else with Blender's own Python, if the wheel is there; else by the PATH."""
    setting = setting.strip()
    if setting and Path(setting).expanduser().is_file():  # a path may hold blanks, and backslashes on Windows
        return [str(Path(setting).expanduser())]
    if setting:
        try:
            return [part.strip('"') for part in shlex.split(setting, posix=os.name != "nt")]
        except ValueError as error:
            raise CospeechError(f"the command {setting!r} cannot be read: {error}") from None
    if importlib.util.find_spec("cospeech") is not None:
        return [sys.executable, "-m", "cospeech"]
    path = shutil.which("cospeech")
    if path is None:
        raise CospeechError("cospeech is not found: name its command in the preferences of the add-on")
    return [path]


def run(command: list[str], *arguments: object) -> list[str]:
    """Run a command of cospeech; its notes."""
    try:
        process = subprocess.run(
            [*command, *map(str, arguments)], capture_output=True, encoding="utf-8", errors="replace", timeout=LONGEST,
            env=os.environ | {"PYTHONIOENCODING": "utf-8"}, creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired) as error:
        raise CospeechError(f"{command[0]} cannot be run: {error}") from None
    if process.returncode:
        lines = [line for line in process.stderr.splitlines() if line.startswith("error: ")]
        text = process.stderr[-300:].strip() or f"{command[0]} ended with {process.returncode} and said nothing"
        raise CospeechError(lines[-1].removeprefix("error: ") if lines else f"cospeech failed: {text}")
    return [line.removeprefix("note: ") for line in process.stderr.splitlines() if line.startswith("note: ")]


def sound_strips(scene: bpy.types.Scene) -> list[bpy.types.Strip]:
    """The sound strips of the scene's sequencer, in time."""
    editor = scene.sequence_editor
    strips = [] if editor is None else [strip for strip in editor.strips_all if strip.type == "SOUND"]
    return sorted(strips, key=lambda strip: (strip.frame_start, strip.name))


def sequencer_scene(context: bpy.types.Context) -> bpy.types.Scene:
    """Whose sequencer is shown: Blender 5 lets a workspace choose it."""
    return getattr(context, "sequencer_scene", None) or context.scene


def _find_strips(self: object, context: bpy.types.Context, text: str) -> list[str]:
    return [strip.name for strip in sound_strips(sequencer_scene(context)) if text.lower() in strip.name.lower()]


class CospeechSettings(bpy.types.PropertyGroup):
    """What the panel shows."""

    strip: StringProperty(  # type: ignore[valid-type]  # a menu would keep the number of a strip, which changes
        name="Sound", description="A sound strip of the sequencer; empty: the first one", default="", search=_find_strips
    )
    model: StringProperty(name="Model", default="rules")  # type: ignore[valid-type]
    style: StringProperty(name="Style", description="Empty: that of the model", default="")  # type: ignore[valid-type]
    emotion: EnumProperty(name="Emotion", items=[(name, name, "") for name in EMOTIONS])  # type: ignore[valid-type]
    seed: IntProperty(name="Seed", min=0, default=0)  # type: ignore[valid-type]
    intensity: FloatProperty(name="Intensity", min=0, max=2, default=1)  # type: ignore[valid-type]
    plan: StringProperty(  # type: ignore[valid-type]
        name="Plan", description="Plan of gestures (.json) to play; empty: none", subtype="FILE_PATH", default=""
    )
    transcript: StringProperty(  # type: ignore[valid-type]
        name="Transcript",
        description="Words of the sound, with times or without; empty: none",
        subtype="FILE_PATH",
        default="",
    )


class CospeechGenerate(bpy.types.Operator):
    """Make an action for the selected armature from a sound strip"""  # Blender shows it as the tip of the button

    bl_idname = "cospeech.generate"
    bl_label = "Generate"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012  # as Blender reads it
    command: StringProperty(default="", options={"HIDDEN", "SKIP_SAVE"})  # type: ignore[valid-type]

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.object is not None and context.object.type == "ARMATURE" and bool(sound_strips(sequencer_scene(context)))

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            summary, notes = make_action(context, context.object, self.command)
        except CospeechError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        for note in notes:
            self.report({"WARNING"}, note)
        self.report({"INFO"}, summary)
        return {"FINISHED"}


def make_action(context: bpy.types.Context, armature: bpy.types.Object, command: str) -> tuple[str, list[str]]:
    """Generate motion and key it; returns a summary, and the notes of cospeech.

    Args:
        context: with the scene and its settings.
        armature: gets the action.
        command: how to start cospeech; that of the preferences, if empty.
    """
    scene, settings = context.scene, context.scene.cospeech
    check_tweaks(armature)
    strips = {strip.name: strip for strip in sound_strips(sequencer_scene(context))}
    if settings.strip and settings.strip not in strips:
        raise CospeechError(f"there is no sound strip {settings.strip!r}: choose another one")
    strip = strips[settings.strip] if settings.strip else next(iter(strips.values()))
    addon = context.preferences.addons.get(__package__)
    start = find_command(command or (addon.preferences.command if addon else ""))
    fps = scene.render.fps / scene.render.fps_base
    with tempfile.TemporaryDirectory(prefix="cospeech-") as folder:
        place = Path(folder)
        sound = _sound_file(strip, place)
        rig = Rig(armature)
        text = rig_to_bvh(rig.names, rig.parents, rig.points("head"), rig.points("tail"))
        (place / "rig.bvh").write_text(text, "utf-8")
        run(start, "convert", place / "rig.bvh", place / "rest.bvh", "--quiet")
        options = ["--model", settings.model, "--fps", f"{fps:.6g}", "--skeleton", place / "rig.bvh", "--quiet"]
        if settings.plan:
            options += ["--plan", bpy.path.abspath(settings.plan)]
        else:
            options += ["--emotion", settings.emotion, "--seed", settings.seed, "--intensity", f"{settings.intensity:.6g}"]
            options += ["--style", settings.style] if settings.style else []
        if settings.transcript:
            options += ["--transcript", bpy.path.abspath(settings.transcript)]
        notes = run(start, "generate", sound, "-o", place / "motion.bvh", "-o", place / "face.json", *options)
        if not (place / "face.json").is_file():
            raise CospeechError(f"{start[0]} wrote no motion: is it cospeech?")
        motion, rest = (read_bvh((place / name).read_text("utf-8")) for name in ("motion.bvh", "rest.bvh"))
        face = json.loads((place / "face.json").read_text("utf-8"))
    action = bpy.data.actions.new(f"{Path(sound).stem} {settings.style or settings.model}")
    weights = np.array([frame["weights"] for frame in face["frames"]])
    count, looks = key_shapes(armature, face["names"], weights, action.name, strip.frame_start)
    rig.key(motion, rest, action, strip.frame_start, looks=looks)
    if bones := rig.constrained:
        notes.append(f"constraints of these bones may change the motion: {', '.join(bones)[:200]}")
    return f"{len(motion.rotations)} frames for {len(rig.names)} bones and {count} shape keys: {action.name}", notes


def _sound_file(strip: bpy.types.Strip, place: Path) -> Path:
    """The file of a strip's sound; a packed one is written out."""
    sound = strip.sound
    if sound is None:
        raise CospeechError(f"the strip {strip.name!r} has no sound")
    if sound.packed_file is not None:
        path = place / f"sound{Path(sound.filepath).suffix or '.wav'}"
        path.write_bytes(sound.packed_file.data)
        return path
    path = Path(bpy.path.abspath(sound.filepath, library=sound.library))
    if not path.is_file():
        raise CospeechError(f"the file of the strip {strip.name!r} is not there: {path}")
    return path


class CospeechPanel(bpy.types.Panel):
    """In the sidebar of the 3D view."""

    bl_idname = "VIEW3D_PT_cospeech"
    bl_label = "cospeech"
    bl_space_type, bl_region_type, bl_category = "VIEW_3D", "UI", "cospeech"

    def draw(self, context: bpy.types.Context) -> None:
        for name in ("strip", "model", "style", "emotion", "seed", "intensity", "transcript", "plan"):
            self.layout.prop(context.scene.cospeech, name)
        self.layout.operator(CospeechGenerate.bl_idname)


CLASSES = (CospeechPreferences, CospeechSettings, CospeechGenerate, CospeechPanel)


def register() -> None:
    """Called by Blender when the add-on is switched on."""
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.Scene.cospeech = bpy.props.PointerProperty(type=CospeechSettings)


def unregister() -> None:
    """Called by Blender when it is switched off."""
    del bpy.types.Scene.cospeech
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
