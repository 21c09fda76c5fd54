"""Speech → numbers per frame: log-mel spectra, energy, pitch, voicing, onsets, pauses. NumPy only."""

from .frames import AUDIO_NAMES, FrameFeatures, audio_features, frame_delay
from .log_mel import LOG_MEL_NAMES, LogMelFeatures, log_mel_400
from .mel import log_mel
from .prosody import Features, ProsodyStream, analyse, find_pauses
from .reduce import REDUCTIONS, audio_width, open_features, reduce_audio

__all__ = [
    "AUDIO_NAMES",
    "LOG_MEL_NAMES",
    "REDUCTIONS",
    "Features",
    "FrameFeatures",
    "LogMelFeatures",
    "ProsodyStream",
    "analyse",
    "audio_features",
    "audio_width",
    "find_pauses",
    "frame_delay",
    "log_mel",
    "log_mel_400",
    "open_features",
    "reduce_audio",
]
