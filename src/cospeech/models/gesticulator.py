"""Gesticulator: Kucherenko et al. 2020, "Gesticulator: A framework for semantically-aware speech-driven gesture generation":
sound and words in, poses out, one after the other; each is made of 30 frames of speech and of the three poses before it.

    speech of frames t − 10 … t + 19, of each: [audio, word, timing]
       │  of each frame: 837 ─► 248 ─► 124
       └─► side by side: 3720 ─► 612 ─► 256 ─► h ──► h · (1 + α) + β ─► 45 ─► ŷₜ
                                                       ▲
    ŷₜ₋₁, ŷₜ₋₂, ŷₜ₋₃ (135) ─► 512 ─► dropout 0.8 ─► [α, β]          FiLM; tanh after every layer but the last

    timing: time since the word began, time until it ends, both together, share that is over, tempo;   0 in silence

Minimised, with y poses of the recording and Δ from one frame to the next:

    L = E (ŷ − y)² + 0.6 E (Δŷ − Δy)²

In the first epochs α = β = 0: no pose is fed back. Then recorded poses are fed back after two of every 16 frames, in the place
of its own; in the next epoch after two of every 8, then of 4, and at last after all.

Followed, changed, not said in the paper: docs/models/gesticulator.md, by number.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import torch
from torch import Tensor, nn

from ..errors import InputError, nearest
from .nn.conditioning import frame_windows
from .nn.configuration import SMALL_RECURRENT, ModelConfig
from .nn.export import ExportGraph
from .nn.modalities import INPUTS
from .nn.objective import Batch, Objective
from .nn.settings import check_least
from .nn.trainable import Trainable
from .nn.words import word_embedding

__all__ = ["TIMING", "Gesticulator", "GesticulatorConfig", "mark_words", "word_timing"]

TIMING = 5  # numbers that say where in a word a frame is; section 4.1
TEMPO = 0.5  # tenths of a second in a frame at 20 per second, the unit in which the authors' code counts time within a word
LARGE = 1e6  # ours: factor that makes any difference of two words in float32 at least 1


@dataclass(frozen=True)
class GesticulatorConfig(ModelConfig):
    """Sizes, weights and schedule; the defaults are those of the authors' code."""

    TINY: ClassVar[Mapping[str, Any]] = {
        "hidden": 8, "speech": 6, "context": 12, "word_width": 5, "history": 3, "look_ahead": 4, "frames": 8, "epoch": 2,
    }  # fmt: skip
    SMALL: ClassVar[Mapping[str, Any]] = {"hidden": 64, "context": 128, "speech": 32, "word_width": 32, "epoch": 20}
    SMALL_TRAIN: ClassVar[Mapping[str, Any]] = {**SMALL_RECURRENT, "batch": 48}

    frames: int = 40
    """Trained in a window, between history and look-ahead; authors' code 40 at 20 per second."""
    history: int = 10
    """Frames of speech before that of a pose; section 4.2: 0.5 s."""
    look_ahead: int = 19
    """Frames of speech after that of a pose; section 4.2: 1 s; in authors' code the frame of the pose is the first of these."""
    poses: int = 3
    """Poses that are fed back; section 4.2: 3."""
    speech: int = 124
    """Width of the code of a frame of speech, half of the layer before it; authors' code 124."""
    context: int = 612
    """Width of the code of all frames of speech; authors' code 612."""
    hidden: int = 256
    """Width of the layer that the poses modulate; authors' code 256."""
    dropout: float = 0.2
    """After every layer but the last; authors' code 0.2."""
    pose_dropout: float = 0.8
    """On the features of the poses; authors' code 0.8, four times the other."""
    word_width: int = 300
    """Of a word where the network learns it; ours, as in the other systems (theirs: 768 of BERT)."""
    velocity: float = 0.6
    """Weight of the distance of velocities; authors' code 0.6."""
    epoch: int = 440
    """Steps of an epoch; ours, of Trinity's 3 h 55 min for training: windows 10 frames apart, 64 in a batch."""
    plain_epochs: int = 7
    """In which no pose is fed back; authors' code 7."""
    forcing: int = 16
    """Recorded poses are fed back after two of so many frames, in the next epoch; each epoch halves it; authors' code 16."""

    def __post_init__(self) -> None:
        low = {"frames": 2, "history": 1, "look_ahead": 0, "poses": 1, "speech": 1, "context": 1, "hidden": 1, "word_width": 1}
        low |= {"dropout": 0, "pose_dropout": 0, "velocity": 0, "epoch": 1, "plain_epochs": 0, "forcing": 2}
        check_least(self, "a Gesticulator", low)
        if not (self.dropout < 1 and self.pose_dropout < 1 and self.poses <= self.history):
            problem = (
                f"dropout {self.dropout}, pose_dropout {self.pose_dropout}, {self.poses} poses of a history of {self.history}"
            )
            raise InputError(f"a Gesticulator with {problem}", "shares below 1; no more poses than the history has frames")

    def forcing_at(self, step: int) -> int | None:
        """Of how many frames two are followed by recorded poses, in a step of training; None: no pose is fed back."""
        epoch = step // self.epoch - self.plain_epochs
        return None if epoch < 0 else max(2, self.forcing >> min(epoch, 60))


