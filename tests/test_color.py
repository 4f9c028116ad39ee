"""Exposure, and the tone maps against what they are fits of."""

import numpy as np
import pytest

import nubis
from nubis import ParameterError, auto_exposure, to_srgb8

RAMP = 0.18 * np.exp2(np.linspace(-11, 7, 400))


@pytest.fixture
def colours():
    """Of every hue, from dark to bright."""
    rng = np.random.default_rng(11)
    return 0.18 * np.exp2(rng.uniform(-8, 6, (40, 1, 1)) + rng.uniform(-2, 2, (40, 50, 3)))


def agx(rgb):
    """Sobotka's AgX (github.com/sobotka/AgX, the configuration's generator): inset, log2 of -10 to
    +6.5 stops about 0.18, and the sigmoid itself, of slope 2 at the pivot (10 / 16.5, 0.5) with
    powers 3 and 3.25, of which the renderer has a polynomial of sixth order. The inset and its
    inverse for Rec. 709 are Wrensch's.
    """
    inset = np.array(
        [
            [0.842479062253094, 0.0784335999999992, 0.0792237451477643],
            [0.0423282422610123, 0.878468636469772, 0.0791661274605434],
            [0.0423756549057051, 0.0784336, 0.879142973793104],
        ]
    )
    x = np.clip((np.log2(np.maximum(rgb @ inset.T, 1e-10) / 0.18) + 10) / 16.5, 0, 1)
    pivot, slope = 10 / 16.5, 2.0

    def scale(x, y, power):
        return ((slope * x) ** -power * ((slope * x / y) ** power - 1)) ** (-1 / power)

    def half(t, size, power):
        term = slope * t / size
        return size * term / (1 + term**power) ** (1 / power)

    toe, shoulder = scale(pivot, 0.5, 3.0), scale(1 - pivot, 0.5, 3.25)
    below = 0.5 - half(np.maximum(pivot - x, 0), toe, 3.0)
    above = 0.5 + half(np.maximum(x - pivot, 0), shoulder, 3.25)
    return np.clip(np.where(x < pivot, below, above) @ np.linalg.inv(inset).T, 0, 1)


def test_agx(colours):
    """The polynomial is within 0.0019 of the sigmoid in the mean, half an 8-bit step; rounding adds
    to that.
    """
    for picture in (np.repeat(RAMP, 3).reshape(1, -1, 3), colours):
        error = to_srgb8(picture, tonemap="agx", dither=False) - 255 * agx(picture)
        assert np.abs(error).max() < 2.5
        assert np.sqrt((error**2).mean()) < 0.9


def spline(x, low, high, points, slopes):
    """The uniform quadratic B-splines of the logarithms that ACES 1.0 calls c5 and c9, with
    straight lines beyond their ends.
    """
    (x0, y0), (x1, _), (x2, y2) = np.log10(points)
    log = np.log10(np.maximum(x, 2.0**-14))
    basis = np.array([[0.5, -1.0, 0.5], [-1.0, 1.0, 0.5], [0.5, 0.0, 0.0]])

    def part(start, end, knots):
        count = len(knots) - 2
        t = np.clip(count - 1, 0, None) * (log - start) / (end - start)
        j = np.clip(t.astype(int), 0, count - 2)
        t = t - j
        knots = np.stack([np.take(knots, j + k) for k in range(3)], axis=-1)
        return (np.stack([t * t, t, np.ones_like(t)], axis=-1) * (knots @ basis)).sum(axis=-1)

    y = np.where(log < x1, part(x0, x1, np.array(low)), part(x1, x2, np.array(high)))
    y = np.where(log <= x0, y0 + slopes[0] * (log - x0), y)
    return 10 ** np.where(log >= x2, y2 + slopes[1] * (log - x2), y)


def c5(x):
    """The reference rendering transform's tone scale (ACESlib.Tonescales.ctl)."""
    return spline(
        x,
        [-4.0, -4.0, -3.1573765773, -0.4852499958, 1.8477324706, 1.8477324706],
        [-0.7185482425, 2.0810307172, 3.6681241237, 4.0, 4.0, 4.0],
        [(0.18 * 2.0**-15, 1e-4), (0.18, 4.8), (0.18 * 2.0**18, 1e4)],
        (0, 0),
    )


def c9(x):
    """That of the 48 nit output device transform."""
    low = [-1.6989700043, -1.6989700043, -1.4779, -1.2291, -0.8648, -0.448, 0.00518]
    high = [0.5154386965, 0.8470437783, 1.1358, 1.3802, 1.5197, 1.5985, 1.6467]
    points = [(c5(0.18 * 2.0**-6.5), 0.02), (c5(0.18), 4.8), (c5(0.18 * 2.0**6.5), 48.0)]
    return spline(
        x,
        [*low, 0.4511080334, 0.9113744414, 0.9113744414],
        [*high, 1.6746091357, 1.687873339, 1.687873339],
        points,
        (0, 0.04),
    )


