// The tracks of values: what style, emotion and intensity hold when, each a row of segments that the pointer and the keys change.

import type { PlanEdit } from "./api";
import { find, followPointer, formatTime, make, readName } from "./dom";
import type { Plan } from "./messages";
import { LEAST_STRETCH, type Store } from "./state";
import type { Takes } from "./takes";

const VALUES = ["style", "emotion", "intensity"] as const;
type Value = (typeof VALUES)[number];
const NUDGE = 0.1; // seconds that an arrow key moves a segment or its end [ours: as of gestures]
const EDGE = 7; // pixels at the end of a segment that change its length [ours]

interface Segment { from: number; to: number; text: string }

/** The stretches of a plan in which a value differs from the rest, neighbours with the same value as one. */
export function segmentsOf(plan: Plan | null, name: Value): Segment[] {
  const segments: Segment[] = [];
  for (const stretch of [...(plan?.stretches ?? [])].sort((a, b) => a.from - b.from)) {
    const value = stretch[name];
    if (value == null) continue;
    const last = segments[segments.length - 1];
    if (last && last.text === String(value) && stretch.from - last.to < 1e-3) last.to = stretch.to;
    else segments.push({ from: stretch.from, to: stretch.to, text: String(value) });
  }
  return segments;
}

export class ValueTracks {
  private readonly rows: Record<Value, HTMLElement>;
  private plan: Plan | null = null;
  private base = "";
  private seconds = 1;
  private dragging = false;

  constructor(private readonly store: Store, private readonly takes: Takes, select: (event: PointerEvent, then: () => void) => void) {
    const row = (name: Value): HTMLElement => make("div", {
      class: "track", role: "group", "data-value": name,
      pointerdown: (event: PointerEvent) => {
        if (event.target === event.currentTarget) select(event, () => find(`stretch-${name}`).focus());
      },
    });
    this.rows = { style: row("style"), emotion: row("emotion"), intensity: row("intensity") };
    find("tracks").replaceChildren(...VALUES.map((name) => this.rows[name]));
  }

  /** Draw the values of the chosen take over `seconds`. */
  draw(seconds: number): void {
    const { plan } = this.store.take;
    const base = VALUES.map((name) => this.tellBase(name)).join("|");
    find("tracks").hidden = plan === null;
    if (this.dragging || (plan === this.plan && base === this.base && seconds === this.seconds)) return;
    this.plan = plan;
    this.base = base;
    this.seconds = seconds;
    for (const name of VALUES) {
      const row = this.rows[name];
      const focus = row.contains(document.activeElement) ? (document.activeElement as HTMLElement).dataset.order : null;
      row.setAttribute("aria-label", `${readName(name)}: ${this.tellBase(name)}`);
      const label = make("span", { class: "base", "aria-hidden": "true" }, `${readName(name)}: ${this.tellBase(name)}`);
      row.replaceChildren(label, ...segmentsOf(plan, name).map((segment, k) => this.button(name, segment, k)));
      if (focus) row.querySelector<HTMLElement>(`[data-order="${focus}"]`)?.focus();
    }
  }

  /** What holds where no segment says otherwise. */
  private tellBase(name: Value): string {
    const { settings } = this.store.state;
    const plan = this.store.take.plan;
    if (name === "style") return readName(plan?.style || settings.style || "the model's own");
    if (name === "intensity") return String(plan?.intensity ?? settings.intensity);
    const emotion = plan?.emotion ?? settings.emotion;
    return typeof emotion !== "string" ? "changes" : emotion === "auto" ? "as the voice sounds" : readName(emotion);
  }

  private button(name: Value, segment: Segment, order: number): HTMLElement {
    const span = `from ${formatTime(segment.from)} to ${formatTime(segment.to)}`;
    const places = [segment];
    const button = make("button", {
      type: "button", role: "option", tabindex: "-1", class: "segment", "data-order": String(order),
      "data-item": `${name} ${order}`, "data-span": `${segment.from} ${segment.to}`, "aria-selected": "false",
      "aria-label": `${readName(name)} ${readName(segment.text)}, ${span}`,
      title: `${readName(segment.text)}, ${span}. Drag it or its ends; Delete takes it off`,
      click: () => this.store.update({ selection: [segment.from, segment.to] }),
      keydown: (event: KeyboardEvent) => this.press(event, name, places),
      pointerdown: (event: PointerEvent) => this.drag(event, name, places, button),
    }, make("span", { class: "label" }, readName(segment.text)));
    this.place(button, segment.from, segment.to);
    return button;
  }

