//! Every parameter, once. A line here reaches Rust, WGSL, the Python dataclasses and the manual.
//!
//! What a sky looks like is in [`Params`]; how it is computed is in [`Quality`], which never changes the look. The
//! sources are named as in `docs/sources.md`: nubis2015, thesis2018, vsu2022, gems2001.

use std::borrow::Cow;
use std::sync::Arc;

use crate::error::{Error, Result};
use crate::schema::{self, Block, Map, Table, Typed as _};
use crate::shared::constants;
use crate::volume::DensityGrid;
use crate::{choice, params};

choice! {
    /// Noises of the base shape and the detail.
    Noise {
        /// Base shape: Perlin-Worley noise and three octaves of Worley FBM. Detail: Worley FBM (nubis2015).
        Nubis2015 = "nubis2015",
        /// Perlin-Worley noise of rising frequency in every channel (vsu2022).
        Vsu2022 = "vsu2022",
    }
}

choice! {
    /// Mapping from the texture of the high clouds to optical depth.
    Curve {
        /// Exponential saturation: soft edges and even cores (gems2001's "condensation").
        Exponential = "exponential",
        /// Linear above a threshold, up to a maximum (gems2001: subtract and clamp).
        Clamp = "clamp",
    }
}

choice! {
    /// Fields of cloud density.
    Field {
        /// Published: the base shape, eroded by detail.
        Eroded = "eroded",
        /// Heaps and layers with relief and narrow edges.
        Heaped = "heaped",
    }
}

choice! {
    /// Noises of the baked weather map.
    WeatherNoise {
        /// Sum of Worley and Perlin noise.
        WorleyPerlin = "worley_perlin",
        /// Product of Worley and simplex noise (thesis2018).
        WorleySimplex = "worley_simplex",
        /// Perlin-Worley noise (vsu2022).
        PerlinWorley = "perlin_worley",
    }
}

choice! {
    /// Addressing of the weather map beyond its edge.
    Edge {
        /// Repeats the map.
        Repeat = "repeat",
        /// Repeats the map, mirrored in every other tile.
        Mirror = "mirror",
        /// Extends the texels of the edge.
        Clamp = "clamp",
    }
}

choice! {
    /// Light model: the radiance that a cloud scatters toward the camera.
    Model {
        /// Physical single scattering alone.
        Single = "single",
        /// Beer's law, times powder, times Henyey-Greenstein, times 2, plus ambient light.
        Nubis2015 = "nubis2015",
        /// Beer's law with a slower second term, the larger of two lobes, powder, and ambient light.
        Thesis2018 = "thesis2018",
        /// `nubis2015` with a blend of two lobes.
        Vsu2022 = "vsu2022",
        /// Approximation of multiple scattering: a sum of octaves of single scattering, each with less extinction and
        /// less anisotropy than the one before (Wrenninge et al. 2013, Hillaire 2016), plus ambient light.
        Octaves = "octaves",
        /// Every order of scattering, from a light field that is solved on nested levels of cells.
        Multiple = "multiple",
        /// Path tracing of every order of scattering: slow and noisy. It is the reference of the other models.
        Path = "path",
    }
}

choice! {
    /// Integrator of the radiative transfer equation in the clouds.
    Integrator {
        /// Ray march with the step counts of the quality.
        March = "march",
        /// Ray march whose steps are halved until no pixel changes by more than `tolerance`.
        Reference = "reference",
        /// Path tracing of every order of scattering, unbiased and with noise.
        Path = "path",
    }
}

choice! {
    /// Phase function of the cloud droplets.
    Phase {
        /// Henyey-Greenstein with `g` (and `g_back` in thesis2018 and vsu2022), as in the published models.
        HenyeyGreenstein = "henyey_greenstein",
        /// Fit to Mie scattering by cloud droplets (Jendersie and d'Eon 2023): forward peak, no fogbow, no glory.
        Droplet = "droplet",
        /// Mie scattering by cloud droplets, tabulated: with fogbow and glory.
        Mie = "mie",
    }
}

