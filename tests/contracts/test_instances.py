"""Instances against the same triangles in world space, watertight in any space, in motion, and in little memory."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fgf_warp.device.bvh import LEAF
from fgf_warp.errors import SceneError
from fgf_warp.scene import MANY_SOLIDS, Instances, Mesh, Solid, Surface, encloses, shape_bounds
from fgf_warp.upload import build_box_tree
from tests.benchmarks.instances import MOST_MEGABYTES, costs, measure, write_stage
from tests.contracts.device_kernels import RICH, hit_meshes
from tests.contracts.test_bvh import directions, knot
from tests.scenes import instance_of, transform

ROOT = Path(__file__).resolve().parents[2]


def affine(rng, *, mirrored=False, shear=0.0, at=2.0):
    """A rotation of a stretch of a shear, somewhere."""
    turned = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turned *= np.sign(np.linalg.det(turned)) * (-1 if mirrored else 1)
    matrix = np.eye(4)
    matrix[:3, :3] = turned @ np.diag(rng.uniform(0.3, 2.0, size=3)) @ (np.eye(3) + shear * rng.normal(size=(3, 3)))
    matrix[:3, 3] = rng.uniform(-at, at, size=3)
    return matrix


def in_world(instance: Instances) -> Mesh:
    """The same triangles without an instance; a mirror turns them, so that their fronts stay where they are."""
    (matrix,) = instance.object_to_world
    triangles = instance.prototype.triangles
    if np.linalg.det(matrix[:3, :3]) < 0:
        triangles = triangles[:, [0, 2, 1]]
    points = instance.prototype.points @ matrix[:3, :3].T + matrix[:3, 3]
    return replace(instance.prototype, points=points, triangles=triangles)


def soup(seed, count=100, **of_mesh):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(count, 1, 3)) + 0.3 * rng.normal(size=(count, 3, 3))
    return Mesh(f"/soup{seed}", points.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3), **of_mesh)


def test_instances_are_what_their_meshes_are_in_world_space():
    """Turned, stretched, sheared, mirrored and nested ones, of two meshes, beside a mesh in world space."""
    rng = np.random.default_rng(1)
    meshes = [soup(1, surface=Surface()), soup(2, count=16, surface=Surface())]
    group = affine(rng, mirrored=True)
    matrices = [affine(rng, mirrored=k % 4 > 1, shear=0.3 * (k % 3), at=4) for k in range(40)]
    matrices += [group @ matrix for matrix in matrices[:5]]
    instances = [instance_of(f"/{k}", meshes[k % 2], matrix) for k, matrix in enumerate(matrices)]
    ground = soup(3, surface=Surface())
    origin, direction = rng.uniform(-6, 6, size=(20_000, 3)).astype(np.float32), directions(20_000, 2)
    direction[:60] = np.tile(np.concatenate([np.eye(3), -np.eye(3)]), (10, 1))
    found = hit_meshes([ground, *instances], origin, direction, kept=RICH)
    expected = hit_meshes([ground, *map(in_world, instances)], origin, direction, kept=RICH)
    met = found.t >= 0
    assert met.sum() > 5000
    assert np.bincount(found.item[met], minlength=46).min() > 5
    same = (found.item == expected.item) & (found.face == expected.face) & met
    assert np.mean(same == met) > 0.9995
    assert np.allclose(found.t[same], expected.t[same], rtol=1e-4, atol=1e-5)
    steep = same & (np.abs((found.normal * direction).sum(axis=1)) > 0.05)
    assert np.abs(found.normal - expected.normal)[steep].max() < 1e-3
    is_mirrored = np.array([False, *(np.linalg.det(m[:3, :3]) < 0 for m in matrices)])[found.item]
    u, v = np.where(is_mirrored, (found.v, found.u), (found.u, found.v))
    assert np.abs(np.array([u - expected.u, v - expected.v]))[:, steep].max() < 1e-3


@pytest.mark.parametrize("seed", range(4))
def test_no_ray_leaves_a_closed_instance_unseen(seed):
    """Half a million rays from inside at corners and edges of triangles, mirrored and sheared for odd seeds."""
    n = 250_000
    rng = np.random.default_rng(seed)
    matrix = affine(rng, mirrored=seed % 2 == 1, shear=0.4 * (seed % 2), at=20)
    mesh = knot(14, 112, medium=0)
    instance = instance_of("/instance", mesh, matrix)
    target = mesh.points[mesh.triangles][rng.integers(len(mesh.triangles), size=500)]
    on_edge = rng.random((500, 1))
    # The tube's spine runs through the middle of each ring of 14 corners.
    spine = mesh.points.reshape(112, 14, 3).mean(axis=1)
    for points in (target[:, 0], target[:, 0] * on_edge + target[:, 1] * (1 - on_edge)):
        nearest = spine[np.argmin(((points[:, None] - spine) ** 2).sum(-1), axis=1)]
        origin = np.repeat(nearest, n // 500, axis=0)
        towards = np.repeat(points, n // 500, axis=0) - origin
        origin = origin + towards * rng.uniform(0, 0.5, size=(n, 1))
        origin, towards = origin @ matrix[:3, :3].T + matrix[:3, 3], towards @ matrix[:3, :3].T
        direction = towards / np.linalg.norm(towards, axis=1, keepdims=True)
        assert (hit_meshes([instance], origin, direction, kept=RICH, inside=1).t < 0).sum() == 0


@pytest.mark.parametrize("inside", [0, 1])
def test_a_face_of_an_instance_just_behind_the_origin_is_met(inside):
    """The ray should have crossed it, and was rounded behind it: in world space, far from the world's origin."""
    rng = np.random.default_rng(3)
    square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    sheet = Mesh("/sheet", square, np.array([[0, 1, 2], [0, 2, 3]]))
    object.__setattr__(sheet, "medium", 0)
    matrix = affine(rng, mirrored=True, shear=0.3, at=30)
    normal = np.linalg.inv(matrix[:3, :3]).T @ [0, 0, 1]
    normal /= np.linalg.norm(normal)
    outwards = normal * (1 if inside else -1)
    within = np.append(rng.uniform(-0.95, 0.95, size=(20_000, 2)), np.zeros((20_000, 1)), axis=1)
    origin = within @ matrix[:3, :3].T + matrix[:3, 3]
    # Coordinates are some 30 here, and float32 rounds them by 2e-6.
    origin += outwards * rng.uniform(0, 2e-5, size=(20_000, 1))
    direction = directions(20_000, 10)
    cosine = direction @ outwards
    direction = direction * np.sign(cosine)[:, None] + outwards * 0.05
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    hits = hit_meshes([instance_of("/instance", sheet, matrix)], origin, direction, kept=RICH, inside=inside)
    assert np.all((hits.t >= 0) & (hits.t < 1e-3))


