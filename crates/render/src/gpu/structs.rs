//! Structures that Rust and WGSL share: declared once in Rust, with the same names as in WGSL; a test compares names, offsets and
//! sizes with what naga reads from the shaders.

/// Describes a struct to the test that compares it with WGSL.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StructLayout {
    /// Name in WGSL.
    pub name: &'static str,
    /// Size in bytes.
    pub size: usize,
    /// Name and offset of every field.
    pub fields: Vec<(&'static str, usize)>,
}

macro_rules! gpu_structs {
    ($($(#[$doc:meta])* $name:ident { $($(#[$field_doc:meta])* $field:ident : $type:ty),+ $(,)? })+) => {
        $(
            $(#[$doc])*
            #[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
            #[repr(C)]
            pub struct $name { $($(#[$field_doc])* pub $field: $type),+ }
        )+

        /// The layouts of these structures.
        pub fn struct_layouts() -> Vec<$crate::gpu::StructLayout> {
            vec![$($crate::gpu::StructLayout {
                name: stringify!($name),
                size: size_of::<$name>(),
                fields: vec![$((stringify!($field), std::mem::offset_of!($name, $field))),+],
            }),+]
        }
    };
}

pub(crate) use gpu_structs;
