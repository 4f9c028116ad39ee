"""The compiled module (crates/clouds_py/src/lib.rs)."""

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
    "renamed",
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
    """A camera. Constructors: `look_at`, `from_matrix`, `equirect` and `fisheye`."""

    @staticmethod
    def look_at(
        eye: npt.ArrayLike,
        target: npt.ArrayLike,
        up: npt.ArrayLike | None = None,
        fov_y: float | None = None,
    ) -> Camera:
        """Return a pinhole camera that looks at a point.

        Parameters
        ----------
        eye : (3,) floats
            Camera position in world metres (x east, y north, z up).
        target : (3,) floats
            World point at the centre of the picture.
        up : (3,) floats
            Up direction of the picture; (0, 0, 1) if left out.
        fov_y : float
            Vertical field of view in degrees, above 0 and at most 179; 60 if left out.

        Raises
        ------
        ParameterError
            For a value that is not allowed.

        Examples
        --------
        >>> camera = nubis.Camera.look_at(eye=(0, 0, 2), target=(0, 1000, 400), fov_y=60.0)
        """

    @staticmethod
    def from_matrix(
        world_from_camera: npt.ArrayLike,
        fov_y: float | None = None,
        convention: Literal["opengl", "opencv"] = "opengl",
    ) -> Camera:
        """Return a pinhole camera from a camera-to-world matrix.

        Parameters
        ----------
        world_from_camera : (4, 4) floats
            Rigid transform from camera coordinates to world metres.
        fov_y : float
            Vertical field of view in degrees, above 0 and at most 179; 60 if left out.
        convention : {"opengl", "opencv"}
            Axes of the camera. OpenGL: +x right, +y up, view direction -z. OpenCV: +x right, +y
            down, view direction +z.

        Raises
        ------
        ParameterError
            For a value that is not allowed, or a matrix that is no rigid transform.
        """

    @staticmethod
    def equirect(eye: npt.ArrayLike) -> Camera:
        """Return an equirectangular camera: the whole sphere around `eye`, in world metres.

        The centre of the picture is north, its right half east (clockwise seen from above), its top
        row the zenith. A width of twice the height gives square pixels.
        """

    @staticmethod
    def fisheye(
        eye: npt.ArrayLike, up: npt.ArrayLike | None = None, fov: float | None = None
    ) -> Camera:
        """Return an equidistant fisheye (all-sky) camera at `eye`, in world metres.

        The centre of the picture is the direction `up` (the zenith if left out). Its top is the
        direction closest to north; east is on the left, as on a photograph of the sky. `fov`
        degrees (180 if left out) span the shorter side. Pixels outside that circle are 0 with alpha
        0.
        """

    @property
    def kind(self) -> Literal["perspective", "equirect", "fisheye"]:
        """Projection: "perspective", "equirect" or "fisheye"."""

    @property
    def eye(self) -> _Vector:
        """Camera position in world metres."""

    @property
    def forward(self) -> _Vector:
        """Unit vector toward the centre of the picture."""

    @property
    def up(self) -> _Vector:
        """Unit vector toward the top of the picture."""

    @property
    def right(self) -> _Vector:
        """Unit vector toward the right of the picture."""

    @property
    def fov(self) -> float:
        """Field of view in degrees: vertical, or of the whole circle of a fisheye."""

    def matrix(self) -> list[list[float]]:
        """Camera-to-world matrix, 4 x 4, by rows; OpenGL camera coordinates."""

    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __reduce__(self) -> tuple[Any, tuple[_CameraState]]: ...
    @staticmethod
    def _restore(state: _CameraState) -> Camera: ...

