"""What a prim says and nobody reads: names that are misspelt or of an older schema, and attributes not rendered.

What has a namespace of its own, such as ``userProperties:`` or that of another renderer, is not for this one, and no
warning is due.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field

from pxr import Gf, Sdf, Sdr, Tf, Usd, UsdGeom, UsdLux, UsdShade

from usd_scenes.reader.attributes import is_authored, read_words
from usd_scenes.reader.context import StageContext

GEOMETRY = (
    "accelerations angularVelocities axis bottomRadius cornerIndices cornerSharpnesses creaseIndices creaseLengths "
    "creaseSharpnesses elementType faceVaryingLinearInterpolation faceVertexCounts faceVertexIndices familyName height "
    "holeIndices ids indices interpolateBoundary invisibleIds length normals orientation orientations orientationsf "
    "points positions primvars:displayColor primvars:displayOpacity protoIndices prototypes radius radiusBottom "
    "radiusTop scales size subdivisionScheme topRadius triangleSubdivisionRule velocities width"
)
CAMERA = (
    "clippingPlanes clippingRange exposure exposure:fStop exposure:iso exposure:responsivity exposure:time fStop "
    "focalLength focusDistance horizontalAperture horizontalApertureOffset projection shutter:close shutter:open "
    "verticalAperture verticalApertureOffset"
)
RENDER = (
    "aspectRatioConformPolicy camera dataWindowNDC disableDepthOfField disableMotionBlur includedPurposes "
    "instantaneousShutter materialBindingPurposes orderedVars pixelAspectRatio productName productType products "
    "renderingColorSpace resolution sourceName sourceType"
)
LIGHT = "geometry poleAxis portals treatAsLine treatAsPoint"
ANYWHERE = "info:id info:implementationSource purpose visibility xformOpOrder"
HARMLESS = (
    "dataType doubleSided extent guideRadius light:shaderId model:applyDrawMode model:cardGeometry "
    "model:cardTextureXNeg model:cardTextureXPos model:cardTextureYNeg model:cardTextureYPos model:cardTextureZNeg "
    "model:cardTextureZPos model:cardVisibility model:drawModeColor lightList lightList:cacheBehavior "
    "motion:nonlinearSampleCount proxyPrim stereoRole"
)
"""Hints to viewers and caches, what README says of all surfaces, and what means nothing without something else."""
READ = frozenset(f"{GEOMETRY} {CAMERA} {RENDER} {LIGHT} {ANYWHERE} {HARMLESS}".split())
"""Attributes that are read, or that have warnings of their own; those in further namespaces are beside them."""
NAMESPACES = ("", "exposure", "model", "motion", "primvars", "shutter")
"""Of the attributes of USD's schemas that a renderer is to read."""
TYPES = (
    "Camera Capsule Capsule_1 Cone Cube Cylinder Cylinder_1 GeomSubset Mesh Plane PointInstancer RenderProduct "
    "RenderSettings RenderVar Scope SkelRoot Sphere Xform"
)
READ_TYPES = frozenset(TYPES.split())
"""Beside those of lights, materials and shaders; of others it is told that they are left out."""
SHADER_KINDS = ("UsdPreviewSurface", "UsdUVTexture", "UsdTransform2d", "UsdPrimvarReader_")
FOREIGN = ("xformop", "userproperties", "collection", "fgf", "outputs")
PRIMVARS = "primvars:"
INPUTS = "inputs:"
OWN_INPUT = re.compile(r"inputs:(texture:)?[^:]+")
"""An input of USD's own lights and shaders."""
LIGHT_APIS = ("ShapingAPI", "ShadowAPI")
BINDING = "material:binding"
DISPLAY = ("primvars:displayColor", "primvars:displayOpacity")
OPS, OP_ORDER, INVERSE = "xformOp:", "xformOpOrder", "!invert!"
KNOWN_OPS = tuple(
    OPS + UsdGeom.XformOp.GetOpTypeToken(kind)
    for kind in UsdGeom.XformOp.Type.allValues
    if kind != UsdGeom.XformOp.TypeInvalid
)
COLLECTION, MEMBERS = "collection:", (":includes", ":excludes")
SHORT, LONG = 5, 7
"""Letters from which on a name with one letter, or with two, that are not as they should be is recognized."""


@dataclass(frozen=True)
class _Kind:
    """What prims of one type, with the same schemas applied, may be said to be.

    Args:
        label: for messages.
        known: names of properties of its schemas.
        meant: the same by their plain forms, with those that a schema would add.
        has_inputs: True where each ``inputs:`` without a further namespace is to be one of these.
        verdicts: what is meant by other names that were met, empty of those that stand for themselves.
    """

    label: str
    known: frozenset[str]
    meant: dict[str, str]
    has_inputs: bool
    verdicts: dict[str, str] = field(default_factory=dict)


