#!/usr/bin/env bash
# Expected: two fields of a Volume, field:fire:density and field:smoke:density, are two entries of GetFieldPaths().
# What happens: its keys are only the last part of the names, so that the two are one entry and one field is gone without a
# word; GetFieldPath("fire:density") and GetFieldPath("smoke:density") find each.
# Where it matters: readers of UsdVol volumes with several simulations in one prim.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check usd-core==26.11
cat > "$folder/show.py" <<'PYTHON'
import sys

from pxr import Usd, UsdVol

print("usd-core", ".".join(str(part) for part in Usd.GetVersion()[1:]))
stage = Usd.Stage.CreateInMemory()
volume = UsdVol.Volume.Define(stage, "/Volume")
for name in ("fire", "smoke"):
    field = UsdVol.OpenVDBAsset.Define(stage, f"/Volume/{name}")
    volume.GetPrim().CreateRelationship(f"field:{name}:density").AddTarget(field.GetPath())
all_paths = {name: str(path) for name, path in volume.GetFieldPaths().items()}
by_name = {name: str(volume.GetFieldPath(name)) for name in ("fire:density", "smoke:density")}
print("GetFieldPaths():", all_paths)
print("GetFieldPath(name):", by_name)
expected = {"fire:density": "/Volume/fire", "smoke:density": "/Volume/smoke"}
sys.exit(0 if list(all_paths) == ["density"] and by_name == expected else 1)
PYTHON
cd "$folder"
venv/bin/python show.py
