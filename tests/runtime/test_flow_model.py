"""Bundles that play: the calls of every model, streams and takes to the bit, parts, options."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from types import SimpleNamespace

import numpy as np
import pytest

from cospeech.errors import InputError
from cospeech.motion.motion import Motion
from cospeech.motion.poses import find_pose
from cospeech.motion.poses.expmap import walk
from cospeech.motion.rotations import axis_angle_to_quat, quat_multiply
from cospeech.motion.skeleton import find_skeleton, humanoid
from cospeech.motion.skeletons.arkit import ARKIT
from cospeech.rules import RuleBasedModel
from cospeech.runtime.autoregressive_decoder import AutoregressiveDecoder
from cospeech.runtime.flow import latent_sources
from cospeech.runtime.flow.latent_sources import CodeSource, NormalSource, SegmentSource
from cospeech.runtime.model import TrainedModel
from cospeech.runtime.mouth import open_default_mouth
from cospeech.runtime.pose_decoder import PoseDecoder
from cospeech.runtime.pose_resampler import PoseResampler
from cospeech.runtime.styles.space import style_space
from cospeech.runtime.styles.style import Styles
from tests.support.runtime_bundles import cut, perform_changes, same, talk, write_small

EYES = [humanoid().index[name] for name in ("leftEye", "rightEye")]
FINGERS = sorted({*humanoid().left_hand, *humanoid().right_hand})
BODY = [k for k in range(len(humanoid())) if k not in {*FINGERS, *EYES}]


@cache
def gesturer(pose: str = "expmap-humanoid", fps: float = 20.0, audio: str = "mel20-prosody") -> TrainedModel:
    folder = Path(mkdtemp(prefix="cospeech-test-"))
    return TrainedModel.open(write_small(folder / "small.cospeech", pose, audio, fps))


def blend(style: object):
    system = gesturer().system
    return Styles(system, style_space(system)).blend(style)


def source(style: object, seed: int = 0):
    system = gesturer().system
    return CodeSource(system, blend(style), seed=seed)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("pose", "fps", "audio"),
    [("expmap-humanoid", 20.0, "mel20-prosody"), ("direction-vectors", 15.0, "mel29-linear"), ("expmap-upper", 20.0, "mel27")],
)
def test_pieces_do_not_show(pose, fps, audio):
    speech = talk()
    whole = gesturer(pose, fps, audio).generate(speech, seed=3)
    for edges in ([], [1, 2, 7, 9000, 9001, 40_000], list(range(1600, 51_000, 1600))):
        pieces = list(gesturer(pose, fps, audio).stream(cut(speech, edges), seed=3))
        assert same(Motion.concatenate(pieces), whole)
        starts = [piece.start for piece in pieces]
        np.testing.assert_allclose(starts, np.cumsum([0, *map(len, pieces)])[:-1] / 30)
    assert len(pieces) > 3  # it does stream


def test_parts_rest():
    speech = talk(2.0)
    whole = gesturer().generate(speech)
    rest = np.array([0, 0, 0, 1], np.float32)
    body = gesturer().generate(speech, parts=("body",))
    assert body.face is None
    assert np.array_equal(body.rotations[:, BODY], whole.rotations[:, BODY])
    assert (body.rotations[:, FINGERS] == rest).all()
    hands = gesturer().generate(speech, parts="hands")
    assert (hands.rotations[:, BODY] == rest).all()
    assert np.ptp(hands.root, 0).max() == 0
    assert np.array_equal(hands.rotations[:, FINGERS], whole.rotations[:, FINGERS])
    face = gesturer().generate(speech, parts=("face",))
    assert (face.rotations[:, BODY + FINGERS] == rest).all()
    by_rules = RuleBasedModel(open_default_mouth).generate(speech, parts=("face",))
    mouth = [k for k, name in enumerate(ARKIT) if not name.startswith(("eye", "brow"))]  # those follow the eyes and the hands
    assert np.array_equal(face.face[:, mouth], by_rules.face[:, mouth])
    assert np.abs(face.rotations[:, EYES] - by_rules.rotations[:, EYES]).max() < 0.03  # aimed from where each head is


def test_intensity_scales_from_the_mean_pose():
    speech = talk(2.0)
    still, half, full = (gesturer().generate(speech, intensity=k, parts=("body",)).root for k in (0.0, 0.5, 1.0))
    assert np.ptp(still, 0).max() < 1e-6
    s = gesturer().system.statistics
    away = (still[0] - humanoid().offsets[0])[[0, 2]]  # not the height: legs may be too short for it
    mean = s.speaker_mean[0] * s.pose_std + s.pose_mean
    np.testing.assert_allclose(away, mean[[0, 2]], atol=1e-5)
    np.testing.assert_allclose((half - still)[:, 0], (full - still)[:, 0] / 2, atol=1e-5)


def test_styles_are_speakers_and_mixtures():
    speech = talk(2.0)
    plain, ada, ben = (gesturer().generate(speech, style=s, parts=("body",)) for s in (None, "ada", "ben"))
    assert same(plain, ada)
    assert not np.allclose(ada.rotations, ben.rotations, atol=1e-2)
    mixture, other = (source(s) for s in ("ada:3, ben:1", "ben"))
    s = gesturer().system.statistics
    np.testing.assert_allclose(mixture.style, 0.75 * s.style_codes[0] + 0.25 * s.style_codes[1], atol=1e-6)
    np.testing.assert_allclose(other.speaker_mean, s.speaker_mean[1])
    beginnings = {tuple(source("ben", seed).history.ravel()) for seed in range(20)}
    assert beginnings == {tuple(h.ravel()) for h in s.histories[3:]}
    assert gesturer().styles == ("ada", "ben")


def test_style_controls(tmp_path):
    path = write_small(tmp_path / "a.cospeech", audio="mel27", controls=("hand_speed", "hand_height"))
    player, speech = TrainedModel.open(path), talk(1.5)
    median, high, both = (
        player.generate(speech, style=s, parts=("body",)) for s in (None, "hand_height:0.95", "ben, hand_height:0.95")
    )
    assert same(median, player.generate(speech, style="hand_height:0.5,hand_speed:0.5", parts=("body",)))
    assert not np.allclose(median.rotations, high.rotations, atol=1e-3)
    assert not np.allclose(both.rotations, high.rotations, atol=1e-3)
    session = player.session(style="hand_speed:0.25")
    table = player.system.statistics.control_quantiles
    np.testing.assert_allclose(session._frontend.silence[0, -2:], [table[25, 0], table[50, 1]], atol=1e-6)
    for wrong in ("hand_radius:0.5", "hand_height:2", "hand_height", "hand_height:0.1,hand_height:0.2"):
        with pytest.raises(InputError):
            player.session(style=wrong)


def test_temperature_and_emotion():
    speech = talk(2.0)
    a, b = (gesturer().generate(speech, temperature=0.0, seed=1, parts=("hands",)) for _ in range(2))
    assert same(a, b)
    warm = gesturer().generate(speech, temperature=2.0, seed=1, parts=("hands",))
    assert not same(a, warm)
    happy, sad = (gesturer().generate(speech, emotion=e) for e in ("happiness", "sadness"))
    assert np.abs(happy.face - sad.face).max() > 0.05
    assert np.array_equal(happy.rotations[:, BODY], sad.rotations[:, BODY])
    session = gesturer().session()
    list(session.push(speech))
    assert sum(session.emotion.values()) == pytest.approx(1)


@pytest.mark.parametrize("fps", [20.0, 47.0])
def test_resampling_keeps_poses_and_holds_ends(fps):
    """A straight line stays one; smoothing and the cubic add up to one everywhere."""
    resampler = PoseResampler(2, 3, smooth=1, step=20 / fps)
    line = np.arange(40, dtype=np.float32)[None, :, None] * np.ones((2, 1, 3), np.float32)
    count = int(40 * fps / 20)
    poses, at = resampler.push(line, count, 39)
    np.testing.assert_allclose(at, np.arange(count) * 20 / fps)
    inner = (at > 3) & (at < 36)
    np.testing.assert_allclose(poses[0, inner, 0], at[inner], atol=2e-4)
    assert poses[1, 0, 2] == pytest.approx(0.25, abs=1e-3)  # (0 + 2·0 + 1) / 4
    assert (np.diff(poses[0, :, 0]) >= -1e-4).all()


def walking(seconds: float = 6.0, fps: float = 20.0) -> Motion:
    """Trinity's skeleton in a T-pose, on a curve: 0.5 m a second, a turn of 20 degrees a second."""
    skeleton, at = find_skeleton("trinity"), np.arange(round(seconds * fps)) / fps
    turn = np.radians(20) * at
    rotations = np.broadcast_to(skeleton.rest, (len(at), len(skeleton), 4)).copy()
    rotations[:, 0] = quat_multiply(axis_angle_to_quat(np.array([0.0, 1.0, 0.0]), turn), skeleton.rest[0])
    steps = 0.5 / fps * np.stack([np.sin(turn), 0 * turn, np.cos(turn)], -1)
    return Motion(fps, rotations, skeleton.offsets[0] + np.cumsum(steps, 0), skeleton=skeleton)


