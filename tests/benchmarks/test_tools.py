"""The benchmark's own tools; nothing here is timed."""

import math
import shutil
from dataclasses import asdict, replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from fgf_warp.features import required_features
from fgf_warp.scene import PHASE_FUNCTIONS, AreaLight, Mesh, Solid, count_open_edges
from fgf_warp.settings import RENDERED_AOVS
from fgf_warp.theory.choices import LINE_VARIANCES
from fgf_warp.theory.law import Regime
from generators.tradeoff.config import load_tradeoff
from tests.benchmarks import llvm, scenes
from tests.benchmarks.agreement import compare, compare_pairs, estimate
from tests.benchmarks.auto import PAIRS, true_errors
from tests.benchmarks.builds import forget_kernels
from tests.benchmarks.limit import build_walk, run_walk
from tests.benchmarks.one_build import SETTINGS, full_scene
from tests.benchmarks.picture_scenes import SCENES
from tests.benchmarks.pictures import PICTURES
from tests.benchmarks.same_pictures import differences


@pytest.mark.parametrize(
    ("name", "version"),
    [
        ("libLLVM-19.so", 19),
        ("libLLVM-19.so.1", 19),
        ("libLLVM.so.19.1", 19),
        ("libLLVM-14.0.6.so.1", 14),
        ("libLLVM.so", 0),
        ("libLLVMTableGen.so.19", 0),
    ],
)
def test_reads_the_version_of_llvm_from_file_names(name, version):
    assert llvm._version(name) == version


def test_says_how_to_get_llvm(monkeypatch):
    monkeypatch.delenv(llvm.VARIABLE, raising=False)
    monkeypatch.setattr(llvm, "_candidates", lambda: iter(()))
    with pytest.raises(llvm.LlvmNotFoundError, match=f"apt-get install libllvm19.*{llvm.VARIABLE}"):
        llvm.provide_llvm()


def test_keeps_the_llvm_that_is_set(monkeypatch):
    monkeypatch.setenv(llvm.VARIABLE, "libLLVM.so")
    assert llvm.provide_llvm() == "libLLVM.so"


def test_the_mesh_is_closed_and_of_the_size_it_is_said_to_be():
    points, triangles = scenes.bumpy_sphere()
    corners = points[triangles]
    volume = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6

    assert len(triangles) == 70224
    assert count_open_edges(points, triangles) == 0
    assert 0.9 * 4 / 3 * math.pi < volume < 1.1 * 4 / 3 * math.pi  # > 0: seen from outside counter-clockwise


def test_stages_are_read_as_they_are_meant(tmp_path):
    ball, box, mesh = (scenes.read(scenes.author(name, tmp_path)) for name in "ABC")

    for scene in (ball, box, mesh):
        assert (scene.media[0].mean_extinction, scene.media[0].asymmetry) == (2.5, 0.5)
        assert scene.media[0].albedo == pytest.approx((0.8, 0.8, 0.8))
    assert isinstance(mesh.shapes[0], Mesh)
    assert [isinstance(shape, Solid) and shape.medium for shape in box.shapes] == [0, None]
    (light,) = box.lights
    assert isinstance(light, AreaLight)
    assert np.cross(light.half_u, light.half_v) == pytest.approx((0, -1, 0))


def test_the_sweep_has_256_different_media():
    media = scenes.sweep_media()

    assert len({(m.mean_extinction, m.albedo, m.asymmetry) for m in media}) == len(media) == 256


def noisy_images(seed, *, count, bias=0.0):
    """Half of each image is without noise, as where nothing is seen but the sky."""
    noise = np.random.default_rng(seed).exponential(size=(count, 64, 64, 3)) - 1
    noise[:, :, 32:] = 0
    return (1 + bias + 0.1 * noise).astype(np.float32)


@pytest.mark.parametrize(
    "agree",
    [lambda a, b: compare(estimate(a), estimate(b)), compare_pairs],
    ids=["renders of one image", "renders of many images"],
)
def test_images_agree_unless_one_is_biased(agree):
    same = agree(noisy_images(1, count=8), noisy_images(2, count=8))
    other = agree(noisy_images(1, count=8), noisy_images(2, count=8, bias=0.002))

    assert same.holds
    assert not other.holds


def test_a_biased_block_is_seen():
    biased = noisy_images(2, count=8)
    biased[:, 8:16, 8:16] += 0.05

    assert not compare(estimate(noisy_images(1, count=8)), estimate(biased)).holds


