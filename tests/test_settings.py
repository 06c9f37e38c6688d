import pytest

from fgf_warp.errors import ConfigError
from fgf_warp.settings import Aov, RenderSettings


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"width": True}, r"width = True; accepted: an integer in \[1, 65536\]"),
        ({"spp": 2.0}, "spp = 2.0; accepted: an integer"),
        ({"threads": True}, "threads = True; accepted: an integer >= 1"),
        ({"threads": "2"}, "threads = '2'; accepted: an integer >= 1"),
        ({"threads": 0}, "threads = 0; accepted: an integer >= 1"),
        ({"device": None}, "device = None; accepted: a name"),
        ({"aovs": {"dept"}}, "aovs = {'dept'}; accepted: a set of depth, variance"),
        ({"aovs": {1}}, r"aovs = \{1\}; accepted: a set of depth, variance"),
        ({"aovs": "depth"}, "aovs = 'depth'; accepted: a set of depth, variance"),
        ({"aovs": None}, "aovs = None; accepted: a set of depth, variance"),
    ],
)
def test_settings_of_another_type_are_refused(settings, message):
    with pytest.raises(ConfigError, match=message):
        RenderSettings(**settings)


def test_any_set_of_planes_will_do():
    found = RenderSettings(aovs={"depth", Aov.VARIANCE})
    assert found == RenderSettings(aovs=frozenset({Aov.DEPTH, Aov.VARIANCE}))
    assert all(isinstance(aov, Aov) for aov in found.aovs)
    assert hash(found) == hash(RenderSettings(aovs=frozenset({Aov.DEPTH, Aov.VARIANCE})))
