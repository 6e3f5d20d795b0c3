//! Structs and constants shared by host and kernels, written once: `build/layout.rs` generates GLSL from this module, which
//! therefore imports no other. `tests/layout.rs` compares each struct with the reflected one.

/// Declares structs of the device's layout and `LAYOUTS`, which lists their fields.
macro_rules! device_structs {
    ($($(#[$doc:meta])* pub struct $name:ident: $size:literal {
        $($(#[$field_doc:meta])* pub $field:ident: $type:ty,)*
    })*) => {
        $(
            $(#[$doc])*
            #[repr(C)]
            #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
            pub struct $name {
                $($(#[$field_doc])* pub $field: $type,)*
            }
            const _: () = assert!(size_of::<$name>() == $size);
        )*
        /// Every struct of this module.
        pub(super) const LAYOUTS: &[Layout] = &[
            $(Layout {
                name: stringify!($name),
                size: $size,
                fields: &[
                    $(FieldLayout {
                        name: stringify!($field),
                        offset: std::mem::offset_of!($name, $field),
                        shape: <$type as Shared>::SHAPE,
                    },)*
                ],
            },)*
        ];
    };
}

pub mod constants;
mod material;
mod render;
mod scene;
mod shape;

pub use constants::*;
pub use material::*;
pub use render::*;
pub use scene::*;
pub use shape::{FieldLayout, Layout, Scalar, Shape, Shared};

/// Every struct.
pub fn layouts() -> impl Iterator<Item = &'static Layout> {
    let rooms = [scene::LAYOUTS, material::LAYOUTS, render::LAYOUTS];
    rooms.into_iter().flatten()
}
