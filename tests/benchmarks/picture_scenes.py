"""The scenes of `pictures` that are made in code, small and each of one kind; of what every version's scene has.

`one_tree` imports it as a file beside it, since the packages are then those of another source tree.
"""

import math
from dataclasses import replace

import numpy as np

from fgf_warp.scene import (
    AreaLight,
    Camera,
    CylinderLight,
    DistantLight,
    DomeLight,
    Image,
    Instances,
    Medium,
    Mesh,
    MeshLight,
    PrimvarInput,
    Scene,
    Shaping,
    Solid,
    SphereLight,
    Surface,
    Texture,
    TextureInput,
)

SKY = DomeLight("/sky", (0.3, 0.4, 0.6))
LAMP = AreaLight("/lamp", "rect", (0, 3, 0), (1, 0, 0), (0, 0, 1), (9.0, 8.0, 7.0))
FOG = Medium("/fog", mean_extinction=2.5, albedo=(0.8, 0.7, 0.6), asymmetry=0.4)
PINK = replace(FOG, name="/pink", hurst=-0.25, white_noise_scale=2.0)
FBM = replace(FOG, name="/fbm", hurst=0.3, white_noise_scale=1.0, outer_scale=10.0, mean_extinction=1.5)
GLASS = Surface((0.8, 0.9, 0.8), ior=1.5, opacity=0.0, roughness=0.2)
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=np.float64)
BOX = np.array(
    [
        *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
        *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
    ]
)
QUAD = np.array([[-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, -1.0], [-1.0, 0.0, -1.0]])
HALVES = np.array([[0, 1, 2], [0, 2, 3]])


def place(scale: object = 1.0, at: tuple[float, ...] = (0.0, 0.0, 0.0)) -> np.ndarray:
    """(4, 4) stretches, then moves."""
    matrix = np.diag([*np.broadcast_to(scale, 3), 1.0])
    matrix[:3, 3] = at
    return matrix


def view(*, closing: tuple[float, ...] | None = None, distance: float = 5.0, **more: object) -> Camera:
    """From z = `distance` along -z; sees 3 units at z = 0 from 5."""
    matrix = place(at=(0, 0, distance))
    return Camera("/camera", matrix, 1.0, 0.6, 0.6, closing=None if closing is None else place(at=closing), **more)


def floor(surface: Surface | None = None) -> Solid:
    """A slab whose top is at y = -1.2."""
    return Solid("/floor", "cube", place((5, 1, 5), (0, -2.2, 0)), surface or Surface((0.5, 0.4, 0.3)))


def filled(name: str = "/ball", kind: str = "sphere", matrix: np.ndarray | None = None, medium: int = 0) -> Solid:
    """A solid of a medium; by default the unit sphere."""
    return Solid(name, kind, np.eye(4) if matrix is None else matrix, medium=medium)


def picture_of(values: object) -> Image:
    """Of (height, width, 4)."""
    return Image("image", np.asarray(values, dtype=np.float32))


def noise(seed: int, height: int = 4, width: int = 4) -> Image:
    """An image of random numbers in [0, 1)."""
    return picture_of(np.random.default_rng(seed).random((height, width, 4)))


def quad(surface: Surface, *, at: tuple[float, ...] = (0.0, -1.2, 0.0), size: float = 3.0, name: str = "/quad") -> Mesh:
    """A square that lies in the plane of x and z, with texture coordinates."""
    st = ((QUAD[:, [0, 2]] + 1) / 2)[HALVES].astype(np.float32)
    return Mesh(name, QUAD * size + at, HALVES, surface, primvars={"st": st})


def ball() -> Scene:
    """The unit sphere, full of a medium, in a sky."""
    return Scene(view(), (filled(),), (FOG,), (SKY,))


def room() -> Scene:
    """The same over a floor, under a lamp."""
    return Scene(view(), (filled(), floor()), (FOG,), (SKY, LAMP))


def cylinder() -> Scene:
    """A cylinder of a medium in a sky and a sun."""
    sun = DistantLight("/sun", (0.48, -0.8, -0.36), 0.05, (40.0, 40.0, 30.0))
    return Scene(view(), (filled("/can", "cylinder"), floor()), (FOG,), (SKY, sun))


def mesh() -> Scene:
    """A box of triangles, full of a medium, over a floor under a lamp."""
    return Scene(view(), (Mesh("/box", CORNERS * 0.8, BOX, medium=0), floor()), (FOG,), (SKY, LAMP))


