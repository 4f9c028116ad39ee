//! Module `nubis._nubis`: the renderer for Python, a thin conversion layer over the core.

mod convert;
mod exit;

use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::{Arc, Mutex};

use clouds_core::Shot;
use clouds_core::camera::{Camera as CoreCamera, Convention, Projection};
use clouds_core::gpu::{self, lock};
use clouds_core::params::{Params, Quality, RENAMED};
use clouds_core::renderer::Renderer as CoreRenderer;
use clouds_core::scene_depth::SceneDepth;
use clouds_core::schema::Value;
use clouds_core::wind::{Advection, Between, NUMBERS};
use clouds_core::{Cells, DensityGrid as CoreGrid, Error, Result, cache, color, files, params, schema};
use glam::DVec3;
use numpy::{PyArray1, PyArrayMethods as _, PyReadonlyArray3, PyReadonlyArrayDyn, PyUntypedArrayMethods as _};
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict as _, PyDict, PyString, PyTuple};

use convert::{
    number_from_python, numbers_from_python, params_from_python, quality_from_python, value_from_python,
    value_to_python, vector_from_python,
};

/// Python exception of an error of the core.
fn exception(py: Python<'_>, error: &Error) -> PyErr {
    let name = match error {
        Error::Parameter(_) => "ParameterError",
        Error::Adapter(_) => "AdapterError",
        Error::Device(_) | Error::Interrupted => "DeviceError",
        Error::Fork => "ForkError",
        Error::File(_) => "FileError",
    };
    match py.import("nubis._errors").and_then(|module| module.getattr(name)?.call1((error.to_string(),))) {
        Ok(value) => PyErr::from_value(value),
        Err(error) => error,
    }
}

fn raise<T>(py: Python<'_>, result: Result<T>) -> PyResult<T> {
    result.map_err(|error| exception(py, &error))
}

/// Runs `work` without the GIL.
fn unlocked<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> T {
    let _inside = exit::enter(py);
    let result = py.detach(work);
    exit::stay_if_closing(py);
    result
}

/// Runs `work` without the GIL. Its interrupt check reports Ctrl-C and the exit of the interpreter. A panic becomes an
/// error.
fn detached<T: Send>(py: Python<'_>, work: impl FnOnce(gpu::Interrupt<'_>) -> Result<T> + Send) -> PyResult<T> {
    let (result, interrupt) = unlocked(py, || {
        let raised = RefCell::new(None);
        let interrupt = || {
            if exit::is_closing() {
                return Err(Error::Interrupted);
            }
            // There is no interpreter to attach to during finalization.
            Python::try_attach(|py| py.check_signals()).unwrap_or(Ok(())).map_err(|error| {
                *raised.borrow_mut() = Some(error);
                Error::Interrupted
            })
        };
        let result = catch_unwind(AssertUnwindSafe(|| work(&interrupt)));
        let result = result.unwrap_or_else(|panic| {
            let message = panic.downcast_ref::<String>().map(String::as_str);
            let message = message.or(panic.downcast_ref::<&str>().copied()).unwrap_or("unknown");
            Err(Error::Device(format!("internal error, please report it: {message}")))
        });
        (result, raised.into_inner())
    });
    match interrupt {
        Some(error) => Err(error),
        None => raise(py, result),
    }
}

fn vector(v: [f64; 3]) -> DVec3 {
    DVec3::from_array(v)
}

fn fov_y_or_default(fov_y: Option<&Bound<'_, PyAny>>) -> PyResult<f64> {
    fov_y.map_or(Ok(60.0), |fov_y| number_from_python("fov_y", fov_y))
}

/// A camera. Constructors: `look_at`, `from_matrix`, `equirect` and `fisheye`.
#[pyclass(frozen, eq, from_py_object, module = "nubis")]
#[derive(Clone, Copy, PartialEq)]
struct Camera(CoreCamera);

type CameraState = (u8, [f64; 3], [f64; 3], [f64; 3], [f64; 3], f64);

