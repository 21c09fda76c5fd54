"""PATS: the layout there and back, tables of words without pandas, transforms, statistics, and what damage leads to."""

from __future__ import annotations

import random
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from cospeech.audio.features import log_mel_400
from cospeech.audio.speech import Speech, Word
from cospeech.corpora import Clip, Dropped
from cospeech.corpora.hdf5_lmdb import Hdf5LmdbReader
from cospeech.corpora.pats import read as pats
from cospeech.corpora.pats.pandas_frame import read_frame, unpack
from cospeech.errors import InputError
from cospeech.motion.motion import Motion
from cospeech.motion.points import Points
from cospeech.motion.rotations import quat_identity
from cospeech.motion.skeleton import humanoid
from cospeech.motion.skeletons.pats import JOINTS, PARENTS, SPEAKERS

h5py = pytest.importorskip("h5py", reason="PATS' reader needs cospeech[corpora]")

HEAD = "dataset,delta_time,end_time,interval_id,speaker,start_time,video_fn,video_link\n"
WORDS = (Word("hello", 0.0, 0.4), Word("wörld", 0.4, 0.8))


def make_clip(number: int, speaker: str = "oliver", frames: int = 30, sound: bool = False, **more) -> Clip:
    rng = np.random.default_rng(number)
    values = np.cumsum(rng.normal(0, 2, (frames, 52, 2)), 0) + rng.normal(0, 150, (52, 2)) + [640, -300]
    values[:, 1] = values[:, 0] + [-166, 1]
    samples = rng.uniform(-0.3, 0.3, round(frames / 15 * 16_000)).astype(np.float32)
    speech = Speech(samples, words=WORDS) if sound else None
    extra = {} if sound else {"words": WORDS}
    return Clip(str(1000 + number), speaker, "made", speech, points=Points(15.0, values, "pats"), extra=extra, **more)


@pytest.fixture(scope="module")
def small(tmp_path_factory) -> Path:
    """Three silent intervals of two seconds."""
    root = tmp_path_factory.mktemp("pats")
    pats.write([make_clip(k) for k in range(3)], root)
    return root


def copy(small: Path, target: Path) -> Path:
    shutil.copytree(small, target)
    return target


# The layout ------------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_what_is_written_comes_back(tmp_path):
    clips = [make_clip(k, SPEAKERS[k % 3], 30 + k, sound=k == 0, start=10.5 * k) for k in range(11)]
    names = pats.write([*clips[:5], Dropped("x", "y"), *clips[5:]], tmp_path)
    clips_read = list(pats.read(tmp_path))
    assert [clip.name for clip in clips_read] == names == [clip.name for clip in clips]
    for k, (clip, back) in enumerate(zip(clips, clips_read, strict=True)):
        assert np.abs(back.points.values - clip.points.values).max() < 1e-9
        assert (back.points.fps, back.points.layout, back.speaker) == (15.0, "pats", clip.speaker)
        assert back.split == {9: "test", 8: "validation"}.get(k, "train")
        assert back.start == pytest.approx(clip.start, abs=1e-6)
        words = back.speech.words if k == 0 else back.extra["words"]
        assert [w.text for w in words] == ["hello", "wörld"]
        assert np.allclose([[w.start, w.end] for w in words], [[0, 0.4], [0.4, 0.8]]), "on whole frames already"
        assert (back.speech is None) == (k > 0)


@pytest.mark.slow
def test_sound_and_its_features(tmp_path):
    speech = Speech.load(Path(__file__).parents[2] / "src/cospeech/assets/example/example.ogg").window(2, 6)
    clip = make_clip(0, frames=60, sound=True)
    clip = Clip("7", "noah", "made", Speech(speech.samples, speech.rate, WORDS), points=clip.points)
    pats.write([clip], tmp_path)
    (back,) = pats.read(tmp_path)
    common = min(len(back.speech), len(speech))
    assert back.speech.seconds == pytest.approx(4.0, abs=0.05)
    assert np.corrcoef(back.speech.samples[:common], speech.samples[:common])[0, 1] > 0.98, "an MP3 of the same sound, in place"
    np.testing.assert_allclose(back.extra["audio/log_mel_400"], log_mel_400(speech.samples), atol=1e-3)
    assert back.extra["audio/log_mel_512"].shape[1] == 128
    silence = back.extra["audio/silence"]
    assert silence.shape == (60,)
    assert 0 < silence.mean() < 0.9


