"""The camera: a pinhole, a thin lens or an orthographic one, and how its film is fitted to an image."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from fgf_warp.errors import SceneError
from fgf_warp.scene.boxes import Box
from fgf_warp.scene.checks import check_choice, check_motion, check_not_negative, check_positive, check_range
from fgf_warp.scene.placements import keyframes, unit_axes

Projection = Literal["perspective", "orthographic"]
PROJECTIONS: tuple[Projection, ...] = ("perspective", "orthographic")
ConformPolicy = Literal[
    "expandAperture", "cropAperture", "adjustApertureWidth", "adjustApertureHeight", "adjustPixelAspectRatio"
]
CONFORM_POLICIES: tuple[ConformPolicy, ...] = (
    "expandAperture",
    "cropAperture",
    "adjustApertureWidth",
    "adjustApertureHeight",
    "adjustPixelAspectRatio",
)

FILM_MAX = 1e6
"""The most that a length of a perspective camera's film may be, over its focal length: float32 cannot tell flatter rays
from each other."""
APERTURE_UNIT = 0.1
"""Unit of the lengths of film and lens [stage unit]: UsdGeom.Camera has them in tenths."""


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole, thin-lens or orthographic camera.

    Args:
        name: the prim path, for messages.
        camera_to_world: (4, 4) float64; the camera looks along its local -z, with +y up and +x right.
        focal_length: > 0 [stage unit / 10].
        horizontal_aperture: > 0, width of the film [stage unit / 10]; of an orthographic camera, of what it sees.
        vertical_aperture: > 0, height of the film.
        horizontal_offset: shift of the film to the right [stage unit / 10].
        vertical_offset: shift of the film upwards.
        projection: ``perspective`` or ``orthographic``.
        f_stop: focal length over the lens' diameter, >= 0; 0 is a pinhole. Not used by an orthographic camera.
        focus_distance: from the lens to what is sharp, along the view axis [stage unit], > 0 where f_stop > 0.
        clipping_range: nearest and farthest distance along the view axis that surfaces and boundaries are seen at
            directly [stage unit], 0 <= near < far.
        exposure_scale: > 0, by which radiance is multiplied in the image.
        conform_policy: what is changed where the image's aspect ratio is not the film's, as UsdRender names it; see
            `window`.
        pixel_aspect_ratio: width of a pixel over its height, > 0; ``adjustPixelAspectRatio`` finds its own.
        closing: (4, 4) float64, `camera_to_world` when the shutter closes, between which it moves linearly; None: it
            rests.

    Raises:
        SceneError: naming the camera, the parameter, its value and the accepted range.
    """

    name: str
    camera_to_world: np.ndarray
    focal_length: float = 50.0
    horizontal_aperture: float = 20.955
    vertical_aperture: float = 15.2908
    horizontal_offset: float = 0.0
    vertical_offset: float = 0.0
    projection: Projection = "perspective"
    f_stop: float = 0.0
    focus_distance: float = 0.0
    clipping_range: tuple[float, float] = (0.0, math.inf)
    exposure_scale: float = 1.0
    conform_policy: ConformPolicy = "expandAperture"
    pixel_aspect_ratio: float = 1.0
    closing: np.ndarray | None = None

    def __post_init__(self) -> None:
        check_motion(self.name, "camera_to_world", self.camera_to_world, self.closing)
        check_choice(self.name, "projection", self.projection, PROJECTIONS)
        check_choice(self.name, "conform_policy", self.conform_policy, CONFORM_POLICIES)
        check_not_negative(self.name, "f_stop", self.f_stop)
        if self.has_lens:
            check_positive(self.name, "focus_distance", self.focus_distance)
        check_positive(self.name, "exposure_scale", self.exposure_scale)
        near, far = self.clipping_range
        if not 0 <= near < far:
            raise SceneError(f"{self.name}: clipping_range = ({near:g}, {far:g}); accepted: 0 <= near < far")
        for key in ("focal_length", "horizontal_aperture", "vertical_aperture", "pixel_aspect_ratio"):
            check_positive(self.name, key, getattr(self, key))
        for key in ("horizontal_offset", "vertical_offset"):
            check_range(self.name, key, getattr(self, key), "finite", lambda x: True)
        if self.projection == "perspective":
            widest = FILM_MAX * self.focal_length
            for key in ("horizontal_aperture", "vertical_aperture", "horizontal_offset", "vertical_offset"):
                accepted = f"at most {FILM_MAX:g} focal_length = {widest:g}"
                check_range(self.name, key, getattr(self, key), accepted, lambda x: abs(x) <= widest)

    @property
    def has_lens(self) -> bool:
        """True where what is out of focus is blurred: a perspective camera that is no pinhole."""
        return self.f_stop > 0 and self.projection == "perspective"

    @property
    def is_pinhole(self) -> bool:
        """True where all rays begin in one point and see everything before it."""
        is_clipped = self.clipping_range != (0.0, math.inf)
        return self.projection == "perspective" and not (self.has_lens or is_clipped or self.closing is not None)

    @property
    def aspect_ratio(self) -> float:
        """Width of the film over its height."""
        return self.horizontal_aperture / self.vertical_aperture

    @property
    def position(self) -> np.ndarray:
        """The pinhole or the middle of the lens when the shutter opens, (3,) float64 in world space."""
        return self.camera_to_world[:3, 3]

    @property
    def lens_radius(self) -> float:
        """Radius of the lens [stage unit]; 0 of a pinhole."""
        return APERTURE_UNIT * self.focal_length / (2 * self.f_stop) if self.has_lens else 0.0

    def window(self, width: int, height: int) -> tuple[float, float, float, float]:
        """What the image shows, before the camera.

        Where the image's aspect ratio is not the film's, it is as `conform_policy` says: the film is widened until it
        covers the image (``expandAperture``) or narrowed until the image covers it (``cropAperture``), only its width
        or only its height is changed, or the pixels are no squares (``adjustPixelAspectRatio``).

        Args:
            width: of the image [pixel], > 0.
            height: of the image [pixel], > 0.

        Returns:
            Left, right, bottom and top: in perspective on the plane at distance 1, orthographic in stage units.
        """
        half_w, half_h = self.horizontal_aperture / 2, self.vertical_aperture / 2
        image_aspect = self.pixel_aspect_ratio * width / height
        wide, high = half_h * image_aspect, half_w / image_aspect
        policy = self.conform_policy
        fits_width = policy == "adjustApertureWidth" or (policy == "expandAperture" and wide > half_w)
        fits_width = fits_width or (policy == "cropAperture" and wide < half_w)
        if fits_width:
            half_w = wide
        elif policy != "adjustPixelAspectRatio":
            half_h = high
        scale = APERTURE_UNIT if self.projection == "orthographic" else 1 / self.focal_length
        return (
            scale * (self.horizontal_offset - half_w),
            scale * (self.horizontal_offset + half_w),
            scale * (self.vertical_offset - half_h),
            scale * (self.vertical_offset + half_h),
        )

    def start_bounds(self, width: int, height: int) -> Box:
        """A box that holds the points that camera rays begin at; tight unless the camera turns while it moves.

        Args:
            width: of the image [pixel], > 0.
            height: of the image [pixel], > 0.

        Returns:
            Lowest and highest corner, (3,) float64 each, in world space.
        """
        left, right, bottom, top = self.window(width, height)
        near = self.clipping_range[0]
        # Rays begin on the near plane: in the image's window there, which is widened by the lens as far as rays from
        # its rim to what is in focus have not come together.
        scale = near if self.projection == "perspective" else 1.0
        lens = self.lens_radius * abs(1 - near / self.focus_distance) if self.has_lens else 0.0
        middle = np.array([scale * (left + right) / 2, scale * (bottom + top) / 2, -near])
        half = np.array([scale * (right - left) / 2 + lens, scale * (top - bottom) / 2 + lens, 0.0])
        matrices = keyframes(self.camera_to_world, self.closing)
        axes = [unit_axes(matrix) for matrix in matrices]
        positions = [matrix[:3, 3] for matrix in matrices]
        if not np.array_equal(axes[0], axes[-1]):
            reach = float(np.abs(middle).sum() + half.sum())
            return np.min(positions, axis=0) - reach, np.max(positions, axis=0) + reach
        middles = [position + axes[0] @ middle for position in positions]
        spread = np.abs(axes[0]) @ half
        return np.min(middles, axis=0) - spread, np.max(middles, axis=0) + spread
