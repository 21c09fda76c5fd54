"""The facts of a bundle, parsed once and validated as a whole; a player may then rely on every one of them.

>>> spec = read_spec(read_bundle("mine.cospeech"))                    # doctest: +SKIP
>>> spec.signatures["make"].width("poses")                            # doctest: +SKIP
57
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from ...audio.emotions import EMOTIONS
from ...audio.features.reduce import REDUCTIONS, audio_width
from ...audio.features.words import BUCKETS
from ...errors import InputError
from ...motion.poses import POSES, find_pose
from ...motion.poses.controls import CONTROLS, QUANTILES
from ...motion.rotations import Array
from ...motion.skeletons.arkit import ARKIT
from ..flow.weights import FlowSizes
from ..flow.weights import check_weights as check_flow
from .bundle import Bundle
from .graph_check import check_onnx
from .signature import Signature
from .statistics import Statistics

__all__ = ["STYLE_SPACES", "VOICE", "BundleFacts", "BundleSpec", "half", "read_spec", "unpack_half"]

STYLE_SPACES = ("none", "one-hot", "speaker-emotion", "code")
"""What a network takes for a style: nothing; weights of the speakers; these and weights of the emotions; a code of its own."""
VOICE = "voice"
"""The style that a network with a classifier hears in the voice, beside its speakers' names."""
STATISTICS, WEIGHTS, CARD = "statistics.safetensors", "weights.safetensors", "card.md"
FRAME_RATES = (1.0, 240.0)
MOST_SMOOTH = 8  # frames; ours
LARGEST = 1e6  # ours: no weight of a trained network comes near
SAMPLERS = ("hear", "prior", "denoise")
_GRAPHS = {"speech", "past", "frame"}  # of a flow; style where it has codes


@dataclass(frozen=True)
class BundleFacts:
    """The facts that every bundle states."""

    name: str
    """Of the file."""
    pose: str
    """Name of the representation of poses."""
    fps: float
    audio: str
    """Name of the reduction of audio."""
    smooth: int
    """How many frames to either side poses are averaged over, with binomial weights."""
    styles: tuple[str, ...]
    """Names of the speakers, and `VOICE` where there is a classifier."""
    style: str
    """The style that is played by default."""
    style_space: str
    """One of `STYLE_SPACES`."""
    controls: tuple[str, ...]
    """Names of the style controls (`cospeech.motion.poses.controls`) that the network takes: further columns of the speech."""
    vocabulary: Mapping[str, int] | None
    """Word → its row of ``statistics.words``; None: words are the mean of their subwords' rows."""
    card: str
    """Markdown."""
    statistics: Statistics
    rests: bool = field(default=False, kw_only=True)
    """Whether hands come to rest in silence (`cospeech.runtime.rest_in_silence`)."""
    emotion_strength: Mapping[str, float] = field(default_factory=dict, kw_only=True)
    """Emotion → how much of it the network is given where it is played, 0 … 1 (the default); the rest is neutral."""

    @property
    def speakers(self) -> tuple[str, ...]:
        """Names of the speakers alone."""
        return tuple(name for name in self.styles if name != VOICE)


@dataclass(frozen=True)
class BundleSpec(BundleFacts):
    """All that a bundle holds. It is either some networks or a flow, whose step is an engine of its own."""

    signatures: Mapping[str, Signature]
    """Network → its signature; nothing for a flow."""
    flow: FlowSizes | None
    graphs: Mapping[str, bytes]
    weights: Mapping[str, Array]


def half(weights: Mapping[str, Array]) -> dict[str, Array]:
    """Weights at half their size: all but biases become float16.

    Raises:
        InputError: some are too large for it.
    """
    with np.errstate(over="ignore"):
        small = {name: value.astype(np.float16) if value.ndim > 1 else value for name, value in weights.items()}
    _check_weights(unpack_half(small))
    return small


def read_spec(bundle: Bundle) -> BundleSpec:
    """Parse and validate a bundle.

    Raises:
        InputError: something is missing, unknown, absurd, or does not go with the rest.
    """
    try:
        return _read(bundle)
    except InputError as error:
        if repr(bundle.name) in error.problem:
            raise
        raise InputError(f"{bundle.name!r}: {error.problem}", error.hint) from error


