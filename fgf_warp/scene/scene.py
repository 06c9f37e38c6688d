"""The scene as a whole: what one render needs, and what its parts are to each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np

from fgf_warp.errors import SceneError
from fgf_warp.scene.boxes import Box, box_around, boxes_meet, boxes_overlap
from fgf_warp.scene.camera import Camera
from fgf_warp.scene.lights import Light
from fgf_warp.scene.medium import Medium
from fgf_warp.scene.shapes import (
    MAX_CONTAINERS,
    Shape,
    bodies_of,
    moves,
    separate_bodies_of,
    separate_count,
    shape_bounds,
    shape_widths,
)

RESOLVED_DEPTH = 1e5
"""sigma_m times the largest coordinate: above it float32, which rounds by 6e-8, moves events by a hundredth of a mean
free path."""
START_ROUNDING = 1e-5
"""Of coordinates in float32, amply and relative: camera rays that begin so near a shape may begin in it."""
FACE_ROUNDING = 2e-6
"""Of coordinates in float32, relative: how far apart rays find faces that coincide, but at the flattest slants."""


@dataclass(frozen=True, eq=False)
class Scene:
    """All that one render needs of a stage.

    Args:
        camera: where the picture is taken from.
        shapes: surfaces and boundaries of media; of meshes of media their `bodies_of`, and of those whose medium
            freezes paths their `separate_bodies_of`, as long as `MAX_CONTAINERS` allow.
        media: those that shapes are filled with, which name them by index.
        lights: the scene's light sources.
        meters_per_unit: of the stage, > 0; carried into the headers of files.
        source: where the scene came from, for headers and messages.

    Raises:
        SceneError: where a shape names a medium that is not there, or the shapes that a medium fills are too large for
            its law.
    """

    camera: Camera
    shapes: tuple[Shape, ...] = ()
    media: tuple[Medium, ...] = ()
    lights: tuple[Light, ...] = ()
    meters_per_unit: float = 0.01
    source: str = ""

    def __post_init__(self) -> None:
        for shape in self.shapes:
            if shape.medium is not None and not 0 <= shape.medium < len(self.media):
                raise SceneError(f"{shape.name}: medium {shape.medium} is not one of the scene's {len(self.media)}")
        bodies = tuple(body for shape in self.shapes for body in bodies_of(shape))
        if parted := _shapes_to_part(bodies, self.media):
            bodies = tuple(
                body
                for k, shape in enumerate(bodies)
                for body in (separate_bodies_of(shape) if k in parted else (shape,))
            )
        if bodies != self.shapes:  # Else the same tuple stays, by which one sees that another scene's are the same.
            object.__setattr__(self, "shapes", bodies)
        for index, medium in enumerate(self.media):
            if medium.line_variance == "exact" and (longest := self.longest_segment(index)) is not None:
                medium.check_segments(longest)

    def medium_index(self, name: str | None = None) -> int:
        """Index of the medium called `name`, or of the only one.

        Raises:
            SceneError: where there is none of that name, or no single one to take.
        """
        names = [medium.name for medium in self.media]
        if name is None and len(names) == 1:
            return 0
        if name in names:
            return names.index(name)
        asked = f"no medium {name!r}" if name else "the medium must be named"
        raise SceneError(f"{self.source or 'scene'}: {asked}; it has: {', '.join(names) or 'none'}")

    def medium_warnings(self, index: int, medium: Medium) -> list[str]:
        """What a user should know of a medium, one sentence each.

        Args:
            index: into `media`, of the one in whose place it stands.
            medium: that one, or another.
        """
        extent, reach = self._medium_sizes[index]
        found = medium.line_law.warnings([] if extent is None else [extent])
        if reach is not None:
            mean_extinction = max(line.mean_extinction for line in medium.channel_laws)
            if mean_extinction * reach > RESOLVED_DEPTH:
                found.append(
                    f"sigma_m = {mean_extinction:g} with coordinates up to {reach:.3g}: float32 rounds positions by "
                    "more than a hundredth of a mean free path, and the picture of it is off by as much"
                )
        if names := self._frozen_as_one(index, medium):
            found.append(
                f"shells that lie apart in {', '.join(names)} share one extinction on a frozen path, since each by "
                f"itself would be one of the {MAX_CONTAINERS} shapes that media may fill"
            )
        return found

    def _frozen_as_one(self, index: int, medium: Medium) -> list[str]:
        """Names of the shapes that a medium freezes as one body though shells of theirs lie apart."""
        several = [k for k in self._of_several_shells if self.shapes[k].medium == index]
        if not several:
            return []
        parted = _shapes_to_part(self.shapes, (*self.media[:index], medium, *self.media[index + 1 :]))
        return [self.shapes[k].name for k in several if medium.freezes_paths and k not in parted]

    @cached_property
    def _of_several_shells(self) -> tuple[int, ...]:
        """Indices of shapes that are filled with a medium and have several `separate_bodies_of`."""
        return tuple(k for k, shape in enumerate(self.shapes) if shape.medium is not None and separate_count(shape) > 1)

    def medium_extent(self, index: int) -> float | None:
        """The longest side of the bounding boxes of the shapes that a medium fills [stage unit]; None of none."""
        return self._medium_sizes[index][0]

    @cached_property
    def _medium_sizes(self) -> tuple[tuple[float | None, float | None], ...]:
        """Of each medium its extent, and the largest coordinate in it, from the origin or the camera [stage unit].

        Both are None of a medium that fills nothing. They are kept, since a sweep asks for them for each sample.
        """
        found: list[tuple[float | None, float | None]] = []
        for index in range(len(self.media)):
            bounds = self._medium_bounds(index)
            if not bounds:
                found.append((None, None))
                continue
            corners: np.ndarray = np.array(bounds).reshape(-1, 3)
            reach = float(max(np.abs(corners).max(), np.linalg.norm(corners - self.camera.position, axis=1).max()))
            found.append((max(float((high - low).max()) for low, high in bounds), reach))
        return tuple(found)

    @cached_property
    def prims(self) -> tuple[str, ...]:
        """The distinct names of shapes, in order: the first is prim 1 of images."""
        return tuple(dict.fromkeys(shape.name for shape in self.shapes))

    def shapes_around_starts(self, width: int, height: int) -> tuple[Shape, ...]:
        """Shapes filled with media that some camera rays may begin in and others not.

        They are told by bounding boxes, so there may be too many of them, but not too few.

        Args:
            width: of the image [pixel], > 0.
            height: of the image [pixel], > 0.
        """
        low, high = self.camera.start_bounds(width, height)
        margin = START_ROUNDING * max(np.abs(low).max(), np.abs(high).max())
        varied = []
        for shape, box in zip(self.shapes, self.bounds, strict=True):
            is_varied = shape.medium is not None and (moves(shape) or not np.array_equal(low, high))
            if is_varied and boxes_overlap((low, high), box, margin):
                varied.append(shape)
        return tuple(varied)

    @cached_property
    def neighbours(self) -> tuple[Shape, ...]:
        """Shapes filled with one medium that may touch or overlap each other.

        They are told by bounding boxes, so there may be too many of them, but not too few.
        """
        filled = [k for k, shape in enumerate(self.shapes) if shape.medium is not None]
        if len(filled) > MAX_CONTAINERS:  # Nothing renders that.
            return ()
        found = set()
        for a, b in combinations(filled, 2):
            if self.shapes[a].medium == self.shapes[b].medium and boxes_meet(self.bounds[a], self.bounds[b]):
                found |= {a, b}
        return tuple(self.shapes[k] for k in sorted(found))

    @property
    def contact_rounding(self) -> float:
        """How far apart rays may find boundaries of `neighbours` that coincide [stage unit]; 0 of none."""
        corners = [shape_bounds(shape) for shape in self.neighbours]
        return FACE_ROUNDING * float(np.abs(corners).max(initial=0))

    def frozen_share(self, index: int, medium: Medium) -> float:
        """The share of paths for which a medium is frozen, at the thickness of what it fills.

        The thickness is the least width of a shape, of several shapes the largest.

        Args:
            index: into `media`, of the one in whose place it stands.
            medium: that one, or another.

        Returns:
            In [0, 1]; 0 where it fills nothing or freezes no paths.
        """
        widths = [shape_widths(shape)[0] for shape in self.shapes if shape.medium == index]
        return medium.line_law.frozen_share(max(widths)) if widths and medium.freezes_paths else 0.0

    def longest_segment(self, index: int) -> float | None:
        """A length that no segment in a medium exceeds [stage unit]; None where it fills nothing."""
        bounds = self._medium_bounds(index)
        if not bounds:
            return None
        one_after_the_other = sum(shape_widths(shape)[1] for shape in self.shapes if shape.medium == index)
        return min(one_after_the_other, _diagonal(bounds))

    def _medium_bounds(self, index: int) -> list[Box]:
        """The boxes of the shapes that a medium fills."""
        return [bounds for shape, bounds in zip(self.shapes, self.bounds, strict=True) if shape.medium == index]

    @cached_property
    def bounds(self) -> tuple[Box, ...]:
        """Lowest and highest corner, (3,) float each, of every shape's box.

        They are kept, since finding those of a mesh takes time, and a sweep asks for each of its samples.
        """
        return tuple(shape_bounds(shape) for shape in self.shapes)

    @cached_property
    def radius(self) -> float:
        """Half the diagonal of the box around all shapes [stage unit]; 1 of none."""
        if not self.shapes:
            return 1.0
        return _diagonal(self.bounds) / 2

    def with_medium(self, index: int, medium: Medium) -> Scene:
        """The same scene with another medium in the place of `media[index]`."""
        return self.with_media((*self.media[:index], medium, *self.media[index + 1 :]))

    def with_media(self, media: tuple[Medium, ...]) -> Scene:
        """The same scene with other media in the place of its own."""
        return replace(self, media=media)

    def with_camera(self, camera: Camera) -> Scene:
        """The same scene seen from elsewhere; `bounds` stay, which are found once for all views."""
        moved = replace(self, camera=camera)
        moved.__dict__["bounds"] = self.bounds
        return moved


def _shapes_to_part(shapes: Sequence[Shape], media: Sequence[Medium]) -> set[int]:
    """Indices of the shapes whose shells are to be bodies of their own: where they are frozen, each at its own rates.

    That holds of one shape after the other, as long as no more than `MAX_CONTAINERS` bodies come of it.
    """
    freezing = {index for index, medium in enumerate(media) if medium.freezes_paths}
    if not freezing:
        return set()
    found, room = set(), MAX_CONTAINERS - sum(shape.medium is not None for shape in shapes)
    for k, shape in enumerate(shapes):
        more = separate_count(shape) - 1 if shape.medium in freezing else 0
        if 0 < more <= room:
            found.add(k)
            room -= more
    return found


def _diagonal(boxes: Sequence[Box]) -> float:
    """Length of the diagonal of the box around boxes, of which there is one at least [stage unit]."""
    low, high = box_around(boxes)
    return float(np.linalg.norm(high - low))
