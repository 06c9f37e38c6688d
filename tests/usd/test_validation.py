"""What the validators find, each in a stage in which nothing else is wrong, and what they let pass."""

from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from pxr import UsdValidation

from fgf_warp.errors import SceneError
from fgf_warp.scene import Medium, Mesh, winding_number
from tests.usd.conftest import write
from tests.usd.prims import CAMERA, DOME, medium_sphere
from usd_scenes.authoring import author_interchange
from usd_scenes.examples import MEDIUM_PATH, build_sphere, stage_names, stage_path
from usd_scenes.validation import Asked, Finding, validate_stage
from usd_scenes.validation.compartments import count_crossings

HEADER = '#usda 1.0\n(\n    defaultPrim = "Camera"\n    metersPerUnit = 0.01\n    upAxis = "Y"\n)\n'
LAMP = 'def SphereLight "Lamp"\n{\n    float inputs:radius = 0.1\n}\n'
CAMERA_AT_ORIGIN = 'def Camera "Camera"\n{\n}\n'
CAMERA_IN_BOX = CAMERA.replace("(0, 0, 9)", "(0, 0, 3)")
BOX = 'def Cube "Box"\n{\n    double size = 8\n}\n'
MESH = """def Mesh "Shell" (
    prepend apiSchemas = ["MaterialBindingAPI"]
)
{
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    int[] faceVertexCounts = [3, 3, 3]
    int[] faceVertexIndices = [0, 2, 1, 0, 1, 3, 0, 3, 2]
    uniform token subdivisionScheme = "none"
    rel material:binding = </Look>
}
"""
CURVES = """def BasisCurves "Hair" (
    prepend apiSchemas = ["MaterialBindingAPI"]
)
{
    rel material:binding = </Look>
}
"""
SURFACE = """def Shader "Surface"
    {
        uniform token info:id = "UsdPreviewSurface"
        token outputs:surface
    }"""

SURFACE_OUTPUT = "token outputs:surface.connect = </Look/Surface.outputs:surface>"
BARE = 'def Sphere "Bare"\n{\n}\n'


@pytest.fixture
def find(tmp_path: Path) -> Callable[..., tuple[Finding, ...]]:
    """Validates the given prims beside a camera and a dome."""

    def find_in(prims: str, *, header: str = HEADER, camera: str = CAMERA, light: str = DOME) -> tuple[Finding, ...]:
        return validate_stage(write(tmp_path, header + camera + light + prims)).findings

    return find_in


def told(findings: tuple[Finding, ...]) -> list[tuple[str, str, str]]:
    """Severity, path and the last name of each."""
    return [(finding.severity, finding.path, finding.validator.rsplit(".")[-1]) for finding in findings]


@pytest.mark.parametrize("name", stage_names())
def test_nothing_is_found_in_our_own_stages(name: str) -> None:
    assert validate_stage(stage_path(name)).findings == ()


def test_nothing_is_found_in_a_stage_where_nothing_is_wrong(find) -> None:
    assert find(medium_sphere("")) == ()


