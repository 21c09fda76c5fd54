"""A store of some of its speakers: as if it had been written of them alone; what is trained on it knows no others."""

from __future__ import annotations

import json

import numpy as np
import pytest

from cospeech.corpora.store import Store
from cospeech.corpora.store_writer import Piece, write_store
from cospeech.errors import InputError
from cospeech.training.speaker_subset import of_speakers
from cospeech.training.windows import Windows
from tests.support.tiny_store import make_store

ALL = ("ann", "ann|mirror", "bob", "cleo")


@pytest.fixture
def store(tmp_path):
    return Store(make_store(tmp_path / "store", mirrored=True))


def write_clips_of(store: Store, names, folder) -> Store:
    """Write the same clips into a store of their own."""
    pieces = [
        Piece(clip, (), lambda clip=clip: {k: np.array(v) for k, v in store.clip(clip).items()})
        for clip in store.clips
        if clip.speaker in names
    ]
    write_store(folder, pieces, corpus=store.corpus, pose=store.pose, fps=store.fps, names=store.names)
    return Store(folder)


@pytest.mark.parametrize("names", [("bob",), ("ann", "cleo"), ("cleo", "ann"), ALL])
def test_it_is_the_store_of_these_clips_alone(store, tmp_path, names):
    some, alone = of_speakers(store, names), write_clips_of(store, names, tmp_path / "alone")
    assert some.speakers == names
    assert len(some) == len(alone)
    assert [clip.name for clip in some.clips] == [clip.name for clip in alone.clips]
    for mine, theirs in zip(some.clips, alone.clips, strict=True):
        assert all(np.array_equal(some.clip(mine)[k], v) for k, v in alone.clip(theirs).items())
    for array in ("pose", "audio"):
        for speaker in (None, *names):
            for mine, theirs in zip(some.statistics(array, speaker), alone.statistics(array, speaker), strict=True):
                assert mine.dtype == np.float32
                assert np.array_equal(mine, theirs)
    if names == ALL:
        assert all(np.array_equal(*both) for both in zip(some.statistics(), store.statistics(), strict=True))
    else:
        assert not np.allclose(some.statistics()[0], store.statistics()[0])


def test_the_store_itself_stays_whole(store):
    before = (store.speakers, store.clips, len(store), *map(np.ndarray.tolist, store.statistics()))
    of_speakers(store, ["bob"])
    assert (store.speakers, store.clips, len(store), *map(np.ndarray.tolist, store.statistics())) == before


def test_windows_are_of_these_speakers_by_their_numbers(store):
    some = of_speakers(store, ["cleo", "ann"])
    batch = Windows(some, 20, balanced=True).at(40, 0, 0)
    assert np.bincount(batch["speaker"]).tolist() == [20, 20]
    for k in range(40):
        clip = some.clips[batch["clip"][k]]
        assert clip.speaker == ("cleo", "ann")[batch["speaker"][k]]
        at = batch["start"][k] - clip.offset
        assert 0 <= at <= clip.frames - 20
        assert np.array_equal(batch["pose"][k], store.clip(clip.name)["pose"][at : at + 20])


@pytest.mark.parametrize(
    ("names", "says"),
    [(["bbo"], "'bbo' .did you mean 'bob'"), (["ann", "ann"], "each once"), ([], "one or more"), ([""], "no speaker")],
)
def test_what_is_no_choice_is_told(store, names, says):
    with pytest.raises(InputError, match=says):
        of_speakers(store, names)


