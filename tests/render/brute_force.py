"""A sphere on a plane under distant lights and a fill, ray-cast and shaded without OpenGL.

The oracle of the renderer: intersections and shadows are exact, everything is float64, and the
reflectance model is written in the textbook form (D G F / (4 n·l n·v)) rather than the shader's.
Lights are points here: `as_points` makes many of each disc, and of a fill. It shares only the
scene's types and the harmonics' basis with the code under test.
"""

from dataclasses import dataclass, replace

import numpy as np

from lighting.light_set import LightSet
from lighting.sphere import harmonics
from render.scenes.scene import Camera, Ground, Material


@dataclass(frozen=True)
class SphereScene:
    """A sphere of one material, and a ground or none."""

    centre: tuple[float, float, float]
    radius_m: float
    material: Material
    ground: Ground | None


def as_points(lights: LightSet, per_light: int = 256, per_fill: int = 2048) -> LightSet:
    """Return the point lights that discs and fill consist of, spread evenly over each."""
    directions, irradiance = [np.empty((0, 3))], [np.empty((0, 3))]
    for axis, light, radius in zip(
        lights.directions, lights.irradiance, lights.angular_radius_rad, strict=True
    ):
        # A golden spiral over the cap, whose height is even in solid angle.
        height = 1 - (1 - np.cos(radius)) * (np.arange(per_light) + 0.5) / per_light
        directions.append(_around(axis, height))
        irradiance.append(np.tile(light / per_light, (per_light, 1)))
    if lights.fill.any():
        height = 1 - 2 * (np.arange(per_fill) + 0.5) / per_fill
        everywhere = _around(np.array([0.0, 1.0, 0.0]), height)
        directions.append(everywhere)
        irradiance.append(harmonics.evaluate(lights.fill, everywhere) * 4 * np.pi / per_fill)
    points = np.concatenate(directions)
    return LightSet(points, np.concatenate(irradiance), np.zeros(len(points)))


def away_from_outlines(scene: SphereScene, camera: Camera):
    """Return where (H, W) a pixel and its neighbours all show the sphere, or all the ground.

    On outlines a sphere and its polyhedron, or a round ground and its polygon, differ.
    """
    dark = LightSet(np.empty((0, 3)), np.empty((0, 3)), np.empty(0))
    covered = trace(scene, camera, dark)[..., 3]
    on_sphere = trace(replace(scene, ground=None), camera, dark)[..., 3]
    shown = np.pad(covered + on_sphere, 1, mode="edge")
    height, width = covered.shape
    around = [shown[j : j + height, i : i + width] for j in range(3) for i in range(3)]
    return (covered == 1) & np.all(np.equal(around, around[4]), axis=0)


def _around(axis, height):
    """Unit vectors (n, 3) at these cosines to an axis, a golden angle apart."""
    across = np.linalg.svd(axis[None])[2][1:]
    angle = np.arange(len(height)) * np.pi * (3 - np.sqrt(5))
    level = np.sqrt(1 - height**2)[:, None]
    u, v = np.cos(angle)[:, None] * across[0], np.sin(angle)[:, None] * across[1]
    return height[:, None] * axis + level * (u + v)


def trace(scene: SphereScene, camera: Camera, lights: LightSet, samples_per_axis: int = 1):
    """Return (H, W, 4) float64: radiance and coverage, the mean of each pixel's samples."""
    width, height = camera.size_px
    n = samples_per_axis
    total = np.zeros((height, width, 4))
    for j in range(n):
        for i in range(n):
            x, y = np.meshgrid(np.arange(width) + (i + 0.5) / n, np.arange(height) + (j + 0.5) / n)
            total += _trace_points(scene, camera, lights, x, y)
    return total / n**2