def test_a_body_that_walks_goes_on_where_it_was():
    """In pieces as in the whole, to the bit; and at another rate as far in the same time."""
    pose, motion = find_pose("expmap-full"), walking()
    vectors, (place, turn) = pose.encode(motion), walk(motion)
    start = (*place[0, [0, 2]], turn[0])
    back = pose.decode(vectors, 20.0, start=start)
    np.testing.assert_allclose(back.root, motion.root, atol=1e-6)
    assert np.allclose(pose.end_of_walk(vectors, start), (*place[-1, [0, 2]], turn[-1]), atol=1e-9)
    whole, pieces = (PoseDecoder(pose, 20.0, 1.0) for _ in range(2))
    root = whole.push(vectors)[1]
    results = [pieces.push(piece) for piece in np.split(vectors, [1, 17, 18, 90])]
    np.testing.assert_array_equal(np.concatenate([r for _, r in results]), root)
    twice = PoseDecoder(pose, 40.0, 0.5).push(np.repeat(vectors, 2, 0))[1]
    np.testing.assert_allclose(twice[1::2], root, atol=0.03)
    distance = np.linalg.norm(np.diff(root[:, [0, 2]], axis=0), axis=1).sum()
    assert 2.0 < distance < 4.0  # 3 m, as far as the smoothing of the walk and the humanoid's legs have it


