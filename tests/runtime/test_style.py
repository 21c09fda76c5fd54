"""Styles of bundles: examples of any skeleton and length, mixtures, strength; three ways of transfer."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache, partial
from itertools import pairwise
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest
import soundfile as sf

from cospeech.audio.speech import Speech
from cospeech.audio.speech import example as speech_example
from cospeech.errors import InputError
from cospeech.generate import generate_files
from cospeech.models import BUNDLE, SHIPPED, load
from cospeech.motion.motion import Motion
from cospeech.motion.rotations import axis_angle_to_quat, quat_conjugate, quat_multiply, quat_rotate
from cospeech.motion.skeleton import humanoid
from cospeech.rules import STYLES, RuleBasedModel
from cospeech.rules.styles import find_style
from cospeech.runtime.flow.latent_sources import CodeSource, NormalSource, SegmentSource
from cospeech.runtime.model import TrainedModel
from cospeech.runtime.styles.space import FlowSpace
from cospeech.runtime.styles.style import Styles, example_files
from cospeech.runtime.system import System, open_bundle
from tests.support.runtime_bundles import write_small

WAYS = {
    "code": CodeSource,
    "segments": SegmentSource,
    "normal": NormalSource,
    "segments-alone": partial(SegmentSource, coded=False),
    "normal-alone": partial(NormalSource, coded=False),
}
BODY = ("body", "hands")


@cache
def system(pose: str = "expmap-humanoid", fps: float = 20.0, audio: str = "mel20-prosody") -> System:
    """Random weights: nothing has been learnt, but every way from example to motion is there."""
    return open_bundle(write_small(Path(mkdtemp(prefix="cospeech-test-")) / "small.cospeech", pose, audio, fps))


def space() -> FlowSpace:
    return FlowSpace(system(), system().flow)


def gesturer(way: str = "code") -> TrainedModel:
    return TrainedModel(system(), WAYS[way])


def talk(seconds: float = 3.0, rate: int = 16_000, seed: int = 0) -> Speech:
    """Noise in bursts that are like syllables."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * rate)) / rate
    sound = np.sin(2 * np.pi * 140 * t) * np.maximum(np.sin(2 * np.pi * 2.5 * t), 0) * (t % 1.7 < 1.2)
    return Speech((0.3 * sound + 0.001 * rng.normal(size=len(t))).astype(np.float32), rate)


@cache
def act(
    hand: float, height: float = 0.0, seconds: float = 9.0, fps: float = 30.0, style: str = "lively", hold: float = 0.8
) -> Motion:
    """The rule-based gesturer with one hand only, the left one (0) or the right one (1), low or high."""
    one = replace(STYLES[style], hand=hand, both=0.0, symmetry=0.0, height=height, rest="low", hold=hold)
    return RuleBasedModel().generate(talk(seconds), style=one, fps=fps, parts=BODY, emotion="neutral")


def same(a: Motion, b: Motion) -> bool:
    return a.rotations.tobytes() == b.rotations.tobytes() and a.root.tobytes() == b.root.tobytes()


def wrists(motion: Motion) -> np.ndarray:
    """(T, 2, 3): left, right."""
    index = humanoid().index
    return motion.positions()[:, [index["leftHand"], index["rightHand"]]]


def code(motion: Motion) -> np.ndarray:
    return space().by_example(motion).code


# what an example does ---------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
def test_two_examples_give_two_motions(way):
    speech, left, right = talk(), act(0.0), act(1.0)
    a, b, again = (gesturer(way).generate(speech, style=s, parts=BODY, seed=1) for s in (left, right, left))
    assert same(a, again)
    assert np.abs(a.rotations - b.rotations).max() > 0.01
    assert len(a) == speech.frames(30)


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
def test_streams_are_wholes_and_takes_are_seeds(way):
    speech, style = talk(3.3), {act(0.0): 0.6, "ben": 0.4}
    whole = gesturer(way).generate(speech, style=style, seed=3, parts=BODY)
    for edges in ([1, 9000, 9001, 40_000], list(range(1600, 51_000, 1600))):
        bounds = [0, *edges, len(speech)]
        pieces = [Speech(speech.samples[a:b], speech.rate) for a, b in pairwise(bounds)]
        assert same(Motion.concatenate(list(gesturer(way).stream(pieces, style=style, seed=3, parts=BODY))), whole)
    takes = gesturer(way).generate_takes(speech, takes=3, style=style, seed=2, parts=BODY)
    assert same(takes[1], whole)
    assert not np.allclose(takes[0].rotations, takes[2].rotations, atol=1e-2)


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
def test_nothing_of_an_example_is_the_default(way):
    speech = talk()
    plain = gesturer(way).generate(speech, seed=4, parts=BODY)
    assert same(gesturer(way).generate(speech, style={act(0.0): 0}, seed=4, parts=BODY), plain)
    assert same(gesturer(way).generate(speech, style="ada", seed=4, parts=BODY), plain)
    assert same(gesturer(way).generate(speech, style="ben:0", seed=4, parts=BODY), plain)


