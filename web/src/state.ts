// What the page knows, and who is told when it changes.

import type { Catalogue, Plan, UploadedClip, UploadedSpeech } from "./messages";
import type { Motion } from "./motion";

export const PARTS = ["face", "body", "hands"] as const;
export type Part = (typeof PARTS)[number];

/** What a take is made with; each take has a seed of its own. */
export interface Settings {
  model: string;
  style: string;
  clip: UploadedClip | null;
  mix: Record<string, number> | null;
  emotion: string;
  intensity: number;
  temperature: number;
  parts: Part[];
  fps: number;
}

/** A take: a place on the stage. */
export interface Take {
  key: number;
  seed: number;
  /** A plan that was edited; null where the model plans by itself. */
  edited: Plan | null;
  plan: Plan | null;
  /** The edited plan that the shown motion was made with. */
  played: Plan | null;
  motion: Motion | null;
  /** The server's name of what is shown. */
  id: string | null;
  /** The server's name of what is being made. */
  making: string | null;
  /** What the motion was asked for with, and how often the words had changed then, as text. */
  madeFrom: string;
  progress: number | null;
  factor: number | null;
  problem: string;
}

export const LEAST_STRETCH = 0.1; // seconds that are selected, or that a value holds, at the least [ours]

export interface State {
  catalogue: Catalogue;
  speech: UploadedSpeech | null;
  settings: Settings;
  takes: Take[];
  chosen: number;
  /** The stretch of time that is selected, seconds. */
  selection: [number, number] | null;
  gesture: string | null;
  problem: string;
  notice: string;
}

let nextKey = 1;

export function makeTake(seed: number): Take {
  return {
    key: nextKey++, seed, edited: null, plan: null, played: null, motion: null, id: null, making: null, madeFrom: "", progress: null,
    factor: null, problem: "",
  };
}

/** Whether the server has the motion of a take with all of its edits. */
export function isReady(take: Take): boolean {
  return take.id !== null && take.progress === null && take.played === take.edited && !take.problem;
}

export class Store {
  private listeners: ((state: State) => void)[] = [];

  constructor(readonly state: State) {}

  onChange(listener: (state: State) => void): void {
    this.listeners.push(listener);
    listener(this.state);
  }

  update(change: Partial<State> = {}): void {
    Object.assign(this.state, change);
    for (const listener of this.listeners) listener(this.state);
  }

  get take(): Take {
    return this.state.takes[this.state.chosen];
  }

  get model() {
    const { catalogue, settings } = this.state;
    return catalogue.models.find((row) => row.name === settings.model) ?? catalogue.models[0];
  }
}