@pytest.mark.parametrize("fps", [20.0, 30.0])
def test_a_whole_body_of_trinity_plays_and_walks(tmp_path, fps):
    player = TrainedModel.open(write_small(tmp_path / "a.cospeech", "expmap-full", "mel27"))
    speech, options = talk(2.5), {"seed": 3, "fps": fps, "parts": ("body", "hands")}
    motion = player.generate(speech, **options)
    assert len(motion) == speech.frames(fps)
    assert np.ptp(motion.root[:, [0, 2]], axis=0).max() > 0.02
    feet = [motion.skeleton.index[name] for name in ("leftUpperLeg", "rightLowerLeg")]
    assert motion.rotations[:, feet].std(0).max() > 1e-3
    for edges in ([1, 9000, 20_001], [400 * k for k in range(1, 90)]):
        assert same(Motion.concatenate([*player.stream(cut(speech, edges), **options)]), motion)
    motion.save(tmp_path / "walk.bvh")
    np.testing.assert_allclose(Motion.load(tmp_path / "walk.bvh").root, motion.root, atol=1e-4)


def test_random_latents_have_the_scale_of_the_bundle(monkeypatch):
    sizes = gesturer().system.flow.sizes
    whole = source("ben", seed=4).draw(30)
    half = SimpleNamespace(sizes=replace(sizes, latent_scale=0.5))
    monkeypatch.setattr(latent_sources, "flow_of", lambda system: half)
    np.testing.assert_allclose(source("ben", seed=4).draw(30), 0.5 * whole, rtol=1e-6)
    with pytest.raises(InputError, match="latent_scale = 3"):
        replace(sizes, latent_scale=3.0)


