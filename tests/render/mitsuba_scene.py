"""A scene of ours as one of Mitsuba 3: the peer of the reference renderer.

Its own loader, acceleration structure, camera, sampler and integrators. Only the BRDF is written
here, in the textbook form, for Mitsuba's rough conductor has another Fresnel term and a masking
that is not height-correlated; its directions are drawn as Mitsuba's own plastics draw theirs, by
the visible normals of its microfacets or the cosine.

`DRJIT_LIBLLVM_PATH` names the LLVM library that Mitsuba's fastest variant compiles with.
"""

import math
import subprocess
import sys
import tempfile
from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np

from capture.sensor import srgb_decode
from lighting.maps.environment import EnvironmentMap
from render.scenes.scene import Camera, Material, Mesh, Scene

INTEGRATORS = {
    "direct": {"type": "direct", "hide_emitters": True},
    "path": {"type": "path", "max_depth": 2, "hide_emitters": True},
}
"""Both trace direct light only."""

_FINE_ROWS = 512  # Mitsuba interpolates between texels: so many make a cell nearly constant


def use_variant() -> str:
    """Set Mitsuba's fastest variant that runs here, and return its name."""
    # An LLVM library that is too old ends the process.
    probe = (
        "import mitsuba as mi; mi.set_variant('llvm_ad_rgb');"
        "mi.render(mi.load_dict(mi.cornell_box()), spp=1)"
    )
    has_llvm = subprocess.run([sys.executable, "-c", probe], capture_output=True).returncode == 0
    mi.set_variant("llvm_ad_rgb" if has_llvm else "scalar_rgb")
    bsdf = _metal_rough()
    mi.register_bsdf("metal_rough", lambda properties: bsdf(properties))
    return str(mi.variant())


def load(scene: Scene, camera: Camera, environment: EnvironmentMap):
    """Return Mitsuba's scene."""
    width, height = camera.size_px
    content = {
        "type": "scene",
        "integrator": INTEGRATORS["direct"],
        "sensor": {
            "type": "perspective",
            "fov": math.degrees(camera.vertical_fov_rad),
            "fov_axis": "y",
            "to_world": mi.ScalarTransform4f().look_at(
                list(camera.eye), list(camera.target), list(camera.up)
            ),
            "near_clip": 1e-3,
            "far_clip": 1e5,
            "film": {
                "type": "hdrfilm",
                "width": width,
                "height": height,
                "pixel_format": "rgb",
                "rfilter": {"type": "box"},
            },
            "sampler": {"type": "independent"},
        },
        "light": {"type": "envmap", "bitmap": mi.Bitmap(_with_corners(environment.radiance))},
    }
    if scene.ground is not None:
        upward = mi.ScalarTransform4f().rotate([1, 0, 0], -90)
        content["ground"] = {
            "type": "disk",
            "to_world": mi.ScalarTransform4f().translate([0, scene.ground.y_m, 0])
            @ mi.ScalarTransform4f().scale(scene.ground.radius_m)
            @ upward,
            "bsdf": _bsdf(Material(scene.ground.reflectance, specular=0.0)),
        }
    with tempfile.TemporaryDirectory() as folder:
        for index, mesh in enumerate(scene.meshes):
            content[f"mesh{index}"] = _mesh(mesh, Path(folder) / f"{index}.ply")
        return mi.load_dict(content)


def render(loaded, samples: int, seed: int, integrator: str = "direct") -> np.ndarray:
    """Return radiance (H, W, 3) of `samples` per pixel."""
    by = mi.load_dict(INTEGRATORS[integrator])
    return np.array(mi.render(loaded, integrator=by, spp=samples, seed=seed))


