"""The tree of triangles: the same hits as trying every triangle, and no way through a closed mesh."""

import numpy as np
import pytest

from fgf_warp import bvh_splitting
from fgf_warp.bvh import build_box_tree, build_wide_tree
from fgf_warp.device.geometry import LIGHT
from fgf_warp.scene import Mesh, MeshLight, Surface
from fgf_warp.scene.placements import invert_axes
from tests.contracts.device_kernels import RICH, hit_meshes, meet_meshes
from usd_scenes.examples import trefoil_tube


def knot(around, along, **of_mesh):
    points, quads = trefoil_tube(around=around, along=along, tube_radius=0.26, radius=0.4)
    quads = np.asarray(quads)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return Mesh("/knot", np.asarray(points, dtype=np.float32), triangles, **of_mesh)


def directions(n, seed):
    d = np.random.default_rng(seed).normal(size=(n, 3))
    return (d / np.linalg.norm(d, axis=1, keepdims=True)).astype(np.float32)


def meet_every_triangle(corners, origin, direction):
    """Distances in float64 by Moeller and Trumbore, inf for a miss, (rays, triangles)."""
    a, b, c = (corners[None, :, i].astype(np.float64) for i in range(3))
    o, d = origin[:, None].astype(np.float64), direction[:, None].astype(np.float64)
    p = np.cross(d, c - a)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1 / ((b - a) * p).sum(-1)
        u = ((o - a) * p).sum(-1) * inverse
        q = np.cross(o - a, b - a)
        v = (d * q).sum(-1) * inverse
        t = ((c - a) * q).sum(-1) * inverse
        return np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0), t, np.inf)


@pytest.mark.parametrize("copies", [1, 3])
def test_hits_are_those_of_every_triangle(copies):
    rng = np.random.default_rng(2)
    meshes = [knot(6, 40, surface=Surface())]
    for k in range(1, copies):
        soup = rng.normal(size=(300, 3)).astype(np.float32)
        meshes.append(Mesh(f"/soup{k}", soup, np.arange(300).reshape(100, 3), Surface()))
    origin = rng.uniform(-1.5, 1.5, size=(2000, 3)).astype(np.float32)
    direction = directions(2000, 3)
    # Along the axes too, where slopes are exactly zero.
    direction[:60] = np.tile(np.concatenate([np.eye(3), -np.eye(3)]), (10, 1))
    t, normal = meet_meshes(meshes, origin, direction)
    corners = np.concatenate([mesh.points[mesh.triangles] for mesh in meshes])
    expected = meet_every_triangle(corners, origin, direction)
    nearest = expected.min(axis=1)
    assert np.isfinite(nearest).sum() > 200
    assert np.array_equal(t >= 0, np.isfinite(nearest))
    met = t >= 0
    assert np.allclose(t[met], nearest[met], rtol=1e-4, atol=1e-5)
    one = corners[expected.argmin(axis=1)[met]].astype(np.float64)
    expected_normal = np.cross(one[:, 1] - one[:, 0], one[:, 2] - one[:, 0])
    expected_normal /= np.linalg.norm(expected_normal, axis=1, keepdims=True)
    assert np.median(np.abs(normal[met] - expected_normal).max(axis=1)) < 1e-5


def test_hits_among_triangles_that_overlap():
    """Rays with many boxes waiting."""
    rng = np.random.default_rng(4)
    points = rng.normal(size=(12_000, 3)).astype(np.float32)
    soup = Mesh("/soup", points, np.arange(12_000).reshape(-1, 3), Surface())
    origin = rng.uniform(-3, 3, size=(200, 3)).astype(np.float32)
    direction = directions(200, 5)
    t, _ = meet_meshes([soup], origin, direction)
    nearest = meet_every_triangle(points[soup.triangles], origin, direction).min(axis=1)
    assert np.array_equal(t >= 0, np.isfinite(nearest))
    met = t >= 0
    assert met.sum() > 100
    assert np.allclose(t[met], nearest[met], rtol=1e-4, atol=1e-5)