class PropertyCheck:
    """Tells, once for all prims of a type, which authored properties are not read.

    Args:
        context: the stage.
    """

    def __init__(self, context: StageContext) -> None:
        self._context = context
        self._kinds: dict[tuple[str, ...], _Kind | None] = {}
        self._passed: set[Sdf.Path] = set()

    def check(self, prim: Usd.Prim) -> None:
        """Looks through the properties of a prim; of instances those of the first.

        Raises:
            SceneError: for a name that is misspelt, where the stage is read strictly.
        """
        if prim.IsInstanceProxy():
            path = prim.GetPrimInPrototype().GetPath()
            if path in self._passed:
                return
            self._passed.add(path)
        names = prim.GetAuthoredPropertyNames()
        self._check_variants(prim)
        self._check_collections(prim, names)
        self._check_transform(prim, names)
        kind = self._kind_of(prim)
        if kind is None:
            return
        for name in names:
            if name in kind.known:
                if name not in READ and name.rpartition(":")[0] in NAMESPACES and _says_something(prim, name):
                    self._context.notes.add(f"{name} is not read", prim.GetPath())
            elif meant := self._meant(kind, name):
                if not prim.GetProperty(meant).IsAuthored():
                    self._context.mend(f"is not read: {meant} may be meant", prim.GetPath().AppendProperty(name))
            elif kind.has_inputs and OWN_INPUT.fullmatch(name):
                text = f"is not read: a {kind.label} has no such input"
                self._context.notes.add(text, prim.GetPath().AppendProperty(name))

    def _check_variants(self, prim: Usd.Prim) -> None:
        """Tells of variants that are selected and not there."""
        if not prim.HasAuthoredMetadata("variantSelection"):
            return
        sets = prim.GetVariantSets()
        for name, chosen in sets.GetAllVariantSelections().items():
            if not sets.HasVariantSet(name):
                # It may be one that another variant brings.
                text = f"selects {chosen} of a variant set {name}, which is not there; it is of no effect"
                self._context.notes.add(text, prim.GetPath())
            elif chosen and chosen not in (variants := sets.GetVariantSet(name).GetVariantNames()):
                text = f"selects {chosen} of the variant set {name}; accepted: {', '.join(variants)}; none is used"
                self._context.mend(text, prim.GetPath())

    def _check_collections(self, prim: Usd.Prim, names: Iterable[str]) -> None:
        """Tells of members of collections that are not there."""
        for name in names:
            if name.startswith(COLLECTION) and name.endswith(MEMBERS):
                relationship = prim.GetRelationship(name)
                for target in relationship.GetTargets() if relationship else ():
                    if not _is_there(target, prim.GetStage()):
                        text = f"= {target}, which is not there; it is left out"
                        self._context.mend(text, relationship.GetPath())

    def _check_transform(self, prim: Usd.Prim, names: Iterable[str]) -> None:
        """Tells of operations that do not move the prim, and of those that it is to be moved by and does not have."""
        authored = [name for name in names if name.startswith(OPS)]
        order = prim.GetAttribute(OP_ORDER)
        listed = read_words(order, self._context, Usd.TimeCode.Default()) if order and is_authored(order) else ()
        if not authored and not listed:
            return
        used = {name.removeprefix(INVERSE) for name in listed} if prim.IsA(UsdGeom.Xformable) else set[str]()
        time = self._context.time
        if unused := [name for name in authored if name not in used and _moves(prim.GetAttribute(name), time)]:
            kind = f"a {prim.GetTypeName()}" if prim.GetTypeName() else "a prim without a type"
            why = f"{OP_ORDER} does not name it" if prim.IsA(UsdGeom.Xformable) else f"{kind} has no transform"
            for name in unused:
                self._context.notes.add(f"is not read: {why}", prim.GetPath().AppendProperty(name))
        for name in sorted(used):
            # Of operations of no type the transform as a whole is refused.
            if name.startswith(KNOWN_OPS) and not prim.HasAttribute(name):
                self._context.mend(f"names {name}, which is not there; it is left out", order.GetPath())

    def _kind_of(self, prim: Usd.Prim) -> _Kind | None:
        shader = UsdShade.Shader(prim).GetShaderId() or "" if prim.GetTypeName() == "Shader" else ""
        key = (prim.GetTypeName(), shader, *prim.GetAppliedSchemas())
        if key not in self._kinds:
            self._kinds[key] = _new_kind(prim, shader)
        return self._kinds[key]

    @staticmethod
    def _meant(kind: _Kind, name: str) -> str:
        if name not in kind.verdicts:
            kind.verdicts[name] = _nearest(name, kind.meant)
        return kind.verdicts[name]


