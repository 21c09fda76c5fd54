// The page of a study: consent, one page for each comparison, thanks. No library, and nothing is loaded from elsewhere.

const STATIC = document.documentElement.dataset.mode === "static";
const SEEN = 0.9; // share of a clip after which it counts as watched
const main = document.getElementById("main");
const status = document.getElementById("status");

/** An element with attributes and children. */
function make(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (value === true) node.setAttribute(name, "");
    else if (value !== false && value !== null) node.setAttribute(name, value);
  }
  node.append(...children);
  return node;
}

function say(text) {
  status.textContent = text;
}

/** Put a page in place of the one before, and let screen readers begin at its top. */
function show(...nodes) {
  main.replaceChildren(...nodes);
  say("");
  window.scrollTo(0, 0);
  main.focus();
}

async function ask(path, { body, rater } = {}) {
  const options = { headers: {}, cache: "no-store" };
  if (rater) options.headers["x-rater"] = rater;
  if (body !== undefined) {
    options.method = "POST";
    options.headers["content-type"] = "application/json";
    options.body = JSON.stringify(body);
  }
  const response = await fetch(path, options);
  const given = await response.json().catch(() => ({}));
  if (!response.ok) throw Object.assign(new Error(given.error || `The server answered ${response.status}.`), { status: response.status });
  return given;
}

const query = new URLSearchParams(location.search);
const code = () => (query.get("participant") || query.get("PROLIFIC_PID") || "").trim();
const MOST_CODE = 64; // characters, as for the server
const UNPRINTED = /[\p{C}\p{Zl}\p{Zp}]|(?! )\p{Zs}/u; // as Python's isprintable has it

/** Where the browser keeps a session: of a participant's code, so that the next one at this computer begins anew. */
const keyOf = (study) => `study-${study.study}${code() && `-${code()}`}`;

/** Where answers go: to the server of the study. */
class Server {
  async open() {
    this.study = await ask("api/study");
    return this.study;
  }
  get key() {
    return keyOf(this.study);
  }
  async resume() {
    const rater = localStorage.getItem(this.key);
    if (!rater) return null;
    try {
      return this.#begin(await ask("api/session", { rater }));
    } catch (error) {
      if (error.status !== 404) throw error;
      localStorage.removeItem(this.key);
      return null;
    }
  }
  async join() {
    return this.#begin(await ask("api/raters", { body: { consent: true, participant: code() } }));
  }
  #begin(session) {
    this.rater = session.rater;
    this.completion = session.completion;
    localStorage.setItem(this.key, session.rater);
    return session;
  }
  async save(trial, answers, seconds) {
    const { completion } = await ask("api/answers", { body: { trial, answers, seconds }, rater: this.rater });
    this.completion = completion;
  }
  thanks() {
    return [];
  }
  forget() {
    localStorage.removeItem(this.key);
    return true;
  }
}

