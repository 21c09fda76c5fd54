// Making takes: asking for them, following them, undoing, and keeping what was made already.

import * as api from "./api";
import type { Plan, TakeEvent, TakeRequest, UploadedSpeech } from "./messages";
import { readMix } from "./link";
import type { Motion } from "./motion";
import { makeTake, type Settings, type Store, type Take } from "./state";

const MOST_TAKES = 8;
const KEPT = 24; // results that undo and redo find again without asking [ours: three rounds of eight takes]
const NUMBERS = ["intensity", "temperature"] as const; // of a plan: its gestures stay where one of them changes
const OUTSIDE = ["fps", "parts"]; // settings that no plan holds: an edited plan is played with others
const PATIENCE = 250; // milliseconds from the last change of a setting to the request [ours: a slider sends one request]
const TOGETHER = 800; // milliseconds within which changes of one setting are one step of undo [ours: keys that are held repeat faster]
const LOST = "the connection to the studio is lost: it is tried again";
const RENEWED = "the studio was started anew: open the address that it has printed";

interface Made { id: string; motion: Motion; plan: Plan | null; factor: number | null }
type Edit = api.PlanEdit | ((plan: Plan) => api.PlanEdit | null);
interface Step { settings: Settings; takes: { seed: number; edited: Plan | null }[]; chosen: number }

export class Takes {
  private readonly made = new Map<string, Made>();
  private readonly events = new Map<string, TakeEvent>();
  private past: Step[] = [];
  private future: Step[] = [];
  /** The last step that has the edits which gave way to a setting, until the user has answered. */
  private lost: Step | null = null;
  private readonly saved = new WeakSet<Plan>();
  private connected = true;
  private timer = 0;
  private note = ""; // of `renew`
  private setting = { names: "", at: 0 }; // that was changed last, and when
  private edits: Promise<void> = Promise.resolve();
  /** Of a take whose edits have no motion yet: the plan with them, and what there was before. */
  private readonly unmade = new Map<Take, { edited: Plan; before: Pick<Take, "edited" | "plan"> }>();

  constructor(private readonly store: Store) {
    api.followEvents((event) => this.hear(event), (connected) => this.onConnection(connected), () => this.store.update({ problem: RENEWED }));
  }

  // ------------------------------------------------------------------------------------------ asking

  /** Ask for every take that is not as the settings say. */
  makeAll(): void {
    window.clearTimeout(this.timer);
    for (const take of this.store.state.takes) void this.make(take);
  }

  /** Another speech: what was planned for the last one is not right for it. */
  openSpeech(speech: UploadedSpeech): void {
    const forget = (step: Step): Step => ({ ...step, takes: step.takes.map((take) => ({ ...take, edited: null })) });
    this.past = this.past.map(forget);
    this.future = this.future.map(forget);
    this.lost = null;
    this.note = "";
    for (const take of this.store.state.takes) Object.assign(take, { plan: null, edited: null, motion: null, id: null, madeFrom: "" });
    this.store.update({ speech, selection: null, gesture: null, notice: "" });
    this.makeAll();
  }

  /** What was made is not right any more, since the words changed; the note is told until all takes are made again. */
  renew(note: string): void {
    this.note = note;
    this.made.clear();
    for (const take of this.store.state.takes) take.madeFrom = "";
    this.makeAll();
  }

  private makeSoon(): void {
    window.clearTimeout(this.timer);
    this.timer = window.setTimeout(() => this.makeAll(), PATIENCE);
  }

  private async make(take: Take): Promise<void> {
    const { speech } = this.store.state;
    if (speech === null) return;
    const request = this.requestOf(take, speech.speech);
    const key = JSON.stringify(request);
    if (take.madeFrom === key) return;
    if (take.making !== null) api.forgetTake(take.making);
    Object.assign(take, { madeFrom: key, making: null, progress: 0, problem: "" });
    const known = this.made.get(key);
    if (known !== undefined) return this.show(take, known);
    this.store.update();
    try {
      const { take: id } = await api.createTake(request);
      if (take.madeFrom !== key) return api.forgetTake(id);
      take.making = id;
      const early = this.events.get(id);
      if (early) this.hear(early);
    } catch (error) {
      if (take.madeFrom === key) this.fail(take, error);
    }
  }

