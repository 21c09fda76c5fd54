"""Live sessions: interruptions, idling, the first push, real time.
``python benchmarks/live.py [--interrupts 200] [--idle 120] [--warm] [--pace 20] [--look-ahead 0.5]``

`--interrupts N` stops the example speech at N random moments, of each of `--models`, and says how fast joints turn against the
fastest that unloaded limbs do, how far a step from frame to frame jumps off the steps
beside it, how long the lips take to shut, and where the hands are. `--idle M` simulates M minutes in which nothing is said, and
says how often the character blinks, for how long any joint stands still, and how much its course resembles itself later.
`--warm` times pushes of 20 ms after `warm_up`. `--pace S` plays S seconds in real time, pieces of 20 ms at 60 fps, through a
`FramePacer`: how far frames leave from their even times, how long a push takes on the clock and of the processor, and how far
behind its sound a frame leaves. `--look-ahead` is that of `--warm` and `--pace`. Without an option, it does a little of each.
"""

from __future__ import annotations

import argparse
import os
import time

import numpy as np
from speed import machine

import cospeech
from cospeech.audio.speech import Speech, example
from cospeech.export.live.pacing import SHORT_MARGIN, FramePacer
from cospeech.metrics.blinks import blinks_of
from cospeech.motion.motion import Motion
from cospeech.motion.parts import PARTS
from cospeech.motion.rotations import Array, quat_angle, quat_conjugate, quat_multiply, quat_to_rotvec
from cospeech.motion.skeleton import humanoid
from cospeech.motion.skeletons.arkit import ARKIT_INDEX

MODELS = ("rules", "stylised-flow", "mix-stage", "chain-of-generation")
PIECE = 0.02  # seconds of a push
CAPS = {"Shoulder": 5, "UpperArm": 14, "LowerArm": 18, "Hand": 20, "head": 8, "neck": 8, "pine": 3, "hest": 3, "hips": 3}
"""Rad/s by the end of a joint's name, those of tests/support/rules_laws.py; of others `OTHERS`."""
OTHERS, LEGS = 25.0, 10.0
SHUT = 0.03  # jawOpen of a mouth that is shut
WATCHED = (
    "hips",
    "spine",
    "head",
    "leftEye",
    "leftUpperArm",
    "rightLowerArm",
    "leftHand",
    "rightIndexProximal",
    "leftUpperLeg",
)
FAR = 60.0  # seconds from which on a course should not resemble itself: postures are kept for some seconds


def cap(name: str) -> float:
    """Largest speed of a joint, rad/s."""
    if any(part in name for part in ("Leg", "Foot", "Toes")):
        return LEGS
    return next((float(value) for end, value in CAPS.items() if name.endswith(end)), 16.0 if "Eye" in name else OTHERS)


def jumps(rotations: Array) -> Array:
    """(T − 2, J) degrees by which a step from frame to frame differs from the step before it."""
    steps = quat_to_rotvec(quat_multiply(rotations[1:], quat_conjugate(rotations[:-1])))
    return np.degrees(np.linalg.norm(np.diff(steps, axis=0), axis=-1))  # type: ignore[no-any-return]


def interrupt(model: object, speech: Speech, at: float, seed: int) -> tuple[Motion, int]:
    """Speech up to a time, an interruption, two seconds of silence, other speech; and the first frame of the interruption."""
    live = cospeech.open_live_session(model, fps=30, seed=seed)  # type: ignore[arg-type]
    motions = [motion for piece in speech.window(0, at).chunks(PIECE) for motion in live.push(piece)]
    first = sum(map(len, motions))
    live.interrupt()
    for sound in (np.zeros(2 * speech.rate, np.float32), speech.window(3, 6).samples):
        for piece in Speech(sound, speech.rate).chunks(PIECE):
            motions += live.push(piece.samples, speech.rate)
    motions += live.finish()
    return Motion.concatenate(motions), first


