"""wav2vec 2.0 (Baevski et al. 2020) as the speech encoder of networks here: its CNN is frozen, its transformer trained on.

The CNN's features, 49.95 a second, are brought to the rate of the motion before the transformer sees them. At 15 frames a
second that costs a third. It also lets a store keep the features: they never change, so they are computed once. It needs
``transformers`` and a folder with the weights, or their name on Hugging Face's hub, such as ``facebook/wav2vec2-base-960h``.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from textwrap import shorten
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F

from ...audio.features.at_16_khz import At16kHz
from ...audio.features.mel import RATE
from ...errors import InputError, describe_extra
from ...motion.rotations import Array

if TYPE_CHECKING:
    from ...audio.speech import Speech

__all__ = ["Wav2VecCnn", "Wav2VecTransformer", "load_cnn", "load_transformer"]

_TINY = 1e-7  # as transformers' Wav2Vec2FeatureExtractor has it: silence stays 0
_PIECE = 500  # features; ours: ten seconds at a time, 60 MB in the first layer
_MASK_EMBEDDING = "masked_spec_embed"  # replaces masked features; nothing is masked here
_LARGEST = 65504.0  # of float16
_TIMEOUT = 10.0  # seconds until the hub must have answered; ours
_HINT = "a folder with config.json and model.safetensors, or a name such as facebook/wav2vec2-base-960h"


class Wav2VecCnn(nn.Module):
    """The features of raw sound, frozen.

    Args:
        encoder: transformers' ``Wav2Vec2FeatureEncoder``.
    """

    layers: Any

    def __init__(self, encoder: Any) -> None:
        super().__init__()
        self.layers = encoder.conv_layers
        self.width = int(encoder.conv_layers[-1].conv.out_channels)
        """Numbers of a feature; 512."""
        self.stride, self.field = 1, 1
        """Samples from one feature to the next, 320, and samples of which each feature is made, 400."""
        for layer in encoder.conv_layers:
            self.field += (layer.conv.kernel_size[0] - 1) * self.stride
            self.stride *= layer.conv.stride[0]
        self.requires_grad_(False).eval()

    def train(self, mode: bool = True) -> Wav2VecCnn:
        """It stays as it is."""
        return super().train(False)

    @torch.no_grad()
    def forward(self, samples: Tensor, frames: int) -> Tensor:
        """(B, n) at 16 kHz → (B, frames, width): a window's features stretched over its frames, the ends on the ends.

        As in the same authors' published code: 36266 samples, 34 frames at 15 a second, give 113 features, then 34.
        """
        return F.interpolate(self.hear(samples), size=frames, mode="linear", align_corners=True).mT

    @torch.no_grad()
    def frame_features(self, speech: Speech, frames: int, fps: float) -> Array:
        """(frames, width) float16 of a whole speech, at the times of its frames: linear between the features about them.

        A feature has the time of the middle of its samples. So long speech stays in step; `forward` would stretch it by up to a
        frame.
        """
        resampler = At16kHz()
        samples = np.concatenate([resampler.push(speech), resampler.finish()])
        features = self.hear(torch.from_numpy(samples)[None])[0].T.numpy()
        at = (np.arange(frames) * (RATE / fps) - (self.field - 1) / 2) / self.stride
        at = np.clip(at, 0, len(features) - 1)
        low = at.astype(int)
        high = np.minimum(low + 1, len(features) - 1)
        rows = features[low] + (features[high] - features[low]) * (at - low)[:, None]
        return np.clip(rows, -_LARGEST, _LARGEST).astype(np.float16)

    @torch.no_grad()
    def hear(self, samples: Tensor) -> Tensor:
        """(B, n) at 16 kHz → (B, width, K) features of speech of mean 0 and deviation 1, in little memory however long."""
        x = F.pad(samples.float(), (0, max(0, self.field - samples.shape[1])))
        mean, std = x.mean(1, keepdim=True), (x.var(1, correction=0, keepdim=True) + _TINY).sqrt()
        x = ((x - mean) / std)[:, None]
        count = (x.shape[-1] - self.field) // self.stride + 1
        scale = self._scale(x)
        pieces = []
        for first in range(0, count, _PIECE):
            last = min(first + _PIECE, count) - 1
            pieces.append(self._run(x[..., first * self.stride : last * self.stride + self.field], scale))
        return torch.cat(pieces, -1)

    def _scale(self, x: Tensor) -> tuple[Tensor, Tensor] | None:
        """(B, C, 1) mean and deviation over all outputs of the first layer, if that layer has a norm over time."""
        conv, norm = self.layers[0].conv, getattr(self.layers[0], "layer_norm", None)
        if not isinstance(norm, nn.GroupNorm):
            return None
        kernel, stride = conv.kernel_size[0], conv.stride[0]
        count, step = (x.shape[-1] - kernel) // stride + 1, _PIECE * self.stride // stride
        total = square = torch.zeros(len(x), norm.num_channels, 1, dtype=torch.float64, device=x.device)
        for first in range(0, count, step):
            last = min(first + step, count) - 1
            y = conv(x[..., first * stride : last * stride + kernel]).double()
            total, square = total + y.sum(-1, keepdim=True), square + y.square().sum(-1, keepdim=True)
        mean = total / count
        std = ((square / count - mean.square()).clamp_min(0) + norm.eps).sqrt()
        return mean.to(x), std.to(x)

    def _run(self, x: Tensor, scale: tuple[Tensor, Tensor] | None) -> Tensor:
        """All layers; the first one's norm by the moments that are given."""
        if scale is not None:
            first = self.layers[0]
            x = (first.conv(x) - scale[0]) / scale[1]
            x = first.activation(x * first.layer_norm.weight[:, None] + first.layer_norm.bias[:, None])
        for layer in self.layers[scale is not None :]:
            x = layer(x)
        return x


