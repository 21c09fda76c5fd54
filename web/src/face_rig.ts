// The face of somebody's character: which shapes speak ARKit, VRM or Oculus, and what drives them. It follows
// src/cospeech/export/face_rig.py, so that a character moves here as in a file; names and limits come with the catalogue.

import { Mesh, SkinnedMesh, type BufferAttribute, type InterleavedBufferAttribute, type Object3D } from "three";
import type { GLTF } from "three/addons/loaders/GLTFLoader.js";
import { presetsOf, visemesOf, type Drivers } from "./face_drivers";
import type { FaceTables } from "./messages";

/** `share` of a driver's weight goes to a shape of a mesh; binary drivers are on or off. */
interface Bind { driver: string; node: number; target: number; share: number; binary: boolean }
/** A node of the file: its meshes, their weights at rest, and what drives them. */
interface Face { node: number; meshes: Mesh[]; base: number[]; binds: Bind[] }
type Attribute = BufferAttribute | InterleavedBufferAttribute;

// Of the file's document, what is read here; it may be damaged, and then the face does not move.
interface MeshEntry { primitives: { targets?: unknown[]; extras?: { targetNames?: unknown } }[]; extras?: { targetNames?: unknown } }
interface ExpressionEntry { isBinary?: boolean; morphTargetBinds?: { node: number; index: number; weight?: number }[] }
interface GroupEntry { name?: string; presetName?: string; isBinary?: boolean; binds?: { mesh: number; index: number; weight?: number }[] }
interface FaceDocument {
  nodes?: { mesh?: number }[];
  meshes?: MeshEntry[];
  extensions?: {
    VRMC_vrm?: { expressions?: Record<string, Record<string, ExpressionEntry>> };
    VRM?: { blendShapeMaster?: { blendShapeGroups?: GroupEntry[] } };
  };
}

const OPENERS = ["jawOpen", "aa", "viseme_aa"]; // drivers that open the mouth
const PER_CENT = 100; // VRM 0.x counts weights so

export class FaceRig {
  /** In what the face is driven; nothing where it cannot be moved. */
  readonly alphabet: "ARKit" | "VRM" | "Oculus" | "" = "";
  private readonly faces: Face[] = [];

  constructor(file: GLTF, private readonly weights: string[], private readonly tables: FaceTables, eyesAreBones: boolean) {
    const meshes = listMeshes(file);
    let binds: Bind[] = [];
    try {
      [this.alphabet, binds] = this.choose(file.parser.json as FaceDocument, eyesAreBones);
    } catch (error) {
      if (!(error instanceof TypeError)) throw error; // an entry is missing, or of another type
    }
    for (const node of new Set(binds.map((bind) => bind.node))) {
      const own = meshes.get(node) ?? [];
      const base = [...(own[0]?.morphTargetInfluences ?? [])];
      const fit = binds.filter((bind) => bind.node === node && bind.target >= 0 && bind.target < base.length && isFinite(bind.share));
      if (fit.length) this.faces.push({ node, meshes: own, base, binds: fit });
    }
    if (!this.faces.length) this.alphabet = "";
  }

  /** The best alphabet that the character knows, and its shapes. */
  private choose(document: FaceDocument, eyesAreBones: boolean): [FaceRig["alphabet"], Bind[]] {
    const { tables } = this;
    const targets = nameTargets(document);
    const expressions = [...listExpressions(document, tables)];
    let arkit = targets.flatMap(([name, bind]) => rename(bind, findArkit(name, tables)));
    if (countDrivers(arkit) < tables.enough) {
      const clips = expressions.flatMap((bind) => rename({ ...bind, binary: false }, lookUp(tables.arkit, bind.driver.toLowerCase())));
      if (countDrivers(clips) > countDrivers(arkit)) arkit = clips;
    }
    if (countDrivers(arkit) >= tables.enough) return ["ARKit", arkit];
    const drivers = presetsOf(Object.fromEntries(this.weights.map((name) => [name, 0])), tables);
    const presets = expressions.filter(({ driver }) => Object.hasOwn(drivers, driver) && !(eyesAreBones && driver.startsWith("look")));
    if (presets.length) return ["VRM", presets];
    const oculus = targets.flatMap(([name, bind]) => rename(bind, findViseme(name, tables)));
    if (oculus.length) return ["Oculus", [...oculus, ...arkit.filter(({ driver }) => /^(eye|brow)/.test(driver))]];
    return ["ARKit", arkit];
  }

  /** What drives the shapes, for ARKit's weights of a pose. */
  driversOf(face: ArrayLike<number>): Drivers {
    const arkit = Object.fromEntries(this.weights.map((name, k) => [name, face[k]]));
    if (this.alphabet === "VRM") return presetsOf(arkit, this.tables);
    if (this.alphabet !== "Oculus") return arkit;
    const visemes = Object.entries(visemesOf(arkit, this.tables));
    return { ...arkit, ...Object.fromEntries(visemes.map(([name, weight]) => [`viseme_${name}`, weight])) };
  }

  /** Show a face. */
  apply(drivers: Drivers): void {
    for (const { meshes, base, binds } of this.faces) {
      const weights = [...base];
      for (const { driver, target, share, binary } of binds) {
        weights[target] += share * (binary ? Number(drivers[driver] > 0.5) : drivers[driver]);
      }
      for (const { morphTargetInfluences: shown } of meshes) {
        if (shown) weights.forEach((weight, k) => (shown[k] = Math.min(Math.max(weight, 0), 1)));
      }
    }
  }

