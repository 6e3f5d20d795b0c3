//! Compiles the kernels in `glsl/stages`, `glsl/ladder` and, for tests, `glsl/probes` to SPIR-V, reflects what each stage binds,
//! and writes the `shaders` module. The shared layout, `layout.glsl` and `settings.glsl`, is generated.
//!
//! A block's name in GLSL is its buffer's name in [`BufferId`](src/stage.rs): a name without a variant of that enum
//! fails the compilation of the generated module. Bindings are numbered by the compiler and never written by hand.

#[path = "build/layout.rs"]
mod layout;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs};

use anyhow::{Context, Result, bail, ensure};
use spirq::ReflectConfig;
use spirq::entry_point::EntryPoint;
use spirq::ty::{AccessType, DescriptorType, ScalarType, StructType, Type};
use spirq::var::Variable;

fn main() -> Result<()> {
    println!("cargo:rerun-if-changed=glsl");
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=build");
    println!("cargo:rerun-if-changed=src/layout");
    let root = PathBuf::from(env::var("CARGO_MANIFEST_DIR")?);
    let out = PathBuf::from(env::var("OUT_DIR")?);

    let mut sources = Vec::new();
    for folder in ["glsl/stages", "glsl/ladder", "glsl/probes"] {
        for entry in fs::read_dir(root.join(folder))? {
            sources.push(entry?.path());
        }
    }
    sources.retain(|path| path.extension().is_some_and(|extension| extension == "comp"));
    sources.sort();

    // For readers, and to compile a stage with another tool.
    for name in layout::INCLUDES {
        fs::write(
            out.join(name),
            layout::include(name).context("a file that is generated")?,
        )?;
    }

    let compiler = shaderc::Compiler::new().context("shaderc: no compiler")?;
    let mut module = String::new();
    let mut names = Vec::new();
    let mut push_constants = BTreeMap::new();
    for source in &sources {
        let name = source
            .file_stem()
            .and_then(|stem| stem.to_str())
            .context("stage's file name")?
            .to_owned();
        let text = fs::read_to_string(source)?;
        let file = source.strip_prefix(&root)?.display().to_string();
        let named = compile(&compiler, &text, &file, &root, shaderc::OptimizationLevel::Zero)?;
        let optimised = compile(&compiler, &text, &file, &root, shaderc::OptimizationLevel::Performance)?;
        fs::write(out.join(format!("{name}.spv")), optimised.as_binary_u8())?;
        let entry_point = reflect(named.as_binary(), false).with_context(|| source.display().to_string())?;
        check_bindings(optimised.as_binary(), &entry_point).with_context(|| source.display().to_string())?;
        let by_query = with_ray_query(&compiler, &text, &file, &root, &entry_point)
            .with_context(|| format!("{file} with ray queries"))?;
        if let Some(module) = &by_query {
            fs::write(out.join(format!("{name}.ray_query.spv")), module.as_binary_u8())?;
        }
        describe(&mut module, &name, &entry_point, by_query.is_some()).with_context(|| source.display().to_string())?;
        add_push_constants(&mut push_constants, &entry_point).with_context(|| source.display().to_string())?;
        names.push(name.to_uppercase());
    }
    module.extend(push_constants.into_values());
    writeln!(
        module,
        "/// Every stage's shader.\npub static ALL: &[&Shader] = &[{}];",
        {
            names
                .iter()
                .map(|name| format!("&{name}"))
                .collect::<Vec<_>>()
                .join(", ")
        }
    )?;
    let probe = compile(
        &compiler,
        &layout::probe(),
        "probe",
        &root,
        shaderc::OptimizationLevel::Zero,
    )?;
    describe_structs(&mut module, &reflect(probe.as_binary(), true)?)?;
    fs::write(out.join("shaders.rs"), module)?;
    Ok(())
}

fn compile(
    compiler: &shaderc::Compiler,
    text: &str,
    file: &str,
    root: &Path,
    level: shaderc::OptimizationLevel,
) -> Result<shaderc::CompilationArtifact> {
    let options = options(root, level)?;
    Ok(compiler.compile_into_spirv(text, shaderc::ShaderKind::Compute, file, "main", Some(&options))?)
}

