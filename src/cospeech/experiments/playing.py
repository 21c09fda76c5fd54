"""Playing: trained networks generate batches of windows, frame by frame or whole windows at once: arrays in, arrays out.

Tables and figures use it, because they need hundreds of windows at once. For users, `cospeech.runtime` generates.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from ..errors import InputError
from ..models.chain_of_generation import ChainOfGeneration
from ..models.nn.windowed import Windowed
from ..motion.rotations import Array

__all__ = ["codes", "context_of", "frame_likelihoods", "perform", "play", "play_inputs", "recognise", "styles_of", "threads"]

BATCH = 512  # windows at a time; ours
LABELS = ("face", "emotion", "speaker")
"""What a Chain of Generation estimates from the speech where it is not given."""


@contextmanager
def threads(count: int) -> Iterator[None]:
    """Within it, PyTorch uses ``count`` threads on the CPU; 0: as many as it likes."""
    before = torch.get_num_threads()
    torch.set_num_threads(count or before)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def context_of(net: nn.Module) -> tuple[int, int]:
    """(τ, l): how many poses before a frame, and how many frames of speech after it, a network needs.

    Raises:
        InputError: the network does not make poses frame by frame.
    """
    config: Any = getattr(net, "config", None)
    try:
        return int(config.history), int(config.look_ahead)
    except AttributeError:
        raise InputError(f"{type(net).__name__} does not generate frame by frame", "a flow does") from None


def _tensor(x: Array, device: torch.device) -> Tensor:
    return torch.from_numpy(np.ascontiguousarray(x, np.float32)).to(device)


def _numbers(x: Array, device: torch.device) -> Tensor:
    """As `_tensor`; whole numbers as int64."""
    return _tensor(x, device) if x.dtype.kind == "f" else torch.from_numpy(np.ascontiguousarray(x, np.int64)).to(device)


def perform(net: Any, history: Array, audio: Array, *, seed: int = 0, latents: Array | None = None) -> Array:
    """Generate poses that follow given ones.

    Args:
        net: with ``sample`` and ``flow.latent``, such as `cospeech.models.stylised_flow.StylisedFlow`.
        history: (B, τ, D), standardised.
        audio: (B, τ + F + l, A), standardised.
        seed: of random latents; the same seed gives the same poses, whatever the size of the batches.
        latents: (B, F, D); None: random ones, multiplied by the network's ``latent_scale``.

    Returns:
        (B, F, D) float32, standardised.

    Raises:
        InputError: no frame is left to make, or the poses are not finite.
    """
    tau, ahead = context_of(net)
    frames = audio.shape[1] - tau - ahead
    if frames < 1 or history.shape[1] != tau:
        raise InputError(
            f"{history.shape[1]} poses and {audio.shape[1]} frames of speech", f"{tau} and more than {tau + ahead}"
        )
    device = next(net.parameters()).device
    if latents is None:
        generator = torch.Generator().manual_seed(seed)
        draws = net.flow.latent.sample(lambda *shape: torch.randn(*shape, generator=generator), len(history), frames)
        draws = draws * float(getattr(net.config, "latent_scale", 1.0))
    else:
        draws = _tensor(latents, torch.device("cpu"))
    parts = [slice(k, k + BATCH) for k in range(0, len(history), BATCH)]
    with torch.no_grad():
        batches = [net.sample(draws[p].to(device), _tensor(history[p], device), _tensor(audio[p], device)) for p in parts]
    poses = torch.cat(batches).cpu().numpy()
    if not np.isfinite(poses).all():
        raise InputError(f"{type(net).__name__} makes poses that are not finite", "train it longer, or at a lower rate")
    return poses


def codes(net: Any, pose: Array, audio: Array) -> Array:
    """(B, F, D) latents of poses under their own conditions.

    Args:
        net: with ``latents``.
        pose: (B, τ + F + l, D), standardised.
        audio: (B, τ + F + l, A), standardised.

    Raises:
        InputError: the latents are not finite.
    """
    device = next(net.parameters()).device
    parts = [slice(k, k + BATCH) for k in range(0, len(pose), BATCH)]
    with torch.no_grad():
        latents = torch.cat([net.latents(_tensor(pose[p], device), _tensor(audio[p], device)).cpu() for p in parts]).numpy()
    if not np.isfinite(latents).all():
        raise InputError(f"{type(net).__name__} has latents that are not finite", "train it longer, or at a lower rate")
    return latents


def frame_likelihoods(net: Any, arrays: Mapping[str, Array]) -> Array:
    """(B, F) exact log-likelihood of each frame after the history, in nats, of standardised poses.

    Args:
        net: with ``log_prob``.
        arrays: its inputs by name: ``pose`` and ``audio`` (B, τ + F + l, …), standardised.

    Raises:
        InputError: a likelihood is not finite.
    """
    device = next(net.parameters()).device
    parts = [slice(k, k + BATCH) for k in range(0, len(arrays["pose"]), BATCH)]
    with torch.no_grad():
        batches = [net.log_prob(**{name: _tensor(array[p], device) for name, array in arrays.items()}).cpu() for p in parts]
    likelihoods = torch.cat(batches).double().numpy()
    if not np.isfinite(likelihoods).all():
        raise InputError(f"{type(net).__name__} has likelihoods that are not finite", "train it longer, or at a lower rate")
    return likelihoods


# whole windows at once ----------------------------------------------------------------------------------------------------


def _as_window_network(net: nn.Module) -> Windowed:
    if not isinstance(net, Windowed):
        raise InputError(
            f"{type(net).__name__} does not generate by windows", "Mix-StAGE and the models that it is compared with do"
        )
    return net


def play(net: nn.Module, audio: Array, style: Array) -> Array:
    """Poses for windows of speech.

    Args:
        net: a `cospeech.models.nn.windowed.Windowed`.
        audio: (B, T, A), standardised.
        style: (styles,) of all windows, or (B, styles).

    Returns:
        (B, T, D) float32, standardised.

    Raises:
        InputError: another network, or the poses are not finite.
    """
    net = _as_window_network(net)
    device = next(net.parameters()).device
    styles = np.array(np.broadcast_to(style, (len(audio), style.shape[-1])))[:, None]
    parts = [slice(k, k + BATCH) for k in range(0, len(audio), BATCH)]
    with torch.no_grad():
        batches = [net.generate(_tensor(audio[p], device), _tensor(styles[p], device)).cpu() for p in parts]
    poses = torch.cat(batches).numpy()
    if not np.isfinite(poses).all():
        raise InputError(f"{type(net).__name__} makes poses that are not finite", "train it longer, or at a lower rate")
    return poses


def play_inputs(
    net: nn.Module, arrays: Mapping[str, Array], lacks: Collection[str] = (), noise: Array | None = None
) -> dict[str, Array]:
    """Play windows with all inputs that there are, except those in ``lacks``.

    Args:
        net: with ``play``: a network of many inputs, or a Chain of Generation, which estimates missing ones from the speech.
        arrays: of a batch: poses and audio standardised, numbers as int64, ``speaker`` (B,).
        lacks: some of text, face, emotion, speaker and seed.
        noise: (B, 1 or T, modes) for a network whose takes differ by noise; None: 0.

    Returns:
        ``pose`` (B, T, D), standardised, and, where the network makes one, ``face`` (B, T, 52).

    Raises:
        InputError: another network, or the output is not finite.
    """
    player: Any = getattr(net, "play", None)
    if player is None:
        raise InputError(
            f"{type(net).__name__} does not generate from many inputs", "Chain of Generation, CaMN and multi-context do"
        )
    options: dict[str, Any] = (
        {"given": [name for name in LABELS if name not in lacks]} if isinstance(net, ChainOfGeneration) else {}
    )
    device, count, parts = next(net.parameters()).device, len(arrays["pose"]), []
    for k in range(0, count, BATCH):
        some = {name: _numbers(array[k : k + BATCH], device) for name, array in arrays.items()}
        draws = {} if noise is None else {"noise": _tensor(noise[k : k + BATCH], device)}
        parts.append({name: output.cpu().numpy() for name, output in player(some, lacks, **options, **draws).items()})
    outputs = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    if not all(np.isfinite(output).all() for output in outputs.values()):
        raise InputError(f"{type(net).__name__} makes poses that are not finite", "train it longer, or at a lower rate")
    return outputs


def styles_of(net: nn.Module, stretches: Array) -> Array:
    """(S, n, T, D) standardised poses of the speakers → (S, styles), the style that `play` takes for each speaker.

    Raises:
        InputError: another network.
    """
    net = _as_window_network(net)
    with torch.no_grad():
        return net.speaker_styles(_tensor(stretches, next(net.parameters()).device)).cpu().numpy()


def recognise(net: Any, poses: Array) -> Array:
    """(B, T, D) standardised poses → (B, S) probability of each speaker.

    Args:
        net: with ``probabilities``, such as `cospeech.models.speaker_classifier.SpeakerClassifier`.
        poses: T ≥ 64.
    """
    device = next(net.parameters()).device
    parts = [poses[k : k + BATCH] for k in range(0, len(poses), BATCH)]
    return np.concatenate([net.probabilities(_tensor(part, device)).cpu().double().numpy() for part in parts])
