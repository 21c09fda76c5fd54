"""Tables of Mix-StAGE: published figures, casts, windows, what is kept and moved, scores by other means; a store of seconds."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from cospeech.corpora.store import Entry, Store
from cospeech.corpora.store_writer import Piece, write_store
from cospeech.errors import InputError
from cospeech.experiments.tables import TABLES, Runs, draw_table, make_table, to_text
from cospeech.experiments.tables import making as making
from cospeech.experiments.tables import mix as paper_table
from cospeech.experiments.tables.controls import order_apart
from cospeech.experiments.tables.making import part_of
from cospeech.experiments.tables.mix import F1, IS, MIX, OURS, PCK, THEIRS, Attribute, SpeakerSet
from cospeech.experiments.tables.mix_bench import Measured, StylePreservation, StyleTransfer
from cospeech.experiments.tables.mix_scores import mean_cells, score_cells, score_target_style
from cospeech.experiments.tables.mix_windows import FRAMES, MixWindows
from cospeech.experiments.tables.report import to_markdown
from cospeech.experiments.tables.runs import CLASSIFIER, PlayableRun, of_speakers, small_scale
from cospeech.metrics.controls import CONTROLS
from cospeech.motion.points import Points
from cospeech.motion.poses.keypoints2d import KEYPOINTS2D
from cospeech.motion.skeletons.pats import JOINTS
from cospeech.training.checkpoint import network
from cospeech.training.recipe import SHIPPED, build, load_recipe
from tests.support.tiny_recipes import cut_off, write_tiny_recipes

torch = pytest.importorskip("torch")

ROOT = Path(__file__).resolve().parents[2]
FPS = 15.0
NAMES = ("ann", "bob", "cleo|twin")
TABLE_NAMES = [*MIX]
CAST = SpeakerSet(
    NAMES,
    tuple(Attribute(name, ("this", "that"), pair) for name, pair in (
        ("sitting", NAMES[:2]), ("frequency", NAMES[1:]), ("orientation", NAMES[:2]), ("arm", NAMES[1:])
    )),
    NAMES[:1],
    own=False,
)  # fmt: skip
RECIPES = sorted({row.recipe for table in MIX.values() for part in table.parts for row in part.rows})


def poses(frames: int, seed: int) -> np.ndarray:
    """(T, 96) arms that swing about, each speaker elsewhere."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(len(JOINTS), 2)) * 100 + 30 * np.sin(
        np.arange(frames)[:, None, None] / 6 + rng.normal(size=(52, 2))
    )
    points[:, 0], points[:, 1] = 0, (-160 - 4 * rng.random(), 5)
    return KEYPOINTS2D.encode(Points(FPS, points, "pats"))


def piece(name: str, speaker: str, split: str, frames: int, seed: int) -> Piece:
    audio = np.random.default_rng(seed + 99).normal(size=(frames, 64)).astype(np.float32)
    values = {"pose": poses(frames, seed).astype(np.float32), "audio": audio}
    return Piece(Entry(name, speaker, split, 0, frames, 0.0, tuple(values)), (), lambda: dict(values))


def make(folder: Path, speakers: tuple[str, ...]) -> Path:
    pieces = [
        piece(f"{k}-{split}-{part}", name, split, frames, 5 * k)
        for k, name in enumerate(speakers)
        for split in ("train", "test")
        for part, frames in enumerate((150, 70))
    ]
    names = {"pose": KEYPOINTS2D.names, "audio": tuple(f"log_mel_400.{k}" for k in range(64))}
    write_store(folder, pieces, corpus="pats", pose="keypoints2d", fps=FPS, names=names)
    return folder


@pytest.fixture(scope="session")
def store(tmp_path_factory) -> Path:
    return make(tmp_path_factory.mktemp("mix") / "pats", NAMES)


def build_config(name: str):
    recipe = load_recipe(SHIPPED / f"{name}.toml")
    return build(network(recipe.model).Config, recipe.config, "model")


