// SPDX-License-Identifier: Apache-2.0
//! Adds attributes to the header of an EXR file that somebody else has written: all else of the file stays as it is,
//! bit for bit, and no pixel is decoded. Hosts write the files of their renders, and Hydra has no way to hand them
//! attributes.
//!
//! The header ends with an empty name; behind it is a table of the places of all chunks, which move by the bytes that
//! were added. Files of one part with chunks in their order are all that hosts write; others are left as they are.

use super::picture_attribute::{PREFIX, PictureAttribute, PictureAttributes};
use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, Error, ErrorKind, Read, Result, Seek, SeekFrom, Write};
use std::path::Path;

/// First bytes of a file.
const MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];
/// Version 2, and the flags of long names: no tiles, one part, no deep pixels.
const VERSION: u32 = 2;
const LONG_NAMES: u32 = 0x400;
/// Longest header that is read: a scene's metadata may be in it.
const LONGEST_HEADER: u64 = 16 << 20;
/// Most characters of a name that need no flag.
const LONGEST_NAME: usize = 31;

/// Writes the file anew with these attributes.
pub(crate) fn add(path: &Path, attributes: &PictureAttributes) -> Result<()> {
    let mut input = BufReader::new(oocpt_files::open(path)?);
    let header = read_header(&mut input)?;
    let added = encoded(attributes)?;
    let places = read_places(&mut input, header.len() as u64)?;
    oocpt_files::replace_by(path, |file| write(&mut input, file, [&header, &added], &places))
}

fn wrong(what: &str) -> Error {
    Error::new(ErrorKind::InvalidData, format!("attributes are not added: {what}"))
}

/// The bytes of the header, without the empty name that ends it.
fn read_header(input: &mut BufReader<File>) -> Result<Vec<u8>> {
    let mut header = vec![0; 8];
    input.read_exact(&mut header)?;
    let version = u32::from_le_bytes([header[4], header[5], header[6], header[7]]);
    if header[..4] != MAGIC || version & !LONG_NAMES != VERSION {
        return Err(wrong("no EXR file of one part in lines"));
    }
    let mut bounded = input.take(LONGEST_HEADER);
    loop {
        let start = header.len();
        if bounded.read_until(0, &mut header)? == 0 || header.pop() != Some(0) {
            return Err(wrong("the header has no end"));
        }
        if header.len() == start {
            return Ok(header);
        }
        if header[start..].starts_with(PREFIX.as_bytes()) {
            return Err(wrong("it has some already"));
        }
        header.push(0);
        // The name of the type, then the size of the value.
        bounded.read_until(0, &mut header)?;
        let mut size = [0; 4];
        bounded.read_exact(&mut size)?;
        header.extend_from_slice(&size);
        let size = u64::from(u32::from_le_bytes(size));
        if (&mut bounded).take(size).read_to_end(&mut header)? as u64 != size {
            return Err(wrong("the header has no end"));
        }
    }
}

/// The attributes as bytes of a header.
fn encoded(attributes: &PictureAttributes) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    for (name, value) in attributes {
        let name = format!("{PREFIX}{name}");
        if name.len() > LONGEST_NAME || name.contains('\0') {
            return Err(wrong("a name is too long"));
        }
        let (kind, value) = match value {
            // Readers differ about other characters.
            PictureAttribute::Text(text) => {
                ("string", text.chars().map(|c| if c.is_ascii() { c as u8 } else { b'?' }).collect())
            }
            PictureAttribute::Number(number) => ("double", number.to_le_bytes().to_vec()),
        };
        let size = u32::try_from(value.len()).map_err(|_too_long| wrong("a text is too long"))?;
        for part in [name.as_bytes(), &[0], kind.as_bytes(), &[0], &size.to_le_bytes(), &value] {
            bytes.extend_from_slice(part);
        }
    }
    Ok(bytes)
}

