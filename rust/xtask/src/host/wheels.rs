// SPDX-License-Identifier: Apache-2.0
//! The pinned wheels: file names, hashes and purposes; fetched once, always verified.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result, bail, ensure};

use crate::places::{WHEEL_HOSTS, WheelHost};
use crate::process::{capture, run, say};

/// The target that a wheel is unpacked into.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum WheelRole {
    /// The runtime: `libusd_ms.so`, the Python package `pxr`, plugins.
    Runtime,
    /// Headers of one base library.
    Headers,
    /// Environment that authors scenes (usd-core; never in one process with the runtime).
    UsdTools,
    /// Environment that makes references with Mitsuba.
    ReferenceTools,
    /// All test environments.
    Tools,
    /// The environment that renders: Open Image Denoise, whose Python interface is not used.
    Denoiser,
}

/// One pinned wheel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PinnedWheel {
    pub(crate) requirement: &'static str,
    pub(crate) file: &'static str,
    pub(crate) sha256: &'static str,
    pub(crate) role: WheelRole,
    /// OpenUSD's version of the host that it is for; [`EVERY_HOST`] for all.
    pub(crate) host: &'static str,
}

/// For wheels that all hosts use.
const EVERY_HOST: &str = "all";

macro_rules! wheels {
    ($($role:ident $host:literal $requirement:literal $file:literal $sha256:literal)*) => {
        &[$(PinnedWheel {
            requirement: $requirement,
            file: $file,
            sha256: $sha256,
            role: WheelRole::$role,
            host: $host,
        }),*]
    };
}

