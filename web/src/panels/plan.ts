// The plan as a file: downloading it, opening one, and asking before edits are lost.

import { isGone, openPlan, readPlanFile } from "../api";
import { find, saveFile, stemOf } from "../dom";
import type { Plan } from "../messages";
import { isReady, type Store } from "../state";
import type { Takes } from "../takes";

const MARK = "cospeech_plan"; // the entry that every plan has

/** Whether a file of JSON is meant as a plan; a transcript may be JSON, too. */
export async function isPlan(file: File): Promise<boolean> {
  return /\.plan\.json$/i.test(file.name) || (/\.json$/i.test(file.name) && (await file.text()).includes(`"${MARK}"`));
}

export class PlanPanel {
  constructor(private readonly store: Store, private readonly takes: Takes) {
    const input = find<HTMLInputElement>("plan-file");
    find("save-plan").addEventListener("click", () => void this.save());
    find("open-plan").addEventListener("click", () => input.click());
    input.addEventListener("change", () => {
      if (input.files?.[0]) void this.open(input.files[0]);
      input.value = "";
    });
    window.addEventListener("beforeunload", (event) => {
      if (takes.hasUnsaved) event.preventDefault();
    });
    store.onChange(() => this.draw());
  }

  private async save(): Promise<void> {
    const { take, state } = this.store;
    if (take.id === null) return;
    const { edited } = take;
    try {
      const file = await readPlanFile(take.id).catch((error: unknown) => {
        if (!isGone(error)) throw error;
        return new Blob([JSON.stringify(take.plan, null, 1)], { type: "application/json" }); // the page has it still
      });
      saveFile(file, `${stemOf(state.speech?.name ?? "talk")}.plan.json`);
      this.takes.markSaved(edited);
    } catch (error) {
      this.store.update({ problem: `the plan cannot be downloaded: ${error instanceof Error ? error.message : String(error)}` });
    }
  }

  /** Play the plan of a file as the chosen take. */
  async open(file: File): Promise<void> {
    const { speech, settings } = this.store.state;
    if (speech === null) return this.store.update({ problem: "a plan goes with a speech (drop the speech first)" });
    try {
      const { plan, note } = await openPlan({ plan: await readPlan(file), speech: speech.speech, model: settings.model });
      this.takes.openPlan(plan);
      this.store.update({ problem: "", notice: note });
    } catch (error) {
      this.store.update({ problem: `${file.name}: ${error instanceof Error ? error.message : String(error)}` });
    }
  }

  private draw(): void {
    find<HTMLButtonElement>("save-plan").disabled = !isReady(this.store.take) || this.store.take.plan === null;
    find("unsaved").hidden = !this.takes.hasUnsaved;
  }
}

async function readPlan(file: File): Promise<Plan> {
  const values = await file.text().then(JSON.parse).catch(() => null) as Plan | null;
  if (values?.cospeech_plan === undefined) throw new Error("this is no plan (Download plan writes one, and cospeech generate --plan-out)");
  return values;
}
