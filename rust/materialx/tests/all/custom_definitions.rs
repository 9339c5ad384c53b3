// SPDX-License-Identifier: Apache-2.0
//! Definitions of one's own beside the data libraries: graphs, namespaces, files, circles, what has no graph.

use std::fs;
use std::path::PathBuf;

use oocpt_materialx::library::{MAX_FILE_BYTES, NodeLibrary};
use oocpt_materialx::network::{Network, NetworkNode};
use oocpt_materialx::surface::Input;
use oocpt_materialx::value::PortValue;
use oocpt_materialx::{InputSource, TranslatedNetwork, translate};

use crate::support::{file, node, source, vector};

/// Where the data libraries of the tests are.
fn standard() -> PathBuf {
    let home = || PathBuf::from(std::env::var_os("HOME").expect("a home")).join(".cache/oocpt/host-25.08");
    let host = std::env::var_os("OOCPT_HOST_ROOT").map_or_else(home, PathBuf::from);
    host.join("python/bpy/lib/materialx/libraries")
}

/// A folder of one's own, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str, files: &[(&str, &str)]) -> Self {
        let folder = std::env::temp_dir().join(format!("oocpt-custom-{name}-{}", std::process::id()));
        fs::create_dir_all(&folder).expect("a folder");
        for (name, text) in files {
            fs::write(folder.join(name), text).expect("a file");
        }
        Self(folder)
    }

    fn library(&self) -> NodeLibrary {
        NodeLibrary::read_with(&[standard()], std::slice::from_ref(&self.0))
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // What is left lies in the folder for temporary files.
        drop(fs::remove_dir_all(&self.0));
    }
}

fn translated_with(library: &NodeLibrary, nodes: Vec<NetworkNode>) -> TranslatedNetwork {
    translate(&Network { nodes, ..Network::default() }, library)
}

/// The base colour that a node of this kind gives.
fn color_of(library: &NodeLibrary, kind: &str, values: &[(&str, PortValue)], output: &str) -> TranslatedNetwork {
    let mut surface = node("ND_standard_surface_surfaceshader", &[("base", PortValue::Numbers([1.0; 4]))], &[]);
    surface.connections.push(("base_color".into(), 1, output.into()));
    translated_with(library, vec![surface, node(kind, values, &[])])
}

fn color(translation: &TranslatedNetwork) -> [f32; 3] {
    match source(translation, Input::DiffuseColor) {
        InputSource::Constant([r, g, b, _]) => [r, g, b],
        other => panic!("{other:?}"),
    }
}

const TWO: &str = r#"<?xml version="1.0"?>
<materialx version="1.38" namespace="mine">
  <xi:include href="other.mtlx" />
  <nodedef name="ND_half_color3" node="half">
    <input name="in" type="color3" value="1, 1, 1" />
    <output name="out" type="color3" />
  </nodedef>
  <nodegraph name="NG_half" nodedef="ND_half_color3">
    <multiply name="m" type="color3">
      <input name="in1" type="color3" interfacename="in" />
      <input name="in2" type="float" value="0.5" />
    </multiply>
    <output name="out" type="color3" nodename="m" />
  </nodegraph>
  <nodedef name="ND_quarter_color3" node="quarter">
    <input name="in" type="color3" value="1, 1, 1" />
    <output name="first" type="color3" />
    <output name="second" type="color3" />
  </nodedef>
  <nodegraph name="NG_quarter" nodedef="ND_quarter_color3">
    <half name="a" type="color3"><input name="in" type="color3" interfacename="in" /></half>
    <half name="b" type="color3"><input name="in" type="color3" nodename="a" /></half>
    <output name="first" type="color3" nodename="a" />
    <output name="second" type="color3" nodename="b" />
  </nodegraph>
</materialx>"#;

