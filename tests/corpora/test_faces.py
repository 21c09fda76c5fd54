"""Tracked faces: read as they lie on disk, with their gaps and damage."""

from __future__ import annotations

import numpy as np
import pytest
import soundfile

from cospeech.corpora import Dropped, faces
from cospeech.errors import InputError
from cospeech.motion.poses.face import FACE
from cospeech.motion.rotations import matrix_to_quat, quat_angle, quat_multiply, rotvec_to_quat
from cospeech.motion.skeletons.arkit import ARKIT, ARKIT_INDEX
from tests.support.corpus_files import sort_out, tone

MEDIAPIPE = ("_neutral", *reversed([name for name in ARKIT if name != "tongueOut"]))
LENGTHS = (50, 40, 25)
CLIPS = ("aa", "bb", "cc")
REST = 0.05


def matrices(turns: np.ndarray) -> np.ndarray:
    """(T, 4, 4) of rotation vectors, by Rodrigues' formula."""
    out = np.zeros((len(turns), 4, 4))
    out[:, 3, 3] = 1
    for k, turn in enumerate(turns):
        angle = np.linalg.norm(turn)
        x, y, z = turn / max(angle, 1e-12)
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        out[k, :3, :3] = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return out


def sounds(folder, seconds):
    (folder / "audio").mkdir(parents=True)
    for name, length in seconds.items():
        soundfile.write(folder / "audio" / f"{name}.flac", tone(length).samples, 16_000)


@pytest.fixture
def grid(tmp_path):
    """A speaker as MediaPipe sees them: the mouth rests at 0.05, and opens in the middle of each clip."""
    folder, frames = tmp_path / "face_ada", sum(LENGTHS)
    weights = np.full((frames, len(MEDIAPIPE)), REST)
    jaw, starts = MEDIAPIPE.index("jawOpen"), np.cumsum((0, *LENGTHS))
    for start, length in zip(starts[:-1], LENGTHS, strict=True):
        weights[start + 10 : start + length - 10, jaw] = 0.6
    weights[3, MEDIAPIPE.index("mouthSmileLeft")] = 0.02  # below rest
    turns = np.stack([0.1 * np.sin(np.arange(frames) / 9), np.full(frames, 0.3), np.zeros(frames)], 1)
    sounds(folder, {name: length / 25 for name, length in zip(CLIPS, LENGTHS, strict=True)})
    (folder / "words").mkdir()
    for name, length in zip(CLIPS, LENGTHS, strict=True):
        rows = ((0, 10, "sil"), (10, length - 10, "blue"), (length - 10, length, "sil"))
        (folder / "words" / f"{name}.align").write_text("".join(f"{a * 1000} {b * 1000} {w}\n" for a, b, w in rows))
    save(folder, CLIPS, LENGTHS, weights, MEDIAPIPE, 25.0, head_matrix=matrices(turns), face_ok=np.ones(frames, np.uint8))
    return folder


def save(folder, clips, lengths, weights, names, fps, **more):
    arrays = {"clip_ids": np.array(clips), "lengths": np.array(lengths), "blendshapes": weights.astype(np.float32)}
    np.savez(folder / "face.npz", names=np.array(names), fps=np.array(fps), **arrays, **more)


def edit_arrays(folder, **arrays):
    with np.load(folder / "face.npz") as file:
        originals = {name: file[name] for name in file.files}
    np.savez(folder / "face.npz", **{**originals, **arrays})


@pytest.mark.slow
def test_a_tracked_face_is_read_without_the_face_at_rest(grid):
    got, reasons = sort_out(faces.read(grid.parent), CLIPS)
    assert reasons == {}
    clip = got["bb"]
    assert (clip.speaker, clip.corpus, clip.split, len(clip.motion), clip.motion.fps) == ("ada", "faces", None, 40, 25.0)
    assert [(w.text, w.start, w.end) for w in clip.speech.words] == [("blue", 0.4, pytest.approx(1.2))]
    face = clip.motion.face
    assert face[15:25, ARKIT_INDEX["jawOpen"]] == pytest.approx(0.6 - REST, abs=1e-6)
    assert np.abs(np.delete(face, ARKIT_INDEX["jawOpen"], 1)).max() < 1e-6
    assert got["aa"].motion.face.min() >= 0
    assert [item.name for item in faces.read(grid)] == [*CLIPS]  # the folder itself


