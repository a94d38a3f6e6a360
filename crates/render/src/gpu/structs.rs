//! Structures that Rust and WGSL share.
//!
//! [`gpu_structs!`] declares them in Rust. Their WGSL is generated: a shader imports a structure by its name, as in `#import structs/Viewport`.
//!
//! Both languages place fields by their own rules; in WGSL for instance a `vec3<f32>` begins at a multiple of 16 bytes. A declaration
//! contains explicit padding where the rules differ: fields named `unused_0`, `unused_1` and so on. `tests/cpu/shaders.rs` compares offsets
//! and sizes in Rust with those that naga computes from the WGSL.

use std::fmt::Write;

/// A Rust type that has a counterpart in WGSL. To give a field a WGSL type that is not listed below, wrap its Rust type and implement this.
pub(crate) trait WgslType {
    /// The shared structure: the type itself, or the element type of an array.
    const STRUCT: Option<&'static str> = None;

    /// Returns the type in WGSL.
    fn wgsl() -> String;
}

macro_rules! wgsl_types {
    ($($rust:ty => $wgsl:literal),+ $(,)?) => {
        $(impl WgslType for $rust {
            fn wgsl() -> String {
                $wgsl.to_owned()
            }
        })+
    };
}

wgsl_types! {
    u32 => "u32",
    i32 => "i32",
    f32 => "f32",
    [u32; 2] => "vec2<u32>",
    [i32; 2] => "vec2<i32>",
    [f32; 2] => "vec2<f32>",
    [f32; 3] => "vec3<f32>",
    [f32; 4] => "vec4<f32>",
    [f32; 5] => "array<f32, 5>",
}

/// A type whose arrays are arrays in WGSL too. (Arrays of up to four numbers are vectors in WGSL instead.)
pub(crate) trait ArrayElement: WgslType {}

impl ArrayElement for [f32; 3] {}

impl<T: ArrayElement, const N: usize> WgslType for [T; N] {
    const STRUCT: Option<&'static str> = T::STRUCT;

    fn wgsl() -> String {
        format!("array<{}, {N}>", T::wgsl())
    }
}

/// A structure that Rust and WGSL share.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StructLayout {
    /// Name in both languages. Shaders import it as `structs/{name}`.
    pub name: &'static str,
    /// Size in Rust, bytes.
    pub size: usize,
    /// The fields in their order.
    pub fields: Vec<StructField>,
}

/// A field of a structure that Rust and WGSL share.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StructField {
    /// Name in both languages.
    pub name: &'static str,
    /// Offset in Rust, bytes.
    pub offset: usize,
    /// Type in WGSL.
    pub wgsl: String,
    /// Name of the shared structure that this type contains, if any.
    pub contained: Option<&'static str>,
}

impl StructLayout {
    /// Returns the declaration in WGSL, after imports of the structures that it contains.
    pub fn wgsl(&self) -> String {
        let mut text = String::new();
        for contained in self.fields.iter().filter_map(|field| field.contained) {
            writeln!(text, "#import structs/{contained}").expect("a String accepts all text");
        }
        writeln!(text, "struct {} {{", self.name).expect("a String accepts all text");
        for field in &self.fields {
            writeln!(text, "    {}: {},", field.name, field.wgsl).expect("a String accepts all text");
        }
        text + "}\n"
    }
}

/// Declares structures that Rust and WGSL share, with public fields, and a function `struct_layouts` that describes them.
macro_rules! gpu_structs {
    ($($(#[$doc:meta])* struct $name:ident { $($(#[$field_doc:meta])* $field:ident : $type:ty),+ $(,)? })+) => {
        $(
            $(#[$doc])*
            #[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
            #[repr(C)]
            pub struct $name { $($(#[$field_doc])* pub $field: $type),+ }

            impl $crate::gpu::WgslType for $name {
                const STRUCT: Option<&'static str> = Some(stringify!($name));

                fn wgsl() -> String {
                    stringify!($name).to_owned()
                }
            }

            impl $crate::gpu::ArrayElement for $name {}
        )+

        /// Returns the descriptions of these structures.
        pub fn struct_layouts() -> Vec<$crate::gpu::StructLayout> {
            use $crate::gpu::{StructField, StructLayout, WgslType};
            vec![$(StructLayout {
                name: stringify!($name),
                size: size_of::<$name>(),
                fields: vec![$(StructField {
                    name: stringify!($field),
                    offset: std::mem::offset_of!($name, $field),
                    wgsl: <$type as WgslType>::wgsl(),
                    contained: <$type as WgslType>::STRUCT,
                }),+],
            }),+]
        }
    };
}

pub(crate) use gpu_structs;

#[cfg(test)]
mod tests {
    gpu_structs! {
        struct Source {
            direction: [f32; 3],
            radius: f32,
        }
        struct Parameters {
            /// The documentation stays in Rust.
            matrix_row: [f32; 4],
            size: [u32; 2],
            corner: [i32; 2],
            sources: [Source; 2],
            brightest: Source,
            scale: [f32; 2],
            count: u32,
            first: i32,
        }
    }

    #[test]
    fn structures_are_generated_as_wgsl() {
        let wgsl: Vec<String> = struct_layouts().iter().map(super::StructLayout::wgsl).collect();
        assert_eq!(wgsl[0], "struct Source {\n    direction: vec3<f32>,\n    radius: f32,\n}\n");
        assert_eq!(
            wgsl[1],
            "#import structs/Source\n#import structs/Source\nstruct Parameters {\n    matrix_row: vec4<f32>,\n    \
             size: vec2<u32>,\n    corner: vec2<i32>,\n    sources: array<Source, 2>,\n    brightest: Source,\n    \
             scale: vec2<f32>,\n    count: u32,\n    first: i32,\n}\n"
        );
    }
}
