"""Mutated sound files: every one ends as sound or as one line about what is wrong with it.

What runs: (1) the decoder on 1,360 mutants of WAV, FLAC, OGG (Vorbis, Opus), MP3 and AIFF, one process for the mutants of
a format as long as it lives; on a mutant that kills or stalls it, the product's own path (`Speech.load`) has to say so in
one line. (2) `Speech.load` as a user calls it, with a decoder of its own per file, on every 16th of them. Most mutants of
OGG have their pages' checksums set right again: otherwise none would get past libogg to the codecs.
"""

from __future__ import annotations

import io
import json
import os
import struct
import subprocess
import threading
from pathlib import Path

import numpy as np
import pytest
import soundfile

from cospeech import InputError, Speech
from cospeech.audio import decoding
from cospeech.audio.worker import message

RATE = 16_000
MUTANTS = 170  # of each of the eight files below
TIME_LIMIT = 20.0  # seconds for one file of a tenth of a second
KINDS = {
    "wav": ("WAV", "PCM_16"),
    "wav-float": ("WAV", "FLOAT"),
    "wav-extensible": ("WAVEX", "PCM_24"),
    "flac": ("FLAC", "PCM_16"),
    "vorbis": ("OGG", "VORBIS"),
    "opus": ("OGG", "OPUS"),
    "mp3": ("MP3", "MPEG_LAYER_III"),
    "aiff": ("AIFF", "PCM_16"),
}
NASTY = (0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0x8000, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFF0, 0xFFFFFFFF)


def original(kind: str, subtype: str) -> bytes:
    file, rng = io.BytesIO(), np.random.default_rng(7)
    samples = 0.3 * np.sin(np.arange(RATE // 8)[:, None] * [0.05, 0.07]) + 0.05 * rng.standard_normal((RATE // 8, 2))
    soundfile.write(file, samples, RATE, format=kind, subtype=subtype)
    return file.getvalue()


def mutant(data: bytes, rng: np.random.Generator) -> bytes:
    """One to four changes: mostly in the header, where they hurt most."""
    out = bytearray(data)
    for _ in range(rng.integers(1, 5)):
        size = len(out)
        at = int(rng.integers(0, min(size, 120))) if rng.random() < 0.6 else int(rng.integers(0, size))
        match int(rng.integers(0, 8)):
            case 0 | 1:
                out[at] ^= 1 << int(rng.integers(0, 8))
            case 2:
                out[at] = int(rng.integers(0, 256))
            case 3 | 4:  # a nasty number, in either byte order
                order = "<" if rng.random() < 0.5 else ">"
                out[at : at + 4] = struct.pack(order + "I", NASTY[int(rng.integers(0, len(NASTY)))])
            case 5:
                del out[at : at + int(rng.integers(1, 64))]
            case 6:
                out[at:at] = rng.bytes(int(rng.integers(1, 64)))
            case _:
                del out[max(at, 8) :]
        if len(out) < 8:
            break
    return bytes(out)


CRC_TABLE = []
for byte in range(256):
    value = byte << 24
    for _ in range(8):
        value = (value << 1) ^ (0x04C11DB7 if value & 0x80000000 else 0)  # RFC 3533, section 6
    CRC_TABLE.append(value & 0xFFFFFFFF)


def with_checksums(data: bytes) -> bytes:
    """An Ogg file with the checksum of every page that can be found made right."""
    out, at = bytearray(data), 0
    while (at := out.find(b"OggS", at)) >= 0 and at + 27 <= len(out):
        body = at + 27 + out[at + 26]
        end = min(body + sum(out[at + 27 : body]), len(out))
        out[at + 22 : at + 26] = bytes(4)
        crc = 0
        for byte in out[at:end]:
            crc = (crc << 8 & 0xFFFFFFFF) ^ CRC_TABLE[crc >> 24 ^ byte]
        out[at + 22 : at + 26] = struct.pack("<I", crc)
        at = max(end, at + 27)
    return bytes(out)


def mutants(folder: Path, name: str) -> list[Path]:
    data, rng = original(*KINDS[name]), np.random.default_rng(list(name.encode()))
    paths = [folder / f"{i:04d}" for i in range(MUTANTS)]
    for path in paths:
        content = mutant(data, rng)
        path.write_bytes(with_checksums(content) if KINDS[name][0] == "OGG" and rng.random() < 0.8 else content)
    return paths


def run_decoder(paths: list[Path]) -> list[str]:
    """How each file ended ("sound", "error"), up to the file that ended the decoder process."""
    decoder = subprocess.Popen(decoding._command(), stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    ends: list[str] = []
    timer = threading.Timer(TIME_LIMIT, decoder.kill)
    timer.start()
    try:
        decoder.stdin.write(b"".join(message(b"P", os.fsencode(path)) for path in paths))
        decoder.stdin.close()
        while len(head := decoder.stdout.read(5)) == 5:
            kind, size = head[:1], struct.unpack("<I", head[1:])[0]
            payload = decoder.stdout.read(size)
            assert kind in b"HBEX", f"{paths[len(ends)].name}: {kind!r}"
            if kind == b"X":
                problem = json.loads(payload)
                assert not problem["ours"], problem
                assert "\n" not in problem["problem"]
            if kind in b"EX":
                ends.append("sound" if kind == b"E" else "error")
                timer.cancel()
                timer = threading.Timer(TIME_LIMIT, decoder.kill)
                timer.start()
        return ends
    finally:
        timer.cancel()
        decoder.kill()
        decoder.wait()
        decoder.stdout.close()


@pytest.mark.slow
@pytest.mark.parametrize("name", KINDS)
def test_mutants_end_as_sound_or_as_an_error(tmp_path, name):
    paths = mutants(tmp_path, name)
    ends: list[str] = []
    while len(ends) < len(paths):
        ends += run_decoder(paths[len(ends) :])
        if len(ends) < len(paths):  # this one kills or stalls the decoder: contained?
            with pytest.raises(InputError, match=r"crashed|hangs"):
                Speech.load(paths[len(ends)])
            ends.append("crash")
    assert ends.count("sound") > MUTANTS // 50, "the mutants are too broken to say anything"
    assert ends.count("error") > MUTANTS // 50, "the mutants are hardly broken"


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*is cut short:cospeech.errors.CospeechWarning")
@pytest.mark.parametrize("name", KINDS)
def test_mutants_as_a_user_loads_them(tmp_path, name):
    for path in mutants(tmp_path, name)[::16]:
        try:
            speech = Speech.load(path)
        except InputError as error:
            message = str(error)
        else:
            message = ""
            assert np.isfinite(speech.samples).all()
            assert speech.frames(30) == -(-speech.duration * 30 // 1) > 0
            assert len(speech) == -(-speech.duration * speech.rate // 1)
        assert "\n" not in message
