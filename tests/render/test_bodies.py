"""Bodies of one medium: those that touch are two media, those that overlap are one, shells of a mesh alike."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from fgf_warp.features import required_features
from fgf_warp.renderer import Variant, render, render_batch
from fgf_warp.scene import DistantLight, DomeLight, Instances, Medium, Mesh, Scene, Solid, Surface
from fgf_warp.settings import Aov, RenderSettings
from fgf_warp.theory.bsdf import fresnel_dielectric
from tests import stats
from tests.render.test_media import BLACK, BOX, CORNERS
from tests.render.test_mixed import NODES
from tests.scenes import camera, law_of, transform

SETTINGS = RenderSettings(width=32, height=32, spp=256, seed=17, aovs=frozenset({Aov.TRANSMITTANCE}))
KINDS = ("solid", "mesh", "instance")
MIXED_KINDS = (("solid", "mesh"), ("mesh", "instance"))
TRANSPORTS = ("reciprocal", "renewal", "mixed")
CUBE = Mesh("/cube", CORNERS, BOX)
TILT = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
TILT *= np.sign(np.linalg.det(TILT))
AT = np.array([3.0, -7.0, 11.0])


def placed(local):
    """A transform of the tilted world, in which no face is parallel to an axis."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = TILT, AT
    return matrix @ local


def view(position, towards=(0, 0, 0)):
    return camera(TILT @ position + AT, TILT @ towards + AT, aperture=1e-4)


def block(kind, name, low, high, wide=9.0):
    """A slab between two heights z, filled with the medium."""
    matrix = placed(transform((wide, wide, (high - low) / 2), (0, 0, (low + high) / 2)))
    if kind == "solid":
        return Solid(name, "cube", matrix, medium=0)
    if kind == "mesh":
        return Mesh(name, CORNERS @ matrix[:3, :3].T + matrix[:3, 3], BOX, medium=0)
    return Instances(name, replace(CUBE, medium=0), matrix[None, :3])


def joined(*meshes, name="/joined"):
    """One mesh of several, each a shell."""
    starts = np.cumsum([0, *(len(mesh.points) for mesh in meshes)])
    points = np.concatenate([mesh.points for mesh in meshes])
    triangles = np.concatenate([mesh.triangles + start for mesh, start in zip(meshes, starts, strict=False)])
    return Mesh(name, points, triangles, medium=0)


def scene_of(*shapes, sky=(1.0, 1.0, 1.0), at=(0, 0, 5), towards=(0, 0, 0), **medium):
    """These shapes, and out of sight one of each kind: all such scenes share a kernel."""
    medium = {"mean_extinction": 1.0, "albedo": BLACK, **law_of(0.5, 1.0)} | medium
    far = placed(transform(0.1, (50, 0, 9)))
    aside = (
        Solid("/solid", "cube", far, Surface(BLACK)),
        Mesh("/mesh", CORNERS @ far[:3, :3].T + far[:3, 3], BOX, Surface(BLACK)),
        Instances("/instance", replace(CUBE, surface=Surface(BLACK)), far[None, :3]),
        Solid("/other", "cube", placed(transform(0.1, (60, 0, 9))), medium=1),
        Solid("/another", "cube", placed(transform(0.1, (60, 0, 9))), medium=1),
    )
    media = (Medium("/medium", **medium), Medium("/frozen", 1.0, BLACK, transport="mixed", **law_of(0.5, 1.0)))
    sun = DistantLight("/sun", tuple(TILT @ (0, 0, -1)), 0.0, (1.0, 1.0, 1.0))
    lights = (DomeLight("/sky", sky), sun)
    return Scene(view(np.array(at, float), np.array(towards, float)), (*shapes, *aside), media, lights)


def tr(scene, *lengths):
    """Of segments one after the other."""
    law = scene.media[0].line_law
    return np.prod([law.eval_kernels(scene.media[0].mean_extinction * t).transmittance_ss for t in lengths])


