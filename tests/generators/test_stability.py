"""`fgf stability`: its quick grid is inside all bounds; what is outside is found, marked, and told by the exit code."""

import base64
import re
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

from fgf_warp.errors import NumericalError
from generators.cli import app
from generators.stability import furnace, law, run
from generators.stability.extremes import FULL, QUICK
from generators.stability.measurement import Axis, Measurement
from generators.stability.parameters import expected_kappa, shorten_refusal


@pytest.fixture(scope="module")
def outcome():
    return run.measure(QUICK, "cpu")


@pytest.fixture
def fgf(monkeypatch, tmp_path):
    """`fgf stability --quick` with an outcome that is already there."""

    def call(found):
        monkeypatch.setattr(run, "measure", lambda extremes, device, progress: found)
        return CliRunner().invoke(app, ["stability", "--quick", "--out", str(tmp_path / "report")])

    return call


def broken(outcome):
    """The same, judged by a bound on f'' that no float32 keeps; and no renders, whose maps take time to draw."""
    bounds = {"line_exponent_d2": (1e-12, 0.0)}
    found = law.measure_law(QUICK.bs, QUICK.kappas, QUICK.depths, "cpu", bounds)
    return replace(outcome, law=tuple(found), rendered=())


def test_quick_grid_is_inside(outcome):
    outside = [
        f"{part}: {found.quantity}: {found.describe(index)}: {found.values[tuple(index)]:.3g}"
        for part, found in outcome.measurements
        for index in np.argwhere(found.outside)
    ]
    assert not outside
    assert not any(one.failures for one in outcome.rendered)


def test_cut_paths_are_counted_and_in_balance(outcome):
    field = next(one for one in outcome.rendered if one.experiment.name == "field").measurements
    cut = field[furnace.CUT].values
    assert np.nanmax(cut) > 0.01
    assert np.nanmax(field[furnace.BALANCE].values[cut > 0]) <= furnace.FLOOR


def test_every_refusal_has_its_reason(outcome):
    field = next(one for one in outcome.rendered if one.experiment.name == "field").measurements[furnace.BALANCE]
    assert np.array_equal(field.refused, np.isnan(field.values))
    reasons = " ".join(set(field.refusals.ravel()))
    for parameter in ("H; accepted: > -0.98", "away from 0", "kappa; accepted", "accepted for H < -0.5: renewal"):
        assert parameter in reasons


def test_report_needs_no_other_file(fgf, outcome, tmp_path):
    answer = fgf(outcome)
    assert answer.exit_code == 0, answer.output
    assert "are inside their bounds" in answer.stdout
    page = (tmp_path / "report" / "index.html").read_text()
    for text in (page, *base64_images(page)):
        assert not re.findall(r"""(?:href|src)=["'](?!#|data:)""", text)
        assert not re.findall(r"url\((?!#)", text)
    assert str(tmp_path) not in page
    assert 'class="verdict"' in page
    rows = pq.read_table(tmp_path / "report" / "cells.parquet")
    assert rows.num_rows == sum(found.values.size for _, found in outcome.measurements)
    columns = {"part", "quantity", "H", "S_w", "sigma_m", "g", "value", "bound", "outside", "refusal"}
    assert columns <= set(rows.column_names)


def test_a_broken_bound_is_found_and_marked(fgf, outcome, tmp_path):
    answer = fgf(broken(outcome))
    assert answer.exit_code == 3
    assert "are outside their bounds" in answer.stdout
    page = (tmp_path / "report" / "index.html").read_text()
    assert 'class="verdict failed"' in page
    failed = re.findall(r'<tr class="failed">(.*?)</tr>', page)
    assert len(failed) == 1
    assert "line_exponent_d2" in failed[0]
    assert "#d7263d" in base64_images(page)[0]
    assert "#d7263d" not in base64_images(page)[-1]


def test_a_folder_that_cannot_be_is_told_first(tmp_path):
    (tmp_path / "file").write_text("")
    answer = CliRunner().invoke(app, ["stability", "--quick", "--out", str(tmp_path / "file" / "report")])
    assert answer.exit_code == 2
    assert "cannot be made" in answer.stderr


def test_a_render_that_is_not_finite_fails_its_cell(monkeypatch):
    experiment = furnace.Experiment(
        "one", "", (Axis("transport", ("renewal",)), Axis("H", (-0.5, -0.25))), (), {"kappa": 1.0}
    )
    develop = furnace.develop

    def spoilt(model, state, image):
        if model.variants[image].media[0].hurst == -0.25:
            raise NumericalError("3 samples are not finite")
        return develop(model, state, image)

    monkeypatch.setattr(furnace, "develop", spoilt)
    found = furnace.run_experiment(experiment, "cpu")
    assert found.failures == ("3 samples are not finite",)
    assert found.measurements[furnace.BALANCE].outside.tolist() == [[False, True]]


def test_light_that_is_lost_is_found(monkeypatch):
    """A thousandth of all."""
    experiment = furnace.Experiment(
        "one", "", (Axis("transport", ("renewal",)), Axis("H", (-0.25,))), (), {"kappa": 1.0}
    )
    develop = furnace.develop

    def dimmed(model, state, image):
        result = develop(model, state, image)
        return replace(result, radiance=result.radiance * np.float32(0.999))

    monkeypatch.setattr(furnace, "develop", dimmed)
    assert furnace.run_experiment(experiment, "cpu").measurements[furnace.BALANCE].outside.all()