  /** Whether the shapes of looking turn the eyeballs themselves; the eye bones then rest, as both would turn them twice. */
  turnsEyes(eyes: (Object3D | null | undefined)[]): boolean {
    return this.faces.some(({ meshes, binds }) => {
      const looks = binds.filter(({ driver }) => /^(eyeLook|look)/.test(driver)).map(({ target }) => target);
      return meshes.some((mesh) => mesh instanceof SkinnedMesh && this.movesHeld(mesh, eyes, looks));
    });
  }

  private movesHeld(mesh: SkinnedMesh, eyes: (Object3D | null | undefined)[], targets: number[]): boolean {
    const { geometry, skeleton } = mesh;
    const { position, skinIndex, skinWeight } = geometry.attributes;
    const own = new Set(skeleton.bones.flatMap((bone, k) => (eyes.includes(bone) ? [k] : [])));
    const parts = [0, 1, 2, 3];
    const shares = (vertex: number): number => parts.reduce((total, part) =>
      total + (own.has(skinIndex.getComponent(vertex, part)) ? skinWeight.getComponent(vertex, part) : 0), 0);
    const eyeball = own.size ? Array.from({ length: position.count }, (_, vertex) => vertex).filter((vertex) => shares(vertex) > this.tables.held) : [];
    const deltas = targets.map((target) => geometry.morphAttributes.position?.[target]);
    return deltas.some((delta: Attribute | undefined) => delta !== undefined && delta !== position && eyeball.some((vertex) =>
      [0, 1, 2].some((axis) => Math.abs(delta.getComponent(vertex, axis)) > this.tables.moved)));
  }

  /** How far the mouth is open, as its shapes stand: 0 to 1. */
  opening(): number {
    const openings = this.faces.flatMap(({ meshes, binds }) =>
      binds.filter(({ driver }) => OPENERS.includes(driver)).map(({ target }) => meshes[0].morphTargetInfluences?.[target] ?? 0));
    return Math.max(0, ...openings);
  }

  /** Node of the file → the weights of its shapes, as they stand. */
  listWeights(): Record<number, number[]> {
    return Object.fromEntries(this.faces.map(({ node, meshes }) => [node, [...(meshes[0].morphTargetInfluences ?? [])]]));
  }
}

/** Node of the file → its meshes with shapes: one for each surface. */
function listMeshes({ scene, parser }: GLTF): Map<number, Mesh[]> {
  const byNode = new Map<number, Mesh[]>();
  const nodeOf = (object: Object3D): number | undefined => parser.associations.get(object)?.nodes;
  scene.traverse((object) => {
    const node = nodeOf(object);
    if (node === undefined) return;
    const parts = [object, ...object.children.filter((child) => nodeOf(child) === undefined)];
    const meshes = parts.filter((part): part is Mesh => part instanceof Mesh && part.morphTargetInfluences !== undefined);
    if (meshes.length) byNode.set(node, meshes);
  });
  return byNode;
}

/** Every shape of every node with its name. */
function nameTargets({ nodes = [], meshes = [] }: FaceDocument): [string, Omit<Bind, "driver">][] {
  return nodes.flatMap(({ mesh }, node) => {
    if (mesh === undefined) return [];
    const { primitives, extras } = meshes[mesh];
    const count = primitives[0].targets?.length ?? 0;
    const lists = [extras?.targetNames, primitives[0].extras?.targetNames];
    const names = lists.find((list): list is unknown[] => Array.isArray(list) && list.length === count) ?? [];
    return names.map((name, target): [string, Omit<Bind, "driver">] => [String(name), { node, target, share: 1, binary: false }]);
  });
}

/** VRM's expressions, under the names of VRM 1.0. */
function* listExpressions({ nodes = [], extensions = {} }: FaceDocument, tables: FaceTables): Generator<Bind> {
  const { preset = {}, custom = {} } = extensions.VRMC_vrm?.expressions ?? {};
  for (const [driver, { isBinary, morphTargetBinds = [] }] of [...Object.entries(preset), ...Object.entries(custom)]) {
    for (const { node, index, weight = 1 } of morphTargetBinds) {
      if (nodes[node].mesh !== undefined) yield { driver, node, target: index, share: weight, binary: Boolean(isBinary) };
    }
  }
  for (const { name = "", presetName = "", isBinary, binds = [] } of extensions.VRM?.blendShapeMaster?.blendShapeGroups ?? []) {
    const driver = lookUp(tables.vrm0, presetName.toLowerCase()) || lookUp(tables.vrm0, name.toLowerCase()) || name;
    for (const { mesh, index, weight = PER_CENT } of binds) {
      for (const [node, entry] of nodes.entries()) {
        if (entry.mesh === mesh) yield { driver, node, target: index, share: weight / PER_CENT, binary: Boolean(isBinary) };
      }
    }
  }
}

const lookUp = (table: Record<string, string>, key: string): string => (Object.hasOwn(table, key) ? table[key] : "");
const countDrivers = (binds: Bind[]): number => new Set(binds.map(({ driver }) => driver)).size;
const rename = (bind: Omit<Bind, "driver">, driver: string): Bind[] => (driver ? [{ ...bind, driver }] : []);

/** "Face.M_eyeBlink_L" → "eyeBlinkLeft": without what stands before ARKit's name, and without signs. */
function findArkit(name: string, { arkit, longest }: FaceTables): string {
  const pieces = name.slice(-longest).split(/[.:|_\s-]+/).filter(Boolean);
  const names = pieces.map((_, first) => lookUp(arkit, pieces.slice(first).join("").toLowerCase()));
  return names.find(Boolean) ?? "";
}

function findViseme(name: string, { oculus, longest }: FaceTables): string {
  const match = /viseme[._\s-]*([a-z]+)$/i.exec(name.slice(-longest));
  const viseme = match ? lookUp(oculus, match[1].toLowerCase()) : "";
  return viseme && `viseme_${viseme}`;
}
