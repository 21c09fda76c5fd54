"""The frame rate of an FBX: a number for each common rate, or the rate itself."""

__all__ = ["find_mode", "rate_of"]

_NTSC = 1000 / 1001
_RATES = (  # frames per second of FBX's numbers of rates
    30, 120, 100, 60, 50, 48, 30, 30, 30 * _NTSC, 30 * _NTSC, 25, 24, 1000, 24 * _NTSC, 0, 96, 72, 60 * _NTSC, 120 * _NTSC,
)  # fmt: skip
_OWN = 14
"""This number says that the rate itself is given."""
_READ_ALONE = (0, 7, 8, 12, _OWN)
"""Numbers that we do not write: a default without a name, rates whose names leave out frames, and 1000."""
_CLOSE = 1e-3  # frames per second; ours


def find_mode(fps: float) -> tuple[int, float]:
    """FBX's number of a frame rate, and the rate where it has none."""
    for mode, rate in enumerate(_RATES):
        if mode not in _READ_ALONE and abs(fps - rate) < _CLOSE:
            return mode, -1.0
    return _OWN, float(fps)


def rate_of(mode: int, own: float) -> float:
    """Frames per second of FBX's number of a rate; ``own`` is the rate itself, if the file has it. 0 for an unknown number."""
    if mode == _OWN:
        return own
    return _RATES[mode] if 0 <= mode < len(_RATES) else 0.0