def assert_passed(scene, *lengths, within=1e-4):
    """The camera sees through segments of these lengths; the plane tells of the first of them, in each pixel."""
    result = render(scene, SETTINGS)
    assert result.truncated_count == 0
    assert np.abs(result.aovs[Aov.TRANSMITTANCE] / tr(scene, lengths[0]) - 1).max() < within
    stats.assert_means(*stats.image_mean(result), tr(scene, *lengths), detects=0.03)


@pytest.mark.parametrize(
    "kinds",
    [*((kind, kind) for kind in KINDS), *(pytest.param(two, marks=pytest.mark.slow) for two in MIXED_KINDS)],
    ids=str,
)
@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("transport", TRANSPORTS)
def test_bodies_of_one_medium_that_touch_are_two_media(kinds, order, transport):
    """Two slabs, each of u = 1 and kappa = 1: Tr(1)^2 = 1/4, where one of u = 2 has 0.29 (b = 0.5) or 0.33 (b = 1)."""
    near, far = block(kinds[0], "/near", 0, 1), block(kinds[1], "/far", -1, 0)
    # Those that are all frozen, or have rates of their own, are told by either.
    for b in (0.5, 1.0) if transport == "mixed" else (0.5 if order == 1 else 1.0,):
        scene = scene_of(*(near, far)[::order], transport=transport, **law_of(b, 1.0))
        assert tr(scene, 1.0, 1.0) == pytest.approx(0.25, rel=1e-6)
        assert_passed(scene, 1.0, 1.0)


@pytest.mark.parametrize("kinds", [("solid", "mesh"), ("instance", "instance"), ("mesh", "mesh")], ids=str)
@pytest.mark.parametrize("size", [1.0, 200.0])
def test_they_touch_at_a_slant_too(kinds, size):
    """At 80 degrees, through slabs as wide as nine or 1,800 of their thickness, whose corners float32 moves by 1e-4."""
    at = np.array([math.tan(math.radians(80)), 0.3, 1.0])
    far = 1 / (at[2] / np.linalg.norm(at))
    near, behind = (block(kind, f"/{k}", -k, 1 - k, wide=9 * size) for k, kind in enumerate(kinds))
    scene = scene_of(near, behind, at=3 * at, mean_extinction=0.2)
    assert_passed(scene, far, far, within=1e-3)


@pytest.mark.parametrize("kinds", [("solid", "solid"), ("mesh", "mesh"), ("instance", "solid")], ids=str)
@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("transport", TRANSPORTS)
def test_bodies_of_one_medium_that_overlap_are_one(kinds, order, transport):
    """However little: a thousandth here."""
    for overlap in (0.7, 1e-3):
        near, far = block(kinds[0], "/near", 0, 1), block(kinds[1], "/far", -1 + overlap, overlap)
        scene = scene_of(*(near, far)[::order], transport=transport)
        assert_passed(scene, 2.0 - overlap)


def floor_below(**medium):
    """A white floor under two slabs that touch."""
    floor = Solid("/floor", "cube", placed(transform((1e4, 1e4, 0.5), (0, 0, -1.5))), surface=Surface((1.0,) * 3))
    slabs = (block("solid", "/near", 0, 0.5, wide=1e4), block("mesh", "/far", -0.5, 0, wide=1e4))
    return scene_of(*slabs, floor, **medium)


@pytest.mark.parametrize("transport", TRANSPORTS)
def test_a_connection_sees_two_media_as_well(transport):
    """The floor, seen from below the slabs, in the light of a sun above them."""
    scene = floor_below(transport=transport, sky=BLACK, at=(0, 0, -0.75), towards=(0.1, 0, -1), mean_extinction=2.0)
    mean, error = stats.image_mean(result := render(scene, SETTINGS))
    expected = 0.25 / math.pi
    if transport == "mixed":
        stats.assert_means(mean, error, expected, detects=0.02)
    else:
        assert np.abs(result.radiance / expected - 1).max() < 1e-4


