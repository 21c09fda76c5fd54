"""Evaluate: systems and control rows in one table, from folders, motions and clips, of rotations and of key points."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import soundfile
import typer
from typer.testing import CliRunner

from cospeech.audio.speech import Speech, example
from cospeech.cli.evaluate import register
from cospeech.corpora import Clip, Semantic
from cospeech.corpora.motion_files import load_motions
from cospeech.corpora.prepare import prepare
from cospeech.corpora.samples import POSE_STATISTICS, load_stored_clips, sample_of, track_of
from cospeech.corpora.ted import read as ted
from cospeech.errors import CospeechWarning, InputError
from cospeech.evaluation import LAYOUTS, evaluate_clips, evaluate_store
from cospeech.metrics import METRICS, Sample, Score, Tools, load_metric
from cospeech.metrics.controls import CONTROLS, UNSURE, WRONG, control_rows, faults_of_order
from cospeech.metrics.interval import mean_score
from cospeech.metrics.metric import About
from cospeech.metrics.table import COVERAGE, DEFAULT, Table
from cospeech.motion.motion import Motion
from cospeech.motion.points import Points
from cospeech.motion.rotations import quat_angle
from cospeech.rules import RuleBasedModel

FPS = 15.0


@cache
def clips() -> tuple[Clip, ...]:
    """Four stretches of the example speech with the rule-based gesturer's motion: synthetic."""
    whole = Speech.load(example()[0])
    examples = []
    for k, (start, end) in enumerate([(0, 9), (9, 18), (3, 12), (6, 15)]):
        speech = Speech(whole.samples[start * 16000 : end * 16000], 16000)
        style = ("calm", "lively")[k % 2]
        motion = RuleBasedModel().generate(speech, seed=k, fps=FPS, style=style, parts=("body", "hands"))
        examples.append(Clip(f"clip{k}", style, "synthetic", speech, motion, semantics=(Semantic(1.0, 3.0, 0.5),)))
    return tuple(examples)


@cache
def pats() -> tuple[Clip, ...]:
    rng = np.random.default_rng(0)
    results = []
    for clip in clips():
        walk = np.cumsum(rng.normal(size=(len(clip.motion), 52, 2)), 0) * 3 + rng.normal(size=(1, 52, 2)) * 5
        rest = np.random.default_rng(1).normal(size=(52, 2)) * 150
        results.append(replace(clip, motion=None, points=Points(FPS, walk + rest, "pats")))
    return tuple(results)


@cache
def table():
    again = [RuleBasedModel().generate(c.speech, seed=9, fps=FPS, parts=("body", "hands")) for c in clips()]
    return evaluate_clips({"again": again}, clips())


@pytest.mark.slow
def test_rows_are_systems_and_then_controls_and_columns_are_metrics():
    assert table().rows == ("again", *CONTROLS)
    assert table().columns == DEFAULT
    assert "4 clips" in table().about
    assert POSE_STATISTICS.name in table().about
    truth = table().cells["ground truth"]
    assert truth["pck"].value == truth["srgr"].value == 1
    assert truth["ape"].value == 0
    assert truth["fgd"].value < 1e-9
    low, high = table().cells["again"]["pck"].interval
    assert low < table().cells["again"]["pck"].value < high
    assert 0 < table().cells["again"]["pck"].value < 1


def test_where_there_are_no_data_the_cell_is_empty_and_says_why():
    assert table().cells["again"]["pck_2d"] is None
    assert "points" in table().why["again"]["pck_2d"]
    assert "two takes" in table().why["again"]["multimodality"]


@pytest.mark.slow
def test_metrics_that_reward_the_wrong_row_are_marked():
    result = evaluate_clips({}, clips(), metrics=("beat_align_ha2g", "l1_div_beat", "pck", "fgd", "w1_speed", "movement"))
    assert {"beat_align_ha2g", "pck"} <= set(result.faults)
    assert not {"fgd", "w1_speed", "movement"} & set(result.faults)
    text = result.to_text()
    assert "beat_align_ha2g ↑!" in text
    assert any(line.startswith("! beat_align_ha2g: white noise is not worse than ground truth") for line in text.splitlines())
    assert "fgd ↓ " in text