def test_an_instance_moves_along_lines():
    rng = np.random.default_rng(5)
    mesh = soup(1, surface=Surface())
    opening, closing = affine(rng), affine(rng, shear=0.2)
    resting = instance_of("/rests", mesh, affine(rng, at=4))
    moving = instance_of("/moves", mesh, opening, closing)
    origin, direction = rng.uniform(-6, 6, size=(20_000, 3)).astype(np.float32), directions(20_000, 2)
    for time in (0.0, 0.25, 0.9):
        found = hit_meshes([resting, moving], origin, direction, kept=RICH, time=time)
        there = instance_of("/there", mesh, (1 - time) * opening + time * closing)
        expected = hit_meshes([resting, there], origin, direction, kept=RICH)
        met = found.t >= 0
        assert (found.item[met] == 1).sum() > 100
        assert np.mean(met == (expected.t >= 0)) > 0.999
        both = met & (found.item == expected.item) & (found.face == expected.face)
        assert both.sum() > 0.999 * met.sum()
        assert np.allclose(found.t[both], expected.t[both], rtol=1e-4, atol=1e-5)


def test_what_casts_no_shadow_does_not_block():
    mesh = Mesh("/near", np.array([[-1, -1, 1.0], [1, -1, 1], [0, 1, 1]]), np.array([[0, 1, 2]]), Surface())
    behind = instance_of("/behind", mesh, transform(at=(0, 0, -1)), shadow_links=0b10)
    shapes = [replace(mesh, shadow_links=0b01), behind]
    ray = [[0, 0, 3.0]], [[0, 0, -1.0]]
    met = [hit_meshes(shapes, *ray, kept=RICH, casters=casters).t[0] for casters in (0, 0b01, 0b10, 0b100)]
    assert met == pytest.approx([2, 2, 3, -1])


