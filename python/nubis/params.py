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
    """The sun.

    Attributes
    ----------
    elevation : float
        Height above the horizon. Allowed: a number from -90 to 90 degrees.
    azimuth : float
        Compass direction, clockwise from north. Allowed: a number from -360 to 360 degrees.
    irradiance : tuple[float, float, float]
        Irradiance on a plane that faces the sun, above the atmosphere (linear Rec. 709). Allowed: 3
        numbers from 0 to 1000000.
    visible : bool
        Whether the sun's disc is drawn. Allowed: True or False.
    """

    elevation: float = 40.0
    azimuth: float = 120.0
    irradiance: tuple[float, float, float] = (10.0, 10.0, 10.0)
    visible: bool = True


@dataclass(frozen=True, kw_only=True, eq=False)
class Moon(Block):
    """The moon. It lights air, clouds and ground as the sun does, casts shadows, and shines
    together with it. Its bright side is toward the sun.

    Attributes
    ----------
    elevation : float
        Height above the horizon; at -90, the default, there is none. Allowed: a number from -90 to
        90 degrees.
    azimuth : float
        Compass direction, clockwise from north. Allowed: a number from -360 to 360 degrees.
    phase : float
        Age as a share of a month: 0 is new, 0.25 half, 0.5 full, 0.75 half again and 1 new. A half
        moon has a tenth of the light of a full one (Krisciunas and Schaefer 1991). Allowed: a
        number from 0 to 1.
    irradiance : tuple[float, float, float]
        Irradiance of the full moon on a plane that faces it, above the air, in the unit of
        `sun.irradiance`. The default is as much less than a sun of 10 as the magnitude of -12.73 is
        than -26.74, and as much redder as B - V = 0.92 is than 0.65 (Allen's Astrophysical
        Quantities). Allowed: 3 numbers from 0 to 1000000.
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
    """The volumetric clouds: where they are and what they are made of.

    Attributes
    ----------
    coverage : float
        How much of the sky is cloudy: shifts the weather map's coverage, 0 is clear, 0.5 the map as
        it is, 1 overcast. Allowed: a number from 0 to 1.
    type : float
        Cloud type: 0 stratus, 0.5 stratocumulus, 1 cumulus. Shifts the weather map's type, 0.5 the
        map as it is. Allowed: a number from 0 to 1.
    precipitation : float
        Rain: thickens and darkens the clouds and lets them grow to cumulonimbus (nubis2015). Scales
        the weather map's precipitation, 0 is dry. Allowed: a number from 0 to 1.
    base : float
        Altitude of the cloud base. Allowed: a number from 0 to 20000 m.
    top : float
        Altitude of the highest cloud tops where there is no rain. Allowed: a number from 1 to 25000
        m.
    cumulonimbus_top : float
        Altitude of the tops of cumulonimbus, where precipitation is 1 (nubis2015: 8 km). Allowed: a
        number from 1 to 25000 m.
    anvil : float
        How far the tops of cumulonimbus spread. Allowed: a number from 0 to 1.
    rain_extinction : float
        Extinction of the rain that is seen below the clouds where it is heaviest; 0 hides it. What
        is thinner than clean air (1e-5) evaporates before it reaches the ground. Allowed: a number
        from 0 to 1 1/m.
    extinction : float
        Extinction where the density is 1. Allowed: a number from 0 to 100000000 1/m.
    seed : int
        Which random shapes. Allowed: a whole number from 0 to 4294967295.
    noise : {nubis2015, vsu2022}
        Which noises the shapes are made of. Allowed: one of "nubis2015", "vsu2022".
    shape_scale : float
        Width of one tile of the base shape. Allowed: a number from 100 to 200000 m.
    detail_scale : float
        Width of one tile of the detail that erodes the edges. Allowed: a number from 10 to 50000 m.
    detail : float
        How deep the detail erodes the edges (nubis2015: 0.2). Allowed: a number from 0 to 1.
    fine_detail : float
        How much of a finer detail, a fifth as wide, is added to it: what shows of clouds that are
        near. 0 leaves it out (nubis2015). Allowed: a number from 0 to 1.
    curl_scale : float
        Width of one tile of the curl noise that swirls the detail. Allowed: a number from 10 to
        50000 m.
    curl : float
        How far curl noise displaces the detail at the base. Allowed: a number from 0 to 2000 m.
    stratus : tuple[float, float, float, float]
        Where the density of stratus rises from 0 to 1 and where it falls back, as fractions of its
        height (nubis2015, figure 4.10; vsu2022's gradients). Allowed: 4 numbers from 0 to 1.
    stratocumulus : tuple[float, float, float, float]
        The same for stratocumulus. Allowed: 4 numbers from 0 to 1.
    cumulus : tuple[float, float, float, float]
        The same for cumulus. Allowed: 4 numbers from 0 to 1.
    cumulonimbus : tuple[float, float, float, float]
        The same for cumulonimbus. Allowed: 4 numbers from 0 to 1.
    profile : array of float32, shape (H, W), or None
        Density by height and type in place of the first three: row 0 at the tops, column 0 type 0
        (Frostbite 2016). Allowed: None or a float array of shape (H, W), H and W from 1 to 8192,
        values from 0 to 1.
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
    """A second deck of volumetric clouds, above the first. Its weather is another part of the same
    map, and its noises are those of the first at another scale.

    Attributes
    ----------
    coverage : float
        How much of the sky it covers: as `clouds.coverage`; 0 is none. Allowed: a number from 0 to
        1.
    type : float
        Cloud type: as `clouds.type`. Allowed: a number from 0 to 1.
    base : float
        Altitude of its base. Allowed: a number from 0 to 25000 m.
    top : float
        Altitude of its tops. Allowed: a number from 1 to 25000 m.
    extinction : float
        Extinction where the density is 1. Allowed: a number from 0 to 100000000 1/m.
    scale : float
        Size of its clouds, as a share of the size of those below. Allowed: a number from 0.01 to
        100.
    direction : float
        Compass direction toward which its wind blows, clockwise from north. Allowed: a number from
        -360 to 360 degrees.
    speed : float
        Speed of that wind. Allowed: a number from -1000 to 1000 m/s.
    shear : float
        How far its tops lean downwind. Allowed: a number from -20000 to 20000 m.
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
    """The weather map: where the clouds stand.

    Attributes
    ----------
    extent : float
        Width of the square that one map covers, about the origin of the world. It lies on the
        planet in stereographic projection: true at the origin, in proportion anywhere. Allowed: a
        number from 100 to 10000000 m.
    edge : {repeat, mirror, clamp}
        What lies beyond that square: the map again, its mirror image, or what is at its edge.
        Allowed: one of "repeat", "mirror", "clamp".
    map : array of float32, shape (H, W, 3), or None
        A map of your own: coverage, type and precipitation, row 0 in the north; None bakes one from
        noise. Allowed: None or a float array of shape (H, W, 3), H and W from 1 to 8192, values
        from 0 to 1.
    noise : {worley_perlin, worley_simplex, perlin_worley}
        Which noises the map is baked from: `worley_simplex` is thesis2018's, `perlin_worley`
        vsu2022's. Allowed: one of "worley_perlin", "worley_simplex", "perlin_worley".
    seed : int
        Which random weather. Allowed: a whole number from 0 to 4294967295.
    scale : float
        Typical distance between clouds. Allowed: a number from 100 to 1000000 m.
    variety : float
        How much the cover varies over distances of several clouds. Allowed: a number from 0 to 1.
    type_variety : float
        How much the type of cloud varies from place to place; 0 makes it the same everywhere.
        Allowed: a number from 0 to 2.
    broad_variety : float
        How much a second, larger map shifts the weather, by seed or `broad_map`, so that no part of
        the sky looks like another; 0 leaves the first map as it is. From 0.3 on the baked one also
        bends it in full. It leaves a `map` of yours alone. Allowed: a number from 0 to 1.
    broad_extent : float
        Width of the square that the larger map covers; beyond it, that repeats. Allowed: a number
        from 100 to 10000000 m.
    broad_map : array of float32, shape (H, W, 3), or None
        A larger map of your own: shifts of coverage, type and precipitation, 0.5 is none. Allowed:
        None or a float array of shape (H, W, 3), H and W from 1 to 8192, values from 0 to 1.
    clear_at : tuple[float, float]
        Middle of the spot to keep clear, east and north of the origin. It stays while the weather
        drifts over it. Allowed: 2 numbers from -10000000 to 10000000 m.
    clear_radius : float
        Radius in which the spot has no cloud; the cover is back half a radius farther out. 0 keeps
        nothing clear. Allowed: a number from 0 to 10000000 m.
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
    """What moves the clouds.

    Attributes
    ----------
    direction : float
        Compass direction toward which the base shapes drift and the tops lean, clockwise from
        north. Allowed: a number from -360 to 360 degrees.
    speed : float
        Speed of the base shapes. Allowed: a number from -1000 to 1000 m/s.
    detail_direction : float
        Compass direction toward which the detail drifts. Allowed: a number from -360 to 360
        degrees.
    detail_speed : float
        Speed of the detail; the difference to the base shapes makes the edges boil. Allowed: a
        number from -1000 to 1000 m/s.
    shear : float
        How far the tops lean downwind (nubis2015: 500 m). Allowed: a number from -20000 to 20000 m.
    updraft : float
        Speed at which the noises rise. Allowed: a number from -100 to 100 m/s.
    weather_direction : float
        Compass direction toward which the weather map drifts. Allowed: a number from -360 to 360
        degrees.
    weather_speed : float
        Speed of the weather map; 0 keeps a composed sky in place while its shapes evolve
        (thesis2018). Allowed: a number from -1000 to 1000 m/s.
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
class Wander(Block):
    """Winds and cover that wander over hours (gems2001): four slow turns of unlike periods, in
    closed form, so that any time can be asked for.

    Attributes
    ----------
    wind : float
        By how much the winds wander, as a share of their speed, in speed and direction: at 0.5 a
        wind blows at a half to one and a half times its speed, within 30 degrees of its direction.
        All winds wander alike; what leans keeps leaning as it does. Allowed: a number from 0 to 1.
    coverage : float
        By how much `clouds.coverage` wanders up and down, within 0 to 1. Allowed: a number from 0
        to 1.
    period : float
        How long a swing takes, about. Allowed: a number from 60 to 100000000 s.
    seed : int
        Which random swings. Allowed: a whole number from 0 to 4294967295.
    """

    wind: float = 0.0
    coverage: float = 0.0
    period: float = 7200.0
    seed: int = 11


@dataclass(frozen=True, kw_only=True, eq=False)
class Drift(Block):
    """Where things are at 0 s, as the winds of now would have it. All 0, unless the winds have
    changed on the way: `Params.after`, `Keyframes` and `Renderer.animate` set it, so that the sky
    goes on from where it is.

    Attributes
    ----------
    shape : tuple[float, float]
        How far the base shapes are carried, east and north. Allowed: 2 numbers from -1000000000000
        to 1000000000000 m.
    detail : tuple[float, float]
        The detail. Allowed: 2 numbers from -1000000000000 to 1000000000000 m.
    weather : tuple[float, float]
        The weather map. Allowed: 2 numbers from -1000000000000 to 1000000000000 m.
    upper : tuple[float, float]
        The upper deck, its weather with its shapes. Allowed: 2 numbers from -1000000000000 to
        1000000000000 m.
    upper_detail : tuple[float, float]
        The detail of the upper deck. Allowed: 2 numbers from -1000000000000 to 1000000000000 m.
    high : tuple[float, float]
        The high clouds, along `high_clouds.direction` and to the left of it. Allowed: 2 numbers
        from -1000000000000 to 1000000000000 m.
    rise : float
        How far the updraft has raised the noises. Allowed: a number from -1000000000000 to
        1000000000000 m.
    evolution : float
        How often the largest shapes of the high clouds have been replaced
        (`high_clouds.evolution`). Allowed: a number from -1000000000000 to 1000000000000.
    swings : float
        How many times `wander.period` the wander is ahead. Allowed: a number from -1000000000000 to
        1000000000000.
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
    """The thin high clouds, a layer without thickness on its own sphere (nubis2015; animated as in
    gems2001).

    Attributes
    ----------
    coverage : float
        How much of the sky they cover: 0 is clear, 1 overcast. Allowed: a number from 0 to 1.
    with_volume : bool
        Whether they are there with a `volume` too, which is otherwise all the cloud that there is.
        Allowed: True or False.
    type : float
        Cloud type: 0 cirrus in streaks, 1 altocumulus in cells, and between them both, here more of
        one, there of the other. Allowed: a number from 0 to 1.
    altitude : float
        Altitude of the layer. Allowed: a number from 100 to 30000 m.
    optical_depth : float
        Optical depth, seen from straight below, where they are thickest. Allowed: a number from 0
        to 100.
    scale : float
        Width of one tile of the texture. Allowed: a number from 1000 to 1000000 m.
    curve : {exponential, clamp}
        How thickness grows with what rises above the cover. Allowed: one of "exponential", "clamp".
    emboss : float
        How strongly the flanks toward the sun are bright and those away from it dark (gems2001).
        Allowed: a number from 0 to 1.
    stretch : float
        How much longer than wide the streaks are, along the wind; cells are stretched by its square
        root, across it. Allowed: a number from 1 to 16.
    direction : float
        Compass direction toward which they drift; the streaks lie along it. Allowed: a number from
        -360 to 360 degrees.
    speed : float
        Speed at which they drift. Allowed: a number from -1000 to 1000 m/s.
    evolution : float
        How often the largest shapes are replaced by new ones; each octave after it twice as often.
        Allowed: a number from 0 to 10 1/s.
    octaves : int
        Octaves of noise. Allowed: a whole number from 1 to 8.
    seed : int
        Which random shapes. Allowed: a whole number from 0 to 4294967295.
    texture_size : int
        Width and height of the texture. Allowed: a whole number from 16 to 4096 texels.
    """

    coverage: float = 0.5
    with_volume: bool = False
    type: float = 0.0
    altitude: float = 8500.0
    optical_depth: float = 0.5
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
    """How light becomes colour.

    Attributes
    ----------
    model : {single, nubis2015, thesis2018, vsu2022, octaves, path}
        The physics of the light in the clouds. Allowed: one of "single", "nubis2015", "thesis2018",
        "vsu2022", "octaves", "path".
    phase : {henyey_greenstein, droplet, mie}
        The phase function: `henyey_greenstein` of `g` (in thesis2018 and vsu2022 of `g_back`, too)
        as published; `droplet` a fit of real droplets, whose clouds have a silver lining (Jendersie
        and d'Eon 2023); `mie` the droplets themselves, with fogbow and glory. Half of what those
        scatter goes on within a few degrees: `path` then takes many times the samples. Allowed: one
        of "henyey_greenstein", "droplet", "mie".
    droplet_diameter : float
        Diameter of the droplets (`droplet`, `mie`): fog 5 to 20, cumulus 10 to 30, drizzle 50.
        Allowed: a number from 5 to 50 µm.
    g : float
        Mean cosine of the forward lobe of the phase function. Allowed: a number from -0.9999 to
        0.9999.
    g_back : float
        Mean cosine of the backward lobe (thesis2018, vsu2022). Allowed: a number from -0.9999 to
        0.9999.
    lobe_mix : float
        Share of the forward lobe (vsu2022). Allowed: a number from 0 to 1.
    albedo : float
        Single-scattering albedo of a droplet (`single`, `octaves`, `path`). Allowed: a number from
        0 to 1.
    octaves : int
        Orders of scattering that `octaves` sums up. Allowed: a whole number from 1 to 16.
    octave_scattering : float
        Share of the light that each octave keeps of the one before. This and the next two are
        fitted to `path` for three octaves (docs/accuracy.md); 0.5 is usual. Allowed: a number from
        0 to 1.
    octave_extinction : float
        Share of the extinction toward the sun that each octave keeps of the one before. Allowed: a
        number from 0 to 1.
    octave_phase : float
        Share of `g` that each octave keeps of the one before (of each lobe's, where the phase
        function is `droplet` or `mie`). Allowed: a number from 0 to 1.
    sun_gain : float
        Gain of the sunlight in the published models, which do not conserve energy. Allowed: a
        number from 0 to 1000.
    absorption : float
        How thick the published models take the cloud to be on the way to the sun. Allowed: a number
        from 0 to 10.
    ambient : tuple[float, float, float]
        Radiance that reaches the clouds from every direction, besides that of sun and sky (all but
        `single`). Allowed: 3 numbers from 0 to 1000000.
    ambient_gain : float
        Gain of the ambient light of the sky (all but `single`). Allowed: a number from 0 to 1000.
    ambient_top : tuple[float, float, float]
        Tint of the ambient light at the top of the clouds; its brightness comes from the sky.
        Allowed: 3 numbers from 0 to 1000.
    ambient_bottom : tuple[float, float, float]
        Tint of the ambient light at the base of the clouds; its brightness comes from sky and
        ground. Allowed: 3 numbers from 0 to 1000.
    ambient_occlusion : float
        How much clouds hide sky and ground from themselves: 1 shares the ambient light by their
        optical depth above and below, 0 by height alone, as the published models do. Allowed: a
        number from 0 to 1.
    powder : float
        How strongly thin edges darken ("powdered sugar", nubis2015); 0 switches it off. Allowed: a
        number from 0 to 1.
    rain_absorption : float
        How many times more light is absorbed where precipitation is 1 (nubis2015). Allowed: a
        number from 1 to 100.
    """

    model: Literal["single", "nubis2015", "thesis2018", "vsu2022", "octaves", "path"] = "octaves"
    phase: Literal["henyey_greenstein", "droplet", "mie"] = "henyey_greenstein"
    droplet_diameter: float = 20.0
    g: float = 0.6
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
    """The planet and its air.

    Attributes
    ----------
    enabled : bool
        Whether there is air; without it the sky is black, day and night, and sunlight arrives
        undimmed. Allowed: True or False.
    planet_radius : float
        Radius of the planet (Earth 6 371 000, thesis2018 400 000). Allowed: a number from 10000 to
        1000000000 m.
    haze : float
        Haze: amount of aerosol. Each unit is an optical depth of 0.0053 straight up from the
        ground, at 550 nm as at all wavelengths: 1 is air as clear as over the Antarctic, 10 to 20 a
        clear day (0.05 to 0.1), 94 thick haze (0.5). Allowed: a number from 0 to 100.
    aerial_perspective : float
        How much air stands between the eye and the clouds: 1 is physical, 0 none. Allowed: a number
        from 0 to 10.
    ground_shadows : bool
        Whether clouds cast shadows on the ground that is seen. Allowed: True or False.
    beams : bool
        Whether clouds cast shadows on the air: crepuscular rays. Allowed: True or False.
    ground_albedo : tuple[float, float, float]
        Albedo of the ground. Allowed: 3 numbers from 0 to 1.
    night : tuple[float, float, float]
        Radiance of the night's own light above the air, airglow and stars, which is there by day
        too: 20.9, 21.6 and 22.6 magnitudes a square arcsecond in R, V and B (Patat 2003) beside a
        sun of 10 and of -27.1, -26.74 and -26.09. Allowed: 3 numbers from 0 to 1000000.
    """

    enabled: bool = True
    planet_radius: float = 6371000.0
    haze: float = 1.0
    aerial_perspective: float = 1.0
    ground_shadows: bool = True
    beams: bool = True
    ground_albedo: tuple[float, float, float] = (0.1, 0.12, 0.07)
    night: tuple[float, float, float] = (0.000000027, 0.00000002, 0.000000014)


@dataclass(frozen=True, kw_only=True, eq=False)
class Quality(Block):
    """The numerical method: how accurately a sky is computed, never how it looks.

    Attributes
    ----------
    steps_zenith : int
        View steps straight up. Allowed: a whole number from 1 to 4096.
    steps_horizon : int
        View steps toward the horizon. Allowed: a whole number from 1 to 4096.
    step_growth : float
        How much steps grow with distance: 0 makes all of a ray's steps equal, 1 lets a step be a
        fixed share of its distance. Allowed: a number from 0 to 1.
    big_step : int
        How many steps one step outside cloud is long; on a hit the march goes back. Allowed: a
        whole number from 1 to 16.
    leap : float
        How far a ray may leap through clear air, beyond `big_step`: as a share of
        `clouds.shape_scale` (of `weather.scale` or two and a half pixels of `weather.map`, if that
        is less) for each unit that the base shape lacks of being cloud. On a hit the march goes
        back. 0 leaps no farther than `big_step`; none does where that is 1, in grids and in rain.
        Allowed: a number from 0 to 1.
    empty_samples : int
        Full samples of zero in a row after which samples are cheap again (nubis2015: 6). Allowed: a
        whole number from 1 to 4096.
    light_steps : int
        Light samples toward the sun, besides the far one. Where they spread to the end of the
        clouds, there is a third more for a second deck above the point. Allowed: a whole number
        from 1 to 128.
    light_share : float
        Share of a pixel's cloud that is lit as one, by the light samples of one place in it:
        samples in a row are lit together once they have gathered more. 0 lights each sample by
        itself. Allowed: a number from 0 to 1.
    light_distance : float
        How far the light samples reach; 0 spreads them to where the clouds end. Allowed: a number
        from 0 to 100000 m.
    far_sample : bool
        Whether there is one more light sample, at three times that reach, for shadows from distant
        clouds (nubis2015). Allowed: True or False.
    cone : float
        Half width of the cone that the light samples are spread over, as a share of its length
        (nubis2015); 0 looks straight at the sun. Allowed: a number from 0 to 1.
    cheap_light : float
        Opacity in front of a sample past which its light samples leave out the detail (nubis2015:
        0.3). Of those that spread to the end of the clouds, the ones that stand for most of a tile
        of the detail leave it out always. Allowed: a number from 0 to 1.
    min_transmittance : float
        Transmittance at which a ray ends; what is left is scaled away, not lost. Allowed: a number
        from 0 to 0.5.
    contrast : float
        Largest contrast between neighbouring rays, past which the pixels between them get rays of
        their own. Of pixels less than an eighth of a degree wide one in sixteen is marched first,
        of a quarter one in four, of wider ones every one; 0 marches every one of any width, and 1
        none but those, so that an animation follows those alone. What is behind the clouds, sky,
        ground and high clouds seen from below, is then worked out at every fourth of the narrowest
        pixels, and where it bends by a tenth of this, at edges too; 0 works out every one. Allowed:
        a number from 0 to 1.
    jitter : bool
        Whether each ray starts at a blue-noise offset of up to one step. Allowed: True or False.
    tolerance : float
        Largest relative change of a pixel when all steps are halved; they are until it is met. It
        replaces everything above by an integration that converges, and sun rays go to the end of
        the clouds; 0 marches with the settings above. Allowed: a number from 0 to 1.
    path_samples : int
        Paths traced for each pixel (light model `path`). Allowed: a whole number from 2 to 1048576.
    path_scatterings : int
        Most scatterings of a path (light model `path`); 1 is single scattering. Allowed: a whole
        number from 1 to 1048576.
    """

    steps_zenith: int = 134
    steps_horizon: int = 320
    step_growth: float = 1.0
    big_step: int = 5
    leap: float = 0.2
    empty_samples: int = 6
    light_steps: int = 16
    light_share: float = 0.15
    light_distance: float = 0.0
    far_sample: bool = False
    cone: float = 0.0
    cheap_light: float = 1.0
    min_transmittance: float = 0.01
    contrast: float = 0.3
    jitter: bool = True
    tolerance: float = 0.0
    path_samples: int = 64
    path_scatterings: int = 4096


@dataclass(frozen=True, kw_only=True, eq=False)
class Params(Root):
    """Everything that a sky looks like; the defaults are a fair-weather sky.

    Attributes
    ----------
    sun : Sun
        The sun.
    moon : Moon
        The moon. It lights air, clouds and ground as the sun does, casts shadows, and shines
        together with it. Its bright side is toward the sun.
    clouds : Clouds
        The volumetric clouds: where they are and what they are made of.
    upper_clouds : UpperClouds
        A second deck of volumetric clouds, above the first. Its weather is another part of the same
        map, and its noises are those of the first at another scale.
    weather : Weather
        The weather map: where the clouds stand.
    wind : Wind
        What moves the clouds.
    wander : Wander
        Winds and cover that wander over hours (gems2001): four slow turns of unlike periods, in
        closed form, so that any time can be asked for.
    drift : Drift
        Where things are at 0 s, as the winds of now would have it. All 0, unless the winds have
        changed on the way: `Params.after`, `Keyframes` and `Renderer.animate` set it, so that the
        sky goes on from where it is.
    high_clouds : HighClouds
        The thin high clouds, a layer without thickness on its own sphere (nubis2015; animated as in
        gems2001).
    light : Light
        How light becomes colour.
    atmosphere : Atmosphere
        The planet and its air.
    weather_mix : tuple of (Weather, float)
        Other weathers and their shares of the weather map: each from 0 to 1, together 1 at most;
        the rest is that of `weather`. All have the same `extent` and `edge`. Weathers change by it
        (thesis2018): see `WeatherBlend` and `lerp`.
    volume : DensityGrid or None
        A cloud of your own in place of all others: high clouds come with it where
        `high_clouds.with_volume` is True.
    """

    sun: Sun = field(default_factory=Sun)
    moon: Moon = field(default_factory=Moon)
    clouds: Clouds = field(default_factory=Clouds)
    upper_clouds: UpperClouds = field(default_factory=UpperClouds)
    weather: Weather = field(default_factory=Weather)
    wind: Wind = field(default_factory=Wind)
    wander: Wander = field(default_factory=Wander)
    drift: Drift = field(default_factory=Drift)
    high_clouds: HighClouds = field(default_factory=HighClouds)
    light: Light = field(default_factory=Light)
    atmosphere: Atmosphere = field(default_factory=Atmosphere)
    weather_mix: tuple[tuple[Weather, float], ...] = ()
    volume: DensityGrid | None = None
