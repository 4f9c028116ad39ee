"""The weather map: its noises, its edges, files, mixtures of weathers, and when it is baked."""

import itertools
import pickle
import re
import struct
import zlib

import numpy as np
import pytest

import nubis
import ref64
import ref64_noise
from nubis import FileError, ParameterError, Params, Weather, WeatherBlend
from nubis.testing import probe

NOISES = ["worley_perlin", "worley_simplex", "perlin_worley"]
EDGES = ["repeat", "mirror", "clamp"]
# A half float between 0.5 and 1, cut or rounded.
STEP = 2.0**-11


def maps(n, size=(6, 9), low=0.0):
    rng = np.random.default_rng(11)
    return [rng.uniform(low, 1, (*size, 3)).astype(np.float32) for _ in range(n)]


@pytest.mark.parametrize("noise", NOISES)
class TestNoises:
    def test_seeds(self, renderer, noise):
        """The same one gives the same map to the bit, on another renderer too; others differ."""

        def bake(renderer, seed):
            return renderer.weather_map(Params(weather=Weather(noise=noise, seed=seed)))

        first, again = bake(renderer(), 5), bake(nubis.Renderer(1, 1), 5)
        assert first.dtype == np.float32 and first.shape == (512, 512, 3)
        np.testing.assert_array_equal(first, again)
        others = [bake(renderer(), seed) for seed in (6, 4_000_000_007)]
        for a, b in itertools.combinations([first, *others], 2):
            for channel in range(3):
                # As different as the numbers of one map are among themselves.
                difference = np.abs(a - b)[..., channel].mean()
                assert difference > 0.8 * a[..., channel].std()

    @pytest.mark.slow
    def test_more_coverage_is_more_cloud(self, renderer, noise):
        """At every point of the field, and in the picture, from a clear sky to an overcast one."""
        sky = nubis.scenes["fair_weather"][1].with_(
            **{"weather.noise": noise, "high_clouds.coverage": 0.0}
        )
        rng = np.random.default_rng(2)
        points = rng.uniform([-30e3, -30e3, 1200], [30e3, 30e3, 3200], (20_000, 3))
        camera = nubis.Camera.fisheye((0, 0, 2))
        before, cover = np.zeros(len(points)), []
        for coverage in (0.0, 0.35, 0.5, 0.65, 0.8, 1.0):
            params = sky.with_(**{"clouds.coverage": coverage})
            density = renderer().density(points, params)
            # The remaps cancel digits where little is left of the shape.
            assert (density >= before - 1e-5 * params.clouds.extinction).all()
            assert coverage == 0 or density.mean() > 1.2 * before.mean()
            before = density
            cover.append(1 - renderer(48, 48).render_layers(camera, params)["transmittance"].mean())
        assert cover[0] < 1e-6 and (np.diff(cover) > 0.0005).all(), cover

    def test_all_noises_cover_alike(self, renderer, noise):
        """So that one can stand for another without a new `clouds.coverage`."""
        skies = [Params(weather=Weather(noise=noise, seed=seed)) for seed in range(6)]
        coverage = np.stack([renderer().weather_map(sky) for sky in skies])[..., 0]
        assert coverage.mean() == pytest.approx(0.47, abs=0.06)
        assert 0.2 < coverage.std() < 0.4
        assert coverage.min() == 0 and coverage.max() == 1

    def test_scale(self, renderer, noise):
        """Twice the distance between clouds: half as many of them along a line across the map."""

        def crossings(scale):
            weather = Weather(noise=noise, scale=scale, variety=0.0)
            coverage = renderer().weather_map(Params(weather=weather))[..., 0]
            above = coverage > np.median(coverage)
            return (above[:, 1:] != above[:, :-1]).mean()

        # Small shapes have edges that no texel resolves.
        assert 1.6 < crossings(5000.0) / crossings(10_000.0) < 2.2

    def test_variety(self, renderer, noise):
        """More of it: the mean over regions of several clouds varies more; of types alike."""

        def regions(**changes):
            map = renderer().weather_map(Params(weather=Weather(noise=noise, **changes)))
            return map.reshape(8, 64, 8, 64, 3).mean(axis=(1, 3)).std(axis=(0, 1))

        spread = [regions(variety=v)[0] for v in (0.0, 0.5, 1.0)]
        assert spread[0] < spread[1] < spread[2]
        spread = [regions(type_variety=v)[1] for v in (0.0, 0.9, 2.0)]
        assert spread[0] < 1e-6 and 1.5 < spread[2] / spread[1] < 2.3


