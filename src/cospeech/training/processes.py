"""Several processes that train one model: started by ``torchrun``, or by a caller who has set up `torch.distributed`."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple

import torch
from torch import Tensor
from torch import distributed as dist

from ..errors import InputError

__all__ = ["Team", "average", "join", "mean_values", "surroundings"]

BUCKET = 6_250_000  # numbers sent at once, 25 MB of float32: ours, as PyTorch's own data-parallel module has it


class Team(NamedTuple):
    """Which process this is, of how many, and where it computes."""

    rank: int
    size: int
    device: torch.device


def _device(name: str, local: int) -> torch.device:
    """A device by its name in a recipe."""
    if name == "auto":
        name = "cuda" if torch.cuda.is_available() else "cpu"
    try:
        device = torch.device(name)
        if device.type == "cuda" and device.index is None:
            device = torch.device("cuda", local)
        torch.empty(1, device=device)
    except (RuntimeError, AssertionError, NotImplementedError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(f"no device {name!r}: {reason}"[:200], "train.device: auto, cpu, cuda, cuda:1 …") from None
    if device.type == "cuda":
        torch.cuda.set_device(device)
    return device


@contextmanager
def join(device: str) -> Iterator[Team]:
    """Within it, this process has a place in the team; it is alone where no other was started.

    Raises:
        InputError: there is no such device.
    """
    place = _device(device, int(os.environ.get("LOCAL_RANK", "0")))
    if dist.is_available() and dist.is_initialized():  # by the caller, who also ends it
        yield Team(dist.get_rank(), dist.get_world_size(), place)
    elif int(os.environ.get("WORLD_SIZE", "1")) > 1:
        dist.init_process_group("nccl" if place.type == "cuda" else "gloo")
        try:
            yield Team(dist.get_rank(), dist.get_world_size(), place)
            dist.barrier()  # a process that ends while another still sends can be aborted by gloo's threads
        finally:
            dist.destroy_process_group()
    else:
        yield Team(0, 1, place)


def _buckets(tensors: Iterable[Tensor]) -> Iterator[list[Tensor]]:
    """Tensors of one type, in their order, until a bucket is full."""
    bucket: list[Tensor] = []
    for tensor in tensors:
        if bucket and (tensor.dtype != bucket[0].dtype or sum(t.numel() for t in bucket) + tensor.numel() > BUCKET):
            yield bucket
            bucket = []
        bucket.append(tensor)
    if bucket:
        yield bucket


@torch.no_grad()
def average(tensors: Iterable[Tensor], team: Team) -> None:
    """Put the mean over all processes in place of each tensor; all must hold tensors of the same shapes."""
    if team.size == 1:
        return
    for bucket in _buckets(tensors):
        flat = torch.cat([tensor.reshape(-1) for tensor in bucket])
        dist.all_reduce(flat)
        parts = (flat / team.size).split([tensor.numel() for tensor in bucket])
        for tensor, part in zip(bucket, parts, strict=True):
            tensor.copy_(part.view_as(tensor))


@torch.no_grad()
def mean_values(values: Sequence[Tensor | float], team: Team) -> list[float]:
    """Means of single numbers over all processes; each process gets them."""
    kind = torch.float32 if team.device.type == "mps" else torch.float64
    row = torch.stack([torch.as_tensor(value, device=team.device).detach().to(kind) for value in values])
    if team.size > 1:
        dist.all_reduce(row)
        row /= team.size
    means: list[float] = row.tolist()
    return means


@contextmanager
def surroundings(threads: int, device: torch.device) -> Iterator[None]:
    """Within it, PyTorch has ``threads`` threads on the CPU (0: as it likes); these and its random numbers are put back."""
    before = torch.get_num_threads()
    if threads:
        torch.set_num_threads(threads)
    try:
        with torch.random.fork_rng([device] if device.type == "cuda" else []):
            yield
    finally:
        torch.set_num_threads(before)
