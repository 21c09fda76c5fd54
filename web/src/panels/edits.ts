// Editing: the chosen gesture, the selected stretch, the dialog that adds a gesture.

import type { PlanEdit } from "../api";
import { enable, fillSelect, find, formatTime, readName } from "../dom";
import { isLocked, lockOrUnlock, removeGesture, touchesLock } from "../gestures";
import { select } from "../keys";
import type { ModelRow, Plan } from "../messages";
import type { Player } from "../player";
import type { State, Store } from "../state";
import type { Takes } from "../takes";
import { emotionRows } from "./settings";

const KEEP: [string, string] = ["", "as it is"];
const INTENSITIES = [0, 0.25, 0.5, 0.75, 1, 1.25, 1.5];

const LEAST_MOVE = 0.006; // seconds, and of a size: the dialog shows hundredths

export class EditPanel {
  private shownStyles = "";
  /** The gesture that the dialog changes; null: it adds one. */
  private gestureId: string | null = null;

  constructor(private readonly store: Store, private readonly takes: Takes, private readonly player: Player) {
    const { catalogue } = store.state;
    fillSelect(find("add-form"), catalogue.forms.map((form) => [form.name, readName(form.name)]), "beat");
    fillSelect(find("stretch-emotion"), [KEEP, ...emotionRows(catalogue.emotions)], "");
    fillSelect(find("stretch-intensity"), [KEEP, ...INTENSITIES.map((each): [string, string] => [String(each), String(each)])], "");
    find("add-gesture").addEventListener("click", () => this.openDialog(player.time));
    find("change-gesture").addEventListener("click", () => this.openDialog(player.time, store.state.gesture));
    find("remove-gesture").addEventListener("click", () => void this.removeChosen());
    find("select-from").addEventListener("click", () => select(store, player.seconds, { from: player.time }));
    find("select-to").addEventListener("click", () => select(store, player.seconds, { to: player.time }));
    find("reseed").addEventListener("click", () => this.editStretch((start, end) => takes.edit({ kind: "reseed", start, end })));
    find("lock-stretch").addEventListener("click", () => this.lockStretch());
    this.onSet("stretch-style", (style) => ({ style }));
    this.onSet("stretch-emotion", (emotion) => ({ emotion }));
    this.onSet("stretch-intensity", (intensity) => ({ intensity: Number(intensity) }));
    find("add-form").addEventListener("change", () => this.showWords());
    const dialog = find<HTMLDialogElement>("add-dialog");
    dialog.addEventListener("close", () => {
      if (dialog.returnValue === "add") this.add();
      dialog.returnValue = "";
    });
    store.onChange((state) => this.draw(state));
  }

  private editStretch(edit: (start: number, end: number) => Promise<unknown>): void {
    const { selection } = this.store.state;
    if (selection !== null) void edit(round(selection[0]), round(selection[1]));
  }

  private lockStretch(): void {
    this.editStretch((from, to) => this.takes.edit((plan) => lockOrUnlock(plan, { from, to })));
  }

  private onSet(id: string, values: (value: string) => { style?: string; emotion?: string; intensity?: number }): void {
    const select = find<HTMLSelectElement>(id);
    select.addEventListener("change", () => {
      const { value } = select;
      if (value) this.editStretch((start, end) => this.takes.edit({ kind: "set", start, end, ...values(value) }));
      select.value = "";
    });
  }

  async removeChosen(): Promise<void> {
    const { gesture } = this.store.state;
    const target = this.store.take.plan?.gestures?.find((each) => each.id === gesture);
    if (target !== undefined && (await removeGesture(this.store, this.takes, target))) this.store.update({ gesture: null });
  }

  /** Ask for a gesture that is added at a time, or for other values of one that is there. */
  openDialog(at: number, gesture: string | null = null): void {
    const { plan } = this.store.take;
    if (!this.store.model.takes_gestures || plan === null) return;
    this.player.pause();
    const old = plan.gestures?.find((each) => each.id === gesture);
    this.gestureId = old?.id ?? null;
    find("title-add").textContent = old ? "Change the gesture" : "Add a gesture";
    find("add-done").textContent = old ? "Change" : "Add";
    const time = old?.stroke ?? at;
    const forms = find<HTMLSelectElement>("add-form");
    forms.querySelector("option.own")?.remove();
    forms.value = old?.form ?? "beat";
    if (old && forms.value !== old.form) { // one that nobody adds
      const own = new Option(readName(old.form), old.form, false, true);
      own.className = "own";
      forms.add(own);
    }
    find<HTMLSelectElement>("add-hands").value = old?.hands ?? "";
    find<HTMLInputElement>("add-size").valueAsNumber = old?.size ?? 1;
    const input = find<HTMLInputElement>("add-time");
    Object.assign(input, { value: time.toFixed(2), max: this.player.seconds.toFixed(2) });
    this.showWords();
    find<HTMLDialogElement>("add-dialog").showModal();
  }

