"""Radiance of clear air in float64, by tracing paths through every order of scattering.

Nothing is shared with the shaders but the numbers of the air (Hillaire 2020, table 1). Paths keep
the phase functions at every order; each straight piece is integrated for the light of the sun by
quadrature, so that what little light there is at dusk is found too.

    python tests/ref64_air.py    # writes references/sky.json
"""

import json
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np

FILE = Path(__file__).parent / "references" / "sky.json"
EARTH, TOP = 6_371_000.0, 100_000.0
RAYLEIGH = np.array([5.802e-6, 13.558e-6, 33.1e-6])
MIE_SCATTERING, MIE_EXTINCTION, MIE_G = 3.996e-6, 4.440e-6, 0.8
OZONE = np.array([1.881e-6, 1.881e-6, 0.085e-6])


class Air:
    """One wavelength band of an atmosphere."""

    def __init__(self, channel, haze=1.0, albedo=(0.10, 0.12, 0.07), radius=EARTH):
        self.rayleigh, self.ozone = RAYLEIGH[channel], OZONE[channel]
        self.haze, self.albedo, self.radius = haze, albedo[channel], radius
        self._table()

    def parts(self, h):
        """Rayleigh and aerosol scattering, and extinction, 1/m."""
        h = np.maximum(h, 0)
        rayleigh = self.rayleigh * np.exp(-h / 8000)
        aerosol = self.haze * np.exp(-h / 1200)
        ozone = self.ozone * np.clip(1 - np.abs(h - 25_000) / 15_000, 0, None)
        return rayleigh, MIE_SCATTERING * aerosol, rayleigh + MIE_EXTINCTION * aerosol + ozone

    def _table(self):
        """Transmittance to space by altitude and by the way to the horizon, in fine steps."""
        self.heights = TOP * np.linspace(0, 1, 161) ** 2
        self.share = np.linspace(0, 1, 241)
        h = self.heights[:, None]
        top = (self.radius + TOP) ** 2
        r = self.radius + h
        horizon = -np.sqrt(np.maximum(1 - (self.radius / r) ** 2, 0))
        mu = horizon + (1 - horizon) * self.share**3
        length = -r * mu + np.sqrt(np.maximum(r * r * mu * mu + top - r * r, 0))
        nodes, weights = np.polynomial.legendre.leggauss(16)
        depth = np.zeros_like(mu)
        # Dense around the lowest point, which for these rays is their start.
        edges = np.linspace(0, 1, 9) ** 2
        for a, b in pairwise(edges):
            for node, weight in zip(nodes, weights, strict=True):
                s = length * (a + (b - a) * (node + 1) / 2)
                at = np.sqrt(r * r + s * s + 2 * r * s * mu) - self.radius
                depth += self.parts(at)[2] * weight * (b - a) / 2 * length
        self.depth = depth

    def sunlight(self, h, mu):
        """Share of the sun's light that arrives; its disc is half a degree wide."""
        h = np.clip(h, 0, TOP)
        horizon = -np.sqrt(np.maximum(1 - (self.radius / (self.radius + h)) ** 2, 0))
        row = np.sqrt(h / TOP) * (len(self.heights) - 1)
        share = np.cbrt(np.clip((mu - horizon) / (1 - horizon), 0, 1))
        column = share * (len(self.share) - 1)
        i = np.minimum(row.astype(int), len(self.heights) - 2)
        j = np.minimum(column.astype(int), len(self.share) - 2)
        f, g = row - i, column - j
        d = self.depth
        depth = (1 - f) * ((1 - g) * d[i, j] + g * d[i, j + 1])
        depth += f * ((1 - g) * d[i + 1, j] + g * d[i + 1, j + 1])
        seen = np.clip((mu - horizon + 0.005) / 0.01, 0, 1)
        return np.exp(-depth) * seen * seen * (3 - 2 * seen)

    def trace(self, rng, eye_height, direction, sun, paths, orders=16, steps=64, limit=np.inf):
        """Mean radiance of paths along a direction, and its standard error, for irradiance 1; of
        the air before a distance `limit` alone.
        """
        position = np.tile([0.0, 0.0, self.radius + eye_height], (paths, 1))
        direction = np.tile(direction, (paths, 1)).astype(float)
        weight, radiance = np.ones(paths), np.zeros(paths)
        for _ in range(orders):
            b = np.einsum("ij,ij->i", position, direction)
            c = np.einsum("ij,ij->i", position, position)
            up = b * b - c + (self.radius + TOP) ** 2
            down = b * b - c + self.radius**2
            grounded = (down > 0) & (b < 0)
            far = np.sqrt(np.maximum(up, 0)) - b
            near = np.maximum(-np.sqrt(np.maximum(up, 0)) - b, 0)
            far = np.where(grounded, -np.sqrt(np.maximum(down, 0)) - b, far)
            far = np.where(up > 0, np.maximum(far, near), near)
            grounded &= far <= limit
            far, limit = np.minimum(far, limit), np.inf
            lowest = np.clip(-b, near, far)
            s0, s1 = -np.sqrt(lowest - near), np.sqrt(far - lowest)
            s = s0[:, None] + (s1 - s0)[:, None] * np.linspace(0, 1, steps + 1)
            edges = lowest[:, None] + s * np.abs(s)
            s = 0.5 * (s[:, 1:] + s[:, :-1])
            t, dt = lowest[:, None] + s * np.abs(s), np.diff(edges, axis=1)
            r = np.sqrt(np.maximum(c[:, None] + t * t + 2 * b[:, None] * t, 1.0))
            h = r - self.radius
            rayleigh, aerosol, extinction = self.parts(h)
            depth = np.cumsum(extinction * dt, axis=1)
            before = np.exp(-(depth - 0.5 * extinction * dt))
            mu_sun = ((position @ sun)[:, None] + t * (direction @ sun)[:, None]) / r
            cosine = (direction @ sun)[:, None]
            source = (rayleigh * phase(cosine, 0) + aerosol * phase(cosine, 1)) * self.sunlight(
                h, mu_sun
            )
            radiance += weight * np.sum(before * source * dt, axis=1)
            through = np.exp(-depth[:, -1])
            end = position + far[:, None] * direction
            mu_end = (end @ sun) / self.radius
            lit = self.albedo / np.pi * self.sunlight(0 * mu_end, mu_end) * np.maximum(mu_end, 0)
            radiance += np.where(grounded, weight * through * lit, 0)
            # On from where the path is scattered, or from the ground; a path to space is made to
            # scatter before, with so much less weight.
            total = np.sum(before * (rayleigh + aerosol) * dt, axis=1)
            ground = np.where(grounded, through * self.albedo, 0)
            at_ground = rng.random(paths) * (total + ground) < ground
            weight = weight * (total + ground)
            share = np.cumsum(before * (rayleigh + aerosol) * dt, axis=1)
            pick = rng.random(paths) * share[:, -1]
            index = np.minimum((share < pick[:, None]).sum(axis=1), steps - 1)
            row = np.arange(paths)
            t_new = edges[row, index] + rng.random(paths) * dt[row, index]
            t_new = np.where(at_ground, far, t_new)
            scattered = position + t_new[:, None] * direction
            fraction = rayleigh[row, index] / (rayleigh + aerosol)[row, index]
            is_rayleigh = rng.random(paths) < fraction
            turned = turn(rng, direction, is_rayleigh)
            zenith = scattered / np.linalg.norm(scattered, axis=1, keepdims=True)
            position = np.where(at_ground[:, None], zenith * (self.radius + 1e-3), scattered)
            direction = np.where(at_ground[:, None], lambert(rng, zenith), turned)
            if weight.max() < 1e-5:
                break
        return radiance.mean(), radiance.std() / np.sqrt(paths)