#[pymethods]
impl Camera {
    /// Return a pinhole camera that looks at a point.
    ///
    /// Parameters
    /// ----------
    /// eye : (3,) floats
    ///     Camera position in world metres (x east, y north, z up).
    /// target : (3,) floats
    ///     World point at the centre of the picture.
    /// up : (3,) floats
    ///     Up direction of the picture; (0, 0, 1) if left out.
    /// fov_y : float
    ///     Vertical field of view in degrees, above 0 and at most 179; 60 if left out.
    ///
    /// Raises
    /// ------
    /// ParameterError
    ///     For a value that is not allowed.
    ///
    /// Examples
    /// --------
    /// >>> camera = nubis.Camera.look_at(eye=(0, 0, 2), target=(0, 1000, 400), fov_y=60.0)
    #[staticmethod]
    #[pyo3(signature = (eye, target, up=None, fov_y=None))]
    fn look_at(
        eye: &Bound<'_, PyAny>,
        target: &Bound<'_, PyAny>,
        up: Option<&Bound<'_, PyAny>>,
        fov_y: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let py = eye.py();
        let (eye, target) = (vector_from_python("eye", eye)?, vector_from_python("target", target)?);
        let up = up.map_or(Ok(DVec3::Z), |up| vector_from_python("up", up))?;
        raise(py, CoreCamera::look_at(eye, target, up, fov_y_or_default(fov_y)?)).map(Self)
    }

    /// Return a pinhole camera from a camera-to-world matrix.
    ///
    /// Parameters
    /// ----------
    /// world_from_camera : (4, 4) floats
    ///     Rigid transform from camera coordinates to world metres.
    /// fov_y : float
    ///     Vertical field of view in degrees, above 0 and at most 179; 60 if left out.
    /// convention : {"opengl", "opencv"}
    ///     Axes of the camera. OpenGL: +x right, +y up, view direction -z. OpenCV: +x right, +y
    ///     down, view direction +z.
    ///
    /// Raises
    /// ------
    /// ParameterError
    ///     For a value that is not allowed, or a matrix that is no rigid transform.
    #[staticmethod]
    #[pyo3(
        signature = (world_from_camera, fov_y=None, convention=None),
        text_signature = "(world_from_camera, fov_y=None, convention='opengl')"
    )]
    fn from_matrix(
        world_from_camera: &Bound<'_, PyAny>,
        fov_y: Option<&Bound<'_, PyAny>>,
        convention: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let py = world_from_camera.py();
        let _inside = exit::enter(py);
        let (shape, allowed) = ([Some(4); 2], "a 4 x 4 matrix of finite numbers");
        let matrix = numbers_from_python("world_from_camera", world_from_camera, allowed, &[&shape], &[])?;
        let numbers = matrix.as_slice()?;
        let rows = std::array::from_fn(|row| std::array::from_fn(|column| numbers[4 * row + column]));
        let convention = match convention.map_or(Ok(Value::Text("opengl".into())), value_from_python)? {
            Value::Text(word) if word == "opengl" => Convention::OpenGl,
            Value::Text(word) if word == "opencv" => Convention::OpenCv,
            other => return Err(exception(py, &Error::parameter("convention", other, "\"opengl\" or \"opencv\""))),
        };
        raise(py, CoreCamera::from_matrix(rows, fov_y_or_default(fov_y)?, convention)).map(Self)
    }

    /// Return an equirectangular camera: the whole sphere around `eye`, in world metres.
    ///
    /// The centre of the picture is north, its right half east (clockwise seen from above), its top
    /// row the zenith. A width of twice the height gives square pixels.
    #[staticmethod]
    fn equirect(eye: &Bound<'_, PyAny>) -> PyResult<Self> {
        raise(eye.py(), CoreCamera::equirect(vector_from_python("eye", eye)?)).map(Self)
    }

    /// Return an equidistant fisheye (all-sky) camera at `eye`, in world metres.
    ///
    /// The centre of the picture is the direction `up` (the zenith if left out). Its top is the
    /// direction closest to north; east is on the left, as on a photograph of the sky. `fov`
    /// degrees (180 if left out) span the shorter side. Pixels outside that circle are 0 with alpha
    /// 0.
    #[staticmethod]
    #[pyo3(signature = (eye, up=None, fov=None))]
    fn fisheye(
        eye: &Bound<'_, PyAny>,
        up: Option<&Bound<'_, PyAny>>,
        fov: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let py = eye.py();
        let up = up.map_or(Ok(DVec3::Z), |up| vector_from_python("up", up))?;
        let fov = fov.map_or(Ok(180.0), |fov| number_from_python("fov", fov))?;
        raise(py, CoreCamera::fisheye(vector_from_python("eye", eye)?, up, fov)).map(Self)
    }

    /// Projection: "perspective", "equirect" or "fisheye".
    #[getter]
    fn kind(&self) -> &'static str {
        match self.0.projection {
            Projection::Perspective => "perspective",
            Projection::Equirect => "equirect",
            Projection::Fisheye => "fisheye",
        }
    }

    /// Camera position in world metres.
    #[getter]
    fn eye(&self) -> (f64, f64, f64) {
        self.0.eye.into()
    }

    /// Unit vector toward the centre of the picture.
    #[getter]
    fn forward(&self) -> (f64, f64, f64) {
        self.0.forward.into()
    }

    /// Unit vector toward the top of the picture.
    #[getter]
    fn up(&self) -> (f64, f64, f64) {
        self.0.up.into()
    }

    /// Unit vector toward the right of the picture.
    #[getter]
    fn right(&self) -> (f64, f64, f64) {
        self.0.right.into()
    }

    /// Field of view in degrees: vertical, or of the whole circle of a fisheye.
    #[getter]
    fn fov(&self) -> f64 {
        self.0.fov
    }

    /// Camera-to-world matrix, 4 x 4, by rows; OpenGL camera coordinates.
    fn matrix(&self) -> [[f64; 4]; 4] {
        self.0.matrix()
    }

    fn __repr__(&self) -> String {
        let (e, f) = (self.0.eye, self.0.forward);
        format!(
            "Camera(kind={:?}, eye=({}, {}, {}), forward=({}, {}, {}), fov={})",
            self.kind(),
            e.x,
            e.y,
            e.z,
            f.x,
            f.y,
            f.z,
            self.0.fov
        )
    }

    fn __hash__(&self) -> u64 {
        let c = &self.0;
        let numbers = [c.eye, c.right, c.up, c.forward].map(|v| v.to_array());
        // -0.0 equals 0.0, so both have the same hash.
        let bits = numbers.iter().flatten().chain([&c.fov]).map(|v| (v + 0.0).to_bits());
        fnv([c.projection as u64].into_iter().chain(bits))
    }

    #[staticmethod]
    fn _restore(state: CameraState) -> Self {
        let (kind, eye, right, up, forward, fov) = state;
        let projection = [Projection::Perspective, Projection::Equirect, Projection::Fisheye][usize::from(kind % 3)];
        let (eye, right, up, forward) = (vector(eye), vector(right), vector(up), vector(forward));
        Self(CoreCamera { projection, eye, right, up, forward, fov })
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (CameraState,))> {
        let c = slf.get().0;
        let axes = [c.eye, c.right, c.up, c.forward].map(|v| v.to_array());
        let state = (c.projection as u8, axes[0], axes[1], axes[2], axes[3], c.fov);
        Ok((slf.get_type().getattr("_restore")?, (state,)))
    }
}