def edge_sky(map, edge, **changes):
    values = {
        "weather.map": map,
        "weather.edge": edge,
        "weather.extent": 20_000.0,
        "clouds.coverage": 0.7,
        "wind.speed": 0.0,
        "wind.detail_speed": 0.0,
        "wind.updraft": 0.0,
        "wind.weather_speed": 10.0,
        "wind.weather_direction": 90.0,
    }
    return Params().with_(**(values | changes))


def test_what_lies_beyond_the_edge(renderer, rng):
    """East of the map: the same, its mirror image, or its last column."""
    (map,) = maps(1, (8, 8))
    points = rng.uniform([-10e3, -10e3, 1200], [10e3, 10e3, 3200], (20_000, 3))
    beyond = {
        "repeat": map,
        "mirror": map[:, ::-1],
        "clamp": np.repeat(map[:, -1:], 8, axis=1),
    }
    # The weather goes west by one map, so that what was beyond is here; the noises stay.
    west = {"wind.weather_direction": 270.0}
    for edge, there in beyond.items():
        got = renderer().density(points, edge_sky(map, edge, **west), time=2000.0)
        want = renderer().density(points, edge_sky(there, edge), time=0.0)
        # Half a texel from the rim what is beyond it is read too, and there the maps differ.
        inside = (np.abs(points[:, :2] - 400 * points[:, 2:] / 2000) < 8000).all(axis=1)
        assert (want[inside] > 0).mean() > 0.05
        np.testing.assert_allclose(got[inside], want[inside], atol=2e-4 * 0.15)


@pytest.mark.parametrize(("edge", "tiles"), [("repeat", 1), ("mirror", 2)])
def test_edges_after_a_year(renderer, rng, edge, tiles):
    """Whole periods of drift change nothing, however many there were."""
    (map,) = maps(1, (8, 8))
    points = rng.uniform([-30e3, -30e3, 1200], [30e3, 30e3, 3200], (5000, 3))
    sky = edge_sky(map, edge)
    now = renderer().density(points, sky)
    later = renderer().density(points, sky, time=2000.0 * tiles * 15_000)
    assert (now > 0).mean() > 0.05
    np.testing.assert_allclose(later, now, atol=1e-6)
    half = renderer().density(points, sky, time=2000.0 * tiles * 15_000.5)
    assert np.abs(half - now).max() > 0.01