@pytest.mark.parametrize(
    ("prims", "extra", "expected", "words"),
    [
        (
            medium_sphere("float inputs:fgf:hurst = 1.001"),
            {},
            ("error", "/Look.inputs:fgf:hurst", "ValueOutOfDomain"),
            "H = 1.001; accepted",
        ),
        (
            medium_sphere('uniform token fgf:boundary = "wall"'),
            {},
            ("error", "/Look.fgf:boundary", "UnknownBoundary"),
            "fgf:boundary = wall; accepted: none, surface",
        ),
        (
            medium_sphere(f"float inputs:fgf:hurst = -0.25\n    {SURFACE_OUTPUT}", schemas="", inside=SURFACE),
            {},
            ("error", "/Look", "UnappliedSchema"),
            "accepted: FgfMediumAPI in the prim's apiSchemas",
        ),
        (
            medium_sphere("token outputs:fgf:volume.connect = </Look/Gone.outputs:volume>"),
            {},
            ("warning", "/Look", "UnconnectedTerminal"),
            "outputs:fgf:volume is connected to nothing",
        ),
        (
            medium_sphere("float inputs:fgf:meanExtinction = 6e3"),
            {},
            ("warning", "/Look", "OpaqueMedium"),
            "the mean optical depth across its 2 units is 1.2e+04",
        ),
        (
            medium_sphere("float inputs:fgf:meanExtinction = 1e-6"),
            {},
            ("warning", "/Look", "ClearMedium"),
            "is per stage unit, of 0.01 m (metersPerUnit); meant per metre, it is 1e-08 per unit",
        ),
        (medium_sphere("") + CURVES, {}, ("error", "/Hair", "NothingToFill"), "a BasisCurves cannot be filled"),
        (medium_sphere("") + MESH, {}, ("error", "/Shell", "OpenMediumMesh"), "needs a closed mesh"),
        (
            BARE + 'def Material "Look" (\n    prepend apiSchemas = ["FgfMediumAPI"]\n)\n{\n}\n',
            {},
            ("warning", "/Look", "UnboundMedium"),
            "fills nothing; accepted: bound to a closed shape",
        ),
        (
            medium_sphere(
                f'uniform token fgf:boundary = "surface"\n    {SURFACE_OUTPUT}',
                inside=SURFACE,
            ),
            {},
            ("warning", "/Look", "ShadowedMedium"),
            "the surface of /Ball is opaque",
        ),
        (
            BOX,
            {"camera": CAMERA_AT_ORIGIN},
            ("warning", "/Camera", "UnlitCamera"),
            "inside /Box, an opaque closed shape",
        ),
        (BOX + LAMP, {}, ("warning", "/Lamp", "EnclosedLight"), "inside /Box, an opaque closed shape"),
        (BOX + medium_sphere(""), {}, ("warning", "/Look", "UnlitMedium"), "no light reaches the medium in /Ball"),
        (
            medium_sphere(""),
            {"camera": CAMERA_AT_ORIGIN},
            ("info", "/Camera", "CameraInMedium"),
            "inside /Ball, filled with /Look",
        ),
        (
            "".join(medium_sphere("").replace("Ball", f"Ball{k}").replace("Look", f"Look{k}") for k in range(33)),
            {},
            ("error", "/", "TooManyFilledShapes"),
            "33 shapes are filled with media, each instance by itself; accepted: at most 32",
        ),
        (
            medium_sphere("").replace("{", "{\n    double radius = -1", 1),
            {},
            ("error", "/Ball.radius", "Refused"),
            "radius = -1; accepted: > 0",
        ),
    ],
)
def test_what_is_wrong_is_told_once(find, prims: str, extra: dict, expected: tuple[str, str, str], words: str) -> None:
    (finding,) = find(prims, **extra)
    assert told((finding,)) == [expected]
    assert words in finding.text


def test_what_is_authored_for_other_renderers_is_no_error(tmp_path: Path) -> None:
    stage = build_sphere(Medium(name="", mean_extinction=2.0))
    author_interchange(stage.GetPrimAtPath(MEDIUM_PATH))
    stage.Export(str(tmp_path / "stage.usda"))
    assert validate_stage(tmp_path / "stage.usda").findings == ()


def test_a_plane_with_a_medium_is_told_of_once(find) -> None:
    plane = CURVES.replace("BasisCurves", "Plane")
    (finding,) = find(plane + medium_sphere(""))
    assert told((finding,)) == [("error", "/Hair", "NothingToFill")]


def test_a_shader_that_this_usd_does_not_know_is_no_error(find) -> None:
    (finding,) = find(BARE + 'def Shader "Stone"\n{\n    uniform token info:id = "Stone"\n}\n')
    assert (finding.severity, finding.path) == ("warning", "/Stone.info:id")


