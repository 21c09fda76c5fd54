"""``cospeech stream``: it takes live speech, and sends frames of motion while the person speaks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import InputError, InternalError, say_count
from ..models import DEFAULT, PARTS
from .options import (
    Debug,
    Emotion,
    FaceGain,
    Fps,
    Intensity,
    Language,
    Model,
    Parts,
    Quiet,
    Seed,
    Style,
    Temperature,
    check_idle,
    number,
    option,
    whole,
)
from .stream_sources import check_partner, check_sources, hear_partner, is_live, open_pieces
from .transcript_options import Offset, Tier, describe_transcript

if TYPE_CHECKING:
    from ..audio.speech import Speech
    from ..export.live.outlets import Outlet
    from ..export.live.pacing import FramePacer
    from ..export.live.targets import StreamSettings
    from ..runtime.live_session import LiveSession

__all__ = ["register"]

_ALL = ",".join(PARTS)
_CLOSING = 0.5  # seconds in which a stopped character closes its mouth and lowers its hands [ours]
_STEP = 0.1  # seconds of idling in one step [ours: a tick of the rules, 10 to 30 ms of work]
_SILENCE = 3.0  # seconds of live silence after which the rules idle [ours: longer than a pause between sentences]
Avatar = Annotated[
    Path | None,
    option(
        "--avatar",
        metavar="FILE",
        help="VRM, GLB or FBX character that vmc:// moves: its bones have other lengths than those of our mannequin.",
    ),
]
AvatarMap = Annotated[
    Path | None,
    option("--map", metavar="FILE", help="TOML file that gives our names to the joints of the avatar."),
]
Source = Annotated[
    str,
    option(
        "--input",
        "-i",
        metavar="SOURCE",
        help="mic; a sound file, as fast as it is spoken; - for raw samples on standard input; ws://HOST:PORT for a "
        "WebSocket server that sends raw samples; listen://HOST:PORT to wait for a client that sends them.",
    ),
]
Targets = Annotated[
    list[str],
    option(
        "--to",
        metavar="ADDRESS",
        help="Receiver. Repeat the option for several: vmc://HOST:39539, livelink://HOST:11111, ws://HOST:PORT (a server of "
        "yours), listen://HOST:PORT (clients connect to us), - (JSON lines on standard output).",
    ),
]
Rate = Annotated[
    int, option("--rate", metavar="HZ", parser=whole, help="Samples per second of raw samples and the microphone.")
]
Kind = Annotated[str, option("--samples", metavar="KIND", help="Raw samples: s16 or f32, little-endian, one channel.")]
Transcript = Annotated[
    str | None,
    option(
        "--transcript",
        metavar="FILE",
        help="Words of the speech, if you know them before: every file that `generate` reads. For raw samples, times "
        "count from the first sample.",
    ),
]
Words = Annotated[
    str | None,
    option(
        "--words",
        metavar="FILE",
        help="File or named pipe of words that come while raw samples come, as JSON lines: "
        '{"word": "huge", "start": 0.5, "end": 0.9}, in seconds from the first sample (docs/guides/live.md).',
    ),
]
Control = Annotated[
    str | None,
    option(
        "--control",
        metavar="SOURCE",
        help="Messages that steer: - for JSON lines on standard input, listen://HOST:PORT or ws://HOST:PORT for a WebSocket. "
        'For example {"interrupt": true} or {"emotion": "happiness"}.',
    ),
]
IdleAfter = Annotated[
    float | None,
    option(
        "--idle-after",
        metavar="SECONDS",
        parser=number,
        help="Seconds of silence after which the character listens and idles. At least the latency of the model, 1.63 s with "
        "a face. Without the option: 3 s for live sound, never for a file.",
    ),
]
Partner = Annotated[
    str | None,
    option(
        "--partner",
        metavar="SOURCE",
        help="Sound of the person who talks to the character, from the same kinds of sources as --input, with its --rate and "
        "--samples. While that person speaks, and the character does not, the character listens: it nods now and then.",
    ),
]
PartnerAngle = Annotated[
    float,
    option(
        "--angle",
        metavar="DEGREES",
        parser=number,
        help="Where the person of --partner is, seen by the character: 0 is straight ahead, 60 to its left, -60 to its right.",
    ),
]
LookAhead = Annotated[
    float | None,
    option(
        "--look-ahead",
        metavar="SECONDS",
        parser=number,
        help="Seconds of later speech on which a frame depends. With less, the character answers sooner, but its gestures come "
        "later than the words. rules: 0.4 … 1.48, and from 0.2 on for --parts face; trained models: 0 and more "
        "(docs/runtime.md).",
    ),
]
Unpaced = Annotated[
    bool, typer.Option("--unpaced", help="Send each frame as soon as it is made, and read a file as fast as possible.")
]


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(stream)


def stream(
    context: typer.Context,
    source: Source = "mic",
    to: Targets = ["-"],  # noqa: B006  typer reads it, and nobody changes it
    model: Model = DEFAULT,
    style: Style = None,
    emotion: Emotion = "auto",
    seed: Seed = 0,
    temperature: Temperature = 1.0,
    intensity: Intensity = 1.0,
    parts: Parts = _ALL,
    face_gain: FaceGain = "1",
    fps: Fps = 60.0,
    avatar: Avatar = None,
    names: AvatarMap = None,
    transcript: Transcript = None, offset: Offset = 0.0, tier: Tier = "", language: Language = "", words: Words = None,
    control: Control = None,
    idle_after: IdleAfter = None,
    partner: Partner = None,
    angle: PartnerAngle = 0.0,
    look_ahead: LookAhead = None,
    rate: Rate = 16_000,
    samples: Kind = "s16",
    unpaced: Unpaced = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:  # fmt: skip
    """Generate motion live, for avatars, games and programs.

    Frames leave evenly, some time after their sound. The program prints this time when it starts: delay the sound by it.

    \b
    cospeech stream --input mic --to vmc://127.0.0.1:39539
    cospeech stream --input talk.wav --to listen://127.0.0.1:8765 --fps 60
    my_tts | cospeech stream -i - --words words.pipe --to listen://127.0.0.1:8765
    my_tts | cospeech stream -i - --partner mic --to vmc://127.0.0.1:39539
    """
    from ..audio.live_sources import PIECE
    from ..export.live.pacing import MARGIN, SHORT_MARGIN, FramePacer
    from ..export.live.targets import StreamSettings
    from ..generate import open_live_session

    words_file = describe_transcript(transcript, offset, tier)
    check_sources(source, control, transcript, words, language, rate, samples)
    bones, tell = _read_map(names, avatar), _say_nothing if quiet else _tell
    part_names = tuple(part.strip() for part in parts.split(","))
    _check_options(context, source, to, part_names, face_gain)
    try:
        session = open_live_session(
            model, style=style, emotion=emotion, seed=seed, temperature=temperature, intensity=intensity, parts=part_names,
            face_gain=face_gain, fps=fps, look_ahead=look_ahead, angle=angle,
            idle_after=_SILENCE if idle_after is None and is_live(source) else idle_after,
        )  # fmt: skip
    except InputError as error:  # of the library, which calls options as Python does
        raise InputError(_name_options(error.problem), error.hint) from None
    if not unpaced:
        session.warm_up()
    margin = MARGIN if look_ahead is None else SHORT_MARGIN
    delay = session.latency + PIECE + margin
    with ExitStack() as stack:
        pieces, controls = open_pieces(
            stack, source, words_file, words, control, rate=rate, kind=samples, slack=margin / 2, unpaced=unpaced, tell=tell,
            language=language)  # fmt: skip
        outlets = _open_outlets(stack, to, StreamSettings(fps, delay, part_names, avatar, bones), tell)
        hear_partner(stack, partner, session.listener, rate=rate, kind=samples, tell=tell)
        pacer = FramePacer(outlets, delay, paced=not unpaced)
        tell(f"listening to {source}; frames leave {delay:.2f} s after their sound (Ctrl-C ends)")
        _play_to_the_end(session, pieces, partial(controls.steer, session), pacer, tell)
    _fail_without_receiver(outlets)


def _fail_without_receiver(outlets: Sequence[Outlet]) -> None:
    if any(outlet.dropped for outlet in outlets) and not any(outlet.sent for outlet in outlets):
        raise InternalError("no receiver got a frame", "are the addresses right, and do the receivers run?")


def _name_options(problem: str) -> str:
    """A message of the library, with the names of options as the user types them."""
    return problem.replace("idle_after", "--idle-after").replace("look_ahead", "--look-ahead")


def _check_options(context: typer.Context, source: str, to: Sequence[str], parts: Sequence[str], face_gain: str) -> None:
    """Check receivers and options; a note tells if ``face_gain`` is given and no face is made.

    Raises:
        InputError: a receiver is named twice, or an option would change nothing.
    """
    from ..export.checks import note_idle_gain
    from ..export.live.addresses import scheme_of

    duplicate = next((address for address in to if to.count(address) > 1), None)
    if duplicate is not None:
        raise InputError(f"--to {duplicate!r} is given twice", "name each receiver once")
    if not any(scheme_of(address) == "vmc" for address in to):
        check_idle(context, ("avatar",), "without a vmc:// receiver")
    partner = context.params["partner"]
    check_partner(partner, source, context.params["control"], context.params["unpaced"])
    if not is_live(source) and not (partner and is_live(partner)):
        check_idle(context, ("rate", "samples"), "beside a sound file")
    if partner is None:
        check_idle(context, ("angle",), "without --partner")
    note_idle_gain(face_gain, parts, "no face is made")


def _read_map(names: Path | None, avatar: Path | None) -> dict[str, str] | None:
    """Read the map of an avatar's joints, if one is given."""
    from ..motion.bone_mapping import load_map

    if names is not None and avatar is None:
        raise InputError("--map without --avatar", "it names the joints of an avatar")
    return None if names is None else load_map(names)