def test_a_clamped_map_far_away(renderer, rng):
    """After ages of drift only its rim is in sight: as the rim alone, and never NaN."""
    (map,) = maps(1, (8, 8))
    points = rng.uniform([-30e3, -30e3, 1200], [30e3, 30e3, 3200], (2000, 3))
    sky = edge_sky(map, "clamp", **{"wind.weather_direction": 90.0})
    # It has gone east: here is what was west of it.
    rim = np.repeat(map[:, :1], 8, axis=1)
    want = renderer().density(points, edge_sky(rim, "clamp"))
    for time in (1e5, 1e9, 1e300):
        got = renderer().density(points, sky, time=time)
        np.testing.assert_allclose(got, want, atol=1e-6)
    assert np.isfinite(renderer().density(points, sky, time=1.7e308)).all()


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("edge", EDGES)
@pytest.mark.parametrize("size", [(128, 96), (100, 37)])
def test_majorants_beyond_the_edge(rng, edge, size):
    """Never exceeded within their reach: in the map, across its edge and far beyond. Cloud stands
    in the north-east alone, so that it matters which side of the map is beyond which.
    """
    map = np.zeros((*size, 3), np.float32)
    map[: size[0] // 3, size[1] // 2 :, 0] = 1
    map[..., 1] = 0.5
    changes = {"light.model": "path", "wind.shear": 1500.0, "clouds.coverage": 0.5}
    params = edge_sky(map, edge, **changes)
    clouds, reach_of = params.clouds, "majorant_at(x.xyz, altitude_at(x.xyz))"

    def ask(expression, points):
        inputs = np.hstack([points, np.zeros((len(points), 1))])
        return probe(expression, inputs, imports=["majorant", "shell"], params=params)

    points = rng.uniform([-35e3, -35e3, clouds.base], [35e3, 35e3, clouds.top], (40_000, 3))
    # Most of them about the edges and corners.
    points[:20_000, :2] = rng.choice([-10e3, 10e3], (20_000, 2)) + rng.uniform(
        -600, 600, (20_000, 2)
    )
    density = ask("vec4f(cloud_density_at(x.xyz, altitude_at(x.xyz), 0.0))", points)[:, 0]
    points, density = points[density > 0], density[density > 0]
    assert len(points) > 1000
    reach = ask(f"vec4f({reach_of}.reach)", points[:1])[0, 0]
    way = ref64.normalized(rng.normal(size=points.shape))
    start = points + way * reach * rng.uniform(0, 0.999, (len(points), 1))
    bound = ask(f"vec4f({reach_of}.density)", start)[:, 0]
    inside = (start[:, 2] > clouds.base + 50) & (start[:, 2] < clouds.top - 50)
    assert (density <= bound + 1e-4)[inside].all()
    # And no more than they must be: the eastern clouds are beyond the western edge in one case.
    west = rng.uniform([-8900, 4000, 1250], [-8500, 9000, 1300], (1000, 3))
    assert (ask(f"vec4f({reach_of}.density)", west)[:, 0] > 0).any() == (edge == "repeat")


@pytest.mark.slow
@pytest.mark.parametrize("edge", EDGES)
def test_paths_beyond_the_edge(renderer, edge):
    """Paths of one scattering and the reference see the same clouds past the edge of a map."""
    map = np.zeros((128, 128, 3), np.float32)
    map[..., 1] = 0.6
    map[:, 90:, 0] = 0.9  # cloud in the east,
    map[:, :26, 0] = 0.6  # and some in the west
    params = ref64.smooth_params(
        **{
            "weather.map": map,
            "weather.edge": edge,
            "weather.extent": 8000.0,
            "clouds.coverage": 0.6,
            "clouds.type": 0.8,
            "light.model": "single",
            "sun.elevation": 50.0,
        }
    )
    # From the eastern part, across the edge, to the east.
    camera = nubis.Camera.look_at((2500, 0, 100), (6500, 0, 1900), fov_y=30)
    want = renderer(12, 8, "reference").render_layers(camera, params)
    method = nubis.quality("balanced").replace(path_samples=400, path_scatterings=1)
    path = params.with_(**{"light.model": "path", "light.ambient_gain": 0.0})
    got = nubis.Renderer(12, 8, quality=method).render_layers(camera, path)
    assert 0.05 < want["transmittance"].mean() < 0.95
    error = got["transmittance"] - want["transmittance"]
    # Of 400 paths through 96 pixels: 0.5 / sqrt(38400) at most.
    assert abs(error.mean()) < 4 * 0.5 / np.sqrt(400 * 96)
    assert np.abs(error).max() < 5 * 0.5 / np.sqrt(400)


def png(path, pixels, depth):
    """A PNG written here: unfiltered rows of big-endian numbers."""

    def chunk(kind, data):
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    height, width, channels = pixels.shape
    colour = {1: 0, 2: 4, 3: 2, 4: 6}[channels]
    rows = pixels.astype(">u2" if depth == 16 else "u1")
    data = b"".join(b"\0" + row.tobytes() for row in rows)
    head = struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, 0)
    parts = chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(data)) + chunk(b"IEND", b"")
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + parts)


