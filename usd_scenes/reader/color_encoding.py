"""What a file of a picture says of how its colors are encoded.

OpenImageIO names a color space of every PNG, JPEG, BMP and WebP, also of those that say nothing, so that the chunks of
a PNG are read here, and of the others only what the file itself holds is taken.
"""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO, Literal

import numpy as np

Transfer = Literal["linear", "sRGB"] | float
"""From encoded to linear values; a number is the exponent of a power."""


@dataclass(frozen=True)
class Encoding:
    """What a file says.

    Args:
        transfer: None where it does not say, or says what is not known here.
        told: what it says that is not followed, one text each.
    """

    transfer: Transfer | None = None
    told: tuple[str, ...] = ()


PNG = b"\x89PNG\r\n\x1a\n"
PNG_ORDER = (b"cICP", b"iCCP", b"sRGB", b"gAMA")
"""Of several chunks the first of these holds, as the specification of PNG says."""
CHUNK_MAX = 1 << 24
"""Bytes of a chunk, or of a profile, that are looked at."""
GAMMA_UNIT = 100000
SRGB_GAMMA = (45455, 10)
"""What a gAMA chunk of 1/2.2 holds, and by how much it may differ: it stands for sRGB, beside which it is written."""
EXPONENTS = (0.1, 10.0)
"""Of a power that is taken for one."""
SRGB_CODE, LINEAR_CODE, REC_709_PRIMARIES = 13, 8, 1
CODED_TRANSFERS: dict[int, Transfer] = {SRGB_CODE: "sRGB", LINEAR_CODE: "linear", 4: 2.2, 5: 2.8}
"""Transfer characteristics of ITU-T H.273 that are followed."""
NAMING_FORMATS = ("tiff", "openexr", "targa")
"""Formats of which OpenImageIO names a color space only where the file does."""
COLOR_SPACE_NAME = re.compile(r"(?P<transfer>lin|srgb|g\d\d)_(?P<primaries>[a-z0-9]+)(_scene|_display)?")
COMMON_NAMES: dict[str, Transfer] = {"srgb": "sRGB", "linear": "linear", "lin_srgb": "linear"}
REC_709_COLORANTS = np.array([[0.4361, 0.3851, 0.1431], [0.2225, 0.7169, 0.0606], [0.0139, 0.0971, 0.7141]])
"""XYZ of the primaries of Rec. 709 in columns, adapted to D50 as ICC profiles are."""
CURVE_TOLERANCE = 0.003
"""By which two curves of transfer may differ and count as one: a power of 2.2 differs from sRGB by 0.008."""
COLORANT_TOLERANCE = 0.01


def read_encoding(file: str, metadata: Callable[[str], Any], file_format: str) -> Encoding:
    """What a file says of its colors.

    Args:
        file: its path.
        metadata: gives what OpenImageIO read of it by name, None of what is not there.
        file_format: OpenImageIO's name of the format.

    Returns:
        Its transfer function, and what it says that is not followed. Of PNG the file itself is read, of others what
        OpenImageIO found.
    """
    if file_format == "png":
        with Path(file).open("rb") as opened:
            return _png_encoding(opened)
    profile = metadata("ICCProfile")
    if profile is not None:
        return _profile_encoding(bytes(np.asarray(profile, dtype=np.uint8)))
    if file_format in NAMING_FORMATS:
        name = metadata("oiio:ColorSpace")
        return _named_encoding(str(name)) if name else Encoding()
    return Encoding("sRGB") if metadata("Exif:ColorSpace") == 1 else Encoding()


def decode(encoded: np.ndarray, transfer: Transfer) -> np.ndarray:
    """Linear from encoded values in [0, 1], or beyond.

    Args:
        encoded: of any shape; 1 is white.
        transfer: linear, sRGB, or the exponent of a power.

    Returns:
        Of the shape of `encoded`; numbers below 0 stay so where the transfer is linear or sRGB, and become 0 under a
        power.
    """
    if transfer == "linear":
        return encoded
    if transfer == "sRGB":  # IEC 61966-2-1
        steep = np.maximum((encoded + 0.055) / 1.055, 0.0) ** 2.4
        return np.where(encoded <= 0.04045, encoded / 12.92, steep)
    return np.maximum(encoded, 0.0) ** transfer


def _png_encoding(file: BinaryIO) -> Encoding:
    chunks = dict(_png_chunks(file))
    told: tuple[str, ...] = ()
    for kind in PNG_ORDER:
        if kind in chunks:
            found = _chunk_encoding(kind, chunks[kind])
            told += found.told
            if found.transfer is not None:
                return replace(found, told=told)
    return Encoding(told=told)


def _png_chunks(file: BinaryIO) -> Iterator[tuple[bytes, bytes]]:
    """The chunks of `PNG_ORDER` that stand before the pixels."""
    if file.read(len(PNG)) != PNG:
        return
    while len(head := file.read(8)) == 8:
        length, kind = struct.unpack(">I4s", head)
        if kind in (b"IDAT", b"IEND"):
            return
        if kind in PNG_ORDER and length <= CHUNK_MAX:
            yield kind, file.read(length)
            length = 0
        file.seek(length + 4, 1)


