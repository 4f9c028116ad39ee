"""The public `Renderer`, named qualities and adapters."""

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

#: Names of the numerical methods.
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
        Names reported by the driver; the backend is ``"vulkan"``, ``"metal"`` or ``"dx12"``.
    kind : str
        ``"discrete"``, ``"integrated"``, ``"virtual"``, ``"cpu"`` or ``"other"``.
    pci : str
        PCI bus address; empty if there is none.
    """

    name: str
    driver: str
    backend: str
    kind: str
    pci: str


def adapters() -> list[Adapter]:
    """Return the usable adapters, best first. An index into the list selects one in `Renderer`.

    Examples
    --------
    >>> [adapter.kind for adapter in nubis.adapters()]
    ['cpu']
    """
    return [Adapter(**adapter) for adapter in _nubis.adapters()]


def quality(name: str) -> Quality:
    """Return the numerical method of a name, to inspect or to change.

    Parameters
    ----------
    name : str
        ``"preview"`` (soft: one pixel in sixteen is marched), ``"draft"``, ``"balanced"``,
        ``"high"``, ``"reference"`` (converged, slow), or the published settings of a source
        (docs/sources.md): ``"nubis2015"``, ``"thesis2018"``, ``"vsu2022"``.

    Returns
    -------
    Quality

    Raises
    ------
    ParameterError
        For an unknown name.

    Examples
    --------
    >>> method = nubis.quality("balanced").replace(adaptive_threshold=0.0)
    >>> renderer = nubis.Renderer(960, 540, quality=method)
    """
    if not isinstance(name, str):
        raise ParameterError(f"quality = {name!r} is not allowed: it must be a name or a Quality")
    try:
        return Quality(**_nubis.quality(name))
    except ParameterError:
        raise ParameterError(unknown(f"quality = {name!r}", name, QUALITIES)) from None


class Renderer:
    """A renderer for pictures of one size with one numerical method.

    Parameters
    ----------
    width, height : int
        Size of the pictures in pixels, 1 to 65536.
    quality : str or Quality
        Numerical method: a name (see `quality`) or a `Quality`. It sets accuracy and cost; the
        appearance of the sky is set by `Params`.
    adapter : int or str, optional
        Device: an index into `adapters()`, a kind such as ``"cpu"``, or part of a name, driver or
        PCI address. Default: the environment variable ``NUBIS_ADAPTER``, in the same form; if it is
        not set, the best adapter: hardware first, else software with a warning.

    Raises
    ------
    ParameterError
        For a size or quality that is not allowed.
    AdapterError
        If there is no such adapter. The message lists those found.
    ForkError
        In a forked child of a process that has used the GPU.

    Examples
    --------
    >>> camera = nubis.Camera.look_at(eye=(0, 0, 2), target=(0, 1000, 400))
    >>> frame = nubis.Renderer(960, 540).render(camera, nubis.Params())
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
        """Numerical method of the renderer."""
        return self._quality

    @property
    def adapter(self) -> Adapter:
        """Device of the renderer."""
        return Adapter(**self._core.adapter())

    @property
    def timings(self) -> dict[str, float]:
        """GPU time in milliseconds by pass name, for the last picture or query.

        Bakes of LUTs are listed only if they ran. Empty on adapters without timestamps.
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
        """Return a still: a complete picture in one call, without history.

        Parameters
        ----------
        camera : Camera
        params : Params
        time : float
            Time in seconds, of any magnitude. Winds carry the clouds from their positions at 0 s.
        background : {"sky", None}
            ``"sky"``: radiance of the whole sky, alpha 1. None: radiance of the clouds alone, seen
            through the air and premultiplied, alpha = 1 - transmittance.
        scene_depth : array-like, shape (height, width), optional
            Depth of a user-supplied scene: distance in metres along the ray of each pixel, not
            along the camera axis (`distance_from_z` converts). inf, or a value above 1e10, means
            no surface. Only clouds and air in front of the scene are visible. The scene hides the
            built-in ground and casts no shadow. Without `scene_color` and with the sky background,
            a pixel of the scene holds the clouds and the air in front of it, premultiplied, with
            alpha below 1: ``frame + (1 - alpha) * scene`` is the composite. Alpha includes the
            luminance of the transmittance of the air.
        scene_color : array-like, shape (height, width, 3) or (height, width, 4), optional
            Scene-linear radiance of that scene (Rec. 709 primaries). Clouds and air attenuate it by
            colour channel. A fourth channel is the coverage of the pixel by the scene, 0 to 1, by
            which the radiance is premultiplied; the rest of the pixel shows the background.
            Requires the sky background.

        Returns
        -------
        frame : array of float32, shape (height, width, 4)
            Scene-linear radiance with Rec. 709 primaries, not clipped, and alpha; row 0 is the top.

        Raises
        ------
        ParameterError
            For an argument that is not allowed, before any GPU work.
        DeviceError
            If the device is lost or out of memory.

        Examples
        --------
        >>> frame = nubis.Renderer(960, 540).render(*nubis.scenes["sunset"])
        >>> frame.shape
        (540, 960, 4)
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
        """A picture by `make`, composited where a scene covers pixels partly."""
        scene = checked_scene(scene_depth, scene_color, self._size)
        if scene_color is not None and not sky:
            raise ParameterError('scene_color is not allowed with background=None: "sky" takes it')
        if scene is None:
            return make(camera, params, time, sky, None, None)
        frame = make(camera, params, time, sky, scene.depth, scene.color)
        if scene.cover is not None:
            # The background of partly covered pixels. A depth of 0 skips all others.
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
        """Return the layers of a still.

        Parameters
        ----------
        camera, params, time, scene_depth
            As for `render`. In pixels of a scene, ``sky`` is the radiance of the air in front of
            it, as for a black scene.

        Returns
        -------
        layers : dict of arrays
            - ``radiance`` float32 (height, width, 3): radiance of the clouds, seen through the air
              and premultiplied; ``radiance + transmittance * sky`` is the composite.
            - ``transmittance`` float32 (height, width): transmittance of all clouds, 0 to 1.
            - ``depth`` float32 (height, width): distance in metres to the mean scattering point of
              the clouds, inf without clouds.
            - ``samples`` uint32 (height, width): number of density evaluations, of view and light
              samples together.
            - ``sky`` float32 (height, width, 3): radiance of the sky without clouds.
            - ``standard_error`` float32 (height, width, 3), with integrator ``"path"``: standard
              error of the radiance of the clouds, without the air in front of them.
            - ``change`` float32 (height, width, 3), with integrator ``"reference"``: change of that
              radiance by the last halving of the steps.

        Raises
        ------
        ParameterError
            For an argument that is not allowed, before any GPU work.
        DeviceError
            If the device is lost or out of memory.

        Examples
        --------
        >>> layers = renderer.render_layers(camera, params)
        >>> frame = layers["radiance"] + layers["transmittance"][..., None] * layers["sky"]
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
            traced = "path" in (self._quality.integrator, params.light.model)
            name = "standard_error" if traced else "change"
            layers[name] = np.ascontiguousarray(uncertainty[..., :3])
        return layers

    def animate(
        self,
        shots: Iterable[Shot],
        *,
        background: Background = "sky",
        progress: Callable[[Iterable[Shot]], Iterable[Shot]] | None = None,
    ) -> Iterator[Frame]:
        """Yield a frame for each shot, with temporal reprojection between consecutive shots.

        A frame marches one pixel in sixteen. The other pixels are reprojected from the history, and
        interpolated or marched where the history is rejected. The first frame and the first frame
        after a cut are stills. A static shot converges to the still in which every pixel is marched
        (``adaptive_threshold=0``).

        With ``adaptive_threshold=1``, as in ``"preview"``, and pixels narrower than an eighth of a
        degree, a frame marches one pixel in sixty-four and reprojects one in sixteen. Its frames
        are upsampled from these pixels, as its stills are, so that a static shot equals the still.

        With integrator ``"path"`` or ``"reference"`` every frame is a still. A static shot
        accumulates paths: noise decreases from frame to frame.

        A change of wind between two shots does not make the clouds jump: the motion continues from
        the frame before, until the next cut, and the winds change half-way between the two shots.
        A still of the same shot shows the clouds elsewhere. Skies of `Keyframes` and `Params.after`
        carry their own displacement and are rendered unchanged: use them if stills and frames have
        to agree, or for shots in any order.

        Parameters
        ----------
        shots : iterable of (Camera, Params, time in seconds[, scene_depth[, scene_color]])
            Camera, parameters and time of each frame, and a scene as for `render`, None or
            different in each shot. At edges of the scene and at disocclusions, where its depth has
            changed since the frame before, every pixel is marched and no history is kept. The
            background of partly covered pixels is rendered as in a still.
        background : {"sky", None}
            As for `render`.
        progress : callable, optional
            Wrapper of the iterable of shots, such as ``tqdm.tqdm``.

        Yields
        ------
        frame : array of float32, shape (height, width, 4)
            As returned by `render`.

        Raises
        ------
        ParameterError
            For an argument or a shot that is not allowed.
        DeviceError
            If the device is lost or out of memory.

        Examples
        --------
        >>> shots = [(camera, params, i / 24) for i in range(48)]
        >>> for i, frame in enumerate(renderer.animate(shots)):
        ...     nubis.save(f"frame_{i:03}.png", frame)
        """
        sky = _sky(background)
        if not (progress is None or callable(progress)):
            raise ParameterError(
                f"progress = {progress!r} is not allowed: it must be None or a function"
            )
        wrapped = progress(shots) if progress else shots
        try:
            each = iter(wrapped)
        except Exception as error:  # a foreign class may raise anything
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
            except Exception:  # a foreign class may raise anything
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
        """History length of each pixel of the last frame of `animate`, in frames.

        Array of uint32, shape (height, width), or None. 16 means that the pixel has been sampled
        directly: marched in this frame, or marched in an earlier one and reprojected since. Less is
        the number of frames since the pixel was interpolated from the samples around it; 1 is an
        interpolated pixel of this frame, such as a disoccluded one. If one pixel in sixteen is
        reprojected (``adaptive_threshold=1``), all sixteen pixels of a block have the value of the
        first, which grows by 4 per frame. None if nothing is reprojected: before the first frame,
        without clouds, and with the integrators ``"reference"`` and ``"path"``.
        """
        return self._core.history_length()

    def density(
        self, points: npt.ArrayLike, params: Params, *, time: float = 0.0
    ) -> npt.NDArray[np.float32]:
        """Return the extinction of the clouds at points: the field that `render` marches.

        Parameters
        ----------
        points : array-like, shape (N, 3)
            Positions in world metres.
        params : Params
        time : float
            Time in seconds.

        Returns
        -------
        extinction : array of float32, shape (N,)
            Extinction in 1/m.

        Raises
        ------
        ParameterError
            For an argument that is not allowed.

        Examples
        --------
        >>> extinction = renderer.density([(0, 0, 1500), (0, 0, 2000)], params)
        """
        _check_params(params)
        return self._core.density(points, params, _time(time))

    def sun_transmittance(
        self, points: npt.ArrayLike, params: Params, *, time: float = 0.0
    ) -> npt.NDArray[np.float32]:
        """Return the transmittance of the clouds from points toward the sun.

        Parameters
        ----------
        points : array-like, shape (N, 3)
            Positions in world metres.
        params : Params
        time : float
            Time in seconds.

        Returns
        -------
        transmittance : array of float32, shape (N,)
            Transmittance, 0 to 1; 0 where the ground hides the sun.

        Raises
        ------
        ParameterError
            For an argument that is not allowed.

        Examples
        --------
        >>> sunlit = renderer.sun_transmittance([(0, 0, 0), (500, 0, 0)], params)
        """
        _check_params(params)
        return self._core.sun_transmittance(points, params, _time(time))

    def irradiance(
        self,
        points: npt.ArrayLike,
        params: Params,
        *,
        normal: npt.ArrayLike = (0.0, 0.0, 1.0),
        time: float = 0.0,
    ) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
        """Return the irradiance of planes at points, by the light field.

        The sum of both parts is the global irradiance; for a horizontal plane, the direct part
        is the direct normal irradiance times the sine of the sun's elevation.

        Parameters
        ----------
        points : array-like, shape (N, 3)
            Positions in world metres.
        params : Params
            Its light model is ``"multiple"``.
        normal : array-like of three numbers
            Normal of the planes, of any length.
        time : float
            Time in seconds.

        Returns
        -------
        direct, diffuse : array of float32, shape (N, 3)
            Irradiance of the sun, straight from it through clouds and air, and of all other
            light: of clouds, sky and ground. Rec. 709, in the units of ``sun.irradiance``. Light
            that high clouds scatter is not part of it.

        Raises
        ------
        ParameterError
            For an argument that is not allowed, and for a light model without a light field.

        Examples
        --------
        >>> direct, diffuse = renderer.irradiance([(0, 0, 0)], params)
        """
        _check_params(params)
        allowed = "three numbers, not all 0"
        across = numbers("normal", normal, allowed, shapes=[(3,)], dtype=np.float64)
        if not np.any(across):
            raise ParameterError(f"normal = {normal!r}: allowed is {allowed}")
        answers = self._core.irradiance(points, tuple(across.tolist()), params, _time(time))
        return answers[:, 0], answers[:, 1]

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
        """Return a map of the transmittance of all clouds toward the sun, on a horizontal square.

        Parameters
        ----------
        params : Params
        time : float
            Time in seconds.
        center : (x, y)
            Centre of the square in world metres.
        extent : float
            Side of the square in metres, 1 to 1e7.
        size : int
            Number of texels along a side, 1 to 8192.
        altitude : float
            World z of the square in metres.

        Returns
        -------
        map : ShadowMap
            ``transmittance`` float32 (size, size): 0 to 1 at the centres of the texels, row 0 in
            the north, column 0 in the west; 0 if the sun is below the horizon. Its deviation from
            `sun_transmittance` is within 2 % (RMS). ``world_from_map`` float64 (4, 4): see
            `ShadowMap`.

        Raises
        ------
        ParameterError
            For a centre, extent or size that is not allowed.

        Examples
        --------
        >>> shadow = renderer.shadow_map(params, extent=10_000.0, size=256)
        >>> sunlit_fraction = shadow.transmittance.mean()
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
        """Return the visibility of the sun from the position of a camera, for flares and lighting.

        Clouds attenuate the direct light and scatter part of it into ambient light (gems2001). The
        view direction matters for `scene_depth` alone.

        Parameters
        ----------
        camera : Camera
        params : Params
        time : float
            Time in seconds.
        scene_depth : array-like, shape (height, width), optional
            Depth of a scene as for `render`. A depth of at most 1e10 hides the sun.

        Returns
        -------
        visibility : SunVisibility
            ``direct``: transmittance toward the sun, 0 where ground or scene hide it, as a mean
            over the disc and the width of a pixel around it; 0 if the sun is below the horizon.
            ``ambient``: fraction of the sunlight that clouds transmit diffusely, by a two-stream
            approximation (`SunVisibility`).

        Raises
        ------
        ParameterError
            For an argument that is not allowed.

        Examples
        --------
        >>> direct, ambient = renderer.sun_visibility(camera, params)
        """
        _check_camera(camera)
        _check_params(params)
        scene = checked_scene(scene_depth, None, self._size)
        depth = None if scene is None else scene.depth
        return seen_sun(self._core, camera, params, _time(time), depth, self._size)

    def weather_map(self, params: Params) -> npt.NDArray[np.float32]:
        """Return the weather map that the march reads: baked, user-supplied, or a mixture.

        Returns
        -------
        map : array of float32, shape (H, W, 3)
            Coverage, type and precipitation, 0 to 1, row 0 in the north, column 0 in the west: a
            valid `weather.map`. Values are half floats on the GPU, exact to 5e-4.

        Examples
        --------
        >>> weather = renderer.weather_map(params)
        >>> coverage = weather[..., 0]
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
    if params.light.model == "path":
        warnings.warn(
            "light.model = 'path' is deprecated: use nubis.Quality(integrator='path')",
            DeprecationWarning,
            stacklevel=3,
        )


def _size(name: str, value: Any) -> int:
    try:
        size = operator.index(value)
    except Exception:  # a foreign class may raise anything
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