def test_a_boundary_without_a_surface_hides_the_medium(find) -> None:
    findings = find(medium_sphere('uniform token fgf:boundary = "surface"'))
    assert {name for _, _, name in told(findings)} == {"MissingSurface", "ShadowedMedium"}


def test_a_surface_that_is_meant_for_this_renderer_is_a_surface(find) -> None:
    surface = "token outputs:fgf:surface.connect = </Look/Surface.outputs:surface>\n    " + SURFACE
    surface = surface.replace("token outputs:surface\n", "float inputs:opacity = 0\n        token outputs:surface\n")
    assert find(medium_sphere('uniform token fgf:boundary = "surface"\n    ' + surface)) == ()


def test_what_glows_lights_a_stage_without_lights(find) -> None:
    glowing = (
        """def Sphere "Glow" (
    prepend apiSchemas = ["MaterialBindingAPI"]
)
{
    double radius = 20
    rel material:binding = </Bright>
}
def Material "Bright"
{
    token outputs:surface.connect = </Bright/Surface.outputs:surface>
    """
        + SURFACE.replace("token outputs", "color3f inputs:emissiveColor = (1, 1, 1)\n        token outputs")
        + "\n}\n"
    )
    # All of the light is inside: the camera is outside of it, and no dome takes the place of lights.
    beyond = CAMERA.replace("(0, 0, 9)", "(0, 0, 30)")
    shut = 'def Cube "Box"\n{\n    double size = 50\n}\n'
    assert find(glowing, light="") == ()
    found = find(shut + glowing, light="", camera=beyond)
    assert ("warning", "/Camera", "UnlitCamera") in told(found)


def test_all_values_of_a_medium_that_are_wrong_are_told(find) -> None:
    values = "float inputs:fgf:hurst = -3\nfloat inputs:fgf:asymmetry = 1\nint inputs:fgf:hearst = 1\n"
    found = told(
        find(medium_sphere(values + "float inputs:fgf:meanExtinction = -1\ncolor3f inputs:fgf:albedo = (2, 0, 0)"))
    )
    names = ("albedo", "asymmetry", "hearst", "hurst", "meanExtinction")
    assert found == [("error", f"/Look.inputs:fgf:{name}", "ValueOutOfDomain") for name in names]


def test_problems_of_several_prims_are_all_told(find) -> None:
    ball = 'def Sphere "Ball{0}"\n{{\n    double radius = -{0}\n}}\n'
    found = [finding.path for finding in find(ball.format(1) + ball.format(2) + 'def Sphere "Whole"\n{\n}\n')]
    assert found == ["/Ball1.radius", "/Ball2.radius"]


def test_a_room_with_a_lamp_is_no_prison(find) -> None:
    assert find(BOX + LAMP + medium_sphere(""), camera=CAMERA_IN_BOX) == ()


def test_usds_own_rules_are_among_them(find) -> None:
    (finding,) = find(BARE, header=HEADER.replace("    metersPerUnit = 0.01\n", ""))
    assert finding.severity == "warning"
    assert finding.validator == "usdGeomValidators:StageMetadataChecker.MissingMetersPerUnitMetadata"
    assert "does not specify its linear scale" in str(finding)
    assert "\n" not in str(finding)


def test_frames_are_told_for_which_something_is_wrong(tmp_path: Path) -> None:
    """Numbers in a text may differ from frame to frame: it is one thing all the same, and the first text is told."""
    moving = medium_sphere("float inputs:fgf:asymmetry.timeSamples = { 1: 0, 3: 1.5, 5: 1.5, 6: 0, 8: 3 }")
    path = write(tmp_path, HEADER + CAMERA + DOME + moving)
    steps: list[tuple[str, int, int]] = []
    found = validate_stage(path, [float(k) for k in range(1, 9)], None, lambda *step: steps.append(step))
    (finding,) = found.findings
    assert told((finding,)) == [("error", "/Look.inputs:fgf:asymmetry", "ValueOutOfDomain")]
    assert "g = 1.5;" in finding.text
    assert finding.frames == "3 to 5, 7 to 8"
    assert "(frames 3 to 5, 7 to 8)" in str(finding)
    assert found.reading is not None
    assert [step for step, _, _ in steps][-8:] == [f"frame {k}" for k in range(1, 9)]
    assert [done for _, done, _ in steps] == list(range(steps[0][2]))
    (at_six,) = validate_stage(path, [3.0, 4.0]).findings
    assert at_six.frames == ""
    assert validate_stage(path, [6.0]).findings == ()


