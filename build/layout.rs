//! Generates GLSL from `src/layout`, the structs and constants shared by host and kernels, which is compiled into this build
//! script too.

use std::fmt::Write as _;

#[path = "../src/layout/mod.rs"]
#[allow(dead_code, unused_imports, reason = "the program uses the rest")]
mod shared;

use shared::constants::{self, Number};
use shared::{FieldLayout, Layout, Scalar, Shape, layouts};

/// The struct that is a uniform block in kernels.
const UNIFORM: &str = "Settings";

fn structs() -> impl Iterator<Item = &'static Layout> {
    layouts().filter(|layout| layout.name != UNIFORM)
}

/// Names of the files of [`include`].
pub const INCLUDES: [&str; 2] = ["layout.glsl", "settings.glsl"];

/// The generated file that kernels include by this name, if any.
pub fn include(name: &str) -> Option<String> {
    match name {
        "layout.glsl" => Some(constants_and_structs()),
        "settings.glsl" => Some(settings()),
        _ => None,
    }
}

/// A kernel that binds a buffer of each struct: its reflection shows their memory layout.
pub fn probe() -> String {
    let mut glsl = String::from("#version 460\n#extension GL_GOOGLE_include_directive : require\n");
    glsl += "layout(local_size_x = 1) in;\n#include \"layout.glsl\"\n";
    for Layout { name, .. } in structs() {
        writeln!(glsl, "layout(std430) buffer Of{name} {{ {name} of_{name}[]; }};").expect("a string");
    }
    glsl + "void main() {}\n"
}

fn constants_and_structs() -> String {
    let mut glsl = String::from("#ifndef LAYOUT\n#define LAYOUT\n");
    for (name, value) in constants::all() {
        match value {
            Number::Uint(value) => writeln!(glsl, "const uint {name} = {value}u;"),
            Number::Float(value) => writeln!(glsl, "const float {name} = {value:?};"),
        }
        .expect("a string");
    }
    for layout in structs() {
        writeln!(glsl, "struct {} {{\n{}}};", layout.name, members(layout)).expect("a string");
        if let Some(reader) = reader(layout) {
            glsl += &reader;
        }
    }
    glsl + "#endif\n"
}

fn settings() -> String {
    let layout = layouts().find(|layout| layout.name == UNIFORM).expect("settings");
    format!(
        "#include \"layout.glsl\"\nlayout(std140) uniform {UNIFORM} {{\n{}}} settings;\n",
        members(layout)
    )
}

fn members(layout: &Layout) -> String {
    let member = |field: &FieldLayout| {
        let (glsl_type, count) = type_of(field.shape);
        format!("    {glsl_type} {}{count};\n", field.name)
    };
    layout.fields.iter().map(member).collect()
}

/// A shape's type in GLSL, and the suffix of the field's name.
fn type_of(Shape { scalar, columns, rows }: Shape) -> (String, String) {
    let (one, vector) = match scalar {
        Scalar::Uint => ("uint", "uvec"),
        Scalar::Float => ("float", "vec"),
    };
    match (columns, rows) {
        (1, 1) => (one.to_owned(), String::new()),
        (2..=4, 1) => (format!("{vector}{columns}"), String::new()),
        (_, 1) => (one.to_owned(), format!("[{columns}]")),
        (_, 5..) => (format!("{vector}{columns}"), format!("[{rows}]")),
        // GLSL's type names the columns, which are contiguous here.
        _ => (format!("mat{rows}x{columns}"), String::new()),
    }
}

/// Macros that read a struct out of a texel buffer: the i-th one, `PHOTON(buffer, i)`, or the i-th one after so many texels,
/// `PHOTON_AFTER(buffer, texels, i)`. Unused fields are not loaded. (Macros, because reflection does not see a texel buffer that
/// is passed to a function.) None for a struct that is not made of whole texels.
fn reader(layout: &Layout) -> Option<String> {
    if !layout.size.is_multiple_of(16) {
        return None;
    }
    let values: Vec<String> = layout.fields.iter().map(value_in_texels).collect::<Option<_>>()?;
    let name = layout.name;
    let snake = snake_case(name);
    let upper = snake.to_uppercase();
    let texels = layout.size / 16;
    let list = |item: &dyn Fn(usize) -> String| (0..texels).map(item).collect::<Vec<_>>().join(", ");
    Some(format!(
        "{name} {snake}_from({}) {{\n    return {name}({});\n}}\n\
         #define {upper}_AFTER(buffer, texels, i) {snake}_from({})\n\
         #define {upper}(buffer, i) {upper}_AFTER(buffer, 0u, i)\n",
        list(&|i| format!("uvec4 t{i}")),
        values.join(", "),
        list(&|i| format!("texelFetch(buffer, int((texels) + {texels}u * (i) + {i}u))")),
    ))
}

fn value_in_texels(field: &FieldLayout) -> Option<String> {
    let Shape { scalar, columns, rows } = field.shape;
    let (texel, first) = (field.offset / 16, field.offset % 16 / 4);
    let in_one = |texel: usize| {
        let components = &"xyzw"[first..first + columns];
        match scalar {
            Scalar::Uint => format!("t{texel}.{components}"),
            Scalar::Float => format!("uintBitsToFloat(t{texel}.{components})"),
        }
    };
    if rows > 1 {
        let all: Vec<String> = (texel..texel + rows).map(in_one).collect();
        return (columns == 4 && first == 0).then(|| format!("{}({})", type_of(field.shape).0, all.join(", ")));
    }
    (first + columns <= 4).then(|| in_one(texel))
}

fn snake_case(name: &str) -> String {
    let mut snake = String::new();
    for letter in name.chars() {
        if letter.is_uppercase() && !snake.is_empty() {
            snake.push('_');
        }
        snake.push(letter.to_ascii_lowercase());
    }
    snake
}
