"""The shapes of a stage: what is alone goes to world space, and what there is more of shares its triangles."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import partial
from operator import is_not

import numpy as np
from pxr import Sdf, Usd, UsdGeom

from fgf_warp.scene import Mesh, MeshInstance, Shape, Solid
from usd_scenes.reader.context import StageContext
from usd_scenes.reader.geometry import FORM_READERS, Canonical, read_solid
from usd_scenes.reader.instancing import Matrices
from usd_scenes.reader.materials import Look, MaterialReader
from usd_scenes.reader.mesh import Assignment, Form, MeshForm, Part, build_part
from usd_scenes.reader.primvars import find_primvar, fits_textures, read_values
from usd_scenes.reader.traversal import Met


@dataclass(frozen=True, eq=False)
class _Use:
    """A part of a form and its places in the world."""

    name: str
    form: Form
    part: Part
    is_shared: bool
    matrices: Matrices
    numbers: np.ndarray


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
        self._found: list[tuple[Sdf.Path, Solid | _Use]] = []

    def read(self, met: Met) -> bool:
        """Reads a prim; False where it is no shape that can be rendered.

        Raises:
            SceneError: for values out of their range, or a topology that does not fit together.
        """
        prim = met.prim
        if solid := read_solid(prim, self._context):
            self._found.extend((_link_path(met, solid.name), solid) for solid in self._solids(met, solid))
            return True
        if not (prim.IsA(UsdGeom.Mesh) or prim.GetTypeName() in FORM_READERS):
            return False
        self._found.extend((_link_path(met, use.name), use) for use in self._uses(met))
        return True

    def shapes(self) -> list[tuple[Sdf.Path, Shape]]:
        """All that was read, in that order, each with the path at which lights may be linked to it.

        Raises:
            SceneError: for points that are not finite, or a medium in a mesh that is not closed.
        """
        counts = Counter[int]()
        for _, found in self._found:
            if isinstance(found, _Use) and found.is_shared:
                counts[id(found.form)] += len(found.numbers)
        meshes: dict[int, Mesh] = {}
        shapes: list[tuple[Sdf.Path, Shape]] = []
        for path, found in self._found:
            look = found if isinstance(found, Solid) else found.part.look
            holds = partial(is_not, look.medium, None)
            with self._context.going_on(), self._context.leaving_out(found.name, "the shape is left out", holds):
                if isinstance(found, Solid):
                    shapes.append((path, found))
                elif counts[id(found.form)] <= 1 and np.array_equal(*found.matrices):
                    mesh = found.part.moved(found.matrices[0][0]).mesh(int(found.numbers[0]))
                    self._tell_mended(mesh)
                    shapes.append((path, mesh))
                else:
                    if id(found.part) not in meshes:
                        meshes[id(found.part)] = found.part.mesh()
                        self._tell_mended(meshes[id(found.part)])
                    shapes.extend((path, instance) for instance in self._instances(found, meshes[id(found.part)]))
        return shapes

    def _tell_mended(self, mesh: Mesh) -> None:
        for text in mesh.mended:
            self._context.mend(text, mesh.name)

    def _solids(self, met: Met, canonical: Canonical) -> list[Solid]:
        kind, to_prim = canonical
        matrices, numbers = self._places(met)
        look = self._materials.look_of(met.prim)
        primvars = self._constants(met.prim, look)
        return [
            Solid(
                name=str(met.prim.GetPath()),
                kind=kind,
                object_to_world=to_world,
                surface=look.surface,
                medium=look.medium,
                closing=closing,
                primvars=primvars,
                instance=int(number),
            )
            for to_world, closing, number in self._filled(
                str(met.prim.GetPath()), (matrices[0] @ to_prim, matrices[1] @ to_prim), numbers
            )
        ]

    def _uses(self, met: Met) -> list[_Use]:
        prim = met.prim
        is_shared = met.copies is not None or prim.IsInstanceProxy()
        form = self._form_of(prim, is_shared)
        if not len(form.triangles):
            self._context.notes.add("mesh without faces is left out", prim.GetPath())
            return []
        matrices, numbers = self._places(met)
        return [
            _Use(a.name, form, self._part(form, prim, number, a), is_shared, matrices, numbers)
            for number, a in enumerate(form.looks(prim, self._materials.look_of))
        ]

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

    def _part(self, form: Form, prim: Usd.Prim, number: int, assignment: Assignment) -> Part:
        """A part; instances whose looks and primvars are the same have one together."""
        look = assignment.look
        names = sorted(look.surface.primvars) if look.surface else []
        inherited = [form.primvar(prim, name) for name in names]
        constants = tuple(v.tobytes() if v is not None and len(v) == 1 else v is None for v in inherited)
        key = (id(form), number, look.surface, look.medium, constants)
        if key not in self._parts:
            self._parts[key] = build_part(form, prim, assignment)
        return self._parts[key]

    def _places(self, met: Met) -> tuple[Matrices, np.ndarray]:
        """Transforms to the world, and the numbers of the copies."""
        if met.copies:
            return met.copies.matrices(met.prim, self._context), met.copies.numbers
        opening, closing = self._context.local_to_world(met.prim), self._context.closing_to_world(met.prim)
        return (opening[None], (opening if closing is None else closing)[None]), np.array([-1])

    def _instances(self, use: _Use, mesh: Mesh) -> list[MeshInstance]:
        return [
            MeshInstance(name=use.name, mesh=mesh, object_to_world=to_world, closing=closing, instance=int(number))
            for to_world, closing, number in self._filled(use.name, use.matrices, use.numbers)
        ]

    def _filled(
        self, name: str, matrices: Matrices, numbers: np.ndarray
    ) -> list[tuple[np.ndarray, np.ndarray | None, int]]:
        """Transform, closing transform where it differs, and number, of the places that have a volume."""
        opening, closing = matrices
        has_volume = (np.linalg.det(opening[:, :3, :3]) != 0) & (np.linalg.det(closing[:, :3, :3]) != 0)
        if not has_volume.all():
            self._context.notes.add("the transform leaves no volume, and the prim is left out", name)
        moves = (opening != closing).any(axis=(1, 2))
        return [(opening[at], closing[at] if moves[at] else None, numbers[at]) for at in np.flatnonzero(has_volume)]

    def _constants(self, prim: Usd.Prim, look: Look) -> dict[str, np.ndarray]:
        """Primvars of a solid, which has one value of each."""
        found = {}
        for name in sorted(look.surface.primvars) if look.surface else []:
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
    instancer = met.copies.instancers[0].GetPath()
    return path if path.HasPrefix(instancer) else instancer