# a style that changes ----------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("transfer", [CodeSource, SegmentSource, NormalSource])
def test_changes_do_not_depend_on_the_pieces(transfer):
    speech, player = talk(4.0), TrainedModel(gesturer().system, transfer)
    clip = gesturer().generate(talk(3.0), style="ben", seed=8, parts=("body", "hands"))
    changes = {20_000: "ben", 23_333: {clip: 0.6, "ada": 0.4}, 41_000: "ada:0.5,ben:0.5"}
    motion = perform_changes(player, speech, [], changes, seed=2)
    for edges in ([1, 2, 7, 9000, 9001, 40_000], list(range(1600, 60_000, 1600))):
        assert same(perform_changes(player, speech, edges, changes, seed=2), motion)
    assert not same(motion, player.generate(speech, seed=2))


def test_nothing_is_foreseen_of_a_change():
    """A flow hears ahead, but plays every frame in its own style: only smoothing and the cubic look one and two poses on."""
    speech, samples, options = talk(5.0), 40_000, {"parts": ("body", "hands"), "fps": 20.0, "seed": 1}
    motion = perform_changes(gesturer(), speech, [], {samples: "ben"}, **options)
    plain = gesturer().generate(speech, **options)
    differs = np.flatnonzero((motion.rotations != plain.rotations).any((1, 2)))
    frame = samples // 800
    assert frame + 1 - (gesturer().system.smooth + 2) <= differs[0] <= frame + 2
    assert len(differs) > 0.9 * (len(motion) - frame)


def test_a_change_is_a_code_and_a_place_for_each_frame():
    """Frame by frame on the engine, with codes and mean poses that are faded by hand."""
    system, frames, start, seeds = gesturer().system, 60, 21, (3, 4)
    sizes, s = system.flow.sizes, system.statistics
    rng, after = np.random.default_rng(0), sizes.speech_frames - 1 - sizes.history
    rows, silence = rng.normal(size=(frames, sizes.audio)).astype(np.float32), np.zeros((1, sizes.audio), np.float32)

    def make_sources(blend):
        return [CodeSource(system, blend, seed=seed) for seed in seeds]

    ada, mixture = (blend(style) for style in ("ada", "ada:0.25,ben:0.75"))
    player = AutoregressiveDecoder(system, system.flow, make_sources, ada, silence, intensity=0.5)
    poses = [player.push(rows[:start])]
    player.restyle(mixture, start)
    poses += [player.push(rows[start:40])]
    units = player.denormalise(np.concatenate(poses, 1), at := np.arange(40 - after))
    poses = np.concatenate([*poses, player.push(rows[40:]), player.finish(silence)], 1)

    sources = make_sources(ada)
    takes = system.flow.begin(np.stack([x.history for x in sources]), np.stack([x.style for x in sources]))
    all_rows = np.concatenate([np.repeat(silence, sizes.history, 0), rows, np.repeat(silence, after, 0)])
    windows, z = system.flow.windows(all_rows), np.stack([x.draw(frames) for x in sources])
    u = np.clip((np.arange(frames) - start) / 10, 0, 1)[:, None]
    share = 0.75 * (3 * u**2 - 2 * u**3)
    for f in range(frames):
        takes.styles[:] = (1 - share[f]) * s.style_codes[0] + share[f] * s.style_codes[1]
        np.testing.assert_allclose(takes.frames(windows[f : f + 1], z[:, f : f + 1])[:, 0], poses[:, f], atol=5e-3)  # 7 bits
    centres = (1 - share) * s.speaker_mean[0] + share * s.speaker_mean[1]
    expected = (centres + 0.5 * (poses - centres)) * s.pose_std + s.pose_mean
    np.testing.assert_allclose(units, expected[:, at], atol=1e-5)