def test_what_is_mended_is_a_warning_and_an_error_where_it_is_to_be(tmp_path: Path) -> None:
    dome = 'def DomeLight "Sky"\n{\n    asset inputs:texture:file = @gone.hdr@\n}\n'
    path = write(tmp_path, HEADER + CAMERA + dome + BARE)
    (finding,) = validate_stage(path).findings
    assert told((finding,)) == [("warning", "/Sky.inputs:texture:file", "NotAsWritten")]
    assert "gone.hdr" in finding.text
    strict = validate_stage(path, asked=Asked(strict=True))
    assert [(found.severity, found.path) for found in strict.findings] == [("error", "/Sky.inputs:texture:file")]
    assert strict.reading is None


def test_a_damaged_layer_that_a_validator_of_usd_fails_on_is_a_finding(tmp_path: Path) -> None:
    (tmp_path / "damaged.usda").write_text("#usda 1.0\ndef {")
    part = 'def "Part" (\n    references = @damaged.usda@\n)\n{\n}\n'
    found = validate_stage(write(tmp_path, HEADER + CAMERA + DOME + BARE + part)).findings
    assert "/Part" in [finding.path for finding in found]
    failed = [finding.validator for finding in found if finding.text.startswith("fails on this stage")]
    assert "usdUtilsValidators:MissingReferenceValidator" in failed


def test_what_is_asked_for_is_what_is_checked(tmp_path: Path) -> None:
    ball = 'def Sphere "Ball"\n{\n    uniform token purpose = "guide"\n    double radius = -1\n}\n'
    path = write(tmp_path, HEADER + CAMERA + DOME + BARE + ball)
    assert validate_stage(path).findings == ()
    assert validate_stage(path, asked=Asked(purposes=["default", "guide"])).findings
    with pytest.raises(SceneError, match="purposes = gide"):
        validate_stage(path, asked=Asked(purposes=["gide"]))


@pytest.mark.parametrize("turned", [False, True])
def test_crossings_of_a_mesh_are_its_winding_number(turned: bool) -> None:
    """At points on the lines through corners and edges too, where two triangles must count once."""
    side = np.array([-1.0, 0.0, 1.0])
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=np.float32)
    faces = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6)]
    triangles = np.array([*faces, (0, 6, 4), (1, 5, 7), (1, 7, 3)])
    both = np.concatenate([triangles, triangles + 8])  # A cube around another one.
    points = np.concatenate([3 * corners, corners])
    triangles = both[:, ::-1] if turned else both
    mesh = Mesh(name="/M", points=points, triangles=triangles, surface=None)
    for at in product([-4.0, -2.0, *(0.5 * side), 2.0, 4.0], repeat=3):
        point = np.array(at)
        assert count_crossings(mesh, point) == round(winding_number(points, triangles, point)), at


def test_what_is_no_stage_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="stage"):
        validate_stage(write(tmp_path, "#usda 1.0\ndef Sphere {"))
    with pytest.raises(SceneError, match="no such file"):
        validate_stage(tmp_path / "none.usda")


def test_usd_knows_our_validators_with_documentation_and_keyword() -> None:
    registry = UsdValidation.ValidationRegistry()
    known = registry.GetValidatorMetadataForKeyword("FgfValidators")
    assert {metadata.name.rsplit(":")[-1] for metadata in known} == {
        "MediumBinding",
        "MediumTerminals",
        "MediumValues",
        "Scene",
    }
    for metadata in known:
        assert metadata.doc
        assert registry.GetOrLoadValidatorByName(metadata.name)
