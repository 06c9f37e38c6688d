#!/usr/bin/env bash
# Expected: in kernels, which are written in Python, a == (a // b) * b + a % b for negative a too, as in Python and in C.
# What happens: // rounds towards minus infinity, as in Python, and % truncates towards zero, as in C, so that the two do
# not belong together: -9 // 8 is -2 and -9 % 8 is -1, which adds up to -17. Python's remainder is 7.
# Where it matters: cells and bricks of grids and periodic lattices left of the origin; i - (i // n) * n is right.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check warp-lang==1.19.0 numpy==2.4.6
cat > "$folder/show.py" <<'PYTHON'
import sys

import warp as wp

wp.config.log_level = wp.LOG_ERROR


@wp.kernel
def divide(a: int, b: int, out: wp.array(dtype=int)):
    out[0] = a // b
    out[1] = a % b


print("warp-lang", wp.__version__)
out = wp.zeros(2, dtype=int, device="cpu")
wp.launch(divide, 1, inputs=[-9, 8, out], device="cpu")
quotient, remainder = (int(number) for number in out.numpy())
print(f"in a kernel: -9 // 8 = {quotient}, -9 % 8 = {remainder}, together {quotient * 8 + remainder}")
print(f"in Python:   -9 // 8 = {-9 // 8}, -9 % 8 = {-9 % 8}, together {-9 // 8 * 8 + -9 % 8}")
sys.exit(0 if (quotient, remainder) == (-2, -1) else 1)
PYTHON
cd "$folder"
WARP_CACHE_PATH="$folder/kernels" venv/bin/python show.py
