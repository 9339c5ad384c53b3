// SPDX-License-Identifier: Apache-2.0
//! Writes `generated/*.glsl` from `oocpt_abi`, then compiles every `shaders/**/NAME.comp`, forbids contraction in it,
//! validates it, and compares the layouts of its structs with those of the Rust structs.
//!
//! Needs `glslangValidator` (or what `GLSLANG_VALIDATOR` names) and `spirv-val` (`SPIRV_VAL`); fails with one clear
//! message when one is missing, when a shader is wrong, or when GLSL and Rust disagree about a struct.

#[path = "build/check.rs"]
mod check;
#[path = "build/exact.rs"]
mod exact;
#[path = "build/leaves.rs"]
mod leaves;
#[path = "build/light_shapes.rs"]
mod light_shapes;
#[path = "build/lobes.rs"]
mod lobes;
#[path = "build/structs.rs"]
mod structs;
#[path = "build/uses.rs"]
mod uses;

use oocpt_abi as abi;
use std::collections::BTreeSet;
use std::env;
use std::fmt::Write as _;
use std::fs;
use std::num::NonZero;
use std::panic::resume_unwind;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

fn main() -> ExitCode {
    match build() {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            for line in message.lines() {
                println!("cargo::error={line}");
            }
            ExitCode::FAILURE
        }
    }
}

fn build() -> Result<(), String> {
    for file in ["build.rs", "build"] {
        println!("cargo::rerun-if-changed={file}");
    }
    let manifest = PathBuf::from(env_variable("CARGO_MANIFEST_DIR")?);
    let out = PathBuf::from(env_variable("OUT_DIR")?);
    let shaders = manifest.join("../../shaders");
    let mut sources = Vec::new();
    watch_files(&shaders, &mut sources)?;
    sources.retain(|path| path.extension().is_some_and(|extension| extension == "comp"));
    sources.sort();
    let include = out.join("include");
    fs::create_dir_all(include.join("generated")).map_err(|error| format!("{}: {error}", include.display()))?;
    let generated = [
        ("constants.glsl", constants()?),
        ("leaves.glsl", leaves::functions()),
        ("light_shapes.glsl", light_shapes::functions()),
        ("lobes.glsl", lobes::types()),
        ("sobol.glsl", sobol()),
        ("structs.glsl", structs::structs()?),
        ("lobe_functions.glsl", lobes::functions()),
    ];
    for (name, text) in generated {
        let path = include.join("generated").join(name);
        fs::write(&path, text).map_err(|error| format!("{}: {error}", path.display()))?;
    }
    let tools = ShaderTools::from_env();
    let layouts = layouts();
    let mut checked_structs = BTreeSet::new();
    let mut passes = Vec::new();
    for compiled in map_in_parallel(&sources, |source| compile(&tools, source, [&shaders, &include], &out, &layouts)) {
        let CompiledPass { name, uses, structs } = compiled?;
        checked_structs.extend(structs);
        passes.push((name, uses));
    }
    for layout in &layouts {
        if !checked_structs.contains(&layout.name) {
            return Err(format!("{}: no shader has this struct in memory, so its layout is not checked", layout.name));
        }
    }
    fs::write(out.join("modules.rs"), modules(&passes)).map_err(|error| format!("modules.rs: {error}"))
}

/// A compiled pass.
struct CompiledPass {
    name: String,
    /// The specialisation constants that it reads.
    uses: uses::ModuleUses,
    /// Names of the structs in its memory whose layout was compared.
    structs: BTreeSet<String>,
}

/// Compiles a pass into `out` and checks it.
fn compile(
    tools: &ShaderTools,
    source: &Path,
    include: [&Path; 2],
    out: &Path,
    layouts: &[check::HostLayout],
) -> Result<CompiledPass, String> {
    let name = pass_name(source)?;
    let words = tools.compile(source, include, &out.join(format!("{name}.spv")))?;
    let structs = check::check(&words, layouts).map_err(|error| format!("{}:\n{error}", source.display()))?;
    let flag_words = [abi::SPEC_FEATURES, abi::SPEC_FEATURES_HIGH, abi::SPEC_FEATURES_TOP];
    let uses = uses::uses(&words, &flag_words).map_err(|error| format!("{}: {error}", source.display()))?;
    Ok(CompiledPass { name, uses, structs })
}