  private requestOf(take: Take, speech: string): TakeRequest {
    const { model, clip, mix, emotion, intensity, temperature, parts, fps, style } = this.store.state.settings;
    const manner = clip ? { clip: clip.clip } : mix ? { mix } : style ? { name: style } : null;
    return {
      speech, model, style: manner, emotion, intensity, seed: take.seed, temperature, parts, fps, plan: take.edited,
    };
  }

  // ------------------------------------------------------------------------------------------ following

  private hear(event: TakeEvent): void {
    const take = this.store.state.takes.find((each) => each.making === event.take);
    if (take === undefined) {
      this.events.set(event.take, event);
      if (this.events.size > 100) this.events.delete(this.events.keys().next().value as string);
      return;
    }
    this.events.delete(event.take);
    if (event.type === "done") void this.fetchResult(take, event);
    else if (event.type === "error") this.fail(take, new api.Problem(event.problem, event.hint));
    else if (event.type === "cancelled") Object.assign(take, { making: null, progress: null, madeFrom: "" });
    else take.progress = event.total ? Math.min(event.done / event.total, 1) : 0;
    this.store.update();
  }

  private async fetchResult(take: Take, event: TakeEvent): Promise<void> {
    const key = take.madeFrom;
    try {
      const plan = api.readPlan(event.take).catch(() => null); // some ways of asking leave no plan
      const motion = await api.readMotion(event.take);
      const made = { id: event.take, motion, plan: await plan, factor: event.realtime_factor };
      this.made.set(key, made);
      if (this.made.size > KEPT) this.made.delete(this.made.keys().next().value as string);
      if (take.madeFrom === key) this.show(take, made);
    } catch (error) {
      if (take.madeFrom === key) this.fail(take, error);
    }
  }

  private show(take: Take, { id, motion, plan, factor }: Made): void {
    Object.assign(take, { id, motion, plan, factor, played: take.edited, making: null, progress: null, problem: "" });
    this.unmade.delete(take);
    const { takes } = this.store.state;
    this.store.update({ notice: `${this.note && `${this.note}; `}take ${takes.indexOf(take) + 1} is ready` });
    if (takes.every((each) => each.progress === null)) this.note = "";
  }

  private fail(take: Take, error: unknown): void {
    const problem = error instanceof Error ? error.message : String(error);
    Object.assign(take, { making: null, progress: null, problem, madeFrom: "" }); // it is asked for again with the next change, or when the studio answers
    this.store.update();
  }

  /** Make a take again that the server has dropped. */
  remake(take: Take): void {
    for (const [key, { id }] of this.made) if (id === take.id) this.made.delete(key);
    Object.assign(take, { id: null, madeFrom: "" });
    void this.make(take);
  }

  private onConnection(connected: boolean): void {
    const wasLost = !this.connected;
    this.connected = connected;
    if (!connected) {
      if (this.store.state.problem !== RENEWED) this.store.update({ problem: LOST });
    }
    else if (wasLost) {
      for (const take of this.store.state.takes) if (take.making !== null) take.madeFrom = "";
      if ([LOST, RENEWED].includes(this.store.state.problem)) this.store.update({ problem: "" });
      this.makeAll();
    }
  }

  /** Stop what is being made; what was shown before stays, and an edit that was not made is taken back. */
  cancel(take: Take): void {
    if (take.making !== null) api.forgetTake(take.making);
    Object.assign(take, { making: null, progress: null, madeFrom: "" });
    const unmade = this.unmade.get(take);
    if (unmade !== undefined && unmade.edited === take.edited) {
      this.remember();
      Object.assign(take, unmade.before);
    }
    this.unmade.delete(take);
    this.store.update({ notice: "cancelled" });
  }

