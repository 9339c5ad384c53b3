// SPDX-License-Identifier: Apache-2.0
//! What the sources define: identifiers, functions, keys of settings and statistics. Pure.
//!
//! A scan by lines and words, not a parser. It takes more for a definition than is one (a call that begins a line looks
//! like a variant), never less: a name that is in no source is found, and nothing that is there is refused.

use std::collections::HashSet;

/// A file of the clone with its text.
pub(in crate::book) type FileText = (String, String);

/// Words before a name that they define.
const DEFINES: &[&str] = &[
    "class",
    "concept",
    "const",
    "constexpr",
    "def",
    "define",
    "enum",
    "fn",
    "macro_rules",
    "mod",
    "namespace",
    "static",
    "struct",
    "trait",
    "type",
    "union",
    "using",
];
/// Those of them that define what is called.
const DEFINES_CALLS: &[&str] = &["def", "define", "fn", "macro_rules"];
/// Words of C++ and GLSL that stand before a call and are no type.
const NO_TYPES: &[&str] =
    &["and", "case", "co_return", "delete", "else", "goto", "new", "not", "or", "return", "throw"];

/// Names that one source holds, comments left out.
#[derive(Debug, Default)]
struct SourceNames {
    /// With the folders that the file lies in, which are modules.
    words: HashSet<String>,
    defined: HashSet<String>,
    calls: HashSet<String>,
}

/// Names that the sources hold.
#[derive(Debug, Default)]
pub(super) struct SourceIndex {
    files: Vec<SourceNames>,
    keys: HashSet<String>,
}

impl SourceIndex {
    /// Reads all `files` that are sources.
    pub(super) fn new(files: &[FileText]) -> Self {
        let mut sources = Self::default();
        for (file, text) in files {
            sources.add(file, text);
        }
        sources
    }

    /// Whether `name` occurs outside of comments.
    pub(super) fn has_word(&self, name: &str) -> bool {
        self.files.iter().any(|file| file.words.contains(name))
    }

    /// Whether something is defined as `name`: an item, a field, a variant, a file.
    pub(super) fn defines(&self, name: &str) -> bool {
        self.files.iter().any(|file| file.defined.contains(name))
    }

    /// Whether `name` is defined where there is something called `owner`, the file's own modules included.
    pub(super) fn defines_in(&self, owner: &str, name: &str) -> bool {
        self.files.iter().any(|file| file.defined.contains(name) && file.words.contains(owner))
    }

    /// Whether a function or a macro is defined as `name`.
    pub(super) fn defines_call(&self, name: &str) -> bool {
        self.files.iter().any(|file| file.calls.contains(name))
    }

    /// Whether `name` is a key below `oocpt:` of the shipped sources; `*` at the end stands for any rest.
    pub(super) fn has_key(&self, name: &str) -> bool {
        match name.strip_suffix('*') {
            Some(start) => self.keys.iter().any(|key| key.starts_with(start)),
            None => self.keys.contains(name),
        }
    }

    fn add(&mut self, file: &str, text: &str) {
        if is_shipped(file) {
            self.keys.extend(keys(shipped_part(text)));
        }
        let language = CommentStyle::of(file);
        let mut source = SourceNames::default();
        source.defined.extend(names_of_file(file));
        source.words.extend(file.split(['/', '.']).map(str::to_owned));
        source.words.extend(names_of_file(file));
        for line in text.lines() {
            source.add_line(language, language.without_comment(line));
        }
        self.files.push(source);
    }
}

impl SourceNames {
    fn add_line(&mut self, language: CommentStyle, line: &str) {
        let found = words(line);
        let is_exported = language == CommentStyle::Rust && line.trim_start().starts_with("pub use ");
        for (index, &(at, word)) in found.iter().enumerate() {
            let rest = line[at + word.len()..].trim_start();
            let before = index.checked_sub(1).map(|i| found[i]);
            let between = before.map_or("", |(start, previous)| line[start + previous.len()..at].trim());
            let previous = before.map_or("", |(_, previous)| previous);
            let is_after = |words: &[&str]| matches!(between, "" | "!") && words.contains(&previous);
            let is_c = language == CommentStyle::C && matches!(between, "" | "*" | "&" | ">" | "&&");
            let is_typed = is_c && !previous.is_empty() && !NO_TYPES.contains(&previous);
            if is_after(DEFINES_CALLS) || is_typed && rest.starts_with('(') {
                self.calls.insert(word.to_owned());
            }
            let is_first = is_visibility(line[..at].trim()) && begins_definition(rest);
            if is_exported || is_after(DEFINES) || is_first || is_typed && begins_definition(rest) {
                self.defined.insert(word.to_owned());
            }
            if !self.words.contains(word) {
                self.words.insert(word.to_owned());
            }
        }
    }
}

/// How comments begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum CommentStyle {
    Rust,
    /// C++ and GLSL.
    C,
    /// Python, shell, TOML and the like.
    Hash,
}

impl CommentStyle {
    fn of(file: &str) -> Self {
        match file.rsplit_once('.').map(|(_, extension)| extension) {
            Some("rs") => Self::Rust,
            Some("h" | "cpp" | "comp" | "glsl") => Self::C,
            _ => Self::Hash,
        }
    }

    fn without_comment(self, line: &str) -> &str {
        if self == Self::Hash {
            return if line.trim_start().starts_with('#') { "" } else { line.split(" # ").next().unwrap_or(line) };
        }
        // An address has the same two slashes.
        let begin = line.match_indices("//").find(|(at, _)| !line[..*at].ends_with(':'));
        begin.map_or(line, |(at, _)| &line[..at])
    }
}

