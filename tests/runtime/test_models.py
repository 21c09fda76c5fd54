"""What every trained model does, whatever decoder plays it: frames, odd speech, options that are wrong."""

from __future__ import annotations

import subprocess
import sys
from functools import cache
from math import inf
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest

pytest.importorskip("onnx", reason="graphs are built with onnx (the train extra)")

from cospeech.audio.speech import Speech
from cospeech.errors import InputError
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import humanoid
from cospeech.runtime.model import TrainedModel
from tests.support.fake_windows import whole_system
from tests.support.runtime_bundles import cut, same, talk, write_small, write_small_chain, write_small_window

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
def test_pieces_at_another_rate(kind):
    speech, model = talk(2.5, rate=44_100), model_of(kind)
    pieces = [*model.stream(cut(speech, [999, 30_000, 30_441, 80_000]))]
    assert same(Motion.concatenate(pieces), model.generate(speech))


@pytest.mark.parametrize(("kind", "apart"), [("flow", 1e-3), ("window", 0.01), ("chain", 1e-4)])
def test_seeds_and_takes(kind, apart):
    speech, model = talk(2.0), model_of(kind)
    first = model.generate(speech, seed=5)
    assert same(first, model.generate(speech, seed=5))
    takes = model.generate_takes(speech, takes=8, seed=4)
    assert same(takes[1], first)
    assert np.abs(takes[2].rotations - takes[3].rotations).max() > apart
    assert kind == "flow" or same(*model.generate_takes(speech, takes=2, temperature=0.0, parts=("body", "hands")))


@of_every_model
def test_it_hears(kind):
    silence = Speech(np.zeros(32_000, np.float32))
    a, b = (model_of(kind).generate(speech, seed=1, parts=("body",)) for speech in (talk(2.0), silence))
    assert np.abs(a.rotations - b.rotations).max() > 1e-3


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
        {"calibrated": 1},
        {"look_ahead": -1.0}, {"look_ahead": np.nan}, {"look_ahead": "long"}, {"look_ahead": True}, {"look_ahead": [1]},
    ],
    ids=str,
)  # fmt: skip
def test_wrong_options(kind, options):
    with pytest.raises(InputError, match=r"^[^\n]*$"):
        model_of(kind).session(**options)


@pytest.mark.parametrize("write", [write_small, write_small_window, write_small_chain], ids=["flow", "window", "chain"])
def test_no_torch_and_no_onnx(write, tmp_path):
    path = write(tmp_path / "a.cospeech")
    code = (
        "import sys, numpy as np; from cospeech.runtime.model import TrainedModel; from cospeech.audio.speech import Speech;"
        f"TrainedModel.open({str(path)!r}).generate(Speech(np.zeros(9000, np.float32)), style='ada:0.5,ben:0.5');"
        "assert not {'torch', 'onnx', 'scipy'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)
