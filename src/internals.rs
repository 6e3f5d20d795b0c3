//! What the library is made of, for its own tests, benches and examples: no promise is made about any of it.

macro_rules! open {
    ($($module:ident)*) => {
        $(
            #[allow(missing_docs)]
            pub mod $module {
                pub use crate::$module::*;
            }
        )*
    };
}

open! {
    alias backend config cpu emission error estimate files film gather gpu layout loader metrics packing pipeline radius random record report
    scene session shaders sizes stage text
}
