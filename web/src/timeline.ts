// The time line: waveform, words, gestures, stretches, the selection and the playhead.

import { find, followPointer, formatTime, make } from "./dom";
import { GestureTrack } from "./gestures";
import type { HeardWord, Plan, Stretch } from "./messages";
import type { Player } from "./player";
import { RovingFocus } from "./roving";
import { LEAST_STRETCH, type Store } from "./state";
import type { Takes } from "./takes";
import { ValueTracks } from "./tracks";
import { drawWaveform } from "./waveform";
import { Zoom } from "./zoom";

const ROOM = 24; // pixels in which letters of a word can be read; with less, it has only the mark of its beginning [ours: three letters]
const LETTER = 8; // pixels of a letter [ours: most letters of the words have less]
const LONGEST_ROOM = 1; // seconds after a word into which its letters may go [ours]

export class TimeLine {
  private readonly lanes = find("lanes");
  private readonly scroller = find("scroller");
  private readonly wave = find<HTMLCanvasElement>("wave");
  private readonly head = find("playhead");
  private readonly band = find("selection");
  private readonly words = find("words");
  private readonly stretches = find("stretches");
  private readonly options = find("options");
  private readonly roving = new RovingFocus(this.options, (option) => {
    const { id } = option.dataset;
    if (id !== undefined) this.store.update({ gesture: id });
  });
  private readonly zoom: Zoom;
  private readonly track: GestureTrack;
  private readonly values: ValueTracks;
  private shownWords: HeardWord[] | null = null;
  private shownScale = 0;
  private peaks: number[] = [];
  private loudest = 1;
  private shownPlan: Plan | null | undefined;
  private shownWidth = 0;
  private lastTime = -1;