#[test]
fn namespaced_nodegraphs_become_nodes() {
    let folder = Folder::new("namespace", &[("two.mtlx", TWO)]);
    let library = folder.library();
    assert!(library.problems().is_empty(), "{:?}", library.problems());
    let given = [("in", vector(0.8, 0.4, 0.2))];
    for (kind, output, expected) in [
        ("mine:ND_half_color3", "out", [0.4, 0.2, 0.1]),
        ("mine:ND_quarter_color3", "first", [0.4, 0.2, 0.1]),
        ("mine:ND_quarter_color3", "second", [0.2, 0.1, 0.05]),
    ] {
        let translation = color_of(&library, kind, &given, output);
        assert_eq!(translation.problems, Vec::<String>::new(), "{kind}");
        assert_eq!(color(&translation), expected, "{kind}.{output}");
    }
    let default = color_of(&library, "mine:ND_half_color3", &[], "out");
    assert_eq!(color(&default), [0.5; 3], "its own default");
    assert!(library.definition("ND_half_color3").is_none(), "only in its namespace");
}

#[test]
fn a_custom_definition_overrides_a_library_one() {
    let text = TWO.replace(" namespace=\"mine\"", "").replace("ND_half_color3", "ND_saturate_color3");
    let folder = Folder::new("instead", &[("two.mtlx", &text)]);
    let translation = color_of(&folder.library(), "ND_saturate_color3", &[("in", vector(0.8, 0.4, 0.2))], "out");
    assert_eq!(color(&translation), [0.4, 0.2, 0.1]);
}

/// A surface shader whose graph reads files: one of the network, with the colour space that the graph says, and one
/// that lies beside the definition.
#[test]
fn graphs_of_surfaces_read_files() {
    let text = r#"<materialx version="1.38">
      <nodedef name="ND_mine" node="mine" version="1.0.0" isdefaultversion="true">
        <input name="color_file" type="filename" value="" />
        <input name="rough_file" type="filename" value="own/rough.png" />
        <output name="out" type="surfaceshader" />
      </nodedef>
      <nodegraph name="IMPL_mine" nodedef="ND_mine">
        <tiledimage name="c" type="color3" colorspace="srgb_texture">
          <input name="file" type="filename" interfacename="color_file" />
        </tiledimage>
        <image name="r" type="float"><input name="file" type="filename" interfacename="rough_file" /></image>
        <standard_surface name="s" type="surfaceshader">
          <input name="base" type="float" value="1" />
          <input name="base_color" type="color3" nodename="c" />
          <input name="specular_roughness" type="float" nodename="r" />
        </standard_surface>
        <output name="out" type="surfaceshader" nodename="s" />
      </nodegraph>
    </materialx>"#;
    let folder = Folder::new("files", &[("mine.mtlx", text)]);
    let translation = translated_with(&folder.library(), vec![node("ND_mine", &[("color_file", file("c.png"))], &[])]);
    assert_eq!(translation.problems, Vec::<String>::new());
    let textures = &translation.uses.textures;
    let of = |input: Input| match source(&translation, input) {
        InputSource::Texture(lookup, _) => &textures[lookup.texture as usize].file,
        other => panic!("{input:?}: {other:?}"),
    };
    let (color, rough) = (of(Input::DiffuseColor), of(Input::Roughness));
    assert_eq!((&*color.resolved, color.color_space.as_deref()), ("c.png", Some("srgb_texture")));
    assert_eq!(*rough.resolved, *folder.0.join("own/rough.png").to_string_lossy());
    assert_eq!((&*rough.node, rough.color_space.as_deref()), ("/m/ND_mine", None), "whom to tell");
}

#[test]
fn recursive_definitions_are_refused() {
    let twice = |name: &str, inner: &str| {
        format!(
            r#"<nodedef name="ND_{name}" node="{name}"><output name="out" type="color3" /></nodedef>
               <nodegraph name="NG_{name}" nodedef="ND_{name}">
                 <{inner} name="a" type="color3" /><{inner} name="b" type="color3" />
                 <add name="s" type="color3">
                   <input name="in1" type="color3" nodename="a" /><input name="in2" type="color3" nodename="b" />
                 </add>
                 <output name="out" type="color3" nodename="s" />
               </nodegraph>"#
        )
    };
    let text = format!("<materialx>{}{}{}</materialx>", twice("a", "a"), twice("b", "c"), twice("c", "b"));
    let folder = Folder::new("circle", &[("circle.mtlx", &text)]);
    let library = folder.library();
    for kind in ["ND_a", "ND_b"] {
        let translation = color_of(&library, kind, &[], "out");
        assert!(!translation.problems.is_empty() && translation.inputs.is_some(), "{kind}: {translation:?}");
    }
    let surface = r#"<materialx>
      <nodedef name="ND_s" node="s"><output name="out" type="surfaceshader" /></nodedef>
      <nodegraph name="NG_s" nodedef="ND_s">
        <s name="again" type="surfaceshader" /><output name="out" type="surfaceshader" nodename="again" />
      </nodegraph></materialx>"#;
    let folder = Folder::new("surface-circle", &[("s.mtlx", surface)]);
    let translation = translated_with(&folder.library(), vec![node("ND_s", &[], &[])]);
    assert!(translation.inputs.is_none() && !translation.problems.is_empty(), "{translation:?}");
}