@final
class DensityGrid:
    """A user-supplied cloud: extinction on a regular grid.

    Parameters
    ----------
    extinction : array-like of float32, shape (nz, ny, nx)
        Extinction in 1/m at the centres of the voxels, with trilinear interpolation. The outermost
        values extend to the faces of the box; the extinction outside the box is 0.
    bounds : ((x0, y0, z0), (x1, y1, z1))
        Lowest and highest corner of the box in world metres. The box is a cuboid: it does not
        follow the curvature of the planet, and the wind does not move it.

    Raises
    ------
    ParameterError
        For a value that is not allowed.
    """

    def __new__(cls, extinction: npt.ArrayLike, bounds: npt.ArrayLike) -> DensityGrid: ...
    @property
    def extinction(self) -> npt.NDArray[np.float32]:
        """Copy of the extinction in 1/m, float32 of shape (nz, ny, nx)."""

    @property
    def bounds(self) -> tuple[_Vector, _Vector]:
        """Lowest and highest corner of the box in world metres."""

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape of the grid: (nz, ny, nx)."""

    def to_dict(self) -> dict[str, Any]:
        """Built-in Python values by name; extinction as nested lists."""

    def __hash__(self) -> int: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __reduce__(self) -> Any: ...

@final
class Renderer:
    """The renderer behind `nubis.Renderer`, without defaults."""

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
        """Clouds with alpha, sky, depth (-1 without clouds), density evaluations, uncertainty."""

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
        """Optical depth of all clouds along rays from the eye; -1 where the ground is hit."""

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
        """Weather map that the march reads: coverage, type, precipitation; shape (H, W, 3)."""

    def probe(
        self,
        imports: list[str],
        expression: str,
        inputs: list[list[float]],
        params: Params,
        eye: tuple[float, float, float],
        time: float,
    ) -> npt.NDArray[np.float32]: ...
    def light_field(
        self, camera: Camera, params: Params, time: float, how: tuple[int, bool]
    ) -> list[npt.NDArray[np.float32]]: ...
    def solve_light(
        self,
        extinction: npt.NDArray[np.float32],
        cell: tuple[float, float, float],
        sun: tuple[float, float, float],
        how: tuple[bool, int],
        params: Params,
    ) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32], float]:
        """Light field of given cells: moments (8) and deposits (2) of each, factor on the sun."""

    def irradiance(
        self,
        points: npt.ArrayLike,
        normal: tuple[float, float, float],
        params: Params,
        time: float,
    ) -> npt.NDArray[np.float32]:
        """Direct and diffuse irradiance at points, shape (N, 2, 3)."""

    def counters(self) -> list[int]:
        """Numbers of submissions to the device and of waits for them so far."""

    def timings(self) -> list[tuple[str, float]]: ...
    def memory(self) -> list[tuple[str, str, int]]:
        """GPU memory after the last picture: owner, variable and bytes of each resource."""

    def adapter(self) -> dict[str, str]: ...

def adapters() -> list[dict[str, str]]: ...
def cache_usage() -> tuple[Path | None, int]:
    """Folder of the disk cache, None if it is off, and its size in bytes."""

def carried(params: Params, time: float) -> list[float]:
    """Displacements by the winds of a sky from 0 s to a time, without its drift."""

def carried_between(
    skies: tuple[Params, Params],
    span: tuple[float, float],
    smooth: bool,
    swings: float,
    time: float,
) -> list[float]:
    """Displacements by the winds that are interpolated between two skies, from the start of the
    span to a time; the wander starts `swings` periods ahead.
    """

def check(type_name: str, path: str, name: str, value: object) -> Any:
    """The value converted to the type of a field of a block, or `ParameterError`."""

def check_params(params: object) -> None: ...
def check_quality(quality: Quality) -> None: ...
def clear_cache() -> None: ...
def drift_after(params: object, before: object, time: float) -> dict[str, Any]:
    """Fields of the drift with which a sky continues the motion of another at a time."""

def drift_of(params: Params, time: float, carried: list[float]) -> dict[str, Any]:
    """Fields of the drift of a sky whose displacements at a time, without its own drift, are
    `carried`.
    """

def number(name: str, value: object) -> float:
    """The value of the argument `name` as a float, or `ParameterError`."""

def quality(name: str) -> dict[str, Any]: ...
def read_pixels(path: str | PathLike[str]) -> npt.NDArray[np.float32]:
    """Pixels of a PNG, HDR or EXR file, shape (H, W, 1) or (H, W, 3)."""

def renamed() -> dict[str, str]:
    """Deprecated names of fields, and their names now."""

def same_winds(a: Params, b: Params) -> bool:
    """Whether two skies have the same winds."""

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
