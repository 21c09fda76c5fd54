"""New parameters that depend only on the seed and on the name of their module: leaving a module out changes no other one.

So two systems of an ablation begin with the same values of all parameters that both have, and their results can be paired.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar
from zlib import crc32

import torch
from torch import nn

__all__ = ["initialise_by_name"]

Net = TypeVar("Net", bound=nn.Module)


def initialise_by_name(make: Callable[[], Net], seed: int) -> Net:
    """A network whose modules draw from generators of their own.

    The network is made twice. The first time gives the names of the modules in the order in which they are made. The second
    time each module begins with the generator of its name. After its last child a module draws from that child's generator.

    Args:
        make: makes the network; twice the same.
        seed: of the run.
    """
    modules: list[nn.Module] = []
    with _watch_modules(modules.append):
        first = make()
    names = {id(module): name for name, module in first.named_modules()}
    order = iter([names.get(id(module), f"{type(module).__name__} of no name") for module in modules])

    def draw_anew(module: nn.Module) -> None:
        name = next(order, "")
        torch.default_generator.manual_seed((seed * 1_000_003 + crc32(name.encode())) % 2**63)  # quicker than of all devices

    with _watch_modules(draw_anew):
        return make()


@contextmanager
def _watch_modules(tell: Callable[[nn.Module], None]) -> Iterator[None]:
    """Call ``tell`` with each module when its construction begins."""
    begin = nn.Module.__init__

    def announce(self: nn.Module, *args: Any, **keywords: Any) -> None:
        begin(self, *args, **keywords)
        tell(self)

    nn.Module.__init__ = announce  # type: ignore[method-assign]
    try:
        yield
    finally:
        nn.Module.__init__ = begin  # type: ignore[method-assign]
