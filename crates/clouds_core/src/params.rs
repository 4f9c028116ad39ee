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
    /// Which noises the base shape is made of.
    Noise {
        /// Perlin-Worley and three octaves of Worley FBM.
        Nubis2015 = "nubis2015",
        /// Perlin-Worley of rising frequency in every channel.
        Vsu2022 = "vsu2022",
    }
}

choice! {
    /// How the texture of the high clouds becomes thickness.
    Curve {
        /// Ever less the denser it is: soft edges and even cores (gems2001's "condensation").
        Exponential = "exponential",
        /// In proportion to what is above a level, up to the thickest (gems2001: subtract and clamp).
        Clamp = "clamp",
    }
}

choice! {
    /// Which noises the weather map is made of.
    WeatherNoise {
        /// Blobs of Worley noise that lean on a Perlin noise.
        WorleyPerlin = "worley_perlin",
        /// Worley noise weighed by simplex noise (thesis2018).
        WorleySimplex = "worley_simplex",
        /// Perlin-Worley noise (vsu2022).
        PerlinWorley = "perlin_worley",
    }
}

choice! {
    /// What lies beyond the edge of the weather map.
    Edge {
        /// The map again.
        Repeat = "repeat",
        /// Its mirror image.
        Mirror = "mirror",
        /// The texels of its edge, for ever.
        Clamp = "clamp",
    }
}

choice! {
    /// How sunlight becomes the brightness of a cloud.
    Model {
        /// Physical single scattering and nothing else.
        Single = "single",
        /// Beer times powder times Henyey-Greenstein times 2, and ambient.
        Nubis2015 = "nubis2015",
        /// Beer with a slower second term, the larger of two lobes, powder, and ambient.
        Thesis2018 = "thesis2018",
        /// As nubis2015 with a blend of two lobes.
        Vsu2022 = "vsu2022",
        /// Single scattering, and more of it with ever less extinction and anisotropy for the orders after the first
        /// (Wrenninge et al. 2013, Hillaire 2016), and ambient.
        Octaves = "octaves",
        /// Every order of scattering, path traced: slow, with noise, and the truth that the others are measured by.
        Path = "path",
    }
}

choice! {
    /// How much light a droplet scatters in which direction.
    Phase {
        /// Henyey and Greenstein's function of `g` (and of `g_back` in thesis2018 and vsu2022): the published models'.
        HenyeyGreenstein = "henyey_greenstein",
        /// Jendersie and d'Eon's fit of cloud droplets (2023): the forward peak, without bow and glory.
        Droplet = "droplet",
        /// Mie's own function of cloud droplets, baked: with fogbow and glory.
        Mie = "mie",
    }
}

