// What undo and redo go back to, and the edits that gave way to a setting.

import type { Settings, Store, Take } from "./state";

const MOST_STEPS = 100;
const TOGETHER = 800; // milliseconds within which changes of one setting are one step of undo [ours: keys that are held repeat faster]

/** What the user has chosen at one time: settings, takes, and which take is shown. */
export interface Step { settings: Settings; takes: Pick<Take, "seed" | "edited" | "plan">[]; chosen: number }

export class History {
  private past: Step[] = [];
  private future: Step[] = [];
  /** The last step that has the edits which gave way to a setting, until the user has answered. */
  private stepWithEdits: Step | null = null;
  private setting = { names: "", at: 0 }; // that was changed last, and when

  constructor(private readonly store: Store) {}

  private takeStep(): Step {
    const { settings, takes, chosen } = this.store.state;
    return { settings, takes: takes.map(({ seed, edited, plan }) => ({ seed, edited, plan })), chosen };
  }

  /** Keep what there is, before a change. */
  remember(): Step {
    this.setting = { names: "", at: 0 };
    const step = this.takeStep();
    this.past.push(step);
    if (this.past.length > MOST_STEPS && this.past.shift() === this.stepWithEdits) this.stepWithEdits = null;
    this.future = [];
    return step;
  }

  /** One step for the changes of one setting that follow each other quickly: a slider that keys move. */
  rememberSetting(names: string): Step {
    const { names: last, at } = this.setting;
    const before = this.past.at(-1);
    const step = names === last && performance.now() - at < TOGETHER && before ? before : this.remember();
    this.setting = { names, at: performance.now() };
    return step;
  }

  /** Plans are not right for another speech. */
  forgetPlans(): void {
    const forget = (step: Step): Step => ({ ...step, takes: step.takes.map((take) => ({ ...take, edited: null, plan: null })) });
    this.past = this.past.map(forget);
    this.future = this.future.map(forget);
    this.stepWithEdits = null;
  }

  /** The edits of `step` gave way. */
  loseEdits(step: Step): void {
    this.stepWithEdits ??= step;
  }

  letGo(): void {
    this.stepWithEdits = null;
  }

  /** Whether edits gave way to a setting, and the user has neither brought them back nor let them go. */
  get hasLost(): boolean {
    return this.stepWithEdits !== null;
  }

  /** The step with the edits that gave way; what came after it can be done again. */
  bringBack(): Step | null {
    if (this.stepWithEdits === null) return null;
    const later = this.past.splice(this.past.indexOf(this.stepWithEdits) + 1);
    this.future.push(this.takeStep(), ...later.reverse());
    return this.goTo(this.past.pop());
  }

  get mayUndo(): boolean {
    return this.past.length > 0;
  }

  get mayRedo(): boolean {
    return this.future.length > 0;
  }

  undo(): Step | null {
    const step = this.past.pop();
    if (step !== undefined) this.future.push(this.takeStep());
    return this.goTo(step);
  }

  redo(): Step | null {
    const step = this.future.pop();
    if (step !== undefined) this.past.push(this.takeStep());
    return this.goTo(step);
  }

  private goTo(step: Step | undefined): Step | null {
    if (step === undefined) return null;
    this.setting = { names: "", at: 0 };
    if (step === this.stepWithEdits) this.stepWithEdits = null;
    return step;
  }
}