def test_weights():
    styles, a, b = Styles(system(), space()), act(0.0), act(1.0)
    half = styles.blend({a: 0.5})
    assert [share for share, _ in half] == [0.5, 0.5]
    np.testing.assert_array_equal(half[1][1].code, space().by_name("ada").code)
    assert [share for share, _ in styles.blend({a: 3, "ben": 1})] == [0.75, 0.25]
    assert [share for share, _ in styles.blend({a: 0.7, b: 0.3})] == [0.7, 0.3]
    assert [share for share, _ in styles.blend({a: 0.7, b: 0.2, "ben": 0.1})] == pytest.approx([0.7, 0.2, 0.1])
    assert [share for share, _ in styles.blend("ben:0.25")] == [0.25, 0.75]
    assert [share for share, _ in styles.blend("ada:0.1,ben,ada:0.1")] == pytest.approx([0.2 / 1.2, 1 / 1.2])
    mixture, parts = (
        CodeSource(system(), styles.blend({a: 0.7, b: 0.3}), seed=0),
        (space().by_example(a), space().by_example(b)),
    )
    np.testing.assert_allclose(mixture.style, 0.7 * parts[0].code + 0.3 * parts[1].code, atol=1e-6)


@pytest.mark.slow
def test_mixtures_lie_between():
    """Without movement what is left is the mean pose, which follows the examples even where nothing was learnt."""
    speech, low, high = talk(1.5), act(1.0, -0.2, hold=1.0), act(1.0, 0.25, hold=1.0)
    heights = []
    for weight in (0.0, 0.25, 0.5, 0.75, 1.0):
        style = {high: weight, low: 1 - weight}
        motion = gesturer().generate(speech, style=style, intensity=0, parts=BODY, seed=1)
        heights.append(wrists(motion)[:, 1, 1].mean())
    assert (np.diff(heights) > 0.005).all()
    assert heights[-1] - heights[0] > 0.05
    posture = [gesturer().generate(speech, style=s, intensity=0, parts=BODY, seed=1) for s in (act(0.0), act(1.0))]
    above = [wrists(motion).mean(0)[:, 1] for motion in posture]
    assert above[0][0] > above[0][1] + 0.05  # the hand that gestures is the higher one
    assert above[1][1] > above[1][0] + 0.05


@pytest.mark.slow
def test_five_minutes_with_an_example():
    motion = gesturer("segments").generate(talk(300.0), style=act(0.0), fps=20, parts=BODY)
    assert len(motion) == 6000
    assert np.abs(np.diff(wrists(motion[-400:]), axis=0)).max() > 1e-3  # it still moves


# latents -----------------------------------------------------------------------------------------------------------------


def test_latents_of_an_example_make_it_again():
    embedding = space().by_example(act(0.0))
    (poses,), sizes = embedding.poses, system().flow.sizes
    (z,) = space().latents(embedding, embedding.code)
    assert z.shape == (len(poses) - sizes.history, sizes.pose)
    takes = system().flow.begin(poses[None, : sizes.history], embedding.code[None])
    windows = np.zeros((40, sizes.speech_frames, sizes.audio), np.float32)
    np.testing.assert_allclose(takes.frames(windows, z[None, :40])[0], poses[sizes.history :][:40], atol=0.02)


