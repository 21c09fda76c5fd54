// Making takes: asking for them, following them, undoing, and keeping what was made already.

import * as api from "./api";
import { History, type Step } from "./history";
import type { Plan, TakeEvent, TakeRequest, UploadedSpeech } from "./messages";
import { readMix } from "./link";
import type { Motion } from "./motion";
import { makeTake, type Settings, type Store, type Take } from "./state";

const MOST_TAKES = 8;
const MOST_RESULTS = 24; // results that undo and redo find again without asking [ours: three rounds of eight takes]
const NUMBERS = ["intensity", "temperature"] as const; // of a plan: its gestures stay where one of them changes
const OUTSIDE = ["fps", "parts"]; // settings that no plan holds: an edited plan is played with others
const PATIENCE = 250; // milliseconds from the last change of a setting to the request [ours: a slider sends one request]
const NO_CONNECTION = "the connection to the studio is lost: it is tried again";
const OLD_PLAN = "the plan is made anew: edit it when the motion is ready";
const NEW_STUDIO = "the studio was started anew: open the address that it has printed";

interface Result { id: string; motion: Motion; plan: Plan | null; factor: number | null }
type Edit = api.PlanEdit | ((plan: Plan) => api.PlanEdit | null);

export class Takes {
  private readonly results = new Map<string, Result>();
  private readonly events = new Map<string, TakeEvent>();
  readonly history: History;
  private readonly plansInFiles = new WeakSet<Plan>();
  private readonly origins = new WeakMap<Plan, string>(); // the requests that plans without edits were made for
  private isConnected = true;
  private timer = 0;
  private note = ""; // of `renew`
  private changesOfWords = 0; // how often `renew` was called: a request does not hold the words
  private edits: Promise<unknown> = Promise.resolve();
  /** Of a take whose edits have no motion yet: the plan with them, and what there was before. */
  private readonly unmade = new Map<Take, { edited: Plan; before: Pick<Take, "edited" | "plan"> }>();

  constructor(private readonly store: Store) {
    this.history = new History(store);
    api.followEvents((event) => this.hear(event), (isConnected) => this.onConnection(isConnected), () => this.store.update({ problem: NEW_STUDIO }));
  }

  // ------------------------------------------------------------------------------------------ asking

  /** Ask for every take that is not as the settings say. */
  makeAll(): void {
    window.clearTimeout(this.timer);
    this.timer = 0;
    for (const take of this.store.state.takes) void this.make(take);
  }

  /** Another speech: what was planned for the last one is not right for it. */
  openSpeech(speech: UploadedSpeech): void {
    this.history.forgetPlans();
    this.note = "";
    for (const take of this.store.state.takes) Object.assign(take, { plan: null, edited: null, motion: null, id: null, madeFrom: "" });
    this.store.update({ speech, selection: null, gesture: null, notice: "" });
    this.makeAll();
  }

