import pytest

import usd_scenes.reader.stage
from fgf_warp.errors import SceneError
from generators.planning.digest import canonical
from usd_scenes.reader import EditError, OpenStages, read_scene

STAGE = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = 1
    upAxis = "Y"
)
def Xform "World"
{
    def Sphere "Ball" (
        variants = {
            string size = "small"
        }
        prepend variantSets = "size"
    )
    {
        double3 xformOp:translate.timeSamples = {
            1: (1, 2, 3),
            2: (4, 5, 6),
        }
        double3 xformOp:translate:other = (0, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        variantSet "size" = {
            "small" {
                double radius = 1
            }
            "large" {
                double radius = 2

                def SphereLight "Glow"
                {
                }
            }
        }
    }
    def Sphere "Off" (
        active = false
    )
    {
    }
    def DomeLight "Sky"
    {
        color3f inputs:color = (1, 0.5, 0.25)
        string note = "clear"
        int count = 3
        float3[] many = [(1, 2, 3)]
        int2 pair = (1, 2)
        float inputs:intensity.connect = </World/Looks.inputs:level>
    }
    def Material "Looks"
    {
        float inputs:level = 1
    }
    def Xform "Original"
    {
        def Sphere "Inside"
        {
        }
    }
    def Xform "Copy" (
        instanceable = true
        references = </World/Original>
    )
    {
    }
}
"""


@pytest.fixture
def edited(tmp_path):
    """Reads the stage with other values."""
    path = tmp_path / "stage.usda"
    path.write_text(STAGE)
    return lambda edits, **choices: read_scene(path, edits=edits, **choices).scene


def ball(scene):
    return next(shape for shape in scene.shapes if shape.name == "/World/Ball")


def test_a_number_of_a_vector_is_edited_and_the_others_are_those_of_the_frame(edited):
    scene = edited({"/World/Ball.xformOp:translate[1]": 9.0}, frame=2.0)
    assert ball(scene).object_to_world[:3, 3].tolist() == [4, 9, 6]
    (sky,) = edited({"/World/Sky.inputs:color[2]": 1.5}).lights
    assert sky.radiance == (1.0, 0.5, 1.5)


def test_a_variant_is_chosen_before_what_it_brings_is_edited(edited):
    edits = {"/World/Ball/Glow.inputs:radius": 0.25, "/World/Ball{size}": "large"}
    scene = edited(edits)
    assert ball(scene).object_to_world[0, 0] == 2
    assert [light.name for light in scene.lights] == ["/World/Ball/Glow", "/World/Sky"]


def test_an_attribute_without_a_value_of_its_own_takes_one(edited):
    assert edited({"/World/Sky.inputs:exposure": 1.0}).lights[0].radiance == (2.0, 1.0, 0.5)


def test_the_next_reading_is_without_the_edits(edited):
    with OpenStages():
        assert ball(edited({"/World/Ball.radius": 5.0, "/World/Ball{size}": "large"})).object_to_world[0, 0] == 5
        assert ball(edited({})).object_to_world[0, 0] == 1
        with pytest.raises(EditError):
            edited({"/World/Ball.radius": 5.0, "/World/No.radius": 5.0})
        assert ball(edited({})).object_to_world[0, 0] == 1


@pytest.mark.parametrize(
    ("target", "value", "message"),
    [
        ("/World/Bal.radius", 1.0, r"there is no prim /World/Bal; did you mean /World/Ball\?"),
        ("/World/Off.radius", 1.0, "there is no prim /World/Off"),
        ("/World/Ball.radios", 1.0, r"/World/Ball has no attribute radios; did you mean radius\?"),
        ("/World/Ball.xformOp:translate", 1.0, r"is of type double3; accepted: .*translate\[0\] to \[2\]"),
        ("/World/Ball.xformOp:translate[3]", 1.0, r"is of type double3; accepted: .*translate\[0\] to \[2\]"),
        ("/World/Ball.radius[0]", 1.0, r"is of type double; accepted: /World/Ball.radius$"),
        ("/World/Ball.xformOp:translate:other[0]", 1.0, "is of no effect, since xformOpOrder of /World/Ball"),
        ("/World/Sky.note", 1.0, "is of type string; accepted: a number, or one of a vector"),
        ("/World/Sky.many[0]", 1.0, r"is of type float3\[\]; accepted: a number"),
        ("/World/Sky.count", 1.5, r"found 1.5; accepted: a whole number in \[-2147483648, 2147483647\]"),
        ("/World/Sky.pair[1]", 0.5, "found 0.5; accepted: a whole number"),
        ("/World/Sky.count", "three", "found 'three'; accepted: a finite number"),
        ("/World/Sky.inputs:intensity", 1.0, "is connected, so its own value is not taken but that of /World/Looks"),
        ("/World/Copy/Inside.radius", 1.0, "/World/Copy/Inside is shared by instances"),
        ("/World/Ball{sizes}", "large", r"has no variant set sizes; did you mean size\?"),
        ("/World/Sky{size}", "large", "has no variant set size; it has none"),
        ("/World/Ball{size}", "huge", "no variant 'huge'; accepted: large, small"),
    ],
)
def test_what_cannot_be_edited_is_refused(edited, target, value, message):
    with pytest.raises(EditError, match=message) as caught:
        edited({target: value})
    assert f"{target}: " in str(caught.value)


def test_a_value_out_of_its_range_is_refused_by_the_reader(edited):
    with pytest.raises(SceneError, match=r"/World/Ball.radius = -1; accepted"):
        edited({"/World/Ball.radius": -1.0})


LIT = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = 1
    upAxis = "Y"
)
def Xform "World"
{
    def Sphere "Ball"
    {
    }
    def Sphere "Egg"
    {
    }
    def SphereLight "Lamp"
    {
        float inputs:radius = 0.5
        double3 xformOp:translate = (0, 3, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def SphereLight "Point"
    {
        float inputs:radius = 0
        bool inputs:normalize = 1
    }
    def Xform "Rig"
    {
        double3 xformOp:translate = (0, 5, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]

        def DiskLight "Spot"
        {
            rel light:filters = </World/Ball>
            rel collection:lightLink:includes = </World/Ball>
            rel collection:shadowLink:excludes = </World/Egg>
            uniform bool collection:lightLink:includeRoot = 0

            MORE
        }
    }
    MORE_OF_WORLD
}
"""
SPOT, LAMP = "/World/Rig/Spot", "/World/Lamp"


@pytest.fixture
def read_both(tmp_path, monkeypatch):
    """Reads a stage with some edits and then with others: the second time after the first one, and alone.

    Returns what is read in both, and how many times all of the stage was read.
    """
    count = 0
    read_all = usd_scenes.reader.stage._read_prims

    def counted(*args):
        nonlocal count
        count += 1
        return read_all(*args)

    def read(first, second, more="", more_of_world=""):
        nonlocal count
        path = tmp_path / "lit.usda"
        path.write_text(LIT.replace("MORE_OF_WORLD", more_of_world).replace("MORE", more))
        monkeypatch.setattr(usd_scenes.reader.stage, "_read_prims", counted)
        alone = outcome(path, second)
        count = 0
        stages = OpenStages()
        with stages:
            outcome(path, first, stages)
            return outcome(path, second, stages), alone, count

    return read


def outcome(path, edits, stages=None):
    try:
        reading = read_scene(path, edits=edits, stages=stages)
    except SceneError as error:
        return str(error)
    return canonical(reading.scene), reading.warnings


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ({f"{SPOT}.inputs:intensity": 1.0}, {f"{SPOT}.inputs:intensity": 3.0}),
        # The size of the one that is a point follows from how far the other is away.
        ({f"{LAMP}.xformOp:translate[1]": 1e3}, {f"{LAMP}.xformOp:translate[1]": 1.001e3}),
        # What does not change may be of other prims.
        (
            {f"{LAMP}.inputs:radius": 1.0, "/World/Ball.radius": 2.0},
            {f"{LAMP}.inputs:radius": 1.5, "/World/Ball.radius": 2.0},
        ),
    ],
)
def test_of_a_stage_whose_lights_are_edited_only_these_are_read_again(read_both, first, second):
    after, alone, count = read_both(first, second)
    assert after == alone
    assert count == 1


