// Made by `python tools/write_types.py` from src/cospeech/studio/messages.py and live_messages.py: do not edit.

/** `cospeech.Plan.add`: a form at a time, or on a word of the transcript. */
export interface AddGesture {
  start?: number | null;
  end?: number | null;
  hold?: number | null;
  hands?: "left" | "right" | "both" | null;
  size?: number;
  place?: [number, number, number] | null;
  score?: number;
  seed?: number | null;
  kind: "add";
  form: string;
  at?: number | null;
  word?: string | null;
}

/** Everything that the page offers. */
export interface Catalogue {
  version: string;
  default_model: string;
  models: ModelRow[];
  emotions: string[];
  languages: Record<string, string>;
  forms: FormRow[];
  formats: FormatRow[];
  joints: string[];
  parents: number[];
  rest: [number, number, number][];
  weights: string[];
  face: FaceTables;
  packed: string[];
  limits: StudioLimits;
}

/** `cospeech.Plan.change`. */
export interface ChangeGesture {
  start?: number | null;
  end?: number | null;
  hold?: number | null;
  hands?: "left" | "right" | "both" | null;
  size?: number;
  place?: [number, number, number] | null;
  score?: number;
  seed?: number | null;
  kind: "change";
  gesture: string;
  form?: string;
  stroke?: number;
  word?: string;
}

/** Steers a live session; only what is given changes. */
export interface ChangeLive {
  type: "change";
  style?: string | null;
  emotion?: string | null;
  intensity?: number | null;
  parts?: ("face" | "body" | "hands")[] | null;
}

/** The plan after an edit. */
export interface ChangedPlan {
  plan: Plan;
}

/** `cospeech.Plan.clear`: a stretch gets the values of the plan again. */
export interface ClearStretch {
  start: number;
  end: number;
  kind: "clear";
  names: ("style" | "emotion" | "intensity" | "seed")[];
}

/** The style of a clip that was uploaded. */
export interface ClipStyle {
  clip: string;
}

/** A take that waits for its turn. */
export interface CreatedTake {
  take: string;
}

/** How much of each emotion there is at a moment; linear in between, and what is left to 1 is neutral. */
export interface EmotionMoment {
  time: number;
  weights: Record<string, number>;
}

/** Tables to find and drive faces of characters, from `cospeech.export.face_names` and `cospeech.export.visemes`. */
export interface FaceTables {
  arkit: Record<string, string>;
  vrm0: Record<string, string>;
  oculus: Record<string, string>;
  longest: number;
  enough: number;
  held: number;
  moved: number;
  vowels: Record<string, string>;
  moods: Record<string, [number, Record<string, number>]>;
  scales: Record<string, number>;
}

/** A form of gesture. */
export interface FormRow {
  name: string;
  hands: "one" | "both" | "any";
  words: string[];
}

/** A file format of a download. */
export interface FormatRow {
  suffix: string;
  title: string;
  parts: ("face" | "body" | "hands")[];
}

/** The eyes jump; see `cospeech.face.gaze.Saccade`. Degrees from the listener. */
export interface GazeShift {
  id: string;
  time: number;
  yaw: number;
  up: number;
  length: number;
  away?: boolean;
}

/** A prosodic accent, see `cospeech.audio.prosodic_events.Accent`. It is shown, and not played. */
export interface HeardAccent {
  time: number;
  strength: number;
}

/** A stretch of speech between two pauses, in seconds. It is shown, and not played. */
export interface HeardPhrase {
  start: number;
  end: number;
}

/** A word of the transcript, in seconds; before 0 where it was under way when the speech began. */
export interface HeardWord {
  text: string;
  start: number;
  end: number;
  language?: string | null;
}

/** The character stops speaking at once. */
export interface InterruptLive {
  type: "interrupt";
}

/** The language that the user gives for the words of a speech. */
export interface LanguageChoice {
  language: string;
}

/** How a live session goes; sent when it starts, once a second, when something goes wrong, and when it ends. */
export interface LiveStatus {
  type: "status";
  running: boolean;
  latency: number;
  look_ahead: number;
  late: number;
  dropped: number;
  targets: TargetStatus[];
  problem: string;
  hint: string;
}

/** `cospeech.Plan.lock`. */
export interface LockStretch {
  start: number;
  end: number;
  kind: "lock";
}

/** Words of a transcript. */
export interface MessageWords {
  words: HeardWord[];
  language: string;
}

/** A mixture of styles: name → weight. */
export interface MixedStyle {
  mix: Record<string, number>;
}

/** A model that can be played. */
export interface ModelRow {
  name: string;
  title: string;
  styles: string[];
  seated: string[];
  parts: ("face" | "body" | "hands")[];
  takes_gestures: boolean;
  takes_example: boolean;
  latency: number;
}

