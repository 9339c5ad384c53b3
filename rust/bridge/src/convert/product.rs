// SPDX-License-Identifier: Apache-2.0
//! Render products.

use super::request::render_request;
use crate::ffi::{NamedValue, NamingPrimvarDesc, PrimTextsDesc, ProductDesc, ProductVarDesc, ScalarTag};
use oocpt_core::scene::NamingPrimvar;
use oocpt_render::{HeaderValue, ProductVar, RenderProduct, naming_primvar};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Primvars that name what Cryptomatte layers show, by name.
pub(crate) type NamingPrimvars = BTreeMap<String, Arc<NamingPrimvar>>;

/// Those primvars as the renderer takes them.
pub(crate) fn naming_primvars(descs: Vec<NamingPrimvarDesc>) -> NamingPrimvars {
    let named = |NamingPrimvarDesc { name, prims }| {
        let texts = prims.into_iter().map(|PrimTextsDesc { path, texts }| {
            let texts = texts.into_iter().map(Arc::from).collect();
            (Arc::from(path), texts)
        });
        (name, Arc::new(NamingPrimvar { texts: texts.collect() }))
    };
    descs.into_iter().map(named).collect()
}

/// Names of the primvars that name what products show, sorted.
pub(crate) fn names_of_naming(products: &[ProductDesc]) -> Vec<String> {
    let vars = products.iter().flat_map(|product| &product.vars);
    let mut names: Vec<String> = vars.filter_map(|desc| naming_primvar(&var(desc))).collect();
    names.sort_unstable();
    names.dedup();
    names
}

/// A product as the renderer takes it.
pub(crate) fn render_product(desc: ProductDesc, naming: &NamingPrimvars) -> RenderProduct {
    let var_of = |desc: &ProductVarDesc| {
        let var = var(desc);
        ProductVar { naming: naming_primvar(&var).and_then(|name| naming.get(&name).cloned()), ..var }
    };
    RenderProduct {
        picture: (!desc.is_of_host).then(|| render_request(&desc.picture)),
        prim: desc.path,
        kind: desc.kind,
        name: desc.name,
        missing: desc.missing,
        vars: desc.vars.iter().map(var_of).collect(),
        numbers: numbers(&desc.settings),
        settings: texts(&desc.settings),
        color_space: desc.color_space,
        pixel_aspect: desc.pixel_aspect,
        display_size: desc.display_size,
        data_corner: desc.data_corner,
        frame: desc.has_frame.then_some(desc.frame).filter(|frame| frame.is_finite()),
        rate: Some(desc.time_codes_per_second).filter(|rate| rate.is_finite() && *rate > 0.0),
        shutter: desc.shutter,
    }
}

fn var(desc: &ProductVarDesc) -> ProductVar {
    ProductVar {
        prim: desc.path.clone(),
        data_type: desc.data_type.clone(),
        source_name: desc.source_name.clone(),
        source_type: desc.source_type.clone(),
        settings: texts(&desc.settings),
        naming: None,
    }
}

/// Those of the settings that are numbers.
fn numbers(settings: &[NamedValue]) -> Vec<(String, HeaderValue)> {
    let number = |NamedValue { key, value }: &NamedValue| match value.tag {
        ScalarTag::Int => i32::try_from(value.integer).ok().map(|number| (key.clone(), HeaderValue::Whole(number))),
        ScalarTag::Float => Some((key.clone(), HeaderValue::Real(value.real))),
        _ => None,
    };
    settings.iter().filter_map(number).collect()
}

/// Settings as text.
fn texts(settings: &[NamedValue]) -> Vec<(String, String)> {
    let text = |NamedValue { key, value }: &NamedValue| {
        let text = match value.tag {
            ScalarTag::Bool => value.flag.to_string(),
            ScalarTag::Int => value.integer.to_string(),
            ScalarTag::Float => value.real.to_string(),
            _ => value.text.clone(),
        };
        (key.clone(), text)
    };
    settings.iter().map(text).collect()
}
