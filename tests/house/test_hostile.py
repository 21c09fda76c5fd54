"""Small files that want gigabytes, minutes or a hang: each of the faults found by attack, and fuzzers of what found them.

3,300 cases over all formats, with the operators of hostile_files.py: each is read or refused in one line, soon, in bounded
memory.
"""

from __future__ import annotations

import ast
import inspect
import io
import json
import os
import random
import struct
import warnings
import zipfile
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import cospeech
from cospeech import InputError, Motion, Speech, limits
from cospeech.audio.emotions import read_emotion_track
from cospeech.audio.features.word_vectors import open_vectors
from cospeech.audio.forced_alignment import align, tokenise
from cospeech.audio.speech import Word, example, open_speech
from cospeech.audio.transcripts import load_words
from cospeech.corpora.beat2 import read_split
from cospeech.corpora.store_files import open_array, read_index
from cospeech.corpora.zeroeggs import read_info
from cospeech.errors import CospeechWarning
from cospeech.export import save
from cospeech.export.arrays import read_array
from cospeech.export.face_rig import _viseme
from cospeech.export.glb_container import split_glb
from cospeech.export.gltf import GltfFile
from cospeech.face.graphemes import graphemes_to_phones
from cospeech.generate import generate_files
from cospeech.limits import most_joint_frames
from cospeech.motion.bone_mapping import load_map, recognise
from cospeech.motion.skeleton import Skeleton
from cospeech.rules.lexicon import form_for
from cospeech.runtime.bundles.bundle import MANIFEST, Bundle, pack_arrays, read_bundle
from cospeech.runtime.bundles.graph_check import check_onnx
from cospeech.runtime.model import TrainedModel
from cospeech.training.checkpoint import read_facts, read_tensors
from cospeech.training.recipe import load_recipe
from tests.support.hostile_files import (
    answer,
    bent_tree,
    bounded_memory,
    face_csv,
    face_json,
    far_glb,
    glb_of,
    hostile_text,
    npz_of,
    peak_of,
)
from tests.support.motions import gesturing, stand_in
from tests.support.runtime_bundles import write_small

pytestmark = pytest.mark.slow

EACH = 170
MOST_MEMORY = 300  # MiB of a process that refuses a file; Python with numpy and this package has some 60
SOON = 3.0  # seconds; each takes milliseconds, and took ten seconds or more

# ---- each fault by itself ----


@pytest.mark.parametrize("tail", ["x", "", ".", "e", ".5e"])
def test_a_textgrid_with_a_long_number(tmp_path, tail):
    """Quadratic once: 10.9 s for 20,000 digits."""
    path = tmp_path / "a.TextGrid"
    path.write_text('"ooTextFile" "TextGrid" ' + "1" * 400_000 + tail)
    outcome, seconds, peak = peak_of(path, "cospeech.audio.transcripts.load_words(path, speech_seconds=9)")
    assert outcome.startswith("'a.TextGrid': a TextGrid with")
    assert seconds < SOON
    assert peak < MOST_MEMORY


@pytest.mark.parametrize(("suffix", "shift"), [(".csv", 0.0), (".json", 0.0), (".json", 12.0)])
def test_a_gap_in_the_times_is_bridged(tmp_path, suffix, shift):
    """Rows 0, 1 and 9 of thirty a second: ten frames, linear from the second to the last."""
    times = [shift + k / 30 for k in (0, 1, 9)]
    path = tmp_path / f"a{suffix}"
    if suffix == ".csv":
        path.write_bytes(face_csv(["00:00:00:00", "00:00:00:01", "00:00:00:09"]))  # weights 0, 0.1, 0.2
    else:
        weights = [{"weights": [k / 10], "time": time} for k, time in enumerate(times)]
        path.write_text(json.dumps({"names": ["jawOpen"], "frames": weights}))
    motion = Motion.load(path)
    assert (len(motion), motion.fps) == (10, 30)
    jaw = motion.face[:, cospeech.motion.skeletons.arkit.ARKIT_INDEX["jawOpen"]]
    np.testing.assert_allclose(jaw, [0, *np.linspace(0.1, 0.2, 9)], atol=1e-6)


@pytest.mark.parametrize("gaps", [(1, 9), (1, 9, 1, 9), (9, 1), (1, 2, 30, 1, 400), (7, 1, 1, 7)])
def test_gaps_of_any_pattern_keep_the_rate(tmp_path, gaps):
    at = np.cumsum([0, *gaps])
    path = tmp_path / "a.json"
    path.write_bytes(face_json(["jawOpen"], [k / 60 for k in at]))
    motion = Motion.load(path)
    assert (len(motion), motion.fps) == (at[-1] + 1, 60)


