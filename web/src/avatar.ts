// Somebody's own character: a VRM by its humanoid, a GLB by the names of its bones. The file stays in the browser.

import { VRMHumanBoneName, VRMLoaderPlugin, VRMUtils, type VRM } from "@pixiv/three-vrm";
import { Bone, Box3, Object3D, Quaternion, Vector3 } from "three";
import { GLTFLoader, type GLTF } from "three/addons/loaders/GLTFLoader.js";
import { Problem } from "./api";
import { findBones } from "./bones";
import { FaceRig } from "./face_rig";
import { disposeMeshes, prepareMeshes, type Figure } from "./figure";
import type { Catalogue } from "./messages";
import type { Pose } from "./motion";

/** Our humanoid, and what is known of the files of others, as the catalogue tells it. */
export type Humanoid = Pick<Catalogue, "joints" | "parents" | "rest" | "weights" | "face" | "packed">;

const LEAST_BONES = 8; // a body has at least hips, head, arms and legs of two bones [ours]; a head with a face needs none

const EYES = ["leftEye", "rightEye"];

const LEGS = 0.6; // surface this far below the hips, of the way from hips to head, is legs; of a half body a third [ours]

const HEAD = 0.3; // metres from the neck to the top of a head [ours: our mannequin]

/** Refuse a character that three.js cannot read as it is packed: as `check_packing` of src/cospeech/export/character_files.py. */
function checkPacking(data: ArrayBuffer, name: string, packed: string[]): void {
  let document: { extensionsUsed?: string[]; extensionsRequired?: string[] } = {};
  try {
    document = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 20, new DataView(data).getUint32(12, true)))); // glTF 2.0, 4.4
  } catch { // the loader says what is wrong
  }
  const has = (list: unknown, name: string): boolean => Array.isArray(list) && list.includes(name);
  const { extensionsUsed, extensionsRequired } = document;
  const packing = packed.find((each) => has(extensionsRequired, each) || (/draco/.test(each) && has(extensionsUsed, each)));
  if (packing) throw new Problem(`${name} is packed by ${packing}`, "export it without compression");
}

/** Read somebody's character; what cannot be used is a Problem. */
export async function loadAvatar(data: ArrayBuffer, name: string, humanoid: Humanoid): Promise<Figure> {
  const whole = data.byteLength < 12 ? Infinity : new DataView(data).getUint32(8, true); // glTF 2.0, 4.4.2
  if (whole > data.byteLength) throw new Problem(`${name} is cut off: ${data.byteLength} bytes of ${whole}`, "copy or download it again");
  checkPacking(data, name, humanoid.packed);
  const loader = new GLTFLoader();
  loader.register((parser) => new VRMLoaderPlugin(parser));
  let file: GLTF;
  try {
    file = await loader.parseAsync(data.slice(0), "");
  } catch {
    throw new Problem(`${name} cannot be read`, "a .vrm, or a .glb with a skin");
  }
  const vrm = file.userData.vrm as VRM | undefined;
  const again = (): Promise<Figure> => loadAvatar(data, name, humanoid);
  return vrm ? new VrmFigure(vrm, file, humanoid, again) : new GlbFigure(file, name, humanoid, again);
}

/** A VRM: its normalised bones rest as ours do, so that rotations are taken as they are. */
class VrmFigure implements Figure {
  readonly root: Object3D;
  readonly face: FaceRig;
  private readonly bones: (Object3D | null)[];
  private readonly scale: number;
  private readonly side: number;
  private readonly turnsByBones: boolean; // its eyes; expressions of looking would turn them twice

