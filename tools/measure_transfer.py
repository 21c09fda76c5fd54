"""Is a system's style the speaker's whose name it plays? Writes the table of docs/models/mix_stage.md.

    python tools/measure_transfer.py SYSTEM --store STORE --raw CORPUS [--write]

The speech of held-out takes, 20 s each, is played in every speaker's style but their own. The classifier of measure_style.py,
trained on the recordings of the training split, hears nothing and sees windows of 8 s, which vote. It sees mean pose and
amplitude, which bundles set to the speaker's own, so "named right" says nothing of the network. Rhythm: beat alignment, in
which motion that does not know its speech has 0. Rate, amplitude and the right hand's share of the movement are set against the
speakers' own recordings: their correlation over speakers.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from measure_style import PARTS, TALK, WARM, SpeakerVotes, select_test_clips

import cospeech
from cospeech.corpora.attributes import attributes_of, body_of
from cospeech.corpora.clip import Clip
from cospeech.corpora.samples import load_stored_clips, sample_of
from cospeech.corpora.store import Store
from cospeech.metrics import Tools, load_metric

PAGE = Path(__file__).parents[1] / "docs" / "models" / "mix_stage.md"
BLOCK = re.compile(r"(<!-- transfer -->\n).*?(<!-- end -->)", re.S)
SPEECHES = 10
SHOWN = ("rate", "amplitude", "right_share")


def rhythm(clips: Sequence[Clip]) -> str:
    """Corrected beat alignment with its interval."""
    samples = [sample_of(clip) for clip in clips]
    score = load_metric("beat_align")(samples, samples, Tools(seed=0))
    low, high = score.interval or (np.nan, np.nan)
    return f"{score.value:.3f} ({low:.3f} … {high:.3f})"


def score_speaker(votes_of: SpeakerVotes, clips: dict[str, list[Clip]], skip: float) -> str:
    """Share of clips that the classifier assigns to their speaker; ``clips``: speaker → clips."""
    names = votes_of.store.speakers
    right = [
        names[int(votes_of.votes(clip.motion, skip=skip).argmax())] == name
        for name, takes in clips.items()
        for clip in takes
        if clip.motion is not None
    ]
    return f"{np.mean(right):.0%} of {len(right)}"


def traits(clips: dict[str, list[Clip]]) -> np.ndarray:
    """(speakers, 3) rate, amplitude, right share."""
    rows = []
    for takes in clips.values():
        bodies = [body_of(clip.motion) for clip in takes if clip.motion is not None]
        attributes = attributes_of([points for points, _ in bodies], bodies[0][1], takes[0].motion.fps)  # type: ignore[union-attr]
        rows.append([getattr(attributes, name) for name in SHOWN])
    return np.array(rows)


def table(system: str, store: Store, raw: Path) -> list[list[str]]:
    """Rows: recordings, and the system in the styles of other speakers."""
    votes_of, model = SpeakerVotes(store), cospeech.load(system)
    clips = [clip for clip in load_stored_clips(store.folder, split=None, raw=raw) if clip.split != "train"]
    talks = select_test_clips(clips, TALK + 1)
    talks = talks[:: max(1, len(talks) // SPEECHES)][:SPEECHES]
    own = {name: [c for c in select_test_clips(clips, 11) if c.speaker == name] for name in store.speakers}
    generated: dict[str, list[Clip]] = {name: [] for name in store.speakers}
    for number, talk in enumerate(talks):
        assert talk.speech is not None
        speech = talk.speech.window(talk.speech.start, talk.speech.start + TALK)
        for name in store.speakers:
            if name != talk.speaker:
                motion = model.generate(speech, style=name, seed=number, fps=store.fps, parts=PARTS)
                generated[name].append(replace(talk, speech=speech, motion=motion))
        print(f"{number + 1} of {len(talks)} speeches", flush=True)
    true, ours = traits(own), traits(generated)
    alike = [f"{np.corrcoef(true[:, k], ours[:, k])[0, 1]:.2f}" for k in range(len(SHOWN))]
    means = [" / ".join(f"{value:.3g}" for value in rows.mean(0)) for rows in (true, ours)]
    return [
        [
            "held-out recordings",
            score_speaker(votes_of, own, 0.0),
            rhythm([c for takes in own.values() for c in takes]),
            means[0],
            "",
            "",
            "",
        ],
        [
            system,
            score_speaker(votes_of, generated, WARM),
            rhythm([c for takes in generated.values() for c in takes]),
            means[1],
            *alike,
        ],
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("system")
    parser.add_argument("--store", type=Path, required=True)
    parser.add_argument("--raw", type=Path, required=True)
    parser.add_argument("--write", action="store_true", help="put the table into docs/models/mix_stage.md")
    options = parser.parse_args()
    rows = table(options.system, Store(options.store), options.raw)
    head = ["", "named right", "beat alignment", "rate, amplitude, right share", *(f"{name}, r" for name in SHOWN)]
    text = "\n".join("| " + " | ".join(cells) + " |" for cells in [head, ["---"] * len(head), *rows])
    print(text)
    if options.write:
        PAGE.write_text(BLOCK.sub(lambda m: f"{m[1]}{text}\n{m[2]}", PAGE.read_text("utf-8")), "utf-8")


if __name__ == "__main__":
    main()