def test_the_file_is_as_the_authors_loader_expects(small):
    with h5py.File(small / "processed" / "oliver" / "1000.h5") as file:
        data, normal, confidence = (file[f"pose/{name}"][()] for name in ("data", "normalize", "confidence"))
    assert data.shape == normal.shape == confidence.shape == (30, 104)
    values = make_clip(0).points.values
    assert np.allclose(data[:, 0], values[:, 0, 0])
    assert np.allclose(data[:, 52], -values[:, 0, 1]), "the neck where it is, y down"
    assert np.allclose(data[:, 53:], -(values[:, 1:, 1] - values[:, :1, 1])), "the others from the neck"
    assert np.allclose(np.hypot(normal[:, 1], normal[:, 53]), 167)
    assert np.allclose(normal[:, [0, 52]], data[:, [0, 52]])
    with h5py.File(small / "missing_intervals.h5") as file:
        assert h5py.check_string_dtype(file["intervals"].dtype).length is None
    assert (small / "cmu_intervals_df_transforms.csv").read_text() == HEAD
    assert (
        (small / "cmu_intervals_df.csv").read_text().startswith(HEAD + "train,2.0,0:00:02.000000,1000,oliver,0:00:00.000000,")
    )


@pytest.mark.slow
def test_missing_intervals_are_dropped_under_current_h5py(small, tmp_path):
    root = copy(small, tmp_path / "raw")
    for kind in (h5py.string_dtype(), h5py.string_dtype("ascii"), "S8"):
        with h5py.File(root / "missing_intervals.h5", "w") as file:
            file["intervals"] = np.array([b"1001", b"77"], dtype=kind)
        items = list(pats.read(root))
        assert [type(item).__name__ for item in items] == ["Clip", "Dropped", "Clip"]
        assert items[1] == Dropped("1001", "listed in missing_intervals.h5")
    (root / "missing_intervals.h5").unlink()
    assert len([item for item in pats.read(root) if isinstance(item, Clip)]) == 3


def test_motion_is_seen_from_the_front(tmp_path):
    body = humanoid()
    still = Motion(60.0, np.tile(quat_identity(len(body)), (120, 1, 1)), np.tile(body.offsets[0], (120, 1)))
    pats.write([Clip("t pose", "a|b/c", "made", motion=still)], tmp_path)
    (clip,) = pats.read(tmp_path)
    assert (clip.name, clip.speaker, len(clip.points)) == ("100000", "a_b_c", 30)
    at = dict(zip(JOINTS, clip.points.values[0] - clip.points.values[0, 0], strict=True))
    assert at["RShoulder"] == pytest.approx([-166, 0], abs=2), "the person's right is at the picture's left"
    assert at["LHandMiddle4"][0] > at["LHandMiddle1"][0] > at["LWrist"][0] > at["LElbow"][0] > at["LShoulder"][0] > 0
    assert np.allclose(at["Nose"], [-4.9, 173.0], atol=25), "about where the corpus has it on average"
    assert at["LEye"][0] > 0 > at["REye"][0]
    assert len(PARENTS) == len(JOINTS) == 52


def test_tables_agree_with_the_representation():
    from cospeech.motion.poses import keypoints2d

    assert keypoints2d.JOINTS == JOINTS
    vectors = keypoints2d.KEYPOINTS2D.encode(make_clip(1).points)
    columns = list(keypoints2d.KEPT)
    from cospeech.corpora.pats.points import normalise_points

    flat = normalise_points(pats.from_points(make_clip(1).points.values))
    assert np.allclose(vectors, np.concatenate([flat[:, columns], flat[:, 52:][:, columns]], 1)), (
        "encode() gives pose/normalize"
    )


