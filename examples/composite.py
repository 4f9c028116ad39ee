"""A mountain in the clouds.

A heightfield is ray traced with NumPy, in place of an external renderer, and composited with the
clouds by its distance along each ray, its linear radiance, and its coverage of each pixel. Shadows
of the clouds on it come from `sun_transmittance`.
"""

from pathlib import Path

import numpy as np
import numpy.typing as npt

import nubis

Array = npt.NDArray[np.float64]

WIDTH, HEIGHT, FINER = 240, 135, 2  # rays per pixel, in both directions
EYE = np.array([0.0, -13_000.0, 1300.0])

camera = nubis.Camera.look_at(eye=EYE, target=(0, 0, 1700), fov_y=32.0)
params = nubis.Params().with_(
    **{
        "sun.elevation": 28.0,
        "sun.azimuth": 240.0,
        "clouds.coverage": 0.6,
        "clouds.base": 1100.0,
        "clouds.top": 2400.0,
        "atmosphere.haze": 0.4,
    }
)


def heights(side: int = 512, extent: float = 16_000.0) -> tuple[Array, float]:
    """Heightfield in metres: ridged noise with a summit in the centre; and its extent in metres."""
    rng = np.random.default_rng(4)
    y, x = np.mgrid[:side, :side] / side - 0.5
    relief = np.zeros((side, side))
    for octave in range(7):
        for _ in range(6):
            wave = 4 * 1.9**octave * rng.normal(size=2)
            relief += (
                0.55**octave * (1 - abs(np.sin(wave[0] * x + wave[1] * y + rng.uniform(0, 6)))) / 6
            )
    away = np.hypot(x, y) * extent
    summit = 3900 * np.exp(-((away / 2600) ** 2)) + 700 * np.exp(-((away / 5200) ** 4))
    return summit * (0.05 + 0.75 * relief) - 30, extent


def looked_up(table: Array, extent: float, x: Array, y: Array) -> Array:
    """Bilinear interpolation of a table over a square that is centred on the origin."""
    last = len(table) - 1
    column = ((x / extent + 0.5) * last).clip(0, last - 1e-6)
    row = ((y / extent + 0.5) * last).clip(0, last - 1e-6)
    i, j = row.astype(int), column.astype(int)
    u, v = column - j, row - i
    upper = table[i, j] * (1 - u) + table[i, j + 1] * u
    values: Array = upper * (1 - v) + (table[i + 1, j] * (1 - u) + table[i + 1, j + 1] * u) * v
    return values


def traced(directions: Array, table: Array, extent: float) -> Array:
    """Distance in metres to the heightfield along rays, inf for a miss."""
    distance = np.full(len(directions), np.inf)
    left = np.arange(len(directions))
    for t in np.geomspace(5000, 22_000, 150):
        p = EYE + t * directions[left]
        hit = p[:, 2] < looked_up(table, extent, p[:, 0], p[:, 1])
        distance[left[hit]] = t
        left = left[~hit]
    return distance


def rays(finer: int) -> Array:
    """Unit ray directions of the camera, `finer` per pixel in both directions."""
    tan = np.tan(np.radians(camera.fov / 2))
    x = (2 * (np.arange(WIDTH * finer) + 0.5) / (WIDTH * finer) - 1) * tan * WIDTH / HEIGHT
    y = (1 - 2 * (np.arange(HEIGHT * finer) + 0.5) / (HEIGHT * finer)) * tan
    x, y = (v.ravel() for v in np.meshgrid(x, y))
    axes = np.array([camera.right, camera.up, camera.forward])
    directions = np.stack([x, y, np.ones_like(x)], axis=-1) @ axes
    unit: Array = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    return unit


# Coverage is the fraction of the rays of a pixel that hit; depth is that of the nearest hit.
table, extent = heights()
distance = traced(rays(FINER), table, extent).reshape(HEIGHT, FINER, WIDTH, FINER)
cover = np.isfinite(distance).mean(axis=(1, 3))
scene_depth = distance.min(axis=(1, 3))

# Lambertian shading by shadowed sunlight and a blue sky; snow on high and gentle slopes.
renderer = nubis.Renderer(WIDTH, HEIGHT, quality="draft")
there = cover > 0
points = EYE + scene_depth[there][:, None] * rays(1)[there.ravel()]
slopes = np.asarray(np.gradient(table, extent / len(table)))
dy, dx = (looked_up(slope, extent, points[:, 0], points[:, 1]) for slope in slopes)
normal = np.stack([-dx, -dy, np.ones_like(dx)], axis=-1)
normal /= np.linalg.norm(normal, axis=1, keepdims=True)
elevation, azimuth = np.radians([params.sun.elevation, params.sun.azimuth])
sun = np.array(
    [np.sin(azimuth) * np.cos(elevation), np.cos(azimuth) * np.cos(elevation), np.sin(elevation)]
)
shadow = renderer.sun_transmittance(points + 5 * normal, params)
irradiance = 8 * (shadow * (normal @ sun).clip(0))[:, None] + np.array([0.7, 0.9, 1.3])
snow = ((points[:, 2] - 1500) / 600).clip(0, 1) * ((normal[:, 2] - 0.45) * 4).clip(0, 1)
albedo = np.array([0.13, 0.12, 0.09]) + snow[:, None] * np.array([0.6, 0.62, 0.66])

# Premultiplied by coverage.
scene_color = np.zeros((HEIGHT, WIDTH, 4))
scene_color[there, :3] = albedo / np.pi * irradiance
scene_color[there, 3] = 1.0
scene_color *= cover[..., None]

frame = renderer.render(camera, params, scene_depth=scene_depth, scene_color=scene_color)
Path("out").mkdir(exist_ok=True)
nubis.save("out/composite.png", frame)
