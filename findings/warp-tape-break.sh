#!/usr/bin/env bash
# Expected: the derivative of a loop that is left by `break` is that of the iterations that were run.
# What happens: wp.Tape gives a `for` loop the derivative of the iterations that were *not* run, without a word. Of
# acc += x * x at x = 2, left after three iterations, the value is 12 and so is the derivative; the tape says 8 where the
# range ends at 6, and 24 where it ends at 10. The same loop as a `while` is right.
# Where it matters: gradients through ray marching, null-collision loops and searches that end early.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check warp-lang==1.19.0 numpy==2.4.6
cat > "$folder/show.py" <<'PYTHON'
import sys

import numpy as np
import warp as wp

wp.config.log_level = wp.LOG_ERROR


@wp.kernel
def sum_with_for(x: wp.array(dtype=float), count: wp.array(dtype=int), y: wp.array(dtype=float)):
    total = float(0.0)
    for i in range(count[0]):
        if i == 3:
            break
        total += x[0] * x[0]
    y[0] = total


@wp.kernel
def sum_with_while(x: wp.array(dtype=float), count: wp.array(dtype=int), y: wp.array(dtype=float)):
    total = float(0.0)
    i = int(0)
    while i < count[0]:
        if i == 3:
            break
        total += x[0] * x[0]
        i += 1
    y[0] = total


def value_and_derivative(kernel: wp.Kernel, count: int) -> tuple[float, float]:
    x = wp.array([2.0], dtype=float, requires_grad=True, device="cpu")
    y = wp.zeros(1, dtype=float, requires_grad=True, device="cpu")
    with wp.Tape() as tape:
        wp.launch(kernel, 1, inputs=[x, wp.array([count], dtype=int, device="cpu"), y], device="cpu")
    tape.backward(y)
    return float(y.numpy()[0]), float(x.grad.numpy()[0])


print("warp-lang", wp.__version__)
found = {}
for kernel in (sum_with_for, sum_with_while):
    for count in (3, 6, 10):
        found[kernel.key, count] = value_and_derivative(kernel, count)
        value, derivative = found[kernel.key, count]
        print(f"{kernel.key}: at most {count} iterations, 3 are run: value {value:g} (12), derivative {derivative:g} (12)")
values_are_right = all(value == 12 for value, _ in found.values())
while_is_right = all(found["sum_with_while", count][1] == 12 for count in (3, 6, 10))
for_is_wrong = found["sum_with_for", 10][1] != 12
sys.exit(0 if values_are_right and while_is_right and for_is_wrong else 1)
PYTHON
cd "$folder"
WARP_CACHE_PATH="$folder/kernels" venv/bin/python show.py
