"""Systems of windows that play: the calls of every model, styles, examples, changes of style, streams to the bit."""

from __future__ import annotations

import json
from functools import cache, partial
from math import inf
from pathlib import Path

import numpy as np
import pytest
import soundfile as sf

from cospeech import generate as generating
from cospeech.errors import InputError
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import humanoid
from cospeech.rules import STYLES, RuleBasedModel
from cospeech.runtime.flow.latent_sources import CodeSource
from cospeech.runtime.model import TrainedModel
from cospeech.runtime.sliding_window_decoder import LIVE
from cospeech.runtime.styles.embedding import stretches
from cospeech.runtime.styles.space import style_space
from tests.support.fake_windows import whole_system
from tests.support.runtime_bundles import cut, perform_changes, same, talk, write_small_window

BODY = ("body", "hands")


def gesturer(**kind) -> TrainedModel:
    return TrainedModel(whole_system(**kind))


@cache
def act(style: str = "lively", seconds: float = 9.0, fps: float = 30.0) -> Motion:
    return RuleBasedModel().generate(talk(seconds), style=STYLES[style], fps=fps, parts=BODY, emotion="neutral")


def away(a: Motion, b: Motion) -> float:
    return float(np.abs(a.rotations - b.rotations).max())


CUTS = ([], [1, 2, 7, 9000, 9001, 40_000], list(range(1600, 51_000, 1600)))

# as every gesturer -------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("look_ahead", [None, 0.0, 0.5, inf])
def test_pieces_do_not_show(look_ahead):
    speech = talk()
    whole = gesturer().generate(speech, seed=3, look_ahead=look_ahead)
    for edges in CUTS:
        pieces = list(gesturer().stream(cut(speech, edges), seed=3, look_ahead=look_ahead))
        assert same(Motion.concatenate(pieces), whole)
        np.testing.assert_allclose([piece.start for piece in pieces], np.cumsum([0, *map(len, pieces)])[:-1] / 30)
    assert (len(pieces) > 3) == (look_ahead != inf)  # it does stream


def test_longer_look_aheads_come_nearer_to_the_whole():
    """The fake network hears 9 frames to the left and right and steps by four."""
    speech = talk(6.0)
    whole, *others = (
        gesturer().generate(speech, look_ahead=seconds, temperature=0.0, parts=BODY) for seconds in (inf, 12 / 20, 0.2, 0.0)
    )
    assert same(others[0], whole)  # its reach
    assert 0 < away(others[1], whole) < away(others[2], whole)


@pytest.mark.slow
@pytest.mark.parametrize(("look_ahead", "frames"), [(None, 4 + 12), (0.0, 1), (0.5, 14), (inf, 268)])
def test_it_is_as_late_as_it_says(look_ahead, frames):
    speech, session = talk(15.0), gesturer().session(parts=BODY, look_ahead=look_ahead)
    samples, count, late = 0, 0, []
    for chunk in cut(speech, range(160, len(speech), 160)):
        samples += len(chunk)
        count += sum(len(piece) for piece in session.push(chunk))
        late.append(samples / 16_000 - count / 30)
    assert max(late) <= session.latency
    assert max(late) > session.latency - 0.2
    assert session.latency == pytest.approx((frames + 2) / 20 + 0.065, abs=0.001)


def test_intensity_scales_from_the_style_s_mean_pose():
    speech, s = talk(2.0), whole_system().statistics
    options = {"style": "ada:0.5,ben:0.5", "parts": BODY}
    still, half, full = (gesturer().generate(speech, intensity=k, **options).root for k in (0.0, 0.5, 1.0))
    assert np.ptp(still, 0).max() < 1e-6
    mean = s.speaker_mean[:2].mean(0) * s.pose_std + s.pose_mean
    np.testing.assert_allclose((still[0] - humanoid().offsets[0])[[0, 2]], mean[[0, 2]], atol=1e-5)
    np.testing.assert_allclose((half - still)[:, 0], (full - still)[:, 0] / 2, atol=1e-5)


def test_latents_are_of_flows():
    with pytest.raises(InputError, match="transfer"):
        TrainedModel(whole_system(), CodeSource)


# styles ------------------------------------------------------------------------------------------------------------------


