"""One kernel for many scenes: whatever a scene does not need may be in its kernel, and changes no image."""

from collections.abc import Iterable
from dataclasses import fields

import pytest

from fgf_warp import renderer
from fgf_warp.features import RenderFeatures, required_features
from fgf_warp.scene import Scene
from fgf_warp.settings import RenderSettings


def union(of: Iterable[RenderFeatures]) -> RenderFeatures:
    """The least that renders all of them."""
    every = list(of)
    merged = {}
    for field in fields(RenderFeatures):
        values = [getattr(features, field.name) for features in every]
        if isinstance(values[0], frozenset):
            merged[field.name] = frozenset().union(*values)
        elif isinstance(values[0], bool):
            merged[field.name] = any(values)
        else:  # Of the lone medium, and the sampler: what they agree on.
            merged[field.name] = values[0] if len(set(values)) == 1 else ""
    return RenderFeatures(**merged)


def share_one_kernel(scenes: Iterable[Scene], settings: RenderSettings, monkeypatch: pytest.MonkeyPatch) -> None:
    """Makes the renderer build the kernel of all these scenes for each of them."""
    features = union(required_features(scene, settings) for scene in scenes)
    monkeypatch.setattr(renderer, "required_features", lambda _scene, _settings: features)
