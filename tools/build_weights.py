"""Makes the weights that ship, src/cospeech/assets/bundles/NAME.cospeech, and their card.

    python tools/build_weights.py stylised-flow --speech FOLDER_OF_SPEECH --work FOLDER --hours 4 [--set train.steps=3000]
    python tools/build_weights.py mix-stage --speech FOLDER_OF_SPEECH --work FOLDER --hours 4
    python tools/build_weights.py chain-of-generation --speech FOLDER_OF_SPEECH --work FOLDER --hours 4
    python tools/build_weights.py speech-to-face --faces FOLDER_OF_TRACKED_FACES --work FOLDER [--without SPEAKER --out BUNDLE]
    python tools/build_weights.py NAME --follow FILE       # what benchmarks/models.py --follow has printed, into the card

Four steps, each skipped where its result is there already: a synthetic corpus in BEAT's layout (the rule-based model
performs the speech, and TTS where espeak-ng or flite are installed), a store of our humanoid's poses, training by the recipe
(stopped, it goes on), the bundle. Then the bundle plays the store's test split, and the card says how that scored beside the
ground truth, the rule-based model and the control rows. Corpus and store are the same for both. The face is trained on real
recordings (docs/corpora/faces.md), and its card says what tools/measure_face.py finds.

Hands of these bundles rest in silence (docs/runtime.md). ``--follow`` sets that too, and over how many frames poses are
averaged, in a bundle that was built before.
"""

from __future__ import annotations

import argparse
import json
import platform
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from calibrate_face import calibrate
from measure_face import measure_faces

from cospeech.audio.speech import Speech
from cospeech.corpora.prepare import prepare
from cospeech.corpora.store import Store
from cospeech.corpora.synthetic import synthesise
from cospeech.evaluation import evaluate_store
from cospeech.metrics.table import Table
from cospeech.models import BUNDLE, SHIPPED, load
from cospeech.models.speech_to_face import SpeechToFaceConfig
from cospeech.motion.motion import Motion
from cospeech.runtime.bundles.bundle import read_bundle, write_bundle
from cospeech.runtime.bundles.spec import CARD
from cospeech.training.checkpoint import read_facts
from cospeech.training.export.bundles import bundle_run
from cospeech.training.recipe import build, load_recipe
from cospeech.training.train import train

ROOT = Path(__file__).parents[1]
SPEAKERS, SEED, STYLE = 8, 0, "elif"  # the orator: neither the largest nor the smallest
SILENCE = 0.25  # share of a take: networks that never heard a pause wave in it
FACE_STYLE = "grid_s1"  # MediaPipe's units are those that apps with ARKit's names expect
METRICS = ("fgd", "beat_align", "diversity", "l1_div", "jerk", "hellinger_speed", "w1_speed")

FLOW = """# stylised-flow: the weights that ship

A small stylised flow (Ye et al. 2022, see docs/models/stylised_flow.md) for our humanoid: body and hands from speech. The
face is the rule-based model's.

**Data: synthetic.** {hours:.2f} h of training motion made by the rule-based model in the styles of {speakers} speakers and
eight emotions, in BEAT's layout; nothing was recorded from people but the voices. The network has learnt our rules, not
people. Speech: LibriVox (public domain), LJ Speech (public domain), JFK (public domain), SpeechBrain samples (Apache-2.0),
Audio2Face samples (MIT), and synthesised voices (espeak-ng, flite).

**Network.** K = {config[steps]} steps, two GRU layers of {config[hidden]}, {parameters:,} parameters, 8-bit products, {fps:g}
poses per second (interpolated), {look:.2f} s of look-ahead besides that of the features. Trained for {train_steps} steps of
{batch} windows on {machine}. Not as published: the likelihood and a loss on when the strokes come that the network plays by
itself (docs/models/stylised_flow.md, "Changed, and added"); neither the reconstruction nor the perceptual term of the paper
(the first narrows the motion of so small a network, for the second no extractor was trained). Latents are drawn at
{config[latent_scale]} of their size. Poses are by their recording's own mean and deviation.

**Speakers**, for `--style NAME`: {names}.

## Scores on the test split of the same synthetic corpus

{table}

`stylised-flow` plays with random latents in its default style, whoever the recording's speaker is. Figures on synthetic data,
comparable with each other and with no paper's.

## What it cannot do

It makes no steps and does not sit down: feet stay planted. It hears sound, not words: no lexical gestures. Emotion changes
the face only. Hands have six numbers each: no finger spelling, no counting. What it has of a style is what a few seconds
show: reach, speed, sides, posture; not what somebody does once a minute.

Rebuild: `python tools/build_weights.py stylised-flow --speech FOLDER_OF_SPEECH --work FOLDER --hours 4`. Licence of the
weights: Apache-2.0.
"""