@pytest.mark.parametrize(
    ("value", "interval", "text"),
    [
        (16.1, (1.4, 46.4), "16.1 [1.4, 46.4]"),
        (16.0, (10.0, 24.0), "16 ± 7"),
        (0.0, (0.01, 0.03), "0 [0.01, 0.03]"),
        (1.0, (1.0, 1.0), "1 ± 0"),
        (1.0, (1.0, 1.0 + 1e-15), "1 ± 5.6e-16"),
        (2.0, None, "2"),
    ],
)
def test_an_interval_that_is_not_symmetric_is_shown_by_its_ends(value, interval, text):
    output = Table(("a",), ("pck",), {"a": {"pck": Score(value, interval)}}).to_text()
    assert output.splitlines()[2].split(maxsplit=1) == ["a", text]


def test_intervals_over_few_clips_are_said_to_be_too_narrow():
    assert "± is too narrow with so few clips: an interval over 4 clips holds the true value in some 80 of" in table().to_text()
    assert json.loads(table().to_json())["clips"] == 4
    for clips_scored in (0, 1, 10):
        assert "too narrow" not in replace(table(), clips=clips_scored).to_text()
    rng = np.random.default_rng(3)
    count = 0
    for seed, values in enumerate(rng.normal(size=(400, 4))):
        low, high = mean_score(values, seed=seed).interval
        count += low < 0 < high
    assert count / 4 == pytest.approx(COVERAGE[4], abs=5)


def test_a_score_is_shown_without_its_draws():
    score = Score(0.5, (0.25, 0.75), 4, draws=(0.125,) * 200)
    assert repr(score) == "Score(value=0.5, interval=(0.25, 0.75), count=4, note='')"
    assert "0.125" not in repr(Table(("a",), ("pck",), {"a": {"pck": score}}))
    assert score != replace(score, draws=())


def test_the_text_is_aligned_and_fits():
    lines = table().to_text(width=100).splitlines()
    for block in "\n".join(lines).split("\n\n")[1:-1]:
        rows = block.splitlines()
        assert len(rows) == 1 + len(table().rows)
        assert len({len(row) for row in rows}) == 1
        assert len(rows[0]) <= 100
    assert " ± " in table().to_text()


def test_the_json_is_all_of_it():
    data = json.loads(table().to_json())
    assert list(data["rows"]) == list(table().rows)
    cell = data["rows"]["again"]["pck"]
    assert cell["value"] == table().cells["again"]["pck"].value
    assert cell["interval"] == list(table().cells["again"]["pck"].interval)
    assert data["rows"]["again"]["pck_2d"] is None
    assert data["why"]["again"]["pck_2d"]
    assert data["metrics"]["fgd"]["better"] == "lower"
    json.loads(evaluate_clips({}, clips()[:1], metrics=("fgd_published", "pck")).to_json().replace("NaN", "boom"))


@pytest.mark.slow
def test_a_folder_of_files_gives_what_the_motions_give(tmp_path):
    for k, clip in enumerate(clips()):
        clip.motion.save(tmp_path / f"{clip.name}.npz")
        if k == 0:
            clip.motion.save(tmp_path / f"{clip.name}.2.bvh")
    motions = load_motions(tmp_path, [clip.name for clip in clips()])
    assert [len(takes) for takes in motions.values()] == [2, 1, 1, 1]
    scores = evaluate_clips({"files": tmp_path}, clips(), metrics=("pck", "srgr", "multimodality")).cells["files"]
    assert scores["pck"].value == pytest.approx(1)
    assert scores["srgr"].value == pytest.approx(1, abs=1e-3)  # through BVH's text
    assert scores["multimodality"].value < 0.5  # millimetres
    (tmp_path / "clip3.npz").unlink()
    with pytest.raises(InputError, match="clip3"):
        evaluate_clips({"files": tmp_path}, clips(), metrics=("pck",))
    with pytest.raises(InputError, match="folder"):
        load_motions(tmp_path / "nowhere", ["clip0"])


def save_motions(folder, *names):
    """A folder of motions; each has as many frames as its place in the list."""
    for k, name in enumerate(names, 1):
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        clips()[0].motion[:k].save(path)
    return folder


