"""UsdRender: the images that a stage asks for, each with its size, its camera and its planes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdRender

from fgf_warp.errors import SceneError
from fgf_warp.scene import CONFORM_POLICIES, ConformPolicy
from usd_scenes.reader.attributes import (
    POSITIVE,
    is_authored,
    read_array,
    read_mended,
    read_mended_flag,
    read_mended_token,
    read_words,
)
from usd_scenes.reader.context import StageContext

PURPOSES = ("default", "render", "proxy", "guide")
RESOLUTION_MAX = 65536
WHOLE_WINDOW = (0.0, 0.0, 1.0, 1.0)
LINEAR_SPACES = ("lin_rec709", "lin_rec709_scene")
"""Names of the color space that images are rendered in."""
FULL_BINDING = ("full", "")
"""Purposes of the materials that are rendered."""
NAMED_BY = {UsdRender.Product: (UsdRender.Settings, "products"), UsdRender.Var: (UsdRender.Product, "orderedVars")}
"""What is rendered only where a relationship of such a prim names it."""
READ_SOURCE_TYPES = ("raw", "intrinsic")


@dataclass(frozen=True)
class Product:
    """An image that a stage asks for: a RenderProduct, or RenderSettings that have none.

    Args:
        path: of the prim; empty where the stage has no RenderSettings.
        file: where the image is to be written, as its productName says; empty where it does not.
        camera: prim path, or None.
        resolution: width and height [pixel], or None.
        pixel_aspect_ratio: width of a pixel over its height, > 0.
        conform_policy: what gives way where the image's aspect ratio is not the film's.
        has_motion_blur: False where the shutter is to open at the frame alone.
        has_depth_of_field: False where the camera is to be a pinhole.
        sources: what its planes hold, the sourceName of each RenderVar; None where it names none.
    """

    path: str = ""
    file: str = ""
    camera: str | None = None
    resolution: tuple[int, int] | None = None
    pixel_aspect_ratio: float = 1.0
    conform_policy: ConformPolicy = "expandAperture"
    has_motion_blur: bool = True
    has_depth_of_field: bool = True
    sources: tuple[str, ...] | None = None


@dataclass(frozen=True)
class StageSettings:
    """What the stage's render settings say.

    Args:
        products: the images, at least one.
        purposes: of the geometry to include; None where they do not say.
    """

    products: tuple[Product, ...] = (Product(),)
    purposes: tuple[str, ...] | None = None

    def product(self, path: str | None) -> Product:
        """The product of that prim; None takes the first.

        Raises:
            SceneError: where there is none of that path; it lists those there are.
        """
        found = [product for product in self.products if path in (None, product.path)]
        if not found:
            there_are = ", ".join(product.path for product in self.products)
            raise SceneError(f"render product {path!r} is not there; accepted: {there_are}")
        return found[0]


def read_settings(context: StageContext, asked: str | None = None) -> StageSettings:
    """What the RenderSettings of a stage say; where they say nothing, neither does the result.

    Args:
        context: the stage.
        asked: prim path of the settings; None takes those that the stage's metadata name, else the first, with a
            warning where there are several.

    Returns:
        At least one product; resolutions in pixels.

    Raises:
        SceneError: for settings that are asked for and not there, or for what is mended, where it is read strictly.
    """
    prims = [prim for prim in context.stage.Traverse() if prim.GetTypeName().startswith("Render")]
    by_type = {kind: [prim for prim in prims if prim.IsA(kind)] for kind in (*NAMED_BY, UsdRender.Settings)}
    _note_unnamed(by_type, context)
    settings = _find_settings(by_type[UsdRender.Settings], context, asked)
    if settings is None:
        return StageSettings()
    _note_what_is_not_read(settings, context)
    products = [prim for path in _targets(settings, "products") if (prim := _product_prim(settings, path, context))]
    return StageSettings(
        products=tuple(_read_product(prim, settings, context) for prim in products or [settings]),
        purposes=_read_purposes(settings, context),
    )


def _note_unnamed(by_type: Mapping[type, Sequence[Usd.Prim]], context: StageContext) -> None:
    """Tells of products and render vars that are in the stage and that nothing asks for."""
    for kind, (of, name) in NAMED_BY.items():
        named = {path for prim in by_type[of] for path in _targets(prim, name)}
        for prim in by_type[kind]:
            if prim.GetPath() not in named:
                text = f"a Render{kind.__name__} that no Render{of.__name__} names in its {name} is left out"
                context.notes.add(text, prim.GetPath())


def _find_settings(there_are: Sequence[Usd.Prim], context: StageContext, asked: str | None) -> Usd.Prim | None:
    stage = context.stage
    if asked is not None:
        found = [prim for prim in there_are if str(prim.GetPath()) == asked]
        if not found:
            names = ", ".join(str(prim.GetPath()) for prim in there_are) or "none"
            raise SceneError(f"render settings {asked!r} are not in the stage; it has: {names}")
        return found[0]
    named = UsdRender.Settings.GetStageRenderSettings(stage)
    if named:
        return named.GetPrim()
    if stage.HasAuthoredMetadata("renderSettingsPrimPath"):
        path = stage.GetMetadata("renderSettingsPrimPath")
        context.mend("the stage's renderSettingsPrimPath is the path of no RenderSettings", path)
    if len(there_are) > 1:
        context.notes.add("several RenderSettings and none chosen: the first are used", there_are[0].GetPath())
    return there_are[0] if there_are else None


def _product_prim(settings: Usd.Prim, path: Sdf.Path, context: StageContext) -> Usd.Prim | None:
    prim = settings.GetStage().GetPrimAtPath(path)
    if not prim or not prim.IsA(UsdRender.Product):
        text = f"= {path}; accepted: the paths of RenderProducts; it is left out"
        context.mend(text, f"{settings.GetPath()}.products")
        return None
    product_type = prim.GetAttribute("productType").Get(context.time)
    if product_type != "raster":
        context.notes.add(f"a product of type {product_type} is not supported and is left out", prim.GetPath())
        return None
    return prim


def _read_product(prim: Usd.Prim, settings: Usd.Prim, context: StageContext) -> Product:
    """A product with what it takes from its settings; `prim` may be the settings themselves."""
    time = context.time

    def attribute(name: str) -> Usd.Attribute:
        own = prim.GetAttribute(name)
        return own if is_authored(own) else settings.GetAttribute(name)

    with context.leaving_out(prim.GetPath(), "the whole image is rendered"):
        if tuple(_numbers(attribute("dataWindowNDC"), time, 4)) != WHOLE_WINDOW:
            context.notes.add("dataWindowNDC is not supported: the whole image is rendered", prim.GetPath())
    still = [read_mended_flag(attribute(name), context) for name in ("disableMotionBlur", "instantaneousShutter")]
    policy = read_mended_token(attribute("aspectRatioConformPolicy"), context, CONFORM_POLICIES, "expandAperture")
    name = prim.GetAttribute("productName")
    return Product(
        path=str(prim.GetPath()),
        file=str(name.Get(time) or "") if name else "",
        camera=_camera_path(prim, context) or (_camera_path(settings, context) if prim != settings else None),
        resolution=_resolution(attribute("resolution"), context),
        pixel_aspect_ratio=read_mended(attribute("pixelAspectRatio"), context, POSITIVE, 1.0),
        conform_policy=next((known for known in CONFORM_POLICIES if known == policy), "expandAperture"),
        has_motion_blur=not any(still),
        has_depth_of_field=not read_mended_flag(attribute("disableDepthOfField"), context),
        sources=_sources(prim, context),
    )


def _sources(prim: Usd.Prim, context: StageContext) -> tuple[str, ...] | None:
    targets = _targets(prim, "orderedVars")
    if not targets:
        return None
    sources = []
    for path in targets:
        var = prim.GetStage().GetPrimAtPath(path)
        if not var or not var.IsA(UsdRender.Var):
            text = f"= {path}; accepted: the paths of RenderVars; it is left out"
            context.mend(text, f"{prim.GetPath()}.orderedVars")
            continue
        kind = var.GetAttribute("sourceType").Get(context.time)
        name = var.GetAttribute("sourceName").Get(context.time)
        if kind not in READ_SOURCE_TYPES:
            context.notes.add(f"a render var of sourceType {kind} is not supported and is left out", path)
        elif not name:
            context.notes.add("a render var without sourceName is left out", path)
        else:
            sources.append(name)
    return tuple(sources)


def _read_purposes(settings: Usd.Prim, context: StageContext) -> tuple[str, ...] | None:
    attribute = settings.GetAttribute("includedPurposes")
    if not is_authored(attribute):
        return None
    asked = read_words(attribute, context, context.time)
    known = tuple(purpose for purpose in map(str.lower, asked) if purpose in PURPOSES)
    if unknown := [purpose for purpose in asked if purpose not in PURPOSES]:
        # Without any purpose nothing would be seen.
        used = f"{', '.join(known)} is used" if known else "it is left out"
        context.mend(f"holds {', '.join(unknown)}; accepted: {', '.join(PURPOSES)}; {used}", attribute.GetPath())
        return known or None
    return known


def _resolution(attribute: Usd.Attribute, context: StageContext) -> tuple[int, int] | None:
    if not is_authored(attribute):
        return None
    with context.leaving_out(attribute.GetPath(), "it is left out"):
        width, height = _numbers(attribute, context.time, 2, np.int64)
        if not (1 <= width <= RESOLUTION_MAX and 1 <= height <= RESOLUTION_MAX):
            raise SceneError(
                f"{attribute.GetPath()} = ({width}, {height}); accepted: two integers in [1, {RESOLUTION_MAX}]"
            )
        return int(width), int(height)
    return None


def _camera_path(prim: Usd.Prim, context: StageContext) -> str | None:
    targets = _targets(prim, "camera")
    if not targets:
        return None
    if not UsdGeom.Camera.Get(prim.GetStage(), targets[0]):
        context.mend(f"= {targets[0]}; accepted: the path of a Camera; it is left out", f"{prim.GetPath()}.camera")
        return None
    return str(targets[0])


def _targets(prim: Usd.Prim, name: str) -> list[Sdf.Path]:
    relationship = prim.GetRelationship(name)
    return list(relationship.GetForwardedTargets()) if relationship else []


def _numbers(attribute: Usd.Attribute, time: Usd.TimeCode, count: int, dtype: type = np.float64) -> np.ndarray:
    numbers = read_array(attribute, time, dtype)
    if len(numbers) != count:
        raise SceneError(f"{attribute.GetPath()} holds {len(numbers)} numbers; accepted: {count}")
    return numbers


def _note_what_is_not_read(settings: Usd.Prim, context: StageContext) -> None:
    purposes = settings.GetAttribute("materialBindingPurposes")
    asked = tuple("" if purpose == "allPurpose" else purpose for purpose in read_words(purposes, context, context.time))
    if asked not in (FULL_BINDING, FULL_BINDING[:1]) and (asked != ("",) or _has_full_binding(context.stage)):
        context.notes.add("materials are those bound for the purpose full, whatever it says", purposes.GetPath())
    space = settings.GetAttribute("renderingColorSpace")
    if space.Get(context.time) not in (None, "", *LINEAR_SPACES):
        context.notes.add("images are rendered in linear Rec.709, whatever it says", space.GetPath())


def _has_full_binding(stage: Usd.Stage) -> bool:
    """True where a material is bound for the purpose full alone."""
    names = (name for prim in stage.TraverseAll() for name in prim.GetAuthoredPropertyNames())
    return any(name.startswith("material:binding") and "full" in name.split(":") for name in names)