params! {
    /// Position, irradiance and disc of the sun.
    Sun {
        /// Elevation above the horizon, geometric (without refraction).
        elevation: f32 = 40.0, in -90..=90 "degrees";
        /// Azimuth, clockwise from north.
        azimuth: f32 = 120.0, in -360..=360 "degrees";
        /// Irradiance above the atmosphere on a plane that faces the sun (linear, Rec. 709 primaries). Its unit, per
        /// steradian, is the unit of the picture (docs/units.md).
        irradiance: [f32; 3] = [10.0, 10.0, 10.0], in 0..=1000000 "";
        /// Whether the sun's disc is drawn.
        visible: bool = true;
    }

    /// Position, phase, irradiance and disc of the moon. Moonlight is added to sunlight: it lights air, clouds and
    /// ground, and casts shadows. The lit side of the disc faces the sun.
    Moon {
        /// Elevation above the horizon. -90, the default, switches the moon off.
        elevation: f32 = -90.0, in -90..=90 "degrees";
        /// Azimuth, clockwise from north.
        azimuth: f32 = 180.0, in -360..=360 "degrees";
        /// Age as a fraction of the lunar month: 0 is new moon, 0.25 first quarter, 0.5 full moon, 0.75 last quarter,
        /// 1 new moon. The irradiance of a half moon is a tenth of that of a full moon (Krisciunas and Schaefer
        /// 1991).
        phase: f32 = 0.5, in 0..=1 "";
        /// Irradiance of the full moon above the atmosphere on a plane that faces the moon, in the unit of
        /// `sun.irradiance`. The default corresponds to a sun of 10: its brightness follows from apparent magnitudes
        /// of -12.73 (moon) and -26.74 (sun), its colour from B - V of 0.92 (moon) and 0.65 (sun; Allen's
        /// Astrophysical Quantities).
        irradiance: [f32; 3] = [2.7e-5, 2.5e-5, 2.0e-5], in 0..=1000000 "";
        /// Whether the moon's disc is drawn.
        visible: bool = true;
    }

    /// The volumetric clouds (lower deck): cover, type, altitude, density and noises.
    Clouds {
        /// Cloud cover: an offset of `2 * coverage - 1` to the coverage of the weather map. 0 is a clear sky, 0.5
        /// leaves the map unchanged, 1 is overcast.
        coverage: f32 = 0.45, in 0..=1 "";
        /// Cloud type: an offset of `2 * type - 1` to the type of the weather map, in which 0 is stratus, 0.5
        /// stratocumulus and 1 cumulus. 0.5 leaves the map unchanged.
        r#type: f32 = 0.85, in 0..=1 "";
        /// Precipitation: a factor on the precipitation of the weather map; 0 is dry. Precipitation thickens and
        /// darkens clouds and makes cumulus grow into cumulonimbus (nubis2015).
        precipitation: f32 = 0.0, in 0..=1 "";
        /// Altitude of the cloud base.
        base: f32 = 1200.0, in 0..=20000 "m";
        /// Altitude of the highest cloud tops without precipitation.
        top: f32 = 3200.0, in 1..=25000 "m";
        /// Altitude of the tops of cumulonimbus, where precipitation is 1 (nubis2015: 8 km).
        cumulonimbus_top: f32 = 8000.0, in 1..=25000 "m";
        /// Horizontal extent of the anvils at the tops of cumulonimbus.
        anvil: f32 = 0.5, in 0..=1 "";
        /// Extinction of the rain below the clouds at the heaviest precipitation; 0 hides the rain. Rain with less
        /// extinction than clean air (1e-5) evaporates before it reaches the ground.
        rain_extinction: f32 = 0.0, in 0..=1 "1/m";
        /// Extinction at density 1.
        extinction: f32 = 0.2, in 0..=100000000 "1/m";
        /// Random seed of the noises.
        seed: u32 = 1, in 0..=4294967295.0 "";
        /// Field of cloud density. `eroded`: Perlin-Worley noise times the height profile, eroded by detail
        /// (nubis2015). `heaped`: a shape that behaves like a distance, with lifted bases, relief of billows and
        /// narrow edges; `extinction` is that of a core, 0.05 to 0.1.
        field: Field = Field::Eroded;
        /// Noises of base shape and detail of the field `eroded`. `nubis2015`: Perlin-Worley noise and three octaves of Worley FBM for the
        /// base shape, Worley FBM for the detail. `vsu2022`: Perlin-Worley noise of rising frequency in every
        /// channel.
        noise: Noise = Noise::Nubis2015;
        /// Tile width of the base-shape noise.
        shape_scale: f32 = 5200.0, in 100..=200000 "m";
        /// Tile width of the detail noise, which erodes the edges.
        detail_scale: f32 = 420.0, in 10..=50000 "m";
        /// Depth of the erosion by the detail noise (nubis2015: 0.2).
        detail: f32 = 0.2, in 0..=1 "";
        /// Weight of a finer detail noise, a fifth as wide, that is added to the detail noise. It is visible in near
        /// clouds. 0 leaves it out (nubis2015).
        fine_detail: f32 = 0.6, in 0..=1 "";
        /// Tile width of the curl noise, which distorts the detail noise.
        curl_scale: f32 = 1600.0, in 10..=50000 "m";
        /// Displacement of the detail noise by the curl noise at the cloud base. It falls to 0 at the cloud top.
        curl: f32 = 70.0, in 0..=2000 "m";
        /// Height profile of stratus: the fractions of the height at which the density starts to rise from 0, reaches
        /// 1, starts to fall, and reaches 0 (nubis2015, figure 4.10; vsu2022's gradients).
        stratus: [f32; 4] = [0.02, 0.05, 0.09, 0.11], in 0..=1 "";
        /// Height profile of stratocumulus, as four fractions of the height in the order of `stratus`.
        stratocumulus: [f32; 4] = [0.02, 0.12, 0.35, 0.60], in 0..=1 "";
        /// Height profile of cumulus, as four fractions of the height in the order of `stratus`.
        cumulus: [f32; 4] = [0.01, 0.07, 0.25, 1.0], in 0..=1 "";
        /// Height profile of cumulonimbus, as four fractions of the height in the order of `stratus`.
        cumulonimbus: [f32; 4] = [0.005, 0.04, 0.8, 1.0], in 0..=1 "";
        /// Table of density by height and type that replaces `stratus`, `stratocumulus` and `cumulus`: row 0 is the
        /// top of the clouds, the last row their base, column 0 type 0, the last column type 1 (Frostbite 2016).
        profile: Option<Table> = None, in 0..=1 "";
    }

    /// The upper deck of volumetric clouds, above `clouds`. Its weather is another region of the same weather map.
    /// Its noises are those of the lower deck at another scale.
    UpperClouds {
        /// Cloud cover of the upper deck, in the scale of `clouds.coverage`; 0 switches the deck off.
        coverage: f32 = 0.0, in 0..=1 "";
        /// Cloud type of the upper deck, in the scale of `clouds.type`.
        r#type: f32 = 0.5, in 0..=1 "";
        /// Altitude of the base of the upper deck: at or above `clouds.top` unless `coverage` is 0.
        base: f32 = 4800.0, in 0..=25000 "m";
        /// Altitude of the tops of the upper deck.
        top: f32 = 5600.0, in 1..=25000 "m";
        /// Extinction of the upper deck at density 1.
        extinction: f32 = 0.06, in 0..=100000000 "1/m";
        /// Size of the clouds of the upper deck, as a factor on the size of those of the lower deck.
        scale: f32 = 0.4, in 0.01..=100 "";
        /// Compass direction toward which the upper deck drifts, clockwise from north.
        direction: f32 = 95.0, in -360..=360 "degrees";
        /// Wind speed of the upper deck.
        speed: f32 = 16.0, in -1000..=1000 "m/s";
        /// Downwind displacement of the tops of the upper deck against its base.
        shear: f32 = 150.0, in -20000..=20000 "m";
    }

    /// The weather map: coverage, type and precipitation by place.
    Weather {
        /// Side of the square that the weather map covers, centred on the origin of the world. The map lies on the
        /// planet in stereographic projection: true to scale at the origin, conformal everywhere.
        extent: f32 = 60000.0, in 100..=10000000 "m";
        /// Addressing beyond the edge of the map: `repeat`, `mirror` (every other tile is mirrored) or `clamp`
        /// (extends the texels of the edge).
        edge: Edge = Edge::Repeat;
        /// User-supplied weather map: coverage, type and precipitation; row 0 is in the north, column 0 in the west.
        /// None bakes a map from noise.
        map: Option<Arc<Map>> = None, in 0..=1 "";
        /// Noises of the baked map: `worley_perlin` is a sum of Worley and Perlin noise, `worley_simplex` a product
        /// of Worley and simplex noise (thesis2018), `perlin_worley` Perlin-Worley noise (vsu2022).
        noise: WeatherNoise = WeatherNoise::WorleyPerlin;
        /// Random seed of the baked maps.
        seed: u32 = 7, in 0..=4294967295.0 "";
        /// Typical distance between the clouds of the baked map.
        scale: f32 = 5000.0, in 100..=1000000 "m";
        /// Amplitude of the variation of cloud cover over distances of several clouds, in the baked map.
        variety: f32 = 0.5, in 0..=1 "";
        /// Amplitude of the variation of cloud type in the baked map; 0 makes the type uniform.
        type_variety: f32 = 0.9, in 0..=2 "";
        /// Amplitude of the larger weather map, which offsets coverage, type and precipitation and hides the
        /// repetition of the smaller map. The larger map is `broad_map`, or is baked from `seed`. A baked larger map
        /// also distorts the smaller map, in full from 0.3 on. 0 switches the larger map off. A user-supplied `map`
        /// without a `broad_map` is not changed.
        broad_variety: f32 = 0.3, in 0..=1 "";
        /// Side of the square that the larger map covers. The larger map repeats beyond it.
        broad_extent: f32 = 430000.0, in 100..=10000000 "m";
        /// User-supplied larger map: offsets of coverage, type and precipitation, 0.5 for no offset. None bakes one
        /// from noise, unless `map` is set.
        broad_map: Option<Arc<Map>> = None, in 0..=1 "";
        /// Centre of the region that is kept clear of clouds, east and north of the origin. The region is fixed in
        /// the world while the weather drifts.
        clear_at: [f32; 2] = [0.0, 0.0], in -10000000..=10000000 "m";
        /// Radius of the region without clouds. Cloud cover is back to full at 1.5 times the radius. 0 switches the
        /// region off.
        clear_radius: f32 = 0.0, in 0..=10000000 "m";
    }

    /// Winds that carry the base shapes, the detail and the weather map.
    Wind {
        /// Compass direction toward which the base shapes drift and the tops are sheared, clockwise from north.
        direction: f32 = 60.0, in -360..=360 "degrees";
        /// Speed of the base shapes.
        speed: f32 = 8.0, in -1000..=1000 "m/s";
        /// Compass direction toward which the detail drifts, clockwise from north.
        detail_direction: f32 = 60.0, in -360..=360 "degrees";
        /// Speed of the detail. The velocity of the detail relative to the base shapes makes the edges evolve.
        detail_speed: f32 = 11.0, in -1000..=1000 "m/s";
        /// Downwind displacement of the cloud tops against the cloud base (nubis2015: 500 m).
        shear: f32 = 400.0, in -20000..=20000 "m";
        /// Upward speed of the noises.
        updraft: f32 = 0.8, in -100..=100 "m/s";
        /// Compass direction toward which the weather map drifts, clockwise from north.
        weather_direction: f32 = 60.0, in -360..=360 "degrees";
        /// Speed of the weather map. 0 keeps a composed sky in place while the shapes of its clouds evolve
        /// (thesis2018).
        weather_speed: f32 = 8.0, in -1000..=1000 "m/s";
    }

    /// Slow variation of winds and cloud cover over hours (gems2001): the mean of four sinusoids of incommensurate
    /// periods, in closed form for any time.
    WindVariation {
        /// Amplitude of the variation of all winds in speed and direction, as a fraction of their speed: at 0.5 a
        /// wind blows at 0.5 to 1.5 times its speed and within 30 degrees of its direction. All winds vary alike.
        /// Wind shear does not vary.
        wind: f32 = 0.0, in 0..=1 "";
        /// Amplitude of the variation of `clouds.coverage`. The result is clamped to the range from 0 to 1.
        coverage: f32 = 0.0, in 0..=1 "";
        /// Typical period of the variation.
        period: f32 = 7200.0, in 60..=100000000 "s";
        /// Random seed of the phases.
        seed: u32 = 11, in 0..=4294967295.0 "";
    }

    /// Displacements at 0 s, from which the present winds carry the clouds on. All are 0 until winds change:
    /// `Params.after`, `Keyframes` and `Renderer.animate` set them, so that a change of wind does not move the
    /// clouds.
    Drift {
        /// Displacement of the base shapes, east and north.
        shape: [f64; 2] = [0.0, 0.0], in -1000000000000.0..=1000000000000.0 "m";
        /// Displacement of the detail, east and north.
        detail: [f64; 2] = [0.0, 0.0], in -1000000000000.0..=1000000000000.0 "m";
        /// Displacement of the weather map, east and north.
        weather: [f64; 2] = [0.0, 0.0], in -1000000000000.0..=1000000000000.0 "m";
        /// Displacement of the upper deck (shapes and weather), east and north.
        upper: [f64; 2] = [0.0, 0.0], in -1000000000000.0..=1000000000000.0 "m";
        /// Displacement of the detail of the upper deck, east and north.
        upper_detail: [f64; 2] = [0.0, 0.0], in -1000000000000.0..=1000000000000.0 "m";
        /// Displacement of the high clouds, along `high_clouds.direction` and to its left.
        high: [f64; 2] = [0.0, 0.0], in -1000000000000.0..=1000000000000.0 "m";
        /// Upward displacement of the noises by the updraft.
        rise: f64 = 0.0, in -1000000000000.0..=1000000000000.0 "m";
        /// Number of replacements of the largest octave of the high clouds (`high_clouds.evolution`).
        evolution: f64 = 0.0, in -1000000000000.0..=1000000000000.0 "";
        /// Time offset of the wander, in units of `wander.period`.
        swings: f64 = 0.0, in -1000000000000.0..=1000000000000.0 "";
    }

    /// The high clouds: a layer without thickness on a sphere of its own (nubis2015), with an animated texture
    /// (gems2001).
    HighClouds {
        /// Cover of the high clouds: 0 is clear, 1 overcast.
        coverage: f32 = 0.5, in 0..=1 "";
        /// Whether high clouds are drawn together with a `volume`, which otherwise replaces all clouds.
        with_volume: bool = false;
        /// Type of the high clouds: 0 is streaks of cirrus, 1 cells of altocumulus. Values between mix both, in
        /// proportions that vary from place to place.
        r#type: f32 = 0.0, in 0..=1 "";
        /// Altitude of the layer.
        altitude: f32 = 8500.0, in 100..=30000 "m";
        /// Vertical optical depth of the layer where it is thickest.
        optical_depth: f32 = 1.0, in 0..=100 "";
        /// Tile width of the texture.
        scale: f32 = 42000.0, in 1000..=1000000 "m";
        /// Mapping from texture to optical depth: `exponential` saturates and has soft edges and even cores
        /// (gems2001's condensation), `clamp` is linear above a threshold, up to a maximum (gems2001: subtract and
        /// clamp).
        curve: Curve = Curve::Exponential;
        /// Strength of the emboss: flanks toward the sun are brightened, flanks away from it darkened (gems2001).
        emboss: f32 = 0.0, in 0..=1 "";
        /// Ratio of length to width of the streaks, along the wind. Cells are stretched by its square root, across
        /// it.
        stretch: f32 = 3.0, in 1..=16 "";
        /// Compass direction toward which the high clouds drift, clockwise from north. The streaks lie along it.
        direction: f32 = 75.0, in -360..=360 "degrees";
        /// Speed of the high clouds.
        speed: f32 = 25.0, in -1000..=1000 "m/s";
        /// Rate at which the largest octave of the texture is replaced by new noise. Each further octave is replaced
        /// twice as often as the one before.
        evolution: f32 = 0.001, in 0..=10 "1/s";
        /// Number of octaves of the texture.
        octaves: u32 = 5, in 1..=8 "";
        /// Random seed of the texture.
        seed: u32 = 3, in 0..=4294967295.0 "";
        /// Width and height of the texture.
        texture_size: u32 = 512, in 16..=4096 "texels";
    }

    /// Light in the clouds: light model, phase function, albedo and ambient light.
    Light {
        /// Light model. `single` is physical single scattering. `nubis2015`, `thesis2018` and `vsu2022` are the
        /// published models. `octaves` approximates multiple scattering (Wrenninge et al. 2013, Hillaire 2016).
        /// `multiple` has every order of scattering, from a light field that is solved for the clouds.
        /// `path` traces paths of every order of scattering and is the reference of the others.
        model: Model = Model::Multiple;
        /// Phase function. `henyey_greenstein` has the parameter `g` (in thesis2018 and vsu2022 `g_back`, too), as
        /// published. `droplet` is a fit to cloud droplets, which gives clouds a silver lining (Jendersie and d'Eon
        /// 2023). `mie` is Mie scattering by droplets, with fogbow and glory. `droplet` and `mie` scatter half of the
        /// light by less than a few degrees, so that `path` needs many times the samples.
        phase: Phase = Phase::HenyeyGreenstein;
        /// Diameter of the droplets for `droplet` and `mie`: fog 5 to 20, cumulus 10 to 30, drizzle 50.
        droplet_diameter: f32 = 20.0, in 5..=50 "µm";
        /// Asymmetry parameter (mean cosine) of the forward lobe of the phase function: 0.85 for droplets. `octaves` is
        /// fitted for 0.6, which suits the published models, too.
        g: f32 = 0.85, in -0.9999..=0.9999 "";
        /// Asymmetry parameter (mean cosine) of the backward lobe (thesis2018, vsu2022).
        g_back: f32 = -0.25, in -0.9999..=0.9999 "";
        /// Weight of the forward lobe (vsu2022).
        lobe_mix: f32 = 0.5, in 0..=1 "";
        /// Single-scattering albedo (`single`, `octaves`, `multiple`, `path`).
        albedo: f32 = 0.999, in 0..=1 "";
        /// Number of orders of scattering in the sum of the `octaves` model.
        octaves: u32 = 3, in 1..=16 "";
        /// Factor on the scattered light from one octave to the next. This factor, `octave_extinction` and
        /// `octave_phase` are fitted to `path` for three octaves (docs/accuracy.md); 0.5 is usual.
        octave_scattering: f32 = 0.91, in 0..=1 "";
        /// Factor on the extinction toward the sun from one octave to the next.
        octave_extinction: f32 = 0.26, in 0..=1 "";
        /// Factor on `g` from one octave to the next; with `droplet` and `mie` on the asymmetry of each lobe.
        octave_phase: f32 = 0.25, in 0..=1 "";
        /// Gain of the sunlight in the published models, which do not conserve energy.
        sun_gain: f32 = 2.2, in 0..=1000 "";
        /// Factor on the optical depth toward the sun in the published models.
        absorption: f32 = 0.22, in 0..=10 "";
        /// Isotropic radiance that lights the clouds in addition to sun and sky (linear, Rec. 709 primaries; all
        /// models but `single`).
        ambient: [f32; 3] = [0.0, 0.0, 0.0], in 0..=1000000 "";
        /// Gain of the ambient light of the sky (all models but `single`).
        ambient_gain: f32 = 1.0, in 0..=1000 "";
        /// Tint of the ambient light at the cloud top. Its brightness follows from the sky.
        ambient_top: [f32; 3] = [1.0, 1.0, 1.0], in 0..=1000 "";
        /// Tint of the ambient light at the cloud base. Its brightness follows from sky and ground.
        ambient_bottom: [f32; 3] = [1.0, 1.0, 1.0], in 0..=1000 "";
        /// Occlusion of the ambient light within clouds (all models but `single` and `multiple`): 1 weights light from
        /// above and below by the optical depths above and below the point (two streams, Bohren 1987), 0 by height
        /// alone, as in the published models.
        ambient_occlusion: f32 = 1.0, in 0..=1 "";
        /// Strength of the darkening of thin edges in the published models ("powdered sugar", nubis2015); 0 is none.
        powder: f32 = 0.6, in 0..=1 "";
        /// Factor on the absorption in the published models where precipitation is 1 (nubis2015).
        rain_absorption: f32 = 2.5, in 1..=100 "";
    }

    /// The planet, its atmosphere, and the shadows of clouds on both.
    Atmosphere {
        /// Whether there is an atmosphere. Without one the sky is black by day and night, and sunlight is not
        /// attenuated.
        enabled: bool = true;
        /// Radius of the planet (Earth 6 371 000, thesis2018 400 000).
        planet_radius: f32 = 6371000.0, in 10000..=1000000000 "m";
        /// Amount of aerosol. One unit has a vertical optical depth of 0.0053 above the ground, at 550 nm and at all
        /// other wavelengths. 1 is air as clear as over the Antarctic, 10 to 20 a clear day (optical depth 0.05 to
        /// 0.1), 94 thick haze (0.5).
        haze: f32 = 1.0, in 0..=100 "";
        /// Strength of the aerial perspective in front of the clouds: 1 is physical, 0 none.
        aerial_perspective: f32 = 1.0, in 0..=10 "";
        /// Whether clouds cast shadows on the visible ground.
        ground_shadows: bool = true;
        /// Whether clouds cast shadows on the air: light shafts (crepuscular rays).
        light_shafts: bool = true;
        /// Albedo of the ground (linear, Rec. 709 primaries).
        ground_albedo: [f32; 3] = [0.10, 0.12, 0.07], in 0..=1 "";
        /// Radiance of the night sky above the atmosphere (airglow and stars), present by day too. The default
        /// corresponds to a sun of 10: 20.9, 21.6 and 22.6 magnitudes per square arcsecond in R, V and B (Patat 2003)
        /// against the sun's -27.1, -26.74 and -26.09.
        night: [f32; 3] = [2.7e-8, 2.0e-8, 1.4e-8], in 0..=1000000 "";
    }

    /// The numerical method: accuracy and cost of a picture. The appearance of the sky is set by `Params` alone.
    Quality {
        /// Integrator: `march`, the ray march that all settings but the last four belong to; `reference`, the ray march
        /// whose steps are halved until it converges to `tolerance`; `path`, path tracing of every order of scattering
        /// with the light models `multiple` and `octaves`.
        integrator: Integrator = Integrator::March;
        /// Number of view steps of a ray toward the zenith.
        steps_zenith: u32 = 134, in 1..=4096 "";
        /// Number of view steps of a ray toward the horizon.
        steps_horizon: u32 = 320, in 1..=4096 "";
        /// Growth of the view steps with distance: 0 makes all steps of a ray equal, 1 makes a step a fixed fraction
        /// of its distance.
        step_growth: f32 = 1.0, in 0..=1 "";
        /// Length of a coarse step outside clouds, in view steps. On a hit the march goes back by the coarse step.
        coarse_step: u32 = 5, in 1..=16 "";
        /// Sphere-tracing factor for steps through clear air longer than `coarse_step` (Hart 1996): the step per unit by
        /// which the base shape falls short of cloud, as a fraction of `clouds.shape_scale` (of `weather.scale`, or
        /// of 2.5 texels of `weather.map`, if that is less). On a hit the march goes back. 0 limits steps to
        /// `coarse_step`. Longer steps are off where `coarse_step` is 1, in grids and in rain.
        sphere_tracing: f32 = 0.2, in 0..=1 "";
        /// Number of consecutive full samples of zero density before the march takes coarse steps (nubis2015: 6).
        empty_before_coarse: u32 = 6, in 1..=4096 "";
        /// Number of light samples toward the sun, without the far sample. Where they reach to the end of the clouds
        /// (`light_distance` 0), points below a second deck take a third more, for that deck.
        light_steps: u32 = 16, in 1..=128 "";
        /// Light-group weight: consecutive view samples are lit as a group, by light samples from one point, once
        /// their opacity in the pixel exceeds this share, or where clear air follows. 0 lights each view sample by
        /// itself.
        light_group_weight: f32 = 0.15, in 0..=1 "";
        /// Reach of the light samples; 0 extends them to the end of the clouds.
        light_distance: f32 = 0.0, in 0..=100000 "m";
        /// Cells of a level of the light field across (light model `multiple`).
        field_cells: u32 = 64, in 16..=128 "";
        /// Cell of the finest level of the light field.
        field_cell: f32 = 100.0, in 10..=10000 "m";
        /// Number of density samples toward the sun, near the view sample, before the light field is read. They reach
        /// across as many of its cells, whose relief they add.
        relief_samples: u32 = 4, in 0..=64 "";
        /// Whether a further light sample is taken at three times the reach of the others, for shadows of distant
        /// clouds (nubis2015).
        far_sample: bool = false;
        /// Half-width of the cone of the light samples, as a fraction of its length (nubis2015); 0 places them on a
        /// straight line to the sun.
        cone: f32 = 0.0, in 0..=1 "";
        /// Detail cut-off of the light samples: opacity in front of a view sample above which its light samples omit
        /// the detail noise (nubis2015: 0.3). Light samples that reach to the end of the clouds also omit it wherever
        /// they stand for most of a tile of the detail noise.
        light_detail_cutoff: f32 = 1.0, in 0..=1 "";
        /// Transmittance at which a ray ends. Its radiance is then scaled up to full opacity, so that the remaining
        /// light is not lost.
        min_transmittance: f32 = 0.01, in 0..=0.5 "";
        /// Threshold for adaptive sampling: a pixel is marched if the contrast between neighbouring samples exceeds
        /// it. 0 marches every pixel; 1 marches only the initial grid and upsamples. The initial grid has one pixel
        /// in sixteen if pixels are narrower than an eighth of a degree, one in four up to a quarter of a degree, and
        /// every pixel if they are wider. With 1, `Renderer.animate` reprojects the initial grid alone. The
        /// background (sky, ground, and high clouds seen from below) is evaluated at every fourth pixel in both
        /// directions if pixels are narrower than an eighth of a degree, and at every pixel where its second
        /// difference exceeds a tenth of the threshold and along edges; 0 evaluates every pixel.
        adaptive_threshold: f32 = 0.3, in 0..=1 "";
        /// Whether the start of each ray is jittered by blue noise of up to one view step.
        jitter: bool = true;
        /// Tolerance of the integrator `reference`: the steps are halved until no pixel changes by more than this
        /// relative amount. Its sun rays reach to the end of the clouds.
        tolerance: f32 = 0.001, in 0.000001..=1 "";
        /// Number of paths per pixel of the integrator `path`.
        path_samples: u32 = 64, in 2..=1048576 "";
        /// Maximum number of scattering events of a path of the integrator `path`; 1 is single scattering.
        path_scatterings: u32 = 4096, in 1..=1048576 "";
        /// Seed of the random numbers of the integrator `path`.
        seed: u32 = 0, in 0..=4294967295.0 "";
    }
}

