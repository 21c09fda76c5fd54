"""How much of its motion a network of windows keeps with so much look-ahead: each against the whole speech (docs/runtime.md).

    python tools/measure_look_ahead.py BUNDLE.cospeech [--speech FILE.wav]

Every speaker's style plays the speech at temperature 0, so that what moves is what the network hears.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np

from cospeech.audio.speech import Speech
from cospeech.cli.demo import EXAMPLE
from cospeech.runtime.sliding_window_decoder import SlidingWindowDecoder, live, whole
from cospeech.runtime.speech_frontend import SpeechFrontend
from cospeech.runtime.styles.space import style_space
from cospeech.runtime.styles.track import StyleTrack
from cospeech.runtime.system import System, open_bundle
from cospeech.runtime.window_layout import WindowLayout

AHEAD = (0, 4, 8, 12, 16, 20, 24, 28)


def play_speakers(system: System, setting: WindowLayout, rows: np.ndarray, silence: np.ndarray) -> tuple[np.ndarray, float]:
    """(S, T, D) standardised poses in every speaker's style, and milliseconds of work a frame and style."""
    began, pieces, space = time.process_time(), [], style_space(system)
    for name in system.styles:
        style = StyleTrack(system, space, ((1.0, space.by_name(name)),), [0], temperature=0.0)
        decoder = SlidingWindowDecoder(system, system.main_network, style, [0], silence, setting, temperature=0.0)
        pieces += [decoder.push(rows), decoder.finish(silence)]
    pairs = [np.concatenate(pair, 1) for pair in zip(pieces[::2], pieces[1::2], strict=True)]
    return np.concatenate(pairs), (time.process_time() - began) / (len(rows) * len(system.styles)) * 1e3


def alike(a: np.ndarray, b: np.ndarray) -> float:
    """Correlation over time, mean over styles and numbers of a pose; numbers that do not move have 0."""
    a, b = (x - x.mean(1, keepdims=True) for x in (a, b))
    scale = np.sqrt((a * a).sum(1) * (b * b).sum(1))
    return float(np.mean(np.divide((a * b).sum(1), scale, out=np.zeros_like(scale), where=scale > 0)))


def speed(poses: np.ndarray) -> float:
    return float(np.sqrt(np.square(np.diff(poses, axis=1)).mean()))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bundle")
    parser.add_argument("--speech", default=str(EXAMPLE))
    options = parser.parse_args()
    system = open_bundle(options.bundle)
    network = system.networks.get("make")
    if network is None or network.signature.hop is not None or system.has_emotions:
        raise SystemExit("no network of windows whose look-ahead can be chosen")
    frontend = SpeechFrontend(system, np.zeros(0, np.float32))
    silence = frontend.silence
    rows = np.concatenate([frontend.push(Speech.load(options.speech)), frontend.finish()])
    reference, cost = play_speakers(system, whole(network.signature), rows, silence)
    print("| frames ahead | seconds | correlation with the whole | speed, of the whole's | ms a frame |\n" + "|---:" * 5 + "|")
    for ahead in AHEAD:
        usual = live(network.signature)
        setting = replace(usual, ahead=ahead, fade=min(usual.hop, ahead))
        poses, work = play_speakers(system, setting, rows, silence)
        shares = f"{alike(poses, reference):.2f} | {speed(poses) / speed(reference):.2f} | {work:.2f}"
        print(f"| {ahead} | {ahead / system.fps:.2f} | {shares} |")
    print(f"| all | | 1 | 1 | {cost:.2f} |")


if __name__ == "__main__":
    main()
