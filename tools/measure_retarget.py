"""What retargeting does to feet and hands: BVH files to our humanoid and back to their own skeleton.

python tools/measure_retarget.py TAKE.bvh ... [--frames 120]

Per file, at most: degrees between the feet's and the palms' directions in the file and on the humanoid, and in the file and
after the way back; centimetres between the height of the soles after the way there, in the file's measure, and in the file.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from cospeech.errors import InputError
from cospeech.export import bvh_reader
from cospeech.motion import tpose
from cospeech.motion.bone_mapping import recognise
from cospeech.motion.motion import Motion
from cospeech.motion.rotations import Array, quat_conjugate, quat_multiply, quat_rotate
from cospeech.motion.skeleton import humanoid
from cospeech.motion.soles import find_soles

FEET, PALMS = ("leftFoot", "rightFoot"), ("leftHand", "rightHand")
AHEAD, DOWN = np.array([0.0, 0.0, 1.0]), np.array([0.0, -1.0, 0.0])  # where toes and palms point in the T-pose


def thin(motion: Motion, step: int) -> Motion:
    """Every so many frames of a motion."""
    return replace(motion, rotations=motion.rotations[::step], root=motion.root[::step], face=None, fps=motion.fps / step)


def directions(motion: Motion, names: Mapping[str, str], joints: tuple[str, ...], rest: Array) -> dict[str, Array]:
    """Joint → (T, 3) the direction that is ``rest`` in the T-pose; of hands, the nearest one across their length."""
    skeleton = motion.skeleton
    lengths = tpose.directions(skeleton, names)
    world = skeleton.forward(motion.rotations, motion.root)[1]
    still = skeleton.forward(skeleton.rest, skeleton.offsets[0])[1]
    places = {joint: skeleton.index[names[joint]] for joint in joints if joint in names}
    vectors = {}
    for joint, k in places.items():
        along = lengths[joint] / np.linalg.norm(lengths[joint]) if joint in PALMS and joint in lengths else np.zeros(3)
        across = rest - (rest @ along) * along
        vectors[joint] = quat_rotate(quat_multiply(world[:, k], quat_conjugate(still[k])), across / np.linalg.norm(across))
    return vectors


def most_apart(one: dict[str, Array], other: dict[str, Array]) -> float:
    """Largest angle in any frame between directions of the same name, degrees; NaN where they share no name."""
    apart = [np.linalg.norm(np.cross(one[k], other[k]), axis=-1) for k in one.keys() & other.keys()]
    along = [(one[k] * other[k]).sum(-1) for k in one.keys() & other.keys()]
    return max((float(np.degrees(np.arctan2(a, b)).max()) for a, b in zip(apart, along, strict=True)), default=float("nan"))


def sole_heights(motion: Motion, names: Mapping[str, str]) -> Array | None:
    """(T,) height of the lowest point under the feet above the floor, as a share of that of the hips in the T-pose."""
    skeleton = motion.skeleton
    soles = find_soles(skeleton, names)
    if soles is None:
        return None
    hips = skeleton.tpose[skeleton.index[names["hips"]], 1] - skeleton.floor
    return (soles.heights(*skeleton.forward(motion.rotations, motion.root)) - skeleton.floor) / hips


def measure(motion: Motion) -> list[float]:
    """Toes there, toes back, palms there, palms back (degrees), soles there, soles back (cm)."""
    names, ours = recognise(motion.skeleton), recognise(humanoid())
    there = motion.retarget("humanoid")
    back = there.retarget(motion.skeleton)
    row = []
    for joints, rest in ((FEET, AHEAD), (PALMS, DOWN)):
        was = directions(motion, names, joints, rest)
        row += [
            most_apart(was, directions(there, ours, joints, rest)),
            most_apart(was, directions(back, names, joints, rest)),
        ]
    was, on_ours, again = sole_heights(motion, names), sole_heights(there, ours), sole_heights(back, names)
    if was is None or on_ours is None or again is None:
        return [*row, float("nan"), float("nan")]
    height = 100 * humanoid().tpose[humanoid().index["hips"], 1]
    return [*row, float(np.abs(on_ours - was).max() * height), float(np.abs(again - was).max() * height)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("takes", nargs="+", type=Path)
    parser.add_argument("--frames", type=int, default=120, help="of each take, evenly over it")
    options = parser.parse_args()
    print(f"{'':36} toes there  back  palms there  back  soles there  back")
    for path in options.takes:
        try:
            motion = bvh_reader.load(path)
            row = measure(thin(motion, max(1, len(motion) // options.frames)))
        except InputError as error:
            print(f"{path.stem[:36]:36} left out: {str(error)[:80]}")
            continue
        print(
            f"{path.stem[:36]:36} {row[0]:8.2f}° {row[1]:5.2f}° {row[2]:9.2f}° {row[3]:5.2f}° {row[4]:8.2f} cm {row[5]:5.2f} cm"
        )


if __name__ == "__main__":
    main()