/// Deprecated names of blocks and fields, and their names now. Python and TOML files may have either.
pub const RENAMED: [(&str, &str); 8] = [
    ("beams", "light_shafts"),
    ("big_step", "coarse_step"),
    ("cheap_light", "light_detail_cutoff"),
    ("contrast", "adaptive_threshold"),
    ("empty_samples", "empty_before_coarse"),
    ("leap", "sphere_tracing"),
    ("light_share", "light_group_weight"),
    ("wander", "wind_variation"),
];

/// All parameters of a sky.
#[derive(Clone, Debug, Default, PartialEq)]
#[expect(missing_docs, reason = "each block says what it is")]
pub struct Params {
    pub sun: Sun,
    pub moon: Moon,
    pub clouds: Clouds,
    pub upper_clouds: UpperClouds,
    pub weather: Weather,
    pub wind: Wind,
    pub wind_variation: WindVariation,
    pub drift: Drift,
    pub high_clouds: HighClouds,
    pub light: Light,
    pub atmosphere: Atmosphere,
    /// Further weathers and their weights in the weather map. Each weight is from 0 to 1, their sum at most 1;
    /// `weather` has the rest. All weathers have the same `extent`, `edge` and `broad_extent`.
    pub weather_mix: Vec<(Weather, f32)>,
    /// User-supplied extinction grid that replaces the procedural clouds.
    pub volume: Option<Arc<DensityGrid>>,
    /// Unit vector toward the sun, if `sun` holds the moonlight (moon.rs).
    pub(crate) lights_moon: Option<[f64; 3]>,
}