params! {
    /// The sun.
    Sun {
        /// Height above the horizon.
        elevation: f32 = 40.0, in -90..=90 "degrees";
        /// Compass direction, clockwise from north.
        azimuth: f32 = 120.0, in -360..=360 "degrees";
        /// Irradiance on a plane that faces the sun, above the atmosphere (linear Rec. 709).
        irradiance: [f32; 3] = [10.0, 10.0, 10.0], in 0..=1000000 "";
        /// Whether the sun's disc is drawn.
        visible: bool = true;
    }

    /// The moon. It lights air, clouds and ground as the sun does, casts shadows, and shines together with it. Its bright side is
    /// toward the sun.
    Moon {
        /// Height above the horizon; at -90, the default, there is none.
        elevation: f32 = -90.0, in -90..=90 "degrees";
        /// Compass direction, clockwise from north.
        azimuth: f32 = 180.0, in -360..=360 "degrees";
        /// Age as a share of a month: 0 is new, 0.25 half, 0.5 full, 0.75 half again and 1 new. A half moon has a tenth of the
        /// light of a full one (Krisciunas and Schaefer 1991).
        phase: f32 = 0.5, in 0..=1 "";
        /// Irradiance of the full moon on a plane that faces it, above the air, in the unit of `sun.irradiance`. The default is
        /// as much less than a sun of 10 as the magnitude of -12.73 is than -26.74, and as much redder as B - V = 0.92 is than 0.65
        /// (Allen's Astrophysical Quantities).
        irradiance: [f32; 3] = [2.7e-5, 2.5e-5, 2.0e-5], in 0..=1000000 "";
        /// Whether the moon's disc is drawn.
        visible: bool = true;
    }

    /// The volumetric clouds: where they are and what they are made of.
    Clouds {
        /// How much of the sky is cloudy: shifts the weather map's coverage, 0 is clear, 0.5 the map as it is, 1 overcast.
        coverage: f32 = 0.45, in 0..=1 "";
        /// Cloud type: 0 stratus, 0.5 stratocumulus, 1 cumulus. Shifts the weather map's type, 0.5 the map as it is.
        r#type: f32 = 0.85, in 0..=1 "";
        /// Rain: thickens and darkens the clouds and lets them grow to cumulonimbus (nubis2015). Scales the weather map's
        /// precipitation, 0 is dry.
        precipitation: f32 = 0.0, in 0..=1 "";
        /// Altitude of the cloud base.
        base: f32 = 1200.0, in 0..=20000 "m";
        /// Altitude of the highest cloud tops where there is no rain.
        top: f32 = 3200.0, in 1..=25000 "m";
        /// Altitude of the tops of cumulonimbus, where precipitation is 1 (nubis2015: 8 km).
        cumulonimbus_top: f32 = 8000.0, in 1..=25000 "m";
        /// How far the tops of cumulonimbus spread.
        anvil: f32 = 0.5, in 0..=1 "";
        /// Extinction of the rain that is seen below the clouds where it is heaviest; 0 hides it. What is thinner than clean air
        /// (1e-5) evaporates before it reaches the ground.
        rain_extinction: f32 = 0.0, in 0..=1 "1/m";
        /// Extinction where the density is 1.
        extinction: f32 = 0.2, in 0..=100000000 "1/m";
        /// Which random shapes.
        seed: u32 = 1, in 0..=4294967295.0 "";
        /// Which noises the shapes are made of.
        noise: Noise = Noise::Nubis2015;
        /// Width of one tile of the base shape.
        shape_scale: f32 = 5200.0, in 100..=200000 "m";
        /// Width of one tile of the detail that erodes the edges.
        detail_scale: f32 = 420.0, in 10..=50000 "m";
        /// How deep the detail erodes the edges (nubis2015: 0.2).
        detail: f32 = 0.2, in 0..=1 "";
        /// How much of a finer detail, a fifth as wide, is added to it: what shows of clouds that are near. 0 leaves it out
        /// (nubis2015).
        fine_detail: f32 = 0.6, in 0..=1 "";
        /// Width of one tile of the curl noise that swirls the detail.
        curl_scale: f32 = 1600.0, in 10..=50000 "m";
        /// How far curl noise displaces the detail at the base.
        curl: f32 = 70.0, in 0..=2000 "m";
        /// Where the density of stratus rises from 0 to 1 and where it falls back, as fractions of its height (nubis2015,
        /// figure 4.10; vsu2022's gradients).
        stratus: [f32; 4] = [0.02, 0.05, 0.09, 0.11], in 0..=1 "";
        /// The same for stratocumulus.
        stratocumulus: [f32; 4] = [0.02, 0.12, 0.35, 0.60], in 0..=1 "";
        /// The same for cumulus.
        cumulus: [f32; 4] = [0.01, 0.07, 0.25, 1.0], in 0..=1 "";
        /// The same for cumulonimbus.
        cumulonimbus: [f32; 4] = [0.005, 0.04, 0.8, 1.0], in 0..=1 "";
        /// Density by height and type in place of the first three: row 0 at the tops, column 0 type 0 (Frostbite 2016).
        profile: Option<Table> = None, in 0..=1 "";
    }

    /// A second deck of volumetric clouds, above the first. Its weather is another part of the same map, and its noises are
    /// those of the first at another scale.
    UpperClouds {
        /// How much of the sky it covers: as `clouds.coverage`; 0 is none.
        coverage: f32 = 0.0, in 0..=1 "";
        /// Cloud type: as `clouds.type`.
        r#type: f32 = 0.5, in 0..=1 "";
        /// Altitude of its base.
        base: f32 = 4800.0, in 0..=25000 "m";
        /// Altitude of its tops.
        top: f32 = 5600.0, in 1..=25000 "m";
        /// Extinction where the density is 1.
        extinction: f32 = 0.06, in 0..=100000000 "1/m";
        /// Size of its clouds, as a share of the size of those below.
        scale: f32 = 0.4, in 0.01..=100 "";
        /// Compass direction toward which its wind blows, clockwise from north.
        direction: f32 = 95.0, in -360..=360 "degrees";
        /// Speed of that wind.
        speed: f32 = 16.0, in -1000..=1000 "m/s";
        /// How far its tops lean downwind.
        shear: f32 = 150.0, in -20000..=20000 "m";
    }

    /// The weather map: where the clouds stand.
    Weather {
        /// Width of the square that one map covers, about the origin of the world. It lies on the planet in stereographic
        /// projection: true at the origin, in proportion anywhere.
        extent: f32 = 60000.0, in 100..=10000000 "m";
        /// What lies beyond that square: the map again, its mirror image, or what is at its edge.
        edge: Edge = Edge::Repeat;
        /// A map of your own: coverage, type and precipitation, row 0 in the north; None bakes one from noise.
        map: Option<Arc<Map>> = None, in 0..=1 "";
        /// Which noises the map is baked from: `worley_simplex` is thesis2018's, `perlin_worley` vsu2022's.
        noise: WeatherNoise = WeatherNoise::WorleyPerlin;
        /// Which random weather.
        seed: u32 = 7, in 0..=4294967295.0 "";
        /// Typical distance between clouds.
        scale: f32 = 5000.0, in 100..=1000000 "m";
        /// How much the cover varies over distances of several clouds.
        variety: f32 = 0.5, in 0..=1 "";
        /// How much the type of cloud varies from place to place; 0 makes it the same everywhere.
        type_variety: f32 = 0.9, in 0..=2 "";
        /// How much a second, larger map shifts the weather, by seed or `broad_map`, so that no part of the sky looks like
        /// another; 0 leaves the first map as it is. From 0.3 on the baked one also bends it in full. It leaves a `map` of
        /// yours alone.
        broad_variety: f32 = 0.3, in 0..=1 "";
        /// Width of the square that the larger map covers; beyond it, that repeats.
        broad_extent: f32 = 430000.0, in 100..=10000000 "m";
        /// A larger map of your own: shifts of coverage, type and precipitation, 0.5 is none.
        broad_map: Option<Arc<Map>> = None, in 0..=1 "";
        /// Middle of the spot to keep clear, east and north of the origin. It stays while the weather drifts over it.
        clear_at: [f32; 2] = [0.0, 0.0], in -10000000..=10000000 "m";
        /// Radius in which the spot has no cloud; the cover is back half a radius farther out. 0 keeps nothing clear.
        clear_radius: f32 = 0.0, in 0..=10000000 "m";
    }

    /// What moves the clouds.
    Wind {
        /// Compass direction toward which the base shapes drift and the tops lean, clockwise from north.
        direction: f32 = 60.0, in -360..=360 "degrees";
        /// Speed of the base shapes.
        speed: f32 = 8.0, in -1000..=1000 "m/s";
        /// Compass direction toward which the detail drifts.
        detail_direction: f32 = 60.0, in -360..=360 "degrees";
        /// Speed of the detail; the difference to the base shapes makes the edges boil.
        detail_speed: f32 = 11.0, in -1000..=1000 "m/s";
        /// How far the tops lean downwind (nubis2015: 500 m).
        shear: f32 = 400.0, in -20000..=20000 "m";
        /// Speed at which the noises rise.
        updraft: f32 = 0.8, in -100..=100 "m/s";
        /// Compass direction toward which the weather map drifts.
        weather_direction: f32 = 60.0, in -360..=360 "degrees";
        /// Speed of the weather map; 0 keeps a composed sky in place while its shapes evolve (thesis2018).
        weather_speed: f32 = 8.0, in -1000..=1000 "m/s";
    }

    /// Winds and cover that wander over hours (gems2001): four slow turns of unlike periods, in closed form, so that any
    /// time can be asked for.
    Wander {
        /// By how much the winds wander, as a share of their speed, in speed and direction: at 0.5 a wind blows at a half to
        /// one and a half times its speed, within 30 degrees of its direction. All winds wander alike; what leans keeps
        /// leaning as it does.
        wind: f32 = 0.0, in 0..=1 "";
        /// By how much `clouds.coverage` wanders up and down, within 0 to 1.
        coverage: f32 = 0.0, in 0..=1 "";
        /// How long a swing takes, about.
        period: f32 = 7200.0, in 60..=100000000 "s";
        /// Which random swings.
        seed: u32 = 11, in 0..=4294967295.0 "";
    }

    /// Where things are at 0 s, as the winds of now would have it. All 0, unless the winds have changed on the way:
    /// `Params.after`, `Keyframes` and `Renderer.animate` set it, so that the sky goes on from where it is.
    Drift {
        /// How far the base shapes are carried, east and north.
        shape: [f64; 2] = [0.0, 0.0], in -1000000000000.0..=1000000000000.0 "m";
        /// The detail.
        detail: [f64; 2] = [0.0, 0.0], in -1000000000000.0..=1000000000000.0 "m";
        /// The weather map.
        weather: [f64; 2] = [0.0, 0.0], in -1000000000000.0..=1000000000000.0 "m";
        /// The upper deck, its weather with its shapes.
        upper: [f64; 2] = [0.0, 0.0], in -1000000000000.0..=1000000000000.0 "m";
        /// The detail of the upper deck.
        upper_detail: [f64; 2] = [0.0, 0.0], in -1000000000000.0..=1000000000000.0 "m";
        /// The high clouds, along `high_clouds.direction` and to the left of it.
        high: [f64; 2] = [0.0, 0.0], in -1000000000000.0..=1000000000000.0 "m";
        /// How far the updraft has raised the noises.
        rise: f64 = 0.0, in -1000000000000.0..=1000000000000.0 "m";
        /// How often the largest shapes of the high clouds have been replaced (`high_clouds.evolution`).
        evolution: f64 = 0.0, in -1000000000000.0..=1000000000000.0 "";
        /// How many times `wander.period` the wander is ahead.
        swings: f64 = 0.0, in -1000000000000.0..=1000000000000.0 "";
    }

    /// The thin high clouds, a layer without thickness on its own sphere (nubis2015; animated as in gems2001).
    HighClouds {
        /// How much of the sky they cover: 0 is clear, 1 overcast.
        coverage: f32 = 0.5, in 0..=1 "";
        /// Whether they are there with a `volume` too, which is otherwise all the cloud that there is.
        with_volume: bool = false;
        /// Cloud type: 0 cirrus in streaks, 1 altocumulus in cells, and between them both, here more of one, there of the other.
        r#type: f32 = 0.0, in 0..=1 "";
        /// Altitude of the layer.
        altitude: f32 = 8500.0, in 100..=30000 "m";
        /// Optical depth, seen from straight below, where they are thickest.
        optical_depth: f32 = 0.5, in 0..=100 "";
        /// Width of one tile of the texture.
        scale: f32 = 42000.0, in 1000..=1000000 "m";
        /// How thickness grows with what rises above the cover.
        curve: Curve = Curve::Exponential;
        /// How strongly the flanks toward the sun are bright and those away from it dark (gems2001).
        emboss: f32 = 0.0, in 0..=1 "";
        /// How much longer than wide the streaks are, along the wind; cells are stretched by its square root, across it.
        stretch: f32 = 3.0, in 1..=16 "";
        /// Compass direction toward which they drift; the streaks lie along it.
        direction: f32 = 75.0, in -360..=360 "degrees";
        /// Speed at which they drift.
        speed: f32 = 25.0, in -1000..=1000 "m/s";
        /// How often the largest shapes are replaced by new ones; each octave after it twice as often.
        evolution: f32 = 0.001, in 0..=10 "1/s";
        /// Octaves of noise.
        octaves: u32 = 5, in 1..=8 "";
        /// Which random shapes.
        seed: u32 = 3, in 0..=4294967295.0 "";
        /// Width and height of the texture.
        texture_size: u32 = 512, in 16..=4096 "texels";
    }

    /// How light becomes colour.
    Light {
        /// The physics of the light in the clouds.
        model: Model = Model::Octaves;
        /// The phase function: `henyey_greenstein` of `g` (in thesis2018 and vsu2022 of `g_back`, too) as published;
        /// `droplet` a fit of real droplets, whose clouds have a silver lining (Jendersie and d'Eon 2023); `mie` the droplets
        /// themselves, with fogbow and glory. Half of what those scatter goes on within a few degrees: `path` then takes many
        /// times the samples.
        phase: Phase = Phase::HenyeyGreenstein;
        /// Diameter of the droplets (`droplet`, `mie`): fog 5 to 20, cumulus 10 to 30, drizzle 50.
        droplet_diameter: f32 = 20.0, in 5..=50 "µm";
        /// Mean cosine of the forward lobe of the phase function.
        g: f32 = 0.6, in -0.9999..=0.9999 "";
        /// Mean cosine of the backward lobe (thesis2018, vsu2022).
        g_back: f32 = -0.25, in -0.9999..=0.9999 "";
        /// Share of the forward lobe (vsu2022).
        lobe_mix: f32 = 0.5, in 0..=1 "";
        /// Single-scattering albedo of a droplet (`single`, `octaves`, `path`).
        albedo: f32 = 0.999, in 0..=1 "";
        /// Orders of scattering that `octaves` sums up.
        octaves: u32 = 3, in 1..=16 "";
        /// Share of the light that each octave keeps of the one before. This and the next two are fitted to `path` for three
        /// octaves (docs/accuracy.md); 0.5 is usual.
        octave_scattering: f32 = 0.91, in 0..=1 "";
        /// Share of the extinction toward the sun that each octave keeps of the one before.
        octave_extinction: f32 = 0.26, in 0..=1 "";
        /// Share of `g` that each octave keeps of the one before (of each lobe's, where the phase function is `droplet` or
        /// `mie`).
        octave_phase: f32 = 0.25, in 0..=1 "";
        /// Gain of the sunlight in the published models, which do not conserve energy.
        sun_gain: f32 = 2.2, in 0..=1000 "";
        /// How thick the published models take the cloud to be on the way to the sun.
        absorption: f32 = 0.22, in 0..=10 "";
        /// Radiance that reaches the clouds from every direction, besides that of sun and sky (all but `single`).
        ambient: [f32; 3] = [0.0, 0.0, 0.0], in 0..=1000000 "";
        /// Gain of the ambient light of the sky (all but `single`).
        ambient_gain: f32 = 1.0, in 0..=1000 "";
        /// Tint of the ambient light at the top of the clouds; its brightness comes from the sky.
        ambient_top: [f32; 3] = [1.0, 1.0, 1.0], in 0..=1000 "";
        /// Tint of the ambient light at the base of the clouds; its brightness comes from sky and ground.
        ambient_bottom: [f32; 3] = [1.0, 1.0, 1.0], in 0..=1000 "";
        /// How much clouds hide sky and ground from themselves: 1 shares the ambient light by their optical depth above and
        /// below, 0 by height alone, as the published models do.
        ambient_occlusion: f32 = 1.0, in 0..=1 "";
        /// How strongly thin edges darken ("powdered sugar", nubis2015); 0 switches it off.
        powder: f32 = 0.6, in 0..=1 "";
        /// How many times more light is absorbed where precipitation is 1 (nubis2015).
        rain_absorption: f32 = 2.5, in 1..=100 "";
    }

    /// The planet and its air.
    Atmosphere {
        /// Whether there is air; without it the sky is black, day and night, and sunlight arrives undimmed.
        enabled: bool = true;
        /// Radius of the planet (Earth 6 371 000, thesis2018 400 000).
        planet_radius: f32 = 6371000.0, in 10000..=1000000000 "m";
        /// Haze: amount of aerosol. Each unit is an optical depth of 0.0053 straight up from the ground, at 550 nm as at all
        /// wavelengths: 1 is air as clear as over the Antarctic, 10 to 20 a clear day (0.05 to 0.1), 94 thick haze (0.5).
        haze: f32 = 1.0, in 0..=100 "";
        /// How much air stands between the eye and the clouds: 1 is physical, 0 none.
        aerial_perspective: f32 = 1.0, in 0..=10 "";
        /// Whether clouds cast shadows on the ground that is seen.
        ground_shadows: bool = true;
        /// Whether clouds cast shadows on the air: crepuscular rays.
        beams: bool = true;
        /// Albedo of the ground.
        ground_albedo: [f32; 3] = [0.10, 0.12, 0.07], in 0..=1 "";
        /// Radiance of the night's own light above the air, airglow and stars, which is there by day too: 20.9, 21.6 and 22.6
        /// magnitudes a square arcsecond in R, V and B (Patat 2003) beside a sun of 10 and of -27.1, -26.74 and -26.09.
        night: [f32; 3] = [2.7e-8, 2.0e-8, 1.4e-8], in 0..=1000000 "";
    }

    /// The numerical method: how accurately a sky is computed, never how it looks.
    Quality {
        /// View steps straight up.
        steps_zenith: u32 = 134, in 1..=4096 "";
        /// View steps toward the horizon.
        steps_horizon: u32 = 320, in 1..=4096 "";
        /// How much steps grow with distance: 0 makes all of a ray's steps equal, 1 lets a step be a fixed share of its distance.
        step_growth: f32 = 1.0, in 0..=1 "";
        /// How many steps one step outside cloud is long; on a hit the march goes back.
        big_step: u32 = 5, in 1..=16 "";
        /// How far a ray may leap through clear air, beyond `big_step`: as a share of `clouds.shape_scale` (of
        /// `weather.scale` or two and a half pixels of `weather.map`, if that is less) for each unit that the base shape lacks of
        /// being cloud. On a hit the march goes back. 0 leaps no farther than `big_step`; none does where that is 1, in grids and
        /// in rain.
        leap: f32 = 0.2, in 0..=1 "";
        /// Full samples of zero in a row after which samples are cheap again (nubis2015: 6).
        empty_samples: u32 = 6, in 1..=4096 "";
        /// Light samples toward the sun, besides the far one. Where they spread to the end of the clouds, there is a third more
        /// for a second deck above the point.
        light_steps: u32 = 16, in 1..=128 "";
        /// Share of a pixel's cloud that is lit as one, by the light samples of one place in it: samples in a row are lit
        /// together once they have gathered more. 0 lights each sample by itself.
        light_share: f32 = 0.15, in 0..=1 "";
        /// How far the light samples reach; 0 spreads them to where the clouds end.
        light_distance: f32 = 0.0, in 0..=100000 "m";
        /// Whether there is one more light sample, at three times that reach, for shadows from distant clouds (nubis2015).
        far_sample: bool = false;
        /// Half width of the cone that the light samples are spread over, as a share of its length (nubis2015); 0 looks
        /// straight at the sun.
        cone: f32 = 0.0, in 0..=1 "";
        /// Opacity in front of a sample past which its light samples leave out the detail (nubis2015: 0.3). Of those
        /// that spread to the end of the clouds, the ones that stand for most of a tile of the detail leave it out always.
        cheap_light: f32 = 1.0, in 0..=1 "";
        /// Transmittance at which a ray ends; what is left is scaled away, not lost.
        min_transmittance: f32 = 0.01, in 0..=0.5 "";
        /// Largest contrast between neighbouring rays, past which the pixels between them get rays of their own. Of pixels
        /// less than an eighth of a degree wide one in sixteen is marched first, of a quarter one in four, of wider ones
        /// every one; 0 marches every one of any width, and 1 none but those, so that an animation follows those alone. What
        /// is behind the clouds, sky, ground and high clouds seen from below, is then worked out at every fourth of the
        /// narrowest pixels, and where it bends by a tenth of this, at edges too; 0 works out every one.
        contrast: f32 = 0.3, in 0..=1 "";
        /// Whether each ray starts at a blue-noise offset of up to one step.
        jitter: bool = true;
        /// Largest relative change of a pixel when all steps are halved; they are until it is met. It replaces everything
        /// above by an integration that converges, and sun rays go to the end of the clouds; 0
        /// marches with the settings above.
        tolerance: f32 = 0.0, in 0..=1 "";
        /// Paths traced for each pixel (light model `path`).
        path_samples: u32 = 64, in 2..=1048576 "";
        /// Most scatterings of a path (light model `path`); 1 is single scattering.
        path_scatterings: u32 = 4096, in 1..=1048576 "";
    }
}

