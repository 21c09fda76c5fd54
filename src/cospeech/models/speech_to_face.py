"""Speech to face: mouth, jaw and head from the sound alone, learnt from tracked faces of people who talk.

    (B, T, A) log mel │ speaker ─► conv 1 ─►[conv k, dilated ─► LeakyReLU ─► conv 1, added] × n ─► conv 1 ─► (B, T, D) ŷ

Convolutions are asymmetric: a frame sees ``ahead`` frames after it, and more frames before it, so that a stream plays what the
whole would give. As in the face decoders of gesture systems, they are temporal convolutions on features of speech, without a
discriminator. A style is the face of one of the speakers of the data, in the units of its tracker.

Minimised, in standard deviations of each number of each speaker; y is the tracked face with left and right averaged:

    min  E w ((1 − ρ) |ŷ₊ − y| + ρ (ŷ₊ − y)² / 2) + λ E w |Δŷ₊ − Δy| + ν E_s w max(0, γ − sd(min(ŷ₊, q)) / sd(y))

Δ is the step from one frame to the next. ŷ₊: weights below 0 count as 0. The last mean is over speakers and numbers; sd(y)
is over all data of a speaker, sd(ŷ₊) over the batch, and q the 0.999 quantile of y. Distance alone leads to the median, which
is 0 for a lip that is mostly still; the lip then never moves. The gradient of the last term is
(ŷ₊ − mean) / sd: it makes the largest movements larger, however small they are, so that standing still is no optimum.
Comparing with the batch's own y would not do: most batches have no frame in which a rare channel moves.

Speech is changed in every step, since the data has few speakers: louder or softer, brighter or darker, of a longer or shorter
vocal tract, in noise, through a telephone, and with pauses in which nobody speaks and the face rests.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import log
from typing import Any, ClassVar

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from ..audio.features.mel import FLOOR
from ..errors import InputError
from ..motion.poses.face import FACE, MIRROR
from ..motion.skeletons.arkit import ARKIT, ARKIT_INDEX
from .nn.configuration import ModelConfig
from .nn.objective import Batch, Objective, StepRandom
from .nn.settings import check_least
from .nn.windowed import Windowed

__all__ = ["SpeechToFace", "SpeechToFaceConfig"]

SLOPE = 0.1  # of LeakyReLU; ours
BELOW = 0.02  # [ours] share by which a weight below 0 counts, so that it keeps a gradient
CALM = log(FLOOR)  # log power of a band in silence
COLOUR = 6.0  # natural log of power by which noise is softer at one end of the axis than in the middle, at most; ours
CLOSED, OPEN = 0.03, 0.06  # [ours] jawOpen of closed and of open lips: on GRID 97 % of b, p and m fall below the first
NEAR = 9  # [ours] frames to both sides among which lips open again, 0.15 s at 60 a second
STILL = 0.002  # [ours] standard deviation of a number that counts as still
LEAST = 0.3  # [ours] the least unit of a number of a speaker, as a share of its deviation over all speakers
TURN = 0.25  # [ours] w of the rotation of the head, which the sound hardly tells
HIGH, LOW = (0.3, 1.0), (-1.0, -0.75)  # [ours] ends of a band limit on the axis −1 … 1: 2.7 to 8 kHz, 0 to 380 Hz
STEEP = (20.0, 200.0)  # [ours] natural log of power per unit of that axis beyond an end: 4 to 43 dB per band of forty
RAMP = 9  # frames over which a face comes to rest in a pause; ours, 0.15 s at 60 a second


@dataclass(frozen=True)
class SpeechToFaceConfig(ModelConfig):
    """Sizes and losses; all ours."""

    TINY: ClassVar[Mapping[str, Any]] = {"frames": 34, "channels": 8, "dilations": (1, 2), "ahead": (2, 1)}

    frames: int = 160
    """T of a training window."""
    channels: int = 128
    """Of every convolution."""
    kernel: int = 5
    """Frames that a block's convolution sees, so many dilations apart."""
    dilations: tuple[int, ...] = (1, 2, 4)
    """Of each block."""
    ahead: tuple[int, ...] = (2, 2, 2)
    """Taps of each block's kernel that lie after the frame; times their dilations 14 frames, 233 ms at 60 a second."""
    velocity: float = 1.0
    """λ."""
    squared: float = 0.5
    """ρ, 0 … 1: the share of the squared distance, which leads to the mean in place of the median."""
    spread: float = 0.5
    """ν."""
    goal: float = 0.65
    """γ."""
    closure: float = 3.0
    """Extra weight of jawOpen in frames in which the tracked lips close between open ones, as for b, p and m."""
    jaw: float = 8.0
    """w of jawOpen; of the other numbers 1."""
    gain_augmentation: float = 3.0
    """Largest change of loudness, in natural log of power: 13 dB."""
    tilt: float = 1.0
    """Largest tilt of the spectrum, at either end, in natural log of power."""
    tract: float = 0.15
    """Largest stretch of the mel axis, as a share."""
    noise: float = 0.4
    """Share of windows with noise, at its loudest 17 to 60 dB below their loudest band."""
    band_limits: float = 0.3
    """Share of windows whose speech and noise are limited to a band, as by a telephone or a low rate of samples."""
    pauses: float = 0.3
    """Share of windows with a pause, in which there is silence or only the noise; a fifth of them are pauses throughout."""

    def __post_init__(self) -> None:
        low = {"frames": self.past + self.future + 2, "channels": 1, "kernel": 1}
        losses = ("velocity", "squared", "spread", "goal", "closure", "jaw")
        changes = ("gain_augmentation", "tilt", "tract", "noise", "band_limits", "pauses")
        check_least(self, "a SpeechToFace", low | dict.fromkeys((*losses, *changes), 0))
        if not self.dilations or len(self.dilations) != len(self.ahead) or min(self.dilations) < 1:
            raise InputError(f"dilations {self.dilations}, ahead {self.ahead}", "as many of both, dilations positive")
        if min(self.ahead) < 0 or max(self.ahead) >= self.kernel:
            raise InputError(f"ahead {self.ahead} of a kernel of {self.kernel}", "0 … kernel − 1")

    @property
    def future(self) -> int:
        """Frames after its own that a frame hears."""
        return sum(d * a for d, a in zip(self.dilations, self.ahead, strict=False))

    @property
    def past(self) -> int:
        """Frames before its own that a frame hears."""
        return (self.kernel - 1) * sum(self.dilations) - self.future