/// A user-supplied cloud: extinction on a regular grid.
///
/// Parameters
/// ----------
/// extinction : array-like of float32, shape (nz, ny, nx)
///     Extinction in 1/m at the centres of the voxels, with trilinear interpolation. The outermost
///     values extend to the faces of the box; the extinction outside the box is 0.
/// bounds : ((x0, y0, z0), (x1, y1, z1))
///     Lowest and highest corner of the box in world metres. The box is a cuboid: it does not
///     follow the curvature of the planet, and the wind does not move it.
///
/// Raises
/// ------
/// ParameterError
///     For a value that is not allowed.
#[pyclass(frozen, eq, module = "nubis")]
#[derive(PartialEq)]
struct DensityGrid(Arc<CoreGrid>);

type GridState<'py> = (Bound<'py, PyAny>, [[f64; 3]; 2]);

#[pymethods]
impl DensityGrid {
    #[new]
    fn new(extinction: &Bound<'_, PyAny>, bounds: &Bound<'_, PyAny>) -> PyResult<Self> {
        let py = extinction.py();
        let _inside = exit::enter(py);
        let allowed = "an array of numbers of shape (nz, ny, nx), each from 1 to 2048";
        let array = numbers_from_python("extinction", extinction, allowed, &[&[None; 3]], &["z", "y", "x"])?;
        let allowed = "two corners of finite numbers: ((x0, y0, z0), (x1, y1, z1))";
        let corners = numbers_from_python::<f64>("bounds", bounds, allowed, &[&[Some(2), Some(3)]], &[])?;
        let (&[nz, ny, nx], &[x0, y0, z0, x1, y1, z1]) = (array.shape(), corners.as_slice()?) else {
            unreachable!("the shapes are checked");
        };
        let (low, high) = ([x0, y0, z0], [x1, y1, z1]);
        let grid = CoreGrid::new([nx, ny, nz], array.as_slice()?.to_vec(), vector(low), vector(high));
        Ok(Self(Arc::new(raise(py, grid)?)))
    }

