// From ARKit's weights to VRM's presets and Oculus' visemes: the formula of src/cospeech/export/visemes.py, which explains it.
// Its figures come with the catalogue. A test compares what both make of the same faces.

import type { FaceTables } from "./messages";

/** Name of what drives a shape → its weight. */
export type Drivers = Record<string, number>;

const clamp = (value: number): number => Math.min(Math.max(value, 0), 1);

/** The mean of the left and the right of some shapes. */
function meanOf(arkit: Drivers, ...stems: string[]): number {
  return stems.reduce((total, stem) => total + arkit[`${stem}Left`] + arkit[`${stem}Right`], 0) / (2 * stems.length);
}

/** VRM 1.0's presets of mouth, lids, looks and moods. */
export function presetsOf(arkit: Drivers, { scales, moods }: FaceTables): Drivers {
  const opening = clamp((arkit.jawOpen - arkit.mouthClose) / scales.open);
  const rounding = clamp(Math.max(arkit.mouthPucker, arkit.mouthFunnel) / scales.round);
  const smile = Math.max(meanOf(arkit, "mouthSmile") - scales.at_ease, 0) / scales.smiled;
  const wide = clamp(meanOf(arkit, "mouthStretch") / scales.stretched + smile - rounding);
  const parting = clamp(Math.max(opening, meanOf(arkit, "mouthLowerDown", "mouthUpperUp") / scales.parted));
  const both = Math.min(arkit.eyeBlinkLeft, arkit.eyeBlinkRight);
  const emotions = Object.entries(moods).map(([mood, [base, shares]]): [string, number] =>
    [mood, clamp(Object.entries(shares).reduce((total, [name, share]) => total + share * arkit[name], base))]);
  return {
    ...Object.fromEntries(emotions),
    aa: (1 - rounding) * opening * (1 - wide),
    ih: (1 - rounding) * (1 - opening) * wide * parting,
    ou: rounding * (1 - opening),
    ee: (1 - rounding) * opening * wide,
    oh: rounding * opening,
    blink: both,
    blinkLeft: arkit.eyeBlinkLeft - both,
    blinkRight: arkit.eyeBlinkRight - both,
    lookUp: meanOf(arkit, "eyeLookUp"),
    lookDown: meanOf(arkit, "eyeLookDown"),
    lookLeft: (arkit.eyeLookOutLeft + arkit.eyeLookInRight) / 2,
    lookRight: (arkit.eyeLookInLeft + arkit.eyeLookOutRight) / 2,
  };
}

/** The visemes of Oculus that lips alone tell apart. */
export function visemesOf(arkit: Drivers, tables: FaceTables): Drivers {
  const presets = presetsOf(arkit, tables);
  const shut = 1 - clamp((arkit.jawOpen - arkit.mouthClose) / tables.scales.open);
  const [upper, lower] = [arkit.mouthRollUpper, arkit.mouthRollLower];
  const vowels = Object.entries(tables.vowels).map(([viseme, preset]): [string, number] => [viseme, presets[preset]]);
  vowels.push(["FF", shut * clamp(lower - upper)]);
  vowels.push(["PP", shut * Math.max(meanOf(arkit, "mouthPress"), Math.min(upper, lower))]);
  const sum = vowels.reduce((total, [, weight]) => total + weight, 0);
  const room = Math.max(sum, 1);
  return { ...Object.fromEntries(vowels.map(([viseme, weight]) => [viseme, weight / room])), sil: Math.max(1 - sum / room, 0) };
}
