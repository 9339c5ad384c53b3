// SPDX-License-Identifier: Apache-2.0
//! What is known of a file, in words.

use super::host::TextureAnswer;

/// Bytes as MiB.
#[expect(clippy::cast_precision_loss, reason = "sizes are shown, not computed with")]
pub(super) fn mib(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}

/// Some lines.
pub(super) fn describe(answer: &TextureAnswer) -> String {
    let plain = |text: &str| -> String { text.chars().filter(|c| !c.is_control()).collect() };
    let TextureAnswer { size, levels, channels, format, .. } = answer;
    let head = plain(&answer.file);
    if let Some(error) = &answer.error {
        return format!("{head}\n    error         {}\n", plain(error));
    }
    let kind = if answer.is_tiled { "tiled" } else { "not tiled" };
    let color = if answer.is_srgb { "sRGB" } else { "linear" };
    let size = match answer.faces {
        Some(faces) => format!("Ptex, faces: {faces}"),
        None => format!("{} x {}, levels: {levels}, {kind}", size[0], size[1]),
    };
    let mut lines = vec![
        ("size", size),
        ("texels", format!("{} channels of {format}", channels)),
        ("color space", format!("{color}: {} (sourceColorSpace {})", plain(&answer.why), plain(&answer.space))),
        ("cache", state(answer)),
    ];
    if !answer.cache.key.is_empty() && !answer.is_direct {
        lines.push(("key", plain(&answer.cache.key)));
        lines.push(("entry", plain(&answer.cache.path)));
    }
    let lines: String = lines.iter().map(|(label, value)| format!("    {label:<14}{value}\n")).collect();
    format!("{head}\n{lines}")
}

fn state(answer: &TextureAnswer) -> String {
    let cache = &answer.cache;
    match (answer.is_direct, cache.bytes, cache.first_level) {
        (true, ..) => "not needed: the file is read as it is".into(),
        (_, Some(bytes), Some(0)) => format!("all levels, {}", mib(bytes)),
        (_, Some(bytes), level) => format!("from level {} on, {}", level.unwrap_or(0), mib(bytes)),
        (_, None, _) if cache.key.is_empty() => "turned off, or nothing tells the file from others".into(),
        _ => "nothing yet".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::host::CachedTexture;
    use super::*;

    #[test]
    fn a_file_report_is_written_as_text() {
        let answer = TextureAnswer {
            file: "/a\u{1b}.png".into(),
            space: "auto".into(),
            size: [8, 4],
            levels: 1,
            channels: 3,
            format: "u8".into(),
            is_srgb: true,
            why: "the file says sRGB".into(),
            cache: CachedTexture {
                key: "k".into(),
                path: "/c/x.tx".into(),
                bytes: Some(3 << 20),
                first_level: Some(0),
            },
            ..TextureAnswer::default()
        };
        let text = describe(&answer);
        let expected = "/a.png\n    size          8 x 4, levels: 1, not tiled\n    texels        3 channels of \
        u8\n    color space   sRGB: the file says sRGB \
                        (sourceColorSpace auto)\n    cache         all levels, 3.0 MiB\n    key           k\n    \
                        entry         /c/x.tx\n";
        assert_eq!(text, expected, "without control characters");
        let with = |cache: CachedTexture| state(&TextureAnswer { cache, ..answer.clone() });
        assert_eq!(
            with(CachedTexture { bytes: None, first_level: None, ..answer.cache.clone() }),
            "nothing yet",
            "no entry"
        );
        assert_eq!(
            with(CachedTexture { first_level: Some(2), ..answer.cache.clone() }),
            "from level 2 on, 3.0 MiB",
            "a part"
        );
        assert!(with(CachedTexture::default()).starts_with("turned off"), "no cache");
        assert!(state(&TextureAnswer { is_direct: true, ..answer.clone() }).starts_with("not needed"), "tiled");
        let ptex = describe(&TextureAnswer { faces: Some(30), ..answer.clone() });
        assert!(ptex.contains("size          Ptex, faces: 30\n"), "faces have sizes of their own: {ptex}");
        assert!(describe(&TextureAnswer::failed("/b", "is\nbad")).contains("error         isbad"), "one line");
    }
}
