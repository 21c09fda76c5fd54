// The page of the studio: its parts are made here and told of each other.

import { readCatalogue } from "./api";
import { Crowd } from "./crowd";
import { enable, find } from "./dom";
import { listenToKeys } from "./keys";
import { listIgnored, readLink, writeLink } from "./link";
import { Live } from "./live";
import { Cards } from "./panels/cards";
import { EditPanel } from "./panels/edits";
import { PlanPanel } from "./panels/plan";
import { SettingsPanel } from "./panels/settings";
import { SpeechPanel } from "./panels/speech";
import { Player } from "./player";
import { publishReadOuts } from "./readouts";
import { Stage } from "./stage";
import { makeTake, Store, type State } from "./state";
import { Takes } from "./takes";
import { TimeLine } from "./timeline";
import { Transport } from "./transport";

async function openStudio(): Promise<void> {
  const catalogue = await readCatalogue();
  const { settings, seeds } = readLink(location.hash, catalogue);
  const leftOut = listIgnored(location.hash, settings, seeds);
  const store = new Store({
    catalogue, settings, takes: seeds.map(makeTake), chosen: 0, speech: null, selection: null, gesture: null, problem: "",
    notice: leftOut.length ? `the link has settings that do not exist here, so these were left out: ${leftOut.join(", ")}` : "",
  });
  const player = new Player();
  const takes = new Takes(store);
  const live = new Live(store);
  const transport = new Transport(store, player);
  const edits = new EditPanel(store, takes, player);
  const timeLine = new TimeLine(store, player, takes, (time, gesture) => edits.openDialog(time, gesture));
  const display = { time: -1, motions: "", tab: "make" };
  let crowd: Crowd | null = null;

  /** Called for every frame of the display: whether the characters have moved. */
  function move(): boolean {
    if (crowd === null) return false;
    if (display.tab === "live") {
      const { fresh } = live;
      live.fresh = false;
      if (fresh) crowd.showPose(live.pose);
      return fresh;
    }
    player.follow();
    const { time } = player;
    const motions = `${crowd.count} ${crowd.name} ${store.state.takes.map((take) => `${take.key} ${take.id}`).join()}`;
    if (time === display.time && motions === display.motions) return false;
    Object.assign(display, { time, motions });
    crowd.show(store.state.takes, time);
    transport.follow(time);
    timeLine.follow(time);
    return true;
  }

  const stage = new Stage(find<HTMLCanvasElement>("view"), move);
  find("frame").addEventListener("click", () => stage.frame());
  const settingsPanel = new SettingsPanel(store, takes);
  new Cards(store, takes);

  async function wear(file: File | null): Promise<void> {
    try {
      await (file === null ? crowd?.wearMannequin() : crowd?.wear(file));
      store.update({ problem: "" });
    } catch (error) {
      store.update({ problem: error instanceof Error ? error.message : String(error) });
    }
    find("avatar-name").textContent = crowd?.name || "Mannequin";
    find("avatar-face").textContent = crowd?.describeFace() ?? "";
    find("mannequin").hidden = !crowd?.name;
    find("avatar-note").hidden = !crowd?.name;
  }

  const planPanel = new PlanPanel(store, takes);
  new SpeechPanel(store, takes, player, {
    avatar: (file) => void wear(file), clip: (file) => void settingsPanel.takeClip(file), plan: (file) => void planPanel.open(file),
  });
  bindAvatar(wear);
  bindHeader(store, takes);
  bindTabs((tab) => {
    display.tab = tab;
    player.pause();
    if (tab === "live") void crowd?.setCount(1);
    else {
      live.stop();
      display.motions = "";
      void crowd?.setCount(store.state.takes.length);
    }
  });
  window.addEventListener("hashchange", () => {
    if (location.hash.includes("=")) location.reload(); // another link was put into the address bar; "#controls" is a place of the page
  });
  find("problem").addEventListener("click", () => store.update({ problem: "" }));
  listenToKeys({ store, takes, player, play: () => transport.toggle(), removeGesture: () => void edits.removeChosen() });
  publishReadOuts({ store, player, live, stage, crowd: () => crowd, shownTime: () => display.time });
  store.onChange((state) => drawState(state, takes));
  crowd = await Crowd.open(stage, catalogue);
  store.onChange((state) => void (display.tab === "make" && crowd?.setCount(state.takes.length)));
  document.documentElement.dataset.ready = "true";
}

function drawState(state: State, takes: Takes): void {
  const problem = find("problem");
  if (problem.textContent !== state.problem) problem.textContent = state.problem;
  problem.hidden = !state.problem;
  const notice = find("notice");
  if (notice.textContent !== state.notice) notice.textContent = state.notice;
  find("gave-way").hidden = !takes.history.hasLost;
  enable("undo", takes.history.mayUndo, takes.history.mayRedo ? "redo" : "view");
  enable("redo", takes.history.mayRedo, takes.history.mayUndo ? "undo" : "view");
  const link = writeLink(state.settings, state.takes.map((take) => take.seed));
  if (location.hash !== link && state.speech !== null) history.replaceState(null, "", link);
}

function bindAvatar(wear: (file: File | null) => Promise<void>): void {
  const input = find<HTMLInputElement>("avatar-file");
  find("choose-avatar").addEventListener("click", () => input.click());
  find("mannequin").addEventListener("click", () => void wear(null));
  input.addEventListener("change", () => {
    if (input.files?.[0]) void wear(input.files[0]);
    input.value = "";
  });
}

function bindHeader(store: Store, takes: Takes): void {
  find("undo").addEventListener("click", () => takes.undo());
  find("redo").addEventListener("click", () => takes.redo());
  find("bring-back").addEventListener("click", () => takes.bringBack());
  find("let-go").addEventListener("click", () => takes.letGo());
  find("open-help").addEventListener("click", () => find<HTMLDialogElement>("help").showModal());
  find("copy-link").addEventListener("click", () => {
    const { settings, takes: all } = store.state;
    const link = location.href.replace(/#.*$/, "") + writeLink(settings, all.map((take) => take.seed));
    history.replaceState(null, "", link);
    const { clipboard } = navigator as { clipboard?: Clipboard }; // browsers give it to pages of https or localhost alone
    (clipboard?.writeText(link) ?? Promise.reject(new Error("no clipboard"))).then(
      () => store.update({ notice: "the link is copied: it holds the settings, and not the speech" }),
      () => store.update({ notice: `copy the link from here, or from the address bar: ${link}` }),
    );
  });
}

function bindTabs(open: (tab: "make" | "live") => void): void {
  const tabs = { make: find("tab-make"), live: find("tab-live") };
  const choose = (tab: "make" | "live"): void => {
    for (const [name, button] of Object.entries(tabs)) {
      button.setAttribute("aria-selected", String(name === tab));
      button.tabIndex = name === tab ? 0 : -1;
    }
    find("controls").hidden = tab !== "make";
    find("live").hidden = tab !== "live";
    document.body.classList.toggle("is-live", tab === "live");
    tabs[tab].focus();
    open(tab);
  };
  for (const name of ["make", "live"] as const) {
    tabs[name].addEventListener("click", () => choose(name));
    tabs[name].addEventListener("keydown", (event) => {
      if (/ArrowLeft|ArrowRight/.test(event.key)) choose(name === "make" ? "live" : "make");
    });
  }
}

openStudio().catch((error: unknown) => {
  const problem = find("problem");
  problem.textContent = error instanceof Error ? error.message : String(error);
  problem.hidden = false;
});