def surfaces() -> Scene:
    """No medium at all."""
    return Scene(view(), (Solid("/ball", "sphere", np.eye(4), Surface((0.2, 0.6, 0.7))), floor()), (), (SKY, LAMP))


def nested() -> Scene:
    """Media of three laws, one in another, one beside, in a sphere, a mesh and a cube."""
    shapes = (
        filled(),
        Mesh("/core", CORNERS * 0.4, BOX, medium=1),
        filled("/beside", "cube", place(0.3, (1.2, -0.4, 0.3)), 2),
        floor(),
    )
    return Scene(view(), shapes, (FOG, replace(PINK, priority=2), replace(FBM, priority=1)), (SKY, LAMP))


def touching() -> Scene:
    """Two bodies of one medium that may touch."""
    shapes = (
        filled("/left", "cube", place(0.5, (-0.5, 0, 0))),
        Mesh("/right", CORNERS * 0.5 + (0.5, 0, 0), BOX, medium=0),
    )
    return Scene(view(), shapes, (PINK,), (SKY,))


def inside() -> Scene:
    """A camera whose near plane is partly in a medium."""
    return Scene(view(clipping_range=(4.5, 5.5)), (filled(), floor()), (PINK,), (SKY, LAMP))


def glass() -> Scene:
    """Rough glass around a medium, with a sheet that lets light through straight, over a textured floor."""
    bend = TextureInput(Texture({(0, 0): noise(3)}), scale=(0.4, 0.4, 0.0, 0.0), bias=(-0.2, -0.2, 1.0, 0.0))
    ground = Surface(TextureInput(Texture({(0, 0): noise(2)})), roughness=0.3, ior=1.5, clearcoat=0.5, normal=bend)
    shapes = (
        Solid("/ball", "sphere", np.eye(4), GLASS, 0),
        quad(ground),
        quad(Surface((0.2, 0.6, 0.2), opacity=0.4, ior=1.3, roughness=0.0), at=(0, 1.1, 0), size=0.7, name="/sheet"),
    )
    return Scene(view(), shapes, (PINK,), (SKY, LAMP))


def textures() -> Scene:
    """A metal with colors of its own at corners and shading normals, and cut-out leaves, without a medium."""
    around = CORNERS / math.sqrt(3)
    colors = np.random.default_rng(5).random((len(BOX), 3, 3)).astype(np.float32)
    metal = Surface(PrimvarInput("tint"), metallic=1.0, roughness=0.3)
    box = Mesh("/box", CORNERS * 0.7, BOX, metal, normals=around[BOX].astype(np.float32), primvars={"tint": colors})
    cut = TextureInput(Texture({(0, 0): noise(6)}, wrap_s="mirror", wrap_t="clamp"), channels="a", st=(0.3, 0.6))
    leaves = quad(Surface((0.3, 0.6, 0.2), opacity=cut, opacity_threshold=0.5), at=(0, -0.9, 0), size=1.5)
    return Scene(view(), (box, leaves, floor(Surface((0.5,) * 3, ior=1.5, specular=(0.1, 0.2, 0.3)))), (), (SKY, LAMP))


def lens() -> Scene:
    """A thin lens, sharp in front of the ball."""
    return replace(room(), camera=view(f_stop=1.0, focus_distance=4.0))


def orthographic() -> Scene:
    """A camera without perspective; its film is as wide as what it sees, in tenths."""
    flat = replace(view(), projection="orthographic", horizontal_aperture=30.0, vertical_aperture=30.0)
    return replace(room(), camera=flat)


def moving_lens() -> Scene:
    """A lens that moves, whose near plane is partly in the medium."""
    camera = view(f_stop=1.0, focus_distance=5.0, clipping_range=(4.5, 5.5), closing=(0.1, 0, 5))
    return replace(room(), camera=camera)


def moving() -> Scene:
    """A ball of a medium that rises, and a cube that grows."""
    ball = replace(filled("/ball", matrix=place(0.7, (-0.5, 0, 0))), closing=place(0.7, (-0.4, 0.4, 0)))
    cube = Solid("/cube", "cube", place(0.2, (0.9, 0, 0)), Surface((0.8, 0.2, 0.2)), closing=place(0.4, (0.9, 0.3, 0)))
    return Scene(view(), (ball, cube, floor()), (FOG,), (SKY, LAMP))


