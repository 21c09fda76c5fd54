// Playing: the button, the clock, the slider, the loop, the speed.

import { fillSelect, find, formatTime, sayTime } from "./dom";
import { SPEEDS, type Player } from "./player";
import type { Store } from "./state";

export class Transport {
  private readonly scrub = find<HTMLInputElement>("scrub");
  private readonly button = find<HTMLButtonElement>("play");
  private readonly clock = find("clock");
  private text = "";

  constructor(private readonly store: Store, private readonly player: Player) {
    const speed = find<HTMLSelectElement>("speed");
    fillSelect(speed, SPEEDS.map((each) => [String(each), `${each}×`]), "1");
    speed.addEventListener("change", () => (player.speed = Number(speed.value)));
    this.button.addEventListener("click", () => this.toggle());
    this.scrub.addEventListener("input", () => player.seek(this.scrub.valueAsNumber));
    const loop = find("loop");
    loop.addEventListener("click", () => {
      player.loop = !player.loop;
      loop.setAttribute("aria-pressed", String(player.loop));
    });
    player.onChange(() => this.draw());
    store.onChange(({ selection }) => {
      player.loopStretch = selection;
      this.draw();
    });
  }

  toggle(): void {
    if (this.store.state.speech === null) return;
    this.player.toggle().catch((error: unknown) => {
      const reason = error instanceof Error ? error.message : String(error);
      this.store.update({ problem: `the sound cannot be played: ${reason}` });
    });
  }

  private draw(): void {
    const { player } = this;
    const ready = this.store.state.speech !== null;
    this.button.disabled = this.scrub.disabled = !ready;
    this.button.classList.toggle("playing", player.playing);
    this.button.setAttribute("aria-label", player.playing ? "Pause" : "Play");
    this.scrub.max = String(player.seconds || this.store.state.speech?.seconds || 1);
    this.follow(player.time);
  }

  /** Show a time; called for every frame. */
  follow(time: number): void {
    const text = `${formatTime(time)} / ${formatTime(this.player.seconds || this.store.state.speech?.seconds || 0)}`;
    if (text !== this.text) {
      this.text = text;
      this.clock.textContent = text;
    }
    this.scrub.setAttribute("aria-valuetext", sayTime(time, this.player.seconds));
    this.scrub.valueAsNumber = time;
  }
}