def phase(cosine, kind):
    if kind == 0:
        return 3 / (16 * np.pi) * (1 + cosine**2)
    g = MIE_G
    return (1 - g * g) / (4 * np.pi * (1 + g * g - 2 * g * cosine) ** 1.5)


def turn(rng, direction, is_rayleigh):
    n = len(direction)
    # Rayleigh's cosine solves mu^3 + 3 mu = 8 u - 4.
    a = 4 * rng.random(n) - 2
    root = np.cbrt(a + np.sqrt(a * a + 1))
    rayleigh = root - 1 / root
    u, g = rng.random(n), MIE_G
    aerosol = (1 + g * g - ((1 - g * g) / (1 - g + 2 * g * u)) ** 2) / (2 * g)
    cosine = np.clip(np.where(is_rayleigh, rayleigh, aerosol), -1, 1)
    return around(rng, direction, cosine)


def lambert(rng, normal):
    return around(rng, normal, np.sqrt(rng.random(len(normal))))


def around(rng, axis, cosine):
    other = np.where(np.abs(axis[:, :1]) > 0.7, [[0.0, 0, 1]], [[1.0, 0, 0]])
    x = np.cross(axis, other)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    y = np.cross(axis, x)
    angle = 2 * np.pi * rng.random(len(axis))
    sine = np.sqrt(np.maximum(1 - cosine**2, 0))
    across = np.cos(angle)[:, None] * x + np.sin(angle)[:, None] * y
    out = cosine[:, None] * axis + sine[:, None] * across
    return out / np.linalg.norm(out, axis=1, keepdims=True)


def direction_of(elevation, azimuth):
    """In the frame of the world: x east, y north, z up; azimuth clockwise from north."""
    e, a = np.radians([elevation, azimuth])
    return np.array([np.cos(e) * np.sin(a), np.cos(e) * np.cos(a), np.sin(e)])


# Sun elevations, altitudes, view elevations and azimuths from the sun.
SUNS = [-6.0, -3.0, 0.0, 5.0, 20.0, 45.0, 90.0]
EYES = {10.0: [5.0, 30.0, 90.0], 8000.0: [-8.0, 2.0, 45.0], 100_000.0: [-60.0, -12.0, -9.0]}
AZIMUTHS = [10.0, 150.0]


def main():
    rng = np.random.default_rng(1)
    paths = int(sys.argv[1]) if len(sys.argv) > 1 else 1500
    air = [Air(channel) for channel in range(3)]
    cases = []
    for sun in SUNS:
        count = paths * (6 if sun < 0 else 1)  # dusk is noisy
        for eye, views in EYES.items():
            for view in views:
                for azimuth in AZIMUTHS:
                    got = [
                        a.trace(
                            rng, eye, direction_of(view, azimuth), direction_of(sun, 0.0), count
                        )
                        for a in air
                    ]
                    cases.append(
                        {
                            "sun": sun,
                            "eye": eye,
                            "view": view,
                            "azimuth": azimuth,
                            "radiance": [float(f"{m:.5g}") for m, _ in got],
                            "error": [float(f"{e:.2g}") for _, e in got],
                        }
                    )
        print(sun, cases[-1], flush=True)
    FILE.write_text("[\n" + ",\n".join(json.dumps(case) for case in cases) + "\n]\n")


if __name__ == "__main__":
    main()
