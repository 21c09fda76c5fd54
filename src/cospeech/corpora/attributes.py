"""Measures of a gesturing style: how often, how large, with which arm, where the body is turned, sitting or standing.

Ahuja et al. 2020 transfer these between speakers, whom they chose by eye (supplement, table 3); all definitions are ours.
Positions are taken from the neck, in widths of the shoulders (their median distance), in 3-D in the axes of the torso, so that
an arm that stands still does not move when the body does. A *stroke* begins where the speed of the faster wrist is above `RISE`
and twice its lowest since the last stroke. It ends where the speed falls below half of its peak.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..errors import InputError
from ..motion.motion import Motion
from ..motion.points import Points
from ..motion.rotations import Array
from ..motion.skeletons import pats, ted
from .store import Store

__all__ = ["Attributes", "attributes_of", "body_of", "speaker_attributes"]

RISE = 1.4  # widths per second: half a metre per second, as movement statistics count strokes, with shoulders of .36 m
SPAN = 1 / 15  # seconds before and after, between which speed is measured: PATS' frame, so that frame rates are comparable
REACH = 0.59  # widths; mean distance of the hands before the neck, of the synthetic speakers in 3-D (docs/corpora/synthetic.md)
SEATED = 0.75  # of the legs' length; sitting, the hips are at about half of it (the shins'), standing at nearly all of it
MOST = 1800.0  # seconds of each speaker that `speaker_attributes` looks at: half an hour settles all five
_SIDE_JOINTS = {
    "shoulder": ("*UpperArm", "@Shoulder", "^Arm", "*_shoulder", "upperarm_#", "*Shoulder"),
    "collar": ("*Shoulder", "^Shoulder", "*_collar", "clavicle_#"),
    "wrist": ("*Hand", "@Wrist", "^Hand", "*_wrist", "hand_#", "*Wrist"),
    "thigh": ("*UpperLeg", "^UpLeg", "*_hip", "thigh_#"),
    "knee": ("*LowerLeg", "^Leg", "*_knee", "calf_#"),
    "ankle": ("*Foot", "^Foot", "*_ankle", "foot_#"),
}
"""Joint → what skeletons call it: ours and VRM's, PATS', BEAT's (also Trinity's and Mixamo's), SMPL-X', Unreal's, TED's."""
_MARKS = {"left": {"*": "left", "@": "L", "^": "Left", "#": "l"}, "right": {"*": "right", "@": "R", "^": "Right", "#": "r"}}
_NECKS = ("neck", "Neck", "neck_01")
_CHESTS = ("upperChest", "Spine3", "spine3", "spine_05", "Spine2", "chest", "spine")  # TED's: the last
_LEG = re.compile("(?i)leg|knee|calf")  # channels of representations with legs; the others decode to a body that stands


@dataclass(frozen=True)
class Attributes:
    """How somebody gestures.

    Args:
        rate: strokes per minute.
        amplitude: root of the mean square of the wrists' distance from where they are on average, shoulder widths.
        right_share: the right wrist's share of the distance that both wrists travel, 0 … 1; .5 where neither moves.
        orientation: degrees that the body is turned to its own left. In 2-D it is estimated from how far left the middle
            between the hands is, `REACH` before the body; using one hand more than the other moves it by some degrees.
        seated: share of time in which the hips are lower than `SEATED` of the legs; None where there are no legs.
    """

    rate: float
    amplitude: float
    right_share: float
    orientation: float
    seated: float | None


def attributes_of(clips: Array | Iterable[Array], names: Sequence[str], fps: float) -> Attributes:
    """The attributes of one speaker.

    Args:
        clips: (T, J, 2 or 3) positions of the joints, y up, the person's left at +x; or several such.
        names: of the J joints, as one of our skeletons (`cospeech.motion.skeletons`) has them, or PATS' or TED's key points.
        fps: frames per second.

    Raises:
        InputError: no neck, shoulders or wrists among the names, another shape, a value that is not finite, or no frame.
    """
    looks = []
    for clip in (clips,) if isinstance(clips, np.ndarray) else clips:
        if clip.ndim != 3 or clip.shape[1:] not in ((len(names), 2), (len(names), 3)) or not np.isfinite(clip).all():
            raise InputError(f"positions of shape {clip.shape} for {len(names)} joints", "(T, J, 2 or 3), all finite")
        looks += [_look(np.asarray(clip, np.float64), names)] if len(clip) else []
    if not looks or not fps > 0:
        raise InputError("no positions to measure", "name at least one frame")
    width = float(np.median(np.concatenate([one.widths for one in looks])))
    if not width > 0:
        raise InputError("shoulders without width", "did the detection fail?")
    wrists = [one.wrists / width for one in looks]
    speeds = [_speeds(places, fps) for places in wrists]
    ways = np.concatenate(speeds).sum(0)
    frames = sum(len(places) for places in wrists)
    everywhere = np.concatenate(wrists)
    away = everywhere - everywhere.mean(0)
    lines = np.concatenate([one.facing / np.array([width, 1.0]) if one.flat else one.facing for one in looks]).mean(0)
    hips = [one.hips for one in looks if one.hips is not None]
    return Attributes(
        rate=sum(_strokes(speed.max(1)) for speed in speeds) / (frames / fps / 60),
        amplitude=float(np.sqrt(np.square(away).sum(-1).mean())),
        right_share=float(ways[1] / ways.sum()) if ways.sum() > 0 else 0.5,
        orientation=float(np.degrees(np.arctan2(lines[0], lines[1]))),
        seated=float((np.concatenate(hips) < SEATED).mean()) if hips else None,
    )


def speaker_attributes(store: Store, decode: Callable[[Array, float], Motion | Points]) -> dict[str, Attributes]:
    """Speaker of a store → attributes.

    Args:
        store: with poses.
        decode: of its representation: ``find_pose(store.pose).decode``.

    Raises:
        InputError: a body without the joints that are looked at.
    """

    def bodies(speaker: str) -> Iterator[Array]:
        seconds = 0.0
        for entry in store.clips:
            if entry.speaker == speaker and seconds < MOST:
                yield body_of(decode(np.asarray(store.clip(entry)["pose"], np.float64), store.fps))[0]
                seconds += entry.frames / store.fps

    names = body_of(decode(np.asarray(store.arrays["pose"][:1], np.float64), store.fps))[1]
    attributes = {speaker: attributes_of(bodies(speaker), names, store.fps) for speaker in store.speakers}
    legs = any(_LEG.search(name) for name in store.names.get("pose", ()))
    return attributes if legs else {speaker: replace(one, seated=None) for speaker, one in attributes.items()}


def body_of(body: Motion | Points) -> tuple[Array, tuple[str, ...]]:
    """(T, J, 2 or 3) positions and the J names, as `attributes_of` takes them."""
    if isinstance(body, Motion):
        return body.positions(), body.skeleton.names
    return body.values, {"ted": ted.JOINTS, "pats": pats.JOINTS}[body.layout]


@dataclass(frozen=True)
class _Look:
    """Measures of one clip: wrists (T, 2, D) from the neck, widths (T,) of the shoulders, facing (T, 2): to the left, to the
    front; height of the hips (T,) by the legs' length."""

    wrists: Array
    widths: Array
    facing: Array
    hips: Array | None
    flat: bool


