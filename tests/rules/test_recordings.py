"""The gesturer on real recordings: every file of the shared speech, where there is one."""

from __future__ import annotations

import os
import subprocess
import sys
from hashlib import sha256
from math import ceil
from pathlib import Path

import numpy as np
import pytest
import soundfile

from cospeech import Speech, humanoid
from cospeech.rules import RuleBasedModel

SUFFIXES = {".flac", ".wav", ".ogg", ".mp3"}


def recordings(shared_folder: Path) -> list[Path]:
    return sorted(p for p in (shared_folder / "data" / "speech").rglob("*") if p.suffix in SUFFIXES)


def test_every_recording_gives_motion_of_its_exact_length(shared_folder):
    files = recordings(shared_folder)
    assert len(files) > 40
    for path in files:
        info = soundfile.info(path)
        assert len(RuleBasedModel().generate(Speech.load(path), seed=7)) == ceil(info.frames * 30 / info.samplerate), path.name


def test_a_seed_gives_the_same_bytes_and_another_seed_other_motion(shared_folder):
    """The test takes every fourth recording, because each needs three performances."""
    hands = [humanoid().index["leftHand"], humanoid().index["rightHand"]]
    for path in recordings(shared_folder)[::4]:
        speech = Speech.load(path)
        first, second, other = (RuleBasedModel().generate(speech, seed=seed) for seed in (7, 7, 8))
        assert first.rotations.tobytes() == second.rotations.tobytes(), path.name
        assert first.face.tobytes() == second.face.tobytes(), path.name
        apart = first.positions()[:, hands] - other.positions()[:, hands]
        assert np.linalg.norm(apart, axis=-1).mean() > 0.03, path.name


PROGRAM = """
import sys, hashlib
from cospeech import Speech
from cospeech.rules import RuleBasedModel
m = RuleBasedModel().generate(Speech.load(sys.argv[1]), seed=3)
print(hashlib.sha256(m.rotations.tobytes() + m.root.tobytes() + m.face.tobytes()).hexdigest())
"""


@pytest.mark.parametrize("threads", ["1", "2"])
def test_the_number_of_threads_changes_nothing(shared_folder, threads):
    path = shared_folder / "data" / "speech" / "jfk" / "jfk.flac"
    here = RuleBasedModel().generate(Speech.load(path), seed=3)
    expected = sha256(here.rotations.tobytes() + here.root.tobytes() + here.face.tobytes()).hexdigest()
    environment = {**os.environ, "OMP_NUM_THREADS": threads, "OPENBLAS_NUM_THREADS": threads}
    ran = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(path)], env=environment, capture_output=True, text=True, check=True, timeout=120
    )
    assert ran.stdout.strip() == expected