@pytest.mark.parametrize(
    ("files", "names", "frames"),
    [
        (["me/a.bvh", "you/a.bvh"], ["me/a", "you/a"], [[1], [2]]),  # as `cospeech generate FOLDER -o out/` writes them
        (["me/a.2.bvh", "me/a.bvh", "me/a.1.bvh"], ["me/a"], [[2, 3, 1]]),
        (["deep/er/me/a.npz", "deep/you/b.npz"], ["me/a", "you/b"], [[1], [2]]),
        (["a.bvh", "b.bvh"], ["me/a", "you/b"], [[1], [2]]),  # one name, one clip
        (["me/a.bvh", "me/b.bvh"], ["a", "b"], [[1], [2]]),
        (["a.npz", "a.bvh", "a.2.npz"], ["a"], [[2, 3]]),  # one take, twice
        (["x.2.bvh", "x.2.1.bvh", "x.3.bvh"], ["x.2", "x.3"], [[1, 2], [3]]),  # numbers that are names
        ([".hidden/me/a.bvh", "me/a.bvh"], ["me/a"], [[2]]),
    ],
)
def test_motions_of_speakers_folders_are_found(tmp_path, files, names, frames):
    motions = load_motions(save_motions(tmp_path, *files), names)
    assert [[len(motion) for motion in motions[name]] for name in names] == frames


@pytest.mark.parametrize(
    ("files", "names", "says"),
    [
        (["one/me/a.bvh", "two/me/a.bvh"], ["me/a"], r"several files in .* could be clip 'me/a': one/me/a.bvh, two/me/a.bvh"),
        (
            ["a.bvh"],
            ["me/a", "you/a"],
            r"no motion for 2 of 2 clips in .*: 'me/a', 'you/a' \(me/a.bvh or me/a.npz; there is a.bvh",
        ),
        (["other/a.bvh"], ["me/a"], r"no motion for 1 of 1 clips in .*: 'me/a' \(me/a.bvh or .*; there is other/a.bvh\)"),
        (["x.bvh", "b.bvh"], ["a", "b", "c", "d", "e"], r"no motion for 4 of 5 clips in .*: 'a', 'c', 'd' and 1 more"),
        ([], ["a"], r"no motion is in the folder"),
        (["a.glb"], ["a"], r"no motion is in the folder .* \(\.bvh or \.npz files, named as the clips\)"),
    ],
)
def test_what_is_not_found_is_named(tmp_path, files, names, says):
    with pytest.raises(InputError, match=says):
        load_motions(save_motions(tmp_path, *files), names)


@pytest.mark.slow
def test_motion_of_another_rate_and_skeleton_is_brought_to_the_recording():
    other = [clip.motion.resample(30.0).retarget("mixamo") for clip in clips()]
    assert evaluate_clips({"other": other}, clips(), metrics=("pck",)).cells["other"]["pck"].value > 0.99
    late = {clip.name: clip.motion[1:] for clip in clips()}
    assert evaluate_clips({"late": late}, clips(), metrics=("pck",)).cells["late"]["pck"].value > 0.8


@pytest.mark.parametrize(
    ("systems", "problem"),
    [
        (lambda: {"few": [clips()[0].motion]}, "1 motions for 4 clips"),
        (
            lambda: {"short": [clip.motion[:50] for clip in clips()]},
            r"'clip0' has 50 frames \(3\.33 s\), the recording 135 \(9\.00 s\) \(2 frames \(0\.13 s\) may be missing",
        ),
        (lambda: {"odd": {"nobody": clips()[0].motion}}, "do not match"),
        (lambda: {"ground truth": [clip.motion for clip in clips()]}, "called 'ground truth'"),
    ],
)
def test_what_does_not_fit_is_refused(systems, problem):
    with pytest.raises(InputError, match=problem):
        evaluate_clips(systems(), clips(), metrics=("pck",))


def test_unknown_metrics_and_empty_references_are_refused():
    with pytest.raises(InputError, match="no metric is called"):
        evaluate_clips({}, clips(), metrics=("pkc",))
    with pytest.raises(InputError):
        evaluate_clips({}, clips(), metrics=())
    with pytest.raises(InputError):
        evaluate_clips({}, [], metrics=("pck",))
    with pytest.raises(InputError, match="no motion"):
        evaluate_clips({}, [replace(clips()[0], motion=None)], metrics=("pck",))


@pytest.mark.parametrize("frames", [-1, 135, 5000])
def test_seed_frames_leave_something_to_judge(frames):
    systems = {"itself": [clip.motion for clip in clips()]}
    with pytest.raises(InputError, match=rf"{frames} seed frames \(0 … 134: the longest clip has 135 frames\)"):
        evaluate_clips(systems, clips(), metrics=("pck",), seed_frames=frames)
    assert evaluate_clips(systems, clips(), metrics=("pck",), seed_frames=134).cells["itself"]["pck"].value == 1
    with pytest.raises(InputError, match="-1 seed frames of 'a'"):
        Sample("a", FPS, seed_frames=-1)


