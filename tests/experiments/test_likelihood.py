"""Likelihood of test windows: exact, in one scale for all rows, paired by clip, and with the speech of the same speaker."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cospeech.audio.features.frames import AUDIO_NAMES
from cospeech.corpora.store import Entry
from cospeech.corpora.store_writer import Piece, write_store
from cospeech.experiments.tables.excerpts import Excerpts
from cospeech.experiments.tables.likelihood import order_within_speakers, score_likelihood, score_still
from cospeech.experiments.tables.paper_tables import HEARING, LIKELIHOOD
from cospeech.experiments.tables.runs import PlayableRun
from cospeech.motion.poses.direction_vectors import DIRECTION_VECTORS
from cospeech.training.batch_loader import standard_pose

torch = pytest.importorskip("torch")
stats = pytest.importorskip("scipy.stats")

POSE, AUDIO = len(DIRECTION_VECTORS.names), len(AUDIO_NAMES)
SIZES = {"steps": 2, "hidden": 6, "layers": 1, "history": 5, "look_ahead": 2, "frames": 8}
FLOW = {"encoder_channels": 4, "encoder_blocks": 1, "feature": 3}
KINDS = [
    ("stylised-flow", FLOW),
    ("stylised-flow", {"encoder": False}),
    ("stylised-flow-extended", {**FLOW, "residual": True, "inertia": 0.5}),
    ("moglow", {"residual": True}),
    ("moglow", {"nu": 50}),
]


@pytest.fixture(scope="module")
def store(tmp_path_factory) -> Path:
    """Two speakers with a training clip and two test clips of unequal length each; poses walk about."""
    folder = tmp_path_factory.mktemp("likelihood") / "ted"
    names = {"pose": DIRECTION_VECTORS.names, "audio": AUDIO_NAMES}

    def piece(name: str, speaker: str, split: str, frames: int, seed: int) -> Piece:
        rng = np.random.default_rng(seed)
        values = {"pose": rng.normal(size=(frames, POSE)).cumsum(0) / 9, "audio": rng.normal(size=(frames, AUDIO))}
        values = {key: value.astype(np.float32) for key, value in values.items()}
        return Piece(Entry(name, speaker, split, 0, frames, 0.0, tuple(values)), (), lambda: dict(values))

    sizes = {"train": 150, "test": 110, "more": 72}
    pieces = [
        piece(f"{who}-{what}", who, "train" if what == "train" else "test", frames, 10 * k + frames)
        for k, who in enumerate("ab")
        for what, frames in sizes.items()
    ]
    write_store(folder, pieces, corpus="ted", pose="direction-vectors", fps=15.0, names=names)
    return folder


@pytest.fixture(scope="module")
def excerpts(store) -> Excerpts:
    return Excerpts(store)


def network_of(name: str, settings: dict, seed: int = 0) -> torch.nn.Module:
    """A network whose couplings do something."""
    from cospeech.training.checkpoint import network

    kind = network(name)
    with torch.random.fork_rng():
        torch.random.manual_seed(seed)
        net = kind(kind.Config(**{**SIZES, **settings}), pose=POSE, audio=AUDIO).eval()
        for part in net.flow.steps:
            torch.nn.init.normal_(part.coupling.net.out.weight, 0, 0.3)
            torch.nn.init.normal_(part.norm.logs, 0, 0.3)
    return net


def player(name: str, settings: dict, excerpts: Excerpts, *, scale: float = 1.0, seed: int = 0) -> PlayableRun:
    """`network_of`, standardised by other moments than the store's."""
    net = network_of(name, settings, seed)
    mean, std = standard_pose(excerpts.store)
    facts = {"config": vars(net.config), "recipe": {"data": {}}, "store": {"speakers": ("a", "b")}}
    moments = {"pose_mean": mean + 0.1, "pose_std": std * np.linspace(scale, 2 * scale, POSE)}
    moments |= {"audio_mean": np.zeros(AUDIO), "audio_std": np.ones(AUDIO)}
    return PlayableRun(net, facts, moments, name)


