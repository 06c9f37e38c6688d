"""The plain values that a scene is made of, and the largest number that is one on the device."""

from __future__ import annotations

import numpy as np

Rgb = tuple[float, float, float]
"""Linear Rec.709: radiance, or a factor per channel."""
Vec3 = tuple[float, float, float]
Vec4 = tuple[float, float, float, float]

WHITE: Rgb = (1.0, 1.0, 1.0)
BLACK: Rgb = (0.0, 0.0, 0.0)

FLOAT32_MAX = float(np.finfo(np.float32).max)
"""What is larger is not finite on the device."""