def instances() -> Scene:
    """Bricks with colors of their own, still, mirrored and moving, and clouds of a medium."""
    still = np.stack([place((0.2, 0.3, 0.2), (x, -0.9, 0.5))[:3] for x in (-1.2, -0.4, 0.4)])
    still[1, 0] *= -1
    tints = np.random.default_rng(7).random((3, 3)).astype(np.float32)
    brick = Mesh("/brick", CORNERS, BOX, Surface(PrimvarInput("tint")))
    cloud = Mesh("/cloud", CORNERS, BOX, medium=0)
    shapes = (
        Instances("/bricks", brick, still, numbers=np.array([4, 5, 6]), primvars={"tint": tints}),
        Instances("/rising", cloud, place(0.4, (-0.7, 0.4, 0))[None, :3], place(0.4, (-0.6, 0.6, 0))[None, :3]),
        Instances("/still", cloud, place((0.5, 0.3, 0.4), (0.7, 0.3, 0))[None, :3]),
        floor(),
    )
    return Scene(view(), shapes, (PINK,), (SKY, LAMP))


def still_instances() -> Scene:
    """Instances without motion, all of surfaces."""
    places = np.stack([place(0.15, (x, y, 0))[:3] for x in (-0.8, 0.0, 0.8) for y in (-0.8, 0.0, 0.8)])
    bricks = Instances("/bricks", Mesh("/brick", CORNERS, BOX, Surface()), places)
    return Scene(view(), (floor(), bricks), (), (LAMP,))


def many_solids() -> Scene:
    """So many spheres that they hang in a tree, in fog."""
    at = np.random.default_rng(8).uniform(-1.2, 1.2, size=(120, 3))
    beads = tuple(
        Solid(f"/bead{k}", "sphere", place(0.1, tuple(x)), Surface((0.7, 0.3, 0.2))) for k, x in enumerate(at)
    )
    return Scene(
        view(), (*beads, filled("/fog", "cube", place(1.3))), (replace(FOG, mean_extinction=0.5),), (SKY, LAMP)
    )


def lamps() -> Scene:
    """A rect, a disk and a sphere, which emit evenly, and a sun."""
    lights = (
        LAMP,
        AreaLight("/disk", "disk", (-1.4, 1.2, 0.5), (0.4, 0, 0), (0, 0, 0.4), (5.0, 4.0, 3.0)),
        SphereLight("/bulb", (1.3, 1.2, 0.3), 0.2, (9.0, 9.0, 12.0)),
        DistantLight("/sun", (0, -0.8, -0.6), 0.0, (0.5,) * 3),
    )
    return replace(room(), lights=lights)


def dressed_lamps() -> Scene:
    """A tube, glowing triangles, a cone, a focus and a rect with an image."""
    lights = (
        CylinderLight(
            "/tube", (0, 1.3, 0.5), (0.8, 0, 0), 0.1, (5.0,) * 3, shaping=Shaping((0.0, -1.0, 0.0), 1.4, 0.5)
        ),
        MeshLight("/glow", (QUAD * 0.4 + (-1.2, 1.2, 0))[HALVES[:, ::-1]], (5.0, 3.0, 2.0)),
        SphereLight("/cone", (1.3, 1.2, 0.3), 0.2, (30.0,) * 3, shaping=Shaping((-0.6, -0.8, 0.0), 0.7, 0.3)),
        replace(LAMP, image=noise(9, 3, 5), shaping=Shaping((0.0, -1.0, 0.0), math.pi, 0.0, 6.0, (0.3, 0.0, 0.0))),
    )
    return replace(room(), lights=lights)


def dome_image() -> Scene:
    """A dome with an image that has a bright spot."""
    pixels = np.random.default_rng(10).random((8, 16, 4)) * 0.3
    pixels[2, 4] = 200.0
    return replace(room(), lights=(DomeLight("/dome", (1.0, 1.0, 1.0), picture_of(pixels)),))


def links() -> Scene:
    """A lamp that shines on the floor alone, and one in whose light the ball casts no shadow; a linked dome."""
    scene = room()
    ball, ground = scene.shapes
    column = Solid("/column", "cylinder", place((0.2, 0.2, 0.5), (1.2, -0.7, 0.4)), Surface(), light_links=2)
    shapes = (ball, replace(ground, light_links=1, shadow_links=1), replace(column, shadow_links=3))
    lights = (replace(LAMP, link=0), SphereLight("/bulb", (1.3, 1.2, 0.3), 0.2, (20.0,) * 3, shadow_link=1))
    return replace(scene, shapes=shapes, lights=(*lights, replace(SKY, link=1)))


SCENES = {
    make.__name__: make
    for make in (
        *(ball, room, cylinder, mesh, surfaces, nested, touching, inside, glass, textures),
        *(lens, orthographic, moving_lens, moving, instances, still_instances, many_solids),
        *(lamps, dressed_lamps, dome_image, links),
    )
}