MIX = """# mix-stage: the weights that ship

A small Mix-StAGE (Ahuja et al. 2020, see docs/models/mix_stage.md) for our humanoid: body and hands from speech, in the style
of eight speakers, between them, or in the mixture of them that an example is nearest to. The face is the rule-based
model's.

**Data: synthetic.** {hours:.2f} h of training motion made by the rule-based model in the styles of {speakers} speakers and
eight emotions, in BEAT's layout; nothing was recorded from people but the voices. The network has learnt our rules, not
people. Speech: LibriVox (public domain), LJ Speech (public domain), JFK (public domain), SpeechBrain samples (Apache-2.0),
Audio2Face samples (MIT), and synthesised voices (espeak-ng, flite).

**Network.** M = {config[modes]} sub-generators, {config[channels]} channels, {parameters:,} parameters in training (the
discriminator and the encoder of poses' content do not ship), 16-bit weights, {fps:g} poses per second (interpolated). Trained
for {train_steps} steps of {batch} windows on {machine}. Not as published: it is judged by what it plays, poses and velocity
both, by squared distances; less weight on the distance to the one recording; a loss on when strokes come
(docs/models/mix_stage.md, "Added").

**Speakers**, for `--style NAME`: {names}.

## Scores on the test split of the same synthetic corpus

{table}

`mix-stage` plays in its default style, whoever the recording's speaker is. Figures on synthetic data, comparable with each
other and with no paper's.

## What it cannot do

It makes no steps and does not sit down: feet stay planted. It hears sound, not words: no lexical gestures. Emotion changes
the face only. Hands have six numbers each: no finger spelling, no counting. Poses are interpolated from {fps:g} a second:
nothing is sudden.

Rebuild: `python tools/build_weights.py mix-stage --speech FOLDER_OF_SPEECH --work FOLDER --hours 4`. Licence of the
weights: Apache-2.0.
"""


CHAIN = """# chain-of-generation: the weights that ship

A small Chain of Generation (Xu et al. 2024, see docs/models/chain_of_generation.md) for our humanoid: who speaks and in which
mood is heard in the voice, then come a face, with it the body, with both the hands. Two networks: one that hears all of a
file, and one for streams, which looks {look:.2f} s ahead. The face that is shown is the learnt mouth's (speech-to-face, of
real recordings: see its card), with brows, blinks, gaze and expressions by rule; the chain's own face drives its body.

**Data: synthetic.** {hours:.2f} h of training motion made by the rule-based model in the styles of {speakers} speakers and
eight emotions, in BEAT's layout, to voices that act the emotions by rule; no body was recorded. The network has learnt our
rules, not people. Speech: LibriVox (public domain), LJ Speech (public domain), JFK (public domain), SpeechBrain samples
(Apache-2.0), FACEGOOD (MIT), GRID (CC BY 4.0: M. Cooke, J. Barker, S. Cunningham, X. Shao 2006), and synthesised voices
(espeak-ng, flite).

**Network.** {parameters:,} parameters of the streaming one in training, with its discriminator, {theirs:,} of the other;
16-bit weights, {fps:g} poses per second (interpolated). Trained for {their_steps} and {train_steps} steps of {batch} windows
on {machine}; what ships is the running average of the parameters. Not as published: the speech encoder is our own small one,
words are subwords, and besides the paper's losses there are a discriminator and terms for the manner of a recording, for when
its strokes come, and for how fast each part of the body moves and with which others (docs/models/chain_of_generation.md,
"Added"). The networks also heard the speech with other voices and in other rooms.

**Speakers**, for `--style NAME`: {names}; without one, whoever is heard. Emotions: `--emotion NAME` or a track; without one,
as heard.

## Scores on the test split of the same synthetic corpus

{table}

`{name}` plays as a stream, `{name}, offline` with all of the speech heard; speaker and emotion are those that it hears.
Figures on synthetic data, comparable with each other and with no paper's.

## What it cannot do

It makes no steps and does not sit down: feet stay planted. Real voices' emotions are not named reliably
(docs/emotion_from_speech.md): say them with `--emotion`. Words move it little. Takes of one speech are alike but for small
things. Hands have six numbers each: no finger spelling, no counting. Poses are interpolated from {fps:g} a second: nothing is
sudden.

Rebuild: `python tools/build_weights.py chain-of-generation --speech FOLDER_OF_SPEECH --work FOLDER --hours 4`. Licence of
the weights: Apache-2.0.
"""