def test_modes_and_controls_are_of_these_speakers_alone(tmp_path):
    pytest.importorskip("scipy")
    from cospeech.corpora.store_files import Entry
    from cospeech.motion.poses.direction_vectors import DIRECTION_VECTORS
    from cospeech.training.movement_modes import with_modes
    from cospeech.training.style_controls import with_controls

    draw, pieces = np.random.default_rng(0), []
    for k, (speaker, split) in enumerate([("ann", "train"), ("bob", "train"), ("ann", "test"), ("cleo", "train")]):
        values = {"pose": (3 * k + draw.normal(0, 1, (60, 27)).cumsum(0)).astype(np.float32)}
        pieces.append(Piece(Entry(f"{k}", speaker, split, 0, 60, 0.0, ("pose",)), (), lambda v=values: dict(v)))
    name = DIRECTION_VECTORS
    write_store(tmp_path / "s", pieces, corpus="ted", pose=name.name, fps=15.0, names={"pose": name.names})
    store = Store(tmp_path / "s")
    some, alone = of_speakers(store, ["ann", "cleo"]), write_clips_of(store, ("ann", "cleo"), tmp_path / "alone")
    (modes, centres), (expected, theirs) = with_modes(some, 3), with_modes(alone, 3)
    assert np.array_equal(centres, theirs)
    controls, others = with_controls(some), with_controls(alone)
    for mine, there in zip(modes.clips, expected.clips, strict=True):
        assert np.array_equal(modes.clip(mine)["cluster"], expected.clip(there)["cluster"])
    for mine, there in zip(controls.clips, others.clips, strict=True):
        assert np.array_equal(controls.clip(mine)["control"], others.clip(there)["control"])
    assert all(np.array_equal(*x) for x in zip(controls.statistics("control"), others.statistics("control"), strict=True))
    assert (modes.arrays["cluster"][60:120] == -1).all()  # bob's


def test_a_run_is_of_the_speakers_of_its_recipe(store, tmp_path):
    pytest.importorskip("torch", reason="networks need torch (the train extra)")
    from safetensors.torch import load_file

    from cospeech.training.recipe import read_recipe
    from cospeech.training.train import train

    def plan(*speakers):
        config = {"frames": 20, "channels": 4, "depth": 1, "decoder": 0, "discriminator_channels": 2}
        settings = {"steps": 1, "batch": 3, "threads": 1, "validate_batches": 1}
        return read_recipe(
            {"model": {"name": "speech2gesture", **config}, "data": {"speakers": [*speakers]}, "train": settings}
        )

    run = tmp_path / "run"
    train(plan("cleo", "ann"), store, run)
    facts, some = json.loads((run / "config.json").read_text()), of_speakers(store, ["cleo", "ann"])
    assert facts["store"]["speakers"] == ["cleo", "ann"]
    assert (facts["store"]["clips"], facts["store"]["frames"]) == (len(some.clips), len(some))
    assert facts["store"]["train_seconds"] == sum(c.frames for c in some.clips if c.split == "train") / some.fps
    assert facts["sizes"]["speakers"] == 2
    assert facts["recipe"]["data"]["speakers"] == ["cleo", "ann"]
    assert np.array_equal(load_file(run / "statistics.safetensors")["pose_mean"].numpy(), some.statistics()[0])
    assert load_file(run / "examples.safetensors")["stretches"].shape[0] == 2
    with pytest.raises(InputError, match=r"data\.speakers"):
        train(plan("ann", "cleo"), store, run, resume=True)
    assert train(plan("cleo", "ann"), store, run, resume=True).resumed == 1
    old = facts["recipe"] | {"data": {k: v for k, v in facts["recipe"]["data"].items() if k != "speakers"}}
    (run / "config.json").write_text(json.dumps(facts | {"recipe": old}))  # a run from before the key was there
    with pytest.raises(InputError, match=r"data\.speakers: \[\], now"):
        train(plan("cleo", "ann"), store, run, resume=True)


def test_a_run_from_before_a_key_goes_on(store, tmp_path):
    pytest.importorskip("torch", reason="networks need torch (the train extra)")
    from cospeech.training.recipe import read_recipe
    from cospeech.training.train import train

    model = {"name": "speech2gesture", "frames": 20, "channels": 4, "depth": 1, "decoder": 0, "discriminator_channels": 2}
    recipe = read_recipe({"model": model, "train": {"steps": 1, "batch": 2, "threads": 1, "validate_batches": 1}})
    train(recipe, store, tmp_path / "run")
    path = tmp_path / "run" / "config.json"
    facts = json.loads(path.read_text())
    del facts["recipe"]["data"]["speakers"], facts["recipe"]["train"]["weight_decay"]
    path.write_text(json.dumps(facts))
    assert train(recipe, store, tmp_path / "run", resume=True).resumed == 1
