// The panel of the speech: dropping, choosing, recording, the example, a transcript.

import * as api from "../api";
import { fillSelect, find, formatTime, saveFile } from "../dom";
import type { MessageWords, UploadedSpeech } from "../messages";
import { closeMicrophone, openMicrophone } from "../microphone";
import type { Player } from "../player";
import { isPlan } from "./plan";
import type { State, Store } from "../state";
import type { Takes } from "../takes";

const TRANSCRIPT = /\.(textgrid|tsv|csv|srt|vtt|sbv|ttml|dfxp|lrc|json|jsonl|marks|txt)$/i;
const MOTION = /\.(bvh|vrma|npz)$/i;
const AVATAR = /\.(vrm|glb)$/i;

/** What becomes of files that are no speech. */
export interface Receivers {
  avatar: (file: File) => void;
  clip: (file: File) => void;
  plan: (file: File) => void;
}

export class SpeechPanel {
  private recorder: MediaRecorder | null = null;
  private asking = false; // for the microphone
  private readonly language = find<HTMLSelectElement>("language");
  private shownLanguage = "";
  private chosenLanguage = ""; // of the words; "": it is found from them
  private changes: Promise<boolean> = Promise.resolve(true); // of the words
  private languageOf: string | undefined; // the speech for which it was chosen

  constructor(
    private readonly store: Store, private readonly takes: Takes, private readonly player: Player, private readonly others: Receivers,
  ) {
    this.bindFile("speech-file", ".choose-speech", (file) => this.take(() => api.sendSpeech(file, file.name)));
    this.bindFile("words-file", "#choose-words", (file) => this.takeWords(file));
    this.language.addEventListener("change", () => void this.setLanguage(this.language.value));
    find("example").addEventListener("click", () => void this.take(api.openExample));
    for (const button of document.querySelectorAll(".record")) button.addEventListener("click", () => void this.record());
    const stage = find("stage");
    window.addEventListener("dragover", (event) => {
      event.preventDefault();
      stage.classList.add("over");
    });
    window.addEventListener("dragleave", (event) => {
      if (event.relatedTarget === null) stage.classList.remove("over");
    });
    window.addEventListener("drop", (event) => {
      event.preventDefault();
      stage.classList.remove("over");
      void this.sortAll([...(event.dataTransfer?.files ?? [])]);
    });
    store.onChange((state) => this.draw(state));
  }

  private bindFile(id: string, buttons: string, tell: (file: File) => unknown): void {
    const input = find<HTMLInputElement>(id);
    for (const button of document.querySelectorAll(buttons)) button.addEventListener("click", () => input.click());
    input.addEventListener("change", () => {
      if (input.files?.[0]) tell(input.files[0]);
      input.value = "";
    });
  }

  /** The speech first: a transcript or a plan goes with it. */
  private async sortAll(files: File[]): Promise<void> {
    const isSpeech = (file: File): boolean => ![AVATAR, MOTION, TRANSCRIPT].some((kind) => kind.test(file.name));
    for (const file of [...files.filter(isSpeech), ...files.filter((file) => !isSpeech(file))]) {
      if (!(await this.sort(file))) return; // the rest belongs to a speech that is not open
    }
  }

  /** A file that was dropped: the name's end says what it is, and the text of a JSON file. */
  private async sort(file: File): Promise<boolean> {
    if (AVATAR.test(file.name)) this.others.avatar(file);
    else if (MOTION.test(file.name)) this.others.clip(file);
    else if (await isPlan(file)) this.others.plan(file);
    else if (TRANSCRIPT.test(file.name)) await this.takeWords(file);
    else return this.take(() => api.sendSpeech(file, file.name));
    return true;
  }

  /** Whether the edits that are in no file may be lost. */
  private mayReplace(): boolean {
    return !this.takes.hasUnsaved || window.confirm("Your edits are in no file. Open another speech without them?");
  }

  /** Open a speech; whether that was done. */
  private async take(send: () => Promise<UploadedSpeech>, asked = false): Promise<boolean> {
    if (!asked && !this.mayReplace()) return false;
    this.store.update({ problem: "", notice: "reading the speech …" });
    try {
      const speech = await send();
      this.player.pause();
      this.player.open(api.soundOf(speech.speech));
      this.takes.openSpeech(speech);
      return true;
    } catch (error) {
      this.store.update({ problem: error instanceof Error ? error.message : String(error), notice: "" });
      return false;
    }
  }

