#!/usr/bin/env bash
# Expected: where the last bytes of an EXR find no room, write_image or close of OpenImageIO says so.
# What happens: what fails while pixels are written is told, but the last part of a file is in a buffer until it is closed,
# and when that cannot be written open, write_image and close are all true and there is no error. The file is cut off.
# Where it matters: disks that become full, and quotas: a picture that was taken for written cannot be read later. Read it
# back where there is little room. Here a limit on the size of files stands for the full disk.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check OpenImageIO==3.2.2.0 numpy==2.4.6
cat > "$folder/show.py" <<'PYTHON'
import os
import resource
import signal
import sys

import numpy as np
import OpenImageIO as oiio

print("OpenImageIO", oiio.__version__)
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
pixels = np.random.default_rng(0).random((32, 32, 4), dtype=np.float32)


def write(name: str) -> bool:
    spec = oiio.ImageSpec(32, 32, 4, "float")
    spec.attribute("compression", "zip")
    file = oiio.ImageOutput.create(name)
    answers = file.open(name, spec), file.write_image(pixels), file.close()
    says = file.geterror()
    is_told = not all(answers) or bool(says)
    print(f"{name}: {os.path.getsize(name)} bytes; open, write_image, close: {answers}; error: {says.strip()[:60]!r}")
    return is_told


def is_whole(name: str) -> bool:
    file = oiio.ImageInput.open(name)
    read = file is not None and file.read_image("float")
    oiio.geterror()
    return read is not None and read is not False and not file.geterror() and np.array_equal(read, pixels)


assert not write("whole.exr") and is_whole("whole.exr")
size = os.path.getsize("whole.exr")
told = {}
for missing in (100, 4000):
    resource.setrlimit(resource.RLIMIT_FSIZE, (size - missing, resource.RLIM_INFINITY))
    told[missing] = write(f"without-{missing}.exr")
    print(f"  can be read whole: {is_whole(f'without-{missing}.exr')}")
sys.exit(0 if not told[100] and told[4000] and not is_whole("without-100.exr") else 1)
PYTHON
cd "$folder"
venv/bin/python show.py