def bvh_of_many_joints(rows: int) -> bytes:
    """One channel, so that a row has two bytes, and joints without any."""
    joints = "".join(f"JOINT b{k}\n{{\nOFFSET 0 1 0\nCHANNELS 0\n}}\n" for k in range(4990))
    head = f"HIERARCHY\nROOT a\n{{\nOFFSET 0 0 0\nCHANNELS 1 Xrotation\n{joints}}}\nMOTION\nFrames: 1\nFrame Time: 0.03\n"
    return head.encode() + b"0\n" * rows


def npz_that_unpacks(**arrays: object) -> bytes:
    out = io.BytesIO()
    rows = {"poses": np.zeros((9, 165), "f4"), "trans": np.zeros((9, 3), "f4"), "mocap_frame_rate": 30}
    np.savez_compressed(out, **(rows | arrays))
    return out.getvalue()


GREEDY = {
    "far JSON": (".json", lambda _: face_json(["jawOpen"], [k / 60 for k in range(40_000)] + [66_000.0])),
    "JSON of many names": (
        ".json",
        lambda _: json.dumps({"names": ["jawOpen"] * 30_000, "frames": [{"weights": [], "time": 0}] * 30_000}).encode(),
    ),
    "far CSV": (".csv", lambda _: face_csv([f"00:00:{k // 30:02d}:{k % 30:02d}" for k in range(1500)] + ["11:00:00:00"])),
    "far GLB": (".glb", lambda folder: far_glb(folder, ".glb", 900, 5000.0)),
    "far VRMA": (".vrma", lambda folder: far_glb(folder, ".vrma", 900, 5000.0)),
    "NPZ of zeros": (".npz", lambda _: npz_that_unpacks(poses=np.zeros((250_000, 165)), trans=np.zeros((250_000, 3)))),
    "NPZ of many weights": (".npz", lambda _: npz_that_unpacks(arkit=np.zeros((1_000_000, 52), "f4"))),
    "NPZ of many rates": (".npz", lambda _: npz_that_unpacks(mocap_frame_rate=np.zeros(50_000_000))),
    "NPZ of a long path": (".npz", lambda _: npz_that_unpacks(trans=np.zeros((20_000_000, 3), "f4"))),
    "BVH of many joints": (".bvh", lambda _: bvh_of_many_joints(100_000)),
}  # fmt: skip


@pytest.mark.parametrize("name", GREEDY)
def test_small_files_that_want_gigabytes(tmp_path, name):
    """Refused before memory is taken for them; where they would become too large the limit is stated."""
    suffix, make = GREEDY[name]
    path = tmp_path / f"a{suffix}"
    path.write_bytes(make(tmp_path))
    assert path.stat().st_size < 3_000_000
    outcome, seconds, peak = peak_of(path)
    assert outcome != "read"
    assert peak < MOST_MEMORY, outcome
    assert seconds < SOON
    if "far" in name or name in ("NPZ of zeros", "BVH of many joints"):
        assert "frames is the most for a file of" in outcome


def test_what_a_small_file_may_become_is_read_in_moderate_memory(tmp_path):
    """The largest motion that a small file may become."""
    path = tmp_path / "a.glb"
    path.write_bytes(far_glb(tmp_path, ".glb", 300, 1000.0))
    outcome, _, peak = peak_of(path)
    assert outcome == "read"
    assert peak < 700


@pytest.mark.parametrize("sharing", ["samplers", "zeros"])
def test_accessors_that_share_their_bytes_have_a_budget(sharing):
    size = 40_000
    accessors = [
        {"componentType": 5126, "count": size, "type": "SCALAR"} | ({"bufferView": 0} if sharing == "samplers" else {})
    ]
    views = {"bufferViews": [{"buffer": 0, "byteLength": 4 * size}], "buffers": [{"byteLength": 4 * size}]}
    file = GltfFile({"asset": {"version": "2.0"}, "accessors": accessors * 1000, **views}, bytes(4 * size), "'a.glb'")

    def read_all() -> None:
        for k in range(1000):
            file.accessor(k, 1)

    with pytest.raises(InputError, match="numbers in 160,000 bytes"):
        read_all()


def test_a_bvh_in_one_line(tmp_path):
    """Quadratic once."""
    path = tmp_path / "a.bvh"
    path.write_text("HIERARCHY ROOT a { " + "END{}" * 190_000)
    began = peak_of(path)
    assert began[0].endswith("the file ends before 'MOTION' (is it cut short?)")
    assert began[1] < SOON


def test_a_bvh_whose_exponent_has_many_digits(tmp_path):
    save(gesturing(2), tmp_path / "a.bvh")
    text = (tmp_path / "a.bvh").read_text()
    line = next(line for line in text.splitlines() if line.startswith("Frame Time"))
    (tmp_path / "a.bvh").write_text(text.replace(line, "Frame Time: 0.0333e" + "0" * 5000))
    assert Motion.load(tmp_path / "a.bvh").fps == 30


