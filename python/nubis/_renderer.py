"""The renderer that users call."""

from __future__ import annotations

import operator
import os
import warnings
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from nubis import _nubis
from nubis._arrays import numbers
from nubis._errors import AdapterError, ParameterError
from nubis._names import unknown
from nubis._nubis import Camera
from nubis._scene_depth import checked as checked_scene
from nubis._shadow import ShadowMap, SunVisibility, seen_sun, world_from_map
from nubis.params import Params, Quality

Frame = npt.NDArray[np.float32]
Shot = (
    tuple[Camera, Params, float]
    | tuple[Camera, Params, float, npt.ArrayLike | None]
    | tuple[Camera, Params, float, npt.ArrayLike | None, npt.ArrayLike | None]
)
Background = Literal["sky"] | None

#: The names of the numerical methods.
QUALITIES = (
    "preview",
    "draft",
    "balanced",
    "high",
    "reference",
    "nubis2015",
    "thesis2018",
    "vsu2022",
)

_warned = False


class Adapter(NamedTuple):
    """A device that can render.

    Attributes
    ----------
    name, driver, backend : str
        As the driver gives them; the backend is ``"vulkan"``, ``"metal"`` or ``"dx12"``.
    kind : str
        ``"discrete"``, ``"integrated"``, ``"virtual"``, ``"cpu"`` or ``"other"``.
    pci : str
        PCI bus address, empty where there is none.
    """

    name: str
    driver: str
    backend: str
    kind: str
    pci: str


def adapters() -> list[Adapter]:
    """Return the adapters that can be used, best first; an index into them chooses one."""
    return [Adapter(**adapter) for adapter in _nubis.adapters()]


def quality(name: str) -> Quality:
    """Return the numerical method of that name, to look at or to change.

    Names: ``"preview"`` (soft: one pixel in sixteen is marched), ``"draft"``, ``"balanced"``,
    ``"high"``, ``"reference"`` (converged, slow), and the published settings of the sources,
    ``"nubis2015"``, ``"thesis2018"``, ``"vsu2022"``.
    """
    if not isinstance(name, str):
        raise ParameterError(f"quality = {name!r} is not allowed: it must be a name or a Quality")
    try:
        return Quality(**_nubis.quality(name))
    except ParameterError:
        raise ParameterError(unknown(f"quality = {name!r}", name, QUALITIES)) from None


