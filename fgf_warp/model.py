"""What a render is about: an immutable model, and the state that its steps change."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fgf_warp.integrator.program import Program
from fgf_warp.scene import Medium, Scene
from fgf_warp.settings import RenderSettings
from fgf_warp.upload import UploadedScene


@dataclass(frozen=True)
class Variant:
    """What one image of a batch has of its own.

    Args:
        media: in place of the scene's, one for each.
        seed: in place of the settings', in [0, 2^64).
    """

    media: tuple[Medium, ...]
    seed: int


@dataclass(frozen=True, eq=False)
class Model:
    """What stays the same during a render: the scene on its device, and the kernel made for it.

    Args:
        scene: what is rendered.
        settings: how.
        variants: one for each image.
        program: the kernels.
        uploaded: scene and variants on the device.
    """

    scene: Scene
    settings: RenderSettings
    variants: tuple[Variant, ...]
    program: Program
    uploaded: UploadedScene


@dataclass(eq=False)
class State:
    """What a render changes.

    Args:
        film: sums over samples, for each pixel of each image.
        samples: (images, height, width) int32, that each pixel has so far.
        seconds: (images,) that each image took: the time of all threads over their number.
    """

    film: Any
    samples: np.ndarray
    seconds: np.ndarray
