// SPDX-License-Identifier: Apache-2.0
//! Placeholders for the number of the frame in the names of products: `<F4>` and `<F>` (Katana, `RenderMan`), `$F4` and
//! `$F` (Houdini), `####`. Pure.

/// Most digits of a placeholder.
const MAX_DIGITS: usize = 16;

/// The name for a frame; `None` if it has a placeholder, and no frame is known.
pub(super) fn resolve(name: &str, frame: Option<f64>) -> Option<String> {
    let mut resolved = String::with_capacity(name.len());
    let mut rest = name;
    while let Some(next) = rest.chars().next() {
        if let Some((digits, length)) = placeholder(rest) {
            resolved.push_str(&number(frame?, digits));
            rest = &rest[length..];
        } else {
            resolved.push(next);
            rest = &rest[next.len_utf8()..];
        }
    }
    Some(resolved)
}

/// Digits and bytes of the placeholder with which `text` begins.
fn placeholder(text: &str) -> Option<(usize, usize)> {
    let hashes = text.bytes().take_while(|byte| *byte == b'#').count();
    if hashes > 0 {
        return Some((hashes.min(MAX_DIGITS), hashes));
    }
    let (start, end) = if text.starts_with("<F") { ("<F", ">") } else { ("$F", "") };
    let tail = text.strip_prefix(start)?;
    let count = tail.bytes().take_while(u8::is_ascii_digit).count();
    let digits = if count == 0 { 1 } else { tail[..count].parse().ok().filter(|digits| *digits <= MAX_DIGITS)? };
    let is_over = if end.is_empty() {
        // `$FF` and `$FOO` are other variables.
        !tail[count..].starts_with(|next: char| next.is_alphanumeric() || next == '_')
    } else {
        tail[count..].starts_with(end)
    };
    is_over.then_some((digits, start.len() + count + end.len()))
}

/// A whole frame in so many digits, others with what is behind the point.
fn number(frame: f64, digits: usize) -> String {
    let whole = frame.trunc();
    let sign = if frame < 0.0 { "-" } else { "" };
    let text = format!("{sign}{:0digits$}", whole.abs());
    let part = (frame - whole).abs();
    if part < 5e-4 { text } else { format!("{text}{}", format!("{part:.3}").trim_start_matches('0')) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn placeholders_become_the_number_of_the_frame() {
        let at = |name: &str, frame: f64| resolve(name, Some(frame)).expect("a frame is known");
        for name in ["a.<F4>.exr", "a.####.exr", "a.$F4.exr"] {
            assert_eq!(at(name, 7.0), "a.0007.exr", "{name}");
            assert_eq!(at(name, 12345.0), "a.12345.exr", "{name}");
            assert_eq!(at(name, -7.0), "a.-0007.exr", "{name}");
            assert_eq!(at(name, 7.25), "a.0007.250.exr", "{name}");
        }
        assert_eq!(at("<F>/$F.#", 3.0), "3/3.3");
        assert_eq!(at("$FF.$F_a.<F4.<Fx>.<F99>", 3.0), "$FF.$F_a.<F4.<Fx>.<F99>", "none of them");
        assert_eq!(at("ü<F2>€", 3.0), "ü03€");
    }

    #[test]
    fn a_placeholder_needs_a_frame() {
        assert_eq!(resolve("a.<F4>.exr", None), None);
        assert_eq!(resolve("a.exr", None), Some("a.exr".to_owned()));
    }
}
