// Elements of the page: finding them, making them.

type Content = Node | string | null;
type Attributes = Record<string, string | boolean | ((event: never) => void)>;

/** The element with an id; the page cannot work without it. */
export function find<T extends HTMLElement = HTMLElement>(id: string): T {
  const element = document.getElementById(id);
  if (element === null) throw new Error(`the page has no element #${id}`);
  return element as T;
}

/** A new element. A function is a listener of the event that its key names. */
export function make<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  attributes: Attributes = {},
  ...content: Content[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") element.addEventListener(name, value as EventListener);
    else if (typeof value === "boolean") element.toggleAttribute(name, value);
    else element.setAttribute(name, value);
  }
  element.append(...content.filter((part) => part !== null));
  return element;
}

/** Follow the pointer from a press on an element until it is let go, or taken away. */
export function followPointer(
  element: HTMLElement, down: PointerEvent, onMove: (event: PointerEvent) => void, onEnd: (event: PointerEvent) => void,
): void {
  const end = (event: PointerEvent): void => {
    element.removeEventListener("pointermove", onMove);
    element.removeEventListener("pointerup", end);
    element.removeEventListener("pointercancel", end);
    onEnd(event);
  };
  element.setPointerCapture(down.pointerId);
  element.addEventListener("pointermove", onMove);
  element.addEventListener("pointerup", end);
  element.addEventListener("pointercancel", end);
}

/** A select element's options; the chosen one stays where it is still among them. */
export function fillSelect(select: HTMLSelectElement, rows: [value: string, text: string][], choice: string): void {
  select.replaceChildren(...rows.map(([value, text]) => make("option", { value }, text)));
  select.value = rows.some(([value]) => value === choice) ? choice : (rows[0]?.[0] ?? "");
}

/** Give the user a file to keep. */
export function saveFile(file: Blob, name: string): void {
  const url = URL.createObjectURL(file);
  make("a", { href: url, download: name }).click();
  window.setTimeout(() => URL.revokeObjectURL(url), 60_000);
}

/** A file's name without its suffix. */
export function stemOf(name: string): string {
  return name.replace(/\.[^.]*$/, "");
}

/** Minutes, seconds and tenths: 1:02.3. */
export function formatTime(seconds: number): string {
  const tenths = Math.round(Math.max(seconds, 0) * 10);
  const minutes = Math.floor(tenths / 600);
  return `${minutes}:${String(Math.floor(tenths / 10) % 60).padStart(2, "0")}.${tenths % 10}`;
}

/** Enable a button or not; one that loses the focus by it gives it to another element. */
export function enable(id: string, may: boolean, other: string): void {
  const button = find<HTMLButtonElement>(id);
  if (!may && document.activeElement === button) {
    const next = find(other);
    if (next instanceof HTMLButtonElement) next.disabled = false;
    next.focus();
  }
  button.disabled = !may;
}

/** A time of a whole, as screen readers say it: "3.04 of 19.0 seconds". */
export function sayTime(seconds: number, whole: number): string {
  return `${seconds.toFixed(2)} of ${whole.toFixed(1)} seconds`;
}

/** A name as people read it: "superimposed-beat" is "superimposed beat". */
export function readName(name: string): string {
  return name.replace(/[-_]/g, " ");
}

/** Options of models: their names in words, and what their titles say first. */
export function modelRows(models: { name: string; title: string }[]): [string, string][] {
  return models.map(({ name, title }) => [name, title.split(":")[0] || readName(name)]);
}
