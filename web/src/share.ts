// The viewer of a share file: character, motion and sound are in the file itself, as text of the elements #character and #sound.

import { AnimationMixer, LoopOnce, type Mesh, type Object3D } from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { fillSelect, find, formatTime, sayTime } from "./dom";
import { prepareMeshes } from "./figure";
import { Player, SPEEDS } from "./player";
import { Stage } from "./stage";
import "./share.css";

/** The bytes of an element's text: base64, packed by deflate where the element says so. */
async function readBytes(id: string): Promise<ArrayBuffer> {
  const element = find(id);
  const bytes = Uint8Array.from(atob(element.textContent ?? ""), (letter) => letter.charCodeAt(0));
  if (element.dataset.packed === undefined) return bytes.buffer;
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"))).arrayBuffer();
}

/** A silent sound of some seconds, so that motion without speech has a clock too: 8-bit samples, 8,000 a second. */
function makeSilence(seconds: number): Blob {
  const count = Math.max(Math.ceil(seconds * 8000), 1);
  const head = new DataView(new ArrayBuffer(44));
  const write = (at: number, text: string): void => [...text].forEach((letter, k) => head.setUint8(at + k, letter.charCodeAt(0)));
  write(0, "RIFF");
  write(8, "WAVEfmt ");
  write(36, "data");
  for (const [at, value] of [[4, 36 + count], [16, 16], [24, 8000], [28, 8000], [40, count]]) head.setUint32(at, value, true);
  for (const [at, value] of [[20, 1], [22, 1], [32, 1], [34, 8]]) head.setUint16(at, value, true);
  return new Blob([head, new Uint8Array(count).fill(128)], { type: "audio/wav" });
}

async function openShare(): Promise<void> {
  const player = new Player();
  const file = await new GLTFLoader().parseAsync(await readBytes("character"), "");
  const { scene } = file;
  const extensions = (file.parser.json as { extensions?: Record<string, unknown> }).extensions ?? {};
  if ("VRM" in extensions) scene.rotation.y = Math.PI; // VRM 0 faces −Z
  prepareMeshes(scene);
  const mixer = new AnimationMixer(scene);
  const clip = file.animations[0];
  const action = mixer.clipAction(clip).setLoop(LoopOnce, 1);
  action.clampWhenFinished = true;
  action.play();
  const fps = Number(find("character").dataset.fps);
  const sound = document.getElementById("sound");
  const blob = sound ? new Blob([await readBytes("sound")], { type: sound.dataset.kind ?? "" }) : makeSilence(clip.duration + 1 / fps);
  const metadata = new Promise((resolve) => player.sound.addEventListener("loadedmetadata", resolve, { once: true }));
  player.open(URL.createObjectURL(blob));
  await metadata;

  let lastTime = -1;
  const scrub = find<HTMLInputElement>("scrub");
  const clock = find("clock");
  const stage = new Stage(find<HTMLCanvasElement>("view"), () => {
    player.follow();
    const { time } = player;
    if (time === lastTime) return false;
    lastTime = time;
    mixer.setTime(Math.min(time, clip.duration));
    scrub.valueAsNumber = time;
    const text = `${formatTime(time)} / ${formatTime(player.seconds)}`;
    if (text !== clock.textContent) clock.textContent = text;
    scrub.setAttribute("aria-valuetext", sayTime(time, player.seconds));
    return true;
  });
  mixer.setTime(0);
  stage.setPeople([scene]);
  stage.frame();
  bind(player, stage, scrub);
  publish(player, scene, fps);
  document.documentElement.dataset.ready = "true";
}

function bind(player: Player, stage: Stage, scrub: HTMLInputElement): void {
  const play = find("play");
  const speed = find<HTMLSelectElement>("speed");
  const loop = find("loop");
  const toggle = (): void => void player.toggle().catch((error: unknown) => tell(String(error)));
  fillSelect(speed, SPEEDS.map((each) => [String(each), `${each}×`]), "1");
  speed.addEventListener("change", () => (player.speed = Number(speed.value)));
  play.addEventListener("click", toggle);
  scrub.addEventListener("input", () => player.seek(scrub.valueAsNumber));
  find("frame").addEventListener("click", () => stage.frame());
  loop.addEventListener("click", () => {
    player.loop = !player.loop;
    loop.setAttribute("aria-pressed", String(player.loop));
  });
  scrub.max = String(player.seconds);
  player.onChange(() => (play.textContent = player.playing ? "Pause" : "Play"));
  window.addEventListener("keydown", (event) => {
    const target = event.target as HTMLElement;
    if (event.key !== " " || target.matches("button, select")) return;
    event.preventDefault();
    toggle();
  });
}

/** What tests read. */
function publish(player: Player, scene: Object3D, fps: number): void {
  const jawOpen = (): number => {
    let open = 0;
    scene.traverse((node) => {
      const { morphTargetDictionary: names, morphTargetInfluences: influences } = node as Mesh;
      if (names && influences && "jawOpen" in names) open = influences[names.jawOpen];
    });
    return open;
  };
  const readOuts = {
    get time() { return player.time; },
    get seconds() { return player.seconds; },
    get playing() { return player.playing; },
    get frame() { return Math.floor(player.time * fps + 1e-6); },
    jawOpen,
  };
  Object.assign(window, { cospeechStudio: readOuts });
}

function tell(problem: string): void {
  find("problem").textContent = problem;
}

openShare().catch((error: unknown) => tell(`this file cannot be shown: ${error instanceof Error ? error.message : String(error)}`));