def test_pairs_span_the_regimes_and_most_were_never_measured(tmp_path):
    measured = load_tradeoff(Path(__file__).parents[2] / "configs" / "tradeoff.yaml").config
    media = [pair.scene(tmp_path).media[0] for pair in PAIRS]

    assert len({pair.name for pair in PAIRS}) == 12
    assert {medium.line_law.regime for medium in media} >= {"exponential", "negative", "pink", "fbm"}
    assert sum(pair.medium in measured.media and pair.stage in measured.stages for pair in PAIRS) <= 7
    assert all(64 <= pair.size <= 128 for pair in PAIRS)


def test_true_errors_are_those_of_the_image_and_not_of_its_reference():
    rng = np.random.default_rng(1)
    truth = np.full((64, 64, 3), 2.0)
    reference = truth + 0.1 * rng.standard_normal(truth.shape)
    image = truth + 0.2 * rng.standard_normal(truth.shape)
    image[:, :32] += 0.4
    found = true_errors(image, reference, np.full(truth.shape, 0.1**2))

    # 0.2 everywhere, and 0.4 in addition to it in one half.
    assert found.rms == pytest.approx(np.sqrt((0.1**2 + (0.1**2 + 0.2**2)) / 2), rel=0.02)
    assert found.mean == pytest.approx((0.1 + np.hypot(0.1, 0.2)) / 2, rel=0.02)
    assert found.plain == pytest.approx(found.rms, rel=0.02)


@pytest.mark.skipif(shutil.which("gcc") is None, reason="there is no gcc")
def test_the_loop_walks_as_the_theory_says(tmp_path):
    walk = run_walk(build_walk(tmp_path), 1 << 20, seed=3)

    # By an independent walk in float64, of 2e6 paths.
    assert walk.events_per_path == pytest.approx(1.5905, abs=0.015)
    assert walk.mean == pytest.approx(0.7632, abs=0.0015)


def test_pictures_compare_every_stage_law_phase_function_plane_and_driver():
    stages = {path.name for path in (Path(__file__).parents[2] / "usd_scenes" / "stages").glob("*.usda")}
    media = [
        replace(medium, **picture.medium)
        for picture in PICTURES
        if picture.scene in SCENES
        for medium in SCENES[picture.scene]().media
    ]

    assert len({picture.name for picture in PICTURES}) == len(PICTURES) >= 60
    assert {picture.scene for picture in PICTURES} == {*SCENES, *stages}
    assert {picture.planes for picture in PICTURES} >= {"none", "usual", "all", *RENDERED_AOVS}
    assert {picture.by for picture in PICTURES} == {"image", "batch", "goal", "threads"}
    assert {picture.settings.get("transport") for picture in PICTURES} >= {"renewal", "mixed"}
    assert {medium.line_variance for medium in media} == {*LINE_VARIANCES}
    assert {medium.phase_function for medium in media} == {*PHASE_FUNCTIONS}
    assert {medium.line_law.regime for medium in media} == {*get_args(Regime)}


def test_one_byte_that_differs_is_told(tmp_path):
    before, after = tmp_path / "before.npz", tmp_path / "after.npz"
    values = np.zeros((4, 4), dtype=np.float32)
    np.savez(before, radiance=values, alpha=values, depth=np.full(3, np.nan))
    np.savez(after, radiance=values, alpha=-values, depth=np.full(3, np.nan))
    assert [*differences(before, before)] == []
    assert [*differences(before, after)] == ["alpha: 0 of 16 numbers, by 0 at most"]


def test_a_cold_build_finds_nothing_but_the_compiler_s_header(tmp_path):
    for name in ("header_12/builtin.pch", "wp_kernel/kernel.o", "1.19.0/wp_kernel/kernel.o", "fgf-warp.lock"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    forget_kernels(tmp_path)
    assert [path.relative_to(tmp_path).as_posix() for path in sorted(tmp_path.rglob("*"))] == [
        "header_12",
        "header_12/builtin.pch",
    ]


def test_the_full_kernel_has_all_but_similar_media_and_what_excludes_other_parts():
    features = asdict(required_features(full_scene(), replace(SETTINGS, aovs=RENDERED_AOVS)))

    assert {name for name, value in features.items() if not value} == {"lone_law", "lone_solid", "similarity"}
