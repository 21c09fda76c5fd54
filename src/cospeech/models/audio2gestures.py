"""Audio2Gestures: Li et al. 2021, "Audio2Gestures: Generating Diverse Gestures from Speech Audio with Conditional Variational
Autoencoders": one speech goes with many motions, so a motion has two codes, one that it shares with its speech, one of its own.

    speech a ─► TCN ─────────────────► S_a  (16 numbers of a frame) ─┐
    motion m ─► TCN ─┬───────────────► S_m  ─────────────────────────┼─► TCN ─► MLP ─► motion
                     └───────────────► I_m  ─────────────────────────┤
    N(μ(I_m), σ(I_m)) ─► mapping net ► R    ─────────────────────────┘

    m̂ = D(S_m, I_m)     m' = D(S_a, I_m)     m* = D(S_a, R)     S*, I* codes of m*; all codes are drawn, normally distributed

Minimised, with θ angles of joints, p their places, Δ from one frame to the next, [·]_ρ the mean of values larger than ρ:

    L = Σ_{x ∈ m̂, m'} (E θ(x, m) + E |p(x) − p(m)| + E |Δp(x) − Δp(m)|)               as recorded
      + E θ(m*, m) + [|p(m*) − p(m)|]_ρ + 5 E |Δp(m*) − Δp(m)|                         near it: relaxed
      + 0.1 E |S_a − S_m| + 0.1 (E |I* − R| + E |S* − S_m|) − λ_d E |p(m*) − p(m')|    shared code, cycle, diversity
      + λ_k Σ KL(S_a, S_m, I_m, R ‖ N(0, 1))

Followed, changed, not said in the paper: docs/models/audio2gestures.md, by number.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, ClassVar, NamedTuple

import torch
from torch import Tensor, nn

from ..errors import InputError
from .nn.bones import bones_of, rotation_angle
from .nn.configuration import SMALL_CONVOLUTIONS, ModelConfig
from .nn.norm import BatchNorm1d
from .nn.objective import Batch, Objective, StepRandom
from .nn.settings import check_least
from .nn.windowed import Windowed

__all__ = ["Audio2Gestures", "Audio2GesturesConfig", "Gaussian"]

AUDIO, MOTION, DECODER = (4, 4, 3, 3, 2), (8, 8, 4, 4, 2), (2, 4, 4, 8, 8)
"""Channels of each block of the three TCNs, in eighths of `channels`; authors' code 128, 128, 96, 96, 64 and so on."""
ROUND = 100_000  # steps in which the weight of KL rises from 0 to 1, before it starts from 0 again; authors' code
COARSE = 10  # steps for which that weight stays the same; authors' code
LEAST = 1e-4  # its least; authors' code