    /// Copy of the extinction in 1/m, float32 of shape (nz, ny, nx).
    #[getter]
    fn extinction<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let [nx, ny, nz] = self.0.size();
        array(py, self.0.extinction().to_vec(), &[nz, ny, nx])
    }

    /// Lowest and highest corner of the box in world metres.
    #[getter]
    fn bounds(&self) -> ((f64, f64, f64), (f64, f64, f64)) {
        let [low, high] = self.0.bounds();
        (low.into(), high.into())
    }

    /// Shape of the grid: (nz, ny, nx).
    #[getter]
    fn shape(&self) -> (usize, usize, usize) {
        let [nx, ny, nz] = self.0.size();
        (nz, ny, nx)
    }

    /// Built-in Python values by name; extinction as nested lists.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        dict.set_item("extinction", self.extinction(py)?.call_method0("tolist")?)?;
        dict.set_item("bounds", self.0.bounds().map(|corner| corner.to_array()))?;
        Ok(dict)
    }

    fn __repr__(&self) -> String {
        let ((x0, y0, z0), (x1, y1, z1)) = self.bounds();
        format!("DensityGrid(shape={:?}, bounds=(({x0}, {y0}, {z0}), ({x1}, {y1}, {z1})))", self.shape())
    }

    fn __hash__(&self) -> u64 {
        let corners = self.0.bounds().map(|corner| corner.to_array());
        let bits = corners.iter().flatten().map(|v| (v + 0.0).to_bits());
        fnv(bits.chain(self.0.extinction().iter().map(|v| u64::from((v + 0.0).to_bits()))))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, GridState<'py>)> {
        let corners = slf.get().0.bounds().map(|corner| corner.to_array());
        Ok((slf.get_type().into_any(), (slf.get().extinction(slf.py())?, corners)))
    }
}

/// FNV-1a hash.
fn fnv(words: impl Iterator<Item = u64>) -> u64 {
    words.fold(0xcbf2_9ce4_8422_2325, |hash, v| (hash ^ v).wrapping_mul(0x0100_0000_01b3))
}

/// Array of `shape` that takes over `data` without a copy.
fn array<'py, T: numpy::Element>(py: Python<'py>, data: Vec<T>, shape: &[usize]) -> PyResult<Bound<'py, PyAny>> {
    Ok(PyArray1::from_vec(py, data).reshape(shape.to_vec())?.into_any())
}

/// World points of shape (N, 3) from an array-like.
fn points_from_python(py: Python<'_>, points: &Bound<'_, PyAny>) -> PyResult<Vec<[f64; 3]>> {
    let allowed = "an array of finite numbers of shape (N, 3), world metres within 2e8 of the origin";
    let points = numbers_from_python::<f64>("points", points, allowed, &[&[None, Some(3)], &[Some(0), Some(3)]], &[])?;
    let numbers = points.as_slice()?;
    if let Some(bad) = numbers.iter().find(|v| v.abs() > 2e8) {
        return Err(exception(py, &Error::parameter("points", format!("an array with {bad}"), allowed)));
    }
    Ok(numbers.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect())
}

/// The renderer behind `nubis.Renderer`, without defaults.
#[pyclass(frozen, module = "nubis._nubis")]
struct Renderer {
    core: Mutex<CoreRenderer>,
    width: u32,
    height: u32,
}

impl Renderer {
    fn shape(&self, channels: &[usize]) -> Vec<usize> {
        [&[self.height as usize, self.width as usize], channels].concat()
    }
}

/// User-supplied scene from arrays that the Python layer has checked.
fn scene_from_python<'a>(
    depth: Option<&'a PyReadonlyArrayDyn<'_, f32>>,
    color: Option<&'a PyReadonlyArrayDyn<'_, f32>>,
) -> PyResult<Option<SceneDepth<'a>>> {
    let Some(depth) = depth else { return Ok(None) };
    let color = color.map(|color| color.as_slice()).transpose()?;
    Ok(Some(SceneDepth { distance: depth.as_slice()?, color }))
}

#[pymethods]
impl Renderer {
    #[new]
    fn new(
        py: Python<'_>,
        width: u32,
        height: u32,
        quality: &Bound<'_, PyAny>,
        adapter: Option<&Bound<'_, PyString>>,
    ) -> PyResult<Self> {
        let quality: Quality = quality_from_python(quality)?;
        let adapter = adapter.map(|name| name.to_string_lossy().into_owned());
        let core = detached(py, move |_| CoreRenderer::new(width, height, quality, adapter.as_deref()))?;
        Ok(Self { core: Mutex::new(core), width, height })
    }

