// One stop of Tab for many options: keys go from one to another (a roving tabindex, as in the WAI-ARIA Authoring Practices).

const KEYS = ["ArrowUp", "ArrowDown", "Home", "End", "PageUp", "PageDown"];

/** The focus in a list box whose options lie in groups. Options have `data-item`, a name that stays when they are drawn again. */
export class RovingFocus {
  private stop: HTMLElement | null = null;

  /** `onMove` is called with the option that a key has gone to. */
  constructor(private readonly box: HTMLElement, private readonly onMove: (option: HTMLElement) => void) {
    box.addEventListener("focusin", (event) => {
      const option = (event.target as HTMLElement).closest<HTMLElement>("[role=option]");
      if (option !== null) this.setStop(option);
    });
    box.addEventListener("keydown", (event) => {
      if (!KEYS.includes(event.key) || event.altKey || event.ctrlKey || event.metaKey || event.shiftKey) return;
      const from = (event.target as HTMLElement).closest<HTMLElement>("[role=option]");
      if (from === null) return;
      event.preventDefault();
      event.stopPropagation();
      const to = this.next(from, event.key);
      if (to === undefined || to === from) return;
      to.focus({ preventScroll: true });
      to.scrollIntoView({ block: "nearest", inline: "nearest" });
      this.onMove(to);
    });
  }

  /** Options that are seen, in the order of the page. */
  private get options(): HTMLElement[] {
    return [...this.box.querySelectorAll<HTMLElement>("[role=option]")].filter((each) => each.closest("[hidden]") === null);
  }

  /** See that Tab stops at one option after some were drawn again; whether there is one. */
  settle(): boolean {
    const isSeen = this.stop?.isConnected && this.stop.closest("[hidden]") === null;
    if (isSeen) return true;
    const { options } = this;
    const item = this.stop?.dataset.item;
    const next = options.find((each) => each.dataset.item === item) ?? options.find((each) => each.ariaSelected === "true") ?? options[0];
    if (next !== undefined) this.setStop(next);
    return next !== undefined;
  }

  private setStop(option: HTMLElement): void {
    if (this.stop !== null) this.stop.tabIndex = -1;
    this.stop = option;
    option.tabIndex = 0;
  }

  private next(from: HTMLElement, key: string): HTMLElement | undefined {
    const { options } = this;
    if (key === "ArrowUp" || key === "ArrowDown") return options[options.indexOf(from) + (key === "ArrowUp" ? -1 : 1)];
    const group = from.parentElement;
    const row = options.filter((each) => each.parentElement === group);
    if (key === "Home") return row[0];
    if (key === "End") return row[row.length - 1];
    const groups = [...new Set(options.map((each) => each.parentElement))];
    const other = groups[groups.indexOf(group) + (key === "PageUp" ? -1 : 1)];
    const away = (each: HTMLElement): number => Math.abs(each.offsetLeft - from.offsetLeft);
    return options.filter((each) => other && each.parentElement === other).sort((a, b) => away(a) - away(b))[0];
  }
}
