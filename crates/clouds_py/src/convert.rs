//! Python values to parameter values, and back.

use std::sync::Arc;

use clouds_core::Error;
use clouds_core::params::{Params, Quality, Weather};
use clouds_core::schema::{self, Block, Map, Value};
use glam::DVec3;
use numpy::{PyArray1, PyArrayMethods as _, PyReadonlyArrayDyn, PyUntypedArray, PyUntypedArrayMethods as _};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyBytes, PyDict, PyInt, PyString, PyTuple};

use crate::{DensityGrid, exception};

/// A value as the parameters know it. What fits no parameter at all comes back as text, which no check lets pass.
pub fn value_from_python(value: &Bound<'_, PyAny>) -> PyResult<Value> {
    if value.is_none() {
        return Ok(Value::None);
    }
    if let Ok(array) = value.cast::<PyUntypedArray>()
        && array.ndim() > 1
    {
        return map_from_python(value, array);
    }
    if let Some(value) = plain_from_python(value) {
        return Ok(value);
    }
    // Text would be a sequence of letters, and bytes one of numbers.
    let parts: Vec<Bound<'_, PyAny>> =
        if value.is_instance_of::<PyBytes>() { Vec::new() } else { value.extract().unwrap_or_default() };
    let number = |part: &Bound<'_, PyAny>| match plain_from_python(part) {
        Some(Value::Int(v)) => Some(v as f64),
        Some(Value::Float(v)) => Some(v),
        _ => None,
    };
    match parts.iter().map(number).collect() {
        Some(numbers) if !parts.is_empty() => Ok(Value::Vector(numbers)),
        _ => Ok(Value::Text(shown(value))),
    }
}

/// A switch, a word or a number.
fn plain_from_python(value: &Bound<'_, PyAny>) -> Option<Value> {
    if let Ok(v) = value.cast::<PyBool>() {
        return Some(Value::Bool(v.is_true()));
    }
    if let Ok(v) = value.cast::<PyString>() {
        return Some(Value::Text(v.to_string_lossy().into_owned()));
    }
    if let Ok(v) = value.cast::<PyInt>() {
        // Beyond i64 no parameter reaches; as a float it is refused with its value, if it fits into one.
        let number = v.extract::<i64>().map(Value::Int).or_else(|_| v.extract::<f64>().map(Value::Float));
        return Some(number.unwrap_or_else(|_| Value::Text(shown(value))));
    }
    if value.cast::<PyUntypedArray>().is_ok_and(|array| array.ndim() > 0) {
        return None;
    }
    // NumPy scalars, which are no Python numbers, and arrays without axes.
    let item = if value.hasattr("dtype").is_ok_and(|has| has) { value.call_method0("item").ok() } else { None };
    match &item {
        Some(item) if !item.hasattr("dtype").is_ok_and(|has| has) => plain_from_python(item),
        _ => value.extract::<f64>().ok().map(Value::Float),
    }
}

fn shown(value: &Bound<'_, PyAny>) -> String {
    value.repr().map_or_else(|_| "?".into(), |text| text.to_string_lossy().into_owned())
}

fn map_from_python(value: &Bound<'_, PyAny>, array: &Bound<'_, PyUntypedArray>) -> PyResult<Value> {
    let shape = array.shape().to_vec();
    let kind: String = array.dtype().getattr("kind")?.extract()?;
    let channels = match shape[..] {
        [_, _] => 1,
        [_, _, channels] => channels,
        _ => 0,
    };
    if channels == 0 || !"fiu".contains(&kind) {
        return Ok(Value::Text(format!("array of shape {shape:?} and dtype {}", array.dtype())));
    }
    let kwargs = PyDict::new(value.py());
    kwargs.set_item("dtype", "float32")?;
    // Where warnings are errors, numbers that f32 does not hold are one.
    let numpy = value.py().import("numpy")?;
    let Ok(numbers) = numpy.call_method("ascontiguousarray", (value,), Some(&kwargs)) else {
        return Ok(Value::Text(format!("array of shape {shape:?} with numbers beyond float32")));
    };
    let numbers: PyReadonlyArrayDyn<'_, f32> = numbers.extract()?;
    let data = numbers.as_slice()?.to_vec();
    Ok(Value::Map(Arc::new(Map { width: shape[1], height: shape[0], channels, data })))
}

/// A value for Python; maps become read-only arrays.
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

fn fill(block: &mut dyn Block, path: &str, object: &Bound<'_, PyAny>) -> PyResult<()> {
    for field in block.fields() {
        let value = value_from_python(&object.getattr(field.name)?)?;
        schema::assign(block, path, field.name, &value).map_err(|error| exception(object.py(), &error))?;
    }
    Ok(())
}

/// The parameters of a `nubis.Params`.
pub fn params_from_python(object: &Bound<'_, PyAny>) -> PyResult<Params> {
    let mut params = Params::default();
    for (name, block) in params.blocks_mut() {
        fill(block, name, &object.getattr(name)?)?;
    }
    for (index, pair) in object.getattr("weather_mix")?.try_iter()?.enumerate() {
        let (weather, share): (Bound<'_, PyAny>, f64) = pair?.extract()?;
        let mut block = Weather::default();
        fill(&mut block, &format!("weather_mix[{index}]"), &weather)?;
        params.weather_mix.push((block, share as f32));
    }
    let volume = object.getattr("volume")?;
    if !volume.is_none() {
        params.volume = Some(volume.cast::<DensityGrid>()?.get().0.clone());
    }
    Ok(params)
}

/// The numerical method of a `nubis.Quality`.
pub fn quality_from_python(object: &Bound<'_, PyAny>) -> PyResult<Quality> {
    let mut quality = Quality::default();
    fill(&mut quality, "quality", object)?;
    Ok(quality)
}

/// A number for an argument called `name`.
pub fn number_from_python(name: &str, value: &Bound<'_, PyAny>) -> PyResult<f64> {
    match value_from_python(value)? {
        Value::Int(v) => Ok(v as f64),
        Value::Float(v) => Ok(v),
        other => Err(exception(value.py(), &Error::parameter(name, other, "a number"))),
    }
}

/// Three numbers for an argument called `name`.
pub fn vector_from_python(name: &str, value: &Bound<'_, PyAny>) -> PyResult<DVec3> {
    match value_from_python(value)? {
        Value::Vector(v) if v.len() == 3 => Ok(DVec3::new(v[0], v[1], v[2])),
        other => Err(exception(value.py(), &Error::parameter(name, other, "3 numbers"))),
    }
}
