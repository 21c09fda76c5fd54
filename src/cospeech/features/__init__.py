"""Speech → numbers per frame: log-mel spectra, energy, pitch, voicing, onsets, pauses. NumPy only."""

from .mel import log_mel
from .prosody import Features, ProsodyStream, analyse, find_pauses

__all__ = ["Features", "ProsodyStream", "analyse", "find_pauses", "log_mel"]
