"""Planning: what to do when, from the speech up to the look-ahead.

The planner is asked every tick (0.1 s). It sets moves on the tracks of both hands and of the body; all of them start at
or after the tick, so frames before it may already have been sent. Its only source of chance is one generator seeded per
take, drawn in tick order: streamed equals offline.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from random import Random

import numpy as np

from ..audio.prosodic_events import Accent, Phrase
from ..audio.speech import Word
from ..face.expressions import BROWS_EARLY
from ..motion.kinematics.hands import CHANNELS, LAGS
from ..motion.rotations import Array
from .bouts import Bouts
from .emotion_modifiers import EmotionModifier
from .gesture import CHAINED, LEFT, RIGHT, RUN_UP, Gesture, GestureOverride
from .gesture_space import GesturePlacement, keep_beside_face, reach_time, shortest_reach_time, stroke_time, stroke_times
from .hand_state import HandState, effort_of
from .lexicon import form_for
from .minimum_jerk import MinimumJerkTrack, peak_share, skew_for
from .posture import Posture
from .repertoire import FORMS, LEXICAL_FORMS, Form, weigh_forms
from .rest_poses import RESTS
from .retraction import retract, sink
from .strokes import draw_arc, draw_beat, draw_skew, draw_twist, recoil
from .styles import Style

__all__ = ["LEFT", "RIGHT", "Planner"]

LEAD = 0.1  # seconds from the wrist's speed peak to the energy peak (motion.md §1: .07–.10 s measured)
HORIZON = 0.78  # seconds ahead of the tick up to which accents are taken up
_MEMORY = 16.0  # seconds after which a stroke moves no face [ours: twelve seconds of motion are made at once, at most]
SLACK = 0.02  # seconds between the tick and the earliest onset of a move
_EARLIEST = 0.35  # share of a preparation at which its speed may peak first; and last, from its end (ours)
_MERGE = 0.03  # seconds by which the end of the preparation brings the peak of speed forward (ours, measured)
_CHAIN = 0.65  # share of the way back to where the hand already is that a preparation leaves out: gestures chain up
_FROM_HANGING = 0.3  # share of its wind-up that a hand at the hip keeps: the body is in the way (ours, by the laws of the body)
_HANGS, _STAYS_OUT = 1.5, 0.3  # seconds that a hand hangs; how often, after that, a gesture leaves it out, to usually (ours)
_SHORTEST_STROKE = 0.6  # share of the usual length of a stroke at least, where a plan leaves little time for it (ours)
_STIRS, _STIR_SIZE = 0.75, 0.75  # how often a hand beats on an accent without a gesture, in a bout; and how large (ours)
_BEATS_TO = -0.9  # arm lengths above the shoulder that beats go down to: those of a low hand are smaller (ours)
_BEATS = 0.5  # how often a raised hand beats in place of a new gesture (ours)
_EASES = 0.7  # how often a raised hand in a bout first goes a part of the way to rest (ours)
_GOES_ALONG = (0.3, 0.7)  # of a beat of one hand: how much the other one makes of it, if it is raised (ours)
_PARKS = 0.4  # how often a raised hand comes down while the other makes a gesture alone (ours)
_ALONG = 0.85  # how often the right hand comes down with the left one (ours)
_LULL = 0.5  # seconds after its last stroke for which a hand stays up between bouts (ours)
_DROPS = 0.8  # how often a hand hangs after the last gesture before a pause (ours)
_LEAST = (0.36, 0.25)  # share of an unhurried preparation that a gesture needs: without a word, with one (ours)
_HANG_FACTOR = 1.6  # factor on it for an arm that hangs: it does not fly up (ours)
_AGAIN, _WEARY = 2.2, 3.0  # seconds after a stroke in which another follows in place; after a gesture in which hands beat
_SOONER = 0.65  # share of the latter that is lost where the gesture was far out or high (ours)
_BLEND = 0.30  # share of the preparation that the stroke overlaps, so that the path is round


class Planner:
    """Decides for one take.

    Args:
        style: the speaker.
        seed: of this take.
        intensity: overall size, 0 (idle only) … 1.5.
        temperature: 1 = the usual freedom; 0 = always the likeliest form at its usual place.
    """

    def __init__(self, style: Style, *, seed: int, intensity: float = 1.0, temperature: float = 1.0) -> None:
        self.style, self.intensity, self.temperature = style, intensity, temperature
        self.horizon, self.late = HORIZON, 0.0  # as of `cospeech.rules.foresight.Foresight`
        self._random = Random(f"{seed + style.variation}/plan")
        self.posture = Posture(style, Random(f"{seed + style.variation}/posture"), intensity)
        places = [RESTS[style.idle][hand].values() for hand in (LEFT, RIGHT)]
        self.hands = [HandState(MinimumJerkTrack(place, LAGS), place) for place in places]
        self._gesture_space = GesturePlacement(style, self._random, intensity, temperature)
        self.bouts = Bouts(Random(f"{seed + style.variation}/bouts"))
        """When it gestures, and when not."""
        self._strokes: list[Gesture] = []
        self.placed = (0.0, 0.0, 0.0, 0.0)
        """Of the last gesture: seconds of its hold, and where its first stroke ends: out, up and forward, arm lengths."""
        self._accents: list[Accent] = []
        self._last_accent = self._last_word = -1.0
        self.stroke_accents: deque[float] = deque()
        """Times of recent accents with a stroke that was planned early enough for the face to go along."""
        self._recent: deque[str] = deque(maxlen=3)
        self._forms = weigh_forms(style.repertoire)

    def restyle(self, now: float, style: Style, intensity: float, modifier: EmotionModifier) -> None:
        """Set another style and size for what is planned from ``now`` seconds on; hands at rest go to its resting place."""
        is_new_rest = (style.rest, style.idle) != (self.style.rest, self.style.idle)
        self.style, self.intensity, self._forms = style, intensity, weigh_forms(style.repertoire)
        self._gesture_space.style, self._gesture_space.intensity = style, intensity
        self.posture.restyle(style, intensity)
        for hand in [h for h, state in enumerate(self.hands) if is_new_rest and state.place != "up" and now > state.busy]:
            self._retract(now, hand, self.hands[hand].place, modifier, self._random)

    @property
    def body(self) -> MinimumJerkTrack:
        """MinimumJerkTrack of hips, torso, head, gaze and feet."""
        return self.posture.track

    def decide(
        self, now: float, *, accents: Sequence[Accent], phrases: Sequence[Phrase], words: Sequence[Word],
        modifier: EmotionModifier,
    ) -> list[Gesture]:  # fmt: skip
        """One tick: plan strokes for new accents and words, and let hands go that are done. Returns the planned strokes."""
        speaking = any(p.start <= now + 0.5 and p.end >= now - 0.1 for p in phrases)
        self._accents = list(accents)
        self.posture.decide(now, phrases=phrases, modifier=modifier, speaking=speaking)
        self.bouts.decide(now, phrases, self.style.stillness / modifier.rate**0.5)  # lively moods rest for less long
        for accent in accents:
            if self._last_accent < accent.time <= now + self.horizon:
                self._last_accent = accent.time
                accent, before = accent._replace(time=accent.time + self.late) if self.late else accent, len(self._strokes)
                if accent.time > now + 0.1 or now == 0:
                    self._on_accent(now, accent, words, modifier)
                self._nod(now, accent, modifier, len(self._strokes) > before)
        self._silent_words(now, words, modifier)
        self._let_go(now, phrases, modifier)
        gestures, self._strokes = self._strokes, []
        return gestures

    def _nod(self, now: float, accent: Accent, modifier: EmotionModifier, has_stroke: bool) -> None:
        """Head and face at an accent, with a stroke of the hands or without."""
        if has_stroke and accent.time >= now + BROWS_EARLY:
            self.stroke_accents.append(accent.time)
        while self.stroke_accents and self.stroke_accents[0] < now - _MEMORY:
            self.stroke_accents.popleft()
        self.posture.on_accent(now, accent, modifier, has_stroke)

    def _on_accent(self, now: float, accent: Accent, words: Sequence[Word], modifier: EmotionModifier) -> None:
        if self.intensity <= 0:
            return
        near = [w for w in words if w.start - 0.12 <= accent.time <= w.end + 0.12 and form_for(w.text, w.language)]
        word = max(near, key=lambda w: (form_for(w.text, w.language) or ("", 0.0))[1], default=None)
        soon = self._strong_word_soon(accent.time, words)
        if word is not None and word.start > self._last_word:
            name, chance = form_for(word.text, word.language) or ("", 0.0)
            chance *= 0.0 if soon and chance < 0.5 else 0.95
            if self._random.random() < chance and self._perform(now, accent.time, accent.strength, name, modifier, word):
                self._last_word = word.start
                return
        if soon:
            return
        willing = self.bouts.willingness(self.style.rate * modifier.rate, accent.strength, self.intensity)
        beating = [s for s in self.hands if s.can_beat() and accent.time - s.gesture_end < _WEARY * (1 - _SOONER * s.effort)]
        beats = self.bouts.busy and (beating or [s for s in self.hands if s.place == "rest"])
        if self._random.random() >= willing:
            if beats and self._random.random() < _STIRS:
                self._beat(now, accent, beats, modifier, _STIR_SIZE)
            return
        again = beating and self.bouts.busy and accent.time - min(s.last_stroke for s in beating) < _AGAIN
        if again and self._random.random() < _BEATS:
            self._beat(now, accent, beating, modifier, 1.0)
            return
        if not self._perform(now, accent.time, accent.strength, self._choose_form(modifier), modifier, None) and beating:
            self._beat(now, accent, beating, modifier, 0.9)

    def _strong_word_soon(self, at: float, words: Sequence[Word]) -> bool:
        """Whether a word with a gesture of its own comes so soon that hands had better be free for it."""
        soon = (word for word in words if self._last_word < word.start and at + 0.12 < word.start < at + 0.62)
        forms = filter(None, (form_for(word.text, word.language) for word in soon))
        return any(chance >= 0.5 and LEXICAL_FORMS[form].score >= 0.8 for form, chance in forms)

    def _silent_words(self, now: float, words: Sequence[Word], modifier: EmotionModifier) -> None:
        """Words with a strong gesture of their own get it even without an accent."""
        for word in words:
            middle = word.start + 0.4 * (word.end - word.start)
            if not (self._last_word < word.start and now + 0.45 < middle <= now + self.horizon - 0.1) or self.intensity <= 0:
                continue
            entry = form_for(word.text, word.language)
            if entry is None or LEXICAL_FORMS[entry[0]].score < 0.8 or entry[1] < 0.5 or middle <= self._last_accent + 0.1:
                continue
            self._last_word = word.start
            if self._random.random() < entry[1] * 0.6:
                self._perform(now, middle, 0.5, entry[0], modifier, word)

    def _choose_form(self, modifier: EmotionModifier) -> str:
        names = list(self._forms)
        sharp = 1.0 / max(modifier.variety * max(self.temperature, 0.05), 0.05) ** 0.5
        weights = [self._forms[n] ** sharp * (0.3 if n in self._recent else 1.0) for n in names]
        name = self._random.choices(names, weights)[0]
        self._recent.append(name)
        return name

    def _which_hands(self, form: Form, now: float) -> tuple[list[int], str]:
        """Hands that perform, leader first; one that has hung for long seldom stays out."""
        leader = RIGHT if self._random.random() < self.style.hand else LEFT
        other = self.hands[1 - leader]
        alone = (1.0 - self.style.both) * (_STAYS_OUT if other.place == "idle" and now - other.busy > _HANGS else 1.0)
        both = form.hands == "both" or (form.hands == "any" and self._random.random() >= alone)
        return ([leader, 1 - leader], "both") if both else ([leader], "right" if leader == RIGHT else "left")

    def _perform(
        self, now: float, at: float, strength: float, name: str, modifier: EmotionModifier, word: Word | None,
        override: GestureOverride | None = None,
    ) -> bool:  # fmt: skip
        """Plan preparation and stroke(s) of a form whose first stroke peaks at the accent; False where there is no time."""
        form = FORMS.get(name) or LEXICAL_FORMS[name]
        hands, label = self._which_hands(form, now)
        hands, label = override.choose_hands(hands, label) if override else (hands, label)
        states = [self.hands[h] for h in hands]
        leader = states[0]
        tempo = self.style.tempo * modifier.tempo * (0.85 + 0.3 * strength) * self._random.uniform(0.92, 1.1)
        effort = (1.15 + 0.9 * strength) * self.style.amplitude * modifier.amplitude * self.intensity
        effort = effort if effort < 1.8 else 1.8 + 0.6 * float(np.tanh((effort - 1.8) / 0.6))  # arms are only so long
        poses = self._gesture_space.of(form, effort * override.size if override else effort, modifier)
        if leader.place == "up" and name in FORMS:
            poses[0][:3] += _CHAIN * (leader.track.target[:3] - poses[0][:3])
        if override:
            override.shift(poses)
        earliest = now + SLACK if now > 0 else -RUN_UP
        usual = stroke_time(poses[0], poses[1], tempo, modifier)
        if override:  # it hurries where there is little time
            usual = min(usual, max(2 * (override.stroke - earliest - 0.2), _SHORTEST_STROKE * usual))
        stroke = stroke_times(usual, poses, tempo, modifier, override)[0]
        skew = draw_skew(self._random, 0.1 - 0.3 * modifier.abrupt, 0.33)
        onset = override.stroke - stroke / 2 if override else at - LEAD + _MERGE - stroke * peak_share(skew)
        ready = max(earliest, *(s.busy for s in states))
        reach = reach_time(leader.track.target, poses[0], tempo)
        available = onset - ready
        slower = [_HANG_FACTOR if s.place == "idle" and not self.style.seated else 1.0 for s in states]
        hurries = [shortest_reach_time(s.track.target, poses[0], tempo) * by for s, by in zip(states, slower, strict=True)]
        least = max(_LEAST[word is not None] * min(reach, 0.9) * slower[0], *hurries)
        if (onset - earliest if override else available) < max(0.2, 0.0 if override else least):
            return False
        prepare, wind = self._preparation(at, onset, reach, max(available, 0.2))
        prepare = max(onset - max(override.start, earliest), 0.2) if override else prepare
        start, end, hand_poses = onset - prepare, onset, dict[int, list[Array]]()
        for hand in hands:
            own = poses if hand == hands[0] else self._gesture_space.follower(poses, strength, mirrors=name not in FORMS)
            hand_poses[hand] = own
            late = 0.0 if hand == hands[0] else self._random.uniform(-0.01, 0.03)
            end = self._schedule(hand, own, start + late, prepare, onset + late, usual, tempo, modifier, (wind, skew), override)
            self._mark(self.hands[hand], name, onset + stroke / 2, end, modifier)
            self.hands[hand].gesture_end, self.hands[hand].effort = end, effort_of(own[-1])
            if override and override.hold is not None:
                self.hands[hand].up_until, self.hands[hand].keeps = end + override.hold, True
        for hand in {LEFT, RIGHT} - set(hands):
            other = self.hands[hand]
            if other.place == "up" and onset > other.busy and self._random.random() < _PARKS:
                later = max(start, other.busy) + self._random.uniform(0.0, 0.25)
                self._retract(later, hand, "rest", modifier, self._random)
            else:
                self._sympathy(other, leader, start, prepare, onset, stroke, poses)
        self.posture.on_stroke(now, (start, onset, stroke), hand_poses, modifier)
        text, score = (word.text, form.score) if word is not None else ("", form.score)
        self._strokes.append(Gesture(start, onset + stroke / 2, end, name, label, text, score))
        self.placed = (leader.up_until - end, *poses[1][:3].tolist())
        return True

    def _preparation(self, at: float, onset: float, reach: float, available: float) -> tuple[float, float]:
        """Seconds and skew of an unhurried preparation; its speed peaks on an accent before, where one fits."""
        prepare = min(1.7 * reach, available)
        for accent in reversed(self._accents):
            if accent.time < at - 0.15:
                for length in (prepare, 0.8 * prepare, min(1.9 * reach, available)):
                    share = 1 - (onset - accent.time + LEAD) / length
                    if _EARLIEST <= share / (1 + _BLEND) <= 1 - _EARLIEST and length >= 0.8 * min(reach, prepare):
                        return length, skew_for(share / (1 + _BLEND))
        return prepare, draw_skew(self._random, 0.0, 0.2)

    def _schedule(
        self,
        hand: int,
        poses: list[Array],
        start: float,
        prepare: float,
        onset: float,
        usual: float,
        tempo: float,
        modifier: EmotionModifier,
        skews: tuple[float, float],
        override: GestureOverride | None,
    ) -> float:
        """Moves of one hand through all poses; returns the end of the last stroke.

        It winds up on one side of the chord and strikes on the other, goes a little too far and settles.
        """
        draw, state = self._random, self.hands[hand]
        bulge = draw.uniform(0.05, 0.30) * (_FROM_HANGING if state.place == "idle" else 1.0)
        wind = draw_arc(draw, poses[0] - state.track.target, poses[0], -bulge)
        state.track.move(start, prepare * (1 + _BLEND), poses[0], skew=skews[0], arc=wind)
        end = onset
        lengths = stroke_times(usual, poses, tempo, modifier, override)
        for k, length in enumerate(lengths, start=1):
            way = poses[k] - poses[k - 1]
            over = np.zeros(CHANNELS)
            over[:7] = way[:7] * (0.05 + 0.07 * (self.style.tension + modifier.tension)) * draw.uniform(0.5, 1.5)
            arc = draw_arc(draw, way, poses[k], draw.uniform(0.08, 0.30))
            state.track.move(end, length, poses[k] + over, skew=skews[1] if k == 1 else draw_skew(draw, 0.05, 0.3), arc=arc)
            state.track.move(end + 0.78 * length, 0.34 / tempo, poses[k], skew=0.2)
            end += length * (CHAINED if k < len(lengths) else 1.0)
        holds = override.hold or 0.0 if override else 0.0
        sink(state, hand, poses[-1], self.style, draw, end + holds, tempo)
        return end

    def _mark(self, state: HandState, name: str, peak: float, end: float, modifier: EmotionModifier) -> None:
        state.busy, state.place, state.form, state.last_stroke, state.keeps = end - 0.08, "up", name, peak, False
        state.has_eased, state.chance = False, self._random.random()
        state.up_until = end + (0.2 + 1.25 * self.style.hold) * self._random.uniform(0.7, 1.4) / modifier.tempo
        state.up_until = end + (state.up_until - end) * (1.0 - 0.7 * effort_of(state.track.target))

    def _beat(self, now: float, accent: Accent, beating: list[HandState], modifier: EmotionModifier, scale: float) -> bool:
        """A short stroke in place, down and a little forward, with a rebound; False where there is no time."""
        lead = self.hands[RIGHT if self._random.random() < self.style.hand else LEFT]
        if len(beating) == 2 and self._random.random() > 0.45 + 0.5 * self.style.symmetry:
            beating = [lead]
        tempo = self.style.tempo * modifier.tempo
        size = scale * (0.16 + 0.28 * accent.strength) * self.style.amplitude * modifier.amplitude * self.intensity
        stroke = max(0.26, 0.42 / tempo) * (1 - 0.2 * modifier.abrupt)
        skew = draw_skew(self._random, -0.1, 0.3)
        onset = accent.time - LEAD - stroke * peak_share(skew)
        lift = min(0.52 / tempo, onset - max(now + SLACK, max(s.busy for s in beating) - 0.1))
        if lift < 0.16:
            return False
        for state in self.hands:
            beats, jitter = state in beating, self._random.uniform(0, 0.03)
            if not beats and (state.place != "up" or onset - lift < state.busy):
                continue
            share = 1.0 if state is lead or len(beating) == 1 else self._random.uniform(0.3 + 0.5 * self.style.symmetry, 1.1)
            share *= 1.0 if beats else self._random.uniform(*_GOES_ALONG)
            room = max(1.4 * (float(state.track.target[1]) - _BEATS_TO), 0.12)
            up, down = draw_beat(self._random, share * min(size, room))
            top = (state.track.target if state.pose is None else state.pose) + up
            aside = top[0]
            keep_beside_face(top)
            up[0] += top[0] - aside
            state.track.add(onset - lift + jitter, lift * 1.2, up, arc=draw_twist(self._random, up, 0.25))
            state.track.add(onset + jitter, stroke, down, skew=skew, arc=draw_twist(self._random, down, 0.22))
            back = recoil(up + down, state.track.target) if state.place == "up" else -(up + down)
            state.track.add(onset + stroke + 0.05, 0.85 / tempo, back, skew=0.1)
            if beats and state.place == "up":
                self._mark(state, state.form, onset + stroke / 2, onset + stroke, modifier)
            elif beats:
                state.busy = onset + stroke - 0.08
        label = "both" if len(beating) == 2 else ("left" if beating[0] is self.hands[LEFT] else "right")
        self._strokes.append(Gesture(onset - lift, onset + stroke / 2, onset + stroke, "beat", label, "", 0.1))
        return True

    def _sympathy(
        self,
        state: HandState,
        leader: HandState,
        start: float,
        prepare: float,
        onset: float,
        stroke: float,
        poses: list[Array],
    ) -> None:
        """The idle hand stirs along with a one-handed gesture."""
        share = (0.28 + 0.42 * self.style.symmetry) * (0.25 if state.place == "idle" or start < state.busy else 1.0)
        side = self._random.choice((1.0, -1.0))  # mirrored, or to the same side
        for onset_, length, delta in (
            (start + 0.03, prepare * 1.1, poses[0] - leader.home),
            (onset + 0.02, stroke, poses[1] - poses[0]),
        ):
            part = np.zeros(CHANNELS)
            part[:3] = np.minimum(np.maximum(delta[:3], -0.35), 0.35) * share * self._random.uniform(0.6, 1.2)
            part[0] *= side
            part[5] = delta[5] * share * 0.5
            state.track.add(onset_, length, part)
        undo = np.zeros(CHANNELS)
        goal = state.pose if state.place == "up" and state.pose is not None else state.home
        undo[:7] = (goal - state.track.target)[:7] * 0.85
        state.track.add(onset + stroke + self._random.uniform(0.15, 0.5), self._random.uniform(0.7, 1.2), undo)

    def _let_go(self, now: float, phrases: Sequence[Phrase], modifier: EmotionModifier) -> None:
        """Retract hands that have nothing to hold, mostly both at once; drop them for good in pauses."""
        quiet = not any(p.end > now - 0.05 and p.start < now + self.horizon for p in phrases)
        last = max((p.end for p in phrases if p.start <= now), default=0.0)
        along = False
        for hand, state in enumerate(self.hands):
            if now <= state.busy:
                continue
            over = quiet and now > last + 0.7 * self.style.hold
            over = over or along or (not self.bouts.busy and now > state.last_stroke + _LULL)
            if state.place == "up" and (now >= state.up_until or (over and not state.keeps)):
                draw = state.dice()
                if self.bouts.busy and not quiet and not state.has_eased and draw.random() < _EASES:
                    self._retract(now, hand, "up", modifier, draw)
                    continue
                idle = draw.random() < (_DROPS if quiet else 0.8 - 0.5 * self.style.hold)
                idle = self.hands[LEFT].place == "idle" if along else idle
                along = hand == LEFT and draw.random() < _ALONG
                self._retract(now, hand, "idle" if idle else "rest", modifier, draw)
            elif state.place == "rest" and quiet and now > last + 0.6 + self.style.hold:
                self._retract(now, hand, "idle", modifier, state.dice())

    def _retract(self, now: float, hand: int, place: str, modifier: EmotionModifier, draw: Random) -> None:
        """Let a hand come down, if possible on an accent of the speech; see `retract`."""
        beats = [accent.time - LEAD for accent in self._accents]
        retract(self.hands[hand], hand, place, self.style, modifier, draw, now + SLACK, beats)