/// The table of places behind a header of so many bytes: the first chunk is right behind the table, so its place tells
/// how long that is.
fn read_places(input: &mut BufReader<File>, header: u64) -> Result<Vec<u64>> {
    let length = input.get_ref().metadata()?.len();
    let begin = header + 1;
    let mut word = [0; 8];
    input.read_exact(&mut word)?;
    let first = u64::from_le_bytes(word);
    if first <= begin || first > length || !(first - begin).is_multiple_of(8) {
        return Err(wrong("chunks are not in their order"));
    }
    let mut places = vec![first];
    for _ in 1..(first - begin) / 8 {
        input.read_exact(&mut word)?;
        let place = u64::from_le_bytes(word);
        if place <= places[places.len() - 1] || place > length {
            return Err(wrong("chunks are not in their order"));
        }
        places.push(place);
    }
    Ok(places)
}

/// Writes old and new parts of the header, the table, and the chunks.
fn write(input: &mut BufReader<File>, file: File, [header, added]: [&[u8]; 2], places: &[u64]) -> Result<()> {
    let mut output = BufWriter::new(file);
    for part in [header, added, &[0]] {
        output.write_all(part)?;
    }
    for place in places {
        output.write_all(&(place + added.len() as u64).to_le_bytes())?;
    }
    input.seek(SeekFrom::Start(places[0]))?;
    std::io::copy(input, &mut output)?;
    output.flush()
}

#[cfg(test)]
mod tests {
    use super::super::picture::{read_attributes, write as write_picture};
    use super::*;
    use exr::prelude::read_first_rgba_layer_from_file;
    use std::path::PathBuf;

    fn temporary(name: &str) -> PathBuf {
        std::env::temp_dir().join(format!("oocpt-header-{name}-{}.exr", std::process::id()))
    }

    fn some() -> PictureAttributes {
        let text = PictureAttribute::Text("a device (1)".into());
        vec![
            ("device".into(), text),
            ("errorLow".into(), PictureAttribute::Number(0.1)),
            ("seed".into(), PictureAttribute::Number(4.0)),
        ]
    }

    fn pixels(path: &Path) -> Vec<[f32; 4]> {
        let image = read_first_rgba_layer_from_file(
            path,
            |size, _| vec![[0.0_f32; 4]; size.area()],
            |pixels: &mut Vec<[f32; 4]>, at, (r, g, b, a): (f32, f32, f32, f32)| {
                pixels[at.y() * 37 + at.x()] = [r, g, b, a]
            },
        );
        image.expect("an EXR file").layer_data.channel_data.pixels
    }

    #[test]
    fn attributes_are_added_and_pixels_stay() {
        let path = temporary("added");
        let values: Vec<f32> = (0_u16..37 * 41 * 4).map(|k| f32::from(k) / 7.0).collect();
        write_picture(&path, [37, 41], &values, &PictureAttributes::new()).expect("a file");
        let before = pixels(&path);
        add(&path, &some()).expect("a file of one part");
        assert_eq!(read_attributes(&path).expect("it stays an EXR file"), some(), "in the order of their names");
        assert_eq!(pixels(&path), before, "the same bits");
        assert!(add(&path, &some()).is_err(), "once is enough");
        std::fs::remove_file(path).expect("it is there");
    }

    #[test]
    fn files_cut_at_any_length_are_refused_and_stay() {
        let path = temporary("cut");
        write_picture(&path, [3, 20], &[0.5; 240], &PictureAttributes::new()).expect("a file");
        let whole = std::fs::read(&path).expect("it is there");
        let mut input = BufReader::new(File::open(&path).expect("it is there"));
        let header = read_header(&mut input).expect("whole").len();
        for length in 0..header + 8 {
            std::fs::write(&path, &whole[..length]).expect("it can be written");
            assert!(add(&path, &some()).is_err(), "{length} bytes");
            assert_eq!(std::fs::read(&path).expect("it is there"), whole[..length], "it stays");
        }
        for at in 0..header + 8 {
            let mut bent = whole.clone();
            bent[at] ^= 0xff;
            std::fs::write(&path, &bent).expect("it can be written");
            let _any = add(&path, &some());
        }
        std::fs::remove_file(path).expect("it is there");
    }
}