def _open_outlets(
    stack: ExitStack, addresses: Iterable[str], settings: StreamSettings, tell: Callable[[str], None]
) -> list[Outlet]:
    """Open the receivers. When all are closed, how many frames each one got is printed."""
    from ..export.live.targets import open_outlet

    outlets: list[Outlet] = []

    def tell_counts() -> None:
        for outlet in outlets:
            tell(f"  {outlet.name}: {outlet.sent} sent, {outlet.dropped} dropped")

    stack.callback(tell_counts)
    for address in addresses:
        outlets.append(open_outlet(address, settings, tell))
        stack.enter_context(_close_at_the_end(outlets[-1]))
    return outlets


@contextmanager
def _close_at_the_end(outlet: Outlet) -> Iterator[None]:
    """Close a receiver at the end. After another error or Ctrl-C, an error of closing is ignored."""
    try:
        yield
    except BaseException:
        with suppress(OSError):
            outlet.close()
        raise
    outlet.close()


def _shut_mouth(session: LiveSession, pacer: FramePacer) -> bool:
    """Replace the frames that have not been sent by frames that end the speech; False if none are left."""
    if (first := pacer.take_back()) is None:
        return False
    try:
        session.interrupt(at=first)
        for motion in session.idle(_CLOSING):
            pacer.push(motion)
    except Exception:  # Ctrl-C can come in the middle of a push
        return False
    return True


