"""What a scene's values may be: checked where they are made, in the precision that they are rendered in."""

import numpy as np
import pytest

from fgf_warp.errors import SceneError
from fgf_warp.scene import (
    AreaLight,
    Camera,
    DistantLight,
    DomeLight,
    Instances,
    Medium,
    Mesh,
    MeshLight,
    Scene,
    Shaping,
    Solid,
    SphereLight,
)
from fgf_warp.theory.phase import eval_draine, eval_hg, eval_two_lobe
from tests.scenes import furnace, transform

CORRELATED = {"hurst": -0.25, "white_noise_scale": 1.0}


def medium(**parameters):
    return Medium(**{"name": "/m", "mean_extinction": 2.0, **parameters})


def test_a_channel_of_factor_zero_is_empty_space():
    found = medium(**CORRELATED, extinction_color=(1, 0, 0.5))
    red, green, blue = found.channel_laws
    assert (green.regime, green.kappa, green.mean_extinction, green.is_exponential) == ("exponential", 0.0, 0.0, True)
    assert red == medium(**CORRELATED).line_law
    assert blue == medium(**CORRELATED, mean_extinction=1.0).line_law
    assert medium(**CORRELATED, extinction_color=(0, 0, 0)).line_law.kappa == 0


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"extinction_color": (1, 1e-9, 1)}, r"/m: extinction_color = \(1, 1e-09, 1\): in green, kappa \(from"),
        ({"mean_extinction": 0.0}, "/m: sigma_m = 0; accepted: > 0"),
        ({"mean_extinction": -1.0, "extinction_color": (0, 0, 0)}, "/m: sigma_m = -1; accepted: > 0"),
        ({"mean_extinction": 1e-9}, r"/m: kappa \(from"),
        ({"extinction_color": (1, 1, -1)}, r"/m: extinction_color = \(1, 1, -1\); accepted: three finite numbers >= 0"),
        ({"extinction_color": (1, 1, 1e38), "mean_extinction": 9.0}, "extinction_color = .*: in blue, sigma_m = 9e.38"),
    ],
)
def test_errors_name_what_was_authored(parameters, message):
    with pytest.raises(SceneError, match=message):
        medium(**CORRELATED, **parameters)


def test_a_grey_mediums_law_is_the_one_in_force():
    grey = medium(**CORRELATED, extinction_color=(0.5, 0.5, 0.5))
    assert grey.line_law == medium(**CORRELATED, mean_extinction=1.0).line_law
    assert set(grey.channel_laws) == {grey.line_law}
    chromatic = medium(**CORRELATED, extinction_color=(0.5, 0.5, 0.6))
    assert chromatic.line_law == medium(**CORRELATED).line_law


def test_asymmetry_is_inside_its_range_in_float32_too():
    inside = float(np.nextafter(np.float32(1), np.float32(0)))
    assert medium(asymmetry=inside).asymmetry == inside
    for g in (1 - 1e-9, -1 + 1e-9):
        with pytest.raises(SceneError, match=rf"/m: g = {g!r}; accepted: in \(-1, 1\), rounded to float32"):
            medium(asymmetry=g)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"phase_function": "mie"}, "/m: phase_function = 'mie'; accepted: isotropic, hg, two_lobe, draine"),
        (
            {"phase_function": "isotropic", "asymmetry": 0.4},
            "/m: g = 0.4 with phase_function = 'isotropic'; accepted: 0, or a phase function that has it: hg, two_lobe",
        ),
        ({"back_weight": 0.5}, "/m: back_weight = 0.5 with phase_function = 'hg'; accepted: 0, or .*: two_lobe"),
        ({"phase_function": "two_lobe", "draine_alpha": 1.0}, "/m: draine_alpha = 1 with .*: draine"),
        ({"phase_function": "two_lobe", "back_asymmetry": -1.0}, r"/m: back_asymmetry = -1; accepted: in \(-1, 1\)"),
        ({"phase_function": "two_lobe", "back_weight": 1.5}, r"/m: back_weight = 1.5; accepted: in \[0, 1\]"),
        ({"phase_function": "draine", "draine_alpha": -0.1}, r"/m: draine_alpha = -0.1; accepted: in \[0, 1000\]"),
        ({"phase_function": "draine", "draine_alpha": float("nan")}, "/m: draine_alpha = nan; accepted: in"),
    ],
)
def test_phase_functions_take_what_they_have(parameters, message):
    with pytest.raises(SceneError, match=message):
        medium(**parameters)


HUGE = 1e39


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: medium(mean_extinction=HUGE), "/m: sigma_m = 1e.39; accepted: .* at most 3.4e.38"),
        (lambda: medium(extinction_color=(HUGE, 1, 1)), "/m: extinction_color = .* 3.4e.38"),
        (lambda: DomeLight("/sky", (HUGE, 1, 1)), "/sky: radiance = .* 3.4e.38"),
        (lambda: SphereLight("/sun", (0, 0, HUGE), 1.0, (1, 1, 1)), "/sun: center = .* 3.4e.38"),
        (lambda: SphereLight("/sun", (0, 0, 0), HUGE, (1, 1, 1)), "/sun: radius = 1e.39; accepted: > 0, .* 3.4e.38"),
        (
            lambda: AreaLight("/sun", "rect", (0, HUGE, 0), (1, 0, 0), (0, 1, 0), (1, 1, 1)),
            "/sun: center = .* 3.4e.38",
        ),
        (lambda: Solid("/cube", "cube", transform(HUGE)), "/cube: object_to_world must be a finite"),
        (lambda: Camera("/camera", transform(at=(HUGE, 0, 0))), "/camera: camera_to_world must be a finite"),
        (lambda: Mesh("/mesh", np.full((3, 3), HUGE), np.array([[0, 1, 2]])), "/mesh: points must be a finite"),
    ],
)
def test_what_is_not_finite_in_float32_is_refused(make, message):
    with pytest.raises(SceneError, match=message):
        make()