    fn render<'py>(
        &self,
        camera: Camera,
        params: &Bound<'py, PyAny>,
        time: f64,
        background: bool,
        scene_depth: Option<PyReadonlyArrayDyn<'py, f32>>,
        scene_color: Option<PyReadonlyArrayDyn<'py, f32>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = params.py();
        let _inside = exit::enter(py);
        let params: Params = params_from_python(params)?;
        let scene = scene_from_python(scene_depth.as_ref(), scene_color.as_ref())?;
        let shot = Shot { camera: &camera.0, params: &params, time, background, scene };
        let picture = detached(py, |interrupt| lock(&self.core).render(&shot, false, interrupt))?;
        array(py, picture.image, &self.shape(&[4]))
    }

    /// Clouds with alpha, sky, depth (-1 without clouds), density evaluations, uncertainty.
    fn render_layers<'py>(
        &self,
        py: Python<'py>,
        camera: Camera,
        params: &Bound<'_, PyAny>,
        time: f64,
        scene_depth: Option<PyReadonlyArrayDyn<'py, f32>>,
    ) -> PyResult<Bound<'py, PyTuple>> {
        let _inside = exit::enter(py);
        let params: Params = params_from_python(params)?;
        let scene = scene_from_python(scene_depth.as_ref(), None)?;
        let shot = Shot { camera: &camera.0, params: &params, time, background: false, scene };
        let picture = detached(py, |interrupt| lock(&self.core).render(&shot, true, interrupt))?;
        let image = array(py, picture.image, &self.shape(&[4]))?;
        let sky = array(py, picture.sky, &self.shape(&[4]))?;
        let depth = array(py, picture.depth, &self.shape(&[]))?;
        let samples = array(py, picture.samples, &self.shape(&[]))?;
        let uncertainty = match picture.uncertainty {
            nothing if nothing.is_empty() => py.None().into_bound(py),
            uncertainty => array(py, uncertainty, &self.shape(&[4]))?,
        };
        (image, sky, depth, samples, uncertainty).into_pyobject(py)
    }

    fn animate<'py>(
        &self,
        camera: Camera,
        params: &Bound<'py, PyAny>,
        time: f64,
        background: bool,
        scene_depth: Option<PyReadonlyArrayDyn<'py, f32>>,
        scene_color: Option<PyReadonlyArrayDyn<'py, f32>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = params.py();
        let _inside = exit::enter(py);
        let params: Params = params_from_python(params)?;
        let scene = scene_from_python(scene_depth.as_ref(), scene_color.as_ref())?;
        let shot = Shot { camera: &camera.0, params: &params, time, background, scene };
        let image = detached(py, |interrupt| lock(&self.core).animate(&shot, interrupt))?;
        array(py, image, &self.shape(&[4]))
    }

    fn cut(&self, py: Python<'_>) {
        unlocked(py, || lock(&self.core).cut());
    }

    fn history_length<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let lengths = detached(py, |_| lock(&self.core).history_length())?;
        (!lengths.is_empty()).then(|| array(py, lengths, &self.shape(&[]))).transpose()
    }

    fn density<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'_, PyAny>,
        params: &Bound<'_, PyAny>,
        time: f64,
    ) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let _inside = exit::enter(py);
        let points = points_from_python(py, points)?;
        let params: Params = params_from_python(params)?;
        let answers = detached(py, |interrupt| lock(&self.core).density(&points, &params, time, interrupt))?;
        Ok(PyArray1::from_vec(py, answers))
    }

    fn sun_transmittance<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'_, PyAny>,
        params: &Bound<'_, PyAny>,
        time: f64,
    ) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let _inside = exit::enter(py);
        let points = points_from_python(py, points)?;
        let params: Params = params_from_python(params)?;
        let answers = detached(py, |interrupt| lock(&self.core).sun_transmittance(&points, &params, time, interrupt))?;
        Ok(PyArray1::from_vec(py, answers))
    }

    /// Optical depth of all clouds along rays from the eye; -1 where the ground is hit.
    fn depth_along<'py>(
        &self,
        py: Python<'py>,
        camera: Camera,
        directions: &Bound<'_, PyAny>,
        params: &Bound<'_, PyAny>,
        time: f64,
    ) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let _inside = exit::enter(py);
        let directions = points_from_python(py, directions)?;
        let params: Params = params_from_python(params)?;
        let answers = detached(py, |interrupt| {
            lock(&self.core).depth_along(camera.0.eye, &directions, &params, time, interrupt)
        })?;
        Ok(PyArray1::from_vec(py, answers))
    }

    fn shadow_map<'py>(
        &self,
        params: &Bound<'py, PyAny>,
        time: f64,
        center: [f64; 2],
        altitude: f64,
        extent: f64,
        size: u32,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = params.py();
        let _inside = exit::enter(py);
        let params: Params = params_from_python(params)?;
        let map = detached(py, |interrupt| {
            lock(&self.core).shadow_map(&params, time, [center[0], center[1], altitude], (extent, size), interrupt)
        })?;
        array(py, map, &[size as usize, size as usize])
    }

    /// Weather map that the march reads: coverage, type, precipitation; shape (H, W, 3).
    fn weather_map<'py>(&self, py: Python<'py>, params: &Bound<'_, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let _inside = exit::enter(py);
        let params: Params = params_from_python(params)?;
        let ([width, height], texels) = detached(py, |interrupt| lock(&self.core).weather_map(&params, interrupt))?;
        array(py, texels, &[height as usize, width as usize, 3])
    }

    fn probe<'py>(
        &self,
        imports: Vec<String>,
        expression: &str,
        inputs: Vec<[f32; 4]>,
        params: &Bound<'py, PyAny>,
        eye: [f64; 3],
        time: f64,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = params.py();
        let _inside = exit::enter(py);
        let params: Params = params_from_python(params)?;
        let answers = detached(py, |interrupt| {
            lock(&self.core).probe(&imports, expression, &inputs, &params, (eye.into(), time), interrupt)
        })?;
        let count = answers.len();
        array(py, answers.into_flattened(), &[count, 4])
    }

    /// Light field of given cells: moments of each cell (8), scaled extinction and sunlight of each cell (2), factor on the
    /// sunlight.
    fn solve_light<'py>(
        &self,
        extinction: PyReadonlyArray3<'py, f32>,
        cell: [f32; 3],
        sun: [f32; 3],
        how: (bool, u32),
        params: &Bound<'py, PyAny>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>, f32)> {
        let py = params.py();
        let _inside = exit::enter(py);
        let params: Params = params_from_python(params)?;
        let [z, y, x]: [usize; 3] = extinction.shape().try_into().expect("three axes");
        let size = [x as u32, y as u32, z as u32];
        let extinction = extinction.as_slice()?.to_vec();
        let (periodic, cycles) = how;
        let (moments, deposits, factor) = detached(py, |interrupt| {
            let cells = Cells { extinction: &extinction, size, cell, sun, periodic, cycles };
            lock(&self.core).solve_light(&cells, &params, interrupt)
        })?;
        Ok((array(py, moments, &[z, y, x, 8])?, array(py, deposits, &[z, y, x, 2])?, factor))
    }

    /// Textures of the light field, optics, sun's field and sky's field: shape (rows of all levels, y, x, 4).
    fn light_field<'py>(
        &self,
        py: Python<'py>,
        camera: &Camera,
        params: &Bound<'py, PyAny>,
        time: f64,
        how: (u32, bool),
    ) -> PyResult<Vec<Bound<'py, PyAny>>> {
        let _inside = exit::enter(py);
        let (camera, params): (_, Params) = (camera.0, params_from_python(params)?);
        let (size, textures) = detached(py, |interrupt| {
            lock(&self.core).light_field(&Shot::new(&camera, &params, time), how.0, how.1, interrupt)
        })?;
        let [x, y, z] = size.map(|n| n as usize);
        textures.into_iter().map(|texture| array(py, texture, &[z, y, x, 4])).collect()
    }

    /// Irradiance at points on planes with a normal: direct and diffuse, shape (N, 2, 3).
    fn irradiance<'py>(
        &self,
        points: &Bound<'py, PyAny>,
        normal: [f64; 3],
        params: &Bound<'py, PyAny>,
        time: f64,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = params.py();
        let _inside = exit::enter(py);
        let points = points_from_python(py, points)?;
        let params: Params = params_from_python(params)?;
        let answers = detached(py, |interrupt| lock(&self.core).irradiance(&points, normal, &params, time, interrupt))?;
        let count = answers.len();
        let numbers = answers.into_iter().flatten().flat_map(|[r, g, b, _]| [r, g, b]).collect();
        array(py, numbers, &[count, 2, 3])
    }

    /// Numbers of submissions to the device and of waits for them so far.
    fn counters(&self, py: Python<'_>) -> [u64; 2] {
        unlocked(py, || lock(&self.core).gpu().counters())
    }

    fn timings(&self, py: Python<'_>) -> Vec<(String, f64)> {
        unlocked(py, || lock(&self.core).timings.0.clone())
    }

    /// GPU memory after the last picture: owner, variable and bytes of each resource.
    fn memory(&self, py: Python<'_>) -> Vec<(&'static str, &'static str, u64)> {
        unlocked(py, || lock(&self.core).memory())
    }

    fn adapter<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let info = unlocked(py, || lock(&self.core).gpu().info.clone());
        adapter_to_python(py, &info)
    }
}

