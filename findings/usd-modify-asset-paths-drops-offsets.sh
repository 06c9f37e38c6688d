#!/usr/bin/env bash
# Expected: UsdUtils.ModifyAssetPaths with a function that gives each path another name changes nothing but the paths.
# What happens: the time offset and scale of a sublayer whose path is renamed are set back to (0, 1), so that its animation
# plays at another time; and empty elements of asset arrays are dropped although keepEmptyPathsInArrays is True, so that
# what other arrays count by index shifts. Offsets of references in the same layer are kept.
# Where it matters: packing a shot with retimed sublayers into one folder or archive.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check usd-core==26.11
cat > "$folder/show.py" <<'PYTHON'
import sys

from pxr import Sdf, Usd, UsdUtils

print("usd-core", ".".join(str(part) for part in Usd.GetVersion()[1:]))
layer = Sdf.Layer.CreateAnonymous(".usda")
layer.ImportFromString(
    """#usda 1.0
(
    subLayers = [@shot.usda@ (offset = 10; scale = 2)]
)

def "Prop" (
    prepend references = @prop.usda@ (offset = 10; scale = 2)
)
{
    asset[] files = [@first.png@, @@, @third.png@]
}
"""
)


def show(title: str) -> tuple[list, list, list]:
    sublayers = [(path, (offset.offset, offset.scale)) for path, offset in zip(layer.subLayerPaths, layer.subLayerOffsets)]
    found = layer.GetPrimAtPath("/Prop").referenceList.prependedItems
    references = [(item.assetPath, (item.layerOffset.offset, item.layerOffset.scale)) for item in found]
    files = [asset.path for asset in layer.GetAttributeAtPath("/Prop.files").default]
    print(f"{title}: sublayers {sublayers}, references {references}, files {files}")
    return sublayers, references, files


show("before")
UsdUtils.ModifyAssetPaths(layer, lambda path: f"packed/{path}", keepEmptyPathsInArrays=True)
sublayers, references, files = show("after ")
is_as_described = (
    sublayers == [("packed/shot.usda", (0.0, 1.0))]
    and references == [("packed/prop.usda", (10.0, 2.0))]
    and files == ["packed/first.png", "packed/third.png"]
)
sys.exit(0 if is_as_described else 1)
PYTHON
cd "$folder"
venv/bin/python show.py