def test_styles_are_speakers_and_mixtures(monkeypatch):
    speech = talk(2.0)
    plain, ada, ben, mixture, by_weights = (
        gesturer().generate(speech, style=s, parts=BODY)
        for s in (None, "ada", "ben", "ada:0.7,ben:0.3", {"ada": 0.7, "ben": 0.3})
    )
    assert same(plain, ada)
    assert same(mixture, by_weights)
    assert min(away(ada, ben), away(mixture, ada), away(mixture, ben)) > 0.01
    assert (gesturer().styles, gesturer().default_style) == (("ada", "ben", "cleo"), "ada")
    network, styles = whole_system().main_network, []
    run = network.run
    monkeypatch.setattr(network, "run", lambda **given: styles.append(given["style"]) or run(**given))
    gesturer().generate(speech, style="ada:3,cleo:1", parts=BODY)
    assert styles
    assert all(np.allclose(style, [0.75, 0, 0.25], atol=1e-6) for style in styles)


def test_a_name_has_no_mixture_and_a_mixture_is_told():
    mixtures = {None: None, "ben": None, "ada:0.7,ben:0.3": {"ada": 0.7, "ben": 0.3}, "ben:0.999,cleo:0.001": {"ben": 0.999}}
    mixtures |= {"cleo:1,ada:2": {"ada": 0.667, "cleo": 0.333}, "cleo:0.25": {"ada": 0.75, "cleo": 0.25}, "cleo:3": None}
    for style, mixture in mixtures.items():
        assert gesturer().session(style=style).style_mixture == mixture
    assert list(gesturer().session(style="cleo:2,ada:1,ben:2").style_mixture) == ["ben", "cleo", "ada"]


def test_an_example_is_the_nearest_mixture():
    system, clip = whole_system(), act()
    embedding = style_space(system).by_example(clip)
    (poses,) = embedding.poses
    windows = [poses[k : k + 64] for k in (*range(0, len(poses) - 64, 32), len(poses) - 64)]
    assert len(windows) > 3
    expected = np.mean([system.networks["style"].run(poses=window[None])["style"][0] for window in windows], 0)
    np.testing.assert_allclose(embedding.code, expected, atol=1e-6)
    assert embedding.code.min() >= 0
    assert embedding.code.sum() == pytest.approx(1)
    np.testing.assert_allclose(embedding.speaker_mean, expected @ system.statistics.speaker_mean, atol=1e-6)
    session = gesturer().session(style=clip)
    weights = {name: round(float(w), 3) for name, w in zip(system.styles, expected, strict=True) if w >= 0.005}
    assert session.style_mixture == weights
    assert list(session.style_mixture.values()) == sorted(weights.values(), reverse=True)
    speech = talk(1.5)
    spelt = dict(zip(system.styles, map(float, embedding.code), strict=True))
    np.testing.assert_allclose(
        gesturer().generate(speech, style=clip, parts=BODY).rotations,
        gesturer().generate(speech, style=spelt, parts=BODY).rotations,
        atol=1e-4,
    )


def test_examples_mix_with_names():
    clip, system = act(), whole_system()
    code = style_space(system).by_example(clip).code
    session = gesturer().session(style={clip: 0.5, "ben": 0.5})
    expected = 0.5 * code + 0.5 * np.eye(3)[1]
    assert session.style_mixture == {
        name: round(float(w), 3) for name, w in zip(system.styles, expected, strict=True) if w >= 0.005
    }


def test_a_free_code_goes_with_the_example_s_own_mean_pose():
    system = whole_system(styles="code")
    embedding = style_space(system).by_example(act())
    assert system.style_space == "code"
    np.testing.assert_allclose(embedding.speaker_mean, embedding.poses[0].mean(0), atol=1e-5)
    assert style_space(system).shares(((1.0, embedding),)) is None
    assert gesturer(styles="code").session(style={act(): 0.5}).style_mixture is None
    assert len(gesturer(styles="code").generate(talk(1.0), style=act())) == 30


