"""Chains under way: frame by frame and in sections, against the same worked out by hand; styles, emotions, noise, pieces."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest

pytest.importorskip("onnx", reason="graphs are built with onnx (the train extra)")

from cospeech.audio.emotions import EMOTIONS, EmotionTrack
from cospeech.runtime.bundles.spec import VOICE
from cospeech.runtime.causal_stream_decoder import CausalStreamDecoder
from cospeech.runtime.crossfade import FADE
from cospeech.runtime.mode_noise import SmoothNoise
from cospeech.runtime.network_decoder import NetworkDecoder
from cospeech.runtime.sliding_window_decoder import OverlapAddDecoder, sections
from cospeech.runtime.speaker_emotion_tracker import SpeakerEmotionTracker
from cospeech.runtime.styles.space import style_space
from cospeech.runtime.styles.track import SpokenStyleTrack
from cospeech.runtime.system import System, open_bundle
from tests.support.runtime_bundles import LOOK_AHEAD, NAMES, WINDOW, write_small_chain

KINDS = [CausalStreamDecoder, OverlapAddDecoder]


@cache
def system(**kind) -> System:
    folder = Path(mkdtemp(prefix="cospeech-test-"))
    return open_bundle(write_small_chain(folder / "chain.cospeech", small=False, **kind))


FPS, MAKE, LIVE = system().fps, system().networks["make"], system().networks["live"]
POSE, ROWS, STYLE, NOISE = (MAKE.signature.width(port) for port in ("poses", "rows", "style", "noise"))
AUDIO, SPEAKERS = len(system().statistics.audio_mean), len(NAMES)
QUIET = np.zeros((1, ROWS), np.float32)


def blend(**shares: float):
    return tuple((share, style_space(system()).by_name(name)) for name, share in shares.items())


ADA, BEN, VOICED = blend(ada=1.0), blend(ben=1.0), blend(**{VOICE: 1.0})


def speech(frames: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(frames, ROWS)).astype(np.float32)


def make_tracker(of: System, emotion=None) -> SpeakerEmotionTracker:
    return SpeakerEmotionTracker(of.networks.get("classify"), SPEAKERS, of.fps, QUIET[0, :AUDIO], emotion)


def player(kind: type[NetworkDecoder], style=ADA, seeds=(0,), emotion=None, of=None, **options: float) -> NetworkDecoder:
    of, live = of or system(), kind is CausalStreamDecoder
    track = SpokenStyleTrack(of, style_space(of), style, make_tracker(of, emotion), live=live)
    network = of.networks["live" if live else "make"]
    return kind(of, network, track, seeds, QUIET, *([] if live else [sections(network.signature)]), **options)


def play(who: NetworkDecoder, rows: np.ndarray, sizes=None) -> np.ndarray:
    """All poses of this speech, pushed in pieces of these sizes, the last one again and again."""
    pieces, at, sizes = [], 0, list(sizes or [len(rows)])
    while at < len(rows):
        size = sizes.pop(0) if len(sizes) > 1 else max(1, sizes[0])
        pieces.append(who.push(rows[at : at + size]))
        at += size
    return np.concatenate([*pieces, who.finish(QUIET)], 1)


def shares_of_voice(rows: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """(n, S + 8) what the voice says of these frames; silence follows the speech."""
    tracker = make_tracker(system())
    tracker.push(np.concatenate([rows, np.repeat(QUIET, 64, 0)])[:, :AUDIO])
    return tracker.shares(frames)


@pytest.mark.parametrize("frames", [1, 2, LOOK_AHEAD, 40])
def test_frame_by_frame_is_the_network_with_silence_after_the_speech(frames):
    rows = speech(frames)
    poses = play(player(CausalStreamDecoder, VOICED, seeds=(3, 4)), rows)
    style = shares_of_voice(rows, np.arange(frames + LOOK_AHEAD)).astype(np.float32)
    draws = np.stack([SmoothNoise(NOISE, FPS, seed=seed).draw(frames + LOOK_AHEAD) for seed in (3, 4)])
    noise = system().statistics.noise_gain[1] * draws
    state, expected = LIVE.begin(2), []
    for k, row in enumerate(np.concatenate([rows, np.repeat(QUIET, LOOK_AHEAD, 0)])):
        output = LIVE.run(rows=row[None], style=np.broadcast_to(style[k], (2, STYLE)), noise=noise[:, k], **state)
        state = {name: output[f"next.{name}"] for name in state}
        expected.append(output["poses"])
    assert poses.tobytes() == np.stack(expected[LOOK_AHEAD:], 1).tobytes()
    assert poses.shape == (2, frames, POSE)


def test_sections_are_windows_as_in_training():
    rows, setting = speech(61), sections(MAKE.signature)
    who = player(OverlapAddDecoder, ADA, emotion=EmotionTrack.constant("anger"), temperature=0.0)
    result = play(who, rows)[0]
    style = np.zeros((1, WINDOW, STYLE), np.float32)
    style[..., [0, SPEAKERS + EMOTIONS.index("anger")]] = 1
    padded = np.concatenate([np.repeat(QUIET, WINDOW, 0), rows, np.repeat(QUIET, 2 * WINDOW, 0)])
    expected, before = [], None
    for first in range(0, 61, setting.hop):
        window = padded[WINDOW + first - setting.past :][:WINDOW]
        poses = MAKE.run(rows=window[None], style=style)["poses"][0, setting.past :]
        new = poses[: setting.hop].copy()
        for k in range(setting.fade if before is not None else 0):
            new[k] = before[k] + (k + 1) / (setting.fade + 1) * (new[k] - before[k])
        expected.append(new)
        before = poses[setting.hop :]
    np.testing.assert_allclose(result, np.concatenate(expected)[:61], atol=1e-5)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("style", [ADA, VOICED], ids=["ada", "voice"])
def test_pieces_do_not_show(kind, style):
    rows = speech(150)
    who = player(kind, style, seeds=(3, 4))
    whole = play(who, rows)
    assert whole.shape == (2, 150, POSE)
    at = np.arange(0, 149, 0.5)
    units = who.denormalise(whole[:, :1].repeat(len(at), 1), at)
    for sizes in ([1], [7], [0, 1, 2, 0, 90, 5], [149, 1]):
        other = player(kind, style, seeds=(3, 4))
        assert play(other, rows, sizes).tobytes() == whole.tobytes()
        assert other.denormalise(whole[:, :1].repeat(len(at), 1), at).tobytes() == units.tobytes()
        assert other.speaker == who.speaker


@pytest.mark.parametrize("kind", KINDS)
def test_takes_together_are_takes_alone(kind):
    rows = speech(70)
    whole = play(player(kind, seeds=(3, 4, 5)), rows)
    for k, seed in enumerate((3, 4, 5)):
        assert play(player(kind, seeds=(seed,)), rows).tobytes() == whole[k].tobytes()
    assert np.abs(whole[0] - whole[1]).max() > 1e-3
    still = play(player(kind, seeds=(3, 4), temperature=0.0), rows)
    assert np.array_equal(still[0], still[1])
    plain = system(noise=0)
    alike = play(player(kind, seeds=(3, 4), of=plain), rows)
    assert np.array_equal(alike[0], alike[1])


@pytest.mark.parametrize("kind", KINDS)
def test_no_frame_waits_longer_than_said(kind):
    who, rows, count, late = player(kind), speech(200), 0, []
    for n in range(1, 201):
        count += who.push(rows[n - 1 : n]).shape[1]
        late.append(n - count)
    waits = who.latency * FPS
    assert max(late) < waits <= max(late) + 1 + 1e-9


@pytest.mark.parametrize("kind", KINDS)
def test_no_speech_no_poses(kind):
    who = player(kind, seeds=(1, 2))
    assert who.push(speech(0)).shape == (2, 0, POSE)
    assert who.finish(QUIET).shape == (2, 0, POSE)


@pytest.mark.parametrize("kind", KINDS)
def test_speakers_emotions_and_words_are_played(kind):
    rows, anger, joy = speech(60), EmotionTrack.constant("anger"), EmotionTrack.constant("happiness")
    first = play(player(kind, ADA, emotion=anger), rows)
    for other in (player(kind, BEN, emotion=anger), player(kind, ADA, emotion=joy)):
        assert np.abs(play(other, rows) - first).max() > 1e-3
    without_words = rows.copy()
    without_words[30:, AUDIO:] = 0
    silent = play(player(kind, ADA, emotion=anger), without_words)
    assert np.abs(silent - first)[:, 35:].max() > 1e-3
    turning = EmotionTrack([0, 2, 2.2, 9], np.eye(8)[[2, 2, 1, 1]])
    change = play(player(CausalStreamDecoder, ADA, emotion=turning), rows)
    angry = play(player(CausalStreamDecoder, ADA, emotion=anger), rows)
    assert np.array_equal(change[:, : 30 - LOOK_AHEAD], angry[:, : 30 - LOOK_AHEAD])
    assert np.abs(change - angry)[:, 34:].max() > 1e-3


def test_what_is_not_asked_for_is_the_voice_s(monkeypatch):
    """Where a style names half of the speaker, the voice gives the other half, and the whole emotion."""
    rows, styles = speech(60), []
    run, half, shares = LIVE.run, blend(ada=0.5, **{VOICE: 0.5}), style_space(system()).shares
    monkeypatch.setattr(LIVE, "run", lambda style, **given: styles.append(style[0].copy()) or run(style=style, **given))
    play(player(CausalStreamDecoder, half), rows)
    voice = shares_of_voice(rows, np.arange(60))
    rows_of_style = np.array(styles[:60])
    np.testing.assert_allclose(rows_of_style[:, :SPEAKERS], 0.5 * voice[:, :SPEAKERS] + [0.5, 0], atol=1e-6)
    np.testing.assert_allclose(rows_of_style[:, SPEAKERS:], voice[:, SPEAKERS:], atol=1e-6)
    assert shares(half) == {"ada": 0.5, VOICE: 0.5}
    assert shares(blend(ada=0.75, ben=0.25)) == {"ada": 0.75, "ben": 0.25}
    assert shares(ADA) is shares(VOICED) is None


@pytest.mark.parametrize("kind", KINDS)
def test_another_style_is_faded_in(kind):
    rows, calm = speech(120), EmotionTrack.constant("neutral")
    who = player(kind, ADA, emotion=calm)
    poses = [who.push(rows[:60])]
    who.restyle(BEN, 60)
    at = np.arange(58, 70)
    u = np.clip((at - 60) / (FADE * FPS), 0, 1)
    np.testing.assert_allclose(who._style.codes(at)[0, :, 0], 1 - (3 * u**2 - 2 * u**3), atol=1e-6)
    poses = np.concatenate([*poses, who.push(rows[60:]), who.finish(QUIET)], 1)
    ada, ben = (play(player(kind, style, emotion=calm), rows) for style in (ADA, BEN))
    waits = round(who.latency * FPS)
    assert np.array_equal(poses[:, : 60 - waits], ada[:, : 60 - waits])
    after = 60 + round(FADE * FPS) + 3 * WINDOW  # an LSTM that goes on remembers a little
    assert np.abs(poses - ben)[:, after:].max() < 0.02 < np.abs(poses - ada)[:, after:].max()


@pytest.mark.parametrize("kind", KINDS)
def test_units_put_the_speaker_s_own_in_the_place_of_what_is_made(kind):
    who, s = (
        player(kind, blend(ada=0.25, ben=0.75), emotion=EmotionTrack.constant("neutral"), intensity=0.5),
        system().statistics,
    )
    play(who, speech(30))
    poses = np.random.default_rng(0).normal(size=(1, 4, POSE)).astype(np.float32)
    shares = np.array([0.25, 0.75])
    means, gains = (s.live_model_mean, s.live_style_gain) if kind is CausalStreamDecoder else (s.model_mean, s.style_gain)
    expected = shares @ s.speaker_mean + 0.5 * (shares @ gains) * (poses - shares @ means)
    np.testing.assert_allclose(who.denormalise(poses, np.arange(4)), expected * s.pose_std + s.pose_mean, atol=1e-5)


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_kept_does_not_grow(kind):
    who, rows = player(kind, VOICED), speech(3000)
    for at in range(0, 3000, 100):
        who.push(rows[at : at + 100])
        who.restyle(BEN if at % 200 else ADA, at + 100)
        assert len(who._style._tracker._course) < 10 * FPS + 150
        assert len(who._style._mixture.layers) < 8


def test_who_knows_no_emotion_says_so():
    assert player(CausalStreamDecoder).moods is None  # what it hears is reported, and not played
    plain = system(judges=False)
    assert player(CausalStreamDecoder, of=plain).moods is None
    assert player(CausalStreamDecoder, of=plain).speaker is None
    assert player(CausalStreamDecoder, of=plain, emotion=EmotionTrack.constant("fear")).moods is not None
    assert set(player(CausalStreamDecoder).speaker) == set(NAMES)
