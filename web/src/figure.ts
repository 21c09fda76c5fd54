// A character that can be posed: our mannequin, or somebody's own (avatar.ts).

import { Mesh, Object3D, Vector3 } from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { clone } from "three/addons/utils/SkeletonUtils.js";
import type { FaceRig } from "./face_rig";
import type { Pose } from "./motion";

export interface Figure {
  readonly root: Object3D;
  /** Take a pose of our humanoid. */
  show(pose: Pose): void;
  /** How far the mouth is open, as the shapes of the face stand: 0 to 1. */
  jawOpen(): number;
  /** What moves the face of somebody's own character. */
  readonly face?: FaceRig;
  /** What turns as a joint of ours. */
  bone(name: string): Object3D | undefined;
  /** Another one that looks the same. */
  copy(): Promise<Figure>;
  dispose(): void;
}

/** Meshes cast and take shadows. A skinned mesh moves out of the box that it has at rest, so it is never left out. */
export function prepareMeshes(root: Object3D): void {
  root.traverse((node) => {
    if (node instanceof Mesh) {
      node.castShadow = true;
      node.receiveShadow = true;
      node.frustumCulled = false;
    }
  });
}

/** Free what the graphics card holds of a character. */
export function disposeMeshes(root: Object3D): void {
  root.traverse((node) => {
    if (node instanceof Mesh) {
      node.geometry.dispose();
      for (const material of [node.material].flat()) material.dispose();
    }
  });
}

/** Where a joint is, metres from the place on which the character stands; null where it has no such joint. */
export function placeOf(figure: Figure, joint: string): [number, number, number] | null {
  const [{ root }, node] = [figure, figure.bone(joint)];
  if (node === undefined) return null;
  root.updateWorldMatrix(true, true);
  const place = root.worldToLocal(node.getWorldPosition(new Vector3()));
  return [place.x, place.y, place.z];
}

/** Our mannequin: its joints have our names and rest unturned, its shapes are ARKit's. */
export class Mannequin implements Figure {
  private readonly joints: (Object3D | undefined)[];
  private readonly faces: { mesh: Mesh; columns: number[] }[] = [];
  private readonly byName = new Map<string, Object3D>();

  constructor(readonly root: Object3D, private readonly names: string[], private readonly weights: string[]) {
    prepareMeshes(root);
    root.traverse((node) => {
      this.byName.set(node.name, node);
      if (node instanceof Mesh && node.morphTargetDictionary !== undefined) {
        const shapes = node.morphTargetDictionary;
        this.faces.push({ mesh: node, columns: weights.map((name) => shapes[name] ?? -1) });
      }
    });
    this.joints = names.map((name) => this.byName.get(name));
  }

  static async load(url: string, names: string[], weights: string[]): Promise<Mannequin> {
    const file = await new GLTFLoader().loadAsync(url);
    return new Mannequin(file.scene, names, weights);
  }

  show(pose: Pose): void {
    this.joints[0]?.position.fromArray(pose.root);
    this.joints.forEach((joint, k) => joint?.quaternion.fromArray(pose.rotations, k * 4));
    for (const { mesh, columns } of this.faces) {
      const influences = mesh.morphTargetInfluences ?? [];
      columns.forEach((column, k) => {
        if (column >= 0) influences[column] = pose.face[k];
      });
    }
  }

  jawOpen(): number {
    const face = this.faces[0];
    const column = face?.columns[this.weights.indexOf("jawOpen")] ?? -1;
    return column < 0 ? 0 : (face.mesh.morphTargetInfluences?.[column] ?? 0);
  }

  bone(name: string): Object3D | undefined {
    return this.byName.get(name);
  }

  copy(): Promise<Figure> {
    return Promise.resolve(new Mannequin(clone(this.root), this.names, this.weights));
  }

  dispose(): void {
    this.root.removeFromParent(); // geometry and materials are shared by all mannequins
  }
}