def _chunk_encoding(kind: bytes, data: bytes) -> Encoding:
    if kind == b"sRGB":
        return Encoding("sRGB")
    if kind == b"gAMA" and len(data) == 4:
        return _gamma_encoding(struct.unpack(">I", data)[0])
    if kind == b"cICP" and len(data) == 4:
        primaries, code, _, _ = data
        transfer = CODED_TRANSFERS.get(code)
        told = () if transfer is not None else (f"the transfer characteristics {code} of its cICP are not known",)
        return Encoding(transfer, told + _foreign_primaries(primaries == REC_709_PRIMARIES))
    if kind == b"iCCP":
        try:
            profile = zlib.decompressobj().decompress(data.partition(b"\0")[2][1:], CHUNK_MAX)
        except zlib.error:
            return Encoding(told=("its ICC profile is damaged",))
        return _profile_encoding(profile)
    return Encoding(told=(f"its {kind.decode('ascii')} chunk is damaged",))


def _gamma_encoding(gamma: int) -> Encoding:
    middle, room = SRGB_GAMMA
    if abs(gamma - middle) <= room:
        return Encoding("sRGB")
    transfer = _power(GAMMA_UNIT / gamma) if gamma else None
    return Encoding(transfer) if transfer else Encoding(told=(f"its gamma of {gamma / GAMMA_UNIT:g} is not plausible",))


def _named_encoding(name: str) -> Encoding:
    common = COMMON_NAMES.get(name.lower())
    if common is not None:
        return Encoding(common)
    found = COLOR_SPACE_NAME.fullmatch(name.lower())
    if found is None:
        return Encoding(told=(f"its color space {name} is not known",))
    kind = found["transfer"]
    transfer: Transfer | None = {"lin": "linear", "srgb": "sRGB"}.get(kind) or _power(int(kind[1:]) / 10)  # type: ignore[assignment]
    return Encoding(transfer, _foreign_primaries(found["primaries"] == "rec709"))


def _foreign_primaries(are_ours: bool) -> tuple[str, ...]:
    return () if are_ours else ("its primaries are taken for those of Rec. 709",)


def _profile_encoding(profile: bytes) -> Encoding:
    """Of an ICC profile that is a matrix or grey, and has curves."""
    try:
        tags = _profile_tags(profile)
        names = (b"kTRC",) if b"kTRC" in tags else (b"rTRC", b"gTRC", b"bTRC")
        curves = [_curve(tags[name]) for name in names]
        columns = [tags[name] for name in (b"rXYZ", b"gXYZ", b"bXYZ") if name in tags]
        colorants = np.array([struct.unpack(">3i", column[8:20]) for column in columns]).T / 65536
    except (KeyError, ValueError, struct.error):
        return Encoding(told=("its ICC profile is not one of curves and a matrix, and is not followed",))
    transfers = {_classified(curve) for curve in curves}
    are_ours = colorants.shape != (3, 3) or bool(np.abs(colorants - REC_709_COLORANTS).max() < COLORANT_TOLERANCE)
    transfer = transfers.pop() if len(transfers) == 1 else None
    told = () if transfer is not None else ("the curves of its ICC profile are not known, and are not followed",)
    return Encoding(transfer, told + _foreign_primaries(are_ours))


def _profile_tags(profile: bytes) -> dict[bytes, bytes]:
    (count,) = struct.unpack_from(">I", profile, 128)
    if count > len(profile) // 12:
        raise ValueError("more tags than bytes")
    places = (struct.unpack_from(">4sII", profile, 132 + 12 * tag) for tag in range(count))
    return {name: profile[start : start + size] for name, start, size in places}


PLACES = np.linspace(0.0, 1.0, 65)
"""Encoded values at which curves are compared."""


def _curve(tag: bytes) -> np.ndarray:
    """(65,) linear values at `PLACES`."""
    if tag[:4] == b"curv":
        (count,) = struct.unpack_from(">I", tag, 8)
        values = np.frombuffer(tag, dtype=">u2", count=count, offset=12).astype(np.float64)
        if count == 0:
            return PLACES
        if count == 1:
            return np.asarray(PLACES ** (values[0] / 256))
        return np.interp(PLACES, np.linspace(0.0, 1.0, count), values / 65535)
    if tag[:4] != b"para":
        raise ValueError("no curve")
    (kind,) = struct.unpack_from(">H", tag, 8)
    number_count = {0: 1, 1: 3, 2: 4, 3: 5, 4: 7}.get(kind)
    if number_count is None:
        raise ValueError("an unknown kind of curve")
    g, a, b, c, d, e, f = (*(n / 65536 for n in struct.unpack_from(f">{number_count}i", tag, 12)), *[0.0] * 7)[:7]
    if kind == 0:
        return np.asarray(PLACES**g)
    steep = np.maximum(a * PLACES + b, 0.0) ** g
    if kind in (1, 2):
        return np.where(a * PLACES + b >= 0, steep + c, c)
    return np.where(d <= PLACES, steep + e, c * PLACES + f)


def _classified(curve: np.ndarray) -> Transfer | None:
    for transfer in ("linear", "sRGB"):
        if np.abs(curve - decode(PLACES, transfer)).max() < CURVE_TOLERANCE:
            return transfer
    middle = float(curve[len(curve) // 2])
    power = _power(round(float(np.log(middle) / np.log(0.5)), 2)) if 0 < middle < 1 else None
    return power if power and np.abs(curve - decode(PLACES, power)).max() < CURVE_TOLERANCE else None


def _power(exponent: float) -> Transfer | None:
    if abs(exponent - 1) < 0.01:
        return "linear"
    return exponent if EXPONENTS[0] <= exponent <= EXPONENTS[1] else None
