//! Declarations of parameters. One declaration yields the Rust struct, the layout and text of the WGSL uniform, the
//! Python dataclass, the manual, and the range check.

use std::fmt::{self, Write as _};
use std::sync::Arc;

use crate::error::{Error, Result};

/// Type of a parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Type {
    /// Number.
    F32,
    /// Non-negative integer.
    U32,
    /// Switch; in WGSL a `u32` of 0 or 1, as `bool` is not host-shareable.
    Bool,
    /// Vector of two, three or four numbers.
    Vector(usize),
    /// Array of vectors of four numbers, which no user sets.
    Array(usize),
    /// One or two numbers in f64, whose precision a uniform does not hold. The GPU receives values derived from them,
    /// in `frame`.
    Exact(usize),
    /// One of a set of words; in WGSL a `u32`, the index of the word.
    Choice(&'static [&'static str]),
    /// Optional image of a number of channels. The GPU receives it as a texture, not in the uniform.
    Map(usize),
}

impl Type {
    /// Size in the WGSL uniform, in 32-bit words.
    pub const fn words(self) -> usize {
        match self {
            Self::F32 | Self::U32 | Self::Bool | Self::Choice(_) => 1,
            Self::Vector(n) => n,
            Self::Array(n) => 4 * n,
            Self::Exact(_) | Self::Map(_) => 0,
        }
    }

    /// Alignment in bytes (WGSL, section "alignment and size").
    const fn align(self) -> usize {
        match self {
            Self::Vector(2) => 8,
            Self::Vector(_) | Self::Array(_) => 16,
            _ => 4,
        }
    }

    /// Name of the type in WGSL.
    pub fn wgsl(self) -> String {
        match self {
            Self::F32 => "f32".into(),
            Self::Vector(n) => format!("vec{n}f"),
            Self::Array(n) => format!("array<vec4f, {n}>"),
            Self::U32 | Self::Bool | Self::Choice(_) => "u32".into(),
            Self::Exact(_) | Self::Map(_) => unreachable!("is in no uniform"),
        }
    }
}

/// Image, row by row.
#[derive(Clone, PartialEq)]
pub struct Map {
    /// Pixels per row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Values per pixel.
    pub channels: usize,
    /// `width * height * channels` values.
    pub data: Vec<f32>,
}

impl fmt::Debug for Map {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Map({} x {} x {})", self.width, self.height, self.channels)
    }
}

/// Value of a parameter, before conversion to the type of its field or after conversion from it.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// Switch.
    Bool(bool),
    /// Integer.
    Int(i64),
    /// Number.
    Float(f64),
    /// Vector.
    Vector(Vec<f64>),
    /// Word.
    Text(String),
    /// Image.
    Map(Arc<Map>),
    /// No image.
    None,
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bool(v) => write!(f, "{v}"),
            Self::Int(v) => write!(f, "{v}"),
            Self::Float(v) => write!(f, "{v}"),
            Self::Vector(v) => {
                let numbers: Vec<_> = v.iter().map(f64::to_string).collect();
                write!(f, "({})", numbers.join(", "))
            }
            Self::Text(v) => write!(f, "{v:?}"),
            Self::Map(v) => write!(f, "{v:?}"),
            Self::None => write!(f, "None"),
        }
    }
}

/// Description of a parameter.
#[derive(Clone, Copy, Debug)]
pub struct Field {
    /// Name, the same in Rust, WGSL and Python.
    pub name: &'static str,
    /// Documentation, one or more sentences.
    pub doc: &'static str,
    /// Unit; empty if there is none.
    pub unit: &'static str,
    /// Smallest and largest allowed value, of each component.
    pub range: (f64, f64),
    /// Type.
    pub ty: Type,
    /// Offset in the WGSL struct of its block, in bytes.
    pub offset: usize,
}

impl Field {
    /// Description of the allowed values, for error messages and the manual.
    pub fn allowed(&self) -> String {
        let (min, max) = self.range;
        let unit = if self.unit.is_empty() { String::new() } else { format!(" {}", self.unit) };
        match self.ty {
            Type::F32 | Type::Exact(1) => format!("a number from {min} to {max}{unit}"),
            Type::U32 => format!("a whole number from {min} to {max}{unit}"),
            Type::Bool => "True or False".into(),
            Type::Vector(n) | Type::Exact(n) => format!("{n} numbers from {min} to {max}{unit}"),
            Type::Choice(names) => format!("one of {names:?}").replace(['[', ']'], ""),
            Type::Array(n) => format!("{n} vectors"),
            Type::Map(channels) => {
                let shape = if channels == 1 { "(H, W)".into() } else { format!("(H, W, {channels})") };
                format!("None or a float array of shape {shape}, H and W from 1 to 8192, values from {min} to {max}")
            }
        }
    }

