// Which bone of somebody's GLB character is which joint of ours, by the bones' names.

import { BONE_TABLES } from "./bone_tables";

const FINGERS = ["Thumb", "Index", "Middle", "Ring", "Little"];
const LINKS: Record<string, string[]> = { Thumb: ["Metacarpal", "Proximal", "Distal"] };
const USUAL_LINKS = ["Proximal", "Intermediate", "Distal"];

/** Joint → the names that programs give it, without prefix, blanks and case; L is the side. */
const NAMES: Record<string, string[]> = {
  hips: ["hips", "pelvis", "hip"],
  spine: ["spine", "spine01", "spinelower", "torso"],
  chest: ["spine1", "chest", "spine02", "spinemid", "spine2nd"],
  upperChest: ["spine2", "upperchest", "spine03", "spineupper"],
  neck: ["neck", "neck01", "neck1"],
  head: ["head"],
  LShoulder: ["Lshoulder", "Lclavicle", "claviclel", "shoulderl", "Lcollar"],
  LUpperArm: ["Larm", "Lupperarm", "upperarml", "Luparm"],
  LLowerArm: ["Lforearm", "Llowerarm", "lowerarml", "forearml"],
  LHand: ["Lhand", "handl", "Lwrist", "wristl"],
  LUpperLeg: ["Lupleg", "Lupperleg", "Lthigh", "upperlegl", "thighl"],
  LLowerLeg: ["Lleg", "Llowerleg", "Lcalf", "Lshin", "lowerlegl", "calfl", "shinl"],
  LFoot: ["Lfoot", "footl", "Lankle"],
  LToes: ["Ltoebase", "Ltoes", "Ltoe", "toesl", "balll"],
  LEye: ["Leye", "eyel"],
};

const plain = (name: string): string =>
  name.replace(/^.*[:|]/, "").replace(/^mixamorig\d*/i, "").replace(/[\s._-]/g, "").toLowerCase();

/** Joint of ours → the plain names of it. */
function candidatesOf(joint: string): string[] {
  const side = joint.startsWith("left") ? "left" : joint.startsWith("right") ? "right" : "";
  const stem = side ? joint.slice(side.length) : joint;
  const finger = FINGERS.find((name) => stem.startsWith(name));
  if (finger) {
    const number = (LINKS[finger] ?? USUAL_LINKS).indexOf(stem.slice(finger.length)) + 1;
    const other = finger === "Little" ? "pinky" : finger.toLowerCase();
    const short = side[0];
    return [
      joint.toLowerCase(), `${side}hand${other}${number}`, `${other}0${number}${short}`, `${other}${number}${short}`,
      `${side}${other}${number}`, `${finger.toLowerCase()}0${number}${short}`,
    ];
  }
  const short = side ? side[0] : "";
  const synonyms = (NAMES[side ? `L${stem}` : joint] ?? []).flatMap((name) => {
    if (!side) return [name];
    return name.startsWith("L") ? [side + name.slice(1), short + name.slice(1), name.slice(1) + side] : [name.slice(0, -1) + short];
  });
  return [joint.toLowerCase(), ...synonyms];
}

/** Find bones: joint of ours → index into `names`; joints that the character lacks are left out. */
export function findBones(joints: string[], names: string[]): Map<string, number> {
  const indices = new Map<string, number>();
  names.forEach((name, k) => {
    if (!indices.has(plain(name))) indices.set(plain(name), k);
  });
  const bones = new Map<string, number>();
  const table = BONE_TABLES.find((one) => Object.values(one).every((name) => names.includes(name)));
  if (table) {  // as Python does: a skeleton that is known as a whole needs no guess
    for (const joint of joints) if (table[joint]) bones.set(joint, names.indexOf(table[joint]));
    return bones;
  }
  const previous = new Set<number>();
  for (const joint of joints) {
    const index = candidatesOf(joint).map((name) => indices.get(name)).find((k) => k !== undefined && !previous.has(k));
    if (index === undefined) continue;
    bones.set(joint, index);
    previous.add(index);
  }
  return bones;
}