FOLLOWS = """
## How far it follows the speech

While nobody speaks, **a rule, not the network, brings the hands to rest**: after 0.6 s without a voice arms and fingers go to
a resting pose and the trunk calms down; they come back when a voice is heard ahead (docs/runtime.md, "While nobody speaks").
In Python `calibrated=False` plays the network without that rule.

{rows}

Calm recordings of ten German actors (EmoDB: neutral and bored), which no network has heard, with pauses of 1 to 4 s put into
them (`python benchmarks/models.py FOLDER_OF_SPEECH --follow`). Silence ratio: speed of the wrists in pauses by that in
speech; in brackets with the time in which hands come down. Own: pairs of speeches in which the motion goes better with its
own. Gains: smallest, median and largest factor on a style's deviations.
"""


FACE = """# speech-to-face: the weights that ship

Mouth, jaw and head from speech (docs/models/speech_to_face.md): what every system's face speaks with.

**Data: real.** {minutes:.0f} minutes of training motion of two people whose faces were tracked while they spoke; none of it
ships. `grid_s1`: one man, English commands of a small vocabulary. `facegood`: one woman, Mandarin. Attribution:

* GRID, CC BY 4.0: M. Cooke, J. Barker, S. Cunningham, X. Shao, "The Grid Audio-Visual Speech Corpus", 2006; blendshapes by
  MediaPipe. Changed: blendshapes mapped to ARKit, the speaker's face at rest taken off, both sides of the mouth made even.
* FACEGOOD-Audio2Face, MIT, The FACEGOOD Authors; rig channels mapped to ARKit.

**Network.** {parameters:,} parameters, 16-bit weights, {fps:g} faces per second; hears {ahead:.0f} ms ahead. Trained for
{train_steps} steps of {batch} windows on {machine}. In training, speech was made louder and softer, brighter and darker, of
longer and shorter vocal tracts, noisy, and interrupted by pauses. Each speaker has a last layer of their own. Channels were
then stretched to the size of the tracked ones (tools/calibrate_face.py).

**Speakers**, for `--style NAME`: {names}; what is played without is grid_s1.

## Held-out takes of the same two people

{table}

Means with 95 % intervals over clips (tools/measure_face.py). Of other voices and languages nothing was measured against a face.

## What it cannot do

Eyes, brows and cheeks do not move: rules do that. Two people, both calm: nothing is learnt of shouting, laughing or singing,
and emotions are added by rules. One speech has one face: smiles and pressed lips that the sound does not tell of are missing.
The turn of the head hardly follows from speech. No tongue.

Rebuild: `python tools/build_weights.py speech-to-face --faces FOLDER_OF_TRACKED_FACES --work FOLDER`. Licence of the weights:
Apache-2.0, with the attribution above.
"""


@dataclass(frozen=True)
class Shipped:
    """What ships: its recipe, and what is said of it."""

    recipe: str
    run: str
    which: str
    card: str
    fps: int = 12
    style: str | None = STYLE
    smooth: int = 1
    """Frames to either side over which poses are averaged."""
    emotion_strength: Mapping[str, float] = field(default_factory=dict)
    """Emotion → how much of it the network is given."""
    teacher: str | None = None
    """Recipe of the network that it is taught by, which is in the same bundle and hears all of a file."""


