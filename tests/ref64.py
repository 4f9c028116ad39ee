"""What the renderer should find, in float64 and in the plainest way: no formula here is copied
from a shader.
"""

import math

import numpy as np

import nubis


def sun_direction(params):
    """Toward the sun: azimuth clockwise from north (y), elevation above the horizon."""
    return compass(params.sun.azimuth, params.sun.elevation)


def compass(azimuth, elevation=0.0):
    a, e = math.radians(azimuth), math.radians(elevation)
    return np.array([math.sin(a) * math.cos(e), math.cos(a) * math.cos(e), math.sin(e)])


def normalized(v):
    v = np.asarray(v, dtype=np.float64)
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def from_centre(points, radius, dtype=np.float64):
    """Positions relative to the centre of the planet, which is under the origin."""
    return np.asarray(points, dtype=dtype) + np.array([0, 0, radius], dtype=dtype)


def altitude(points, radius):
    """Height above a sphere that touches the origin from below."""
    return np.linalg.norm(from_centre(points, radius), axis=-1) - radius


def on_chart(points, radius):
    """Where points lie on a map: seen from the antipode of the origin, on the plane that touches
    the planet there.
    """
    up = from_centre(points, radius)
    on_sphere = up / np.linalg.norm(up, axis=-1, keepdims=True) * radius
    return on_sphere[..., :2] * (2 * radius / (on_sphere[..., 2:] + radius))


def from_chart(places, radius, height):
    """The points over places on a map, at `height`."""
    places = np.asarray(places, dtype=np.float64)
    share = (places**2).sum(axis=-1, keepdims=True) / (2 * radius) ** 2
    level = places / (1 + share) * (1 + height / radius)[..., None]
    below = -2 * radius * share / (1 + share)
    z = below[..., 0] * (1 + height / radius) + height
    return np.concatenate([level, z[..., None]], axis=-1)


def raised(points, radius, height):
    """The points moved along z so that they are at `height`."""
    points = np.array(points, dtype=np.float64)
    level = points[:, 0] ** 2 + points[:, 1] ** 2
    r = radius + height
    points[:, 2] = (height**2 + 2 * radius * height - level) / (np.sqrt(r * r - level) + radius)
    return points


def sphere_hits(starts, directions, radius, height):
    """Distances of both crossings of rays with the sphere at `height`: (near, far), NaN for a miss.

    Long doubles, because the plain quadratic formula loses half of its digits.
    """
    o = from_centre(starts, radius, np.longdouble)
    b = (np.asarray(directions, dtype=np.longdouble) * o).sum(axis=-1)
    c = (o * o).sum(axis=-1) - (np.longdouble(radius) + height) ** 2
    with np.errstate(invalid="ignore"):
        root = np.sqrt(b * b - c)
    return (-b - root).astype(np.float64), (-b + root).astype(np.float64)


def pixel_directions(camera, width, height):
    """Directions of pixel centres of a pinhole, shape (height, width, 3)."""
    tan = math.tan(math.radians(camera.fov) / 2)
    x = (2 * (np.arange(width) + 0.5) / width - 1) * tan * width / height
    y = (1 - 2 * (np.arange(height) + 0.5) / height) * tan
    x, y = np.meshgrid(x, y)
    right, up, forward = (np.array(v) for v in (camera.right, camera.up, camera.forward))
    return normalized(x[..., None] * right + y[..., None] * up + forward)


def shell(params):
    """The lowest and the highest altitude at which there can be anything."""
    clouds, deck = params.clouds, params.upper_clouds
    top = max(clouds.top, clouds.cumulonimbus_top if clouds.precipitation > 0 else 0.0)
    lowest = 0.0 if clouds.rain_extinction > 0 else clouds.base
    return lowest, max(top, deck.top if deck.coverage > 0 else 0.0)


def ray_ends(eye, directions, params):
    """How far along each ray there can be cloud: to the ground, or to where the ray leaves the
    shell for good.
    """
    radius = params.atmosphere.planet_radius
    end = np.nan_to_num(sphere_hits(eye, directions, radius, shell(params)[1])[1]).clip(0)
    ground = sphere_hits(eye, directions, radius, 0.0)[0]
    return np.where(ground > 0, np.minimum(end, ground), end)


def optical_depths(renderer, params, starts, directions, ends, n, time=0.0):
    """The renderer's own density along rays from `starts` to `ends`, in `n` equal steps.

    Returns the optical depth of every step, and the points in their middles.
    """
    t = (np.arange(n) + 0.5) / n * ends[:, None]
    points = starts[:, None] + t[..., None] * directions[:, None]
    extinction = renderer.density(points.reshape(-1, 3), params, time=time).reshape(t.shape)
    return extinction * (ends / n)[:, None], points


def transmittance(renderer, params, eye, directions, n, time=0.0):
    starts = np.broadcast_to(np.asarray(eye, dtype=np.float64), directions.shape)
    ends = ray_ends(eye, directions, params)
    return np.exp(
        -optical_depths(renderer, params, starts, directions, ends, n, time)[0].sum(axis=1)
    )


