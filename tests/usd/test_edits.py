import pytest

from fgf_warp.errors import SceneError
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
