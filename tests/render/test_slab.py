"""Reflectance and transmittance of slabs against the tables of the theory, both transports."""

import numpy as np
import pytest

from fgf_warp.renderer import begin, build_model, develop, step
from fgf_warp.settings import RenderSettings
from tests import stats
from tests.scenes import slab

RELATIVE_ERROR = 0.002
SETTINGS = RenderSettings(width=32, height=32, spp=1, seed=20, max_depth=100_000)


def measure(scene):
    """R, T and their standard errors, each of at most 0.2 % relative."""
    model = build_model(scene, SETTINGS)
    state = begin(model)
    samples = 512
    while True:
        step(model, state, samples)
        result = develop(model, state)
        means = np.array([stats.image_mean(result, channel) for channel in (0, 1)])
        worst = (means[:, 1] / means[:, 0]).max()
        if worst <= RELATIVE_ERROR:
            assert result.truncated_count == 0
            return means
        # As many more as the error asks for, and a little over.
        samples = int(state.samples[0] * min(8.0, 1.1 * (worst / RELATIVE_ERROR) ** 2 - 1)) + 64


def check_rows(rows, transport):
    values, errors, expected = [], [], []
    for row, incidence in rows:
        b, kappa = row["b"], row["kappa"]
        # b alone enters the law here: H follows from it, and b = 1 is any H of an fBm.
        medium = dict(hurst=(b - 1) / 2 if b < 1 else 0.5, kappa=kappa, albedo=(row["albedo"],) * 3)
        found = measure(slab(row["T"], incidence=incidence, transport=transport, **medium))
        values += list(found[:, 0])
        errors += list(found[:, 1])
        expected += [row[f"R_{incidence}"], row[f"T_{incidence}_total"]]
    stats.assert_means(values, errors, expected, detects=0.02)


def rows_of(table):
    return [{key: table[key][i] for key in table} for i in range(len(table["T"]))]


def some(rows, picked):
    """The rows of these (T, b, kappa, albedo)."""
    found = [row for row in rows if (row["T"], row["b"], row["kappa"], row["albedo"]) in picked]
    assert len(found) == len(picked)
    return found


SOME = {(1, 0, 0, 0.9), (1, 0, 1, 0.9), (1, 0.5, 1, 0.9), (4, 0.2, 1, 0.99), (0.2, 0.5, 10, 1), (1, 1, 1, 0.9)}
SOME_RENEWAL = {(1, 0.5, 1, 0.9), (4, 1, 0.1, 0.9), (4, -0.5, 1, 0.9), (1, 0.2, 1, 1)}


def test_reciprocal_lambert(reference):
    rows = some(rows_of(reference("slab_isotropic_reciprocal.csv")), SOME)
    check_rows([(row, "lambert") for row in rows], "reciprocal")


def test_reciprocal_normal(reference):
    rows = some(rows_of(reference("slab_isotropic_reciprocal.csv")), SOME)
    check_rows([(row, "normal") for row in rows], "reciprocal")


def test_renewal_lambert(reference):
    rows = some(rows_of(reference("slab_isotropic_renewal_only.csv")), SOME_RENEWAL)
    check_rows([(row, "lambert") for row in rows], "renewal")


@pytest.mark.slow
def test_every_reciprocal_row(reference):
    rows = rows_of(reference("slab_isotropic_reciprocal.csv"))
    check_rows([(row, incidence) for row in rows for incidence in ("lambert", "normal")], "reciprocal")


@pytest.mark.slow
def test_every_renewal_row(reference):
    rows = rows_of(reference("slab_isotropic_renewal_only.csv"))
    check_rows([(row, "lambert") for row in rows], "renewal")
