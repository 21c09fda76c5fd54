// The link that holds the settings: what stands after # in the address.

import type { Catalogue } from "./messages";
import { PARTS, type Part, type Settings } from "./state";

const MOST_SEED = 2 ** 31; // the server refuses what is too large; this only keeps numbers whole

const USUAL: Settings = {
  model: "", style: "", clip: null, mix: null, emotion: "auto", intensity: 1, temperature: 1, parts: [...PARTS], fps: 30,
};

/** The settings that a model has where nothing else is said. */
export function usualSettings(catalogue: Catalogue): Settings {
  return { ...USUAL, model: catalogue.default_model, parts: [...PARTS] };
}

/** Every setting and the seeds as text; a clip is not among them, for it is on this machine only. */
function describe(settings: Settings, seeds: number[]): Record<string, string> {
  return {
    model: settings.model,
    style: settings.style,
    mix: Object.entries(settings.mix ?? {}).map(([name, share]) => `${name}:${share}`).join(","),
    emotion: settings.emotion,
    intensity: String(settings.intensity),
    temperature: String(settings.temperature),
    parts: (settings.parts.length < PARTS.length ? settings.parts : PARTS).join(","),
    fps: String(settings.fps),
    seeds: seeds.join(","),
  };
}

/** Settings and seeds of takes as text: what is not as usual, and always the model and the seeds. */
export function writeLink(settings: Settings, seeds: number[]): string {
  const usual = describe(USUAL, []);
  const fields = Object.entries(describe(settings, seeds)).filter(([key, value]) => key === "model" || key === "seeds" || value !== usual[key]);
  return `#${new URLSearchParams(fields).toString().replace(/%2C/g, ",").replace(/%3A/g, ":")}`;
}

/** Settings and seeds out of such a text; what cannot be read has its usual value. */
export function readLink(text: string, catalogue: Catalogue): { settings: Settings; seeds: number[] } {
  const fields = new URLSearchParams(text.replace(/^#/, ""));
  const settings = usualSettings(catalogue);
  const model = catalogue.models.find((row) => row.name === fields.get("model"));
  if (model) settings.model = model.name;
  const styles = (model ?? catalogue.models.find((row) => row.name === settings.model))?.styles ?? [];
  if (styles.includes(fields.get("style") ?? "")) settings.style = fields.get("style") ?? "";
  settings.mix = readMix(fields.get("mix") ?? "", styles);
  if (catalogue.emotions.includes(fields.get("emotion") ?? "")) settings.emotion = fields.get("emotion") ?? "auto";
  settings.intensity = readNumber(fields.get("intensity"), 0, 1.5, 1);
  settings.temperature = readNumber(fields.get("temperature"), 0, 2, 1);
  settings.fps = readNumber(fields.get("fps"), 10, 120, 30);
  const parts = (fields.get("parts") ?? "").split(",").filter((part): part is Part => PARTS.includes(part as Part));
  if (parts.length) settings.parts = parts;
  const seeds = (fields.get("seeds") ?? "0").split(",").map((seed) => Math.floor(readNumber(seed, 0, MOST_SEED, 0)));
  return { settings, seeds: seeds.slice(0, 8) };
}

/** What such a text says that was not taken over, as KEY=VALUE; an address without settings says nothing. */
export function listIgnored(text: string, settings: Settings, seeds: number[]): string[] {
  const fields = new URLSearchParams(text.replace(/^#/, ""));
  const differs = (a: string, b: string) => a !== b && !(a.trim() !== "" && Number(a) === Number(b));
  return Object.entries(describe(settings, seeds))
    .filter(([key, value]) => fields.has(key) && differs(fields.get(key) ?? "", value))
    .map(([key]) => `${key}=${fields.get(key)}`);
}

function readNumber(text: string | null, least: number, most: number, usual: number): number {
  const value = text === null || text.trim() === "" ? NaN : Number(text);
  return Number.isFinite(value) ? Math.min(Math.max(value, least), most) : usual;
}

export function readMix(text: string, styles: string[]): Record<string, number> | null {
  const rows = text.split(",").map((row) => row.split(":")).filter(([name]) => styles.includes(name));
  if (!rows.length) return null;
  return Object.fromEntries(rows.map(([name, share]) => [name, readNumber(share ?? null, 0, 1, 0)]));
}