def direct(run: PlayableRun, excerpts: Excerpts, k: int, frame: int, speech_of: int) -> float:
    """−ln p of one frame of window ``k`` with the speech of window ``heard``, by the Jacobian of recorded pose → latent."""
    before, after = run.context
    pose = run.pose(excerpts.rows("pose", before, after)[k]).astype(np.float64)
    audio = torch.from_numpy(run.audio(excerpts.rows("audio", before, after)[speech_of]).astype(np.float64))[None]
    net, at = run.net.double(), before + frame
    mean, std = (torch.from_numpy(run.statistics[f"pose_{what}"]) for what in ("mean", "std"))
    store_mean, store_std = (torch.from_numpy(x.astype(np.float64)) for x in standard_pose(excerpts.store))

    def latent(x):  # of the pose, standardised by the store; all others are as they were
        own = (x * store_std + store_mean - mean) / std
        whole = torch.from_numpy(pose).clone()
        whole[at] = own
        return net.latents(whole[None], audio)[0, frame]

    row = excerpts.rows("pose", before, after)[k][at]
    x = (torch.from_numpy(row.astype(np.float64)) - store_mean) / store_std
    jacobian = torch.autograd.functional.jacobian(latent, x)
    log_density = net.flow.latent.log_prob(latent(x)[None]).item() + torch.linalg.slogdet(jacobian)[1].item()
    run.net.float()
    return -log_density


# exact ----------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "settings"), KINDS, ids=[f"{name}-{len(settings)}" for name, settings in KINDS])
def test_it_is_the_density_of_the_recorded_poses_whatever_the_network_gives(excerpts, monkeypatch, name, settings):
    from cospeech.experiments.tables import likelihood

    tables = []
    monkeypatch.setattr(likelihood, "_over_clips", lambda values, excerpts: tables.append(values))
    run = player(name, settings, excerpts)
    score_likelihood(run, excerpts)
    nll, gain = tables
    order = order_within_speakers(excerpts.speakers(), excerpts.clips, excerpts.starts, 37)
    for k, frame in ((0, 0), (3, 7), (len(excerpts) - 1, excerpts.protocol.made - 1)):
        own, other = (direct(run, excerpts, k, frame, speech_of) for speech_of in (k, order[k]))
        assert nll[k, frame] == pytest.approx(own, abs=2e-3)  # float32 against float64
        assert gain[k, frame] == pytest.approx(other - own, abs=4e-3)


