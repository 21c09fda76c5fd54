"""The runs of a table: the feature networks first, then every row with every seed.

A finished run is not trained again; an interrupted run continues. Torch is imported when the first run is needed.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from hashlib import blake2b
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ...corpora.store import Store
from ...errors import InputError, nearest
from ...files import describe_os_error
from ...metrics import FeatureNet
from ...motion.rotations import Array
from ...training.recipe import SHIPPED, Recipe, list_changes, load_recipe, read_recipe

__all__ = ["FEATURES", "OMEGA", "PlayableRun", "Runs", "make_folder", "of_speakers", "small_scale"]

OMEGA, FEATURES, CLASSIFIER = "gesture_autoencoder", "fgd", "speaker_classifier"
"""Recipes, before ``_CORPUS``: the network of the perceptual loss, that of FGD, and that of the inception score."""
SHARED = (OMEGA, FEATURES, CLASSIFIER)
_UNPLAYED = dict.fromkeys(
    ("stylised-flow", "stylised-flow-extended", "moglow"), ("style",)
)  # `PlayableRun` supports neither these nor the moments of single clips

_SMALL_OF_RECIPE: Mapping[str, dict[str, dict[str, Any]]] = {
    "mix_stage_pats_authors": {"model": {"curriculum": 7}},  # 1000 of 60,000 steps, as many of 400
    "fgd_beat": {"model": {"channels": 48, "hidden": 192, "code": 32}},  # 32: test clips have some hundred windows
}
"""Recipe → what ``--small`` changes in it, beside the changes of its model; sections as in the file. [ours]"""

Tell = Callable[[str], None]


@dataclass(frozen=True)
class PlayableRun:
    """A trained run, ready to be played on a store's windows.

    Args:
        net: the network.
        facts: of its run.
        statistics: ``pose_mean`` and so on.
        fingerprint: digest of its weights, part of the key of cached scores.
        stretches: (speakers, n, T, D) standardised poses of each speaker; None where it was trained without speech.
    """

    net: Any
    facts: Mapping[str, Any]
    statistics: Mapping[str, Array]
    fingerprint: str
    stretches: Array | None = None

    @property
    def speakers(self) -> tuple[str, ...]:
        """The speakers that it was trained on."""
        return tuple(self.facts["store"]["speakers"])

    @property
    def parameters(self) -> int:
        """The number of parameters of the network."""
        return sum(p.numel() for p in self.net.parameters())

    @property
    def summary(self) -> str:
        """Steps of its training, and its size, in a line."""
        config, train = self.facts["config"], self.facts["recipe"]["train"]
        units = next(f"{config[name]} {name}" for name in ("hidden", "channels") if name in config)
        size = f"K {config['steps']}, {config['hidden']} units" if "steps" in config else units
        return f"{train['steps']} steps of {train['batch']} windows, {size}, {self.parameters:,} parameters"

    @property
    def context(self) -> tuple[int, int]:
        """Poses before a frame and frames of speech after it."""
        from ..playing import context_of

        return context_of(self.net)

    def pose(self, rows: Array) -> Array:
        """Rows of a store, standardised."""
        return (rows - self.statistics["pose_mean"]) / self.statistics["pose_std"]

    def unpose(self, poses: Array) -> Array:
        """Standardised poses in the units of the store."""
        return poses * self.statistics["pose_std"] + self.statistics["pose_mean"]

    def style(self, speaker: str) -> Array:
        """(styles,) the style of a speaker, as a network of windows takes it.

        Raises:
            InputError: it was not trained on this speaker.
        """
        if speaker not in self.speakers or self.stretches is None:
            raise InputError(f"no style of {speaker!r}", f"it was trained on {', '.join(self.speakers)}")
        from ..playing import styles_of

        return styles_of(self.net, self.stretches)[self.speakers.index(speaker)]

    def audio(self, rows: Array) -> Array:
        """(B, T, 84) rows of a store, reduced and standardised."""
        from ...audio.features.reduce import reduce_audio

        name = self.facts["recipe"]["data"].get("audio")
        if name is not None:
            rows = reduce_audio(rows.reshape(-1, rows.shape[-1]), name).reshape(*rows.shape[:2], -1)
        return (rows - self.statistics["audio_mean"]) / self.statistics["audio_std"]


_open_runs: dict[tuple[Path, str], PlayableRun] = {}
"""The runs that were opened last: rows and tables share them."""
_OPEN = 20_000_000  # parameters of all of them, 80 MB [ours]


def _open_run(folder: Path, fingerprint: str) -> PlayableRun:
    from ...training.checkpoint import load_run, read_tensors

    net, facts = load_run(folder)
    tensors, _ = read_tensors(folder / "statistics.safetensors")
    statistics = {key: np.asarray(tensor.numpy()) for key, tensor in tensors.items()}
    stretches = read_tensors(folder / "examples.safetensors")[0].get("stretches")
    return PlayableRun(net, facts, statistics, fingerprint, None if stretches is None else stretches.numpy())


def _digest(*parts: bytes) -> str:
    digest = blake2b(digest_size=6)
    for part in parts:
        digest.update(len(part).to_bytes(8, "little") + part)
    return digest.hexdigest()


def of_speakers(speakers: Sequence[str]) -> tuple[str, ...]:
    """Overrides of a recipe for a run with these speakers alone; (): none, it has all."""
    return (f"data.speakers={json.dumps([*speakers])}",) if speakers else ()


def small_scale(model: str) -> dict[str, Mapping[str, Any]]:
    """What ``--small`` changes in the recipes of a network: section → key → value.

    Args:
        model: name of the network, as in a recipe.
    """
    from ...training.checkpoint import network

    config = network(model).Config
    return {"model": config.SMALL, "train": config.SMALL_TRAIN}


def make_folder(folder: Path) -> None:
    """Make a folder where it is missing.

    Raises:
        InputError: it cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot make {str(folder)!r}: {describe_os_error(error)}", "is the name right?") from None


