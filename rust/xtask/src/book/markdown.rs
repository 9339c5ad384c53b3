// SPDX-License-Identifier: Apache-2.0
//! As much of Markdown as the checks need: paragraphs outside of fenced code, code spans, link targets, headings.
//!
//! Pure. HTML comments and indented code count as text; the documents have neither links nor paths there.

/// Consecutive lines outside of fenced code, joined by blanks, with the number of the first one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Paragraph {
    pub(super) line: usize,
    pub(super) text: String,
}

/// All paragraphs; a row of a table, a heading and an item of a list are paragraphs of their own.
pub(super) fn paragraphs(text: &str) -> Vec<Paragraph> {
    let mut found: Vec<Paragraph> = Vec::new();
    let mut goes_on = false;
    for (line, content) in prose(text) {
        let trimmed = content.trim();
        let begins = trimmed.starts_with(['|', '#', '!']) || trimmed.starts_with("- ");
        if trimmed.is_empty() {
            goes_on = false;
            continue;
        }
        match found.last_mut().filter(|_| goes_on && !begins) {
            Some(paragraph) => {
                paragraph.text.push(' ');
                paragraph.text.push_str(trimmed);
            }
            None => found.push(Paragraph { line, text: trimmed.to_owned() }),
        }
        goes_on = !trimmed.starts_with(['|', '#']);
    }
    found
}

/// Lines outside of fenced code, with their numbers; a fence ends a paragraph, so it stands for an empty line.
fn prose(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let mut is_code = false;
    (1..).zip(text.lines()).filter_map(move |(number, line)| {
        if line.trim_start().starts_with("```") {
            is_code = !is_code;
            return Some((number, ""));
        }
        (!is_code).then_some((number, line))
    })
}

/// Lines of blocks marked `sh`, with their numbers; those that a backslash continues are one.
pub(super) fn shell_lines(text: &str) -> Vec<(usize, String)> {
    let mut found: Vec<(usize, String)> = Vec::new();
    let mut is_shell = false;
    let mut goes_on = false;
    for (number, line) in (1..).zip(text.lines()) {
        let trimmed = line.trim();
        if let Some(language) = trimmed.strip_prefix("```") {
            is_shell = language == "sh";
            goes_on = false;
        } else if is_shell && !trimmed.is_empty() {
            let content = trimmed.trim_end_matches('\\').trim_end();
            match found.last_mut().filter(|_| goes_on) {
                Some((_, command)) => {
                    command.push(' ');
                    command.push_str(content);
                }
                None => found.push((number, content.to_owned())),
            }
            goes_on = trimmed.ends_with('\\');
        }
    }
    found
}

/// The texts between single backticks.
pub(super) fn code_spans(paragraph: &str) -> impl Iterator<Item = &str> {
    paragraph.split('`').skip(1).step_by(2)
}

/// Targets of links and pictures, outside of code spans.
pub(super) fn targets(paragraph: &str) -> Vec<String> {
    let outside: String = paragraph.split('`').step_by(2).collect::<Vec<_>>().join("`");
    let starts = outside.match_indices("](").map(|(at, mark)| at + mark.len());
    starts.filter_map(|at| outside[at..].split_once(')')).map(|(target, _)| target.trim().to_owned()).collect()
}

/// The anchors that mdBook and GitHub make of a page's headings.
pub(super) fn anchors(text: &str) -> Vec<String> {
    let mut found: Vec<String> = Vec::new();
    for (_, line) in prose(text) {
        let Some(heading) = line.strip_prefix('#').map(|rest| rest.trim_start_matches('#')) else {
            continue;
        };
        let kept = heading.trim().chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
        let slug: String = kept.map(|c| if c == ' ' { '-' } else { c.to_ascii_lowercase() }).collect();
        let before = found.iter().filter(|other| **other == slug).count();
        found.push(if before == 0 { slug } else { format!("{slug}-{before}") });
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paragraphs_leave_fenced_code_out() {
        let found = paragraphs("# A\none `b\nc` [d](e)\n```sh\n[no](no)\n```\n- x\n- y\n| r |\n| s |\n");
        let texts: Vec<(usize, &str)> = found.iter().map(|p| (p.line, p.text.as_str())).collect();
        let expected = [(1, "# A"), (2, "one `b c` [d](e)"), (7, "- x"), (8, "- y"), (9, "| r |"), (10, "| s |")];
        assert_eq!(texts, expected, "paragraphs");
        assert_eq!(code_spans(&found[1].text).collect::<Vec<_>>(), ["b c"], "a span over two lines");
        assert_eq!(targets(&found[1].text), ["e"], "a link");
        assert_eq!(targets("`[a](b)` ![c](d.png) [e](f#g)"), ["d.png", "f#g"], "not in code");
    }

    #[test]
    fn commands_are_lines_of_shell_blocks() {
        let text = "a\n```sh\nb \\\n    c\n\nd\n```\n```text\ne\n```\n  ```sh\n  f\n  ```\n";
        let expected = [(3, "b c"), (6, "d"), (12, "f")].map(|(line, command)| (line, command.to_owned()));
        assert_eq!(shell_lines(text), expected, "blocks of shell, also indented");
    }

    #[test]
    fn anchors_are_those_of_mdbook() {
        let text = "# How it works: `a` & b\n## Same\n## Same\n```\n# code\n```\n";
        assert_eq!(anchors(text), ["how-it-works-a--b", "same", "same-1"], "headings");
    }
}
