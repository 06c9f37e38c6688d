#!/usr/bin/env bash
# Expected: a comparison of a picture with a reference fails where a pixel is NaN: NaN is within no tolerance of a number.
# What happens: ImageBufAlgo.compare() of OpenImageIO counts no failure, whatever the thresholds, for a pixel that is NaN
# in one picture and 0 in the other, even if every pixel is; inf against 0 does fail.
# Where it matters: tests of renderers by images: check that all pixels are finite first.
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
reference = oiio.ImageBuf(np.zeros((4, 4, 3), dtype=np.float32))
found = {}
for name, value in (("0.5", 0.5), ("inf", np.inf), ("nan", np.nan)):
    found[name] = oiio.ImageBufAlgo.compare(reference, oiio.ImageBuf(np.full((4, 4, 3), value, np.float32)), 1e-6, 1e-6)
    print(f"all pixels {name} against 0: failed {found[name].nfail} of 16, largest error {found[name].maxerror:g}")
sys.exit(0 if found["0.5"].nfail == 16 and found["inf"].nfail == 16 and found["nan"].nfail == 0 else 1)
PYTHON
cd "$folder"
venv/bin/python show.py