    /// Converts a value to the type of this field.
    ///
    /// Returns [`Error::Parameter`] with the field, the value and the allowed values if it does not fit.
    pub fn check(&self, block: &str, value: &Value) -> Result<Value> {
        let (min, max) = self.range;
        // Comparisons that reject NaN.
        let in_range = |v: f64| v >= min && v <= max;
        let number = |v: &Value| match v {
            Value::Int(v) => Some(*v as f64),
            Value::Float(v) => Some(*v),
            _ => None,
        };
        let checked = match (self.ty, value) {
            (Type::F32 | Type::Exact(1), v) => number(v).filter(|v| in_range(*v)).map(Value::Float),
            (Type::U32, Value::Int(v)) => in_range(*v as f64).then_some(Value::Int(*v)),
            (Type::Bool, Value::Bool(v)) => Some(Value::Bool(*v)),
            (Type::Vector(n) | Type::Exact(n), Value::Vector(v)) => {
                (v.len() == n && v.iter().all(|v| in_range(*v))).then(|| value.clone())
            }
            (Type::Choice(names), Value::Text(v)) => names.contains(&v.as_str()).then(|| value.clone()),
            (Type::Map(_), Value::None) => Some(Value::None),
            (Type::Map(channels), Value::Map(map)) => {
                let sized = [map.width, map.height].iter().all(|side| (1..=8192).contains(side));
                if let Some(bad) = map.data.iter().find(|v| !in_range(f64::from(**v))) {
                    return Err(Error::parameter(
                        &format!("{block}.{}", self.name),
                        format!("{map:?} with a value of {bad}"),
                        self.allowed(),
                    ));
                }
                (sized && map.channels == channels).then(|| value.clone())
            }
            _ => None,
        };
        checked.ok_or_else(|| Error::parameter(&format!("{block}.{}", self.name), value, self.allowed()))
    }
}

/// Rust type of a parameter.
pub trait Typed: Sized {
    /// Corresponding [`Type`].
    const TYPE: Type;
    /// Conversion from a value that [`Field::check`] has accepted.
    fn from_value(value: &Value) -> Option<Self>;
    /// Conversion to a value.
    fn to_value(&self) -> Value;
    /// Writes the words of the uniform; `out` has [`Type::words`] of them.
    fn write(&self, out: &mut [u32]);
}

impl Typed for f32 {
    const TYPE: Type = Type::F32;
    fn from_value(value: &Value) -> Option<Self> {
        match value {
            Value::Float(v) => Some(*v as f32),
            Value::Int(v) => Some(*v as f32),
            _ => None,
        }
    }
    fn to_value(&self) -> Value {
        // Through decimal text, so that 0.45 stays 0.45 instead of 0.44999998807907104.
        Value::Float(self.to_string().parse().expect("a number prints as a number"))
    }
    fn write(&self, out: &mut [u32]) {
        out[0] = self.to_bits();
    }
}

impl Typed for f64 {
    const TYPE: Type = Type::Exact(1);
    fn from_value(value: &Value) -> Option<Self> {
        match value {
            Value::Float(v) => Some(*v),
            Value::Int(v) => Some(*v as f64),
            _ => None,
        }
    }
    fn to_value(&self) -> Value {
        Value::Float(*self)
    }
    fn write(&self, _out: &mut [u32]) {}
}

impl Typed for [f64; 2] {
    const TYPE: Type = Type::Exact(2);
    fn from_value(value: &Value) -> Option<Self> {
        match value {
            Value::Vector(v) => v.as_slice().try_into().ok(),
            _ => None,
        }
    }
    fn to_value(&self) -> Value {
        Value::Vector(self.to_vec())
    }
    fn write(&self, _out: &mut [u32]) {}
}

impl Typed for u32 {
    const TYPE: Type = Type::U32;
    fn from_value(value: &Value) -> Option<Self> {
        match value {
            Value::Int(v) => (*v).try_into().ok(),
            _ => None,
        }
    }
    fn to_value(&self) -> Value {
        Value::Int(i64::from(*self))
    }
    fn write(&self, out: &mut [u32]) {
        out[0] = *self;
    }
}

impl Typed for bool {
    const TYPE: Type = Type::Bool;
    fn from_value(value: &Value) -> Option<Self> {
        match value {
            Value::Bool(v) => Some(*v),
            _ => None,
        }
    }
    fn to_value(&self) -> Value {
        Value::Bool(*self)
    }
    fn write(&self, out: &mut [u32]) {
        out[0] = u32::from(*self);
    }
}