@pytest.mark.parametrize("shape", ["chain", "star", "one name"])
def test_skeletons_of_five_thousand_joints(shape):
    count = 5000
    parents = tuple(range(-1, count - 1)) if shape == "chain" else (-1, *[0] * (count - 1))
    skeleton = Skeleton(tuple(f"b{k}" for k in range(count)), parents, np.full((count, 3), 0.01))
    assert answer(lambda: recognise(skeleton)) == "refused"
    assert skeleton.forward(skeleton.rest, np.zeros(3))[0].shape == (count, 3)
    if shape == "one name":
        with pytest.raises(InputError, match="joint names repeat: a"):
            Skeleton(("a",) * count, parents, np.zeros((count, 3)))


QUADRATIC = {  # what is done with n of something; each was quadratic
    "signs between words": lambda n: tokenise("a" + " -" * n),
    "signs in a text without blanks": lambda n: tokenise("あ" + "・" * n),
    "a word with a run of signs": lambda n: form_for("a" + "-" * n + "a"),
    "a name of visemes": lambda n: _viseme("viseme" * n + "1"),
    "a word of letters and digits": lambda n: graphemes_to_phones("a1" * n),
}  # fmt: skip


@pytest.mark.parametrize("name", QUADRATIC)
def test_scanners_look_at_each_character_once(name):
    assert answer(lambda: QUADRATIC[name](1_000_000)) == "read"


def test_a_long_word_does_not_become_gigabytes():
    """47 s and 7 GB once, in every model that moves the lips."""
    with bounded_memory():
        assert len(graphemes_to_phones("a1" * 500_000)) < 1000


def test_three_words_in_hours_of_speech_are_aligned_in_moderate_memory():
    """The search looked at all of the speech for each of them."""
    rng = np.random.default_rng(0)
    speech = Speech((0.1 * rng.standard_normal(1200 * 16_000)).astype(np.float32))
    with bounded_memory(300 << 20):
        words = align("one two three", speech)
    assert [word.text for word in words] == ["one", "two", "three"]


TRANSCRIPTS = {
    "ten million words": ("a.txt", b"a " * 10_000_000, "more than 500,000 words"),
    "ten million signs": ("b.txt", "字".encode() * 10_000_000, "more than 500,000 words"),
    "rows": ("a.tsv", b"0\t1\ta\n" * 3_000_000, "more than 500,000 words"),
    "silences": ("b.tsv", b"0\t1\t\n" * 3_000_000, "more than 500,000 words"),
    "lists": ("a.json", b"[" + b"[]," * 10_000_000 + b"[]]", "more than 4,000,000 values"),
    "subtitles": ("a.srt", b"00:01.000 --> 00:02.000\n\n" * 1_100_000, "more than 500,000 words"),
    "broken subtitles": ("b.srt", b"00:00:01:00 --> 00:00:02:00\n" * 500_000, "counts frames"),
    "times of words": ("a.vtt", b"00:01.000 --> 00:02.000\n" + b"a<00:01.500>" * 510_000, "more than 500,000 words"),
    "lines that roll": ("b.vtt", b"00:01.000 --> 00:01.000\na\nb\n\n" * 100_000, None),
    "elements": ("a.ttml", b"<tt>" + b"<p/>" * 2_100_000, "more than 2,000,000"),
    "depth": ("b.ttml", b"<tt>" * 6_000_000, "nested too deeply"),
    "lyrics": ("a.lrc", b"[00:01.00]" * 1_100_000 + b"a", "more than 500,000 words"),
    "columns": ("a.csv", b"start,end,text,x\n" + b"0,1,a,b\n" * 510_000, "more than 500,000 words"),
    "labels": ("c.srt", b"00:01.000 --> 00:02.000\n" + b"(A" * 5_000_000 + "A：".encode() * 1_000_000, None),
    "brackets": ("c.txt", b"[<({*a " * 510_000, "more than 500,000 words"),
    "laughs": ("d.txt", b"(laughs) a " * 510_000, "more than 500,000 words"),
}  # fmt: skip


@pytest.mark.parametrize("name", TRANSCRIPTS)
def test_transcripts_of_millions(tmp_path, name):
    file, data, problem = TRANSCRIPTS[name]
    (tmp_path / file).write_bytes(data)
    outcome, seconds, peak = peak_of(tmp_path / file, "cospeech.audio.transcripts.load_words(path, speech_seconds=9)")
    assert problem is None or problem in outcome
    assert seconds < 30  # a second or three
    assert peak < MOST_MEMORY


@pytest.mark.parametrize("entity", ["&#" + "1" * 5000, "&#" + "1" * 5000 + ";", "&#x" + "f" * 5000 + ";", "&" * 5000])
def test_a_subtitle_with_an_endless_character(tmp_path, entity):
    (tmp_path / "a.srt").write_text(f"1\n00:00:01,000 --> 00:00:02,000\nhello {entity}\n")
    assert load_words(tmp_path / "a.srt", speech_seconds=9)[0].text == "hello"