  constructor(private readonly vrm: VRM, file: GLTF, humanoid: Humanoid, private readonly again: () => Promise<Figure>) {
    this.root = new Object3D();
    this.root.add(vrm.scene);
    VRMUtils.rotateVRM0(vrm);
    prepareMeshes(vrm.scene);
    this.side = vrm.meta.metaVersion === "0" ? -1 : 1; // VRM 0 faces −Z
    const eyes = EYES.map((name) => this.bone(name));
    this.face = new FaceRig(file, humanoid.weights, humanoid.face, eyes[0] !== undefined);
    const resting = this.face.turnsEyes(eyes) ? EYES : [];
    this.turnsByBones = eyes[0] !== undefined && !resting.length;
    this.bones = humanoid.joints.map((name) => resting.includes(name) ? null : vrm.humanoid.getNormalizedBoneNode(name as VRMHumanBoneName));
    this.scale = (this.bones[0]?.position.y ?? humanoid.rest[0][1]) / humanoid.rest[0][1];
  }

  show(pose: Pose): void {
    const { side } = this;
    this.bones[0]?.position.set(pose.root[0] * side, pose.root[1], pose.root[2] * side).multiplyScalar(this.scale);
    this.bones.forEach((bone, k) => {
      const [x, y, z, w] = pose.rotations.subarray(k * 4, k * 4 + 4);
      bone?.quaternion.set(x * side, y, z * side, w);
    });
    const drivers = this.face.driversOf(pose.face);
    if (this.face.alphabet === "VRM") { // expressions also change materials
      for (const [name, weight] of Object.entries(drivers)) {
        if (!(this.turnsByBones && name.startsWith("look"))) this.vrm.expressionManager?.setValue(name, weight);
      }
    }
    this.vrm.update(0);
    this.face.apply(drivers); // three-vrm puts shapes back to 0, and not to their weights at rest
  }

  jawOpen(): number {
    return this.face.opening();
  }

  bone(name: string): Object3D | undefined {
    return this.vrm.humanoid.getRawBoneNode(name as VRMHumanBoneName) ?? undefined;
  }

  copy(): Promise<Figure> {
    return this.again();
  }

  dispose(): void {
    this.root.removeFromParent();
    VRMUtils.deepDispose(this.vrm.scene);
  }
}

interface Driven {
  bone: Object3D;
  column: number;
  /** World rotation of the bone at rest, turned so that its limb points where ours does in the T-pose. */
  rest: Quaternion;
}

/** A GLB: bones take our world rotations on top of their own rest. */
class GlbFigure implements Figure {
  readonly root = new Object3D();
  private readonly mapping: Driven[] = [];
  private readonly byJoint = new Map<string, Object3D>();
  readonly face: FaceRig;
  private readonly scene: Object3D;
  private readonly world: Quaternion[];
  private readonly scale: number;
  private readonly hips: Vector3;

  constructor(file: GLTF, name: string, private readonly humanoid: Humanoid, private readonly again: () => Promise<Figure>) {
    const { scene } = file;
    this.scene = scene;
    this.root.add(scene);
    prepareMeshes(scene);
    this.root.updateMatrixWorld(true);
    const bones: Object3D[] = [];
    scene.traverse((node) => {
      if (node instanceof Bone) bones.push(node);
    });
    const indices = findBones(humanoid.joints, bones.map((bone) => bone.userData.name ?? bone.name));
    this.face = new FaceRig(file, humanoid.weights, humanoid.face, indices.has("leftEye"));
    if (indices.size < LEAST_BONES && !this.face.alphabet) {
      throw new Problem(`${name} has no humanoid that is recognised`, "a VRM says which bone is which");
    }
    for (const [joint, index] of indices) this.byJoint.set(joint, bones[index]);
    this.world = humanoid.joints.map(() => new Quaternion());
    this.collect();
    const box = new Box3().setFromObject(scene);
    if (!indices.size) {  // a face alone: its file may have any unit
      scene.scale.multiplyScalar(HEAD / Math.max(box.max.y - box.min.y, 1e-6));
      box.setFromObject(scene);
    }
    const [hips, head] = ["hips", "head"].map((joint) => this.byJoint.get(joint)?.getWorldPosition(new Vector3()));
    this.hips = hips ?? new Vector3();
    const [trunk, below] = [head && hips ? head.y - hips.y : 0, hips ? hips.y - box.min.y : 0];
    const stands = below > LEGS * trunk;
    const lift = stands ? -box.min.y : this.heightOf("head") - (head ?? box.getCenter(new Vector3())).y;
    const ours = stands ? humanoid.rest[0][1] : this.heightOf("head") - humanoid.rest[0][1];
    this.scale = Math.max(stands ? below : trunk, 0.05) / ours;
    scene.position.y += lift;
    this.hips.y += lift;
  }

