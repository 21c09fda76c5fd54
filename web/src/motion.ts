// Motion as the server sends it, and the pose of any moment of it.

import type { MotionHeader } from "./messages";

const ROUNDING = 1e-3; // frames; a browser rounds the time of a sound to a millionth of a second

/** A pose of our humanoid: metres, local rotations as quaternions xyzw, ARKit weights. */
export interface Pose {
  root: Float32Array;
  rotations: Float32Array;
  face: Float32Array;
}

/** Room for a pose of a skeleton of `joints` joints and a face of `weights` shapes. */
export function makePose(joints: number, weights: number): Pose {
  const rotations = new Float32Array(joints * 4);
  for (let k = 3; k < rotations.length; k += 4) rotations[k] = 1;
  return { root: new Float32Array(3), rotations, face: new Float32Array(weights) };
}

/** Frames of motion: root (T, 3), rotations (T, J, 4), face (T, 52). */
export class Motion {
  readonly fps: number;
  readonly frames: number;
  readonly joints: string[];
  readonly weights: string[];
  readonly root: Float32Array;
  readonly rotations: Float32Array;
  readonly face: Float32Array;

  constructor(header: MotionHeader, root: Float32Array, rotations: Float32Array, face: Float32Array) {
    this.fps = header.fps;
    this.frames = header.frames;
    this.joints = header.joints;
    this.weights = header.weights;
    this.root = root;
    this.rotations = rotations;
    this.face = face;
  }

  /** Read the answer of `/api/takes/…/motion`: length, header in JSON, padding to 4 bytes, numbers. */
  static decode(data: ArrayBuffer): Motion {
    const length = new DataView(data).getUint32(0, true);
    const header = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length))) as MotionHeader;
    let offset = Math.ceil((4 + length) / 4) * 4;
    const take = (count: number): Float32Array => {
      const part = new Float32Array(data, offset, count);
      offset += count * 4;
      return part;
    };
    const { frames, joints, weights } = header;
    return new Motion(header, take(frames * 3), take(frames * joints.length * 4), take(frames * weights.length));
  }

  get seconds(): number {
    return this.frames / this.fps;
  }

  /** The number of the frame that is shown at a time in seconds. */
  frameAt(time: number): number {
    return Math.min(Math.max(Math.floor(time * this.fps + ROUNDING), 0), this.frames - 1);
  }

  /** Write the pose of a time in seconds into `pose`; between two frames it is linear. */
  sample(time: number, pose: Pose): void {
    const at = Math.min(Math.max(time * this.fps, 0), this.frames - 1);
    const before = Math.floor(at + 1e-6);
    const after = Math.min(before + 1, this.frames - 1);
    const share = Math.max(at - before, 0);
    mix(this.root, pose.root, before, after, share);
    if (this.weights.length) mix(this.face, pose.face, before, after, share);
    else pose.face.fill(0); // a motion without a face
    mixRotations(this.rotations, pose.rotations, before, after, share);
  }
}

function mix(source: Float32Array, target: Float32Array, before: number, after: number, share: number): void {
  const width = target.length;
  for (let k = 0; k < width; k++) {
    target[k] = source[before * width + k] * (1 - share) + source[after * width + k] * share;
  }
}

/** Mix quaternions by their numbers, on the nearer side, and normalise: frames are near to each other. */
function mixRotations(source: Float32Array, target: Float32Array, before: number, after: number, share: number): void {
  const width = target.length;
  const [a, b] = [before * width, after * width];
  for (let k = 0; k < width; k += 4) {
    let dot = 0;
    for (let c = k; c < k + 4; c++) dot += source[a + c] * source[b + c];
    const towards = dot < 0 ? -share : share;
    let length = 0;
    for (let c = k; c < k + 4; c++) {
      target[c] = source[a + c] * (1 - share) + source[b + c] * towards;
      length += target[c] * target[c];
    }
    const scale = 1 / Math.sqrt(length || 1);
    for (let c = k; c < k + 4; c++) target[c] *= scale;
  }
}
