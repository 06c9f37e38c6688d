#!/usr/bin/env bash
# Expected: an array of integer ids written by OpenImageIO into a float channel of an EXR keeps its values, as far as float
# has the digits: id 5 is read as 5.0. Likewise an EXR of uint ids read as float.
# What happens: integers are taken for fractions of their type's largest value, as pixels of an 8-bit picture are: id 5
# becomes 5 / (2^32 - 1) = 1.2e-9, without an error, whichever side the conversion is on.
# Where it matters: object, instance and material ids in EXR: convert to float32 first (exact up to 2^24), or ask for uint
# when writing and when reading.
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
ids = np.array([[1, 2], [70000, 5]], dtype=np.uint32)[..., None]


def written_and_read(pixels, kept_as, asked_for):
    spec = oiio.ImageSpec(2, 2, 1, kept_as)
    file = oiio.ImageOutput.create("ids.exr")
    assert file.open("ids.exr", spec) and file.write_image(pixels) and file.close()
    file = oiio.ImageInput.open("ids.exr")
    found = file.read_image(asked_for)
    file.close()
    return [float(number) for number in found.ravel()]


into_float = written_and_read(ids, oiio.FLOAT, oiio.FLOAT)
out_of_uint = written_and_read(ids, oiio.UINT, oiio.FLOAT)
as_uint = written_and_read(ids, oiio.UINT, oiio.UINT)
converted = written_and_read(ids.astype(np.float32), oiio.FLOAT, oiio.FLOAT)
wanted = [1.0, 2.0, 70000.0, 5.0]
print("uint32 array into a float channel:", into_float)
print("uint channel read as float:       ", out_of_uint)
print("uint channel read as uint:        ", as_uint)
print("float32 array into a float channel:", converted)
fractions = np.allclose(into_float, np.array(wanted) / (2**32 - 1)) and into_float == out_of_uint
sys.exit(0 if fractions and as_uint == wanted and converted == wanted else 1)
PYTHON
cd "$folder"
venv/bin/python show.py
