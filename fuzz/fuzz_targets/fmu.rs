//! Any file as an FMU: it is refused or read, and what is unpacked of it is within its folder and within the limits.
//! No code of it runs.
#![no_main]

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use libfuzzer_sys::fuzz_target;
use resonarm_fmu_import::{Archive, OutputsOf, Source, Spec};

/// The most bytes to which a small archive may unpack.
const MOST: u64 = 100_000_000;

/// The bytes of all files below `folder`, none of which is a link.
fn size(folder: &Path) -> u64 {
    let entries = fs::read_dir(folder).expect("a folder");
    entries
        .map(|entry| entry.expect("an entry").path())
        .map(|path| {
            let kind = fs::symlink_metadata(&path).expect("its kind");
            if kind.is_dir() {
                size(&path)
            } else {
                assert!(kind.is_file(), "{} is no file", path.display());
                kind.len()
            }
        })
        .sum()
}

fuzz_target!(|bytes: &[u8]| {
    if let Ok(archive) = Archive::read(bytes.to_vec()) {
        let outer = std::env::temp_dir().join(format!("resonarm-fuzz-{}", std::process::id()));
        // Two folders around it: a name with `..` would leave its file beside one of them, where it is counted.
        let folder = outer.join("inner/fmu");
        let _ = fs::remove_dir_all(&outer);
        fs::create_dir_all(&folder).expect("a folder for the files");
        let _ = archive.unpack("x86_64-linux", &folder);
        let beside = |folder: &Path| fs::read_dir(folder).expect("a folder").count();
        assert_eq!((beside(&outer), beside(&outer.join("inner"))), (1, 1));
        // The limits of the archive: 100 MB, and 100 times its own size.
        assert!(size(&folder) <= MOST + 100 * bytes.len() as u64);
        fs::remove_dir_all(&outer).expect("removed");
    }
    let of = |name: &str| Some(name.to_owned());
    let outputs = OutputsOf { displacement: of("x"), velocity: of("v"), acceleration: of("a"), force: None };
    let spec = Spec {
        inputs: BTreeMap::from([("tip.x".to_owned(), "force".to_owned())]),
        outputs: BTreeMap::from([("tip.x".to_owned(), outputs)]),
        sample_s: 1e-3,
        steps_per_sample: 2,
        ..Spec::default()
    };
    let _ = Source::read(bytes.to_vec(), &spec);
});