def tiny_sizes(model: str) -> dict[str, int]:
    fields = network(model).Config.__dataclass_fields__
    tiny = {"channels": 8, "patch_channels": 4, "discriminator_channels": 4, "mlp": 8, "blocks": 1, "depth": 3, "decoder": 1}
    return {key: value for key, value in tiny.items() if key in fields}


@pytest.fixture(scope="session")
def recipes(tmp_path_factory) -> Path:
    """The repository's recipes, made tiny."""
    return write_tiny_recipes(tmp_path_factory.mktemp("recipes"), (*RECIPES, f"{CLASSIFIER}_pats"), tiny_sizes)


@pytest.fixture(scope="session")
def table_runs(store, recipes, tmp_path_factory) -> Runs:
    return Runs(store, tmp_path_factory.mktemp("runs"), recipes, threads=1, about="made up")


@pytest.fixture(autouse=True)
def small_cast(monkeypatch):
    """The tables on three speakers, behind the paper's and ours."""
    makers = (
        paper_table._make_table_1,
        paper_table._make_table_2,
        paper_table._make_table_3,
        paper_table._make_table_4,
        paper_table._make_table_5,
        paper_table._make_table_6,
    )
    more = {n: replace(MIX[n], parts=(*MIX[n].parts, make(CAST))) for n, make in zip(TABLE_NAMES, makers, strict=True)}
    monkeypatch.setattr(making, "TABLES", TABLES | more)


# what the paper says ------------------------------------------------------------------------------------------------------


def test_published_figures_are_the_papers(shared_folder):
    paper = (shared_folder / "papers" / "mix-stage_ahuja-2020.txt").read_text("utf-8")
    paper_figures = {f"{float(word):g}" for word in paper.split() if word.replace(".", "", 1).isdigit()}
    figures = [value for table in MIX.values() for part in table.parts for row in part.rows for value in row.published.values()]
    assert len(figures) > 300
    assert all(f"{value:g}" in paper_figures or f"{value * 100:g}" in paper_figures for value in figures)


def test_rows_bear_the_figures_of_their_own_line(shared_folder):
    """Lines of the supplement's table 5, read from the paper: speaker, then PCK and F1 of the five systems."""
    paper = (shared_folder / "papers" / "mix-stage_ahuja-2020.txt").read_text("utf-8")
    lines = paper[paper.index("Table 4: Objective metrics for attribute-level") : paper.index("Table 5: Objective metrics")]
    paper_rows = [
        line.rsplit(None, 10) for line in lines.splitlines() if len(line.split()) >= 11 and line.split()[-1][0] == "0"
    ]
    rows = {row.name: row.published for row in MIX["mix-5"].parts[0].rows}
    names = {"Corden": "corden", "lec cosmic": "lec_cosmic", "ytch prof": "ytch_prof", "Oliver": "oliver", "Ellen": "ellen"}
    sizes, count = iter((2, 4, 8)), 0
    for name, *figures in paper_rows:
        if name == "Mean":
            size = next(sizes)
        elif name in names:
            for k, system in enumerate(("S2G", "CMix-GAN", "MUNIT", "StAGE", "Mix-StAGE")):
                assert rows[f"{system}, {size} speakers: {names[name]}"] == {
                    PCK: float(figures[2 * k]), F1: float(figures[2 * k + 1])
                }  # fmt: skip
                count += 1
    assert count == 5 * (2 + 4 + 5)


@pytest.mark.parametrize("name", [*RECIPES, f"{CLASSIFIER}_pats"])
def test_every_row_has_a_recipe_and_a_small_form_of_it(name):
    recipe = load_recipe(SHIPPED / f"{name}.toml")
    small = small_scale(recipe.model)
    assert build_config(name).frames == FRAMES
    assert small["model"]["channels"] < build_config(name).channels
    assert small["train"]["steps"] < recipe.train.steps