impl<const N: usize> Typed for [f32; N] {
    const TYPE: Type = Type::Vector(N);
    fn from_value(value: &Value) -> Option<Self> {
        match value {
            Value::Vector(v) => v.iter().map(|v| *v as f32).collect::<Vec<_>>().try_into().ok(),
            _ => None,
        }
    }
    fn to_value(&self) -> Value {
        let number = |v: &f32| v.to_string().parse().expect("a number prints as a number");
        Value::Vector(self.iter().map(number).collect())
    }
    fn write(&self, out: &mut [u32]) {
        for (out, v) in out.iter_mut().zip(self) {
            *out = v.to_bits();
        }
    }
}

impl<const N: usize> Typed for [[f32; 4]; N] {
    const TYPE: Type = Type::Array(N);
    fn from_value(_value: &Value) -> Option<Self> {
        None
    }
    fn to_value(&self) -> Value {
        Value::None
    }
    fn write(&self, out: &mut [u32]) {
        self.iter().zip(out.chunks_exact_mut(4)).for_each(|(row, out)| row.write(out));
    }
}

/// Image of one channel.
#[derive(Clone, Debug, PartialEq)]
pub struct Table(pub Arc<Map>);

impl Typed for Option<Table> {
    const TYPE: Type = Type::Map(1);
    fn from_value(value: &Value) -> Option<Self> {
        Option::<Arc<Map>>::from_value(value).map(|map| map.map(Table))
    }
    fn to_value(&self) -> Value {
        self.as_ref().map(|Table(map)| map.clone()).to_value()
    }
    fn write(&self, _out: &mut [u32]) {}
}

impl Typed for Option<Arc<Map>> {
    const TYPE: Type = Type::Map(3);
    fn from_value(value: &Value) -> Option<Self> {
        match value {
            Value::Map(v) => Some(Some(v.clone())),
            Value::None => Some(None),
            _ => None,
        }
    }
    fn to_value(&self) -> Value {
        self.as_ref().map_or(Value::None, |v| Value::Map(v.clone()))
    }
    fn write(&self, _out: &mut [u32]) {}
}

/// Block of parameters: a struct in Rust and WGSL, a dataclass in Python.
pub trait Block {
    /// Name of its type.
    fn type_name(&self) -> &'static str;
    /// Documentation.
    fn doc(&self) -> &'static str;
    /// Its parameters, in order of declaration.
    fn fields(&self) -> &'static [Field];
    /// Value of a parameter, by its index in `fields`.
    fn get(&self, index: usize) -> Value;
    /// Sets a parameter from a value that [`Field::check`] has accepted; None for any other value.
    fn set(&mut self, index: usize, value: &Value) -> Option<()>;
    /// Writes the words of the WGSL struct; `out` has [`size`] / 4 of them.
    fn write(&self, out: &mut [u32]);
}

/// Size of the WGSL struct of a block in bytes, rounded up to the alignment of a following block.
pub const fn size(fields: &[Field]) -> usize {
    let (mut end, mut i) = (0, 0);
    while i < fields.len() {
        end = fields[i].offset + 4 * fields[i].ty.words();
        i += 1;
    }
    end.next_multiple_of(16)
}

/// Assigns offsets by the layout rules of WGSL: the next multiple of each field's alignment.
pub const fn layout<const N: usize>(mut fields: [Field; N]) -> [Field; N] {
    let (mut end, mut i) = (0usize, 0);
    while i < N {
        fields[i].offset = end.next_multiple_of(fields[i].ty.align());
        end = fields[i].offset + 4 * fields[i].ty.words();
        i += 1;
    }
    fields
}