def _tell(text: str) -> None:
    typer.echo(text, err=True)


def _say_nothing(text: str) -> None:
    """The function to print with when the user wants --quiet."""


def _play_to_the_end(
    session: LiveSession, pieces: Iterable[Speech], steer: Callable[[Speech], Speech], pacer: FramePacer,
    tell: Callable[[str], None],
) -> None:  # fmt: skip
    """Play until the sound ends or the user stops the program, and print how evenly the frames were sent."""
    try:
        _play(session, pieces, steer, pacer)
    except (KeyboardInterrupt, SystemExit, Exception):  # SystemExit: SIGTERM; Exception: such as an unplugged microphone
        is_shut = pacer.paced and _shut_mouth(session, pacer)
        with suppress(OSError):  # an error of a receiver; the first error is printed
            _end(pacer, tell, drop=not is_shut)
        raise
    _end(pacer, tell, drop=False)


def _end(pacer: FramePacer, tell: Callable[[str], None], *, drop: bool) -> None:
    pace = pacer.close(drop=drop)
    tell(f"{say_count(pace.frames, 'frame')}, {pace.late} late (the latest by {pace.worst * 1e3:.0f} ms)")


def _play(session: LiveSession, pieces: Iterable[Speech], steer: Callable[[Speech], Speech], pacer: FramePacer) -> None:
    """Play from the first piece of sound to the last frame."""
    from ..runtime.idle import TO_REST

    for piece in pieces:
        if not pacer.is_started:
            pacer.begin(float(piece.duration))
        for motion in session.push(steer(piece)):
            pacer.push(motion)
    steps = round(TO_REST / _STEP) if pacer.paced else 0  # unpaced: only the frames of the sound
    for seconds in (0.0, *[_STEP] * steps):  # in steps, since one long step would make frames late
        for motion in session.idle(seconds):
            pacer.push(motion)
