"""Closed meshes taken apart: against boxes, of which it is known what they hold."""

import numpy as np
import pytest

from fgf_warp.errors import OpenMeshError
from fgf_warp.scene import DOUBLED_FACES, INWARD_SHELL, Camera, Instances, Medium, Mesh, Scene, Surface, encloses
from fgf_warp.scene.boxes import meeting_boxes
from fgf_warp.scene.shells import count_unmatched, find_shells, weld
from tests.render.test_media import BOX, CORNERS
from tests.scenes import transform


def box(half=1.0, at=(0.0, 0.0, 0.0), *, inwards=False):
    return CORNERS * half + np.asarray(at, dtype=np.float64), BOX[:, ::-1] if inwards else BOX


def joined(*parts):
    """Points and triangles of parts, which share no points."""
    starts = np.cumsum([0, *(len(points) for points, _ in parts)])
    triangles = [triangles + start for (_, triangles), start in zip(parts, starts, strict=False)]
    return np.concatenate([points for points, _ in parts]), np.concatenate(triangles)


def soup(mesh):
    """The same, and no two triangles share points."""
    points, triangles = mesh
    return points[triangles].reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3)


def shells_of(mesh):
    points, triangles = mesh
    corners = weld(points)[triangles]
    assert not count_unmatched(corners).any(), "the test's mesh is open"
    return find_shells(points, triangles, corners)


def layers(mesh):
    """Of each box, in order, the group."""
    return shells_of(mesh).groups[::12].tolist()


@pytest.mark.parametrize("cut", [lambda mesh: mesh, soup], ids=["whole", "in triangles"])
@pytest.mark.parametrize(
    ("boxes", "groups"),
    [
        ([box()], [0]),
        ([box(), box(at=(2.1, 0, 0))], [0, 0]),
        ([box(), box(at=(1.5, 0.1, 0.1))], [0, 1]),
        ([box(), box(0.5)], [0, 1]),
        ([box(), box(0.5, inwards=True)], [0, 0]),
        ([box(), box(0.5, inwards=True), box(0.25)], [0, 0, 0]),
        ([box(), box(0.5, inwards=True), box(0.6)], [0, 1, 1]),
        ([box(at=(1.6 * k, 0.1 * k, 0)) for k in range(6)], [0, 1, 0, 1, 0, 1]),
        ([box(1 + 0.1 * k) for k in range(4)], [0, 1, 2, 3]),
    ],
)
def test_what_lies_apart_is_crossed_as_one(boxes, groups, cut):
    mesh = cut(joined(*boxes))
    assert layers(mesh) == groups
    assert shells_of(mesh).are_plain == (max(groups) == 0)


def test_a_shell_with_its_cavities_is_one_body():
    """Whatever group it is in, and whatever bounds nothing beside it."""
    hollow = (box(), box(0.5, inwards=True))
    found = shells_of(
        joined(box(at=(9, 0, 0)), *hollow, box(at=(1.5, 0, 0)), box(at=(0, 9, 0)), box(at=(0, 9, 0), inwards=True))
    )
    assert found.bodies[::12].tolist() == [0, 1, 1, 2, -1, -1]
    assert found.groups[::12].tolist() == [0, 0, 0, 1, -1, -1]
    assert found.body_count == 3


def test_shells_that_touch_are_told_apart():
    assert layers(joined(box(), box(at=(2.0, 0, 0)))) == [0, 1]
    assert layers(joined(box(), box(at=(2.0, 2.0, 2.0)))) == [0, 1]
    assert layers(joined(box(), box(at=(2.0 + 1e-6, 0.3, 0)))) == [0, 1]


def test_shells_whose_boxes_overlap_may_lie_apart():
    """Two linked rings."""
    rings = []
    for axes, at in (((0, 1, 2), 0.0), ((0, 2, 1), 1.0)):
        turn, around = (np.arange(48) * 2 * np.pi / 48, np.arange(12) * 2 * np.pi / 12)
        radius = 1 + 0.2 * np.cos(around)
        height = np.broadcast_to(0.2 * np.sin(around), (48, 12))
        ring = [radius * np.cos(turn[:, None]), radius * np.sin(turn[:, None]), height]
        points = np.stack(ring, axis=-1)[..., axes].reshape(-1, 3) + np.array([at, 0, 0])
        index = np.arange(48 * 12).reshape(48, 12)
        a, b = index, np.roll(index, -1, axis=0)
        c, d = np.roll(b, -1, axis=1), np.roll(a, -1, axis=1)
        triangles = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
        rings.append((points, triangles if axes == (0, 1, 2) else triangles[:, ::-1]))
    assert shells_of(joined(*rings)).are_plain
    moved = joined(rings[0], (rings[1][0] + (0.9, 0, 0), rings[1][1]))
    assert shells_of(moved).count == 2


def test_a_shell_that_faces_inwards_alone_is_turned():
    found = shells_of(joined(box(), box(0.5, (5, 0, 0), inwards=True), box(0.5, inwards=True)))
    assert found.groups.tolist() == [0] * 36
    assert found.turned.tolist() == [False] * 12 + [True] * 12 + [False] * 12


