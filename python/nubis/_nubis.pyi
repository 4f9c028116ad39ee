"""The compiled renderer: crates/clouds_py/src/lib.rs."""

from os import PathLike
from pathlib import Path
from typing import Any, Literal, Self, TypeAlias, final

import numpy as np
import numpy.typing as npt

from nubis.params import Params, Quality

__all__ = [
    "Camera",
    "DensityGrid",
    "Renderer",
    "adapters",
    "auto_exposure",
    "cache_usage",
    "carried",
    "carried_between",
    "check",
    "check_params",
    "check_quality",
    "check_target",
    "clear_cache",
    "close",
    "drift_after",
    "drift_of",
    "driver_settings",
    "forked",
    "number",
    "quality",
    "read_pixels",
    "same_winds",
    "to_srgb8",
    "write_bytes",
    "write_exr",
    "write_hdr",
    "write_png",
]

_Vector: TypeAlias = tuple[float, float, float]
_CameraState: TypeAlias = tuple[int, _Vector, _Vector, _Vector, _Vector, float]

@final
class Camera:
    """A camera: see `Camera.look_at`, `from_matrix`, `equirect` and `fisheye`."""

    @staticmethod
    def look_at(
        eye: npt.ArrayLike,
        target: npt.ArrayLike,
        up: npt.ArrayLike | None = None,
        fov_y: float | None = None,
    ) -> Camera:
        """A pinhole camera.

        Parameters
        ----------
        eye : (3,) floats
            Position in world metres (x east, y north, z up).
        target : (3,) floats
            A point in the middle of the picture.
        up : (3,) floats
            A direction that is up in the picture; (0, 0, 1) if left out.
        fov_y : float
            Vertical field of view in degrees, above 0 and at most 179; 60 if left out.
        """

    @staticmethod
    def from_matrix(
        world_from_camera: npt.ArrayLike,
        fov_y: float | None = None,
        convention: Literal["opengl", "opencv"] = "opengl",
    ) -> Camera:
        """A pinhole camera from a matrix.

        Parameters
        ----------
        world_from_camera : (4, 4) floats
            Takes camera coordinates to world metres; a rigid motion.
        fov_y : float
            Vertical field of view in degrees, above 0 and at most 179; 60 if left out.
        convention : {"opengl", "opencv"}
            The camera's axes: +x right, +y up, looking down -z; or +x right, +y down, looking down
            +z.
        """

    @staticmethod
    def equirect(eye: npt.ArrayLike) -> Camera:
        """The whole sphere around `eye` by longitude and latitude.

        The image's centre is north, right is clockwise seen from above (east), its top row the
        zenith. Twice as wide as high gives square pixels.
        """

    @staticmethod
    def fisheye(
        eye: npt.ArrayLike, up: npt.ArrayLike | None = None, fov: float | None = None
    ) -> Camera:
        """An equidistant all-sky camera.

        The image's centre is `up` (the zenith if left out), its top as far north as can be; as on a
        photograph of the sky, east is on the left. `fov` degrees (180 if left out) span the shorter
        side; outside that circle pixels are 0 with alpha 0.
        """

    @property
    def kind(self) -> Literal["perspective", "equirect", "fisheye"]:
        """The projection: "perspective", "equirect" or "fisheye"."""

    @property
    def eye(self) -> _Vector:
        """Position in world metres."""

    @property
    def forward(self) -> _Vector:
        """Unit vector toward the middle of the picture."""

    @property
    def up(self) -> _Vector:
        """Unit vector toward the top of the picture."""

    @property
    def right(self) -> _Vector:
        """Unit vector toward the right of the picture."""

    @property
    def fov(self) -> float:
        """Field of view in degrees: vertical, of a fisheye its whole circle."""

    def matrix(self) -> list[list[float]]:
        """The 4 x 4 matrix from camera coordinates (OpenGL) to world coordinates, by rows."""

    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __reduce__(self) -> tuple[Any, tuple[_CameraState]]: ...
    @staticmethod
    def _restore(state: _CameraState) -> Camera: ...