def test_a_change_brings_the_speaker_s_own_deviation():
    """Of a system that knows poses by their recording's own mean and deviation: both are faded, and what is made by itself."""
    system = gesturer().system
    rng, width = np.random.default_rng(0), system.flow.sizes.pose
    own = {
        "speaker_std": rng.uniform(0.5, 2, (2, width)),
        "free_mean": rng.normal(size=width),
        "free_std": rng.uniform(1, 2, width),
    }
    s = replace(system.statistics, **{name: value.astype(np.float32) for name, value in own.items()})
    system = replace(system, statistics=s)

    def make_sources(blend):
        return [CodeSource(system, blend, seed=1)]

    ada, ben = (Styles(system, style_space(system)).blend(name) for name in ("ada", "ben"))
    player = AutoregressiveDecoder(system, system.flow, make_sources, ada, np.zeros((1, system.flow.sizes.audio), np.float32))
    player.restyle(ben, 0)
    at, poses = np.array([0.0, 5.0, 10.0]), rng.normal(size=(1, 3, width)).astype(np.float32)
    result = (player.denormalise(poses, at) - s.pose_mean) / s.pose_std
    for k, share in enumerate((0.0, 0.5, 1.0)):
        centre, spread = ((1 - share) * each[0] + share * each[1] for each in (s.speaker_mean, s.speaker_std))
        expected = centre + (poses[:, k] - s.free_mean) / s.free_std * spread
        np.testing.assert_allclose(result[:, k], expected, atol=1e-4)


def test_style_controls_change_with_the_style(tmp_path):
    path = write_small(tmp_path / "a.cospeech", audio="mel27", controls=("hand_speed", "hand_height"))
    player, speech = TrainedModel.open(path), talk(4.0)
    changes = {16_000: "hand_height:0.95", 33_000: "ben"}
    motion = perform_changes(player, speech, [], changes, parts=("body",))
    assert same(perform_changes(player, speech, [900, 31_000, 31_001], changes, parts=("body",)), motion)
    table, session = player.system.statistics.control_quantiles, player.session()
    list(session.push(cut(speech, [16_000])[0]))
    session.restyle("hand_height:0.95")
    frontend = session._frontend
    rows = np.concatenate([frontend.push(cut(speech, [16_000])[1]), frontend.finish()])
    first = frontend.frames - len(rows)
    assert rows[20 - first, -1] == table[50, 1]  # at the change itself nothing has changed yet
    assert (rows[30 - first :, -1] == table[95, 1]).all()
    assert rows[25 - first, -1] == pytest.approx((table[50, 1] + table[95, 1]) / 2, abs=1e-5)
    assert (rows[:, -2] == table[50, 0]).all()


def test_a_wrong_change_changes_nothing():
    speech, session = talk(2.0), gesturer().session(seed=1)
    motions = list(session.push(speech))
    for wrong in ("bem", 7, "ada:nan", "hand_height:0.5"):
        with pytest.raises(InputError):
            session.restyle(wrong)
    assert same(Motion.concatenate([*motions, *session.finish()]), gesturer().generate(speech, seed=1))
    assert session.style_mixture is None


@pytest.mark.slow
@pytest.mark.parametrize("look_ahead", [None, 1.0, 0.1, 0.0])
def test_flows_hear_as_far_ahead_as_they_were_trained_to_or_less(look_ahead):
    speech, session = talk(6.0), gesturer().session(parts=("body",), look_ahead=look_ahead)
    usual = gesturer().session(parts=("body",)).latency
    assert session.latency == usual if look_ahead in (None, 1.0) else session.latency < usual
    samples, count, late = 0, 0, []
    for chunk in cut(speech, list(range(160, len(speech), 160))):
        samples += len(chunk)
        count += sum(len(piece) for piece in session.push(chunk))
        late.append(samples / 16_000 - count / 30)
    assert session.latency - 0.06 < max(late) <= session.latency