/// All wheels: the host that each is for, `requirement`, file name and SHA-256 as the package index lists them.
#[rustfmt::skip]
pub(crate) const WHEELS: &[PinnedWheel] = wheels! {
    Runtime "25.08" "bpy==5.0.1"
        "bpy-5.0.1-cp311-cp311-manylinux_2_28_x86_64.whl"
        "79c6e421f53ea24a5961d86eefb8141798eee708682415eb4f5a952c2abdeb8b"
    Headers "all" "pxr-ar-dev==25.8"
        "pxr_ar_dev-25.8-cp311-cp311-manylinux_2_17_x86_64.manylinux2014_x86_64.whl"
        "6486ad1813e39dfcbbf60e364332de122841eac6ad4c64f28365a2c44f730574"
    Headers "all" "pxr-arch-dev==25.8"
        "pxr_arch_dev-25.8-cp311-cp311-manylinux_2_17_x86_64.manylinux2014_x86_64.whl"
        "c75935945f0d58c36ac783dadc653f0a253746aed1b244484160ef20ab9804c7"
    Headers "all" "pxr-boost-dev==25.8"
        "pxr_boost_dev-25.8-cp311-cp311-manylinux_2_17_x86_64.manylinux2014_x86_64.whl"
        "2227d29a9af66f2c22b05785cfdfd31e6b4c94d5f32bf5ec7fc1f8c11906b543"
    Headers "all" "pxr-gf-dev==25.8"
        "pxr_gf_dev-25.8-cp311-cp311-manylinux_2_17_x86_64.manylinux2014_x86_64.whl"
        "3c51b0f8dbe3c08aaee976bf92c7ffddd64ec8a4637aca3d60678d12457fb1de"
    Headers "all" "pxr-js-dev==25.8"
        "pxr_js_dev-25.8-cp311-cp311-manylinux_2_17_x86_64.manylinux2014_x86_64.whl"
        "d6cf7fc5ab58dea79e9b7b8e32a778d631ed56bea4776a87976b3664ca25e0d7"
    Headers "all" "pxr-kind-dev==25.8"
        "pxr_kind_dev-25.8-cp311-cp311-manylinux_2_17_x86_64.manylinux2014_x86_64.whl"
        "c029ffe78e81a35f38452b28fa0095cb573888e0c09e3c9dfce832c296d93449"
    Headers "all" "pxr-plug-dev==25.8"
        "pxr_plug_dev-25.8-cp311-cp311-manylinux_2_17_x86_64.manylinux2014_x86_64.whl"
        "c3afd1568960e47962f5e8673faf57a66e53b3fedfef830a68d31cbc3a491a33"
    Headers "all" "pxr-sdf-dev==25.8"
        "pxr_sdf_dev-25.8-cp311-cp311-manylinux_2_17_x86_64.manylinux2014_x86_64.whl"
        "4aadf7a928a8c7b1018b14b3d1cbb79880ad9788f3375ec1801e467b1a708239"
    Headers "all" "pxr-tf-dev==25.8"
        "pxr_tf_dev-25.8-cp311-cp311-manylinux_2_17_x86_64.manylinux2014_x86_64.whl"
        "ba69c1d4585eaec41ddec2ef9993885b5f967023c9762ad08af2f02b47744fa3"
    Headers "all" "pxr-trace-dev==25.8"
        "pxr_trace_dev-25.8-cp311-cp311-manylinux_2_17_x86_64.manylinux2014_x86_64.whl"
        "8afd12748494607b10df8196504dbe6f839766737b59824c3c3982eacb1421da"
    Headers "all" "pxr-ts-dev==25.8"
        "pxr_ts_dev-25.8-cp311-cp311-manylinux_2_17_x86_64.manylinux2014_x86_64.whl"
        "c849ee8126ee9a3183f38974304e856e696905ef10da9e7a9d601310081a6646"
    Headers "25.08" "pxr-vt-dev==25.8"
        "pxr_vt_dev-25.8-cp311-cp311-manylinux_2_17_x86_64.manylinux2014_x86_64.whl"
        "3a160158d021be6bb7525a7b58eae6b77671ef09c2bd99db023d2fbda9198e38"
    Headers "all" "pxr-work-dev==25.8"
        "pxr_work_dev-25.8-cp311-cp311-manylinux_2_17_x86_64.manylinux2014_x86_64.whl"
        "9ee50b53eb7dfce1dafeb21889793158f6224c11aec1335731f24e8c84f07b7f"
    UsdTools "25.08" "usd-core==25.8"
        "usd_core-25.8-cp311-none-manylinux_2_17_x86_64.manylinux2014_x86_64.whl"
        "ec4a897e828e7aa761bbbe48ec24e27be2212467495aa60f293f5097a38b542a"
    ReferenceTools "25.08" "drjit==1.5.0"
        "drjit-1.5.0-cp311-cp311-manylinux_2_27_x86_64.manylinux_2_28_x86_64.whl"
        "0d9cb374fe1f05d4167a8c24cbce6084404372e5fb3dcd6f08bbb1cee06f245a"
    ReferenceTools "25.08" "glcontext==3.1.0"
        "glcontext-3.1.0-cp311-cp311-manylinux1_x86_64.manylinux_2_28_x86_64.manylinux_2_5_x86_64.whl"
        "5d6afa9d3d99206e487d20255202695031a1db9d4e357470d375301a5688b1b7"
    ReferenceTools "25.08" "materialx==1.39.3"
        "materialx-1.39.3-cp311-cp311-manylinux_2_17_x86_64.manylinux2014_x86_64.whl"
        "e947c81af1b45a452230d7f8c324935a4b0cee433c8229514bffade8557d2095"
    ReferenceTools "25.08" "mitsuba==3.9.1"
        "mitsuba-3.9.1-cp311-cp311-manylinux_2_28_x86_64.whl"
        "7ad4fca9aedd588e5851177c7510eb8b6d27b2a5d2ee614e443dfd1bf92d457f"
    ReferenceTools "25.08" "moderngl==5.13.0"
        "moderngl-5.13.0-cp311-cp311-manylinux2014_x86_64.manylinux_2_17_x86_64.manylinux_2_28_x86_64.whl"
        "bac3293968fe818cc477bda08fa27b952f699e83f5131e0f3fc625f950db4579"
    Tools "all" "iniconfig==2.3.1"
        "iniconfig-2.3.1-py3-none-any.whl"
        "9121e2c1fdb355232495be3194c8dfe87ccc2d5dee45947b78e68f499790d7a7"
    Tools "25.08" "numpy==2.3.5"
        "numpy-2.3.5-cp311-cp311-manylinux_2_27_x86_64.manylinux_2_28_x86_64.whl"
        "8cba086a43d54ca804ce711b2a940b16e452807acebe7852ff327f1ecd49b0d4"
    UsdTools "25.08" "openexr==3.5.3"
        "openexr-3.5.3-cp311-cp311-manylinux_2_28_x86_64.whl"
        "45a35cb35b38b83635dc149d82627a618f8537f339753dc045f409b6dec0ac4c"
    UsdTools "25.08" "openimageio==3.2.2.0"
        "openimageio-3.2.2.0-cp311-cp311-manylinux_2_28_x86_64.whl"
        "1133b6a6c04270398c419804e0d293b2bb3ce2d7607a17724cc45f385036b05b"
    Tools "all" "packaging==26.3"
        "packaging-26.3-py3-none-any.whl"
        "d7193f7c8e4e93f444fde0262bf90af30e16fa0ad0ad44cb553c87339b23cd1c"
    Denoiser "all" "pyoidn==2.5.1.0"
        "pyoidn-2.5.1.0-py3-none-manylinux2014_x86_64.whl"
        "32ad13368f8de1ef63001942ad05b02a00cd732d1206d97f352d3a3f606d823e"
    UsdTools "25.08" "pillow==13.0.0"
        "pillow-13.0.0-cp311-cp311-manylinux_2_27_x86_64.manylinux_2_28_x86_64.whl"
        "a625df9a2a5597fa5e5266e01aefc82604bb85d291e3547981e863560d75da6c"
    Tools "all" "pluggy==1.7.0"
        "pluggy-1.7.0-py3-none-any.whl"
        "7dd7b0d8832ba3cb632c306926ded123429211b83641b35dc5c41ad2d34f9bec"
    Tools "all" "pygments==2.21.0"
        "pygments-2.21.0-py3-none-any.whl"
        "2363c69b61c4a97c838da3b130dcd6468f4848992b21a82f2a63ec34377137d9"
    Tools "all" "pytest==9.2.0"
        "pytest-9.2.0-py3-none-any.whl"
        "07acdcf88ec174f907dc01af70bf52d49b014bbab03faeeade31c96b18c2e588"
    UsdTools "all" "tifffile==2026.3.3"
        "tifffile-2026.3.3-py3-none-any.whl"
        "e8be15c94273113d31ecb7aa3a39822189dd11c4967e3cc88c178f1ad2fd1170"
    Runtime "26.03" "bpy==5.2.3"
        "bpy-5.2.3-cp313-cp313-manylinux_2_28_x86_64.whl"
        "8ef4a335930d647233c661ae21be1abf81207af33e1440fc5a4fc2f2f2d44db7"
    Headers "26.03" "pxr-vt-dev==26.8"
        "pxr_vt_dev-26.8-cp313-cp313-manylinux_2_24_x86_64.manylinux_2_28_x86_64.whl"
        "00419a2e9fee1a3044af37bd437b4ab5678ce50ec4c2a00b501d1a12bda59586"
    UsdTools "26.03" "usd-core==26.3"
        "usd_core-26.3-cp313-none-manylinux_2_27_x86_64.manylinux_2_28_x86_64.whl"
        "28d7003859cd98f6d9b0349198458c81f4caad204783fbc50c648669ac2c3041"
    Tools "26.03" "numpy==2.3.5"
        "numpy-2.3.5-cp313-cp313-manylinux_2_27_x86_64.manylinux_2_28_x86_64.whl"
        "11e06aa0af8c0f05104d56450d6093ee639e15f24ecf62d417329d06e522e017"
    UsdTools "26.03" "openexr==3.5.3"
        "openexr-3.5.3-cp313-cp313-manylinux_2_28_x86_64.whl"
        "0f1c9790e2b57dbbcde9f74d1788e18cb627333066101d63bbfc6be091ff24fa"
    UsdTools "26.03" "openimageio==3.2.2.0"
        "openimageio-3.2.2.0-cp313-cp313-manylinux_2_28_x86_64.whl"
        "7b0b0c62342325ea1acc8e6343e12e52e1686985af4a5c43f9e54b173b3bbed7"
    UsdTools "26.03" "pillow==13.0.0"
        "pillow-13.0.0-cp313-cp313-manylinux_2_27_x86_64.manylinux_2_28_x86_64.whl"
        "5f56499c1a74d2b862beb0c33b8016f99d095858455df9d21583bbbc1c15b582"
};