def _read(bundle: Bundle) -> BundleSpec:
    flow, signatures = _networks(bundle)
    facts = _facts(bundle)
    statistics, weights, graphs = _statistics(bundle), unpack_half(bundle.arrays(WEIGHTS)), bundle.graphs()
    if flow is not None:
        statistics = _check_flow_statistics(flow, statistics, facts)
        check_flow(weights, flow)
        if missing := (_GRAPHS | ({"style"} if flow.style else set())) - set(graphs):
            raise InputError(f"the graph {', '.join(sorted(missing))} is missing", "is the bundle damaged?")
        widths = flow.pose, flow.audio
    else:
        statistics = _check_network_statistics(signatures, statistics, facts)
        _check_weights(weights)
        _check_graphs(graphs, signatures, weights)
        decoder = signatures.get("make") or signatures["live"]
        words = statistics.words.shape[1] if statistics.words.size else 0
        widths = decoder.width("poses"), _width(signatures, "rows") - words
    pose, audio = facts["pose"], facts["audio"]
    if find_pose(pose).dimensions != widths[0] or audio_width(audio) != widths[1] - len(facts["controls"]):
        raise InputError(
            f"{bundle.name!r}: its networks do not fit {pose[:40]!r} poses and {audio[:40]!r} audio", "is it damaged?"
        )
    return BundleSpec(**facts, statistics=statistics, signatures=signatures, flow=flow, graphs=graphs, weights=weights)


def _networks(bundle: Bundle) -> tuple[FlowSizes | None, dict[str, Signature]]:
    """The sizes of a flow, or the signatures of networks that fit together."""
    if ("flow" in bundle.manifest) == ("networks" in bundle.manifest):
        raise InputError(
            f"the manifest of {bundle.name!r} has to describe either networks or a flow", "is it of another version?"
        )
    if "flow" in bundle.manifest:
        sizes = bundle.fact("flow", dict)
        if not set(sizes) <= {f.name for f in fields(FlowSizes)}:
            raise InputError(
                f"{bundle.name!r} names sizes of a flow that this version does not know", "is it of another version?"
            )
        try:
            return FlowSizes(**sizes), {}
        except TypeError:
            raise InputError(f"{bundle.name!r} lacks sizes of its flow", "is it of another version?") from None
    signatures = {name: Signature.parse(name, value) for name, value in bundle.fact("networks", dict).items()}
    decoder = signatures.get("make") or signatures.get("live")
    if decoder is None:
        raise InputError(f"{bundle.name!r} has no network that makes motion", "it needs 'make', 'live', or both")
    live, style = signatures.get("live", decoder), signatures.get("style")
    for port in ("poses", "rows", "style", "noise"):
        if live.width(port) != decoder.width(port):
            raise InputError(
                f"port {port!r} has {decoder.width(port)} numbers in 'make' and {live.width(port)} in 'live'",
                "they must be equal",
            )
    fits_face = decoder.width("face") in (0, len(ARKIT) + 1)
    if not fits_face or decoder.width("seed") != (decoder.width("poses") + 1 if decoder.seeds else 0):
        due = f"'face' has {len(ARKIT) + 1} numbers, 'seed' one more than 'poses'"
        raise InputError("the ports 'face' and 'seed' have other sizes than a network can have", due)
    _check_sampler(signatures)
    if style is not None and (style.width("poses"), style.width("style")) != (
        decoder.width("poses"),
        _width(signatures, "style"),
    ):
        raise InputError(
            "the style encoder has other poses or styles than the network that makes motion", "is the bundle damaged?"
        )
    return None, signatures


def _width(signatures: Mapping[str, Signature], port: str) -> int:
    """Numbers of a port that the networks take which make motion; 0: none of them has it."""
    making = (signatures[name] for name in ("make", "live", *SAMPLERS) if name in signatures)
    return next((width for each in making if (width := each.width(port))), 0)


def _check_sampler(signatures: Mapping[str, Signature]) -> None:
    """Check that the networks fit together that draw latents, which `make` turns into poses.

    Raises:
        InputError: they do not, or one of them is missing.
    """
    latent = signatures["make"].width("latent") if "make" in signatures else 0
    has = [name for name in SAMPLERS if name in signatures]
    if not latent and not has:
        return
    if not latent or len(has) != 2 or "hear" not in has:
        raise InputError(f"the bundle draws motion by {', '.join(has)[:60]!r}", "it needs make, hear, and prior or denoise")
    hear, draw = signatures["hear"], signatures[has[1]]
    widths = {draw.width(port) for port in ("latent", "velocity", "before", "codes", "logits") if draw.width(port)}
    hop, ahead = signatures["make"].hop or 0, signatures["make"].look_ahead
    whole = not any(frames % hear.multiple for frames in (hop, ahead, signatures["make"].probe)) and hop > 0
    alike = {each.multiple for each in (hear, signatures["make"], draw) if each.window} == {hear.multiple}
    if widths != {latent} or draw.width("heard") != hear.width("heard") or not (whole and alike):
        raise InputError("the networks that draw motion do not fit together", "is the bundle damaged?")
    is_valid = latent % draw.groups == 0 if has[1] == "prior" else draw.steps > 0 and draw.width("level") % 2 == 0
    if not is_valid:
        raise InputError(f"the network {has[1]!r} has groups={draw.groups}, steps={draw.steps}", "is the bundle damaged?")


