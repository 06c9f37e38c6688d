"""Which camera is taken, and what its film, lens and shutter come to."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom

from fgf_warp.errors import SceneError
from fgf_warp.scene import Camera
from tests.usd.prims import CAMERA, HEADER, TWO_CAMERAS
from usd_scenes.reader import look_at, read_scene
from usd_scenes.reader.bounds import scene_bounds

ASSETS = Path(__file__).parents[3] / "shared" / "usd_assets"
ANIMATED = ASSETS / "PixarAnimationStudios__OpenUSD/pxr/usdImaging/usdImagingGL/testenv/testUsdImagingGLAnimatedCamera"


def film(body: str) -> str:
    return f'def Camera "Film"\n{{\n{body}\n}}\n'


# Which camera


def test_the_cameras_window_is_that_of_usd(read) -> None:
    prim = """def Camera "Film"
{
    float focalLength = 35
    float horizontalAperture = 30
    float verticalAperture = 20
    float horizontalApertureOffset = 3
    float verticalApertureOffset = -2
}
"""
    camera = read(prim, camera="").scene.camera
    gf = Gf.Camera(
        focalLength=35,
        horizontalAperture=30,
        verticalAperture=20,
        horizontalApertureOffset=3,
        verticalApertureOffset=-2,
    )
    window = gf.frustum.window
    expected = (window.GetMin()[0], window.GetMax()[0], window.GetMin()[1], window.GetMax()[1])
    np.testing.assert_allclose(camera.window(300, 200), expected, rtol=1e-6)


def test_the_cameras_transform_is_the_prims(read) -> None:
    prim = (
        'def Xform "Rig"\n{\n float xformOp:rotateY = 90\n uniform token[] xformOpOrder = ["xformOp:rotateY"]\n'
        + CAMERA
        + "}"
    )
    camera = read(prim, camera="").scene.camera
    assert camera.name == "/Rig/Camera"
    np.testing.assert_allclose(camera.position, [9, 0, 0], atol=1e-12)
    np.testing.assert_allclose(camera.camera_to_world[:3, :3] @ [0, 0, -1], [-1, 0, 0], atol=1e-12)


@pytest.mark.parametrize(("asked", "path"), [("A", "/A"), ("/A", "/A"), ("/Y/B", "/Y/B")])
def test_a_camera_is_chosen_by_path_or_unique_name(read, asked: str, path: str) -> None:
    assert read(TWO_CAMERAS, chosen=asked).scene.camera.name == path


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ("C", "camera 'C' is not a camera of the stage; it has: /Camera, /A, /X/B, /Y/B"),
        ("B", "camera 'B' is the name of several cameras; it has: /Camera, /A, /X/B, /Y/B"),
    ],
)
def test_a_camera_that_is_not_there_is_refused_with_a_list(read, asked: str, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        read(TWO_CAMERAS, chosen=asked)


def test_of_several_cameras_the_first_is_used_with_a_warning(read) -> None:
    reading = read(TWO_CAMERAS)
    assert reading.scene.camera.name == "/Camera"
    assert "4 cameras and none asked for: the first is used: /Camera" in reading.warnings


@pytest.mark.parametrize(("up", "above", "front"), [("Y", 1, 2), ("Z", 2, 1)])
def test_the_default_view_holds_everything_from_the_front(read, up: str, above: int, front: int) -> None:
    prims = """def Cube "C"
{
    double3 xformOp:translate = (5, 6, 7)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
    reading = read(prims, camera="", header=HEADER.replace('"Y"', f'"{up}"'))
    camera = reading.scene.camera
    assert "no camera: the view is from the front and holds everything" in reading.warnings
    corners = np.array(np.meshgrid(*zip(*scene_bounds(reading.scene.shapes), strict=True))).reshape(3, -1).T
    seen = (corners - camera.position) @ camera.camera_to_world[:3, :3]
    left, right, bottom, top = camera.window(400, 300)
    x, y = seen[:, 0] / -seen[:, 2], seen[:, 1] / -seen[:, 2]
    assert (seen[:, 2] < 0).all()
    assert left < x.min() and x.max() < right and bottom < y.min() and y.max() < top
    assert camera.position[above] > [5, 6, 7][above]
    assert (camera.position[front] - [5, 6, 7][front]) * (1 if up == "Y" else -1) > 0
    assert camera.camera_to_world[above, 1] > 0.9


# Film and lens


def test_an_orthographic_camera_sees_its_aperture(read) -> None:
    camera = read(
        film('token projection = "orthographic"\nfloat fStop = 2\nfloat focusDistance = 3'), camera=""
    ).scene.camera
    assert camera.projection == "orthographic"
    assert not camera.has_lens


def test_a_lens_is_read(read) -> None:
    unfocused = film('token projection = "orthographic"\nfloat fStop = 2')
    assert not read(unfocused, camera="").scene.camera.has_lens
    camera = read(film("float fStop = 2.8\nfloat focusDistance = 7.5\nfloat focalLength = 35"), camera="").scene.camera
    assert (camera.f_stop, camera.focus_distance, camera.focal_length) == (2.8, 7.5, 35)
    assert camera.has_lens


def test_a_clipping_range_holds_where_it_is_authored(read) -> None:
    assert read(film(""), camera="").scene.camera.clipping_range == (0, math.inf)
    assert read(film("float2 clippingRange = (0.5, 20)"), camera="").scene.camera.clipping_range == (0.5, 20)


def test_exposure_is_that_of_usd(read) -> None:
    body = "float exposure = 1\nfloat exposure:time = 0.01\nfloat exposure:iso = 400\nfloat exposure:fStop = 2"
    expected = 2 * 0.01 * 400 / 100 / 2**2
    assert read(film(body), camera="").scene.camera.exposure_scale == pytest.approx(expected, rel=1e-6)
    assert read(film(""), camera="").scene.camera.exposure_scale == 1


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("float focalLength = 0", "/Film.focalLength = 0; accepted: > 0"),
        ("float fStop = -1", "/Film.fStop = -1; accepted: >= 0"),
        (
            "float fStop = 2\nfloat focusDistance = 0",
            "/Film.focusDistance = 0; accepted: > 0 with fStop = 2; a pinhole has fStop = 0",
        ),
        ("float2 clippingRange = (3, 2)", r"/Film.clippingRange = \(3, 2\); accepted: two numbers, 0 <= near < far"),
        ("float2 clippingRange = (-1, 2)", r"/Film.clippingRange = \(-1, 2\); accepted"),
        ('token projection = "fisheye"', "/Film.projection = fisheye; accepted: perspective, orthographic"),
        ("float exposure:fStop = 0", "/Film: exposure, .* come to a scale of inf; accepted: finite and > 0"),
        ("double shutter:open = 1\ndouble shutter:close = 0", "shutter:close = 0; accepted: >= shutter:open = 1"),
    ],
)
def test_bad_cameras_are_refused_strictly(read, body: str, message: str) -> None:
    with pytest.raises(SceneError, match=r"stage.usda: .*" + message):
        read(film(body), camera="", strict=True)