/// Whether the file is what this check reads for names.
pub(in crate::book) fn is_source(file: &str) -> bool {
    // The check's own tests hold names that are nowhere.
    let is_check = file.starts_with("rust/xtask/src/book/");
    let ends = [".rs", ".h", ".cpp", ".comp", ".glsl", ".py", ".toml", ".cmake", ".in", "CMakeLists.txt"];
    let others = ["plugin/", ".ci/"];
    !is_check && (ends.iter().any(|end| file.ends_with(end)) || others.iter().any(|folder| file.starts_with(folder)))
}

/// Whether people get what is compiled from the file.
fn is_shipped(file: &str) -> bool {
    let is_below = ["rust/", "cpp/", "plugin/"].iter().any(|folder| file.starts_with(folder));
    is_below && !file.split('/').any(|part| part == "tests" || part == "tests.rs" || part.ends_with("_tests.rs"))
}

fn shipped_part(text: &str) -> &str {
    text.split("#[cfg(test)]").next().unwrap_or(text)
}

/// Keys in quotes or backquotes: `"oocpt:seed"`.
fn keys(text: &str) -> impl Iterator<Item = String> {
    text.split("\"oocpt:").skip(1).filter_map(|rest| {
        let end = rest.find(|c: char| !c.is_ascii_alphanumeric())?;
        Some(rest[..end].to_owned()).filter(|key| !key.is_empty() && rest[end..].starts_with('"'))
    })
}

/// The module, crate or program that a file is.
fn names_of_file(file: &str) -> Vec<String> {
    let mut parts = file.rsplit('/');
    let name = parts.next().unwrap_or(file);
    let stem = name.split_once('.').map_or(name, |(stem, _)| stem);
    let folder = parts.find(|part| *part != "src").unwrap_or("");
    match stem {
        "mod" => vec![folder.to_owned()],
        "lib" | "main" => vec![folder.to_owned(), format!("oocpt_{folder}")],
        stem => vec![stem.to_owned()],
    }
}

fn is_visibility(text: &str) -> bool {
    text.is_empty() || text == "pub" || text.starts_with("pub(") && text.ends_with(')')
}

fn begins_definition(rest: &str) -> bool {
    rest.is_empty() || rest.starts_with([',', ':', '(', '{', '=', ';', '['])
}

/// Identifiers with where they begin.
pub(super) fn words(line: &str) -> Vec<(usize, &str)> {
    let is_part = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let mut found = Vec::new();
    let mut from = 0;
    while let Some(at) = line[from..].find(is_part).map(|at| from + at) {
        let end = line[at..].find(|c| !is_part(c)).map_or(line.len(), |length| at + length);
        if !line[at..].starts_with(|c: char| c.is_ascii_digit()) {
            found.push((at, &line[at..end]));
        }
        from = end;
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sources(file: &str, text: &str) -> SourceIndex {
        SourceIndex::new(&[(file.to_owned(), text.to_owned())])
    }

    #[test]
    fn rust_defines_items_fields_and_variants() {
        let text = "pub fn walk(a: u32) {}\n// fn gone() {}\nenum Kind {\n    Ball,\n    Tube { r: f32 },\n}\n\
                    struct S {\n    pub(super) side: f32,\n}\nmacro_rules! rows { () => {} }\n\
                    pub use made::{checks};\n";
        let found = sources("rust/core/src/mesh/mod.rs", text);
        for name in ["walk", "Kind", "Ball", "Tube", "S", "side", "rows", "mesh", "checks"] {
            assert!(found.defines(name), "{name} is defined");
        }
        assert!(found.defines_call("walk") && found.defines_call("rows"), "functions and macros are called");
        assert!(!found.defines_call("Kind"), "a type is no function");
        assert!(found.defines_in("Kind", "Ball") && found.defines_in("mesh", "walk"), "by type and by module");
        assert!(!found.defines_in("Other", "walk"), "nothing of the kind is there");
        assert!(!found.defines("gone") && !found.has_word("gone"), "what a comment names is not there");
    }

    #[test]
    fn shaders_and_python_define_functions() {
        let shader = sources("shaders/math/a.glsl", "vec3 bend(vec3 v) {\n    return call(v);\n}\nconst uint N = 1;\n");
        assert!(shader.defines_call("bend") && shader.defines("N") && shader.defines("a"), "GLSL");
        assert!(!shader.defines_call("call"), "what is returned is a call");
        let python = sources("tests/a.py", "def draw(x):\n    pass  # old_draw()\n");
        assert!(python.defines_call("draw") && !python.has_word("old_draw"), "Python");
    }

    #[test]
    fn keys_are_those_of_shipped_code() {
        let text = "row(\"oocpt:seed\");\nrow(\"oocpt:seed ...\");\n#[cfg(test)]\nmod tests { \"oocpt:planted\" }\n";
        let found = sources("rust/core/src/settings.rs", text);
        assert!(found.has_key("seed") && found.has_key("se*"), "a key, by its name and by its beginning");
        assert!(!found.has_key("planted") && !found.has_key("x*"), "a test's key is none");
        assert!(!sources("tests/hydra/a.py", "\"oocpt:other\"").has_key("other"), "a test's file has none");
    }

    #[test]
    fn crates_have_the_names_of_their_folders() {
        assert!(sources("rust/core/src/lib.rs", "").defines("oocpt_core"), "a crate");
        assert!(sources("rust/core/src/scene.rs", "").defines("scene"), "a module");
    }
}