@dataclass(frozen=True)
class Runs:
    """How and where a table's runs are made.

    Args:
        folder: of the store.
        runs: folder of the run folders.
        recipes: folder of the recipes; default: those that come with the program.
        small: whether rows are trained at small scale, see `small_scale`.
        overrides: ``"train.steps=…"`` for every row, or ``"camn_beat:train.steps=…"`` for the rows of a recipe; see
            `cospeech.training.recipe.load_recipe`.
        threads: of PyTorch; 0: as many as it likes.
        oracle: folder of the store of the same speech with other gestures; None: no such row.
        about: a word about the store that it does not hold itself, such as "synthetic"; printed at the head of the table.
        tell: is told what is being done.
    """

    folder: str | PathLike[str]
    runs: str | PathLike[str] = "runs/tables"
    recipes: str | PathLike[str] = SHIPPED
    small: bool = False
    overrides: tuple[str, ...] = ()
    threads: int = 0
    oracle: str | PathLike[str] | None = None
    about: str = ""
    tell: Tell = field(default=lambda text: None)

    @property
    def store(self) -> Store:
        return Store(self.folder)

    @property
    def fingerprint(self) -> str:
        """Tells this store from all others: corpus, poses, and a digest of its index and statistics."""
        store = self.store
        digest = _digest((Path(self.folder) / "index.json").read_bytes(), store.statistics("pose")[0].tobytes())
        return f"{store.corpus}-{store.pose}-{digest}"

    def digest_data(self, raw: str | PathLike[str] | None) -> str:
        """Tells the data that scores are of: some rows of each array of the store, and names and sizes of files of ``raw``."""
        store = self.store
        rows = [np.ascontiguousarray(array[:: max(1, len(array) // 1000)]).tobytes() for array in store.arrays.values()]
        files = [] if raw is None else sorted(path for path in Path(raw).rglob("*") if path.is_file())
        return _digest(*rows, *(f"{path.relative_to(str(raw))} {path.stat().st_size}".encode() for path in files))

    def folder_of(self, name: str, seed: int, more: Sequence[str] = ()) -> Path:
        """Folder of a run: store, scale, recipe with a digest of its contents, seed."""
        recipe = replace(self._recipe(name, seed, more), needs={})
        changes = list_changes(
            Recipe(recipe.model).to_dict(), recipe.to_dict()
        )  # compared with the defaults, so that a key that is added later is no change
        texts = [recipe.model, str(recipe.train.steps), *changes, *self._name_omega(name, seed, more)]
        own = _digest(*(text.encode() for text in texts))
        return Path(self.runs) / self.fingerprint / ("small" if self.small else "paper") / f"{name}-{own}-{seed}"

    def _name_omega(self, name: str, seed: int, more: Sequence[str]) -> list[str]:
        """The name of the folder of the perceptual network that a run needs, if the network is not as its recipe has it."""
        omega = f"{OMEGA}_{self.store.corpus}"
        differs = any(text.startswith(f"{omega}:") for text in self.overrides)
        return [self.folder_of(omega, 0).name] if differs and "omega" in self._recipe(name, seed, more).needs else []

    def recipe(self, name: str, seed: int = 0, more: Sequence[str] = ()) -> Recipe:
        """A recipe as the table trains it.

        Args:
            name: of its file.
            seed: of the run.
            more: changes of a row, such as ``"model.modes=4"``.

        Raises:
            InputError: there is no such recipe, or it cannot take the changes.
        """
        recipe = self._recipe(name, seed, more)
        if "omega" in recipe.needs:
            recipe = replace(recipe, needs={**recipe.needs, "omega": str(self.folder_of(f"{OMEGA}_{self.store.corpus}", 0))})
        return recipe

    def _recipe(self, name: str, seed: int, more: Sequence[str] = ()) -> Recipe:
        """As `recipe`, without the folders of the runs that it needs."""
        path = Path(self.recipes) / f"{name}.toml"
        if not path.is_file():
            raise InputError(f"there is no recipe {str(path)!r}", "--recipes names a folder that has it")
        plain = load_recipe(path)
        texts: list[str] = []
        if self.small:
            both = [*small_scale(plain.model).items(), *_SMALL_OF_RECIPE.get(name, {}).items()]
            for section, values in both:
                texts += [f"{section}.{key}={json.dumps(value)}" for key, value in values.items()]
        texts += [*more, *self._overrides_of(name), f"train.seed={seed}"]
        if self.threads:
            texts.append(f"train.threads={self.threads}")
        recipe = load_recipe(path, texts)
        if recipe.data.per_clip_normalisation or any(recipe.config.get(key) for key in _UNPLAYED.get(recipe.model, ())):
            raise InputError(
                f"a table's row {name!r} with data.per_clip_normalisation or model.style", "tables are of the papers' systems"
            )
        if recipe.data.mirror and not any(clip.name.endswith("|mirror") for clip in self.store.clips):
            recipe = replace(recipe, data=replace(recipe.data, mirror=None))
        return recipe

    def _overrides_of(self, name: str) -> Iterator[str]:
        """The overrides of a recipe; recipes that all rows share take only those with their name.

        Raises:
            InputError: an override of a recipe that does not exist.
        """
        for text in self.overrides:
            recipe, colon, _ = text.partition("=")[0].rpartition(":")
            if colon and not (Path(self.recipes) / f"{recipe}.toml").is_file():
                recipes = sorted(path.stem for path in Path(self.recipes).glob("*.toml"))
                raise InputError(f"{text!r} is of no recipe", nearest(recipe, recipes))
            if recipe == name or (not recipe and not name.startswith(SHARED)):
                yield text.removeprefix(f"{recipe}:")

    def run(self, name: str, seed: int = 0, more: Sequence[str] = ()) -> Path:
        """Train a run to its last step, and return its folder."""
        recipe, folder = self.recipe(name, seed, more), self.folder_of(name, seed, more)
        for what, path in recipe.needs.items():
            if what == "omega" and Path(path) == self.folder_of(f"{OMEGA}_{self.store.corpus}", 0):
                self.run(f"{OMEGA}_{self.store.corpus}")
        if not self._is_done(folder, recipe):
            from ...training.train import train

            label = " ".join([f"{name}, seed {seed}", *more])
            every = max(1, recipe.train.steps // 10)

            def progress(step: float, total: float | None, text: str) -> None:
                if step % every == 0:
                    self.tell(f"{label}: step {step:g} of {total:g}, {text}")

            again = "run the same command again to go on"
            train(recipe, self.store, folder, resume=True, progress=progress, notice=self.tell, hint=again)
        return folder

    def is_done(self, name: str, seed: int = 0, more: Sequence[str] = ()) -> bool:
        """Whether a run exists and is trained to its last step."""
        return self._is_done(self.folder_of(name, seed, more), self.recipe(name, seed, more))

    def _is_done(self, folder: Path, recipe: Recipe) -> bool:
        """Whether a run exists that has this recipe and all its steps."""
        if not (folder / "last.safetensors").exists():
            return False
        from ...models.nn.sampled import Sampled
        from ...training.checkpoint import network, read_facts, read_state

        differs = list_changes(read_recipe(read_facts(folder)["recipe"]).to_dict(), recipe.to_dict())
        if any(not text.startswith("needs.") for text in differs):  # the folders of needed runs do not matter
            return False  # resuming says what differs
        state = read_state(folder / "last.safetensors")
        if "preliminary_steps" not in state and issubclass(network(recipe.model), Sampled):
            return False  # its steps were counted in another way
        return int(state["step"]) >= recipe.train.steps

    def player(self, name: str, seed: int = 0, more: Sequence[str] = ()) -> PlayableRun:
        """The run of a row; it is trained if it is missing."""
        folder = self.run(name, seed, more)
        from ...training.checkpoint import read_facts, stands_for

        config = json.dumps(read_facts(folder)["config"], sort_keys=True)  # some settings matter in play alone
        fingerprint = _digest((folder / f"{stands_for(folder)}.safetensors").read_bytes(), config.encode())
        player = _open_runs.pop((folder, fingerprint), None) or _open_run(folder, fingerprint)
        _open_runs[folder, fingerprint] = player  # now the most recent
        while len(_open_runs) > 1 and sum(each.parameters for each in _open_runs.values()) > _OPEN:
            del _open_runs[next(iter(_open_runs))]
        return player

    def features(self) -> FeatureNet:
        """The feature network of FGD, trained on this store; one for all rows and seeds."""
        from ...models.feature_net import feature_net

        player = self.player(f"{FEATURES}_{self.store.corpus}")
        return feature_net(
            player.net, name="fgd-autoencoder", pose=self.store.pose, fps=self.store.fps,
            mean=player.statistics["pose_mean"], std=player.statistics["pose_std"],
        )  # fmt: skip
