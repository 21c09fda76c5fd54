"""Style transfer by the latents of an example (Ye et al. 2022, section 4.5 and figure 8, right), measured.

    z = f(example | its own poses before each frame, its own speech),    motion = g(z | other speech)

The example and the other speech are recordings of two speakers of the test split. The motion begins with the recorded poses
before the *other speech*, so it knows the example by the latents alone. Examples are drawn at random. Two judges
(`cospeech.experiments.style_judge`) name the speaker of a motion. They learnt from recordings of the training split. One sees
neither mean pose nor standard deviation; the other sees them, too, since latents set neither of them directly.

The paper shows one picture and has no figure for this. The measures here are ours.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, partial
from os import PathLike
from typing import Any

import numpy as np

from ...errors import InputError, say_count
from ...metrics import Score, Tools
from ...metrics.controls import CONTROLS, UNSURE
from ...metrics.interval import DRAWS, bootstrap, mean_score
from ...motion.rotations import Array
from ..style_judge import FPS, WARM, WindowJudge, describe_manner
from .excerpts import Excerpts, Protocol
from .figures import SECONDS, draw_poses
from .paper_tables import NAMED, NAMED_BY_ALL, REPLAY, SIZE, SIZE_RATIO, Cells, PaperTable, Pictures, TableSplit, TableSystem
from .runs import PlayableRun, Runs
from .scores import ScoreCache, as_cell, score_columns
from .verdicts import LIFT

__all__ = ["EXAMPLE", "RANDOM", "SCALED", "StyleTransfers"]

EXAMPLE, SCALED, RANDOM = "latents of an example", "latents of an example, scaled like random ones", "random latents"
"""The rows. The paper has the first. Random latents are multiplied by the network's ``latent_scale``. In the second row, those
of the example are, too."""
TRUTH, _, _, SHUFFLED, OTHERS = CONTROLS
_COLUMNS = (NAMED, NAMED_BY_ALL, SIZE, SIZE_RATIO, REPLAY)
WINDOW, MADE = 6.0, 120  # s, that the judges see, and frames of a piece; [ours] half of TED's takes are shorter than 10 s
EXAMPLES = 5  # [ours] examples for each piece of speech
RUN = 3  # [ours] words in a row that an example and the speech must not share
PROTOCOL = Protocol(made=MADE, given=0, stride=MADE, apart=1)
_PARTS = {
    "trunk": ("spine-neck", "neck-leftShoulder", "neck-rightShoulder"),
    "head": ("neck-nose", "nose-head"),
    "left arm": ("leftShoulder-leftElbow", "leftElbow-leftWrist"),
    "right arm": ("rightShoulder-rightElbow", "rightElbow-rightWrist"),
}
"""Part of the body → bones of TED's direction vectors."""
_TINY = 1e-6  # added to deviations, so that a still pose has a logarithm
_STILL = 0.05  # [ours] added to deviations that a judge sees, in those of the store: smaller ones are alike to it


def _describe_all(window: Array, mean: Array, std: Array, parts: Mapping[str, Array]) -> Array:
    """Mean pose, deviations of poses and steps, and manner of (F, D) poses; ``mean`` and ``std`` are those of the store."""
    poses = (window - mean) / std
    deviations = [np.log(values.std(0) + _STILL) for values in (poses, np.diff(poses, axis=0) * FPS)]
    return np.concatenate([poses.mean(0), *deviations, describe_manner(window, parts)])


def _correlate_velocities(poses: Array, others: Array) -> Array:
    """(P, F, D) twice → (P,) correlation over time of the velocities, the mean over the numbers of a pose."""
    a, b = (np.diff(each[:, round(WARM * FPS) :], axis=1) for each in (poses, others))
    a, b = (each - each.mean(1, keepdims=True) for each in (a, b))
    products = (a * b).sum(1) / np.sqrt(np.square(a).sum(1) * np.square(b).sum(1) + _TINY**2)
    means: Array = products.mean(1)
    return means


def _measure_size(poses: Array) -> Array:
    """(N, F, D) → (N,) logarithm of the standard deviation over time, the mean over the numbers of a pose."""
    return np.log(poses[:, round(WARM * FPS) :].std(1).mean(1) + _TINY)


