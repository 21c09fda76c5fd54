// The clock of the page: the sound's own. Where there is no sound yet, time stands.

export const SPEEDS = [0.25, 0.5, 0.75, 1, 1.25, 1.5, 2];

export class Player {
  readonly sound = new Audio();
  private listeners: (() => void)[] = [];
  /** A stretch in seconds that is played again and again; null for the whole. */
  loopStretch: [number, number] | null = null;
  loop = false;

  constructor() {
    this.sound.preload = "auto";
    this.sound.preservesPitch = true;
    for (const event of ["play", "pause", "ended", "ratechange", "seeked", "durationchange", "error"]) {
      this.sound.addEventListener(event, () => this.tell());
    }
    this.sound.addEventListener("ended", () => {
      if (this.loop) this.restart();
    });
  }

  onChange(listener: () => void): void {
    this.listeners.push(listener);
  }

  private tell(): void {
    for (const listener of this.listeners) listener();
  }

  open(url: string): void {
    this.sound.src = url;
    this.sound.load();
  }

  get time(): number {
    return this.sound.currentTime;
  }

  get seconds(): number {
    return Number.isFinite(this.sound.duration) ? this.sound.duration : 0;
  }

  get playing(): boolean {
    return !this.sound.paused && !this.sound.ended;
  }

  set speed(value: number) {
    this.sound.playbackRate = value;
    this.sound.defaultPlaybackRate = value;
  }

  get speed(): number {
    return this.sound.playbackRate;
  }

  async toggle(): Promise<void> {
    if (this.playing) this.sound.pause();
    else await this.sound.play();
  }

  pause(): void {
    this.sound.pause();
  }

  seek(time: number): void {
    this.sound.currentTime = Math.min(Math.max(time, 0), Math.max(this.seconds - 0.001, 0));
    this.tell();
  }

  /** Keep to the stretch that is looped; called for every frame. */
  follow(): void {
    if (!this.loop || this.loopStretch === null || !this.playing) return;
    const [from, to] = this.loopStretch;
    if (this.time >= to || this.time < from - 0.05) this.sound.currentTime = from;
  }

  private restart(): void {
    this.sound.currentTime = this.loopStretch?.[0] ?? 0;
    void this.sound.play();
  }
}