@cache
def detect(layout):
    """The clips as recordings of key points."""
    return tuple(replace(clip, motion=None, points=LAYOUTS[layout](clip.motion)) for clip in clips())


@pytest.mark.parametrize(("layout", "metric"), [("ted", "pck"), ("pats", "pck_2d")])
def test_motions_are_converted_to_the_key_points_of_the_recordings(layout, metric, tmp_path):
    for clip in clips():
        clip.motion.retarget("mixamo").save(tmp_path / f"{clip.name}.bvh")
    points = [clip.points for clip in detect(layout)]
    late = [replace(p, values=np.concatenate([p.values[:1], p.values[:-2]])) for p in points]
    systems = {"files": tmp_path, "motions": [clip.motion for clip in clips()], "points": points, "late": late}
    result = evaluate_clips(systems, detect(layout), metrics=(metric, "ape", "jerk"))
    assert result.cells["points"][metric].value == result.cells["motions"][metric].value == 1
    assert result.cells["files"][metric].value > 0.99
    if layout == "ted":
        assert result.cells["files"]["ape"].value < result.cells["late"]["ape"].value


def test_key_points_at_another_rate_are_brought_to_the_recording():
    fast = [replace(clip.points, values=np.repeat(clip.points.values, 2, 0), fps=2 * FPS) for clip in detect("ted")]
    assert evaluate_clips({"fast": fast}, detect("ted"), metrics=("pck",)).cells["fast"]["pck"].value == 1


def test_a_folder_of_motions_is_evaluated_on_a_store_of_key_points(tmp_path):
    ted.write([replace(clip, split="test") for clip in clips()[:2]], tmp_path / "raw")
    prepare("ted", tmp_path / "raw", tmp_path / "store", filters=False)
    folder = tmp_path / "motions"
    folder.mkdir()
    for entry, clip in zip(load_stored_clips(tmp_path / "store"), clips(), strict=False):
        clip.motion.save(folder / f"{entry.name}.bvh")
    scores = evaluate_store({"mine": str(folder)}, tmp_path / "store", metrics=("pck", "jerk")).cells
    assert scores["mine"]["pck"].value > 0.99  # the recordings' own motion: bone lengths do not count
    assert scores["mine"]["jerk"].value == pytest.approx(scores["ground truth"]["jerk"].value, rel=0.2)


@pytest.mark.parametrize(
    ("system", "reference", "problem"),
    [
        (lambda: [clip.points for clip in detect("ted")], clips, "has joint rotations.*lift"),
        (lambda: [clip.points for clip in detect("ted")], lambda: detect("pats"), "of layout 'ted'.*has layout 'pats'"),
        (lambda: [replace(c.points, values=c.points.values[:50]) for c in detect("ted")], lambda: detect("ted"), "50 frames"),
        (lambda: [clip.motion[:50] for clip in clips()], lambda: detect("ted"), "50 frames"),
        (lambda: [c.motion for c in clips()], lambda: [replace(c, points=replace(c.points, layout="x")) for c in detect("ted")],
         "layout 'x'"),
    ],
)  # fmt: skip
def test_key_points_that_do_not_fit_are_refused(system, reference, problem):
    with pytest.raises(InputError, match=problem):
        evaluate_clips({"mine": system()}, reference(), metrics=("pck",))


@pytest.mark.slow
def test_key_points_are_evaluated_too():
    system = [replace(c, points=replace(c.points, values=c.points.values + 8.0 * (np.arange(52) > 0)[:, None])) for c in pats()]
    names = ("pck_2d", "pck_mix_stage", "pck_s2g", "mode_f1", "fid_poses", "diversity", "w1_speed", "beat_align", "pck")
    centres = np.random.default_rng(0).normal(size=(8, 240)) * 100
    result = evaluate_clips({"moved": system}, pats(), metrics=names, tools=Tools(centres=centres))
    truth = result.cells["ground truth"]
    assert truth["pck_2d"].value == truth["pck_mix_stage"].value == truth["pck_s2g"].value == truth["mode_f1"].value == 1
    assert result.cells["moved"]["pck_2d"].value <= 1
    assert result.cells["white noise"]["w1_speed"].value > truth["w1_speed"].value
    assert truth["pck"] is None
    assert truth["beat_align"] is not None