def report_interrupts(name: str, count: int) -> None:
    model, speech, s = cospeech.load(name), Speech.load(example()[0]), humanoid()
    random = np.random.default_rng(0)
    eyes = [s.index["leftEye"], s.index["rightEye"]]
    caps = np.array([cap(joint) for joint in s.names])
    share, jump, usual, shut, down, sank = [], [], [], [], [], []
    for number in range(count):
        motion, first = interrupt(model, speech, random.uniform(2.2, float(speech.duration) - 0.1), number)
        q = motion.rotations.astype(float)
        window = slice(max(first - 1, 0), first + 60)
        share.append((quat_angle(q[1:], q[:-1]) * motion.fps / caps)[window].max())
        off = jumps(q)
        off[:, eyes] = 0.0  # saccades jump
        jump.append(off[max(first - 2, 0) : first + 60].max())
        usual.append(off[: max(first - 2, 1)].max())
        assert motion.face is not None
        open_ = np.flatnonzero(motion.face[first : first + 60, ARKIT_INDEX["jawOpen"]] > SHUT)
        shut.append((open_[-1] + 1) / motion.fps if len(open_) else 0.0)
        hands = motion.positions()[:, [s.index["leftHand"], s.index["rightHand"]], 1].mean(1)
        way = hands[first - 1] - hands[first + 45]
        if way > 0.1:
            down.append((hands[first - 1] - hands[first + 8]) / way)
            sank.append((hands[first - 1] - hands[first + 17]) / way)
    print(f"{name}: {count} interruptions. Fastest joint: {100 * max(share):.0f} % of its cap. Largest change from step to "
          f"step, eyes left out: {max(jump):.1f}° at 30 fps (before, while gesturing: {max(usual):.1f}°). Lips shut after "
          f"{max(shut):.2f} s at most. Of the hands' way down, {100 * np.mean(down):.0f} % is done after 0.3 s and "
          f"{100 * np.mean(sank):.0f} % after 0.6 s")  # fmt: skip


def longest_still(rotations: Array, fps: float) -> float:
    """Seconds of the longest stretch in which a joint (T, 4) does not turn by a thousandth of a degree from frame to frame."""
    moving = np.flatnonzero(np.degrees(quat_angle(rotations[1:], rotations[:-1])) > 1e-3)
    return float(np.diff(moving, prepend=-1, append=len(rotations) - 1).max() - 1) / fps


