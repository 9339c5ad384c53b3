// SPDX-License-Identifier: Apache-2.0
//! Prims to a USD file: raw arrays and a table of contents in a temporary folder, from which `tests/scenes/island.py`
//! makes the stage in a Python that has usd-core.

use anyhow::{Context, Result, bail};
use glam::DMat4;
use oocpt_command::stop::{self, Folder};
use oocpt_core::array::{ElementType, TypedArray};
use oocpt_core::scene::{InstancerDesc, Interpolation, LightDesc, LightKind, MeshDesc};
use oocpt_scenes::island::{Prims, StageCamera};
use rustc_hash::FxHashMap;
use serde_json::{Value, json};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::process::{Command, Stdio};

/// The writer of stages; the same file that the Python tests import.
const SCRIPT: &str = include_str!("../../../../tests/scenes/island.py");

/// The Python to use.
pub(crate) fn python(named: Option<&Path>) -> Result<&Path> {
    named.filter(|path| !path.as_os_str().is_empty()).context(
        "writing USD takes a Python with usd-core: set OOCPT_USD_PYTHON, for example by eval \"$(cargo xtask env)\"",
    )
}

/// Writes the stage; with `report`, its render settings name that file.
pub(crate) fn write(
    prims: &Prims,
    camera: &StageCamera,
    report: Option<&Path>,
    python: &Path,
    out: &Path,
) -> Result<()> {
    let folder = Folder::create(std::env::temp_dir().join(format!("oocpt-island-{}", std::process::id())))?;
    let place = folder.path();
    let contents = write_parts(prims, camera, report, place);
    contents.with_context(|| format!("cannot write into {} (TMPDIR names another place)", place.display()))?;
    let script = place.join("island.py");
    let mut child = Command::new(python);
    child.arg("-I").arg(&script).arg(place).arg(out).stdin(Stdio::null());
    child.stdout(Stdio::piped()).stderr(Stdio::piped());
    let ended = stop::start(&mut child).and_then(|(child, _started)| child.wait_with_output());
    let output = ended.with_context(|| format!("cannot start OOCPT_USD_PYTHON={}", python.display()))?;
    if !output.status.success() {
        let errors = String::from_utf8_lossy(&output.stderr);
        let last = errors.trim_end().lines().last().unwrap_or("no message");
        bail!("{} did not write {}: {last}", python.display(), out.display());
    }
    Ok(())
}

fn write_parts(prims: &Prims, camera: &StageCamera, report: Option<&Path>, folder: &Path) -> Result<()> {
    std::fs::write(folder.join("island.py"), SCRIPT)?;
    let mut arrays =
        ArrayFile { file: BufWriter::new(File::create(folder.join("arrays"))?), end: 0, known: FxHashMap::default() };
    let meshes: Vec<Value> = prims.meshes.iter().map(|mesh| arrays.mesh(mesh)).collect::<Result<_>>()?;
    let instancers: Vec<Value> = prims.instancers.iter().map(|i| arrays.instancer(i)).collect::<Result<_>>()?;
    arrays.file.flush()?;
    let contents = json!({
        "meshes": meshes,
        "instancers": instancers,
        "lights": prims.lights.iter().map(light).collect::<Vec<_>>(),
        "camera": {
            "matrix": matrix(&camera.world_from_view),
            "field_of_view": camera.field_of_view,
            "clipping": camera.clipping,
        },
        "report": report.map(|report| report.to_string_lossy()),
    });
    std::fs::write(folder.join("contents.json"), contents.to_string())?;
    Ok(())
}

/// The file of all arrays, each once.
struct ArrayFile {
    file: BufWriter<File>,
    end: u64,
    /// Where an array of this address and length is.
    known: FxHashMap<(usize, usize), u64>,
}

impl ArrayFile {
    /// Appends an array unless it is there; gives its place and type for numpy.
    fn add(&mut self, array: &TypedArray) -> Result<Value> {
        let (kind, width, size) = match array.element() {
            ElementType::I32 => ("i4", 1, 4),
            ElementType::Vec3f => ("f4", 3, 12),
            ElementType::Quath => ("f2", 4, 8),
            ElementType::Quatf => ("f4", 4, 16),
            other => bail!("arrays of {other:?} are not written"),
        };
        let identity = array.identity();
        let at = match self.known.get(&identity) {
            Some(at) => *at,
            None => {
                let at = self.end;
                self.file.write_all(array.view().bytes())?;
                self.end += (array.len() * size) as u64;
                self.known.insert(identity, at);
                at
            }
        };
        Ok(json!({ "at": at, "count": array.len(), "type": kind, "width": width }))
    }

    fn mesh(&mut self, mesh: &MeshDesc) -> Result<Value> {
        let color = mesh.display_color.as_ref().context("a mesh without colour")?;
        Ok(json!({
            "path": &*mesh.prim.path,
            "matrix": matrix(&mesh.prim.transform),
            "points": self.add(&mesh.points)?,
            "counts": self.add(&mesh.face_vertex_counts)?,
            "indices": self.add(&mesh.face_vertex_indices)?,
            "colors": self.add(&color.values)?,
            "interpolation": interpolation(color.interpolation),
            "normals": mesh.normals.as_ref().map(|normals| self.add(&normals.values)).transpose()?,
            "double_sided": mesh.double_sided,
        }))
    }

    fn instancer(&mut self, instancer: &InstancerDesc) -> Result<Value> {
        let mut prototypes = Vec::new();
        for prototype in &instancer.prototypes {
            prototypes.push(json!({ "root": &*prototype.root, "indices": self.add(&prototype.indices)? }));
        }
        let mut array = |array: &Option<TypedArray>| self.add(array.as_ref().context("an instancer without an array")?);
        Ok(json!({
            "path": &*instancer.prim.path,
            "matrix": matrix(&instancer.prim.transform),
            "positions": array(&instancer.translations)?,
            "orientations": array(&instancer.rotations)?,
            "scales": array(&instancer.scales)?,
            "prototypes": prototypes,
        }))
    }
}

/// As `GfMatrix4d` takes it: rows, for row vectors; these are our columns.
fn matrix(m: &DMat4) -> Vec<f64> {
    m.to_cols_array().to_vec()
}

fn interpolation(interpolation: Interpolation) -> &'static str {
    match interpolation {
        Interpolation::Constant => "constant",
        Interpolation::Uniform => "uniform",
        Interpolation::Varying => "varying",
        Interpolation::Vertex => "vertex",
        Interpolation::FaceVarying => "faceVarying",
        Interpolation::Instance => "instance",
    }
}

fn light(light: &LightDesc) -> Value {
    let angle = match light.kind {
        LightKind::Distant { angle_degrees } => angle_degrees.into(),
        _ => Value::Null,
    };
    json!({
        "path": &*light.prim.path,
        "matrix": matrix(&light.prim.transform),
        "color": light.color,
        "intensity": light.intensity,
        "angle": angle,
    })
}