def test_light_that_is_lost_in_one_channel_is_found(monkeypatch):
    """A twentieth of the blue."""
    axes = (Axis("transport", ("renewal",)), Axis("H", (-0.25,)))
    media = {"kappa": 1.0, "albedo": 0.5, "color": (1.0, 0.3, 0.03)}
    experiment = furnace.Experiment("one", "", axes, (), media)
    assert not furnace.run_experiment(experiment, "cpu").measurements[furnace.BALANCE].outside.any()
    develop = furnace.develop

    def dimmed(model, state, image):
        result = develop(model, state, image)
        return replace(result, radiance=result.radiance * np.array([1, 1, 0.95], dtype=np.float32))

    monkeypatch.setattr(furnace, "develop", dimmed)
    assert furnace.run_experiment(experiment, "cpu").measurements[furnace.BALANCE].outside.all()


def test_only_what_passes_an_absorbing_sphere_shows_wrong_geometry(monkeypatch):
    """A radius that is a tenth too large."""
    axes = (Axis("transport", ("renewal",)), Axis("H", (-0.25,)))
    experiment = furnace.Experiment("one", "", axes, (), {"kappa": 1.0, "albedo": 0.0}, shows_law=True)
    assert not furnace.run_experiment(experiment, "cpu").measurements[furnace.SHOWN].outside.any()
    solid = furnace.Solid

    def larger(name, kind, to_world, **of_shape):
        return solid(name, kind, to_world @ np.diag([1.1, 1.1, 1.1, 1.0]), **of_shape)

    monkeypatch.setattr(furnace, "Solid", larger)
    found = furnace.run_experiment(experiment, "cpu").measurements
    assert found[furnace.SHOWN].outside.all()
    assert not found[furnace.BALANCE].outside.any()


@pytest.mark.parametrize("has_roulette", [False, True])
def test_only_noise_gets_a_second_look(monkeypatch, has_roulette):
    """A tenth of the light is lost in the first render alone."""
    axes = (Axis("transport", ("renewal",)), Axis("H", (-0.25,)))
    experiment = furnace.Experiment("one", "", axes, (), {"kappa": 1.0, "albedo": 0.5}, has_roulette=has_roulette)
    develop, renders = furnace.develop, []

    def dimmed(model, state, image):
        result = develop(model, state, image)
        renders.append(result.samples)
        return replace(result, radiance=result.radiance * np.float32(0.9 if len(renders) == 1 else 1.0))

    monkeypatch.setattr(furnace, "develop", dimmed)
    found = furnace.run_experiment(experiment, "cpu")
    assert found.measurements[furnace.BALANCE].outside.all() != has_roulette
    assert found.looked_again == has_roulette
    assert renders == ([furnace.NOISY_SPP, furnace.SECOND_LOOK * furnace.NOISY_SPP] if has_roulette else [8])


def test_planes():
    axes = (Axis("a", (1, 2)), Axis("b", (1, 2, 3)), Axis("c", ("x", "y")))
    values = np.arange(12.0).reshape(2, 3, 2)
    values[0, 0] = np.nan
    refusals = np.where(np.isnan(values), "no", "")
    found = Measurement("q", axes, values, 10.0, refusals)
    plane = found.plane("b", "a")
    assert np.array_equal(plane.values, [[np.nan, 7], [3, 9], [5, 11]], equal_nan=True)
    assert plane.refused.tolist() == [[True, False], [False, False], [False, False]]
    assert plane.outside.tolist() == [[False, False], [False, False], [False, True]]
    assert found.plane("a", "b", c="x").values[1].tolist() == [6, 8, 10]
    assert found.plane("a", "b", of_bound=True).values[1, 2] == 1.1
    assert found.worst() == (1, 2, 1)
    assert found.describe((1, 2, 1)) == "a = 2, b = 3, c = y"


def test_a_value_of_nothing_is_outside_every_bound():
    found = Measurement("q", (Axis("a", (1, 2, 3)),), np.array([0.0, np.nan, np.inf]))
    assert found.outside.tolist() == [False, False, True]
    assert Measurement("q", found.axes, np.array([0.0, 1e-30, 0.0]), 0.0).outside.tolist() == [False, True, False]


@pytest.mark.parametrize(
    ("parameters", "kappa"),
    [
        ((-0.5, 3.0, 2.0, None), 1.5),
        ((-0.25, 0.0, 2.0, None), 0.0),
        # K = S_w / (Gamma(5/2) sin(pi/4)).
        ((-0.25, 1.0, 1.0, None), 1 / (1.32934038817914 * np.sqrt(0.5))),
        # v = S_w L / (Gamma(3) sin(pi/2)).
        ((0.5, 1.0, 2.0, 4.0), 0.5),
        ((1.0, 1.0, 1.0, 1.0), None),
        ((0.5, 1.0, 1.0, None), None),
    ],
)
def test_expected_kappa(parameters, kappa):
    found = expected_kappa(*parameters)
    assert found is None if kappa is None else found == pytest.approx(kappa, rel=1e-13)


def test_refusals_of_one_kind_are_one():
    message = "kappa (from S_w = 1, sigma_m = 1e-06, H = -0.98) = 1e+12; accepted: in [0, 1e+08]"
    assert shorten_refusal(message) == "kappa; accepted: in [0, 1e+08]"


def test_the_whole_grid_reaches_the_extremes():
    """As far as they are asked for."""
    axes = {}
    for experiment in FULL.experiments:
        for axis in experiment.axes:
            axes.setdefault(axis.name, set()).update(axis.values)
    assert {-0.9999, 0.9999} <= axes["g"]
    assert {0.0, 1e8} <= axes["S_w"]
    assert {1e-6, 1e6} <= axes["sigma_m"]
    assert {0.0, 1.0} <= axes["albedo"]
    assert {1e-4, 1e5} <= axes["scale"]
    assert {-1.0, 0.0, 1.0, 2.0} <= axes["H"]


def base64_images(page: str) -> list[str]:
    return [base64.b64decode(data).decode() for data in re.findall(r'src="data:image/svg\+xml;base64,([^"]*)"', page)]