class Renderer:
    """Makes pictures of one size with one numerical method.

    Parameters
    ----------
    width, height : int
        Size of the pictures in pixels, 1 to 65536.
    quality : str or Quality
        The numerical method, never the look: a name (see `quality`) or your own.
    adapter : int or str, optional
        Which device: an index into `adapters()`, a kind such as ``"cpu"``, or part of a name,
        driver or PCI address. Without it the environment variable ``NUBIS_ADAPTER`` says the
        same, and without that the best is taken: hardware first, else software with a warning.

    Raises
    ------
    ParameterError
        For a size or quality that is not allowed.
    AdapterError
        When there is no such adapter; lists those found.
    ForkError
        In a forked child of a process that has used the GPU.
    """

    def __init__(
        self,
        width: int,
        height: int,
        *,
        quality: str | Quality = "balanced",
        adapter: int | str | None = None,
    ) -> None:
        self._quality = quality if isinstance(quality, Quality) else _named(quality)
        if adapter is not None and (
            isinstance(adapter, bool) or not isinstance(adapter, int | str)
        ):
            raise ParameterError(
                f"adapter = {adapter!r} is not allowed: it must be an index or a part of a name"
            )
        size = _size("width", width), _size("height", height)
        _nubis.check_quality(self._quality)
        wanted = os.environ.get("NUBIS_ADAPTER") if adapter is None else str(adapter)
        try:
            self._core = _nubis.Renderer(*size, self._quality, wanted or None)
        except AdapterError as error:
            if adapter is not None or not wanted:
                raise
            raise AdapterError(f"NUBIS_ADAPTER = {wanted!r}: {error}") from None
        self._size = size
        if not wanted:
            _warn_once(self.adapter)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the pictures in pixels."""
        return self._size

    @property
    def quality(self) -> Quality:
        """The numerical method."""
        return self._quality

    @property
    def adapter(self) -> Adapter:
        """The device that renders."""
        return Adapter(**self._core.adapter())

    @property
    def timings(self) -> dict[str, float]:
        """Milliseconds on the GPU by pass, for the last picture or answer.

        Bakes appear only when they ran. Empty on adapters without timestamps.
        """
        return dict(self._core.timings())

    def render(
        self,
        camera: Camera,
        params: Params,
        *,
        time: float = 0.0,
        background: Background = "sky",
        scene_depth: npt.ArrayLike | None = None,
        scene_color: npt.ArrayLike | None = None,
    ) -> Frame:
        """Return a still, finished in one call: no history, no noise to wait for.

        Parameters
        ----------
        camera : Camera
        params : Params
        time : float
            Seconds, of any size: where the wind has carried the clouds.
        background : {"sky", None}
            ``"sky"``: the radiance of the whole sky, alpha 1. None: the clouds alone as seen
            through the air, premultiplied, alpha = 1 - transmittance.
        scene_depth : array-like, shape (height, width), optional
            A scene of yours among the clouds: metres along the ray of each pixel, not along the
            axis of the camera (`distance_from_z`); inf, or any number above 1e10, where there is
            nothing. Only what lies in front of it is seen. It hides the plain ground too, and casts
            no shadow. Without `scene_color`, and with the sky, its pixels hold the clouds and the
            air in front of it, premultiplied, with alpha below 1: ``frame + (1 - alpha) * yours``
            is the picture, in which alpha has the luminance of the air's transmittance.
        scene_color : array-like, shape (height, width, 3) or (height, width, 4), optional
            Linear radiance of that scene, seen through air and clouds with each colour dimmed in
            its own way. A fourth number is how much of the pixel the scene covers, 0 to 1, and the
            radiance then premultiplied by it: the rest of the pixel sees what is behind. Needs the
            sky as background.

        Returns
        -------
        frame : array of float32, shape (height, width, 4)
            Scene-linear radiance with Rec. 709 primaries, never clipped; row 0 is the top.

        Raises
        ------
        ParameterError
            Before any GPU work.
        DeviceError
            When the device is lost or out of memory.
        """
        _check_camera(camera)
        _check_params(params)
        sky, when = _sky(background), _time(time)
        return self._picture(self._core.render, camera, params, when, sky, scene_depth, scene_color)

    def _picture(
        self,
        make: Callable[..., Frame],
        camera: Camera,
        params: Params,
        time: float,
        sky: bool,
        scene_depth: npt.ArrayLike | None,
        scene_color: npt.ArrayLike | None,
    ) -> Frame:
        """What `make` makes of a scene that may cover pixels in part."""
        scene = checked_scene(scene_depth, scene_color, self._size)
        if scene_color is not None and not sky:
            raise ParameterError('scene_color is not allowed with background=None: "sky" takes it')
        if scene is None:
            return make(camera, params, time, sky, None, None)
        frame = make(camera, params, time, sky, scene.depth, scene.color)
        if scene.cover is not None:
            # Of the pixels that are covered in part, what lies behind; the others end at the eye.
            part = (scene.cover < 1) & np.isfinite(scene.depth)
            behind = np.where(part, np.float32(np.inf), np.float32(0))
            rest = self._core.render(camera, params, time, sky, behind, None)
            cover = scene.cover[part][:, None]
            frame[part] = cover * frame[part] + (1 - cover) * rest[part]
        return frame

    def render_layers(
        self,
        camera: Camera,
        params: Params,
        *,
        time: float = 0.0,
        scene_depth: npt.ArrayLike | None = None,
    ) -> dict[str, npt.NDArray[Any]]:
        """Return a still with all that is known of each pixel.

        Parameters
        ----------
        camera, params, time, scene_depth
            As for `render`. In front of a scene ``sky`` is the air alone, as before a black one.

        Returns
        -------
        layers : dict of arrays
            - ``radiance`` float32 (height, width, 3): the clouds seen through the air,
              premultiplied; ``radiance + transmittance * sky`` is the picture.
            - ``transmittance`` float32 (height, width): of all clouds, 0 to 1.
            - ``depth`` float32 (height, width): metres to the clouds' mean scattering point,
              inf where there are none.
            - ``samples`` uint32 (height, width): density evaluations, primary and light together.
            - ``sky`` float32 (height, width, 3): radiance of the sky without clouds.
            - ``standard_error`` float32 (height, width, 3), with light model ``"path"``: one
              standard error of the clouds' radiance, before the air in front of them.
            - ``change`` float32 (height, width, 3), with quality ``"reference"``: how much that
              radiance changed when the steps were halved for the last time.
        """
        _check_camera(camera)
        _check_params(params)
        scene = checked_scene(scene_depth, None, self._size)
        image, sky, depth, samples, uncertainty = self._core.render_layers(
            camera, params, _time(time), None if scene is None else scene.depth
        )
        depth[depth < 0] = np.inf
        layers = {
            "radiance": np.ascontiguousarray(image[..., :3]),
            "transmittance": 1 - image[..., 3],
            "depth": depth,
            "samples": samples,
            "sky": np.ascontiguousarray(sky[..., :3]),
        }
        if uncertainty is not None:
            name = "standard_error" if params.light.model == "path" else "change"
            layers[name] = np.ascontiguousarray(uncertainty[..., :3])
        return layers

    def animate(
        self,
        shots: Iterable[Shot],
        *,
        background: Background = "sky",
        progress: Callable[[Iterable[Shot]], Iterable[Shot]] | None = None,
    ) -> Iterator[Frame]:
        """Yield a frame for each shot, with temporal reprojection between consecutive ones.

        One pixel in sixteen is marched per frame, the others follow the clouds from the frame
        before; the first frame and the first after a cut are stills. A static shot converges to
        the still in which every pixel is marched (``contrast=0``). Where pixels are less than an
        eighth of a degree wide, ``contrast=1``, as in ``"preview"``, marches one in sixty-four and
        follows one in sixteen, between which frames are interpolated, as its stills are: a static
        shot is the still. With light model ``"path"`` or
        quality ``"reference"`` every frame is a still, and a static shot goes on tracing paths:
        each frame has less noise.

        Where winds differ from those of the shot before, the sky does not jump to where it would
        be had they always blown: it goes on from where it is, until the next cut, and the winds
        change half way between the two shots. A still of such a shot is elsewhere; where stills
        and frames have to agree, and for shots in any order, say where the sky is by `Keyframes`
        or `Params.after`, which are shown as they are.

        Parameters
        ----------
        shots : iterable of (Camera, Params, time in seconds[, scene_depth[, scene_color]])
            The scene as for `render`, another in each shot or None. Beside its edges, and where it
            was nearer or farther in the frame before, every pixel is marched: nothing of the past
            is kept that another scene has hidden or shown. What pixels covered in part see behind
            it is a still's.
        background : {"sky", None}
            As for `render`.
        progress : callable, optional
            Wraps the shots, such as ``tqdm.tqdm``.
        """
        sky = _sky(background)
        if not (progress is None or callable(progress)):
            raise ParameterError(
                f"progress = {progress!r} is not allowed: it must be None or a function"
            )
        wrapped = progress(shots) if progress else shots
        try:
            each = iter(wrapped)
        except Exception as error:  # whatever a class of its own raises
            raise ParameterError(
                f"shots = {shots!r} is not allowed: it must be an iterable of shots ({error})"
            ) from error
        return self._frames(each, sky)

    def _frames(self, shots: Iterator[Shot], sky: bool) -> Iterator[Frame]:
        self._core.cut()
        for shot in shots:
            try:
                camera, params, time, *scene = shot
                scene_depth, scene_color = [*scene, None, None][: max(2, len(scene))]
            except Exception:  # whatever a class of its own raises
                raise ParameterError(
                    f"shot = {shot!r} is not allowed: it must be (camera, params, time), or with "
                    "scene_depth, or with scene_depth and scene_color"
                ) from None
            _check_camera(camera)
            _check_params(params)
            yield self._picture(
                self._core.animate, camera, params, _time(time), sky, scene_depth, scene_color
            )

    @property
    def history_length(self) -> npt.NDArray[np.uint32] | None:
        """How much each pixel of the last frame of `animate` rests on, in frames.

        Shape (height, width). 16 is a ray of its own, in this frame or in one since which it has
        been followed; less is the mean of guesses from the rays around it in so many frames: what
        has just come into the picture begins with 1. Where one pixel in sixteen is followed, it is
        what the first of its sixteen rests on, 4 for each frame. None where nothing is
        reprojected: before the first frame, without clouds, and with methods that converge or
        trace paths.
        """
        return self._core.history_length()

    def density(
        self, points: npt.ArrayLike, params: Params, *, time: float = 0.0
    ) -> npt.NDArray[np.float32]:
        """Return the extinction at points: the field that `render` marches.

        Parameters
        ----------
        points : array-like, shape (N, 3)
            World metres.

        Returns
        -------
        extinction : array of float32, shape (N,)
            In 1/m.
        """
        _check_params(params)
        return self._core.density(points, params, _time(time))

    def sun_transmittance(
        self, points: npt.ArrayLike, params: Params, *, time: float = 0.0
    ) -> npt.NDArray[np.float32]:
        """Return how much direct sun reaches points through the clouds.

        Parameters
        ----------
        points : array-like, shape (N, 3)
            World metres.

        Returns
        -------
        transmittance : array of float32, shape (N,)
            0 to 1; 0 where the ground hides the sun.
        """
        _check_params(params)
        return self._core.sun_transmittance(points, params, _time(time))

    def shadow_map(
        self,
        params: Params,
        *,
        time: float = 0.0,
        center: tuple[float, float] = (0.0, 0.0),
        extent: float = 20_000.0,
        size: int = 512,
        altitude: float = 0.0,
    ) -> ShadowMap:
        """Return how much direct sun reaches a level square through all clouds.

        Parameters
        ----------
        params : Params
        time : float
            Seconds.
        center : (x, y)
            Middle of the square in world metres.
        extent : float
            Its side in metres, 1 to 1e7.
        size : int
            Texels along a side, 1 to 8192.
        altitude : float
            World z of the square in metres.

        Returns
        -------
        map : ShadowMap
            ``transmittance`` float32 (size, size), row 0 in the north and column 0 in the west,
            each texel the value at its centre: 0 to 1, 0 where the sun is below the horizon. It is
            within 2 % (RMS) of `sun_transmittance`. ``world_from_map`` float64 (4, 4): see
            `ShadowMap`.

        Raises
        ------
        ParameterError
            For a place, extent or size that is not allowed.
        """
        _check_params(params)
        x, y = numbers("center", center, "2 finite numbers", shapes=[(2,)])
        place = float(x), float(y)
        side, z = _nubis.number("extent", extent), _nubis.number("altitude", altitude)
        texels = _size("size", size)
        map_ = self._core.shadow_map(params, _time(time), place, z, side, texels)
        return ShadowMap(map_, world_from_map(params, place, z, side, texels))

    def sun_visibility(
        self,
        camera: Camera,
        params: Params,
        *,
        time: float = 0.0,
        scene_depth: npt.ArrayLike | None = None,
    ) -> SunVisibility:
        """Return how much of the sun a camera sees, wherever it looks: for lens flares and light.

        Clouds take from the direct light and add to the ambient, as they scatter it to all sides
        (gems2001).

        Parameters
        ----------
        camera : Camera
        params : Params
        time : float
            Seconds.
        scene_depth : array-like, shape (height, width), optional
            As for `render`: where it is at most 1e10, it hides the sun.

        Returns
        -------
        visibility : SunVisibility
            ``direct``: the share of the sun's disc that is seen through clouds, over the ground and
            beside the scene, as a mean over the disc and over a pixel's width around it; 0 with
            the sun below the horizon. ``ambient``: the share of the sunlight that comes through the
            clouds scattered, by two streams (`SunVisibility`).
        """
        _check_camera(camera)
        _check_params(params)
        scene = checked_scene(scene_depth, None, self._size)
        depth = None if scene is None else scene.depth
        return seen_sun(self._core, camera, params, _time(time), depth, self._size)

    def weather_map(self, params: Params) -> npt.NDArray[np.float32]:
        """Return the weather map as the march reads it: baked, your own, or a mixture.

        Returns
        -------
        map : array of float32, shape (H, W, 3)
            Coverage, type and precipitation, 0 to 1, row 0 in the north and column 0 in the west,
            as `weather.map` takes them: to look at, to paint on (`paint`) or to save. They are
            half floats on the GPU, exact to 5e-4.
        """
        _check_params(params)
        return self._core.weather_map(params)

    def __repr__(self) -> str:
        width, height = self._size
        return f"Renderer({width}, {height}, adapter={self.adapter.name!r})"


_named = quality


def _check_camera(camera: Any) -> None:
    if not isinstance(camera, Camera):
        raise ParameterError(f"camera = {camera!r} is not allowed: it must be a nubis.Camera")


def _check_params(params: Any) -> None:
    if not isinstance(params, Params):
        raise ParameterError(f"params = {params!r} is not allowed: it must be a nubis.Params")


def _size(name: str, value: Any) -> int:
    try:
        size = operator.index(value)
    except Exception:  # whatever a class of its own raises
        size = 0
    if not 1 <= size <= 65536 or isinstance(value, bool):
        raise ParameterError(
            f"{name} = {value!r} is not allowed: it must be a whole number from 1 to 65536 pixels"
        )
    return size


def _time(value: Any) -> float:
    return _nubis.number("time", value)


def _sky(background: Any) -> bool:
    if background is None or (isinstance(background, str) and background == "sky"):
        return background is not None
    raise ParameterError(f'background = {background!r} is not allowed: it must be "sky" or None')


def _warn_once(adapter: Adapter) -> None:
    global _warned
    if adapter.kind == "cpu" and not _warned:
        _warned = True
        warnings.warn(
            f"no hardware Vulkan adapter was found: rendering in software on {adapter.name} "
            '(adapter="cpu" or NUBIS_ADAPTER=cpu says that this is meant)',
            stacklevel=3,
        )
