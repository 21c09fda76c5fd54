// The keys of the whole page; the dialog of keys lists them.

import { find, formatTime } from "./dom";
import type { Player } from "./player";
import { LEAST_STRETCH, type Store } from "./state";
import type { Takes } from "./takes";

const LIVE_KEYS = ["f", "?"];

/** What keys do that is not done by a button of the page. */
export interface KeyActions {
  store: Store;
  takes: Takes;
  player: Player;
  play: () => void;
  removeGesture: () => void;
}

export function listenToKeys(actions: KeyActions): void {
  window.addEventListener("keydown", (event) => {
    const target = event.target as HTMLElement;
    if (document.querySelector("dialog[open]") || event.altKey) return;
    if (document.body.classList.contains("is-live") && !LIVE_KEYS.includes(event.key.toLowerCase())) return; // takes are not seen there
    if (event.ctrlKey || event.metaKey) {
      if (!isText(target) && undoes(event, actions.takes)) event.preventDefault();
      return;
    }
    if (takesKey(target, event.key) || event.defaultPrevented) return;
    if (answer(event, actions)) event.preventDefault();
  });
}

function isText(element: HTMLElement): boolean {
  return element.matches("textarea, input[type=number], input[type=text]");
}

/** Whether an element has its own use for a key. */
function takesKey(element: HTMLElement, key: string): boolean {
  if (isText(element) || element.matches("select")) return true;
  if (element.matches("input[type=range]:not(#scrub)")) return /Arrow|Home|End|Page/.test(key);
  if (element.matches("[role=tab]") && /Arrow/.test(key)) return true;
  return key === " " && element.matches("button, a, input:not([type=range]), summary");
}

function undoes(event: KeyboardEvent, takes: Takes): boolean {
  const key = event.key.toLowerCase();
  if (key === "y" || (key === "z" && event.shiftKey)) takes.redo();
  else if (key === "z") takes.undo();
  else return false;
  return true;
}

/** Begin or end the selected stretch at a time. */
export function select(store: Store, seconds: number, part: { from?: number; to?: number }): void {
  const [first, last] = store.state.selection ?? [0, seconds];
  const from = part.from ?? (first > part.to! - LEAST_STRETCH ? 0 : first);
  const to = part.to ?? (last < part.from! + LEAST_STRETCH ? seconds : last);
  if (store.state.speech !== null && to - from >= LEAST_STRETCH) store.update({ selection: [from, to], notice: `${formatTime(from)} to ${formatTime(to)} is selected` });
}

/** Whether Delete means the chosen gesture there: not on a field of the settings. */
function isOfGestures(element: HTMLElement): boolean {
  return element === document.body || element.closest("#timeline, #view") !== null;
}

/** Whether a key writes a letter, a digit or a sign, which programs that listen to speech press by mistake (WCAG 2.1.4). */
function isSign(key: string): boolean {
  return key.length === 1 && key !== " ";
}

/** Whether a key zooms the time line and was pressed there. */
function isZoom({ key, target }: KeyboardEvent): boolean {
  return "+=-0".includes(key) && (target as HTMLElement).closest("#timeline") !== null;
}

function answer(event: KeyboardEvent, { store, takes, player, play, removeGesture }: KeyActions): boolean {
  const { state } = store;
  const step = event.shiftKey ? 1 : 1 / (store.take.motion?.fps ?? 30);
  const actions: Record<string, () => void> = {
    " ": play,
    ArrowLeft: () => player.seek(player.time - step),
    ArrowRight: () => player.seek(player.time + step),
    Home: () => player.seek(0),
    End: () => player.seek(player.seconds),
    ...(isOfGestures(event.target as HTMLElement) ? { Delete: removeGesture, Backspace: removeGesture } : {}),
    i: () => select(store, player.seconds, { from: player.time }),
    o: () => select(store, player.seconds, { to: player.time }),
    l: () => {
      find("loop").click();
      store.update({ notice: player.loop ? "loop" : "no loop" });
    },
    k: () => find("lock").click(),
    f: () => find("frame").click(),
    "+": () => find("zoom-in").click(),
    "=": () => find("zoom-in").click(), // the same key of many keyboards, without Shift
    "-": () => find("zoom-out").click(),
    "0": () => find("zoom-fit").click(),
    n: () => {
      takes.changeSeed(store.take.seed + 1);
      store.update({ notice: `seed ${store.take.seed}` });
    },
    "?": () => find<HTMLDialogElement>("help").showModal(),
    Escape: () => store.update({ selection: null, gesture: null, problem: "" }),
  };
  if (isSign(event.key) && !find<HTMLInputElement>("letters").checked && !isZoom(event)) return false;
  const action = actions[event.key] ?? actions[event.key.toLowerCase()];
  if (action !== undefined) action();
  else if (/^[1-8]$/.test(event.key) && Number(event.key) <= state.takes.length) {
    store.update({ chosen: Number(event.key) - 1, gesture: null });
  } else return false;
  return true;
}