def test_an_encoder_s_nonsense_becomes_weights(monkeypatch):
    system = whole_system(fps=21.0)
    for odd, weights in {
        (-1.0, 3.0, 1.0): (0, 0.5, 0.5),
        (np.nan, 1.0, 0.0): (0, 1, 0),
        (-1.0, -1.0, 0.0): (1 / 3,) * 3,
    }.items():
        output = {"style": np.array([odd], np.float32)}
        monkeypatch.setattr(system.networks["style"], "run", lambda poses, output=output: output)
        np.testing.assert_allclose(style_space(system).by_example(act()).code, weights, atol=1e-6)


def test_examples_that_are_too_short_or_of_no_use(tmp_path):
    with pytest.raises(InputError, match=r"the example has only 3\.17 s.*3\.2 s at least"):
        gesturer().session(style=act()[:95])
    assert gesturer().session(style=act()[:96]).style_mixture
    short, stick = tmp_path / "short.npz", tmp_path / "stick.bvh"
    act()[:40].save(short)
    stick.write_text(
        "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n"
        "JOINT b\n{\nOFFSET 0 10 0\nCHANNELS 3 Zrotation Xrotation Yrotation\nEnd Site\n{\nOFFSET 0 10 0\n}\n}\n}\n"
        "MOTION\nFrames: 120\nFrame Time: 0.033333\n" + "0 0 0 0 0 0 0 0 0\n" * 120
    )
    for path in (short, stick, tmp_path / "none.bvh"):
        with pytest.raises(InputError, match=path.name) as error:
            gesturer().session(style=path)
        assert "\n" not in str(error.value)
    for kind in ({"recognises": False}, {"styles": "none", "recognises": False}):
        with pytest.raises(InputError, match="cannot take a style"):
            gesturer(**kind).session(style=act())


def test_a_long_example_is_seen_in_pieces_of_a_window_at_least():
    system = whole_system(fps=5.0)  # ten seconds would be 50 frames
    embedding = style_space(system).by_example(Motion.concatenate([act()] * 20))
    assert {len(poses) for poses in embedding.poses} <= {64, 65}
    assert len(embedding.poses) == 12


def test_stretches_overlap_by_half_and_reach_the_end():
    poses = np.arange(200)[:, None]
    assert [(s[0, 0], s[-1, 0]) for s in stretches(poses, 64)] == [(k, k + 63) for k in (0, 32, 64, 96, 128, 136)]
    assert len(stretches(poses[:64], 64)) == 1


# a style that changes ----------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("look_ahead", [None, inf])
def test_a_change_depends_on_the_samples_and_not_on_the_pieces(look_ahead):
    speech, changes = talk(4.0), {20_000: "ben", 23_333: "ada:0.5,cleo:0.5", 41_000: act()}
    play = partial(perform_changes, gesturer(), speech, changes=changes, seed=2, parts=BODY, look_ahead=look_ahead)
    at_once = play([])
    assert all(same(play(edges), at_once) for edges in CUTS)
    plain = gesturer().generate(speech, seed=2, parts=BODY, look_ahead=look_ahead)
    assert away(plain, at_once) > 0.01


@pytest.mark.slow
def test_what_was_before_a_change_and_what_comes_after():
    speech, samples = talk(9.0), 64_000
    motion = perform_changes(gesturer(), speech, [], {samples: "ben"}, parts=BODY, fps=20.0)
    before, after = (gesturer().generate(speech, style=style, parts=BODY, fps=20.0) for style in ("ada", "ben"))
    differs = (motion.rotations != before.rotations).any((1, 2))
    frame, lead = samples // 800, LIVE.waits - 2 + whole_system().smooth + 2
    assert not differs[: frame - lead].any()
    assert differs[frame + LIVE.hop :].mean() > 0.9
    end = frame + 10 + LIVE.past + LIVE.hop
    assert motion.rotations[end:].tobytes() == after.rotations[end:].tobytes()


def test_a_change_is_told_and_a_wrong_one_changes_nothing():
    speech = talk(3.0)
    session = gesturer().session(parts=BODY, style="ada:0.5,ben:0.5")
    motions = list(session.push(cut(speech, [16_000])[0]))
    for wrong in ("bem", 7, "ada:nan", act()[:20]):
        with pytest.raises(InputError):
            session.restyle(wrong)
    assert session.style_mixture == {"ada": 0.5, "ben": 0.5}
    motions += session.push(cut(speech, [16_000])[1])
    motions += session.finish()
    assert same(Motion.concatenate(motions), gesturer().generate(speech, style="ada:0.5,ben:0.5", parts=BODY))
    session.restyle("cleo:0.5,ben:0.5")
    assert session.style_mixture == {"ben": 0.5, "cleo": 0.5}