def test_a_failed_write_is_no_pats(tmp_path):
    from dataclasses import replace

    bad = replace(make_clip(1), points=None)
    with pytest.raises(InputError, match="'1001'"):
        pats.write([make_clip(0), bad], tmp_path)
    with pytest.raises(InputError, match="there is no PATS"):
        list(pats.read(tmp_path))
    pats.write([make_clip(0)], tmp_path)
    with pytest.raises(InputError, match=r"has a cmu_intervals_df\.csv already"):
        pats.write([make_clip(0)], tmp_path)


# Transforms ------------------------------------------------------------------------------------------------------------


def test_transforms():
    values = make_clip(3).points.values
    mirror_image = pats.mirror(values)
    assert np.allclose(pats.mirror(mirror_image), values)
    flat, other = pats.from_points(values), pats.from_points(mirror_image)
    assert np.allclose(other[:, 1:52], -flat[:, 1:52])
    assert np.allclose(np.delete(other, np.r_[1:52], 1), np.delete(flat, np.r_[1:52], 1)), "neck and y stay"
    mean = pats.to_points(flat.mean(0, keepdims=True))[0] - values[:, 0].mean(0)
    of_held_arm = pats.from_points(pats.hold_arm(values, "left", mean))
    left = [JOINTS.index(name) for name in JOINTS if name.startswith("L")]
    assert len(left) == 25
    assert np.ptp(of_held_arm[:, left], 0).max() < 1e-9
    assert np.allclose(of_held_arm[:, left], flat[:, left].mean(0))
    still = [k for k in range(52) if k not in left]
    assert np.allclose(of_held_arm[:, still], flat[:, still])
    both = pats.from_points(pats.hold_arm(pats.hold_arm(values, "left", mean), "right", mean))
    assert sorted(np.flatnonzero(np.ptp(both[:, :52], 0) > 1e-9)) == [0, JOINTS.index("Nose")]
    with pytest.raises(InputError, match="'middle'"):
        pats.hold_arm(values, "middle", mean)


@pytest.mark.slow
def test_twins(small, tmp_path):
    pats.write([make_clip(0), make_clip(1, "noah")], tmp_path / "written", transforms=True)
    assert [clip.name for clip in pats.read(tmp_path / "written")] == ["1000", "1001"]
    clips = list(pats.read(tmp_path / "written", transforms=True))
    assert [(clip.name, clip.speaker) for clip in clips[2:]] == [
        ("1000|mirror", "oliver|mirror"),
        ("1001|mirror", "noah|mirror"),
    ]
    assert np.allclose(clips[2].points.values, pats.mirror(clips[0].points.values))
    root = copy(small, tmp_path / "raw")
    row = "dev,2.0,0:00:02.0,1000|{0},oliver|{0},0:00:00.0,,\n"
    (root / "cmu_intervals_df_transforms.csv").write_text(HEAD + row.format("mirror") + row.format("leftarm"))
    *_, twin, missing = pats.read(root, transforms=True)
    assert np.allclose(twin.points.values, pats.mirror(make_clip(0).points.values)), "made where it has no file"
    assert twin.split == "validation"
    assert "leftarm" in missing.reason


# Tables of pandas ------------------------------------------------------------------------------------------------------

PANDAS = """
import sys, warnings
warnings.simplefilter("ignore")
import pandas as pd
folder = sys.argv[1]
frame = pd.DataFrame({"Word": ["the", "naïve", "the"], "start_frame": [0, 3, 9], "end_frame": [2, 8, 14]}, index=[4, 5, 9])
for kind in ("fixed", "table"):
    frame.to_hdf(f"{folder}/{kind}.h5", key="text/meta", format=kind)
frame.astype(object).to_hdf(f"{folder}/objects.h5", key="text/meta")
ours = pd.read_hdf(f"{folder}/processed/oliver/1000.h5", key="text/meta")
print(ours.to_dict("list"))
"""


