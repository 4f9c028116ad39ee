//! Python values to parameter values, and back.

use std::sync::Arc;

use clouds_core::Error;
use clouds_core::params::{Params, Quality};
use clouds_core::schema::{self, Block, Map, Value};
use glam::DVec3;
use numpy::{PyArray1, PyArrayMethods as _, PyReadonlyArray3, PyUntypedArray, PyUntypedArrayMethods as _};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyInt, PyString, PyTuple};

use crate::{DensityGrid, exception};

/// A value as the parameters know it. What fits no parameter at all comes back as text, which no check lets pass.
pub fn value_from_python(value: &Bound<'_, PyAny>) -> PyResult<Value> {
    if value.is_none() {
        return Ok(Value::None);
    }
    if let Ok(v) = value.cast::<PyBool>() {
        return Ok(Value::Bool(v.is_true()));
    }
    if let Ok(v) = value.cast::<PyString>() {
        return Ok(Value::Text(v.to_string()));
    }
    if let Ok(v) = value.cast::<PyInt>() {
        // Beyond i64 no parameter reaches; as a float it is refused with its value.
        return v.extract::<i64>().map(Value::Int).or_else(|_| v.extract::<f64>().map(Value::Float));
    }
    if let Ok(array) = value.cast::<PyUntypedArray>() {
        return match array.ndim() {
            0 => value_from_python(&value.call_method0("item")?),
            1 => Ok(numbers(value)),
            _ => map_from_python(value, array),
        };
    }
    // NumPy scalars, which are no Python numbers.
    if value.hasattr("dtype")? && value.hasattr("item")? {
        return value_from_python(&value.call_method0("item")?);
    }
    if let Ok(v) = value.extract::<f64>() {
        return Ok(Value::Float(v));
    }
    Ok(numbers(value))
}

fn numbers(value: &Bound<'_, PyAny>) -> Value {
    match value.extract::<Vec<f64>>() {
        Ok(v) => Value::Vector(v),
        Err(_) => Value::Text(value.repr().map_or_else(|_| "?".into(), |text| text.to_string())),
    }
}

fn map_from_python(value: &Bound<'_, PyAny>, array: &Bound<'_, PyUntypedArray>) -> PyResult<Value> {
    let shape = array.shape().to_vec();
    let kind: String = array.dtype().getattr("kind")?.extract()?;
    if shape.len() != 3 || shape[2] != 3 || !"fiu".contains(&kind) {
        return Ok(Value::Text(format!("array of shape {shape:?} and dtype {}", array.dtype())));
    }
    let kwargs = PyDict::new(value.py());
    kwargs.set_item("dtype", "float32")?;
    let numbers = value.py().import("numpy")?.call_method("ascontiguousarray", (value,), Some(&kwargs))?;
    let numbers: PyReadonlyArray3<'_, f32> = numbers.extract()?;
    let data = numbers.as_slice()?.to_vec();
    Ok(Value::Map(Arc::new(Map { width: shape[1], height: shape[0], data })))
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
            let array = flat.reshape([map.height, map.width, 3])?.into_any();
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