/** Where answers go without a server: into this browser, and at the end into a file. */
class Folder {
  async open() {
    this.held = await ask("study.json");
    this.study = this.held.study;
    this.completion = this.held.completion;
    return this.study;
  }
  get key() {
    return keyOf(this.study);
  }
  async resume() {
    const text = localStorage.getItem(this.key);
    if (!text) return null;
    this.kept = JSON.parse(text);
    return this.#session();
  }
  async join() {
    if (code().length > MOST_CODE || UNPRINTED.test(code())) throw new Error("The code of the invitation is not valid.");
    const wanted = Number.parseInt(query.get("session") ?? "", 10);
    const any = crypto.getRandomValues(new Uint32Array(5));
    const session = wanted >= 0 && wanted < this.held.sessions.length ? wanted : any[4] % this.held.sessions.length;
    const rater = [...any.slice(0, 4)].map((n) => n.toString(16).padStart(8, "0")).join("");
    this.kept = { study: this.study.study, session, rater, participant: code(), answers: [] };
    this.#keep();
    return this.#session();
  }
  forget() {
    if (!this.saved && !confirm("Your answers are not saved yet. Go on without them?")) return false;
    localStorage.removeItem(this.key);
    return true;
  }
  #session() {
    return { trials: this.held.sessions[this.kept.session], done: this.kept.answers.map((row) => row.trial) };
  }
  #keep() {
    localStorage.setItem(this.key, JSON.stringify(this.kept));
  }
  async save(trial, answers, seconds) {
    this.kept.answers = [...this.kept.answers.filter((row) => row.trial !== trial), { trial, answers, seconds }];
    this.#keep();
  }
  thanks() {
    const file = URL.createObjectURL(new Blob([JSON.stringify(this.kept)], { type: "application/json" }));
    const name = `answers-${this.kept.rater.slice(0, 8)}.json`;
    return [
      make("p", { class: "text" }, "Your answers are in this browser only. Save the file and send it to the people who invited you."),
      make("p", {}, make("a", { href: file, download: name, id: "download", onclick: () => { this.saved = true; } }, "Save my answers")),
    ];
  }
}

const store = STATIC ? new Folder() : new Server();

/** The first page: what it is about, and whether one agrees. */
function askConsent(study) {
  return new Promise((resolve) => {
    const box = make("input", { type: "checkbox", id: "agree" });
    const button = make("button", { type: "submit" }, "Start");
    const form = make("form", {}, make("p", { class: "agree" }, box, make("label", { for: "agree" }, "I have read this, and I agree to take part.")), button);
    form.addEventListener("submit", async (event) => {
      event.preventDefault();
      if (!box.checked) {
        say("Tick the box if you agree to take part.");
        box.focus();
        return;
      }
      try {
        resolve(await store.join());
      } catch (error) {
        say(error.message);
      }
    });
    show(make("h1", {}, "Before you start"), make("p", { class: "text" }, study.consent), make("p", { class: "text" }, study.instructions), form);
  });
}

/** A clip with its player; `done` is called when it was watched. */
function makeClip(name, label, { muted, notice, done }) {
  const video = make("video", { src: `clips/${name}`, controls: true, playsinline: true, preload: "auto", "aria-label": label,
    controlslist: "nodownload noplaybackrate", disablepictureinpicture: true });
  video.muted = muted;
  const screen = make("div", { class: "screen" }, video);
  const seen = make("p", { class: "seen" }, "Not watched yet");
  let most = 0;
  const watched = () => {
    if (seen.dataset.done) return;
    seen.dataset.done = "yes";
    seen.textContent = "Watched";
    done();
  };
  video.addEventListener("timeupdate", () => {
    if (!video.seeking && video.currentTime - most < 1.5) most = Math.max(most, video.currentTime);
    if (most >= SEEN * video.duration) watched();
    if (notice && most >= 0.5 * video.duration && !screen.querySelector(".notice")) {
      screen.append(make("p", { class: "notice", role: "alert" }, notice));
    }
  });
  video.addEventListener("ended", () => { if (most >= 0.5 * video.duration) watched(); });
  video.addEventListener("error", () => {
    seen.textContent = "This video cannot be played here.";
    say("A video cannot be played. Try another browser.");
  });
  video.addEventListener("play", () => {
    for (const other of main.querySelectorAll("video")) if (other !== video) other.pause();
  });
  return make("figure", {}, make("figcaption", {}, label), screen, seen);
}

/** A question as a group of radio buttons. */
function makeQuestion(question, place, label) {
  const name = `${question.name}:${place}`;
  const options = question.options.map(([value, words]) =>
    make("label", {}, make("input", { type: "radio", name, value: String(value), required: true }), words));
  return make("fieldset", { "data-name": question.name, "data-place": String(place) },
    make("legend", {}, label ? `${label}: ${question.text}` : question.text), make("div", { class: "options" }, ...options));
}