def test_an_emotion_track_of_blank_lines(tmp_path):
    (tmp_path / "a.csv").write_bytes(b"time,emotion\n" + b"\n" * (15 << 20))
    outcome, seconds, _ = peak_of(tmp_path / "a.csv", "cospeech.audio.emotions.read_emotion_track(path)")
    assert "more than 100,000 rows" in outcome
    assert seconds < SOON


HEAD = "{'descr': '<f4', 'fortran_order': False, 'shape': (9, 165), }"


@pytest.mark.parametrize(
    "head",
    [
        HEAD[:-3] + "(" * 5000, "{'descr': '''", HEAD.replace("9", "9" * 5000), HEAD.replace("'<f4'", "'|O'"),
        "\\\n" * 4000, "",
        HEAD.replace("'<f4'", "[('a', '<f4')]"), HEAD.replace("<f4", "<f" + "4" * 9),
        HEAD.replace("(9, 165)", "(" * 200 + ")" * 200),
        HEAD.replace("9, 165", "0, " + "9" * 15), HEAD.replace("<f4", "<U0"), "1" * 9990, "{'a':1}\n)" * 900, b"\xff" * 900,
        HEAD.replace("9, 165", ", ".join("1" * 33)), HEAD.replace("9, 165", "1" * 480), HEAD.replace("9, 165", "1, " * 2000),
    ],
)  # fmt: skip
def test_an_array_with_a_head_that_is_no_head(tmp_path, head):
    """numpy runs Python's tokeniser over such heads, which ends in TokenError or SystemError."""
    good = (HEAD.replace("9, 165", "9, 3"), bytes(108))
    rate = ("{'descr': '<f4', 'fortran_order': False, 'shape': (), }", struct.pack("<f", 30))
    (tmp_path / "a.npz").write_bytes(npz_of({"poses": (head, bytes(9 * 165 * 4)), "trans": good, "mocap_frame_rate": rate}))
    assert answer(lambda: Motion.load(tmp_path / "a.npz")) == "refused"
    raw = head if isinstance(head, bytes) else head.encode("latin-1", "replace")
    (tmp_path / "a.npy").write_bytes(b"\x93NUMPY\x02\x00" + struct.pack("<I", len(raw)) + raw + bytes(100))
    assert answer(lambda: open_array(tmp_path / "a.npy", "<f4", (9, 165))) == "refused"


@pytest.mark.parametrize(
    "array",
    [np.zeros((3, 2)), np.array("smplx"), np.array(5, "i2"), np.zeros((0, 4), "f2"), np.asfortranarray(np.ones((2, 3)))],
)
def test_arrays_that_numpy_writes_are_read(array):
    out = io.BytesIO()
    np.save(out, array)
    out.seek(0)
    back = read_array(out, len(out.getvalue()), "it")
    assert back.dtype == array.dtype
    np.testing.assert_array_equal(back, array)


@pytest.mark.parametrize("rate", [1e-300, 5e-324, 0.0, -30.0, np.nan, np.inf, 1e300, 10**15])
def test_an_npz_of_an_impossible_rate(tmp_path, rate):
    (tmp_path / "a.npz").write_bytes(npz_that_unpacks(mocap_frame_rate=np.array(rate)))
    with pytest.raises(InputError, match="frames per second"):
        Motion.load(tmp_path / "a.npz")


@pytest.mark.parametrize("fps", [1e-300, 1e-9, 0, -1, 1e9, float("nan"), float("inf"), True, 10**400, "30", None])
def test_motion_of_an_impossible_rate(fps):
    motion = gesturing(2)
    with pytest.raises(InputError, match="frames per second"):
        Motion(fps=fps, rotations=motion.rotations, root=motion.root)
    with pytest.raises(InputError, match="frames per second"):
        motion.resample(fps)


def test_resampling_has_a_limit():
    motion = gesturing(3)
    slow = Motion(fps=1e-3, rotations=motion.rotations, root=motion.root)
    with pytest.raises(InputError, match="would become 30,000,000 at 10000"):
        slow.resample(1e4)


@pytest.mark.parametrize("rate", [16000.0, np.float64(16000), np.int64(16000), np.float32(16000)])
def test_whole_rates_of_any_type_are_rates(rate):
    speech = Speech(np.zeros(16_000, np.float32), rate)
    assert (type(speech.rate), speech.rate, speech.duration) == (int, 16_000, 1)
    assert sum(len(chunk) for chunk in speech.chunks()) == 16_000


@pytest.mark.parametrize(
    "rate",
    [10**30, 10**400, 0, -16_000, 0.5, 16_000.5, True, "16000", None, float("nan"), float("inf"), -float("inf"), 1e300,
     [16_000], Fraction(16_000), 1j],
)  # fmt: skip
def test_rates_that_are_none(rate):
    with pytest.raises(InputError, match="samples per second"):
        Speech(np.zeros(16_000, np.float32), rate)
    with pytest.raises(InputError, match="samples per second"):
        open_speech(example()[0], rate=rate)