#[test]
fn definitions_without_a_graph_are_named() {
    let text = r#"<materialx>
      <nodedef name="ND_code_color3" node="code"><output name="out" type="color3" /></nodedef>
      <implementation name="IM_code" nodedef="ND_code_color3" file="code.osl" target="genosl" />
    </materialx>"#;
    let folder = Folder::new("code", &[("code.mtlx", text)]);
    let translation = color_of(&folder.library(), "ND_code_color3", &[], "out");
    assert_eq!(translation.problems.len(), 1, "{:?}", translation.problems);
    let line = &translation.problems[0];
    assert!(line.contains("`code` (/m/ND_code_color3) is not supported") && line.contains("graph"), "{line}");
}

/// A file that a scene names, with what it includes: in a circle, too many, not there.
#[test]
fn included_documents_are_loaded() {
    let half = TWO.replace(" namespace=\"mine\"", "").replace("other.mtlx", "user.mtlx");
    let user = r#"<materialx><xi:include href="two.mtlx" /><xi:include href="none.mtlx" />
      <nodedef name="uses_half" node="uses_half"><output name="out" type="color3" /></nodedef>
      <nodegraph name="NG_uses_half" nodedef="uses_half">
        <half name="h" type="color3"><input name="in" type="color3" value="0.8, 0.4, 0.2" /></half>
        <output name="out" type="color3" nodename="h" />
      </nodegraph></materialx>"#;
    let folder = Folder::new("includes", &[("two.mtlx", &half), ("user.mtlx", user)]);
    let library = crate::support::library().with_files(&[folder.0.join("user.mtlx")]);
    let translation = color_of(&library, "uses_half", &[], "out");
    assert_eq!(color(&translation), [0.4, 0.2, 0.1]);
    let words = library.problems().join("\n");
    assert!(library.problems().len() == 1 && words.contains("none.mtlx"), "{words}");
    assert!(library.definition("ND_standard_surface_surfaceshader").is_some(), "beside the data libraries");

    let chain = |at: usize| format!(r#"<materialx><xi:include href="{}.mtlx" /></materialx>"#, at + 1);
    let folder = Folder::new("chain", &[]);
    for at in 0..200 {
        fs::write(folder.0.join(format!("{at}.mtlx")), chain(at)).expect("a file");
    }
    let library = crate::support::library().with_files(&[folder.0.join("0.mtlx")]);
    assert!(library.problems().len() == 1 && library.problems()[0].contains("left out"), "{:?}", library.problems());
}

/// Nothing is waited for, nothing is read without an end.
#[cfg(unix)]
#[test]
fn irregular_files_are_not_opened() {
    let folder = Folder::new("pipes", &[("two.mtlx", TWO)]);
    let made = std::process::Command::new("mkfifo").arg(folder.0.join("pipe.mtlx")).status().expect("it runs");
    assert!(made.success(), "a pipe");
    std::os::unix::fs::symlink("/dev/zero", folder.0.join("zero.mtlx")).expect("a link");
    std::os::unix::fs::symlink(&folder.0, folder.0.join("again")).expect("a folder in itself");
    let large = fs::File::create(folder.0.join("large.mtlx")).expect("a file");
    large.set_len(MAX_FILE_BYTES + 1).expect("a long one");
    let library = NodeLibrary::read(std::slice::from_ref(&folder.0));
    let words = library.problems().join("\n");
    for (name, why) in [("pipe.mtlx", "a pipe"), ("zero.mtlx", "a device"), ("large.mtlx", "has more than")] {
        assert!(words.lines().any(|line| line.contains(name) && line.contains(why)), "{name}: {words}");
    }
    assert!(library.definition("mine:ND_half_color3").is_some(), "the rest is read");
}
