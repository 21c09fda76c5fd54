// Faces of other characters: ARKit's shapes where they have them, else a few shapes of the mouth and the lids.

/** Shape of VRM → ARKit's weights of which it is the sum. The mouth is closed where lips are pressed. */
const SUMS: Record<string, Record<string, number>> = {
  aa: { jawOpen: 1.1, mouthFunnel: -0.4, mouthPucker: -0.4 },
  ou: { mouthPucker: 0.9 },
  oh: { mouthFunnel: 0.9 },
  ee: { mouthStretchLeft: 0.4, mouthStretchRight: 0.4 },
  happy: { mouthSmileLeft: 0.4, mouthSmileRight: 0.4 },
  blinkLeft: { eyeBlinkLeft: 1 },
  blinkRight: { eyeBlinkRight: 1 },
};
// [ours] The shares keep the mouth of the example speech about as wide open as our mannequin's.

/** ARKit weights of a pose → weights of the shapes that a character has. */
export class ShapeMap {
  private readonly rows: { shape: string; terms: [number, number][] }[] = [];
  /** Whether the face moves at all. */
  readonly moves: boolean;

  constructor(weights: string[], has: (shape: string) => boolean) {
    const own = weights.filter((name) => has(name));
    if (own.length >= weights.length / 2) {
      this.rows = own.map((name) => ({ shape: name, terms: [[weights.indexOf(name), 1]] }));
    } else {
      for (const [shape, sum] of Object.entries(SUMS)) {
        const terms = Object.entries(sum).map(([name, share]): [number, number] => [weights.indexOf(name), share]);
        if (has(shape)) this.rows.push({ shape, terms });
      }
    }
    this.moves = this.rows.length > 0;
  }

  apply(face: Float32Array, set: (shape: string, value: number) => void): void {
    for (const { shape, terms } of this.rows) {
      const sum = terms.reduce((total, [column, share]) => total + face[column] * share, 0);
      set(shape, Math.min(Math.max(sum, 0), 1));
    }
  }
}
