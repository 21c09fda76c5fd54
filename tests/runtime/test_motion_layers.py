"""Layers that files have and streams have only when they are asked for."""

from __future__ import annotations

import pytest

import cospeech
from cospeech.errors import InputError


@pytest.mark.parametrize("layer", ["holds", "beat_alignment", "rests"])
def test_files_have_it_and_sessions_only_when_they_are_asked(layer):
    model = cospeech.load("mix-stage")
    assert model.for_files[layer] is True
    assert cospeech.load("speech-to-face").for_files[layer] is False
    usual = {"stance": True, "parts": ("body", "hands")}
    assert model.session(**usual).latency < model.session(**usual, **{layer: True}).latency
    with pytest.raises(InputError, match=f"{layer} is 1"):
        model.session(**{layer: 1})


def test_files_and_streams_have_limits_of_arms_at_no_cost_of_time():
    model = cospeech.load("mix-stage")
    assert model.for_files["arm_limits"] is True
    assert cospeech.load("speech-to-face").for_files["arm_limits"] is False
    usual = {"stance": True, "parts": ("body", "hands")}
    assert model.session(**usual).latency == model.session(**usual, arm_limits=True).latency