KINDS = {
    "stylised-flow": Shipped("flow_humanoid", "run-humanoid", "last", FLOW),
    "mix-stage": Shipped("mix_stage_humanoid", "run-mix", "last", MIX),  # adversarial training has no figure to be best by
    "chain-of-generation": Shipped(
        "chain_live_humanoid",
        "run-chain-live",
        "last",
        CHAIN,
        fps=15,
        style=None,
        teacher="chain_of_generation_humanoid",
        smooth=2,  # with 1 its hands make more strokes than people's
        emotion_strength={"sadness": 0.7},  # speed of hands by that of neutral ones: .2 with 1, .4 so, .43 in training data
    ),
}


@dataclass(frozen=True)
class Offline:
    """A model that is given the whole speech before it moves."""

    model: Any

    def generate(self, speech: Speech, **options: Any) -> Motion:
        """See `cospeech.models.Model`."""
        motion: Motion = self.model.generate(speech, look_ahead=float("inf"), **options)
        return motion


def markdown(table: Table) -> str:
    """Rows and columns with half of the 95 % interval."""
    data = json.loads(table.to_json())

    def cell(score: dict[str, object] | None) -> str:
        if score is None or score["value"] is None:
            return "–"
        ends = score["interval"]
        half = "" if not isinstance(ends, list) or None in ends else f" ± {(ends[1] - ends[0]) / 2:.2g}"
        return f"{score['value']:.3g}{half}"

    lines = ["| | " + " | ".join(table.columns) + " |", "|---" * (1 + len(table.columns)) + "|"]
    lines += [f"| {row} | " + " | ".join(cell(data["rows"][row][c]) for c in table.columns) + " |" for row in table.rows]
    return "\n".join([*lines, "", f"{table.about}; ± half of the 95 % interval over clips."])


def build_face(options: argparse.Namespace, out: Path) -> None:
    """Build the bundle of the face from real recordings."""
    store, speaker = options.work / "store-faces", options.without
    run = options.work / (f"run-face-without-{speaker}" if speaker else "run-face")
    if not (store / "index.json").exists():
        print(prepare("faces", options.faces, store, pose="face", fps=60).summary())
    own = [f"train.threads={options.threads}"]
    if speaker:
        own.append(f"data.speakers={json.dumps([name for name in Store(store).speakers if name != speaker])}")
    recipe = load_recipe("speech_to_face", [*options.set, *own])
    report = train(recipe, store, run, resume=True)
    sized_run = run.with_name(f"{run.name}-sized")
    print(*calibrate(run, store, sized_run), sep=", ")
    shape = {"which": "last", "style": FACE_STYLE}
    bundle_run(sized_run, out, **shape)
    if speaker:
        print(measure_faces(options.faces, out))
        return
    facts = read_facts(sized_run)
    corpus = facts["store"]
    config = build(SpeechToFaceConfig, facts["config"], "model")
    card = FACE.format(
        minutes=corpus["train_seconds"] / 60, parameters=report.parameters, fps=corpus["fps"],
        ahead=1000 * config.future / corpus["fps"], train_steps=report.step, batch=recipe.train.batch,
        machine=f"{options.threads} core of a {platform.machine()} machine, no GPU", names=", ".join(corpus["speakers"]),
        table=measure_faces(options.faces, out),
    )  # fmt: skip
    bundle_run(sized_run, out, card=card, **shape)
    print(f"{card}\n{out}  {out.stat().st_size / 1e6:.2f} MB")


def _settings_of(kind: Shipped) -> dict[str, Any]:
    """Facts of a bundle that do not come from its run."""
    return {"smooth": kind.smooth, "rests": True, "emotion_strength": dict(kind.emotion_strength)}