class TestFiles:
    @pytest.mark.parametrize("depth", [8, 16])
    @pytest.mark.parametrize("channels", [1, 2, 3, 4])
    def test_png(self, tmp_path, rng, depth, channels):
        whole = rng.integers(0, 2**depth, (5, 7, channels))
        whole[0, 0], whole[0, 1] = 0, 2**depth - 1
        png(tmp_path / "map.png", whole, depth)
        map = nubis.load_map(tmp_path / "map.png")
        assert map.dtype == np.float32 and map.shape == (5, 7, 3)
        want = whole / (2**depth - 1)
        if channels < 3:
            np.testing.assert_allclose(map[..., 0], want[..., 0], atol=1e-7)
            assert (map[..., 1] == 0.5).all() and (map[..., 2] == 0).all()
        else:
            np.testing.assert_allclose(map, want[..., :3], atol=1e-7)
        assert Weather(map=map).map.shape == (5, 7, 3)

    def test_exr_and_hdr(self, tmp_path):
        (map,) = maps(1)
        for name, tolerance in (("map.exr", 0), ("map.hdr", 1 / 128)):
            nubis.save(tmp_path / name, map)
            got = nubis.load_map(str(tmp_path / name))
            # Radiance keeps 8 bits of the largest channel.
            np.testing.assert_allclose(got, map, atol=tolerance)

    @pytest.mark.parametrize("channels", ["RGB", "RGBA", "Y", "V"])
    @pytest.mark.parametrize("dtype", [np.float16, np.float32])
    def test_exr_of_others(self, tmp_path, rng, channels, dtype):
        """Written by the OpenEXR library."""
        openexr = pytest.importorskip("OpenEXR")
        pixels = rng.uniform(0, 1, (5, 7, len(channels))).astype(dtype)
        planes = {name: pixels[..., i].copy() for i, name in enumerate(channels)}
        openexr.File({"type": openexr.scanlineimage}, planes).write(str(tmp_path / "map.exr"))
        map = nubis.load_map(tmp_path / "map.exr")
        np.testing.assert_array_equal(map[..., 0], pixels[..., 0].astype(np.float32))
        if len(channels) >= 3:
            np.testing.assert_array_equal(map, pixels[..., :3].astype(np.float32))

    def test_npy(self, tmp_path, rng):
        path = tmp_path / "map.npy"
        (map,) = maps(1)
        for given, want in [
            (map, map),
            (map.astype(np.float64)[..., 0], map[..., 0]),
            (np.uint8([[0, 51], [102, 255]]), np.float32([[0, 0.2], [0.4, 1]])),
            (np.uint16([[0, 13107, 65535]]), np.float32([[0, 0.2, 1]])),
        ]:
            np.save(path, given)
            got = nubis.load_map(path)
            np.testing.assert_allclose(got if want.ndim == 3 else got[..., 0], want, atol=1e-7)

    @pytest.mark.parametrize(
        ("name", "content", "words"),
        [
            ("map.npy", np.full((2, 2, 3), 1.5), "values from 0 to 1 (it has 1.5)"),
            ("map.npy", np.full((2, 2, 3), np.nan), "values from 0 to 1 (it has nan)"),
            ("map.npy", np.zeros((2, 2, 2)), "(2, 2, 2)"),
            ("map.npy", np.zeros((2, 2, 3), np.int64), "int64"),
            ("map.npy", np.zeros(3), "(3,)"),
            ("map.npy", np.zeros((1, 8193)), "8192"),
            ("map.npy", b"no array", "numpy.save"),
            ("map.png", b"no picture", "a picture that is whole"),
            ("map.exr", b"no picture", "a picture that is whole"),
            ("map.hdr", b"no picture", "a picture that is whole"),
            ("map.jpg", b"", ".png, .exr, .hdr or .npy"),
        ],
    )
    def test_what_is_no_map(self, tmp_path, name, content, words):
        path = tmp_path / name
        if isinstance(content, bytes):
            path.write_bytes(content)
        else:
            np.save(path, content)
        with pytest.raises(ParameterError, match=re.escape(words)) as error:
            nubis.load_map(path)
        assert str(error.value).startswith("path = ") and str(path) in str(error.value)

    @pytest.mark.parametrize("name", ["none.png", "none.exr", "none.npy", "."])
    def test_a_file_that_is_not_there(self, tmp_path, name):
        if name == ".":
            (tmp_path / "map.png").mkdir()
            name = "map.png"
        with pytest.raises((FileError, ParameterError), match=re.escape(name)):
            nubis.load_map(tmp_path / name)
        assert issubclass(FileError, OSError)


def texels(params, size):
    """The map, texel by texel, from the shaders."""
    y, x = np.mgrid[: size[0], : size[1]]
    wgsl = "textureLoad(weather_map, vec2i(x.xy), 0)"
    got = probe(wgsl, np.stack([x, y], -1).reshape(-1, 2), imports=["bindings"], params=params)
    return got.reshape(*size, 4)[..., :3]


