//! `resonarm quickstart`: writes a folder with a bench and controllers to change.

use std::fs;
use std::io::ErrorKind;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;

use crate::failure::{Failure, Verdict};
use crate::output::JsonFlag;
use resonarm::protocol::{Profile, SPEC, dbc, sources};

/// Writes a scenario, a virtual bus, and controllers in Python, C and Rust to change.
#[derive(Debug, Args)]
#[command(after_help = "Its README.md has the commands that run each controller against the simulated arm.")]
pub(crate) struct Quickstart {
    /// Folder to write; it must not exist, or be empty.
    #[arg(value_name = "FOLDER", default_value = "resonarm-bench")]
    folder: PathBuf,
    #[command(flatten)]
    json: JsonFlag,
}

#[derive(Serialize)]
struct Document {
    folder: PathBuf,
    /// The files that were written, relative to the folder.
    files: Vec<PathBuf>,
}

/// The files of `examples/quickstart`, by the names that they get.
const FILES: [(&str, &str); 9] = [
    ("README.md", include_str!("../../examples/quickstart/README.md")),
    ("scenario.toml", include_str!("../../examples/quickstart/scenario.toml")),
    (BUS, include_str!("../../examples/quickstart/bus.sh")),
    ("python/controller.py", include_str!("../../examples/quickstart/python/controller.py")),
    ("python/test_controller.py", include_str!("../../examples/quickstart/python/test_controller.py")),
    ("c/controller.c", include_str!("../../examples/quickstart/c/controller.c")),
    ("c/Makefile", include_str!("../../examples/quickstart/c/Makefile")),
    ("rust/Cargo.toml", include_str!("../../examples/quickstart/rust/Cargo.toml.txt")),
    ("rust/src/main.rs", include_str!("../../examples/quickstart/rust/main.rs")),
];
const BUS: &str = "bus.sh";
const PROTOCOL_MANIFEST: &str = include_str!("../../examples/quickstart/rust/protocol.toml.txt");

impl Quickstart {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        self.refuse_what_is_there()?;
        let files = all_files();
        let written = files.iter().try_for_each(|(path, text)| write(&self.folder.join(path), text));
        written.and_then(|()| make_executable(&self.folder.join(BUS))).inspect_err(|_| self.undo(&files))?;
        let files = files.into_iter().map(|(path, _)| path).collect();
        let document = Document { folder: self.folder.clone(), files };
        let text = || {
            let folder = self.folder.display();
            format!(
                "{folder} holds a bench and controllers in Python, C and Rust; {folder}/README.md says how to run them\n"
            )
        };
        self.json.show(&document, text, &[])
    }

    /// Removes what was written, so that the same call can be made again.
    fn undo(&self, files: &[(PathBuf, String)]) {
        for (path, _) in files {
            let _may_be_missing = fs::remove_file(self.folder.join(path));
            // `remove_dir` refuses a folder with content, so files of the user survive. The empty path at the end of
            // `ancestors` is the quickstart's own folder, which stays: it may have been there before.
            for folder in path.ancestors().skip(1).filter(|folder| !folder.as_os_str().is_empty()) {
                let _may_be_in_use = fs::remove_dir(self.folder.join(folder));
            }
        }
    }

    fn refuse_what_is_there(&self) -> Result<(), Failure> {
        let folder = self.folder.display();
        match fs::read_dir(&self.folder).map(|mut entries| entries.next().is_some()) {
            Ok(true) => Err(Failure::Usage(format!("{folder} is not empty: choose a folder that does not exist"))),
            Ok(false) => Ok(()),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
            Err(error) => Err(Failure::Usage(format!("{folder} can't be used: {error}; choose another folder"))),
        }
    }
}

/// Lists all files, by their paths in the folder.
fn all_files() -> Vec<(PathBuf, String)> {
    let manifest = PROTOCOL_MANIFEST.replace("VERSION", env!("CARGO_PKG_VERSION"));
    let rust = Path::new("rust/resonarm-protocol");
    let mut files = FILES.map(|(path, text)| (PathBuf::from(path), String::from(text))).to_vec();
    files.extend(sources::C_LOOP.map(|(name, text)| (Path::new("c").join(name), String::from(text))));
    add(&mut files, Path::new("c/resonarm/include"), &sources::C_HEADERS);
    add(&mut files, Path::new("c/resonarm/src"), &sources::C_SOURCES);
    add(&mut files, &rust.join("src"), &sources::RUST);
    files.extend([
        (rust.join("Cargo.toml"), manifest),
        (rust.join("SPEC.md"), String::from(SPEC)),
        (rust.join("resonarm.dbc"), String::from(dbc::text(Profile::Classic))),
        (rust.join("resonarm-fd.dbc"), String::from(dbc::text(Profile::Fd))),
    ]);
    files
}

/// Adds the files of an embedded folder, with those of the folders in it.
fn add(files: &mut Vec<(PathBuf, String)>, to: &Path, folder: &sources::Dir<'_>) {
    // All embedded files are text.
    let texts = folder.files().filter_map(|file| Some((to.join(file.path()), String::from(file.contents_utf8()?))));
    files.extend(texts);
    folder.dirs().for_each(|inner| add(files, to, inner));
}

fn write(path: &Path, text: &str) -> Result<(), Failure> {
    let folder = path.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder).and_then(|()| fs::write(path, text)).map_err(Failure::write(path))
}

fn make_executable(path: &Path) -> Result<(), Failure> {
    fs::set_permissions(path, fs::Permissions::from_mode(0o755)).map_err(Failure::write(path))
}
