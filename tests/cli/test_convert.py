"""Edits on the command line: what each option does to the motion, and what cannot be done."""

from __future__ import annotations

import errno
import shlex
from pathlib import Path

import numpy as np
import pytest

from cospeech.errors import InputError, InternalError
from cospeech.export import load, save
from cospeech.motion.edit import cut
from cospeech.motion.rotations import quat_angle
from tests.support.motions import gesturing, stand_in


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A folder with two clips and a face."""
    monkeypatch.chdir(tmp_path)
    motion = gesturing(60)
    save(motion, "talk.glb", character=stand_in())
    save(motion.mirror(), "other.glb", character=stand_in())
    save(motion, "talk.bvh")
    save(motion.mirror(), "face.json")
    return tmp_path


def test_cut_join_and_loop(cli, place):
    assert cli("convert", "talk.bvh", "out.bvh", "--join", "talk.bvh", "--from", 1, "--to", 3.5, "--loop")[0] == 0
    motion, before = load("out.bvh"), load("talk.bvh")
    assert len(motion) == 75
    np.testing.assert_allclose(motion.root[:20], before.root[30:50], atol=1e-5)
    step = quat_angle(motion.rotations[-1].astype(float), motion.rotations[0].astype(float)).max()
    assert step < 0.15


@pytest.mark.parametrize(
    "words", ["-o out.bvh talk.bvh", "talk.bvh --output=out.bvh", "talk.bvh --to 1 -o out.bvh", "-o out.bvh -- talk.bvh"]
)
def test_the_file_to_write_may_be_named_as_in_generate(cli, place, words):
    assert cli("convert", "-q", *words.split()) == (0, "", "")
    assert load("out.bvh").fps == load("talk.bvh").fps


@pytest.mark.parametrize(("words", "message"), [
    ("talk.bvh -o", "-o without a file"), ("talk.bvh -o a.bvh -o b.bvh", "names 2 files"), ("-o a.bvh", "missing argument"),
])  # fmt: skip
def test_one_file_is_written(cli, place, words, message):
    code, _, err = cli("convert", *words.split())
    assert (code, message in err, [*place.glob("?.bvh")]) == (2, True, [])


@pytest.mark.slow
def test_a_part_of_a_motion_is_drawn_with_that_part_of_the_speech(cli, place):
    av = pytest.importorskip("av")
    import soundfile

    loud = np.sin(2 * np.pi * 300 * np.arange(8000) / 16000)
    soundfile.write("talk.wav", np.concatenate([0 * loud, loud, 0 * loud, 0 * loud]), 16000)  # loud from .5 to 1 s
    level = {}
    for start, end in ((0.5, 1.0), (1.0, 1.5)):
        arguments = ("render", "talk.bvh", "part.mp4", "--audio", "talk.wav", "--from", start, "--to", end)
        assert cli(*arguments)[0] == 0
        with av.open("part.mp4") as film:
            pictures = sum(1 for _ in film.decode(video=0))
        with av.open("part.mp4") as film:
            sound = np.concatenate([frame.to_ndarray()[0] for frame in film.decode(audio=0)])
        assert (pictures, len(sound) / 48000) == (15, pytest.approx(0.5, abs=0.05))
        level[start] = np.abs(sound[4800:-4800]).mean()
    assert level[0.5] > 0.3 > 0.01 > level[1.0]
    assert cli("render", "talk.bvh", "part.png", "--audio", "talk.wav", "--from", 1.9)[0] == 0
    code, _, err = cli("render", "talk.bvh", "late.mp4", "--audio", "talk.wav", "--from", 9)
    assert (code, "no frame from 9 s to the end" in err, (place / "late.mp4").exists()) == (2, True, False)


@pytest.mark.parametrize(
    ("start", "end", "first", "last"), [(0.51, 1.0, 25600, 48000), (None, 1.0, 0, 48000), (0.51, None, 25600, 96000)]
)
def test_a_part_of_any_speech_is_heard_as_it_is(place, monkeypatch, start, end, first, last):
    import soundfile

    from cospeech import convert

    ramp = (np.arange(96000) / 96000).astype(np.float32)
    soundfile.write("talk.wav", ramp, 48000, subtype="FLOAT")
    sounds = []
    monkeypatch.setattr("cospeech.motion.motion.Motion.save", lambda *_, audio, **more: sounds.append(soundfile.read(audio)))
    monkeypatch.setattr("cospeech.audio.speech.SECONDS_IN_MEMORY", 1.0)  # as if the recording took three hours
    convert.convert_file("talk.bvh", "part.png", audio="talk.wav", edits=convert.Edits(start=start, end=end), fps=60)
    ((samples, rate),) = sounds
    assert rate == 48000  # what a film of the whole has
    np.testing.assert_array_equal(samples, ramp[first:last])  # at 30 frames a second the first frame from .51 s is at .533 s


def test_a_strip_of_a_part_has_the_times_of_the_whole(cli, place):
    whole = load("talk.bvh")
    assert cli("render", "talk.bvh", "part.png", "--from", 0.51, "--to", 1.5)[0] == 0
    for start, same in ((16 / 30, True), (0.0, False)):
        save(cut(whole, 0.51, 1.5), "cut.png", start=start)
        assert ((place / "cut.png").read_bytes() == (place / "part.png").read_bytes()) == same
    with pytest.raises(InputError, match="begins at -1 s"):
        save(whole, "cut.png", start=-1)


def test_mirror_and_the_face_of_another(cli, place):
    assert cli("convert", "talk.glb", "out.bvh", "--mirror")[0] == 0
    assert cli("convert", "talk.glb", "out.json", "--face", "face.json")[0] == 0
    np.testing.assert_allclose(load("out.json").face, load("other.glb").face, atol=2e-3)
    body, mirrored = load("out.bvh").retarget("humanoid"), gesturing(60).mirror()
    assert quat_angle(body.rotations.astype(float), mirrored.rotations.astype(float)).max() < 0.02


def test_a_face_that_is_shorter_comes_to_rest_and_is_told_of(cli, place):
    assert cli("convert", "face.json", "short.json", "--to", 1)[0] == 0
    code, _, err = cli("convert", "talk.glb", "out.json", "--face", "short.json")
    assert (code, "note: the face of 'short.json' ends at 1 s, and rests until 2 s" in err) == (0, True)
    face = load("out.json").face
    np.testing.assert_allclose(face[:30], load("short.json").face, atol=2e-3)
    assert face[30:42].max() > 0.01
    assert face[45:].max() == 0


def test_a_cut_that_leaves_nothing_of_what_is_joined_is_told_of(cli, place):
    _, _, err = cli("convert", "talk.bvh", "out.bvh", "--join", "talk.bvh", "--to", 1.5)
    assert "note: --to 1.5 leaves nothing of what is joined: clips are joined before they are cut; cut 'talk.bvh' first" in err
    _, _, err = cli("convert", "talk.bvh", "out.bvh", "--join", "talk.bvh", "--to", 3)
    assert "leaves nothing" not in err


def test_a_face_for_a_file_without_one_is_noted(cli, place):
    code, _, err = cli("convert", "talk.bvh", "out.bvh", "--face", "face.json")
    assert code == 0
    assert "note: the face changes nothing: a .bvh holds none" in err


def test_the_figure_of_another_is_not_lost_silently(cli, place):
    ours = (place / "talk.glb").read_bytes()
    skin = b'"name":"cospeech","joints"'
    assert ours.count(skin) == 1
    (place / "shown.glb").write_bytes(ours.replace(skin, b'"name":"somebody","joints"'))
    _, _, err = cli("convert", "shown.glb", "cut.glb", "--to", "0.5")
    assert "note: 'cut.glb' shows our mannequin: the figure of 'shown.glb' is not taken over (--avatar shown.glb does" in err
    _, _, err = cli("convert", "shown.glb", "kept.glb", "--to", "0.5", "--avatar", "shown.glb")
    assert "mannequin" not in err
    _, _, err = cli("convert", "talk.glb", "again.glb")
    assert "mannequin" not in err


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        (["--from", "9"], "no frame from 9 s to the end"),
        (["--to", "x"], "'x' is not a number"),
        (["--join", "nowhere.bvh"], "nowhere.bvh"),
        (["--face", "talk.bvh"], "has no face"),
        (["--loop", "--blend", "-1"], "blend -1"),
        (["--join", "out.glb"], "out.glb"),
    ],
)
def test_what_cannot_be_edited_leaves_nothing(cli, place, arguments, what):
    code, out, err = cli("convert", "talk.glb", "out.glb", *arguments)
    assert (code, out) == (2, "")
    assert what in err
    assert not (place / "out.glb").exists()


@pytest.mark.parametrize("foreign_first", [False, True])
def test_clips_of_other_skeletons_are_joined_after_the_command_of_the_hint(cli, place, foreign_first):
    assert cli("convert", "talk.bvh", "their clip.bvh", "--skeleton", "mixamo")[0] == 0
    first, second = ("their clip.bvh", "talk.glb") if foreign_first else ("talk.glb", "their clip.bvh")
    code, _, err = cli("convert", first, "out.bvh", "--join", second, "--skeleton", "humanoid")
    assert code == 2
    assert f"{first!r} and {second!r} have different skeletons" in err
    command = err.partition("retarget first: cospeech ")[2].partition(";")[0]
    assert command == "convert 'their clip.bvh' 'their clip-humanoid.bvh' --skeleton humanoid"
    assert "then name 'their clip-humanoid.bvh' in its place" in err
    assert cli(*shlex.split(command))[0] == 0
    names = [name.replace("clip.bvh", "clip-humanoid.bvh") for name in (first, second)]
    assert cli("convert", names[0], "out.bvh", "--join", names[1])[0] == 0
    assert len(load("out.bvh")) == 120


def test_several_motions_are_converted_one_by_one(cli, place):
    code, out, _ = cli("convert", "talk.bvh", "other.glb", "made/{name}.npz", "--fps", 15)
    assert (code, sorted(each.name for each in (place / "made").iterdir())) == (0, ["other.npz", "talk.npz"])
    assert [line.split()[0] for line in out.splitlines()] == ["made/talk.npz", "made/other.npz"]
    assert load("made/talk.npz").fps == 15
    assert cli("convert", "t*.bvh", "{name}.vrma")[0] == 0
    assert (place / "talk.vrma").exists()
    (place / "takes").mkdir()
    (place / "talk.bvh").rename("takes/one.bvh")
    (place / "takes" / "notes.txt").write_text("no motion")
    (place / "takes" / "two.BVH").write_bytes((place / "takes" / "one.bvh").read_bytes())
    assert cli("convert", "takes", "from a folder/{name}.npz")[0] == 0
    assert sorted(each.name for each in (place / "from a folder").iterdir()) == ["one.npz", "two.npz"]


def test_no_error_of_one_motion_ends_the_others(place):
    from cospeech.cli.several import MotionFile, convert_each

    motions = [MotionFile(place / f"{name}.bvh", place / f"{name}.npz", name, has_placeholder=False) for name in "abc"]
    names = list[str]()

    def convert(each):
        if each.source.name == "a.bvh":
            raise MemoryError
        if each.source.name == "b.bvh":
            raise OSError(errno.EIO, "Input/output error")
        names.append(each.source.name)

    with pytest.raises(InternalError, match=r"2 of 3 motions failed: .*a\.bvh: too little memory.*Input/output error"):
        convert_each(motions, convert)
    assert names == ["c.bvh"]

    def fill_disk(each):
        raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.raises(OSError, match="No space left"):
        convert_each(motions, fill_disk)


def test_a_folder_of_motions_is_searched_to_the_bottom_and_one_of_each_name_taken(cli, place):
    (place / "out/a").mkdir(parents=True)
    (place / "out/.cospeech-0f").mkdir()
    for name in ("talk.bvh", "talk.glb", "a/line.bvh", ".cospeech-0f/0.bvh"):
        (place / "out" / name).write_bytes((place / f"talk{name[-4:]}").read_bytes())
    code, _, err = cli("convert", "out", "made/{name}.vrma", "-q")
    assert (code, sorted(each.as_posix() for each in Path("made").rglob("*.*"))) == (0, ["made/a/line.vrma", "made/talk.vrma"])
    assert "note: left out: out/talk.bvh (of files of one name the first is taken: .glb .fbx .vrma .npz .bvh)" in err
    assert load("made/talk.vrma").face is not None
    before = (place / "out/talk.bvh").read_bytes()
    code, _, err = cli("convert", "out", "out/{name}.bvh")
    assert (code, "'out/talk.bvh' would overwrite what is read" in err) == (2, True)
    assert (place / "out/talk.bvh").read_bytes() == before


def test_what_is_wrong_with_one_motion_keeps_none_of_the_others_back(cli, place):
    (place / "broken.bvh").write_text("HIERARCHY")
    code, _, err = cli("convert", "broken.bvh", "talk.bvh", "made/{name}.npz")
    assert (code, "1 of 2 motions failed: broken.bvh:" in err, "the others are done" in err) == (2, True, True)
    assert [each.name for each in (place / "made").iterdir()] == ["talk.npz"]
    assert "Traceback" not in err
    code, _, err = cli("convert", "broken.bvh", "broken.bvh", "new/{name}.npz")  # one, named twice
    assert (code, "failed" in err, (place / "new").exists()) == (2, False, False)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("talk.bvh", "other.glb", "out.npz"), "one file 'out.npz' for 2 motions ('{name}.npz' writes one for each)"),
        (("talk.bvh", "other.glb", "made"), "no format in 'made' for 2 motions ('made/{name}.glb' writes one for each)"),
        (("talk.bvh", "talk.glb", "out/{name}.npz"), "'talk.bvh' and 'talk.glb' are both called 'talk'"),
        (("talk.bvh", "other.glb", "{name}.bvh"), "'talk.bvh' would overwrite what is read"),
        (("*/*.npz", "out/{name}.npz"), "no file is called '*/*.npz'"),
        (("talk.bvh", "other.glb", "out/{name}.x"), "cannot tell the format of"),
        (("nothing*.bvh", "out/{name}.npz"), "no file is called 'nothing*.bvh'"),
        (("empty", "out/{name}.npz"), "no motion file is in the folder 'empty'"),
    ],
)
def test_several_motions_that_cannot_be(cli, place, arguments, message):
    (place / "empty").mkdir()
    code, _, err = cli("convert", *arguments)
    assert (code, message in err, (place / "out").exists()) == (2, True, False), err


def test_several_motions_are_drawn_each_with_its_own_speech(cli, place):
    import soundfile

    for name in ("talk", "other"):
        soundfile.write(f"{name}.wav", np.zeros(32000), 16000)
    assert cli("render", "talk.bvh", "other.glb", "{name}.png", "--audio", "{name}.wav")[0] == 0
    assert (place / "other.png").exists()
    (place / "other.wav").unlink()
    code, _, err = cli("render", "talk.bvh", "other.glb", "{name}2.png", "--audio", "{name}.wav")
    assert (code, "1 of 2 motions failed: other.glb" in err, (place / "talk2.png").exists()) == (2, True, True)