/** The answers on the page as the server takes them; null if one is missing. */
function readAnswers(form, study) {
  const answers = {};
  for (const question of study.questions) {
    const values = [...form.querySelectorAll(`fieldset[data-name="${question.name}"]`)].map((set) => set.querySelector(":checked")?.value);
    if (values.some((value) => value === undefined)) return null;
    answers[question.name] = question.each ? values.map(Number) : Number(values[0]);
  }
  return answers;
}

function clipLabels(count) {
  if (count === 1) return ["Video"];
  return Array.from({ length: count }, (_, k) => `Video ${String.fromCharCode(65 + k)}`);
}

/** One page of the session. */
function askTrial(study, trial, number, total) {
  return new Promise((resolve) => {
    const began = performance.now();
    const labels = clipLabels(trial.clips.length);
    let waiting = trial.clips.length;
    const button = make("button", { type: "submit", "aria-disabled": "true" }, "Next");
    const done = () => {
      waiting -= 1;
      if (waiting === 0) button.removeAttribute("aria-disabled");
    };
    const clips = trial.clips.map((name, k) => makeClip(name, labels[k], { muted: study.muted, notice: trial.notice, done }));
    const sets = study.questions.flatMap((question) =>
      question.each ? labels.map((label, k) => makeQuestion(question, k, labels.length > 1 ? label : "")) : [makeQuestion(question, -1, "")]);
    const form = make("form", { novalidate: true, onchange: () => say("") }, ...sets, button);
    form.addEventListener("submit", async (event) => {
      event.preventDefault();
      if (waiting > 0) return say(labels.length > 1 ? "Please watch every video to the end." : "Please watch the video to the end.");
      const answers = readAnswers(form, study);
      if (!answers) {
        say("Please answer every question.");
        form.querySelector("fieldset:not(:has(:checked)) input").focus();
        return;
      }
      button.disabled = true;
      try {
        await store.save(number, answers, (performance.now() - began) / 1000);
        resolve();
      } catch (error) {
        button.disabled = false;
        say(`Your answers could not be saved. Press Next again. (${error.message})`);
      }
    });
    show(make("h1", {}, `Page ${number + 1} of ${total}`), make("div", { class: `clips ${study.shows}` }, ...clips), form);
  });
}

function showProgress(done, total) {
  document.getElementById("progress").hidden = false;
  const bar = document.getElementById("bar");
  bar.max = total;
  bar.value = done;
  document.getElementById("count").textContent = `${done} of ${total}`;
}

async function run() {
  const study = await store.open();
  document.title = study.title;
  document.getElementById("title").textContent = study.title;
  const session = (await store.resume()) ?? (await askConsent(study));
  const total = session.trials.length;
  const done = new Set(session.done);
  for (const [number, trial] of session.trials.entries()) {
    if (done.has(number)) continue;
    showProgress(done.size, total);
    await askTrial(study, trial, number, total);
    done.add(number);
  }
  showProgress(total, total);
  show(make("h1", {}, "Thank you"), make("p", { class: "text" }, study.thanks), ...store.thanks(), ...goOn());
}

/** Where a rater goes on after the thanks, and where the next one at this computer begins. */
function goOn() {
  const nodes = [];
  if (store.completion) {
    nodes.push(make("p", {}, make("a", { href: store.completion, id: "completion", rel: "noreferrer" }, "Go on to finish")));
  }
  if (!code()) {
    const again = () => {
      if (store.forget()) location.reload();
    };
    nodes.push(make("p", {}, make("button", { type: "button", id: "next-person", class: "plain", onclick: again }, "Another person takes part at this computer")));
  }
  return nodes;
}

const reason = (error) => (location.protocol === "file:"
  ? "Browsers open this page from a web space only. Try: python -m http.server, in the folder of the page." : error.message);
run().catch((error) => show(make("h1", {}, "This study cannot be opened"), make("p", {}, reason(error))));
