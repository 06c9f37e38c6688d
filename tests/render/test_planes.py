"""The planes of a render beside its radiance, against closed forms."""

import math
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

from fgf_warp.renderer import render
from fgf_warp.scene import Camera, DistantLight, DomeLight, Medium, Scene, Solid, Surface
from fgf_warp.settings import RENDERED_AOVS, USUAL_AOVS, Aov, RenderSettings
from generators.planning.config import AovName
from tests import stats
from tests.scenes import transform

BLACK, WHITE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
ALL = RenderSettings(width=32, height=32, spp=64, seed=4, aovs=RENDERED_AOVS)
SUN = DistantLight("/sun", (0.0, 0.0, -1.0), 0.2, WHITE)
THIN = Medium("/thin", 0.01, (0.5, 0.5, 0.5))


def seen_from_above(**of_camera) -> Camera:
    """Parallel rays down on the square [-2, 2]^2, from z = 5."""
    film = {"horizontal_aperture": 40.0, "vertical_aperture": 40.0, "projection": "orthographic"}
    return Camera("/camera", transform(at=(0, 0, 5)), **film | of_camera)


def ball(name: str, radius: float, at, **of_shape) -> Solid:
    return Solid(name, "sphere", transform(radius, at), **of_shape)


def block(name: str, scale, at, **of_shape) -> Solid:
    return Solid(name, "cube", transform(scale, at), **of_shape)


def full_scene(**of_camera) -> Scene:
    """A ball to the left, a thin slab to the right, and at the bottom two blocks, one over the other, of one name."""
    shapes = (
        ball("/ball", 0.9, (-1, 1, 0), surface=Surface((0.6,) * 3)),
        block("/slab", (0.9, 0.9, 0.5), (1, 1, 0), medium=0),
        block("/blocks", (1.5, 0.4, 0.1), (0, -1, -1), surface=Surface((0.2, 0.4, 0.8)), instance=7),
        block("/blocks", (0.5, 0.4, 0.1), (0, -1, 1), surface=Surface((0.5,) * 3, WHITE), instance=8),
    )
    return Scene(seen_from_above(**of_camera), shapes, (THIN,), (SUN, DomeLight("/sky", (0.2, 0.2, 0.4))))


@pytest.fixture(scope="module")
def full():
    return render(full_scene(), ALL)


def test_names():
    assert set(get_args(AovName)) == set(Aov)
    first = list(Aov)[: list(Aov).index(Aov.PRIM_ID) + 1]
    assert frozenset(first) == USUAL_AOVS, "the command line says: up to prim_id"


def place(x: float, y: float) -> tuple[int, int]:
    """Row and column that show a point."""
    return math.floor((2 - y) * 8), math.floor((x + 2) * 8)


def test_normal_of_a_ball(full):
    x, y = np.meshgrid((np.arange(32) + 0.5) / 8 - 2, 2 - (np.arange(32) + 0.5) / 8)
    u, v = (x + 1) / 0.9, (y - 1) / 0.9
    within = np.hypot(u, v) < 0.85
    normal = np.dstack([u, v, np.sqrt(np.maximum(1 - u**2 - v**2, 0))])
    assert within.sum() > 100
    assert np.abs(full.aovs[Aov.NORMAL] - normal)[within].max() < 0.02
    assert np.abs(full.aovs[Aov.NORMAL] - (0, 0, 1))[place(0, -1)].max() < 1e-6
    assert not full.aovs[Aov.NORMAL][place(0.0, 0.05)].any()


def test_ids_count_names_and_tell_instances(full):
    assert full.provenance["prims"] == ["/ball", "/slab", "/blocks"]
    prims, instances = full.aovs[Aov.PRIM_ID], full.aovs[Aov.INSTANCE_ID]
    assert prims.dtype == instances.dtype == np.int32
    assert (prims[place(-1, 1)], instances[place(-1, 1)]) == (1, -1)
    assert (prims[place(1.2, -1)], instances[place(1.2, -1)]) == (3, 7)
    assert (prims[place(0, -1)], instances[place(0, -1)]) == (3, 8), "the nearer one"
    assert (prims[place(0, 0.05)], instances[place(0, 0.05)]) == (0, -1)
    # A medium of optical depth 0.01 is there where one of 64 paths scatters in it; the lattice makes that 64 times as
    # probable as for one.
    rows, columns = slice(2, 14), slice(18, 30)
    assert set(np.unique(prims[rows, columns])) == {0, 2}
    share = (prims[rows, columns] == 2).mean()
    assert abs(share - 64 * (1 - math.exp(-0.01))) < 4 * math.sqrt(0.25 / prims[rows, columns].size)


