// The gestures on the time line: one option each of its list, moved by the pointer or the keys.

import type { PlanEdit } from "./api";
import { find, followPointer, make, readName } from "./dom";
import type { Plan, PlannedGesture } from "./messages";
import type { Store } from "./state";
import type { Takes } from "./takes";

const LEAD = 0.5; // seconds before the stroke that are drawn where a plan does not say the start [ours]
const NUDGE = 0.1; // seconds that an arrow key moves a gesture [ours: three frames]
const BEAT = "superimposed-beat";

export interface Span { from: number; to: number }

/** From the start of a gesture to the end of its hold. */
export function spanOf(gesture: PlannedGesture): Span {
  const from = Math.max(gesture.start ?? gesture.stroke - LEAD, 0);
  return { from, to: (gesture.end ?? gesture.stroke + LEAD / 2) + Math.min(gesture.hold ?? 0, 3) };
}

/** The same, but not into the next gesture of one of its hands: that ends the hold. */
function shownSpanOf(gesture: PlannedGesture, all: PlannedGesture[]): Span {
  const { from, to } = spanOf(gesture);
  const meets = (other: PlannedGesture): boolean =>
    other.form !== BEAT && other.stroke > gesture.stroke && (other.hands === gesture.hands || sides(other) === "both" || sides(gesture) === "both");
  const next = Math.min(...all.filter(meets).map((other) => spanOf(other).from));
  return { from, to: Math.max(Math.min(to, next), gesture.stroke + 0.05) };
}

const sides = (gesture: PlannedGesture): string => gesture.hands ?? "both";

/** Whether a part of a gesture lies in a stretch that is locked. */
export function isLocked(plan: Plan, gesture: PlannedGesture): boolean {
  return touchesLock(plan, shownSpanOf(gesture, plan.gestures ?? []));
}

/** Whether a part of a stretch is locked. */
export function touchesLock(plan: Plan, { from, to }: Span): boolean {
  return (plan.locked ?? []).some((stretch) => stretch.from < to && from < stretch.to);
}

/** The edit that locks a stretch; if a part of it is locked, the one that unlocks all: a plan knows no more. */
export function lockOrUnlock(plan: Plan, { from, to }: Span): PlanEdit {
  return touchesLock(plan, { from, to }) ? { kind: "unlock" } : { kind: "lock", start: from, end: to };
}

function describe(gesture: PlannedGesture, locked: boolean): string {
  const hands = { left: "left hand", right: "right hand", both: "both hands" }[gesture.hands ?? "both"];
  const word = gesture.word ? `, on the word ${gesture.word}` : "";
  return `${readName(gesture.form)}, ${hands}, at ${gesture.stroke.toFixed(1)} seconds${word}${locked ? ", locked" : ""}`;
}

/** Take a gesture off the plan, and say whether it is off: a locked one stays, and the page says why. */
export async function removeGesture(store: Store, takes: Takes, gesture: PlannedGesture): Promise<boolean> {
  const { plan } = store.take;
  if (plan !== null && isLocked(plan, gesture)) {
    store.update({ problem: "this gesture is locked: press K to unlock it" });
    return false;
  }
  return takes.edit({ kind: "remove", gesture: gesture.id });
}

export class GestureTrack {
  private plan: Plan | null = null;
  private seconds = 0;
  private dragging = false;

  constructor(private readonly track: HTMLElement, private readonly store: Store, private readonly takes: Takes) {}

