// SPDX-License-Identifier: Apache-2.0
//! Primvars at the points of cut curves. Pure.

use super::curves::CutCurves;
use crate::desc::{DroppedData, Interpolation, MeshDesc, NamedPrimvar, Primvar};
use crate::mesh::WantedPrimvar;
use crate::mesh::refine_values::{by_point, primvar_of};

/// `desc` with values at the points of the cut, each `times` times.
pub(super) fn on_curves(
    desc: &MeshDesc,
    wanted: &[WantedPrimvar],
    cut: &CutCurves,
    times: usize,
    dropped: &mut DroppedData,
) -> MeshDesc {
    let mut on_cut = |primvar: &Primvar| match primvar.interpolation {
        Interpolation::Constant | Interpolation::Uniform | Interpolation::Instance => Some(primvar.clone()),
        Interpolation::Vertex | Interpolation::Varying | Interpolation::FaceVarying => {
            let Some((width, floats)) = on_points(primvar, desc, cut, dropped) else {
                dropped.primvars += 1;
                return None;
            };
            let repeated =
                floats.chunks_exact(width).flat_map(|value| (0..times).flat_map(move |_| value.iter().copied()));
            Some(primvar_of(width, repeated.collect()))
        }
    };
    let mut out = MeshDesc { normals: None, primvars: Vec::new(), ..desc.clone() };
    out.display_color = desc.display_color.as_ref().and_then(&mut on_cut);
    out.display_opacity = desc.display_opacity.as_ref().and_then(&mut on_cut);
    for named in &desc.primvars {
        if wanted.iter().any(|wanted| wanted.name == named.name)
            && let Some(primvar) = on_cut(&named.primvar)
        {
            out.primvars.push(NamedPrimvar { name: named.name.clone(), primvar });
        }
    }
    out
}

/// Width and values of a primvar at each point of the cut; `None` where it cannot be used.
pub(super) fn on_points(
    primvar: &Primvar,
    desc: &MeshDesc,
    cut: &CutCurves,
    dropped: &mut DroppedData,
) -> Option<(usize, Vec<f32>)> {
    let count = match primvar.interpolation {
        Interpolation::Constant | Interpolation::Instance => 1,
        Interpolation::Uniform => cut.curve_count,
        Interpolation::Vertex => desc.points.len(),
        Interpolation::Varying | Interpolation::FaceVarying => cut.varying_count,
    };
    let (width, floats) = by_point(primvar, count, dropped)?;
    let value = |at: u32| floats.get(at as usize * width..(at as usize + 1) * width).unwrap_or_default();
    let mut out = Vec::with_capacity(cut.points.len() * width);
    for (stencil, &curve) in cut.stencils.iter().zip(&cut.curves) {
        let start = out.len();
        out.resize(start + width, 0.0);
        let mut add = |at: u32, weight: f32| {
            out.iter_mut().skip(start).zip(value(at)).for_each(|(sum, value)| *sum += weight * value);
        };
        match primvar.interpolation {
            Interpolation::Constant | Interpolation::Instance => add(0, 1.0),
            Interpolation::Uniform => add(curve, 1.0),
            Interpolation::Vertex => {
                // A weight of 0 takes nothing from a value that is no number.
                stencil.vertex.into_iter().filter(|(_, weight)| *weight != 0.0).for_each(|(at, w)| add(at, w));
            }
            Interpolation::Varying | Interpolation::FaceVarying => {
                let [first, second] = stencil.varying;
                add(first, 1.0 - stencil.along);
                add(second, stencil.along);
            }
        }
    }
    Some((width, out))
}