/// Source of a larger weather map.
#[derive(Clone, Debug, PartialEq)]
pub enum BroadSource {
    /// Baked from noise.
    Seed(u32),
    /// User-supplied.
    Own(Arc<Map>),
}

/// Mixture of the larger weather map.
#[derive(Clone, Debug, PartialEq)]
pub struct BroadShares {
    /// Maps and their weights, normalised to a sum of 1: the weight of a weather times its variety. Normalisation
    /// keeps the other maps bit-exact when one of almost no weight joins them.
    pub maps: Vec<(BroadSource, f32)>,
    /// Factor on the texels: the sum of the weights before normalisation.
    pub total: f32,
    /// Distortion of the smaller map per weight of a baked map. The total is 1 if every weather has a baked map at
    /// full distortion.
    pub bend: f32,
}

/// `broad_variety` from which on the larger map distorts the smaller one in full: the default.
const FULL_BEND: f32 = 0.3;

/// Coverage up to which a deck is invisible: fewer than one noise texel in ten thousand exceeds 1 - 2 * `UNSEEN`.
const UNSEEN: f32 = 0.01;

/// Extinction in 1/m of rain that evaporates at once, and of rain that reaches the ground. Clean air has 1.2e-5
/// (Rayleigh scattering at 550 nm, sea level).
const FAINTEST_RAIN: [f32; 2] = [1.5e-6, 1e-5];

