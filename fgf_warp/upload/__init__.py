"""From a scene to the device: one module for each kind of thing, and the builders of the trees over triangles."""

from fgf_warp.upload.bvh import load_builder
from fgf_warp.upload.media import LawTables, build_device_law
from fgf_warp.upload.scene import UploadedScene, upload

__all__ = ["LawTables", "UploadedScene", "build_device_law", "load_builder", "upload"]
