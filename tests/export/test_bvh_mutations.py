"""2,400 damaged BVH files: each is read as finite motion or refused in one line, and nothing else happens."""

from __future__ import annotations

import re
import warnings
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from cospeech.errors import InputError
from cospeech.motion.motion import Motion
from cospeech.motion.rotations import quat_identity
from cospeech.motion.skeleton import Skeleton, humanoid
from tests.support.motions import gesturing

NASTY = [
    *(
        "nan",
        "NaN",
        "inf",
        "-inf",
        "1e999",
        "-1e308",
        "1e-320",
        "0x1p3",
        "1_0",
        "1,5",
        "",
        "{",
        "}",
        "\0",
        "٣",
        "−1",
        "9" * 400,
    ),
    *("+", ".", "--1", "1e", "JOINT", "ROOT x {", "End Site", "MOTION", "Frames: -1", "Frame Time: 0", "OFFSET", "CHANNELS"),
    *("Xposition", "6", "#", '"', "1;2", "True", "HIERARCHY", "\r", "\n", "\t", "\x1a", "\ufeff", "1 2 3 4 5 6"),
]
NUMBERS = [
    "0",
    "-7",
    "1e7",
    "-9999999",
    "0.5e-3",
    "1e-300",
    "-0",
    "007",
    "360",
    "+5",
    "90.",
    ".1",
    "1E+2",
    "-89.9999999",
    "3.14159265358979323846",
]
COUNT = 2400


def bodies(folder: Path) -> list[bytes]:
    """Small files to damage: our body without fingers, and a hand-made chain with mixed channel orders."""
    ours = humanoid()
    keep = [k for k, n in enumerate(ours.names) if not re.search(r"Thumb|Index|Middle|Ring|Little|Eye|jaw", n)]
    parents = tuple(keep.index(ours.parents[k]) if ours.parents[k] >= 0 else -1 for k in keep)
    skeleton = Skeleton(tuple(ours.names[k] for k in keep), parents, ours.offsets[keep])
    motion = gesturing(2)
    Motion(fps=30, rotations=motion.rotations[:, keep], root=motion.root, skeleton=skeleton).save(folder / "body.bvh")
    chain = Skeleton(("a b", "b", "c", "d"), (-1, 0, 1, 1), np.arange(12).reshape(4, 3) / 10, ends={"c": (0, 0.1, 0)})
    Motion(fps=25, rotations=quat_identity(3, 4), root=np.ones((3, 3)), skeleton=chain).save(folder / "chain.bvh")
    six = (folder / "chain.bvh").read_text().replace("CHANNELS 3 Zrotation Xrotation", "CHANNELS 3 Xrotation Zrotation")
    return [(folder / "body.bvh").read_bytes(), (folder / "chain.bvh").read_bytes(), six.encode()]


def damage(data: bytes, rng: np.random.Generator) -> bytes:
    """One to three of: other bytes, other words, lines gone, doubled or swapped, an end cut off, a piece put elsewhere."""
    for _ in range(rng.integers(1, 3)):
        kind = rng.integers(12)
        at = int(rng.integers(max(len(data), 1)))
        lines = data.split(b"\n")
        row = int(rng.integers(len(lines)))
        if kind == 0:
            data = data[:at] + bytes(rng.integers(0, 256, rng.integers(1, 4), dtype=np.uint8)) + data[at + 1 :]
        elif kind == 1:
            data = data[:at]
        elif kind == 2:
            lines[row : row + int(rng.integers(1, 4))] = []
            data = b"\n".join(lines)
        elif kind == 3:
            lines.insert(int(rng.integers(len(lines))), lines[row])
            data = b"\n".join(lines)
        elif kind == 4:
            cut = sorted(int(x) for x in rng.integers(0, len(data) + 1, 2))
            data = data[: cut[0]] + data[cut[1] :]
        else:
            words = lines[row].split(b" ")
            choice = NASTY if kind < 8 else NUMBERS
            words[int(rng.integers(len(words)))] = choice[rng.integers(len(choice))].encode()
            lines[row] = b" ".join(words)
            data = b"\n".join(lines)
    return data


@pytest.mark.slow
def test_damaged_files_are_read_or_refused(tmp_path):
    rng, sound, outcomes, messages = np.random.default_rng(20), bodies(tmp_path), Counter(), set()
    path = tmp_path / "mutant.bvh"
    for k in range(COUNT):
        data = damage(sound[k % len(sound)], rng)
        path.write_bytes(data)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                motion = Motion.load(path)
                positions = motion.positions()
        except InputError as error:
            outcomes[re.sub(r"line \d+:? ?|'.*?'|\d+", "", error.problem)] += 1
            messages.add(str(error))
        except Exception as error:
            pytest.fail(f"mutant {k}: {error!r} from {data[:2000]!r}")
        else:
            assert np.isfinite(positions).all()
            assert np.isfinite(motion.skeleton.tpose).all()
            assert np.allclose(np.linalg.norm(motion.rotations, axis=-1), 1, atol=1e-6)
            assert 0 < motion.fps <= 1e4
            assert len(set(motion.skeleton.names)) == len(motion.skeleton)
            outcomes["read"] += 1
    assert not [message for message in messages if "\n" in message or len(message) > 500]
    assert outcomes["read"] > COUNT / 10, outcomes  # the damage is not so great that nothing is tested behind the header
    assert outcomes["read"] < COUNT * 0.9, outcomes
    assert len(outcomes) > 6, outcomes
