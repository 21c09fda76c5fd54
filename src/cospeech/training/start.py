"""The parameters that a run begins with, where they are those of another run, or of a bundle of the stylised flow."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import torch
from torch import Tensor

from ..errors import InputError
from ..models import BUNDLE, SHIPPED
from ..models.nn.trainable import Trainable
from ..models.stylised_flow import StylisedFlow
from ..runtime.bundles.bundle import read_bundle
from ..runtime.bundles.spec import WEIGHTS, read_spec
from .checkpoint import load_run
from .flow_weights import calibrate_norms, unpack_flow

__all__ = ["start_from"]


@torch.no_grad()
def start_from(model: Trainable, source: str, batch: Mapping[str, Tensor]) -> str:
    """Give a network the parameters that have the same name and the same shape elsewhere.

    Args:
        model: on any device; parameters that are not there keep their values.
        source: folder of a run; or a bundle of the stylised flow, as a file or by the name of one that ships.
        batch: this process's windows of a batch, for what a bundle does not say.

    Returns:
        What was taken, in words.

    Raises:
        InputError: there is no such run or bundle, or none of its parameters fits.
    """
    own_bundle = SHIPPED / f"{source}{BUNDLE}"
    path = own_bundle if own_bundle.exists() else Path(source)
    arrays = load_run(path)[0].state_dict() if path.is_dir() else _open_bundle(path)
    own = {name: value for name, value in model.state_dict().items() if not name.endswith("num_batches_tracked")}
    fits = {name: value for name, value in arrays.items() if name in own and own[name].shape == value.shape}
    if not any(value.dim() for value in fits.values()):
        raise InputError(f"no parameter of {source!r} fits {type(model).__name__}", "a network of the same sizes fits")
    model.load_state_dict(fits, strict=False)
    if isinstance(model, StylisedFlow) and model.encoder is not None and not path.is_dir():
        model.eval()
        calibrate_norms(model.encoder, lambda: model.log_prob(batch["pose"], batch["audio"]))
    new = sorted({name.partition(".")[0] for name in own.keys() - fits.keys()})
    return f"{len(fits)} of {len(own)} arrays are those of {source!r}" + (f"; new: {', '.join(new)}" if new else "")


def _open_bundle(path: Path) -> dict[str, Tensor]:
    spec = read_spec(bundle := read_bundle(path))
    if spec.flow is None or spec.flow.cell != "gru":
        raise InputError(f"{str(path)!r} is no bundle of the stylised flow", "train.start also takes the folder of a run")
    return unpack_flow(bundle.arrays(WEIGHTS), spec.flow)
