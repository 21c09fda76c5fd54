"""Draws docs/media/dialogue.webp: two moments of a conversation, each of the two persons speaking once.

    python tools/draw_dialogue.py

The conversation is put together from the example speech: the first person says its beginning, the second one what follows.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import av
import numpy as np
import soundfile
from PIL import Image

from cospeech.audio.conversation import VoiceTrack, hear_conversation
from cospeech.audio.speech import Speech, example
from cospeech.export.group_film import write_group_film
from cospeech.generate import generate_motion
from cospeech.motion.frame_pieces import cut_alike
from cospeech.runtime.listening import DialogueRole

PICTURE = Path(__file__).resolve().parents[1] / "docs" / "media" / "dialogue.webp"
TURN, SECONDS = 5.2, 10.4  # of the speech: the first turn, and both
MOMENTS = (2.6, 8.3)  # seconds that are shown


def main() -> None:
    speech = Speech.load(example()[0])
    samples, turn = speech.samples[: round(SECONDS * speech.rate)], round(TURN * speech.rate)
    tracks = np.zeros((len(samples), 2), np.float32)
    tracks[:turn, 0], tracks[turn:, 1] = samples[:turn], samples[turn:]
    with tempfile.TemporaryDirectory() as folder:
        sound, film = Path(folder) / "call.wav", Path(folder) / "both.mp4"
        soundfile.write(sound, tracks, speech.rate)
        one, other = hear_conversation(VoiceTrack(sound, 0), VoiceTrack(sound, 1))
        roles = (DialogueRole(one, (other,)), DialogueRole(other, (one,)))
        moving = [
            generate_motion(sound, role=role, seed=seed, style=style)
            for role, seed, style in zip(roles, (3, 4), ("lively", "natural"), strict=True)
        ]
        write_group_film(film, cut_alike(moving), fps=30, sounds=[sound], avatars=[None, None])
        with av.open(str(film)) as container:
            pictures = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    strip = np.concatenate([pictures[round(30 * moment)][::, :] for moment in MOMENTS], 1)
    Image.fromarray(strip).resize((strip.shape[1] // 2, strip.shape[0] // 2), Image.Resampling.LANCZOS).save(
        PICTURE, quality=80
    )


if __name__ == "__main__":
    main()