def test_key_points_of_pats_are_scaled_to_the_shoulder():
    values = pats()[0].points.values * 3 + 500
    values[5, 1] = values[5, 0]  # a failed detection
    sample = sample_of(replace(pats()[0], points=Points(FPS, values, "pats")))
    length = np.linalg.norm(sample.points[:, 1], axis=-1)
    np.testing.assert_allclose(np.delete(length, 5), 167)
    assert length[5] == 0
    assert not sample.points[:, 0].any()


def test_the_track_of_key_points_is_at_thirty_frames():
    values = np.random.default_rng(0).normal(size=(30, 10, 3))
    track = track_of(Points(15.0, values, "ted"))
    assert track.fps == 30
    assert len(track.hips) == 60
    np.testing.assert_allclose(track.wrists[0], values[0, [6, 9]])
    np.testing.assert_allclose(track.wrists[1], values[:2, [6, 9]].mean(0))
    assert track_of(Points(15.0, np.zeros((4, 52, 2)), "pats")).shoulders.shape == (8, 2, 3)
    with pytest.raises(InputError, match="layout"):
        track_of(Points(15.0, values, "tedd"))


def test_a_sample_has_what_the_clip_has():
    sample = sample_of(clips()[0], seed_frames=4)
    assert sample.positions.shape[1] == len(sample.names) == sample.rotations.shape[1]
    assert sample.names[0] == "hips"
    assert not any("Leg" in name or "Foot" in name for name in sample.names)
    assert sample.seed_frames == 4
    scores = sample.semantics
    assert (scores[15:45] == 0.5).all()
    assert scores.sum() == 15
    assert sample_of(replace(clips()[0], semantics=None)).semantics is None


def test_control_rows_are_what_they_say():
    rows = control_rows(clips())
    assert tuple(rows) == CONTROLS
    for k, clip in enumerate(clips()):
        for row in rows.values():
            assert len(row[k].motion) == len(clip.motion)
            assert row[k].name == clip.name
            assert abs(float(row[k].speech.duration) - float(clip.speech.duration)) < 0.01
        frozen = rows["frozen pose"][k].motion
        assert 0 < quat_angle(frozen.rotations[:-1], frozen.rotations[1:]).max() < 1e-4
        noise = rows["white noise"][k].motion
        moving = quat_angle(clip.motion.rotations[:-1], clip.motion.rotations[1:]).mean()
        assert quat_angle(noise.rotations[:-1], noise.rotations[1:]).mean() > 3 * moving
        other = clips()[(k + 1) % 4]
        np.testing.assert_array_equal(rows["another clip"][k].motion.rotations, other.motion.rotations)
        np.testing.assert_array_equal(rows["shuffled speech"][k].motion.rotations, clip.motion.rotations)
        np.testing.assert_array_equal(rows["shuffled speech"][k].speech.samples, other.speech.samples)
    again = control_rows(clips())
    np.testing.assert_array_equal(again["white noise"][0].motion.rotations, rows["white noise"][0].motion.rotations)


def test_control_rows_of_one_clip_and_of_unequal_ones():
    one = control_rows(clips()[:1])
    assert not np.array_equal(one["shuffled speech"][0].speech.samples, clips()[0].speech.samples)
    assert not np.array_equal(one["another clip"][0].motion.rotations, clips()[0].motion.rotations)
    short = replace(clips()[1], motion=clips()[1].motion[:40])
    motion = control_rows([clips()[0], short])["another clip"][0].motion
    assert len(motion) == len(clips()[0].motion)
    assert quat_angle(motion.rotations[:-1], motion.rotations[1:]).max() < 1.0  # to and fro: no jump
    rows = control_rows([clips()[0], pats()[1], clips()[2]])
    np.testing.assert_array_equal(rows["another clip"][0].motion.rotations, clips()[2].motion.rotations)
    with pytest.raises(InputError):
        control_rows([])