def test_a_change_before_any_speech_fades_from_the_beginning():
    speech = talk(4.0)
    session = gesturer().session(parts=BODY, fps=20.0)
    session.restyle("ben")
    motion = Motion.concatenate([*session.push(speech), *session.finish()])
    ben = gesturer().generate(speech, style="ben", parts=BODY, fps=20.0)
    end = 10 + LIVE.past + LIVE.hop + 3
    assert motion.rotations[end:].tobytes() == ben.rotations[end:].tobytes()
    assert away(motion, ben) > 0.001


# from files --------------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_report_tells_the_mixture(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(generating, "load_model", lambda name: gesturer())
    sf.write("talk.wav", talk(1.0).samples, 16_000)
    act().save("clip.bvh")
    mixtures = {
        "clip.bvh": gesturer().session(style="clip.bvh").style_mixture,
        "ben": None,
        "cleo:3,ada:1": {"cleo": 0.75, "ada": 0.25},
    }
    for style, mixture in mixtures.items():
        generating.generate_files("talk.wav", ["a.bvh"], style=style, parts=BODY, report="r.json")
        report = json.loads((tmp_path / "r.json").read_text())
        assert report["style_mixture"] == mixture
        assert report["style"] == style
    assert mixtures["clip.bvh"]


@pytest.mark.slow
def test_takes_in_one_pass_are_the_files_of_their_seeds(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(generating, "load_model", lambda name: gesturer())
    sf.write("talk.wav", talk(1.0).samples, 16_000)
    generating.generate_files("talk.wav", ["a.npz"], seed=2, takes=8, parts=BODY)
    files = set()
    for take in range(8):
        generating.generate_files("talk.wav", ["alone.npz"], seed=2 + take, parts=BODY)
        content = (tmp_path / f"a.{take + 1}.npz").read_bytes()
        assert content == (tmp_path / "alone.npz").read_bytes()
        files.add(content)
    assert len(files) == 8


def test_named_styles_are_rows_of_codes():
    system = whole_system(styles="code")
    for k, name in enumerate(system.styles):
        embedding = style_space(system).by_name(name)
        assert (embedding.code == system.statistics.style_codes[k]).all()
        assert (embedding.speaker_mean == system.statistics.speaker_mean[k]).all()


def test_a_bundle_on_stage(tmp_path, monkeypatch):
    """From a file, through onnxruntime: streams, takes, an example, another style while it plays."""
    pytest.importorskip("onnx", reason="graphs are built with onnx (the train extra)")
    monkeypatch.chdir(tmp_path)
    model = "small.cospeech"
    write_small_window(Path(model))
    sf.write("talk.wav", talk(2.0).samples, 16_000)
    act().save("clip.bvh")
    options = {"model": model, "parts": BODY, "style": "clip.bvh:0.5,ben:0.5"}
    result = generating.generate_files("talk.wav", ["a.npz"], seed=3, takes=8, report="r.json", **options)
    assert sum(result.style_mixture.values()) == pytest.approx(1, abs=0.01)
    assert json.loads(Path("r.json").read_text(encoding="utf-8"))["style_mixture"] == result.style_mixture
    generating.generate_files("talk.wav", ["alone.npz"], seed=5, **options)
    assert Path("a.3.npz").read_bytes() == Path("alone.npz").read_bytes()
    assert len({Path(f"a.{take}.npz").read_bytes() for take in range(1, 9)}) == 8
    player, speech = TrainedModel.open(model), talk(3.0)
    for look_ahead in (None, inf):
        whole = player.generate(speech, style="ben", look_ahead=look_ahead)
        assert same(Motion.concatenate(list(player.stream(cut(speech, CUTS[1]), style="ben", look_ahead=look_ahead))), whole)
    play = partial(perform_changes, player, speech, changes={20_000: "ben", 31_000: act()}, parts=BODY)
    assert same(play(CUTS[2]), play([]))