@final
class DensityGrid:
    """A cloud of your own: extinction on a grid.

    Parameters
    ----------
    extinction : array-like of float32, shape (nz, ny, nx)
        In 1/m, at the centres of the voxels, trilinear between them; the outermost values hold to
        the faces of the box, outside there is nothing.
    bounds : ((x0, y0, z0), (x1, y1, z1))
        Lowest and highest corner of the box in world metres. It is straight: the planet's
        curvature does not bend it, and the wind does not move it.
    """

    def __new__(cls, extinction: npt.ArrayLike, bounds: npt.ArrayLike) -> DensityGrid: ...
    @property
    def extinction(self) -> npt.NDArray[np.float32]:
        """Extinction in 1/m, float32 of shape (nz, ny, nx): a copy."""

    @property
    def bounds(self) -> tuple[_Vector, _Vector]:
        """Lowest and highest corner in world metres."""

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape of the grid: (nz, ny, nx)."""

    def to_dict(self) -> dict[str, Any]:
        """Plain values by name: extinction as nested lists."""

    def __hash__(self) -> int: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __reduce__(self) -> Any: ...

@final
class Renderer:
    """What `nubis.Renderer` wraps: no defaults, plain values."""

    def __new__(cls, width: int, height: int, quality: Quality, adapter: str | None) -> Self: ...
    def render(
        self,
        camera: Camera,
        params: Params,
        time: float,
        background: bool,
        scene_depth: npt.NDArray[np.float32] | None,
        scene_color: npt.NDArray[np.float32] | None,
    ) -> npt.NDArray[np.float32]: ...
    def render_layers(
        self,
        camera: Camera,
        params: Params,
        time: float,
        scene_depth: npt.NDArray[np.float32] | None,
    ) -> tuple[
        npt.NDArray[np.float32],
        npt.NDArray[np.float32],
        npt.NDArray[np.float32],
        npt.NDArray[np.uint32],
        npt.NDArray[np.float32] | None,
    ]:
        """Clouds with alpha, sky, depth (-1 where there is none), density evaluations."""

    def animate(
        self,
        camera: Camera,
        params: Params,
        time: float,
        background: bool,
        scene_depth: npt.NDArray[np.float32] | None,
        scene_color: npt.NDArray[np.float32] | None,
    ) -> npt.NDArray[np.float32]: ...
    def cut(self) -> None: ...
    def history_length(self) -> npt.NDArray[np.uint32] | None: ...
    def density(
        self, points: npt.ArrayLike, params: Params, time: float
    ) -> npt.NDArray[np.float32]: ...
    def sun_transmittance(
        self, points: npt.ArrayLike, params: Params, time: float
    ) -> npt.NDArray[np.float32]: ...
    def depth_along(
        self, camera: Camera, directions: npt.ArrayLike, params: Params, time: float
    ) -> npt.NDArray[np.float32]:
        """Optical depth of all clouds from the eye; -1 where the ground is in the way."""

    def shadow_map(
        self,
        params: Params,
        time: float,
        center: tuple[float, float],
        altitude: float,
        extent: float,
        size: int,
    ) -> npt.NDArray[np.float32]: ...
    def weather_map(self, params: Params) -> npt.NDArray[np.float32]:
        """Coverage, type and precipitation as the march reads them, shape (H, W, 3)."""

    def probe(
        self,
        imports: list[str],
        expression: str,
        inputs: list[list[float]],
        params: Params,
        eye: tuple[float, float, float],
        time: float,
    ) -> npt.NDArray[np.float32]: ...
    def counters(self) -> list[int]:
        """Submissions to the device so far, and how often one was waited for."""

    def timings(self) -> list[tuple[str, float]]: ...
    def memory(self) -> list[tuple[str, str, int]]:
        """What the last picture has left on the GPU: for whom, the variable, bytes."""

    def adapter(self) -> dict[str, str]: ...

def adapters() -> list[dict[str, str]]: ...
def cache_usage() -> tuple[Path | None, int]:
    """The folder of the cache, None where it is off, and how many bytes are in it."""

def carried(params: Params, time: float) -> list[float]:
    """How far a sky has carried things from 0 s to a time, beside its drift."""

def carried_between(
    skies: tuple[Params, Params],
    span: tuple[float, float],
    smooth: bool,
    swings: float,
    time: float,
) -> list[float]:
    """How far things are carried from the start of the span to a time, on the way from one sky to
    another, by a wander that is `swings` ahead.
    """

def check(type_name: str, path: str, name: str, value: object) -> Any:
    """The value in the type that a field of a block holds, or `ParameterError`."""

def check_params(params: object) -> None: ...
def check_quality(quality: Quality) -> None: ...
def clear_cache() -> None: ...
def drift_after(params: object, before: object, time: float) -> dict[str, Any]:
    """The fields of the drift with which a sky goes on from another."""

def drift_of(params: Params, time: float, carried: list[float]) -> dict[str, Any]:
    """The fields of the drift of a sky that has carried things so far at a time, beside the drift
    that it has.
    """

def number(name: str, value: object) -> float:
    """The number that is given for an argument, or `ParameterError`."""

def quality(name: str) -> dict[str, Any]: ...
def read_pixels(path: str | PathLike[str]) -> npt.NDArray[np.float32]:
    """The numbers in a PNG, HDR or EXR file, shape (H, W, 1) or (H, W, 3)."""

def same_winds(a: Params, b: Params) -> bool:
    """Whether what winds carry moves alike in two skies."""

def to_srgb8(
    frame: npt.NDArray[np.float32], exposure: float, tonemap: str, dither: bool
) -> npt.NDArray[np.uint8]: ...
def auto_exposure(frame: npt.NDArray[np.float32], key: float, low: float, high: float) -> float: ...
def close() -> None: ...
def forked() -> None: ...
def driver_settings() -> list[tuple[str, str]]: ...
def check_target(path: str | PathLike[str]) -> None: ...
def write_bytes(path: str | PathLike[str], bytes: bytes) -> None: ...
def write_png(path: str | PathLike[str], frame: npt.NDArray[np.uint8]) -> None: ...
def write_exr(path: str | PathLike[str], frame: npt.NDArray[np.float32]) -> None: ...
def write_hdr(path: str | PathLike[str], frame: npt.NDArray[np.float32]) -> None: ...