def test_each_body_is_frozen_at_rates_of_its_own():
    """Seen through both slabs the floor sends light back through both: the two ways are one inside each body's law."""
    scene = floor_below(transport="mixed", mean_extinction=0.8, **law_of(1.0, 1.0))
    scene = replace(scene, lights=(scene.lights[0], replace(scene.lights[1], radiance=BLACK)))
    cosine, weight = NODES
    both = np.array([tr(scene, 0.5 + 0.5 / c) for c in cosine])
    expected = (2 * cosine * weight) @ both**2
    result = render(scene, replace(SETTINGS, spp=512))
    mean, error = stats.image_mean(result)
    stats.assert_means(mean, error, expected, detects=0.02)
    shared = (2 * cosine * weight) @ [tr(scene, 1 + 1 / c) for c in cosine]
    forgotten = (2 * cosine * weight) @ [tr(scene, 0.5, 0.5, 0.5 / c, 0.5 / c) for c in cosine]
    assert min(abs(expected - shared), abs(expected - forgotten)) > 5 * error, "what is wrong looks alike"


SHELLS = {
    "overlap": ([(0, 1), (-0.3, 0.7)], 1.3),
    "three": ([(0, 1), (-0.3, 0.7), (-0.6, 0.4)], 1.6),
    "nested": ([(0, 1), (0.25, 0.75)], 1.0),
    "nested with a common face": ([(0, 1), (0.25, 1)], 1.0),
    "the same twice": ([(0, 1), (0, 1)], 1.0),
}


def shells(spans, kind):
    """One mesh, or an instance of it, of slabs between these heights, the later ones less wide."""
    blocks = [block("mesh", "/shell", *span, wide=9.0 - k) for k, span in enumerate(spans)]
    mesh = joined(*blocks)
    if kind == "mesh":
        return mesh
    return Instances("/joined", replace(mesh, points=2 * mesh.points), transform(0.5)[None, :3])


@pytest.mark.parametrize("name", SHELLS)
@pytest.mark.parametrize(("kind", "transport"), [("mesh", "reciprocal"), ("instance", "mixed")])
def test_shells_of_one_mesh_are_the_union(name, kind, transport):
    spans, length = SHELLS[name]
    for order in itertools.permutations(spans) if kind == "mesh" else [spans]:
        assert_passed(scene_of(shells(order, kind), transport=transport), length)


def test_a_camera_in_the_overlap_is_in_the_union():
    """0.2 below it is the face of one shell, and 0.65 that of the other."""
    mesh = shells([(-0.2, 0.8), (-0.65, 0.35)], "mesh")
    assert_passed(scene_of(mesh, at=(0, 0, 0), towards=(0, 0, -1)), 0.65)


def test_a_camera_in_a_cavity_is_in_nothing():
    """Of a shell that another one overlaps beside the cavity."""
    outer, hole = block("mesh", "/a", -2, 1), block("mesh", "/b", -0.5, 0.5, wide=3.0)
    lower = block("mesh", "/c", -2.5, -1.5)
    mesh = joined(outer, replace(hole, triangles=hole.triangles[:, ::-1], medium=None), lower)
    assert_passed(scene_of(mesh, at=(0, 0, 0), towards=(0, 0, -1)), 2.0)


def test_a_shell_that_faces_inwards_alone_is_turned():
    upper, lower = block("mesh", "/a", 0, 1), block("mesh", "/b", -3, -2.5)
    mesh = joined(upper, replace(lower, triangles=lower.triangles[:, ::-1], medium=None))
    assert_passed(scene_of(mesh), 1.0, 0.5)


def test_touching_shells_of_one_mesh_are_two_media():
    mesh = joined(block("mesh", "/a", 0, 1), block("mesh", "/b", -1, 0))
    assert_passed(scene_of(mesh), 1.0, 1.0)


def apart(kind, spans=2):
    """One mesh, or an instance of it, of slabs of 1 that are so far apart that boxes of their triangles do not meet."""
    mesh = joined(*(block("mesh", "/apart", -40 * k, 1 - 40 * k) for k in range(spans)))
    assert mesh.bodies == (mesh,)
    return mesh if kind == "mesh" else Instances("/joined", mesh, np.eye(4)[None, :3])


