"""What it costs to hear by wav2vec 2.0, and to read by fastText: ``python benchmarks/speech_encoders.py`` (extra ``wav2vec``).

wav2vec 2.0 of the base size with random weights, PyTorch in float32: the frozen CNN over 10 s and over 60 s of noise, as
``prepare --wav2vec`` does once per clip, and the most memory that it took besides; and the transformer over 10 s at 15 frames a
second and at the CNN's own rate. A ``.bin`` of fastText's with 2 million words and 2 million n-grams, 300 wide, whose matrices
are holes in the file (7.24 GB, like cc.en.300.bin): how long it takes to open it, to look up the first word, and each of the
next thousand. Processor time of one run each.
"""

from __future__ import annotations

import resource
import struct
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from transformers import Wav2Vec2Config, Wav2Vec2Model

from cospeech.features.word_vectors import open_vectors
from cospeech.nn.speech_encoder import Wav2VecCnn, Wav2VecTransformer
from cospeech.speech import Speech

FPS, WORDS, BUCKETS, WIDTH = 15.0, 2_000_000, 2_000_000, 300


def timed(what: str, work: Callable[[], object]) -> None:
    before, began = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
    work()
    more = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    print(f"{what:58s} {time.process_time() - began:9.4f} s   {more / 1024:7.0f} MB more at most")


def hear() -> None:
    torch.manual_seed(0)
    model = Wav2Vec2Model(Wav2Vec2Config()).eval()
    cnn, transformer = Wav2VecCnn(model.feature_extractor), Wav2VecTransformer(model)
    sizes = [sum(p.numel() for p in part.parameters()) / 1e6 for part in (cnn, transformer)]
    print(f"wav2vec 2.0 base: CNN {sizes[0]:.1f} M parameters, the rest {sizes[1]:.1f} M; {torch.get_num_threads()} threads")
    for seconds in (10, 60):
        speech = Speech(np.random.default_rng(0).normal(size=16_000 * seconds).astype(np.float32) * 0.1)
        timed(f"CNN, {seconds} s of speech", lambda s=speech, n=seconds: cnn.frame_features(s, round(n * FPS), FPS))
    with torch.no_grad():
        for rate in (FPS, 49.9):
            frames = torch.randn(1, round(10 * rate), cnn.width)
            timed(f"transformer, 10 s at {rate:g} frames a second", lambda x=frames: transformer(x))


def read(folder: Path) -> None:
    path = folder / "large.bin"
    with path.open("wb") as file:
        file.write(struct.pack("<2i12id", 793712314, 12, WIDTH, 5, 5, 5, 10, 1, 2, 1, BUCKETS, 5, 5, 100, 1e-5))
        file.write(struct.pack("<3i2q", WORDS, WORDS, 0, 10**9, -1))
        file.write(b"".join(f"word{k}".encode() + b"\0" + struct.pack("<qb", WORDS - k, 0) for k in range(WORDS)))
        file.write(struct.pack("<?2q", False, WORDS + BUCKETS, WIDTH))
        file.seek((WORDS + BUCKETS) * WIDTH * 4, 1)
        file.write(struct.pack("<?2q", False, WORDS, WIDTH))
        file.truncate(file.tell() + WORDS * WIDTH * 4)
    print(f"a .bin of {path.stat().st_size / 1e9:.2f} GB")
    found = []
    timed("open", lambda: found.append(open_vectors(path)))
    timed("the first word", lambda: found[0].table(["word7"]))
    timed("the next thousand", lambda: found[0].table([f"word{k * 1999}" for k in range(1000)]))


if __name__ == "__main__":
    hear()
    with tempfile.TemporaryDirectory() as folder:
        read(Path(folder))
