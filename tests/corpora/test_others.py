"""BEAT2, ZeroEGGS and any folder: read as they lie on disk, with their gaps and damage."""

from __future__ import annotations

import os
import shutil
from dataclasses import replace

import numpy as np
import pytest
import soundfile

from cospeech.corpora import CORPORA, Clip, Dropped, Semantic, beat2, folder, zeroeggs
from cospeech.corpora.beat.annotations import semantic_text
from cospeech.corpora.layout import textgrid, write_bvh
from cospeech.corpora.prepare.pieces import split_of
from cospeech.errors import CospeechWarning, InputError
from tests.support.corpus_files import UNUSABLE, WORDS, damage, same_turns, sort_out, tone, unusable
from tests.support.motions import gesturing


def sound(path, seconds=1.0, rate=16_000):
    path.parent.mkdir(parents=True, exist_ok=True)
    soundfile.write(path, tone(seconds, rate).samples, rate, "FLOAT" if path.suffix == ".wav" else None)


# ---- BEAT2 ----


def smplx(path, frames=30, **changes):
    """A file like those of BEAT2: the types of a real one, without the arrays that we add."""
    body = gesturing(frames).retarget("smplx")
    body.save(path)
    with np.load(path) as content:
        poses, trans = content["poses"].astype(np.float32), content["trans"].astype(np.float64)
    arrays = {
        "betas": np.linspace(-1, 1, 300, dtype=np.float32), "poses": poses, "trans": trans,
        "expressions": np.tile(np.linspace(0, 1, 100), (frames, 1)), "model": "smplx2020", "gender": "neutral",
        "mocap_frame_rate": np.int32(30),
    }  # fmt: skip
    np.savez(path, **{key: value for key, value in {**arrays, **changes}.items() if value is not None})
    return body


@pytest.fixture(scope="module")
def beat2_raw(tmp_path_factory):
    """BEAT2 with one language and three takes, of which one is only in the list."""
    root = tmp_path_factory.mktemp("BEAT2")
    place = root / "beat_english_v2.0.0"
    for name in ("smplxflame_30", "wave16k", "textgrid", "sem"):
        (place / name).mkdir(parents=True)
    for take in ("2_scott_0_1_1", "2_scott_0_73_73"):
        smplx(place / "smplxflame_30" / f"{take}.npz")
    sound(place / "wave16k" / "2_scott_0_1_1.wav")
    (place / "textgrid" / "2_scott_0_1_1.TextGrid").write_text(textgrid({"words": WORDS, "phones": []}, 1.0))
    (place / "sem" / "2_scott_0_1_1.txt").write_text(semantic_text([Semantic(0, 0.5, 0.8, "08_metaphoric_l", "big")]))
    rows = ["id,type", "2_scott_0_1_1,test", "2_scott_0_73_73,additional", "3_solomon_0_1_1,train", ""]
    (place / "train_test_split.csv").write_text("\n".join(rows))
    return root


@pytest.mark.slow
def test_beat2(beat2_raw):
    one, two, missing = beat2.read(beat2_raw)
    body = gesturing(30).retarget("smplx")
    assert (one.name, one.speaker, one.split, one.emotion) == ("2_scott_0_1_1", "scott", "test", "neutral")
    assert (one.motion.skeleton.kind, one.motion.fps) == ("smplx", 30)
    assert same_turns(one.motion.rotations[:, :22], body.rotations[:, :22]) < 1e-5
    assert np.allclose(one.motion.root, body.root, atol=1e-5)
    assert one.speech.words == WORDS
    assert one.semantics == (Semantic(0, 0.5, 0.8, "08_metaphoric_l", "big"),)
    assert one.extra["betas"].shape == (300,)
    assert np.allclose(one.extra["expressions"][7], np.linspace(0, 1, 100), atol=1e-6)
    assert (two.emotion, two.split, two.extra["additional"], two.speech, two.semantics) == ("anger", "train", True, None, None)
    assert isinstance(missing, Dropped)
    assert missing.reason.startswith("'3_solomon_0_1_1.npz' is not there")
    again = [item.name for item in beat2.read(beat2_raw / "beat_english_v2.0.0")]
    assert again == [one.name, two.name, missing.name]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"poses": None}, "no 'poses'"),
        ({"poses": np.zeros((30, 165), "U5")}, "2_scott_0_1_1.npz"),
        ({"poses": np.full((30, 165), np.nan, "f4")}, "not finite"),
        ({"trans": np.zeros((29, 3))}, "trans (29, 3)"),
        ({"mocap_frame_rate": np.int32(60)}, "60 frames per second"),
        ({"expressions": np.zeros((30, 50))}, "'expressions' of '2_scott_0_1_1.npz'"),
        ({"betas": np.array([{"a": 1}], object)}, "2_scott_0_1_1.npz"),
    ],
)
def test_beat2_damage_is_told(tmp_path, changes, message):
    (tmp_path / "smplxflame_30").mkdir()
    (tmp_path / "train_test_split.csv").write_text("id,type\n")
    smplx(tmp_path / "smplxflame_30" / "2_scott_0_1_1.npz", **changes)
    (item,) = beat2.read(tmp_path)
    assert isinstance(item, Dropped)
    assert message in item.reason