fn adapter_to_python<'py>(py: Python<'py>, info: &clouds_core::AdapterInfo) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("name", &info.name)?;
    dict.set_item("driver", &info.driver)?;
    dict.set_item("backend", &info.backend)?;
    dict.set_item("kind", &info.kind)?;
    dict.set_item("pci", &info.pci)?;
    Ok(dict)
}

#[pyfunction]
fn adapters(py: Python<'_>) -> PyResult<Vec<Bound<'_, PyDict>>> {
    let infos = detached(py, |_| gpu::adapters())?;
    infos.iter().map(|info| adapter_to_python(py, info)).collect()
}

/// The value converted to the type of a field of a block, or `ParameterError`.
#[pyfunction]
fn check<'py>(
    py: Python<'py>,
    type_name: &str,
    path: &str,
    name: &str,
    value: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    let _inside = exit::enter(py);
    let block = params::block(type_name).expect("the classes are generated from the blocks");
    let field = block.fields().iter().find(|field| field.name == name).expect("so are their fields");
    let value = raise(py, field.check(path, &value_from_python(value)?))?;
    value_to_python(py, &value)
}

/// Checks constraints between fields, such as `clouds.top` above `clouds.base`.
#[pyfunction]
fn check_params(params: &Bound<'_, PyAny>) -> PyResult<()> {
    let py = params.py();
    let _inside = exit::enter(py);
    raise(py, params_from_python(params)?.check())
}