def _facts(bundle: Bundle) -> dict[str, Any]:
    """The facts of `BundleFacts`, without the statistics."""
    pose, audio, fps = bundle.fact("pose", str), bundle.fact("audio", str), float(bundle.fact("fps", (int, float)))
    smooth, names, style = bundle.fact("smooth", int), bundle.fact("styles", list), bundle.fact("style", str)
    if style not in names or len({str(name) for name in names}) < len(names) or not all(isinstance(n, str) for n in names):
        raise InputError(f"{bundle.name!r} has no valid list of styles, or its default is not one of them", "is it damaged?")
    if pose not in POSES or audio not in REDUCTIONS:
        raise InputError(
            f"{bundle.name!r} has unknown poses {pose[:40]!r} or audio {audio[:40]!r}", "is it of another version?"
        )
    if not (FRAME_RATES[0] <= fps <= FRAME_RATES[1] and 0 <= smooth <= MOST_SMOOTH):
        raise InputError(
            f"{bundle.name!r} has {fps} frames per second and smooth={smooth}",
            f"{FRAME_RATES[0]:g} … {FRAME_RATES[1]:g}, and 0 … {MOST_SMOOTH}",
        )
    space = bundle.fact("style_space", str)
    if space not in STYLE_SPACES:
        raise InputError(f"{bundle.name!r} has the unknown style_space {space[:40]!r}", f"one of {', '.join(STYLE_SPACES)}")
    controls = bundle.fact("controls", list) if "controls" in bundle.manifest else []
    if any(controls.count(name) > 1 or name not in CONTROLS for name in controls):
        raise InputError(
            f"{bundle.name!r} lists the style controls {str(controls)[:60]}", f"known: {', '.join(CONTROLS)}, each once"
        )
    words = bundle.fact("vocabulary", list) if "vocabulary" in bundle.manifest else None
    if words is not None and not all(isinstance(word, str) for word in words):
        raise InputError("the vocabulary holds something else than words", "is the bundle damaged?")
    rests = bundle.manifest.get("rests", False)
    if not isinstance(rests, bool):
        raise InputError(f"the manifest of {bundle.name!r} says rests={str(rests)[:40]!r}", "true or false")
    strength = bundle.manifest.get("emotion_strength", {})
    if not isinstance(strength, dict) or not all(
        name in EMOTIONS and isinstance(share, int | float) and 0 <= share <= 1 for name, share in strength.items()
    ):
        problem = f"the manifest of {bundle.name!r} says emotion_strength={str(strength)[:40]!r}"
        raise InputError(problem, f"a number of 0 … 1 for some of {', '.join(EMOTIONS)}")
    return {
        "rests": rests, "emotion_strength": strength,
        "name": bundle.name, "pose": pose, "fps": fps, "audio": audio, "smooth": smooth, "styles": tuple(names), "style": style,
        "style_space": space, "controls": tuple(controls),
        "vocabulary": None if words is None else {word: row for row, word in enumerate(words, 1)},
        "card": bundle.members.get(CARD, b"").decode("utf-8", "replace"),
    }  # fmt: skip


def _statistics(bundle: Bundle) -> Statistics:
    """The statistics by their names, not checked yet."""
    arrays = bundle.arrays(STATISTICS)
    names = {f.name for f in fields(Statistics)[:9]}
    if not names <= set(arrays) <= {f.name for f in fields(Statistics)}:
        raise InputError(f"{bundle.name!r} lacks statistics, or has unknown ones", "is it of another version?")
    return Statistics(**arrays)


def _common_shapes(pose: int, audio: int, speakers: int, controls: int) -> dict[str, tuple[int, ...]]:
    shapes: dict[str, tuple[int, ...]] = {f"pose_{what}": (pose,) for what in ("mean", "std", "low", "high")}
    shapes |= {f"audio_{what}": (audio,) for what in ("mean", "std", "low", "high")}
    return shapes | {"speaker_mean": (speakers, pose), "control_quantiles": (QUANTILES, controls)}