def test_rows_that_are_standardised_in_other_ways_are_in_one_scale(excerpts):
    """A network of poses twice as large, which undoes that first, has the same density."""
    run = player("moglow", {}, excerpts)
    wide = player("moglow", {}, excerpts, scale=0.5)
    wide.net.load_state_dict(run.net.state_dict())
    halve = torch.nn.Parameter(wide.net.flow.steps[0].norm.logs - np.log(2))
    wide.net.flow.steps[0].norm.logs = halve
    with torch.no_grad():
        wide.net.flow.steps[0].norm.bias.mul_(2)
        for step in wide.net.flow.steps:
            history = slice(POSE // 2, POSE // 2 + 5 * POSE)
            step.coupling.net.rnn.weight_ih_l0[:, history] /= 2
    narrow, twice = (score_likelihood(each, excerpts) for each in (run, wide))
    for column in (LIKELIHOOD, HEARING):
        assert twice[column]["value"] == pytest.approx(narrow[column]["value"], abs=1e-3)


def test_it_is_that_of_the_command_that_measures_hearing(excerpts, monkeypatch):
    from cospeech.experiments import playing
    from cospeech.experiments.hearing import measure_likelihood

    run = player("stylised-flow", FLOW, excerpts)
    arrays = excerpts.inputs.gather(run, excerpts.starts - 5, 37, excerpts.speakers())
    order = np.roll(np.arange(len(excerpts)), 1)
    whole = measure_likelihood(run.net, arrays, order)
    from cospeech.models.nn.objective import Batch, StepRandom

    batch = Batch({key: torch.from_numpy(arrays[key].astype(np.float32)) for key in ("pose", "audio")}, StepRandom(0, 1))
    loss = run.net.loss(batch, 1)
    assert -whole.own.mean() == pytest.approx(float(loss["nll"].detach()), rel=1e-5)
    monkeypatch.setattr(playing, "BATCH", 3)
    np.testing.assert_allclose(measure_likelihood(run.net, arrays, order).other, whole.other, atol=1e-3)


def test_the_control_row_is_a_normal_density_of_steps(excerpts):
    mean, std = (x.astype(np.float64) for x in standard_pose(excerpts.store))
    clips = [clip for clip in excerpts.store.clips if clip.split == "train"]
    steps = np.concatenate([np.diff((excerpts.store.clip(clip)["pose"] - mean) / std, axis=0) for clip in clips])
    test = np.diff((excerpts.rows("pose", 1, 0) - mean) / std, axis=1)
    expected = -stats.norm.logpdf(test, steps.mean(0), steps.std(0)).sum(-1).mean()
    cells = score_still(excerpts)
    assert cells[LIKELIHOOD]["value"] == pytest.approx(expected, abs=1e-4)
    assert cells[HEARING]["value"] == 0


# pairs ----------------------------------------------------------------------------------------------------------------------


def test_the_other_speech_is_of_the_same_speaker():
    speakers = [*"aaaabbbbbc"]
    clips, starts = np.arange(10), 100 * np.arange(10)
    order = order_within_speakers(speakers, clips, starts, 30)
    assert [speakers[k] for k in order[:9]] == speakers[:9]
    assert (order != np.arange(10)).all()
    assert sorted(order[:9]) == [*range(9)]
    assert (np.abs(order[:4] - np.arange(4)) == 2).all()


def test_the_other_speech_shares_no_frame_with_the_own_one():
    speakers, clips = [*"aaabbbbbb"], np.array([0, 0, 0, 1, 1, 1, 2, 2, 2])
    starts = np.array([0, 10, 20, 100, 110, 120, 300, 310, 320])
    order = order_within_speakers(speakers, clips, starts, 30)
    assert (clips[order] != clips).all()
    assert [speakers[k] for k in order[3:]] == ["b"] * 6
    alone = order_within_speakers([*"aaa"], np.zeros(3, int), np.array([0, 10, 20]), 30)
    assert (alone != np.arange(3)).all()  # nothing else is there


def test_clips_are_drawn_whole_and_the_same_for_all_rows(excerpts):
    from cospeech.experiments.tables.likelihood import _over_clips

    rng = np.random.default_rng(0)
    values = rng.normal(size=(len(excerpts), 30))
    one, other = _over_clips(values, excerpts), _over_clips(values + 3, excerpts)
    assert one["value"] == pytest.approx(values.mean())
    assert one["note"] == f"4 clips, {len(excerpts)} windows"
    np.testing.assert_allclose(np.subtract(other["draws"], one["draws"]), 3, atol=1e-4)
    within = values + np.repeat(rng.normal(size=len(excerpts)), 30).reshape(values.shape)
    of_clips = {clip: within[excerpts.clips == clip].mean() for clip in np.unique(excerpts.clips)}
    flat = np.stack([np.full(30, of_clips[clip]) for clip in excerpts.clips])
    np.testing.assert_allclose(_over_clips(flat, excerpts)["draws"], _over_clips(within, excerpts)["draws"], atol=1e-5)


def test_what_has_no_likelihood_says_so(excerpts):
    run = player("moglow", {}, excerpts)
    bare = PlayableRun(torch.nn.Linear(1, 1), run.facts, run.statistics, "bare")
    assert score_likelihood(bare, excerpts)[LIKELIHOOD] == {"why": "the network has no likelihood"}
    with torch.no_grad():
        run.net.flow.steps[0].norm.logs.fill_(np.inf)
    assert "not finite" in score_likelihood(run, excerpts)[HEARING]["why"]


@pytest.mark.parametrize("name", ["moglow", "stylised-flow-extended"])
def test_rows_play_with_their_own_scale_of_latents(name):
    """A row whose `latent_scale` is 0 has one motion for one speech; at 1 each seed has its own."""
    from cospeech.experiments.playing import perform

    net, rng = network_of(name, {}), np.random.default_rng(0)
    history, audio = rng.normal(size=(3, 5, POSE)), rng.normal(size=(3, 15, AUDIO))
    one, other = (perform(net, history, audio, seed=seed) for seed in (0, 1))
    assert np.abs(one - other).max() > 0.1
    net.config = replace(net.config, latent_scale=0.0)
    one, other = (perform(net, history, audio, seed=seed) for seed in (0, 1))
    np.testing.assert_array_equal(one, other)