@pytest.mark.parametrize("kind", ["mesh", "instance"])
def test_each_shell_that_lies_apart_is_frozen_at_rates_of_its_own(kind):
    """Tr(1)^2 = 0.25, as of two prims; of one body whose two segments add up it is Tr(2) at b = 0.5: 0.29."""
    mesh = apart(kind)
    scene = scene_of(mesh, transport="mixed", **law_of(0.5, 1.0))
    assert tr(scene, 1.0, 1.0) == pytest.approx(0.25, rel=1e-6)
    assert_passed(scene, 1.0, 1.0)
    # The other transports forget between them anyway, and cross the mesh as it is.
    assert mesh in scene_of(mesh, transport="reciprocal", **law_of(0.5, 1.0)).shapes


def test_a_sweep_takes_shells_apart_where_they_are_frozen():
    """Of the scene that the images share the medium is not frozen."""
    shared = scene_of(apart("mesh"), transport="reciprocal", **law_of(0.5, 1.0))
    frozen = scene_of(apart("mesh"), transport="mixed", **law_of(0.5, 1.0))
    assert len(frozen.shapes) == len(shared.shapes) + 1
    variants = [Variant(scene.media, SETTINGS.seed) for scene in (shared, frozen, shared)]
    found = list(render_batch(shared, variants, SETTINGS))
    assert all(
        np.array_equal(image.radiance, render(scene, SETTINGS).radiance)
        for image, scene in zip(found, (shared, frozen, shared), strict=True)
    )


def test_a_cavity_stays_with_the_shell_around_it():
    """Above and below it a frozen path has one rate, so that the two segments add up inside the law."""
    outer, hole = block("mesh", "/a", -1, 1), block("mesh", "/b", -0.5, 0.5, wide=3.0)
    mesh = joined(outer, replace(hole, triangles=hole.triangles[:, ::-1], medium=None), block("mesh", "/c", -60, -59))
    scene = scene_of(mesh, transport="mixed", **law_of(0.5, 1.0))
    assert [len(shape.triangles) for shape in scene.shapes if shape.name == "/joined"] == [24, 12]
    share = scene.frozen_share(0, scene.media[0])
    expected = (share * tr(scene, 1.0) + (1 - share) * tr(scene, 0.5, 0.5)) * tr(scene, 1.0)
    mean, error = stats.image_mean(render(scene, SETTINGS))
    stats.assert_means(mean, error, expected, detects=0.02)
    assert abs(expected - tr(scene, 0.5, 0.5, 1.0)) > 5 * error, "keeping and forgetting look alike"


def test_shells_for_which_there_is_no_room_stay_one_body_with_a_warning():
    """Two of the 32 shapes are taken by `scene_of`; a mesh of 31 shells stays whole, and one of 3 finds room."""
    many, few = apart("mesh", spans=31), replace(apart("mesh", spans=3), name="/few")
    scene = scene_of(many, few, transport="mixed", **law_of(0.5, 1.0))
    assert [shape.name for shape in scene.shapes if shape.medium == 0] == ["/joined", *["/few"] * 3]
    (warning,) = (text for text in scene.medium_warnings(0, scene.media[0]) if "shells" in text)
    assert warning.startswith("shells that lie apart in /joined share one extinction on a frozen path")
    for other in (few, apart("mesh", spans=30)):
        scene = scene_of(other, transport="mixed", **law_of(0.5, 1.0))
        assert not any("shells" in text for text in scene.medium_warnings(0, scene.media[0]))
    # A sweep asks about media in the place of the scene's.
    scene = scene_of(many, transport="reciprocal", **law_of(0.5, 1.0))
    assert not any("shells" in text for text in scene.medium_warnings(0, scene.media[0]))
    mixed = replace(scene.media[0], transport="mixed")
    assert any("shells" in text for text in scene.medium_warnings(0, mixed))


