"""Records what the program makes, and compares: `tools/golden.py record FILE`, change the code, `tools/golden.py compare FILE`.

What is recorded, through the command line, so that the code behind it may move:

* motion of every model that plays out of the box, in three styles, for two speeches;
* a file of every export format;
* `prepare` of the four synthetic layouts;
* 20 training steps of every recipe, at a small size.

Each entry has a SHA-256 of its numbers and a fingerprint (means and fixed random projections). `compare` prints for each entry
``equal``, or by how much the fingerprint moved relative to its size; beyond ``--tolerance`` the exit code is 1.
Another machine may run other kernels, so a file compares code on one machine. Synthetic data throughout. It takes about eight
minutes on two cores.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import soundfile
from safetensors.numpy import load_file

from cospeech.training.checkpoint import network

ROOT = Path(__file__).resolve().parents[1]
STEPS = 20
PROJECTIONS = 4
LAYOUTS = {"trinity": 1, "ted": 2, "pats": 2, "beat": 4}  # layout → speakers
EXPORTS = ("bvh", "glb", "vrma", "csv", "json", "npz", "mp4", "gif", "png")
STORES = {"ted": "ted", "trinity": "trinity", "pats": "pats", "beat": "beat", "humanoid": "humanoid"}
HUMANOID = ["beat", "raw-beat", "humanoid", "--pose", "expmap-humanoid", "--fps", "12"]
LEFT_OUT = {
    "speech_to_face": "needs a corpus of tracked faces",
    "speech_classifier": "needs a store with its features",
    "chain_of_generation_beat_wav2vec": "needs weights of wav2vec 2.0",
}


def cospeech(folder: Path, *arguments: object) -> str:
    """Run a command in a folder; its standard output."""
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-m", "cospeech", *map(str, arguments)]
    process = subprocess.run(command, cwd=folder, capture_output=True, text=True, env=environment)
    if process.returncode:
        raise SystemExit(f"cospeech {' '.join(map(str, arguments))}\n{process.stderr}")
    return process.stdout


def entry(arrays: Mapping[str, np.ndarray]) -> dict[str, object]:
    """Digest and fingerprint of arrays, whatever their names are: those of a network's parts may change."""
    digests, values = [], []
    for array in arrays.values():
        array = np.ascontiguousarray(array)
        digests.append(hashlib.sha256(f"{array.dtype}{array.shape}".encode() + array.tobytes()).hexdigest())
        if array.dtype.kind in "fiu" and array.size:
            flat = array.astype(np.float64).ravel()
            draw = np.random.default_rng(flat.size).normal(size=(PROJECTIONS, flat.size)) / np.sqrt(flat.size)
            values.append((digests[-1], [float(np.abs(flat).mean()), *map(float, draw @ flat)]))
    pairs = sorted(values, key=lambda pair: (round(pair[1][0], 6), len(pair[1])))
    whole = hashlib.sha256("".join(sorted(digests)).encode()).hexdigest()
    return {"sha256": whole, "values": [number for _, numbers in pairs for number in numbers]}


def of_bytes(path: Path) -> dict[str, object]:
    data = path.read_bytes()
    return {"sha256": hashlib.sha256(data).hexdigest(), "values": [float(len(data))]}


def speeches(folder: Path) -> list[Path]:
    """The example, and a part of it faster, quieter, in stereo and at another rate."""
    samples, rate = soundfile.read(ROOT / "src/cospeech/assets/example/example.ogg", dtype="float32")
    first, second = folder / "first.wav", folder / "second.wav"
    soundfile.write(first, samples[: 8 * rate], rate)
    soundfile.write(second, np.stack([0.4 * samples[9 * rate : 16 * rate]] * 2, 1), 22_050)
    (folder / "speech").mkdir()
    for k in range(3):
        soundfile.write(folder / "speech" / f"{k}.wav", samples[5 * k * rate : (5 * k + 6) * rate], rate)
        (folder / "speech" / f"{k}.txt").write_text("hello all of you, this is huge and that is tiny\n", "utf-8")
    return [first, second]


def motions(folder: Path) -> Iterator[tuple[str, dict[str, object]]]:
    rows = json.loads(cospeech(folder, "list", "styles", "--json"))
    names: dict[str, list[str]] = {}
    for row in rows:
        names.setdefault(str(row.get("model", "rules")), []).append(str(row["name"]))
    names.setdefault("speech-to-face", [])
    for model, styles in sorted(names.items()):
        mixtures = [f"{styles[0]}:0.7,{styles[1]}:0.3"] if len(styles) > 1 else []
        for style in [*styles[:2], *mixtures] or [""]:
            for speech in speeches_of(folder):
                options = ["--style", style] if style else []
                out = ["-o", "face.json"] if model == "speech-to-face" else ["-o", "motion.npz", "-o", "face.json"]
                cospeech(folder, "generate", speech, "--model", model, *options, "--fps", "30", "-q", *out)
                arrays = {
                    "face": np.array([f["weights"] for f in json.loads((folder / "face.json").read_text("utf-8"))["frames"]])
                }
                if model != "speech-to-face":
                    with np.load(folder / "motion.npz") as file:
                        arrays |= {key: file[key] for key in ("poses", "trans")}
                yield f"motion/{model}/{style or 'default'}/{speech.stem}", entry(arrays)


