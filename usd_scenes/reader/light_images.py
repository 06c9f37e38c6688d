"""Pictures that the radiance of lights is multiplied by."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from pxr import Sdf, Usd

from fgf_warp.scene import Image
from usd_scenes.reader.context import StageContext
from usd_scenes.reader.textures import read_image

PLAIN = "the light has no picture: it is plain, of its own color and intensity"


def read_light_image(prim: Usd.Prim, context: StageContext) -> Image | None:
    """The picture of a light, without light below 0; None where it names none, or, with a warning, none that is one.

    Returns:
        Pixels (height, width, 4), >= 0.

    Raises:
        SceneError: in place of a warning, where the stage is read strictly.
    """
    attribute = prim.GetAttribute("inputs:texture:file")
    asset = attribute.Get(context.time)
    if asset is None or (isinstance(asset, Sdf.AssetPath) and not asset.path):
        return None
    file = read_image(attribute, context, "auto", PLAIN)
    if file is None:
        return None
    pixels = file.image.pixels
    is_dark = (pixels[..., :3] < 0).any(axis=-1) if pixels.dtype == np.float32 else np.zeros(0, dtype=bool)
    if not is_dark.any():
        return file.image
    text = f"{asset.path}: {int(is_dark.sum())} of {is_dark.size} pixels are below 0; 0 is used for what is"
    context.mend(text, attribute.GetPath())
    lit = pixels.copy()
    np.maximum(lit[..., :3], 0, out=lit[..., :3])
    return replace(file.image, pixels=lit)
