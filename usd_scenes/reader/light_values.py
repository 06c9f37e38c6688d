"""What lights of all kinds have: how bright they are, how large, where they point and how they are shaped."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade

from fgf_warp.errors import SceneError
from fgf_warp.scene import BLACK, Rgb, Shaping, Vec3
from usd_scenes.reader.attributes import (
    NOT_NEGATIVE,
    POSITIVE,
    UNIT,
    Range,
    is_authored,
    read_mended,
    read_mended_color,
    read_mended_flag,
)
from usd_scenes.reader.context import StageContext

HARMLESS: dict[str, object] = {
    "inputs:diffuse": 1.0,
    "inputs:specular": 1.0,
    "inputs:shadow:color": Gf.Vec3f(0.0),
    "inputs:shadow:distance": -1.0,
    "inputs:shadow:falloff": -1.0,
    "inputs:shaping:ies:file": None,
}
"""Attributes of lights that are not rendered, and the values at which that needs no warning."""
HINTS = ("treatAsLine", "treatAsPoint")
"""That a light may be rendered as if it had no radius."""
RELATIONSHIPS_NOT_READ = ("light:filters", "portals")
LIGHTS_WITHOUT_A_PLACE = ("DistantLight", "DomeLight", "DomeLight_1")
EXPOSURE = Range("[-127, 127]", -127.0, 127.0, is_cut=False)
"""2^127 is the largest power of two in float32; a light of that exposure would outshine all numbers."""
KELVIN = Range("[1000, 10000] K", 1000.0, 10000.0)
"""Where USD knows the colors of black bodies."""
CONE = Range("[0, 180] degrees", 0.0, 180.0)
SMALL = 1e-4
"""Size of a light that has none, as a share of how far the stage reaches from it."""


def emission(prim: Usd.Prim, context: StageContext) -> Rgb:
    """Radiance per channel before `normalize`.

    Returns:
        Three numbers >= 0 of linear Rec.709 [radiance]: intensity times 2^exposure, times color and the color of the
        temperature.
    """
    intensity = number(prim, "inputs:intensity", NOT_NEGATIVE, context)
    exposure = number(prim, "inputs:exposure", EXPOSURE, context)
    color = read_mended_color(prim.GetAttribute("inputs:color"), context, NOT_NEGATIVE, (1.0, 1.0, 1.0))
    if read_mended_flag(prim.GetAttribute("inputs:enableColorTemperature"), context):
        white = UsdLux.BlackbodyTemperatureAsRgb(number(prim, "inputs:colorTemperature", KELVIN, context))
        color = (color[0] * white[0], color[1] * white[1], color[2] * white[2])
    return scaled(color, intensity * 2.0**exposure)


def number(prim: Usd.Prim, name: str, within: Range, context: StageContext) -> float:
    """A number of a light; what is out of its range is mended, by the schema's fallback where nothing is nearer.

    Returns:
        Within the range, in the unit that UsdLux gives the attribute.
    """
    fallback = prim.GetPrimDefinition().GetAttributeFallbackValue(name)
    return read_mended(prim.GetAttribute(name), context, within, float(fallback))


def size(prim: Usd.Prim, name: str, context: StageContext) -> float:
    """A width, height, radius or length [unit of the prim's space].

    A size of 0 stands for a light whose power does not depend on it, such as a point: where the light is normalized, a
    size that is small beside the stage takes its place, so that its power stays.

    Returns:
        A length > 0.

    Raises:
        SceneError: for a size of 0 where the light is not normalized, and so has no power.
    """
    attribute = prim.GetAttribute(name)
    if attribute.Get(context.time) != 0:
        return number(prim, name, POSITIVE, context)
    if not read_mended_flag(prim.GetAttribute("inputs:normalize"), context):
        raise SceneError(
            f"{attribute.GetPath()} = 0, where the light has no area and so no power; accepted: > 0, or 0 with "
            "inputs:normalize = 1"
        )
    small = SMALL * _reach(prim, context)
    context.mend(f"= 0; accepted: > 0; {small:.3g} is used, and the light's power stays", attribute.GetPath())
    return small


def _reach(prim: Usd.Prim, context: StageContext) -> float:
    """How far the stage reaches from a light, in units of the light's own space."""
    bounds = UsdGeom.BBoxCache(context.time, [*context.purposes])
    box = bounds.ComputeWorldBound(context.stage.GetPseudoRoot()).ComputeAlignedRange()
    to_world = context.local_to_world(prim)
    scale = float(np.cbrt(abs(np.linalg.det(to_world[:3, :3])))) or 1.0
    corners = np.array([box.GetCorner(corner) for corner in range(8)]) - to_world[:3, 3]
    reach = float(np.linalg.norm(corners, axis=1).max()) if not box.IsEmpty() else 0.0
    return reach / scale if math.isfinite(reach) and reach > 0 else 1.0


def read_shaping(prim: Usd.Prim, context: StageContext, whole_angle: float) -> Shaping | None:
    """What ShapingAPI says; None where the light emits evenly.

    Args:
        prim: the light.
        context: the stage.
        whole_angle: that a light of this kind emits up to from its axis anyway [degree].

    Returns:
        Its axis in world space, its angle in radian.
    """
    if not prim.HasAPI(UsdLux.ShapingAPI):
        return None
    angle = number(prim, "inputs:shaping:cone:angle", CONE, context)
    softness = number(prim, "inputs:shaping:cone:softness", UNIT, context)
    focus = number(prim, "inputs:shaping:focus", NOT_NEGATIVE, context)
    tint = read_mended_color(prim.GetAttribute("inputs:shaping:focusTint"), context, NOT_NEGATIVE, BLACK)
    if focus == 0 and softness == 0 and angle >= whole_angle:
        return None
    return Shaping(
        axis=axis(prim, context),
        cone_angle=math.radians(angle),
        cone_softness=softness,
        focus=focus,
        focus_tint=tint,
    )


def axis(prim: Usd.Prim, context: StageContext) -> Vec3:
    """The direction of a light's local -z, of unit length.

    Returns:
        In world space, when the shutter opens.

    Raises:
        SceneError: for a transform that leaves none.
    """
    found = -context.local_to_world(prim)[:3, 2]
    if not found.any():
        raise SceneError(
            f"{prim.GetPath()}: the transform leaves the light no direction; accepted: a scale that is not 0"
        )
    return vec3(found / np.linalg.norm(found))


def note_not_read(prim: Usd.Prim, context: StageContext) -> None:
    """Tells what a light says that is not rendered."""
    for what in _ignored(prim, context.time):
        context.notes.add(f"{what} is not supported and is ignored", prim.GetPath())
    _note_unapplied(prim, context)
    if context.closing_to_world(prim) is not None:
        context.notes.add("a light that moves is rendered where it is when the shutter opens", prim.GetPath())


def note_hints(prim: Usd.Prim, context: StageContext) -> None:
    """Tells that a light that gives light does so from all of its surface, unless its radius is 0, as it is to be."""
    for name in HINTS:
        hint, radius = prim.GetAttribute(name), prim.GetAttribute("inputs:radius")
        if is_authored(hint) and hint.Get(context.time) and radius and radius.Get(context.time) != 0:
            context.notes.add(f"{name} is a hint that is not followed: the light has its radius", prim.GetPath())


def _ignored(prim: Usd.Prim, time: Usd.TimeCode) -> Iterator[str]:
    for name, harmless in HARMLESS.items():
        attribute = prim.GetAttribute(name)
        if is_authored(attribute) and _plain(attribute.Get(time)) != harmless:
            yield f"{name} of lights"
    if prim.GetTypeName() in LIGHTS_WITHOUT_A_PLACE and _shapes(prim, time):
        yield f"ShapingAPI of a {prim.GetTypeName()}"
    for name in RELATIONSHIPS_NOT_READ:
        relationship = prim.GetRelationship(name)
        if relationship and relationship.GetTargets():
            yield f"{name} of lights"
    for light_input in UsdShade.ConnectableAPI(prim).GetInputs():
        if light_input.GetAttr().HasAuthoredConnections():
            yield f"connection of {light_input.GetFullName()} of lights"


def _plain(value: object) -> object:
    """The value, or None of the path of nothing."""
    return None if isinstance(value, Sdf.AssetPath) and not value.path else value


def _shapes(prim: Usd.Prim, time: Usd.TimeCode) -> bool:
    """True where ShapingAPI is applied and would leave a light of which it says nothing else another."""
    if not prim.HasAPI(UsdLux.ShapingAPI):
        return False
    api = UsdLux.ShapingAPI(prim)
    angle = api.GetShapingConeAngleAttr()
    has_cone = is_authored(angle) and _differs(angle.Get(time), lambda degrees: degrees >= 90)
    others = (api.GetShapingConeSoftnessAttr(), api.GetShapingFocusAttr())
    return has_cone or any(_differs(attribute.Get(time), lambda number: number == 0) for attribute in others)


def _differs(value: object, is_harmless: Callable[[float], bool]) -> bool:
    return not (isinstance(value, int | float) and is_harmless(value))


def _note_unapplied(prim: Usd.Prim, context: StageContext) -> None:
    registry = Usd.SchemaRegistry()
    for api in (UsdLux.ShadowAPI, UsdLux.ShapingAPI):
        if prim.HasAPI(api):
            continue
        schema = registry.FindAppliedAPIPrimDefinition(api.__name__)
        for name in schema.GetPropertyNames():
            attribute = prim.GetAttribute(name)
            value = _plain(attribute.Get(context.time)) if is_authored(attribute) else None
            if value is not None and value != schema.GetAttributeFallbackValue(name):
                text = f"is of no effect on a light to which {api.__name__} is not applied"
                context.notes.add(text, attribute.GetPath())


def scaled(color: Rgb, factor: float) -> Rgb:
    """The color times a factor."""
    return (color[0] * factor, color[1] * factor, color[2] * factor)


def vec3(values: np.ndarray) -> Vec3:
    """Three numbers as plain floats.

    Args:
        values: (3,) of any type.
    """
    return (float(values[0]), float(values[1]), float(values[2]))
