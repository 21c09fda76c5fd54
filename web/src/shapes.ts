// Faces of other characters: ARKit's shapes where they have them, else a few shapes of the mouth and the lids.

/** Shape of VRM → ARKit's weights of which it is the sum. The mouth is closed where lips are pressed. */
const SUMS: Record<string, Record<string, number>> = {
  aa: { jawOpen: 1.1, mouthFunnel: -0.4, mouthPucker: -0.4 },
  ou: { mouthPucker: 0.9 },
  oh: { mouthFunnel: 0.9 },
  ee: { mouthStretchLeft: 0.4, mouthStretchRight: 0.4 },
  blinkLeft: { eyeBlinkLeft: 1 },
  blinkRight: { eyeBlinkRight: 1 },
};
// [ours] The shares keep the mouth of the example speech about as wide open as our mannequin's.

/** Mood of VRM → what is added to a sum of ARKit's weights, and their shares: as in src/cospeech/export/visemes.py. */
const MOODS: Record<string, [number, Record<string, number>]> = {
  happy: [-0.4, { mouthSmileLeft: 0.8, mouthSmileRight: 0.8 }],
  angry: [-0.2, { browDownLeft: 0.425, browDownRight: 0.425, browInnerUp: -0.7 }],
  sad: [-0.1, { mouthFrownLeft: 0.6, mouthFrownRight: 0.6, browDownLeft: -0.25, browDownRight: -0.25 }],
  surprised: [-0.25, { eyeWideLeft: 0.4, eyeWideRight: 0.4, browInnerUp: 0.2 }],
};

/** ARKit weights of a pose → weights of the shapes that a character has. */
export class ShapeMap {
  private readonly rows: { shape: string; base: number; terms: [number, number][] }[] = [];
  /** Whether the face moves at all. */
  readonly moves: boolean;

  constructor(weights: string[], has: (shape: string) => boolean) {
    const own = weights.filter((name) => has(name));
    if (own.length >= weights.length / 2) {
      this.rows = own.map((name) => ({ shape: name, base: 0, terms: [[weights.indexOf(name), 1]] }));
    } else {
      const sums = Object.entries(SUMS).map(([shape, sum]): [string, [number, Record<string, number>]] => [shape, [0, sum]]);
      for (const [shape, [base, sum]] of [...sums, ...Object.entries(MOODS)]) {
        const terms = Object.entries(sum).map(([name, share]): [number, number] => [weights.indexOf(name), share]);
        if (has(shape)) this.rows.push({ shape, base, terms });
      }
    }
    this.moves = this.rows.length > 0;
  }

  apply(face: Float32Array, set: (shape: string, value: number) => void): void {
    for (const { shape, base, terms } of this.rows) {
      const sum = terms.reduce((total, [column, share]) => total + face[column] * share, base);
      set(shape, Math.min(Math.max(sum, 0), 1));
    }
  }
}
