"""Cameras: which way every pixel looks, found by the sun's disc; and cameras as Python values."""

import copy
import pickle

import numpy as np
import pytest

import nubis
import ref64
from nubis import Camera, ParameterError


def brightest(renderer, camera, azimuth, elevation, size):
    """The pixel (x, y) that shows the sun in an empty sky."""
    params = nubis.Params().with_(
        **{
            "sun.azimuth": azimuth,
            "sun.elevation": elevation,
            "clouds.coverage": 0.0,
            "high_clouds.coverage": 0.0,
            "atmosphere.enabled": False,
        }
    )
    image = renderer(*size).render(camera, params)[..., 0]
    assert image.max() > 0
    y, x = np.unravel_index(image.argmax(), image.shape)
    return int(x), int(y)


@pytest.mark.slow
@pytest.mark.parametrize("pixel", [(32, 10), (31, 20), (50, 5), (63, 30), (0, 30), (10, 15)])
def test_equirect(renderer, pixel):
    """Centre north, right clockwise from above, top the zenith; pixel centres at half-integers."""
    width, height = size = 64, 64
    azimuth = ((pixel[0] + 0.5) / width - 0.5) * 360
    elevation = 90 - (pixel[1] + 0.5) / height * 180
    assert brightest(renderer, Camera.equirect((0, 0, 2)), azimuth, elevation, size) == pixel


@pytest.mark.slow
@pytest.mark.parametrize("fov", [180.0, 120.0])
@pytest.mark.parametrize(
    ("azimuth", "side"), [(0, "top"), (90, "left"), (180, "bottom"), (270, "right"), (30, "top")]
)
def test_fisheye(renderer, azimuth, side, fov):
    """Equidistant: the angle from the zenith grows linearly. North on top and, seen from below,
    east on the left.
    """
    width, height = size = 96, 64
    angle = 40.0
    r = angle / (0.5 * fov) * 32
    x = 0.5 * width - r * np.sin(np.radians(azimuth))
    y = 0.5 * height - r * np.cos(np.radians(azimuth))
    # The direction of the centre of the pixel that this falls on.
    dx, dy = np.floor([x, y]) + 0.5 - [0.5 * width, 0.5 * height]
    sun = np.degrees(np.arctan2(-dx, -dy)), 90 - np.hypot(dx, dy) / 32 * 0.5 * fov
    found = brightest(renderer, Camera.fisheye((0, 0, 2), fov=fov), *sun, size)
    assert found == (int(x), int(y))
    offset = {
        "top": 32 - found[1],
        "bottom": found[1] - 32,
        "left": 48 - found[0],
        "right": found[0] - 48,
    }
    assert max(offset, key=offset.get) == side


@pytest.mark.slow
def test_fisheye_that_looks_at_the_horizon(renderer):
    """Its top is as far north as can be: looking south that is the zenith, and east is on the
    left.
    """
    camera = Camera.fisheye((0, 0, 2), up=(0, -1, 0), fov=180)
    x, y = brightest(renderer, camera, 150, 20, (64, 64))
    assert x < 30 and y < 30


@pytest.mark.slow
def test_fisheye_shows_nothing_outside_its_circle(renderer):
    image = renderer(96, 64).render(Camera.fisheye((0, 0, 2)), nubis.Params())
    y, x = np.mgrid[:64, :96] + 0.5
    outside = np.hypot(x - 48, y - 32) > 32
    assert (image[outside] == 0).all()
    assert (image[~outside][:, 3] == 1).all()


LOOKS = [
    ((0, 0, 2), (0, 100, 40), (0, 0, 1)),
    ((10, -20, 300), (-50, 30, 290), (0.2, 0.1, 1)),
    ((0, 0, 50), (1, 0, 50), (0, 1, 1)),
]


