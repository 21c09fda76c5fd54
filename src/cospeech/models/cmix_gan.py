"""CMix-GAN: Mix-StAGE without style, a network for one speaker (Ahuja et al. 2020, section 5.1).

"We remove the style embedding module and style consistency losses": Z is the U-Net's content alone, there is no Eˢₚ, no S and
no L_id. Sub-generators, priors and all other losses are those of `cospeech.models.mix_stage`.
"""

from __future__ import annotations

from ..errors import InputError
from .mix_stage import MixGan, MixGanConfig
from .nn.style import NoStyle

__all__ = ["CMixGan"]


class CMixGan(MixGan):
    """CMix-GAN (Ahuja et al. 2020): one motion for one speech, of one speaker.

    Args:
        config: sizes and weights.
        pose: D, numbers of a pose.
        audio: A, numbers of a frame of speech.
        speakers: 1.

    Raises:
        InputError: more speakers.
    """

    Config = MixGanConfig

    def __init__(self, config: MixGanConfig, *, pose: int, audio: int, speakers: int) -> None:
        if speakers != 1:
            raise InputError(f"a CMix-GAN of {speakers} speakers: it is of one", 'choose one in [data]: speakers = ["NAME"]')
        super().__init__(config, pose=pose, audio=audio, style=NoStyle())
