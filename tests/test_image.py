"""Linear pictures to screens and files."""

import struct
import zlib

import numpy as np
import OpenEXR
import pytest

import nubis
from nubis import FileError, ParameterError, _image, to_srgb8
from nubis.__main__ import main

TONE_MAPS = ["agx", "aces", "none"]


@pytest.fixture
def picture():
    """Three colours and an alpha, dark to far beyond white, wider than high."""
    frame = np.random.default_rng(3).lognormal(-1, 2, (5, 6, 4)).astype(np.float32)
    frame[..., 3] = np.linspace(0, 1, 30).reshape(5, 6)
    return frame


@pytest.mark.parametrize("tonemap", TONE_MAPS)
@pytest.mark.parametrize("channels", [3, 4])
def test_srgb8(picture, tonemap, channels):
    pixels = to_srgb8(picture[..., :channels], tonemap=tonemap)
    assert (
        pixels.shape == (5, 6, channels) and pixels.dtype == np.uint8 and pixels.flags.c_contiguous
    )
    if channels == 4:
        np.testing.assert_array_equal(pixels[..., 3], np.round(picture[..., 3] * 255))
        picture[..., :3] /= np.where(picture[..., 3:] > 0, picture[..., 3:], np.inf)
    np.testing.assert_array_equal(
        pixels[..., :3], to_srgb8(picture[..., :3].tolist(), tonemap=tonemap)
    )


@pytest.mark.parametrize("tonemap", TONE_MAPS)
def test_grey(tonemap):
    """Grey stays grey, more light is never darker, and black and white are reached."""
    ramp = np.concatenate([[0], np.logspace(-5, 3, 200)])
    ramp = np.repeat(ramp, 3).reshape(1, -1, 3)
    assert np.ptp(to_srgb8(ramp, tonemap=tonemap)[0].astype(int), axis=1).max() <= 1
    pixels = to_srgb8(ramp, tonemap=tonemap, dither=False)[0].astype(int)
    assert np.ptp(pixels, axis=1).max() <= 1
    assert (np.diff(pixels, axis=0) >= 0).all()
    assert pixels[0].max() <= 1 and pixels[-1].min() >= 254
    middle = to_srgb8(np.full((1, 1, 3), 0.18), tonemap=tonemap)[0, 0, 0]
    assert 60 < middle < 160


def test_no_tone_map_is_the_srgb_curve():
    """IEC 61966-2-1."""
    v = np.linspace(0, 1.2, 500)
    encoded = np.where(v <= 0.0031308, 12.92 * v, 1.055 * v ** (1 / 2.4) - 0.055).clip(0, 1)
    pixels = to_srgb8(np.repeat(v, 3).reshape(1, -1, 3), tonemap="none", dither=False)[0, :, 0]
    np.testing.assert_allclose(pixels, 255 * encoded, atol=0.51)


@pytest.mark.parametrize("tonemap", TONE_MAPS)
def test_exposure_is_in_stops(picture, tonemap):
    colours = picture[..., :3]
    for stops in (-2, 1, 3):
        exposed = to_srgb8(colours, exposure=stops, tonemap=tonemap)
        np.testing.assert_array_equal(
            exposed, to_srgb8(colours * np.float32(2.0**stops), tonemap=tonemap)
        )


@pytest.mark.parametrize("tonemap", TONE_MAPS)
def test_strange_numbers(tonemap):
    """Negative, huge and infinite radiance end at the ends of the range."""
    frame = np.array([[[-1, -1e-3, -1e30], [np.inf] * 3, [1e30] * 3]], dtype=np.float32)
    pixels = to_srgb8(frame, tonemap=tonemap)[0]
    assert pixels[0].max() <= 1 and pixels[1:].min() >= 254


