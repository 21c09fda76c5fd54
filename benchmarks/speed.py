"""Speed and memory on this machine, as Markdown: what docs/benchmarks.md shows.

python benchmarks/speed.py              # `cospeech bench`, with the machine named
python benchmarks/speed.py --hours 3    # and a recording of so many hours: does memory grow?
python benchmarks/speed.py --film 11    # the processor time of `generate` to .mp4 for so many seconds of speech, alone
python benchmarks/speed.py --film 11 --camera face --avatar my.vrm    # the same with `render` as a second step
"""

from __future__ import annotations

import argparse
import os
import platform
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import soundfile

from cospeech.cli.bench import measure
from cospeech.cli.demo import EXAMPLE
from cospeech.generate import generate_files
from cospeech.motion.motion import Motion
from cospeech.motion.rotations import quat_normalize
from cospeech.motion.skeleton import find_skeleton


def machine() -> str:
    """Processor, cores, system and Python, in words."""
    name = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        models = [
            line.split(":")[1].strip()
            for line in info.read_text(encoding="utf-8").splitlines()
            if line.startswith("model name")
        ]
        name = models[0] if models else name
    return f"{name}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}, NumPy {np.__version__}"


def resident() -> float:
    """Memory of this process now, in MB (Linux)."""
    for line in Path("/proc/self/status").read_text(encoding="utf-8").splitlines():
        if line.startswith("VmRSS"):
            return int(line.split()[1]) / 1000
    raise SystemExit("the memory of a process can only be read on Linux here")


def long_speech(path: Path, hours: float) -> None:
    """The example said over and over, written in blocks."""
    samples, rate = soundfile.read(EXAMPLE, dtype="float32")
    with soundfile.SoundFile(path, "w", rate, 1) as file:
        for _ in range(int(hours * 3600 * rate / len(samples))):
            file.write(samples)


def memory_over(hours: float) -> list[tuple[float, float]]:
    """(share of the speech done, MB) at 10 %, 50 % and the end of generating from a long recording."""
    readings: list[tuple[float, float]] = []
    marks = [0.1, 0.5, 0.999]

    def watch(position: float, total: float | None) -> None:
        if marks and total and position / total >= marks[0]:
            readings.append((marks.pop(0), resident()))

    with tempfile.TemporaryDirectory() as folder:
        audio = Path(folder) / "long.flac"
        long_speech(audio, hours)
        generate_files(audio, [Path(folder) / f"talk{suffix}" for suffix in (".bvh", ".glb", ".npz")], progress=watch)
    return readings


def file_times(suffix: str, seconds: float = 60.0) -> tuple[float, float]:
    """Processor time of writing and of reading a motion of BEAT's size (75 joints at 120 fps), in shares of real time."""
    skeleton = find_skeleton("beat")
    frames = round(seconds * 120)
    turns = quat_normalize(np.random.default_rng(0).normal(size=(frames, len(skeleton), 4)))
    motion = Motion(120.0, turns, np.zeros((frames, 3)), skeleton=skeleton)
    with tempfile.TemporaryDirectory() as folder:
        path, times = Path(folder) / f"a{suffix}", []
        for act in (motion.save, Motion.load):
            began = time.process_time()
            act(path)
            times.append((time.process_time() - began) / seconds)
    return times[0], times[1]


def film_times(seconds: float, look: list[str]) -> tuple[float, float]:
    """Seconds of processor and of waiting that an ``.mp4`` of the example's first seconds takes.

    Args:
        seconds: of speech.
        look: options of `cospeech render`, which then draws what `cospeech generate` has written; that draws, too, where empty.
    """
    samples, rate = soundfile.read(EXAMPLE, dtype="float32")
    with tempfile.TemporaryDirectory() as folder:
        audio = Path(folder) / "talk.wav"
        soundfile.write(audio, samples[: int(seconds * rate)], rate)
        before, began = os.times(), time.perf_counter()
        motion, film = str(audio.with_suffix(".npz")), str(audio.with_suffix(".mp4"))
        steps = [["generate", str(audio), "-o", motion if look else film]]
        if look:
            steps.append(["render", motion, film, "--audio", str(audio), *look])
        for step in steps:
            subprocess.run([sys.executable, "-m", "cospeech", *step], check=True, stdout=subprocess.DEVNULL)
        after, finish = os.times(), time.perf_counter()
    work = after.children_user + after.children_system - before.children_user - before.children_system
    return work, finish - began


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--hours", type=float, default=0.0)
    parser.add_argument("--film", type=float, default=0.0)
    parser.add_argument("--camera")
    parser.add_argument("--avatar")
    options = parser.parse_args()
    print(f"{machine()}, {time.strftime('%Y-%m-%d')}\n")
    if options.film:
        names = {"--camera": options.camera, "--avatar": options.avatar}
        look = [word for name, value in names.items() if value for word in (name, value)]
        work, took = film_times(options.film, look)
        print(f"{options.film:g} s of speech to .mp4: {work:.1f} s of processor time, {took:.1f} s of waiting")
        return
    print("| what | value | |\n|---|---:|---|")
    for row in measure(options.seconds):
        print(f"| {row['what']} | {row['value']:.3g} {row['unit']} | {row['note']} |")
    for suffix in (".bvh", ".npz"):
        write, read = file_times(suffix)
        print(f"| motion of BEAT's size, {suffix} | {write:.3f} | of real time to write, {read:.3f} to read |")
    if options.hours:
        began = time.perf_counter()
        readings = memory_over(options.hours)
        took = time.perf_counter() - began
        text = ", ".join(f"{megabytes:.0f} MB at {share:.0%}" for share, megabytes in readings)
        print(f"| {options.hours:g} h of speech to .bvh, .glb and .npz | {took:.0f} s | memory {text} |")


if __name__ == "__main__":
    main()
