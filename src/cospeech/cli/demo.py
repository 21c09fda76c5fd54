"""The demonstration: the example speech that ships with the package, in every format."""

from __future__ import annotations

from importlib.util import find_spec
from os import PathLike
from pathlib import Path

from ..errors import InputError
from ..export import FORMATS
from ..files import describe_os_error
from ..generate import Progress, generate_files
from ..runtime.report import Report

__all__ = ["EXAMPLE", "EXAMPLE_WORDS", "make_demo"]

EXAMPLE = Path(__file__).parents[1] / "assets" / "example" / "example.ogg"
"""A speech of some seconds, spoken by a synthetic voice and ours to ship."""

EXAMPLE_WORDS = EXAMPLE.with_suffix(".TextGrid")
"""Its words and their times."""

VIDEO_SIZE = (540, 540)  # ours: drawn in half the time of the usual 720, so that the demonstration stays short
SUFFIXES = tuple(suffix for suffix in FORMATS.ours if suffix not in (".gif", ".html"))
"""Formats of the demonstration. No .gif: the video shows the same. No .html: its viewer needs `make studio` first."""


def make_demo(folder: str | PathLike[str], *, progress: Progress | None = None) -> Report:
    """Generate motion for the example speech into ``folder``, which is made if it is missing.

    Without PyAV (extra ``av``) the video is left out.

    Raises:
        InputError: the folder cannot be made or written.
    """
    place = Path(folder)
    try:
        place.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot make the folder {str(place)!r}: {describe_os_error(error)}", "name another one") from None
    suffixes = [suffix for suffix in SUFFIXES if not (module := FORMATS[suffix].needs) or find_spec(module)]
    return generate_files(
        EXAMPLE,
        [place / f"talk{suffix}" for suffix in suffixes],
        transcript=EXAMPLE_WORDS,
        report=place / "report.json",
        special={".mp4": {"size": VIDEO_SIZE}},
        progress=progress,
    )