@pytest.mark.slow
def test_eyes_and_brows_and_what_no_tracker_moves_are_dead(grid):
    with np.load(grid / "face.npz") as file:
        lively = np.random.default_rng(0).uniform(0, 1, file["blendshapes"].shape)
    edit_arrays(grid, blendshapes=lively)
    face = np.concatenate([clip.motion.face for clip in faces.read(grid)])
    alive = {ARKIT[k] for k in np.flatnonzero(face.any(0))}
    assert alive == {n for n in ARKIT if n.startswith(("jawOpen", "mouth"))} - {"mouthLeft", "mouthRight"}


@pytest.mark.slow
def test_the_head_turns_relative_to_its_mean(grid):
    clips = {clip.name: clip for clip in faces.read(grid)}
    with np.load(grid / "face.npz") as file:
        head_turns = matrix_to_quat(file["head_matrix"][: LENGTHS[0], :3, :3])
    turns = rotvec_to_quat(FACE.encode(clips["aa"].motion)[:, -3:])
    a, b = (quat_multiply(q[1:], q[:-1] * [-1, -1, -1, 1]) for q in (turns, head_turns))
    assert np.abs(quat_angle(a, np.array([0, 0, 0, 1.0])) - quat_angle(b, np.array([0, 0, 0, 1.0]))).max() < 1e-5
    every = np.concatenate([FACE.encode(clip.motion)[:, -3:] for clip in clips.values()])
    assert np.abs(every.mean(0)).max() < 0.01


@pytest.mark.slow
def test_frames_without_a_face_are_filled_from_those_around(grid):
    with np.load(grid / "face.npz") as file:
        weights, has_face = file["blendshapes"].copy(), file["face_ok"].copy()
    expected = {clip.name: clip.motion.face for clip in faces.read(grid)}["aa"][18:22]
    weights[18:22], has_face[18:22] = 0.9, 0
    edit_arrays(grid, blendshapes=weights, face_ok=has_face)
    np.testing.assert_allclose({c.name: c.motion.face for c in faces.read(grid)}["aa"][18:22], expected, atol=1e-6)


def test_without_alignments_the_lowest_tenth_is_rest(grid):
    for path in (grid / "words").iterdir():
        path.unlink()
    clip = next(faces.read(grid))
    assert clip.speech.words is None
    assert clip.motion.face[20, ARKIT_INDEX["jawOpen"]] == pytest.approx(0.6 - REST, abs=1e-6)


@pytest.fixture
def good(tmp_path):
    """A take of 34 s of FACEGOOD's rig, 30 frames a second."""
    folder, frames = tmp_path / "face_good", 34 * 30
    parts_of_rig = {part for parts in faces._FACEGOOD.values() for part, _ in parts}
    names = sorted(parts_of_rig | {"eye_blink1_l"})
    weights = np.random.default_rng(1).uniform(0, 0.5, (frames, len(names)))
    sounds(folder, {"take": 34.0})
    save(folder, ["take"], [frames], weights, names, 30.0)
    return folder, dict(zip(names, weights.astype(np.float32).T, strict=True))


def test_the_pieces_of_a_long_take_have_its_words_where_they_are_said(good):
    folder, _ = good
    (folder / "words").mkdir()
    rows = [(3 * k, 3 * k + 1) for k in range(11)]
    text = "".join(f"{a * 25_000} {b * 25_000} w{a}\n" for a, b in rows)
    (folder / "words" / "take.align").write_text(text)
    words = [(clip.name, word.text, clip.start + word.start) for clip in faces.read(folder) for word in clip.speech.words]
    assert [(text, start) for _, text, start in words] == [(f"w{a}", a) for a, _ in rows]
    assert [name for name, text, _ in words if text in ("w9", "w12", "w30")] == ["take@00", "take@01", "take@02"]


