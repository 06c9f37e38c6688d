"""Attributes that name files of pictures: which files they mean, and what is in them."""

from __future__ import annotations

from pxr import Sdf, Usd, UsdShade

from fgf_warp.errors import SceneError
from usd_scenes.reader.context import StageContext
from usd_scenes.reader.images import ColorSpace, ImageFile

FIRST_TILE = 1001
TILES_ACROSS = 10
"""Tile 1001 + u + 10 v of a UDIM set fills the unit square at (u, v)."""


def read_image(attribute: Usd.Attribute, context: StageContext, color_space: ColorSpace, done: str) -> ImageFile | None:
    """The picture that an attribute names; None, with a warning, where there is none or it is damaged.

    Args:
        attribute: of an asset path.
        context: the stage.
        color_space: that the file's colors are in.
        done: what is done without a picture, for the warning.

    Returns:
        Pixels (height, width, 4), see `ImageFiles.read`.

    Raises:
        SceneError: in place of the warning, where the stage is read strictly.
    """
    asset = attribute.Get(context.time)
    if not isinstance(asset, Sdf.AssetPath) or not asset.path:
        context.mend(f"names no picture; {done}", attribute.GetPath())
        return None
    return _read_file(asset.resolvedPath, asset.path, attribute, context, color_space, done)


def read_tiles(
    attribute: Usd.Attribute, context: StageContext, color_space: ColorSpace, done: str
) -> dict[tuple[int, int], ImageFile]:
    """The tiles of a UDIM set by their unit squares (u, v); without those that there is no picture of.

    Args:
        attribute: of an asset path that holds ``<UDIM>``, see `is_udim`.
        context: the stage.
        color_space: that the files' colors are in.
        done: what is done without any of them, for the warning.

    Returns:
        Pictures by (u, v), each coordinate an integer >= 0: 1001 is (0, 0), 1012 is (1, 1).

    Raises:
        SceneError: in place of a warning, where the stage is read strictly.
    """
    path = attribute.Get(context.time).path
    layer = _layer_of_value(attribute, context.time)
    tiles = UsdShade.UdimUtils.ResolveUdimTilePaths(path, layer) if layer else []
    if not tiles:
        context.mend(f"{path}: there are no such files; {done}", attribute.GetPath())
    files = {}
    for resolved, tile in tiles:
        file = _read_file(resolved, resolved, attribute, context, color_space, "this tile is left out")
        if file:
            v, u = divmod(int(tile) - FIRST_TILE, TILES_ACROSS)
            files[u, v] = file
    return files


def is_udim(attribute: Usd.Attribute, time: Usd.TimeCode) -> bool:
    """True where the attribute names the tiles of a UDIM set."""
    asset = attribute.Get(time)
    return isinstance(asset, Sdf.AssetPath) and UsdShade.UdimUtils.IsUdimIdentifier(asset.path)


def _read_file(
    resolved: str,
    shown: str,
    attribute: Usd.Attribute,
    context: StageContext,
    color_space: ColorSpace,
    done: str,
) -> ImageFile | None:
    try:
        file = context.images.read(resolved, color_space)
    except SceneError as error:
        context.mend(f"{shown}: {error}; {done}", attribute.GetPath())
        return None
    for text in file.mended:
        context.mend(f"{shown}: {text}", attribute.GetPath())
    for text in file.told:
        context.notes.add(f"{shown}: {text}", attribute.GetPath())
    return file


def _layer_of_value(attribute: Usd.Attribute, time: Usd.TimeCode) -> Sdf.Layer | None:
    """Where the value was written, which relative paths start from."""
    written = (
        spec for spec in attribute.GetPropertyStack(time) if spec.HasDefaultValue() or spec.HasInfo("timeSamples")
    )
    return next((spec.layer for spec in written), None)