def test_segments_are_the_examples_latents_in_order_then_stretches_of_them():
    embedding = space().by_example(act(0.0))
    (z,) = space().latents(embedding, embedding.code)
    source = SegmentSource(system(), ((1.0, embedding),), seed=5)
    latents = np.concatenate([source.draw(n) for n in (1, 3, 76, len(z) - 80 + 200)])
    np.testing.assert_allclose(latents[: len(z)], z, atol=1e-4)
    seconds = latents[len(z) :].reshape(10, 20, -1)
    places = [np.abs(z[None] - second[0]).max(-1).argmin() for second in seconds]
    for place, second in zip(places, seconds, strict=True):
        np.testing.assert_allclose(second, z[place : place + 20], atol=1e-4)
    assert len(set(places)) > 5
    still = SegmentSource(system(), ((1.0, embedding),), seed=5, temperature=0.0).draw(300)
    np.testing.assert_allclose(still, np.broadcast_to(z.mean(0), still.shape), atol=1e-4)


@pytest.mark.slow
def test_normal_latents_have_the_examples_mean_and_covariance():
    embedding = space().by_example(act(0.0, seconds=30.0))
    (z,) = space().latents(embedding, embedding.code)
    latents = NormalSource(system(), ((1.0, embedding),), seed=0).draw(40_000)
    np.testing.assert_allclose(latents.mean(0), z.mean(0), atol=0.1 * z.std(0).max())
    trust = len(z) / (len(z) + z.shape[1])
    expected = trust * np.cov(z.T, bias=True) + (1 - trust) * 50 / 48 * np.eye(z.shape[1])
    np.testing.assert_allclose(np.cov(latents.T), expected, atol=0.06 * np.diag(expected).max())
    plain = NormalSource(system(), ((1.0, space().by_name("ada")),), seed=0).draw(200)
    np.testing.assert_allclose(plain, CodeSource(system(), ((1.0, space().by_name("ada")),), seed=0).draw(200), atol=1e-5)


# any skeleton, any length, any place ------------------------------------------------------------------------------------


def away(a: np.ndarray, b: np.ndarray) -> float:
    """Difference of two codes in units of how far two styles are apart."""
    return float(np.linalg.norm(a - b) / np.linalg.norm(code(act(0.0)) - code(act(1.0))))


@pytest.mark.parametrize("skeleton", ["mixamo", "beat", "vrm", "trinity", "smplx"])
def test_any_skeleton(skeleton):
    assert away(code(act(0.0).retarget(skeleton)), code(act(0.0))) < 0.1


@pytest.mark.parametrize("suffix", [".bvh", ".glb", ".npz", ".vrma"])
def test_any_file(suffix, tmp_path):
    path = tmp_path / f"my clip, left{suffix}"  # a comma in the name of a file that is there
    act(0.0).save(path)
    styles = Styles(system(), space())
    ((share, embedding),) = styles.blend(str(path))
    assert share == 1
    assert away(embedding.code, code(act(0.0))) < 0.1
    assert styles.blend(path)[0][1] is embedding  # not read again
    plain = path.rename(tmp_path / f"C:clip{suffix}")
    assert [share for share, _ in styles.blend(f"{plain}:0.25, ben:0.5")] == [0.25, 0.5, 0.25]
    np.testing.assert_array_equal(styles.blend(f"{plain}:0.25")[0][1].code, embedding.code)


@pytest.mark.slow
def test_rate_place_and_heading_do_not_matter():
    motion = act(0.0)
    assert away(code(act(0.0, fps=60.0)), code(motion)) < 0.15

    def poses_elsewhere(angle: float) -> np.ndarray:
        turn = axis_angle_to_quat([0, 1, 0], angle)
        rotations = motion.rotations.copy()
        rotations[:, 0] = quat_multiply(turn, rotations[:, 0])
        root = quat_rotate(turn, np.asarray(motion.root, float)) + np.array([5.0, 0, -3.0])
        return space().by_example(Motion(motion.fps, rotations, root.astype(np.float32))).poses[0]

    there, here = poses_elsewhere(2.0), space().by_example(motion).poses[0]
    assert np.abs(there - poses_elsewhere(-1.5)).mean() < 0.005  # of a deviation: both are turned to the front
    assert np.abs(there - here).mean() < 0.05  # what is left is the heading that the person kept, which was not quite 0
    ahead = space().by_example(Motion(motion.fps, motion.rotations, motion.root + np.array([0.05, 0, 0]))).poses[0]
    assert np.abs(ahead[:, 0] - here[:, 0]).min() > 0.1  # a step aside is the person's own