/// The wheels of a host with one of `roles`.
pub(crate) fn with_role(host: &WheelHost, roles: &[WheelRole]) -> Vec<&'static PinnedWheel> {
    let is_for = |wheel: &&PinnedWheel| wheel.host == EVERY_HOST || wheel.host == host.usd;
    WHEELS.iter().filter(is_for).filter(|wheel| roles.contains(&wheel.role)).collect()
}

/// A text that changes with any pin among `wheels`, for the stamp of a finished folder.
pub(crate) fn stamp(layout: u32, wheels: &[&PinnedWheel]) -> String {
    let lines = wheels.iter().map(|wheel| format!("{} {}\n", wheel.sha256, wheel.file));
    format!("layout {layout}\n{}", lines.collect::<String>())
}

/// Makes sure that `wheels` lie in `downloads` with the pinned bytes. `pip` gives a Python with pip; it is asked for
/// only if a file is absent.
///
/// # Errors
/// If a download fails, or if any file (old or new) differs from its pin: then nothing may be built from it.
pub(crate) fn fetch(
    pip: impl Fn() -> Result<PathBuf>,
    downloads: &Path,
    wheels: &[&PinnedWheel],
) -> Result<Vec<PathBuf>> {
    fs::create_dir_all(downloads).with_context(|| format!("cannot create {}", downloads.display()))?;
    for wheel in wheels {
        if !downloads.join(wheel.file).exists() {
            say(format_args!("downloading {}", wheel.requirement));
            download(&pip()?, downloads, wheel)?;
        }
        verify(&downloads.join(wheel.file), wheel)?;
    }
    Ok(wheels.iter().map(|wheel| downloads.join(wheel.file)).collect())
}