def test_beat2_without_its_list_and_with_other_shapes(tmp_path):
    """Betas of another shape drop no take, as nothing uses them. A missing list is told, because it changes every split."""
    (tmp_path / "smplxflame_30").mkdir()
    smplx(tmp_path / "smplxflame_30" / "2_scott_0_1_1.npz", betas=np.zeros(16))
    with pytest.warns(CospeechWarning, match=r"'train_test_split.csv' is not in .*: its takes have the split of BEAT"):
        (item,) = beat2.read(tmp_path)
    assert (item.split, "betas" in item.extra) == ("test", False)


@pytest.mark.parametrize("text", ["", "id\na\n", "id,type\na,b\n", "id,type\n2_scott_0_1_1\n", "\0", "id,type\n\xff"])
def test_beat2_split_list_that_makes_no_sense(beat2_raw, tmp_path, text):
    shutil.copytree(beat2_raw / "beat_english_v2.0.0", tmp_path / "b")
    (tmp_path / "b" / "train_test_split.csv").write_bytes(text.encode("latin-1"))
    with pytest.raises(InputError, match=r"train_test_split\.csv"):
        beat2.read(tmp_path / "b")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:'train_test_split.csv' is not in")
def test_beat2_damaged_files_are_drops_or_sound(beat2_raw, tmp_path):
    rng = np.random.default_rng(5)
    source = beat2_raw / "beat_english_v2.0.0"
    smplx(tmp_path / "short.npz", frames=3)
    parts = {
        "smplxflame_30": (".npz", 130, (tmp_path / "short.npz").read_bytes()),
        "sem": (".txt", 60, (source / "sem" / "2_scott_0_1_1.txt").read_bytes()),
        "textgrid": (".TextGrid", 8, (source / "textgrid" / "2_scott_0_1_1.TextGrid").read_bytes()),
        "wave16k": (".wav", 8, (source / "wave16k" / "2_scott_0_1_1.wav").read_bytes()),
    }
    names = []
    for part, (_, count, _) in parts.items():
        for _ in range(count):
            name = f"2_scott_{len(names) // 100}_{len(names) % 100}_1"
            names.append(name)
            kinds = {"smplxflame_30", part} | ({"wave16k"} if part == "textgrid" else set())
            for kind in kinds:
                suffix, _, data = parts[kind]
                (tmp_path / "raw" / kind).mkdir(parents=True, exist_ok=True)
                (tmp_path / "raw" / kind / (name + suffix)).write_bytes(damage(data, rng) if kind == part else data)
    assert len(names) >= 200
    clips, reasons = sort_out(beat2.read(tmp_path / "raw"), names)
    assert len(reasons) > 100
    assert all(name in reason for name, reason in reasons.items())
    assert len(clips) > 10


# ---- ZeroEGGS ----


def egg(path, frames=30, fps=60):
    body = gesturing(frames, fps).retarget("mixamo")
    path.parent.mkdir(parents=True, exist_ok=True)
    write_bvh(path, body, order="ZYX", root=body.root, frame_time=f"{1 / fps:.6f}")
    return body