@pytest.mark.parametrize(("eye", "target", "up"), LOOKS)
def test_look_at(renderer, eye, target, up):
    """The sun stands where a pinhole projects it, pixel by pixel."""
    size = 48, 32
    camera = Camera.look_at(eye, target, up, 50.0)
    forward = ref64.normalized(np.subtract(target, eye))
    right = ref64.normalized(np.cross(forward, up))
    np.testing.assert_allclose(camera.forward, forward, atol=1e-12)
    np.testing.assert_allclose(camera.right, right, atol=1e-12)
    np.testing.assert_allclose(camera.up, np.cross(right, forward), atol=1e-12)
    directions = ref64.pixel_directions(camera, *size)
    for x, y in [(24, 16), (3, 2), (40, 5)]:
        d = directions[y, x]
        azimuth, elevation = np.degrees(np.arctan2(d[0], d[1])), np.degrees(np.arcsin(d[2]))
        if elevation > 0.5:
            assert brightest(renderer, camera, azimuth, elevation, size) == (x, y)


def test_looking_north_east_is_on_the_right():
    camera = Camera.look_at((0, 0, 0), (0, 1, 0))
    np.testing.assert_allclose([camera.right, camera.forward, camera.up], np.eye(3), atol=1e-15)


@pytest.mark.parametrize(("eye", "target", "up"), LOOKS)
def test_matrices(renderer, eye, target, up):
    """OpenGL: x right, y up, looking down -z. OpenCV: x right, y down, looking down z. Same
    camera, same picture.
    """
    camera = Camera.look_at(eye, target, up, 50.0)
    opengl = np.eye(4)
    opengl[:3, 0], opengl[:3, 1], opengl[:3, 2], opengl[:3, 3] = (
        camera.right,
        camera.up,
        -np.array(camera.forward),
        eye,
    )
    opencv = opengl @ np.diag([1, -1, -1, 1])
    np.testing.assert_allclose(camera.matrix(), opengl)
    a = Camera.from_matrix(opengl, 50.0)
    b = Camera.from_matrix(opencv, 50.0, convention="opencv")
    for other in (a, b):
        for name in ("eye", "right", "up", "forward"):
            np.testing.assert_allclose(getattr(other, name), getattr(camera, name), atol=1e-12)
    assert a == Camera.from_matrix(opengl.tolist(), 50.0, convention="opengl")
    pictures = [renderer(32, 18).render(c, nubis.Params()) for c in (camera, a, b)]
    for other in pictures[1:]:
        np.testing.assert_allclose(other, pictures[0], rtol=1e-2, atol=1e-3)


