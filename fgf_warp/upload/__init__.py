"""From a scene to the device: one module for each kind of thing, and the builders of the trees over triangles."""

from fgf_warp.upload.albedos import AlbedoTables
from fgf_warp.upload.bvh import BoxTree, WideTree, build_box_tree, build_wide_tree, load_builder
from fgf_warp.upload.instances import number_motions, upload_solids
from fgf_warp.upload.lights import LightRows, build_device_light
from fgf_warp.upload.media import LawTables, build_device_law
from fgf_warp.upload.meshes import build_device_meshes
from fgf_warp.upload.scene import UploadedScene, upload
from fgf_warp.upload.textures import TextureRows, decoded_srgb

__all__ = [
    "AlbedoTables",
    "BoxTree",
    "LawTables",
    "LightRows",
    "TextureRows",
    "UploadedScene",
    "WideTree",
    "build_box_tree",
    "build_device_law",
    "build_device_light",
    "build_device_meshes",
    "build_wide_tree",
    "decoded_srgb",
    "load_builder",
    "number_motions",
    "upload",
    "upload_solids",
]