def test_systems_are_compared_at_the_same_steps_batch_and_rate():
    models = {load_recipe(SHIPPED / f"{name}.toml").model for name in RECIPES}
    assert len(models) == 5
    assert len({json.dumps(dict(small_scale(model)["train"])) for model in models}) == 1


def test_runs_are_shared_between_tables():
    """Of our speakers, with one seed: 11 of S2G and of CMix-GAN, 12 of other M, 7 each of three systems, and the authors'."""
    rows = [row for table in MIX.values() for row in table.parts[1].rows]
    runs = {(row.recipe, row.overrides, run) for row in rows for run in row.runs}
    assert len(runs) == 11 + 11 + 12 + 3 * 7 + 1


# casts --------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("speaker_set", "first"), [(THEIRS, 0), (OURS, 1)])
@pytest.mark.parametrize("name", MIX)
def test_the_speakers_of_a_store_choose_the_table(name, speaker_set, first):
    data = SimpleNamespace(corpus="pats", speakers=("someone", *speaker_set.everybody))
    assert part_of(name, data)[1] is MIX[name].parts[first]


def test_a_store_of_other_speakers_is_told_who_is_missing():
    data = SimpleNamespace(corpus="pats", speakers=tuple(name for name in OURS.everybody if name != "hugo"))
    with pytest.raises(InputError, match="hugo"):
        part_of("mix-1", data)
    with pytest.raises(InputError, match="'ted'"):
        part_of("mix-1", SimpleNamespace(corpus="ted", speakers=()))


def test_smaller_sets_are_within_larger_ones():
    for speaker_set in (THEIRS, OURS):
        assert len(speaker_set.eight) == len(set(speaker_set.eight)) == 8
        assert {*speaker_set.ablation} <= {*speaker_set.eight}
    rows = {row.name: row for row in MIX["mix-1"].parts[1].rows}
    assert rows["Mix-StAGE, 2 speakers"].runs == (("ada", "dan"),)
    assert rows["S2G, 2 speakers"].runs == (("ada",), ("dan",))


# windows ------------------------------------------------------------------------------------------------------------------


def test_windows_lie_one_after_another_in_test_clips(store):
    data = MixWindows(store)
    assert len(data) == 3 * (2 + 1)
    for k in range(len(data)):
        entry = data.store.clips[data.clips[k]]
        assert entry.split == "test"
        assert (data.starts[k] - entry.offset) % FRAMES == 0
        assert entry.offset <= data.starts[k] <= entry.offset + entry.frames - FRAMES
    assert [data.speaker(k) for k in data.of(["bob"])] == ["bob"] * 3
    with pytest.raises(InputError, match="zed"):
        data.of(["bob", "zed"])


def test_samples_are_in_the_pixels_of_the_centres(store):
    data = MixWindows(store)
    which = data.of(["ann"])
    for sample, vectors in zip(data.samples(data.rows("pose", which), which), data.rows("pose", which), strict=True):
        assert sample.points.shape == (FRAMES, 52, 2)
        np.testing.assert_allclose(np.linalg.norm(sample.points[:, 1], axis=1), 167, atol=1e-3)
        np.testing.assert_allclose(KEYPOINTS2D.encode(Points(FPS, sample.points, "pats")), vectors, atol=1e-3)


def test_centres_are_of_speakers_and_not_of_their_twins(store, tmp_path):
    theirs = MixWindows(make(tmp_path / "two", NAMES[:2])).centres()
    np.testing.assert_array_equal(MixWindows(store).centres(), theirs)
    assert theirs.shape == (8, 240)


@pytest.mark.parametrize("count", [1, 2, 3, 10, 25])
def test_an_order_in_which_neighbours_are_far_apart(count):
    order = order_apart(count)
    assert sorted(order) == list(range(count))
    if count > 3:
        assert np.abs(np.diff(order)).min() >= count // 4