def test_optical_depth_of_the_first_segment(full):
    assert full.aovs[Aov.OPTICAL_DEPTH][place(1, 1)] == pytest.approx([0.01] * 3, rel=1e-4)
    assert not full.aovs[Aov.OPTICAL_DEPTH][place(-1, 1)].any()
    transmittance = full.aovs[Aov.TRANSMITTANCE]
    np.testing.assert_allclose(
        transmittance[2:14, 18:30], np.exp(-full.aovs[Aov.OPTICAL_DEPTH][2:14, 18:30]), rtol=1e-4
    )


def test_direct_and_indirect_are_the_radiance(full):
    direct, indirect = full.aovs[Aov.DIRECT], full.aovs[Aov.INDIRECT]
    np.testing.assert_allclose(direct + indirect, full.radiance, rtol=1e-6, atol=1e-7)
    assert (indirect >= 0).all()
    assert not indirect[place(0, 0.05)].any(), "the sky is seen at once"
    # The upper block sees the sky and the sun alone; it glows.
    assert not indirect[place(0, -1)].any()
    # The lower one sees the upper one's underside and light from it, which the upper one has from elsewhere.
    assert indirect[place(0.7, -1)].min() > 0


def test_direct_light_of_a_surface_is_what_one_bounce_brings():
    """The first two of the events of a path: with paths cut at one event there is nothing else."""
    scene = full_scene()
    settings = replace(ALL, spp=256, max_depth=1)
    cut, whole = render(scene, settings), render(scene, replace(settings, max_depth=64, seed=9))
    assert not cut.aovs[Aov.INDIRECT].any()
    stats.assert_planes_agree(cut.aovs[Aov.DIRECT], whole.aovs[Aov.DIRECT], detects=0.02)
    assert whole.aovs[Aov.INDIRECT].mean() > 1e-3


def test_scatterings_in_a_thin_slab():
    """Nearly every path scatters once at most: where it meets the slab, and is not absorbed there."""
    view = seen_from_above(horizontal_aperture=1.0, vertical_aperture=1.0)
    slab = block("/slab", (500.0, 500.0, 0.5), (0, 0, 0), medium=0)
    aside = ball("/aside", 0.1, (1e4, 0, 0), surface=Surface(WHITE))
    scene = Scene(
        view, (slab, aside), (replace(THIN, albedo=WHITE),), (replace(SUN, radiance=BLACK), DomeLight("/sky", WHITE))
    )
    result = render(scene, replace(ALL, spp=4096))
    assert np.array_equal(result.aovs[Aov.SCATTERINGS], result.aovs[Aov.COLLISIONS][..., 0])
    # Of those that scatter, less than u (2 - ln u) scatter again: the mean optical depth to the faces is below it.
    u = 0.01
    mean, error = stats.image_mean(replace(result, radiance=result.aovs[Aov.SCATTERINGS][..., None]))
    first = 1 - math.exp(-u)
    assert first - 4 * error < mean < first * (1 + u * (2 - math.log(u))) + 4 * error
    assert result.aovs[Aov.OPTICAL_DEPTH] == pytest.approx(u, rel=1e-4)
    assert set(np.unique(result.aovs[Aov.PRIM_ID])) == {1}


def test_nothing_moves_where_nothing_moves(full):
    assert not full.aovs[Aov.MOTION].any()


def test_motion_of_a_camera_is_its_displacement_over_the_depth():
    """To the right and up by 0.2 and 0.1: what is at depth d moves the other way, by focal length * 0.2 / d."""
    closing = transform(at=(0.2, 0.1, 5))
    view = seen_from_above(projection="perspective", focal_length=20.0, closing=closing)
    result = render(
        replace(full_scene(), camera=view), replace(ALL, aovs=frozenset({Aov.MOTION, Aov.DEPTH, Aov.PRIM_ID}))
    )
    motion, per_unit = result.aovs[Aov.MOTION], 32 / 2  # 32 pixels for a window of 2 at unit distance
    assert motion.shape == (32, 32, 2)
    for (x, y), depth in (((0, -1), 3.9), ((-1.2, -1), 5.9)):
        row, column = math.floor(16 - per_unit * (y - 0.05) / depth), math.floor(16 + per_unit * (x - 0.1) / depth)
        assert motion[row, column] == pytest.approx((-per_unit * 0.2 / depth, per_unit * 0.1 / depth), rel=1e-4)
    assert not motion[0, 16].any()


def test_motion_of_parallel_rays_does_not_depend_on_depth():
    view = seen_from_above(closing=transform(at=(0.25, 0, 5)))
    result = render(
        replace(full_scene(), camera=view), replace(ALL, aovs=frozenset({Aov.MOTION, Aov.DEPTH, Aov.PRIM_ID}))
    )
    shown = result.aovs[Aov.MOTION][place(0.1, -1)], result.aovs[Aov.MOTION][place(1.1, -1)]
    assert np.allclose(shown, (-2.0, 0.0), atol=1e-4)
