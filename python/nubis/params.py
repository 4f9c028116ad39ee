"""The parameters of a sky and of the numerical method.

Generated from crates/clouds_core/src/params.rs by `make generate`: change it there.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import numpy.typing as npt

from nubis._block import Block, Root
from nubis._nubis import DensityGrid
from nubis._sun import SunBlock


@dataclass(frozen=True, kw_only=True, eq=False)
class Sun(SunBlock):
    """Position, irradiance and disc of the sun.

    Attributes
    ----------
    elevation : float
        Elevation above the horizon, geometric (without refraction). Allowed: a number from -90 to
        90 degrees.
    azimuth : float
        Azimuth, clockwise from north. Allowed: a number from -360 to 360 degrees.
    irradiance : tuple[float, float, float]
        Irradiance above the atmosphere on a plane that faces the sun (linear, Rec. 709 primaries).
        Its unit, per steradian, is the unit of the picture (docs/units.md). Allowed: 3 numbers from
        0 to 1000000.
    visible : bool
        Whether the sun's disc is drawn. Allowed: True or False.
    """

    elevation: float = 40.0
    azimuth: float = 120.0
    irradiance: tuple[float, float, float] = (10.0, 10.0, 10.0)
    visible: bool = True


@dataclass(frozen=True, kw_only=True, eq=False)
class Moon(Block):
    """Position, phase, irradiance and disc of the moon. Moonlight is added to sunlight: it lights
    air, clouds and ground, and casts shadows. The lit side of the disc faces the sun.

    Attributes
    ----------
    elevation : float
        Elevation above the horizon. -90, the default, switches the moon off. Allowed: a number from
        -90 to 90 degrees.
    azimuth : float
        Azimuth, clockwise from north. Allowed: a number from -360 to 360 degrees.
    phase : float
        Age as a fraction of the lunar month: 0 is new moon, 0.25 first quarter, 0.5 full moon, 0.75
        last quarter, 1 new moon. The irradiance of a half moon is a tenth of that of a full moon
        (Krisciunas and Schaefer 1991). Allowed: a number from 0 to 1.
    irradiance : tuple[float, float, float]
        Irradiance of the full moon above the atmosphere on a plane that faces the moon, in the unit
        of `sun.irradiance`. The default corresponds to a sun of 10: its brightness follows from
        apparent magnitudes of -12.73 (moon) and -26.74 (sun), its colour from B - V of 0.92 (moon)
        and 0.65 (sun; Allen's Astrophysical Quantities). Allowed: 3 numbers from 0 to 1000000.
    visible : bool
        Whether the moon's disc is drawn. Allowed: True or False.
    """

    elevation: float = -90.0
    azimuth: float = 180.0
    phase: float = 0.5
    irradiance: tuple[float, float, float] = (0.000027, 0.000025, 0.00002)
    visible: bool = True


@dataclass(frozen=True, kw_only=True, eq=False)
class Clouds(Block):
    """The volumetric clouds (lower deck): cover, type, altitude, density and noises.

    Attributes
    ----------
    coverage : float
        Cloud cover: an offset of `2 * coverage - 1` to the coverage of the weather map. 0 is a
        clear sky, 0.5 leaves the map unchanged, 1 is overcast. Allowed: a number from 0 to 1.
    type : float
        Cloud type: an offset of `2 * type - 1` to the type of the weather map, in which 0 is
        stratus, 0.5 stratocumulus and 1 cumulus. 0.5 leaves the map unchanged. Allowed: a number
        from 0 to 1.
    precipitation : float
        Precipitation: a factor on the precipitation of the weather map; 0 is dry. Precipitation
        thickens and darkens clouds and makes cumulus grow into cumulonimbus (nubis2015). Allowed: a
        number from 0 to 1.
    base : float
        Altitude of the cloud base. Allowed: a number from 0 to 20000 m.
    top : float
        Altitude of the highest cloud tops without precipitation. Allowed: a number from 1 to 25000
        m.
    cumulonimbus_top : float
        Altitude of the tops of cumulonimbus, where precipitation is 1 (nubis2015: 8 km). Allowed: a
        number from 1 to 25000 m.
    anvil : float
        Horizontal extent of the anvils at the tops of cumulonimbus. Allowed: a number from 0 to 1.
    rain_extinction : float
        Extinction of the rain below the clouds at the heaviest precipitation; 0 hides the rain.
        Rain with less extinction than clean air (1e-5) evaporates before it reaches the ground.
        Allowed: a number from 0 to 1 1/m.
    extinction : float
        Extinction at density 1. Allowed: a number from 0 to 100000000 1/m.
    seed : int
        Random seed of the noises. Allowed: a whole number from 0 to 4294967295.
    field : {eroded, heaped}
        Field of cloud density. `eroded`: Perlin-Worley noise times the height profile, eroded by
        detail (nubis2015). `heaped`: a shape that behaves like a distance, with lifted bases,
        relief of billows and narrow edges; `extinction` is that of a core, 0.05 to 0.1. Allowed:
        one of "eroded", "heaped".
    noise : {nubis2015, vsu2022}
        Noises of base shape and detail of the field `eroded`. `nubis2015`: Perlin-Worley noise and
        three octaves of Worley FBM for the base shape, Worley FBM for the detail. `vsu2022`:
        Perlin-Worley noise of rising frequency in every channel. Allowed: one of "nubis2015",
        "vsu2022".
    shape_scale : float
        Tile width of the base-shape noise. Allowed: a number from 100 to 200000 m.
    detail_scale : float
        Tile width of the detail noise, which erodes the edges. Allowed: a number from 10 to 50000
        m.
    detail : float
        Depth of the erosion by the detail noise (nubis2015: 0.2). Allowed: a number from 0 to 1.
    fine_detail : float
        Weight of a finer detail noise, a fifth as wide, that is added to the detail noise. It is
        visible in near clouds. 0 leaves it out (nubis2015). Allowed: a number from 0 to 1.
    curl_scale : float
        Tile width of the curl noise, which distorts the detail noise. Allowed: a number from 10 to
        50000 m.
    curl : float
        Displacement of the detail noise by the curl noise at the cloud base. It falls to 0 at the
        cloud top. Allowed: a number from 0 to 2000 m.
    stratus : tuple[float, float, float, float]
        Height profile of stratus: the fractions of the height at which the density starts to rise
        from 0, reaches 1, starts to fall, and reaches 0 (nubis2015, figure 4.10; vsu2022's
        gradients). Allowed: 4 numbers from 0 to 1.
    stratocumulus : tuple[float, float, float, float]
        Height profile of stratocumulus, as four fractions of the height in the order of `stratus`.
        Allowed: 4 numbers from 0 to 1.
    cumulus : tuple[float, float, float, float]
        Height profile of cumulus, as four fractions of the height in the order of `stratus`.
        Allowed: 4 numbers from 0 to 1.
    cumulonimbus : tuple[float, float, float, float]
        Height profile of cumulonimbus, as four fractions of the height in the order of `stratus`.
        Allowed: 4 numbers from 0 to 1.
    profile : array of float32, shape (H, W), or None
        Table of density by height and type that replaces `stratus`, `stratocumulus` and `cumulus`:
        row 0 is the top of the clouds, the last row their base, column 0 type 0, the last column
        type 1 (Frostbite 2016). Allowed: None or a float array of shape (H, W), H and W from 1 to
        8192, values from 0 to 1.
    """

    coverage: float = 0.45
    type: float = 0.85
    precipitation: float = 0.0
    base: float = 1200.0
    top: float = 3200.0
    cumulonimbus_top: float = 8000.0
    anvil: float = 0.5
    rain_extinction: float = 0.0
    extinction: float = 0.2
    seed: int = 1
    field: Literal["eroded", "heaped"] = "eroded"
    noise: Literal["nubis2015", "vsu2022"] = "nubis2015"
    shape_scale: float = 5200.0
    detail_scale: float = 420.0
    detail: float = 0.2
    fine_detail: float = 0.6
    curl_scale: float = 1600.0
    curl: float = 70.0
    stratus: tuple[float, float, float, float] = (0.02, 0.05, 0.09, 0.11)
    stratocumulus: tuple[float, float, float, float] = (0.02, 0.12, 0.35, 0.6)
    cumulus: tuple[float, float, float, float] = (0.01, 0.07, 0.25, 1.0)
    cumulonimbus: tuple[float, float, float, float] = (0.005, 0.04, 0.8, 1.0)
    profile: npt.NDArray[np.float32] | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class UpperClouds(Block):
    """The upper deck of volumetric clouds, above `clouds`. Its weather is another region of the
    same weather map. Its noises are those of the lower deck at another scale.

    Attributes
    ----------
    coverage : float
        Cloud cover of the upper deck, in the scale of `clouds.coverage`; 0 switches the deck off.
        Allowed: a number from 0 to 1.
    type : float
        Cloud type of the upper deck, in the scale of `clouds.type`. Allowed: a number from 0 to 1.
    base : float
        Altitude of the base of the upper deck: at or above `clouds.top` unless `coverage` is 0.
        Allowed: a number from 0 to 25000 m.
    top : float
        Altitude of the tops of the upper deck. Allowed: a number from 1 to 25000 m.
    extinction : float
        Extinction of the upper deck at density 1. Allowed: a number from 0 to 100000000 1/m.
    scale : float
        Size of the clouds of the upper deck, as a factor on the size of those of the lower deck.
        Allowed: a number from 0.01 to 100.
    direction : float
        Compass direction toward which the upper deck drifts, clockwise from north. Allowed: a
        number from -360 to 360 degrees.
    speed : float
        Wind speed of the upper deck. Allowed: a number from -1000 to 1000 m/s.
    shear : float
        Downwind displacement of the tops of the upper deck against its base. Allowed: a number from
        -20000 to 20000 m.
    """

    coverage: float = 0.0
    type: float = 0.5
    base: float = 4800.0
    top: float = 5600.0
    extinction: float = 0.06
    scale: float = 0.4
    direction: float = 95.0
    speed: float = 16.0
    shear: float = 150.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Weather(Block):
    """The weather map: coverage, type and precipitation by place.

    Attributes
    ----------
    extent : float
        Side of the square that the weather map covers, centred on the origin of the world. The map
        lies on the planet in stereographic projection: true to scale at the origin, conformal
        everywhere. Allowed: a number from 100 to 10000000 m.
    edge : {repeat, mirror, clamp}
        Addressing beyond the edge of the map: `repeat`, `mirror` (every other tile is mirrored) or
        `clamp` (extends the texels of the edge). Allowed: one of "repeat", "mirror", "clamp".
    map : array of float32, shape (H, W, 3), or None
        User-supplied weather map: coverage, type and precipitation; row 0 is in the north, column 0
        in the west. None bakes a map from noise. Allowed: None or a float array of shape (H, W, 3),
        H and W from 1 to 8192, values from 0 to 1.
    noise : {worley_perlin, worley_simplex, perlin_worley}
        Noises of the baked map: `worley_perlin` is a sum of Worley and Perlin noise,
        `worley_simplex` a product of Worley and simplex noise (thesis2018), `perlin_worley`
        Perlin-Worley noise (vsu2022). Allowed: one of "worley_perlin", "worley_simplex",
        "perlin_worley".
    seed : int
        Random seed of the baked maps. Allowed: a whole number from 0 to 4294967295.
    scale : float
        Typical distance between the clouds of the baked map. Allowed: a number from 100 to 1000000
        m.
    variety : float
        Amplitude of the variation of cloud cover over distances of several clouds, in the baked
        map. Allowed: a number from 0 to 1.
    type_variety : float
        Amplitude of the variation of cloud type in the baked map; 0 makes the type uniform.
        Allowed: a number from 0 to 2.
    broad_variety : float
        Amplitude of the larger weather map, which offsets coverage, type and precipitation and
        hides the repetition of the smaller map. The larger map is `broad_map`, or is baked from
        `seed`. A baked larger map also distorts the smaller map, in full from 0.3 on. 0 switches
        the larger map off. A user-supplied `map` without a `broad_map` is not changed. Allowed: a
        number from 0 to 1.
    broad_extent : float
        Side of the square that the larger map covers. The larger map repeats beyond it. Allowed: a
        number from 100 to 10000000 m.
    broad_map : array of float32, shape (H, W, 3), or None
        User-supplied larger map: offsets of coverage, type and precipitation, 0.5 for no offset.
        None bakes one from noise, unless `map` is set. Allowed: None or a float array of shape (H,
        W, 3), H and W from 1 to 8192, values from 0 to 1.
    clear_at : tuple[float, float]
        Centre of the region that is kept clear of clouds, east and north of the origin. The region
        is fixed in the world while the weather drifts. Allowed: 2 numbers from -10000000 to
        10000000 m.
    clear_radius : float
        Radius of the region without clouds. Cloud cover is back to full at 1.5 times the radius. 0
        switches the region off. Allowed: a number from 0 to 10000000 m.
    """

    extent: float = 60000.0
    edge: Literal["repeat", "mirror", "clamp"] = "repeat"
    map: npt.NDArray[np.float32] | None = None
    noise: Literal["worley_perlin", "worley_simplex", "perlin_worley"] = "worley_perlin"
    seed: int = 7
    scale: float = 5000.0
    variety: float = 0.5
    type_variety: float = 0.9
    broad_variety: float = 0.3
    broad_extent: float = 430000.0
    broad_map: npt.NDArray[np.float32] | None = None
    clear_at: tuple[float, float] = (0.0, 0.0)
    clear_radius: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Wind(Block):
    """Winds that carry the base shapes, the detail and the weather map.

    Attributes
    ----------
    direction : float
        Compass direction toward which the base shapes drift and the tops are sheared, clockwise
        from north. Allowed: a number from -360 to 360 degrees.
    speed : float
        Speed of the base shapes. Allowed: a number from -1000 to 1000 m/s.
    detail_direction : float
        Compass direction toward which the detail drifts, clockwise from north. Allowed: a number
        from -360 to 360 degrees.
    detail_speed : float
        Speed of the detail. The velocity of the detail relative to the base shapes makes the edges
        evolve. Allowed: a number from -1000 to 1000 m/s.
    shear : float
        Downwind displacement of the cloud tops against the cloud base (nubis2015: 500 m). Allowed:
        a number from -20000 to 20000 m.
    updraft : float
        Upward speed of the noises. Allowed: a number from -100 to 100 m/s.
    weather_direction : float
        Compass direction toward which the weather map drifts, clockwise from north. Allowed: a
        number from -360 to 360 degrees.
    weather_speed : float
        Speed of the weather map. 0 keeps a composed sky in place while the shapes of its clouds
        evolve (thesis2018). Allowed: a number from -1000 to 1000 m/s.
    """

    direction: float = 60.0
    speed: float = 8.0
    detail_direction: float = 60.0
    detail_speed: float = 11.0
    shear: float = 400.0
    updraft: float = 0.8
    weather_direction: float = 60.0
    weather_speed: float = 8.0


@dataclass(frozen=True, kw_only=True, eq=False)
class WindVariation(Block):
    """Slow variation of winds and cloud cover over hours (gems2001): the mean of four sinusoids of
    incommensurate periods, in closed form for any time.

    Attributes
    ----------
    wind : float
        Amplitude of the variation of all winds in speed and direction, as a fraction of their
        speed: at 0.5 a wind blows at 0.5 to 1.5 times its speed and within 30 degrees of its
        direction. All winds vary alike. Wind shear does not vary. Allowed: a number from 0 to 1.
    coverage : float
        Amplitude of the variation of `clouds.coverage`. The result is clamped to the range from 0
        to 1. Allowed: a number from 0 to 1.
    period : float
        Typical period of the variation. Allowed: a number from 60 to 100000000 s.
    seed : int
        Random seed of the phases. Allowed: a whole number from 0 to 4294967295.
    """

    wind: float = 0.0
    coverage: float = 0.0
    period: float = 7200.0
    seed: int = 11


@dataclass(frozen=True, kw_only=True, eq=False)
class Drift(Block):
    """Displacements at 0 s, from which the present winds carry the clouds on. All are 0 until winds
    change: `Params.after`, `Keyframes` and `Renderer.animate` set them, so that a change of wind
    does not move the clouds.

    Attributes
    ----------
    shape : tuple[float, float]
        Displacement of the base shapes, east and north. Allowed: 2 numbers from -1000000000000 to
        1000000000000 m.
    detail : tuple[float, float]
        Displacement of the detail, east and north. Allowed: 2 numbers from -1000000000000 to
        1000000000000 m.
    weather : tuple[float, float]
        Displacement of the weather map, east and north. Allowed: 2 numbers from -1000000000000 to
        1000000000000 m.
    upper : tuple[float, float]
        Displacement of the upper deck (shapes and weather), east and north. Allowed: 2 numbers from
        -1000000000000 to 1000000000000 m.
    upper_detail : tuple[float, float]
        Displacement of the detail of the upper deck, east and north. Allowed: 2 numbers from
        -1000000000000 to 1000000000000 m.
    high : tuple[float, float]
        Displacement of the high clouds, along `high_clouds.direction` and to its left. Allowed: 2
        numbers from -1000000000000 to 1000000000000 m.
    rise : float
        Upward displacement of the noises by the updraft. Allowed: a number from -1000000000000 to
        1000000000000 m.
    evolution : float
        Number of replacements of the largest octave of the high clouds (`high_clouds.evolution`).
        Allowed: a number from -1000000000000 to 1000000000000.
    swings : float
        Time offset of the wander, in units of `wander.period`. Allowed: a number from
        -1000000000000 to 1000000000000.
    """

    shape: tuple[float, float] = (0.0, 0.0)
    detail: tuple[float, float] = (0.0, 0.0)
    weather: tuple[float, float] = (0.0, 0.0)
    upper: tuple[float, float] = (0.0, 0.0)
    upper_detail: tuple[float, float] = (0.0, 0.0)
    high: tuple[float, float] = (0.0, 0.0)
    rise: float = 0.0
    evolution: float = 0.0
    swings: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class HighClouds(Block):
    """The high clouds: a layer without thickness on a sphere of its own (nubis2015), with an
    animated texture (gems2001).

    Attributes
    ----------
    coverage : float
        Cover of the high clouds: 0 is clear, 1 overcast. Allowed: a number from 0 to 1.
    with_volume : bool
        Whether high clouds are drawn together with a `volume`, which otherwise replaces all clouds.
        Allowed: True or False.
    type : float
        Type of the high clouds: 0 is streaks of cirrus, 1 cells of altocumulus. Values between mix
        both, in proportions that vary from place to place. Allowed: a number from 0 to 1.
    altitude : float
        Altitude of the layer. Allowed: a number from 100 to 30000 m.
    optical_depth : float
        Vertical optical depth of the layer where it is thickest. Allowed: a number from 0 to 100.
    scale : float
        Tile width of the texture. Allowed: a number from 1000 to 1000000 m.
    curve : {exponential, clamp}
        Mapping from texture to optical depth: `exponential` saturates and has soft edges and even
        cores (gems2001's condensation), `clamp` is linear above a threshold, up to a maximum
        (gems2001: subtract and clamp). Allowed: one of "exponential", "clamp".
    emboss : float
        Strength of the emboss: flanks toward the sun are brightened, flanks away from it darkened
        (gems2001). Allowed: a number from 0 to 1.
    stretch : float
        Ratio of length to width of the streaks, along the wind. Cells are stretched by its square
        root, across it. Allowed: a number from 1 to 16.
    direction : float
        Compass direction toward which the high clouds drift, clockwise from north. The streaks lie
        along it. Allowed: a number from -360 to 360 degrees.
    speed : float
        Speed of the high clouds. Allowed: a number from -1000 to 1000 m/s.
    evolution : float
        Rate at which the largest octave of the texture is replaced by new noise. Each further
        octave is replaced twice as often as the one before. Allowed: a number from 0 to 10 1/s.
    octaves : int
        Number of octaves of the texture. Allowed: a whole number from 1 to 8.
    seed : int
        Random seed of the texture. Allowed: a whole number from 0 to 4294967295.
    texture_size : int
        Width and height of the texture. Allowed: a whole number from 16 to 4096 texels.
    """

    coverage: float = 0.5
    with_volume: bool = False
    type: float = 0.0
    altitude: float = 8500.0
    optical_depth: float = 1.0
    scale: float = 42000.0
    curve: Literal["exponential", "clamp"] = "exponential"
    emboss: float = 0.0
    stretch: float = 3.0
    direction: float = 75.0
    speed: float = 25.0
    evolution: float = 0.001
    octaves: int = 5
    seed: int = 3
    texture_size: int = 512


@dataclass(frozen=True, kw_only=True, eq=False)
class Light(Block):
    """Light in the clouds: light model, phase function, albedo and ambient light.

    Attributes
    ----------
    model : {single, nubis2015, thesis2018, vsu2022, octaves, multiple, path}
        Light model. `single` is physical single scattering. `nubis2015`, `thesis2018` and `vsu2022`
        are the published models. `octaves` approximates multiple scattering (Wrenninge et al. 2013,
        Hillaire 2016). `multiple` has every order of scattering, from a light field that is solved
        for the clouds. `path` traces paths of every order of scattering and is the reference of the
        others. Allowed: one of "single", "nubis2015", "thesis2018", "vsu2022", "octaves",
        "multiple", "path".
    phase : {henyey_greenstein, droplet, mie}
        Phase function. `henyey_greenstein` has the parameter `g` (in thesis2018 and vsu2022
        `g_back`, too), as published. `droplet` is a fit to cloud droplets, which gives clouds a
        silver lining (Jendersie and d'Eon 2023). `mie` is Mie scattering by droplets, with fogbow
        and glory. `droplet` and `mie` scatter half of the light by less than a few degrees, so that
        `path` needs many times the samples. Allowed: one of "henyey_greenstein", "droplet", "mie".
    droplet_diameter : float
        Diameter of the droplets for `droplet` and `mie`: fog 5 to 20, cumulus 10 to 30, drizzle 50.
        Allowed: a number from 5 to 50 µm.
    g : float
        Asymmetry parameter (mean cosine) of the forward lobe of the phase function: 0.85 for
        droplets. `octaves` is fitted for 0.6, which suits the published models, too. Allowed: a
        number from -0.9999 to 0.9999.
    g_back : float
        Asymmetry parameter (mean cosine) of the backward lobe (thesis2018, vsu2022). Allowed: a
        number from -0.9999 to 0.9999.
    lobe_mix : float
        Weight of the forward lobe (vsu2022). Allowed: a number from 0 to 1.
    albedo : float
        Single-scattering albedo (`single`, `octaves`, `multiple`, `path`). Allowed: a number from 0
        to 1.
    octaves : int
        Number of orders of scattering in the sum of the `octaves` model. Allowed: a whole number
        from 1 to 16.
    octave_scattering : float
        Factor on the scattered light from one octave to the next. This factor, `octave_extinction`
        and `octave_phase` are fitted to `path` for three octaves (docs/accuracy.md); 0.5 is usual.
        Allowed: a number from 0 to 1.
    octave_extinction : float
        Factor on the extinction toward the sun from one octave to the next. Allowed: a number from
        0 to 1.
    octave_phase : float
        Factor on `g` from one octave to the next; with `droplet` and `mie` on the asymmetry of each
        lobe. Allowed: a number from 0 to 1.
    sun_gain : float
        Gain of the sunlight in the published models, which do not conserve energy. Allowed: a
        number from 0 to 1000.
    absorption : float
        Factor on the optical depth toward the sun in the published models. Allowed: a number from 0
        to 10.
    ambient : tuple[float, float, float]
        Isotropic radiance that lights the clouds in addition to sun and sky (linear, Rec. 709
        primaries; all models but `single`). Allowed: 3 numbers from 0 to 1000000.
    ambient_gain : float
        Gain of the ambient light of the sky (all models but `single`). Allowed: a number from 0 to
        1000.
    ambient_top : tuple[float, float, float]
        Tint of the ambient light at the cloud top. Its brightness follows from the sky. Allowed: 3
        numbers from 0 to 1000.
    ambient_bottom : tuple[float, float, float]
        Tint of the ambient light at the cloud base. Its brightness follows from sky and ground.
        Allowed: 3 numbers from 0 to 1000.
    ambient_occlusion : float
        Occlusion of the ambient light within clouds (all models but `single` and `multiple`): 1
        weights light from above and below by the optical depths above and below the point (two
        streams, Bohren 1987), 0 by height alone, as in the published models. Allowed: a number from
        0 to 1.
    powder : float
        Strength of the darkening of thin edges in the published models ("powdered sugar",
        nubis2015); 0 is none. Allowed: a number from 0 to 1.
    rain_absorption : float
        Factor on the absorption in the published models where precipitation is 1 (nubis2015).
        Allowed: a number from 1 to 100.
    """

    model: Literal[
        "single", "nubis2015", "thesis2018", "vsu2022", "octaves", "multiple", "path"
    ] = "multiple"
    phase: Literal["henyey_greenstein", "droplet", "mie"] = "henyey_greenstein"
    droplet_diameter: float = 20.0
    g: float = 0.85
    g_back: float = -0.25
    lobe_mix: float = 0.5
    albedo: float = 0.999
    octaves: int = 3
    octave_scattering: float = 0.91
    octave_extinction: float = 0.26
    octave_phase: float = 0.25
    sun_gain: float = 2.2
    absorption: float = 0.22
    ambient: tuple[float, float, float] = (0.0, 0.0, 0.0)
    ambient_gain: float = 1.0
    ambient_top: tuple[float, float, float] = (1.0, 1.0, 1.0)
    ambient_bottom: tuple[float, float, float] = (1.0, 1.0, 1.0)
    ambient_occlusion: float = 1.0
    powder: float = 0.6
    rain_absorption: float = 2.5


@dataclass(frozen=True, kw_only=True, eq=False)
class Atmosphere(Block):
    """The planet, its atmosphere, and the shadows of clouds on both.

    Attributes
    ----------
    enabled : bool
        Whether there is an atmosphere. Without one the sky is black by day and night, and sunlight
        is not attenuated. Allowed: True or False.
    planet_radius : float
        Radius of the planet (Earth 6 371 000, thesis2018 400 000). Allowed: a number from 10000 to
        1000000000 m.
    haze : float
        Amount of aerosol. One unit has a vertical optical depth of 0.0053 above the ground, at 550
        nm and at all other wavelengths. 1 is air as clear as over the Antarctic, 10 to 20 a clear
        day (optical depth 0.05 to 0.1), 94 thick haze (0.5). Allowed: a number from 0 to 100.
    aerial_perspective : float
        Strength of the aerial perspective in front of the clouds: 1 is physical, 0 none. Allowed: a
        number from 0 to 10.
    ground_shadows : bool
        Whether clouds cast shadows on the visible ground. Allowed: True or False.
    light_shafts : bool
        Whether clouds cast shadows on the air: light shafts (crepuscular rays). Allowed: True or
        False.
    ground_albedo : tuple[float, float, float]
        Albedo of the ground (linear, Rec. 709 primaries). Allowed: 3 numbers from 0 to 1.
    night : tuple[float, float, float]
        Radiance of the night sky above the atmosphere (airglow and stars), present by day too. The
        default corresponds to a sun of 10: 20.9, 21.6 and 22.6 magnitudes per square arcsecond in
        R, V and B (Patat 2003) against the sun's -27.1, -26.74 and -26.09. Allowed: 3 numbers from
        0 to 1000000.
    """

    enabled: bool = True
    planet_radius: float = 6371000.0
    haze: float = 1.0
    aerial_perspective: float = 1.0
    ground_shadows: bool = True
    light_shafts: bool = True
    ground_albedo: tuple[float, float, float] = (0.1, 0.12, 0.07)
    night: tuple[float, float, float] = (0.000000027, 0.00000002, 0.000000014)


@dataclass(frozen=True, kw_only=True, eq=False)
class Quality(Block):
    """The numerical method: accuracy and cost of a picture. The appearance of the sky is set by
    `Params` alone.

    Attributes
    ----------
    integrator : {march, reference, path}
        Integrator: `march`, the ray march that all settings but the last four belong to;
        `reference`, the ray march whose steps are halved until it converges to `tolerance`; `path`,
        path tracing of every order of scattering with the light models `multiple` and `octaves`.
        Allowed: one of "march", "reference", "path".
    steps_zenith : int
        Number of view steps of a ray toward the zenith. Allowed: a whole number from 1 to 4096.
    steps_horizon : int
        Number of view steps of a ray toward the horizon. Allowed: a whole number from 1 to 4096.
    step_growth : float
        Growth of the view steps with distance: 0 makes all steps of a ray equal, 1 makes a step a
        fixed fraction of its distance. Allowed: a number from 0 to 1.
    coarse_step : int
        Length of a coarse step outside clouds, in view steps. On a hit the march goes back by the
        coarse step. Allowed: a whole number from 1 to 16.
    sphere_tracing : float
        Sphere-tracing factor for steps through clear air longer than `coarse_step` (Hart 1996): the
        step per unit by which the base shape falls short of cloud, as a fraction of
        `clouds.shape_scale` (of `weather.scale`, or of 2.5 texels of `weather.map`, if that is
        less). On a hit the march goes back. 0 limits steps to `coarse_step`. Longer steps are off
        where `coarse_step` is 1, in grids and in rain. Allowed: a number from 0 to 1.
    empty_before_coarse : int
        Number of consecutive full samples of zero density before the march takes coarse steps
        (nubis2015: 6). Allowed: a whole number from 1 to 4096.
    light_steps : int
        Number of light samples toward the sun, without the far sample. Where they reach to the end
        of the clouds (`light_distance` 0), points below a second deck take a third more, for that
        deck. Allowed: a whole number from 1 to 128.
    light_group_weight : float
        Light-group weight: consecutive view samples are lit as a group, by light samples from one
        point, once their opacity in the pixel exceeds this share, or where clear air follows. 0
        lights each view sample by itself. Allowed: a number from 0 to 1.
    light_distance : float
        Reach of the light samples; 0 extends them to the end of the clouds. Allowed: a number from
        0 to 100000 m.
    field_cells : int
        Cells of a level of the light field across (light model `multiple`). Allowed: a whole number
        from 16 to 128.
    field_cell : float
        Cell of the finest level of the light field. Allowed: a number from 10 to 10000 m.
    relief_samples : int
        Number of density samples toward the sun, near the view sample, before the light field is
        read. They reach across as many of its cells, whose relief they add. Allowed: a whole number
        from 0 to 64.
    far_sample : bool
        Whether a further light sample is taken at three times the reach of the others, for shadows
        of distant clouds (nubis2015). Allowed: True or False.
    cone : float
        Half-width of the cone of the light samples, as a fraction of its length (nubis2015); 0
        places them on a straight line to the sun. Allowed: a number from 0 to 1.
    light_detail_cutoff : float
        Detail cut-off of the light samples: opacity in front of a view sample above which its light
        samples omit the detail noise (nubis2015: 0.3). Light samples that reach to the end of the
        clouds also omit it wherever they stand for most of a tile of the detail noise. Allowed: a
        number from 0 to 1.
    min_transmittance : float
        Transmittance at which a ray ends. Its radiance is then scaled up to full opacity, so that
        the remaining light is not lost. Allowed: a number from 0 to 0.5.
    adaptive_threshold : float
        Threshold for adaptive sampling: a pixel is marched if the contrast between neighbouring
        samples exceeds it. 0 marches every pixel; 1 marches only the initial grid and upsamples.
        The initial grid has one pixel in sixteen if pixels are narrower than an eighth of a degree,
        one in four up to a quarter of a degree, and every pixel if they are wider. With 1,
        `Renderer.animate` reprojects the initial grid alone. The background (sky, ground, and high
        clouds seen from below) is evaluated at every fourth pixel in both directions if pixels are
        narrower than an eighth of a degree, and at every pixel where its second difference exceeds
        a tenth of the threshold and along edges; 0 evaluates every pixel. Allowed: a number from 0
        to 1.
    jitter : bool
        Whether the start of each ray is jittered by blue noise of up to one view step. Allowed:
        True or False.
    tolerance : float
        Tolerance of the integrator `reference`: the steps are halved until no pixel changes by more
        than this relative amount. Its sun rays reach to the end of the clouds. Allowed: a number
        from 0.000001 to 1.
    path_samples : int
        Number of paths per pixel of the integrator `path`. Allowed: a whole number from 2 to
        1048576.
    path_scatterings : int
        Maximum number of scattering events of a path of the integrator `path`; 1 is single
        scattering. Allowed: a whole number from 1 to 1048576.
    seed : int
        Seed of the random numbers of the integrator `path`. Allowed: a whole number from 0 to
        4294967295.
    """

    integrator: Literal["march", "reference", "path"] = "march"
    steps_zenith: int = 134
    steps_horizon: int = 320
    step_growth: float = 1.0
    coarse_step: int = 5
    sphere_tracing: float = 0.2
    empty_before_coarse: int = 6
    light_steps: int = 16
    light_group_weight: float = 0.15
    light_distance: float = 0.0
    field_cells: int = 64
    field_cell: float = 100.0
    relief_samples: int = 4
    far_sample: bool = False
    cone: float = 0.0
    light_detail_cutoff: float = 1.0
    min_transmittance: float = 0.01
    adaptive_threshold: float = 0.3
    jitter: bool = True
    tolerance: float = 0.001
    path_samples: int = 64
    path_scatterings: int = 4096
    seed: int = 0


@dataclass(frozen=True, kw_only=True, eq=False)
class Params(Root):
    """All parameters of a sky; the defaults are a fair-weather sky.

    Attributes
    ----------
    sun : Sun
        Position, irradiance and disc of the sun.
    moon : Moon
        Position, phase, irradiance and disc of the moon. Moonlight is added to sunlight: it lights
        air, clouds and ground, and casts shadows. The lit side of the disc faces the sun.
    clouds : Clouds
        The volumetric clouds (lower deck): cover, type, altitude, density and noises.
    upper_clouds : UpperClouds
        The upper deck of volumetric clouds, above `clouds`. Its weather is another region of the
        same weather map. Its noises are those of the lower deck at another scale.
    weather : Weather
        The weather map: coverage, type and precipitation by place.
    wind : Wind
        Winds that carry the base shapes, the detail and the weather map.
    wind_variation : WindVariation
        Slow variation of winds and cloud cover over hours (gems2001): the mean of four sinusoids of
        incommensurate periods, in closed form for any time.
    drift : Drift
        Displacements at 0 s, from which the present winds carry the clouds on. All are 0 until
        winds change: `Params.after`, `Keyframes` and `Renderer.animate` set them, so that a change
        of wind does not move the clouds.
    high_clouds : HighClouds
        The high clouds: a layer without thickness on a sphere of its own (nubis2015), with an
        animated texture (gems2001).
    light : Light
        Light in the clouds: light model, phase function, albedo and ambient light.
    atmosphere : Atmosphere
        The planet, its atmosphere, and the shadows of clouds on both.
    weather_mix : tuple of (Weather, float)
        Further weathers and their weights in the weather map. Each weight is from 0 to 1, their sum
        at most 1; `weather` has the rest. All weathers have the same `extent`, `edge` and
        `broad_extent`. A change of the weather is a mixture of varying weights (thesis2018): see
        `WeatherBlend` and `lerp`.
    volume : DensityGrid or None
        User-supplied extinction grid that replaces the procedural clouds, and the high clouds
        unless `high_clouds.with_volume` is True.
    """

    sun: Sun = field(default_factory=Sun)
    moon: Moon = field(default_factory=Moon)
    clouds: Clouds = field(default_factory=Clouds)
    upper_clouds: UpperClouds = field(default_factory=UpperClouds)
    weather: Weather = field(default_factory=Weather)
    wind: Wind = field(default_factory=Wind)
    wind_variation: WindVariation = field(default_factory=WindVariation)
    drift: Drift = field(default_factory=Drift)
    high_clouds: HighClouds = field(default_factory=HighClouds)
    light: Light = field(default_factory=Light)
    atmosphere: Atmosphere = field(default_factory=Atmosphere)
    weather_mix: tuple[tuple[Weather, float], ...] = ()
    volume: DensityGrid | None = None