fn download(python: &Path, downloads: &Path, wheel: &PinnedWheel) -> Result<()> {
    // pip writes the file in place: it is downloaded elsewhere and renamed, so that an interrupted run leaves no
    // partial wheel.
    let part = downloads.join(format!(".part-{}", std::process::id()));
    let mut pip = Command::new(python);
    pip.args(["-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps"]);
    pip.args(["--only-binary=:all:", "--implementation", "cp", "--python-version", python_of(wheel)]);
    for platform in ["manylinux_2_28_x86_64", "manylinux_2_27_x86_64", "manylinux_2_17_x86_64", "manylinux2014_x86_64"]
    {
        pip.args(["--platform", platform]);
    }
    pip.arg("--dest").arg(&part).arg(wheel.requirement);
    run(&mut pip)?;
    let arrived = part.join(wheel.file);
    ensure!(arrived.exists(), "pip found another file than {} for {}", wheel.file, wheel.requirement);
    fs::rename(&arrived, downloads.join(wheel.file)).context("cannot move a finished download")?;
    fs::remove_dir_all(&part).context("cannot remove the download folder")
}

/// The Python that a wheel is made for, by its tag: headers of one Python serve others, too.
fn python_of(wheel: &PinnedWheel) -> &'static str {
    let is_for = |host: &&WheelHost| wheel.file.contains(&format!("-cp{}-", host.python.replace('.', "")));
    WHEEL_HOSTS.iter().find(is_for).unwrap_or(&WHEEL_HOSTS[0]).python
}