/// Name of a field without the `r#` of Rust's raw identifiers.
pub const fn bare(name: &'static str) -> &'static str {
    match name.as_bytes() {
        [b'r', b'#', ..] => name.split_at(2).1,
        _ => name,
    }
}

/// Checks a value and assigns it to the parameter `name` of `block`. Errors call the block `path`.
///
/// Returns [`Error::Parameter`] for an unknown name or a value that does not fit.
pub fn assign(block: &mut dyn Block, path: &str, name: &str, value: &Value) -> Result<()> {
    let fields = block.fields();
    let Some(index) = fields.iter().position(|field| field.name == name) else {
        let names: Vec<_> = fields.iter().map(|field| field.name).collect();
        return Err(Error::parameter(&format!("{path}.{name}"), value, format!("one of {}", names.join(", "))));
    };
    let field = &fields[index];
    let value = field.check(path, value)?;
    block.set(index, &value).ok_or_else(|| Error::parameter(&format!("{path}.{name}"), &value, field.allowed()))
}

/// Name of a field in WGSL, where `type` is reserved.
pub fn wgsl_name(name: &str) -> &str {
    if name == "type" { "type_" } else { name }
}

/// WGSL struct of a block and the constants of its choices; empty if the block has no words in the uniform.
pub fn wgsl_struct(block: &dyn Block) -> String {
    if size(block.fields()) == 0 {
        return String::new();
    }
    let mut code = format!("struct {} {{\n", block.type_name());
    for field in block.fields().iter().filter(|field| field.ty.words() > 0) {
        let unit = if field.unit.is_empty() { String::new() } else { format!(" [{}]", field.unit) };
        let _ = writeln!(code, "    {}: {}, //{}{unit}", wgsl_name(field.name), field.ty.wgsl(), field.doc);
    }
    code += "}\n";
    for field in block.fields() {
        if let Type::Choice(names) = field.ty {
            for (index, name) in names.iter().enumerate() {
                let (field, name) = (field.name.to_uppercase(), name.to_uppercase());
                let _ = writeln!(code, "const {field}_{name} = {index}u;");
            }
        }
    }
    code
}

/// Declares a block of parameters. The range is optional, for values that no user sets.
#[macro_export]
macro_rules! params {
    ($($(#[doc = $doc:literal])* $block:ident { $(
        $(#[doc = $about:literal])*
        $field:ident: $ty:ty = $default:expr $(, in $min:literal..=$max:literal $unit:literal)?;
    )* })*) => { $(
        $(#[doc = $doc])*
        #[derive(Clone, Debug, PartialEq)]
        pub struct $block { $( $(#[doc = $about])* pub $field: $ty, )* }

        impl Default for $block {
            fn default() -> Self { Self { $( $field: $default, )* } }
        }

        impl $block {
            /// Its parameters, in order of declaration.
            pub const FIELDS: &'static [$crate::schema::Field] = &$crate::schema::layout([$(
                $crate::schema::Field {
                    name: $crate::schema::bare(stringify!($field)),
                    doc: concat!($($about),*),
                    unit: concat!($($unit)?),
                    range: (f64::MIN $(.max($min as f64))?, f64::MAX $(.min($max as f64))?),
                    ty: <$ty as $crate::schema::Typed>::TYPE,
                    offset: 0,
                }
            ),*]);
        }

        impl $crate::schema::Block for $block {
            fn type_name(&self) -> &'static str { stringify!($block) }
            fn doc(&self) -> &'static str { concat!($($doc),*) }
            fn fields(&self) -> &'static [$crate::schema::Field] { Self::FIELDS }
            fn get(&self, index: usize) -> $crate::schema::Value {
                let getters: &[fn(&Self) -> $crate::schema::Value] =
                    &[$( |block| $crate::schema::Typed::to_value(&block.$field) ),*];
                getters[index](self)
            }
            fn set(&mut self, index: usize, value: &$crate::schema::Value) -> Option<()> {
                type Setter = fn(&mut $block, &$crate::schema::Value) -> Option<()>;
                let setters: &[Setter] = &[$( |block, value| {
                    block.$field = $crate::schema::Typed::from_value(value)?;
                    Some(())
                } ),*];
                setters[index](self, value)
            }
            fn write(&self, out: &mut [u32]) {
                let mut fields = Self::FIELDS.iter();
                $(
                    let field = fields.next().expect("as many fields as the struct has");
                    let start = field.offset / 4;
                    $crate::schema::Typed::write(&self.$field, &mut out[start..start + field.ty.words()]);
                )*
            }
        }
    )* };
}

/// Words of a uniform block of several parts.
pub(crate) fn words(parts: &[&dyn Block]) -> Vec<u32> {
    let mut words = Vec::new();
    for part in parts {
        let start = words.len();
        words.resize(start + size(part.fields()) / 4, 0);
        part.write(&mut words[start..]);
    }
    words
}

/// Declares a parameter type with a set of words.
#[macro_export]
macro_rules! choice {
    ($(#[doc = $doc:literal])* $name:ident { $( $(#[doc = $about:literal])* $variant:ident = $word:literal, )* }) => {
        $(#[doc = $doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum $name { $( $(#[doc = $about])* $variant, )* }

        impl $crate::schema::Typed for $name {
            const TYPE: $crate::schema::Type = $crate::schema::Type::Choice(&[$($word),*]);
            fn from_value(value: &$crate::schema::Value) -> Option<Self> {
                match value {
                    $( $crate::schema::Value::Text(word) if word == $word => Some(Self::$variant), )*
                    _ => None,
                }
            }
            fn to_value(&self) -> $crate::schema::Value {
                match self { $( Self::$variant => $crate::schema::Value::Text($word.into()), )* }
            }
            fn write(&self, out: &mut [u32]) { out[0] = *self as u32; }
        }
    };
}
