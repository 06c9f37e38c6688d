"""Lights on a diffuse plane against closed forms, and next-event estimation against paths that find the light."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fgf_warp.renderer import render
from fgf_warp.scene import (
    WHITE,
    AreaLight,
    CylinderLight,
    DistantLight,
    DomeLight,
    Image,
    Medium,
    MeshLight,
    Scene,
    Shaping,
    Solid,
    SphereLight,
    Surface,
)
from fgf_warp.settings import RenderSettings
from fgf_warp.theory import kernels
from fgf_warp.upload import lights as upload_lights
from tests import stats
from tests.grid import REGIMES
from tests.lighting import grey_image, irradiance
from tests.scenes import camera, transform

RHO = 0.6
HEIGHT = 2.0
SETTINGS = RenderSettings(width=16, height=16, spp=1024, seed=4)


def form_factor_of_square(half: float, height: float) -> float:
    """Of a square of half width `half` above a point below its centre."""
    a = half / height
    return 4 / (2 * math.pi) * 2 * a / math.sqrt(1 + a * a) * math.atan(a / math.sqrt(1 + a * a))


LIGHTS = {
    "distant delta": (DistantLight("/l", (math.sin(0.5), 0, -math.cos(0.5)), 0.0, (3.0,) * 3), 3 * math.cos(0.5)),
    "distant disc": (DistantLight("/l", (0, 0, -1), 0.3, (3.0,) * 3), 3 * math.pi * math.sin(0.3) ** 2),
    "sun": (
        DistantLight("/l", (0, 0, -1), math.radians(0.265), (5e4,) * 3),
        5e4 * math.pi * math.sin(math.radians(0.265)) ** 2,
    ),
    "dome": (DomeLight("/l", (2.0,) * 3), 2 * math.pi),
    "rect": (
        AreaLight("/l", "rect", (0, 0, HEIGHT), (1, 0, 0), (0, -1, 0), (5.0,) * 3),
        5 * math.pi * form_factor_of_square(1.0, HEIGHT),
    ),
    "disk": (AreaLight("/l", "disk", (0, 0, HEIGHT), (1, 0, 0), (0, -1, 0), (5.0,) * 3), 5 * math.pi / (1 + HEIGHT**2)),
    "sphere": (SphereLight("/l", (0, 0, HEIGHT), 0.7, (5.0,) * 3), 5 * math.pi * (0.7 / HEIGHT) ** 2),
}


@pytest.mark.parametrize("kind", LIGHTS)
def test_irradiance_on_a_plane(kind):
    """A pixel shows rho E / pi; sees a bias of 0.5 %."""
    light, irradiance = LIGHTS[kind]
    floor = Solid("/floor", "cube", transform((1e3, 1e3, 1), (0, 0, -1)), Surface((RHO,) * 3))
    scene = Scene(camera((1.5, 0, 0.7), (0, 0, 0), aperture=1e-4), (floor,), lights=(light,))
    result = render(scene, SETTINGS)
    stats.assert_means(*stats.image_mean(result), RHO * irradiance / math.pi, detects=0.005)


def dome_around_z(image, **more) -> DomeLight:
    """With its pole along z, longitude 0 along x and pi / 2 along y."""
    return DomeLight("/l", WHITE, image, ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), **more)


LATITUDES = np.pi / 2 - (np.arange(128) + 0.5) * np.pi / 128
SUN = np.full((32, 64), 0.5)
SUN[9, 40] = 1e6
DOWN = (0.0, 0.0, -1.0)
TILTED = (0.6, 0.0, -0.8)
SQUARE = np.array([[-1, -1, HEIGHT], [-1, 1, HEIGHT], [1, 1, HEIGHT], [1, -1, HEIGHT], [1, -1, HEIGHT + 1]])
"""Corners that go round clockwise seen from above; and one out of their plane."""
INTRICATE = {
    "cosine dome": dome_around_z(grey_image(np.maximum(np.sin(LATITUDES), 0)[:, None])),
    "dome of two hemispheres": dome_around_z(grey_image([[1.0], [0.0]])),
    "dome of random bytes": DomeLight("/l", (2.0,) * 3, grey_image(np.random.default_rng(3).random((5, 8)))),
    "dome with a sun": dome_around_z(grey_image(SUN)),
    "dome of one texel": DomeLight("/l", (2.0,) * 3, grey_image([[0.5]])),
    "linked dome": DomeLight("/l", (2.0,) * 3, link=3),
    "rect with half an image": AreaLight(
        "/l", "rect", (0, 0, HEIGHT), (1, 0, 0), (0, -1, 0), (5.0,) * 3, grey_image([[0.0, 1.0]])
    ),
    "rect with an image": AreaLight(
        "/l",
        "rect",
        (0.3, 0, HEIGHT),
        (1.5, 0.4, 0),
        (0, -1, 0.5),
        (5.0,) * 3,
        grey_image(np.random.default_rng(4).random((3, 4)) ** 4),
        ((0.0, -0.5, 0.5), (0.5, 0.0, 0.5)),
    ),
    "cylinder": CylinderLight("/l", (0, 0, HEIGHT), (2.0, 0, 0), 0.5, (5.0,) * 3),
    "tilted cylinder": CylinderLight("/l", (-1.0, 0.3, 1.5), (0.6, 0.5, 0.7), 0.4, (5.0,) * 3),
    "mesh": MeshLight("/l", SQUARE[[[0, 1, 2], [0, 2, 3]]], (5.0,) * 3),
    "bent mesh": MeshLight("/l", SQUARE[[[0, 1, 2], [0, 2, 4]]], (5.0,) * 3),
    "hard cone": SphereLight("/l", (0, 0, HEIGHT), 0.7, (5.0,) * 3, shaping=Shaping(TILTED, math.radians(40))),
    "soft cone": SphereLight("/l", (0, 0, HEIGHT), 0.7, (5.0,) * 3, shaping=Shaping(TILTED, math.radians(60), 0.8)),
    "focus": AreaLight(
        "/l",
        "disk",
        (0, 0, HEIGHT),
        (1, 0, 0),
        (0, -1, 0),
        (5.0,) * 3,
        shaping=Shaping(DOWN, math.pi, 0.0, 6.0, (0.3, 0.0, 0.0)),
    ),
    "shaped cylinder": CylinderLight(
        "/l", (0, 0, HEIGHT), (2.0, 0, 0), 0.5, (5.0,) * 3, shaping=Shaping(TILTED, math.radians(80), 0.5, 2.0)
    ),
}
CLOSED_FORMS = {
    "mesh": 5 * math.pi * form_factor_of_square(1.0, HEIGHT),
    "cosine dome": 2 * math.pi / 3,
    "dome of one texel": math.pi,
    "linked dome": 2 * math.pi,
    "rect with half an image": 2.5 * math.pi * form_factor_of_square(1.0, HEIGHT),
}
"""The others are integrated alone."""
BLACK = (0.0, 0.0, 0.0)
BELOW = (40.0, 30.0, -50.0)
UNSEEN = (
    AreaLight("/u", "rect", BELOW, (1, 0, 0), (0, 1, 0), BLACK, grey_image([[1.0]])),
    AreaLight("/u", "disk", BELOW, (1, 0, 0), (0, 1, 0), BLACK, link=0, shaping=Shaping(DOWN)),
    SphereLight("/u", BELOW, 1.0, BLACK),
    CylinderLight("/u", BELOW, (1, 0, 0), 1.0, BLACK),
    DomeLight("/u", BLACK, grey_image([[1.0]])),
    MeshLight("/u", SQUARE[None, :3] - 60.0, BLACK),
)
"""Black lights below the floor, so that all these scenes have one kernel."""


def chosen(monkeypatch, item: int) -> None:
    """Makes paths connect to one light alone."""
    monkeypatch.setattr(upload_lights, "choose_chances", lambda sources, scene: np.eye(len(sources))[item])


def floor_under(light, *shapes, **links) -> Scene:
    """A pixel shows rho E / pi of one point of the floor."""
    floor = Solid("/floor", "cube", transform((1e3, 1e3, 1), (0, 0, -1)), Surface((RHO,) * 3), **links)
    lights = light if isinstance(light, tuple) else (light, *UNSEEN)
    return Scene(camera((1.5, 0, 0.7), (0, 0, 0), aperture=1e-4), (floor, *shapes), lights=lights)


@cache
def expected_irradiance(kind: str) -> float:
    integrated = irradiance(INTRICATE[kind], points=1500 if kind in ("dome with a sun", "hard cone") else 500)
    if kind in CLOSED_FORMS:
        assert integrated == pytest.approx(CLOSED_FORMS[kind], rel=3e-4)
    return integrated


@pytest.mark.slow
@pytest.mark.parametrize("kind", INTRICATE)
def test_irradiance_of_intricate_lights(kind, monkeypatch):
    """As above: connections, weighed against paths that find the light."""
    chosen(monkeypatch, 0)
    result = render(floor_under(INTRICATE[kind], light_links=8), SETTINGS)
    stats.assert_means(*stats.image_mean(result), RHO * expected_irradiance(kind) / math.pi, detects=0.005)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [kind for kind in INTRICATE if kind != "dome with a sun"])
def test_intricate_lights_are_found_by_scattered_rays(kind, monkeypatch):
    """Without connections: sees a bias of 2.5 %."""
    chosen(monkeypatch, 1)
    result = render(floor_under(INTRICATE[kind], light_links=8), replace(SETTINGS, spp=1536))
    stats.assert_means(*stats.image_mean(result), RHO * expected_irradiance(kind) / math.pi, detects=0.025)


def test_many_lights_are_all_connected_to():
    """By the chances that follow from their power: the sum of all but a linked one, which does not shine here."""
    kinds = ("cosine dome", "dome of two hemispheres", "linked dome")
    away = AreaLight("/a", "rect", (400, 0, HEIGHT), (1, 0, 0), (0, -1, 0), (1e3,) * 3, link=4)
    lights = (*(INTRICATE[kind] for kind in kinds), away, *UNSEEN)
    result = render(floor_under(lights, light_links=8), SETTINGS)
    expected = sum(expected_irradiance(kind) for kind in kinds)
    stats.assert_means(*stats.image_mean(result), RHO * expected / math.pi, detects=0.005)


DIRECTIONS = {
    "+z": ((0, 0, 1), (0.5, 0.5)),
    "+x": ((1, 0, 0), (0.25, 0.5)),
    "-x": ((-1, 0, 0), (0.75, 0.5)),
    "-z, from +x": ((0.02, 0, -1), (0.0, 0.5)),
    "+y": ((0, 1, 0), (0.5, 0.0)),
    "-y": ((0, -1, 0), (0.5, 1.0)),
    "up and left": ((1, math.sqrt(2), 1), (0.375, 0.25)),
}
"""Where the camera looks, and the place in the image from its top left corner: OpenEXR's latitude and longitude."""
QUARTER_TURN = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0))
"""Around y, from z to x."""


