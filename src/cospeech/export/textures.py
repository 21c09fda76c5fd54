"""Read the drawn properties of glTF materials: colour, texture, opacity; textures are decoded without trusting them."""

from __future__ import annotations

import base64
import binascii
import io
import warnings
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..errors import CospeechWarning, InputError
from ..limits import TEXTURE_PIXELS, TEXTURES_PIXELS
from ..motion.rotations import Array
from .gltf import GltfFile
from .surface import Texture

__all__ = ["Material", "MaterialReader"]

_LARGEST = 1024  # most pixels along a side; ours: a picture of 720 pixels shows no more of a whole figure
_WRAPS = {33071: "clamp", 33648: "mirror"}  # 3.8.4; anything else repeats


@dataclass(frozen=True, eq=False)
class Material:
    """The look of a surface.

    Args:
        name: of the material, for messages.
        colour: (4,) linear RGB and opacity, multiplied with the texture.
        roughness: 0 mirror … 1 chalk.
        cutoff: as `Surface` has it.
        double_sided: whether its back is drawn, too.
        texture: its texture; None for plain colour.
        texcoord: which set of texture coordinates it uses.
        transform: (2, 3) of texture coordinates.
    """

    name: str = ""
    colour: Array = field(default_factory=lambda: np.ones(4))
    roughness: float = 1.0
    cutoff: float | None = 0.0
    double_sided: bool = False
    texture: Texture | None = None
    texcoord: int = 0
    transform: Array = field(default_factory=lambda: np.eye(3)[:2])


class MaterialReader:
    """Reads the materials of one file; textures that several materials share are decoded once.

    Shading models (unlit, MToon) make no difference: all are drawn as diffuse surfaces of their colour.
    """

    def __init__(self, file: GltfFile) -> None:
        self._file, self._remaining = file, TEXTURES_PIXELS
        self._pixels: dict[int, Any] = {}

    def read(self, index: int | None) -> Material:
        """Read the material of that number; the default one (3.9.1) for None.

        Raises:
            InputError: the material or its texture is damaged or too large.
        """
        if index is None:
            return Material()
        entry = _item(self._file.json, "materials", index)
        surface = entry.get("pbrMetallicRoughness", {})
        colour = np.array(surface.get("baseColorFactor", (1, 1, 1, 1)), float).reshape(4)
        roughness = float(surface.get("roughnessFactor", 1.0))
        if not (np.isfinite(colour).all() and np.isfinite(roughness)):
            raise InputError(f"{self._file.name} is damaged: material {index} is not finite", "export it again")
        mode = entry.get("alphaMode", "OPAQUE")
        cutoff = {"MASK": float(entry.get("alphaCutoff", 0.5)), "BLEND": None}.get(mode, 0.0)
        texture = surface.get("baseColorTexture")
        extension = {} if texture is None else texture.get("extensions", {}).get("KHR_texture_transform", {})
        unlit = "KHR_materials_unlit" in entry.get("extensions", {})
        return Material(
            str(entry.get("name", index)), np.clip(colour, 0, 1), 1.0 if unlit else min(max(roughness, 0.2), 1.0), cutoff,
            bool(entry.get("doubleSided")),
            None if texture is None else self._texture(texture["index"]),
            0 if texture is None else int(extension.get("texCoord", texture.get("texCoord", 0))),
            _transform(extension),
        )  # fmt: skip

    def _texture(self, index: int) -> Texture | None:
        entry = _item(self._file.json, "textures", index)
        source = entry.get("source")
        if source is None:
            warnings.warn(
                f"{self._file.name}: texture {index} is no PNG or JPEG, its surface is drawn without it", CospeechWarning,
                stacklevel=2,
            )  # fmt: skip
            return None
        sampler = _item(self._file.json, "samplers", entry["sampler"]) if "sampler" in entry else {}
        wrap = [_WRAPS.get(sampler.get(key, 10497), "repeat") for key in ("wrapS", "wrapT")]
        if source not in self._pixels:
            self._pixels[source] = self._decode(source)
        return Texture(self._pixels[source], (wrap[0], wrap[1]))

    def _decode(self, index: int) -> Array:
        """Decode (H, W, 4) pixels of an image; it is scaled down where it is larger than `_LARGEST`."""
        from PIL import Image

        data = self._image_bytes(_item(self._file.json, "images", index), index)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # PIL's own limit is a warning; ours is stricter
                with Image.open(io.BytesIO(data), formats=("PNG", "JPEG")) as picture:
                    width, height = picture.size
                    self._remaining -= width * height
                    if width * height > TEXTURE_PIXELS or self._remaining < 0:
                        raise Image.DecompressionBombError
                    share = min(1.0, _LARGEST / max(width, height))
                    size = max(1, round(width * share)), max(1, round(height * share))
                    picture.draft("RGB", size)  # a JPEG can be decoded at a fraction of its size
                    return np.asarray(picture.convert("RGBA").resize(size, Image.Resampling.BOX))
        except Image.DecompressionBombError:
            raise InputError(f"{self._file.name}: texture {index} has too many pixels", "make its textures smaller") from None
        except Exception as error:  # Pillow raises OSError, SyntaxError, ValueError, struct.error, zlib.error …
            kind = type(error).__name__
            raise InputError(
                f"{self._file.name} is damaged: texture {index} is no PNG or JPEG ({kind})", "export it again"
            ) from None

    def _image_bytes(self, entry: dict[str, Any], index: int) -> bytes:
        if "bufferView" in entry:
            return self._file.view(entry["bufferView"])
        uri = str(entry.get("uri", ""))
        if not (uri.startswith("data:image/") and ";base64," in uri[:100]):
            raise InputError(f"{self._file.name} keeps texture {index} in {uri[:60]!r}", "export it as one .glb file")
        try:
            return base64.b64decode(uri.split(";base64,", 1)[1], validate=True)
        except binascii.Error:
            raise InputError(f"{self._file.name} is damaged: texture {index} is not base64", "export it again") from None


def _transform(extension: dict[str, Any]) -> Array:
    """(2, 3) of KHR_texture_transform: scale, then rotation, then offset."""
    offset = np.array(extension.get("offset", (0, 0)), float).reshape(2)
    scale = np.array(extension.get("scale", (1, 1)), float).reshape(2)
    angle = float(extension.get("rotation", 0.0))
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    matrix = np.concatenate([turn * scale, offset[:, None]], 1)
    return matrix if np.isfinite(matrix).all() else np.eye(3)[:2]


def _item(document: dict[str, Any], key: str, index: object) -> dict[str, Any]:
    """An entry of a list of the document; negative or missing ones are damage."""
    if not isinstance(index, int) or isinstance(index, bool) or index < 0:
        raise ValueError(f"{index!r} is no index of {key}")
    entry: dict[str, Any] = document[key][index]
    return entry