#[pyfunction]
fn check_quality(quality: &Bound<'_, PyAny>) -> PyResult<()> {
    let _inside = exit::enter(quality.py());
    raise(quality.py(), quality_from_python(quality)?.check())
}

/// Fields of a named numerical method.
#[pyfunction]
fn quality<'py>(py: Python<'py>, name: &Bound<'py, PyString>) -> PyResult<Bound<'py, PyDict>> {
    let quality = raise(py, Quality::named(&name.to_string_lossy()))?;
    fields(py, &quality)
}

/// Deprecated names of fields, and their names now.
#[pyfunction]
fn renamed(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    RENAMED.into_py_dict(py)
}

/// Values of a block by name.
fn fields<'py>(py: Python<'py>, block: &dyn schema::Block) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    for (index, field) in block.fields().iter().enumerate() {
        dict.set_item(field.name, value_to_python(py, &block.get(index))?)?;
    }
    Ok(dict)
}

/// Fields of the drift with which a sky continues the motion of another at a time.
#[pyfunction]
fn drift_after<'py>(params: &Bound<'py, PyAny>, before: &Bound<'py, PyAny>, time: f64) -> PyResult<Bound<'py, PyDict>> {
    fields(params.py(), &params_from_python(params)?.after(&params_from_python(before)?, time))
}

/// Fields of the drift of a sky whose displacements at a time, without its own drift, are
/// `carried`.
#[pyfunction]
fn drift_of<'py>(params: &Bound<'py, PyAny>, time: f64, carried: [f64; NUMBERS]) -> PyResult<Bound<'py, PyDict>> {
    let py = params.py();
    let params = params_from_python(params)?;
    let carried = Advection::from(carried).plus(&Advection::from(&params.drift), 1.0);
    fields(py, &carried.drift_of(&params, time))
}

/// Displacements by the winds of a sky from 0 s to a time, without its drift.
#[pyfunction]
fn carried(params: &Bound<'_, PyAny>, time: f64) -> PyResult<[f64; NUMBERS]> {
    Ok(Advection::new(&params_from_python(params)?, 0.0, time).numbers())
}