  private place(button: HTMLElement, from: number, to: number): void {
    button.style.left = `${(from / this.seconds) * 100}%`;
    button.style.width = `${((to - from) / this.seconds) * 100}%`;
  }

  private press(event: KeyboardEvent, name: Value, places: Segment[]): void {
    const by = event.key === "ArrowLeft" ? -NUDGE : event.key === "ArrowRight" ? NUDGE : 0;
    if (by) void this.move(name, places, (old) => event.shiftKey ? this.stretch(old, 0, by) : this.shift(old, by));
    else if (event.key === "Delete" || event.key === "Backspace") void this.remove(name, places);
    else return;
    event.preventDefault();
    event.stopPropagation();
  }

  private shift(segment: Segment, by: number): Segment {
    const most = this.seconds - segment.to;
    const way = Math.min(Math.max(by, -segment.from), Math.max(most, 0));
    return { ...segment, from: segment.from + way, to: segment.to + way };
  }

  /** The segment with its first or last border elsewhere. */
  private stretch(segment: Segment, byFrom: number, byTo: number): Segment {
    const from = Math.min(Math.max(segment.from + byFrom, 0), segment.to - LEAST_STRETCH);
    const to = Math.max(Math.min(segment.to + byTo, this.seconds), segment.from + LEAST_STRETCH);
    return byFrom ? { ...segment, from } : { ...segment, to };
  }

  /**
   * Give a segment other borders, from those that it then has: keys come faster than the server answers. `places` are where it
   * was drawn and where it was moved since.
   */
  private async move(name: Value, places: Segment[], change: (old: Segment) => Segment): Promise<void> {
    let next = null as Segment | null;
    const leave = (plan: Plan): PlanEdit | null => {
      const old = findLast(plan, name, places);
      if (old === null) return null;
      const changed = round(change(old));
      if (changed.from === round(old).from && changed.to === round(old).to) return null;
      places.push(changed);
      next = changed;
      return clear(name, old);
    };
    const isMoved = await this.takes.edit(leave, () => next && set(name, next));
    if (isMoved && next !== null && this.store.state.selection !== null) this.store.update({ selection: [next.from, next.to] });
  }

  private remove(name: Value, places: Segment[]): Promise<boolean> {
    return this.takes.edit((plan) => {
      const segment = findLast(plan, name, places);
      return segment && clear(name, segment);
    });
  }

  private drag(down: PointerEvent, name: Value, places: Segment[], button: HTMLElement): void {
    if (down.button !== 0) return;
    const segment = places[0]; // as it is drawn
    const box = button.getBoundingClientRect();
    const edge = Math.min(EDGE, box.width / 4);
    const first = down.clientX - box.left < edge;
    const last = box.right - down.clientX < edge;
    const perSecond = this.rows[name].clientWidth / this.seconds;
    let by = 0;
    const change = (old: Segment): Segment => first ? this.stretch(old, by, 0) : last ? this.stretch(old, 0, by) : this.shift(old, by);
    const onMove = (event: PointerEvent): void => {
      const pixels = event.clientX - down.clientX;
      this.dragging = Math.abs(pixels) > 3 || this.dragging;
      if (!this.dragging) return;
      by = pixels / perSecond;
      const { from, to } = change(segment);
      this.place(button, from, to);
    };
    const onUp = (event: PointerEvent): void => {
      const isDrop = this.dragging && event.type === "pointerup";
      this.dragging = false;
      const settle = (): void => this.place(button, segment.from, segment.to);
      if (isDrop) void this.move(name, places, change).then(settle);
      else settle();
    };
    followPointer(button, down, onMove, onUp);
  }
}

function clear(name: Value, { from, to }: Segment): PlanEdit {
  return { kind: "clear", start: from, end: to, names: [name] };
}

function set(name: Value, { from, to, text }: Segment): PlanEdit {
  return { kind: "set", start: from, end: to, [name]: name === "intensity" ? Number(text) : text };
}

/** To the millisecond. */
function round(segment: Segment): Segment {
  return { ...segment, from: Math.round(segment.from * 1000) / 1000, to: Math.round(segment.to * 1000) / 1000 };
}

/** The segment of a plan at the last of these places where it has one; null: it was taken off. */
function findLast(plan: Plan, name: Value, places: Segment[]): Segment | null {
  const segments = segmentsOf(plan, name);
  for (const place of [...places].reverse()) {
    const common = ({ from, to, text }: Segment): number => text === place.text ? Math.min(to, place.to) - Math.max(from, place.from) : 0;
    const [segment] = segments.filter((each) => common(each) > 1e-3).sort((a, b) => common(b) - common(a));
    if (segment !== undefined) return segment;
  }
  return null;
}