  /** Draw the gestures of the chosen take over `seconds`. */
  draw(seconds: number): void {
    const plan = this.store.take.plan;
    if (this.dragging) return;
    if (plan !== this.plan || seconds !== this.seconds) {
      this.seconds = seconds;
      const focus = this.track.contains(document.activeElement) ? (document.activeElement as HTMLElement).dataset.id : null;
      const place = [...this.track.children].findIndex((each) => (each as HTMLElement).dataset.id === focus);
      this.track.replaceChildren(...(plan?.gestures ?? []).map((gesture) => this.button(plan as Plan, gesture)));
      if (focus) {
        const same = this.track.querySelector<HTMLElement>(`[data-id="${CSS.escape(focus)}"]`);
        const next = this.track.children[Math.min(place, this.track.children.length - 1)] as HTMLElement | undefined;
        (same ?? next ?? find("add-gesture")).focus();
      }
      this.plan = plan;
    }
    for (const button of this.track.children) {
      const isChosen = (button as HTMLElement).dataset.id === this.store.state.gesture;
      button.setAttribute("aria-selected", String(isChosen));
    }
  }

  private button(plan: Plan, gesture: PlannedGesture): HTMLElement {
    const { from, to } = shownSpanOf(gesture, plan.gestures ?? []);
    const locked = isLocked(plan, gesture);
    const beat = gesture.form === BEAT;
    const button = make("button", {
      type: "button", role: "option", tabindex: "-1", "data-item": `gesture ${gesture.id}`,
      class: `gesture ${gesture.hands ?? "both"}${beat ? " beat" : ""}${locked ? " locked" : ""}`,
      "data-id": gesture.id, "aria-label": describe(gesture, locked), "aria-selected": "false", title: describe(gesture, locked),
      click: () => this.store.update({ gesture: gesture.id }),
      keydown: (event: KeyboardEvent) => this.press(event, gesture),
      pointerdown: (event: PointerEvent) => this.drag(event, gesture, button),
    }, beat ? null : make("span", { class: "label" }, readName(gesture.form)));
    const stroke = make("span", { class: "stroke" });
    button.append(stroke);
    const start = beat ? gesture.stroke - 0.04 : from;
    const length = beat ? 0.08 : Math.max(to - from, 0.15);
    button.style.left = `${(start / this.seconds) * 100}%`;
    button.style.width = `${(length / this.seconds) * 100}%`;
    stroke.style.left = `${((gesture.stroke - start) / length) * 100}%`;
    return button;
  }

  private press(event: KeyboardEvent, gesture: PlannedGesture): void {
    const sign = event.key === "ArrowLeft" ? -1 : event.key === "ArrowRight" ? 1 : 0;
    if (sign) void this.move(gesture, sign * NUDGE);
    else if (event.key === "Delete" || event.key === "Backspace") void removeGesture(this.store, this.takes, gesture);
    else if (event.key === "k" || event.key === "K") this.lock(gesture);
    else return;
    event.preventDefault();
    event.stopPropagation();
  }

  /** Move a gesture by so many seconds from where it then is: keys come faster than the server answers. */
  private move({ id }: PlannedGesture, by: number): Promise<boolean> {
    return this.takes.edit((plan) => {
      const gesture = plan.gestures?.find((each) => each.id === id);
      if (gesture === undefined) return null;
      const time = Math.min(Math.max(gesture.stroke + by, 0), this.seconds);
      return { kind: "move", gesture: id, to: Math.round(time * 1000) / 1000 };
    });
  }

  /** Lock the stretch of a gesture, or unlock it. */
  lock(gesture: PlannedGesture): void {
    void this.takes.edit((plan) => lockOrUnlock(plan, shownSpanOf(gesture, plan.gestures ?? [])));
  }

  private drag(down: PointerEvent, gesture: PlannedGesture, button: HTMLElement): void {
    if (down.button !== 0) return;
    const perSecond = this.track.clientWidth / this.seconds;
    let way = 0;
    const onMove = (event: PointerEvent): void => {
      way = event.clientX - down.clientX;
      this.dragging = Math.abs(way) > 3 || this.dragging;
      if (this.dragging) button.style.transform = `translateX(${way}px)`;
    };
    const onUp = (event: PointerEvent): void => {
      const move = this.dragging && event.type === "pointerup";
      this.dragging = false;
      const settle = (): void => void button.style.removeProperty("transform");
      if (move) void this.move(gesture, way / perSecond).then(settle);
      else settle();
    };
    followPointer(button, down, onMove, onUp);
  }
}
