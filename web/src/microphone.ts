// The microphone of the browser.

import { Problem } from "./api";

/** Open the microphone, or say why the browser does not give it. */
export async function openMicrophone(audio: MediaTrackConstraints | true): Promise<MediaStream> {
  const { mediaDevices } = navigator as { mediaDevices?: MediaDevices };
  if (mediaDevices === undefined) {
    throw new Problem("browsers give the microphone to pages of https or localhost alone", "open the studio on its own computer, or through an SSH tunnel: the guide to the studio says how");
  }
  try {
    return await mediaDevices.getUserMedia({ audio });
  } catch (error) {
    throw new Problem(`the microphone cannot be used: ${error instanceof Error ? error.message : String(error)}`, "allow it in the browser");
  }
}

export function closeMicrophone(microphone: MediaStream): void {
  for (const track of microphone.getTracks()) track.stop();
}
