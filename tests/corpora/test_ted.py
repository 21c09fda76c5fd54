"""TED: the old pyarrow container, the LMDB layout there and back, and what damaged databases lead to."""

from __future__ import annotations

import random
import struct
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from cospeech.audio.speech import Speech, Word
from cospeech.corpora import Clip, Dropped
from cospeech.corpora.ted import read as ted
from cospeech.corpora.ted.legacy_arrow import PickledContent, decode
from cospeech.corpora.ted.legacy_arrow_writer import encode
from cospeech.errors import InputError
from cospeech.motion.motion import Motion
from cospeech.motion.points import Points
from cospeech.motion.rotations import quat_identity
from cospeech.motion.skeleton import humanoid
from cospeech.motion.skeletons.ted import JOINTS, PARENTS

pa = pytest.importorskip("pyarrow", reason="TED's reader needs cospeech[corpora]")
pytest.importorskip("pyarrow.ipc")
lmdb = pytest.importorskip("lmdb", reason="TED's reader needs cospeech[corpora]")


def make_clip(number: int, speaker: str = "anna", frames: int = 40, fps: float = 25.0, **more) -> Clip:
    rng = np.random.default_rng(number)
    values = np.cumsum(rng.normal(0, 0.01, (frames, 10, 3)), 0) + rng.normal(0, 0.3, (10, 3))
    samples = rng.uniform(-0.5, 0.5, round(frames / fps * 16_000)).astype(np.float32)
    words = (Word("hello", 0.1, 0.4), Word("wörld", 0.5, 0.9))
    points = Points(fps, values - values[:, :1], "ted")
    return Clip(f"clip{number}", speaker, "made", Speech(samples, words=words), points=points, **more)


def put(folder: Path, values: list[bytes]) -> Path:
    """An LMDB as the authors' scripts write it."""
    with lmdb.open(str(folder), map_size=1 << 24) as store, store.begin(write=True) as change:
        for k, value in enumerate(values):
            change.put(f"{k:010}".encode(), value)
    return folder


def entry(clips: int = 2) -> dict:
    """A video as in the raw databases."""
    parts = []
    for k in range(clips):
        clip, start = make_clip(k, frames=30), 2.0 * k
        words = [[w.text, w.start + start, w.end + start] for w in clip.speech.words]
        parts.append({"words": words, "skeletons_3d": clip.points.values.astype(np.float16)})
        parts[-1] |= {"audio_feat": np.zeros((128, 38), np.float16), "audio_raw": clip.speech.samples.astype(np.float16)}
        parts[-1] |= {"start_frame_no": 50 * k, "end_frame_no": 50 * k + 30, "start_time": start, "end_time": start + 1.2}
    return {"vid": "abcdefghijk", "framerate": 25.0, "clips": parts}


# The container ---------------------------------------------------------------------------------------------------------


def test_given_payloads_decode_and_encode_to_the_same_bytes(shared_folder):
    folder = shared_folder / "data" / "ted_legacy"
    window, video = ((folder / f"{name}_entry.bin").read_bytes() for name in ("cache", "raw"))
    value = decode(window)
    with np.load(folder / "cache_entry_expected.npz") as expected:
        for k in range(4):
            assert value[k + 1].dtype == expected[f"arr_{k}"].dtype
            assert np.array_equal(value[k + 1], expected[f"arr_{k}"])
    assert value[0] == [["hello", 10.1, 10.4]]
    assert value[5]["filtering_message"] == "PASS"
    assert value[5]["is_correct_motion"] is True
    clip = decode(video)["clips"][0]
    assert [clip["skeletons_3d"].shape, clip["audio_raw"].shape] == [(150, 10, 3), (96_000,)]
    assert encode(value) == window
    assert encode(decode(video)) == video


def same(a, b) -> bool:
    if isinstance(a, np.ndarray):
        return isinstance(b, np.ndarray) and a.dtype == b.dtype and a.shape == b.shape and np.array_equal(a, b)
    if isinstance(a, dict):
        return list(a) == list(b) and all(same(a[k], b[k]) for k in a)
    if isinstance(a, (list, tuple)):
        return type(a) is type(b) and len(a) == len(b) and all(map(same, a, b))
    return type(a) is type(b) and a == b


