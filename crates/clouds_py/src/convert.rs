//! Conversion between Python values and parameter values.

use std::sync::Arc;

use clouds_core::Error;
use clouds_core::params::{Params, Quality, Weather};
use clouds_core::schema::{self, Block, Map, Value};
use glam::DVec3;
use numpy::{PyArray1, PyArrayMethods as _, PyReadonlyArrayDyn, PyUntypedArray, PyUntypedArrayMethods as _};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyBytes, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple};

use crate::{DensityGrid, exception};

/// Converts a Python value to a parameter value. A value of no parameter type becomes text, which every check rejects.
pub fn value_from_python(value: &Bound<'_, PyAny>) -> PyResult<Value> {
    if value.is_none() {
        return Ok(Value::None);
    }
    if let Some(value) = plain_from_python(value) {
        return Ok(value);
    }
    if is_array(value) {
        return Ok(array_from_python(value).unwrap_or_else(Value::Text));
    }
    // A string is a sequence of letters and bytes are a sequence of numbers; neither is a vector.
    let parts: Vec<Bound<'_, PyAny>> =
        if value.is_instance_of::<PyBytes>() { Vec::new() } else { value.extract().unwrap_or_default() };
    let number = |part: &Bound<'_, PyAny>| match plain_from_python(part) {
        Some(Value::Int(v)) => Some(v as f64),
        Some(Value::Float(v)) => Some(v),
        _ => None,
    };
    match parts.iter().map(number).collect() {
        Some(numbers) if !parts.is_empty() => Ok(Value::Vector(numbers)),
        _ => Ok(Value::Text(repr_of(value))),
    }
}

/// Whether a value has axes, or is a nested sequence.
fn is_array(value: &Bound<'_, PyAny>) -> bool {
    let nested = || value.get_item(0).is_ok_and(|row| row.cast::<PyString>().is_err() && row.len().is_ok());
    let sequence = value.cast::<PyList>().is_ok() || value.cast::<PyTuple>().is_ok();
    if sequence { nested() } else { value.hasattr("ndim").is_ok_and(|has| has) }
}

/// Bool, string or number.
fn plain_from_python(value: &Bound<'_, PyAny>) -> Option<Value> {
    if let Ok(v) = value.cast::<PyBool>() {
        return Some(Value::Bool(v.is_true()));
    }
    if let Ok(v) = value.cast::<PyFloat>() {
        return Some(Value::Float(v.value()));
    }
    if let Ok(v) = value.cast::<PyString>() {
        return Some(Value::Text(v.to_string_lossy().into_owned()));
    }
    if let Ok(v) = value.cast::<PyInt>() {
        // Integers beyond i64 exceed the range of every parameter. As floats, if they fit, the error shows their value.
        let number = v.extract::<i64>().map(Value::Int).or_else(|_| v.extract::<f64>().map(Value::Float));
        return Some(number.unwrap_or_else(|_| Value::Text(repr_of(value))));
    }
    if !value.hasattr("dtype").is_ok_and(|has| has) {
        return value.extract::<f64>().ok().map(Value::Float);
    }
    // NumPy scalars, which are not Python numbers, and arrays without axes.
    match opened(value, &[], "fiub") {
        Ok(array) if array.getattr("ndim").is_ok_and(|axes| axes.extract::<usize>().is_ok_and(|axes| axes == 0)) => {
            let item = array.call_method0("item").ok()?;
            if item.hasattr("dtype").is_ok_and(|has| has) {
                // A float longer than Python's stays a NumPy scalar.
                return item.extract::<f64>().ok().map(Value::Float);
            }
            plain_from_python(&item)
        }
        _ => None,
    }
}

fn repr_of(value: &Bound<'_, PyAny>) -> String {
    const LONGEST: usize = 200;
    let text = value.repr().map_or_else(|_| "?".into(), |text| text.to_string_lossy().into_owned());
    match text.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text,
    }
}

/// Array after the checks of python/nubis/_arrays.py, or a description of the rejected value.
fn opened<'py>(value: &Bound<'py, PyAny>, dims: &[&str], kinds: &str) -> Result<Bound<'py, PyAny>, String> {
    let py = value.py();
    let gate = py.import("nubis._arrays").and_then(|module| module.getattr("opened"));
    gate.and_then(|gate| gate.call1((value, dims, kinds))).map_err(|error| error.value(py).to_string())
}

/// Argument `name` as a contiguous, finite array of float64 or float32. Its shape is one of `shapes`, in which None is
/// any length.
pub fn numbers_from_python<'py, T: numpy::Element>(
    name: &str,
    value: &Bound<'py, PyAny>,
    allowed: &str,
    shapes: &[&[Option<usize>]],
    dims: &[&str],
) -> PyResult<PyReadonlyArrayDyn<'py, T>> {
    let py = value.py();
    let kwargs = PyDict::new(py);
    let shapes = shapes.iter().map(|shape| PyTuple::new(py, *shape)).collect::<PyResult<Vec<_>>>()?;
    kwargs.set_item("shapes", shapes)?;
    kwargs.set_item("dims", dims)?;
    kwargs.set_item("dtype", T::get_dtype(py))?;
    let gate = py.import("nubis._arrays")?.getattr("numbers")?;
    gate.call((name, value, allowed), Some(&kwargs))?.extract()
}

