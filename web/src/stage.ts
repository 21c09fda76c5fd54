// The stage: light, ground, shadow, camera. It draws only when something has changed.

import {
  AmbientLight, Box3, Color, DirectionalLight, HemisphereLight, Mesh, PCFShadowMap, PerspectiveCamera, PlaneGeometry,
  Scene, ShadowMaterial, Vector3, WebGLRenderer, type Object3D,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

const FIELD = 26; // degrees of the camera's view, up and down [ours: long enough a lens that hands in front do not look large]
const APART = 1.25; // metres between characters side by side [ours: a little more than two arms' reach inwards]
const ROOM = 1.12; // the view is so much larger than the character [ours]
const REACH = 0.62; // metres from the middle of a character to its hands in a usual gesture [ours]
const LEGLESS = 0.2; // of its height above the ground a character has no legs, and does not hover [ours]
const ARMLESS = 0.7; // of its height above the ground it is a head [ours]
const STEP = 1.15; // share of the distance to the camera that a key comes nearer or goes away [ours]
const TURN = Math.PI / 12; // radians that a key turns the camera [ours]
const TALL = 1.78; // metres that the camera frames where there is no character yet [ours: our mannequin]

export class Stage {
  readonly scene = new Scene();
  readonly camera = new PerspectiveCamera(FIELD, 1, 0.05, 100);
  private readonly renderer: WebGLRenderer;
  private readonly controls: OrbitControls;
  private readonly sun = new DirectionalLight(0xfff4e6, 2.1);
  private people: Object3D[] = [];
  private stale = true;
  private isFramed = false;
  /** Frames that were drawn; tests read it. */
  drawn = 0;

  /** Draw into `canvas`; `beforeDraw` is called for every frame of the display and says whether anything moved. */
  constructor(private readonly canvas: HTMLCanvasElement, beforeDraw: () => boolean) {
    this.renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true, powerPreference: "low-power" });
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFShadowMap;
    this.light();
    this.controls = new OrbitControls(this.camera, canvas);
    this.canvas.style.touchAction = "pan-y"; // one finger up or down scrolls the page; two move the camera
    this.canvas.addEventListener("keydown", (event) => this.press(event));
    this.controls.enableDamping = false;
    this.controls.maxPolarAngle = Math.PI * 0.52;
    this.controls.zoomToCursor = true; // scrolling comes nearer to what the pointer is on, a face say
    this.controls.minDistance = 0.4;
    this.controls.maxDistance = 25;
    this.controls.addEventListener("change", () => (this.stale = true));
    this.controls.addEventListener("start", () => (this.isFramed = false));
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
    this.frame();
    this.renderer.setAnimationLoop(() => {
      if (beforeDraw() || this.stale) {
        this.stale = false;
        this.drawn++;
        this.renderer.render(this.scene, this.camera);
      }
    });
  }

  /** Keys of the camera: + and − come nearer and go away, [ and ] turn. */
  private press(event: KeyboardEvent): void {
    const nearer = { "+": 1, "=": 1, "-": -1 }[event.key];
    const turn = { "[": -1, "]": 1 }[event.key];
    if (event.metaKey || (nearer !== undefined && (event.ctrlKey || event.altKey)) || (nearer === undefined && turn === undefined)) return;
    event.preventDefault();
    const { target } = this.controls;
    const away = this.camera.position.clone().sub(target);
    if (nearer !== undefined) away.setLength(Math.min(Math.max(away.length() * STEP ** -nearer, this.controls.minDistance), this.controls.maxDistance));
    if (turn !== undefined) away.applyAxisAngle(this.camera.up, turn * TURN);
    this.camera.position.copy(target).add(away);
    this.isFramed = false;
    this.controls.update();
    this.stale = true;
  }

  private light(): void {
    const sky = new HemisphereLight(0xf3f6ff, 0xb9aea2, 1.25);
    const rim = new DirectionalLight(0xdfe9ff, 0.9);
    rim.position.set(-2.5, 2.6, -3);
    this.sun.position.set(1.8, 3.6, 3.2);
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.set(1024, 1024);
    this.sun.shadow.radius = 6;
    this.sun.shadow.bias = -0.0004;
    this.sun.shadow.normalBias = 0.02;
    const ground = new Mesh(new PlaneGeometry(60, 60), new ShadowMaterial({ color: new Color(0x0b1a22), opacity: 0.24 }));
    ground.rotation.x = -Math.PI / 2;
    ground.receiveShadow = true;
    this.scene.add(sky, new AmbientLight(0xffffff, 0.25), this.sun, this.sun.target, rim, ground);
  }

  /** Show characters side by side, and frame them. */
  setPeople(people: Object3D[]): void {
    const same = people.length === this.people.length;
    for (const old of this.people) this.scene.remove(old);
    this.people = people;
    people.forEach((person, k) => {
      person.position.x = (k - (people.length - 1) / 2) * APART;
      this.scene.add(person);
    });
    const half = (Math.max(people.length, 1) * APART) / 2 + 0.6;
    const shadow = this.sun.shadow.camera;
    Object.assign(shadow, { left: -half, right: half, top: 2.6, bottom: -1.6, near: 0.5, far: 12 });
    shadow.updateProjectionMatrix();
    if (!same || this.isFramed) this.frame();
    this.stale = true;
  }

  /** The camera in front of all characters, from head to feet, or to where a half body ends. */
  frame(): void {
    const boxes = this.people.map((person) => new Box3().setFromObject(person));
    const tall = Math.max(...boxes.map((box) => box.max.y), 0) || TALL;
    const lowest = Math.min(...boxes.map((box) => box.min.y), tall);
    const low = lowest > LEGLESS * tall ? lowest : 0;
    const within = (metres: number): number => Math.min(Math.max(metres, 0.3), 6);
    const height = within(tall - low) * ROOM;
    const arms = low > ARMLESS * tall ? height : (2 * REACH * within(tall)) / TALL;
    const width = (Math.max(this.people.length, 1) - 1) * APART + arms;
    const tangent = Math.tan((FIELD * Math.PI) / 360);
    const away = Math.max(height / 2 / tangent, width / 2 / tangent / this.camera.aspect) + 0.35;
    this.controls.target.set(0, low + height / 2 - 0.03 * height, 0);
    this.camera.position.copy(this.controls.target).add(new Vector3(away * 0.1, away * 0.045, away));
    this.controls.update();
    this.isFramed = true;
    this.stale = true;
  }

  /** Something changed that `beforeDraw` does not know of. */
  redraw(): void {
    this.stale = true;
  }

  private resize(): void {
    const { clientWidth, clientHeight } = this.canvas;
    if (!clientWidth || !clientHeight) return;
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.camera.aspect = clientWidth / clientHeight;
    this.camera.updateProjectionMatrix();
    if (this.isFramed) this.frame();
    this.stale = true;
  }
}