/// Bindings of the first descriptor set, with their buffers' names.
fn slots(entry_point: &EntryPoint) -> BTreeMap<u32, String> {
    let slot = |variable: &Variable| match variable {
        Variable::Descriptor {
            name, desc_bind, ty, ..
        } if desc_bind.set() == 0 => {
            let name = match ty {
                Type::Struct(block) => block.name(),
                _ => name.as_deref(),
            };
            Some((desc_bind.bind(), name.unwrap_or_default().to_owned()))
        }
        _ => None,
    };
    entry_point.vars.iter().filter_map(slot).collect()
}

/// The stage with ray queries, if it traces rays: a module that other devices can't load. `plain` is the stage without them, whose
/// bindings it must have.
fn with_ray_query(
    compiler: &shaderc::Compiler,
    text: &str,
    file: &str,
    root: &Path,
    plain: &EntryPoint,
) -> Result<Option<shaderc::CompilationArtifact>> {
    const OP_RAY_QUERY_INITIALIZE: u32 = 4473;
    let level = shaderc::OptimizationLevel::Performance;
    let (version, rest) = text.split_once('\n').context("an empty stage")?;
    let text = format!("{version}\n#extension GL_EXT_ray_query : require\n#define RAY_QUERY\n#line 2\n{rest}");
    let preprocessed = compiler.preprocess(&text, file, "main", Some(&options(root, level)?))?;
    if !preprocessed.as_text().contains("rayQueryInitializeEXT") {
        return Ok(None);
    }
    let module = compile(compiler, &text, file, root, level)?;
    // Some stages include the traversal and don't call it.
    let traces = instructions(module.as_binary())?
        .iter()
        .any(|instruction| code(instruction) == OP_RAY_QUERY_INITIALIZE);
    if !traces {
        return Ok(None);
    }
    check_bindings(module.as_binary(), plain)?;
    let named = compile(compiler, &text, file, root, shaderc::OptimizationLevel::Zero)?;
    ensure!(
        slots(&reflect(named.as_binary(), false)?) == slots(plain),
        "bindings have other numbers"
    );
    Ok(Some(module))
}

fn options(root: &Path, level: shaderc::OptimizationLevel) -> Result<shaderc::CompileOptions<'_>> {
    let mut options = shaderc::CompileOptions::new().context("shaderc: no options")?;
    options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_2 as u32);
    options.set_optimization_level(level);
    options.set_auto_bind_uniforms(true);
    options.set_warnings_as_errors();
    options.set_include_callback(move |name, _, _, _| {
        let path = root.join("glsl").join(name);
        let content = match layout::include(name) {
            Some(generated) => generated,
            None => fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?,
        };
        Ok(shaderc::ResolvedInclude {
            resolved_name: path.display().to_string(),
            content,
        })
    });
    Ok(options)
}

/// `unused`: includes declarations that the kernel does not use.
fn reflect(spirv: &[u32], unused: bool) -> Result<EntryPoint> {
    let mut entry_points = ReflectConfig::new()
        .spv(spirv)
        .ref_all_rscs(unused)
        .reflect()
        .map_err(|error| anyhow::anyhow!("{error}"))?;
    ensure!(
        entry_points.len() == 1,
        "{} entry points, expected one",
        entry_points.len()
    );
    Ok(entry_points.remove(0))
}

/// Every binding of the optimised module must have been reflected: reflection does not see one that is passed to a function.
fn check_bindings(spirv: &[u32], entry_point: &EntryPoint) -> Result<()> {
    const OP_DECORATE: u32 = 71;
    const BINDING: u32 = 33;
    let reflected: Vec<u32> = entry_point
        .vars
        .iter()
        .filter_map(|variable| match variable {
            Variable::Descriptor { desc_bind, .. } => Some(desc_bind.bind()),
            _ => None,
        })
        .collect();
    for instruction in instructions(spirv)? {
        if let [_, _, BINDING, slot, ..] = instruction
            && code(instruction) == OP_DECORATE
        {
            ensure!(
                reflected.contains(slot),
                "binding {slot} wasn't reflected; use its buffer by name"
            );
        }
    }
    Ok(())
}