@pytest.mark.slow
def test_who_turns_bends_and_walks_leaves_the_flow_on_its_feet():
    """Of an example whose person goes about the room, the flow that ships takes the manner and stands."""
    motion = act(0.0, seconds=10.0)
    times = motion.times[:, None]
    turn = axis_angle_to_quat([0, 1, 0], 2.5 * np.sin(times[:, 0]))
    bow = axis_angle_to_quat([1, 0, 0], 0.6 + 0.6 * np.sin(0.7 * times[:, 0]))
    rotations = motion.rotations.copy()
    rotations[:, 0] = quat_multiply(quat_multiply(turn, bow), rotations[:, 0])
    root = motion.root + np.concatenate([np.sin(times), -0.3 - 0.3 * np.sin(times), np.cos(times)], 1)
    about = Motion(motion.fps, rotations, root.astype(np.float32))
    model = load("stylised-flow")
    result = model.generate(talk(6.0), style=about, **model.for_files)
    places, index = result.positions(), result.skeleton.index
    feet = (places[:, index["leftFoot"]] + places[:, index["rightFoot"]]) / 2
    for low, high, most in ((feet, places[:, index["hips"]], 15), (places[:, index["hips"]], places[:, index["neck"]], 40)):
        way = high - low
        lean = np.degrees(np.arccos(way[:, 1] / np.linalg.norm(way, axis=1)))
        assert lean.max() < most


@pytest.mark.slow
def test_long_examples_are_seen_in_pieces():
    motion, other = (act(hand, style="natural", seconds=60.0) for hand in (0.0, 1.0))
    long = Motion.concatenate([motion] * 3 + [other] * 3)  # six minutes
    embedding = space().by_example(long)
    assert sum(map(len, embedding.poses)) == 120 * 20
    assert len(embedding.poses) == 12
    first, last = (np.concatenate(pieces).mean(0) for pieces in (embedding.poses[:6], embedding.poses[6:]))
    means = [np.concatenate(space().by_example(each).poses).mean(0) for each in (motion, other)]
    away = [[np.linalg.norm(half - mean) for mean in means] for half in (first, last)]
    assert away[0][0] < 0.75 * away[0][1]  # the first six are of one hand, the others of the other hand
    assert away[1][1] < 0.75 * away[1][0]
    half = Motion.concatenate([long] * 5)
    assert sum(map(len, space().by_example(half).poses)) == 120 * 20


@pytest.mark.slow
def test_the_shortest_example():
    embedding = space().by_example(act(0.0)[:30])
    assert np.isfinite(embedding.code).all()
    speech = talk(5.0)
    for way in WAYS:
        assert len(gesturer(way).generate(speech, style=act(0.0)[30:60], parts=BODY)) == 150
    with pytest.raises(InputError, match=r"0\.97 s"):
        space().by_example(act(0.0)[:29])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("pose", "fps", "audio"), [("direction-vectors", 15.0, "mel29-linear"), ("expmap-upper", 20.0, "mel27")]
)
def test_other_poses(pose, fps, audio):
    other = TrainedModel(system(pose, fps, audio))
    a, b = (other.generate(talk(), style=act(hand), parts=BODY) for hand in (0.0, 1.0))
    assert np.abs(a.rotations - b.rotations).max() > 0.005


# what cannot be ----------------------------------------------------------------------------------------------------------


def test_bad_examples(tmp_path):
    styles = Styles(system(), space())
    damage = tmp_path / "broken.bvh"
    damage.write_text("HIERARCHY\nROOT hips\n{")
    stick = tmp_path / "stick.bvh"
    stick.write_text(
        "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n"
        "JOINT b\n{\nOFFSET 0 10 0\nCHANNELS 3 Zrotation Xrotation Yrotation\nEnd Site\n{\nOFFSET 0 10 0\n}\n}\n}\n"
        "MOTION\nFrames: 60\nFrame Time: 0.033333\n" + "0 0 0 0 0 0 0 0 0\n" * 60
    )
    short = tmp_path / "short.npz"
    act(0.0)[:10].save(short)
    told_of = {
        "broken.bvh": damage, "stick.bvh": stick, "short.npz": short, "none.bvh": tmp_path / "none.bvh", "clip.mp3": "clip.mp3",
        "did you mean 'ada'": "adda", "weight 'x' of style 'ada'": "ada:x", "weight 'x' of style 'clip.bvh'": "clip.bvh:x",
        "style ''": "", "style ' '": " ", "is called ''": ",", "null": "a\0.bvh",
    }  # fmt: skip
    for word, wrong in told_of.items():
        with pytest.raises(InputError, match=r"^[^\n]*$") as error:
            styles.blend(str(wrong))
        assert word in str(error.value)
    for wrong in ("ada:nan", "ada:-1,ben:3", "ada:1e300,ben:1e300", "ada:inf"):
        with pytest.raises(InputError, match="weights of style"):
            styles.blend(wrong)
    for odd in (7, {}, {7: 1.0}, {"ada": "x"}, {"ada": True}, {"ada": np.nan}, ["ada"], b"ada"):
        with pytest.raises(InputError):
            styles.blend(odd)


