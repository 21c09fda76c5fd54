// Loads an animated GLB with three.js: node check_glb.mjs FILE TIME... prints, as JSON, world positions of all nodes, and
// the morph weights and moved vertices of every mesh, at each time.
import { readFile } from "node:fs/promises";
import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";

globalThis.self = globalThis; // the loader asks for it
const [path, ...times] = process.argv.slice(2);
const bytes = await readFile(path);
const gltf = await new GLTFLoader().parseAsync(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength), "");
const clip = gltf.animations.at(-1);
const mixer = new THREE.AnimationMixer(gltf.scene);
mixer.clipAction(clip).setLoop(THREE.LoopOnce).play().clampWhenFinished = true;

const samples = times.map(Number).map((time) => {
  mixer.setTime(time);
  gltf.scene.updateMatrixWorld(true);
  const positions = {};
  const meshes = {};
  gltf.scene.traverse((node) => {
    positions[node.name] = node.getWorldPosition(new THREE.Vector3()).toArray();
    if (!node.isMesh) return;
    const box = new THREE.Box3();
    const vertex = new THREE.Vector3();
    for (let k = 0; k < node.geometry.attributes.position.count; k += 1) {
      box.expandByPoint(node.getVertexPosition(k, vertex).applyMatrix4(node.matrixWorld));
    }
    meshes[node.name] = {
      weights: [...(node.morphTargetInfluences ?? [])],
      names: Object.keys(node.morphTargetDictionary ?? {}),
      min: box.min.toArray(),
      max: box.max.toArray(),
    };
  });
  return { time, positions, meshes };
});
console.log(JSON.stringify({ duration: clip.duration, clips: gltf.animations.map((a) => a.name), samples }));