@dataclass(frozen=True)
class Audio2GesturesConfig(ModelConfig):
    """Sizes and weights; the defaults are those of the authors' code."""

    TINY: ClassVar[Mapping[str, Any]] = {"channels": 32, "code": 4, "frames": 20}
    SMALL: ClassVar[Mapping[str, Any]] = {"channels": 64, "code": 8}
    SMALL_TRAIN: ClassVar[Mapping[str, Any]] = SMALL_CONVOLUTIONS

    frames: int = 64
    """T of a training window; authors' code 64, at 30 per second."""
    channels: int = 256
    """Of the widest blocks; authors' code 256."""
    code: int = 16
    """Numbers of each code of a frame; authors' code 16."""
    dropout: float = 0.0
    """In the blocks; authors' code 0."""
    rotation: float = 1.0
    """Weight of the angles of m̂ and m'; authors' code 1."""
    position: float = 1.0
    """Of their places; authors' code 1."""
    speed: float = 1.0
    """Of their speeds; authors' code 1."""
    relaxed_rotation: float = 1.0
    """Of the angles of m*; authors' code 1."""
    relaxed_position: float = 1.0
    """Of its places; authors' code 1."""
    relaxed_speed: float = 5.0
    """Of its speeds; authors' code 5."""
    tolerance: float = 0.02
    """ρ, metres by which places of m* may be off; authors' code 0.02."""
    shared: float = 0.1
    """Of the distance of the shared codes; authors' code 0.1."""
    cycle: float = 0.1
    """Of the distance of codes from those of m*; authors' code 0.1."""
    diversity: float = 0.1
    """λ_d at the first step; authors' code 0.1."""
    diversity_steps: int = 500_000
    """In which λ_d sinks to 0; authors' code 500,000."""
    divergence: float = 1e-3
    """Of KL; authors' code 0.001."""

    def __post_init__(self) -> None:
        low = {name: 0 for name in ("dropout", "rotation", "position", "speed", "tolerance", "shared", "cycle", "diversity")}
        low |= {name: 0 for name in ("relaxed_rotation", "relaxed_position", "relaxed_speed", "divergence")}
        check_least(self, "an Audio2Gestures", low | {"frames": 2, "channels": 8, "code": 1, "diversity_steps": 1})
        if self.channels % 8 or not self.dropout < 1:
            problem = f"an Audio2Gestures of {self.channels} channels, dropout {self.dropout}"
            raise InputError(problem, "a multiple of 8; a share below 1")


# parts ---------------------------------------------------------------------------------------------------------------


class _Block(nn.Module):
    """Two dilated convolutions, each with ReLU and dropout, and a skip: (B, inputs, T) → (B, outputs, T)."""

    def __init__(self, inputs: int, outputs: int, dilation: int, dropout: float) -> None:
        super().__init__()
        first, second = (nn.Conv1d(width, outputs, 3, padding=dilation, dilation=dilation) for width in (inputs, outputs))
        for layer in (first, second):
            nn.init.kaiming_normal_(layer.weight)  # ours: with authors' deviation of 0.01 speech is hardly heard at first
        drop = nn.Dropout(dropout)
        self.path = nn.Sequential(first, nn.ReLU(), drop, second, nn.ReLU(), drop)
        self.skip = nn.Conv1d(inputs, outputs, 1) if inputs != outputs else nn.Identity()

    def forward(self, x: Tensor) -> Tensor:
        return torch.relu(self.path(x) + self.skip(x))