def test_no_ray_leaves_a_closed_mesh_unseen():
    """Two million rays from inside at corners and edges of triangles: a leak rate of 1.5e-6 would show at 95 %."""
    n = 1_000_000
    mesh = knot(14, 112, medium=0)
    corners = mesh.points[mesh.triangles]
    rng = np.random.default_rng(8)
    target = corners[rng.integers(len(corners), size=n)]
    on_edge = rng.random(n).astype(np.float32)[:, None]
    aimed = {"corner": target[:, 0], "edge": target[:, 0] * on_edge + target[:, 1] * (1 - on_edge)}
    # The tube's spine runs through the middle of each ring of 14 corners.
    spine = mesh.points.reshape(112, 14, 3).mean(axis=1)
    for points in aimed.values():
        nearest = spine[np.argmin(((points[:2000, None] - spine) ** 2).sum(-1), axis=1)]
        origin = np.repeat(nearest, n // 2000, axis=0).astype(np.float32)
        towards = np.repeat(points[:2000], n // 2000, axis=0) - origin
        origin = origin + towards * rng.uniform(0, 0.5, size=(n, 1)).astype(np.float32)
        direction = np.repeat(points[:2000], n // 2000, axis=0) - origin
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        t, _ = meet_meshes([mesh], origin, direction, inside=1)
        assert (t < 0).sum() == 0


def test_a_boundary_is_met_from_the_side_that_the_path_is_on():
    mesh = knot(14, 112, medium=0)
    origin = np.tile([[0.0, 0.0, 8.0]], (50_000, 1))
    direction = directions(50_000, 5) * 0.12 + np.array([0, 0, -1], dtype=np.float32)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    entered, _ = meet_meshes([mesh], origin, direction, inside=0)
    left, _ = meet_meshes([mesh], origin, direction, inside=1)
    met = entered >= 0
    assert np.array_equal(met, left >= 0)
    assert met.sum() > 10_000
    assert np.all(left[met] >= entered[met])


def cube(ticks):
    """The surface of [-1, 1]^3, every face in ticks x ticks squares."""
    x, y = np.meshgrid(np.linspace(-1, 1, ticks + 1), np.linspace(-1, 1, ticks + 1), indexing="ij")
    first = (np.arange(ticks)[:, None] * (ticks + 1) + np.arange(ticks)).reshape(-1, 1)
    right, across, up = first + ticks + 1, first + ticks + 2, first + 1
    square = np.concatenate([np.hstack([first, right, across]), np.hstack([first, across, up])])
    points, triangles = [], []
    for axis in range(3):
        for side in (-1, 1):
            face = np.roll(np.stack([x, y, np.full_like(x, side)], axis=-1).reshape(-1, 3), axis + 1, axis=1)
            triangles.append(square[:, ::side] + len(points) * len(face))
            points.append(face)
    points, merged = np.unique(np.concatenate(points).round(6), axis=0, return_inverse=True)
    return points.astype(np.float32), merged.reshape(-1)[np.concatenate(triangles)]


@pytest.mark.parametrize("inside", [0, 1])
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("side", [-1, 1])
def test_a_face_just_behind_the_origin_is_met(axis, side, inside):
    """The ray should have crossed it, and was rounded behind it; leaves are in one face, and their boxes flat."""
    mesh = Mesh("/cube", *cube(20), medium=0)
    rng = np.random.default_rng(9)
    origin = rng.uniform(-0.9, 0.9, size=(20_000, 3))
    outwards = side * (1 if inside else -1)
    # Coordinates are 1 here, and their errors below 1e-6.
    origin[:, axis] = side + outwards * rng.uniform(0, 0.9e-6, size=20_000)
    direction = directions(20_000, 10)
    # Flatter than 0.01 it is not looked for.
    direction[:, axis] = outwards * np.maximum(np.abs(direction[:, axis]), 0.02)
    t, _ = meet_meshes([mesh], origin, direction, inside=inside)
    assert np.all((t >= 0) & (t < 1e-6))


def depth_of(tree):
    """Levels of nodes; children come after their parents."""
    level = np.ones(len(tree.children) // 2, dtype=int)
    for node, children in enumerate(tree.children.reshape(-1, 16)):
        level[children[children > 0]] = level[node] + 1
    return level.max()


def assert_whole(tree, corners):
    """Every triangle is in one leaf, and every leaf in its box and those above it."""
    found = tree.triangles.reshape(-1, 3, 3, 8).transpose(0, 3, 1, 2)
    real = tree.owners >= 0
    assert real.sum() == len(corners)
    listed, given = (sorted(map(tuple, rows.reshape(-1, 9).tolist())) for rows in (found[real], corners))
    assert listed == given
    assert np.all(np.isnan(found[~real]))
    boxes = tree.boxes.reshape(-1, 6, 16)
    children = tree.children.reshape(-1, 16)
    reached = np.zeros(len(found), dtype=int)

    def visit(node, low, high):
        for lane, child in enumerate(children[node]):
            box = boxes[node, :, lane]
            if box[0] > box[1]:
                continue
            assert np.all(box[0::2] >= low)
            assert np.all(box[1::2] <= high)
            if child > 0:
                visit(child, box[0::2], box[1::2])
            else:
                leaf = -1 - child
                reached[leaf] += 1
                inside = found[leaf][real[leaf]]
                assert np.all(inside >= box[0::2])
                assert np.all(inside <= box[1::2])

    visit(0, np.full(3, -np.inf), np.full(3, np.inf))
    assert np.all(reached == 1)
    assert depth_of(tree) <= 7


def test_every_triangle_is_in_one_leaf_and_every_leaf_in_its_box():
    corners = knot(70, 300, surface=Surface())
    corners = corners.points[corners.triangles]
    tree = build_wide_tree([corners[:100], corners[100:]])
    assert_whole(tree, corners)
    assert np.bincount(tree.owners[tree.owners >= 0]).tolist() == [100, len(corners) - 100]


@pytest.mark.parametrize("count", [1, 2, 7, 8, 9, 64, 65])
def test_few_triangles(count):
    corners = np.random.default_rng(count).normal(size=(count, 3, 3)).astype(np.float32)
    tree = build_wide_tree([corners])
    assert_whole(tree, corners)
    assert len(tree.owners) == (1 if count <= 8 else pytest.approx(count / 5, abs=count / 5))


UNIT = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=np.float64)


@pytest.mark.parametrize("width", [1e-30, 1e-38, 1e-44])
def test_triangles_nearer_to_each_other_than_the_inverse_of_a_float_can_tell(width):
    at = np.random.default_rng(1).uniform(0, width, size=(100, 1, 3))
    corners = (UNIT * width + at).astype(np.float32)
    assert_whole(build_wide_tree([corners]), corners)


@pytest.mark.parametrize("size", [1e19, 3e38])
def test_triangles_whose_areas_or_extents_are_no_float(size):
    corners = np.random.default_rng(1).uniform(-size, size, size=(3000, 3, 3)).astype(np.float32)
    assert_whole(build_wide_tree([corners]), corners)


@pytest.mark.parametrize("per_decade", [4, 400])
def test_triangles_that_shrink_by_30_decades(per_decade):
    """By area alone, a level takes a few decades off, or less, and 7 levels are too few."""
    sizes = 10.0 ** -np.linspace(0, 30, 30 * per_decade)
    corners = (UNIT * sizes[:, None, None] + [1, 1, 1] * sizes[:, None, None]).astype(np.float32)
    assert_whole(build_wide_tree([corners]), corners)


def test_triangles_in_one_place():
    corners = np.repeat(UNIT[None].astype(np.float32), 5000, axis=0)
    assert_whole(build_wide_tree([corners]), corners)


def test_one_triangle_is_met():
    mesh = Mesh("/one", UNIT.astype(np.float32), np.array([[0, 1, 2]]), Surface())
    t, normal = meet_meshes([mesh], [[0.2, 0.2, 3.0], [0.8, 0.8, 3.0]], [[0, 0, -1.0], [0, 0, -1.0]])
    assert t == pytest.approx([3.0, -1.0], rel=1e-6)
    assert normal[0].tolist() == pytest.approx([0, 0, 1], abs=1e-6)


def test_no_meshes_no_tree():
    assert build_wide_tree([]).children.shape == (0, 8)


def test_the_triangle_that_is_met_and_where_on_it():
    """Two meshes and a light: the hit is the point that the weights give of the triangle that is named."""
    rng = np.random.default_rng(3)
    soups = [rng.normal(size=(30, 3, 3)).astype(np.float32) for _ in range(3)]
    meshes = [Mesh(f"/{k}", soups[k].reshape(-1, 3), np.arange(90).reshape(-1, 3), Surface()) for k in range(2)]
    lamp = MeshLight("/lamp", soups[2].astype(np.float64), (1, 1, 1))
    origin, direction = rng.uniform(-3, 3, size=(5000, 3)).astype(np.float32), directions(5000, 4)
    hits = hit_meshes(meshes, origin, direction, lights=[lamp], kept=RICH)
    expected = meet_every_triangle(np.concatenate(soups), origin, direction)
    met = hits.t >= 0
    assert np.array_equal(met, np.isfinite(expected.min(axis=1)))
    owner, face = np.divmod(expected.argmin(axis=1), 30)
    assert np.bincount(owner[met]).min() > 100
    assert np.mean((hits.face == face)[met]) > 0.999
    assert np.array_equal(hits.kind[met] == LIGHT, (owner == 2)[met])
    assert np.mean((hits.item == np.where(owner == 2, 0, owner))[met]) > 0.999
    weights = np.stack([1 - hits.u - hits.v, hits.u, hits.v], axis=1)[met]
    assert np.all(weights >= -1e-6)
    named = np.stack(soups)[np.where(hits.kind == LIGHT, 2, hits.item), hits.face][met]
    there = np.einsum("rc,rcx->rx", weights, named)
    assert np.abs(there - (origin + direction * hits.t[:, None])[met]).max() < 2e-5


def test_surfaces_that_were_passed_are_not_met_again():
    """A ray meets one triangle after the other, each once."""
    rng = np.random.default_rng(6)
    soup = Mesh("/soup", rng.normal(size=(600, 3)).astype(np.float32), np.arange(600).reshape(-1, 3), Surface())
    origin, direction = rng.uniform(-3, 3, size=(1, 3)).astype(np.float32), np.zeros((1, 3), dtype=np.float32)
    direction[0] = -origin[0] / np.linalg.norm(origin[0])
    expected = np.sort(meet_every_triangle(soup.points[soup.triangles], origin, direction)[0])
    expected = expected[np.isfinite(expected)]
    assert len(expected) > 10
    passed = 0.0
    for t in [*expected, -1.0]:
        hits = hit_meshes([soup], origin, direction, kept=RICH, passed=passed)
        assert hits.t[0] == pytest.approx(t, rel=1e-5)
        passed = float(hits.t[0])


CENTERS = {
    "a cloud": lambda rng: rng.normal(size=(600, 3)),
    "half of them in one place": lambda rng: np.where(np.arange(600)[:, None] % 2, rng.normal(size=(600, 3)), 1.0),
    "all in one place": lambda rng: np.ones((600, 3)),
    "one after the other far away": lambda rng: 1.07 ** np.arange(600)[:, None] * np.ones(3),
    "few": lambda rng: rng.normal(size=(9, 3)),
}


@pytest.mark.parametrize("leaf", [1, 8])
@pytest.mark.parametrize("kind", CENTERS)
def test_a_tree_that_is_split_in_parts_is_that_of_the_whole(kind, leaf, monkeypatch):
    """The left half of a part lies where its whole was, and what is below a part may be no range at all."""
    centers = CENTERS[kind](np.random.default_rng(5)).astype(np.float32)
    found = []
    for part in (len(centers), 64, leaf):
        monkeypatch.setattr(bvh_splitting, "PART_MIN", part)
        monkeypatch.setattr(bvh_splitting, "PARTS", len(centers))
        low, high = centers - np.float32(0.1), centers + np.float32(0.1)
        tree = build_box_tree(low, high, leaf)
        found.append([tree.boxes, tree.children, tree.leaves, tree.order, low, high])
    for parts in found[1:]:
        assert all(np.array_equal(one, other) for one, other in zip(parts, found[0], strict=True))


def test_inverses_of_places_are_those_of_their_matrices():
    places = np.random.default_rng(6).normal(size=(500, 3, 4)) * 10.0 ** np.arange(-5, 5).repeat(50)[:, None, None]
    found = invert_axes(places)
    assert np.abs(places[:, :, :3] @ found - np.eye(3)).max() < 1e-11