def test_the_judge_of_order_knows_what_to_ask():
    def scores(*values, width=0.0):
        return {n: Score(v, (v - width, v + width)) for n, v in zip(CONTROLS, values, strict=True)}

    beat = About(("speech",), "higher", hears=True)
    assert faults_of_order(beat, scores(0.5, 0.0, 0.0, 0.1, 0.1)) == []
    assert faults_of_order(beat, scores(0.5, 0.0, 0.9, 0.1, 0.1)) == [f"white noise is {WRONG} ground truth"]
    assert faults_of_order(beat, scores(0.5, 0.0, 0.0, 0.5, 0.1)) == [f"shuffled speech is {WRONG} ground truth"]
    assert faults_of_order(beat, scores(0.5, 0.0, 0.0, 0.3, 0.1, width=0.3)) == [f"shuffled speech is {UNSURE} ground truth"]
    distance = About(("features",), "lower")
    assert faults_of_order(distance, scores(0, 5, 9, 0, 0.1)) == []
    assert faults_of_order(distance, scores(0, 5, 0.05, 0, 0.1)) == [f"white noise is {WRONG} another clip"]
    extent = About(("positions",), "reference")
    assert faults_of_order(extent, scores(60, 0, 90, 60, 65)) == []
    assert faults_of_order(extent, scores(60, 0, 61, 60, 65)) == [f"white noise is {WRONG} another clip"]
    paired = About(("positions",), "higher", paired=True)
    assert faults_of_order(paired, scores(1, 0.3, 0.2, 1, 0.5)) == []
    assert len(faults_of_order(paired, scores(1, 0.3, 0.2, 1, 1))) == 1
    assert faults_of_order(paired, {"ground truth": None}) == []


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    """A minute of a synthetic corpus in the layout of BEAT, and its store."""
    pytest.importorskip("joblib", reason="prepare needs joblib: pip install 'cospeech[corpora]'")
    from cospeech.corpora.prepare import prepare
    from cospeech.corpora.synthetic import synthesise

    folder = tmp_path_factory.mktemp("corpus")
    samples, rate = soundfile.read(example()[0], dtype="float32")
    (folder / "speech").mkdir()
    for k in range(3):
        soundfile.write(folder / "speech" / f"{k}.wav", samples[6 * k * rate : 6 * (k + 1) * rate], rate)
    synthesise(folder / "raw", layout="beat", speech=folder / "speech", hours=0.007, speakers=2, tts=False)
    prepare("beat", folder / "raw", folder / "store")
    return folder


@pytest.mark.slow
def test_the_ground_truth_of_a_store_is_perfect_and_heard_where_the_sound_is(corpus):
    clips = load_stored_clips(corpus / "store", split=None, raw=corpus / "raw")
    assert len(clips) > 2
    for clip in clips:
        assert abs(float(clip.speech.duration) - clip.motion.duration) < 0.1
        assert clip.speaker
    result = evaluate_clips({"itself": [clip.motion for clip in clips]}, clips, metrics=("pck", "srgr", "fgd"))
    assert result.cells["itself"]["pck"].value == result.cells["itself"]["srgr"].value == 1
    assert result.cells["itself"]["fgd"].value < 1e-6
    assert result.cells["white noise"]["fgd"].value > 10
    assert load_metric("beat_align")([sample_of(clip) for clip in clips]).value > 0


@pytest.mark.slow
def test_files_of_the_corpus_are_perfect_on_its_store(corpus, tmp_path):
    """The store leaves out hips and legs: what moves there counts for no row."""
    for number, path in enumerate(sorted((corpus / "raw").rglob("*.bvh"))):
        shutil.copy(path, tmp_path / path.name)
        hips = Motion.load(path).rotations[:, 0]
        assert number > 1 or quat_angle(hips, hips[:1]).max() > 0.02
    clips = load_stored_clips(corpus / "store", split=None)
    result = evaluate_clips({"files": str(tmp_path)}, clips, metrics=("pck", "mae", "l1_div"))
    assert result.cells["files"]["pck"].value == 1
    assert result.cells["files"]["mae"].value < 1e-5
    assert result.cells["files"]["l1_div"].value == pytest.approx(result.cells["ground truth"]["l1_div"].value, rel=1e-4)


def test_motion_that_goes_on_after_the_recording_is_told(tmp_path):
    clip = clips()[0]
    slow = replace(clip.motion, fps=FPS / 4)
    with pytest.warns(CospeechWarning, match=r"1 of 1 clip.*'clip0': 36.0 s, recorded 9.0 s.*Are frame rate and take right"):
        evaluate_clips({"slow": [slow]}, [clip], metrics=("pck",))