DOUBLED = {
    "of the same points": (CORNERS, np.concatenate([BOX, BOX[:, [1, 0, 2]]])),
    "of points of its own": joined(box(), box(inwards=True)),
    "cut along other diagonals": joined(box(), (CORNERS * (1, 1, -1), BOX)),
    "flat": (
        np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]),
        np.array([(0, 1, 2), (0, 2, 3), (1, 0, 3), (1, 3, 2)]),
    ),
}


@pytest.mark.parametrize("name", DOUBLED)
def test_faces_that_are_all_there_twice_enclose_nothing(name):
    points, triangles = DOUBLED[name]
    with pytest.raises(OpenMeshError, match=r"/double: .*there twice, facing both ways: it encloses no volume"):
        Mesh("/double", points.astype(float), triangles, medium=0)
    Mesh("/sheet", points.astype(float), triangles, Surface((0.5,) * 3))
    beside = joined((points, triangles), box(at=(9, 0, 0)))
    mesh = Mesh("/both", *beside, medium=0)
    assert mesh.mended == (DOUBLED_FACES,)
    (body,) = mesh.bodies
    assert sorted(map(tuple, body.triangles)) == sorted(map(tuple, beside[1][-12:]))


def test_a_face_that_stands_off_the_volume_is_left_out():
    points, triangles = joined(
        box(), (np.array([(1.0, 1, 1), (1, 1, -1), (3, 3, 0)]), np.array([(0, 1, 2), (0, 2, 1)]))
    )
    welded = np.unique(points, axis=0, return_inverse=True)
    for mesh in ((points, triangles), (welded[0], welded[1].reshape(-1)[triangles])):
        assert shells_of(mesh).groups.tolist() == [0] * 12 + [-1] * 2


def test_a_mesh_of_one_body_is_the_same_object():
    for mesh in (box(), joined(box(), box(at=(3, 0, 0))), joined(box(), box(0.5, inwards=True))):
        shape = Mesh("/m", *mesh, medium=0)
        assert shape.bodies[0] is shape
        assert shape.mended == ()
    opaque = Mesh("/m", *joined(box(), box(0.5)), Surface((0.5,) * 3), 0)
    assert opaque.bodies == (opaque,)


def test_bodies_keep_what_their_triangles_carry():
    mesh = joined(box(), box(0.5, (5, 0, 0), inwards=True), box(at=(1, 0, 0)))
    rng = np.random.default_rng(1)
    carried = {"st": rng.random((36, 3, 2)), "id": rng.random((36, 1, 1)), "all": rng.random((1, 1, 3))}
    glass = Surface((1.0,) * 3, opacity=0.0)
    whole = Mesh("/m", *mesh, glass, 0, rng.normal(size=(36, 3, 3)), carried)
    first, second = whole.bodies
    assert whole.mended == (INWARD_SHELL,)
    assert np.array_equal(first.triangles[12:], whole.triangles[12:24, ::-1])
    assert np.array_equal(first.normals[12:], whole.normals[12:24, ::-1])
    assert np.array_equal(first.primvars["st"][:12], carried["st"][:12])
    assert np.array_equal(first.primvars["st"][12:], carried["st"][12:24, ::-1])
    assert np.array_equal(second.primvars["id"], carried["id"][24:])
    assert np.array_equal(second.primvars["all"], carried["all"])


@pytest.mark.parametrize("seed", range(6))
def test_what_a_mesh_encloses_is_the_union_of_its_shells(seed):
    """Random boxes with cavities, on a lattice so that many share faces: by containment, and by the bodies."""
    rng = np.random.default_rng(seed)
    boxes = [(rng.integers(1, 4, 3) / 4, rng.integers(-4, 5, 3) / 4, rng.random() < 0.3) for _ in range(5)]
    parts = []
    for half, at, has_hole in boxes:
        parts += [box(half, at), *([box(half / 2, at, inwards=True)] if has_hole else [])]
    mesh = Mesh("/m", *joined(*parts), medium=0)
    scene = Scene(
        Camera("/c", np.eye(4)), (mesh, Instances("/i", mesh, transform(2.0)[None, :3])), (Medium("/f", 1.0),)
    )
    copies = scene.shapes[len(scene.shapes) // 2 :]
    assert {shape.name for shape in copies} == {"/i"}
    points = rng.uniform(-2, 2, (200, 3))
    expected = np.zeros(len(points), dtype=bool)
    for half, at, has_hole in boxes:
        distance = np.abs((points - at) / half).max(axis=1)
        expected |= (distance < 1) & ~(has_hole & (distance < 0.5))
    assert [encloses(mesh, point) for point in points] == expected.tolist()
    assert [any(encloses(body, 2 * point) for body in copies) for point in points] == expected.tolist()


@pytest.mark.parametrize("count", [2, 3, 50, 200])
@pytest.mark.parametrize("size", [0.01, 0.2, 5.0])
def test_boxes_that_meet_are_all_found_once(count, size):
    rng = np.random.default_rng(count)
    low = rng.random((count, 3)).round(2)
    high = low + (size * rng.random((count, 3))).round(2)
    low[0], high[0] = -3, 5
    found = [pair for i, j in meeting_boxes(low, high) for pair in zip(i.tolist(), j.tolist(), strict=True)]
    meets = ((low[:, None] <= high) & (low <= high[:, None])).all(axis=-1)
    assert sorted(map(sorted, found)) == np.argwhere(np.triu(meets, 1)).tolist()