class TestMixtures:
    def test_the_map_that_is_read(self, renderer):
        """`weather_map` is what shaders read: an own map, one from noise, a mixture."""
        a, b = maps(2)
        own = Params(weather=Weather(map=a))
        np.testing.assert_allclose(renderer().weather_map(own), a, atol=STEP)
        mixed = own.replace(weather_mix=((Weather(map=b), 0.25),))
        for params, size in ((own, (6, 9)), (mixed, (6, 9)), (Params(), (512, 512))):
            map = renderer().weather_map(params)
            np.testing.assert_array_equal(map, texels(params, size))

    @pytest.mark.parametrize("count", [1, 2, 3, 4, 7])
    def test_a_mixture_is_the_weighted_sum(self, renderer, rng, count):
        base, *others = maps(count + 1)
        weights = rng.dirichlet(np.ones(count + 1))
        mix = tuple(
            (Weather(map=map), w) for map, w in zip(others, weights[1:].tolist(), strict=True)
        )
        got = renderer().weather_map(Params(weather=Weather(map=base), weather_mix=mix))
        want = np.tensordot(weights, ref64_noise.half([base, *others]), 1)
        # A step each time that four are mixed, and that of filter weights at the texels' centres.
        np.testing.assert_allclose(got, want, atol=(1 + count // 3) * STEP + 1e-4)

    def test_maps_from_noise(self, renderer):
        """With parameters of their own."""
        a, b = Weather(seed=3), Weather(seed=4, noise="perlin_worley", scale=9000.0, variety=0.1)
        one, other = (renderer().weather_map(Params(weather=w)) for w in (a, b))
        for base, rest, weight in ((a, b, 0.3), (b, a, 0.7)):
            got = renderer().weather_map(Params(weather=base, weather_mix=((rest, weight),)))
            want = 0.7 * one.astype(np.float64) + 0.3 * other
            np.testing.assert_allclose(got, want, atol=STEP + 1e-4)

    def test_maps_of_different_sizes(self, renderer):
        """As the march would have read each: linear between texels, across the edge too."""
        rng = np.random.default_rng(1)
        small = rng.uniform(0, 1, (4, 6, 3)).astype(np.float32)
        large = rng.uniform(0, 1, (20, 18, 3)).astype(np.float32)
        at = np.stack(np.meshgrid((np.arange(18) + 0.5) / 18, (np.arange(20) + 0.5) / 20), -1)
        for edge in EDGES:
            fields = [
                ref64_noise.sample(
                    lambda t, m=m: ref64_noise.half(m[t[..., 1], t[..., 0]]),
                    m.shape[1::-1],
                    at.reshape(-1, 2),
                    edge,
                )
                for m in (small, large)
            ]
            want = (0.4 * fields[0] + 0.6 * fields[1]).reshape(20, 18, 3)
            for a, b, weight in ((small, large, 0.6), (large, small, 0.4)):
                mix = ((Weather(map=b, edge=edge), weight),)
                got = renderer().weather_map(
                    Params(weather=Weather(map=a, edge=edge), weather_mix=mix)
                )
                np.testing.assert_allclose(got, want, atol=STEP + 3e-4)

    def test_the_field_follows(self, renderer, rng):
        """All of the weight is the other weather, none of it this one, and equal ones are one."""
        a, b = maps(2)
        points = rng.uniform([-30e3, -30e3, 1200], [30e3, 30e3, 3200], (4000, 3))
        one, other = Params(weather=Weather(map=a)), Params(weather=Weather(map=b))
        want = {p: renderer().density(points, p) for p in (one, other)}
        assert np.abs(want[one] - want[other]).max() > 0.05
        for params, same in [
            (one.replace(weather_mix=((Weather(map=b), 1.0),)), other),
            (one.replace(weather_mix=((Weather(map=b), 0.0),)), one),
            (one.replace(weather_mix=((Weather(map=a), 0.6),)), one),
            (one.replace(weather_mix=((Weather(map=b), 0.5), (Weather(map=b), 0.5))), other),
        ]:
            np.testing.assert_array_equal(renderer().density(points, params), want[same])

    @pytest.mark.slow
    @pytest.mark.parametrize("method", ["path", "shadows"])
    def test_what_is_baked_from_the_map_follows(self, method):
        """Majorants, and shadows on ground and air: as on a renderer that has seen no other
        mixture.
        """
        a, b = (
            0.3 * part + least for part, least in zip(maps(2, (16, 16)), (0.3, 0.7), strict=True)
        )
        quality = nubis.quality("draft").replace(path_samples=8)
        sky = Params(weather=Weather(map=a, extent=20_000.0)).with_(**{"clouds.coverage": 0.6})
        if method == "path":
            sky = sky.with_(**{"light.model": "path"})
        camera = nubis.Camera.look_at((0, 0, 2), (0, 1000, 1500))
        mixed = sky.replace(weather_mix=((Weather(map=b, extent=20_000.0), 0.5),))
        used, fresh = (
            nubis.Renderer(24, 16, quality=quality),
            nubis.Renderer(24, 16, quality=quality),
        )
        before = used.render(camera, sky)
        after = used.render(camera, mixed)
        np.testing.assert_array_equal(after, fresh.render(camera, mixed))
        assert np.abs(after - before).max() > 0.1

    def test_copies(self, tmp_path):
        """Equality, hash, repr, pickle, plain values and files know mixtures."""
        (map,) = maps(1)
        weathers = [Weather(map=map), Weather(seed=9, noise="worley_simplex")]
        params = Params(weather_mix=[(w, 0.1 * (i + 1)) for i, w in enumerate(weathers)])
        assert params.weather_mix == ((weathers[0], 0.1), (weathers[1], 0.2))
        other = params.replace(weather_mix=((weathers[0], 0.1), (weathers[1], 0.3)))
        assert len({params, other, Params(), pickle.loads(pickle.dumps(params))}) == 3
        assert Params.from_dict(params.to_dict()) == params
        params.save(tmp_path / "sky.toml")
        assert Params.load(tmp_path / "sky.toml") == params
        assert "weather_mix" not in Params().to_dict()
        wide = params.weather.replace(extent=70_000.0)
        changed = params.replace(weather=wide, weather_mix=((Weather(extent=70_000.0), 0.5),))
        assert Params.from_dict(changed.to_dict()) == changed
        plain = params.replace(weather_mix=params.weather_mix[1:])
        assert eval(repr(plain), vars(nubis)) == plain
        assert params.with_(**{"clouds.coverage": 0.7}).weather_mix == params.weather_mix

    @pytest.mark.parametrize(
        ("mix", "words"),
        [
            (((Weather(), 1.5),), "weather_mix[0] weight = 1.5"),
            (((Weather(), -0.1),), "weather_mix[0] weight = -0.1"),
            (((Weather(), float("nan")),), "weather_mix[0] weight = NaN"),
            (((Weather(), "1"),), "weather_mix[0] weight"),
            (((Weather(), 0.7), (Weather(seed=1), 0.7)), "weights of at most 1 together"),
            (((Weather(extent=1e4), 0.5),), "weather_mix[0].extent = 10000"),
            (((Weather(edge="clamp"), 0.5),), 'weather_mix[0].edge = "clamp"'),
            (((nubis.Sun(), 0.5),), "nubis.Weather"),
            ((Weather(), 0.5), "pairs"),
            (5, "weather_mix = 5"),
            (None, "weather_mix = None"),
        ],
    )
    def test_what_is_no_mixture(self, mix, words):
        with pytest.raises(ParameterError, match=re.escape(words)) as error:
            Params(weather_mix=mix)
        assert "is not allowed: it must be" in str(error.value)

    @pytest.mark.parametrize(
        ("text", "words"),
        [
            ("[weather_mix]\nweight = 1", "weather_mix"),
            ("[[weather_mix]]\nseed = 1", "weather_mix[0].weight"),
            ("[[weather_mix]]\nweight = 1\nsead = 1", "weather_mix[0].sead"),
            ("[[weather_mix]]\nweight = 2", "weather_mix[0] weight = 2"),
        ],
    )
    def test_bad_toml(self, tmp_path, text, words):
        (tmp_path / "sky.toml").write_text(text)
        with pytest.raises(ParameterError, match=re.escape(words)):
            Params.load(tmp_path / "sky.toml")

    def test_one_field_of_a_mixture(self):
        with pytest.raises(ParameterError, match=re.escape("replace(weather_mix=...)")):
            Params().with_(**{"weather_mix.weight": 1.0})


def shares(weather, mix):
    """Each weather's share of a mixture."""
    found = {weather: 1 - sum(w for _, w in mix)}
    for other, weight in mix:
        found[other] = found.get(other, 0) + weight
    return {w: share for w, share in found.items() if share > 1e-12}


class TestWeatherBlend:
    A, B, C = (Weather(seed=seed) for seed in (1, 2, 3))

    def test_a_change_is_linear(self):
        """Over 30 s, as in thesis2018; before and after there is nothing to mix."""
        blend = WeatherBlend(self.A).change(self.B, at=100.0)
        for time in (-1e9, 0.0, 99.99, 100.0):
            assert blend.at(time) == (self.A, ())
        for time in (107.5, 115.0, 129.0):
            share = (time - 100) / 30
            assert shares(*blend.at(time)) == pytest.approx({self.A: 1 - share, self.B: share})
        for time in (130.0, 131.0, 1e9):
            assert blend.at(time) == (self.B, ())

    @pytest.mark.parametrize("at", [0.1, 1e7 / 3, -7.7])
    def test_it_ends_exactly(self, at):
        for seconds in (0.0, 0.3, 30.0, 1 / 7):
            blend = WeatherBlend(self.A).change(self.B, at, seconds)
            assert blend.at(at + seconds) == (self.B, ())
            before = np.nextafter(at, -np.inf)
            assert blend.at(before) == (self.A, ())

    def test_an_interrupted_change(self):
        """It goes on under the next one, and nothing jumps when that begins."""
        blend = WeatherBlend(self.A).change(self.B, 0.0, 10.0).change(self.C, 5.0, 10.0)
        assert shares(*blend.at(5.0)) == pytest.approx({self.A: 0.5, self.B: 0.5})
        assert shares(*blend.at(7.0)) == pytest.approx(
            {self.A: 0.8 * 0.3, self.B: 0.8 * 0.7, self.C: 0.2}
        )
        assert shares(*blend.at(12.0)) == pytest.approx({self.B: 0.3, self.C: 0.7})
        assert blend.at(15.0) == (self.C, ())
        # And back to what it was.
        back = blend.change(self.A, 8.0, 1.0)
        assert back.at(9.0) == (self.A, ()) == back.at(100.0)
        # Given in any order.
        assert WeatherBlend(self.A, tuple(reversed(back.changes))) == back
        assert hash(WeatherBlend(self.A, list(reversed(back.changes)))) == hash(back)

    def test_shares_never_jump(self, rng):
        """Many changes that interrupt each other: no share moves faster than the quickest."""
        blend = WeatherBlend(self.A)
        for seed in range(12):
            blend = blend.change(Weather(seed=seed % 5), rng.uniform(0, 60), rng.uniform(5, 30))
        quickest = min(change.seconds for change in blend.changes)
        before = shares(*blend.at(0.0))
        for time in np.arange(0.05, 100, 0.05):
            now = shares(*blend.at(time))
            assert sum(now.values()) == pytest.approx(1)
            moved = sum(abs(now.get(w, 0) - before.get(w, 0)) for w in {**now, **before})
            # Several changes run at once.
            assert moved < 12 * 2 * 0.05 / quickest
            before = now

    @pytest.mark.parametrize(
        ("make", "words"),
        [
            (lambda a: WeatherBlend(1), "weather = 1"),
            (lambda a: WeatherBlend(a, 5), "changes = 5"),
            (lambda a: WeatherBlend(a, [(a,)]), "changes = "),
            (lambda a: WeatherBlend(a).change(None, 0.0), "changes[0].weather"),
            (
                lambda a: WeatherBlend(a).change(Weather(extent=1e3), 0.0),
                "changes[0].weather.extent",
            ),
            (
                lambda a: WeatherBlend(a).change(Weather(edge="clamp"), 0.0),
                "changes[0].weather.edge",
            ),
            (lambda a: WeatherBlend(a).change(a, float("nan")), "changes[0].at"),
            (lambda a: WeatherBlend(a).change(a, 0.0, -1.0), "changes[0].seconds = -1.0"),
            (lambda a: WeatherBlend(a).change(a, 0.0, float("inf")), "changes[0].seconds"),
            (lambda a: WeatherBlend(a).at(float("inf")), "time"),
            (lambda a: WeatherBlend(a).apply(a, 0.0), "params"),
        ],
    )
    def test_what_is_no_blend(self, make, words):
        with pytest.raises(ParameterError, match=re.escape(words)):
            make(self.A)

    @pytest.mark.slow
    def test_no_frame_jumps(self, renderer):
        """Map and picture change from frame to frame by no more than a change's pace, also where
        one interrupts another; without the blend they jump.
        """
        camera, sky = nubis.scenes["fair_weather"]
        still = {"wind.speed": 0.0, "wind.detail_speed": 0.0, "wind.updraft": 0.0}
        sky = sky.with_(**still, **{"wind.weather_speed": 0.0, "high_clouds.coverage": 0.0})
        blend = WeatherBlend(self.A).change(self.B, 0.0, 8.0).change(self.C, 5.0, 8.0)
        frames = [blend.apply(sky, t) for t in np.arange(-0.5, 14.5, 0.5)]
        assert frames[0].weather_mix == () == frames[-1].weather_mix
        assert frames[-1] == sky.replace(weather=self.C)
        maps = np.stack([renderer().weather_map(params) for params in frames])
        steps = np.abs(np.diff(maps, axis=0))
        # Two changes at once, each of a sixteenth, of what differs by at most 1; and rounding.
        assert steps.max() < 2 / 16 + 3 * STEP
        pictures = np.stack(
            [
                np.array(renderer(48, 27).render(camera, params, background=None)[..., 3])
                for params in frames
            ]
        )
        jump = np.abs(pictures[0] - pictures[-1]).mean()
        moved = np.abs(np.diff(pictures, axis=0)).mean(axis=(1, 2))
        assert moved[0] == moved[-1] == 0 and (moved[2:-3] > 0).all()
        assert moved.max() < 0.35 * jump, (moved, jump)


class TestBakes:
    """What runs again, by the passes that are timed."""

    SEED = 2_000_000_000

    @pytest.fixture(autouse=True)
    def _without_files(self, monkeypatch):
        """What is found on disk is not baked."""
        monkeypatch.setenv("NUBIS_CACHE", "off")

    def ran(self, renderer, params):
        renderer.render(nubis.Camera.equirect((0, 0, 2)), params)
        return {"weather", "weather_mix"} & set(renderer.timings)

    @pytest.mark.slow
    def test_a_map_is_baked_when_its_own_inputs_change(self):
        renderer = nubis.Renderer(8, 4, quality="draft")
        sky = Params(weather=Weather(seed=self.SEED))
        if not self.ran(renderer, sky):
            pytest.skip("no timestamps")
        assert self.ran(renderer, sky) == set()
        for name, value in [
            ("clouds.coverage", 0.6),
            ("clouds.seed", 2),
            ("wind.weather_speed", 3.0),
            ("weather.edge", "mirror"),
            ("sun.elevation", 10.0),
        ]:
            sky = sky.with_(**{name: value})
            assert self.ran(renderer, sky) == set(), name
        for name, value in [
            ("weather.seed", self.SEED + 1),
            ("weather.scale", 4321.0),
            ("weather.variety", 0.321),
            ("weather.type_variety", 0.321),
            ("weather.noise", "worley_simplex"),
            ("weather.extent", 54_321.0),
        ]:
            sky = sky.with_(**{name: value})
            assert self.ran(renderer, sky) == {"weather"}, name

    @pytest.mark.slow
    def test_a_weight_runs_the_mixture_alone(self):
        renderer = nubis.Renderer(8, 4, quality="draft")
        a, b, c = (Weather(seed=self.SEED + 10 + i) for i in range(3))

        def sky(*mix):
            return Params(weather=a, weather_mix=mix)

        if not self.ran(renderer, sky()):
            pytest.skip("no timestamps")
        assert self.ran(renderer, sky((b, 0.1))) == {"weather", "weather_mix"}
        assert self.ran(renderer, sky((b, 0.2))) == {"weather_mix"}
        assert self.ran(renderer, sky((b, 0.2))) == set()
        # The same mixture from the other side, and then one that is new.
        assert self.ran(renderer, Params(weather=b, weather_mix=((a, 0.8),))) == {"weather_mix"}
        assert self.ran(renderer, sky((b, 0.2), (c, 0.3))) == {"weather", "weather_mix"}
        coverage = sky((b, 0.2), (c, 0.3)).with_(**{"clouds.coverage": 0.7})
        assert self.ran(renderer, coverage) == set()
        # What the last picture needed is kept: a drag back and forth bakes nothing.
        assert self.ran(renderer, sky()) == set()
        assert self.ran(renderer, sky((b, 0.5))) == {"weather_mix"}
        # What it did not is not.
        assert self.ran(renderer, sky()) == set() == self.ran(renderer, sky())
        assert self.ran(renderer, Params(weather=b)) == {"weather"}


class TestAnimation:
    def run(self, skies):
        """Which frames were reprojected from the one before."""
        camera = nubis.scenes["fair_weather"][0]
        renderer = nubis.Renderer(48, 27, quality="draft")
        shots = ((camera, sky, 0.1 * i) for i, sky in enumerate(skies))
        return ["reproject" in renderer.timings for _ in renderer.animate(shots)]

    @pytest.mark.slow
    def test_a_change_does_not_cut(self):
        a, b = Weather(seed=21), Weather(seed=22)
        blend = WeatherBlend(a).change(b, 0.0, 5.0)
        frames = [
            blend.apply(Params(), t)
            for t in [-1.0, *np.arange(-0.1, 0.5, 0.08), *np.arange(4.6, 5.2, 0.08), 6.0]
        ]
        reprojected = self.run(frames)
        if not any(reprojected):
            pytest.skip("no timestamps")
        # But for the one that leaves out the middle.
        assert reprojected == [False] + [True] * 8 + [False] + [True] * 8

    def test_another_weather_cuts(self):
        a, b = (Params(weather=Weather(seed=seed)) for seed in (21, 22))
        mixed = a.replace(weather_mix=((b.weather, 0.5),))
        wide = a.with_(**{"weather.extent": 50_000.0})
        mirrored = a.with_(**{"weather.edge": "mirror"})
        assert self.run([a, b, b, mixed, mixed, wide]) == [False, False, True, False, True, False]
        assert self.run([a, mirrored]) == [False, False]