@pytest.mark.parametrize(
    ("named", "call"),
    [
        ("tonemap", lambda f: to_srgb8(f, tonemap="filmic")),
        ("tonemap", lambda f: to_srgb8(f, tonemap=None)),
        ("exposure", lambda f: to_srgb8(f, exposure=float("nan"))),
        ("exposure", lambda f: to_srgb8(f, exposure="bright")),
        ("frame", lambda f: to_srgb8(f[0])),
        ("frame", lambda f: to_srgb8(f[..., :2])),
        ("frame", lambda f: to_srgb8(f[:0])),
        ("frame", lambda f: to_srgb8("sky")),
        ("frame", lambda f: to_srgb8(f * np.nan)),
        ("dither", lambda f: to_srgb8(f, dither="no")),
        ("dither", lambda f: nubis.save("sky.png", f, dither=2)),
        ("path", lambda f: nubis.save(3, f)),
        ("path", lambda f: nubis.save("sky.jpg", f)),
        ("path", lambda f: nubis.save("sky", f)),
        ("frame", lambda f: nubis.save("sky.npy", f[0])),
    ],
)
def test_wrong_arguments(picture, named, call):
    with pytest.raises(ParameterError, match="is not allowed") as error:
        call(picture)
    assert str(error.value).startswith(named)


