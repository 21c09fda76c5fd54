"""Windows that slide: against one pass over everything, in pieces of any size, with styles that change, takes that differ."""

from __future__ import annotations

from dataclasses import replace
from math import erf, inf, sqrt

import numpy as np
import pytest

from cospeech.errors import InputError
from cospeech.runtime.crossfade import FADE, Crossfade
from cospeech.runtime.mode_noise import SmoothNoise
from cospeech.runtime.sliding_window_decoder import LIVE, SlidingWindowDecoder, live, looking, whole
from cospeech.runtime.styles.space import style_space
from cospeech.runtime.window_layout import WindowLayout
from tests.support.fake_windows import NAMES, decoder, fake_sizes, fake_system

SYSTEM = fake_system()
ENGINE = SYSTEM.main_network
SIZES = ENGINE.signature
QUIET = np.array([[-0.5, 0.25]], np.float32)
SMALL = WindowLayout(window=32, hop=4, ahead=8, fade=3)
SETTINGS = {"live": live(SIZES), "small": SMALL, "whole": whole(SIZES), "abrupt": WindowLayout(16, 4, 0, 0)}


def blend(**shares: float):
    return tuple((share, style_space(SYSTEM).by_name(name)) for name, share in shares.items())


ADA, BEN, MIXTURE = blend(ada=1.0), blend(ben=1.0), blend(ada=0.7, cleo=0.3)


def speech(frames: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(frames, SIZES.width("rows"))).astype(np.float32)


def player(setting: WindowLayout = SMALL, style=ADA, seeds=(0,), system=SYSTEM, **options) -> SlidingWindowDecoder:
    return decoder(system, setting, style, seeds, QUIET, **options)


def play(who: SlidingWindowDecoder, rows: np.ndarray, sizes=None) -> np.ndarray:
    """All poses of this speech, pushed in pieces of these sizes, the last one again and again."""
    pieces, at, sizes = [], 0, list(sizes or [len(rows)])
    while at < len(rows):
        size = sizes.pop(0) if len(sizes) > 1 else max(1, sizes[0])
        pieces.append(who.push(rows[at : at + size]))
        at += size
    return np.concatenate([*pieces, who.finish(QUIET)], 1)


def codes_of(frames: np.ndarray, track: list[tuple[int, np.ndarray]]) -> np.ndarray:
    """(n, styles) worked out frame by frame: each style faded in over half a second by 3u² − 2u³."""
    out = []
    for frame in frames:
        code = track[0][1].astype(float)
        for start, new in track[1:]:
            u = min(max((frame - start) / (FADE * SYSTEM.fps), 0), 1)
            code = code + (3 * u**2 - 2 * u**3) * (new - code)
        out.append(code)
    return np.array(out)


def one_pass(rows: np.ndarray, track: list[tuple[int, np.ndarray]], around: int = 64) -> np.ndarray:
    """What the network makes of the whole speech at once, with silence around it and without noise."""
    fill = -len(rows) % SIZES.multiple
    all_rows = np.concatenate([np.repeat(QUIET, around, 0), rows, np.repeat(QUIET, around + fill, 0)])
    style = codes_of(np.arange(len(all_rows)) - around, track)[None]
    poses = ENGINE.make(all_rows, style)
    return poses[:, around : around + len(rows)]


def by_hand(rows: np.ndarray, setting: WindowLayout, track: list[tuple[int, np.ndarray]]) -> np.ndarray:
    """The sliding windows again, each cut out of the whole speech by its number."""
    around = 4 * setting.window
    all_rows = np.concatenate([np.repeat(QUIET, around, 0), rows, np.repeat(QUIET, around, 0)])
    pieces, before = [], None
    for first in range(0, len(rows), setting.hop):
        begin = first + setting.hop + setting.ahead - setting.window
        at = np.arange(begin, begin + setting.window)
        poses = ENGINE.make(all_rows[at + around], codes_of(at, track)[None])[0]
        new = poses[first - begin :].copy()
        if before is not None:
            for k in range(setting.fade):
                share = (k + 1) / (setting.fade + 1)
                new[k] = (1 - share) * before[k] + share * new[k]
        pieces.append(new[: setting.hop])
        before = poses[first - begin + setting.hop :]
    return np.concatenate(pieces)[None, : len(rows)]