def test_a_file_that_changes_is_read_again(tmp_path):
    path, styles = tmp_path / "a.bvh", Styles(system(), space())
    act(0.0).save(path)
    first = styles.blend(path)[0][1]
    act(1.0, seconds=5.0).save(path)
    assert not np.allclose(styles.blend(path)[0][1].code, first.code, atol=1e-3)


# from the command line -----------------------------------------------------------------------------------------------


def test_files_named_by_a_style(tmp_path):
    comma = tmp_path / "a,b.bvh"
    comma.touch()
    for style, files in {
        "ada": [], "a.bvh": ["a.bvh"], "a.bvh:0.5, ada , x/B.GLB:2": ["a.bvh", "x/B.GLB"], "C:\\a.npz:1": ["C:\\a.npz"],
        str(comma): [str(comma)],
    }.items():  # fmt: skip
        assert example_files(style) == [Path(file) for file in files]
    assert example_files({Path("a.bvh"): 1, "ada": 2, act(0.0): 3}) == [Path("a.bvh")]
    assert example_files(None) == example_files(act(0.0)) == example_files(7) == []


@pytest.mark.slow
def test_generate_files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_small(tmp_path / "small.cospeech")
    act(0.0).save("clip.bvh")
    sf.write("talk.wav", talk(1.5).samples, 16_000)
    options = {"model": "small.cospeech", "parts": BODY, "takes": 2, "seed": 1}
    plain = generate_files("talk.wav", ["plain.bvh"], **options)
    assert plain.style == "ada"
    result = generate_files("talk.wav", ["by_text.bvh"], style="clip.bvh:0.5,ben:0.25", report="r.json", **options)
    assert result.style == "clip.bvh:0.5,ben:0.25"
    assert json.loads(Path("r.json").read_text(encoding="utf-8"))["style"] == result.style
    by_dict = generate_files("talk.wav", ["by_dict.bvh"], style={Path("clip.bvh"): 0.5, "ben": 0.25}, **options)
    assert by_dict.style == "clip.bvh:0.5,ben:0.25"
    assert generate_files("talk.wav", ["by_motion.bvh"], style=act(0.0), **options).style == "example"
    texts = [Path(f"{name}.2.bvh").read_text(encoding="utf-8") for name in ("plain", "by_text", "by_dict", "by_motion")]
    assert texts[1] == texts[2]
    assert len(set(texts)) == 3
    before = Path("clip.bvh").read_bytes()
    with pytest.raises(InputError, match="overwrite"):
        generate_files("talk.wav", ["clip.bvh"], style="clip.bvh:0.5", model="small.cospeech")
    with pytest.raises(InputError, match="cannot learn a style from an example"):
        generate_files("talk.wav", ["other.bvh"], style="clip.bvh", model="rules")
    assert Path("clip.bvh").read_bytes() == before
    assert not Path("other.bvh").exists()


def test_a_dict_is_a_mixture_for_the_rules_too():
    assert find_style({"lively": 0.5, "calm": 0.5}) == find_style("lively:0.5,calm:0.5")
    with pytest.raises(InputError, match="did you mean 'lively'"):
        find_style({"livly": 1.0})


# learnt: the bundle that ships -----------------------------------------------------------------------------------------


@cache
def load_shipped() -> TrainedModel:
    path = SHIPPED / f"stylised-flow{BUNDLE}"
    if not path.is_file():
        pytest.skip("needs the weights that ship, and there are none (tools/build_weights.py)")
    return TrainedModel.open(path)


