// SPDX-License-Identifier: Apache-2.0
//! The headers of a host's base libraries, from the wheels that hold them.
//!
//! There are wheels of headers for 25.08, the runtime of the first host, and for 26.08, none between. The runtime of
//! 26.03 has the interface of 25.08 in all libraries that the shim compiles against but Vt, whose values have since got
//! the form that they have in 26.08; only the types that values know without asking are still those of 26.03. So its
//! headers are those of 25.08, with Vt's of 26.08 and the corrections below. `tests/abi` holds against the runtime what
//! the shim makes of them: virtual tables, sizes, the numbers of types, symbols.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;

use anyhow::{Context as _, Result, ensure};

use crate::places::WheelHost;

/// Header libraries and the folder of OpenUSD's source tree that each is included from.
const HEADER_FOLDERS: &[(&str, &str)] = &[
    ("arch", "base"),
    ("gf", "base"),
    ("js", "base"),
    ("plug", "base"),
    ("tf", "base"),
    ("trace", "base"),
    ("ts", "base"),
    ("vt", "base"),
    ("work", "base"),
    ("ar", "usd"),
    ("kind", "usd"),
    ("sdf", "usd"),
    ("boost", "external"),
];

/// A correction of a header: file below `dev`, a text that has to be there once, and what stands there instead.
type HeaderCorrection = (&'static str, &'static str, &'static str);

/// What 26.08 changed in Vt after 26.03: time codes, which were Sdf's, are Gf's and known to Vt; a function of Tf that
/// Vt asks while it is compiled needs no object.
const CORRECTIONS_26_03: &[HeaderCorrection] = &[
    ("pxr-vt/include/pxr/vt/types.h", "#include <pxr/gf/timeCode.h>\n", ""),
    ("pxr-vt/include/pxr/vt/types.h", "VT_VALUE_TYPE_CAN_TRANSFORM(GfTimeCode);\n", ""),
    ("pxr-vt/include/pxr/vt/types.h", " \\\nVT_TIMECODE_VALUE_TYPES\n", "\n"),
    ("pxr-vt/include/pxr/vt/types.h", "        || std::is_same_v<T, GfTimeCode>\n", ""),
    ("pxr-vt/include/pxr/vt/typeHeaders.h", "#include <pxr/gf/timeCode.h>\n", ""),
    (
        "pxr-vt/include/pxr/vt/value.h",
        "            TfPointerAndBits<const _TypeInfo>::GetMaxValue() >= _AllFlags);\n",
        "            TfPointerAndBits<const _TypeInfo>().GetMaxValue() >= _AllFlags);\n",
    ),
];

fn corrections(host: &WheelHost) -> &'static [HeaderCorrection] {
    if host.usd == "26.03" { CORRECTIONS_26_03 } else { &[] }
}

/// Makes the unpacked headers below `folder` those of the host's runtime.
///
/// # Errors
/// If a header is not what the table of corrections takes it for.
pub(super) fn correct(folder: &Path, host: &WheelHost) -> Result<()> {
    for (file, from, to) in corrections(host) {
        let path = folder.join("dev").join(file);
        let text = fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
        ensure!(text.matches(from).count() == 1, "{} is not the header that is corrected: {from:?}", path.display());
        fs::write(&path, text.replacen(from, to, 1)).with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}

/// Puts the header libraries below `host/include`, at the paths that they use among themselves and at OpenUSD's own.
///
/// # Errors
/// If a wheel holds no headers where they are expected.
pub(super) fn link(host: &Path) -> Result<()> {
    for (library, folder) in HEADER_FOLDERS {
        let headers = format!("dev/pxr-{library}/include/pxr/{library}");
        ensure!(host.join(&headers).is_dir(), "the wheel of pxr-{library}-dev holds no {headers}");
        let pxr = host.join("include/pxr");
        fs::create_dir_all(pxr.join(folder)).context("cannot create the include folder")?;
        link_folder(&format!("../../{headers}"), &pxr.join(library))?;
        link_folder(&format!("../../../{headers}"), &pxr.join(folder).join(library))?;
    }
    Ok(())
}

fn link_folder(target: &str, at: &Path) -> Result<()> {
    symlink(target, at).with_context(|| format!("cannot link {}", at.display()))?;
    ensure!(at.is_dir(), "{} leads nowhere", at.display());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::places::WHEEL_HOSTS;

    #[test]
    fn headers_appear_at_both_paths() {
        let host = std::env::temp_dir().join(format!("xtask-headers-{}", std::process::id()));
        for (library, _) in HEADER_FOLDERS {
            let folder = host.join(format!("dev/pxr-{library}/include/pxr/{library}"));
            fs::create_dir_all(&folder).unwrap();
            fs::write(folder.join("api.h"), *library).unwrap();
        }
        link(&host).unwrap();
        for path in ["tf/api.h", "base/tf/api.h", "usd/sdf/api.h", "external/boost/api.h"] {
            assert!(host.join("include/pxr").join(path).is_file(), "{path} must resolve");
        }
        fs::remove_dir_all(&host).unwrap();
    }

    #[test]
    fn a_header_is_corrected_once_or_refused() {
        let folder = std::env::temp_dir().join(format!("xtask-corrections-{}", std::process::id()));
        for (file, from, _) in CORRECTIONS_26_03 {
            let path = folder.join("dev").join(file);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            let text = fs::read_to_string(&path).unwrap_or_default();
            fs::write(&path, format!("{text}{from}")).unwrap();
        }
        correct(&folder, &WHEEL_HOSTS[0]).expect("headers of the first host stay as they are");
        correct(&folder, &WHEEL_HOSTS[1]).unwrap();
        for (file, from, _) in CORRECTIONS_26_03 {
            let text = fs::read_to_string(folder.join("dev").join(file)).unwrap();
            assert!(!text.contains(from), "{file}: {from}");
        }
        let message = correct(&folder, &WHEEL_HOSTS[1]).unwrap_err().to_string();
        assert!(message.contains("is not the header that is corrected"), "{message}");
        fs::remove_dir_all(&folder).unwrap();
    }
}