def test_other_poses_have_no_such_tables(store, tmp_path):
    values = {"pose": np.zeros((90, 27), np.float32), "audio": np.zeros((90, 4), np.float32)}
    one = Piece(Entry("a", "ann", "test", 0, 90, 0.0, tuple(values)), (), lambda: dict(values))
    names = {"pose": tuple(map(str, range(27))), "audio": tuple("abcd")}
    write_store(tmp_path / "x", [one], corpus="pats", pose="direction-vectors", fps=FPS, names=names)
    with pytest.raises(InputError, match="direction-vectors"):
        MixWindows(tmp_path / "x")


# scores -------------------------------------------------------------------------------------------------------------------


def test_inception_score_and_its_own_of_a_set():
    rng = np.random.default_rng(0)
    classes = rng.dirichlet(np.ones(5), 200)
    own = classes[:, 1:4] / classes[:, 1:4].sum(1, keepdims=True)
    clips = [str(k // 10) for k in range(200)]
    cells = score_cells(classes, own, "x", clips)
    for p, name in ((classes, IS), (own, "score_of_set")):
        divergence = (p * np.log(p / p.mean(0))).sum(1).mean()
        assert cells[name]["value"] == pytest.approx(np.exp(divergence), abs=1e-3)
        assert len(cells[name]["draws"]) == 200
    sure = np.eye(4)[np.arange(80) % 4]
    assert score_cells(sure, sure, "x", clips[:80])[IS]["value"] == pytest.approx(4, abs=1e-3)
    assert score_cells(sure[:, :1] + 0 * sure, sure, "x", clips[:80])[IS].get("why") is not None  # no distribution


def test_clips_are_named_by_the_mean_of_their_windows():
    own = np.array([[0.9, 0.1], [0.4, 0.6], [0.4, 0.6], [0.2, 0.8], [0.7, 0.3]])
    target = np.array([0, 0, 0, 1, 1])
    cells = score_target_style(own, target, [("a", "ann"), ("a", "ann"), ("b", "ann"), ("a", "bob"), ("a", "bob")])
    assert cells["named_windows"]["value"] == pytest.approx(2 / 5)
    assert cells["named"]["value"] == pytest.approx(2 / 3)  # a by ann: .65; b: .4; a by bob: .55
    assert len({*cells["named"]["draws"]}) <= 3  # of two clips: both, or one of them twice


def test_means_over_speakers_are_plain():
    parts = [{"m": {"value": v, "interval": (0, 1), "note": "x"}} for v in (1.0, 2.0, 6.0)]
    assert mean_cells(parts)["m"]["value"] == 3
    assert mean_cells(parts[:1]) == parts[0]
    assert mean_cells([*parts, {"m": {"why": "none"}}]) == {"m": {"why": "none"}}


def test_draws_of_means_over_speakers_are_means_of_draws():
    parts = [{"m": {"value": v, "interval": (0, 1), "note": "x", "draws": [v, v + 1, v + 2]}} for v in (1.0, 3.0)]
    assert mean_cells(parts)["m"]["draws"] == [2, 3, 4]
    assert "draws" not in mean_cells([parts[0], {"m": {"value": 1.0, "interval": None, "note": ""}}])["m"]


# playing ------------------------------------------------------------------------------------------------------------------


class Echo(torch.nn.Module):
    """Makes the style it is given, in every frame."""

    def __new__(cls, styles: int = 3):
        from cospeech.models.nn.windowed import Windowed

        class Net(Windowed):
            pose, audio, multiple, shortest, modes = 96, 64, 4, 4, 0

            def __init__(self):
                super().__init__()
                self.styles, self.one = styles, torch.nn.Parameter(torch.ones(1))

            def make(self, audio, style, mode_noise):
                frames = audio.new_zeros(*audio.shape[:2], 96)
                frames[..., : self.styles] = style
                frames[..., 10] = audio[..., 0]
                return frames

            def speaker_styles(self, stretches):
                return torch.eye(len(stretches))

        return Net()


def test_play_does_not_depend_on_the_batch(monkeypatch):
    from cospeech.experiments import playing

    audio = np.random.default_rng(0).normal(size=(7, 9, 64))
    whole = playing.play(Echo(), audio, np.array([0.0, 1.0, 0.0]))
    assert whole.shape == (7, 9, 96)
    assert (whole[..., 1] == 1).all()
    each = np.eye(3)[np.arange(7) % 3]
    np.testing.assert_array_equal(playing.play(Echo(), audio, each)[:, 4, :3], each)
    monkeypatch.setattr(playing, "BATCH", 3)
    np.testing.assert_array_equal(playing.play(Echo(), audio, np.array([0.0, 1.0, 0.0])), whole)
    with pytest.raises(InputError, match="Linear"):
        playing.play(torch.nn.Linear(1, 1), audio, each)
    with pytest.raises(InputError, match="finite"):
        playing.play(Echo(), audio * np.nan, each)


def echo(store: Path) -> PlayableRun:
    facts = {"store": {"speakers": [*NAMES]}, "recipe": {"data": {}, "train": {}}, "config": {}}
    still = {"pose_mean": np.zeros(96), "pose_std": np.ones(96), "audio_mean": np.zeros(64), "audio_std": np.ones(64)}
    return PlayableRun(Echo(), facts, still, "echo", np.zeros((3, 2, 128, 96), np.float32))


def test_styles_are_moved_to_the_speech_of_all_others(store, table_runs):
    table, part = part_of("mix-2", Store(store))
    bench = StyleTransfer(table, part, table_runs, None)
    transfer = bench.transfer(echo(store), NAMES)
    data = bench.data
    pairs = {(data.speaker(k), style) for k, style in zip(transfer.which, transfer.styles, strict=True)}
    assert pairs == {(a, b) for a in NAMES for b in NAMES if a != b}
    assert len(transfer.which) == len(data) * 2
    np.testing.assert_array_equal(transfer.poses[:, 0, :3], [np.eye(3)[NAMES.index(style)] for style in transfer.styles])
    np.testing.assert_allclose(transfer.poses[..., 10], data.rows("audio", transfer.which)[..., 0], rtol=1e-6)


def test_a_system_that_plays_the_recording_is_perfect_and_others_are_not(store, table_runs):
    table, part = part_of("mix-1", Store(store))
    bench = StylePreservation(table, part, table_runs, None)
    controls = bench.controls()
    assert [*controls] == [*CONTROLS]
    for metric in (PCK, "pck_2d", F1, "mode_f1"):
        assert controls[CONTROLS[0]][metric]["value"] == pytest.approx(1)
        assert controls["frozen pose"][metric]["value"] < 1
        assert controls["white noise"][metric]["value"] < 1


# the way as a whole -------------------------------------------------------------------------------------------------------


def test_a_table_from_nothing_and_again_from_what_is_kept(table_runs, tmp_path):
    messages: list[str] = []
    again = replace(table_runs, tell=messages.append)
    table = make_table("mix-1", again, seeds=(0, 1), tell=messages.append)
    assert len(table["rows"]) == 16
    assert any("step 2 of 2" in text for text in messages)
    for row in table["rows"].values():
        for metric in (PCK, F1, "pck_2d", "mode_f1"):
            assert len(row["cells"][metric]["values"]) == 2
            assert 0 <= row["cells"][metric]["mean"] <= 1
    assert "3 networks" in table["rows"]["S2G, 8 speakers"]["facts"]
    assert "64 frames" in table["head"]
    assert len(table["verdicts"]) == 5
    del messages[:]
    assert make_table("mix-1", again, seeds=(0, 1), tell=messages.append) == json.loads(json.dumps(table))
    by_speaker = make_table("mix-5", again, seeds=(0, 1), tell=messages.append)
    assert not any("step" in text for text in messages)  # the same runs
    own = [by_speaker["rows"][f"MUNIT, 8 speakers: {name}"]["cells"][F1]["mean"] for name in NAMES]
    assert np.mean(own) == pytest.approx(table["rows"]["MUNIT, 8 speakers"]["cells"][F1]["mean"])
    assert "(0.33)" in to_text(table)
    draw_table(table, table_runs, tmp_path / "a.png")
    with Image.open(tmp_path / "a.png") as picture:
        assert len(picture.getcolors(picture.width * picture.height)) > 50


def test_transfer_is_scored_by_one_classifier(table_runs):
    table = make_table("mix-2", table_runs, seeds=(0,), tell=lambda text: None)
    for row in [row["cells"] for row in table["rows"].values()] + [*table["controls"].values()]:
        assert 1 <= row[IS]["mean"] <= 3
        assert 0 <= row["named"]["mean"] <= 1
        assert "--raw" in row["beat_align"]["why"]
    assert "speaker-classifier" in table["head"]
    sets = {row.name: row.runs[0] for row in part_of("mix-2", table_runs.store)[1].rows}
    few = {name: some for name, some in sets.items() if len(some) < max(map(len, sets.values()))}
    for name, some in few.items():  # its control rows are of the same speakers
        own = table["rows"][name]["cells"][IS]["controls"]
        assert own["ground truth"] == table["controls"][f"ground truth, {' and '.join(some)}"][IS]["mean"]
        assert own["frozen pose"] != table["controls"]["frozen pose"][IS]["mean"]
    assert few
    page = to_markdown(table)
    lines = [line.replace("\\|", "") for line in page.splitlines() if line.startswith("|")]
    assert {line.count("|") for line in lines} == {len(table["columns"]) + 2}


def test_attributes_are_measured_of_recordings_and_of_what_is_made(table_runs):
    table = make_table("mix-3", table_runs, seeds=(0,), tell=lambda text: None)
    assert [*table["controls"]] == [f"recordings of {name}" for name in NAMES]
    bench = Measured(*part_of("mix-3", table_runs.store), table_runs, None)
    which = bench.data.of(["bob"])
    from cospeech.corpora.attributes import attributes_of

    points = [KEYPOINTS2D.decode(w.astype(float), FPS).values for w in bench.data.rows("pose", which)]
    expected = attributes_of(points, JOINTS, FPS)
    cells = table["controls"]["recordings of bob"]
    assert (cells["rate"]["mean"], cells["amplitude"]["mean"]) == pytest.approx((expected.rate, expected.amplitude))
    assert all(0 <= row["cells"]["right_share"]["mean"] <= 1 for row in table["rows"].values())


def test_the_number_of_sub_generators_makes_another_run(table_runs):
    plain, four = (table_runs.recipe("cmix_gan_pats", 0, (*more, *of_speakers(["ann"]))) for more in ((), ("model.modes=4",)))
    assert (plain.config["modes"], four.config["modes"]) == (8, 4)
    assert plain.data.speakers == ("ann",)
    places = {table_runs.folder_of("cmix_gan_pats", 0, of_speakers([name])) for name in NAMES}
    assert len(places) == 3
    assert plain.data.audio == "log-mel-400"  # which reduces nothing


def test_a_speaker_who_was_not_trained_on_has_no_style(store):
    with pytest.raises(InputError, match="zed"):
        echo(store).style("zed")


@pytest.mark.parametrize("name", ["cmix_gan_pats", "munit_pats"])
def test_a_run_that_was_cut_off_goes_on(table_runs, name, tmp_path):
    """Of a network that knows clusters, and of one that does not."""
    change = of_speakers(["ann"])
    whole = table_runs.run(name, 7, change)
    other = replace(table_runs, runs=tmp_path)
    cut_off(other, name, 7, change)
    folder = other.run(name, 7, change)
    assert (folder / "best.safetensors").read_bytes() == (whole / "best.safetensors").read_bytes()
