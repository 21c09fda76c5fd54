"""Which derived speakers each clip of a corpus is to have, and the mean poses that they need: a first pass over the corpus."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial

from ...errors import InputError, nearest
from ..clip import Clip, Dropped
from ..derived_speakers import DERIVATIONS, MeanPose, derive_clip, mean_poses
from .pieces import split_of

__all__ = ["Change", "plan_derivations"]

Change = Callable[[Clip], Clip]


def plan_derivations(
    derived_speakers: Sequence[str], read: Callable[[], Iterator[Clip | Dropped]], mirror: bool
) -> Callable[[Clip], list[Change]]:
    """A function from a clip to the changes that make its derived speakers.

    Args:
        derived_speakers: names of `DERIVATIONS`, of every speaker, or ``"speaker|name"``. Without any, nothing is read.
        read: begins to read the corpus.
        mirror: whether training clips are mirrored as well: their speakers are called as derived speakers would be.

    Raises:
        InputError: no such derived speaker or speaker, or both kinds of mirror.
    """
    requests = [
        (speaker, name) for speaker, _, name in (derivation.rpartition("|") for derivation in dict.fromkeys(derived_speakers))
    ]
    for _, name in requests:
        if name not in DERIVATIONS:
            raise InputError(f"no derived speaker is called {name!r}", nearest(name, DERIVATIONS))
    if mirror and any(name == "mirror" for _, name in requests):
        raise InputError("mirror as derived speaker and as augmentation: the same speakers twice", "choose one of them")
    means = mean_poses((clip, split_of(clip) == "train") for clip in read() if isinstance(clip, Clip)) if requests else {}
    for speaker, _ in requests:
        if speaker and speaker not in means:
            raise InputError(f"no speaker of the corpus is called {speaker!r}", nearest(speaker, means))

    def makers(clip: Clip) -> list[Change]:
        names = dict.fromkeys(name for speaker, name in requests if speaker in ("", clip.speaker))
        return [partial(derive_clip, derivation=name, mean=means.get(clip.speaker, MeanPose({}))) for name in names]

    return makers