def _mesh(mesh: Mesh, path: Path) -> dict:
    """Return a mesh that Mitsuba loads from a file: vertices set otherwise get new normals."""
    columns = [mesh.positions, mesh.normals]
    names = ["x", "y", "z", "nx", "ny", "nz"]
    if mesh.texture_coordinates is not None:
        columns.append(mesh.texture_coordinates)
        names += ["u", "v"]
    faces = np.empty(len(mesh.faces), [("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, mesh.faces
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(mesh.positions)}",
        *(f"property float {name}" for name in names),
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        "end_header",
    ]
    with path.open("wb") as file:
        file.write(("\n".join(header) + "\n").encode())
        file.write(np.column_stack(columns).astype("<f4").tobytes())
        file.write(faces.tobytes())
    return {"type": "ply", "filename": str(path), "bsdf": _bsdf(mesh.material)}


def _bsdf(material: Material) -> dict:
    if material.specular == 0 and material.metalness == 0:
        diffuse = {"type": "diffuse", "reflectance": _colour(material.base_colour)}
        if material.base_colour_texture is not None:
            pixels = srgb_decode(material.base_colour_texture / 255.0).astype(np.float32)
            # Mitsuba's row 0 is at v = 1 too, once flipped as it does with files.
            diffuse["reflectance"] = {"type": "bitmap", "bitmap": mi.Bitmap(pixels), "raw": True}
        return {"type": "twosided", "bsdf": diffuse}
    base = np.array(material.base_colour)
    f0 = (1 - material.metalness) * 0.04 * material.specular + material.metalness * base
    return {
        "type": "metal_rough",
        "matt": [float(each) for each in base * (1 - material.metalness)],
        "f0": [float(each) for each in f0],
        "f90": (1 - material.metalness) * material.specular + material.metalness,
        "alpha": material.roughness**2,
    }


def _colour(values) -> dict:
    return {"type": "rgb", "value": [float(value) for value in values]}


def _with_corners(radiance: np.ndarray) -> np.ndarray:
    """Return cells as texels; Mitsuba's first and last row lie at the poles, and so on edges."""
    finer = max(_FINE_ROWS // len(radiance), 1)
    below = np.repeat(radiance, finer, axis=0)
    edges = np.concatenate([radiance[:1], radiance, radiance[-1:]])
    rows = np.concatenate([below, radiance[-1:]])
    rows[::finer] = 0.5 * (edges[:-1] + edges[1:])
    return np.repeat(rows, finer, axis=1)


def _metal_rough() -> type:
    """Return the BSDF of glTF; Mitsuba's base class exists only once a variant is chosen."""

    class MetalRough(mi.BSDF):
        def __init__(self, properties):
            mi.BSDF.__init__(self, properties)
            self.matt = mi.Color3f(list(properties["matt"]))
            self.f0 = mi.Color3f(list(properties["f0"]))
            self.f90, self.alpha2 = properties["f90"], properties["alpha"] ** 2
            self.matt_share = 0.5 if max(properties["matt"]) > 0 else 0.0
            self.microfacets = mi.MicrofacetDistribution(
                mi.MicrofacetType.GGX, properties["alpha"], sample_visible=True
            )
            flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
            self.m_components = [flags]
            self.m_flags = flags

        def sample(self, context, si, sample1, sample2, active):
            up = dr.mulsign(mi.Float(1), mi.Frame3f.cos_theta(si.wi))
            toward_eye = up * si.wi
            normal, _ = self.microfacets.sample(toward_eye, sample2)
            mirrored = 2 * dr.dot(toward_eye, normal) * normal - toward_eye
            matt = mi.warp.square_to_cosine_hemisphere(sample2)
            drawn = mi.BSDFSample3f()
            drawn.wo = up * dr.select(sample1 < self.matt_share, matt, mirrored)
            drawn.pdf = self.pdf(context, si, drawn.wo, active)
            drawn.eta = 1.0
            drawn.sampled_type = mi.UInt32(+mi.BSDFFlags.GlossyReflection)
            drawn.sampled_component = mi.UInt32(0)
            active &= drawn.pdf > 0
            value = self.eval(context, si, drawn.wo, active)  # 0 where not active
            return drawn, value / dr.select(active, drawn.pdf, 1.0)

        def eval(self, context, si, wo, active):
            up = dr.mulsign(mi.Float(1), mi.Frame3f.cos_theta(si.wi))
            n_v, n_l = up * si.wi.z, up * wo.z
            h = dr.normalize(si.wi + wo)
            n_h, v_h = up * h.z, dr.dot(si.wi, h)
            a2 = self.alpha2
            d = a2 / (dr.pi * (n_h**2 * (a2 - 1) + 1) ** 2)
            lambda_l = 0.5 * (dr.sqrt(1 + a2 * (1 / n_l**2 - 1)) - 1)
            lambda_v = 0.5 * (dr.sqrt(1 + a2 * (1 / n_v**2 - 1)) - 1)
            g = 1 / (1 + lambda_l + lambda_v)
            fresnel = self.f0 + (self.f90 - self.f0) * (1 - v_h) ** 5
            value = (1 - fresnel) * self.matt * n_l / dr.pi + d * g * fresnel / (4 * n_v)
            return dr.select(active & (n_v > 0) & (n_l > 0), value, 0.0)

        def pdf(self, context, si, wo, active):
            up = dr.mulsign(mi.Float(1), mi.Frame3f.cos_theta(si.wi))
            toward_eye, toward_light = up * si.wi, up * wo
            normal = dr.normalize(toward_eye + toward_light)
            by_normal = self.microfacets.pdf(toward_eye, normal)
            is_above = active & (toward_eye.z > 0) & (toward_light.z > 0)
            mirrored = by_normal / dr.select(is_above, 4 * dr.dot(toward_light, normal), 1.0)
            by_cosine = toward_light.z / dr.pi
            density = self.matt_share * by_cosine + (1 - self.matt_share) * mirrored
            return dr.select(is_above, density, 0.0)

        def eval_pdf(self, context, si, wo, active):
            return self.eval(context, si, wo, active), self.pdf(context, si, wo, active)

        def traverse(self, callback):
            pass

        def to_string(self):
            return "MetalRough"

    return MetalRough
