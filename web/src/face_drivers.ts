// From ARKit's weights to VRM's presets and Oculus' visemes: the formula of src/cospeech/export/visemes.py, which explains it.
// Its figures come with the catalogue. A test compares what both make of the same faces.

import type { FaceTables } from "./messages";

/** Name of what drives a shape → its weight. */
export type Drivers = Record<string, number>;

const held = (value: number): number => Math.min(Math.max(value, 0), 1);

/** The mean of the left and the right of some shapes. */
function meanOf(arkit: Drivers, ...stems: string[]): number {
  return stems.reduce((total, stem) => total + arkit[`${stem}Left`] + arkit[`${stem}Right`], 0) / (2 * stems.length);
}

/** VRM 1.0's presets of mouth, lids, looks and moods. */
export function presetsOf(arkit: Drivers, { scales, moods }: FaceTables): Drivers {
  const opened = held((arkit.jawOpen - arkit.mouthClose) / scales.open);
  const rounded = held(Math.max(arkit.mouthPucker, arkit.mouthFunnel) / scales.round);
  const smile = Math.max(meanOf(arkit, "mouthSmile") - scales.at_ease, 0) / scales.smiled;
  const wide = held(meanOf(arkit, "mouthStretch") / scales.stretched + smile - rounded);
  const parted = held(Math.max(opened, meanOf(arkit, "mouthLowerDown", "mouthUpperUp") / scales.parted));
  const both = Math.min(arkit.eyeBlinkLeft, arkit.eyeBlinkRight);
  const felt = Object.entries(moods).map(([mood, [base, shares]]): [string, number] =>
    [mood, held(Object.entries(shares).reduce((total, [name, share]) => total + share * arkit[name], base))]);
  return {
    ...Object.fromEntries(felt),
    aa: (1 - rounded) * opened * (1 - wide),
    ih: (1 - rounded) * (1 - opened) * wide * parted,
    ou: rounded * (1 - opened),
    ee: (1 - rounded) * opened * wide,
    oh: rounded * opened,
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
  const shut = 1 - held((arkit.jawOpen - arkit.mouthClose) / tables.scales.open);
  const [upper, lower] = [arkit.mouthRollUpper, arkit.mouthRollLower];
  const named = Object.entries(tables.vowels).map(([viseme, preset]): [string, number] => [viseme, presets[preset]]);
  named.push(["FF", shut * held(lower - upper)]);
  named.push(["PP", shut * Math.max(meanOf(arkit, "mouthPress"), Math.min(upper, lower))]);
  const sum = named.reduce((total, [, weight]) => total + weight, 0);
  const room = Math.max(sum, 1);
  return { ...Object.fromEntries(named.map(([viseme, weight]) => [viseme, weight / room])), sil: Math.max(1 - sum / room, 0) };
}
