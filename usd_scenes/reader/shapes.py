"""The shapes of a stage: what is alone goes to world space, and what there is more of shares its triangles."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from operator import is_not

import numpy as np
from pxr import Sdf, Usd, UsdGeom

from fgf_warp.errors import UnsupportedFeatureError
from fgf_warp.scene import MANY_SOLIDS, MAX_CONTAINERS, Instances, Mesh, Shape, Solid
from fgf_warp.scene.placements import are_usable, squared
from usd_scenes.reader.context import StageContext
from usd_scenes.reader.geometry import FORM_READERS, Canonical, read_solid
from usd_scenes.reader.instance_primvars import read_of_instances
from usd_scenes.reader.instancing import MAX_INSTANCES, Matrices
from usd_scenes.reader.materials import Look, MaterialReader
from usd_scenes.reader.mesh import Assignment, Form, MeshForm, Part, build_part
from usd_scenes.reader.primvars import find_primvar, fits_textures, read_values
from usd_scenes.reader.traversal import Met

NOT_COPIED = np.array([-1], dtype=np.int32)
"""Number of what is in no instancer."""


@dataclass(frozen=True, eq=False)
class _Places:
    """Where a prim is, with what it has in each place.

    Args:
        name: path of the prim, or of the part of it that is meant.
        matrices: to the world.
        numbers: (n,) int32, of the copies.
        primvars: of instancers, name to (n, k) float32.
    """

    name: str
    matrices: Matrices
    numbers: np.ndarray
    primvars: Mapping[str, np.ndarray]

    @property
    def moves(self) -> bool:
        """True where some place is not at rest."""
        opening, closing = self.matrices
        return closing is not opening and not np.array_equal(opening, closing)

    def at(self, chosen: np.ndarray) -> _Places:
        """Some of them."""
        opening, closing = self.matrices
        part = opening[chosen]
        matrices = part, part if closing is opening else closing[chosen]
        return replace(
            self,
            matrices=matrices,
            numbers=self.numbers[chosen],
            primvars={name: values[chosen] for name, values in self.primvars.items()},
        )

    def one_by_one(self) -> Iterator[_Places]:
        """Each of them."""
        return (self.at(np.array([number])) for number in range(len(self.numbers)))

    def of(self, prototype: Mesh | Solid) -> Instances:
        """The instances of what stands there."""
        return Instances(
            name=self.name,
            prototype=prototype,
            object_to_world=self.matrices[0],
            closing=self.matrices[1] if self.moves else None,
            numbers=self.numbers,
            primvars=self.primvars,
        )


@dataclass(frozen=True, eq=False)
class _Use:
    """A part of a form and its places in the world."""

    form: Form
    part: Part
    is_shared: bool
    places: _Places


class ShapeReader:
    """Reads shapes one prim after the other; `shapes` puts them together.

    Args:
        context: the stage.
        materials: of the shapes.
    """

    def __init__(self, context: StageContext, materials: MaterialReader) -> None:
        self._context = context
        self._materials = materials
        self._forms: dict[Sdf.Path, Form] = {}
        self._parts: dict[object, Part] = {}
        self._count = 0
        self._found: list[tuple[Sdf.Path, Shape | _Use]] = []

    def read(self, met: Met) -> bool:
        """Reads a prim; False where it is no shape that can be rendered.

        Raises:
            SceneError: for values out of their range, or a topology that does not fit together.
            UnsupportedFeatureError: for more than `MAX_INSTANCES` in all, or more instances that are filled with a
                medium than `MAX_CONTAINERS`.
        """
        prim = met.prim
        if solid := read_solid(prim, self._context):
            path = _link_path(met, str(prim.GetPath()))
            self._found.extend((path, shape) for shape in self._solids(met, solid))
            return True
        if not (prim.IsA(UsdGeom.Mesh) or prim.GetTypeName() in FORM_READERS):
            return False
        self._found.extend((_link_path(met, use.places.name), use) for use in self._uses(met))
        return True

    def shapes(self) -> list[tuple[Sdf.Path, Shape]]:
        """All that was read, in that order, each with the path at which lights may be linked to it.

        Raises:
            SceneError: for points that are not finite, or a medium in a mesh that is not closed.
        """
        counts = Counter[int]()
        for _, found in self._found:
            if isinstance(found, _Use) and found.is_shared:
                counts[id(found.form)] += len(found.places.numbers)
        meshes: dict[int, Mesh] = {}
        shapes: list[tuple[Sdf.Path, Shape]] = []
        for path, found in self._found:
            look, name = (found.part.look, found.places.name) if isinstance(found, _Use) else (found, found.name)
            holds = partial(is_not, look.medium, None)
            with self._context.going_on(), self._context.leaving_out(name, "the shape is left out", holds):
                if not isinstance(found, _Use):
                    shapes.append((path, found))
                elif counts[id(found.form)] <= 1 and not found.places.moves:
                    shapes.extend((path, self._alone(found.part, places)) for places in found.places.one_by_one())
                else:
                    if id(found.part) not in meshes:
                        meshes[id(found.part)] = found.part.mesh()
                        self._tell_mended(meshes[id(found.part)])
                    mesh, places = meshes[id(found.part)], self._with_volume(found.places)
                    parted = [places] if mesh.medium is None else places.one_by_one()
                    shapes.extend((path, part.of(mesh)) for part in parted if len(part.numbers))
        return shapes

    def _alone(self, part: Part, places: _Places) -> Mesh:
        """In the world, in its only place."""
        own = {name: values[None] for name, values in places.primvars.items()}
        mesh = part.moved(places.matrices[0][0]).mesh(int(places.numbers[0]))
        self._tell_mended(mesh)
        return replace(mesh, primvars={**mesh.primvars, **own}) if own else mesh

    def _tell_mended(self, mesh: Mesh) -> None:
        for text in mesh.mended:
            self._context.mend(text, mesh.name)

    def _solids(self, met: Met, canonical: Canonical) -> Iterator[Shape]:
        kind, to_prim = canonical
        look = self._materials.look_of(met.prim, met.copies)
        places = self._with_volume(self._places(met, look))
        solid = Solid(
            name=places.name,
            kind=kind,
            object_to_world=to_prim,
            surface=look.surface,
            medium=look.medium,
            primvars=self._constants(met.prim, look, places.primvars),
        )
        if look.medium is None and len(places.numbers) > MANY_SOLIDS:
            yield places.of(solid)
            return
        for place in places.one_by_one():
            opening, closing = (squared(matrices)[0] @ to_prim for matrices in place.matrices)
            own = {name: values[0] for name, values in place.primvars.items()}
            yield replace(
                solid,
                object_to_world=opening,
                closing=closing if place.moves else None,
                primvars={**solid.primvars, **own},
                instance=int(place.numbers[0]),
            )

    def _uses(self, met: Met) -> list[_Use]:
        prim = met.prim
        is_shared = met.copies is not None or prim.IsInstanceProxy()
        form = self._form_of(prim, is_shared)
        if not len(form.triangles):
            self._context.notes.add("mesh without faces is left out", prim.GetPath())
            return []
        found = []
        for number, a in enumerate(form.looks(prim, lambda bound: self._materials.look_of(bound, met.copies))):
            places = replace(self._places(met, a.look), name=a.name)
            found.append(_Use(form, self._part(form, prim, number, a, places), is_shared, places))
        return found

    def _form_of(self, prim: Usd.Prim, is_shared: bool) -> Form:
        """The triangles of a prim; instances have one form together."""
        if not is_shared:
            return self._read_form(prim)
        path = (prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim).GetPath()
        if path not in self._forms:
            self._forms[path] = self._read_form(prim)
        return self._forms[path]

    def _read_form(self, prim: Usd.Prim) -> Form:
        reader = FORM_READERS.get(prim.GetTypeName(), MeshForm)
        return reader(prim, self._context)

    def _part(self, form: Form, prim: Usd.Prim, number: int, assignment: Assignment, places: _Places) -> Part:
        """A part; instances whose looks and primvars are the same have one together."""
        look, without = assignment.look, frozenset(places.primvars)
        names = sorted(look.surface.primvars - without) if look.surface else []
        inherited = [form.primvar(prim, name) for name in names]
        constants = tuple(v.tobytes() if v is not None and len(v) == 1 else v is None for v in inherited)
        key = (id(form), number, look.surface, look.medium, constants, without)
        if key not in self._parts:
            self._parts[key] = build_part(form, prim, assignment, without)
        return self._parts[key]

    def _places(self, met: Met, look: Look) -> _Places:
        """Where a prim is."""
        prim, name, context = met.prim, str(met.prim.GetPath()), self._context
        if met.copies:
            matrices, numbers = met.copies.matrices(prim, context), met.copies.numbers
        else:
            opening, closing = context.local_to_world(prim)[None, :3], context.closing_to_world(prim)
            matrices, numbers = (opening, opening if closing is None else closing[None, :3]), NOT_COPIED
        self._check_counts(name, len(numbers), look)
        names = sorted(look.surface.primvars) if look.surface else []
        primvars = {
            key: values
            for key, values in read_of_instances(prim, names, met.copies, context).items()
            if fits_textures(values, key, look.surface, name, context)
        }
        return _Places(name, matrices, numbers, primvars)

    def _with_volume(self, places: _Places) -> _Places:
        """Those in which something is left of the prim."""
        opening, closing = places.matrices
        usable = are_usable(opening)
        if closing is not opening:
            usable &= are_usable(closing)
        if usable.all():
            return places
        self._context.notes.add("the transform leaves no volume, and the prim is left out", places.name)
        return places.at(np.flatnonzero(usable))

    def _check_counts(self, name: str, count: int, look: Look) -> None:
        self._count += count
        if self._count > MAX_INSTANCES:
            raise UnsupportedFeatureError(
                f"{name}: with its {count:,} instances the stage has {self._count:,} shapes; accepted: at most "
                f"{MAX_INSTANCES:,}"
            )
        if look.medium is not None and count > MAX_CONTAINERS:
            raise UnsupportedFeatureError(
                f"{name}: a medium fills {count:,} instances, each of them a shape of its own; accepted: at most "
                f"{MAX_CONTAINERS} shapes that are filled with media"
            )

    def _constants(self, prim: Usd.Prim, look: Look, without: Collection[str]) -> dict[str, np.ndarray]:
        """Primvars of a solid, which has one value of each."""
        found = {}
        for name in sorted(look.surface.primvars - set(without)) if look.surface else []:
            primvar = find_primvar(prim, name)
            values = read_values(primvar, self._context) if primvar else None
            if values is None:
                continue
            if len(values) != 1:
                path = primvar.GetAttr().GetPath()
                self._context.notes.add("primvar that varies over a solid is not supported and is left out", path)
                continue
            if fits_textures(values, name, look.surface, str(prim.GetPath()), self._context):
                found[name] = values[0].astype(np.float32)
        return found


def _link_path(met: Met, name: str) -> Sdf.Path:
    """Where lights may be linked to a shape: its own path, or that of an instancer whose prototypes are elsewhere."""
    path = Sdf.Path(name)
    if met.copies is None:
        return path
    instancer = met.copies.levels[-1].instancer.GetPath()
    return path if path.HasPrefix(instancer) else instancer