def test_a_lens_that_is_focused_nowhere_is_a_pinhole_by_name(read) -> None:
    reading = read(film("float fStop = 2") + 'def Sphere "Ball"\n{\n}', camera="")
    assert reading.scene.camera.f_stop == 0
    assert reading.warnings == ("fStop without a focusDistance is not used: the camera is a pinhole: /Film",)


def test_what_a_camera_ignores_is_named(read) -> None:
    reading = read(film("float4[] clippingPlanes = [(0, 0, 1, 5)]") + 'def Sphere "Ball"\n{\n}', camera="")
    assert reading.warnings == ("clippingPlanes of a camera are not supported and are ignored: /Film",)


# Shutter

MOVING = """def Camera "Film"
{
    double shutter:open = -0.25
    double shutter:close = 0.5
    double3 xformOp:translate.timeSamples = { 0: (0, 0, 0), 10: (20, 0, 0) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Sphere "Ball"
{
    double3 xformOp:translate.timeSamples = { 0: (0, 0, -5), 10: (0, 10, -5) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""


def test_the_shutter_is_relative_to_the_frame(read) -> None:
    camera = read(MOVING, camera="", frame=4).scene.camera
    assert camera.position[0] == pytest.approx(2 * 3.75)
    assert camera.closing is not None
    assert camera.closing[0, 3] == pytest.approx(2 * 4.5)


def test_a_shutter_that_opens_in_an_instant_stops_all_motion(read) -> None:
    still = MOVING.replace("-0.25", "0.5")
    camera = read(still, camera="", frame=4).scene.camera
    assert camera.closing is None
    assert camera.position[0] == pytest.approx(2 * 4)


def test_a_camera_at_rest_has_no_motion(read) -> None:
    assert read(MOVING.replace("(20, 0, 0)", "(0, 0, 0)"), camera="", frame=4).scene.camera.closing is None


@pytest.mark.parametrize("frame", [None, "default"])
def test_without_a_frame_nothing_moves_with_a_warning(read, frame) -> None:
    reading = read(MOVING, camera="", frame=frame)
    assert reading.scene.camera.closing is None
    assert "no frame is chosen for the shutter to open at: nothing moves: /Film" in reading.warnings


def test_the_stages_start_is_a_frame(read) -> None:
    started = HEADER.replace("(\n", "(\n    startTimeCode = 4\n", 1)
    assert read(MOVING, camera="", header=started).scene.camera.position[0] == pytest.approx(2 * 3.75)


# Cameras of others


@pytest.mark.skipif(
    not ANIMATED.is_dir(), reason="the third-party stages of ../shared/usd_assets are not on this machine"
)
@pytest.mark.parametrize("frame", [1, 2.5, 9])
def test_an_animated_camera_is_where_usd_has_it(frame: float) -> None:
    path = ANIMATED / "cameraMoving.usda"
    camera = read_scene(path, frame=frame).scene.camera
    stage = Usd.Stage.Open(str(path))
    gf = UsdGeom.Camera.Get(stage, camera.name).GetCamera(frame)
    np.testing.assert_allclose(camera.position, gf.transform.ExtractTranslation())
    assert (camera.f_stop, camera.focus_distance) == pytest.approx((gf.fStop, gf.focusDistance))
    assert camera.clipping_range == pytest.approx((gf.clippingRange.min, gf.clippingRange.max))


@pytest.mark.skipif(
    not ASSETS.is_dir(), reason="the third-party stages of ../shared/usd_assets are not on this machine"
)
def test_a_shot_is_seen_through_its_camera() -> None:
    path = ASSETS / "PixarAnimationStudios__OpenUSD/extras/usd/tutorials/endToEnd/assets/shot.usd"
    assert read_scene(path).scene.camera.name == "/World/main_cam"


@pytest.mark.parametrize("center", [(0.0, 1.0, -1e38), (0.0, 1e200, 0.0)])
def test_a_camera_that_is_where_it_looks_is_refused_and_nothing_printed(center, recwarn) -> None:
    """As far from the origin a distance of 6 is lost in rounding, or a square overflows."""
    target = np.array(center)
    with pytest.raises(SceneError, match="camera_to_world must be"):
        Camera("/C", look_at(target + np.array([0, 0, 6.0]), target, np.array([0.0, 1.0, 0.0])))
    assert not recwarn.list