@pytest.mark.slow
def test_pandas_reads_our_tables_and_we_read_its(small, tmp_path):
    pytest.importorskip("pandas", reason="needs pandas and PyTables, to compare with")
    pytest.importorskip("tables", reason="needs pandas and PyTables, to compare with")
    shutil.copytree(small / "processed", tmp_path / "processed")
    process = subprocess.run([sys.executable, "-c", PANDAS, str(tmp_path)], capture_output=True, text=True, timeout=120)
    assert process.returncode == 0, process.stderr
    assert process.stdout.strip() == str({"Word": ["hello", "wörld"], "start_frame": [0, 6], "end_frame": [5, 11]})
    expected = {"Word": ["the", "naïve", "the"], "start_frame": [0, 3, 9], "end_frame": [2, 8, 14]}
    with Hdf5LmdbReader("hdf5") as reader:
        for kind in ("fixed", "table", "objects"):
            assert read_frame(*reader.hdf5(tmp_path / f"{kind}.h5"), "text/meta") == expected, kind


@pytest.mark.parametrize(
    "data",
    [
        b"cos\nsystem\n(S'echo'\ntR.",
        b"\x80\x04\x8c\x05posix\x8c\x06system\x93\x8c\x04echo\x85R.",
        b"\x80\x02c__builtin__\neval\nX\x01\x00\x00\x001\x85R.",
    ],
)
def test_pickles_are_taken_apart_not_run(data):
    value, state = unpack(data)
    assert type(value) is object, "what it would have called is unknown, and was not called"
    assert state is None


@pytest.mark.parametrize(
    "data", [b"", b".", b"\x80", b"]e.", b"(lp0\n", b"K\x01K\x02e.", b"h\x05.", b"}.", b"\x80\x04\x95\xff"]
)
def test_damaged_pickles(data):
    with pytest.raises(InputError):
        unpack(data)


# Statistics ------------------------------------------------------------------------------------------------------------

EIGHT = ("chemistry", "corden", "lec_cosmic", "maher", "noah", "oliver", "seth", "ytch_prof")


@pytest.mark.parametrize("speaker", EIGHT)
def test_published_statistics(shared_folder, speaker):
    folder = shared_folder / "data" / "pats_stats"
    centres = pats.load_statistics(folder / f"{speaker}.kmeans.h5")[pats.CENTRES]
    assert centres.shape == (8, 240)
    with h5py.File(folder / f"{speaker}.kmeans.h5") as file:
        assert np.array_equal(centres, file[pats.CENTRES][()])
    numbers = pats.load_statistics(folder / f"{speaker}.muvar.h5")
    assert numbers["pose/data/mean"].shape == numbers["pose/normalize/var"].shape == (104,)
    assert numbers["audio/log_mel_400/mean"].shape == (64,)
    mean = pats.to_points(numbers["pose/normalize/mean"][None])[0]
    around = mean - mean[0]
    assert around[JOINTS.index("LShoulder"), 0] > 100 > -100 > around[JOINTS.index("RShoulder"), 0], "left is at +x"
    assert around[JOINTS.index("Nose"), 1] > 50, "y is up"
    assert np.linalg.norm(around[JOINTS.index("RShoulder")]) == pytest.approx(167, abs=8)


@pytest.mark.slow
def test_what_is_no_statistics(small, tmp_path):
    with pytest.raises(InputError, match=r"1000\.h5.*means or centres"):
        pats.load_statistics(small / "processed" / "oliver" / "1000.h5")
    with h5py.File(tmp_path / "x.muvar.h5", "w") as file:
        file["pose/data/mean"] = np.full((1, 1, 104), np.nan)
    with pytest.raises(InputError, match=r"x\.muvar\.h5.*pose/data/mean"):
        pats.load_statistics(tmp_path / "x.muvar.h5")
    for data in (b"", b"hello", b"\x89HDF\r\n\x1a\n" + bytes(500)):
        (tmp_path / "y.h5").write_bytes(data)
        with pytest.raises(InputError, match=r"y\.h5"):
            pats.load_statistics(tmp_path / "y.h5")


