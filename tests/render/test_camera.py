"""Cameras beyond the pinhole: lens, parallel rays, clipping planes, exposure and motion, against closed forms."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fgf_warp.errors import SceneError
from fgf_warp.features import required_features
from fgf_warp.renderer import render
from fgf_warp.scene import Camera, DomeLight, Medium, Mesh, Scene, Solid, Surface
from fgf_warp.settings import Aov, RenderSettings
from tests import stats
from tests.render.test_media import BOX, CORNERS
from tests.scenes import transform

BLACK, WHITE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
SETTINGS = RenderSettings(width=32, height=32, spp=64, seed=3)


def glowing(*spheres, view, sky=BLACK) -> Scene:
    """Black spheres (radius, center, emission) that glow, in a sky."""
    shapes = tuple(
        Solid(f"/ball{k}", "sphere", transform(radius, at), Surface(BLACK, emission))
        for k, (radius, at, emission) in enumerate(spheres)
    )
    return Scene(view, shapes, lights=(DomeLight("/sky", sky),))


def from_above(**of_camera) -> Camera:
    """A camera at z = 5 that looks down at the origin; its film is 4 stage units wide where its rays are parallel."""
    return Camera(
        "/camera",
        transform(at=(0, 0, 5)),
        **{"focal_length": 50.0, "horizontal_aperture": 40.0, "vertical_aperture": 40.0} | of_camera,
    )


@pytest.mark.parametrize(
    ("policy", "square", "wide"),
    [
        ("expandAperture", (-1, 1, -1, 1), (-2, 2, -0.5, 0.5)),
        ("cropAperture", (-0.5, 0.5, -0.5, 0.5), (-1, 1, -0.25, 0.25)),
        ("adjustApertureWidth", (-0.5, 0.5, -0.5, 0.5), (-2, 2, -0.5, 0.5)),
        ("adjustApertureHeight", (-1, 1, -1, 1), (-1, 1, -0.25, 0.25)),
        ("adjustPixelAspectRatio", (-1, 1, -0.5, 0.5), (-1, 1, -0.5, 0.5)),
    ],
)
def test_what_gives_way_where_image_and_film_differ(policy, square, wide):
    film = Camera("/camera", np.eye(4), 2.0, 4.0, 2.0, conform_policy=policy)
    assert film.window(100, 100) == square
    assert film.window(400, 100) == wide
    # Pixels twice as high as wide make of the one image the other, but where they are found.
    assert replace(film, pixel_aspect_ratio=0.25).window(400, 100) == square
    orthographic = replace(film, projection="orthographic", horizontal_offset=1.0)
    np.testing.assert_allclose(orthographic.window(100, 100), 0.2 * np.array(square) + [0.1, 0.1, 0, 0])
    with pytest.raises(SceneError, match="pixel_aspect_ratio = 0; accepted: > 0"):
        replace(film, pixel_aspect_ratio=0.0)


def test_a_lens_of_no_width_is_a_pinhole():
    view = from_above(focus_distance=3.0)
    balls = ((1.0, (0, 0, 0), WHITE), (0.2, (0.3, 0.2, 3.0), (0.3, 0.6, 0.1)))
    pinhole = render(glowing(*balls, view=view), SETTINGS)
    lens = render(glowing(*balls, view=replace(view, f_stop=1e7)), SETTINGS)
    assert np.abs(pinhole.radiance - lens.radiance).max() <= 1.0 / SETTINGS.spp + 1e-6
    assert np.abs(pinhole.radiance - lens.radiance).mean() < 1e-5


@pytest.mark.parametrize("depth", [2.0, 4.5])
def test_a_point_out_of_focus_is_a_disc(depth):
    """Uniform, of radius R |1/F - 1/D| on the plane at unit distance, so that its mean square radius is half of that.

    A far small ball stands for the point: its own picture, of mean square radius r^2 / (2 D^2), is folded in.
    """
    focus, radius, tiny, width = 3.0, 0.25, 0.02, 0.2
    view = from_above(
        f_stop=50.0 * 0.1 / (2 * radius), focus_distance=focus, horizontal_aperture=10.0, vertical_aperture=10.0
    )
    assert view.lens_radius == pytest.approx(radius)
    ball = (tiny, (0.0, 0.0, 5.0 - depth), WHITE)
    result = render(glowing(ball, view=view), replace(SETTINGS, spp=4096))
    light = result.radiance[..., 0].astype(np.float64)
    grid = ((np.arange(32) + 0.5) / 32 - 0.5) * width
    x, y = np.meshgrid(grid, grid)
    disc = radius * abs(1 / focus - 1 / depth)
    expected = disc**2 / 2 + tiny**2 / depth**2 / 2 + (width / 32) ** 2 / 6
    assert (light * (x**2 + y**2)).sum() / light.sum() == pytest.approx(expected, rel=0.02)
    assert abs((light * x).sum() / light.sum()) < 0.02 * disc
    # As bright as the sharp picture over the disc's area, and dark beyond it.
    assert light.sum() * (width / 32) ** 2 == pytest.approx(math.pi * tiny**2 / depth**2, rel=0.03)
    assert not light[np.hypot(x, y) > disc + tiny / depth + width / 32].any()


def test_parallel_rays_show_the_area():
    view = from_above(projection="orthographic", horizontal_offset=3.0)
    result = render(glowing((1.2, (0.3, 0, 0), WHITE), view=view), replace(SETTINGS, spp=256, aovs={Aov.DEPTH}))
    pixel = (4.0 / 32) ** 2
    area, error = (
        result.radiance[..., 0].sum(dtype=np.float64) * pixel,
        math.sqrt(result.variance[..., 0].sum()) * pixel,
    )
    stats.assert_means(area, error, math.pi * 1.2**2, detects=0.01)
    # The film is shifted to x = 0.3: the ball is in its middle.
    assert result.aovs[Aov.DEPTH].min() == pytest.approx(3.8, abs=1e-3)
    assert np.unravel_index(result.aovs[Aov.DEPTH].argmin(), (32, 32)) in {(15, 15), (15, 16), (16, 15), (16, 16)}


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_clipping_planes(projection):
    """Three balls behind each other, at 2, 5 and 8 from the camera: the planes leave the middle one."""
    red, green, blue = np.eye(3)
    balls = [(0.4, (0, 0, 3), tuple(red)), (0.6, (0, 0, 0), tuple(green)), (2.5, (0, 0, -3.0), tuple(blue))]
    view = from_above(projection=projection, clipping_range=(3.0, 7.0))
    scene = glowing(*balls, view=view, sky=(0.0, 0.0, 0.25))
    result = render(scene, replace(SETTINGS, aovs={Aov.DEPTH}))
    depth = result.aovs[Aov.DEPTH]
    assert result.radiance[..., 0].max() == 0
    assert result.radiance[16, 16] == pytest.approx((0, 1, 0))
    assert depth.min() == pytest.approx(4.4, abs=5e-3)
    # The near part of the large ball is seen up to the far plane; beyond it there is the sky.
    middle = render(
        replace(scene, camera=replace(view, clipping_range=(0.0, 6.5))), replace(SETTINGS, aovs={Aov.DEPTH})
    )
    seen = middle.aovs[Aov.DEPTH][np.isfinite(middle.aovs[Aov.DEPTH])]
    assert seen.max() < 6.5
    assert middle.radiance[0, 0] == pytest.approx((0, 0, 0.25))
    # A plane through a ball shows its inside.
    cut = render(replace(scene, camera=replace(view, clipping_range=(5.0, 5.45))), replace(SETTINGS, aovs={Aov.DEPTH}))
    assert cut.aovs[Aov.DEPTH][np.isfinite(cut.aovs[Aov.DEPTH])].max() <= 5.45
    assert cut.radiance[16, 16] == pytest.approx((0, 0, 0.25))


def test_scattered_light_comes_from_beyond_the_clipping_planes():
    """Under a uniform sky a white ball is as bright as the sky, wherever the planes are, if they show it."""
    view = from_above(clipping_range=(4.5, 5.0))
    white = Solid("/ball", "sphere", transform(1.0), Surface(WHITE, BLACK))
    lamp = Solid("/lamp", "sphere", transform(50.0), Surface(BLACK, WHITE))
    result = render(Scene(view, (white, lamp)), replace(SETTINGS, aovs={Aov.ALBEDO}))
    # Rays begin inside the ball: none of its inside is within the planes but at its rim.
    assert result.radiance.max() <= 1 + 1e-5
    shown = replace(view, clipping_range=(3.0, 5.0))
    result = render(Scene(shown, (white, lamp)), SETTINGS)
    assert result.radiance[16, 16] == pytest.approx(WHITE, rel=1e-5)
    assert result.radiance[0, 0] == pytest.approx(BLACK), "the lamp is beyond the far plane"


def test_exposure_scales_the_image_and_its_error():
    scene = glowing((1.0, (0, 0, 0), WHITE), view=from_above())
    plain = render(scene, SETTINGS)
    exposed = render(replace(scene, camera=replace(scene.camera, exposure_scale=4.0)), SETTINGS)
    assert np.array_equal(exposed.radiance, 4 * plain.radiance)
    np.testing.assert_allclose(exposed.variance, 16 * plain.variance, rtol=1e-6)
    assert np.array_equal(exposed.alpha, plain.alpha)


def test_a_moving_camera_smears_what_rests():
    """Along the motion an edge becomes a ramp as wide as the path."""
    travel = 1.5
    view = from_above(projection="orthographic", closing=transform(at=(travel, 0, 5)))
    result = render(glowing((1.0, (0.5, 0, 0), WHITE), view=view), replace(SETTINGS, spp=1024))
    x = (np.arange(32) + 0.5) / 8 - 2
    row = result.radiance[15:17, :, 0].mean(axis=0)
    # At time s the ball's middle is at 0.5 - s travel; averaged over the pixel by a fine sum.
    s, offset = np.meshgrid((np.arange(500) + 0.5) / 500, (np.arange(50) + 0.5) / 400 - 1 / 16)
    expected = [np.mean(np.abs(at + offset - 0.5 + travel * s) < math.sqrt(1 - 1 / 16**2)) for at in x]
    np.testing.assert_allclose(row, expected, atol=0.02)


def test_a_turning_camera_keeps_its_shape():
    """It turns about its view axis: at half the time it is turned by half, and sees circles as circles."""
    quarter = np.eye(4)
    quarter[:2, :2] = [[0, -1], [1, 0]]
    view = from_above(closing=transform(at=(0, 0, 5)) @ quarter)
    result = render(glowing((1.0, (0, 0, 0), WHITE), view=view), replace(SETTINGS, spp=256))
    still = render(glowing((1.0, (0, 0, 0), WHITE), view=replace(view, closing=None)), replace(SETTINGS, spp=256))
    assert np.abs(result.radiance - still.radiance).max() < 0.15
    assert result.radiance.mean() == pytest.approx(still.radiance.mean(), rel=2e-3)


def test_a_camera_that_moves_is_a_ball_that_moves_the_other_way():
    """The picture, and the motion in it."""
    settings = replace(SETTINGS, spp=128, aovs={Aov.MOTION})
    view = from_above(clipping_range=(0.0, 100.0))
    here, there = transform(0.8, (0.3, 0.2, 0)), transform(0.8, (-0.4, 0.5, -1.0))
    step = transform(at=there[:3, 3] - here[:3, 3])
    ball = Solid("/ball", "sphere", here, Surface(BLACK, WHITE))
    sky = (DomeLight("/sky", (0.1, 0.1, 0.1)),)
    by_ball = render(Scene(view, (replace(ball, closing=there),), lights=sky), settings)
    moving = replace(view, closing=np.linalg.inv(step) @ view.camera_to_world)
    by_camera = render(Scene(moving, (ball,), lights=sky), settings)
    assert np.abs(by_ball.radiance - by_camera.radiance).mean() < 1e-4
    a, b = by_ball.aovs[Aov.MOTION], by_camera.aovs[Aov.MOTION]
    assert np.abs(a - b).mean() < 1e-3 * np.abs(a).mean()
    # At the closing it is smaller, farther to the left and higher.
    assert a[..., 0].min() < -1
    assert a[..., 1].min() < -0.5


def slab_scene(view: Camera, *, kind: str, top=1.0) -> Scene:
    """An absorbing slab from z = -1 to `top`, sigma_m = 0.7, of pink noise, with a second medium beside it."""
    medium = Medium("/fog", 0.7, BLACK, hurst=-0.25, white_noise_scale=0.5)
    scale, at = (40.0, 40.0, (top + 1) / 2), (0, 0, (top - 1) / 2)
    if kind == "solid":
        shape = Solid("/slab", "cube", transform(scale, at), medium=0)
    else:
        shape = Mesh("/slab", CORNERS * scale + at, BOX, medium=0)
    return Scene(view, (shape,), (medium,), (DomeLight("/sky", WHITE),))


def transmittance(scene: Scene, t: float) -> float:
    return (
        1.0
        if t == 0
        else float(scene.media[0].line_law.eval_kernels(scene.media[0].mean_extinction * t).transmittance_ss)
    )


@pytest.mark.parametrize("kind", ["solid", pytest.param("mesh", marks=pytest.mark.slow)])
@pytest.mark.parametrize("near", [0.0, 3.0, 4.5, 5.5, 7.0])
def test_the_near_plane_cuts_a_medium(kind, near):
    """Parallel rays from the plane's height to the slab's far side."""
    view = from_above(
        projection="orthographic", clipping_range=(near, math.inf), horizontal_aperture=1.0, vertical_aperture=1.0
    )
    scene = slab_scene(view, kind=kind)
    settings = replace(SETTINGS, spp=256, aovs={Aov.TRANSMITTANCE})
    result = render(scene, settings)
    length = min(max(5 - near + 1, 0.0), 2.0)
    assert np.abs(result.aovs[Aov.TRANSMITTANCE] / transmittance(scene, length) - 1).max() < 2e-5
    if length > 0:
        stats.assert_means(*stats.image_mean(result), transmittance(scene, length), detects=0.05)


@pytest.mark.parametrize("kind", ["solid", "mesh"])
def test_the_far_plane_cuts_a_medium(kind):
    """Light from beyond it comes through what is before it alone."""
    view = from_above(
        projection="orthographic", clipping_range=(0.0, 4.6), horizontal_aperture=1.0, vertical_aperture=1.0
    )
    scene = slab_scene(view, kind=kind)
    result = render(scene, replace(SETTINGS, spp=256, aovs={Aov.TRANSMITTANCE}))
    assert np.abs(result.aovs[Aov.TRANSMITTANCE] / transmittance(scene, 0.6) - 1).max() < 2e-5
    stats.assert_means(*stats.image_mean(result), transmittance(scene, 0.6), detects=0.05)


@pytest.mark.parametrize("kind", ["solid", pytest.param("mesh", marks=pytest.mark.slow)])
def test_rays_that_begin_in_and_beside_a_medium(kind):
    """A ray's own start says what it is in: the film of parallel rays lies across the side of a block."""
    view = from_above(projection="orthographic", clipping_range=(5.0, math.inf))
    scene = slab_scene(view, kind=kind)
    shape = scene.shapes[0]
    half = (np.array([0.5, 1, 1]), np.array([20.5, 0, 0]))
    if kind == "solid":
        matrix = transform(at=(20.5, 0, 0)) @ transform((20.0, 40.0, 1.0))
        scene = replace(scene, shapes=(replace(shape, object_to_world=matrix),))
    else:
        points = shape.points * (0.5, 1, 1) + half[1]
        scene = replace(scene, shapes=(replace(shape, points=points),))
    result = render(scene, replace(SETTINGS, spp=256, aovs={Aov.TRANSMITTANCE}))
    passed = result.aovs[Aov.TRANSMITTANCE][..., 0]
    assert (passed[:, :20] == 1).all()
    assert np.abs(passed[:, 20:] / transmittance(scene, 1.0) - 1).max() < 2e-5
    assert (result.radiance[:, :20] == 1).all()
    stats.assert_means(
        *stats.image_mean(replace(result, radiance=result.radiance[:, 20:])), transmittance(scene, 1.0), detects=0.05
    )


def test_a_kernel_finds_starts_only_where_they_differ():
    def finds(view, top=1.0):
        return required_features(slab_scene(view, kind="solid", top=top), SETTINGS).varied_starts

    pinhole = from_above()
    assert not finds(pinhole)
    assert not finds(pinhole, top=6.0), "one point, whatever it is in"
    assert not finds(replace(pinhole, clipping_range=(1.0, 100.0)))
    assert finds(replace(pinhole, clipping_range=(4.5, 100.0)))
    assert not finds(from_above(projection="orthographic"))
    assert finds(from_above(projection="orthographic", clipping_range=(4.5, 100.0)))
    assert finds(replace(pinhole, f_stop=2.0, focus_distance=3.0), top=6.0)
    assert finds(replace(pinhole, closing=transform(at=(0, 0, 0.5))))
    assert not finds(replace(pinhole, closing=transform(at=(0, 0, 1.5))))
