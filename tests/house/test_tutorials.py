"""The tutorials, typed from the first line to the last; what they write is opened in Blender where there is one."""

from __future__ import annotations

import json
import subprocess

import pytest
import soundfile

from cospeech.cli.demo import EXAMPLE
from cospeech.motion.motion import Motion
from cospeech.motion.skeletons.arkit import ARKIT
from tests.house.test_docs import ROOT, commands, fences, run

pytestmark = pytest.mark.slow

VOICE = ROOT / "docs" / "tutorials" / "voice_to_blender.md"
CHECK = """
import json
armatures = [o for o in bpy.data.objects if o.type == "ARMATURE"]
keys = [[k.name for k in o.data.shape_keys.key_blocks][1:] for o in bpy.data.objects if o.type == "MESH" and o.data.shape_keys]
print("RESULT " + json.dumps({"armatures": len(armatures), "keys": keys, "end": scene.frame_end, "fps": scene.render.fps}))
"""


@pytest.fixture(scope="module")
def tutorial_folder(tmp_path_factory):
    """A folder in which a reader has recorded two seconds and typed every command of the tutorial, in its order."""
    place = tmp_path_factory.mktemp("tutorial")
    soundfile.write(place / "talk.wav", *soundfile.read(EXAMPLE, frames=48_000))
    (place / "talk.txt").write_text("hello all of you\n")
    for line in commands(VOICE):
        if ".mp4" in line:
            pytest.importorskip("av", reason="a video needs PyAV (cospeech[av])")
        run(line, place)
    return place


def test_the_voice_tutorial_gives_a_character(tutorial_folder):
    for name in ("talk.png", "talk.mp4", "lively.png", "words.png"):
        assert (tutorial_folder / name).stat().st_size > 1000
    rate, samples = soundfile.info(tutorial_folder / "talk.wav").samplerate, 48_000
    frames = -(-samples * 30 // rate)
    assert len(Motion.load(tutorial_folder / "talk.bvh")) == len(Motion.load(tutorial_folder / "talk.glb")) == frames


def test_the_voice_tutorial_opens_in_blender(tutorial_folder, blender_python):
    (script,) = fences(VOICE, "python")
    empty = script.replace("import bpy\n", "import bpy\nbpy.ops.wm.read_factory_settings(use_empty=True)\n", 1)
    process = subprocess.run(
        [blender_python, "-c", empty + CHECK], cwd=tutorial_folder, capture_output=True, text=True, timeout=300, check=False
    )
    lines = [line for line in process.stdout.splitlines() if line.startswith("RESULT ")]
    assert lines, (process.stdout + process.stderr)[-3000:]
    result = json.loads(lines[0].removeprefix("RESULT "))
    assert result == {
        "armatures": 1,
        "keys": [list(ARKIT)],
        "end": len(Motion.load(tutorial_folder / "talk.bvh")) - 1,
        "fps": 30,
    }