  /** Metres above the ground at which a joint of ours is when we stand. */
  private heightOf(joint: string): number {
    const { joints, parents, rest } = this.humanoid;
    let height = 0;
    for (let k = joints.indexOf(joint); k >= 0; k = parents[k]) height += rest[k][1];
    return height;
  }

  /** Bones in the order of our joints, parents first. */
  private collect(): void {
    const { joints } = this.humanoid;
    const resting = this.face.turnsEyes(EYES.map((name) => this.byJoint.get(name))) ? EYES : [];
    joints.forEach((joint, column) => {
      const bone = this.byJoint.get(joint);
      if (bone === undefined || resting.includes(joint)) return;
      const rest = bone.getWorldQuaternion(new Quaternion());
      const turn = this.turnOf(column, bone);
      this.mapping.push({ bone, column, rest: turn.multiply(rest) });
    });
  }

  /** The rotation that takes the limb at rest to where ours points; arms, hands and legs only. */
  private turnOf(column: number, bone: Object3D): Quaternion {
    const { joints, parents, rest } = this.humanoid;
    const turn = new Quaternion();
    if (!/Arm|Hand|Leg|Thumb|Index|Middle|Ring|Little/.test(joints[column])) return turn;
    const below = joints[column].endsWith("Hand") ? joints[column].replace("Hand", "MiddleProximal") : "";
    const child = below ? joints.indexOf(below) : parents.indexOf(column);
    const next = child < 0 ? undefined : this.byJoint.get(joints[child]);
    if (next === undefined) {
      const above = this.mapping.find((each) => each.column === parents[column]);
      if (above) turn.copy(above.rest).multiply(above.bone.getWorldQuaternion(new Quaternion()).invert());
      return turn;
    }
    const from = next.getWorldPosition(new Vector3()).sub(bone.getWorldPosition(new Vector3())).normalize();
    return turn.setFromUnitVectors(from, new Vector3(...rest[child]).normalize());
  }

  show(pose: Pose): void {
    const { parents } = this.humanoid;
    this.world.forEach((rotation, k) => {
      rotation.fromArray(pose.rotations, k * 4);
      if (parents[k] >= 0) rotation.premultiply(this.world[parents[k]]);
    });
    const lean = new Vector3().fromArray(pose.root).sub(new Vector3(...this.humanoid.rest[0])).multiplyScalar(this.scale);
    const base = this.root.getWorldQuaternion(new Quaternion()).invert();
    for (const { bone, column, rest } of this.mapping) {
      const above = bone.parent;
      const inverse = above ? above.getWorldQuaternion(new Quaternion()).premultiply(base).invert() : new Quaternion();
      bone.quaternion.copy(inverse).multiply(this.world[column]).multiply(rest);
      if (column === 0 && above) {
        above.updateWorldMatrix(true, false);
        bone.position.copy(above.worldToLocal(this.root.localToWorld(this.hips.clone().add(lean))));
      }
      bone.updateMatrixWorld(true);
    }
    this.face.apply(this.face.driversOf(pose.face));
  }

  jawOpen(): number {
    return this.face.opening();
  }

  bone(name: string): Object3D | undefined {
    return this.byJoint.get(name);
  }

  copy(): Promise<Figure> {
    return this.again();
  }

  dispose(): void {
    this.root.removeFromParent();
    disposeMeshes(this.scene);
  }
}