def _new_kind(prim: Usd.Prim, shader: str) -> _Kind | None:
    known = frozenset(prim.GetPrimDefinition().GetPropertyNames())
    label, has_inputs, more = prim.GetTypeName(), False, frozenset[str]()
    if prim.GetTypeName() == "Shader":
        node = Sdr.Registry().GetShaderNodeByIdentifier(shader) if shader.startswith(SHADER_KINDS) else None
        if node is None:
            return None
        label, has_inputs = shader, True
        known |= {INPUTS + name for name in node.GetShaderInputNames()}
    elif prim.HasAPI(UsdLux.LightAPI):
        has_inputs = prim.GetTypeName() != "Mesh"
        registry = Usd.SchemaRegistry()
        # Where these are not applied, `lights` tells that their attributes have no effect.
        apis = (registry.FindAppliedAPIPrimDefinition(name) for name in LIGHT_APIS)
        more = frozenset(name for api in apis for name in api.GetPropertyNames())
    elif prim.GetTypeName() not in READ_TYPES:
        return None
    if prim.IsA(UsdGeom.Imageable):
        more |= {*DISPLAY, BINDING}
    meant = {_plain(name): name for name in sorted(known | more) if not name.startswith((COLLECTION, "outputs:"))}
    return _Kind(label, known | more, meant, has_inputs)


def _says_something(prim: Usd.Prim, name: str) -> bool:
    """True of an attribute that is not as if it were not authored, or a relationship with targets."""
    attribute = prim.GetAttribute(name)
    if not attribute:
        relationship = prim.GetRelationship(name)
        return bool(relationship and relationship.GetTargets())
    if not is_authored(attribute):
        return False
    return attribute.Get() != prim.GetPrimDefinition().GetAttributeFallbackValue(name)


def _is_there(path: Sdf.Path, stage: Usd.Stage) -> bool:
    """True of a prim, a property, or a collection, of which no property needs to be authored."""
    if not path.IsPropertyPath():
        return bool(stage.GetPrimAtPath(path))
    if stage.GetObjectAtPath(path):
        return True
    prim = stage.GetPrimAtPath(path.GetPrimPath())
    return bool(prim) and prim.HasAPI(Usd.CollectionAPI, path.name.removeprefix(COLLECTION))


def _moves(operation: Usd.Attribute, time: Usd.TimeCode) -> bool:
    """False of an operation that leaves everything where it is; true of a relationship that has such a name."""
    if not operation:
        return True
    try:
        return bool(UsdGeom.XformOp(operation).GetOpTransform(time) != Gf.Matrix4d(1))
    except Tf.ErrorException:
        return True


def _plain(name: str) -> str:
    """A name in small letters, without separators, the namespace that may be forgotten, or an ending of the plural."""
    plain = name.removeprefix(INPUTS).removeprefix(PRIMVARS).lower().replace("_", "").replace("-", "")
    return plain[:-3] + "y" if plain.endswith("ies") else plain.removesuffix("s")


def _nearest(name: str, meant: dict[str, str]) -> str:
    """The name that is meant by another; empty where it may be one of its own."""
    plain = _plain(name)
    head = plain.partition(":")[0] if ":" in plain else ""
    if head in FOREIGN or (head and head not in _heads(meant)):
        return ""
    if name.startswith(PRIMVARS):  # Primvars may have any name, such as that of an attribute or a numbered one.
        meant = {other: full for other, full in meant.items() if full in DISPLAY}
    if plain in meant:
        return meant[plain]
    letters = len(name.removeprefix(INPUTS))
    room = 0 if letters < SHORT else 1 if letters < LONG else 2
    if not room or plain[-1].isdigit():
        return ""
    distance, found = min(((_distance(plain, other), meant[other]) for other in meant), default=(room + 1, ""))
    return found if distance <= room else ""


def _heads(names: Iterable[str]) -> set[str]:
    return {name.partition(":")[0] for name in names if ":" in name}


def _distance(a: str, b: str) -> int:
    """Letters that are put in, left out, changed, or exchanged with the next one, from one word to another."""
    rows = [list(range(len(b) + 1))]
    for i, letter in enumerate(a, start=1):
        row = [i]
        for j, other in enumerate(b, start=1):
            cost = min(row[-1] + 1, rows[-1][j] + 1, rows[-1][j - 1] + (letter != other))
            if i > 1 and j > 1 and letter == b[j - 2] and a[i - 2] == other:
                cost = min(cost, rows[-2][j - 2] + 1)
            row.append(cost)
        rows.append(row)
    return rows[-1][-1]
