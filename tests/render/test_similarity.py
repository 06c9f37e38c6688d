"""The similar medium that long paths see, against that medium as it can be authored."""

from dataclasses import replace

import numpy as np
import pytest

from fgf_warp.errors import ConfigError, UnsupportedFeatureError
from fgf_warp.features import required_features
from fgf_warp.renderer import render
from fgf_warp.scene import DistantLight, DomeLight, Medium, Scene, Solid, Surface
from fgf_warp.settings import RenderSettings
from tests import stats
from tests.grid import REGIMES
from tests.scenes import camera, furnace, law_of, transform

SETTINGS = RenderSettings(width=16, height=16, spp=4096, similarity_order=1)
FOG = {"mean_extinction": 4.0, "albedo": (0.9, 0.9, 0.9), "asymmetry": 0.8}


def lit_floor(**medium) -> Scene:
    """A floor that is lit through a ball of medium, which the camera does not see: light there has been scattered."""
    return Scene(
        camera((0, 0, 2), (0.5, 0, 0), aperture=0.3),
        shapes=(
            Solid("/floor", "cube", transform((3.0, 3.0, 0.1), (0, 0, -0.1)), Surface((0.8, 0.8, 0.8))),
            Solid("/ball", "sphere", transform(0.8, (1.8, 0.0, 1.0)), medium=0),
        ),
        media=(Medium("/fog", **medium),),
        lights=(DomeLight("/sky", (0.3, 0.3, 0.3)), DistantLight("/sun", (-0.8, 0.0, -0.6), 0.0, (2.0, 2.0, 2.0))),
    )


def as_authored(medium: Medium) -> dict:
    """The similar medium, with channels that differ in albedo alone."""
    channel = medium.similar_channels[0]
    return {
        "mean_extinction": channel.mean_extinction,
        "albedo": tuple(channel.albedo for channel in medium.similar_channels),
        "hurst": medium.hurst,
        "kappa": channel.kappa,
        "outer_scale": medium.outer_scale,
        "transport": medium.transport,
    }


@pytest.mark.parametrize(
    "medium",
    [
        FOG | REGIMES["pink"],
        pytest.param(FOG, marks=pytest.mark.slow),
        pytest.param(FOG | law_of(1.0, 0.5) | {"transport": "mixed"}, marks=pytest.mark.slow),
        pytest.param(FOG | REGIMES["negative"], marks=pytest.mark.slow),
        pytest.param(FOG | REGIMES["fbm"], marks=pytest.mark.slow),
        pytest.param(
            FOG | {"phase_function": "two_lobe", "back_asymmetry": -0.5, "back_weight": 0.1}, marks=pytest.mark.slow
        ),
        pytest.param(FOG | {"phase_function": "draine", "draine_alpha": 5.0}, marks=pytest.mark.slow),
    ],
    ids=["pink", "exponential", "mixed", "negative", "fbm", "two_lobe", "draine"],
)
def test_after_its_order_the_medium_is_the_similar_one(medium):
    """Nothing but the floor scatters before the medium does, so with order 1 it is the similar one throughout."""
    scene = lit_floor(**medium)
    similar = lit_floor(**as_authored(scene.media[0]))
    a = render(scene, SETTINGS)
    b = render(similar, replace(SETTINGS, similarity_order=None, seed=1))
    stats.assert_images_agree(a, b, blocks=2, detects=0.01)


@pytest.mark.slow
def test_the_floor_shows_which_medium_it_is():
    """The power of the test above: what it tells apart differs by several times what it detects."""
    scene = lit_floor(**FOG)
    a = render(scene, SETTINGS)
    b = render(scene, replace(SETTINGS, similarity_order=None, seed=1))
    with pytest.raises(AssertionError, match="z ="):
        stats.assert_images_agree(a, b, blocks=2, detects=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("albedo", [(0.9, 0.9, 0.9), (1.0, 0.9, 0.5)], ids=["grey", "coloured"])
def test_light_whose_direction_is_lost_is_scattered_alike(albedo):
    """From a thick ball, after four events: the image is the medium's own but for a hundredth."""
    scene = furnace(fills_view=True, mean_extinction=20.0, albedo=albedo, asymmetry=0.8)
    settings = replace(SETTINGS, spp=1024, similarity_order=4)
    assert required_features(scene, settings).chromatic == (len(set(albedo)) > 1)
    a, b = render(scene, settings), render(scene, replace(settings, similarity_order=None, seed=1))
    found, expected = (np.mean(result.radiance, axis=(0, 1), dtype=np.float64) for result in (a, b))
    np.testing.assert_allclose(found, expected, rtol=0.01)


def test_only_what_scatters_unevenly_is_replaced():
    def is_replaced(**medium) -> bool:
        return required_features(furnace(**medium), SETTINGS).similarity

    assert is_replaced(asymmetry=0.5)
    assert is_replaced(asymmetry=-0.5)
    assert not is_replaced()
    assert not is_replaced(phase_function="draine", draine_alpha=1.0)
    assert not required_features(furnace(asymmetry=0.5), replace(SETTINGS, similarity_order=None)).similarity


def test_what_cannot_be_replaced_is_refused():
    with pytest.raises(UnsupportedFeatureError, match="/medium: similarity_order = 1 with the exact line variance"):
        render(furnace(**REGIMES["exact fbm"], asymmetry=0.5), SETTINGS)
    with pytest.raises(ConfigError, match="similarity_order = 0; accepted: an integer in"):
        replace(SETTINGS, similarity_order=0)