def mark_words(words: Tensor, last: Tensor | None = None) -> Tensor:
    """Whether a word is said, and whether another one begins, 1 or 0: (B, T, W) vectors of words → (B, T, 2).

    A word is a run of the same vector, zeros are silence.

    Args:
        words: of frames that follow each other.
        last: (B, 1, W) the word of the frame before them; None: silence.
    """
    words = words.detach()
    before = torch.cat([words[:, :1] * 0 if last is None else last, words[:, :-1]], 1)
    return (LARGE * torch.stack([words.abs().amax(-1), (words - before).abs().amax(-1)], -1)).clamp(0, 1)


def word_timing(marks: Tensor) -> Tensor:
    """The place of each frame of a stretch in its word, as far as the stretch shows: (…, K, 2) of `mark_words` → (…, K, 5).

    The five numbers: tenths of a second since the word began, this frame included; until it ends, this frame included; both
    together; the share that is over; words per tenth of a second. All are 0 in silence. A bundle may hold all operators here.
    """
    is_word, begins = (x.flatten(-2) for x in marks.split(1, -1))
    length = is_word.shape[-1]
    begins = torch.cat([begins[..., :1] * 0 + 1, begins[..., 1:]], -1)
    place = torch.arange(length, device=marks.device)
    since = (place + 1) * (place[:, None] >= place)  # [k, j]: j + 1 for frames j up to k
    until = (length - place) * (place[:, None] < place)  # K − j for those after it
    first = (begins.unsqueeze(-2) * since.to(marks)).amax(-1)  # 1 + where the word of frame k began
    after = length - (begins.unsqueeze(-2) * until.to(marks)).amax(-1)  # where the next one begins
    age, rest = TEMPO * (place + 2 - first), TEMPO * (after - place)
    whole = age + rest - TEMPO
    return torch.stack([age, rest, whole, age / whole, is_word / whole], -1) * is_word.unsqueeze(-1)


