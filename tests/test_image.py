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
    np.testing.assert_array_equal(
        pixels[..., :3], to_srgb8(picture[..., :3].tolist(), tonemap=tonemap)
    )


@pytest.mark.parametrize("tonemap", TONE_MAPS)
def test_grey(tonemap):
    """Grey stays grey, more light is never darker, and black and white are reached."""
    ramp = np.concatenate([[0], np.logspace(-5, 3, 200)])
    pixels = to_srgb8(np.repeat(ramp, 3).reshape(1, -1, 3), tonemap=tonemap)[0].astype(int)
    assert np.ptp(pixels, axis=1).max() <= 1
    assert (np.diff(pixels, axis=0) >= 0).all()
    assert pixels[0].max() <= 1 and pixels[-1].min() >= 254
    middle = to_srgb8(np.full((1, 1, 3), 0.18), tonemap=tonemap)[0, 0, 0]
    assert 60 < middle < 160


def test_no_tone_map_is_the_srgb_curve():
    """IEC 61966-2-1."""
    v = np.linspace(0, 1.2, 500)
    encoded = np.where(v <= 0.0031308, 12.92 * v, 1.055 * v ** (1 / 2.4) - 0.055).clip(0, 1)
    pixels = to_srgb8(np.repeat(v, 3).reshape(1, -1, 3), tonemap="none")[0, :, 0]
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


def test_png_with_alpha(picture, tmp_path):
    """Alpha as it is; colours no longer multiplied by it, so that compositing multiplies them
    again.
    """
    picture[..., :3] *= 0.1 * picture[..., 3:]
    nubis.save(tmp_path / "clouds.PNG", picture, tonemap="none")
    pixels = read_png(tmp_path / "clouds.PNG").astype(float)
    premultiplied = to_srgb8(picture, tonemap="none").astype(float)
    np.testing.assert_array_equal(pixels[..., 3], premultiplied[..., 3])
    alpha = pixels[..., 3:] / 255
    room = premultiplied[..., :3] <= pixels[..., 3:]
    np.testing.assert_allclose(
        (pixels[..., :3] * alpha)[room], premultiplied[..., :3][room], atol=0.51
    )
    assert (pixels[pixels[..., 3] == 0] == 0).all()


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


def test_hdr(picture, tmp_path):
    """Radiance's format: a mantissa of 8 bits a colour and a common exponent; a row of 6 pixels
    is not compressed.
    """
    path = tmp_path / "sky.hdr"
    nubis.save(path, picture)
    data = path.read_bytes()
    assert data.startswith(b"#?RADIANCE\n") and b"FORMAT=32-bit_rle_rgbe\n" in data
    header, _, pixels = data.partition(b"-Y 5 +X 6\n")
    assert header.endswith(b"\n\n")
    rgbe = np.frombuffer(pixels, np.uint8).reshape(5, 6, 4).astype(np.float64)
    colours = (rgbe[..., :3] + 0.5) * 2.0 ** (rgbe[..., 3:] - 136)
    largest = picture[..., :3].max(axis=2, keepdims=True)
    assert (np.abs(colours - picture[..., :3]) <= largest / 120).all()


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