def resemblance(course: Array, fps: float) -> tuple[float, float]:
    """Where a course (T, 3) resembles itself most, from `FAR` seconds to half its length, on the axis that varies most.

    Returns:
        The autocorrelation, and the lag in seconds. A repeat is a peak at its lag. A course that drifts slowly has its largest
        autocorrelation at the first lag, and it falls from there.
    """
    x = course[:, course.std(0).argmax()]
    x = x - x.mean()
    power = np.abs(np.fft.rfft(x, 2 * len(x))) ** 2
    correlation = np.fft.irfft(power)[: len(x)] / np.arange(len(x), 0, -1)
    far = (correlation / correlation[0])[round(FAR * fps) : len(x) // 2]
    return float(far.max()), FAR + float(far.argmax()) / fps


def report_idle(name: str, minutes: float, fps: float, seed: int) -> None:
    live, s = cospeech.open_live_session(name, fps=fps, seed=seed), humanoid()
    rotations, faces, began = list[Array](), list[Array](), time.process_time()
    for _ in range(round(minutes)):
        for motion in live.idle(60.0):
            rotations.append(motion.rotations[:, [s.index[joint] for joint in WATCHED]])
            assert motion.face is not None
            faces.append(motion.face)
    q, face = np.concatenate(rotations).astype(float), np.concatenate(faces)
    work = time.process_time() - began
    part = round(600 * fps)
    rates = [60 * len(blinks_of(face[k : k + part], fps).widths) / (len(face[k : k + part]) / fps)
             for k in range(0, len(face), part)]  # fmt: skip
    still = max(longest_still(q[:, k], fps) for k in range(len(WATCHED)))
    alike = {joint: resemblance(np.degrees(quat_to_rotvec(q[:, k])), fps) for k, joint in enumerate(WATCHED)}
    worst = max(alike, key=lambda joint: alike[joint])
    most, lag = alike[worst]
    print(f"{name}: {minutes:g} minutes of idling at {fps:g} fps, {work / minutes / 0.6:.1f} % of a core. "
          f"Blinks a minute, by ten minutes: {min(rates):.1f} … {max(rates):.1f}. Longest rest of a joint: {still:.2f} s. "
          f"Largest autocorrelation after a minute or more: {most:.2f} ({worst}, at {lag:.0f} s)")  # fmt: skip


class Recorder:
    """A receiver that notes when each frame leaves."""

    def __init__(self) -> None:
        self.departures: list[tuple[float, float]] = []

    def send(self, frame: Motion) -> None:
        self.departures.append((time.monotonic(), frame.start))


def report_pace(name: str, seconds: float, look_ahead: float | None) -> None:
    parts = ("face",) if name == "speech-to-face" else PARTS
    live = cospeech.open_live_session(name, fps=60, look_ahead=look_ahead, parts=parts)
    live.warm_up()
    speech, recorder, took, work = Speech.load(example()[0]), Recorder(), list[float](), list[float]()
    pacer = FramePacer([recorder], live.latency + PIECE + SHORT_MARGIN)  # type: ignore[list-item]
    pieces = list(speech.chunks(PIECE))[:-1]
    begin = time.monotonic()
    pacer.begin()
    for k in range(round(seconds / PIECE)):
        if (rest := begin + (k + 1) * PIECE - time.monotonic()) > 0:
            time.sleep(rest)
        clock_start, work_start = time.perf_counter(), time.thread_time()
        for motion in live.push(pieces[k % len(pieces)].samples, speech.rate):
            pacer.push(motion)
        took.append(1e3 * (time.perf_counter() - clock_start))
        work.append(1e3 * (time.thread_time() - work_start))
    pace = pacer.close(drop=True)
    departures = np.array(recorder.departures)
    gaps = 1e3 * np.abs(np.diff(departures[:, 0]) - np.diff(departures[:, 1]))
    lag = departures[:, 0] - begin - departures[:, 1]
    wall, cpu, gap = np.percentile(took, 99), np.percentile(work, 99), np.percentile(gaps, 99)
    print(f"{name}, look-ahead {look_ahead}: a push takes {np.median(took):.2f} ms, p99 {wall:.1f} ms on the clock, "
          f"{np.median(work):.2f} and {cpu:.1f} ms of the processor, the first {took[0]:.1f} ms; jitter of the time between "
          f"frames p99 {gap:.2f} ms; a frame leaves {np.median(lag):.3f} s behind its sound, {lag.max():.3f} s at most; "
          f"{pace.late} of {pace.frames} frames late; load {os.getloadavg()[0]:.1f}", flush=True)  # fmt: skip


def report_warm(name: str, look_ahead: float | None) -> None:
    speech = Speech.load(example()[0])
    for warm in (False, True):
        live, took = cospeech.open_live_session(name, fps=60, look_ahead=look_ahead), []
        began = time.perf_counter()
        if warm:
            live.warm_up()
        ready = time.perf_counter() - began
        for piece in speech.chunks(PIECE):
            began = time.perf_counter()
            for _ in live.push(piece):
                pass
            took.append(1e3 * (time.perf_counter() - began))
        early, late = np.array(took[: round(2 / PIECE)]), np.array(took[round(2 / PIECE) :])
        print(f"{name}, {f'after warm_up ({ready:.2f} s)' if warm else 'cold'}: first push {took[0]:.2f} ms; of all, median "
              f"{np.median(late):.2f} ms, p99 {np.percentile(late, 99):.1f} ms; the first two seconds at most "
              f"{early.max():.1f} ms, the others {late.max():.1f} ms")  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--interrupts", type=int, default=0)
    parser.add_argument("--idle", type=float, default=0.0, metavar="MINUTES")
    parser.add_argument("--warm", action="store_true")
    parser.add_argument("--pace", type=float, default=0.0, metavar="SECONDS")
    parser.add_argument("--look-ahead", type=float)
    parser.add_argument("--fps", type=float, default=30.0, help="of idling")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--models", nargs="+", default=list(MODELS))
    options = parser.parse_args()
    little = not (options.interrupts or options.idle or options.warm or options.pace)
    print(machine(), flush=True)
    for name in options.models:
        if options.warm or little:
            report_warm(name, options.look_ahead)
        if options.pace or little:
            report_pace(name, options.pace or 10.0, options.look_ahead)
        if options.interrupts or little:
            report_interrupts(name, options.interrupts or 10)
    if options.idle or little:
        report_idle(options.models[0], options.idle or 5.0, options.fps, options.seed)


if __name__ == "__main__":
    main()