@pytest.mark.parametrize(
    "times",
    [{"seconds": float("nan")}, {"seconds": float("inf")}, {"seconds": 1e9}, {"seconds": -1.0}, {"duration": Fraction(10**9)},
     {"duration": 1.0}, {"start": float("nan")}, {"start": float("inf")}, {"start": "now"}, {"seconds": "long"}],
)  # fmt: skip
def test_speech_of_an_impossible_length(times):
    """A second of samples that says it lasts for years made motion for years."""
    with pytest.raises(InputError, match="speech"):
        Speech(np.zeros(16_000, np.float32), **times)


# ---- bundles ----


@pytest.fixture(scope="module")
def bundle(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("bundle") / "small.cospeech"
    write_small(path)
    return path


def rewritten(bundle: Path, path: Path, manifest: dict) -> Path:
    """The same bundle with another manifest."""
    with zipfile.ZipFile(bundle) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in (members | {MANIFEST: json.dumps(manifest).encode()}).items():
            archive.writestr(name, data)
    return path


@pytest.mark.parametrize("fps", [10**400, -(10**400), 1e308, 1e-300, 0, True])
def test_a_bundle_of_an_impossible_rate(bundle, tmp_path, fps):
    path = rewritten(bundle, tmp_path / "a.cospeech", {**read_bundle(bundle).manifest, "fps": fps})
    with pytest.raises(InputError):
        TrainedModel.open(path)


def test_the_list_of_arrays_of_a_bundle_has_a_limit():
    long = json.dumps({f"a{k}": {"dtype": "F32", "shape": [0], "data_offsets": [0, 0]} for k in range(200_000)}).encode()
    bundle = Bundle("b", {}, {"x.safetensors": struct.pack("<Q", len(long)) + long})
    with pytest.raises(InputError, match="lists more than 1 MiB of arrays"):
        bundle.arrays("x.safetensors")


@pytest.mark.parametrize("kind", ["bundle", "npz"])
def test_zips_of_too_many_members(tmp_path, kind):
    """Refused by the length of their lists, which Python would read to the end."""
    path = tmp_path / ("a.cospeech" if kind == "bundle" else "a.npz")
    with zipfile.ZipFile(path, "w") as archive:
        for k in range(6000):
            archive.writestr(f"{k}.npy", b"")
    with pytest.raises(InputError, match=r"more than (32|100) members"):
        read_bundle(path) if kind == "bundle" else Motion.load(path)


# ---- pipes, devices and folders ----


def generate(**given: object) -> None:
    generate_files(example()[0], [Path(str(given.pop("out", "a.bvh")))], **given)


OPENERS = {  # suffix → whoever opens a path that a user names
    "emotion": (".csv", lambda p: read_emotion_track(p)),
    "--emotion": (".csv", lambda p: generate(emotion=p, out=p.parent / "out.bvh")),
    "--style": (".bvh", lambda p: generate(style=p, model="stylised-flow", out=p.parent / "out.bvh")),
    "--transcript": (".TextGrid", lambda p: generate(transcript=p, out=p.parent / "out.bvh")),
    "--avatar": (".vrm", lambda p: generate(avatar=p, out=p.parent / "out.glb")),
    "--report": (".json", lambda p: generate(report=p, out=p.parent / "out.bvh")),
    "--face": (".json", lambda p: generate(face=p, model="chain-of-generation", out=p.parent / "out.bvh")),
    "--continue": (".bvh", lambda p: generate(continue_from=p, model="chain-of-generation", out=p.parent / "out.bvh")),
    "--model": (".cospeech", lambda p: generate(model=str(p), out=p.parent / "out.bvh")),
    "speech": (".wav", lambda p: Speech.load(p)),
    "transcript": (".srt", lambda p: load_words(p, speech_seconds=9)),
    "map": (".toml", lambda p: load_map(p)),
    "recipe": (".toml", lambda p: load_recipe(p)),
    "bundle": (".cospeech", lambda p: read_bundle(p)),
    "store": ("/index.json", lambda p: read_index(p.parent)),
    "array": (".npy", lambda p: open_array(p, "<f4", (1,))),
    "run": ("/config.json", lambda p: read_facts(p.parent)),
    "checkpoint": (".safetensors", lambda p: read_tensors(p)),
    "word vectors": (".vec", lambda p: open_vectors(p)),
    "split": (".csv", lambda p: read_split(p)),
    "info": (".csv", lambda p: read_info(p)),
    **{suffix: (suffix, lambda p: Motion.load(p)) for suffix in (".bvh", ".glb", ".fbx", ".vrma", ".csv", ".json", ".npz")},
}  # fmt: skip


@pytest.mark.parametrize("kind", ["pipe", "device", "folder", "empty"])
@pytest.mark.parametrize("name", OPENERS)
def test_what_is_no_file_is_refused(tmp_path, name, kind):
    """A pipe that nobody writes to blocks whoever opens it, for ever."""
    if not hasattr(os, "mkfifo"):
        pytest.skip("this system has no such files")
    suffix, opener = OPENERS[name]
    path = tmp_path / (suffix[1:] if suffix.startswith("/") else f"a{suffix}")
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "device":
        path.symlink_to("/dev/zero")
    elif kind == "folder":
        path.mkdir()
    elif name == "--report":
        pytest.skip("an empty file is written anew")
    else:
        path.touch()
    before = sorted(p.name for p in tmp_path.iterdir())
    with pytest.raises(InputError) as refusal:
        opener(path)
    assert "\n" not in str(refusal.value)
    assert sorted(p.name for p in tmp_path.iterdir()) == before


# ---- limits are in one place ----


def test_every_limit_is_a_row_of_the_table():
    tree = ast.parse(inspect.getsource(limits))
    table = next(node for node in tree.body if isinstance(node, ast.Assign) and node.targets[0].id == "LIMITS")
    names = {node.id for node in ast.walk(table) if isinstance(node, ast.Name)}
    constants = {name for name in limits.__all__ if name.isupper()} - {"LIMITS"}
    assert constants <= names, sorted(constants - names)
    assert len({(row.what, row.unit) for row in limits.LIMITS}) == len(limits.LIMITS)
    assert all(row.value > 0 and row.why and row.unit for row in limits.LIMITS)


def test_what_our_own_files_take_is_allowed(tmp_path):
    """Hours of a body at rest: nothing but the clock is keyed."""
    rest = gesturing(1)
    frames = 40_000
    still = Motion(30, np.repeat(rest.rotations, frames, 0), np.repeat(rest.root, frames, 0), np.repeat(rest.face, frames, 0))
    for suffix in (".glb", ".vrma"):
        save(still, tmp_path / f"a{suffix}", **({"character": stand_in()} if suffix == ".glb" else {}))
        size = (tmp_path / f"a{suffix}").stat().st_size
        assert 10 * frames * 56 < most_joint_frames(10 * size)  # ten times as long, too
        assert len(Motion.load(tmp_path / f"a{suffix}")) == frames


# ---- fuzzers ----


GOOD_TRANSCRIPTS = {
    "vtt": "WEBVTT\n\n00:00:00.000 --> 00:00:02.000 align:start\n \n"
    "good<00:00:00.400><c> evening</c><00:00:00.900><c> all</c>\n\n"
    "00:00:02.000 --> 00:00:02.010\ngood evening all\n \n\n00:00:02.010 --> 00:00:04.000\ngood evening all\nANN: *laughs*\n",
    "sbv": "0:00:00.500,0:00:02.000\n田中：Good evening[br](笑)\n\n0:00:02.000,0:00:04.000\nMy brother\n",
    "ttml": '<?xml version="1.0"?>\n<tt xmlns="http://www.w3.org/ns/ttml" ttp:frameRate="25"><body><div begin="1s">'
    '<p begin="00:00:00:12" end="2s">Good<br/>evening</p>'
    '<p begin="3s" dur="9t"><span begin="0s" end="0.5s">Bob</span></p></div></body></tt>',
    "lrc": "[ti:Song]\n[offset:-100]\n[00:00.50]<00:00.50>Good <00:01.00>evening\n[00:02.00][00:03.00]My brother\n",
    "columns": 'speaker,text,from,duration\nBob,"Good, evening",00:00:00.5,1.5\nAnn,Hello,2.0,1\n',
    "google.json": '{"results": [{"alternatives": [{"transcript": "so", "words": [{"word": "so", "startTime": "0.5s", '
    '"endTime": {"seconds": 1, "nanos": 5}}]}]}]}',
    "whisper.json": '{"transcription": [{"offsets": {"from": 0, "to": 900}, "text": "some", "tokens": [{"text": " so", '
    '"offsets": {"from": 500, "to": 700}}, {"text": "me", "offsets": {"from": 700, "to": 900}}]}]}',
}
"""Name → a transcript."""


@pytest.fixture(scope="module")
def good(tmp_path_factory) -> dict[str, bytes]:
    """A small good file of every format."""
    folder, motion = tmp_path_factory.mktemp("good"), gesturing(3)
    contents: dict[str, bytes] = {}
    for suffix in (".bvh", ".csv", ".json", ".glb", ".vrma"):
        save(motion, folder / f"a{suffix}", **({"character": stand_in()} if suffix == ".glb" else {}))
        contents[suffix] = (folder / f"a{suffix}").read_bytes()
    tier = "".join(f'{k / 2} {k / 2 + 0.5} "{word}"\n' for k, word in enumerate(("Hello", "", "<sil>", "a b")))
    contents["textgrid"] = f'"ooTextFile"\n"TextGrid"\n0 2 <exists> 1\n"IntervalTier" "words" 0 2 4\n{tier}'.encode()
    contents["tsv"] = b"start\tend\tword\n0.1\t0.5\tHello,\n0.5\t1,25\tworld (laughs)\n1.5\t2\t<sil>\n"
    contents["srt"] = (
        b"1\n00:00:01,000 --> 00:00:02,500\n<i>Hello</i> &amp; &#228;\nworld\n\n2\n00:00:03,000 --> 00:00:04,000\nBye\n"
    )
    contents |= {name: text.encode() for name, text in GOOD_TRANSCRIPTS.items()}
    words = [{"word": w, "start": k / 2, "end": k / 2 + 0.4} for k, w in enumerate(["so", "what", "is", "that"])]
    contents["words.json"] = json.dumps({"segments": [{"words": words}]}, indent=1).encode()
    contents["txt"] = "Well, the big house - and 42 others! 你好。 สวัสดี (laughs)\n".encode() * 3
    contents["named"] = b"time,emotion,weight\n0,neutral,1\n2.5,happiness,0.7\n9,anger,1\n"
    contents["shares"] = b"time,happiness,anger\n0,0,0\n2.5,0.5,0.2\n9,1,1\n"
    contents["map"] = b'[bones]\nleftUpperArm = "L_Arm"\nhips = "pelvis"\nleftHand = ""\n'
    contents["recipe"] = b'[model]\nname = "moglow"\n[data]\nfps = 20.0\nspeakers = ["a", "b"]\n[train]\nbetas = [0.9, 0.99]\n'
    contents["split"] = b"id,type\n1_wayne_0_1_1,train\n1_wayne_0_2_2,test\n"
    contents["info"] = b"anim_bvh,validation\na.bvh,TRUE\nb.bvh,FALSE\n"
    return contents


TEXTS = {  # name of the good file → suffix, reader
    ".bvh": (".bvh", Motion.load),
    ".csv": (".csv", Motion.load),
    ".json": (".json", Motion.load),
    "textgrid": (".TextGrid", lambda p: load_words(p, speech_seconds=9)),
    "tsv": (".tsv", lambda p: load_words(p, speech_seconds=9)),
    "srt": (".srt", lambda p: load_words(p, speech_seconds=9)),
    **{name: (f".{name}", lambda p: load_words(p, speech_seconds=9)) for name in ("vtt", "sbv", "ttml", "lrc")},
    "columns": (".csv", lambda p: load_words(p, speech_seconds=9)),
    **{f"{name}.json": (".json", lambda p: load_words(p, speech_seconds=9)) for name in ("words", "google", "whisper")},
    "txt": (".txt", lambda p: load_words(p, speech_seconds=9)),
    "named": (".csv", read_emotion_track),
    "shares": (".csv", read_emotion_track),
    "map": (".toml", load_map),
    "recipe": (".toml", load_recipe),
    "split": (".csv", read_split),
    "info": (".csv", read_info),
}  # fmt: skip


def read_within_bounds(read, path: Path) -> str:
    """Read in bounded time and memory; a motion is finite, and no larger than its file may become."""

    def one() -> None:
        result = read(path)
        if isinstance(result, Motion):
            assert len(result) * len(result.skeleton) <= most_joint_frames(path.stat().st_size)
            assert np.isfinite(result.rotations).all()

    return answer(one)


@pytest.mark.parametrize("name", TEXTS)
def test_hostile_texts(good, tmp_path, name):
    suffix, read = TEXTS[name]
    chance, text, ends = random.Random(f"hostile {name}"), good[name].decode(), []
    with bounded_memory(), warnings.catch_warnings():
        warnings.simplefilter("ignore", CospeechWarning)  # what is left out of a damaged transcript is told
        for _ in range(EACH):
            path = tmp_path / f"a{suffix}"
            path.write_text(hostile_text(text, chance) or " ", "utf-8")
            ends.append(read_within_bounds(read, path))
    assert ends.count("refused") > (0 if name == "txt" else EACH / 10)  # almost anything is a text
    assert ends.count("read") > EACH / 100


@pytest.mark.parametrize("suffix", [".glb", ".vrma"])
def test_hostile_documents(good, tmp_path, suffix):
    """The JSON of glTF files, and far keys in their numbers."""
    chance, ends = random.Random(f"hostile {suffix}"), []
    document, data = split_glb(good[suffix], "")
    clock = document["accessors"][document["animations"][0]["samplers"][0]["input"]]
    at = document["bufferViews"][clock["bufferView"]].get("byteOffset", 0) + clock.get("byteOffset", 0)
    path = tmp_path / f"a{suffix}"
    with bounded_memory():
        for _ in range(EACH):
            binary, tree = bytearray(data), document
            if chance.random() < 0.4:
                key = at + 4 * chance.randrange(clock["count"])
                struct.pack_into("<f", binary, key, chance.choice((1e3, 1e6, 1e30, -1.0, 1e-30, 0.0, float("nan"))))
            else:
                tree = bent_tree(document, chance)
            path.write_bytes(glb_of(tree, bytes(binary)))
            ends.append(read_within_bounds(Motion.load, path))
    assert min(ends.count("refused"), ends.count("read")) > EACH / 20


def test_hostile_arrays(tmp_path):
    """Heads of the arrays of an .npz as text, with the numbers behind them left as they are."""
    chance, ends, rows = random.Random("hostile .npz"), [], 9
    sizes = {"poses": "(9, 165)", "trans": "(9, 3)", "mocap_frame_rate": "()", "arkit": "(9, 52)"}
    data = {"poses": bytes(rows * 660), "trans": bytes(rows * 12), "arkit": bytes(rows * 208)}
    data["mocap_frame_rate"] = struct.pack("<f", 30)
    with bounded_memory():
        for _ in range(2 * EACH):
            heads = {k: f"{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}" for k, shape in sizes.items()}
            name, numbers = chance.choice(list(heads)), dict(data)
            if chance.random() < 0.8:
                heads[name] = hostile_text(heads[name], chance)
            else:
                rate = chance.choice((1e-300, 1e-30, 1e30, -1, 0, float("nan"), 1e9, 29.97))
                numbers["mocap_frame_rate"] = struct.pack("<f", rate)
            path = tmp_path / "a.npz"
            path.write_bytes(npz_of({key: (heads[key], numbers[key]) for key in heads}))
            ends.append(read_within_bounds(Motion.load, path))
    assert ends.count("refused") > EACH / 2
    assert ends.count("read") > 0


def test_hostile_manifests(bundle, tmp_path):
    chance, ends = random.Random("hostile manifest"), []
    manifest = dict(read_bundle(bundle).manifest)
    for _ in range(EACH):
        mutant = bent_tree(manifest, chance)
        with bounded_memory():
            ends.append(answer(lambda tree=mutant: TrainedModel.open(rewritten(bundle, tmp_path / "a.cospeech", dict(tree)))))
    assert min(ends.count("refused"), ends.count("read")) > EACH / 50


def test_hostile_lists_of_arrays():
    """Heads of safetensors: text in front of numbers."""
    chance, ends = random.Random("hostile safetensors"), []
    whole = pack_arrays({"a": np.zeros((2, 3), np.float32), "b": np.ones(4, np.float32)})
    size = int.from_bytes(whole[:8], "little")
    head, data = whole[8 : 8 + size].decode(), whole[8 + size :]
    with bounded_memory():
        for _ in range(EACH):
            text = hostile_text(head, chance).encode()
            length = len(text) if chance.random() < 0.9 else chance.choice((0, 1, 2**31, 2**63, 2**64 - 1))
            member = struct.pack("<Q", length) + text + data
            ends.append(answer(lambda member=member: Bundle("b", {}, {"x.safetensors": member}).arrays("x.safetensors")))
    assert ends.count("refused") > EACH / 2


def test_hostile_graphs(bundle):
    """Runs of bytes and far sizes in ONNX files."""
    chance, ends = random.Random("hostile onnx"), []
    graphs = list(read_bundle(bundle).graphs().values())
    with bounded_memory():
        for _ in range(EACH):
            graph = bytearray(chance.choice(graphs))
            at = chance.randrange(len(graph))
            run = chance.choice((b"\x80", b"\xff", b"\x0a\x00", b"\x08\x01", b"\x7a\x7a", bytes(graph[at : at + 40]) or b"x"))
            graph[at : at + chance.choice((0, 1, len(run)))] = run * chance.choice((1, 10, 5000))
            ends.append(answer(lambda graph=graph: check_onnx(bytes(graph))))
    assert ends.count("refused") > EACH / 4


def test_hostile_speech():
    """Speech that a program makes, with extreme rates, times and words."""
    chance, ends = random.Random("hostile speech"), []
    odd = (1e-300, 1e300, 10**30, -1, 0, 0.5, 1.0, float("nan"), float("inf"), "x", None, True, Fraction(1, 3), 100, 1e7)
    for _ in range(EACH):
        names = chance.sample(["rate", "seconds", "start", "duration"], chance.choice((1, 2)))
        given = dict(zip(names, chance.choices(odd, k=len(names)), strict=True))
        spans = [sorted(chance.choices((0.0, 0.5, 1e9, -1.0), k=2)) for _ in range(2)]
        words = tuple(Word(chance.choice(("a", "a1" * 3000, "-", "")), start, end) for start, end in spans)

        def one(given=given, words=words) -> None:
            speech = Speech(np.zeros(1600, np.float32), **({"rate": 16_000} | given), words=words)
            assert sum(len(chunk) for chunk in speech.chunks(0.05)) == 1600
            assert speech.frames(30) <= 1600 * 30 / speech.rate + 31

        ends.append(answer(one))
    assert min(ends.count("refused"), ends.count("read")) > EACH / 50
