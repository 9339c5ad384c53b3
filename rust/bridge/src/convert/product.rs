// SPDX-License-Identifier: Apache-2.0
//! Render products.

use super::request::render_request;
use crate::ffi::{NamedValue, ProductDesc, ProductVarDesc, ScalarTag};
use oocpt_render::{HeaderValue, ProductVar, RenderProduct};

/// A product as the renderer takes it.
pub(crate) fn render_product(desc: ProductDesc) -> RenderProduct {
    RenderProduct {
        picture: (!desc.is_of_host).then(|| render_request(&desc.picture)),
        prim: desc.path,
        kind: desc.kind,
        name: desc.name,
        vars: desc.vars.into_iter().map(var).collect(),
        numbers: numbers(&desc.settings),
        settings: texts(desc.settings),
        color_space: desc.color_space,
        pixel_aspect: desc.pixel_aspect,
        display_size: desc.display_size,
        data_corner: desc.data_corner,
        frame: desc.has_frame.then_some(desc.frame).filter(|frame| frame.is_finite()),
    }
}

fn var(desc: ProductVarDesc) -> ProductVar {
    ProductVar {
        prim: desc.path,
        data_type: desc.data_type,
        source_name: desc.source_name,
        source_type: desc.source_type,
        settings: texts(desc.settings),
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
fn texts(settings: Vec<NamedValue>) -> Vec<(String, String)> {
    let text = |NamedValue { key, value }: NamedValue| {
        let text = match value.tag {
            ScalarTag::Bool => value.flag.to_string(),
            ScalarTag::Int => value.integer.to_string(),
            ScalarTag::Float => value.real.to_string(),
            _ => value.text,
        };
        (key, text)
    };
    settings.into_iter().map(text).collect()
}
