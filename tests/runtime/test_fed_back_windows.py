"""Windows that begin with the last poses of the window before: what the network is given, take by take."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from cospeech.errors import InputError
from cospeech.runtime.bundles.signature import Signature
from cospeech.runtime.sliding_window_decoder import OverlapAddDecoder, sections

WINDOW, SEEDS, WIDTH, AHEAD = 12, 4, 3, 2


def signature(seed: int | str = "N") -> Signature:
    ports = {"rows": (1, "T", 2), "noise": ("N", "T", 1), "seed": (seed, "T", WIDTH + 1)}
    hop = WINDOW - SEEDS - AHEAD
    return Signature(ports, {"poses": ("N", "T", WIDTH)}, window=WINDOW, look_ahead=AHEAD, hop=hop, seeds=SEEDS)


class Counting:
    """A network whose poses count up from the last known pose, in steps of a take's first noise; it stores its inputs."""

    def __init__(self, seed: int | str) -> None:
        self.signature, self.given = signature(seed), []

    def run(self, **ports):
        self.given.append(ports)
        rows = ports["noise"]
        seed = ports.get("seed", np.zeros((*rows.shape[:2], WIDTH + 1), np.float32))
        steps = np.arange(rows.shape[1]) - (SEEDS - 1)
        start = seed[:, SEEDS - 1, :1, None]
        return {"poses": np.broadcast_to(start + steps[:, None], (len(rows), rows.shape[1], WIDTH)).astype(np.float32)}


def play(network: Counting, frames: int, **options) -> np.ndarray:
    flat = np.zeros(WIDTH, np.float32)
    statistics = SimpleNamespace(
        noise_gain=np.ones(2, np.float32),
        pose_std=flat + 1,
        pose_mean=flat,
        audio_mean=np.zeros(2),
        bounds=(flat - 99, flat + 99),
    )
    system = SimpleNamespace(fps=15.0, pose_width=WIDTH, statistics=statistics)
    style = SimpleNamespace(
        forget=lambda frame: None, hear=lambda rows: None, by_frame=False, codes=lambda at: np.zeros((2, 1, 0), np.float32),
        scales=lambda at: (np.zeros((1, 1, WIDTH)), np.zeros((1, 1, WIDTH)), np.ones((1, 1, WIDTH))),
    )  # fmt: skip
    silence = np.zeros((1, 2), np.float32)
    decoder = OverlapAddDecoder(system, network, style, (0, 1), silence, sections(network.signature), **options)
    return np.concatenate([decoder.push(np.zeros((frames, 2), np.float32)), decoder.finish(silence)], 1)


def test_each_window_goes_on_from_the_poses_of_the_one_before():
    network = Counting("N")
    poses = play(network, 40)
    assert poses.shape == (2, 40, WIDTH)
    assert "seed" not in network.given[0]
    np.testing.assert_allclose(poses[0, :, 0], np.arange(40) + 1)  # without a gap where windows meet
    for k, ports in enumerate(network.given[1:], 1):
        seed, before = ports["seed"], 6 * k
        np.testing.assert_allclose(seed[:, :SEEDS, :-1], poses[:, before - SEEDS : before])
        assert seed[:, :SEEDS, -1].all()
        assert not seed[:, SEEDS:].any()


def test_poses_before_the_first_are_each_takes_own():
    network = Counting("N")
    before = np.repeat(np.arange(6, 10, dtype=np.float32)[:, None], WIDTH, 1)
    poses = play(network, 6, before=before)
    assert network.given[0]["seed"].shape == (2, WINDOW, WIDTH + 1)
    np.testing.assert_allclose(network.given[0]["seed"][:, :SEEDS, :-1], np.stack([before, before]))
    np.testing.assert_allclose(poses[0, :, 0], np.arange(10, 16))


def test_of_a_shared_port_only_the_first_window_has_known_poses():
    network = Counting(1)
    play(network, 40)
    assert not any("seed" in ports for ports in network.given)


def test_a_signature_says_whether_it_feeds_back():
    assert signature("N").feeds_back
    assert not signature(1).feeds_back
    signature().check("make")
    with pytest.raises(InputError, match="seed"):
        Signature({"rows": (1, "T", 2), "seed": (2, "T", 4)}, {"poses": ("N", "T", 3)}, window=12, hop=6, seeds=4).check("make")