def test_medium_extent_is_the_longest_side_of_what_it_fills():
    media = (medium(), medium(name="/n"), medium(name="/o"))
    points = np.array([[0, 0, 0], [0, 0, 5], [0, 1, 0], [1, 0, 0]], dtype=np.float32)
    faces = np.array([[0, 2, 3], [0, 1, 2], [0, 3, 1], [1, 3, 2]])
    shapes = (
        Solid("/a", "cube", transform((1, 2, 1)), medium=0),
        Solid("/b", "cube", transform((9, 1, 1))),
        Mesh("/c", points, faces, medium=1),
        Mesh("/d", points / 2, faces, medium=1),
    )
    scene = Scene(furnace().camera, shapes, media)
    assert [scene.medium_extent(index) for index in range(3)] == [4.0, 5.0, None]


@pytest.mark.parametrize(
    ("parameters", "evaluate"),
    [
        ({"phase_function": "isotropic"}, lambda v: np.full_like(v, 1 / (4 * np.pi))),
        ({"asymmetry": -0.4}, lambda v: eval_hg(-0.4, v)),
        (
            {"phase_function": "two_lobe", "asymmetry": 0.7, "back_asymmetry": -0.5, "back_weight": 0.3},
            lambda v: eval_two_lobe(0.7, -0.5, 0.3, v),
        ),
        ({"phase_function": "draine", "asymmetry": 0.6, "draine_alpha": 7.0}, lambda v: eval_draine(0.6, 7.0, v)),
    ],
)
def test_the_mean_cosine_is_the_phase_functions(parameters, evaluate):
    cosines, weights = np.polynomial.legendre.leggauss(200)
    mean = 2 * np.pi * (weights * cosines * evaluate(1 - cosines)).sum()
    assert medium(**parameters).mean_cosine == pytest.approx(mean, abs=1e-12)


def test_a_solid_too_far_away_for_its_size_is_refused():
    """Its inverse overflows float32, though the matrix does not."""
    matrix = np.diag([0.2, 0.2, 0.2, 1.0])
    matrix[0, 3] = 1e38
    with pytest.raises(SceneError, match="/ball: object_to_world is too far away for its size"):
        Solid("/ball", "sphere", matrix)


def test_a_film_too_wide_for_its_lens_is_refused():
    """Its rays would run across the view axis."""
    accepted = r"/c: vertical_aperture = 1e\+11; accepted: at most 1e\+06 focal_length = 4.2e\+07"
    with pytest.raises(SceneError, match=accepted):
        Camera("/c", np.eye(4), focal_length=42.0, vertical_aperture=1e11)
    assert Camera("/c", np.eye(4), vertical_aperture=1e11, projection="orthographic").vertical_aperture == 1e11


POINTS = np.eye(3)
TRIANGLES = np.array([[0, 1, 2], [0, 2, 1]])
PLACES = np.tile(np.eye(4)[:3], (4, 1, 1))


def flattened(places, index):
    places = places.copy()
    places[index, 0] = 0
    return places


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Mesh("/m", POINTS[:, :2], TRIANGLES), r"/m: points must be a finite \(n, 3\) array"),
        (
            lambda: Mesh("/m", POINTS, TRIANGLES, normals=np.zeros((3, 3, 3))),
            r"/m: normals must be a finite \(2, 3, 3\) array",
        ),
        (
            lambda: Mesh("/m", POINTS, TRIANGLES, primvars={"st": np.zeros((3, 1, 2))}),
            r"/m: primvar 'st' has the shape \(3, 1, 2\); accepted: \(1, 1, k\), \(2, 1, k\) and \(2, 3, k\)$",
        ),
        (
            lambda: Instances("/i", Mesh("/m", POINTS, TRIANGLES), PLACES, primvars={"a": np.zeros((3, 1))}),
            r"/i: primvar 'a' has the shape \(3, 1\); accepted: \(4, k\)$",
        ),
        (
            lambda: Instances("/i", Mesh("/m", POINTS, TRIANGLES), PLACES, flattened(PLACES, 2)),
            r"/i: closing\[2\] is of no use; accepted: finite, invertible",
        ),
        (
            lambda: Instances("/i", Mesh("/m", POINTS, TRIANGLES), PLACES, PLACES[:3]),
            r"/i: closing must be an \(n, 3, 4\) array, with n > 0 the same for all",
        ),
        (
            lambda: Solid("/ball", "sphere", np.eye(4), closing=np.zeros((4, 4))),
            "/ball: closing must be a finite, invertible 4x4 matrix",
        ),
        (
            lambda: MeshLight("/lamp", np.zeros((2, 3, 2)), (1, 1, 1)),
            r"/lamp: corners must be a finite \(m, 3, 3\) array",
        ),
        (lambda: DistantLight("/sun", (0, 0, -2), 0.0, (1, 1, 1)), r"/sun: \|direction\| = 2; accepted: 1$"),
        (lambda: Shaping((0, 0, 0.5)), r"shaping: \|axis\| = 0.5; accepted: 1$"),
    ],
)
def test_arrays_and_vectors_are_of_the_shape_that_is_told(make, message):
    with pytest.raises(SceneError, match=message):
        make()