  // ------------------------------------------------------------------------------------------ changing

  /**
   * Change settings. An edited plan takes a new intensity and temperature, and is played at another frame rate and with other
   * parts. Any other setting makes another plan: the edits give way until `bringBack`.
   */
  changeSettings(change: Partial<Settings>): void {
    const step = this.rememberSetting(Object.keys(change).join());
    const { takes, settings } = this.store.state;
    const numbers = Object.fromEntries(NUMBERS.filter((name) => name in change).map((name) => [name, change[name]]));
    const stays = Object.keys(change).every((name) => name in numbers || OUTSIDE.includes(name));
    for (const take of takes) {
      if (take.edited === null) continue;
      if (!stays) this.dropEdits(take, step);
      else if (Object.keys(numbers).length) {
        Object.assign(take, { edited: { ...take.edited, ...numbers }, plan: { ...(take.plan ?? take.edited), ...numbers } });
      }
    }
    this.store.update({ settings: { ...settings, ...change }, ...this.silence() });
    this.makeSoon();
  }

  changeSeed(seed: number): void {
    const step = this.remember();
    const { take } = this.store;
    if (take.edited !== null) this.dropEdits(take, step);
    take.seed = seed;
    this.store.update(this.silence());
    this.makeSoon();
  }

  /** What was told is over, unless it still holds. */
  private silence(): { notice: string; problem: string } {
    return { notice: "", problem: [LOST, RENEWED].includes(this.store.state.problem) ? this.store.state.problem : "" };
  }

  private dropEdits(take: Take, step: Step): void {
    take.edited = null;
    this.lost ??= step;
  }

  get mayAdd(): boolean {
    return this.store.state.takes.length < Math.min(MOST_TAKES, this.store.state.catalogue.limits.takes);
  }

  add(): void {
    if (!this.mayAdd) return;
    this.remember();
    const { takes } = this.store.state;
    takes.push(makeTake(Math.max(...takes.map((take) => take.seed)) + 1));
    this.store.update({ chosen: takes.length - 1, gesture: null, ...this.silence() });
    this.makeAll();
  }

  remove(index: number): void {
    const { takes, chosen } = this.store.state;
    if (takes.length < 2) return;
    this.remember();
    const [gone] = takes.splice(index, 1);
    if (gone.making !== null) api.forgetTake(gone.making);
    this.store.update({ chosen: Math.min(chosen > index ? chosen - 1 : chosen, takes.length - 1), gesture: null });
  }

  /**
   * Edit the plan of the chosen take, show it at once, and ask for its motion. Several edits are one step of undo. An edit may
   * be a function of the plan, for what depends on the edits before it.
   */
  edit(...edits: Edit[]): Promise<void> {
    const { take } = this.store;
    this.edits = this.edits.then(() => this.editNow(take, edits)); // one after the other: each begins with the plan of the last
    return this.edits;
  }

  private async editNow(take: Take, edits: Edit[]): Promise<void> {
    const { speech, takes } = this.store.state;
    if (take.plan === null || speech === null || !takes.includes(take)) return;
    const before = { edited: take.edited, plan: take.plan };
    try {
      let plan = take.plan;
      for (const each of edits) {
        const edit = typeof each === "function" ? each(plan) : each;
        if (edit !== null) ({ plan } = await api.editPlan({ plan, speech: speech.speech, edit }));
      }
      if (plan === take.plan) return;
      if (take.edited !== before.edited || this.store.state.speech !== speech) return; // something else was played meanwhile
      this.remember();
      this.lost = null;
      const known = this.unmade.get(take);
      this.unmade.set(take, { edited: plan, before: known !== undefined && known.edited === take.edited ? known.before : before });
      Object.assign(take, { edited: plan, plan });
      this.store.update({ problem: "", notice: "" });
      await this.make(take);
    } catch (error) {
      this.store.update({ problem: error instanceof Error ? error.message : String(error) });
    }
  }