def speeches_of(folder: Path) -> list[Path]:
    return [folder / "first.wav", folder / "second.wav"]


def exports(folder: Path) -> Iterator[tuple[str, dict[str, object]]]:
    out = [part for suffix in EXPORTS for part in ("-o", f"all.{suffix}")]
    cospeech(folder, "generate", folder / "speech" / "0.wav", *out, "-q")
    for suffix in EXPORTS:
        yield f"export/{suffix}", of_bytes(folder / f"all.{suffix}")
    for skeleton in ("mixamo", "vrm", "beat", "smplx", "unreal"):
        cospeech(folder, "convert", "all.bvh", "other.bvh", "--skeleton", skeleton, "-q")
        yield f"convert/{skeleton}", of_bytes(folder / "other.bvh")


def stores(folder: Path) -> Iterator[tuple[str, dict[str, object]]]:
    for layout, speakers in LAYOUTS.items():
        line = ["--layout", layout, "--speech", "speech", "--hours", "0.05", "--speakers", speakers, "--no-tts", "-q"]
        cospeech(folder, "synthesise", f"raw-{layout}", *line)
        cospeech(folder, "prepare", layout, f"raw-{layout}", layout, "-q", *(["--mirror"] if layout == "trinity" else []))
    cospeech(folder, "prepare", *HUMANOID, "-q")
    for name in [*LAYOUTS, "humanoid"]:
        files = sorted(path for path in (folder / name).rglob("*") if path.is_file() and path.suffix != ".json")
        yield f"prepare/{name}", entry({path.name: np.frombuffer(path.read_bytes(), np.uint8) for path in files})


def trainings(folder: Path, recipes: Path) -> Iterator[tuple[str, dict[str, object]]]:
    import tomllib

    paths = sorted(recipes.rglob("*.toml"), key=lambda path: ("needs" in tomllib.loads(path.read_text("utf-8")), path.name))
    for path in paths:
        model = tomllib.loads(path.read_text("utf-8")).get("model", {}).get("name")
        store = path.stem.replace("_live", "").split("_")
        store = next((name for name in STORES if name in store), None)
        if model is None or store is None or path.stem in LEFT_OUT:
            continue
        changes = [f"model.{name}={json.dumps(value)}" for name, value in network(model).Config.TINY.items()]
        changes += [f"train.{pair}" for pair in (f"steps={STEPS}", "batch=4", "validate_every=0", f"save_every={STEPS}")]
        changes += ["train.threads=1", *(["data.fps=12"] if store == "humanoid" else [])]
        changes += ['data.speakers=["ada"]'] if model == "cmix-gan" else []  # it is of one
        line = [part for change in changes for part in ("--set", change)]
        cospeech(folder, "train", path, "--store", store, "--out", f"runs/{path.stem}", *line, "-q")
        yield f"train/{path.stem}", entry(load_file(folder / "runs" / path.stem / "best.safetensors"))


def make(recipes: Path, only: str) -> dict[str, dict[str, object]]:
    """All entries by name; each is printed on standard error as it comes."""
    entries: dict[str, dict[str, object]] = {}
    with TemporaryDirectory() as place:
        folder = Path(place)
        speeches(folder)
        parts = {"motion": motions, "export": exports, "prepare": stores, "train": lambda f: trainings(f, recipes)}
        names = only.split(",") if only else list(parts)
        if "train" in names and "prepare" not in names:
            names.insert(0, "prepare")
        for part in (name for name in parts if name in names):
            for name, value in parts[part](folder):
                print(name, str(value["sha256"])[:12], file=sys.stderr, flush=True)
                entries[name] = value
    return entries


def compare(before: Mapping[str, dict], after: Mapping[str, dict], tolerance: float) -> bool:
    """Print the differences; True if none exceeds the tolerance and no entry is missing."""
    good, equal = True, 0
    for name in sorted({*before, *after}):
        if name not in before or name not in after:
            print(f"{name}: only {'after' if name in after else 'before'}")
            good &= name in after
        elif before[name]["sha256"] == after[name]["sha256"]:
            equal += 1
        else:
            a, b = (np.array(side[name]["values"]) for side in (before, after))
            distance = float(np.abs(a - b).max() / max(np.abs(a).max(), 1e-12)) if a.shape == b.shape else np.inf
            print(f"{name}: moved by {distance:.2g}")
            good &= distance <= tolerance
    print(f"{equal} entries equal, of {len(before)}")
    return good


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("record", "compare"))
    parser.add_argument("file", type=Path)
    parser.add_argument("--recipes", type=Path, default=ROOT / "src/cospeech/training/recipes")
    parser.add_argument("--only", default="", help="motion, export, prepare, train; separated by commas")
    parser.add_argument("--tolerance", type=float, default=0.0, help="of fingerprints, relative; 0: the same bits")
    options = parser.parse_args()
    entries = make(options.recipes.resolve(), options.only)
    if options.what == "record":
        options.file.write_text(json.dumps(entries, indent=1) + "\n", "utf-8")
        return 0
    before = json.loads(options.file.read_text("utf-8"))
    kinds = {name.partition("/")[0] for name in entries}
    return 0 if compare({k: v for k, v in before.items() if k.partition("/")[0] in kinds}, entries, options.tolerance) else 1


if __name__ == "__main__":
    raise SystemExit(main())
