"""Watts and candelas, worked out again from spectra."""

import numpy as np
import pytest

import nubis
import ref64

# Means over bins of 10 nm from 360 nm on. ASTM G173-03, extraterrestrial, W/(m2 nm), as averaged by
# E. Bruneton (precomputed_atmospheric_scattering, 2017).
SUN = [
    1.11776, 1.14259, 1.01249, 1.14716, 1.72765, 1.73054, 1.6887, 1.61253, 1.91198, 2.03474,
    2.02042, 2.02212, 1.93377, 1.95809, 1.91686, 1.8298, 1.8685, 1.8931, 1.85149, 1.8504, 1.8341,
    1.8345, 1.8147, 1.78158, 1.7533, 1.6965, 1.68194, 1.64654, 1.6048, 1.52143, 1.55622, 1.5113,
    1.474, 1.4482, 1.41018, 1.36775, 1.34188, 1.31429, 1.28303, 1.26758, 1.2367, 1.2082, 1.18737,
    1.14683, 1.12362, 1.1058, 1.07124, 1.04992,
]  # fmt: skip
# CIE 1931, 2 degrees.
X = [
    0.00023, 0.00075, 0.0023, 0.00778, 0.02382, 0.07694, 0.20501, 0.32105, 0.34669, 0.31911,
    0.25278, 0.14823, 0.06322, 0.01733, 0.00376, 0.02889, 0.10617, 0.22027, 0.35329, 0.50467,
    0.67001, 0.83369, 0.9706, 1.05049, 1.04393, 0.94249, 0.76096, 0.55265, 0.37068, 0.22648,
    0.12675, 0.06683, 0.03475, 0.01681, 0.00855, 0.00433, 0.00216, 0.00106, 0.00051, 0.00025,
    0.00012, 6e-05, 3e-05, 2e-05, 1e-05, 0.0, 0.0, 0.0,
]  # fmt: skip
Y = [
    1e-05, 2e-05, 7e-05, 0.00022, 0.00066, 0.00218, 0.00708, 0.01643, 0.0293, 0.04725, 0.07289,
    0.11104, 0.16731, 0.25509, 0.40006, 0.59733, 0.78331, 0.90795, 0.97625, 0.9983, 0.97904,
    0.91802, 0.821, 0.70088, 0.57325, 0.4476, 0.32747, 0.22249, 0.14255, 0.08471, 0.04668, 0.0244,
    0.0126, 0.00608, 0.00309, 0.00156, 0.00078, 0.00038, 0.00018, 9e-05, 4e-05, 2e-05, 1e-05, 1e-05,
    0.0, 0.0, 0.0, 0.0,
]  # fmt: skip
Z = [
    0.00108, 0.00353, 0.01087, 0.03682, 0.11325, 0.36815, 0.9923, 1.5855, 1.77358, 1.7409, 1.5283,
    1.06833, 0.64162, 0.36813, 0.21869, 0.11799, 0.06, 0.03142, 0.01436, 0.00619, 0.00292, 0.00185,
    0.00142, 0.00099, 0.00061, 0.00026, 0.00012, 3e-05, 1e-05, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
    0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
]  # fmt: skip
# IEC 61966-2-1.
RGB_FROM_XYZ = [
    [3.2404542, -1.5371385, -0.4985314],
    [-0.9692660, 1.8760108, 0.0415560],
    [0.0556434, -0.2040259, 1.0572252],
]


def test_the_sun():
    """Irradiance and efficacy follow from the spectrum, the observer and 683.002 lm/W."""
    wavelength = 360 + 10 * np.arange(48)
    spectrum = 10 * np.array(SUN)
    tristimulus = 683.002 * (np.array([X, Y, Z]) @ spectrum)
    visible = spectrum[(wavelength >= 380) & (wavelength < 780)].sum()
    efficacy = tristimulus[1] / visible
    assert efficacy == pytest.approx(nubis.LUMINOUS_EFFICACY, rel=1e-4)
    irradiance = np.array(RGB_FROM_XYZ) @ tristimulus / efficacy
    np.testing.assert_allclose(nubis.SOLAR_IRRADIANCE, irradiance, rtol=3e-4)
    # A plane that faces the sun: the literature has 127.5 (IES) to 133.8 klx (ASTM E490).
    lux = float(nubis.luminance(np.array(nubis.SOLAR_IRRADIANCE)))
    assert lux == pytest.approx(tristimulus[1], rel=1e-3)
    assert 127_500 < lux < 133_800
    # Of the solar constant, 1361 W/m2, a little less than a half is visible.
    assert 0.47 < visible / 1361 < 0.5


def test_a_white_plate():
    """Lambert's law: luminance is illuminance over pi, times the cosine."""
    plate = np.array(nubis.SOLAR_IRRADIANCE) * np.cos(np.radians(60)) / np.pi
    frame = np.broadcast_to(np.append(plate, 1.0), (3, 5, 4))
    got = nubis.luminance(frame)
    assert got.shape == (3, 5) and got.dtype == np.float32
    np.testing.assert_allclose(got, 0.5 * 127_500 / np.pi, rtol=0.05)
    np.testing.assert_array_equal(nubis.luminance(frame[..., :3]), got)
    assert nubis.luminance([0.0, 0.0, 0.0]) == 0


def test_a_cloud_of_known_luminance(renderer):
    """Isotropic single scattering in a box, lit and seen from opposite sides without air:
    E / (4 pi) times the optical depth, where that is small.
    """
    low, high = (-500.0, -500.0, 3000.0), (500.0, 500.0, 4000.0)
    grid = nubis.DensityGrid(np.full((2, 2, 2), 1e-5, np.float32), (low, high))
    params = ref64.smooth_params(
        **{
            "light.model": "single",
            "light.g": 0.0,
            "light.albedo": 1.0,
            "sun.elevation": 90.0,
            "sun.irradiance": nubis.SOLAR_IRRADIANCE,
        }
    ).replace(volume=grid)
    camera = nubis.Camera.look_at((0, 0, 1000), (0, 0, 3500), up=(0, 1, 0), fov_y=1)
    frame = renderer(8, 8, "reference").render(camera, params, background=None)
    depth = 1e-5 * 1000
    expected = 133_122 / (4 * np.pi) * depth * np.exp(-depth)
    np.testing.assert_allclose(nubis.luminance(frame), expected, rtol=0.01)


@pytest.mark.parametrize("frame", [1.0, np.zeros((4, 2)), "sky", [[1.0, 2.0], [3.0]]])
def test_refused(frame):
    with pytest.raises(nubis.ParameterError, match=r"^frame"):
        nubis.luminance(frame)