@pytest.mark.slow
def test_projections_agree(renderer):
    """One direction, three projections of equal pixels: the same clouds."""
    params = nubis.Params().with_(**{"clouds.coverage": 0.7, "sun.visible": False})
    method = nubis.quality("draft").replace(jitter=False)
    n = 64
    pixel = 2 * np.pi / n
    eye = (0, 0, 100)
    equirect = renderer(n, n // 2, method).render(Camera.equirect(eye), params)
    for x, y in [(40, 10), (10, 6), (33, 14)]:
        azimuth, elevation = ((x + 0.5) / n - 0.5) * 360, 90 - (y + 0.5) / n * 360
        target = eye + ref64.compass(azimuth, elevation)
        pinhole = Camera.look_at(eye, target, fov_y=np.degrees(2 * np.arctan(0.5 * pixel)))
        fisheye = Camera.fisheye(eye, up=target - eye, fov=np.degrees(pixel))
        for camera in (pinhole, fisheye):
            single = renderer(1, 1, method).render(camera, params)[0, 0]
            np.testing.assert_allclose(single, equirect[y, x], rtol=5e-3, atol=1e-3)


CAMERAS = [
    Camera.look_at((0, 0, 2), (0, 1000, 400), (0, 0, 1), 60.0),
    Camera.from_matrix(np.eye(4), 45.0),
    Camera.equirect((1, 2, 3)),
    Camera.fisheye((1, 2, 3), (0, 0, 1), 170.0),
]


@pytest.mark.parametrize("camera", CAMERAS, ids=lambda c: c.kind)
def test_cameras_are_values(camera):
    for other in (pickle.loads(pickle.dumps(camera)), copy.copy(camera), copy.deepcopy(camera)):
        assert other == camera and hash(other) == hash(camera) and repr(other) == repr(camera)
    assert sum(other == camera for other in CAMERAS) == 1
    assert camera != 1
    assert len({*CAMERAS, camera}) == len(CAMERAS)
    assert repr(camera).startswith("Camera(") and camera.kind in repr(camera)
    assert f"fov={camera.fov:g}" in repr(camera)
    with pytest.raises(AttributeError):
        camera.fov = 1.0


def test_defaults():
    assert Camera.look_at((0, 0, 2), (0, 1, 2)) == Camera.look_at(
        (0, 0, 2), (0, 1, 2), (0, 0, 1), 60.0
    )
    assert Camera.fisheye((0, 0, 2)) == Camera.fisheye((0, 0, 2), (0, 0, 1), 180.0)
    # Any three numbers are a point.
    assert (
        Camera.equirect(np.array([1, 2, 3]))
        == Camera.equirect([1.0, 2.0, 3.0])
        == Camera.equirect((1, 2, np.float32(3)))
    )


NAN, INF = float("nan"), float("inf")
LEFT_HANDED = np.diag([1.0, 1.0, -1.0, 1.0])
SCALED = np.diag([2.0, 2.0, 2.0, 1.0])
PROJECTIVE = np.eye(4)
PROJECTIVE[3] = [0, 0, 1, 1]


@pytest.mark.parametrize(
    ("field", "make"),
    [
        ("eye", lambda: Camera.look_at((NAN, 0, 0), (0, 1, 0))),
        ("eye", lambda: Camera.look_at((0, 0), (0, 1, 0))),
        ("eye", lambda: Camera.look_at("abc", (0, 1, 0))),
        ("eye", lambda: Camera.look_at((1e9, 0, 0), (0, 1, 0))),
        ("target", lambda: Camera.look_at((0, 0, 0), (0, INF, 0))),
        ("target", lambda: Camera.look_at((0, 0, 5), (0, 0, 5))),
        ("up", lambda: Camera.look_at((0, 0, 0), (0, 0, 1), (0, 0, 1))),
        ("up", lambda: Camera.look_at((0, 0, 0), (0, 1, 0), (0, 0, 0))),
        ("up", lambda: Camera.look_at((0, 0, 0), (0, 1, 0), (0, 0, NAN))),
        ("fov_y", lambda: Camera.look_at((0, 0, 0), (0, 1, 0), (0, 0, 1), 0.0)),
        ("fov_y", lambda: Camera.look_at((0, 0, 0), (0, 1, 0), (0, 0, 1), 180.0)),
        ("fov_y", lambda: Camera.look_at((0, 0, 0), (0, 1, 0), (0, 0, 1), NAN)),
        ("fov_y", lambda: Camera.look_at((0, 0, 0), (0, 1, 0), (0, 0, 1), "wide")),
        ("fov_y", lambda: Camera.from_matrix(np.eye(4), -1.0)),
        ("world_from_camera", lambda: Camera.from_matrix(np.eye(3), 60.0)),
        ("world_from_camera", lambda: Camera.from_matrix(LEFT_HANDED, 60.0)),
        ("world_from_camera", lambda: Camera.from_matrix(SCALED, 60.0)),
        ("world_from_camera", lambda: Camera.from_matrix(PROJECTIVE, 60.0)),
        ("world_from_camera", lambda: Camera.from_matrix(np.full((4, 4), NAN), 60.0)),
        ("convention", lambda: Camera.from_matrix(np.eye(4), 60.0, "directx")),
        ("eye", lambda: Camera.equirect((0, 0, INF))),
        ("up", lambda: Camera.fisheye((0, 0, 0), (0, 0, 0))),
        ("fov", lambda: Camera.fisheye((0, 0, 0), (0, 0, 1), 361.0)),
    ],
)
def test_errors(field, make):
    with pytest.raises(ParameterError, match=r"is not allowed: it must be") as error:
        make()
    assert str(error.value).startswith(field)