class Gesticulator(Trainable):
    """Gesticulator (Kucherenko et al. 2020): one motion for one speech, from sound and words, as speech comes.

    Poses and audio are standardised vectors.

    Args:
        config: sizes, weights and schedule.
        pose: D, numbers of a pose.
        audio: A, numbers of a frame of speech.
        text: width of the store's word vectors; 0: it has ids of subwords.

    Raises:
        InputError: no pose, no speech.
    """

    arrays = ("pose", "audio", "text")
    optional_arrays = ("text",)
    dimensions = ("pose", "audio", "text")
    Config = GesticulatorConfig
    config: GesticulatorConfig

    def __init__(self, config: GesticulatorConfig, *, pose: int, audio: int, text: int = 0) -> None:
        super().__init__()
        if min(pose, audio) < 1:
            raise InputError(f"a Gesticulator from {audio} numbers of speech to {pose} of a pose", "both are positive")
        self.config, self.pose, self.audio = config, pose, audio
        self.embedding = word_embedding(text, config.word_width)
        self.rows, self.length = audio + self.embedding.width, config.history + 1 + config.look_ahead
        drop = nn.Dropout(config.dropout)
        self.entry, self.timing = nn.Linear(self.rows, 2 * config.speech, bias=False), nn.Linear(TIMING, 2 * config.speech)
        self.frame = nn.Sequential(nn.Tanh(), drop, nn.Linear(2 * config.speech, config.speech), nn.Tanh(), drop)
        self.stretch = nn.Sequential(
            nn.Linear(self.length * config.speech, config.context), nn.Tanh(), drop,
            nn.Linear(config.context, config.hidden), nn.Tanh(), drop,
        )  # fmt: skip
        self.film = nn.Sequential(nn.Linear(config.poses * pose, 2 * config.hidden), nn.Tanh(), nn.Dropout(config.pose_dropout))
        self.out = nn.Sequential(nn.Linear(config.hidden, pose), nn.Tanh(), drop, nn.Linear(pose, pose))
        for value in self.film.parameters():
            nn.init.zeros_(value)  # authors' code: α = β = 0

    @property
    def window(self) -> int:
        """Frames of a training window: history, trained frames, look-ahead."""
        return self.config.history + self.config.frames + self.config.look_ahead

    def enter(self, rows: Tensor, last: Tensor | None = None) -> Tensor:
        """The first layer without timing, which is the same in any stretch: (B, T, A + W) → (B, T, 2 · speech + 2).

        For ``last`` see `mark_words`, whose marks are the last two numbers.
        """
        return torch.cat([self.entry(rows), mark_words(rows[..., self.audio :], last)], -1)

    def hear(self, frames: Tensor) -> Tensor:
        """h: (…, K, 2 · speech + 2) stretches of `enter`, of K frames around a pose's own, → (…, hidden)."""
        codes, marks = frames.split([2 * self.config.speech, 2], -1)
        features: Tensor = self.stretch(self.frame(codes + self.timing(word_timing(marks))).flatten(-2))
        return features

    def move(self, features: Tensor, before: Tensor | None) -> Tensor:
        """(B, hidden) and the poses before, (B, 3 · D), the last one first, → (B, D); None: none is fed back."""
        if before is not None:
            gain, shift = self.film(before).chunk(2, -1)
            features = features * (1 + gain) + shift
        pose: Tensor = self.out(features)
        return pose

    def forward(self, rows: Tensor, before: Tensor | None, feedback: Mapping[int, Tensor] | None = None) -> Tensor:
        """All frames between history and look-ahead.

        Args:
            rows: (B, history + F + look-ahead, A + W) of speech and words.
            before: (B, 3 · D) the poses before the first that is made, the last one first; None: no pose is fed back.
            feedback: frame, counted from the first that is made, → (B, 3 · D) poses to feed back after it, in place of its own.

        Returns:
            (B, F, D).
        """
        features, poses = self._hear_all(rows), list[Tensor]()
        if before is None:
            return self.move(features, None)
        for t in range(features.shape[1]):
            poses.append(self.move(features[:, t], before))
            own = torch.cat([poses[-1], before[:, : -self.pose]], 1)
            before = own if feedback is None else feedback.get(t, own)
        return torch.stack(poses, 1)

    def _hear_all(self, rows: Tensor) -> Tensor:
        """(B, F, hidden) of all stretches: with gradients all at once, without them one by one."""
        stretches = frame_windows(self.enter(rows), self.length)
        if torch.is_grad_enabled():
            return self.hear(stretches)
        return torch.stack([self.hear(stretches[:, t]) for t in range(stretches.shape[1])], 1)

    # what is optimised -----------------------------------------------------------------------------------------------

    def objectives(self) -> dict[str, Objective]:
        """One."""
        return {"gestures": Objective(self.parameters(), self.loss)}

    def loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """L of the module's docstring; in training by the schedule of ``step``, else with its own poses alone."""
        c, pose = self.config, batch["pose"]
        rows = torch.cat([batch["audio"], self.embedding(batch["text"])], -1)
        forcing = c.forcing_at(step) if self.training else 0
        blank = pose.new_zeros(len(pose), c.poses * self.pose)
        poses = self(rows, None if forcing is None else blank, self._choose_poses(pose, forcing) if forcing else None)
        true = pose[:, c.history : c.history + c.frames]
        return {
            "pose": (poses - true).square().mean(),
            "velocity": c.velocity * (poses.diff(dim=1) - true.diff(dim=1)).square().mean(),
        }

    def _choose_poses(self, pose: Tensor, every: int) -> dict[int, Tensor]:
        """Recorded poses to feed back: after two of ``every`` frames, counted from the window's first, as authors' code."""
        tau = self.config.history
        times = [t for t in range(tau, tau + self.config.frames) if t % every < 2]
        return {t - tau: self._poses_up_to(pose, t + 1) for t in times}

    def _poses_up_to(self, pose: Tensor, end: int) -> Tensor:
        """(B, 3 · D) the last poses before a frame, the last one first."""
        return pose[:, end - self.config.poses : end].flip(1).flatten(1)

    # generation ------------------------------------------------------------------------------------------------------

    @torch.no_grad()
    def play(self, arrays: Mapping[str, Tensor], lacks: Collection[str] = (), noise: Tensor | None = None) -> dict[str, Tensor]:
        """Poses for the arrays of a batch, of any length.

        Args:
            arrays: ``audio``, ``text``, and ``pose``, of which the frames of the history are used.
            lacks: inputs that are left out; words are then zeros, and the motion begins with the mean pose.
            noise: not used.

        Returns:
            ``pose``: (B, T, D), standardised; the poses of the history are the given ones. Speech before and after the window
            is taken as the mean.

        Raises:
            InputError: there is no such input.
        """
        for name in lacks:
            if name not in INPUTS:
                raise InputError(f"no input is called {name!r}", nearest(name, INPUTS))
        tau, words = self.config.history, self.embedding(arrays["text"])
        rows = torch.cat([arrays["audio"], torch.zeros_like(words) if "text" in lacks else words], -1)
        rows = nn.functional.pad(rows, (0, 0, 0, self.config.look_ahead))
        history = torch.zeros_like(arrays["pose"][:, :tau]) if "seed" in lacks else arrays["pose"][:, :tau]
        return {"pose": torch.cat([history, self(rows, self._poses_up_to(history, tau))], 1)}

    def export_module(self) -> dict[str, ExportGraph]:
        """``live``: a frame of speech and words (1, A + W) → the pose that lies ``look_ahead`` frames before it."""
        width = 2 * self.config.speech + 2
        states = {"heard": self.length * width, "word": self.rows - self.audio, "before": self.config.poses * self.pose}
        rows, poses = {"rows": (1, self.rows)}, {"poses": (1, self.pose)}
        return {"live": ExportGraph(_Frame(self), rows, poses, states, look_ahead=self.config.look_ahead)}


class _Frame(nn.Module):
    """``live``; states: the last frames of speech, the oldest first; the last word; the last poses, the last one first."""

    def __init__(self, net: Gesticulator) -> None:
        super().__init__()
        self.net = net

    def forward(self, rows: Tensor, speech: Tensor, word: Tensor, before: Tensor) -> tuple[Tensor, ...]:
        net = self.net
        frame = net.enter(rows.unsqueeze(1), word.unsqueeze(1))
        width = frame.shape[2]
        speech = torch.cat([speech[:, width:], frame.flatten(1)], 1)
        pose = net.move(net.hear(speech.unflatten(1, (net.length, width))), before)
        return pose, speech, rows[:, net.audio :], torch.cat([pose, before[:, : -net.pose]], 1)