def reflectance(material: Material, n, v, l):  # noqa: E741
    """BRDF of unit vectors (..., 3) toward viewer and light, (..., 3), in 1/sr."""
    base = np.asarray(material.base_colour)
    f0 = (1 - material.metalness) * 0.04 * material.specular + material.metalness * base
    f90 = (1 - material.metalness) * material.specular + material.metalness
    diffuse = base * (1 - material.metalness)
    alpha = material.roughness**2
    h = (v + l) / np.linalg.norm(v + l, axis=-1, keepdims=True)
    n_l, n_v, n_h, v_h = (
        np.clip((a * b).sum(axis=-1, keepdims=True), 1e-12, 1)
        for a, b in ((n, l), (n, v), (n, h), (v, h))
    )
    d = alpha**2 / (np.pi * (n_h**2 * (alpha**2 - 1) + 1) ** 2)
    lambda_l = 0.5 * (np.sqrt(1 + alpha**2 * (1 / n_l**2 - 1)) - 1)
    lambda_v = 0.5 * (np.sqrt(1 + alpha**2 * (1 / n_v**2 - 1)) - 1)
    g = 1 / (1 + lambda_l + lambda_v)
    fresnel = f0 + (f90 - f0) * (1 - v_h) ** 5
    return (1 - fresnel) * diffuse / np.pi + d * g * fresnel / (4 * n_l * n_v)


def _trace_points(scene, camera, lights, x, y):
    """Radiance and hit (H, W, 4) of rays through picture points, (0, 0) the upper left corner."""
    width, height = camera.size_px
    forward = camera.target - camera.eye
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    upward = np.cross(right, forward)
    per_pixel = np.tan(camera.vertical_fov_rad / 2) / (height / 2)
    rays = (
        forward
        + ((x - width / 2) * per_pixel)[..., None] * right
        - ((y - height / 2) * per_pixel)[..., None] * upward
    )
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    centre = np.asarray(scene.centre)

    # |e + t r − c|² = R², the nearer root.
    to_centre = centre - camera.eye
    along = rays @ to_centre
    discriminant = along**2 - to_centre @ to_centre + scene.radius_m**2
    t_sphere = np.where(discriminant > 0, along - np.sqrt(np.maximum(discriminant, 0)), np.inf)
    t_ground = np.full_like(t_sphere, np.inf)
    if scene.ground is not None:
        with np.errstate(divide="ignore"):
            t = (scene.ground.y_m - camera.eye[1]) / rays[..., 1]
        beside = np.hypot(camera.eye[0] + t * rays[..., 0], camera.eye[2] + t * rays[..., 2])
        t_ground = np.where((t > 0) & (beside <= scene.ground.radius_m), t, np.inf)

    result = np.zeros((*x.shape, 4))
    on_sphere = np.isfinite(t_sphere) & (t_sphere < t_ground)
    on_ground = np.isfinite(t_ground) & ~on_sphere
    for mask, t in ((on_sphere, t_sphere), (on_ground, t_ground)):
        if not mask.any():
            continue
        points = camera.eye + t[mask][:, None] * rays[mask]
        v = -rays[mask]
        radiance = np.zeros_like(points)
        if mask is on_sphere:
            n = (points - centre) / scene.radius_m
            material = scene.material
        else:
            n = np.broadcast_to([0.0, 1.0, 0.0], points.shape)
            material = Material(scene.ground.reflectance, 1.0, specular=0.0)
        for l, irradiance in zip(lights.directions, lights.irradiance, strict=True):  # noqa: E741
            if scene.ground is not None and l[1] <= 0:
                continue
            cosine = n @ l
            lit = cosine > 0
            if mask is on_ground:
                # The ray toward the light meets the sphere if it passes closer than its radius.
                offset = centre - points
                ahead = offset @ l
                closest2 = (offset**2).sum(axis=1) - ahead**2
                lit &= ~((ahead > 0) & (closest2 < scene.radius_m**2))
            f = reflectance(material, n[lit], v[lit], l)
            radiance[lit] += f * irradiance * cosine[lit, None]
        result[mask, :3] = radiance
        result[mask, 3] = 1
    return result
