"""The bench's shapes and materials in Mitsuba 3 (variant scalar_rgb).

Light adds up, so each material is a sum of layers.  Mitsuba has plugins for two of them: ``diffuse``
(Lambert) and ``principled`` with metallic 1 (GGX, Smith, Schlick).  The third, the retro-reflected lobe, is a
small BSDF here.
"""

from __future__ import annotations

import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")

from lmmap_lab.bench import renderer, shading, skins  # noqa: E402
from lmmap_lab.bench.cad import BODY, MARKER, PETAL, PLATE, RING  # noqa: E402

SEGMENTS = 1440  # of the ring: its chords stay within 0.2 um of the circle
LIFT_M = 2e-5  # of the markers over the plate, so that rays tell them apart


class Retro(mi.BSDF):
    """A lobe around the direction of the light: peak exp(-angle^2 / width^2), in radiance per irradiance."""

    def __init__(self, props):
        mi.BSDF.__init__(self, props)
        self.m_components = [mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide]
        self.m_flags = self.m_components[0]

    def eval(self, ctx, si, wo, active=True):
        if si.wi.z <= 0 or wo.z <= 0:
            return mi.Color3f(0.0)
        angle = np.arccos(min(si.wi.x * wo.x + si.wi.y * wo.y + si.wi.z * wo.z, 1.0))
        lobe = shading.RETRO_PEAK_SR * np.exp(-((angle / shading.RETRO_WIDTH_RAD) ** 2))
        return mi.Color3f(float(lobe * wo.z))

    def pdf(self, ctx, si, wo, active=True):
        return 0.0

    def sample(self, ctx, si, sample1, sample2, active=True):
        return mi.BSDFSample3f(), mi.Color3f(0.0)

    def to_string(self):
        return "Retro[]"


mi.register_bsdf("retro", Retro)


def mesh(name, vertices, faces, bsdf, uv=None) -> mi.Mesh:
    """Triangles with a face's normal each; ``uv`` (N, 2) when a texture needs them."""
    properties = mi.Properties()
    properties["bsdf"] = bsdf
    shape = mi.Mesh(name, len(vertices), len(faces), has_vertex_texcoords=uv is not None, props=properties)
    arrays = mi.traverse(shape)
    arrays["vertex_positions"] = np.ravel(vertices).astype(np.float32)
    arrays["faces"] = np.ravel(faces).astype(np.uint32)
    if uv is not None:
        arrays["vertex_texcoords"] = np.ravel(uv).astype(np.float32)
    arrays.update()
    return shape


def texture(values) -> dict:
    """A map over the panel; ``values`` (rows, columns[, 3]) with row 0 at the least y."""
    values = np.ascontiguousarray(np.atleast_3d(values), np.float32)
    return {"type": "bitmap", "bitmap": mi.Bitmap(values), "raw": True, "wrap_mode": "clamp"}


def material(layer, diffuse, specular, alpha) -> dict:
    """One layer of a material from numbers or textures, or ``half``: half the sum of the first two; ``alpha``
    is the root of GGX's."""
    matt = {"type": "diffuse", "reflectance": diffuse}
    glossy = {"type": "principled", "metallic": 1.0, "base_color": specular, "roughness": alpha}
    if layer == "half":
        return {"type": "blendbsdf", "weight": 0.5, "matt": matt, "glossy": glossy}
    return matt if layer == "diffuse" else glossy


def part(layer, surface):
    """One layer of a part of the port, seen from both sides."""
    if layer == "retro":
        lobe = {"type": "retro"} if surface in (RING, MARKER) else black()
        return mi.load_dict({"type": "twosided", "bsdf": lobe})
    diffuse, specular, alpha = (float(v) for v in renderer.PARTS[surface])
    nested = material(layer, rgb(diffuse), rgb(specular), float(np.sqrt(alpha)))
    return mi.load_dict({"type": "twosided", "bsdf": nested})


def rgb(value):
    return {"type": "rgb", "value": [float(v) for v in np.broadcast_to(value, 3)]}


def black():
    return {"type": "diffuse", "reflectance": rgb(0.0)}


def panel_materials(layer, skin):
    """The skin with and without its slopes: for the panel's face and for its sides."""
    if layer == "retro":
        flat = mi.load_dict(black())
        return flat, flat
    nested = material(
        layer,
        texture(skin[..., skins.DIFFUSE]),
        texture(skin[..., skins.SPECULAR]),
        texture(np.sqrt(skin[..., skins.ROUGHNESS])),
    )
    slope = skin[..., skins.SLOPE]
    normals = np.dstack([-slope, np.ones(slope.shape[:2], np.float32)])
    bumpy = {"type": "normalmap", "normalmap": texture((normals + 1) / 2), "arbitrary": nested}
    return mi.load_dict({"type": "twosided", "bsdf": bumpy}), mi.load_dict(
        {"type": "twosided", "bsdf": nested}
    )


