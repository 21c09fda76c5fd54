"""Convert a recording to files for animation programs, in constant memory, with two takes to choose from."""

import sys
import tempfile
from pathlib import Path

from cospeech.cli.demo import EXAMPLE
from cospeech.generate import generate_files

audio = Path(sys.argv[1]) if len(sys.argv) > 1 else EXAMPLE

with tempfile.TemporaryDirectory() as folder:
    outputs = [Path(folder) / name for name in ("talk.bvh", "talk.glb", "talk.vrma")]
    report = generate_files(audio, outputs, style="lively", takes=2, seed=7)
    for name in report.outputs:
        print(f"{Path(name).name}: {Path(name).stat().st_size / 1000:.0f} kB")

feeling = max(report.emotion, key=report.emotion.__getitem__)
print(f"{report.frames} frames at {report.fps:g} fps for {report.speech_seconds:.2f} s of speech that sounds like {feeling}")