def _make_tcn(inputs: int, eighths: Sequence[int], config: Audio2GesturesConfig) -> nn.Sequential:
    """Blocks whose dilation doubles from one to the next."""
    widths = [inputs, *(n * config.channels // 8 for n in eighths)]
    return nn.Sequential(*(_Block(a, b, 2**k, config.dropout) for k, (a, b) in enumerate(pairwise(widths))))


class Gaussian(NamedTuple):
    """Normal codes of every frame."""

    mean: Tensor
    variance: Tensor
    """log σ²; (B, code, T) each."""

    def sample(self, chance: StepRandom) -> Tensor:
        """One of them, (B, code, T)."""
        return self.mean + (self.variance / 2).exp() * chance.normal(*self.mean.shape)

    def divergence(self) -> Tensor:
        """KL from N(0, 1), summed over the frames and averaged over the rest, as authors' code."""
        return (self.variance.exp() + self.mean.square() - self.variance - 1).sum(2).mean() / 2


class _Code(nn.Module):
    """Features (B, inputs, T) → normal codes."""

    def __init__(self, inputs: int, hidden: int, code: int) -> None:
        super().__init__()
        self.mean, self.variance = (
            nn.Sequential(nn.Conv1d(inputs, hidden, 1), nn.ReLU(), nn.Conv1d(hidden, code, 1)) for _ in range(2)
        )

    def forward(self, x: Tensor) -> Gaussian:
        return Gaussian(self.mean(x), self.variance(x))


class _Bodies(NamedTuple):
    """Motion as losses compare it."""

    turns: Tensor | None
    """(B, T, K, 3, 3) rotations of joints; None where poses are no rotations."""
    places: Tensor
    """(B, T, …) places of joints in metres, or the poses themselves."""


# the model -----------------------------------------------------------------------------------------------------------


class Audio2Gestures(Windowed):
    """Audio2Gestures (Li et al. 2021): many motions for one speech, of the sound alone.

    Poses and audio are standardised vectors.

    Args:
        config: sizes and weights.
        pose: D, numbers of a pose.
        audio: A, numbers of a frame of speech.
        representation: of the poses, a name of `cospeech.motion.poses.POSES`. For Euler angles and rotations in
            six numbers losses compare angles and places of joints; for others, as in authors' code for points, the poses.

    Raises:
        InputError: no pose, no speech.
    """

    dimensions = ("pose", "audio", "representation")
    Config = Audio2GesturesConfig
    normal_noise = True
    config: Audio2GesturesConfig
    pose_mean: Tensor
    pose_std: Tensor

    def __init__(self, config: Audio2GesturesConfig, *, pose: int, audio: int, representation: str = "") -> None:
        super().__init__()
        if min(pose, audio) < 1:
            raise InputError(f"an Audio2Gestures from {audio} numbers of speech to {pose} of a pose", "both are positive")
        self.config, self.pose, self.audio, self.modes = config, pose, audio, config.code
        self.multiple = self.shortest = 1
        last, half, code = config.channels // 4, config.channels // 8, config.code
        self.hear, self.hear_shared = _make_tcn(audio, AUDIO, config), _Code(last, half, code)
        self.watch = _make_tcn(pose, MOTION, config)
        self.watch_shared, self.watch_own = (nn.Sequential(nn.Conv1d(last, half, 1), _Code(half, half, code)) for _ in range(2))
        self.map = nn.Sequential(
            nn.Conv1d(code, code, 3, padding=1), nn.ReLU(), nn.Conv1d(code, code, 3, padding=1), nn.ReLU(),
            nn.Conv1d(code, code, 3, padding=1), _Code(code, code, code),
        )  # fmt: skip
        self.decoder = nn.Sequential(
            _make_tcn(2 * code, DECODER, config), nn.Conv1d(config.channels, config.channels, 1), nn.ReLU(),
            nn.Conv1d(config.channels, pose, 1),
        )  # fmt: skip
        self.own = BatchNorm1d(code, affine=False)  # running mean and deviation of I_m in training
        self.bones = bones_of(representation)
        self.register_buffer("pose_mean", torch.zeros(pose))
        self.register_buffer("pose_std", torch.ones(pose))

    def set_statistics(self, statistics: Mapping[str, Tensor]) -> None:
        """Take the statistics by which poses are standardised, since places of joints are in metres."""
        self.pose_mean.copy_(statistics["pose_mean"])
        self.pose_std.copy_(statistics["pose_std"])

    def encode(self, poses: Tensor) -> tuple[Gaussian, Gaussian]:
        """S_m and I_m: (B, D, T) → codes."""
        features = self.watch(poses)
        return self.watch_shared(features), self.watch_own(features)

    def decode(self, shared_code: Tensor, own_code: Tensor) -> Tensor:
        """D: two codes (B, code, T) → (B, D, T)."""
        poses: Tensor = self.decoder(torch.cat([shared_code, own_code], 1))
        return poses

    def make(self, audio: Tensor, style: Tensor, mode_noise: Tensor) -> Tensor:
        """(B, T, A), noise (B, T, code) → (B, T, D); there is no style. Codes are means of their distributions."""
        assert self.own.running_mean is not None
        assert self.own.running_var is not None
        own = self.own.running_mean[:, None] + self.own.running_var.sqrt()[:, None] * mode_noise.mT
        return self.decode(self.hear_shared(self.hear(audio.mT)).mean, self.map(own).mean).mT

    # what is optimised -----------------------------------------------------------------------------------------------

    def objectives(self) -> dict[str, Objective]:
        """One."""
        return {"gestures": Objective(self.parameters(), self.loss)}

    def loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """L of the module's docstring."""
        c, poses, chance = self.config, batch["pose"].mT, batch.chance
        speech_code, (motion_code, own_code) = self.hear_shared(self.hear(batch["audio"].mT)), self.encode(poses)
        s_a, s_m, i_m = speech_code.sample(chance), motion_code.sample(chance), own_code.sample(chance)
        with torch.no_grad():
            self.own(i_m)
            mean, spread = i_m.mean(2, keepdim=True), i_m.std(2, keepdim=True)
        noise_code = self.map(mean + spread * chance.normal(*i_m.shape))
        r, codes = noise_code.sample(chance), (speech_code, motion_code, own_code, noise_code)
        motion = self.decode(torch.cat([s_m, s_a, s_a]), torch.cat([i_m, i_m, r]))
        true, *bodies = self._as_bodies(torch.cat([poses, motion]).mT)
        s_x, i_x = (code.sample(chance) for code in self.encode(motion[-len(poses) :]))
        terms = self._compare("motion", bodies[0], true) | self._compare("audio", bodies[1], true)
        terms |= self._compare_loosely(bodies[2], true)
        terms |= {
            "shared": c.shared * (s_a - s_m).abs().mean(),
            "cycle": c.cycle * ((i_x - r).abs().mean() + (s_x - s_m).abs().mean()),
            "divergence": self._divergence_weight(step) * torch.stack([x.divergence() for x in codes]).sum(),
        }
        fading = max(0.0, 1 - step / c.diversity_steps)
        return terms | {"diversity": -c.diversity * fading * (bodies[2].places - bodies[1].places.detach()).abs().mean()}

    def _divergence_weight(self, step: int) -> float:
        return self.config.divergence * max(LEAST, step % ROUND // COARSE * COARSE / ROUND)

    def _as_bodies(self, poses: Tensor) -> list[_Bodies]:
        """(4 B, T, D) standardised poses: of a recording, m̂, m' and m*; as rotations and places of each."""
        if self.bones is None:
            return [_Bodies(None, places) for places in poses.chunk(4)]
        turns = self.bones.rotations(poses * self.pose_std + self.pose_mean)
        return [_Bodies(*pair) for pair in zip(turns.chunk(4), self.bones.places(turns).chunk(4), strict=True)]

    def _compare(self, name: str, motion: _Bodies, true: _Bodies) -> dict[str, Tensor]:
        """Terms of motion that should be as recorded."""
        c = self.config
        return self._compare_angles(f"{name}_rotation", motion, true, c.rotation) | {
            f"{name}_position": c.position * (motion.places - true.places).abs().mean(),
            f"{name}_speed": c.speed * _speed_distance(motion, true),
        }

    def _compare_loosely(self, motion: _Bodies, true: _Bodies) -> dict[str, Tensor]:
        """Terms of motion that may differ from the recorded one: only places that are off by more than ρ count."""
        c, off = self.config, (motion.places - true.places).abs().flatten(1)
        counts = (off > c.tolerance).to(off)
        position = ((off * counts).sum(1) / counts.sum(1).clamp_min(1)).mean()
        return self._compare_angles("relaxed_rotation", motion, true, c.relaxed_rotation) | {
            "relaxed_position": c.relaxed_position * position,
            "relaxed_speed": c.relaxed_speed * _speed_distance(motion, true),
        }

    @staticmethod
    def _compare_angles(name: str, motion: _Bodies, true: _Bodies, weight: float) -> dict[str, Tensor]:
        """Mean angle between rotations, where there are some."""
        if motion.turns is None or true.turns is None:
            return {}
        return {name: weight * rotation_angle(motion.turns, true.turns).mean()}


def _speed_distance(motion: _Bodies, true: _Bodies) -> Tensor:
    return (motion.places.diff(dim=1) - true.places.diff(dim=1)).abs().mean()