def _check_flow_statistics(flow: FlowSizes, s: Statistics, facts: Mapping[str, Any]) -> Statistics:
    """Statistics as a flow needs them."""
    speakers, controls = len(facts["styles"]), len(facts["controls"])
    each = max(1, len(np.atleast_1d(s.histories)) // max(speakers, 1))
    if facts["style_space"] != ("code" if flow.style else "none"):
        raise InputError(f"a flow of this size cannot have the style_space {facts['style_space']!r}", "is the bundle damaged?")
    shapes = _common_shapes(flow.pose, flow.audio - controls, speakers, controls)
    shapes |= {"histories": (speakers * each, flow.history, flow.pose), "style_codes": (speakers, flow.style)}
    shapes |= {"speaker_std": (speakers, flow.pose)}
    shapes |= dict.fromkeys(("free_mean", "free_std"), (flow.pose if s.speaker_std.size else 0,))
    s.check(shapes)
    if not s.histories.size or (flow.style and not s.style_codes.size) or (controls and not s.control_quantiles.size):
        raise InputError(
            "the statistics of the flow lack histories, style_codes or control_quantiles", "is the bundle damaged?"
        )
    if s.speaker_std.size and not (s.free_mean.size and s.free_std.size):
        raise InputError("the statistics of the flow have speaker_std, but no free_mean and free_std", "is the bundle damaged?")
    return s.complete(one_hot=False)


def _check_network_statistics(signatures: Mapping[str, Signature], s: Statistics, facts: Mapping[str, Any]) -> Statistics:
    """Statistics as networks need them; and whether styles are those of these networks."""
    decoder = signatures.get("make") or signatures["live"]
    speakers, controls, space = len([n for n in facts["styles"] if n != VOICE]), len(facts["controls"]), facts["style_space"]
    hears = VOICE in facts["styles"]
    if hears != ("classify" in signatures) or (hears and (facts["styles"][-1] != VOICE or space != "speaker-emotion")):
        raise InputError(
            f"the styles {', '.join(facts['styles'])[:60]} do not fit the networks",
            f"{VOICE!r} is the last style of a bundle with a classifier, and of no other",
        )
    emotions = len(EMOTIONS) if space == "speaker-emotion" else 0
    style_width = _width(signatures, "style")
    width = {"none": 0, "code": style_width}.get(space, speakers + emotions)
    if style_width != width or (space == "code" and not width) or not speakers:
        raise InputError(
            f"the network takes a style of {style_width} numbers",
            f"{speakers} speakers in the style_space {space!r} need {width}",
        )
    words, shapes = s.words.shape[-1] if s.words.size else 0, dict[str, tuple[int, ...]]()
    audio = _width(signatures, "rows") - words
    if hears and (signatures["classify"].width("rows"), signatures["classify"].width("logits")) != (audio - controls, width):
        raise InputError(
            "the classifier has another number of inputs or outputs than the networks need", "is the bundle damaged?"
        )
    if hears and signatures["classify"].reach is None:
        raise InputError("the signature of the classifier has no reach", "a whole number of frames")
    rows = BUCKETS if facts["vocabulary"] is None else len(facts["vocabulary"])
    shapes = _common_shapes(decoder.width("poses"), audio - controls, speakers, controls)
    shapes |= dict.fromkeys(
        ("model_mean", "style_gain", "live_model_mean", "live_style_gain"), (speakers, decoder.width("poses"))
    )
    shapes |= {"noise_gain": (2,), "words": (rows + 1, words), "style_codes": (speakers, width - emotions)}
    s.check(shapes)
    if (space == "code" and not s.style_codes.size) or (facts["vocabulary"] is not None and not words):
        raise InputError("the statistics lack style_codes, or the vectors of the vocabulary's words", "is the bundle damaged?")
    if controls and not s.control_quantiles.size:
        raise InputError("the statistics lack control_quantiles", "is the bundle damaged?")
    return s.complete(one_hot=space in ("one-hot", "speaker-emotion"))


def _check_graphs(graphs: Mapping[str, bytes], signatures: Mapping[str, Signature], weights: Mapping[str, Array]) -> None:
    """Check that there is one graph for each signature, and that the weights are those that the graphs use."""
    if set(graphs) != set(signatures):
        raise InputError(f"the bundle holds the graphs {', '.join(sorted(graphs))[:60]!r}", f"expected {', '.join(signatures)}")
    if odd := set(weights) ^ {name for graph in graphs.values() for name in check_onnx(graph)}:
        raise InputError(f"the weights {min(odd)!r} are missing, or no graph uses them"[:200], "is the bundle damaged?")


def unpack_half(weights: Mapping[str, Array]) -> dict[str, Array]:
    """Weights in float16 become float32; the others stay."""
    return {name: value.astype(np.float32) if value.dtype == np.float16 else value for name, value in weights.items()}


def _check_weights(weights: Mapping[str, Array]) -> None:
    """Refuse weights of a wrong type or value.

    Raises:
        InputError: some are not float32, not finite or absurd.
    """
    for name, value in weights.items():
        if value.dtype != np.float32:
            raise InputError(f"weights {name[:60]!r} are {value.dtype}", "expected float32")
        if not np.abs(value).max(initial=0) <= LARGEST:  # not a number fails this too
            raise InputError(
                f"weights {name[:60]!r} hold numbers that are not finite or too large", "did the training diverge?"
            )
