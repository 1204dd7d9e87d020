//! Records from which commit, for which target and with which compiler the library is built.
//!
//! Without git, or outside the project's own repository, the commit is `unknown`; the build never fails for it.

use std::env;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Sources of the library: a change in one of these makes the stated commit untrue.
const SOURCES: [&str; 5] = ["crates", "firmware-protocol", "proto", "Cargo.toml", "Cargo.lock"];

/// The project's folder, relative to this crate's.
const ROOT: &str = "../..";

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    // A path that does not exist would make cargo run this script at every build: in a package of this crate alone the
    // folders beside it are missing.
    for path in SOURCES.iter().map(|path| Path::new(ROOT).join(path)).filter(|path| path.exists()) {
        println!("cargo:rerun-if-changed={}", path.display());
    }
    let commit = commit().unwrap_or_else(|| String::from("unknown"));
    let compiler = output(&env::var("RUSTC").unwrap_or_default(), &["--version"]).unwrap_or_default();
    println!("cargo:rustc-env=RESONARM_GIT_COMMIT={commit}");
    println!("cargo:rustc-env=RESONARM_RUSTC={compiler}");
    for name in ["TARGET", "PROFILE"] {
        println!("cargo:rustc-env=RESONARM_{name}={}", env::var(name).unwrap_or_default());
    }
}

/// Returns the commit checked out, with `-dirty` appended if a source differs from it.
fn commit() -> Option<String> {
    let top = PathBuf::from(output("git", &["rev-parse", "--show-toplevel"])?);
    let here = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR")?).join(ROOT);
    if top.canonicalize().ok()? != here.canonicalize().ok()? {
        return None; // a copy inside some other repository
    }
    // `HEAD` names the branch and changes when another one is checked out; its log grows with every commit on it.
    for name in ["HEAD", "logs/HEAD"] {
        let path = output("git", &["rev-parse", "--git-path", name])?;
        if Path::new(&path).exists() {
            println!("cargo:rerun-if-changed={path}");
        }
    }
    let commit = output("git", &["rev-parse", "HEAD"])?;
    // Only tracked sources count: a recording or a figure in the folder does not make the build dirty.
    let mut status = vec!["-C", ROOT, "status", "--porcelain", "--untracked-files=no", "--"];
    status.extend(SOURCES);
    let dirty = !output("git", &status)?.is_empty();
    Some(if dirty { format!("{commit}-dirty") } else { commit })
}

/// Returns the standard output of a program, without the line end, if it succeeds.
fn output(program: &str, arguments: &[&str]) -> Option<String> {
    let output = Command::new(program).args(arguments).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim_end().to_string())
}
