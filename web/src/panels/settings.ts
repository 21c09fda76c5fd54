// The panel of the performance: model, style, emotion, intensity, freedom, seed, parts, frames per second.

import { sendClip } from "../api";
import { fillSelect, find, make, modelRows, readName } from "../dom";
import { PARTS, type State, type Store } from "../state";
import type { Takes } from "../takes";

const RATES = [15, 23.976, 24, 25, 29.97, 30, 50, 60];
const MOST_SEED = 2 ** 31 - 1; // what a number field shows without an exponent

export class SettingsPanel {
  private shownModel = "";
  private shownMix = "";

  constructor(private readonly store: Store, private readonly takes: Takes) {
    const { catalogue } = store.state;
    fillSelect(find("model"), modelRows(catalogue.models), catalogue.default_model);
    fillSelect(find("emotion"), emotionRows(catalogue.emotions), "auto");
    fillSelect(find("fps"), RATES.map((rate) => [String(rate), String(rate)]), "30");
    this.onSelect("model", (model) => takes.changeSettings({ model, style: "", mix: null, clip: null }));
    this.onSelect("style", (style) => {
      if (style !== "*clip" && style !== "*mix") takes.changeSettings({ style, clip: null, mix: null });
    });
    this.onSelect("emotion", (emotion) => takes.changeSettings({ emotion }));
    this.onSelect("fps", (fps) => takes.changeSettings({ fps: Number(fps) }));
    this.onSlide("intensity", (intensity) => takes.changeSettings({ intensity }));
    this.onSlide("temperature", (temperature) => takes.changeSettings({ temperature }));
    const seed = find<HTMLInputElement>("seed");
    seed.max = String(MOST_SEED);
    seed.addEventListener("change", () => {
      takes.changeSeed(Math.min(Math.max(Math.floor(seed.valueAsNumber || 0), 0), MOST_SEED));
      seed.value = String(store.take.seed);
    });
    find("next-seed").addEventListener("click", () => takes.changeSeed(store.take.seed < MOST_SEED ? store.take.seed + 1 : 0));
    for (const part of PARTS) find(`part-${part}`).addEventListener("change", () => this.changeParts());
    this.listenToStyles();
    store.onChange((state) => this.draw(state));
  }

  private onSelect(id: string, tell: (value: string) => void): void {
    const select = find<HTMLSelectElement>(id);
    select.addEventListener("change", () => tell(select.value));
  }

  /** The number beside a slider follows at once; motion is asked for when it is let go. */
  private onSlide(id: string, tell: (value: number) => void): void {
    const slider = find<HTMLInputElement>(id);
    const value = find<HTMLOutputElement>(`${id}-value`);
    slider.addEventListener("input", () => (value.value = slider.valueAsNumber.toFixed(2)));
    slider.addEventListener("change", () => tell(slider.valueAsNumber));
  }

  private changeParts(): void {
    const parts = PARTS.filter((part) => find<HTMLInputElement>(`part-${part}`).checked);
    if (parts.length) this.takes.changeSettings({ parts });
    else this.store.update({ notice: "one part at least moves" });
  }

  private listenToStyles(): void {
    const clip = find<HTMLInputElement>("clip-file");
    find("choose-clip").addEventListener("click", () => clip.click());
    clip.addEventListener("change", () => {
      if (clip.files?.[0]) void this.takeClip(clip.files[0]);
      clip.value = "";
    });
    find("open-mix").addEventListener("click", () => {
      const { settings } = this.store.state;
      const styles = this.store.model.styles;
      const mix = settings.mix === null ? Object.fromEntries(styles.slice(0, 2).map((name) => [name, 0.5])) : null;
      this.takes.changeSettings({ mix, clip: null });
    });
  }

  /** A clip as an example of style. */
  async takeClip(file: File): Promise<void> {
    if (!this.store.model.takes_example) {
      const others = this.store.state.catalogue.models.filter((row) => row.takes_example).map((row) => row.name);
      const some = others.length > 1 ? `${others.join(", ")} do` : `${others[0] ?? "none"} does`;
      this.store.update({ problem: `the model ${this.store.model.name} takes no example of style (${some})` });
      return;
    }
    try {
      this.takes.changeSettings({ clip: await sendClip(file), mix: null, style: "" });
    } catch (error) {
      this.store.update({ problem: error instanceof Error ? error.message : String(error) });
    }
  }

  private draw(state: State): void {
    const { settings } = state;
    const { model } = this.store;
    find<HTMLSelectElement>("model").value = model.name;
    this.drawStyles(state);
    find<HTMLSelectElement>("emotion").value = settings.emotion;
    find<HTMLSelectElement>("fps").value = String(settings.fps);
    for (const id of ["intensity", "temperature"] as const) {
      find<HTMLInputElement>(id).valueAsNumber = settings[id];
      find<HTMLOutputElement>(`${id}-value`).value = settings[id].toFixed(2);
    }
    const seed = find<HTMLInputElement>("seed");
    if (document.activeElement !== seed) seed.value = String(this.store.take.seed);
    for (const part of PARTS) {
      const box = find<HTMLInputElement>(`part-${part}`);
      box.disabled = !model.parts.includes(part);
      box.checked = settings.parts.includes(part) && !box.disabled;
    }
  }

  private drawStyles({ settings }: State): void {
    const { model } = this.store;
    const special = settings.clip ? "*clip" : settings.mix ? "*mix" : "";
    const key = `${model.name} ${special} ${settings.clip?.name}`;
    const select = find<HTMLSelectElement>("style");
    if (key !== this.shownModel) {
      this.shownModel = key;
      const rows: [string, string][] = [["", "the model's own"], ...model.styles.map((name): [string, string] => [name, readName(name)])];
      if (settings.clip) rows.push(["*clip", `as ${settings.clip.name}`]);
      if (settings.mix) rows.push(["*mix", "a mixture"]);
      fillSelect(select, rows, special);
    }
    select.value = special || settings.style;
    find("choose-clip").hidden = !model.takes_example;
    find("open-mix").hidden = model.styles.length < 2;
    find("open-mix").setAttribute("aria-expanded", String(settings.mix !== null));
    this.drawMix(settings.mix);
  }

  private drawMix(mix: Record<string, number> | null): void {
    const box = find("mix");
    box.hidden = mix === null;
    const key = mix === null ? "" : `${this.store.model.name} ${JSON.stringify(mix)}`;
    if (key === this.shownMix || mix === null) return;
    this.shownMix = key;
    const focus = document.activeElement?.id;
    box.replaceChildren(...this.store.model.styles.map((name) => this.share(name, mix)));
    if (focus?.startsWith("mix-")) document.getElementById(focus)?.focus();
  }

  private share(name: string, mix: Record<string, number>): HTMLElement {
    const slider = make("input", { type: "range", id: `mix-${name}`, min: "0", max: "1", step: "0.05", value: String(mix[name] ?? 0) });
    slider.addEventListener("change", () => {
      const shares = Object.entries({ ...mix, [name]: slider.valueAsNumber }).filter(([, share]) => share > 0);
      if (shares.length) this.takes.changeSettings({ mix: Object.fromEntries(shares) });
      else slider.valueAsNumber = mix[name];
    });
    return make("label", {}, readName(name), slider);
  }
}

export function emotionRows(emotions: string[]): [string, string][] {
  const rows = emotions.filter((name) => name !== "auto").map((name): [string, string] => [name, readName(name)]);
  return [["auto", "as the voice sounds"], ...rows];
}