ON_SPOT = f"{SPOT}.inputs:intensity"


@pytest.mark.parametrize(
    ("first", "second", "more", "more_of_world"),
    [
        ({"/World/Ball.radius": 1.0, ON_SPOT: 1.0}, {"/World/Ball.radius": 2.0, ON_SPOT: 1.0}, "", ""),
        # Others follow: what is below the prim, what is connected to it, what is a copy of it.
        ({"/World/Rig.xformOp:translate[1]": 5.0}, {"/World/Rig.xformOp:translate[1]": 6.0}, "", ""),
        ({ON_SPOT: 1.0}, {ON_SPOT: 2.0}, 'def Sphere "Below" {}', ""),
        ({ON_SPOT: 1.0}, {ON_SPOT: 2.0}, "", f'def Material "M" {{\nfloat inputs:a.connect = <{ON_SPOT}>\n}}'),
        (
            {f"{LAMP}.xformOp:translate[0]": 1.0},
            {f"{LAMP}.xformOp:translate[0]": 2.0},
            "",
            f'def Sphere "Copy" (references = <{LAMP}>) {{}}',
        ),
        # A shape that is told to be a light stays a shape.
        (
            {"/World/Glow.xformOp:translate[0]": 1.0},
            {"/World/Glow.xformOp:translate[0]": 2.0},
            "",
            'def Sphere "Glow" (prepend apiSchemas = ["LightAPI"]) {\ndouble3 xformOp:translate = (0, 0, 0)\n'
            'uniform token[] xformOpOrder = ["xformOp:translate"]\n}',
        ),
        # There is something else to tell, or to refuse.
        ({f"{SPOT}.inputs:diffuse": 1.0}, {f"{SPOT}.inputs:diffuse": 0.5}, "", ""),
        ({f"{SPOT}.inputs:radius": 1.0}, {f"{SPOT}.inputs:radius": -1.0}, "", ""),
    ],
)
def test_a_stage_is_read_anew_where_more_than_lights_may_differ(read_both, first, second, more, more_of_world):
    after, alone, count = read_both(first, second, more, more_of_world)
    assert after == alone
    assert count == 2