@pytest.mark.parametrize(
    "value",
    [
        None,
        {},
        [[], {}, ()],
        {"a": {"b": [{"c": np.arange(6, dtype=np.int16).reshape(2, 3)}, None, (1, 2.5)]}, 3: "x"},
        [True, 1, 1.0, "1", b"1", -(2**63)],
        {"words": [["né", 1.0, 2.0]], "empty": np.zeros((0, 10, 3), np.float16), "f": np.ones((2, 3), order="F")},
        {1, 2},
    ],
)
def test_values_come_back(value):
    assert same(decode(encode(value)), value)


@pytest.mark.parametrize("bad", [np.array([True]), np.array(["x"]), np.array([None]), object(), 2**70, [1j]])
def test_what_would_have_been_pickled_is_not_written(bad):
    with pytest.raises(InputError):
        encode({"a": [bad]})


def test_pickled_content_is_refused_and_named(tmp_path):
    video = entry()
    video["clips"][1]["mask"] = {"data": b"\x80\x04K\x01.", "pickle": True, "_pytype_": "numpy.ndarray"}
    with pytest.raises(PickledContent, match=r"numpy\.ndarray.*\['clips'\]\[1\]\['mask'\]"):
        decode(encode(video))
    put(tmp_path / "lmdb_train", [encode(entry()), encode(video)])
    with pytest.raises(InputError, match=r"entry 0000000001 of .*lmdb_train.*pickled content .*\['mask'\]"):
        list(ted.read(tmp_path))


def as_before_0_15(payload: bytes) -> bytes:
    """The same value in the older framing: no markers, counts without sparse tensors, metadata version 4."""
    source = pa.BufferReader(payload)
    source.seek(16)
    batch = pa.ipc.open_stream(source).read_next_batch()
    count, at = struct.unpack_from("<4i", payload)[2], source.tell() + 8
    sink = pa.BufferOutputStream()
    sink.write(struct.pack("<4i", 0, count, 0, 0))
    options = pa.ipc.IpcWriteOptions(metadata_version=pa.ipc.MetadataVersion.V4, use_legacy_format=True)
    with pa.ipc.new_stream(sink, batch.schema, options=options) as stream:
        stream.write_batch(batch)
    for _ in range(count):
        at += -at % 64
        source.seek(at)
        pa.ipc.read_tensor(source)
        length = struct.unpack_from("<i", payload, at + 4)[0]
        sink.write(bytes(-sink.tell() % 64))
        sink.write(struct.pack("<i", length + 4) + payload[at + 8 : at + 8 + length] + bytes(4))
        sink.write(payload[at + 8 + length : source.tell()])
        at = source.tell()
    return sink.getvalue().to_pybytes()


def test_the_older_framing_is_read():
    video = {"a": np.arange(12.0).reshape(3, 4), "b": ["x", 1, np.ones(5, np.float16)]}
    old = as_before_0_15(encode(video))
    assert old[16:20] != b"\xff\xff\xff\xff"
    assert same(decode(old), video)


# The layout ------------------------------------------------------------------------------------------------------------


def test_what_is_written_comes_back(tmp_path):
    clips = [make_clip(k, f"speaker{k // 7}", frames=20 + k) for k in range(22)]
    names = ted.write([*clips[:3], Dropped("x", "y"), *clips[3:]], tmp_path / "raw")
    assert sorted(path.name for path in (tmp_path / "raw").iterdir()) == ["lmdb_test", "lmdb_train", "lmdb_val"]
    clips_by_name = {clip.name: clip for clip in ted.read(tmp_path / "raw")}
    assert len(clips_by_name) == len(names) == 22
    for k, (clip, name) in enumerate(zip(clips, names, strict=True)):
        back = clips_by_name[name]
        assert back.split == {9: "test", 8: "validation"}.get(k % 10, "train")
        assert np.array_equal(back.points.values, clip.points.values.astype(np.float16))
        assert np.array_equal(back.speech.samples, clip.speech.samples.astype(np.float16))
        assert back.points.fps == 25
        assert back.speaker.rstrip("_") == clip.speaker
        assert len(back.extra["vid"]) == 11
        assert [w.text for w in back.speech.words] == ["hello", "wörld"]
        times = [[w.start, w.end] for w in back.speech.words]
        assert np.allclose(times, [[0.1, 0.4], [0.5, min(0.9, back.duration)]], atol=1e-9)
    starts = [(clips_by_name[name].start, clips_by_name[name].start + clips_by_name[name].duration) for name in names[:7]]
    assert all(a[1] < b[0] for a, b in pairwise(starts)), "clips of a speaker follow each other"