def tell_following(path: Path, name: str, table: str) -> None:
    """Write the rows of a model and of the rules into its card; set rests in silence and smoothing in its bundle."""
    bundle = read_bundle(path)
    first = f"| {name}"
    rows = [line for line in table.splitlines() if line.startswith(("| |", "|---", "| rules |", f"{first} |", f"{first},"))]
    card = bundle.members[CARD].decode().split(FOLLOWS.splitlines()[1])[0].rstrip()
    members = {**bundle.members, CARD: (card + "\n" + FOLLOWS.format(rows="\n".join(rows))).encode()}
    manifest = {key: value for key, value in bundle.manifest.items() if key not in ("members", "format")}
    write_bundle(path, manifest | _settings_of(KINDS[name]), members)
    print(f"{path}: {len(rows) - 2} rows")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("name", choices=[*KINDS, "speech-to-face"])
    parser.add_argument("--speech", type=Path, help="folder of recordings; without it only TTS speaks")
    parser.add_argument("--faces", type=Path, help="folder of tracked faces, for speech-to-face")
    parser.add_argument("--without", metavar="SPEAKER", help="of speech-to-face: leave a speaker out, and measure; needs --out")
    parser.add_argument("--work", type=Path, help="where corpus, store and run lie, or are made")
    parser.add_argument("--follow", type=Path, metavar="FILE", help="output of benchmarks/models.py --follow, for the card")
    parser.add_argument("--hours", type=float, default=2.0)
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="of the recipe")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--out", type=Path, help="of the bundle; where it ships, else")
    options = parser.parse_args()
    if options.without and not options.out:
        parser.error("--without needs --out: its bundle does not ship")
    out = options.out or SHIPPED / f"{options.name}{BUNDLE}"
    if options.follow:
        tell_following(out, options.name, options.follow.read_text("utf-8"))
        return
    if options.work is None:
        parser.error("--work is missing")
    if options.name not in KINDS:
        build_face(options, out)
        return
    build_gestures(options, KINDS[options.name], out)


def build_gestures(options: argparse.Namespace, kind: Shipped, out: Path) -> None:
    """Build the bundle of body and hands from the synthetic corpus."""
    raw, store, run = options.work / "raw-beat", options.work / f"store-humanoid{kind.fps}", options.work / kind.run
    if not raw.exists():
        print(
            synthesise(
                raw, "beat", speech=options.speech, hours=options.hours, speakers=SPEAKERS, seed=SEED, silence=SILENCE
            ).summary()
        )
    if not (store / "index.json").exists():
        print(prepare("beat", raw, store, pose="expmap-humanoid", fps=kind.fps).summary())
    own, more = [f"train.threads={options.threads}"], dict[str, Any]()
    if kind.teacher:
        folder = options.work / "run-chain"
        theirs = train(load_recipe(kind.teacher, own), store, folder, resume=True)
        own.append(f"needs.teacher={folder}")
        more = {"theirs": theirs.parameters, "their_steps": theirs.step, "name": options.name}
    recipe = load_recipe(kind.recipe, [*options.set, *own])
    report = train(recipe, store, run, resume=True)
    print(f"{report.step} steps, {report.parameters:,} parameters, best {report.best}")
    out.parent.mkdir(parents=True, exist_ok=True)
    settings = {"which": kind.which, "style": kind.style, **_settings_of(kind)}
    bundle_run(run, out, **settings)
    facts = read_facts(run)
    systems: dict[str, Any] = {options.name: str(out), "rules": "rules"}
    if kind.teacher:
        systems = {options.name: str(out), f"{options.name}, offline": Offline(load(out)), "rules": "rules"}
    table = evaluate_store(systems, store, raw=raw, metrics=METRICS)
    corpus, config = facts["store"], facts["config"]
    card = kind.card.format(
        hours=corpus["train_seconds"] / 3600, speakers=SPEAKERS, config=config, parameters=report.parameters,
        look=config.get("look_ahead", 0) / corpus["fps"], fps=corpus["fps"], train_steps=report.step, batch=recipe.train.batch,
        machine=f"{options.threads} core of a {platform.machine()} machine, no GPU", names=", ".join(corpus["speakers"]),
        table=markdown(table), **more,
    )  # fmt: skip
    bundle_run(run, out, card=card, **settings)
    print(f"{out}  {out.stat().st_size / 1e6:.2f} MB")
    print(table.to_text())


if __name__ == "__main__":
    main()