  private showWords(): void {
    const form = this.store.state.catalogue.forms.find((each) => each.name === find<HTMLSelectElement>("add-form").value);
    find("form-words").textContent = form?.words.length ? `Goes with: ${form.words.slice(0, 8).join(", ")}` : "";
  }

  private add(): void {
    const hands = find<HTMLSelectElement>("add-hands").value as "left" | "right" | "both" | "";
    const at = find<HTMLInputElement>("add-time").valueAsNumber;
    const form = find<HTMLSelectElement>("add-form").value;
    const size = find<HTMLInputElement>("add-size").valueAsNumber;
    const values = { form, size, ...(hands ? { hands } : {}) };
    const gesture = this.gestureId;
    if (gesture === null) void this.takes.edit({ kind: "add", at, ...values });
    else void this.takes.edit((plan) => this.changeOf(plan, gesture, values), (plan) => this.moveOf(plan, gesture, at));
  }

  /** Only what is another: a form that is given again would lose its place and its hold. */
  private changeOf(plan: Plan, gesture: string, values: Record<string, string | number>): PlanEdit | null {
    const old = plan.gestures?.find((each) => each.id === gesture) as Record<string, unknown> | undefined;
    const isOther = ([name, value]: [string, string | number]): boolean =>
      typeof value === "number" ? Math.abs(value - ((old?.[name] as number | undefined) ?? 1)) > LEAST_MOVE : value !== old?.[name];
    const others = Object.fromEntries(Object.entries(values).filter(isOther));
    return old === undefined || !Object.keys(others).length ? null : { kind: "change", gesture, ...others };
  }

  /** The whole gesture goes with its stroke. */
  private moveOf(plan: Plan, gesture: string, to: number): PlanEdit | null {
    const old = plan.gestures?.find((each) => each.id === gesture);
    return old === undefined || Math.abs(to - old.stroke) < LEAST_MOVE ? null : { kind: "move", gesture, to };
  }

  private draw({ selection, gesture }: State): void {
    const { model, take } = this.store;
    const target = take.plan?.gestures?.find((each) => each.id === gesture);
    const edits = model.takes_gestures && take.plan !== null;
    find("gesture-tools").hidden = !edits;
    find("gestures").hidden = !model.takes_gestures;
    find("edit-hint").hidden = selection !== null || !edits;
    find("select-tools").hidden = take.plan === null;
    for (const id of ["change-gesture", "remove-gesture"]) enable(id, target !== undefined, "add-gesture");
    const lock = find<HTMLButtonElement>("lock");
    lock.disabled = target === undefined;
    lock.textContent = target && take.plan && isLocked(take.plan, target) ? "Unlock all" : "Lock";
    const locked = selection !== null && take.plan !== null && touchesLock(take.plan, { from: selection[0], to: selection[1] });
    find("lock-stretch").textContent = locked ? "Unlock all" : "Lock";
    find("stretch-tools").hidden = selection === null || take.plan === null;
    if (selection !== null) find("stretch-time").textContent = `${formatTime(selection[0])} – ${formatTime(selection[1])}`;
    const styles = stretchStyles(model, take.plan);
    if (this.shownStyles !== styles.join()) {
      this.shownStyles = styles.join();
      fillSelect(find("stretch-style"), [KEEP, ...styles.map((name): [string, string] => [name, readName(name)])], "");
    }
  }
}

/** The styles that a stretch of a plan may have: nobody sits down or gets up within one. */
function stretchStyles(model: ModelRow, plan: Plan | null): string[] {
  const sits = plan?.style != null && model.seated.includes(plan.style);
  return model.styles.filter((name) => model.seated.includes(name) === sits);
}

function round(seconds: number): number {
  return Math.round(seconds * 1000) / 1000;
}