/** The beginning of a motion. */
export interface MotionHeader {
  fps: number;
  frames: number;
  joints: string[];
  weights: string[];
}

/** `cospeech.Plan.move`: to a time of the stroke. */
export interface MoveGesture {
  kind: "move";
  gesture: string;
  to: number;
}

/** A style by its name. */
export interface NamedStyle {
  name: string;
}

/** A plan that can be played. */
export interface OpenedPlan {
  plan: Plan;
  note: string;
}

/** Which gestures a performance has, and when: gestures, gaze, phrases, accents, emotions, seeds. */
export interface Plan {
  cospeech_plan?: 1;
  seconds?: number | null;
  style?: string | null;
  emotion?: string | EmotionMoment[];
  seed?: number;
  intensity?: number;
  temperature?: number;
  open?: boolean;
  phrases?: HeardPhrase[];
  accents?: HeardAccent[];
  words?: HeardWord[];
  gestures?: PlannedGesture[];
  gaze?: GazeShift[];
  stretches?: Stretch[];
  locked?: Stretch[];
}

/** An edit of a plan. The words of the speech are added to a plan that has none. */
export interface PlanEditRequest {
  plan: Plan;
  speech?: string | null;
  edit: AddGesture | RemoveGesture | MoveGesture | ChangeGesture | ReseedStretch | SetStretch | ClearStretch | LockStretch | UnlockAll;
}

/** Request to open a plan from a file for a speech. */
export interface PlanOpenRequest {
  plan: Plan;
  speech: string;
  model: string;
}

/** A gesture: preparation, stroke, hold. Times are seconds; what is not given the planner chooses. */
export interface PlannedGesture {
  id: string;
  form: string;
  stroke: number;
  start?: number | null;
  end?: number | null;
  hold?: number | null;
  hands?: "left" | "right" | "both" | null;
  size?: number;
  place?: [number, number, number] | null;
  word?: string;
  score?: number;
  seed?: number | null;
}

/** `cospeech.Plan.remove`. */
export interface RemoveGesture {
  kind: "remove";
  gesture: string;
}

/** `cospeech.Plan.reseed`: another performance of a stretch. */
export interface ReseedStretch {
  start: number;
  end: number;
  kind: "reseed";
  seed?: number | null;
}

/** `cospeech.Plan.set`: values of a stretch; only given values are set. */
export interface SetStretch {
  start: number;
  end: number;
  kind: "set";
  style?: string | null;
  emotion?: string | null;
  intensity?: number | null;
  seed?: number | null;
  open?: boolean;
}

/** Opens a live session; binary messages of int16 samples, one channel, little-endian, follow. */
export interface StartLive {
  type: "start";
  model: string;
  style?: string | null;
  emotion?: string;
  intensity?: number;
  fps?: number;
  targets?: string[];
  rate: number;
}

/** Ends the live session; the connection stays, and another one may be started. */
export interface StopLive {
  type: "stop";
}

/** A stretch of time with values of its own; None: those of the plan. Borders are smooth. */
export interface Stretch {
  from: number;
  to: number;
  seed?: number | null;
  style?: string | null;
  emotion?: string | null;
  intensity?: number | null;
  open?: boolean;
}

/** Limits of the server. */
export interface StudioLimits {
  upload_bytes: number;
  minutes: number;
  takes: number;
}

/** A problem, and a hint how to mend it: the body of every answer with a status from 400 on. */
export interface StudioProblem {
  problem: string;
  hint: string;
  entry: string | null;
}

/** An event of a take. */
export interface TakeEvent {
  type: "queued" | "progress" | "done" | "error" | "cancelled";
  take: string;
  done: number;
  total: number | null;
  seconds: number;
  problem: string;
  hint: string;
  realtime_factor: number | null;
}

/** Request of motion for a speech. */
export interface TakeRequest {
  speech: string;
  model: string;
  style?: NamedStyle | ClipStyle | MixedStyle | null;
  emotion?: string;
  intensity?: number;
  seed?: number;
  temperature?: number;
  parts?: ("face" | "body" | "hands")[];
  fps?: number;
  plan?: Plan | null;
  page?: string | null;
}

/** A receiver of a live session. */
export interface TargetStatus {
  url: string;
  sent: number;
  problem: string;
  note: string;
}

/** `cospeech.Plan.unlock`. */
export interface UnlockAll {
  kind: "unlock";
}

/** A motion that the server keeps, as an example of a style. */
export interface UploadedClip {
  clip: string;
  name: string;
  seconds: number;
}

/** A speech that the server keeps. */
export interface UploadedSpeech {
  speech: string;
  name: string;
  seconds: number;
  peaks: number[];
  words: HeardWord[];
  language: string;
}