/// Everything that a sky looks like.
#[derive(Clone, Debug, Default, PartialEq)]
#[expect(missing_docs, reason = "each block says what it is")]
pub struct Params {
    pub sun: Sun,
    pub moon: Moon,
    pub clouds: Clouds,
    pub upper_clouds: UpperClouds,
    pub weather: Weather,
    pub wind: Wind,
    pub wander: Wander,
    pub drift: Drift,
    pub high_clouds: HighClouds,
    pub light: Light,
    pub atmosphere: Atmosphere,
    /// Other weathers and their shares of the weather map, each 0 to 1 and 1 together at most; the rest is that of
    /// `weather`. All cover the same square.
    pub weather_mix: Vec<(Weather, f32)>,
    /// A cloud of the user's own in place of the procedural ones.
    pub volume: Option<Arc<DensityGrid>>,
    /// Unit vector toward the sun, where `sun` holds the moon's light (moon.rs).
    pub(crate) lights_moon: Option<[f64; 3]>,
}

/// A larger weather map.
#[derive(Clone, Debug, PartialEq)]
pub enum BroadSource {
    /// Baked from noise.
    Seed(u32),
    /// The user's.
    Own(Arc<Map>),
}

/// What the larger weather map is made of.
#[derive(Clone, Debug, PartialEq)]
pub struct BroadShares {
    /// Maps and their weights, which are 1 together: the share of a weather times its variety. One that comes with next to
    /// no weight then leaves the others the bits that they have alone.
    pub maps: Vec<(BroadSource, f32)>,
    /// What the texels are multiplied with: the sum of those shares times varieties.
    pub total: f32,
    /// How much the smaller map is bent, for each weight of a baked map: 1 in all where every weather has one.
    pub bend: f32,
}