  /** What was made is not right any more, since the words changed; the note is told until all takes are made again. */
  renew(note: string): void {
    this.note = note;
    this.changesOfWords += 1;
    this.results.clear();
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
    const key = this.keyOf(request);
    if (take.madeFrom === key) return;
    if (take.making !== null) api.forgetTake(take.making);
    Object.assign(take, { madeFrom: key, making: null, progress: 0, problem: "" });
    const result = this.results.get(key);
    if (result !== undefined) return this.show(take, result);
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

  private keyOf(request: TakeRequest): string {
    return JSON.stringify([request, this.changesOfWords]);
  }

  /** Whether the plan of a take without edits is one of the settings of now. */
  private isCurrent(take: Take, plan: Plan, speech: string): boolean {
    return this.origins.get(plan) === this.keyOf(this.requestOf(take, speech));
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
    try {
      const plan = api.readPlan(event.take).catch(() => null); // some ways of asking leave no plan
      const motion = await api.readMotion(event.take);
      const result = { id: event.take, motion, plan: await plan, factor: event.realtime_factor };
      if (take.making !== event.take) return; // something else was asked for meanwhile
      this.results.set(take.madeFrom, result);
      if (this.results.size > MOST_RESULTS) this.results.delete(this.results.keys().next().value as string);
      this.show(take, result);
    } catch (error) {
      if (take.making === event.take) this.fail(take, error);
    }
  }

  private show(take: Take, { id, motion, plan, factor }: Result): void {
    Object.assign(take, { id, motion, plan, factor, played: take.edited, making: null, progress: null, problem: "" });
    this.unmade.delete(take);
    if (plan !== null && take.edited === null) this.origins.set(plan, take.madeFrom);
    const { takes, problem } = this.store.state;
    if (problem === OLD_PLAN && takes.every((each) => each.progress === null)) this.store.update({ problem: "" });
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
    for (const [key, { id }] of this.results) if (id === take.id) this.results.delete(key);
    Object.assign(take, { id: null, madeFrom: "" });
    void this.make(take);
  }

  private onConnection(isConnected: boolean): void {
    const wasLost = !this.isConnected;
    this.isConnected = isConnected;
    if (!isConnected) {
      if (this.store.state.problem !== NEW_STUDIO) this.store.update({ problem: NO_CONNECTION });
    }
    else if (wasLost) {
      for (const take of this.store.state.takes) if (take.making !== null) take.madeFrom = "";
      if ([NO_CONNECTION, NEW_STUDIO].includes(this.store.state.problem)) this.store.update({ problem: "" });
      this.makeAll();
    }
  }

  /** Stop what is being made; what was shown before stays, and an edit that was not made is taken back. */
  cancel(take: Take): void {
    if (take.making !== null) api.forgetTake(take.making);
    Object.assign(take, { making: null, progress: null, madeFrom: "" });
    const unmade = this.unmade.get(take);
    if (unmade !== undefined && unmade.edited === take.edited) {
      this.history.remember();
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
    const step = this.history.rememberSetting(Object.keys(change).join());
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
    const step = this.history.remember();
    const { take } = this.store;
    if (take.edited !== null) this.dropEdits(take, step);
    take.seed = seed;
    this.store.update(this.silence());
    this.makeSoon();
  }

  /** What was told is over, unless it still holds. */
  private silence(): { notice: string; problem: string } {
    return { notice: "", problem: [NO_CONNECTION, NEW_STUDIO].includes(this.store.state.problem) ? this.store.state.problem : "" };
  }

  private dropEdits(take: Take, step: Step): void {
    take.edited = null;
    this.history.loseEdits(step);
  }

  get mayAdd(): boolean {
    return this.store.state.takes.length < Math.min(MOST_TAKES, this.store.state.catalogue.limits.takes);
  }

  add(): void {
    if (!this.mayAdd) return;
    this.history.remember();
    const { takes } = this.store.state;
    takes.push(makeTake(Math.max(...takes.map((take) => take.seed)) + 1));
    this.store.update({ chosen: takes.length - 1, gesture: null, ...this.silence() });
    this.makeAll();
  }

  remove(index: number): void {
    const { takes, chosen } = this.store.state;
    if (takes.length < 2) return;
    this.history.remember();
    const [take] = takes.splice(index, 1);
    if (take.making !== null) api.forgetTake(take.making);
    this.store.update({ chosen: Math.min(chosen > index ? chosen - 1 : chosen, takes.length - 1), gesture: null });
  }

  /**
   * Edit the plan of the chosen take, show it at once, and ask for its motion. Several edits are one step of undo. An edit may
   * be a function of the plan, for what depends on the edits before it. The answer is whether the plan is another one then.
   */
  edit(...edits: Edit[]): Promise<boolean> {
    const { take } = this.store;
    const done = this.edits.then(() => this.editNow(take, edits)); // one after the other: each begins with the plan of the last
    this.edits = done;
    return done;
  }

  private async editNow(take: Take, edits: Edit[]): Promise<boolean> {
    const { speech, takes } = this.store.state;
    if (take.plan === null || speech === null || !takes.includes(take)) return false;
    const before = { edited: take.edited, plan: take.plan };
    if (before.edited === null && !this.isCurrent(take, before.plan, speech.speech)) return this.refuseOldPlan(take);
    try {
      let plan = take.plan;
      for (const each of edits) {
        const edit = typeof each === "function" ? each(plan) : each;
        if (edit !== null) ({ plan } = await api.editPlan({ plan, speech: speech.speech, edit }));
      }
      if (plan === take.plan) return false;
      if (take.edited !== before.edited || this.store.state.speech !== speech) return false; // something else was played meanwhile
      if (before.edited === null && !this.isCurrent(take, before.plan, speech.speech)) return this.refuseOldPlan(take);
      this.history.remember();
      this.history.letGo();
      const entry = this.unmade.get(take);
      this.unmade.set(take, { edited: plan, before: entry !== undefined && entry.edited === take.edited ? entry.before : before });
      Object.assign(take, { edited: plan, plan });
      this.store.update({ problem: "", notice: "" });
      await this.make(take);
      return true;
    } catch (error) {
      this.store.update({ problem: error instanceof Error ? error.message : String(error) });
      return false;
    }
  }

  /** What is shown is a plan of other settings; its motion may have been cancelled. */
  private refuseOldPlan(take: Take): boolean {
    this.store.update({ problem: OLD_PLAN });
    if (this.timer === 0) void this.make(take);
    return false;
  }

  // ------------------------------------------------------------------------------------------ plans in files

  get hasEdits(): boolean {
    return this.store.state.takes.some(({ edited }) => edited !== null);
  }

  /** Whether a take has edits that are in no file. */
  get hasUnsaved(): boolean {
    return this.store.state.takes.some(({ edited }) => edited !== null && !this.plansInFiles.has(edited));
  }

  /** The plan is in a file. */
  markSaved(plan: Plan | null): void {
    if (plan !== null) this.plansInFiles.add(plan);
    this.store.update();
  }

  /** Play a plan from a file as the chosen take; the settings become those of the plan. */
  openPlan(plan: Plan): void {
    this.history.remember();
    this.history.letGo();
    this.plansInFiles.add(plan);
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

  /** Undo up to the edits that gave way. */
  bringBack(): void {
    this.restore(this.history.bringBack());
  }

  letGo(): void {
    this.history.letGo();
    this.store.update();
  }

  /** Undo, after the edits that are on their way. */
  undo(): void {
    this.edits = this.edits.then(() => this.restore(this.history.undo(), "undone"));
  }

  redo(): void {
    this.edits = this.edits.then(() => this.restore(this.history.redo(), "done again"));
  }

  private restore(step: Step | null, notice = ""): void {
    if (step === null) return;
    const { takes } = this.store.state;
    for (const take of takes.splice(step.takes.length)) if (take.making !== null) api.forgetTake(take.making);
    step.takes.forEach((old, k) => {
      takes[k] ??= makeTake(old.seed);
      Object.assign(takes[k], old, { madeFrom: "" }); // so that its plan comes back with the motion that it belongs to
    });
    this.store.update({ settings: step.settings, chosen: step.chosen, gesture: null, notice });
    this.makeAll();
  }
}