def test_light_scattered_in_overlapping_shells_is_that_of_the_union():
    """Two crossing bars as one mesh, against the same cross made of parts that a surface bounds once."""
    bars = [(-1.5, 1.5, -0.4, 0.4), (-0.4, 0.4, -1.5, 1.5)]
    solids = [(x0, x1, y0, y1, -0.3, 0.3) for x0, x1, y0, y1 in bars]

    def bar(x0, x1, y0, y1, z0, z1):
        low, high = np.array([x0, y0, z0]), np.array([x1, y1, z1])
        points = (CORNERS * (high - low) / 2 + (low + high) / 2) @ TILT.T + AT
        return Mesh("/bar", points, BOX, medium=0)

    medium = dict(albedo=(0.9,) * 3, mean_extinction=3.0, asymmetry=0.3)
    settings = replace(SETTINGS, spp=512, aovs=frozenset({Aov.TRANSMITTANCE}))
    scene = scene_of(joined(*(bar(*span) for span in solids)), **medium)
    wide = replace(scene.camera, horizontal_aperture=0.6, vertical_aperture=0.6)
    found = render(replace(scene, camera=wide), settings)
    points, triangles = cross()
    whole = Mesh("/cross", points @ TILT.T + AT, triangles, medium=0)
    expected = render(replace(scene_of(whole, **medium), camera=wide), replace(settings, seed=5))
    stats.assert_images_agree(found, expected, blocks=4, detects=0.05)


def cross():
    """The outline of two crossing bars, drawn out along z, as one closed mesh without inner faces."""
    outline = [(-0.4, -1.5), (0.4, -1.5), (0.4, -0.4), (1.5, -0.4), (1.5, 0.4), (0.4, 0.4)]
    outline += [(0.4, 1.5), (-0.4, 1.5), (-0.4, 0.4), (-1.5, 0.4), (-1.5, -0.4), (-0.4, -0.4)]
    points = np.array([(x, y, z) for z in (-0.3, 0.3) for x, y in outline])
    caps = [(0, 1, 2), (0, 2, 11), (2, 3, 4), (2, 4, 5), (5, 6, 7), (5, 7, 8), (8, 9, 10), (8, 10, 11)]
    caps += [(2, 5, 8), (2, 8, 11)]
    sides = [(k, (k + 1) % 12, 12 + (k + 1) % 12) for k in range(12)]
    sides += [(k, 12 + (k + 1) % 12, 12 + k) for k in range(12)]
    top = [(a + 12, b + 12, c + 12) for a, b, c in caps]
    return points, np.array([*((a, c, b) for a, b, c in caps), *top, *sides])


@pytest.mark.parametrize("kind", ["mesh", "instance"])
def test_shells_of_one_glass_refract_only_at_the_outside_of_the_union(kind):
    """A plate of 1.3, head-on: Beer and Lambert, and the series of Fresnel's reflections at its two faces."""
    mesh = replace(
        shells(SHELLS["overlap"][0], "mesh"), surface=Surface((1.0,) * 3, opacity=0.0, ior=1.5, roughness=0.0)
    )
    shape = (
        mesh
        if kind == "mesh"
        else Instances("/joined", replace(mesh, points=2 * mesh.points), transform(0.5)[None, :3])
    )
    medium = Medium("/ink", 1.0, BLACK)
    scene = Scene(view(np.array([0, 0, 5.0])), (shape,), (medium,), (DomeLight("/sky", (1.0, 1.0, 1.0)),))
    reflectance, passed = float(fresnel_dielectric(1.0, 1.5)), math.exp(-1.3)
    again = 1 - (reflectance * passed) ** 2
    share = (1 - reflectance) ** 2 * passed
    result = render(scene, replace(SETTINGS, spp=512))
    expected = reflectance + share * (1 + reflectance * passed) / again
    stats.assert_means(*stats.image_mean(result), expected, detects=0.02)
    assert np.abs(result.aovs[Aov.TRANSMITTANCE] - 1).max() < 1e-6, "the camera is outside"


def test_only_bodies_that_may_touch_make_the_kernel_tell():
    above, scene = Solid("/above", "cube", transform((9, 9, 0.5), (0, 0, 0.5)), medium=0), scene_of()
    for gap, medium, contacts in ((0.0, 0, True), (1e-6, 0, True), (0.01, 0, False), (0.0, 1, False)):
        below = Solid("/below", "cube", transform((9, 9, 0.5), (0, 0, -0.5 - gap)), medium=medium)
        scene = replace(scene, shapes=(above, below))
        assert required_features(scene, SETTINGS).contacts is contacts
        assert scene.neighbours == ((above, below) if contacts else ())
