//! Constants shared by Rust and WGSL. Each is declared once, in the module that owns its meaning, and written to the
//! WGSL module `constants` when shaders are linked.

/// Declares constants of a module for Rust and, by the same names, for WGSL. Their documentation gives unit and source.
macro_rules! constants {
    ($($(#[doc = $doc:literal])+ $vis:vis const $name:ident: $ty:ty = $value:expr;)+) => {
        $($(#[doc = $doc])+ $vis const $name: $ty = $value;)+

        /// Declarations of the constants of this module in WGSL.
        pub(crate) fn constants() -> String {
            [$($crate::shared::declaration(stringify!($name), concat!($($doc),+), &$name)),+].concat()
        }
    };
}
pub(crate) use constants;

/// Declaration of a constant in WGSL.
pub(crate) fn declaration(name: &str, doc: &str, value: &impl Shared) -> String {
    format!("const {name}: {} = {}; //{doc}\n", value.wgsl_type(), value.wgsl())
}

/// Type of a shared constant.
pub(crate) trait Shared {
    /// Type in WGSL.
    fn wgsl_type(&self) -> String;
    /// Literal in WGSL.
    fn wgsl(&self) -> String;
}

impl Shared for f32 {
    fn wgsl_type(&self) -> String {
        "f32".into()
    }
    fn wgsl(&self) -> String {
        // Shortest decimal text that parses to the same bits.
        format!("{self:?}")
    }
}

/// Values in f64 are rounded to f32, as naga rounds literals without a type.
impl Shared for f64 {
    fn wgsl_type(&self) -> String {
        "f32".into()
    }
    fn wgsl(&self) -> String {
        (*self as f32).wgsl()
    }
}

/// Integers of any width are `u32` in WGSL.
macro_rules! whole {
    ($($ty:ty),+) => { $(
        impl Shared for $ty {
            fn wgsl_type(&self) -> String {
                "u32".into()
            }
            fn wgsl(&self) -> String {
                format!("{self}u")
            }
        }
    )+ };
}
whole!(u32, u64, usize);

/// Vectors.
macro_rules! vectors {
    ($($ty:ty),+) => { $(
        impl<const N: usize> Shared for [$ty; N] {
            fn wgsl_type(&self) -> String {
                format!("vec{N}f")
            }
            fn wgsl(&self) -> String {
                format!("vec{N}f({})", self.map(|v| v.wgsl()).join(", "))
            }
        }
    )+ };
}
vectors!(f32, f64);

/// Matrix by rows; WGSL matrices are by columns.
impl Shared for [[f32; 3]; 3] {
    fn wgsl_type(&self) -> String {
        "mat3x3f".into()
    }
    fn wgsl(&self) -> String {
        let column = |i: usize| self.map(|row| row[i]).wgsl();
        format!("mat3x3f({})", [0, 1, 2].map(column).join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_back_as_the_same_bits() {
        let awkward = [0.1, 1e30, 4.0e-45, f32::MAX, f32::MIN_POSITIVE, 0.004_654, -12.473_93, 16_777_217.0];
        for number in awkward {
            assert_eq!(number.wgsl().parse().map(f32::to_bits), Ok(number.to_bits()));
        }
    }

    #[test]
    fn a_matrix_has_its_columns() {
        let rows = [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]];
        let columns = "mat3x3f(vec3f(1.0, 4.0, 7.0), vec3f(2.0, 5.0, 8.0), vec3f(3.0, 6.0, 9.0))";
        assert_eq!(rows.wgsl(), columns);
    }
}
