#!/usr/bin/env bash
# Expected: a PNG of which nobody said a colour space holds no chunk about it; a mask or a height map has none to say.
# What happens: OpenImageIO writes an sRGB chunk and gAMA 1/2.2 into every PNG, also of one channel and of 16 bits, unless it
# is told otherwise; and it gives every PNG that it reads the colour space sRGB, also where the file says nothing.
# Where it matters: renderers that ask the file before they decode a texture, as sourceColorSpace "auto" of UsdUVTexture
# does: a mask of roughness written so is decoded as a colour. Author "raw", or write oiio:ColorSpace.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check OpenImageIO==3.2.2.0 numpy==2.4.6
cat > "$folder/show.py" <<'PYTHON'
import struct
import sys
import zlib

import numpy as np
import OpenImageIO as oiio

print("OpenImageIO", oiio.__version__)


def chunks(name: str) -> list[str]:
    data, at, found = open(name, "rb").read(), 8, []
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at : at + 8])
        found.append(kind.decode())
        at += length + 12
    return found


written = {}
for kind in ("uint8", "uint16"):
    spec = oiio.ImageSpec(4, 4, 1, kind)
    file = oiio.ImageOutput.create("mask.png")
    assert file.open("mask.png", spec) and file.write_image(np.zeros((4, 4, 1), dtype=kind)) and file.close()
    written[kind] = chunks("mask.png")
    print(f"one channel of {kind}, no colour space asked for: {' '.join(written[kind])}")


def chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


header = chunk(b"IHDR", struct.pack(">IIBBBBB", 2, 2, 8, 0, 0, 0, 0))
pixels = chunk(b"IDAT", zlib.compress(b"\0\x80\x80" * 2))
open("plain.png", "wb").write(b"\x89PNG\r\n\x1a\n" + header + pixels + chunk(b"IEND", b""))
space = oiio.ImageInput.open("plain.png").spec().getattribute("oiio:ColorSpace")
print(f"read from a file of {' '.join(chunks('plain.png'))}: oiio:ColorSpace = {space}")
says_srgb = all({"sRGB", "gAMA"} <= set(found) for found in written.values())
sys.exit(0 if says_srgb and space == "srgb_rec709_scene" else 1)
PYTHON
cd "$folder"
venv/bin/python show.py
