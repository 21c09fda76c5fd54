// The live tab: the microphone goes to the server, frames come back, the character moves, receivers are told of.

import { socketOf } from "./api";
import { fillSelect, find, make, modelRows, readName } from "./dom";
import type { LiveStatus, StartLive } from "./messages";
import { closeMicrophone, openMicrophone } from "./microphone";
import { makePose, type Pose } from "./motion";
import type { Store } from "./state";
import { emotionRows } from "./panels/settings";

const RATE = 30; // frames per second that are asked for [ours: the display mixes none of them, and 30 look smooth]

export class Live {
  private socket: WebSocket | null = null;
  private context: AudioContext | null = null;
  private microphone: MediaStream | null = null;
  readonly pose: Pose;
  private attempts = 0;
  running = false;
  fresh = false;
  frames = 0;

  constructor(private readonly store: Store) {
    const { catalogue } = store.state;
    this.pose = makePose(catalogue.joints.length, catalogue.weights.length);
    fillSelect(find("live-model"), modelRows(catalogue.models), catalogue.default_model);
    fillSelect(find("live-emotion"), emotionRows(catalogue.emotions), "auto");
    const model = find<HTMLSelectElement>("live-model");
    model.addEventListener("change", () => this.fillStyles());
    this.fillStyles();
    find("live-start").addEventListener("click", () => void (this.running ? this.stop() : this.start()));
    find("live-interrupt").addEventListener("click", () => this.send({ type: "interrupt" }));
    find("live-style").addEventListener("change", () => this.change({ style: valueOf("live-style") || null }));
    find("live-emotion").addEventListener("change", () => this.change({ emotion: valueOf("live-emotion") }));
    const intensity = find<HTMLInputElement>("live-intensity");
    const output = find<HTMLOutputElement>("live-intensity-value");
    output.value = intensity.valueAsNumber.toFixed(2);
    intensity.addEventListener("input", () => (output.value = intensity.valueAsNumber.toFixed(2)));
    intensity.addEventListener("change", () => this.change({ intensity: intensity.valueAsNumber }));
  }

  private fillStyles(): void {
    const model = this.store.state.catalogue.models.find((row) => row.name === valueOf("live-model"));
    const styles = (model?.styles ?? []).map((name): [string, string] => [name, readName(name)]);
    fillSelect(find("live-style"), [["", "the model's own"], ...styles], "");
  }

  private send(message: object): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }

  private change(values: object): void {
    if (this.running) this.send({ type: "change", ...values });
  }

  private async start(): Promise<void> {
    this.tell("");
    const attempt = ++this.attempts;
    try {
      const microphone = await openMicrophone({ channelCount: 1, autoGainControl: true });
      if (attempt !== this.attempts) return closeMicrophone(microphone); // stopped, or started again, while the browser asked
      this.microphone = microphone;
      this.context = new AudioContext();
      await this.context.audioWorklet.addModule("./capture.js");
    } catch (error) {
      if (attempt !== this.attempts) return;
      this.tell(error instanceof Error ? error.message : String(error));
      return this.stop();
    }
    if (attempt !== this.attempts) return;
    const socket = socketOf("/api/live");
    socket.binaryType = "arraybuffer";
    socket.onopen = () => this.begin(socket);
    socket.onmessage = (message) => this.hear(message.data as string | ArrayBuffer);
    socket.onclose = () => {
      if (this.socket === socket && this.running) this.tell("the connection to the studio is lost (start again)");
      if (this.socket === socket) this.stop();
    };
    this.socket = socket;
    this.setRunning(true);
  }

  private begin(socket: WebSocket): void {
    const { context, microphone } = this;
    if (context === null || microphone === null) return;
    const start: StartLive = {
      type: "start", model: valueOf("live-model"), style: valueOf("live-style") || null, emotion: valueOf("live-emotion"),
      intensity: find<HTMLInputElement>("live-intensity").valueAsNumber, fps: RATE, rate: Math.round(context.sampleRate),
      targets: valueOf("targets").split("\n").map((line) => line.trim()).filter(Boolean),
    };
    socket.send(JSON.stringify(start));
    const capture = new AudioWorkletNode(context, "capture", { numberOfOutputs: 0, channelCount: 1, channelCountMode: "explicit" });
    capture.port.onmessage = (message) => {
      if (socket.readyState === WebSocket.OPEN) socket.send(message.data as ArrayBuffer);
    };
    context.createMediaStreamSource(microphone).connect(capture);
  }

  private hear(data: string | ArrayBuffer): void {
    if (typeof data === "string") return this.showStatus(JSON.parse(data) as LiveStatus);
    const numbers = new Float32Array(data.slice(8));
    const { root, rotations, face } = this.pose;
    root.set(numbers.subarray(0, 3));
    rotations.set(numbers.subarray(3, 3 + rotations.length));
    face.set(numbers.subarray(3 + rotations.length, 3 + rotations.length + face.length));
    this.fresh = true;
    this.frames++;
  }

  private showStatus(status: LiveStatus): void {
    find("live-facts").hidden = false;
    find("live-latency").textContent = `${Math.round(status.latency * 1000)} ms after the sound`;
    find("live-late").textContent = String(status.late);
    find("live-targets").replaceChildren(...status.targets.map((target) =>
      make("li", {}, [`${target.url}: ${target.problem || `${target.sent} frames sent`}`, target.note].filter(Boolean).join("; "))));
    if (status.problem) this.tell(status.hint ? `${status.problem} (${status.hint})` : status.problem);
    if (!status.running && status.problem) this.stop();
  }

  private tell(problem: string): void {
    find("live-problem").hidden = !problem;
    find("live-problem").textContent = problem;
  }

  stop(): void {
    this.send({ type: "stop" });
    const { socket } = this;
    this.socket = null;
    socket?.close();
    this.attempts++;
    if (this.microphone !== null) closeMicrophone(this.microphone);
    void this.context?.close();
    this.microphone = this.context = null;
    this.setRunning(false);
  }

  private setRunning(running: boolean): void {
    this.running = running;
    find("live-start").textContent = running ? "Stop" : "Start";
    find<HTMLButtonElement>("live-interrupt").disabled = !running;
    for (const id of ["live-model", "targets"]) find<HTMLSelectElement>(id).disabled = running;
  }
}

function valueOf(id: string): string {
  return find<HTMLSelectElement | HTMLTextAreaElement>(id).value;
}
