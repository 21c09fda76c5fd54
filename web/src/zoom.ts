// The scale of the time line: how many pixels a second has. The buttons, the keys and Ctrl with the wheel change it.

import { enable, find, make } from "./dom";
import type { Store } from "./state";

const USUAL = 64; // pixels of a second before the user zooms; a longer speech scrolls [ours: short words can be read]
const MOST = 512; // pixels of a second at the most [ours: 17 for a frame]
const STEP = 1.5; // of the buttons and the keys [ours]
const WHEEL = 0.002; // of the logarithm of the scale, for a pixel of the wheel [ours: a notch is a fourth more]
const MOST_WHEEL = 200; // pixels of one event that count [ours: a fast wheel does not lose the place]
const LINE = 16; // pixels of a line, where the wheel counts lines
const LABEL = 64; // pixels from one time of the ruler to the next, at the least [ours: 0:00.0 and space]
const STEPS = [0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600]; // seconds between times of the ruler [ours]

/** Seconds between the times of a ruler of so many pixels a second. */
export function stepOf(scale: number): number {
  return STEPS.find((step) => step * scale >= LABEL) ?? STEPS[STEPS.length - 1]!;
}

/** A time of the ruler: 1:05, and 1:05.2 where the times are less than a second apart. */
export function rulerTime(tenths: number, step: number): string {
  const text = `${Math.floor(tenths / 600)}:${String(Math.floor(tenths / 10) % 60).padStart(2, "0")}`;
  return step < 1 ? `${text}.${tenths % 10}` : text;
}

export class Zoom {
  /** Pixels of a second; null: as usual; 0: the whole speech is in view, however wide the window is. */
  private chosen: number | null = null;
  private speech: string | undefined;
  private readonly scroller = find("scroller");
  private readonly ruler = find("ruler");

  /** `time`: where the playhead is; `redraw`: called when the scale is another. */
  constructor(private readonly store: Store, private readonly time: () => number, private readonly redraw: () => void) {
    find("zoom-in").addEventListener("click", () => this.change(STEP));
    find("zoom-out").addEventListener("click", () => this.change(1 / STEP));
    find("zoom-fit").addEventListener("click", () => this.fit());
    this.scroller.addEventListener("wheel", (event) => this.turn(event), { passive: false });
  }

  private get seconds(): number {
    return this.store.state.speech?.seconds ?? 1;
  }

  private get least(): number {
    return this.scroller.clientWidth / this.seconds;
  }

  /** Pixels of a second. */
  get scale(): number {
    const { least } = this;
    return Math.min(Math.max(this.chosen ?? USUAL, least), Math.max(MOST, least));
  }

  /** Take the scale of a speech that was opened, and show which buttons can be pressed. */
  draw(): void {
    const name = this.store.state.speech?.speech;
    if (name !== this.speech) this.chosen = null;
    this.speech = name;
    const { scale, least } = this;
    enable("zoom-in", scale < MOST, "zoom-out");
    enable("zoom-out", scale > least, "zoom-in");
    enable("zoom-fit", scale > least, "zoom-in");
  }

  /** Another scale; the time at `x` pixels of the view stays where it is. */
  private scaleTo(scale: number, x: number): void {
    const time = (this.scroller.scrollLeft + x) / this.scale;
    this.chosen = scale <= this.least * 1.001 ? 0 : Math.min(scale, MOST);
    this.redraw();
    this.scroller.scrollLeft = time * this.scale - x;
  }

  private change(factor: number): void {
    if (this.store.state.speech === null) return;
    this.scaleTo(this.scale * factor, this.anchor());
    this.tell();
  }

  private fit(): void {
    if (this.store.state.speech === null) return;
    this.scaleTo(0, 0);
    this.tell();
  }

  /** Pixels of the view where the playhead is; of its middle, if the playhead is out of view. */
  private anchor(): number {
    const { scrollLeft, clientWidth } = this.scroller;
    const x = this.time() * this.scale - scrollLeft;
    return x >= 0 && x <= clientWidth ? x : clientWidth / 2;
  }

  private tell(): void {
    const seconds = this.scroller.clientWidth / this.scale;
    this.store.update({ notice: `${seconds.toFixed(seconds < 10 ? 1 : 0)} seconds are in view` });
  }

  private turn(event: WheelEvent): void {
    if (!event.ctrlKey) return;
    event.preventDefault(); // of the browser's own zoom
    const pixels = event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? event.deltaY : event.deltaY * LINE;
    const turned = Math.min(Math.max(pixels, -MOST_WHEEL), MOST_WHEEL);
    this.scaleTo(this.scale * Math.exp(-turned * WHEEL), event.clientX - this.scroller.getBoundingClientRect().left);
  }

  /** Draw the times that are in view. */
  drawRuler(): void {
    const { scale, seconds } = this;
    const { scrollLeft, clientWidth } = this.scroller;
    const step = stepOf(scale);
    const last = Math.min((scrollLeft + clientWidth) / scale, seconds);
    const marks: HTMLElement[] = [];
    for (let k = Math.floor(scrollLeft / scale / step); k * step <= last; k += 1) {
      const left = k * step * scale - scrollLeft;
      const isCut = left + LABEL * 0.8 > Math.min(clientWidth, seconds * scale - scrollLeft); // at the end of the view or the speech
      const mark = make("span", {}, isCut ? "" : rulerTime(Math.round(k * step * 10), step));
      mark.style.left = `${left}px`;
      marks.push(mark);
    }
    this.ruler.replaceChildren(...marks);
  }
}
