"""What a scene makes its kernel pay for, and the reasons that are given for it."""

from dataclasses import replace

from fgf_warp.features import explain, required_features
from fgf_warp.scene import AreaLight, DistantLight, Medium, Mesh, Scene, Solid, SphereLight, Surface
from fgf_warp.settings import Aov, RenderSettings
from tests.grid import REGIMES
from tests.render.test_media import BOX, CORNERS
from tests.scenes import furnace, transform

SETTINGS = RenderSettings()


def scene_of(shapes, lights=(), media=None) -> Scene:
    base = furnace()
    return replace(base, shapes=tuple(shapes), lights=tuple(lights), media=media or base.media)


BALL = Solid("/ball", "sphere", transform(), medium=0)
CAN = Solid("/can", "cylinder", transform(), surface=Surface())
BLOCK = Mesh("/block", CORNERS, BOX, medium=0)
LAMPS = (
    AreaLight("/rect", "rect", (0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 1)),
    SphereLight("/bulb", (0, 0, 0), 1.0, (1, 1, 1)),
    DistantLight("/sun", (0, 0, -1), 0.0, (1, 1, 1)),
)


def test_a_lone_solid_has_neither_surfaces_nor_lights_nor_boundaries():
    features = required_features(furnace(), SETTINGS)
    assert (features.solids, features.lone_law, features.lone_solid) == ({"sphere"}, "exponential", "sphere")
    assert not (features.crossings or features.connections or features.surfaces or features.meshes or features.aovs)


def test_only_the_kinds_that_are_there():
    features = required_features(scene_of((BALL, CAN), LAMPS), SETTINGS)
    assert features.solids == {"sphere", "cylinder"}
    assert features.shaped_lights == {"rect", "sphere"}
    assert features.distant_lights
    assert not features.environment


def test_what_ends_the_road_of_the_lone_solid():
    assert required_features(scene_of((BLOCK,)), SETTINGS).lone_solid == ""
    assert required_features(scene_of((BLOCK,)), SETTINGS).lone_law == "exponential"
    two = scene_of((BALL, replace(BALL, name="/other")))
    assert (required_features(two, SETTINGS).lone_law, required_features(two, SETTINGS).crossings) == ("", True)
    assert required_features(furnace(extinction_color=(1, 2, 3)), SETTINGS).lone_law == ""


def reasons(scene, settings=SETTINGS):
    return {reason.part: (reason.built, reason.why) for reason in explain(scene, settings)}


def test_reasons_name_what_asks_for_a_part():
    found = reasons(scene_of((BALL, CAN), LAMPS), replace(SETTINGS, aovs=frozenset({Aov.DEPTH})))
    assert found["spheres, cubes, cylinders"] == (True, "/ball, /can")
    assert found["surfaces"] == (True, "/can")
    assert found["meshes"] == (False, "nothing needs it")
    assert found["connections to lights"] == (True, "/rect, /bulb, /sun")
    assert found["even environment"] == (False, "nothing needs it")
    assert found["plane: depth"] == (True, "asked for")
    assert found["plane: albedo"] == (False, "not asked for")
    assert found["one law for all flights: exponential"][0]
    assert found["one chord through the medium"][0]


def test_only_the_phase_functions_that_fill_a_shape():
    hazy, dusty, unused = (
        Medium(f"/{kind}", mean_extinction=1.0, phase_function=kind) for kind in ("isotropic", "draine", "two_lobe")
    )
    assert required_features(furnace(), SETTINGS).phases == {"hg"}
    assert required_features(scene_of(()), SETTINGS).phases == frozenset()
    both = scene_of((BALL, replace(BALL, name="/other", medium=1)), media=(hazy, dusty, unused))
    features = required_features(both, SETTINGS)
    assert (features.phases, features.phase_parameters) == ({"isotropic", "draine"}, ("asymmetry", "draine_alpha"))
    assert reasons(both)["phase functions: draine, isotropic"] == (True, "/draine, /isotropic")
    assert reasons(scene_of(()))["phase functions"] == (False, "nothing needs it")


def test_a_medium_that_fills_nothing_is_no_reason():
    colourful = Medium("/unused", mean_extinction=1.0, extinction_color=(1, 2, 3))
    found = reasons(scene_of((BALL,), media=(*furnace(**REGIMES["pink"]).media, colourful)))
    assert found["channels of their own extinction"] == (False, "nothing needs it")
    assert found["one law for all flights: fractional"][0]


def test_long_lists_are_cut():
    found = reasons(scene_of(replace(CAN, name=f"/can{k}") for k in range(5)))
    assert found["surfaces"] == (True, "/can0, /can1, /can2 and 2 more")
    assert found["media"] == (False, "nothing needs it")