@pytest.fixture(scope="module")
def eggs(tmp_path_factory):
    root = tmp_path_factory.mktemp("zeggs")
    for name in ("001_Neutral_0_x_1_0", "001_Neutral_0_mirror_x_1_0", "005_Neutral_4_x_1_0", "067_Speech_2"):
        egg(root / "clean" / f"{name}.bvh", 60)
    sound(root / "clean" / "001_Neutral_0_x_1_0.wav", 1.0, 48_000)
    rows = ["audio_filename,style,anim_bvh,validation", "001_Neutral_0.wav,Neutral,001_Neutral_0.bvh,FALSE", ""]
    (root / "info.csv").write_text("\n".join([*rows, "005_Neutral_4.wav,Neutral,005_Neutral_4.bvh,TRUE"]))
    return root


@pytest.mark.slow
def test_zeroeggs(eggs):
    got, reasons = sort_out(zeroeggs.read(eggs), [p.stem for p in (eggs / "clean").glob("*.bvh")])
    assert reasons == {}
    one, mirrored = got["001_Neutral_0_x_1_0"], got["001_Neutral_0_mirror_x_1_0"]
    assert (one.speaker, one.split, one.extra) == ("zeroeggs", "train", {"style": "Neutral", "take": "001_Neutral_0"})
    assert (one.motion.fps, one.speech.rate, one.speech.seconds) == (60, 16_000, 1.0)
    assert same_turns(one.motion.rotations, gesturing(60, 60).retarget("mixamo").rotations) < 1e-6
    assert mirrored.extra["mirrored"] is True
    assert mirrored.speech is not None
    assert (got["005_Neutral_4_x_1_0"].split, got["005_Neutral_4_x_1_0"].speech) == ("validation", None)
    assert (got["067_Speech_2"].split, got["067_Speech_2"].extra["style"]) == (None, "Speech")
    assert [item.name for item in zeroeggs.read(eggs / "clean")] == sorted(got)


def test_zeroeggs_without_its_list_keeps_the_forms_of_a_recording_together(eggs, tmp_path):
    shutil.copytree(eggs / "clean", tmp_path / "eggs" / "clean")
    with pytest.warns(CospeechWarning, match=r"'info.csv' is not beside .*: its takes have no split"):
        got = {item.name: item for item in zeroeggs.read(tmp_path / "eggs")}
    forms = [got[f"001_Neutral_0{form}"] for form in ("_x_1_0", "_mirror_x_1_0")]
    for k in range(40):
        assert len({split_of(replace(form, extra={"take": f"{k:03d}_Neutral_0"})) for form in forms}) == 1
    assert {form.split for form in forms} == {None}


def test_zeroeggs_gaps_and_other_files(tmp_path):
    (tmp_path / "info.csv").write_text("anim_bvh,validation\n")
    egg(tmp_path / "walk.bvh", 2)
    egg(tmp_path / "002_Sad_0_x_1_0.bvh", 2, fps=30)
    sound(tmp_path / "003_Old_0_x_1_0.wav")
    _, reasons = sort_out(zeroeggs.read(tmp_path), ["walk", "002_Sad_0_x_1_0", "003_Old_0_x_1_0"])
    assert "not the name of a take" in reasons["walk"]
    assert "30 frames per second" in reasons["002_Sad_0_x_1_0"]
    assert "'003_Old_0_x_1_0.bvh' is not there" in reasons["003_Old_0_x_1_0"]


@pytest.mark.parametrize("text", ["", "a,b\n", "anim_bvh,validation\n001_Neutral_0.bvh,perhaps\n", "anim_bvh,validation\nx\n"])
def test_zeroeggs_list_that_makes_no_sense(eggs, tmp_path, text):
    shutil.copytree(eggs, tmp_path / "z")
    (tmp_path / "z" / "info.csv").write_text(text)
    with pytest.raises(InputError, match=r"info\.csv"):
        zeroeggs.read(tmp_path / "z")


@pytest.mark.filterwarnings("ignore:'info.csv' is not beside")
@pytest.mark.slow
def test_zeroeggs_damaged_files_are_drops_or_sound(tmp_path):
    rng = np.random.default_rng(6)
    egg(tmp_path / "one.bvh", 3)
    sound(tmp_path / "one.wav")
    bvh, wav = (tmp_path / "one.bvh").read_bytes(), (tmp_path / "one.wav").read_bytes()
    names = []
    (tmp_path / "clean").mkdir()
    for k in range(204):
        names.append(f"{k:03d}_Tired_{k}_x_1_0")
        (tmp_path / "clean" / f"{names[-1]}.bvh").write_bytes(damage(bvh, rng) if k < 190 else bvh)
        if k >= 190:
            (tmp_path / "clean" / f"{names[-1]}.wav").write_bytes(damage(wav, rng))
    clips, reasons = sort_out(zeroeggs.read(tmp_path), names)
    assert len(reasons) > 60
    assert all(name in reason for name, reason in reasons.items())
    assert len(clips) > 5