def test_a_part_of_a_recording_is_cut_from_the_motion_of_the_whole(tmp_path, monkeypatch):
    whole = clips()[0].motion
    whole.save(tmp_path / "take.1.npz")  # as a name, not as the first take
    parts = [
        replace(clips()[0], name=f"take.1@{first}", motion=whole[first : first + 30], start=first / FPS, pose="rot6d-humanoid")
        for first in (0, 40, 80)
    ]
    loads, load = [], Motion.load
    monkeypatch.setattr("cospeech.corpora.motion_files.Motion.load", lambda path: loads.append(path) or load(path))
    result = evaluate_clips({"files": str(tmp_path)}, parts, metrics=("mae",))
    assert result.cells["files"]["mae"].value < 0.05  # the representation of the store has no hips, and moves nothing else
    assert len(loads) == 1, "a recording is read once, however many parts it has"
    other = replace(parts[1], start=10.0)  # a name with an @, which a reader gave
    with pytest.raises(InputError, match="no motion for 1 of 1 clips"):
        evaluate_clips({"files": str(tmp_path)}, [other], metrics=("mae",))
    late = replace(parts[1], name="take.1@500", start=500 / FPS)
    with pytest.raises(InputError, match="has 0 frames"):
        evaluate_clips({"files": str(tmp_path)}, [late], metrics=("mae",))
    near = result.cells["files"]["mae"].value
    whole[20:50].save(tmp_path / "take.1@40.npz")
    assert evaluate_clips({"files": str(tmp_path)}, parts[1:2], metrics=("mae",)).cells["files"]["mae"].value > 2 * near


@pytest.mark.slow
def test_a_store_without_its_corpus_is_mute(corpus):
    clips = load_stored_clips(corpus / "store", split=None)
    assert all(clip.speech is None for clip in clips)
    result = evaluate_clips({}, clips, metrics=("beat_align", "pck"))
    assert result.cells["ground truth"]["beat_align"] is None
    assert "speech" in result.why["ground truth"]["beat_align"]
    assert {c.name for c in load_stored_clips(corpus / "store", split="test")} < {c.name for c in clips}
    assert [c.name for c in load_stored_clips(corpus / "store", split="all")] == [c.name for c in clips]
    with pytest.raises(InputError, match=r"did you mean 'test'\? known: train, validation, test, all"):
        load_stored_clips(corpus / "store", split="tets")
    with pytest.raises(InputError):
        load_stored_clips(corpus / "speech")


@pytest.mark.slow
def test_a_store_of_a_corpus_that_is_not_known_says_whose_module_to_import(corpus, tmp_path):
    shutil.copytree(corpus / "store", tmp_path / "store")
    index = tmp_path / "store" / "index.json"
    index.write_text(json.dumps(json.loads(index.read_text("utf-8")) | {"corpus": "tapes"}), "utf-8")
    assert load_stored_clips(tmp_path / "store", split=None)  # without its sound it needs no reader
    with pytest.raises(InputError, match=r"of corpus 'tapes', which is not known here \(import the module of its reader"):
        load_stored_clips(tmp_path / "store", split=None, raw=corpus / "raw")


@pytest.mark.slow
def test_the_wrong_corpus_is_told_and_so_is_a_recording_without_sound(corpus, tmp_path):
    """Both once gave the hint to pass --raw, although it was passed."""
    first = load_stored_clips(corpus / "store", split=None)[0].name
    for folder in ("other", "partly"):
        shutil.copytree(corpus / "raw", tmp_path / folder)
    for path in (tmp_path / "other").glob("*/*"):
        path.rename(path.with_name(path.name.replace("_0_", "_1_")))
    with pytest.raises(InputError, match=rf"other' has none of the recordings of the store .*{first}.*name the beat corpus"):
        load_stored_clips(corpus / "store", split=None, raw=tmp_path / "other")
    for path in (tmp_path / "partly").glob(f"*/{first}.*"):
        path.unlink()
    with pytest.raises(InputError, match=rf"'{first}' has no speech to play \(its sound is not in the folder of --raw"):
        evaluate_store({"rules": "rules"}, corpus / "store", split="all", raw=tmp_path / "partly", metrics=("w1_speed",))


