"""Sizes and weights of Chain of Generation (`cospeech.models.chain_of_generation`)."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["ChainConfig"]


@dataclass(frozen=True)
class ChainConfig:
    """Sizes and weights; the defaults are the paper's, or, where it is silent, those of CaMN's code, which it builds on."""

    frames: int = 34
    """N; section 4.1."""
    seeds: int = 4
    """Frames at the beginning that are given as seed poses; section 4.1. 0: there is no such input. Ours."""
    latent: int = 128
    """Of audio, text, face features and style; section 4.1."""
    hidden: int = 256
    """Of each LSTM, and of B̂; not stated, CaMN's code 256."""
    layers: int = 4
    """Of each LSTM; not stated, CaMN's code 4."""
    dropout: float = 0.3
    """Between layers of LSTMs and in the text network; not stated, CaMN's code 0.3."""
    reduction: int = 8
    """By how much channel attention narrows; not stated, ours."""
    speech_encoder: str = "own"
    """What makes Â of speech, one of models/nn/speech_encoders.py; the paper's is wav2vec."""
    encoder: str = "facebook/wav2vec2-base-960h"
    """Of the speech encoder wav2vec: a name on Hugging Face's hub, or a folder; appendix A.2."""
    word_width: int = 300
    """Numbers of a word where the network learns them; appendix A.3: 300 of fastText's."""
    text_channels: int = 256
    """Of the text network; not stated, CaMN's code 256."""
    classifier_steps: int = 2000
    """Of the first stage; not stated, ours."""
    classifier_channels: int = 128
    """Not stated, ours."""
    classifier_kernel: int = 3
    """Frames that each of its convolutions sees; not stated, ours."""
    reconstruction: float = 500.0
    """λ_Rec; section 3.4."""
    hands: float = 1.0
    """α, weight of hands beside the body; not stated, ours."""
    face: float = 1000.0
    """λ_Mse; section 3.4."""
    rhythm: float = 1.0
    """λ_Rhy; section 3.4."""
    temperature: float = 0.1
    """τ of equation 6; section 4.1."""
    word_dropout: float = 0.0
    """Share of training clips whose words are not known. Ours."""
    seed_dropout: float = 0.0
    """Share of training clips without seed poses. Ours."""
    label_conditioning: float = 0.0
    """Share of training clips whose style is of their labels, not of what the classifier says. Ours."""
    face_teacher_forcing: float = 0.0
    """Share of training clips of which TFFDec sees the recorded face. Ours."""
    gain_augmentation: float = 0.0
    """dB by which training clips are made louder or softer at most. Ours."""
    speech_swap: float = 0.0
    """Share of training clips that are played to the speech of another of their batch, in the style of their own labels: of
    what they should be like D and ``motion_statistics`` tell. Ours."""
    motion_statistics: float = 0.0
    """Weight of how far a clip's mean pose, and its deviations of pose, velocity and acceleration, are from those
    recorded. Ours."""
    noise: int = 0
    """Numbers of smooth Gumbel noise that both decoders get at every frame, by which takes differ. Ours."""
    persistence: float = 15.0
    """Frames over which the noise correlates. Ours."""
    adversarial: float = 0.0
    """Weight of what a discriminator says (models/nn/pose_discriminator.py), by least squares; 0: there is none. Ours."""
    discriminator_channels: int = 48
    """Of its first convolution. Ours."""
    attention: bool = True
    """Whether CW-Attn is in it; table 2 has rows without."""
    style_injection: bool = True
    """Whether styles are injected; table 2 has rows without."""