def test_the_file_is_as_the_authors_scripts_expect(tmp_path):
    ted.write([make_clip(0)], tmp_path)
    with lmdb.open(str(tmp_path / "lmdb_train"), readonly=True, lock=False) as store, store.begin() as look:
        (key, value), *rest = look.cursor()
    assert key == b"0000000000"
    assert rest == []
    video = decode(value)
    assert list(video) == ["vid", "framerate", "clips"]
    clip = video["clips"][0]
    assert list(clip) == [
        "words", "skeletons_3d", "audio_feat", "audio_raw", "start_frame_no", "end_frame_no", "start_time", "end_time",
    ]  # fmt: skip
    assert {clip[key].dtype for key in ("skeletons_3d", "audio_feat", "audio_raw")} == {np.dtype(np.float16)}
    assert clip["audio_feat"].shape == (128, 1 + len(clip["audio_raw"]) // 512)
    assert clip["audio_feat"].max() == 0
    original = make_clip(0).points.values
    assert np.allclose(clip["skeletons_3d"], original * [-1, -1, 1], atol=1e-3), "x to the person's right, y down"


def test_written_again_where_something_is(tmp_path):
    ted.write([make_clip(0)], tmp_path)
    with pytest.raises(InputError, match="has a lmdb_train already"):
        ted.write([make_clip(0)], tmp_path)


@pytest.mark.parametrize("missing", ["speech", "points"])
def test_a_failed_write_leaves_nothing(tmp_path, missing):
    from dataclasses import replace

    bad = replace(make_clip(1), **{missing: None})
    with pytest.raises(InputError, match="'clip1'"):
        ted.write([make_clip(0), bad], tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_motion_is_turned_into_key_points(tmp_path):
    body = humanoid()
    still = Motion(50.0, np.tile(quat_identity(len(body)), (100, 1, 1)), np.tile(body.offsets[0], (100, 1)))
    speech = Speech(np.full(32_000, 0.1, np.float32))
    (name,) = ted.write([Clip("t-pose", "a", "made", speech, motion=still)], tmp_path)
    (clip,) = ted.read(tmp_path)
    assert (clip.name, len(clip.points), clip.speech.words) == (name, 50, ())
    at = dict(zip(JOINTS, clip.points.values[0], strict=True))
    assert at["leftWrist"][0] > 0.6
    assert at["rightWrist"][0] < -0.6
    assert at["head"][1] > at["neck"][1] > 0.2
    assert at["nose"][2] > at["head"][2]
    bones = [np.linalg.norm(clip.points.values[0, k] - clip.points.values[0, p]) for k, p in enumerate(PARENTS) if p >= 0]
    assert np.abs(np.array(bones[:3]) - [0.26, 0.18, 0.14]).max() < 0.011, "as the authors' table of bones"


def test_tables_agree_with_the_representation():
    from cospeech.motion.poses import direction_vectors

    assert direction_vectors.JOINTS == JOINTS
    assert [(PARENTS[b], b) for _, b, _ in direction_vectors.BONES] == [(a, b) for a, b, _ in direction_vectors.BONES]


def window(k: int = 0) -> list:
    """A window as in the caches."""
    clip = make_clip(k, frames=42, fps=15.0)
    about = {"vid": "abcdefghijk", "start_frame_no": 7, "end_frame_no": 49, "start_time": 3.0, "end_time": 5.8}
    about |= {"is_correct_motion": True, "filtering_message": "PASS"}
    vectors = np.zeros((42, 9, 3), np.float32)
    sound = clip.speech.samples.astype(np.float16)
    return [
        [["hello", 3.5, 3.9], ["late", 9.0, 9.1]],
        clip.points.values,
        vectors,
        sound,
        np.zeros((128, 86), np.float16),
        about,
    ]


def test_the_cache_is_read_where_there_is_nothing_else(tmp_path):
    as_list = window(1)
    as_list[1] = list(as_list[1])  # some versions keep a list of frames
    put(tmp_path / "lmdb_val_cache", [encode(window()), encode(as_list), encode([*window(2), np.zeros((14, 10))])])
    clips = list(ted.read(tmp_path))
    assert [clip.split for clip in clips] == ["validation"] * 3
    assert clips[0].points.fps == 15
    assert clips[0].speech.words == (Word("hello", 0.5, pytest.approx(0.9)),)
    assert clips[0].extra["words_outside"] == 1
    for k, clip in enumerate(clips):
        assert np.array_equal(clip.points.values, make_clip(k, frames=42, fps=15.0).points.values * [-1, -1, 1])
    ted.write([make_clip(5)], tmp_path)
    assert [clip.points.fps for clip in ted.read(tmp_path)] == [25.0]


# Damage ----------------------------------------------------------------------------------------------------------------


def sound(item: Clip | Dropped) -> None:
    """What a reader may yield: a whole clip, or a drop with a one-line reason."""
    if isinstance(item, Dropped):
        assert item.reason
        assert "\n" not in item.reason
        return
    assert item.points.values.shape == (len(item.points), 10, 3)
    assert np.isfinite(item.points.values).all()
    assert np.isfinite(item.speech.samples).all()
    assert abs(item.speech.seconds - item.points.duration) < 2
    assert all(0 <= w.start <= w.end <= item.speech.seconds + 1 for w in item.speech.words)


def replace_place(value, path, new):
    """A copy of nested containers with one place replaced, or taken out (...)."""
    copy = dict(value) if isinstance(value, dict) else list(value)
    if len(path) > 1:
        copy[path[0]] = replace_place(copy[path[0]], path[1:], new)
    elif new is ...:
        del copy[path[0]]
    else:
        copy[path[0]] = new
    return copy


def spoilt(array: np.ndarray, value: float) -> np.ndarray:
    array = array.copy()
    array.flat[array.size // 2] = value
    return array


def wrong_entries() -> list[object]:
    video = entry()
    clip, entries = ("clips", 1), []
    for key in video["clips"][1]:
        entries += [replace_place(video, (*clip, key), new) for new in (..., None, "text", -1, [], {}, True)]
    harmless = [v["clips"][1].get("words") == [] or "audio_feat" not in v["clips"][1] for v in entries]
    entries = [v for v, fine in zip(entries, harmless, strict=True) if not fine]  # nothing said, no spectrum: that may be
    for key in ("skeletons_3d", "audio_raw", "audio_feat"):
        array = video["clips"][1][key]
        news = [spoilt(array, np.nan), spoilt(array, np.inf), spoilt(array, 5e4), array[:0], array[..., :2], array.astype(int)]
        entries += [replace_place(video, (*clip, key), new) for new in [*news, array[None], np.float16(1), array.tolist()]]
    for word in (
        [],
        ["a"],
        ["a", 1.0],
        [1, 2.0, 3.0],
        ["a", "b", "c"],
        ["a", np.nan, 3.0],
        ["a", 3.0, 2.5],
        None,
        "a",
        ["a", 1, 2, 3],
    ):
        entries.append(replace_place(video, (*clip, "words", 0), word))
    for key in ("start_time", "end_time"):
        entries += [
            replace_place(video, (*clip, key), t) for t in (np.nan, -np.inf, 1e9, 100.0, 3.1 if key == "start_time" else 2.05)
        ]
    entries += [replace_place(video, (*clip, "end_frame_no"), n) for n in (0, 20, 10**6)]
    entries += [
        replace_place(video, (*clip, "skeletons_3d"), array)
        for array in (np.zeros((30, 10, 3)), np.ones((30, 9, 3)), np.ones((5, 10, 3)))
    ]
    return entries


@pytest.mark.slow
def test_wrong_entries_are_dropped_with_a_reason(tmp_path):
    values = wrong_entries()
    put(tmp_path / "lmdb_train", [encode(value) for value in values])
    items = list(ted.read(tmp_path))
    by_entry = [[i for i in items if i.name.startswith(f"train-{k:010}")] for k in range(len(values))]
    assert len(values) > 100
    for pair, value in zip(by_entry, values, strict=True):
        good, bad = pair
        assert isinstance(good, Clip), "only the damaged clip is lost"
        assert isinstance(bad, Dropped), value["clips"][1]
        assert "abcdefghijk" in bad.reason
        sound(bad)


def test_wrong_shapes_of_entries_are_dropped(tmp_path):
    video = entry()
    values = [None, 1, "x", [], {}, [1] * 6, {"vid": 3, "clips": []}, {**video, "vid": "a\nb"}, {**video, "clips": None}]
    values += [{**video, "clips": [None]}, {**video, "framerate": 0.0}, {**video, "framerate": "25"}, {**video, "clips": []}]
    put(tmp_path / "lmdb_test", [encode(value) for value in values])
    items = list(ted.read(tmp_path))
    assert {item.name[:15] for item in items} == {f"test-{k:010}" for k in range(len(values))}
    for item in items:
        assert isinstance(item, Dropped)
        sound(item)


def test_damaged_payloads(tmp_path):
    """Truncated and with bits flipped, in the structure and in the arrays."""
    rng, payload = random.Random(1), encode(entry(1))
    values = [payload[: rng.randrange(1, len(payload))] for _ in range(40)]
    for k in range(160):
        data = bytearray(payload)
        at = rng.randrange(16 if k % 4 else 0, 3000 if k % 3 else len(data))
        data[at] ^= 1 << rng.randrange(8)
        values.append(bytes(data))
    put(tmp_path / "lmdb_train", values)
    names = []
    for item in ted.read(tmp_path):
        sound(item)
        names.append(item.name[:16])
        if isinstance(item, Dropped) and len(item.name) == 16:
            assert item.name[6:] in item.reason, "the reason names the entry"
    assert set(names) == {f"train-{k:010}" for k in range(200)}, "nothing is lost silently"


def failure(raw: Path) -> str | None:
    """The message of the error that reading ends with; what comes before it is sound."""
    try:
        for item in ted.read(raw):
            sound(item)
    except InputError as error:
        return str(error)
    return None


@pytest.mark.slow
@pytest.mark.parametrize("part", range(4))
def test_damaged_databases(tmp_path, part):
    """An error of one line that names the database, or sound items; in no case a crash of ours."""
    rng = random.Random(part)
    put(tmp_path / "lmdb_train", [encode(entry(1)) for _ in range(3)])
    file = tmp_path / "lmdb_train" / "data.mdb"
    whole = file.read_bytes()
    errors = 0
    for k in range(14):
        data = bytearray(whole)
        if k % 3 == 0:
            data = data[: rng.randrange(len(data))] if k % 2 else data[: rng.randrange(3, len(data) // 4096) * 4096]
        elif k % 3 == 1:
            for _ in range(20):
                data[rng.randrange(2 * 4096) if k % 2 else rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        else:
            page = rng.randrange(len(data) // 4096) * 4096
            data[page : page + 4096] = bytes(4096) if k % 2 else rng.randbytes(4096)
        file.write_bytes(data)
        message = failure(tmp_path)
        if message is not None:
            errors += 1
            assert "\n" not in message
            assert "lmdb_train" in message
    assert errors >= 4


def test_no_ted_at_all(tmp_path):
    with pytest.raises(InputError, match="no such folder"):
        list(ted.read(tmp_path / "nowhere"))
    (tmp_path / "readme.txt").write_text("hello")
    with pytest.raises(InputError, match="there is no TED in"):
        list(ted.read(tmp_path))