def _look(places: Array, names: Sequence[str]) -> _Look:
    neck, chest, pairs = _find(names)
    arms = places[:, pairs["wrist"]] - places[:, neck, None]
    line = places[:, pairs["shoulder"][0]] - places[:, pairs["shoulder"][1]]
    widths = np.linalg.norm(line, axis=-1)
    if places.shape[2] == 2:
        leftward = arms[..., 0].mean(1)
        return _Look(arms, widths, np.stack([leftward, np.full_like(leftward, REACH)], -1), None, True)
    trunk = _torso(places[:, neck], places[:, chest], places[:, pairs.get("collar", pairs["shoulder"])])
    wrists = np.einsum("twk,tak->twa", arms, trunk)
    facing = np.stack([-line[:, 2], line[:, 0]], -1) / np.maximum(np.hypot(line[:, 0], line[:, 2]), 1e-9)[:, None]
    return _Look(wrists, widths, facing, _hips(places, pairs), False)


def _torso(neck: Array, chest: Array, collars: Array) -> Array:
    """(T, 3, 3) axes of the torso in its rows: to the left, up, to the front. None of the joints moves with an arm."""
    up, line = neck - chest, collars[:, 0] - collars[:, 1]
    if np.abs(line).max() < 0.05 * np.abs(up).max():  # BEAT's and Trinity's collar bones begin at one point, before the spine
        line = np.cross(up, collars.mean(1) - chest)
    x = line / np.maximum(np.linalg.norm(line, axis=-1, keepdims=True), 1e-9)
    y = up - np.einsum("tk,tk->t", up, x)[:, None] * x
    y = y / np.maximum(np.linalg.norm(y, axis=-1, keepdims=True), 1e-9)
    return np.stack([x, y, np.cross(x, y)], 1)


def _hips(places: Array, pairs: dict[str, list[int]]) -> Array | None:
    """(T,) height of the hips over the lower ankle, by the length of thigh and shin."""
    if not {"thigh", "knee", "ankle"} <= {*pairs}:
        return None
    thigh, knee, ankle = (places[:, pairs[name]] for name in ("thigh", "knee", "ankle"))
    legs = (np.linalg.norm(thigh - knee, axis=-1) + np.linalg.norm(knee - ankle, axis=-1)).mean()
    return (thigh[..., 1].mean(1) - ankle[..., 1].min(1)) / max(float(legs), 1e-9)


def _find(names: Sequence[str]) -> tuple[int, int, dict[str, list[int]]]:
    """Numbers of the neck, of the chest (PATS: of the neck), and left and right of each of `_SIDE_JOINTS` that there is."""
    plain = {name.rpartition(":")[2]: k for k, name in reversed(list(enumerate(names)))}
    pairs: dict[str, list[int]] = {}
    for part, patterns in _SIDE_JOINTS.items():
        for pattern in reversed(patterns):
            both = [plain.get("".join(marks.get(c, c) for c in pattern)) for marks in _MARKS.values()]
            if None not in both:
                pairs[part] = both  # type: ignore[assignment]  # just checked
    neck, chest = (next((plain[name] for name in chain if name in plain), None) for chain in (_NECKS, _CHESTS))
    if neck is None or not {"shoulder", "wrist"} <= {*pairs}:
        raise InputError(f"no neck, shoulders and wrists among {', '.join(list(names)[:6])}, …", "joints of a known skeleton")
    return neck, neck if chest is None else chest, pairs


def _speeds(places: Array, fps: float) -> Array:
    """(T - 2k, 2) widths per second of the wrists; none of a clip that is too short."""
    k = max(1, round(fps * SPAN))
    return np.asarray(np.linalg.norm(places[2 * k :] - places[: -2 * k], axis=-1) * (fps / (2 * k)))


def _strokes(speed: Array) -> int:
    """The number of strokes: the speed rises above `RISE` and to twice its low, after it fell to half of its last peak."""
    count, up, high, low = 0, False, 0.0, 0.0
    for value in speed.tolist():
        if up:
            high = max(high, value)
            up = value >= high / 2
            low = value
        else:
            low = min(low, value)
            if value >= max(RISE, 2 * low):
                count, up, high = count + 1, True, value
    return count
