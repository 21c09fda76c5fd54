"""Speech → numbers per frame: log-mel spectra, energy, pitch, voicing, onsets, pauses. NumPy only."""

from .frames import AUDIO_NAMES, FrameFeatures, audio_features, frame_delay
from .mel import log_mel
from .prosody import Features, ProsodyStream, analyse, find_pauses
from .reduce import REDUCTIONS, audio_width, reduce_audio

__all__ = [
    "AUDIO_NAMES",
    "REDUCTIONS",
    "Features",
    "FrameFeatures",
    "ProsodyStream",
    "analyse",
    "audio_features",
    "audio_width",
    "find_pauses",
    "frame_delay",
    "log_mel",
    "reduce_audio",
]
