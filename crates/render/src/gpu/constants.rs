//! Constants that Rust and WGSL share. [`shared_constants!`] declares them in Rust, in named tables. Their WGSL is generated: a shader
//! imports a table by its name, as in `#import constants/pixel_grid`.

use std::fmt::Write;

use super::structs::WgslType;

/// A named table of constants.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Name. Shaders import it as `constants/{name}`.
    pub name: &'static str,
    /// Name, type and value of each constant in WGSL.
    pub constants: Vec<(&'static str, String, String)>,
}

impl Table {
    /// Returns the declarations in WGSL.
    pub fn wgsl(&self) -> String {
        let mut text = String::new();
        for (name, kind, value) in &self.constants {
            writeln!(text, "const {name}: {kind} = {value};").expect("a String accepts all text");
        }
        text
    }
}

/// A value that a table can hold.
pub(crate) trait ConstantValue: WgslType {
    /// Returns the value in WGSL.
    fn value(&self) -> String;
}

impl ConstantValue for u32 {
    fn value(&self) -> String {
        format!("{self}u")
    }
}

impl ConstantValue for i32 {
    fn value(&self) -> String {
        self.to_string()
    }
}

impl ConstantValue for f32 {
    /// Returns the shortest decimal that parses to this number.
    fn value(&self) -> String {
        assert!(self.is_finite(), "WGSL has no literal for {self}");
        format!("{self:?}")
    }
}

/// Vectors and arrays.
impl<T: ConstantValue, const N: usize> ConstantValue for [T; N]
where
    [T; N]: WgslType,
{
    fn value(&self) -> String {
        let elements: Vec<String> = self.iter().map(ConstantValue::value).collect();
        format!("{}({})", Self::wgsl(), elements.join(", "))
    }
}

/// Declares modules of constants, and a function `tables` that returns them as [`Table`]s. Names and types are the same in WGSL.
macro_rules! shared_constants {
    ($($(#[$doc:meta])* mod $table:ident {
        $($(#[$constant_doc:meta])* $name:ident: $type:ty = $value:expr;)+
    })+) => {
        $(
            $(#[$doc])*
            pub(crate) mod $table {
                $($(#[$constant_doc])* pub(crate) const $name: $type = $value;)+
            }
        )+

        /// Returns all tables of constants.
        pub fn tables() -> Vec<$crate::gpu::Table> {
            use $crate::gpu::{ConstantValue, Table, WgslType};
            vec![$(Table {
                name: stringify!($table),
                constants: vec![$((stringify!($name), <$type as WgslType>::wgsl(), ConstantValue::value(&$table::$name))),+],
            }),+]
        }
    };
}

pub(crate) use shared_constants;

#[cfg(test)]
mod tests {
    use super::*;

    shared_constants! {
        mod sample {
            COUNT: u32 = 4_294_967_295;
            STEP: i32 = -1920;
            LIGHT: f32 = 3.085_677_6e16;
            TINY: f32 = 1e-6;
            WHOLE: f32 = 2.0;
            AXIS: [f32; 3] = [0.2126, -0.0, 1.0];
        }
    }

    #[test]
    fn tables_are_generated_as_wgsl() {
        assert_eq!(
            tables()[0].wgsl(),
            "const COUNT: u32 = 4294967295u;\nconst STEP: i32 = -1920;\nconst LIGHT: f32 = 3.0856776e16;\n\
             const TINY: f32 = 1e-6;\nconst WHOLE: f32 = 2.0;\nconst AXIS: vec3<f32> = vec3<f32>(0.2126, -0.0, 1.0);\n"
        );
    }

    #[test]
    #[should_panic(expected = "WGSL has no literal for inf")]
    fn infinity_is_refused() {
        f32::INFINITY.value();
    }

    /// Parses a constant with naga.
    fn read(kind: &str, value: &str) -> naga::Literal {
        let module = naga::front::wgsl::parse_str(&format!("const X: {kind} = {value};")).unwrap();
        let (_, constant) = module.constants.iter().next().unwrap();
        match module.global_expressions[constant.init] {
            naga::Expression::Literal(literal) => literal,
            ref other => panic!("{other:?}"),
        }
    }

    #[test]
    fn numbers_keep_all_bits() {
        let numbers = (0..40_000_u32).map(|i| f32::from_bits(i.wrapping_mul(2_654_435_761)));
        let special = [f32::MIN_POSITIVE, f32::MAX, f32::from_bits(1), 1.0 / 3.0, 16_777_216.0, 7.643_856];
        for number in numbers.chain(special).filter(|number| number.is_finite() && *number > 0.0) {
            let naga::Literal::F32(back) = read("f32", &number.value()) else { panic!("{number}: no f32") };
            assert_eq!(back.to_bits(), number.to_bits(), "{number:?}");
        }
        assert_eq!(read("u32", &u32::MAX.value()), naga::Literal::U32(u32::MAX));
        assert_eq!(read("i32", &7_i32.value()), naga::Literal::I32(7));
        assert_ne!(read("f32", &0.1_f32.value()), naga::Literal::F32(0.1_f32.next_up()));
    }
}
