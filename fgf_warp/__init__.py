"""FGF-Warp: rendering of media whose extinction is a fractional Gaussian field, on NVIDIA Warp.

`import fgf_warp` starts neither Warp nor USD; `fgf_warp.renderer` starts Warp when it first renders.
"""

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("fgf-warp")
except PackageNotFoundError:
    __version__ = "0+unknown"
