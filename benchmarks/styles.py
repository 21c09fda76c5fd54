"""Whether trained models move in the styles that they are asked for: a judge that sees neither mean pose nor amplitude.

    OMP_NUM_THREADS=1 python benchmarks/styles.py FOLDER_OF_SPEECH [--bundle FILE …] [--bare] [--takes 2 --pieces 6]

The rules taught the networks that ship, in the styles of eight speakers. A judge (`cospeech.experiments.style_judge`) learns
these speakers from performances of the rules on every other piece of speech in the folder. Then each model performs the rest in
each style, and the judge names the speaker. It sees neither mean pose nor amplitude, which bundling sets.

The rules with other seeds are the first row: what can be reached. The second row is the control: the styles are drawn by lot.

The second column asks less: a judge that learns from the model's own performances on the same pieces, and that does not see
which arm does more. It tells whether the styles of a model differ from each other in manner, be it that of their speakers or
another.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from models import BODY, Player, held_out, players

import cospeech
from cospeech.corpora.synthetic.speakers import Speaker, choose_speakers, vary_take
from cospeech.experiments.style_judge import StyleJudge
from cospeech.rules import RuleBasedModel

SPEAKERS, SEED = 8, 0  # as tools/build_weights.py
TAKES = 4  # of each piece in each style, that the judge learns from, as published in docs/styles.md


def perform(model: Any, speeches: list[cospeech.Speech], people: list[Speaker], seed: int, **options: Any) -> Any:
    """(number of the speaker, motion) of each speech in each style; styles of the rules vary from take to take."""
    for k, speech in enumerate(speeches):
        for who, person in enumerate(people):
            own = seed + 1000 * k + who
            style = vary_take(person.style, own, 1.0) if isinstance(model, RuleBasedModel) else person.name
            yield who, model.generate(speech, style=style, seed=own, **BODY, **options)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("speech", type=Path, help="a folder of recordings")
    parser.add_argument("--bundle", action="append", help="a file; those that ship where not given")
    parser.add_argument("--bare", action="store_true", help="networks alone, without what was measured at bundling")
    parser.add_argument("--takes", type=int, default=TAKES, help="takes of each piece that a judge learns from")
    parser.add_argument("--pieces", type=int, help="of either half of the folder, the first ones alone; quicker")
    arguments = parser.parse_args()
    people = choose_speakers(SPEAKERS, SEED)
    pieces = held_out(arguments.speech, "all", 0.0)
    train_pieces, test_pieces = pieces[::2][: arguments.pieces], pieces[1::2][: arguments.pieces]
    if not test_pieces:
        parser.error(f"{arguments.speech} has fewer than two pieces of 13 s or more")
    judge = teach_judge(RuleBasedModel(), train_pieces, people, arguments.takes)
    print(f"the judge learnt from {len(train_pieces)} pieces; {len(test_pieces)} others in {SPEAKERS} styles\n")
    print("| | named | named by a judge of its own | chance |\n|---|---|---|---|")
    bare = {"calibrated": not arguments.bare, "stance": False}
    rows: list[Player] = [("rules, other seeds", RuleBasedModel(), {}), *players(arguments.bundle, bare)]
    for name, model, options in rows:
        own = teach_judge(model, train_pieces, people, arguments.takes, arms=False, **options)
        performances = list(perform(model, test_pieces, people, 50_000, **options))
        answers = [[(who, each.name(motion)) for who, motion in performances] for each in (judge, own)]
        print(f"| {name} | {' | '.join(map(share_right, answers))} | {1 / SPEAKERS:.0%} |", flush=True)
        if isinstance(model, RuleBasedModel):
            lot = np.random.default_rng(0).permutation([who for who, _ in performances])
            by_lot = share_right(list(zip(lot, (answer for _, answer in answers[0]), strict=True)))
            print(f"| the same, styles by lot | {by_lot} | | |", flush=True)


def teach_judge(
    model: Any, speeches: list[cospeech.Speech], people: list[Speaker], takes: int, *, arms: bool = True, **options: Any
) -> StyleJudge:
    """A judge that has seen some takes of a model."""
    performances = (perform(model, speeches, people, 7919 * take + 1, **options) for take in range(takes))
    return StyleJudge((pair for each in performances for pair in each), arms=arms)


def share_right(pairs: list[tuple[int, int]]) -> str:
    """How often a judge was right, with its interval of 95 %."""
    right = np.array([who == answer for who, answer in pairs])
    return f"{right.mean():.0%} ± {1.96 * right.std() / len(right) ** 0.5:.0%}"


if __name__ == "__main__":
    main()