# ---- any folder ----


@pytest.mark.slow
def test_folder(tmp_path):
    root = tmp_path / "mine"
    sound(root / "a.wav")
    gesturing(30).save(root / "a.bvh")
    gesturing(30).save(root / "a.json")
    (root / "a.TextGrid").write_text(textgrid({"words": WORDS}, 1.0))
    (root / "a.txt").write_text("not looked at, as there is a TextGrid")
    sound(root / "Ana" / "b.flac")
    gesturing(30).save(root / "Ana" / "b.glb")
    (root / "Ana" / "b.tsv").write_text("0.1\t0.3\twell\n")
    sound(root / "Ana" / "day 2" / "c.ogg")
    gesturing(30).save(root / "Ana" / "day 2" / "c.npz")
    (root / "Ana" / "day 2" / "c.json").write_text('[{"word": "well", "start": 0.1, "end": 0.3}]')
    sound(root / "Ben" / "d.wav")
    sound(root / "Ben" / "d.flac")
    sound(root / "Ben" / "d.WAV")
    gesturing(30).save(root / "Ben" / "d.vrma")
    (root / "Ben" / "d.srt").write_text("1\n00:00:00,100 --> 00:00:00,300\nwell\n")
    sound(root / "Ben" / "e.wav")
    (root / "Ben" / "e.txt").write_text("Well, don't relax.")
    (root / "Ben" / "alone.bvh").write_text("no sound, not looked at")
    (root / "Ben" / "._d.wav").write_text("what macOS leaves on a stick")
    names = ["a", "Ana/b", "Ana/day 2/c", "Ben/alone.bvh", "Ben/d.wav", "Ben/d.flac", "Ben/d", "Ben/e"]
    items = list(folder.read(root))
    assert [item.name for item in items] == names
    got, reasons = sort_out(items, names)
    assert "'d.WAV' is the sound of this name already" in reasons["Ben/d.flac"]
    assert "'d.WAV' is the sound of this name already" in reasons["Ben/d.wav"]
    assert {n: c.speaker for n, c in got.items()} == {
        "a": "mine",
        "Ana/b": "Ana",
        "Ana/day 2/c": "Ana",
        "Ben/d": "Ben",
        "Ben/e": "Ben",
    }
    assert {n: c.motion and c.motion.skeleton.kind for n, c in got.items()}["Ana/day 2/c"] == "smplx"
    assert same_turns(got["a"].motion.rotations, gesturing(30).rotations) < 1e-6
    assert (got["a"].face.shape, got["a"].face_fps) == ((30, 52), 30)
    assert got["a"].speech.words == WORDS
    assert [w.text for w in got["Ben/e"].speech.words] == ["Well", "don't", "relax"]
    for name in ("Ana/b", "Ana/day 2/c", "Ben/d"):
        ((word),) = got[name].speech.words
        assert (word.text, word.start) == ("well", 0.1)
        assert len(got[name].motion) == 30
    assert got["Ben/e"].motion is None


def test_a_folder_may_tell_emotions_and_have_faces_of_live_link(tmp_path):
    for name in ("a", "Ana/b", "Ana/loud/c", "Ana/loud/d", "Ben/e"):
        sound(tmp_path / f"{name}.wav")
        gesturing(30).save(tmp_path / f"{name}.bvh")
    gesturing(30).save(tmp_path / "a.csv")
    (tmp_path / "Ben" / "e.csv").write_text("time,note\n1,no face\n")
    lines = ["Name,Emotion", "Ana, neutral", "Ana/loud,Anger", "Ana/loud/d,fear", "", "Ana/lost,anger"]
    (tmp_path / "emotions.csv").write_text("\n".join(lines))
    *clips, missing = folder.read(tmp_path)
    emotions = {clip.name: clip.emotion for clip in clips}
    assert emotions == {"a": None, "Ana/b": "neutral", "Ana/loud/c": "anger", "Ana/loud/d": "fear", "Ben/e": None}
    assert missing == Dropped("Ana/lost", "emotions.csv names it, and there is no such recording")
    assert clips[0].face.shape == (30, 52)
    assert clips[-1].face is None


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("Ana,angry", "line 1: no emotion is called 'angry'"),
        ("Ana", "line 1: 'Ana'"),
        ("Ana,fear,loud", "line 1: 'Ana,fear,loud'"),
    ],
)
def test_emotions_that_cannot_be_read_are_an_error(tmp_path, line, message):
    sound(tmp_path / "Ana" / "a.wav")
    (tmp_path / "emotions.csv").write_text(line)
    with pytest.raises(InputError, match=message):
        folder.read(tmp_path)