@pytest.mark.parametrize("turned", [False, True], ids=["as it is", "turned"])
@pytest.mark.parametrize("name", DIRECTIONS)
def test_a_dome_is_seen_where_the_format_says(name, turned):
    """A red spot on blue at one place of the image, and the camera looking there: red, and blue to the other side."""
    towards, (s, t) = DIRECTIONS[name]
    pixels = np.zeros((32, 64, 4), dtype=np.float32)
    pixels[..., 2] = 1.0
    # The four texels around the place; at a pole all of a row.
    for row in {*np.clip([int(t * 32) - 1, int(t * 32)], 0, 31).tolist()}:
        columns = range(64) if t in (0.0, 1.0) else [int(s * 64) - 1, int(s * 64)]
        pixels[row, columns] = (1.0, 0.0, 0.0, 1.0)
    turn = np.array(QUARTER_TURN if turned else np.eye(3))
    dome = DomeLight("/l", (2.0,) * 3, Image("spot", pixels), tuple(map(tuple, turn.tolist())))
    speck = Solid("/speck", "cube", transform(1e-3, (50, 50, 50)), Surface())
    at = turn @ np.asarray(towards, dtype=float)
    for sign, color in ((1, (2, 0, 0)), (-1, (0, 0, 2))):
        scene = Scene(camera((0, 0, 0), sign * at, aperture=1e-3), (speck,), lights=(dome, *UNSEEN))
        result = render(scene, replace(SETTINGS, spp=1))
        assert np.allclose(result.radiance, color, atol=2e-2), (sign, result.radiance[0, 0])
        assert not result.alpha.any()


