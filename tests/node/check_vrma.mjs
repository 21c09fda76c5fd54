// Plays a VRMA with @pixiv/three-vrm-animation on a humanoid built here, without a browser.
// node check_vrma.mjs CLIP.vrma HUMANOID.json TIME... prints, as JSON, world positions of the bones and expression weights
// at each time. HUMANOID.json: {"bones": [{"name", "parent" | null, "offset": [x, y, z]}, ...]}.
import { readFile } from "node:fs/promises";
import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { VRMExpression, VRMExpressionManager, VRMHumanoid, VRMLookAt, VRMLookAtBoneApplier, VRMLookAtRangeMap } from "@pixiv/three-vrm";
import { VRMAnimationLoaderPlugin, VRMLookAtQuaternionProxy, createVRMAnimationClip } from "@pixiv/three-vrm-animation";

globalThis.self = globalThis; // the loader asks for it
const [clipPath, humanoidPath, ...times] = process.argv.slice(2);

const loader = new GLTFLoader();
loader.register((parser) => new VRMAnimationLoaderPlugin(parser));
const bytes = await readFile(clipPath);
const gltf = await loader.parseAsync(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength), "");
const [animation] = gltf.userData.vrmAnimations;

const { bones } = JSON.parse(await readFile(humanoidPath, "utf8"));
const scene = new THREE.Group();
const humanBones = {};
for (const { name, parent, offset } of bones) {
  const node = new THREE.Object3D();
  node.name = name;
  node.position.fromArray(offset);
  (parent ? humanBones[parent].node : scene).add(node);
  humanBones[name] = { node };
}
scene.updateMatrixWorld(true);
const humanoid = new VRMHumanoid(humanBones);
scene.add(humanoid.normalizedHumanBonesRoot);
const expressionManager = new VRMExpressionManager();
for (const name of [...animation.expressionTracks.preset.keys(), ...animation.expressionTracks.custom.keys()]) {
  const expression = new VRMExpression(name);
  scene.add(expression);
  expressionManager.registerExpression(expression);
}
const range = () => new VRMLookAtRangeMap(90, 90);
const lookAt = new VRMLookAt(humanoid, new VRMLookAtBoneApplier(humanoid, range(), range(), range(), range()));
const proxy = new VRMLookAtQuaternionProxy(lookAt);
proxy.name = "lookAt";
scene.add(proxy);

const clip = createVRMAnimationClip(animation, { scene, humanoid, expressionManager, lookAt, meta: { metaVersion: "1" } });
const mixer = new THREE.AnimationMixer(scene);
mixer.clipAction(clip).setLoop(THREE.LoopOnce).play().clampWhenFinished = true;

const samples = times.map(Number).map((time) => {
  mixer.setTime(time);
  humanoid.update();
  lookAt.update(0);
  scene.updateMatrixWorld(true);
  const positions = {};
  for (const { name } of bones) {
    positions[name] = humanBones[name].node.getWorldPosition(new THREE.Vector3()).toArray();
  }
  const expressions = Object.fromEntries(expressionManager.expressions.map((e) => [e.expressionName, e.weight]));
  return { time, positions, expressions, lookAt: { yaw: lookAt.yaw, pitch: lookAt.pitch } };
});
console.log(JSON.stringify({ duration: clip.duration, tracks: clip.tracks.length, samples }));