def test_aces_greys():
    """Of greys, ACES 1.0 (RRT and the 100 nit sRGB ODT) is two tone scales, black at 0.02 nits, and
    the step from a dark to a dim surround. Hill's fit leaves out the glow and the red modifier,
    which do nothing to greys.
    """
    linear = np.clip((c9(c5(RAMP)) - 0.02) / (48 - 0.02), 0, 1) ** 0.9811
    expected = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    got = to_srgb8(np.repeat(RAMP, 3).reshape(1, -1, 3), tonemap="aces", dither=False)[0, :, 1]
    error = got - 255 * expected
    assert np.abs(error).max() < 2.5
    assert np.sqrt((error**2).mean()) < 1


def test_aces_is_the_published_fit(colours):
    """S. Hill, BakingLab, ACES.hlsl (2016)."""
    into = [[0.59719, 0.35458, 0.04823], [0.076, 0.90834, 0.01566], [0.0284, 0.13383, 0.83777]]
    out = [
        [1.60475, -0.53108, -0.07367],
        [-0.10208, 1.10813, -0.00605],
        [-0.00327, -0.07276, 1.07602],
    ]
    v = colours @ np.transpose(into)
    v = (v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.4329510) + 0.238081)
    v = np.clip(v @ np.transpose(out), 0, 1)
    expected = 255 * np.where(v <= 0.0031308, 12.92 * v, 1.055 * v ** (1 / 2.4) - 0.055)
    np.testing.assert_allclose(to_srgb8(colours, tonemap="aces", dither=False), expected, atol=0.52)


def grey(values):
    return np.repeat(np.asarray(values, np.float32).reshape(1, -1, 1), 3, axis=2)


def test_automatic_exposure():
    """The geometric mean comes to the key; a picture twice as bright needs a stop less."""
    light = np.exp2(np.random.default_rng(5).normal(3, 2, 2000))
    stops = auto_exposure(grey(light), low=0, high=100)
    assert np.log2(light * 2**stops).mean() == pytest.approx(np.log2(0.18), abs=1e-4)
    assert auto_exposure(grey(2 * light)) == pytest.approx(auto_exposure(grey(light)) - 1, abs=1e-4)
    dim = auto_exposure(grey(light), key=0.09)
    assert dim == pytest.approx(auto_exposure(grey(light)) - 1, abs=1e-4)
    # Of colours, the luminance.
    green = np.full((2, 2, 3), [0, 0.18 / 0.7152, 0])
    assert auto_exposure(green) == pytest.approx(0, abs=1e-5)


def test_automatic_exposure_does_not_see_the_sun():
    """A disc a million times as bright, black pixels, NaN and infinity move nothing."""
    light = np.linspace(0.5, 2, 1000)
    plain = auto_exposure(grey(light))
    sun = light.copy()
    sun[500:520] = 1e6
    assert auto_exposure(grey(sun)) == pytest.approx(plain, abs=0.05)
    odd = np.concatenate([light, np.zeros(500), [-1.0, np.nan, np.inf]])
    assert auto_exposure(grey(odd)) == pytest.approx(plain, abs=1e-6)


def test_automatic_exposure_of_little():
    for values in ([0.0], [np.nan], [-1.0, 0.0]):
        assert auto_exposure(grey(values)) == 0
    assert auto_exposure(grey([0.18])) == pytest.approx(0, abs=1e-5)
    for value in (1e-38, 3e38):
        stops = auto_exposure(grey([value]))
        assert np.isfinite(stops)
        got, middle = to_srgb8(grey([value]), stops), to_srgb8(grey([0.18]))
        np.testing.assert_allclose(got.astype(int), middle, atol=1)


@pytest.mark.parametrize(
    ("given", "name"),
    [
        ({"key": 0.0}, "key"),
        ({"key": float("inf")}, "key"),
        ({"low": -1.0}, "low"),
        ({"low": 50.0, "high": 50.0}, "low"),
        ({"high": 101.0}, "low"),
        ({"low": float("nan")}, "low"),
    ],
)
def test_automatic_exposure_refused(given, name):
    with pytest.raises(ParameterError, match=rf"^{name} = "):
        auto_exposure(grey([1.0]), **given)
    with pytest.raises(ParameterError, match=r"^frame"):
        auto_exposure(np.zeros((3, 3)))


def test_save_with_automatic_exposure(tmp_path):
    frame = grey(np.linspace(20, 80, 50))
    nubis.save(tmp_path / "auto.png", frame, exposure="auto")
    nubis.save(tmp_path / "manual.png", frame, exposure=auto_exposure(frame))
    nubis.save(tmp_path / "none.png", frame)
    auto, manual, none = (
        (tmp_path / f"{name}.png").read_bytes() for name in ("auto", "manual", "none")
    )
    assert auto == manual != none
    # What stays linear is not exposed.
    nubis.save(tmp_path / "auto.npy", frame, exposure="auto")
    np.testing.assert_array_equal(np.load(tmp_path / "auto.npy"), frame)
    with pytest.raises(ParameterError, match=r"^exposure = 'bright'"):
        nubis.save(tmp_path / "sky.png", frame, exposure="bright")