def test_lights_shine_on_what_they_are_linked_to(monkeypatch):
    chosen(monkeypatch, 0)
    kept = render(floor_under(replace(INTRICATE["cylinder"], link=2), light_links=4), SETTINGS)
    free = render(floor_under(INTRICATE["cylinder"], light_links=3), SETTINGS)
    assert np.array_equal(kept.radiance, free.radiance)
    for light in (INTRICATE["cylinder"], INTRICATE["dome of random bytes"]):
        assert not render(floor_under(replace(light, link=2), light_links=3), SETTINGS).radiance.any()


def test_only_linked_shapes_cast_shadows(monkeypatch):
    """A lid under the light casts one where its bit is set; and connections alone carry the light, without bias."""
    chosen(monkeypatch, 0)
    light = replace(INTRICATE["rect with an image"], shadow_link=1)

    def lid(bits):
        return Solid("/lid", "cube", transform((50, 50, 0.01), (0, 0, 1)), Surface(BLACK), shadow_links=bits)

    open_ = render(floor_under(light, lid(1)), SETTINGS)
    expected = RHO * irradiance(light) / math.pi
    stats.assert_means(*stats.image_mean(open_), expected, detects=0.005)
    closed = render(floor_under(light, lid(2)), replace(SETTINGS, max_depth=1))
    assert not closed.radiance.any()


def block_under(light, **links) -> Scene:
    """A block of a medium over a floor; the light may be linked to the block alone."""
    shapes = (
        Solid("/floor", "cube", transform((20, 20, 1), (0, 0, -2)), Surface((0.5,) * 3), light_links=8),
        Solid("/block", "cube", np.eye(4), medium=0, **links),
    )
    medium = dict(mean_extinction=1.5, albedo=(0.9,) * 3, asymmetry=0.6) | REGIMES["pink"]
    return Scene(camera((5, 3, 1.5), (0, 0, 0)), shapes, (Medium("/medium", **medium),), (light, *UNSEEN))