def cloudy_time(renderer, params, camera, low, high):
    """A time at which the mean transmittance of a narrow view lies between `low` and `high`.

    The wind brings cloud before every camera sooner or later, whatever noises and profiles are
    tuned to.
    """
    directions = pixel_directions(camera, 4, 3).reshape(-1, 3)
    for time in range(0, 20_000, 500):
        if low < transmittance(renderer, params, camera.eye, directions, 500, time).mean() < high:
            return float(time)
    raise AssertionError("no cloud passes")


def sun_transmittance(renderer, params, points, n, time=0.0):
    """0 where the ground hides the sun."""
    sun, radius = sun_direction(params), params.atmosphere.planet_radius
    # To the last way out of the shell; without one in front, there is nothing between the point and
    # the sun.
    ends = np.nan_to_num(sphere_hits(points, sun, radius, shell(params)[1])[1]).clip(0)
    depth = optical_depths(
        renderer, params, points, np.broadcast_to(sun, points.shape), ends, n, time
    )[0]
    hidden = sphere_hits(points, sun, radius, 0.0)[0] > 0
    return np.where(hidden, 0, np.exp(-depth.sum(axis=1)))


def single_scattering(renderer, params, eye, directions, n, n_sun, time=0.0):
    """The contract's integral of sigma_s p E T_sun T dt, without air, as radiance (N, 3)."""
    starts = np.broadcast_to(np.asarray(eye, dtype=np.float64), directions.shape)
    ends = ray_ends(eye, directions, params)
    depth, points = optical_depths(renderer, params, starts, directions, ends, n, time)
    lit = depth > 0
    sun = np.zeros(depth.shape)
    sun[lit] = sun_transmittance(renderer, params, points[lit], n_sun, time)
    seen = np.exp(depth - np.cumsum(depth, axis=1))
    phase = henyey_greenstein(directions @ sun_direction(params), params.light.g)
    scattered = params.light.albedo * phase * (seen * -np.expm1(-depth) * sun).sum(axis=1)
    return scattered[:, None] * np.array(params.sun.irradiance)


def droplet_lobes(diameter):
    """Jendersie and d'Eon 2023: g of the Henyey-Greenstein lobe; g, alpha, share of Draine's."""
    return (
        np.exp(-0.0990567 / (diameter - 1.67154)),
        np.exp(-2.20679 / (diameter + 3.91029) - 0.428934),
        np.exp(3.62489 - 8.29288 / (diameter + 5.52825)),
        np.exp(-0.599085 / (diameter - 0.641583) - 0.665888),
    )


def draine(mu, g, alpha):
    """Draine 2003, equation 1 of Jendersie and d'Eon."""
    shape = (1 - g**2) * (1 + alpha * mu**2) / (1 + g**2 - 2 * g * mu) ** 1.5
    return shape / (4 * np.pi * (1 + alpha * (1 + 2 * g**2) / 3))


def droplet(mu, diameter, peak=1.0):
    """The blend, with g and alpha of both lobes times `peak`."""
    g, g_draine, alpha, share = droplet_lobes(diameter)
    body = draine(mu, peak * g_draine, peak * alpha)
    return (1 - share) * draine(mu, peak * g, 0.0) + share * body


def henyey_greenstein(mu, g):
    """As printed in 1941, with float64 to pay for its cancellations."""
    mu = np.asarray(mu, dtype=np.longdouble)
    g = np.longdouble(g)
    return ((1 - g * g) / (4 * np.pi * (1 + g * g - 2 * g * mu) ** 1.5)).astype(np.float64)


def remap(v, a, b, c=0.0, d=1.0):
    return c + (v - a) / (b - a) * (d - c)


def relative_rmse(image, reference):
    image, reference = (np.asarray(v, dtype=np.float64) for v in (image, reference))
    return np.sqrt(np.mean((image - reference) ** 2)) / np.mean(reference)


def smooth_params(**changes):
    """A field without detail smaller than hundreds of metres, in black air without high clouds.

    Steps of tens of metres then resolve it, and the level of detail that the march takes for its
    step is the finest, which is the one that `density` reads.
    """
    values = {
        "clouds.coverage": 0.5,
        "weather.map": np.full((1, 1, 3), [0.9, 0.6, 0.0]),
        "clouds.base": 1000.0,
        "clouds.top": 3000.0,
        "clouds.type": 0.5,
        "clouds.extinction": 0.004,
        "clouds.detail": 0.4,
        "clouds.fine_detail": 0.0,
        "clouds.shape_scale": 40_000.0,
        "clouds.detail_scale": 20_000.0,
        "clouds.curl_scale": 40_000.0,
        "high_clouds.coverage": 0.0,
        "wind.speed": 10.0,
        "wind.detail_speed": 10.0,
        "atmosphere.enabled": False,
        "sun.visible": False,
    }
    return nubis.Params().with_(**(values | changes))


def fine(view_steps, light_steps=1, **changes):
    """A numerical method without short cuts: equal steps, light samples with all detail, no end
    before the end.
    """
    values = {
        "steps_zenith": view_steps,
        "steps_horizon": view_steps,
        "step_growth": 0.0,
        "coarse_step": 1,
        "empty_before_coarse": 4096,
        "light_steps": light_steps,
        "light_group_weight": 0.0,
        "light_distance": 3000.0,
        "far_sample": False,
        "light_detail_cutoff": 1.0,
        "min_transmittance": 0.0,
        "adaptive_threshold": 0.0,
        "jitter": False,
    }
    return nubis.Quality(**(values | changes))