/// The instructions of a SPIR-V module, after its head of five words.
fn instructions(spirv: &[u32]) -> Result<Vec<&[u32]>> {
    let mut instructions = Vec::new();
    let mut rest = &spirv[5..];
    while let [first, ..] = rest {
        let words = (first >> 16) as usize;
        ensure!(words > 0 && words <= rest.len(), "damaged SPIR-V");
        let (instruction, after) = rest.split_at(words);
        instructions.push(instruction);
        rest = after;
    }
    Ok(instructions)
}

fn code(instruction: &[u32]) -> u32 {
    instruction[0] & 0xffff
}

/// Appends the `Shader` constant of the stage `name` to the module.
fn describe(module: &mut String, name: &str, entry_point: &EntryPoint, by_query: bool) -> Result<()> {
    let mut bindings = BTreeMap::new();
    let mut constants = BTreeMap::new();
    let mut push_constants = "None".to_owned();
    for variable in &entry_point.vars {
        match variable {
            Variable::Descriptor {
                name,
                desc_bind,
                desc_ty,
                ty,
                ..
            } => {
                let (buffer, access, element) = match (desc_ty, ty) {
                    (DescriptorType::StorageBuffer(access), Type::Struct(block)) => {
                        (block.name(), access_name(*access), fields(element(block))?)
                    }
                    (DescriptorType::UniformBuffer(), Type::Struct(block)) => {
                        (block.name(), "Uniform", fields(element(block))?)
                    }
                    (DescriptorType::UniformTexelBuffer(), _) => (
                        name.as_deref(),
                        "Texels",
                        "StructLayout { name: \"\", fields: &[] }".to_owned(),
                    ),
                    other => bail!("{other:?} isn't a buffer"),
                };
                let buffer = buffer.context("a buffer without a name")?;
                let slot = desc_bind.bind();
                bindings.insert(
                    slot,
                    format!(
                        "Binding {{ slot: {slot}, buffer: BufferId::{buffer}, access: Access::{access}, \
                         element: {element} }}"
                    ),
                );
            }
            Variable::PushConstant {
                ty: Type::Struct(block),
                ..
            } => {
                push_constants = format!("Some({})", fields(block)?);
            }
            Variable::SpecConstant { name, spec_id, .. } => {
                let name = name.as_deref().unwrap_or("").to_owned();
                constants.insert(*spec_id, name);
            }
            other => bail!("unexpected interface: {other:?}"),
        }
    }
    let constants: Vec<String> = constants
        .iter()
        .map(|(id, name)| format!("SpecConstant {{ id: {id}, name: \"{name}\" }}"))
        .collect();
    let bindings: Vec<String> = bindings.into_values().collect();
    let ray_query = if by_query {
        format!("Some(include_bytes!(concat!(env!(\"OUT_DIR\"), \"/{name}.ray_query.spv\")))")
    } else {
        "None".to_owned()
    };
    writeln!(
        module,
        "/// Stage `{name}`.\npub static {}: Shader = Shader {{ name: \"{name}\", \
         spirv: include_bytes!(concat!(env!(\"OUT_DIR\"), \"/{name}.spv\")), ray_query: {ray_query}, \
         workgroup: {}, bindings: &[{}], push_constants: {push_constants}, constants: &[{}] }};",
        name.to_uppercase(),
        workgroup_size(entry_point)?,
        bindings.join(", "),
        constants.join(", ")
    )?;
    Ok(())
}

/// Adds the Rust struct of the stage's push constants. Stages may share a block; it must be the same in all of them.
fn add_push_constants(structs: &mut BTreeMap<String, String>, entry_point: &EntryPoint) -> Result<()> {
    let blocks = entry_point.vars.iter().filter_map(|variable| match variable {
        Variable::PushConstant {
            ty: Type::Struct(block),
            ..
        } => Some(block),
        _ => None,
    });
    for block in blocks {
        let name = block.name().context("push constants without a name")?;
        let mut fields = String::new();
        let mut end = 0;
        for member in &block.members {
            ensure!(member.offset == Some(end), "{name}: padding between push constants");
            end += size(&member.ty)?;
            let field = member.name.as_deref().context("a push constant without a name")?;
            write!(fields, "pub {field}: {}, ", rust_type(&member.ty)?)?;
        }
        let declaration = format!(
            "/// Push constants.\n#[repr(C)]\n#[derive(Debug, Clone, Copy, bytemuck::NoUninit)]\n\
             #[allow(missing_docs, reason = \"GLSL has the comments\")]\npub struct {name} {{ {fields}}}\n\
             impl crate::stage::PushConstants for {name} {{ const NAME: &str = \"{name}\"; }}\n"
        );
        let known = structs.entry(name.to_owned()).or_insert_with(|| declaration.clone());
        ensure!(*known == declaration, "two blocks of push constants are named {name}");
    }
    Ok(())
}