class _Pieces:
    """The pieces of the test split that do not overlap, and the examples for each.

    Args:
        folder, raw: as of `Excerpts`.

    Raises:
        InputError: fewer than two speakers have a piece, or the store has no direction vectors at 15 frames a second.
    """

    def __init__(self, folder: str | PathLike[str], raw: str | PathLike[str] | None) -> None:
        self.excerpts = Excerpts(folder, raw, PROTOCOL)
        store = self.excerpts.store
        teaching = {clip.speaker for clip in store.clips if clip.split == "train" and clip.frames >= round(WINDOW * FPS)}
        self.left_out = self.excerpts.keep_speakers(teaching)
        """The number of pieces of speakers whom the judges cannot know."""
        if store.pose != "direction-vectors" or store.fps != FPS:
            raise InputError(f"a store of {store.pose!r} at {store.fps:g} fps", f"direction-vectors at {FPS}")
        names = self.excerpts.speakers()
        if len({*names}) < 2:
            what = f"test pieces of {say_count(len({*names}), 'speaker')} with {WINDOW:g} s of training recordings"
            raise InputError(what, "two speakers at least")
        self.speakers = [*dict.fromkeys(names)]
        self.who = np.array([self.speakers.index(name) for name in names])
        self._phrases = self._list_phrases()
        rng = np.random.default_rng(0)
        pairs = [(piece, example) for piece in range(len(names)) for example in self._draw_examples(piece, rng)]
        self.speech, self.example = np.array(pairs).T
        """(P,) the piece whose speech is played, and the piece that is the example, of each performance. Where speech is
        performed by several speakers, as in a synthetic corpus, an example shares no run of words with the speech."""
        self.other = np.array([self._other_piece(k, rng) for k in self.example])
        """(P,) another piece by the example's speaker; the example where there is no other."""

    def _list_phrases(self) -> list[set[tuple[int, ...]]]:
        """The runs of `RUN` words that are said in each piece; none where the store has no words."""
        if "word" not in self.excerpts.store.arrays:
            return [set() for _ in self.who]
        phrases = []
        for row in self.excerpts.rows("word", 0, 0):
            words = row[np.flatnonzero((row > 0) & (np.diff(row, prepend=0) != 0))].tolist()
            phrases.append({tuple(words[k : k + RUN]) for k in range(len(words) - RUN + 1)})
        return phrases

    def _draw_examples(self, piece: int, rng: np.random.Generator) -> list[int]:
        own = np.array([bool(self._phrases[piece] & phrases) for phrases in self._phrases])
        candidates = [np.flatnonzero((self.who == k) & ~own) for k in range(len(self.speakers)) if k != self.who[piece]]
        candidates = [pieces for pieces in candidates if len(pieces)]
        if not candidates:
            name = self.excerpts.store.clips[self.excerpts.clips[piece]].name
            raise InputError(f"no other speaker says other words than the piece of {name!r}", "a larger test split")
        count = len(candidates)  # fewer other speakers than examples: some have several
        picks = np.concatenate([rng.permutation(count) for _ in range(-(-EXAMPLES // count))])[:EXAMPLES]
        return [int(rng.choice(candidates[k])) for k in picks]

    def _other_piece(self, piece: int, rng: np.random.Generator) -> int:
        own = np.flatnonzero(self.who == self.who[piece])
        return int(rng.choice(own[own != piece])) if len(own) > 1 else piece

    @cached_property
    def poses(self) -> Array:
        """(N, MADE, D) recorded poses of the pieces."""
        return self.excerpts.rows("pose", 0, 0).astype(np.float64)

    @cached_property
    def judges(self) -> dict[str, WindowJudge]:
        """Column → the judge; they have seen the training split."""
        store, bones = self.excerpts.store, np.array([name.split(".")[0] for name in self.excerpts.pose.names])
        parts = {part: np.flatnonzero(np.isin(bones, own)) for part, own in _PARTS.items()}
        recordings = [
            (self.speakers.index(clip.speaker), np.asarray(store.clip(clip)["pose"], np.float64))
            for clip in store.clips
            if clip.split == "train" and clip.speaker in self.speakers and clip.frames >= round(WINDOW * FPS)
        ]
        mean, std = store.statistics("pose")
        views = {
            NAMED: partial(describe_manner, parts=parts),
            NAMED_BY_ALL: partial(_describe_all, mean=mean, std=np.maximum(std, 1e-3), parts=parts),
        }
        return {name: WindowJudge(recordings, describe, window=WINDOW) for name, describe in views.items()}

    @cached_property
    def groups(self) -> list[str]:
        """(N,) the clip of each piece; the bootstrap draws clips."""
        return [self.excerpts.store.clips[k].name for k in self.excerpts.clips]

    def _over_pieces(self, values: Array) -> Score:
        """The mean of (P,) values."""
        means = values.reshape(len(self.who), -1).mean(1)
        return mean_score([*means], groups=self.groups, note=say_count(len(values), "performance"))

    def score(self, poses: Array) -> dict[str, Score]:
        """The columns of (P, MADE, D) poses of the performances, except the lift."""
        late = poses[:, round(WARM * FPS) :]
        guesses = {name: np.array([judge.name(each) for each in late]) for name, judge in self.judges.items()}
        size, theirs = _measure_size(poses), _measure_size(self.poses)[self.example]
        rows = np.arange(len(poses)).reshape(len(self.who), -1)

        def correlate(pieces: Array) -> float:
            some = rows[pieces].ravel()
            with np.errstate(all="ignore"):  # of one clip that is drawn again and again
                return float(np.corrcoef(size[some], theirs[some])[0, 1])

        resamples = bootstrap(correlate, self.groups, draws=DRAWS)
        value = correlate(np.arange(len(rows)))
        return {
            **{name: self._over_pieces((own == self.who[self.example]).astype(float)) for name, own in guesses.items()},
            SIZE: Score(value, resamples.interval, len(rows), say_count(len(poses), "performance"), resamples.draws),
            SIZE_RATIO: self._over_pieces(np.exp(size - theirs)),
            REPLAY: self._over_pieces(_correlate_velocities(poses, self.poses[self.example])),
        }

    def perform(self, player: PlayableRun, name: str, seed: int) -> Array:
        """(P, MADE, D) poses of a row, in the units of the store."""
        from ..playing import codes, perform

        excerpts, (before, after) = self.excerpts, player.context
        excerpts.check_context(before, after)
        frames = before + MADE + after
        arrays = excerpts.inputs.gather(player, excerpts.starts - before, frames, excerpts.speakers())
        history, audio = arrays["pose"][self.speech, :before], arrays["audio"][self.speech]
        if name == RANDOM:
            return player.unpose(perform(player.net, history, audio, seed=seed))
        latents = codes(player.net, arrays["pose"], arrays["audio"])[self.example]
        if name == SCALED:
            latents = latents * float(getattr(player.net.config, "latent_scale", 1.0))
        return player.unpose(perform(player.net, history, audio, latents=latents))


class StyleTransfers:
    """The motion for other speech, by latents of an example or random ones."""

    features = "judges of styles that learnt from the training split"

    def __init__(self, paper_table: PaperTable, part: TableSplit, runs: Runs, raw: str | PathLike[str] | None) -> None:
        self.runs, self.pieces, self._scores = runs, _Pieces(runs.folder, raw), ScoreCache(runs, raw)

    @property
    def windows(self) -> str:
        """The number of pieces and performances, in words."""
        pieces, count = len(self.pieces.who), len(self.pieces.speech)
        more = f" ({self.pieces.left_out} of speakers without training recordings are left out)" if self.pieces.left_out else ""
        return f"{say_count(pieces, 'test piece')} of {MADE} frames{more}, {say_count(count, 'performance')}"

    def _cache(self, key: Sequence[object], work: Callable[[], Any]) -> Any:
        return self._scores.find(["style transfer", _COLUMNS, PROTOCOL, EXAMPLES, RUN, *key], work)

    def row(self, row: TableSystem, seed: int) -> tuple[Cells, str]:
        """Scores of all performances."""
        assert row.recipe is not None
        player = self.runs.player(row.recipe, seed)

        def work() -> Cells:
            from ..playing import threads as limited

            with limited(self.runs.threads):
                return self._score(self.pieces.perform(player, row.name, seed))

        return self._cache([player.fingerprint, row.name, seed], work), player.summary

    def _score(self, poses: Array) -> Cells:
        cells = {name: as_cell(score) for name, score in self.pieces.score(poses).items()}
        first = poses[:: len(poses) // len(self.pieces.who)]  # one performance of each piece of speech
        return cells | self._score_lift(self.pieces.excerpts.samples(first))

    def _score_lift(self, samples: Sequence[Any]) -> Cells:
        return score_columns((LIFT,), samples, samples, self.pieces.excerpts, Tools())

    def controls(self) -> dict[str, Cells]:
        """Other recordings of the example's speaker; recordings of the speech's speaker; recordings with other speech."""

        def work() -> dict[str, Cells]:
            pieces, rows = self.pieces, self.pieces.excerpts.controls()
            recordings = {TRUTH: pieces.other, OTHERS: pieces.speech}
            cells = {
                name: {key: as_cell(score) for key, score in pieces.score(pieces.poses[which]).items()}
                for name, which in recordings.items()
            }
            cells[SHUFFLED] = {name: {"why": "it is the same motion as the recordings"} for name in _COLUMNS}
            return {name: own | self._score_lift(rows[name]) for name, own in cells.items()}

        scores: dict[str, Cells] = self._cache(["controls"], work)
        return scores

    def faults(self, controls: Mapping[str, Cells]) -> dict[str, list[str]]:
        """The judges that do not tell the example's speaker from the speech's in recordings.

        The size is that of the example, not of its speaker, so recordings need not have it.
        """
        faults = {}
        for metric in self.pieces.judges:
            ours, theirs = (controls[name][metric]["interval"] for name in (TRUTH, OTHERS))
            if ours is None or theirs is None or ours[0] <= theirs[1]:
                faults[metric] = [f"{OTHERS} is {UNSURE} {TRUTH}"]
        return faults

    def picture(self, table: Mapping[str, Any]) -> Pictures:
        """The largest example, and the same speech with random latents and with its latents, as in figure 8."""
        pieces, excerpts, seed = self.pieces, self.pieces.excerpts, table["seeds"][0]
        where = int(_measure_size(pieces.poses)[pieces.example].argmax())
        speech, part = pieces.speech[where], slice(round(WARM * FPS), round((WARM + SECONDS) * FPS))
        entry = excerpts.store.clips[excerpts.clips[speech]]
        rows = {name: row["recipe"] for name, row in table["rows"].items() if row.get("cells")}
        poses = {"the example": pieces.poses[pieces.example[where]][part]}
        for name, recipe in rows.items():
            poses[name] = pieces.perform(self.runs.player(recipe, seed), name, seed)[where][part]
        return draw_poses(poses, excerpts, entry, int(excerpts.starts[speech] - entry.offset) + part.start)
