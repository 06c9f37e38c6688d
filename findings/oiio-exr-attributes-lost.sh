#!/usr/bin/env bash
# Expected: metadata that a format has no type for is refused or reported when an image is written.
# What happens: OpenImageIO drops attributes of type double, int64 and int[4] when it writes an EXR, though EXR has a
# double, and open(), write_image(), close() and has_error all say that nothing is wrong; float and matrix are kept.
# Where it matters: exact parameters and seeds in the headers of renders: write them as text.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check OpenImageIO==3.2.2.0 numpy==2.4.6
cat > "$folder/show.py" <<'PYTHON'
import sys

import numpy as np
import OpenImageIO as oiio

print("OpenImageIO", oiio.__version__)
attributes = {
    "of_float": ("float", 1.5),
    "of_double": ("double", 1.5),
    "of_int": ("int", 7),
    "of_int64": ("int64", 7),
    "of_four_ints": ("int[4]", (1, 2, 3, 4)),
    "of_matrix": ("matrix", tuple(float(i) for i in range(16))),
    "of_text": ("string", "1.5"),
}
spec = oiio.ImageSpec(2, 2, 1, oiio.FLOAT)
for name, (kind, value) in attributes.items():
    spec.attribute(name, oiio.TypeDesc(kind), value)
file = oiio.ImageOutput.create("header.exr")
is_well = file.open("header.exr", spec) and file.write_image(np.zeros((2, 2, 1), dtype=np.float32)) and file.close()
print("written without an error:", is_well and not file.has_error)
kept = {attribute.name for attribute in oiio.ImageInput.open("header.exr").spec().extra_attribs}
lost = sorted(set(attributes) - kept)
for name, (kind, value) in attributes.items():
    print(f"{kind:8} {value}: {'kept' if name in kept else 'lost'}")
sys.exit(0 if is_well and lost == ["of_double", "of_four_ints", "of_int64"] else 1)
PYTHON
cd "$folder"
venv/bin/python show.py