  // ------------------------------------------------------------------------------------------ plans in files

  get hasEdits(): boolean {
    return this.store.state.takes.some(({ edited }) => edited !== null);
  }

  /** Whether a take has edits that are in no file. */
  get hasUnsaved(): boolean {
    return this.store.state.takes.some(({ edited }) => edited !== null && !this.saved.has(edited));
  }

  /** The plan is in a file. */
  markSaved(plan: Plan | null): void {
    if (plan !== null) this.saved.add(plan);
    this.store.update();
  }

  /** Play a plan from a file as the chosen take; the settings become those of the plan. */
  openPlan(plan: Plan): void {
    this.remember();
    this.lost = null;
    this.saved.add(plan);
    const { settings } = this.store.state;
    const mix = readMix(plan.style?.includes(":") ? plan.style : "", this.store.model.styles);
    const emotion = typeof plan.emotion === "string" ? plan.emotion : settings.emotion;
    const { intensity = 1, temperature = 1, seed = 0 } = plan;
    Object.assign(this.store.take, { edited: plan, plan, seed });
    const style = mix ? "" : (plan.style ?? "");
    this.store.update({ settings: { ...settings, style, mix, clip: null, emotion, intensity, temperature }, gesture: null });
    this.makeAll();
  }

  // ------------------------------------------------------------------------------------------ undoing

  private step(): Step {
    const { settings, takes, chosen } = this.store.state;
    return { settings, takes: takes.map(({ seed, edited }) => ({ seed, edited })), chosen };
  }

  /** One step for the changes of one setting that follow each other quickly: a slider that keys move. */
  private rememberSetting(names: string): Step {
    const { names: last, at } = this.setting;
    const before = this.past.at(-1);
    const step = names === last && performance.now() - at < TOGETHER && before ? before : this.remember();
    this.setting = { names, at: performance.now() };
    return step;
  }

  private remember(): Step {
    this.setting = { names: "", at: 0 };
    const step = this.step();
    this.past.push(step);
    if (this.past.length > 100 && this.past.shift() === this.lost) this.lost = null;
    this.future = [];
    return step;
  }

  /** Whether edits gave way to a setting, and the user has neither brought them back nor let them go. */
  get hasLost(): boolean {
    return this.lost !== null;
  }

  /** Undo up to the edits that gave way. */
  bringBack(): void {
    if (this.lost === null) return;
    const later = this.past.splice(this.past.indexOf(this.lost) + 1);
    this.future.push(this.step(), ...later.reverse());
    this.restore(this.past.pop() as Step);
  }

  letGo(): void {
    this.lost = null;
    this.store.update();
  }

  get mayUndo(): boolean {
    return this.past.length > 0;
  }

  get mayRedo(): boolean {
    return this.future.length > 0;
  }

  /** Undo, after the edits that are on their way. */
  undo(): void {
    this.edits = this.edits.then(() => this.undoNow());
  }

  redo(): void {
    this.edits = this.edits.then(() => this.redoNow());
  }

  private undoNow(): void {
    const step = this.past.pop();
    if (step === undefined) return;
    this.setting = { names: "", at: 0 };
    this.future.push(this.step());
    this.restore(step, "undone");
  }

  private redoNow(): void {
    const step = this.future.pop();
    if (step === undefined) return;
    this.past.push(this.step());
    this.restore(step, "done again");
  }

  private restore(step: Step, notice = ""): void {
    if (step === this.lost) this.lost = null;
    const { takes } = this.store.state;
    for (const gone of takes.splice(step.takes.length)) if (gone.making !== null) api.forgetTake(gone.making);
    step.takes.forEach((wanted, k) => {
      takes[k] ??= makeTake(wanted.seed);
      Object.assign(takes[k], wanted);
    });
    this.store.update({ settings: step.settings, chosen: step.chosen, gesture: null, notice });
    this.makeAll();
  }
}