/// The variety from which on the larger map bends the smaller one in full: the default.
const FULL_BEND: f32 = 0.3;

/// The cover up to which a deck shows nothing: fewer than one texel of noise in ten thousand rises above 1 less twice that.
const UNSEEN: f32 = 0.01;

/// Extinction of rain that evaporates at once, and of rain that reaches the ground, 1/m: that of clean air is 1.2e-5
/// (Rayleigh scattering at 550 nm, sea level).
const FAINTEST_RAIN: [f32; 2] = [1.5e-6, 1e-5];

constants! {
    /// Shares of the heaviest rain between which a cloud grows from none to all of the tower of a cumulonimbus.
    const TOWER: [f32; 2] = [0.5, 0.9];
    /// Share of the heaviest rain from which on a cumulonimbus has an anvil, for an `anvil` of 0, and how much less that
    /// is for one of 1.
    const ANVIL_EDGE: [f32; 2] = [0.6, 0.5];
}

fn lerp(a: f32, b: f32, share: f32) -> f32 {
    a + share * (b - a)
}

fn smoothstep(low: f32, high: f32, v: f32) -> f32 {
    let x = ((v - low) / (high - low)).clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// How much room a deck of some cover has, before it shows: 0 without any, 1 from `UNSEEN` on.
fn shown(cover: f32) -> f32 {
    smoothstep(0.0, UNSEEN, cover)
}

impl Params {
    /// The blocks with their names.
    pub fn blocks(&self) -> [(&'static str, &dyn Block); 11] {
        [
            ("sun", &self.sun),
            ("moon", &self.moon),
            ("clouds", &self.clouds),
            ("upper_clouds", &self.upper_clouds),
            ("weather", &self.weather),
            ("wind", &self.wind),
            ("wander", &self.wander),
            ("drift", &self.drift),
            ("high_clouds", &self.high_clouds),
            ("light", &self.light),
            ("atmosphere", &self.atmosphere),
        ]
    }

    /// The same, to set them.
    pub fn blocks_mut(&mut self) -> [(&'static str, &mut dyn Block); 11] {
        [
            ("sun", &mut self.sun),
            ("moon", &mut self.moon),
            ("clouds", &mut self.clouds),
            ("upper_clouds", &mut self.upper_clouds),
            ("weather", &mut self.weather),
            ("wind", &mut self.wind),
            ("wander", &mut self.wander),
            ("drift", &mut self.drift),
            ("high_clouds", &mut self.high_clouds),
            ("light", &mut self.light),
            ("atmosphere", &mut self.atmosphere),
        ]
    }

    /// Checks every value, and what no range can say.
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

    /// Whether there are marched clouds at all.
    pub fn has_clouds(&self) -> bool {
        self.volume.is_some() || self.clouds.coverage > 0.0 || self.has_upper_clouds()
    }

    /// Whether there is a second deck.
    pub fn has_upper_clouds(&self) -> bool {
        self.volume.is_none() && self.upper_clouds.coverage > 0.0
    }

    /// Whether there are high clouds.
    pub fn has_high_clouds(&self) -> bool {
        (self.volume.is_none() || self.high_clouds.with_volume) && self.high_clouds.coverage > 0.0
    }

    /// Whether it can rain.
    pub fn is_rainy(&self) -> bool {
        self.volume.is_none() && self.clouds.coverage > 0.0 && self.clouds.precipitation > 0.0
    }

    /// Whether rain is seen below the clouds.
    pub fn has_rain_shafts(&self) -> bool {
        self.rain_reach() > 0.0
    }

    /// Whether a second, larger map shifts the weather.
    pub fn has_broad_weather(&self) -> bool {
        self.volume.is_none() && self.broad_shares().total > 0.0
    }

    /// The weathers of a mixture, or the one, and their weights, which are 1 together.
    fn weathers(&self) -> impl Iterator<Item = (&Weather, f32)> {
        let mixed: f32 = self.weather_mix.iter().map(|(_, share)| share).sum();
        let others = self.weather_mix.iter().map(|(weather, share)| (weather, *share));
        std::iter::once((&self.weather, (1.0 - mixed).max(0.0))).chain(others)
    }

    /// The spot to keep clear, its middle and its radius in m: of a mixture one that grows in its place.
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

    /// What the larger map is made of.
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

    /// The lowest and the highest altitude at which there can be procedural clouds or visible rain, m.
    ///
    /// Continuous in all that can be switched on: steps lie by it, and where it leapt all clouds would change with what is
    /// switched on beside them.
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

    /// How much room the second deck has.
    pub fn upper_shown(&self) -> f32 {
        shown(self.upper_clouds.coverage)
    }

    /// The highest altitude of the first deck, m: it grows with the towers that the heaviest rain makes, and before its anvils
    /// spread (`tower` and `anvil` of density.wgsl).
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

    /// How far rain falls, as a share of its way to the ground: what is thinner than clean air evaporates on its way.
    pub fn rain_reach(&self) -> f32 {
        if self.is_rainy() { smoothstep(FAINTEST_RAIN[0], FAINTEST_RAIN[1], self.clouds.rain_extinction) } else { 0.0 }
    }

    /// The lowest altitude of rain where it is heaviest (`rain_below` of density.wgsl), or of the first deck, m.
    fn rain_base(&self) -> f32 {
        self.clouds.base * (1.0 - (self.rain_reach() * self.clouds.precipitation / 0.3).min(1.0))
    }

    /// What the weather map is made of: maps by what they depend on, and their shares, which are 1 together.
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
}

impl Weather {
    /// The weather with what its map does not depend on at the default.
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

impl Quality {
    /// The numerical methods that have a name. The last three are the published settings of the sources.
    pub const NAMES: [&str; 8] =
        ["preview", "draft", "balanced", "high", "reference", "nubis2015", "thesis2018", "vsu2022"];

    /// The method called `name`.
    pub fn named(name: &str) -> Result<Self> {
        let balanced = Self::default();
        // The published marches: equal steps, light samples near by.
        let published = Self {
            steps_zenith: 64,
            steps_horizon: 128,
            step_growth: 0.0,
            big_step: 1,
            leap: 0.0,
            light_steps: 5,
            light_share: 0.0,
            light_distance: 700.0,
            far_sample: true,
            cone: 0.12,
            cheap_light: 0.3,
            contrast: 0.0,
            ..balanced.clone()
        };
        let draft = Self {
            steps_zenith: 80,
            steps_horizon: 192,
            big_step: 3,
            light_steps: 10,
            min_transmittance: 0.03,
            contrast: 0.5,
            path_samples: 16,
            ..balanced.clone()
        };
        Ok(match name {
            "balanced" => balanced,
            "draft" => draft,
            "preview" => Self { steps_zenith: 54, steps_horizon: 128, light_steps: 8, contrast: 1.0, ..draft },
            "high" => Self {
                steps_zenith: 192,
                steps_horizon: 512,
                big_step: 3,
                light_steps: 48,
                light_share: 0.01,
                min_transmittance: 0.002,
                contrast: 0.0,
                path_samples: 256,
                ..balanced
            },
            "reference" => Self { tolerance: 1e-3, path_samples: 1024, ..balanced },
            // "A sample and five more in a cone"; the sixth is the far one.
            "nubis2015" => published,
            // Options A to D of the text: big steps of three, ten empty samples, light samples always full.
            "thesis2018" => Self { big_step: 3, empty_samples: 10, cheap_light: 1.0, ..published },
            "vsu2022" => Self {
                steps_zenith: 250,
                steps_horizon: 250,
                light_steps: 64,
                light_distance: 2000.0,
                far_sample: false,
                cheap_light: 1.0,
                ..published
            },
            _ => return Err(Error::parameter("quality", format!("{name:?}"), format!("one of {:?}", Self::NAMES))),
        })
    }

    /// Most iterations of the loops of a ray. lavapipe ends loops without a word after 65,535 of them summed over a shader
    /// (docs/numerics.md); a second deck, which gets a third more light samples (light.wgsl), stays below that from 40,000.
    fn turns(&self) -> u32 {
        // Growing steps may be twice as many (passes/march.wgsl).
        let steps = self.steps_zenith.max(self.steps_horizon) * if self.step_growth > 0.0 { 2 } else { 1 };
        // What is lit as one has gathered more than its share; the rest of the ray is one more.
        let groups = (1.0 / self.light_share + 1.0).min(steps as f32) as u32;
        2 * steps + groups * (1 + self.light_steps)
    }

    /// Whether the user's grid is read in f32, and not filtered by the hardware in half floats.
    pub(crate) fn is_precise(&self, params: &Params) -> bool {
        self.tolerance > 0.0 || params.light.model == Model::Path
    }

    /// Most rays through a pixel that is wider than clouds (subrays.wgsl): 16, of which the mean is off by a tenth of that between
    /// cloud and none, or as many as lavapipe has iterations for, less those of a mean of the phase function.
    pub(crate) fn most_rays(&self) -> f32 {
        (48_000 / self.turns().max(1)).clamp(1, 16) as f32
    }

    /// Checks every value, and what no range can say.
    pub fn check(&self) -> Result<()> {
        check_block("quality", self)?;
        let turns = self.turns();
        if turns > 40_000 {
            return Err(Error::parameter(
                "quality.light_steps",
                self.light_steps,
                format!(
                    "so small that twice the view steps and the light samples of all groups, here {turns}, are at most 40000"
                ),
            ));
        }
        Ok(())
    }
}

fn check_block(name: &str, block: &dyn Block) -> Result<()> {
    for (index, field) in block.fields().iter().enumerate() {
        field.check(name, &block.get(index))?;
    }
    Ok(())
}

/// A block by the name that Python calls its type: every block of [`Params`], and [`Quality`].
pub fn block(type_name: &str) -> Option<Box<dyn Block>> {
    let Params {
        sun,
        moon,
        clouds,
        upper_clouds,
        weather,
        wind,
        wander,
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
        Box::new(wander),
        Box::new(drift),
        Box::new(high_clouds),
        Box::new(light),
        Box::new(atmosphere),
        Box::new(quality),
    ];
    blocks.into_iter().find(|block| block.type_name() == type_name)
}

/// Where each block starts in the `params` uniform, the last of them `quality`, and the size of the whole, in bytes.
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

/// The words of the `params` uniform.
pub fn uniform(params: &Params, quality: &Quality) -> Vec<u32> {
    // Shaders see by the cover whether there are high clouds.
    let mut params = Cow::Borrowed(params);
    if !params.has_high_clouds() {
        params.to_mut().high_clouds.coverage = 0.0;
    }
    let blocks = params.blocks().into_iter().map(|(_, block)| block);
    schema::words(&blocks.chain([quality as &dyn Block]).collect::<Vec<_>>())
}