/// Refuses a file whose bytes are not the pinned ones.
fn verify(file: &Path, wheel: &PinnedWheel) -> Result<()> {
    let line = capture(Command::new("sha256sum").arg("--binary").arg(file))?;
    let found = line.split_whitespace().next().unwrap_or_default().trim_start_matches('\\');
    if found != wheel.sha256 {
        bail!(
            "{} is not the pinned {}: expected sha256 {}, found {found}; delete the file to download it again",
            file.display(),
            wheel.requirement,
            wheel.sha256
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const HELLO: PinnedWheel = PinnedWheel {
        requirement: "hello==1",
        file: "hello.whl",
        sha256: "2cf24dba5fb0a30e26e83b2ac5b9e29e1b161e5c1fa7425e73043362938b9824",
        role: WheelRole::Tools,
        host: EVERY_HOST,
    };

    fn scratch(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("xtask-wheels-{name}-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        folder
    }

    #[test]
    fn changed_bytes_are_refused() {
        let folder = scratch("refuse");
        fs::write(folder.join(HELLO.file), "hello").unwrap();
        let no_pip = || bail!("with the file present nothing may be downloaded");
        let files = fetch(no_pip, &folder, &[&HELLO]).unwrap();
        assert_eq!(files, [folder.join("hello.whl")], "a file with the pinned bytes is taken");
        fs::write(folder.join(HELLO.file), "hellp").unwrap();
        let message = fetch(no_pip, &folder, &[&HELLO]).unwrap_err().to_string();
        assert!(message.contains("is not the pinned hello==1"), "{message}");
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn an_absent_wheel_is_asked_of_pip() {
        let folder = scratch("absent");
        let message = fetch(|| Ok("false".into()), &folder, &[&HELLO]).unwrap_err().to_string();
        assert!(message.contains("pip download") && message.contains("hello==1"), "{message}");
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn the_stamp_changes_with_any_pin() {
        let other = PinnedWheel { sha256: "00", ..HELLO };
        assert_ne!(stamp(1, &[&HELLO]), stamp(1, &[&other]), "another hash");
        assert_ne!(stamp(1, &[&HELLO]), stamp(2, &[&HELLO]), "another layout");
        assert_eq!(stamp(1, &[&HELLO]), stamp(1, &[&HELLO]), "the same pins");
    }

    #[test]
    fn each_host_has_one_runtime_and_all_headers() {
        for host in &WHEEL_HOSTS {
            let runtimes = with_role(host, &[WheelRole::Runtime]);
            assert_eq!(runtimes.len(), 1, "{}", host.usd);
            assert_eq!(runtimes[0].requirement, format!("bpy=={}", host.bpy));
            assert_eq!(python_of(runtimes[0]), host.python);
            let headers = with_role(host, &[WheelRole::Headers]);
            let mut names: Vec<_> = headers.iter().filter_map(|wheel| wheel.requirement.split('=').next()).collect();
            names.sort_unstable();
            names.dedup();
            assert_eq!((headers.len(), names.len()), (13, 13), "each library once, {}", host.usd);
            assert!(with_role(host, &[WheelRole::UsdTools]).len() >= 5, "{}", host.usd);
        }
    }

    #[test]
    fn every_pin_is_well_formed() {
        for wheel in WHEELS {
            assert!(wheel.sha256.len() == 64 && wheel.sha256.bytes().all(|b| b.is_ascii_hexdigit()), "{wheel:?}");
            assert!(wheel.file.ends_with(".whl") && wheel.requirement.contains("=="), "{wheel:?}");
            assert!(wheel.host == EVERY_HOST || WheelHost::named(wheel.host).is_ok(), "{wheel:?}");
        }
    }
}
