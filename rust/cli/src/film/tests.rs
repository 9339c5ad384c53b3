// SPDX-License-Identifier: Apache-2.0
//! `oocpt film` on parts of a made-up film.

use super::info::FilmFacts;
use super::*;
use oocpt_film::{ExactFilm, ExactPixel, ExactSums as _, FilmHeader, FilmIdentity, FilmRequest, FilmView, SampleRange};
use oocpt_render::picture::read_attributes;

const SIZE: [u32; 2] = [5, 4];

struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("oocpt-film-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a temporary folder");
        Self(folder)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        std::fs::remove_dir_all(&self.0).expect("own files can be removed");
    }
}

/// A part of a film, whose pixels differ and whose samples do.
fn part(folder: &Folder, begin: u32, end: u32) -> PathBuf {
    let request = FilmRequest { camera: "/Camera\u{7}".to_owned(), size: SIZE, window: [0, 0, SIZE[0], SIZE[1]] };
    let settings = [("oocpt:seed", "7"), ("oocpt:pixelFilter", "box"), ("oocpt:clamp", "0")];
    let settings = settings.map(|(key, value)| (key.to_owned(), value.to_owned())).into();
    let identity = FilmIdentity { scene: "ab12".to_owned(), request, settings, version: "0".to_owned() };
    let view = FilmView { exposure: 2.0, clear_color: [0.0; 4], error_floor: 0.01 };
    let mut film = ExactFilm::new(FilmHeader { identity, view, ..FilmHeader::default() }).expect("a sound header");
    for piece in SampleRange::new(begin, end).pieces() {
        let pixel = |pixel: u16| {
            let mut sums = ExactPixel::default();
            for index in piece.begin..piece.end {
                let noise = f32::from(u16::try_from((index * 7919 + u32::from(pixel) * 104_729) % 101).expect("small"));
                sums.add_sample([f32::from(pixel), noise, 0.5, 1.0]);
            }
            sums
        };
        film.add(piece, (0..20).map(pixel).collect()).expect("it fits");
    }
    film.note(0, 1500, 3 << 20, &format!("device {}", begin % 2));
    let path = folder.0.join(format!("{begin}-{end}.film"));
    film.write(&path).expect("it can be written");
    path
}

fn film(command: FilmCommand) -> Result<()> {
    run(&FilmArguments { command })
}

#[test]
fn a_picture_of_parts_is_that_of_the_merged_film_and_says_how_it_was_made() {
    let folder = Folder::new("picture");
    let parts = vec![part(&folder, 3, 11), part(&folder, 0, 3)];
    let [merged, first, second] = ["all.film", "first.exr", "second.exr"].map(|name| folder.0.join(name));
    film(FilmCommand::Merge { parts: parts.clone(), out: merged.clone() }).expect("they merge");
    film(FilmCommand::Picture { films: parts, out: first.clone(), partial: false }).expect("whole");
    film(FilmCommand::Picture { films: vec![merged], out: second.clone(), partial: false }).expect("whole");
    let [said, same] = [&first, &second].map(|file| read_attributes(file).expect("an EXR file"));
    assert_eq!(said, same, "in the order of their names");
    let [bytes, same] = [&first, &second].map(|file| std::fs::read(file).expect("it is there"));
    let pixels = bytes.len() - 64..;
    assert!(bytes.len() == same.len() && bytes[pixels.clone()] == same[pixels], "the same pixels");
    let find = |name: &str| said.iter().find(|(have, _)| have == name).map(|(_, value)| value.to_string());
    let expected = [
        ("samples", "11"),
        ("seed", "7"),
        ("pixelFilter", "box"),
        ("seconds", "3"),
        ("device", "device 0; device 1"),
        ("scene", "ab12"),
    ];
    for (name, value) in expected {
        assert_eq!(find(name).as_deref(), Some(value), "{name}");
    }
    assert!(find("errorEstimate").is_some() && find("samplesMissing").is_none(), "{said:?}");
}

#[test]
fn missing_samples_have_to_be_accepted_and_are_in_the_picture() {
    let folder = Folder::new("missing");
    let (films, out) = (vec![part(&folder, 2, 4), part(&folder, 6, 7)], folder.0.join("out.exr"));
    let picture = |partial| film(FilmCommand::Picture { films: films.clone(), out: out.clone(), partial });
    let said = picture(false).expect_err("samples are missing").to_string();
    assert!(said.ends_with("samples 0..2, 4..6 are missing"), "{said}");
    picture(true).expect("what is there");
    let said = read_attributes(&out).expect("an EXR file");
    assert!(said.contains(&("samplesMissing".to_owned(), PictureAttribute::Text("0..2, 4..6".to_owned()))), "{said:?}");
    assert!(!said.iter().any(|(name, _)| name.starts_with("error")), "nothing is known of the error");
}

#[test]
fn a_film_is_told_as_text_and_as_json() {
    let folder = Folder::new("info");
    let facts = FilmFacts::read(&part(&folder, 0, 5), true).expect("a film");
    let text = facts.text();
    for (name, value) in [("samples", "0..5"), ("camera", "/Camera"), ("time", "1.500 s"), ("oocpt:clamp", "0")] {
        let line = text.lines().find(|line| line.trim_start().starts_with(name)).expect(name);
        assert!(line.ends_with(&format!(" {value}")), "no control characters: {line:?}");
    }
    assert!(text.contains(" at 2 samples") && text.contains(" at 4 samples"), "{text}");
    let json = facts.json();
    assert_eq!(json["samples"], serde_json::json!([{"begin": 0, "end": 5}]));
    assert_eq!(json["errors"][1]["samples"], 4);
    assert_eq!(json["header"]["identity"]["settings"]["oocpt:seed"], "7");
    let hole = missing_of(&[part(&folder, 8, 9)], 10);
    assert_eq!(hole, "0..8, 9..10");
}

fn missing_of(files: &[PathBuf], end: u32) -> String {
    let facts: Vec<FilmFacts> = files.iter().map(|file| FilmFacts::read(file, false).expect("a film")).collect();
    let samples: Vec<SampleRange> = facts.iter().flat_map(FilmFacts::samples).collect();
    text::ranges(&oocpt_film::missing(&samples, end))
}
