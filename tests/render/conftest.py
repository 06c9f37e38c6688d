"""Which renders of the test suite run every time."""

import pytest

SLOW_REGIMES = frozenset({"exponential", "fbm", "exact fbm"})
"""Each law has kernels of its own, and building them takes most of the time of these tests."""
ALWAYS = frozenset({"test_medium", "test_absorbing_sphere_shows_the_law", "test_both_drivers_render_the_same_picture"})
"""Where the law and its energy show; these render every regime."""


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Everything else renders pink noise every time, and the other laws with the slow tests."""
    for item in items:
        parameters = item.callspec.params if hasattr(item, "callspec") else {}
        if parameters.get("regime") in SLOW_REGIMES and item.originalname not in ALWAYS and "render" in item.path.parts:
            item.add_marker(pytest.mark.slow)