@pytest.mark.slow
def test_the_command_judges_a_folder_against_a_store(corpus, tmp_path):
    app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
    register(app)
    generated = tmp_path / "generated"
    generated.mkdir()
    for clip in load_stored_clips(corpus / "store", split="test"):
        clip.motion.save(generated / f"{clip.name}.npz")
    head = [f"mine={generated}", "--corpus", str(corpus / "store")]
    line = [*head, "--metrics", "pck,w1_speed", "-o", str(tmp_path / "table.json")]
    result = CliRunner().invoke(app, line, catch_exceptions=False)
    assert result.exit_code == 0
    assert "pck ↑" in result.output
    content = json.loads((tmp_path / "table.json").read_text("utf-8"))
    assert content["rows"]["mine"]["pck"]["value"] == pytest.approx(1)
    assert list(content["rows"]) == ["mine", *CONTROLS]
    result = CliRunner().invoke(app, [*head, "--metrics", "ape", "--json"], catch_exceptions=False)
    assert json.loads(result.output)["rows"]["mine"]["ape"]["value"] < 1e-4
    with pytest.raises(InputError, match="5000 seed frames"):
        CliRunner().invoke(app, [*head, "--metrics", "pck", "--seed-frames", "5000"], catch_exceptions=False)
    for wrong in (["=x"], [f"mine={generated}", f"mine={generated}"], [str(tmp_path / "nowhere")]):
        with pytest.raises(InputError):
            CliRunner().invoke(app, [*wrong, *head[1:], "--metrics", "pck"], catch_exceptions=False)


@pytest.mark.slow
def test_every_metric_can_be_asked_for():
    result = evaluate_clips({}, clips()[:2], metrics=tuple(METRICS))
    assert sum(score is not None for score in result.cells["ground truth"].values()) > 25
    assert all(isinstance(load_metric(name).about.unit, str) for name in result.columns)
    assert isinstance(clips()[0].motion, Motion)


@pytest.mark.slow
def test_a_model_plays_the_recordings_of_a_store(corpus):
    """From the name of a model to its row of the table, with the sound of the corpus."""

    table = evaluate_store({"rules": "rules"}, corpus / "store", raw=corpus / "raw", metrics=("w1_speed", "pck"), takes=2)
    assert table.rows == ("rules", *CONTROLS)
    assert table.cells["rules"]["w1_speed"].value < table.cells["white noise"]["w1_speed"].value
    with pytest.raises(InputError, match="models: rules"):
        evaluate_store({"x": "rulez"}, corpus / "store")
    with pytest.raises(InputError, match="--raw"):
        evaluate_store({"rules": "rules"}, corpus / "store", metrics=("pck",))
    with pytest.raises(InputError, match=r"beat_align: the sound of the corpus is needed \(name its folder: --raw RAW\)"):
        evaluate_store({}, corpus / "store", metrics=("pck", "beat_align"))


@pytest.mark.parametrize("other", ["empty", "nope.cospeech"])
def test_folders_and_later_models_are_read_before_the_first_model_plays(tmp_path, monkeypatch, other):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    monkeypatch.setattr("cospeech.evaluation.load_stored_clips", lambda *_, **__: clips())
    monkeypatch.setattr("cospeech.evaluation.play", lambda *_, **__: pytest.fail("a model has played"))
    with pytest.raises(InputError):
        evaluate_store({"rules": "rules", "mine": other}, "store", metrics=("w1_speed",))


@pytest.mark.slow
def test_the_public_call_takes_a_model_and_a_store(corpus):
    """As README and interface have it: a model, a corpus, metrics."""
    import cospeech

    by_object = cospeech.evaluate(cospeech.load("rules"), corpus / "store", metrics=["w1_speed"], raw=corpus / "raw")
    by_name = cospeech.evaluate("rules", corpus / "store", metrics=["w1_speed"], raw=corpus / "raw")
    alone = cospeech.evaluate(None, load_stored_clips(corpus / "store"), metrics=["w1_speed"])
    assert by_object.rows[0] == "RuleBasedModel"
    assert by_name.cells["rules"]["w1_speed"].value == by_object.cells["RuleBasedModel"]["w1_speed"].value
    assert alone.rows == tuple(CONTROLS)


def test_a_table_says_why_a_metric_is_empty():
    why = {"a": {"ape": "ape needs another shape", "pck": "pck needs another shape"}}
    table = Table(("a",), ("ape", "pck"), {"a": {"ape": None, "pck": None}}, why)
    assert table.to_text().endswith("– ape, pck: needs another shape")
