// SPDX-License-Identifier: Apache-2.0
//! Reads apt's source lists (one-line and deb822 form) to find the mirror this machine already uses for a suite.

/// The first URI in `list` (the text of a `.list` or `.sources` file) that serves the component `main` of `suite`.
pub(super) fn mirror_of(list: &str, suite: &str) -> Option<String> {
    one_line_mirror(list, suite).or_else(|| deb822_mirror(list, suite))
}

/// `deb [options] URI SUITE COMPONENT...`
fn one_line_mirror(list: &str, suite: &str) -> Option<String> {
    list.lines().find_map(|line| {
        let line = line.split('#').next()?.trim().strip_prefix("deb ")?.trim();
        let line = match line.strip_prefix('[') {
            Some(rest) => rest.split_once(']')?.1,
            None => line,
        };
        let mut words = line.split_whitespace();
        let (uri, found) = (words.next()?, words.next()?);
        (found == suite && words.any(|component| component == "main")).then(|| uri.to_owned())
    })
}

/// Stanzas of `Field: words`, continued by indented lines, parted by empty lines.
fn deb822_mirror(list: &str, suite: &str) -> Option<String> {
    let lines: Vec<&str> = list.lines().filter(|line| !line.starts_with('#')).collect();
    lines.split(|line| line.trim().is_empty()).find_map(|stanza| {
        let enabled = !field(stanza, "Enabled").iter().any(|word| word.eq_ignore_ascii_case("no"));
        let serves = |name: &str, word: &str| field(stanza, name).contains(&word);
        if enabled && serves("Types", "deb") && serves("Suites", suite) && serves("Components", "main") {
            field(stanza, "URIs").first().map(|uri| (*uri).to_owned())
        } else {
            None
        }
    })
}

fn field<'list>(stanza: &[&'list str], name: &str) -> Vec<&'list str> {
    let is_field = |line: &&&str| line.split_once(':').is_some_and(|(key, _)| key.trim().eq_ignore_ascii_case(name));
    let Some(start) = stanza.iter().position(|line| is_field(&line)) else {
        return Vec::new();
    };
    let first = stanza[start].split_once(':').map(|(_, words)| words).unwrap_or_default();
    let continued = stanza[start + 1..].iter().take_while(|line| line.starts_with([' ', '\t']));
    std::iter::once(first).chain(continued.copied()).flat_map(str::split_whitespace).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_line_lists() {
        let list = "# deb http://old/debian bookworm main\n\
                    deb http://security/debian bookworm-security main\n\
                    deb [arch=amd64 signed-by=/k.gpg] http://mirror/debian bookworm main contrib # ours\n";
        assert_eq!(mirror_of(list, "bookworm").as_deref(), Some("http://mirror/debian"), "options are skipped");
        assert_eq!(mirror_of(list, "bookworm-backports"), None, "no such suite");
        assert_eq!(mirror_of("deb http://m/debian bookworm contrib", "bookworm"), None, "not main");
    }

    #[test]
    fn deb822_stanzas() {
        let list = "Types: deb deb-src\n# URIs: http://commented/debian\nURIs: http://mirror/debian\n\
                    Suites: bookworm\n bookworm-updates\nComponents: main\n\n\
                    Types: deb\nURIs: http://off/debian\nSuites: trixie\nComponents: main\nEnabled: no\n";
        assert_eq!(mirror_of(list, "bookworm").as_deref(), Some("http://mirror/debian"), "first stanza");
        assert_eq!(mirror_of(list, "bookworm-updates").as_deref(), Some("http://mirror/debian"), "continued field");
        assert_eq!(mirror_of(list, "trixie"), None, "a disabled stanza does not count");
        assert_eq!(mirror_of("", "bookworm"), None, "an empty file");
    }
}