def shapes(solid, skin, layer) -> dict:
    """Every surface under the name of what it is."""
    lower, upper = (*solid.panel_lower, solid.panel_bottom), (*solid.panel_upper, solid.panel_top)
    corner = np.array([[(lower, upper)[i >> k & 1][k] for k in range(3)] for i in range(8)])
    uv = (corner[:, :2] - solid.panel_lower) / (solid.panel_upper - solid.panel_lower)
    face, side = panel_materials(layer, skin)
    front = np.array([[4, 5, 7], [4, 7, 6]])
    rest = [[0, 2, 3], [0, 3, 1], [0, 1, 5], [0, 5, 4], [2, 6, 7], [2, 7, 3], [0, 4, 6], [0, 6, 2], [1, 3, 7],
            [1, 7, 5]]  # fmt: skip
    meshes = {
        "panel face": mesh("face", corner, front, face, uv),
        "panel": mesh("sides", corner, rest, side, uv),
    }

    a = np.arange(SEGMENTS) * 2 * np.pi / SEGMENTS
    circle = np.stack([np.cos(a), np.sin(a), 0 * a], -1)
    i, j = np.arange(SEGMENTS), (np.arange(SEGMENTS) + 1) % SEGMENTS
    ring = np.concatenate([solid.ring_inner * circle, solid.ring_outer * circle])
    quads = np.concatenate(
        [np.stack([i, i + SEGMENTS, j + SEGMENTS], -1), np.stack([i, j + SEGMENTS, j], -1)]
    )
    meshes["ring"] = mesh("ring", ring, quads, part(layer, RING))
    for name, radius, top in (
        ("outer wall", solid.ring_outer, 0.0),
        ("inner wall", solid.ring_inner, 0.0),
        ("stem", solid.stem, solid.plate_height),
    ):
        meshes[name] = mi.load_dict(
            {"type": "cylinder", "p0": [0, 0, solid.panel_top], "p1": [0, 0, top], "radius": radius,
             "bsdf": part(layer, BODY)}
        )  # fmt: skip

    meshes["plate"] = mesh("plate", *plate_triangles(solid), part(layer, PLATE))
    quad = [[0, 1, 2], [0, 2, 3]]
    for k, (c, s) in enumerate(solid.sectors):
        radial = solid.marker_radius + solid.marker_half[1] * np.array([-1, 1, 1, -1])
        radial = np.minimum(radial, solid.plate_apothem)  # nothing stands over the plate's edge
        along = solid.marker_half[0] * np.array([-1, -1, 1, 1])
        marker = np.stack([radial * c - along * s, radial * s + along * c], -1)
        marker = np.column_stack([marker, np.full(4, solid.plate_height + LIFT_M)])
        meshes[f"marker {k}"] = mesh("marker", marker, quad, part(layer, MARKER))
        base, tangent, up, _ = solid.petals[k]
        (foot, tip), rise = solid.petal_half_widths, solid.petal_length
        petal = [base - foot * tangent, base + foot * tangent, base + rise * up + tip * tangent,
                 base + rise * up - tip * tangent]  # fmt: skip
        meshes[f"petal {k}"] = mesh("petal", petal, quad, part(layer, PETAL))
    return meshes


def plate_triangles(solid) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (N, 3) and triangles (M, 3) of the hexagon without its windows.

    Each third of it, about a window, is a pentagon from the axis; its corners are joined with the window's.
    """
    apothem, (tangential, radial) = solid.plate_apothem, solid.window_half
    near, far = solid.window_radius - radial, solid.window_radius + radial
    c, s = apothem * np.cos(np.pi / 3), apothem * np.sin(np.pi / 3)  # the middle of a marker's side
    corner = apothem * np.tan(np.pi / 6)
    third = np.array([
        (0, 0), (c, -s), (apothem, -corner), (apothem, corner), (c, s),
        (near, -tangential), (far, -tangential), (far, tangential), (near, tangential),
    ])  # fmt: skip
    faces = np.array([[0, 1, 5], [1, 2, 6], [1, 6, 5], [2, 3, 7], [2, 7, 6], [3, 4, 8], [3, 8, 7], [4, 0, 8],
                      [0, 5, 8]])  # fmt: skip
    vertices = [np.column_stack([third @ [[x, y], [-y, x]], np.full(9, solid.plate_height)])
                for x, y in solid.window_sectors]  # fmt: skip
    return np.concatenate(vertices), np.concatenate([faces + 9 * k for k in range(len(vertices))])