/// Maps `sources` by `work` on as many threads as there are processors; results are in the order of the sources.
fn map_in_parallel<T: Send>(sources: &[PathBuf], work: impl Fn(&Path) -> T + Sync) -> Vec<T> {
    let next = AtomicUsize::new(0);
    let worker = || {
        let mut results = Vec::new();
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(source) = sources.get(index) else { break };
            results.push((index, work(source)));
        }
        results
    };
    let workers = thread::available_parallelism().map_or(1, NonZero::get);
    let mut results: Vec<(usize, T)> = thread::scope(|scope| {
        let threads: Vec<_> = (0..workers).map(|_| scope.spawn(worker)).collect();
        threads.into_iter().flat_map(|thread| thread.join().unwrap_or_else(|cause| resume_unwind(cause))).collect()
    });
    results.sort_by_key(|(index, _)| *index);
    results.into_iter().map(|(_, result)| result).collect()
}

fn env_variable(name: &str) -> Result<String, String> {
    env::var(name).map_err(|error| format!("{name}: {error}"))
}

/// Collects the files below `folder` and has cargo watch them, and the folders too, so that new files are seen.
fn watch_files(folder: &Path, files: &mut Vec<PathBuf>) -> Result<(), String> {
    println!("cargo::rerun-if-changed={}", folder.display());
    let entries = fs::read_dir(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    for entry in entries {
        let path = entry.map_err(|error| format!("{}: {error}", folder.display()))?.path();
        if path.is_dir() {
            watch_files(&path, files)?;
        } else {
            println!("cargo::rerun-if-changed={}", path.display());
            files.push(path);
        }
    }
    Ok(())
}

/// The name of a pass: `NAME` for `shaders/wavefront/NAME.comp`, `FOLDER_NAME` for other folders.
fn pass_name(source: &Path) -> Result<String, String> {
    let part = |path: Option<&std::ffi::OsStr>| path.and_then(|name| name.to_str()).map(str::to_owned);
    let stem = part(source.file_stem()).ok_or_else(|| format!("{}: the name is not UTF-8", source.display()))?;
    let folder = part(source.parent().and_then(Path::file_name)).unwrap_or_default();
    Ok(if folder == "wavefront" { stem } else { format!("{folder}_{stem}") })
}

struct ShaderTools {
    compiler: String,
    validator: String,
}

impl ShaderTools {
    fn from_env() -> Self {
        for name in ["GLSLANG_VALIDATOR", "SPIRV_VAL"] {
            println!("cargo::rerun-if-env-changed={name}");
        }
        Self {
            compiler: env::var("GLSLANG_VALIDATOR").unwrap_or_else(|_| "glslangValidator".to_owned()),
            validator: env::var("SPIRV_VAL").unwrap_or_else(|_| "spirv-val".to_owned()),
        }
    }

    fn compile(&self, source: &Path, include: [&Path; 2], output: &Path) -> Result<Vec<u32>, String> {
        let mut compiler = Command::new(&self.compiler);
        compiler.args(["--quiet", "--target-env", "vulkan1.2", "-o"]).arg(output);
        if cfg!(feature = "faults") {
            compiler.arg("-DOOCPT_FAULTS");
        }
        compiler.args(include.map(|folder| format!("-I{}", folder.display()))).arg(source);
        run(compiler, "glslang-tools")?;
        let bytes = fs::read(output).map_err(|error| format!("{}: {error}", output.display()))?;
        let words: Vec<u32> = bytes.as_chunks::<4>().0.iter().map(|word| u32::from_le_bytes(*word)).collect();
        let words = exact::without_contraction(&words).map_err(|error| format!("{}: {error}", source.display()))?;
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        fs::write(output, bytes).map_err(|error| format!("{}: {error}", output.display()))?;
        let mut validator = Command::new(&self.validator);
        validator.args(["--target-env", "vulkan1.2", "--scalar-block-layout"]).arg(output);
        run(validator, "spirv-tools").map_err(|error| format!("{}: {error}", source.display()))?;
        Ok(words)
    }
}

/// `generated/constants.glsl`: `HAS_NAME` of every feature, and every constant that host and shaders share. A feature
/// that needs others is off where one of them is.
fn constants() -> Result<String, String> {
    let mut text = String::from(
        "// Written by rust/shaders/build.rs, from rust/abi/src: features, flags, constants, numbers and patterns.\n\n",
    );
    let mut declared = abi::Features::empty();
    for abi::FeatureRow { name, bit, needs, .. } in abi::FEATURES {
        if !declared.contains(*needs) {
            return Err(format!("feature {name} needs one that is not above it in the table"));
        }
        declared |= *bit;
        let index = bit.bits().trailing_zeros();
        let word = ["FEATURES", "FEATURES_HIGH", "FEATURES_TOP"].get(index as usize / 32);
        let (word, index) = (word.ok_or("too many features")?, index % 32);
        let needed: String = needs.iter_names().map(|(name, _)| format!(" && HAS_{name}")).collect();
        let _infallible = writeln!(text, "const bool HAS_{name} = ({word} & (1u << {index})) != 0u{needed};");
    }
    text.push('\n');
    for (name, value) in abi::flag_constants() {
        let _infallible = writeln!(text, "const uint {name} = {value}u;");
    }
    for (name, value) in abi::CONSTANTS {
        let _infallible = writeln!(text, "const uint {name} = {value}u;");
    }
    for (name, value) in abi::FLOATS {
        let _infallible = writeln!(text, "const float {name} = {value:?};");
    }
    Ok(text)
}

/// `generated/sobol.glsl`: the direction numbers of dimensions 1 to 3, one row for each bit of the index. Dimension 0
/// is the index with its bits reversed, which GLSL does without a table.
fn sobol() -> String {
    let [_reversed_bits, x, y, z] = abi::sampler::SOBOL_DIRECTIONS;
    let rows: Vec<_> = (0..32).map(|k| format!("    uvec3({:#x}u, {:#x}u, {:#x}u)", x[k], y[k], z[k])).collect();
    format!(
        "// Written by rust/shaders/build.rs, from rust/abi/src/sampler.rs.\n\n\
         const uvec3 SOBOL[32] = uvec3[32](\n{}\n);\n",
        rows.join(",\n")
    )
}

/// Runs a tool. If it fails, its output is the error.
fn run(mut command: Command, debian_package: &str) -> Result<(), String> {
    let program = command.get_program().to_string_lossy().into_owned();
    let output = command.output().map_err(|error| {
        format!("cannot run `{program}` ({error}): the shaders need it; on Debian: apt install {debian_package}")
    })?;
    if output.status.success() {
        return Ok(());
    }
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).trim().to_owned();
    Err(format!("{program} failed:\n{}\n{}", text(&output.stdout), text(&output.stderr)))
}

