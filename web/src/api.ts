// What the page asks of the server. Every failure becomes a Problem: what is wrong, and how to mend it.

import type {
  Catalogue, ChangedPlan, CreatedTake, LanguageChoice, MessageWords, OpenedPlan, Plan, PlanEditRequest, PlanOpenRequest, StudioProblem, TakeEvent, TakeRequest, UploadedClip,
  UploadedSpeech,
} from "./messages";
import { Motion } from "./motion";

export type PlanEdit = PlanEditRequest["edit"];

/** Whether the server has dropped what was asked for, or was started again. */
export const isGone = (error: unknown): boolean => error instanceof Problem && error.status === 404;

export class Problem extends Error {
  /** `status` is that of an answer which refused; 0: there was none. */
  constructor(readonly problem: string, readonly hint = "", readonly status = 0) {
    super(hint ? `${problem} (${hint})` : problem);
  }
}

async function ask(path: string, options: RequestInit = {}): Promise<Response> {
  let answer: Response;
  try {
    answer = await fetch(path, options);
  } catch {
    if (options.signal?.aborted) throw new Problem("cancelled", "");
    throw new Problem("the studio does not answer", "is `cospeech studio` still running?");
  }
  if (answer.ok) return answer;
  const message = (await answer.json().catch(() => ({}))) as Partial<StudioProblem>;
  throw new Problem(message.problem ?? `the studio answered ${answer.status}`, message.hint ?? "", answer.status);
}

async function askJson<T>(path: string, method = "GET", body?: unknown): Promise<T> {
  const options: RequestInit = { method };
  if (body !== undefined) {
    options.body = JSON.stringify(body);
    options.headers = { "Content-Type": "application/json" };
  }
  return (await (await ask(path, options)).json()) as T;
}

async function upload<T>(path: string, method: string, file: Blob, name: string): Promise<T> {
  const headers = { "Content-Type": "application/octet-stream" };
  return (await (await ask(`${path}?name=${encodeURIComponent(name)}`, { method, body: file, headers })).json()) as T;
}

export const readCatalogue = (): Promise<Catalogue> => askJson("/api/catalogue");
export const sendSpeech = (file: Blob, name: string): Promise<UploadedSpeech> => upload("/api/speech", "POST", file, name);
export const openExample = (): Promise<UploadedSpeech> => askJson("/api/speech/example", "POST");
export const sendClip = (file: File): Promise<UploadedClip> => upload("/api/clips", "POST", file, file.name);
export const sendTranscript = (speech: string, file: File): Promise<MessageWords> =>
  upload(`/api/speech/${speech}/transcript`, "PUT", file, file.name);
export const setLanguage = (speech: string, language: string): Promise<MessageWords> =>
  askJson(`/api/speech/${speech}/language`, "PUT", { language } satisfies LanguageChoice);
export const soundOf = (speech: string): string => `/api/speech/${speech}/sound`;
export const createTake = (request: TakeRequest): Promise<CreatedTake> => askJson("/api/takes", "POST", { ...request, page: PAGE });
export const readPlan = (take: string): Promise<Plan> => askJson(`/api/takes/${take}/plan`);
export const editPlan = (request: PlanEditRequest): Promise<ChangedPlan> => askJson("/api/plans/edit", "POST", request);
export const openPlan = (request: PlanOpenRequest): Promise<OpenedPlan> => askJson("/api/plans/open", "POST", request);
export const readPlanFile = async (take: string): Promise<Blob> => (await ask(`/api/takes/${take}/plan`)).blob();
export const fileOf = (take: string, suffix: string): string => `/api/takes/${take}/file?suffix=${encodeURIComponent(suffix)}`;

export async function readMotion(take: string): Promise<Motion> {
  return Motion.decode(await (await ask(`/api/takes/${take}/motion`)).arrayBuffer());
}

/** A take as a file; the studio stops to write it when the signal says so. */
export async function readFile(take: string, suffix: string, signal: AbortSignal): Promise<Blob> {
  return (await ask(fileOf(take, suffix), { signal })).blob();
}

/** Cancel a take, or forget it; that it is gone already is no problem. */
export function forgetTake(take: string): void {
  void fetch(`/api/takes/${take}`, { method: "DELETE" }).catch(() => undefined);
}

export function socketOf(path: string): WebSocket {
  return new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}${path}`);
}

const PAGE = Array.from(crypto.getRandomValues(new Uint8Array(16)), (byte) => byte.toString(16).padStart(2, "0")).join("");
const AGAIN = 1000; // milliseconds until a lost connection is opened again [ours]

/** Call `tell` with every event of a take. The connection is opened again whenever it is lost; `onRenewal`: the studio knows this page no more. */
export function followEvents(tell: (event: TakeEvent) => void, state: (isConnected: boolean) => void, onRenewal: () => void): void {
  const socket = socketOf(`/api/events?page=${PAGE}`);
  socket.onopen = () => state(true);
  socket.onmessage = (message) => tell(JSON.parse(message.data as string) as TakeEvent);
  socket.onclose = () => {
    state(false);
    void readCatalogue().catch((error: unknown) => error instanceof Problem && error.status === 401 && onRenewal());
    window.setTimeout(() => followEvents(tell, state, onRenewal), AGAIN);
  };
}
