"""The table of models: one row for each, with all facts about it. Other modules read the rows.

This module imports nothing large: to list models, neither a network nor torch is needed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from ..export.plugins import Registry, check_row

__all__ = ["ENTRIES", "MODELS", "NETWORKS", "ModelEntry"]


_ALL = ("words", "face", "emotion")


@dataclass(frozen=True)
class ModelEntry:
    """A row of the table of models."""

    where: str
    """``module:Class``."""
    what: str
    """One line of description."""
    paper: str = ""
    """The paper; empty for our own models."""
    plays: bool = True
    """Whether it makes motion for speech, under this name: ``--model NAME``, ``cospeech.load(NAME)``."""
    trains: bool = True
    """Whether it is a network that a recipe trains; else the class is called with ``mouth=`` and is a `Model` at once."""
    needs: tuple[str, ...] = ()
    """Data that clips must have to train it, beside poses and sound: words, face, emotion."""
    weights: str = ""
    """Path of the bundle with its weights, for models of other packages; ours lie in `cospeech.models.SHIPPED`."""

    def __post_init__(self) -> None:
        check_row(self, ("where", "what", "paper", "weights"), {"needs": _ALL})


_OURS = {
    "rules": ModelEntry(
        "cospeech.rules:RuleBasedModel",
        "The rule-based model: face, body and hands from speech, without training",
        trains=False,
    ),
    "stylised-flow": ModelEntry(
        "cospeech.models.stylised_flow:StylisedFlow",
        "The stylised flow (Ye et al. 2022): many motions for one speech, in the style of an example",
        "Ye et al. 2022",
    ),
    "stylised-flow-extended": ModelEntry(
        "cospeech.models.stylised_flow_extended:StylisedFlowExtended",
        "The stylised flow with our additions, as the weights that ship: quicker to learn, with style codes",
        "Ye et al. 2022", plays=False,
    ),
    "moglow": ModelEntry(
        "cospeech.models.moglow:MoGlow",
        "MoGlow (Henter et al. 2020): many motions for one speech, with controls for height, speed and reach of the hands",
        "Henter et al. 2020",
    ),
    "mix-stage": ModelEntry(
        "cospeech.models.mix_stage:MixStage",
        "Mix-StAGE (Ahuja et al. 2020): one motion for one speech, in the style of a speaker or of a mixture of them",
        "Ahuja et al. 2020",
    ),
    "mix-stage-extended": ModelEntry(
        "cospeech.models.mix_stage_extended:MixStageExtended",
        "Mix-StAGE with our additions, as the weights that ship: it learns to move in few steps",
        "Ahuja et al. 2020", plays=False,
    ),
    "stage": ModelEntry(
        "cospeech.models.stage:Stage",
        "StAGE (Ahuja et al. 2020): Mix-StAGE with a single generator; one motion for one speech, in the style of a speaker",
        "Ahuja et al. 2020",
    ),
    "cmix-gan": ModelEntry(
        "cospeech.models.cmix_gan:CMixGan",
        "CMix-GAN (Ahuja et al. 2020): one motion for one speech, of one speaker",
        "Ahuja et al. 2020",
    ),
    "speech2gesture": ModelEntry(
        "cospeech.models.speech2gesture:Speech2Gesture",
        "Speech2Gesture (Ginosar et al. 2019): one motion for one speech, of one speaker",
        "Ginosar et al. 2019",
    ),
    "munit": ModelEntry(
        "cospeech.models.munit:Munit",
        "MUNIT between speech and poses (Huang et al. 2018; Ahuja et al. 2020): style transfer from speaker to speaker",
        "Huang et al. 2018; Ahuja et al. 2020",
    ),
    "chain-of-generation": ModelEntry(
        "cospeech.models.chain_of_generation:ChainOfGeneration",
        "Chain of Generation (Xu et al. 2024): estimates speaker and emotion, then generates face, body and hands",
        "Xu et al. 2024", needs=_ALL,
    ),
    "chain-of-generation-extended": ModelEntry(
        "cospeech.models.chain_of_generation_extended:ChainOfGenerationExtended",
        "Chain of Generation with our additions, as the weights that ship: takes differ, inputs may be missing or given",
        "Xu et al. 2024", plays=False, needs=_ALL,
    ),
    "speech-to-face": ModelEntry(
        "cospeech.models.speech_to_face:SpeechToFace",
        "Speech to face: the face alone, learnt from real speakers; it also makes the mouth of all other models",
    ),
    "camn": ModelEntry(
        "cospeech.models.camn:Camn",
        "CaMN (Liu et al. 2022): body, then hands, from sound, words, emotion and a given face",
        "Liu et al. 2022", needs=_ALL,
    ),
    "multi-context": ModelEntry(
        "cospeech.models.multi_context:MultiContext",
        "Multi-context (Yoon et al. 2020, in BEAT's form): one motion for one speech, from sound, words and speaker",
        "Yoon et al. 2020; Liu et al. 2022", needs=("words",),
    ),
    "talkshow": ModelEntry(
        "cospeech.models.talkshow:TalkShow",
        "TalkSHOW (Yi et al. 2023): many motions for one speech, drawn from a prior over codes of body and hands; and a face",
        "Yi et al. 2023", needs=("face",),
    ),
    "gesturediffuclip": ModelEntry(
        "cospeech.models.gesturediffuclip:GestureDiffuClip",
        "GestureDiffuCLIP-like (after Ao et al. 2023): motion by diffusion, in the style of a label or example; no CLIP",
        "Ao et al. 2023", needs=("words", "emotion"),
    ),
    "joint-embedding": ModelEntry(
        "cospeech.models.joint_embedding:JointEmbedding",
        "Joint embedding (Ahuja and Morency 2019; Yoon et al. 2020): one motion for one speech, from the waveform and words",
        "Ahuja and Morency 2019; Yoon et al. 2020", needs=("words",),
    ),
    "trimodal": ModelEntry(
        "cospeech.models.trimodal:Trimodal",
        "Trimodal context (Yoon et al. 2020): one motion for one speech, from the waveform, words and speaker",
        "Yoon et al. 2020", needs=("words",),
    ),
    "speech2affective-gestures": ModelEntry(
        "cospeech.models.speech2affective_gestures:Speech2AffectiveGestures",
        "Speech2AffectiveGestures (Bhattacharya et al. 2021): trimodal context with an encoder of affect on the pose graph",
        "Bhattacharya et al. 2021", needs=("words",),
    ),
    "chain-of-generation-live": ModelEntry(
        "cospeech.models.chain_live:ChainLive",
        "Chain of Generation, frame by frame: the streaming network of chain-of-generation",
        "Xu et al. 2024", plays=False, needs=_ALL,
    ),
    "speech-classifier": ModelEntry(
        "cospeech.models.speech_classifier:SpeechClassifier",
        "Classifier of the speaker and of eight emotions in speech: the first stage of Chain of Generation",
        "Xu et al. 2024", plays=False, needs=("emotion",),
    ),
    "seq2seq": ModelEntry(
        "cospeech.models.seq2seq:Seq2Seq",
        "Seq2seq (Yoon et al. 2019): one motion for the words of a speech",
        "Yoon et al. 2019", needs=("words",),
    ),
    "gesticulator": ModelEntry(
        "cospeech.models.gesticulator:Gesticulator",
        "Gesticulator (Kucherenko et al. 2020): one motion for one speech, from sound and words, each pose of those before it",
        "Kucherenko et al. 2020", needs=("words",),
    ),
    "audio2gestures": ModelEntry(
        "cospeech.models.audio2gestures:Audio2Gestures",
        "Audio2Gestures (Li et al. 2021): many motions for one speech, by a code that it shares with them and one of their own",
        "Li et al. 2021",
    ),
    "gesture-autoencoder": ModelEntry(
        "cospeech.models.gesture_autoencoder:GestureAutoencoder",
        "Feature network of the gesture perceptual loss (Ye et al. 2022)",
        "Ye et al. 2022", plays=False,
    ),
    "fgd-autoencoder": ModelEntry(
        "cospeech.models.gesture_autoencoder:FgdAutoencoder",
        "Feature network of the Fréchet gesture distance (Yoon et al. 2020)",
        "Yoon et al. 2020", plays=False,
    ),
    "speaker-classifier": ModelEntry(
        "cospeech.models.speaker_classifier:SpeakerClassifier",
        "Classifier of the speaker from movement: the network of the inception score (Ahuja et al. 2020)",
        "Ahuja et al. 2020", plays=False,
    ),
}  # fmt: skip
ENTRIES: Registry[ModelEntry] = Registry(_OURS, group="cospeech.models", kind=ModelEntry)
"""Name → row, those of other packages too."""


class _Selection(Mapping[str, str]):
    """Name → ``module:Class`` of the entries that meet a condition."""

    def __init__(self, has: Callable[[ModelEntry], bool]) -> None:
        self._has = has

    def __getitem__(self, name: str) -> str:
        entry = ENTRIES[name]
        if not self._has(entry):
            raise KeyError(name)
        return entry.where

    def __iter__(self) -> Iterator[str]:
        return (name for name in ENTRIES if self._has(ENTRIES[name]))

    def __len__(self) -> int:
        return sum(1 for _ in self)


MODELS: Mapping[str, str] = _Selection(lambda entry: entry.plays)
"""Name → ``module:Class`` of models that play; `cospeech list models`, the documentation and the tests iterate over it."""

NETWORKS: Mapping[str, str] = _Selection(lambda entry: entry.trains)
"""Name → ``module:Class`` of networks that recipes train: those of systems, and those with features for losses and metrics."""
