"""What every trained model does, whatever decoder plays it: frames, odd speech, options that are wrong."""

from __future__ import annotations

from functools import cache
from math import inf
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest

pytest.importorskip("onnx", reason="graphs are built with onnx (the train extra)")

from cospeech.audio.speech import Speech
from cospeech.errors import InputError
from cospeech.motion.skeleton import humanoid
from cospeech.runtime.model import TrainedModel
from tests.support.fake_windows import whole_system
from tests.support.runtime_bundles import talk, write_small, write_small_chain

MAKERS = {
    "flow": lambda folder: TrainedModel.open(write_small(folder / "a.cospeech")),
    "window": lambda folder: TrainedModel(whole_system()),
    "chain": lambda folder: TrainedModel.open(write_small_chain(folder / "a.cospeech")),
}
OTHERS = {*humanoid().left_hand, *humanoid().right_hand, humanoid().index["leftEye"], humanoid().index["rightEye"]}
BODY = [k for k in range(len(humanoid())) if k not in OTHERS]

of_every_model = pytest.mark.parametrize("kind", MAKERS)


@cache
def model_of(kind: str) -> TrainedModel:
    return MAKERS[kind](Path(mkdtemp(prefix="cospeech-test-")))


@of_every_model
@pytest.mark.parametrize("fps", [15.0, 30.0, 60.0, 24000 / 1001, 7.3])
def test_frames_and_clothes(kind, fps):
    speech = talk()
    motion = model_of(kind).generate(speech, fps=fps, seed=1)
    assert len(motion) == speech.frames(fps)
    assert (motion.fps, motion.skeleton) == (fps, humanoid())
    assert motion.rotations.dtype == np.float32
    assert motion.face.shape == (len(motion), 52)
    assert motion.rotations[:, BODY].std(0).max() > 0.01  # it moves


@of_every_model
def test_odd_speech(kind):
    model = model_of(kind)
    assert len(model.generate(Speech(np.zeros(1, np.float32)))) == 1
    for look_ahead in [None] if kind == "flow" else [None, inf]:
        for volume, samples in ((90.0, 16_000), (0.0, 48_000)):
            motion = model.generate(Speech(np.full(samples, volume, np.float32)), look_ahead=look_ahead)
            assert len(motion) == samples // 16_000 * 30
            assert np.isfinite(motion.rotations).all()
    with pytest.raises(InputError, match="no speech"):
        list(model.session().finish())
    session = model.session()
    list(session.push(talk(0.5)))
    with pytest.raises(InputError, match="Hz"):
        list(session.push(talk(0.5, rate=8000)))


@of_every_model
@pytest.mark.parametrize(
    "options",
    [
        {"style": "calm"}, {"style": 7}, {"style": "ada:x"}, {"style": "ada:-1,ben:3"}, {"style": "ada:nan"}, {"style": ""},
        {"style": "hand_height:0.5"}, {"emotion": "hungry"}, {"seed": -1}, {"seed": 1.5}, {"intensity": np.nan},
        {"temperature": 3}, {"fps": 0}, {"parts": ("feet",)}, {"parts": ()}, {"takes": 0}, {"takes": 65},
        {"look_ahead": -1.0}, {"look_ahead": np.nan}, {"look_ahead": "long"}, {"look_ahead": True}, {"look_ahead": [1]},
    ],
    ids=str,
)  # fmt: skip
def test_wrong_options(kind, options):
    with pytest.raises(InputError, match=r"^[^\n]*$"):
        model_of(kind).session(**options)
