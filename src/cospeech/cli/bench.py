"""``cospeech bench``: real-time factor, latency, memory and start time, measured on repetitions of the example speech."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator

import numpy as np

from ..audio.speech import Speech
from ..errors import InputError
from ..files import scratch, workplace
from ..generate import generate_files
from ..models import DEFAULT, load
from .demo import EXAMPLE

__all__ = ["measure"]

Row = dict[str, str | float]
CHUNK = 0.2  # seconds of sound per step of the stream, as a microphone would give it
STARTS = 5  # how often the start is timed; the shortest counts, because other work on the machine only adds time


def measure(seconds: float = 60.0) -> list[Row]:
    """Rows of ``what``, ``value``, ``unit`` and ``note``.

    Args:
        seconds: of speech to measure on, 1 … 36,000.

    Raises:
        InputError: ``seconds`` is out of range.
    """
    if not 1 <= seconds <= 36_000:
        raise InputError(f"{seconds:g} seconds of speech to measure on", "1 … 36000")
    speech = _repeat(Speech.load(EXAMPLE), seconds)
    return [*_motion(speech), *_files(speech), *_stream(speech), _memory(), _start()]


def _repeat(speech: Speech, seconds: float) -> Speech:
    count = int(seconds * speech.rate)
    return Speech(np.resize(speech.samples, count), speech.rate, name="bench")


def _row(what: str, value: float, unit: str, note: str) -> Row:
    return {"what": what, "value": value, "unit": unit, "note": note}


def _motion(speech: Speech) -> Iterator[Row]:
    model = load(DEFAULT)
    model.generate(speech.window(0, 1))  # imports and tables are not what is timed here
    wall, work = time.perf_counter(), time.process_time()
    frames = len(model.generate(speech))
    wall, work = time.perf_counter() - wall, time.process_time() - work
    length = float(speech.duration)
    yield _row("motion alone, real-time factor", wall / length, "", f"{frames} frames, {length / wall:.0f} times real time")
    yield _row("motion alone, processor time", work / length, "", "seconds of all cores per second of speech")


def _files(speech: Speech) -> Iterator[Row]:
    import soundfile

    with workplace(scratch()) as folder:
        audio = folder / "speech.flac"
        soundfile.write(audio, speech.samples, speech.rate)
        for names in ([".bvh"], [".bvh", ".glb"]):
            report = generate_files(audio, [folder / f"talk{suffix}" for suffix in names])
            yield _row(
                f"file to {' + '.join(names)}", report.realtime_factor, "", "real-time factor, decoding and writing included"
            )


def _stream(speech: Speech) -> Iterator[Row]:
    """Time per chunk, and how far the motion is behind the sound."""
    steps, lags, position, mark = [], [], 0.0, time.perf_counter()

    def time_chunks() -> Iterator[Speech]:
        nonlocal position, mark
        for chunk in speech.chunks(CHUNK):
            steps.append(time.perf_counter() - mark)
            mark = time.perf_counter()
            position = chunk.start + float(chunk.duration)
            yield chunk

    for piece in load(DEFAULT).stream(time_chunks()):
        lags.append(position - piece.start)
    step_times = np.array(steps[1:]) * 1000
    for share in (50, 99):
        yield _row(
            f"stream, step of {CHUNK} s, {share} %",
            float(np.percentile(step_times, share)),
            "ms",
            "time to answer a piece of sound",
        )
    yield _row("stream, slowest step", float(step_times.max()), "ms", f"of {len(step_times)}")
    yield _row("stream, motion behind sound", max(lags), "s", "look-ahead and piece together, at the most")


def _memory() -> Row:
    try:
        import resource
    except ImportError:  # Windows
        return _row("memory, peak", float("nan"), "MB", "not known on this system")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return _row("memory, peak", peak / (1e6 if sys.platform == "darwin" else 1e3), "MB", "of this process, bench included")


def _start() -> Row:
    times = []
    for _ in range(STARTS):
        start = time.perf_counter()
        subprocess.run([sys.executable, "-m", "cospeech", "--help"], check=True, capture_output=True)
        times.append(time.perf_counter() - start)
    return _row("cospeech --help", min(times), "s", f"best of {STARTS}, worst {max(times):.2f}")