class Wav2VecTransformer(nn.Module):
    """(B, T, inputs) features of the CNN → (B, T, outputs): its projection and its transformer, to be trained on.

    Args:
        model: transformers' ``Wav2Vec2Model``. It neither masks features nor skips layers: we draw all randomness of a step.
    """

    def __init__(self, model: Any) -> None:
        super().__init__()
        self.projection, self.encoder = model.feature_projection, model.encoder
        self.inputs, self.outputs = int(model.config.conv_dim[-1]), int(model.config.hidden_size)
        self.encoder.config.layerdrop = 0.0

    def forward(self, features: Tensor) -> Tensor:
        states, _ = self.projection(features)
        out: Tensor = self.encoder(states).last_hidden_state
        return out


@lru_cache(1)
def load_cnn(name: str) -> Wav2VecCnn:
    """The CNN of a pretrained wav2vec 2.0.

    Args:
        name: a folder, or a name on Hugging Face's hub.

    Raises:
        InputError: it cannot be loaded, or transformers is missing.
    """
    return Wav2VecCnn(_load_wav2vec(name).feature_extractor)


def load_transformer(name: str) -> Wav2VecTransformer:
    """The rest of a pretrained wav2vec 2.0.

    Args:
        name: a folder, or a name on Hugging Face's hub.

    Raises:
        InputError: it cannot be loaded, or transformers is missing.
    """
    return Wav2VecTransformer(_load_wav2vec(name))


def _load_wav2vec(name: str) -> Any:
    """transformers' ``Wav2Vec2Model`` with all of its weights."""
    try:
        import transformers  # noqa: F401  # is it there?
    except ImportError:
        raise InputError("wav2vec 2.0 needs transformers", describe_extra("wav2vec")) from None
    try:
        with _quiet():
            try:
                model, info = _read_wav2vec(name, local=True)
            except OSError:  # it is no folder, and not all of it is in the hub's cache
                if Path(name).is_dir():
                    raise
                _check_hub(name)
                model, info = _read_wav2vec(name, local=False)
    except InputError:
        raise
    except Exception as error:  # whatever transformers, its hub and its readers raise
        raise InputError(f"cannot load wav2vec 2.0 from {name!r}: {shorten(str(error), 160)}", _HINT) from None
    missing = [key for key in (*info["missing_keys"], *info["mismatched_keys"]) if key != _MASK_EMBEDDING]
    if missing:
        raise InputError(f"{name!r} has not all weights of wav2vec 2.0: {missing[0]} is missing", _HINT)
    return model.float()


def _read_wav2vec(name: str, *, local: bool) -> tuple[Any, dict[str, Any]]:
    """transformers' ``Wav2Vec2Model``, and its report on the weights; ``local``: without asking the hub."""
    from transformers import AutoConfig

    config = AutoConfig.from_pretrained(name, local_files_only=local)
    if config.model_type != "wav2vec2" or config.add_adapter:
        raise InputError(f"{name!r} is a {config.model_type} model", "only wav2vec2 without an adapter is supported")
    from transformers import Wav2Vec2Model  # takes seconds: not before it is known that there is something to read

    pair: Any = Wav2Vec2Model.from_pretrained(name, config=config, output_loading_info=True, local_files_only=local)
    model, info = pair
    return model, info


def _check_hub(name: str) -> None:
    """Ask the hub once for a model: transformers would ask six times, and wait 23 s in between.

    Raises:
        InputError: the hub has none of that name, or does not answer.
    """
    from huggingface_hub import model_info
    from huggingface_hub.errors import HFValidationError, RepositoryNotFoundError

    problem = f"cannot load wav2vec 2.0 from {name!r}: it is no folder"
    try:
        model_info(name, timeout=_TIMEOUT)
    except (HFValidationError, RepositoryNotFoundError):
        raise InputError(f"{problem}, and no model on Hugging Face's hub", _HINT) from None
    except Exception:  # of whatever library the hub's client uses for HTTP
        raise InputError(f"{problem}, not downloaded yet, and Hugging Face's hub cannot be reached", _HINT) from None


@contextmanager
def _quiet() -> Iterator[None]:
    """Silence transformers: no messages, no progress bars."""
    from transformers.utils import logging

    level, bars = logging.get_verbosity(), logging.is_progress_bar_enabled()
    logging.set_verbosity_error()
    logging.disable_progress_bar()
    try:
        yield
    finally:
        logging.set_verbosity(level)
        if bars:
            logging.enable_progress_bar()
