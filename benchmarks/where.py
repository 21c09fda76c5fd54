"""Where the time of a session goes: ``OMP_NUM_THREADS=1 python benchmarks/where.py [rules:offline chain-of-generation:live …]``

Jobs are those of `versus.py`. Functions are watched from outside, each for itself: what another watched one does within it
counts there. Processor time per second of speech, of the quickest of some runs, as Markdown. Watching costs 2 to 5 %.
"""

from __future__ import annotations

import argparse
import importlib
import time
from collections import Counter
from collections.abc import Callable
from typing import Any

import versus
from speed import machine

RUNS = 7
WATCHED = {
    "features": (
        "audio.features.prosody:ProsodyStream.push", "runtime.speech_frontend:SpeechFrontend.push",
        "runtime.speech_frontend:SpeechTextFrontend.push",
    ),
    "accents and phrases": ("audio.event_detection:EventDetector.catch_up", "audio.event_detection:EventDetector.step"),
    "emotion of the voice": ("rules.mood:Mood.listen",),
    "planning": ("rules.session:Session._decide",),
    "body of the rules": ("rules.session:Session._pose",),
    "face": ("face.composition:Face.weights", "rules.session:Session._faces"),
    "mouth": ("runtime.mouth:BundleMouth.push", "runtime.mouth:BundleMouth.at"),
    "gaze": ("rules.session:Session.aim",),
    "network": (
        "runtime.sliding_window_decoder:SlidingWindowDecoder.push", "runtime.causal_stream_decoder:CausalStreamDecoder.push",
        "runtime.autoregressive_decoder:AutoregressiveDecoder.push",
    ),
    "decoding": ("runtime.session:TrainedSession._keep", "runtime.session:TrainedSession._decode"),
    "holds": ("runtime.hand_holds:HandHolds.push",),
    "beat alignment": ("runtime.beat_alignment:BeatAlignment.push", "runtime.beat_alignment:AccentTrack.push"),
    "rests": ("runtime.hand_rests:HandRests.push",),
    "stance": ("rules.stance_layer:StanceLayer.push",),
    "rest in silence": (
        "runtime.rest_in_silence:RestInSilence.push", "runtime.rest_in_silence:RestInSilence.lead",
        "runtime.rest_in_silence:RestInSilence.split",
    ),
}  # fmt: skip
"""Stage → functions, as module:class.name. A mouth is played by a window network, too, whose time counts where it is asked."""
NESTED = {"network": "mouth"}
"""A stage that counts as another where that one asks for it."""


class Watch:
    """Adds up the processor time of stages."""

    def __init__(self) -> None:
        self.total: Counter[str] = Counter()
        self._stack: list[tuple[str, float]] = []

    def wrap(self, stage: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """The function; its processor time is added to a stage."""

        def watched(*arguments: Any, **keywords: Any) -> Any:
            around = {name for name, _ in self._stack}
            self._switch(NESTED[stage] if NESTED.get(stage) in around else stage)
            try:
                return function(*arguments, **keywords)
            finally:
                self._switch(None)

        return watched

    def _switch(self, stage: str | None) -> None:
        """Enter a stage, or leave the last one (None)."""
        now = time.process_time()
        if self._stack:
            name, since = self._stack[-1]
            self.total[name] += now - since
            self._stack[-1] = (name, now)
        if stage is None:
            self._stack.pop()
            if self._stack:
                self._stack[-1] = (self._stack[-1][0], now)
        else:
            self._stack.append((stage, now))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    jobs = ["rules:offline", "rules:live", "chain-of-generation:offline", "chain-of-generation:live"]
    parser.add_argument("jobs", nargs="*", default=jobs)
    options = parser.parse_args()
    watch = Watch()
    for stage, places in WATCHED.items():
        for place in places:
            module, _, path = place.partition(":")
            cls, _, name = path.partition(".")
            owner = getattr(importlib.import_module(f"cospeech.{module}"), cls)
            setattr(owner, name, watch.wrap(stage, getattr(owner, name)))
    table = {}
    for job in options.jobs:
        play, seconds = versus.prepare(job)
        play()
        best: tuple[float, Counter[str]] | None = None
        for _ in range(RUNS):
            watch.total.clear()
            began = time.process_time()
            play()
            took = time.process_time() - began
            if best is None or took < best[0]:
                best = took, Counter(watch.total)
        assert best is not None
        table[job] = {name: value / seconds for name, value in best[1].items()}
        table[job]["all"] = best[0] / seconds
        table[job]["the rest"] = table[job]["all"] - sum(best[1].values()) / seconds
    print(f"{machine()}, {time.strftime('%Y-%m-%d')}; thousandths of real time\n")
    print(f"| stage | {' | '.join(table)} |\n|---|{'---:|' * len(table)}")
    for stage in (*WATCHED, "the rest", "all"):
        print(f"| {stage} | {' | '.join(f'{1e3 * times.get(stage, 0):.2f}' for times in table.values())} |")


if __name__ == "__main__":
    main()