@pytest.mark.slow
def test_a_rig_is_mapped_by_name_and_long_takes_are_cut(good):
    folder, rig = good
    clips = [*faces.read(folder)]
    assert [(c.name, c.start, len(c.motion)) for c in clips] == [
        ("take@00", 0, 300),
        ("take@01", 10, 300),
        ("take@02", 20, 420),
    ]
    assert [len(clip.speech.samples) for clip in clips] == [160_000, 160_000, 14 * 16_000]
    np.testing.assert_array_equal(
        np.concatenate([clip.speech.samples for clip in clips]), soundfile.read(folder / "audio/take.flac", dtype="float32")[0]
    )
    face = np.concatenate([clip.motion.face for clip in clips])
    for name, expected in {
        "jawOpen": rig["mouth_stretch_c"],
        "mouthFunnel": np.mean([rig[f"mouth_funnel_{end}"] for end in ("dl", "dr", "ul", "ur")], 0),
        "mouthSmileRight": rig["mouth_lipCornerPull_r"],
        "mouthRollUpper": (rig["mouth_suck_ul"] + rig["mouth_suck_ur"]) / 2,
    }.items():
        np.testing.assert_allclose(face[:, ARKIT_INDEX[name]], expected, atol=1e-6)
    assert face.max() <= 1
    assert not face[:, ARKIT_INDEX["eyeBlinkLeft"]].any()


@pytest.mark.slow
def test_gaps_are_drops(grid):
    (grid / "audio" / "bb.flac").unlink()
    (grid / "words" / "cc.align").write_text("0 1000 sil\nbroken\n")
    sounds(grid.parent / "other", {"dd": 1.0})
    (grid.parent / "other" / "audio" / "dd.flac").rename(grid / "audio" / "dd.flac")
    items = {item.name: item for item in faces.read(grid)}
    assert {name for name, item in items.items() if isinstance(item, Dropped)} == {"bb", "cc", "dd"}
    assert "line 2" in items["cc"].reason
    assert "sound" in items["bb"].reason


@pytest.mark.parametrize(
    "damage",
    [
        {"lengths": np.array([50, 40, 99])},
        {"lengths": np.array([50, 65, 0])},
        {"blendshapes": np.full((sum(LENGTHS), len(MEDIAPIPE)), np.nan)},
        {"names": np.array(MEDIAPIPE[1:])},
        {"names": np.array([f"x{k}" for k in range(len(MEDIAPIPE))])},
        {"fps": np.array(0.0)},
        {"fps": np.array("fast")},
        {"clip_ids": np.array(["aa", "aa", "cc"])},
        {"head_matrix": np.zeros((3, 4, 4))},
        {"face_ok": np.zeros(sum(LENGTHS), np.uint8)},
    ],
    ids=lambda damage: next(iter(damage)),
)
def test_tracks_that_make_no_sense_are_errors(grid, damage):
    edit_arrays(grid, **damage)
    with pytest.raises(InputError, match=r"face\.npz"):
        faces.read(grid)


@pytest.mark.parametrize("size", [0, 10, 500])
def test_a_file_that_is_cut_short_is_an_error(grid, size):
    path = grid / "face.npz"
    path.write_bytes(path.read_bytes()[:size])
    with pytest.raises(InputError, match=r"face\.npz"):
        faces.read(grid)


def test_a_folder_without_tracks_is_an_error(tmp_path):
    (tmp_path / "x").mkdir()
    with pytest.raises(InputError, match=r"face\.npz"):
        faces.read(tmp_path)


@pytest.mark.slow
def test_long_takes_lie_in_one_split_each(tmp_path):
    """Neighbouring pieces of a take are too alike to tell what a network has learnt."""
    names, frames = [f"take{k}" for k in range(5)], 520
    folder = tmp_path / "face_eva"
    sounds(folder, dict.fromkeys(names, frames / 25))
    weights = np.zeros((5 * frames, len(MEDIAPIPE)))
    save(folder, names, [frames] * 5, weights, MEDIAPIPE, 25.0)
    splits: dict[str, set] = {}
    for clip in faces.read(folder):
        splits.setdefault(clip.name.split("@")[0], set()).add(clip.split)
    assert sorted(map(len, splits.values())) == [1] * 5
    assert sorted(split for splits_of_take in splits.values() for split in splits_of_take) == [
        "test",
        "train",
        "train",
        "train",
        "validation",
    ]