def read_png(path):
    """The pixels of an 8-bit RGB or RGBA file without interlacing (W3C PNG, sections 5, 7, 9)."""
    data = path.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    at, compressed = 8, b""
    while at < len(data):
        length, name = struct.unpack_from(">I4s", data, at)
        chunk = data[at + 8 : at + 8 + length]
        assert struct.unpack_from(">I", data, at + 8 + length)[0] == zlib.crc32(name + chunk)
        if name == b"IHDR":
            width, height, depth, color, *rest = struct.unpack(">IIBBBBB", chunk)
            assert depth == 8 and rest == [0, 0, 0]
        compressed += chunk if name == b"IDAT" else b""
        at += 12 + length
    n = {2: 3, 6: 4}[color]
    rows = np.frombuffer(zlib.decompress(compressed), np.uint8).reshape(height, 1 + n * width)
    out = np.zeros((height + 1, width + 1, n), dtype=int)
    for y, (filtering, *row) in enumerate(rows.tolist(), start=1):
        for x, value in enumerate(np.reshape(row, (width, n)), start=1):
            a, b, c = out[y, x - 1], out[y - 1, x], out[y - 1, x - 1]
            p = a + b - c
            apart = np.abs([p - a, p - b, p - c])
            paeth = np.choose(apart.argmin(axis=0), [a, b, c])
            out[y, x] = (value + [0 * a, a, b, (a + b) // 2, paeth][filtering]) % 256
    return out[1:, 1:].astype(np.uint8)


@pytest.mark.parametrize("channels", [3, 4])
def test_png(picture, tmp_path, channels):
    frame = picture[..., :channels].copy()
    frame[..., 3:] = 1
    nubis.save(tmp_path / "sky.png", frame, exposure=1.0, tonemap="aces")
    expected = to_srgb8(frame, exposure=1.0, tonemap="aces")[..., :3]
    np.testing.assert_array_equal(read_png(tmp_path / "sky.png"), expected)


@pytest.mark.parametrize("tonemap", TONE_MAPS)
@pytest.mark.parametrize("exposure", [0.0, 2.0])
def test_alpha_does_not_change_a_colour(tmp_path, tonemap, exposure):
    """What covers a share of a pixel has the colour that it has where it covers all of it, at all
    shares, and in a file too.
    """
    alpha = np.linspace(0.004, 1, 200, dtype=np.float32)[:, None]
    colour = np.array([0.5, 0.2, 0.05], np.float32)
    frame = np.concatenate([colour * alpha, alpha], axis=1)[None]
    opaque = to_srgb8(colour[None, None], exposure, tonemap, dither=False)[0, 0]
    nubis.save(tmp_path / "c.PNG", frame, exposure=exposure, tonemap=tonemap, dither=False)
    for pixels in (to_srgb8(frame, exposure, tonemap, dither=False), read_png(tmp_path / "c.PNG")):
        assert np.abs(pixels[0, :, :3].astype(int) - opaque).max() <= 1
        np.testing.assert_array_equal(pixels[0, :, 3], np.rint(255 * alpha[:, 0]))


def test_alpha_by_the_srgb_curve():
    """A tenth of a pixel of radiance 0.5 is 188 (IEC 61966-2-1), and nothing is nothing."""
    frame = np.array([[[0.05, 0.05, 0.05, 0.1], [0, 0, 0, 0], [9, 9, 9, 0], [0.5, 0.5, 0.5, 1]]])
    pixels = to_srgb8(frame, tonemap="none", dither=False)[0]
    assert pixels.tolist() == [[188, 188, 188, 26], [0] * 4, [0] * 4, [188, 188, 188, 255]]


def _box_means(values, side):
    height, width = (n // side * side for n in values.shape)
    return values[:height, :width].reshape(height // side, side, width // side, side).mean((1, 3))


def test_slow_gradients_have_no_bands():
    """Means of 8 x 8 pixels follow a gradient of two steps over the picture to a twentieth of a
    step, where rounding is wrong by half a step; nothing is off by a step.
    """
    level = np.linspace(60, 62, 256)[:, None] + np.zeros((256, 128))
    encoded = level / 255
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    frame = np.repeat(linear[..., None], 3, axis=2)
    exact = _box_means(level, 8)
    for dither, most in [(True, 0.06), (False, 0.55)]:
        pixels = to_srgb8(frame, tonemap="none", dither=dither)[..., 0].astype(float)
        error = np.abs(_box_means(pixels, 8) - exact).max()
        assert error < most and (dither or error > 0.4)
        assert np.abs(pixels - level).max() <= (1 if dither else 0.51)


def test_dither_is_fixed_and_leaves_whole_steps(picture):
    for value in (0.0, 1.0, 4.0):
        flat = to_srgb8(np.full((70, 70, 3), value), tonemap="none")
        assert np.ptp(flat) == 0
    for channels in (3, 4):
        once, again = (to_srgb8(picture[..., :channels]) for _ in range(2))
        np.testing.assert_array_equal(once, again)
    tall = to_srgb8(np.full((130, 70, 3), 0.2), tonemap="none")
    np.testing.assert_array_equal(tall[:64], tall[64:128])
    assert np.ptp(tall) == 1 and (tall == tall[..., :1]).all()


@pytest.mark.parametrize("dither", [True, False])
def test_a_file_has_the_same_pixels(picture, tmp_path, dither):
    nubis.save(tmp_path / "sky.png", picture[..., :3], dither=dither)
    np.testing.assert_array_equal(
        read_png(tmp_path / "sky.png"), to_srgb8(picture[..., :3], dither=dither)
    )


@pytest.mark.parametrize(("channels", "name"), [(3, "RGB"), (4, "RGBA")])
def test_exr(picture, tmp_path, channels, name):
    path = tmp_path / "sky.exr"
    nubis.save(path, picture[..., :channels])
    pixels = OpenEXR.File(str(path)).channels()[name].pixels
    assert pixels.dtype == np.float32
    np.testing.assert_array_equal(pixels, picture[..., :channels])


@pytest.mark.parametrize("channels", [3, 4])
def test_npy(picture, tmp_path, channels):
    nubis.save(str(tmp_path / "sky.npy"), picture[..., :channels])
    pixels = np.load(tmp_path / "sky.npy")
    assert pixels.dtype == np.float32
    np.testing.assert_array_equal(pixels, picture[..., :channels])


def read_hdr(path):
    """As OpenCV, stb_image and Ward's rgbe.c read it: mantissa / 256 times a power of two."""
    header, _, rows = path.read_bytes().partition(b"\n\n")
    assert header.startswith(b"#?RADIANCE\n") and b"FORMAT=32-bit_rle_rgbe" in header
    size, _, data = rows.partition(b"\n")
    _, height, _, width = size.split()
    height, width = int(height), int(width)
    if width < 8:
        rgbe = np.frombuffer(data, np.uint8).reshape(height, width, 4)
    else:
        rgbe, at = np.zeros((height, 4, width), np.uint8), 0
        for row in rgbe:
            assert data[at : at + 4] == bytes([2, 2, width >> 8, width & 255])
            at += 4
            for channel in row:
                x = 0
                while x < width:
                    count = data[at]
                    run = count > 128
                    count -= 128 * run
                    values = data[at + 1 : at + 2 + (0 if run else count - 1)]
                    channel[x : x + count] = np.frombuffer(values, np.uint8)
                    x, at = x + count, at + 1 + len(values)
        rgbe = rgbe.transpose(0, 2, 1)
    rgbe = rgbe.astype(np.float64)
    return rgbe[..., :3] * 2.0 ** (rgbe[..., 3:] - 136) * (rgbe[..., 3:] > 0)


@pytest.mark.parametrize("width", [7, 500])
def test_hdr_is_rounded(rng, tmp_path, width):
    """To half a step of the largest colour's mantissa, 128 to 255, and right in the mean; the
    numbers are from the smallest to the largest of the format, and exact at powers of two.
    """
    scale = 2.0 ** rng.integers(-40, 40, (40, width, 1))
    frame = (scale * rng.random((40, width, 3))).astype(np.float32)
    frame[0, :6, 0] = [1.0, 0.999, 0.99999, 2.0**-100, 0.0, 1e38]
    frame[0, :6, 1:] = 0
    nubis.save(tmp_path / "sky.hdr", frame)
    got = read_hdr(tmp_path / "sky.hdr")
    largest = frame.max(axis=2, keepdims=True)
    assert (np.abs(got - frame) <= largest / 256 * 1.001).all()
    bright = frame >= largest
    bias = (got[bright & (frame > 0)] / frame[bright & (frame > 0)]).mean() - 1
    assert abs(bias) < (0.0002 if width == 500 else 0.0005)  # truncated: 0.0027
    assert got[0, 0, 0] == 1 and got[0, 3, 0] == 2.0**-100 and (got[0, 4] == 0).all()


def test_hdr_of_the_largest_and_smallest(tmp_path):
    """What the format cannot hold ends at its ends: no light below 0, and none beyond 2^127."""
    frame = np.array([[[3e38, 1, 0], [-1, 2, 4], [1e-44, 0, 0], [0, 0, 0]]], np.float32)
    nubis.save(tmp_path / "sky.hdr", frame)
    got = read_hdr(tmp_path / "sky.hdr")[0]
    assert got[0, 0] == 255 * 2.0**119 and got[1].tolist() == [0, 2, 4] and (got[2:] == 0).all()


@pytest.mark.parametrize("ending", ["png", "exr", "hdr", "npy"])
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_no_number_is_not_saved(picture, tmp_path, ending, bad):
    path = tmp_path / f"sky.{ending}"
    nubis.save(path, picture)
    before = path.read_bytes()
    picture[1, 2, 0] = picture[3, 4, 1] = bad
    with pytest.raises(ParameterError, match=r"frame\[1, 2, 0\] = .*one of 2 such values"):
        nubis.save(path, picture)
    assert path.read_bytes() == before


@pytest.mark.parametrize("ending", ["png", "exr", "hdr", "npy"])
def test_a_folder_that_is_not_there(picture, tmp_path, ending):
    path = tmp_path / "none" / f"sky.{ending}"
    with pytest.raises(FileError, match="none") as error:
        nubis.save(path, picture)
    assert isinstance(error.value, OSError)


def test_heat():
    """Black, red, yellow, white, and nothing beyond."""
    counts = np.array([[0, 50, 100, 200, 300, 900]], dtype=np.uint32)
    black, red, white = [0, 0, 0], [255, 0, 0], [255, 255, 255]
    assert _image.heat(counts, 300).tolist() == [
        [black, [128, 0, 0], red, [255, 255, 0], white, white]
    ]


def test_heat_beside_a_picture(tmp_path, capsys):
    out = tmp_path / "sky.exr"
    assert main(["render", "in_cloud", "--heat", "--size", "32x18", "--out", str(out)]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {"sky.exr", "sky.heat.png"}
    assert "density evaluations a pixel" in capsys.readouterr().out


def test_a_render_can_be_saved(renderer, tmp_path):
    frame = renderer(64, 36).render(*nubis.scenes["fair_weather"])
    nubis.save(tmp_path / "sky.png", frame)
    np.testing.assert_array_equal(read_png(tmp_path / "sky.png"), to_srgb8(frame)[..., :3])
