// SPDX-License-Identifier: Apache-2.0
//! Text from files, as it is shown.

/// Longest text, characters.
const MAX_TEXT: usize = 200;

/// Text from a file without control characters and marks that turn the direction of writing, and not too long.
pub(super) fn clean(text: &str) -> String {
    let is_shown = |c: &char| {
        !c.is_control()
            && !matches!(c, '\u{200B}'..='\u{200F}' | '\u{2028}'..='\u{202E}' | '\u{2060}'..='\u{2069}' | '\u{FEFF}')
    };
    let mut shown: String = text.chars().filter(is_shown).take(MAX_TEXT + 1).collect();
    if shown.chars().count() > MAX_TEXT {
        shown = shown.chars().take(MAX_TEXT).chain(['…']).collect();
    }
    shown
}