fn rust_type(ty: &Type) -> Result<String> {
    let scalar = |scalar: &ScalarType| match scalar {
        ScalarType::Integer {
            bits: 32,
            is_signed: false,
        } => Ok("u32"),
        ScalarType::Float { bits: 32, .. } => Ok("f32"),
        other => bail!("no Rust type for {other:?}"),
    };
    Ok(match ty {
        Type::Scalar(ty) => scalar(ty)?.to_owned(),
        Type::Vector(ty) => format!("[{}; {}]", scalar(&ty.scalar_ty)?, ty.nscalar),
        other => bail!("no Rust type for {other:?}"),
    })
}

/// Appends `STRUCTS`, the element of each buffer that the probe binds.
fn describe_structs(module: &mut String, entry_point: &EntryPoint) -> Result<()> {
    let mut structs = Vec::new();
    for variable in &entry_point.vars {
        if let Variable::Descriptor {
            ty: Type::Struct(block),
            ..
        } = variable
        {
            structs.push(fields(element(block))?);
        }
    }
    writeln!(
        module,
        "/// Every struct of `layout`, as storage buffers have it.\npub static STRUCTS: &[StructLayout] = &[{}];",
        structs.join(", ")
    )?;
    Ok(())
}

/// Invocations of a workgroup, all of them along x.
fn workgroup_size(entry_point: &EntryPoint) -> Result<u32> {
    let mode = entry_point
        .exec_modes
        .iter()
        .find(|mode| mode.exec_mode == spirq::spirv::ExecutionMode::LocalSize)
        .context("no local size")?;
    let mut sizes = Vec::new();
    for operand in &mode.operands {
        let bytes = operand.value.to_typeless().context("a local size that is no literal")?;
        sizes.push(u32::from_le_bytes(bytes.as_ref().try_into()?));
    }
    let [x, 1, 1] = sizes[..] else {
        bail!("local size {sizes:?}, expected (x, 1, 1)")
    };
    Ok(x)
}

fn access_name(access: AccessType) -> &'static str {
    match access {
        AccessType::ReadOnly => "Read",
        AccessType::WriteOnly => "Write",
        AccessType::ReadWrite => "ReadWrite",
    }
}

/// The struct of a block's content or elements, or the block itself.
fn element(block: &StructType) -> &StructType {
    match block.members.as_slice() {
        [member] => match &member.ty {
            Type::Struct(element) => element,
            Type::Array(array) => match array.element_ty.as_ref() {
                Type::Struct(element) => element,
                _ => block,
            },
            _ => block,
        },
        _ => block,
    }
}

fn size(ty: &Type) -> Result<usize> {
    Ok(match ty {
        Type::Array(array) => match (array.nelement, array.stride) {
            (Some(count), Some(stride)) => count as usize * stride,
            _ => 0,
        },
        other => other
            .nbyte()
            .or_else(|| other.min_nbyte())
            .context("a type without a size")?,
    })
}

fn fields(layout: &StructType) -> Result<String> {
    let mut fields = Vec::new();
    for member in &layout.members {
        fields.push(format!(
            "Field {{ name: \"{}\", offset: {}, size: {} }}",
            member.name.as_deref().unwrap_or(""),
            member.offset.context("a member without an offset")?,
            size(&member.ty)?
        ));
    }
    Ok(format!(
        "StructLayout {{ name: \"{}\", fields: &[{}] }}",
        layout.name().unwrap_or(""),
        fields.join(", ")
    ))
}