/// Vector or map, or a description of another array.
fn array_from_python(value: &Bound<'_, PyAny>) -> Result<Value, String> {
    let array = opened(value, &["y", "x"], "fiu")?;
    let failed = |error: PyErr| error.value(value.py()).to_string();
    let shape = array.cast::<PyUntypedArray>().map_err(|error| error.to_string())?.shape().to_vec();
    let read = |dtype: &str| {
        let numpy = value.py().import("numpy")?;
        numpy.call_method1("ascontiguousarray", (&array, dtype))
    };
    let channels = match shape[..] {
        [_] => {
            let numbers: PyReadonlyArrayDyn<'_, f64> =
                read("float64").and_then(|array| array.extract()).map_err(failed)?;
            return Ok(Value::Vector(numbers.as_slice().map_err(|error| error.to_string())?.to_vec()));
        }
        [_, _] => 1,
        [_, _, channels] if channels > 0 => channels,
        _ => return Err(format!("array of shape {shape:?}")),
    };
    // With warnings as errors, the conversion of values beyond f32 fails.
    let Ok(numbers) = read("float32") else {
        return Err(format!("array of shape {shape:?} with numbers beyond float32"));
    };
    let numbers: PyReadonlyArrayDyn<'_, f32> = numbers.extract().map_err(|error| format!("{error}"))?;
    let data = numbers.as_slice().map_err(|error| error.to_string())?.to_vec();
    Ok(Value::Map(Arc::new(Map { width: shape[1], height: shape[0], channels, data })))
}

/// Converts a parameter value to Python; maps become read-only arrays.
pub fn value_to_python<'py>(py: Python<'py>, value: &Value) -> PyResult<Bound<'py, PyAny>> {
    Ok(match value {
        Value::Bool(v) => PyBool::new(py, *v).to_owned().into_any(),
        Value::Int(v) => v.into_pyobject(py)?.into_any(),
        Value::Float(v) => v.into_pyobject(py)?.into_any(),
        Value::Vector(v) => PyTuple::new(py, v)?.into_any(),
        Value::Text(v) => v.into_pyobject(py)?.into_any(),
        Value::Map(map) => {
            let flat = PyArray1::from_vec(py, map.data.clone());
            let array = match map.channels {
                1 => flat.reshape([map.height, map.width])?.into_any(),
                channels => flat.reshape([map.height, map.width, channels])?.into_any(),
            };
            array.getattr("flags")?.setattr("writeable", false)?;
            array
        }
        Value::None => py.None().into_bound(py),
    })
}

fn read_block(block: &mut dyn Block, path: &str, object: &Bound<'_, PyAny>) -> PyResult<()> {
    for field in block.fields() {
        let value = value_from_python(&object.getattr(field.name)?)?;
        schema::assign(block, path, field.name, &value).map_err(|error| exception(object.py(), &error))?;
    }
    Ok(())
}

/// Converts a `nubis.Params`.
pub fn params_from_python(object: &Bound<'_, PyAny>) -> PyResult<Params> {
    let mut params = Params::default();
    for (name, block) in params.blocks_mut() {
        read_block(block, name, &object.getattr(name)?)?;
    }
    for (index, pair) in object.getattr("weather_mix")?.try_iter()?.enumerate() {
        let (weather, share): (Bound<'_, PyAny>, f64) = pair?.extract()?;
        let mut block = Weather::default();
        read_block(&mut block, &format!("weather_mix[{index}]"), &weather)?;
        params.weather_mix.push((block, share as f32));
    }
    let volume = object.getattr("volume")?;
    if !volume.is_none() {
        params.volume = Some(volume.cast::<DensityGrid>()?.get().0.clone());
    }
    Ok(params)
}

/// Converts a `nubis.Quality`.
pub fn quality_from_python(object: &Bound<'_, PyAny>) -> PyResult<Quality> {
    let mut quality = Quality::default();
    read_block(&mut quality, "quality", object)?;
    Ok(quality)
}

/// Converts the argument `name` to a number.
pub fn number_from_python(name: &str, value: &Bound<'_, PyAny>) -> PyResult<f64> {
    match value_from_python(value)? {
        Value::Int(v) => Ok(v as f64),
        Value::Float(v) => Ok(v),
        other => Err(exception(value.py(), &Error::parameter(name, other, "a number"))),
    }
}

/// Converts the argument `name` to three numbers.
pub fn vector_from_python(name: &str, value: &Bound<'_, PyAny>) -> PyResult<DVec3> {
    match value_from_python(value)? {
        Value::Vector(v) if v.len() == 3 => Ok(DVec3::new(v[0], v[1], v[2])),
        other => Err(exception(value.py(), &Error::parameter(name, other, "3 numbers"))),
    }
}