/// Displacements by the winds that are interpolated between two skies, from the start of the
/// span to a time; the wander starts `swings` periods ahead.
#[pyfunction]
fn carried_between(
    skies: [Bound<'_, PyAny>; 2],
    span: [f64; 2],
    smooth: bool,
    swings: f64,
    time: f64,
) -> PyResult<[f64; NUMBERS]> {
    let py = skies[0].py();
    let [from, to] = [params_from_python(&skies[0])?, params_from_python(&skies[1])?];
    detached(py, |_| Between { skies: [&from, &to], span, smooth }.carried(swings, time)).map(|sum| sum.numbers())
}

/// Whether two skies have the same winds.
#[pyfunction]
fn same_winds(a: &Bound<'_, PyAny>, b: &Bound<'_, PyAny>) -> PyResult<bool> {
    Ok(params_from_python(a)?.has_winds_of(&params_from_python(b)?))
}

/// The value of the argument `name` as a float, or `ParameterError`.
#[pyfunction]
fn number(name: &str, value: &Bound<'_, PyAny>) -> PyResult<f64> {
    number_from_python(name, value)
}

#[pyfunction]
fn to_srgb8<'py>(
    py: Python<'py>,
    frame: PyReadonlyArrayDyn<'py, f32>,
    exposure: f32,
    tonemap: &Bound<'py, PyString>,
    dither: bool,
) -> PyResult<Bound<'py, PyAny>> {
    let shape = frame.shape().to_vec();
    let (pixels, tone_map) = (frame.as_slice()?, tonemap.to_string_lossy());
    let pixels = raise(py, color::to_srgb8(pixels, shape[2], shape[1], exposure, &tone_map, dither))?;
    array(py, pixels, &shape)
}

#[pyfunction]
fn auto_exposure(py: Python<'_>, frame: PyReadonlyArrayDyn<'_, f32>, key: f64, low: f64, high: f64) -> PyResult<f64> {
    let channels = frame.shape()[2];
    raise(py, color::auto_exposure(frame.as_slice()?, channels, color::Metering { key, low, high }))
}

#[pyfunction]
fn write_png(py: Python<'_>, path: PathBuf, frame: PyReadonlyArrayDyn<'_, u8>) -> PyResult<()> {
    let shape = frame.shape();
    raise(py, files::write_png(&path, frame.as_slice()?, [shape[1], shape[0]], shape[2]))
}

#[pyfunction]
fn write_exr(py: Python<'_>, path: PathBuf, frame: PyReadonlyArrayDyn<'_, f32>) -> PyResult<()> {
    let shape = frame.shape();
    raise(py, files::write_exr(&path, frame.as_slice()?, [shape[1], shape[0]], shape[2]))
}

#[pyfunction]
fn write_hdr(py: Python<'_>, path: PathBuf, frame: PyReadonlyArrayDyn<'_, f32>) -> PyResult<()> {
    let shape = frame.shape();
    raise(py, files::write_hdr(&path, frame.as_slice()?, [shape[1], shape[0]], shape[2]))
}

/// Writes bytes to a file atomically.
#[pyfunction]
fn write_bytes(py: Python<'_>, path: PathBuf, bytes: &[u8]) -> PyResult<()> {
    raise(py, files::write_bytes(&path, bytes))
}

/// Raises `FileError` if a file cannot be written.
#[pyfunction]
fn check_target(py: Python<'_>, path: PathBuf) -> PyResult<()> {
    raise(py, files::check_target(&path))
}

/// Pixels of a PNG, HDR or EXR file, shape (H, W, 1) or (H, W, 3).
#[pyfunction]
fn read_pixels(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyAny>> {
    let pixels = raise(py, files::read_pixels(&path))?;
    array(py, pixels.data, &[pixels.size[1], pixels.size[0], pixels.channels])
}

/// Folder of the disk cache, None if it is off, and its size in bytes.
#[pyfunction]
fn cache_usage() -> (Option<PathBuf>, u64) {
    (cache::folder(), cache::size())
}

#[pyfunction]
fn clear_cache(py: Python<'_>) -> PyResult<()> {
    raise(py, cache::clear())
}

/// Environment variables, as names and values, that must be set before the driver is loaded.
#[pyfunction]
fn driver_settings() -> Vec<(&'static str, &'static str)> {
    gpu::driver_settings()
}

#[pymodule]
mod _nubis {
    #[pymodule_export]
    use super::exit::{close, forked};
    #[pymodule_export]
    use super::{
        Camera, DensityGrid, Renderer, adapters, auto_exposure, cache_usage, carried, carried_between, check,
        check_params, check_quality, check_target, clear_cache, drift_after, drift_of, driver_settings, number,
        quality, read_pixels, renamed, same_winds, to_srgb8, write_bytes, write_exr, write_hdr, write_png,
    };
}