@cache
def rest_one_arm(hand: float) -> Motion:
    """As `act`, but the other arm hangs still."""
    motion, idle = act(hand, seconds=12.0, style="lively"), "right" if hand == 0 else "left"
    rotations = motion.rotations.copy()
    arm = [k for k, name in enumerate(humanoid().names) if name.startswith((f"{idle}Upper", f"{idle}Lower", f"{idle}Hand"))]
    arm = [k for k in arm if "Leg" not in humanoid().names[k]]
    hangs = int(wrists(motion)[:, 1 if idle == "right" else 0, 1].argmin())
    rotations[:, arm] = rotations[hangs, arm]
    return replace(motion, rotations=rotations)


@cache
def performance(hand: float, seed: int = 0) -> Motion:
    """Eight seconds of speech in the style of an example of one hand."""
    return load_shipped().generate(talk(8.0, seed=3), style=rest_one_arm(hand), seed=seed, parts=BODY, emotion="neutral")


def wrists_of_performance(hand: float, seed: int = 0) -> np.ndarray:
    """(T, 2, 3) its wrists."""
    return wrists(performance(hand, seed))


def view_from_chest(hand: float, seed: int) -> np.ndarray:
    """(T, 2, 3) the same wrists without what the body does."""
    motion = performance(hand, seed)
    points, turns = motion.skeleton.forward(motion.rotations, motion.root)
    chest = humanoid().index["upperChest"]
    return quat_rotate(quat_conjugate(turns[:, [chest]]), wrists(motion) - points[:, [chest]])


def travel(path: np.ndarray) -> np.ndarray:
    """(2,) metres a second, left and right."""
    return np.linalg.norm(np.diff(path, axis=0), axis=-1).mean(0) * 30


@pytest.mark.slow
def test_the_hand_of_the_example_gestures():
    """From the chest, one hand moves more than the other in every performance; how much more depends on chance."""
    spread = [[np.linalg.norm(view_from_chest(hand, seed).std(0), axis=-1) for hand in (0.0, 1.0)] for seed in range(8)]
    left, right = (np.array([pair[k] for pair in spread]) for k in (0, 1))
    more = np.concatenate([left[:, 0] / left[:, 1], right[:, 1] / right[:, 0]])
    assert more.min() > 1.0
    assert (more > 1.1).mean() > 0.9
    assert np.median(more) > 1.7


@pytest.mark.slow
def test_size_follows_the_example():
    example = act(1.0, style="natural")
    frozen = {"rotations": np.repeat(example.rotations[:1], 270, 0), "root": np.repeat(example.root[:1], 270, 0)}
    examples = [example, replace(example, **frozen)]
    lively, still = (wrists(load_shipped().generate(talk(8.0), style=e, parts=BODY, emotion="neutral")) for e in examples)
    assert travel(still).max() < 0.1 * travel(lively).max()
    np.testing.assert_allclose(lively[:, 1].mean(0), wrists(example)[:, 1].mean(0), atol=0.12)


@pytest.mark.slow
@pytest.mark.parametrize("style", ["natural", "lively"])
def test_hands_go_as_far_as_in_the_example(style):
    speech = Speech.load(speech_example()[0])  # nineteen seconds, of a voice
    one = replace(STYLES[style], hand=1.0, both=0.0, symmetry=0.0, rest="low")
    example = RuleBasedModel().generate(speech, style=one, fps=30.0, parts=BODY, emotion="neutral", seed=1)
    result = load_shipped().generate(speech, style=example, parts=BODY, emotion="neutral")
    far, example_distance = (np.sqrt(wrists(motion)[:, 1].var(0).sum()) for motion in (result, example))
    assert 0.8 < far / example_distance < 1.25


@pytest.mark.slow
def test_weights_lead_from_one_example_to_the_other():
    left, right = rest_one_arm(0.0), rest_one_arm(1.0)
    lean = []
    for weight in (0.0, 0.25, 0.5, 0.75, 1.0):
        path = wrists(load_shipped().generate(talk(8.0), style={left: weight, right: 1 - weight}, parts=BODY))
        lean.append(float((path[:, 0, 1] - path[:, 1, 1]).mean()))
    assert (np.diff(lean) > 0).all()
    half = [wrists(load_shipped().generate(talk(8.0), style={left: w}, parts=BODY)) for w in (0, 0.5, 1)]
    lean = [float((path[:, 0, 1] - path[:, 1, 1]).mean()) for path in half]
    assert lean[0] < lean[1] < lean[2]