# Damage ----------------------------------------------------------------------------------------------------------------


def sound(item: Clip | Dropped) -> None:
    """What a reader may yield: a whole clip, or a drop with a one-line reason."""
    if isinstance(item, Dropped):
        assert item.reason
        assert "\n" not in item.reason
        return
    assert item.points.values.shape == (len(item.points), 52, 2)
    assert np.isfinite(item.points.values).all()
    assert abs(item.points.duration - 2.0) <= 1
    for name, value in item.extra.items():
        if isinstance(value, np.ndarray):
            assert np.isfinite(value).all(), name
    assert all(0 <= w.start < w.end for w in item.extra.get("words", ()))


def many(small: Path, target: Path, count: int) -> list[Path]:
    """A corpus of ``count`` intervals that all are copies of one; their files."""
    folder = target / "processed" / "oliver"
    folder.mkdir(parents=True)
    files = [folder / f"{k}.h5" for k in range(count)]
    for file in files:
        shutil.copy(small / "processed" / "oliver" / "1000.h5", file)
    rows = [f"train,2.0,2.0,{k},oliver,0.0,,\n" for k in range(count)]
    (target / "cmu_intervals_df.csv").write_text(HEAD + "".join(rows))
    return files


@pytest.mark.slow
def test_damaged_files(small, tmp_path):
    """Truncated, with bits flipped, with pages lost; 200 files, and each is a sound clip or a drop that names it."""
    rng = random.Random(2)
    files = many(small, tmp_path / "raw", 200)
    whole = files[0].read_bytes()
    for k, file in enumerate(files):
        data = bytearray(whole)
        if k < 40:
            data = data[: rng.randrange(len(data))]
        elif k < 150:
            for _ in range(1 + k % 5):
                data[rng.randrange(len(data) if k % 4 == 0 else 4096)] ^= 1 << rng.randrange(8)
        elif k < 180:
            at = rng.randrange(len(data) - 64)
            data[at : at + 64] = rng.randbytes(64)
        else:
            at = rng.randrange(8) * 512
            data[at : at + 512] = bytes(512)
        file.write_bytes(data)
    items = list(pats.read(tmp_path / "raw"))
    assert [item.name for item in items] == [str(k) for k in range(200)]
    count = 0
    for item in items:
        sound(item)
        if isinstance(item, Dropped):
            count += 1
            assert f"{item.name}.h5" in item.reason or "pose" in item.reason or "text" in item.reason
            assert item.reason.startswith(f"oliver/{item.name}: ")
    assert count > 80
    assert all(isinstance(item, Dropped) for item in items[:40]), "what is cut short is never used"