# where windows lie --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("frames", [1, 3, 4, 5, 31, 32, 33, 257, 700])
def test_whole_is_one_pass_over_the_whole_speech(frames):
    rows = speech(frames)
    poses = play(player(whole(SIZES), MIXTURE, temperature=0.0), rows)
    assert poses.shape == (1, frames, SIZES.width("poses"))
    np.testing.assert_allclose(poses, one_pass(rows, [(0, np.array([0.7, 0, 0.3]))]), atol=2e-5)


def test_whole_would_notice_a_window_too_small_or_out_of_step():
    rows, expected = speech(300), one_pass(speech(300), [(0, np.eye(3)[0])])
    right = whole(SIZES)
    for wrong in (
        replace(right, window=right.window - 8),  # less before than what matters
        replace(right, window=right.window - 8, ahead=right.ahead - 8),  # less after
        replace(right, hop=right.hop - 2, ahead=right.ahead + 2),  # other steps in time
    ):
        assert np.abs(play(player(wrong, temperature=0.0), rows) - expected).max() > 0.01


@pytest.mark.parametrize("setting", SETTINGS.values(), ids=SETTINGS)
@pytest.mark.parametrize("frames", [1, 7, 90])
def test_windows_slide_as_they_are_said_to(setting, frames):
    rows = speech(frames)
    poses = play(player(setting, MIXTURE, temperature=0.0), rows)
    np.testing.assert_allclose(poses, by_hand(rows, setting, [(0, np.array([0.7, 0, 0.3]))]), atol=2e-5)


@pytest.mark.slow
@pytest.mark.parametrize("setting", SETTINGS.values(), ids=SETTINGS)
def test_pieces_do_not_show(setting):
    rows = speech(333)
    at_once = play(player(setting, seeds=(3, 4)), rows)
    for sizes in ([1], [4], [7], [32], [0, 1, 2, 0, 300, 5], [332, 1], [64, 3]):
        assert play(player(setting, seeds=(3, 4)), rows, sizes).tobytes() == at_once.tobytes()