def test_a_point_is_in_an_instance_where_it_is_in_its_mesh():
    mesh = knot(14, 112, medium=0)
    matrix = affine(np.random.default_rng(7), mirrored=True, shear=0.2)
    instance = instance_of("/instance", mesh, matrix)
    spine = mesh.points.reshape(112, 14, 3).mean(axis=1)[5]
    assert encloses(instance, matrix[:3, :3] @ spine + matrix[:3, 3])
    assert not encloses(instance, matrix[:3, :3] @ [0, 0, 0.9] + matrix[:3, 3])


def test_many_solids_are_met_as_one_after_the_other():
    """Spheres, cubes and cylinders, some in motion, beside an instance and a mesh."""
    rng = np.random.default_rng(9)
    kinds = ("sphere", "cube", "cylinder")
    solids = [
        Solid(f"/{k}", kinds[k % 3], affine(rng, at=6), Surface(), closing=affine(rng, at=6) if k % 5 == 0 else None)
        for k in range(2 * MANY_SOLIDS)
    ]
    others = [soup(3, surface=Surface()), instance_of("/instance", soup(4, surface=Surface()), affine(rng))]
    origin, direction = rng.uniform(-8, 8, size=(20_000, 3)).astype(np.float32), directions(20_000, 2)
    found = hit_meshes([*others, *solids], origin, direction, kept=RICH, time=0.3)
    few = [solids[k : k + MANY_SOLIDS] for k in (0, MANY_SOLIDS)]
    parts = [hit_meshes(others, origin, direction, kept=RICH, tried=part, time=0.3) for part in few]
    distances = np.array([np.where(part.t < 0, np.inf, part.t) for part in parts])
    nearest, ray = distances.argmin(axis=0), np.arange(20_000)
    met = found.t >= 0
    assert np.array_equal(met, np.isfinite(distances.min(axis=0)))
    assert np.array_equal(found.t[met], distances.min(axis=0)[met])
    item = np.array([part.item for part in parts])[nearest, ray]
    item += np.where(item > 1, nearest * MANY_SOLIDS, 0)
    assert len(np.unique(item[met])) > 100
    assert np.array_equal(found.item[met], item[met])
    assert np.array_equal(found.normal[met], np.array([part.normal for part in parts])[nearest, ray][met])
    assert np.all(found.face[met & (found.item > 1)] == -1)


def test_instances_are_the_same_together_as_one_by_one():
    """Of two meshes and a solid, some of them in motion: equal to the bit."""
    rng = np.random.default_rng(11)
    opening = np.array([affine(rng, shear=0.2, at=4) for _ in range(40)])
    closing = np.array([one if k % 3 else affine(rng, at=4) for k, one in enumerate(opening)])
    ball = Solid("/ball", "cylinder", affine(rng), Surface())
    of = [soup(1, surface=Surface()), soup(2, count=16, surface=Surface()), ball]
    parts = [range(40), range(5), range(5, 40)]
    together = [
        Instances(prototype.name, prototype, opening[part, :3], None if prototype is ball else closing[part, :3])
        for prototype, part in zip(of, parts, strict=True)
    ]
    alone = [
        instance_of(f"/{k}", prototype, opening[k], closing[k] if k % 3 == 0 else None)
        for prototype, part in zip(of[:2], parts, strict=False)
        for k in part
    ]
    alone += [replace(ball, object_to_world=opening[k] @ ball.object_to_world) for k in parts[2]]
    alone += [Solid(f"/far{k}", "sphere", transform(at=(1e6, 0, k)), Surface()) for k in range(MANY_SOLIDS)]
    origin, direction = rng.uniform(-8, 8, size=(20_000, 3)).astype(np.float32), directions(20_000, 2)
    found, expected = (hit_meshes(shapes, origin, direction, kept=RICH, time=0.3) for shapes in (together, alone))
    assert len(np.unique(found.item[found.t >= 0])) == 80
    for field in ("t", "item", "face", "normal"):
        assert np.array_equal(getattr(found, field), getattr(expected, field))
    low, high = shape_bounds(together[0])
    boxes = [shape_bounds(one) for one in alone[:40]]
    assert np.array_equal(low, np.min([one for one, _ in boxes], axis=0))
    assert np.array_equal(high, np.max([one for _, one in boxes], axis=0))


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (dict(object_to_world=np.zeros((2, 3, 4))), r"/i: object_to_world\[0\] is of no use; accepted: finite, inv"),
        (dict(object_to_world=np.full((2, 3, 4), np.nan)), r"/i: object_to_world\[0\] is of no use"),
        (dict(closing=np.eye(4)[None, :3]), r"/i: closing must be an \(n, 3, 4\) array"),
        (dict(numbers=np.arange(3)), r"/i: numbers must be a \(2,\) array"),
        (dict(primvars={"a": np.ones((1, 3))}), r"/i: primvar 'a' has the shape \(1, 3\); accepted: \(2, k\)"),
        (
            dict(prototype=knot(5, 10, medium=0)),
            "/i: 2 instances are filled with a medium; accepted: each",
        ),
        (
            dict(prototype=Solid("/s", "cube", np.eye(4), medium=0)),
            "/i: a solid that is filled or moves is no pro",
        ),
    ],
)
def test_instances_that_do_not_fit_are_refused(changed, message):
    placed = Instances("/i", knot(5, 10), np.array([transform(at=(k, 0, 0))[:3] for k in range(2)]))
    with pytest.raises(SceneError, match=message):
        replace(placed, **changed)


