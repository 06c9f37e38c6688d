"""Which frames a FrameSpec names, as usdrecord spells them."""

from __future__ import annotations

from itertools import islice

from pxr import Tf, UsdUtils

from fgf_warp.errors import SceneError

FRAMES_MAX = 100_000
ACCEPTED = "frames such as 7, 1:24, 1:24x2 or 101,105:110"


def parse_frames(spec: str) -> tuple[float, ...]:
    """The time codes of a list of FrameSpecs.

    Args:
        spec: FrameSpecs with commas between them, each a time code, or the first and the last with a colon between
            them, and after an ``x`` the stride.

    Returns:
        Each of them once, in the order in which they are named.

    Raises:
        SceneError: for what is no such list, or names no frame or more than 100,000.
    """
    found: list[float] = []
    for part in spec.split(","):
        try:
            codes = UsdUtils.TimeCodeRange.CreateFromFrameSpec(part.strip())
        except Tf.ErrorException:
            codes = ()
        frames = [code.GetValue() for code in islice(codes, FRAMES_MAX + 1)]
        if not frames:
            raise SceneError(f"frames = {spec}; accepted: {ACCEPTED}")
        found.extend(frames)
        if len(found) > FRAMES_MAX:
            raise SceneError(f"frames = {spec} are too many; accepted: at most {FRAMES_MAX}")
    return tuple(dict.fromkeys(found))