constants! {
    /// Precipitation at which a cumulonimbus starts to grow, and at which its tower is complete.
    const TOWER: [f32; 2] = [0.5, 0.9];
    /// Precipitation from which on a cumulonimbus has an anvil if `anvil` is 0, and by how much an `anvil` of 1
    /// lowers it.
    const ANVIL_EDGE: [f32; 2] = [0.6, 0.5];
}

fn lerp(a: f32, b: f32, share: f32) -> f32 {
    a + share * (b - a)
}

fn smoothstep(low: f32, high: f32, v: f32) -> f32 {
    let x = ((v - low) / (high - low)).clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// Fraction of its height range that a deck is given before it becomes visible: 0 at a coverage of 0, 1 from `UNSEEN`
/// on.
fn shown(cover: f32) -> f32 {
    smoothstep(0.0, UNSEEN, cover)
}

impl Params {
    /// The blocks by name.
    pub fn blocks(&self) -> [(&'static str, &dyn Block); 11] {
        [
            ("sun", &self.sun),
            ("moon", &self.moon),
            ("clouds", &self.clouds),
            ("upper_clouds", &self.upper_clouds),
            ("weather", &self.weather),
            ("wind", &self.wind),
            ("wind_variation", &self.wind_variation),
            ("drift", &self.drift),
            ("high_clouds", &self.high_clouds),
            ("light", &self.light),
            ("atmosphere", &self.atmosphere),
        ]
    }

    /// The blocks by name, mutable.
    pub fn blocks_mut(&mut self) -> [(&'static str, &mut dyn Block); 11] {
        [
            ("sun", &mut self.sun),
            ("moon", &mut self.moon),
            ("clouds", &mut self.clouds),
            ("upper_clouds", &mut self.upper_clouds),
            ("weather", &mut self.weather),
            ("wind", &mut self.wind),
            ("wind_variation", &mut self.wind_variation),
            ("drift", &mut self.drift),
            ("high_clouds", &mut self.high_clouds),
            ("light", &mut self.light),
            ("atmosphere", &mut self.atmosphere),
        ]
    }

    /// Checks the range of every value, and the constraints between values.
    pub fn check(&self) -> Result<()> {
        for (name, block) in self.blocks() {
            check_block(name, block)?;
        }
        if self.clouds.top <= self.clouds.base {
            let base = self.clouds.base;
            return Err(Error::parameter("clouds.top", self.clouds.top, format!("above clouds.base = {base} m")));
        }
        let Clouds { stratus, stratocumulus, cumulus, cumulonimbus, .. } = self.clouds;
        let edges = [("stratus", stratus), ("stratocumulus", stratocumulus), ("cumulus", cumulus)];
        for (name, edges) in edges.into_iter().chain([("cumulonimbus", cumulonimbus)]) {
            if !edges.is_sorted() {
                let name = format!("clouds.{name}");
                return Err(Error::parameter(
                    &name,
                    format!("{edges:?}"),
                    "four fractions of the height in rising order",
                ));
            }
        }
        let upper = &self.upper_clouds;
        if upper.top <= upper.base {
            let allowed = format!("above upper_clouds.base = {} m", upper.base);
            return Err(Error::parameter("upper_clouds.top", upper.top, allowed));
        }
        if upper.coverage > 0.0 && upper.base < self.clouds.top {
            let allowed =
                format!("at or above clouds.top = {} m where upper_clouds.coverage is not 0", self.clouds.top);
            return Err(Error::parameter("upper_clouds.base", upper.base, allowed));
        }
        self.check_mix()
    }

    fn check_mix(&self) -> Result<()> {
        let mut sum = 0.0;
        for (index, (weather, share)) in self.weather_mix.iter().enumerate() {
            let path = format!("weather_mix[{index}]");
            check_block(&path, weather)?;
            // Written so that NaN fails it.
            if !(*share >= 0.0 && *share <= 1.0) {
                return Err(Error::parameter(&format!("{path} weight"), share, "a number from 0 to 1"));
            }
            sum += f64::from(*share);
            let (extent, edge) = (self.weather.extent, self.weather.edge.to_value());
            if weather.extent != extent {
                let allowed = format!("weather.extent = {extent} m, as of all weathers of a mixture");
                return Err(Error::parameter(&format!("{path}.extent"), weather.extent, allowed));
            }
            let broad_extent = self.weather.broad_extent;
            if weather.broad_extent != broad_extent {
                let allowed = format!("weather.broad_extent = {broad_extent} m, as of all weathers of a mixture");
                return Err(Error::parameter(&format!("{path}.broad_extent"), weather.broad_extent, allowed));
            }
            if weather.edge.to_value() != edge {
                let allowed = format!("weather.edge = {edge}, as of all weathers of a mixture");
                return Err(Error::parameter(&format!("{path}.edge"), weather.edge.to_value(), allowed));
            }
        }
        // Shares that are 1 in sum may pass it by their rounding.
        if sum > 1.0 + 1e-5 {
            let allowed = "weights of at most 1 together: the rest is that of weather";
            return Err(Error::parameter("weather_mix", format!("weights of {sum} together"), allowed));
        }
        Ok(())
    }

    /// Whether there are volumetric clouds: procedural or a grid.
    pub fn has_clouds(&self) -> bool {
        self.volume.is_some() || self.clouds.coverage > 0.0 || self.has_upper_clouds()
    }

    /// Whether there is an upper deck.
    pub fn has_upper_clouds(&self) -> bool {
        self.volume.is_none() && self.upper_clouds.coverage > 0.0
    }

    /// Whether there are high clouds.
    pub fn has_high_clouds(&self) -> bool {
        (self.volume.is_none() || self.high_clouds.with_volume) && self.high_clouds.coverage > 0.0
    }

    /// Whether there can be precipitation.
    pub fn is_rainy(&self) -> bool {
        self.volume.is_none() && self.clouds.coverage > 0.0 && self.clouds.precipitation > 0.0
    }

    /// Whether rain is visible below the clouds.
    pub fn has_rain_shafts(&self) -> bool {
        self.rain_reach() > 0.0
    }

    /// Whether the larger weather map is in use.
    pub fn has_large_scale_weather(&self) -> bool {
        self.volume.is_none() && self.broad_shares().total > 0.0
    }

    /// The weathers and their weights, which sum to 1.
    fn weathers(&self) -> impl Iterator<Item = (&Weather, f32)> {
        let mixed: f32 = self.weather_mix.iter().map(|(_, share)| share).sum();
        let others = self.weather_mix.iter().map(|(weather, share)| (weather, *share));
        std::iter::once((&self.weather, (1.0 - mixed).max(0.0))).chain(others)
    }

    /// Centre and radius in m of the region kept clear. Of a mixture: the radius is the weighted mean, the centre the
    /// mean weighted by weight and radius.
    pub fn clear_spot(&self) -> ([f64; 2], f64) {
        let (mut middle, mut radius) = ([0.0; 2], 0.0);
        for (weather, share) in self.weathers() {
            let part = f64::from(share) * f64::from(weather.clear_radius);
            radius += part;
            for (sum, at) in middle.iter_mut().zip(weather.clear_at) {
                *sum += part * f64::from(at);
            }
        }
        if radius > 0.0 { (middle.map(|sum| sum / radius), radius) } else { ([0.0; 2], 0.0) }
    }

    /// Mixture of the larger weather map.
    pub fn broad_shares(&self) -> BroadShares {
        let mut shares = BroadShares { maps: Vec::new(), total: 0.0, bend: 0.0 };
        let mut baked = 0.0;
        for (weather, share) in self.weathers() {
            let source = match (&weather.broad_map, &weather.map) {
                (Some(map), _) => BroadSource::Own(map.clone()),
                (None, None) => BroadSource::Seed(weather.seed),
                // One that is composed stays as it is.
                (None, Some(_)) => continue,
            };
            let weight = share * weather.broad_variety;
            if weight <= 0.0 {
                continue;
            }
            if let BroadSource::Seed(_) = source {
                shares.bend += share * (weather.broad_variety / FULL_BEND).min(1.0);
                baked += weight;
            }
            shares.total += weight;
            match shares.maps.iter_mut().find(|(known, _)| *known == source) {
                Some((_, sum)) => *sum += weight,
                None => shares.maps.push((source, weight)),
            }
        }
        // The weights are on the bend as on the shifts.
        shares.bend = if baked > 0.0 { shares.bend / baked } else { 0.0 };
        for (_, weight) in &mut shares.maps {
            *weight /= shares.total;
        }
        shares
    }

    /// Lowest and highest altitude in m of procedural clouds and visible rain: the bounds of the march.
    ///
    /// Continuous in every parameter that switches a feature on: the view steps are placed between these bounds, so
    /// that a jump would change all clouds.
    pub fn shell(&self) -> [f32; 2] {
        let lower = [self.rain_base(), self.lower_top()];
        if !self.has_upper_clouds() {
            return lower;
        }
        let upper = &self.upper_clouds;
        let above = lower[1].max(upper.top);
        let shown = shown(self.clouds.coverage);
        [lerp(upper.base, lower[0], shown), lerp(above, lerp(lower[1], above, self.upper_shown()), shown)]
    }

    /// Fraction of its height range that the upper deck is given (`shown`).
    pub fn upper_shown(&self) -> f32 {
        shown(self.upper_clouds.coverage)
    }

    /// Thickness of the thinner deck in m: of a deck that appears, continuously (`shown`).
    pub fn thinnest_deck(&self) -> f32 {
        let lower = self.clouds.top - self.clouds.base;
        if !self.has_upper_clouds() {
            return lower;
        }
        let upper = self.upper_clouds.top - self.upper_clouds.base;
        lerp(upper, lerp(lower, lower.min(upper), self.upper_shown()), shown(self.clouds.coverage))
    }

    /// Highest altitude of the lower deck in m. It grows with the towers of the heaviest precipitation, before anvils
    /// appear (`tower` and `anvil` of density.wgsl).
    pub fn lower_top(&self) -> f32 {
        let clouds = &self.clouds;
        if !self.is_rainy() {
            return clouds.top;
        }
        let tallest = clouds.top.max(clouds.cumulonimbus_top);
        let anvil = ANVIL_EDGE[0] - ANVIL_EDGE[1] * clouds.anvil;
        let rain = clouds.precipitation;
        let grown = smoothstep(TOWER[0], TOWER[1], rain).max(smoothstep(anvil - 0.1, anvil, rain));
        lerp(clouds.top, tallest, grown)
    }

    /// Fraction of the way to the ground that rain falls. Rain with less extinction than clean air evaporates on the
    /// way.
    pub fn rain_reach(&self) -> f32 {
        if self.is_rainy() { smoothstep(FAINTEST_RAIN[0], FAINTEST_RAIN[1], self.clouds.rain_extinction) } else { 0.0 }
    }

    /// Lowest altitude in m of the heaviest rain (`rain_below` of density.wgsl), or of the lower deck.
    fn rain_base(&self) -> f32 {
        self.clouds.base * (1.0 - (self.rain_reach() * self.clouds.precipitation / 0.3).min(1.0))
    }

    /// Mixture of the weather map: weathers reduced to the fields that their maps depend on, and their weights, which
    /// sum to 1.
    pub fn weather_shares(&self) -> Vec<(Weather, f32)> {
        let mut shares: Vec<(Weather, f32)> = Vec::new();
        for (weather, share) in self.weathers() {
            let source = weather.source();
            match shares.iter_mut().find(|(known, _)| *known == source) {
                Some((_, sum)) => *sum += share,
                None => shares.push((source, share)),
            }
        }
        // Half floats do not tell less.
        shares.retain(|(_, share)| *share > 1e-6);
        shares
    }

    /// Fraction of the weather map that differs from that of another sky: 1 minus the weights that they have in common.
    pub fn weather_change(&self, before: &Self) -> f32 {
        let before = before.weather_shares();
        let common = |(weather, share): (Weather, f32)| {
            before.iter().find(|(old, _)| *old == weather).map_or(0.0, |(_, old)| old.min(share))
        };
        1.0 - self.weather_shares().into_iter().map(common).sum::<f32>()
    }
}

impl Weather {
    /// The weather with every field that its map does not depend on set to the default.
    fn source(&self) -> Self {
        let default = Self::default();
        match &self.map {
            Some(map) => Self { map: Some(map.clone()), ..default },
            None => {
                let Self { edge, broad_variety, broad_extent, broad_map, clear_at, clear_radius, .. } = default;
                Self { edge, broad_variety, broad_extent, broad_map, clear_at, clear_radius, ..self.clone() }
            }
        }
    }
}

pub(crate) fn check_block(name: &str, block: &dyn Block) -> Result<()> {
    for (index, field) in block.fields().iter().enumerate() {
        field.check(name, &block.get(index))?;
    }
    Ok(())
}

/// The default block of a Python type name: any block of [`Params`], or [`Quality`].
pub fn block(type_name: &str) -> Option<Box<dyn Block>> {
    let Params {
        sun,
        moon,
        clouds,
        upper_clouds,
        weather,
        wind,
        wind_variation,
        drift,
        high_clouds,
        light,
        atmosphere,
        weather_mix: _,
        volume: _,
        lights_moon: _,
    } = Params::default();
    let quality = Quality::default();
    let blocks: [Box<dyn Block>; 12] = [
        Box::new(sun),
        Box::new(moon),
        Box::new(clouds),
        Box::new(upper_clouds),
        Box::new(weather),
        Box::new(wind),
        Box::new(wind_variation),
        Box::new(drift),
        Box::new(high_clouds),
        Box::new(light),
        Box::new(atmosphere),
        Box::new(quality),
    ];
    blocks.into_iter().find(|block| block.type_name() == type_name)
}

/// Offset of each block in the `params` uniform, `quality` last, and the size of the whole, in bytes.
pub fn uniform_layout() -> (Vec<(&'static str, &'static str, usize)>, usize) {
    let (params, quality) = (Params::default(), Quality::default());
    let mut offset = 0;
    let mut blocks = Vec::new();
    for (name, block) in params.blocks().into_iter().chain([("quality", &quality as &dyn Block)]) {
        let size = schema::size(block.fields());
        if size > 0 {
            blocks.push((name, block.type_name(), offset));
        }
        offset += size;
    }
    (blocks, offset)
}

/// Contents of the `params` uniform, as 32-bit words.
pub fn uniform(params: &Params, quality: &Quality) -> Vec<u32> {
    // Shaders see by the cover whether there are high clouds.
    let mut params = Cow::Borrowed(params);
    if !params.has_high_clouds() {
        params.to_mut().high_clouds.coverage = 0.0;
    }
    let blocks = params.blocks().into_iter().map(|(_, block)| block);
    schema::words(&blocks.chain([quality as &dyn Block]).collect::<Vec<_>>())
}