def wrong_contents() -> list[tuple[str, object]]:
    """(key, what it is replaced with; None: removed)."""
    flat = np.zeros((30, 104)) + np.r_[640, np.linspace(-200, 200, 51), 300, np.linspace(-100, 300, 51)]
    changes: list[tuple[str, object]] = [("pose/data", None), ("pose", None)]
    for bad in (np.nan, np.inf, -np.inf, 1e9, -1e30):
        for k in (0, 1500, 3119):
            spoilt = flat.copy()
            spoilt.flat[k] = bad
            changes.append(("pose/data", spoilt))
    changes += [
        ("pose/data", array) for array in (flat[:0], flat[:3], flat[:, :103], flat.T, flat[None], flat[0], np.zeros((30, 104)))
    ]
    changes += [("pose/data", np.repeat(flat, n, 0)) for n in (2, 10)]
    changes += [("pose/data", value) for value in (flat.astype(complex), flat.astype("S8"), "text", 3.0, np.zeros((0, 0)))]
    columns = {
        "pose/normalize": 104,
        "pose/confidence": 104,
        "audio/log_mel_400": 64,
        "audio/log_mel_512": 128,
        "text/bert": 768,
    }
    for key, count in columns.items():
        rows = {"audio/log_mel_400": 200, "audio/log_mel_512": 178}.get(key, 30)
        fine = np.zeros((rows, count))
        spoilt = fine.copy()
        spoilt[rows // 2, 1] = np.nan
        news = [
            spoilt,
            fine - 1e6,
            fine[:, :-1],
            fine[: rows // 4],
            np.repeat(fine, 5, 0),
            fine[:0],
            fine[None],
            "x",
            fine.astype("S3"),
        ]
        changes += [(key, new) for new in news]
    changes += [("audio/silence", new) for new in (np.full(30, 7), np.full(30, np.nan), np.zeros(3), np.zeros((3, 3, 3)), "x")]
    changes += [("text/tokens", new) for new in (np.full(30, -1e9), np.zeros(3), np.full(30, np.inf))]
    return changes


@pytest.mark.slow
def test_wrong_contents_are_dropped_with_the_key(small, tmp_path):
    wrong = wrong_contents()
    files = many(small, tmp_path / "raw", len(wrong) + 1)
    for file, (key, value) in zip(files, wrong, strict=False):
        with h5py.File(file, "a") as hdf5:
            if key in hdf5:
                del hdf5[key]
            if value is not None:
                hdf5[key] = value
    *bad, good = pats.read(tmp_path / "raw")
    assert isinstance(good, Clip)
    assert len(bad) == len(wrong) > 75
    for item, (key, value) in zip(bad, wrong, strict=True):
        sound(item)
        assert isinstance(item, Dropped), (key, value)
        assert key in item.reason or "poses" in item.reason, item.reason


@pytest.mark.slow
def test_wrong_tables_of_words(small, tmp_path):
    def change(field, row, value):
        def apply(group):
            rows = group["table"][()]
            rows[field][row] = value
            group["table"][...] = rows

        return apply

    def attribute(name, value, table=False):
        return lambda group: (group["table"] if table else group).attrs.__setitem__(name, value)

    changes = [change("values_block_1", 0, value) for value in ((-1, 3), (5, 2), (0, 10**6), (10**15, 10**15))]
    changes += [attribute("pandas_type", kind) for kind in ("series", "frame", "", 3)]
    kind = "values_block_1_kind"
    changes += [
        attribute(kind, np.bytes_(data), True) for data in (b"(lp0\n.", b"(lp0\nVa\naVb\na.", b"cos\nsystem\n.", b"\xff", b"}.")
    ]
    changes += [lambda group: group.__delitem__("table")]
    files = many(small, tmp_path / "raw", len(changes))
    for file, apply in zip(files, changes, strict=True):
        with h5py.File(file, "a") as hdf5:
            apply(hdf5["text/meta"])
    for item in pats.read(tmp_path / "raw"):
        assert isinstance(item, Dropped)
        sound(item)
        assert "text/meta" in item.reason


def test_links_to_other_files_are_not_followed(small, tmp_path):
    files = many(small, tmp_path / "raw", 3)
    for file, link in zip(
        files, (h5py.ExternalLink(small / "processed/oliver/1001.h5", "/pose/data"), None, None), strict=True
    ):
        with h5py.File(file, "a") as hdf5:
            if link is not None or file is files[1]:
                del hdf5["pose/data"]
            if link is not None:
                hdf5["pose/data"] = link
            elif file is files[1]:
                space = hdf5.create_dataset("pose/data", (30, 104), "f8", external=[(tmp_path / "secret", 0, 30 * 104 * 8)])
                space[...] = 1.0
    first, second, third = pats.read(tmp_path / "raw")
    assert "no pose/data" in first.reason
    assert "another file" in second.reason
    assert isinstance(third, Clip)


ROWS = "train,2.0,2.0,1000,oliver,0.0,,\n"


@pytest.mark.slow
@pytest.mark.parametrize(
    "text",
    [
        b"", b"\n", b"a,b\n1,2\n", HEAD.encode()[:-30], HEAD.encode() + b"\xff\xfe,1\n", HEAD.encode() + b'train,"2.0\n',
        HEAD.encode() + b"x" * 200_000 + b",1\n", HEAD.replace(",", ";").encode(), b"\x89HDF\r\n", HEAD.encode("utf-16"),
    ],
)  # fmt: skip
def test_tables_that_cannot_be_read(small, tmp_path, text):
    root = copy(small, tmp_path / "raw")
    (root / "cmu_intervals_df.csv").write_bytes(text)
    with pytest.raises(InputError, match="cmu_intervals_df") as refusal:
        list(pats.read(root))
    assert "\n" not in str(refusal.value)


WRONG_CELLS = ("", "nan", "-1", "1e300", "x", "../../etc", "a\x00b", "0:0:0:0")


@pytest.mark.slow
@pytest.mark.parametrize("column", range(6))
def test_wrong_cells_are_dropped_with_their_line(small, tmp_path, column):
    many(small, tmp_path / "raw", len(WRONG_CELLS) + 1)
    lines = []
    for k, value in enumerate(WRONG_CELLS):
        cells = ROWS.replace("1000", str(k)).strip().split(",")
        cells[column] = value
        lines.append(",".join(cells) + "\n")
    good = ROWS.replace("1000", str(len(WRONG_CELLS)))
    (tmp_path / "raw" / "cmu_intervals_df.csv").write_text(HEAD + "".join(lines) + good)
    *bad, fine = pats.read(tmp_path / "raw")
    assert isinstance(fine, Clip)
    assert len(bad) == len(WRONG_CELLS)
    for line, item in enumerate(bad, 2):
        sound(item)
        assert isinstance(item, Dropped), "also an id or a speaker that has no file"
        assert f"line {line}" in item.reason or "No such file" in item.reason


@pytest.mark.slow
def test_rows_that_do_not_fit(small, tmp_path):
    root = copy(small, tmp_path / "raw")
    rows = [
        ROWS,
        ROWS,
        "train,2.0\n",
        ROWS.replace("2.0,2.0", "2.0,9.0"),
        ROWS.replace("1000", "1001").replace("2.0,2.0", "9.0,9.0"),
    ]
    (root / "cmu_intervals_df.csv").write_text(HEAD + "".join(rows))
    first, twice, short, times, length = pats.read(root)
    assert isinstance(first, Clip)
    assert "stands there twice" in twice.reason
    assert "2 cells of 8" in short.reason
    assert "2 s from 0 to 9 s" in times.reason
    assert "3.3 per second" in length.reason


@pytest.mark.slow
def test_damaged_lists_of_missing_intervals(small, tmp_path):
    root = copy(small, tmp_path / "raw")
    file, rng = root / "missing_intervals.h5", random.Random(3)
    whole = file.read_bytes()
    for k in range(12):
        data = bytearray(whole)
        if k % 2:
            data = data[: rng.randrange(len(data))]
        for _ in range(10):
            data[rng.randrange(min(600, len(data)))] ^= 1 << rng.randrange(8) if data else 0
        file.write_bytes(data)
        try:
            assert all(isinstance(item, Clip) for item in pats.read(root))
        except InputError as error:
            message = str(error)
        else:
            continue
        assert "missing_intervals.h5" in message
    with h5py.File(file, "w") as hdf5:
        hdf5["intervals"] = np.arange(3)
    with pytest.raises(InputError, match="intervals are int64"):
        list(pats.read(root))


def test_no_pats_at_all(tmp_path):
    with pytest.raises(InputError, match="no such folder"):
        list(pats.read(tmp_path / "nowhere"))
    (tmp_path / "data").mkdir()
    with pytest.raises(InputError, match="there is no PATS in"):
        list(pats.read(tmp_path))