@pytest.mark.parametrize("setting", SETTINGS.values(), ids=SETTINGS)
def test_no_frame_waits_longer_than_said(setting):
    who, rows, count = player(setting), speech(600), 0
    assert who.latency == setting.waits / SYSTEM.fps
    for frames in range(1, 601):
        count += who.push(rows[frames - 1 : frames]).shape[1]
        assert count == max(0, (frames - setting.ahead) // setting.hop) * setting.hop
        assert frames - count < setting.waits


def test_no_speech_no_poses():
    for setting in SETTINGS.values():
        who = player(setting, seeds=(1, 2))
        assert who.push(speech(0)).shape == (2, 0, SIZES.width("poses"))
        assert who.finish(QUIET).shape == (2, 0, SIZES.width("poses"))


def test_a_window_is_as_long_as_in_training():
    who = player(live(SIZES))
    ENGINE.calls.clear()
    play(who, speech(40))
    assert set(ENGINE.calls) == {(1, 32)}
    assert len(ENGINE.calls) == 10


def test_settings():
    assert live(fake_sizes(window=64, reach=40)) == LIVE
    assert live(fake_sizes(window=64)) == replace(LIVE, ahead=12)  # its reach of 9 is near: it gets all of it
    assert live(fake_sizes(window=10, reach=40)) == replace(LIVE, window=LIVE.waits)  # no shorter than what is new and ahead
    assert live(fake_sizes(window=63, multiple=32, reach=40)) == LIVE
    assert whole(fake_sizes(multiple=32, reach=140)) == WindowLayout(window=160 + 256 + 160, hop=256, ahead=160, fade=0)
    assert whole(fake_sizes(reach=0, multiple=1)).ahead == 0
    sizes = fake_sizes(window=64, multiple=32, reach=140)
    assert looking(sizes, 20) == LIVE
    assert looking(sizes, 20, LIVE.ahead / 20) == LIVE
    assert looking(sizes, 20, 2.0) == WindowLayout(window=96, hop=4, ahead=40, fade=4)
    assert looking(sizes, 20, 2.0).past >= LIVE.past  # what is heard before does not become less
    assert looking(sizes, 20, 0.05) == WindowLayout(window=64, hop=1, ahead=1, fade=1, held=10)
    assert looking(sizes, 20, 0) == WindowLayout(window=64, hop=1, ahead=0, fade=0, held=11)
    assert looking(sizes, 20, 7.0) == looking(sizes, 20, inf) == whole(sizes)
    for wrong in (-0.1, np.nan, "long", True, [1.0]):
        with pytest.raises(InputError, match="look_ahead"):
            looking(sizes, 20, wrong)
    for odd in ({"hop": 0}, {"fade": 9}, {"fade": -1}, {"ahead": -1, "fade": -1}, {"window": LIVE.waits - 1}, {"ahead": 61}):
        with pytest.raises(InputError):
            replace(LIVE, **odd)


def test_a_network_that_normalises_hears_as_much_before_as_after():
    sizes = fake_sizes(window=64, multiple=1, reach=None)
    assert whole(sizes) == looking(sizes, 20, inf) == WindowLayout(window=64, hop=4, ahead=30, fade=4)
    assert looking(sizes, 20, 1.0) == WindowLayout(window=64, hop=4, ahead=20, fade=4)  # windows stay as in training


# styles ------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("setting", SETTINGS.values(), ids=SETTINGS)
@pytest.mark.parametrize("frame", [0, 1, 50, 61])
def test_a_style_that_changes_is_a_style_for_each_frame(setting, frame):
    rows, track = speech(120), [(0, np.eye(3)[0]), (frame, np.array([0.2, 0.8, 0]))]
    who = player(setting, temperature=0.0)
    poses = who.push(rows[:frame])
    who.restyle(blend(ada=0.2, ben=0.8), frame)
    poses = np.concatenate([poses, play(who, rows[frame:])], 1)
    np.testing.assert_allclose(poses, by_hand(rows, setting, track), atol=2e-5)
    if setting.fade == 0 and setting.ahead:
        np.testing.assert_allclose(poses, one_pass(rows, track), atol=2e-5)


@pytest.mark.parametrize("setting", SETTINGS.values(), ids=SETTINGS)
def test_before_a_change_bits_stay_but_for_the_look_ahead(setting):
    rows, frame = speech(800), 401
    plain = play(player(setting), rows)
    who = player(setting)
    poses = who.push(rows[:frame])
    who.restyle(BEN, frame)
    poses = np.concatenate([poses, play(who, rows[frame:])], 1)
    differs = np.flatnonzero((poses != plain).any((0, 2)))
    foreseen = frame + 2 - setting.waits  # a window whose new frames begin before ends with the last frame of the old style
    assert differs[0] >= max(foreseen, 0)
    assert differs[0] <= frame + setting.hop
    later = play(player(setting, BEN), rows)
    after = frame + round(FADE * SYSTEM.fps) + setting.past + setting.hop
    assert poses[:, after:].tobytes() == later[:, after:].tobytes()  # and is then as if it had always been so


@pytest.mark.slow
def test_changes_do_not_depend_on_the_pieces():
    rows, changes = speech(900), {100: BEN, 104: MIXTURE, 500: BEN, 503: ADA, 504: blend(cleo=1.0)}
    for setting in SETTINGS.values():
        results = set()
        for size in (1, 4, 10, 97, 900):
            who, pieces = player(setting, seeds=(5, 6)), []
            for start, end in zip([0, *changes], [*changes, 900], strict=True):
                if start:
                    who.restyle(changes[start], start)
                pieces += [who.push(rows[k : min(k + size, end)]) for k in range(start, end, size)]
            results.add(np.concatenate([*pieces, who.finish(QUIET)], 1).tobytes())
        assert len(results) == 1


def test_of_two_changes_at_one_place_the_last_counts():
    rows = speech(80)

    def play_styles(*styles):
        who = player()
        first = who.push(rows[:30])
        for style in styles:
            who.restyle(style, 30)
        return np.concatenate([first, play(who, rows[30:])], 1).tobytes()

    assert play_styles(MIXTURE, BEN) == play_styles(BEN) != play_styles(MIXTURE)
    assert play_styles(BEN, ADA) == play_styles()


@pytest.mark.slow
def test_a_thousand_changes_are_forgotten():
    who = player()
    for frame in range(1000):
        who.restyle((ADA, BEN)[frame % 2], frame)
        who.push(speech(1, frame))
    assert len(who._style._styles.layers) < 100


def test_fading_takes_over_to_the_bit():
    track = Crossfade(np.full((1, 1, 1), 0.1, np.float32), fps=20)
    track.change(np.full((1, 1, 1), 0.7, np.float32), 10)
    at = np.arange(0, 25, 0.25)
    values = track.mix(lambda value: value, at)[0, :, 0]
    assert (values[at <= 10] == np.float32(0.1)).all()
    assert (values[at >= 20] == np.float32(0.7)).all()
    assert (np.diff(values) >= 0).all()
    assert values[at == 15] == pytest.approx(0.4)
    assert track.steady(0, 11)
    assert not track.steady(0, 12)
    assert not track.steady(19, 30)
    assert track.steady(20, 99)
    track.forget(19.9)
    assert len(track.layers) == 2
    track.forget(20)
    assert [start for start, _ in track.layers] == [10]
    assert track.mix(lambda value: value, at).ravel() == np.float32(0.7)


def test_intensity_scales_around_the_style_s_mean_pose():
    rows, s = speech(60), SYSTEM.statistics
    at, poses = np.arange(60.0), {}
    for intensity in (0.0, 0.5, 1.0, 2.0):
        who = player(style=MIXTURE, intensity=intensity)
        poses[intensity] = who.denormalise(play(who, rows), at)
    centre = (0.7 * s.speaker_mean[0] + 0.3 * s.speaker_mean[2]) * s.pose_std + s.pose_mean
    np.testing.assert_allclose(poses[0.0], np.broadcast_to(centre, poses[0.0].shape), atol=1e-6)
    gain, mean = (0.7 * x[0] + 0.3 * x[2] for x in (s.style_gain, s.model_mean))
    movement = gain * (play(player(style=MIXTURE), rows) - mean) * s.pose_std  # as the speakers' own movement is
    np.testing.assert_allclose(poses[1.0], movement + centre, atol=1e-6)
    np.testing.assert_allclose(poses[0.5] - centre, (poses[1.0] - centre) / 2, atol=1e-6)
    np.testing.assert_allclose(poses[2.0] - centre, (poses[1.0] - centre) * 2, atol=1e-6)
    who, growing = player(style=MIXTURE), np.linspace(1, 1.5, 60, dtype=np.float32)[:, None]  # arousal, frame by frame
    np.testing.assert_allclose(
        who.denormalise(play(who, rows), at, growing) - centre, (poses[1.0] - centre) * growing, atol=1e-6
    )
    who = player(intensity=0.0)
    who.restyle(BEN, 20)
    still = (who.denormalise(np.zeros((1, 60, 3), np.float32), at)[0] - s.pose_mean) / s.pose_std
    np.testing.assert_allclose(still, codes_of(at, [(0, np.eye(3)[0]), (20, np.eye(3)[1])]) @ s.speaker_mean, atol=1e-5)


# takes -------------------------------------------------------------------------------------------------------------------


def test_temperature_zero_is_the_network_s_own_motion():
    rows = speech(90)
    takes = play(player(seeds=range(3), temperature=0.0), rows)
    assert takes[0].tobytes() == takes[1].tobytes() == takes[2].tobytes()
    np.testing.assert_allclose(takes[:1], by_hand(rows, SMALL, [(0, np.eye(3)[0])]), atol=2e-5)
    distances = [np.abs(play(player(temperature=t), rows) - takes[:1]).mean() for t in (0.25, 1.0)]
    assert 0.01 < distances[0] < distances[1]


def test_takes_are_seeds_and_played_in_one_pass():
    rows = speech(90)
    ENGINE.calls.clear()
    together = play(player(seeds=range(8)), rows)
    assert {takes for takes, _ in ENGINE.calls} == {8}
    assert len(ENGINE.calls) == 23
    for seed in range(8):
        assert play(player(seeds=[seed]), rows).tobytes() == together[seed].tobytes()
    assert len({take.tobytes() for take in together}) == 8
    assert np.abs(together[0] - together[1]).mean() > 0.05


def test_another_look_ahead_is_the_same_take():
    """Of a network that hears one frame at a time, windows of any kind make the same."""
    system = fake_system(fake_sizes(multiple=1, reach=0))
    rows = speech(90)
    takes = [
        play(player(setting, seeds=[9], system=system), rows)
        for setting in (WindowLayout(32, 4, 8, 3), whole(system.main_network.signature))
    ]
    np.testing.assert_allclose(takes[0], takes[1], atol=1e-5)


def test_a_free_code_is_moved_for_good():
    codes = np.array([[1.0, 0], [0, 5], [-1, 1]])
    sizes = fake_sizes(styles=2, modes=0, multiple=1, reach=0)
    system = fake_system(sizes, codes=codes)
    ada = ((1.0, style_space(system).by_name("ada")),)
    codes_played = []
    still = {"poses": np.zeros((1, 32, 3), np.float32)}
    system.main_network.run = lambda rows, style: codes_played.append(style) or still
    play(decoder(system, SMALL, ada, range(500), QUIET), speech(9))
    shift = codes_played[0][:, 0] - codes[0]
    assert all((style == codes_played[0]).all() for style in codes_played)
    np.testing.assert_allclose(shift.std(0), codes.std(0), rtol=0.1)
    np.testing.assert_allclose(shift.mean(0), 0, atol=0.3)
    codes_played.clear()
    play(decoder(system, SMALL, ada, range(3), QUIET, temperature=0.0), speech(9))
    assert (codes_played[0] == codes[0]).all()


def test_a_free_code_is_one_for_a_window():
    sizes = fake_sizes(styles=2, modes=0, multiple=1, reach=0)
    system = fake_system(sizes, codes=np.array([[1.0, 0], [0, 5], [-1, 1]]))
    ada, ben = (((1.0, style_space(system).by_name(name)),) for name in NAMES[:2])
    codes_played = []
    still = {"poses": np.zeros((1, 32, 3), np.float32)}
    system.main_network.run = lambda rows, style: codes_played.append(style) or still
    who = decoder(system, SMALL, ada, [0], QUIET, temperature=0.0)
    who.push(speech(20))
    who.restyle(ben, 20)
    play(who, speech(40))
    middles = 4 * np.arange(15) + 2
    expected = codes_of(middles, [(0, np.array([1.0, 0])), (20, np.array([0, 5.0]))])
    assert all((style == style[:, :1]).all() for style in codes_played)
    np.testing.assert_allclose(np.concatenate(codes_played)[:, 0], expected, atol=1e-6)


@pytest.mark.parametrize("styles", [0, 3])
def test_without_modes_and_codes_of_their_own_takes_are_alike(styles):
    system = fake_system(fake_sizes(styles=styles, modes=0), codes=np.eye(3)[:, :styles])
    ada = ((1.0, style_space(system).by_name("ada")),)
    takes = play(decoder(system, SMALL, ada, [1, 2], QUIET), speech(50))
    assert takes[0].tobytes() == takes[1].tobytes()


# noise -------------------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_noise_is_gumbel_at_every_frame_and_draws_modes_as_softmax_has_them():
    rate = 2.0  # frames so far apart that there are many draws in few frames
    noise = SmoothNoise(5, rate, seed=1).draw(40_000)
    assert noise.dtype == np.float32
    assert noise.std() == pytest.approx(np.pi / sqrt(6), rel=0.02)
    assert noise.mean() == pytest.approx(0.5772, abs=0.02)
    for x in (-1.0, 0.0, 0.5, 2.0, 4.0):
        assert (noise <= x).mean() == pytest.approx(np.exp(-np.exp(-x)), abs=0.01)
    assert np.abs(np.corrcoef(noise.T) - np.eye(5)).max() < 0.03
    logits = np.array([0.0, 1.0, -1.0, 2.0, 0.5])
    frequencies = np.bincount((logits + noise).argmax(1), minlength=5) / len(noise)
    np.testing.assert_allclose(frequencies, np.exp(logits) / np.exp(logits).sum(), atol=0.012)


@pytest.mark.slow
@pytest.mark.parametrize("fps", [12.0, 15.0, 30.0])
def test_noise_is_smooth_and_as_slow_at_any_rate(fps):
    noise = SmoothNoise(400, fps, seed=2).draw(round(3 * fps) + 1).astype(float)
    # back to normal numbers, by bisection: what correlates is known there
    level = np.exp(-np.exp(-noise))
    low, high = np.full(noise.shape, -8.0), np.full(noise.shape, 8.0)
    phi = np.vectorize(lambda x: (1 + erf(x / sqrt(2))) / 2)
    for _ in range(30):
        middle = (low + high) / 2
        below = phi(middle) < level
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    for lag in (0.5, 1.0, 2.0):
        k = round(lag * fps)
        seconds = k / fps
        correlation = (low[:-k] * low[k:]).mean()
        assert correlation == pytest.approx((1 + 2 * seconds) * np.exp(-2 * seconds), abs=0.08)
    speed = np.diff(low, axis=0) * fps
    assert speed.std() == pytest.approx(2.0, rel=0.1)  # λ: a process with a derivative, not a jitter that grows with the rate


def test_noise_does_not_depend_on_the_pieces():
    at_once = SmoothNoise(3, 15, seed=7).draw(100)
    noise = SmoothNoise(3, 15, seed=7)
    assert np.concatenate([noise.draw(n) for n in (0, 1, 2, 3, 60, 34)]).tobytes() == at_once.tobytes()
    assert not np.allclose(SmoothNoise(3, 15, seed=8).draw(100), at_once, atol=0.5)
    assert np.isfinite(SmoothNoise(3, 15, seed=2**62).draw(2000)).all()
    assert SmoothNoise(0, 15, seed=1).draw(4).shape == (4, 0)


def test_numbers_far_out_stay_numbers():
    from cospeech.runtime.mode_noise import _gumbel

    x = np.array([-60.0, -9.0, -1.0, 0.0, 3.0, 9.0, 60.0])
    values = _gumbel(x)
    assert np.isfinite(values).all()
    assert (np.diff(values) >= 0).all()
    assert values[3] == pytest.approx(-np.log(np.log(2)))


# networks ----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["mix-stage", "stage", "cmix-gan", "speech2gesture", "munit"])
def test_networks_are_played_as_they_are(name):
    """Of random weights: several takes have the bits of one each, and whole is what one pass of the network itself makes."""
    pytest.importorskip("torch", reason="networks need torch (the train extra)")
    pytest.importorskip("onnx", reason="graphs are built with onnx (the train extra)")
    from cospeech.runtime.network import Network
    from tests.support.exports import export_graphs
    from tests.support.windowed_networks import given, make_network, run_network

    net = make_network(name)
    low = export_graphs(net.export_module())
    signature = low.signatures["make"]
    system = fake_system(signature, codes=np.eye(3)[:, : signature.width("style")])
    system = replace(system, networks={"make": Network(signature, low.graphs["make"], low.weights)})
    rows, *_ = given(net, 1, 300)
    silence, ben = np.full((1, rows.shape[1]), -0.5, np.float32), ((1.0, style_space(system).by_name("ben")),)
    for setting in (live(signature), whole(signature)):

        def play_seeds(*seeds, setting=setting, **options):
            who = decoder(system, setting, ben, seeds, silence, **options)
            return np.concatenate([who.push(rows), who.finish(silence)], 1)

        together = play_seeds(*range(8))
        assert together.shape == (8, 300, 96)
        assert together[0].tobytes() == play_seeds(0)[0].tobytes()
        assert together[7].tobytes() == play_seeds(7)[0].tobytes()
        assert (np.abs(together[0] - together[1]).max() > 1e-3) == (name not in ("stage", "speech2gesture"))
    if signature.reach is not None:
        around = whole(signature).ahead
        all_rows = np.concatenate(
            [np.repeat(silence, around, 0), rows, np.repeat(silence, around + -300 % signature.multiple, 0)]
        )
        style = np.zeros((1, len(all_rows), signature.width("style")), np.float32)
        style[..., 1:2] = 1
        expected = run_network(net, all_rows, style, np.zeros((1, len(all_rows), signature.width("noise")), np.float32))
        np.testing.assert_allclose(play_seeds(0, temperature=0.0), expected[:, around : around + 300], atol=1e-4)