/// The layouts of the Rust structs that shaders have in memory.
fn layouts() -> Vec<check::HostLayout> {
    let member = |member: &abi::MemberLayout| check::HostMember {
        name: member.name.to_owned(),
        offset: member.offset as u64,
        size: member.size as u64,
    };
    let layout = |layout: &abi::StructLayout| check::HostLayout {
        name: layout.name.to_owned(),
        size: layout.size as u64,
        members: layout.members.iter().map(member).collect(),
    };
    abi::LAYOUTS.iter().map(layout).collect()
}

/// Rust source of the statics `passes::NAME` and, for what is in `shaders/scene`, `scene::NAME`, for the programs of
/// `shaders/check`, `checks::NAME`.
fn modules(modules: &[(String, uses::ModuleUses)]) -> String {
    let (checks, others): (Vec<_>, Vec<_>) = modules.iter().partition(|(name, _)| name.starts_with("check_"));
    let (scene, passes): (Vec<_>, Vec<_>) = others.into_iter().partition(|(name, _)| name.starts_with("scene_"));
    let mut text = String::new();
    let groups = [
        ("passes", "Every compiled pass, under its own name", &passes),
        ("scene", "What prepares the scene, before the passes of a frame", &scene),
        ("checks", "Programs of tests", &checks),
    ];
    for (group, doc, modules) in groups {
        let _infallible = write!(text, "/// {doc}.\npub mod {group} {{\n    use super::ShaderModule;\n");
        for (name, uses) in modules {
            let bits = |spec| u128::from(uses.bits.get(&spec).copied().unwrap_or(0));
            let features =
                bits(abi::SPEC_FEATURES) | bits(abi::SPEC_FEATURES_HIGH) << 32 | bits(abi::SPEC_FEATURES_TOP) << 64;
            let reads = |spec| uses.constants.contains(&spec);
            let _infallible = writeln!(
                text,
                "    /// `{name}`.\n    pub static {}: ShaderModule = ShaderModule {{\n        name: \"{name}\",\n        \
                 words: words!(\"{name}\"),\n        \
                 features: oocpt_abi::Features::from_bits_retain({features:#x}),\n        \
                 reads_levels: {},\n        reads_stack: {},\n    }};",
                name.to_uppercase(),
                reads(abi::SPEC_MAX_LEVELS),
                reads(abi::SPEC_STACK_SIZE),
            );
        }
        text.push_str("}\n\n");
    }
    let lists = [("ALL", "Every compiled pass", "passes", passes), ("SCENE", "All of [`scene`]", "scene", scene)];
    for (list, doc, group, modules) in lists {
        let _infallible = writeln!(text, "/// {doc}.\npub static {list}: &[&ShaderModule] = &[");
        for (name, _) in modules {
            let _infallible = writeln!(text, "    &{group}::{},", name.to_uppercase());
        }
        text.push_str("];\n");
    }
    text
}
