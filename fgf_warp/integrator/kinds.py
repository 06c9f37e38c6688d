"""What the device calls the kinds of things that features name."""

from fgf_warp.device.geometry import CUBE, CYLINDER, SPHERE
from fgf_warp.device.law import EXACT_FBM, EXPONENTIAL, FRACTIONAL, POWER
from fgf_warp.device.lights import CYLINDER_LIGHT, DISK, DISTANT, DOME, MESH_LIGHT, RECT, SPHERE_LIGHT

LAW_KINDS = {
    "exponential": int(EXPONENTIAL),
    "power": int(POWER),
    "fractional": int(FRACTIONAL),
    "exact_fbm": int(EXACT_FBM),
}
SOLID_KINDS = {"sphere": int(SPHERE), "cube": int(CUBE), "cylinder": int(CYLINDER)}
LIGHT_KINDS = {
    "distant": int(DISTANT),
    "rect": int(RECT),
    "disk": int(DISK),
    "sphere": int(SPHERE_LIGHT),
    "dome": int(DOME),
    "cylinder": int(CYLINDER_LIGHT),
    "mesh": int(MESH_LIGHT),
}