BLOCK_SETTINGS = RenderSettings(width=16, height=16, spp=4096, seed=1)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "detects"), [("dome of random bytes", 0.1), ("mesh", 0.15)])
def test_media_under_intricate_lights(kind, detects, monkeypatch):
    """Connections from media, weighed, against paths that find the light: the same picture."""
    scene = block_under(INTRICATE[kind], light_links=8)
    chosen(monkeypatch, 0)
    connected = render(scene, replace(BLOCK_SETTINGS, spp=1024))
    chosen(monkeypatch, 1)
    found = render(scene, replace(BLOCK_SETTINGS, seed=2))
    stats.assert_images_agree(connected, found, blocks=2, detects=detects)


@pytest.mark.slow
def test_links_of_media(monkeypatch):
    """A light shines in a block that it is linked to as if it were free; a block that casts no shadow dims nothing."""
    chosen(monkeypatch, 0)
    light = SphereLight("/l", (0, 0, 8), 0.5, (5.0,) * 3)
    settings = replace(BLOCK_SETTINGS, spp=64)
    free = render(block_under(light), settings)
    linked = render(block_under(replace(light, link=3), light_links=8), settings)
    assert np.array_equal(free.radiance, linked.radiance)
    # Neither the block nor the floor is lit.
    assert not render(block_under(replace(light, link=5), light_links=8), settings).radiance.any()

    def below(bits):
        """The floor under the middle of an absorbing block, by light from straight above."""
        scene = block_under(DistantLight("/l", DOWN, 0.0, WHITE, shadow_link=4), shadow_links=bits)
        black = replace(scene.media[0], albedo=BLACK)
        view = camera((0, 0, -0.995), (0.001, 0, -1), aperture=1e-3)
        return render(replace(scene, camera=view, media=(black,)), settings)

    law = block_under(light).media[0].line_law
    passed = float(kernels.transmittance_ss(law.b, law.kappa, law.mean_extinction * 2.0))
    # The camera is in the block, close to the floor.
    assert below(1 << 4).radiance.mean() == pytest.approx(0.5 / math.pi * passed, rel=0.015)
    assert below(1 << 5).radiance.mean() == pytest.approx(0.5 / math.pi, rel=0.015)


def test_a_flat_light_is_black_from_behind():
    light, _ = LIGHTS["rect"]
    scene = Scene(camera((0, 0, 5), (0, 0, 0), aperture=0.1), lights=(light,))
    result = render(scene, SETTINGS)
    assert not result.radiance.any()
    assert (result.alpha == 1).all()


def test_lights_are_seen_at_their_radiance():
    light, _ = LIGHTS["sphere"]
    scene = Scene(camera((0, -5, 2), (0, 0, 2), aperture=0.1), lights=(light, DomeLight("/d", (1.0,) * 3)))
    assert np.allclose(render(scene, SETTINGS).radiance, 5.0)


@pytest.mark.parametrize(
    ("regime", "transport"),
    [("exponential", None), ("pink", "reciprocal"), ("pink", "renewal"), ("fbm", "reciprocal"), ("negative", None)],
)
def test_connections_agree_with_paths_that_find_the_light(regime, transport):
    """A block over a floor under a rect light, and under a plate that glows: the same picture.

    The plate is found by chance alone, so this holds Tms and Tss of connections, their pdfs and weights against
    free flights.
    """

    def scene(light):
        shapes = [
            Solid("/floor", "cube", transform((20, 20, 1), (0, 0, -2)), Surface((0.5,) * 3)),
            Solid("/block", "cube", np.eye(4), medium=0),
        ]
        lights = ()
        if light:
            lights = (AreaLight("/light", "rect", (0, 0, 3), (2, 0, 0), (0, -2, 0), (1.0,) * 3),)
        else:
            shapes.append(
                Solid("/plate", "cube", transform((2, 2, 1e-3), (0, 0, 3.001)), Surface((0,) * 3, (1.0,) * 3))
            )
        medium = dict(mean_extinction=1.5, albedo=(0.9,) * 3, asymmetry=0.6, transport=transport) | REGIMES[regime]
        return Scene(camera((5, 3, 1.5), (0, 0, 0)), tuple(shapes), (Medium("/medium", **medium),), lights)

    settings = dict(width=32, height=32)
    connected = render(scene(light=True), RenderSettings(**settings, spp=2048, seed=1))
    found = render(scene(light=False), RenderSettings(**settings, spp=8192, seed=2))
    stats.assert_images_agree(connected, found, blocks=4, detects=0.05)
