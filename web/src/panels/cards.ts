// The takes under the characters: which is chosen, how far it is, what went wrong; and the downloads of the chosen one.

import { fileOf, isGone, readFile } from "../api";
import { fillSelect, find, make, saveFile, stemOf } from "../dom";
import { isReady, type State, type Store, type Take } from "../state";
import type { Takes } from "../takes";

export class Cards {
  private writing: AbortController | null = null;
  private drawing = "";

  constructor(private readonly store: Store, private readonly takes: Takes) {
    const { formats } = store.state.catalogue;
    fillSelect(find("format"), formats.map((row) => [row.suffix, `${row.suffix}  ${row.title}`]), ".glb");
    find("add-take").addEventListener("click", () => takes.add());
    find("remove-take").addEventListener("click", () => takes.remove(store.state.chosen));
    find("format").addEventListener("change", () => store.update());
    find("download").addEventListener("click", (event) => {
      event.preventDefault();
      void this.download();
    });
    find("cancel-download").addEventListener("click", () => this.writing?.abort());
    store.onChange((state) => this.draw(state));
  }

  private draw(state: State): void {
    this.drawCards(state);
    find<HTMLButtonElement>("add-take").disabled = !this.takes.mayAdd || state.speech === null;
    find<HTMLButtonElement>("remove-take").disabled = state.takes.length < 2;
    const link = find<HTMLAnchorElement>("download");
    const ready = isReady(this.store.take);
    link.setAttribute("aria-disabled", String(!ready));
    if (ready) link.href = fileOf(this.store.take.id ?? "", find<HTMLSelectElement>("format").value);
    else link.removeAttribute("href");
    link.textContent = `Download take ${state.chosen + 1}`;
  }

  /** Buttons stay where they are while only the progress changes: one that is replaced under a finger loses its click. */
  private drawCards({ speech, takes, chosen }: State): void {
    const cards = speech === null ? [] : takes;
    const drawing = JSON.stringify([chosen, cards.map((take) => [
      take.key, take.seed, take.edited !== null, take.problem, take.progress !== null,
    ])]);
    if (drawing !== this.drawing) {
      const focus = document.activeElement?.id;
      find("cards").replaceChildren(...cards.map((take, k) => this.card(take, k)));
      const key = focus?.split("-")[1]; // a button to cancel is gone with what it cancels: then the take
      if (focus?.startsWith("card-")) (document.getElementById(focus) ?? document.getElementById(`card-${key}`))?.focus();
      this.drawing = drawing;
    }
    for (const { key, progress } of cards) if (progress !== null) find<HTMLProgressElement>(`card-${key}-progress`).value = progress;
  }

  private card(take: Take, k: number): HTMLElement {
    const isChosen = this.store.state.chosen === k;
    const name = make("button", {
      type: "button", class: "name", id: `card-${take.key}`, "aria-pressed": String(isChosen),
      click: () => this.store.update({ chosen: k, gesture: null }),
    }, `Take ${k + 1}`);
    const card = make("div", { class: `card${isChosen ? " chosen" : ""}` }, name);
    if (take.progress !== null) {
      const progress = make("progress", { max: "1", id: `card-${take.key}-progress`, "aria-label": `Making take ${k + 1}` });
      const stop = make("button", { type: "button", class: "quiet", id: `card-${take.key}-stop`, click: () => this.takes.cancel(take) }, "Cancel");
      card.append(progress, stop);
    } else card.append(make("span", { class: "soft" }, `seed ${take.seed}${take.edited ? ", edited" : ""}`));
    if (take.problem) card.append(make("span", { class: "wrong", role: "alert" }, take.problem));
    return make("li", {}, card);
  }

  /** Fetch first, so that a problem is told here and not shown as a page of its own. */
  private async download(): Promise<void> {
    const { take, state } = this.store;
    const suffix = find<HTMLSelectElement>("format").value;
    if (take.id === null || !isReady(take) || this.writing !== null) return;
    const writing = this.follow(new AbortController());
    this.store.update({ notice: `writing ${suffix} …`, problem: "" });
    try {
      saveFile(await readFile(take.id, suffix, writing.signal), `${stemOf(state.speech?.name ?? "talk")}${suffix}`);
      this.store.update({ notice: `${stemOf(state.speech?.name ?? "talk")}${suffix} is saved` });
    } catch (error) {
      if (writing.signal.aborted) this.store.update({ notice: "cancelled" });
      else if (isGone(error)) {
        this.takes.remake(take);
        this.store.update({ notice: "the studio had dropped this take: it is made again; then download it" });
      }
      else this.store.update({ notice: "", problem: error instanceof Error ? error.message : String(error) });
    } finally {
      this.follow(null);
    }
  }

  /** Show the button that cancels while a file is written. */
  private follow<T extends AbortController | null>(writing: T): T {
    this.writing = writing;
    const cancel = find("cancel-download");
    if (writing === null && document.activeElement === cancel) find("download").focus();
    cancel.hidden = writing === null;
    return writing;
  }
}
