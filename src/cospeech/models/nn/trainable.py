"""Declarations of a network for the training loop, for the maker of its batches, and for the maker of its bundle.

A network subclasses `Trainable` and says how it differs from the defaults. The least that it says is its ``Config`` and
`objectives`; a network of another package does the same (docs/add_a_model.md).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from torch import Tensor, nn

from ...errors import InputError
from .export import ExportGraph
from .objective import Batch, Objective
from .words import SubwordTable, WordEmbedding

__all__ = ["Trainable"]


class Trainable(nn.Module):
    """A network that a recipe trains; it is built as ``Network(config, pose=D, audio=A)``.

    A subclass sets ``self.config`` in its ``__init__``.
    """

    Config: ClassVar[Any]
    """The frozen dataclass of its settings: its fields are the keys of [model] in a recipe."""
    config: Any
    """An instance of ``Config``."""
    arrays: tuple[str, ...] = ("pose", "audio")
    """Arrays of a store that its batches hold; every batch has ``speaker`` (B,) besides."""
    optional_arrays: tuple[str, ...] = ()
    """Those of ``arrays`` that a clip may lack: floats are then NaN, labels −1, and there is no word."""
    dimensions: tuple[str, ...] = ("pose", "audio")
    """Keywords of ``__init__`` that come from the store, of `cospeech.training.dataset.DIMENSIONS`."""
    delay: int = 0
    """Frames that a pose comes after its speech."""
    controls: tuple[str, ...] = ()
    """Names of the style controls that it takes, of `cospeech.motion.poses.controls.CONTROLS`."""
    styles: int = 0
    """Numbers of a style: speakers' weights, or a code; 0: there is nothing to choose."""
    encodes_style: bool = False
    """Whether `style_of` gives the style of poses."""
    estimates_speaker: bool = False
    """Whether it estimates speaker and emotion from the speech."""
    smallest_batch: int = 1
    """Windows that a batch has at least, over all processes; 2 where a batch norm sees one vector a window."""
    wants_quantiles: bool = False
    """Whether `set_statistics` is given ``pose_quantiles`` (S, Q, D) as well: quantiles of each speaker's poses, 0 … 1."""
    literal: bool = False
    """Whether its numbers are used as they are; else its motion is brought to the speakers' mean poses and deviations."""
    smooth: int = 1
    """Frames to either side over which a bundle averages its poses (binomial weights); 0 where it learnt to be smooth."""

    @classmethod
    def arrays_for(cls, config: Any) -> tuple[str, ...]:
        """``arrays`` of a network with these settings."""
        return cls.arrays

    @classmethod
    def dimensions_for(cls, config: Any) -> tuple[str, ...]:
        """``dimensions`` of a network with these settings."""
        return cls.dimensions

    @classmethod
    def encoder_for(cls, config: Any) -> str | None:
        """Name or folder of the wav2vec 2.0 whose features a network with these settings hears; None: it hears none."""
        return None

    @property
    def preliminary_steps(self) -> int:
        """Steps of a first stage, which ``[train] steps`` does not count: all systems get equally many steps of the second."""
        return 0

    @property
    def window(self) -> int:
        """Frames of a training window: ``frames`` of the settings, and ``delay`` frames after them.

        Raises:
            InputError: there are no settings, or they have no ``frames``.
        """
        frames = getattr(getattr(self, "config", None), "frames", None)
        if frames is None:
            hint = "self.config = config in __init__, and a field frames in Config; or a property window"
            raise InputError(f"{type(self).__name__} does not say how long a training window is", hint)
        return int(frames) + self.delay

    @property
    def word_embedding(self) -> SubwordTable | WordEmbedding | None:
        """The part ``embedding``, which makes numbers of words; in ``rows`` they follow the speech. None: it reads no words."""
        part = self._modules.get("embedding")
        return part if isinstance(part, SubwordTable | WordEmbedding) else None

    def set_statistics(self, statistics: Mapping[str, Tensor]) -> None:
        """Take the statistics by which its inputs are standardised, before training begins; by default it does not use them.

        Args:
            statistics: ``pose_mean``, ``pose_std`` (D,), ``audio_mean``, ``audio_std`` (A,), and others that a run keeps.
        """

    def objectives(self) -> dict[str, Objective]:
        """Name → objective, in the order within a step.

        Raises:
            InputError: a subclass does not say, which is the default.
        """
        raise InputError(f"{type(self).__name__} does not say what is trained", "docs/add_a_model.md: objectives")

    def validate(self, batch: Batch) -> dict[str, Tensor]:
        """Figures of a validation batch, by name; by default none, and the loop measures the losses."""
        return {}

    def export_module(self) -> dict[str, ExportGraph]:
        """Graphs that play, by the names of `cospeech.runtime.bundles.signature.NETWORKS`; for ``cospeech bundle``.

        Raises:
            InputError: it makes no motion, which is the default.
        """
        raise InputError(f"{type(self).__name__} makes no motion: no bundle is possible", "docs/add_a_model.md: export_module")

    def label_styles(self) -> Mapping[str, Tensor]:
        """Styles that a bundle offers by name beside those of its speakers: name → (styles,); by default none."""
        return {}

    def style_of(self, poses: Tensor) -> Tensor:
        """The style of poses: (B, T, D) standardised, T ≥ 64, → (B, styles); by default zeros."""
        return poses.new_zeros(len(poses), self.styles)

    def speaker_styles(self, stretches: Tensor) -> Tensor:
        """The style of each speaker.

        Args:
            stretches: (S, n, T, D) standardised poses of each speaker, T ≥ 64.

        Returns:
            (S, styles); by default zeros.
        """
        return stretches.new_zeros(len(stretches), self.styles)