def test_motion_without_a_sound_is_told(tmp_path):
    motion = gesturing(30)
    for name in ("a", "sub/alone", "sub/both", ".hidden/part"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        motion.save(tmp_path / f"{name}.bvh")
    motion.save(tmp_path / "sub" / "both.npz")
    sound(tmp_path / "a.wav")
    (tmp_path / "README.txt").write_text("no motion")
    items = list(folder.read(tmp_path))
    assert [item.name for item in items if isinstance(item, Clip)] == ["a"]
    reasons = [(item.name, item.reason) for item in items if isinstance(item, Dropped)]
    assert reasons == [(f"sub/{name}.bvh", "no sound of this name is beside it") for name in ("alone", "both")]


@pytest.mark.slow
def test_folder_damaged_files_are_drops_or_sound(tmp_path):
    rng = np.random.default_rng(7)
    root, body = tmp_path / "raw", gesturing(3)
    files = {}
    for suffix in (".bvh", ".glb", ".npz", ".vrma", ".json"):
        body.save(tmp_path / f"one{suffix}")
        files[suffix] = (tmp_path / f"one{suffix}").read_bytes()
    files[".srt"] = b"1\n00:00:00,100 --> 00:00:00,300\nwell\n\n2\n00:00:00,300 --> 00:00:00,500\nrelax\n"
    files[".tsv"] = b"0.1\t0.3\twell\n0.3\t0.5\trelax\n"
    sound(tmp_path / "one.wav", 0.5)
    files[".wav"] = (tmp_path / "one.wav").read_bytes()
    counts = {".bvh": 55, ".glb": 45, ".npz": 45, ".vrma": 30, ".json": 15, ".srt": 5, ".tsv": 5, ".wav": 10}
    names = []
    (root / "who").mkdir(parents=True)
    for suffix, count in counts.items():
        for _ in range(count):
            names.append(f"who/take{len(names):03d}")
            (root / f"{names[-1]}.wav").write_bytes(files[".wav"])
            (root / f"{names[-1]}{suffix}").write_bytes(damage(files[suffix], rng))
    assert len(names) >= 200
    clips, reasons = sort_out(folder.read(root), names)
    assert len(reasons) > 60
    assert all(name.removeprefix("who/") in reason for name, reason in reasons.items())
    assert len(clips) > 5


def test_a_sub_folder_that_cannot_be_listed_is_told(tmp_path, monkeypatch):
    for name in ("a", "b"):
        sound(tmp_path / name / "x.wav")
    real = os.scandir
    error = PermissionError(13, "Permission denied", str(tmp_path / "b"))

    def scandir(place):
        if str(place).endswith("b"):
            raise error
        return real(place)

    monkeypatch.setattr(os, "scandir", scandir)
    _, reasons = sort_out(folder.read(tmp_path), ["a/x", "b"])
    assert reasons == {"b": "cannot list it: Permission denied"}


@pytest.mark.parametrize("kind", UNUSABLE)
@pytest.mark.parametrize("reader", [beat2, zeroeggs, folder])
def test_an_unusable_folder_is_an_error(tmp_path, reader, kind):
    with pytest.raises(InputError, match="root"):
        reader.read(unusable(tmp_path, kind))


def test_lengths_that_do_not_belong_together(tmp_path):
    sound(tmp_path / "a.wav", 20)
    gesturing(30).save(tmp_path / "a.bvh")
    (item,) = folder.read(tmp_path)
    assert "1.0 s of motion, 20.0 s of speech" in item.reason


def test_writable_corpora_are_those_with_a_writer():
    import importlib

    for name in ("beat", "beat2", "trinity", "zeroeggs", "folder"):
        module = importlib.import_module(CORPORA[name].module)
        assert hasattr(module, "write") == CORPORA[name].writable