  private async takeWords(file: File): Promise<void> {
    const { speech } = this.store.state;
    if (speech === null) return this.store.update({ problem: "a transcript goes with a speech (drop the speech first)" });
    const asks = (): Promise<MessageWords> => api.sendTranscript(speech.speech, file);
    await this.changeWords(speech, asks, "takes with edits keep their gestures: the new words plan none there");
  }

  /** The language of the words: its code, or "": it is found from the words. */
  private async setLanguage(code: string): Promise<void> {
    const { speech } = this.store.state;
    if (speech === null) return;
    const before = this.chosenLanguage;
    this.chosenLanguage = code;
    const asks = (): Promise<MessageWords> => api.setLanguage(speech.speech, code);
    if (await this.changeWords(speech, asks, "takes with edits keep their gestures: the language changes their lips")) return;
    if (this.chosenLanguage === code) this.chosenLanguage = before;
    this.store.update();
  }

  /** Ask for other words of a speech, and make its takes again; whether that was done. One request after the other. */
  private changeWords(speech: UploadedSpeech, ask: () => Promise<MessageWords>, noteOfEdits: string): Promise<boolean> {
    this.changes = this.changes.then(() => this.changeWordsNow(speech, ask, noteOfEdits));
    return this.changes;
  }

  private async changeWordsNow(speech: UploadedSpeech, ask: () => Promise<MessageWords>, noteOfEdits: string): Promise<boolean> {
    try {
      const words = await ask();
      if (this.store.state.speech?.speech !== speech.speech) return false; // another one was opened meanwhile
      this.store.update({ speech: { ...speech, ...words }, problem: "" });
      const note = this.takes.hasEdits ? noteOfEdits : "";
      this.takes.renew(note);
      if (note) this.store.update({ notice: note });
      return true;
    } catch (error) {
      this.store.update({ problem: error instanceof Error ? error.message : String(error) });
      return false;
    }
  }

  private async record(): Promise<void> {
    if (this.recorder !== null) return this.recorder.stop();
    if (this.asking) return;
    this.asking = true;
    try {
      const microphone = await openMicrophone(true);
      const recorder = new MediaRecorder(microphone);
      const pieces: Blob[] = [];
      recorder.ondataavailable = (event) => pieces.push(event.data);
      recorder.onstop = () => {
        closeMicrophone(microphone);
        this.recorder = null;
        this.showRecording(false);
        const suffix = recorder.mimeType.includes("mp4") ? "m4a" : recorder.mimeType.includes("ogg") ? "ogg" : "webm";
        const sound = new Blob(pieces, { type: recorder.mimeType });
        if (this.mayReplace()) void this.take(() => api.sendSpeech(sound, `recording.${suffix}`), true);
        else saveFile(sound, `recording.${suffix}`); // it is not thrown away
      };
      recorder.start();
      this.recorder = recorder;
      this.showRecording(true);
    } catch (error) {
      this.store.update({ problem: error instanceof Error ? error.message : String(error) });
    } finally {
      this.asking = false;
    }
  }

  private showRecording(on: boolean): void {
    for (const button of document.querySelectorAll(".record")) {
      button.textContent = on ? "Stop recording" : "Record";
      button.classList.toggle("recording", on);
    }
    this.store.update({ notice: on ? "recording …" : "" });
  }

  private draw({ speech }: State): void {
    const welcome = find("welcome");
    const left = speech !== null && welcome.contains(document.activeElement);
    welcome.hidden = speech !== null;
    find("timeline").hidden = speech === null;
    if (left) find("view").focus(); // of what was opened, as the button is gone
    find<HTMLButtonElement>("choose-words").disabled = speech === null;
    this.drawLanguage(speech);
    find("speech-name").textContent = speech === null ? "None yet" : `${speech.name}, ${formatTime(speech.seconds)}`;
  }

  /** The languages, and which one the words are in where none is chosen. */
  private drawLanguage(speech: UploadedSpeech | null): void {
    if (speech?.speech !== this.languageOf) { // a new speech begins without a choice
      this.languageOf = speech?.speech;
      this.chosenLanguage = "";
    }
    const { languages } = this.store.state.catalogue;
    const has = (speech?.words.length ?? 0) > 0;
    const found = speech?.language ? languages[speech.language] : "not known, read as English";
    const auto = has && this.chosenLanguage === "" ? `auto: ${found}` : "auto";
    if (auto !== this.shownLanguage) {
      this.shownLanguage = auto;
      const names = Object.entries(languages).sort(([, a], [, b]) => a.localeCompare(b));
      fillSelect(this.language, [["", auto], ...names], this.chosenLanguage);
    }
    this.language.value = this.chosenLanguage;
    this.language.disabled = !has;
    find("language-note").hidden = has;
  }
}