  constructor(
    private readonly store: Store, private readonly player: Player, private readonly takes: Takes,
    private readonly askFor: (time: number, gesture: string | null) => void,
  ) {
    const gestures = find("gestures");
    this.zoom = new Zoom(store, () => player.time, () => this.draw());
    this.track = new GestureTrack(gestures, store, takes);
    this.values = new ValueTracks(store, takes, (event, then) => this.select(event, then));
    gestures.addEventListener("dblclick", (event) => {
      const on = (event.target as HTMLElement).closest<HTMLElement>("[data-id]");
      this.askFor(this.timeAt(event.clientX), on?.dataset.id ?? null);
    });
    for (const lane of [find("ruler"), this.wave, this.words]) lane.addEventListener("pointerdown", (event) => this.select(event));
    find("lock").addEventListener("click", () => {
      const gesture = this.store.take.plan?.gestures?.find((each) => each.id === this.store.state.gesture);
      if (gesture) this.track.lock(gesture);
    });
    new ResizeObserver(() => this.draw()).observe(this.scroller);
    this.scroller.addEventListener("scroll", () => this.drawView());
    window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.drawView());
    store.onChange(() => this.draw());
  }

  get seconds(): number {
    return this.store.state.speech?.seconds ?? 1;
  }

  private timeAt(x: number): number {
    const box = this.lanes.getBoundingClientRect();
    return Math.min(Math.max((x - box.left) / box.width, 0), 1) * this.seconds;
  }

  private draw(): void {
    const { speech, selection } = this.store.state;
    if (speech === null) return;
    this.zoom.draw();
    const { scale } = this.zoom;
    const isOther = scale !== this.shownScale || speech.peaks !== this.peaks || speech.words !== this.shownWords;
    this.drawWords(speech.words);
    if (isOther) {
      this.shownScale = scale;
      this.lanes.style.width = `${this.seconds * scale}px`;
      this.hideTightWords(speech.words, scale);
      this.placeHead();
    }
    if (isOther || this.scroller.clientWidth !== this.shownWidth) this.drawView();
    this.drawStretches();
    this.track.draw(this.seconds);
    this.values.draw(this.seconds);
    this.settleOptions();
    this.band.hidden = selection === null;
    if (selection !== null) this.place(this.band, selection[0], selection[1]);
  }

  /** The stretch that is selected, and the one option at which Tab stops; without options it stops at the scroller. */
  private settleOptions(): void {
    const span = this.store.state.selection?.join(" ");
    for (const each of this.options.querySelectorAll<HTMLElement>("[data-span]")) {
      each.setAttribute("aria-selected", String(each.dataset.span === span));
    }
    this.scroller.tabIndex = this.roving.settle() ? -1 : 0;
  }

  /** What is drawn only where it is in view. */
  private drawView(): void {
    const { speech } = this.store.state;
    const width = this.scroller.clientWidth;
    if (speech === null || !width) return;
    if (speech.peaks !== this.peaks) {
      this.peaks = speech.peaks;
      this.loudest = speech.peaks.reduce((most, each) => Math.max(most, each), 0.05);
    }
    this.shownWidth = width;
    this.zoom.drawRuler();
    drawWaveform(this.wave, speech.peaks, { width: this.seconds * this.zoom.scale, left: this.scroller.scrollLeft, top: this.loudest });
  }

  /** Where the room for the letters of a word ends: a pause after it is room, too. */
  private endOf(words: HeardWord[], k: number): number {
    return Math.max(words[k]!.end, Math.min(words[k + 1]?.start ?? this.seconds, words[k]!.end + LONGEST_ROOM));
  }

  /** A word that has no room for its letters shows none: parts of them tell nothing. */
  private hideTightWords(words: HeardWord[], scale: number): void {
    words.forEach((word, k) => {
      const room = (this.endOf(words, k) - word.start) * scale;
      this.words.children[k]?.classList.toggle("tight", room < ROOM && room < word.text.length * LETTER + 4);
    });
  }

  private place(element: HTMLElement, from: number, to: number): void {
    element.style.left = `${(from / this.seconds) * 100}%`;
    element.style.width = `${((to - from) / this.seconds) * 100}%`;
  }

  private drawWords(words: HeardWord[]): void {
    if (words === this.shownWords) return;
    this.shownWords = words;
    this.words.replaceChildren(...words.map((word, k) => {
      const span = make("span", { title: word.text }, word.text);
      this.place(span, word.start, this.endOf(words, k));
      return span;
    }));
  }

  /** Stretches with seeds of their own, and what is locked. */
  private drawStretches(): void {
    const plan = this.store.take.plan;
    if (plan === this.shownPlan) return;
    this.shownPlan = plan;
    const sown = (plan?.stretches ?? []).filter((stretch) => stretch.seed != null);
    const own = sown.map((stretch) => this.stretch(stretch, `seed ${stretch.seed}`, "own"));
    own.forEach((button, k) => this.dropSeedOf(sown[k]!, button));
    const locked = (plan?.locked ?? []).map((stretch) => this.stretch(stretch, "locked", "locked"));
    this.stretches.replaceChildren(...own, ...locked);
    this.stretches.hidden = !own.length && !locked.length;
  }

  private stretch(stretch: Stretch, text: string, kind: string): HTMLElement {
    const from = formatTime(stretch.from);
    const button = make("button", {
      type: "button", role: "option", tabindex: "-1", class: kind, "data-item": `${kind} ${stretch.from}`,
      "data-span": `${stretch.from} ${stretch.to}`, "aria-selected": "false", "aria-label": `${text}, from ${from} to ${formatTime(stretch.to)}: select this stretch`,
      click: () => this.store.update({ selection: [stretch.from, stretch.to] }),
    }, text);
    this.place(button, stretch.from, stretch.to);
    return button;
  }

  /** Delete on a stretch with a seed of its own: that of the take again. */
  private dropSeedOf({ from, to }: Stretch, button: HTMLElement): void {
    button.title = "Delete takes the seed off";
    button.addEventListener("keydown", (event) => {
      if (event.key !== "Delete" && event.key !== "Backspace") return;
      event.preventDefault();
      event.stopPropagation();
      void this.takes.edit({ kind: "clear", start: from, end: to, names: ["seed"] });
    });
  }

  /** A click goes to a time; a drag selects a stretch, and what is to come then does. */
  private select(down: PointerEvent, then?: () => void): void {
    if (down.button !== 0 || this.store.state.speech === null) return;
    const lane = down.currentTarget as HTMLElement;
    const from = this.timeAt(down.clientX);
    const before = { time: this.player.time, selection: this.store.state.selection };
    this.player.seek(from);
    if (before.selection !== null) this.store.update({ selection: null });
    const onMove = (event: PointerEvent): void => {
      const to = this.timeAt(event.clientX);
      const selection: [number, number] = [Math.min(from, to), Math.max(from, to)];
      this.store.update({ selection: selection[1] - selection[0] < LEAST_STRETCH ? null : selection }); // a shorter drag is a click
    };
    const onUp = (event: PointerEvent): void => {
      if (event.type === "pointercancel") { // a finger scrolls
        this.player.seek(before.time);
        this.store.update({ selection: before.selection });
      } else if (this.store.state.selection !== null) then?.();
    };
    followPointer(lane, down, onMove, onUp);
  }

  /** Move the playhead; called for every frame. */
  follow(time: number): void {
    if (time === this.lastTime) return;
    this.lastTime = time;
    const x = this.placeHead();
    const { scrollLeft, clientWidth } = this.scroller;
    if (x < scrollLeft || x > scrollLeft + clientWidth * (this.player.playing ? 0.92 : 1)) this.scroller.scrollLeft = x - clientWidth * 0.1;
  }

  /** Put the playhead where the last time is that it followed; its pixels from the start. */
  private placeHead(): number {
    const x = Math.max(this.lastTime, 0) * this.zoom.scale;
    this.head.style.transform = `translateX(${x}px)`;
    return x;
  }
}
