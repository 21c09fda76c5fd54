"""How much of an emotion a network is given where it is played: a fact of the bundle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cospeech.audio.emotions import EMOTIONS, EmotionTrack
from cospeech.audio.speech import Speech, example
from cospeech.errors import InputError
from cospeech.models import SHIPPED, load
from cospeech.runtime.bundles.bundle import read_bundle, write_bundle
from cospeech.runtime.bundles.spec import read_spec
from cospeech.runtime.model import TrainedModel
from tests.support.runtime_bundles import same

OPTIONS = {"seed": 0, "fps": 15.0, "style": "ada", "parts": ("body", "hands")}


def spoken() -> Speech:
    return Speech.load(example()[0]).window(0, 3)


def mix_with_neutral(sadness: float) -> EmotionTrack:
    weights = np.zeros(len(EMOTIONS))
    weights[EMOTIONS.index("sadness")], weights[EMOTIONS.index("neutral")] = sadness, 1 - sadness
    return EmotionTrack([0], [weights])


def test_a_part_of_an_emotion_is_played_as_a_mixture_with_neutral():
    system = replace(load("chain-of-generation").system, emotion_strength={})
    whole, part = TrainedModel(system), TrainedModel(replace(system, emotion_strength={"sadness": 0.5}))
    assert same(
        part.generate(spoken(), emotion="sadness", **OPTIONS),
        whole.generate(spoken(), emotion=mix_with_neutral(0.5), **OPTIONS),
    )
    assert not same(
        part.generate(spoken(), emotion="sadness", **OPTIONS), whole.generate(spoken(), emotion="sadness", **OPTIONS)
    )
    assert same(part.generate(spoken(), emotion="anger", **OPTIONS), whole.generate(spoken(), emotion="anger", **OPTIONS))


def test_what_ships_gives_less_than_all_of_sadness_and_the_bare_network_all():
    model = load("chain-of-generation")
    assert model.system.emotion_strength == {"sadness": 0.7}
    usual = model.generate(spoken(), emotion="sadness", **OPTIONS)
    assert same(
        usual,
        TrainedModel(replace(model.system, emotion_strength={})).generate(spoken(), emotion=mix_with_neutral(0.7), **OPTIONS),
    )


@pytest.mark.parametrize("wrong", [{"sadness": 2}, {"gloom": 0.5}, {"sadness": "much"}, [0.5]])
def test_a_manifest_that_says_something_else_is_refused(tmp_path, wrong):
    bundle = read_bundle(SHIPPED / "chain-of-generation.cospeech")
    manifest = {key: value for key, value in bundle.manifest.items() if key not in ("members", "format")}
    write_bundle(tmp_path / "a.cospeech", manifest | {"emotion_strength": wrong}, bundle.members)
    with pytest.raises(InputError, match=r"emotion_strength.*0 … 1"):
        read_spec(read_bundle(tmp_path / "a.cospeech"))
