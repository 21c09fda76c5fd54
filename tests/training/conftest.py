"""What modules of this folder share: bundles of systems whose motion is drawn, made once."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

__all__ = ["SAMPLERS", "SampledBundle"]

SAMPLERS: dict[str, dict[str, Any]] = {
    "talkshow": {
        "frames": 24, "codes": 12, "code": 6, "hidden": 16, "heard": 16, "width": 8, "layers": 2, "latent": 8, "prior_from": 2,
    },
    "gesturediffuclip": {
        "frames": 24, "hidden": 16, "latent": 6, "heard": 16, "text_channels": 6, "text": 6, "word_width": 5, "style": 6,
        "width": 8, "layers": 1, "heads": 2, "steps": 3, "align_from": 2, "diffusion_from": 3,
    },
}  # fmt: skip


class SampledBundle(NamedTuple):
    """A run of some steps, and its bundle with exact weights."""

    run: Path
    path: Path


@pytest.fixture(scope="session")
def sampler_bundle(tmp_path_factory) -> Callable[[str], SampledBundle]:
    """Make each bundle once: an export takes seconds."""
    folder, bundles = tmp_path_factory.mktemp("sampled"), dict[str, SampledBundle]()

    def make(name: str) -> SampledBundle:
        if name not in bundles:
            from cospeech.training.export.bundles import bundle_run
            from cospeech.training.recipe import read_recipe
            from cospeech.training.train import train

            settings = {"steps": 6, "batch": 4, "lr": 1e-2, "threads": 1, "device": "cpu", "validate_every": 0, "save_every": 6}
            sections = {"model": {"name": name, **SAMPLERS[name]}, "data": {"audio": "mel20-prosody"}, "train": settings}
            train(read_recipe(sections), _store(folder), folder / name)
            bundle_run(folder / name, folder / f"{name}.cospeech", small=False)
            bundles[name] = SampledBundle(folder / name, folder / f"{name}.cospeech")
        return bundles[name]

    return make


def _store(folder: Path) -> Any:
    """Two speakers who move at random, one to the side (made up), in two moods; with words and faces."""
    from cospeech.audio.features.frames import AUDIO_NAMES, audio_features
    from cospeech.audio.speech import Speech, example
    from cospeech.corpora.store import Store
    from cospeech.corpora.store_files import Entry
    from cospeech.corpora.store_writer import Piece, write_store
    from cospeech.motion.poses import find_pose

    if not (folder / "store").exists():
        speech, pose, rng, pieces = (
            Speech.load(example()[0]).window(0, 6),
            find_pose("expmap-humanoid"),
            np.random.default_rng(0),
            [],
        )
        rows = audio_features(speech, 72, 12.0)
        for k, name in enumerate(["big", "small"] * 2):
            steps = rng.normal(size=(72, pose.dimensions)).cumsum(0) * 0.02 + 0.1 * (name == "small")
            values = {
                "pose": steps.astype(np.float32), "audio": rows, "face": rng.random((72, 52)).astype(np.float32),
                "emotion": np.full(72, k, np.int8), "word": (np.arange(72) // 9 % 3).astype(np.int32),
            }  # fmt: skip
            entry = Entry(f"{name}{k}", name, "validation" if k > 1 else "train", 0, 72, 0.0, tuple(values))
            pieces.append(Piece(entry, ("yes", "mountains"), lambda values=values: dict(values)))
        names = {"pose": pose.names, "audio": AUDIO_NAMES, "face": tuple(map(str, range(52)))}
        write_store(folder / "store", pieces, corpus="beat", pose="expmap-humanoid", fps=12.0, names=names)
    return Store(folder / "store")