class Block(nn.Module):
    """A dilated, asymmetric convolution over frames and a mixing of channels; the input is added."""

    def __init__(self, config: SpeechToFaceConfig, dilation: int, ahead: int) -> None:
        super().__init__()
        self.pads = ((config.kernel - 1 - ahead) * dilation, ahead * dilation)
        self.over_time = nn.Conv1d(config.channels, config.channels, config.kernel, dilation=dilation)
        self.mix = nn.Conv1d(config.channels, config.channels, 1)

    def forward(self, x: Tensor) -> Tensor:
        """(B, channels, T) → the same shape."""
        out: Tensor = x + self.mix(F.leaky_relu(self.over_time(F.pad(x, self.pads)), SLOPE))
        return out


class SpeechToFace(Windowed):
    """Speech to face: mouth, jaw and head, learnt from real speakers; the mouth of every other model, too.

    Its style is that of one of the speakers of the data, or between them.

    Poses and audio are standardised vectors, by the statistics that `set_statistics` takes before training begins.

    Args:
        config: sizes.
        pose: D, numbers of a pose; in the representation "face" left and right are averaged.
        audio: A, log mel powers.
        speakers: S.
    """

    dimensions = ("pose", "audio", "speakers")
    Config = SpeechToFaceConfig
    config: SpeechToFaceConfig
    literal = True
    smooth = 0  # velocity was learnt
    wants_quantiles = True
    pose_mean: Tensor
    pose_std: Tensor
    audio_mean: Tensor
    audio_std: Tensor
    alive: Tensor
    pose_quantiles: Tensor
    units: Tensor

    def __init__(self, config: SpeechToFaceConfig, *, pose: int, audio: int, speakers: int) -> None:
        super().__init__()
        if min(pose, audio, speakers) < 1:
            raise InputError(
                f"a SpeechToFace from {audio} numbers of speech to {pose}, {speakers} speakers", "all are positive"
            )
        self.config, self.pose, self.audio, self.styles, self.modes = config, pose, audio, speakers, 0
        self.multiple = self.shortest = 1
        self.first = nn.Conv1d(audio + speakers, config.channels, 1)
        pairs = zip(config.dilations, config.ahead, strict=True)
        self.blocks = nn.ModuleList(Block(config, dilation, ahead) for dilation, ahead in pairs)
        self.out = nn.Conv1d(config.channels, speakers * pose, 1)
        for name, width in (("pose", pose), ("audio", audio)):
            self.register_buffer(f"{name}_mean", torch.zeros(width))
            self.register_buffer(f"{name}_std", torch.ones(width))
        self.register_buffer("alive", torch.ones(pose))
        self.register_buffer("pose_quantiles", torch.zeros(speakers, 2, pose), persistent=False)
        self.register_buffer("units", torch.ones(speakers, pose), persistent=False)

    def set_statistics(self, statistics: Mapping[str, Tensor]) -> None:
        """Take the statistics of poses and audio. A number that is 0 throughout the data stays 0."""
        for name in ("pose_mean", "pose_std", "audio_mean", "audio_std"):
            getattr(self, name).copy_(statistics[name])
        self.alive.copy_((self.pose_mean != 0).float())
        self.pose_quantiles = self._symmetrise(statistics["pose_quantiles"].to(self.pose_mean))
        self.units = torch.maximum(self.pose_quantiles.std(1), LEAST * self.pose_std)

    def speaker_styles(self, stretches: Tensor) -> Tensor:
        """(S, n, T, D) → (S, S): each speaker alone."""
        return torch.eye(self.styles, device=stretches.device)

    def make(self, audio: Tensor, style: Tensor, mode_noise: Tensor) -> Tensor:
        """(B, T, A), (B, T, S) speakers' weights → (B, T, D)."""
        x = F.leaky_relu(self.first(torch.cat([audio, style], 2).mT), SLOPE)
        for block in self.blocks:
            x = block(x)
        heads = self.out(x).mT.unflatten(2, (self.styles, self.pose))
        poses: Tensor = (heads * style[..., None]).sum(2) * self.alive
        return poses

    # what is optimised ----------------------------------------------------------------------------------------------

    def objectives(self) -> dict[str, Objective]:
        """One."""
        return {"face": Objective([*self.parameters()], self.loss)}

    def loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """Distance of weights, of their velocity and of their distribution, over frames whose speech lies in the window."""
        audio, face, rest = self._augment(
            batch["audio"], self._symmetrise(batch["pose"] * self.pose_std + self.pose_mean), batch.chance
        )
        style = F.one_hot(batch["speaker"], self.styles).to(audio)[:, None].expand(-1, audio.shape[1], -1)
        output = self.make(audio, style, audio.new_zeros(*audio.shape[:2], 0)) * self.pose_std + self.pose_mean
        rows = slice(self.config.past, audio.shape[1] - self.config.future)
        units = self.units[batch["speaker"]][:, None]
        output, face = self._clip_weights(output[:, rows]) / units, face[:, rows] / units
        shares, square_share = self._shares(output), self.config.squared
        off = output - face
        off = (1 - square_share) * off.abs() + square_share * off.square() / 2
        return {
            "distance": (off * shares).mean() + self.config.closure * self._at_closures(off, face * units, shares),
            "velocity": self.config.velocity * ((output.diff(dim=1) - face.diff(dim=1)).abs() * shares).mean(),
            "spread": self.config.spread * self._short_of_spread(output, batch["speaker"], rest[:, rows], shares),
        }

    def _short_of_spread(self, output: Tensor, speaker: Tensor, rest: Tensor, shares: Tensor) -> Tensor:
        """Mean over speakers of how far standard deviations are below the share `goal` of the tracked ones."""
        terms = []
        for number, quantiles in enumerate(self.pose_quantiles / self.units[:, None]):
            own = output[(speaker == number)[:, None] & (rest == 0)]
            if len(own):
                target, moves = quantiles.std(0), self.pose_quantiles[number].std(0) > STILL
                spread = (torch.minimum(own, quantiles[-2]).var(0) + 1e-8).sqrt()
                terms.append((F.relu(self.config.goal - spread / target.clamp_min(1e-6)) * moves * shares).mean())
        return torch.stack(terms).mean() if terms else output.new_zeros(())

    def _at_closures(self, off: Tensor, face: Tensor, shares: Tensor) -> Tensor:
        """Mean of jawOpen's distance, only of frames in which the tracked lips are closed between open ones."""
        if not self._weights:
            return off.new_zeros(())
        jaw = ARKIT_INDEX["jawOpen"]
        open_ = face[..., jaw]
        around = F.max_pool1d(open_[:, None], 2 * NEAR + 1, 1, NEAR)[:, 0]
        return (off[..., jaw] * ((open_ < CLOSED) & (around > OPEN))).mean() * shares[jaw] / len(shares)

    @property
    def _weights(self) -> int:
        """How many of the numbers, the first ones, are weights of a face."""
        return len(ARKIT) if self.pose == FACE.dimensions else 0

    def _clip_weights(self, face: Tensor) -> Tensor:
        """ŷ₊: weights below 0 are scaled by `BELOW`, since they are shown as 0."""
        weights, turn = face[..., : self._weights], face[..., self._weights :]
        return torch.cat([torch.where(weights < 0, BELOW * weights, weights), turn], -1)

    def _shares(self, like: Tensor) -> Tensor:
        """(D,) w; a number that is 0 in all of the data has none."""
        shares = self.alive.to(like).clone()
        if self._weights:
            shares[ARKIT_INDEX["jawOpen"]] = self.config.jaw
            shares[self._weights :] = TURN
        return shares

    def _symmetrise(self, face: Tensor) -> Tensor:
        """Weights with left and right replaced by their mean; the rotation of the head as it is."""
        other = face[..., MIRROR] if self._weights else face
        even = (face + other) / 2
        return torch.cat([even[..., : self._weights], face[..., self._weights :]], -1)

    # augmentation of speech -----------------------------------------------------------------------------------------

    def _augment(self, audio: Tensor, face: Tensor, chance: StepRandom) -> tuple[Tensor, Tensor, Tensor]:
        """Speech as another voice in another place, (B, T, A) standardised; the face, which rests in the pauses that are added;
        the share of rest, (B, T)."""
        rows, bands = len(audio), self.audio
        axis = torch.linspace(-1, 1, bands, device=audio.device)
        mel = _stretch(audio * self.audio_std + self.audio_mean, 1 + self.config.tract * _even(chance, rows))
        mel = (
            mel + (self.config.gain_augmentation * _even(chance, rows) + self.config.tilt * _even(chance, rows) * axis)[:, None]
        )
        below = 4 + 10 * chance.uniform(rows, 1)  # natural log of power under the loudest band
        slope = COLOUR * _even(chance, rows)
        level = mel.amax((1, 2))[:, None] - below - slope.abs() + slope * axis
        level = torch.where(chance.uniform(rows, 1) < self.config.noise, level, 2 * CALM)  # far below all speech
        u, v = (1 - chance.uniform(rows, *audio.shape[1:]) for _ in range(2))
        hiss = level[:, None] + (1e-6 - (u.log() + v.log()) / 2).log()  # power of four degrees of freedom
        still = _pauses(chance, rows, audio.shape[1], self.config.pauses)
        mel = torch.logaddexp(torch.where(still[..., None] > 0, CALM, mel), hiss)
        mel = (mel - _band_limits(chance, rows, axis, self.config.band_limits)[:, None]).clamp_min(CALM)
        rest = F.avg_pool1d(still[:, None], RAMP, 1, RAMP // 2, count_include_pad=False)[:, 0, :, None]
        return (mel - self.audio_mean) / self.audio_std, face * (1 - rest), rest[..., 0]


def _even(chance: StepRandom, rows: int) -> Tensor:
    """(rows, 1) of −1 … 1."""
    return 2 * chance.uniform(rows, 1) - 1


def _stretch(mel: Tensor, factors: Tensor) -> Tensor:
    """(B, T, A) with the axis of bands stretched by factors (B, 1): linear between bands, the ends held."""
    last = mel.shape[2] - 1
    at = (torch.arange(last + 1, device=mel.device) * factors).clamp(0, last)
    low = at.long()
    high = (low + 1).clamp_max(last)
    a, b = (torch.gather(mel, 2, index[:, None].expand_as(mel)) for index in (low, high))
    return a + (at - low)[:, None] * (b - a)


def _band_limits(chance: StepRandom, rows: int, axis: Tensor, share: float) -> Tensor:
    """(rows, A) natural log of power by which each band is softer; 0 in most rows."""
    which, *draws, steep = (chance.uniform(rows, 1) for _ in range(4))
    high, low = (begin + (end - begin) * draw for (begin, end), draw in zip((HIGH, LOW), draws, strict=True))
    fall = STEEP[0] * (STEEP[1] / STEEP[0]) ** steep
    return (which < share) * fall * (F.relu(axis - high) + F.relu(low - axis))


def _pauses(chance: StepRandom, rows: int, frames: int, share: float) -> Tensor:
    """(rows, frames) 1 in an added pause, else 0."""
    which, length, start = (chance.uniform(rows, 1) for _ in range(3))
    size = frames * (0.2 + 0.5 * length)
    first = start * (frames - size)
    at = torch.arange(frames, device=which.device)
    within = (at >= first) & (at < first + size)
    return ((which < 0.2 * share) | ((which < share) & within)).float()
