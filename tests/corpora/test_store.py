"""The store: what is written is read, windows stay within clips, and damage is refused."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from cospeech.corpora.store import Entry, Store, gather
from cospeech.corpora.store_writer import Piece, write_store
from cospeech.errors import InputError

NAMES = {"pose": ("a", "b", "c"), "audio": ("loud", "pitch"), "face": tuple(f"f{k}" for k in range(52))}
LENGTHS = {"one": 40, "two": 7, "three": 90, "four": 55}


def piece(name: str, frames: int, *, face: bool, words: tuple[str, ...] = ()) -> Piece:
    rng = np.random.default_rng(frames)
    values = {
        "pose": np.concatenate([rng.normal(3, 2, (frames, 2)), np.full((frames, 1), 7.0)], 1).astype(np.float32),
        "audio": rng.normal(size=(frames, 2)).astype(np.float32),
        "word": rng.integers(0, len(words) + 1, frames).astype(np.int32),
    }
    if face:
        values["face"] = rng.random((frames, 52), np.float32)
    split = "test" if name == "four" else "train"
    entry = Entry(name, "ann" if frames % 2 else "bob", split, 0, frames, 1.5, tuple(values))
    return Piece(entry, words, lambda: dict(values))


@pytest.fixture(scope="module")
def pieces():
    words = {"one": ("hello", "you"), "three": ("you", "all", "hello")}
    return [piece(name, n, face=name != "three", words=words.get(name, ())) for name, n in LENGTHS.items()]


@pytest.fixture(scope="module")
def folder(tmp_path_factory, pieces):
    path = tmp_path_factory.mktemp("store") / "mine"
    write_store(path, pieces, corpus="beat", pose="none", fps=15.0, names=NAMES)
    return path


def test_what_is_written_is_read(folder, pieces):
    store = Store(folder)
    assert [(c.name, c.frames) for c in store.clips] == list(LENGTHS.items())
    assert len(store) == sum(LENGTHS.values())
    assert store.fps == 15
    assert store.speakers == ("ann", "bob")
    for original in pieces:
        read, values = store.clip(original.entry.name), original.load()
        assert set(read) == set(values)
        for name in ("pose", "audio", "face"):
            if name in values:
                np.testing.assert_array_equal(read[name], values[name])
        own = np.array(["", *original.words])
        np.testing.assert_array_equal(np.array(store.words)[read["word"]], own[values["word"]])


def test_what_a_clip_lacks_is_absent_not_zero(folder):
    store = Store(folder)
    rows = slice(store.clips[2].offset, store.clips[2].offset + 90)
    assert "face" not in store.clips[2].has
    assert np.isnan(store.arrays["face"][rows]).all()
    assert store.starts(30, None, ["face"])[0].tolist() == [0, 3]


def test_statistics_are_those_of_the_train_split(folder):
    store = Store(folder)
    train = np.concatenate([store.clip(k)["pose"] for k in range(3)]).astype(float)
    mean, std = store.statistics()
    np.testing.assert_allclose(mean, train.mean(0), rtol=1e-5)
    np.testing.assert_allclose(std[:2], train.std(0)[:2], rtol=1e-5)
    assert std[2] == 1  # constant: dividing by it does no harm
    ann = store.clip(1)["pose"].astype(float)
    np.testing.assert_allclose(store.statistics("pose", "ann")[0], ann.mean(0), rtol=1e-5)
    with pytest.raises(InputError, match="did you mean 'ann'"):
        store.statistics("pose", "anne")


def test_windows_stay_within_clips_and_reach_every_start(folder):
    store = Store(folder)
    batches = store.windows(32, batch=256, seed=3, arrays=("pose", "word"))
    starts = set()
    for _ in range(8):
        batch = next(batches)
        for start, clip, speaker, pose in zip(batch["start"], batch["clip"], batch["speaker"], batch["pose"], strict=True):
            entry = store.clips[clip]
            assert entry.offset <= start
            assert start + 32 <= entry.offset + entry.frames
            assert entry.split == "train"
            assert store.speakers[speaker] == entry.speaker
            np.testing.assert_array_equal(pose, store.arrays["pose"][start : start + 32])
            starts.add(int(start))
    assert len(starts) == (40 - 31) + (90 - 31)
    again = next(store.windows(32, batch=256, seed=3))
    np.testing.assert_array_equal(again["start"], next(store.windows(32, batch=256, seed=3))["start"])


def test_a_window_is_a_copy(folder):
    batch = next(Store(folder).windows(8))
    batch["pose"][:] = 0
    assert Store(folder).arrays["pose"][:8].any()


def test_windows_that_cannot_be(folder):
    store = Store(folder)
    hint = "no window of 91 .*: its longest clip has 90 .*data.validation=0.05"  # what helps where a split has no clips
    for arguments, words in [((91,), hint), ((8, "train", ["hands"]), "no 'hands'"), ((8, "dev"), "no split")]:
        with pytest.raises(InputError, match=words):
            store.starts(*arguments)
    with pytest.raises(InputError, match=r"of 41 .*: its longest clip has 40 "):  # the one of 90 has no face
        store.starts(41, "train", ["pose", "face"])
    with pytest.raises(InputError, match=r"validation split of .*: it has no clips .*data.validation=0.05"):
        store.starts(8, "validation", ["pose", "face"])
    with pytest.raises(InputError, match="outside"):
        gather(np.zeros((10, 2)), np.array([5]), 6)


def test_what_no_clip_of_a_split_has_is_named_alone(tmp_path):
    parts = [piece("one", 40, face=True), piece("four", 55, face=False)]  # four: the test split
    write_store(tmp_path / "faceless", parts, corpus="beat", pose="none", fps=15.0, names=NAMES)
    with pytest.raises(InputError, match=r"test split of .*: it has no clip with face \(prepare it again .* have face;"):
        Store(tmp_path / "faceless").starts(8, "test", ["pose", "audio", "word", "face"])


def test_the_same_pieces_give_the_same_bytes(folder, pieces, tmp_path):
    write_store(tmp_path / "again", pieces, corpus="beat", pose="none", fps=15.0, names=NAMES)
    files = sorted(p.name for p in folder.iterdir())
    assert files == sorted(p.name for p in (tmp_path / "again").iterdir())
    assert all((folder / name).read_bytes() == (tmp_path / "again" / name).read_bytes() for name in files)


def test_a_writing_that_fails_leaves_nothing(pieces, tmp_path):
    def fail() -> dict:
        raise InputError("a part is gone")

    bad = [*pieces, Piece(pieces[0].entry, (), fail)]
    with pytest.raises(InputError, match="gone"):
        write_store(tmp_path / "s", bad, corpus="beat", pose="none", fps=15.0, names=NAMES)
    assert list((tmp_path / "s").iterdir()) == []


def damage(folder, index):
    """Ways to spoil a store: (name, what to do)."""

    def edit(**changes):
        (folder / "index.json").write_text(json.dumps(index | changes))

    def clip(**changes):
        edit(clips=[index["clips"][0] | changes, *index["clips"][1:]])

    def pickle(path):
        np.save(path, np.array([{"a": 1}], object), allow_pickle=True)

    pose = folder / "pose.npy"
    return {
        "no index": lambda: (folder / "index.json").unlink(),
        "no JSON": lambda: (folder / "index.json").write_text("{"),
        "nested": lambda: (folder / "index.json").write_text("[" * 100_000),
        "binary": lambda: (folder / "index.json").write_bytes(b"\xff\xfe\x00"),
        "a list": lambda: (folder / "index.json").write_text("[]"),
        "version": lambda: edit(format="cospeech-store-0"),
        "no clips": lambda: edit(clips=None),
        "clip without name": lambda: edit(clips=[{}]),
        "offset": lambda: clip(offset=3),
        "frames": lambda: clip(frames=-1),
        "frames as text": lambda: clip(frames="many"),
        "split": lambda: clip(split="dev"),
        "speaker": lambda: clip(speaker="nobody"),
        "has": lambda: clip(has=["hands"]),
        "fewer clips": lambda: edit(clips=index["clips"][:2]),
        "shape": lambda: edit(arrays=index["arrays"] | {"pose": [5, 3]}),
        "fps": lambda: edit(fps=0),
        "fps NaN": lambda: edit(fps=float("nan")),
        "no pose": lambda: pose.unlink(),
        "cut": lambda: pose.write_bytes(pose.read_bytes()[:-8]),
        "empty": lambda: pose.write_bytes(b""),
        "header": lambda: pose.write_bytes(b"\x93NUMPY\x01\x00v\x00{'descr': __import__('os')"),
        "pickle": lambda: pickle(pose),
        "type": lambda: np.save(pose, np.zeros((192, 3))),
        "order": lambda: np.save(pose, np.zeros((192, 3), np.float32, order="F")),
        "zip": lambda: pose.write_bytes(b"PK\x03\x04" + bytes(200)),
    }


@pytest.mark.parametrize("kind", damage(Path(), None))
def test_damage_is_refused_in_one_line(folder, tmp_path, kind):
    spoilt = tmp_path / "spoilt"
    shutil.copytree(folder, spoilt)
    damage(spoilt, json.loads((spoilt / "index.json").read_text()))[kind]()
    with pytest.raises(InputError) as error:
        Store(spoilt)
    assert "\n" not in str(error.value)
    assert "spoilt" in str(error.value)


def test_an_index_cannot_name_files_elsewhere(folder, tmp_path):
    spoilt = tmp_path / "spoilt"
    shutil.copytree(folder, spoilt)
    index = json.loads((spoilt / "index.json").read_text())
    (spoilt / "index.json").write_text(json.dumps(index | {"arrays": index["arrays"] | {"../../secret": [3]}}))
    assert "../../secret" not in Store(spoilt).arrays
