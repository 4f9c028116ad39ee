"""Pictures are continuous in every parameter: what is switched on at a value begins there with
nothing, and leaves the numerical method of all else alone.
"""

import dataclasses
import functools

import numpy as np
import pytest

import nubis
from nubis import ParameterError, Params
from test_params import GROUPS, allowed, each, filled, kind

CAMERAS = {
    "ground": nubis.Camera.look_at((3000, -2000, 30), (13_000, -4000, 2200), fov_y=50),
    "above": nubis.Camera.look_at((3000, -2000, 9000), (13_000, -4000, 6300), fov_y=50),
}
# In which what is switched on has something to be beside: storms that reach the deck above.
SKIES = {
    "fair": {},
    "rain": {
        "clouds.coverage": 0.6,
        "clouds.precipitation": 0.8,
        "clouds.rain_extinction": 0.002,
        "weather.clear_radius": 4000.0,
    },
    "decks": {
        "clouds.coverage": 0.4,
        "upper_clouds.coverage": 0.5,
        "sun.elevation": 12.0,
        "sun.visible": False,  # its disc alone is brighter than all else
    },
}
VIEWS = [(sky, camera) for sky in SKIES for camera in CAMERAS]
TIME = 700.0  # s: winds have blown


def may_be_nothing(group, name):
    if "float" not in str(kind(group, name)) or allowed(group, name)[1] is None:
        return False
    low, high = allowed(group, name)[1]
    return low <= 0 < high


SWITCHES = [
    (group, field.name)
    for group, cls in GROUPS.items()
    for field in dataclasses.fields(cls)
    if may_be_nothing(group, field.name)
]


# Samples that are lit as a group leap by a few percent of a pixel where one more makes it full. The
# light field of each picture has few cells, so that it takes half of the time.
METHOD = nubis.quality("draft").replace(
    adaptive_threshold=0.0, light_group_weight=0.03, field_cells=32, field_cell=200.0
)


@pytest.fixture(scope="module")
def picture(renderer):
    @functools.cache
    def render(sky, camera, *changes):
        params = Params().with_(**SKIES[sky]).with_(**dict(changes))
        image = renderer(32, 18, METHOD).render(CAMERAS[camera], params, time=TIME)
        return np.asarray(image[..., :3], dtype=np.float64)

    return render


@pytest.mark.slow
@each(SWITCHES)
def test_nothing_is_the_limit_of_little(picture, group, name):
    """A picture with 0 and one with next to 0, root mean square, of the mean of the picture as it
    is.

    With 1e-9 (of 1, or of a range that is less) 1e-4; found are up to 8e-5, of clouds whose
    extinction is that. With 1e-6 1.5e-2; found are up to 1.1e-2, in three pixels before the sun, of
    an upper deck whose extinction is that. Where the steps of a march moved with what was switched
    on it was 1e-2 and more with either.
    """
    most = min(allowed(group, name)[1][1], 1.0)
    for view in VIEWS:

        def at(value, view=view):
            return picture(*view, (f"{group}.{name}", filled(kind(group, name), value)))

        try:
            nothing = at(0.0)
        except ParameterError:
            continue  # no switch, as 0 is not allowed in this sky
        scale = picture(*view).mean()
        for share, tolerance in (1e-9, 1e-4), (1e-6, 1.5e-2):
            error = np.sqrt(np.mean((at(share * most) - nothing) ** 2)) / scale
            assert error < tolerance, f"{view}: {error} with {share}"


BORDERS = [
    ("clouds.precipitation", 0.2),  # where the shell once leapt to the tops of storms
    ("clouds.precipitation", 0.25),  # where it begins to grow to those of anvils
    ("clouds.precipitation", 0.35),  # where anvils begin
    ("clouds.rain_extinction", 1.5e-6),
    ("clouds.coverage", 0.01),
    ("upper_clouds.coverage", 0.01),
    ("clouds.cumulonimbus_top", 3200.0),
    ("clouds.cumulonimbus_top", 4800.0),  # the base of the deck above
    ("weather.broad_variety", 0.3),
]


@pytest.mark.slow_after(1)
@pytest.mark.parametrize(("name", "value"), BORDERS, ids=str)
@pytest.mark.parametrize("view", VIEWS, ids="-".join)
def test_no_leap_where_something_begins(picture, view, name, value):
    """Just below and just above, 4e-7 of the value apart: 1e-3, as numbers of steps are whole."""
    low, high = (picture(*view, (name, value * (1 + d))) for d in (-2e-7, 2e-7))
    error = np.sqrt(np.mean((high - low) ** 2)) / low.mean()
    assert error < 1e-3


@pytest.mark.slow
def test_a_deck_begins_to_show_after_it_has_room(renderer):
    """The cover up to which the shell grows with a deck shows nothing of it at all."""
    method = nubis.quality("high").replace(adaptive_threshold=0.0)
    camera = nubis.Camera.look_at((0, 0, 60_000), (0, 1, 0), fov_y=30)
    wet = {"clouds.precipitation": 1.0, "clouds.coverage": 0.0099, "upper_clouds.coverage": 0.0099}
    layers = renderer(64, 64, method).render_layers(camera, Params().with_(**wet))
    none = Params().with_(**{"clouds.coverage": 0.0})
    clear = renderer(64, 64, method).render_layers(camera, none)
    np.testing.assert_array_equal(layers["transmittance"], clear["transmittance"])


@pytest.mark.slow
def test_anvils_have_room_in_little_rain(renderer):
    """With the widest anvils storms begin at a precipitation of 0.1: what `density` says of a
    column, a ray along it meets.
    """
    params = Params().with_(
        **{
            "clouds.coverage": 1.0,
            "clouds.precipitation": 0.19,
            "clouds.anvil": 1.0,
            "clouds.extinction": 1e-4,
            "weather.map": np.ones((1, 1, 3), np.float32),
            "high_clouds.coverage": 0.0,
        }
    )
    heights = np.arange(5, 12_000, 10.0)
    points = np.column_stack([np.full_like(heights, 500.0), np.zeros_like(heights), heights])
    density = renderer(8, 8).density(points, params)
    assert density[heights > params.clouds.top].max() > 0
    camera = nubis.Camera.look_at((500, 0, 15_000), (500, 0.001, 0), fov_y=0.01)
    method = nubis.quality("reference")
    seen = renderer(1, 1, method).render_layers(camera, params)["transmittance"]
    np.testing.assert_allclose(seen, np.exp(-density.sum() * 10.0), atol=2e-3)