def test_every_box_is_in_one_leaf_and_in_the_boxes_above_it():
    """Of few boxes, which are sorted into bins, and of many."""
    rng = np.random.default_rng(3)
    for count in (1, 2, 9, 16, 17, 500):
        for leaf in (1, LEAF):
            low = np.round(rng.normal(size=(count, 3)) * 4).astype(np.float32)
            tree = build_box_tree(low.copy(), low + np.float32(1), leaf)
            assert sorted(tree.order) == list(range(count))
            assert tree.leaves[:, 1].max() <= leaf
            assert tree.leaves[:, 1].sum() == count
            for node, kids in enumerate(tree.children):
                boxes = tree.boxes[node]
                for lane in np.flatnonzero(kids < 0):
                    first, held = tree.leaves[-1 - kids[lane]]
                    inside = low[tree.order[first : first + held]]
                    assert np.array_equal(boxes[0::2, lane], inside.min(axis=0))
                    assert np.array_equal(boxes[1::2, lane], inside.max(axis=0) + 1)


MEASURE = """
import resource, sys
from dataclasses import replace
import numpy as np
from fgf_warp.features import required_features
from fgf_warp.integrator.program import build_program
from fgf_warp.scene import Instances, Surface
from fgf_warp.settings import RenderSettings
from fgf_warp.upload import upload
from tests.contracts.test_bvh import knot
from tests.scenes import furnace, transform

mesh = knot(5, 100, surface=Surface())
assert len(mesh.triangles) == 1000
places = np.tile(transform(0.3)[:3], (int(sys.argv[1]), 1, 1))
places[:, 0, 3], places[:, 1, 3] = np.divmod(np.arange(len(places)), 300)
scene = replace(furnace(), shapes=(Instances("/many", mesh, places),))
settings = RenderSettings()
uploaded = upload(scene, settings, [scene.media], [0], build_program(required_features(scene, settings)))
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""


def test_a_hundred_thousand_instances_cost_little():
    """Of a mesh of 1000 triangles: the peak of resident memory, scene and upload, against that of one instance.

    Some 35 MB, of which 10 are the matrices; as a Python object each they would be 500.
    """

    def peak(count):
        command = [sys.executable, "-c", MEASURE, str(count)]
        return float(subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()[-1])

    assert peak(100_000) - peak(1) < 70


@pytest.mark.slow
def test_a_million_instances_are_read_placed_and_rendered_in_seven_hundred_megabytes(tmp_path):
    """Of a mesh of 1000 triangles, from a stage; the first process builds the kernel."""
    path = tmp_path / "many.usdc"
    write_stage(path, 1_000_000)
    measure(path)
    assert costs(measure(path))[1] < MOST_MEGABYTES
