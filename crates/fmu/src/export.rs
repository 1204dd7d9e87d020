//! FMUs as files: descriptions, library, resources and documentation, packed.

use std::path::{Path, PathBuf};
use std::{fs, io};

use serde::Serialize;
use thiserror::Error;

use crate::archive::{Files, pack};
use crate::construction::{build, variables};
use crate::content::{Content, Interface, Role, Settings, VERSION, token};
use crate::description::{IDENTIFIER, model_description};
use crate::documentation::{LICENSE, index};
use crate::fault::Fault;
use crate::model::Parameters;
use crate::terminals::{MANIFEST, TERMINALS, manifest, terminals_and_icons};
use resonarm_files::write_whole;

/// Text that a library of this version contains in its bytes.
const MARK: &str = concat!("resonarm-fmu library ", env!("CARGO_PKG_VERSION"), ";");

/// Kept in the library, for [`Library::read`] to find.
#[used]
static KEPT: [u8; MARK.len()] = {
    let mut bytes = [0; MARK.len()];
    bytes.copy_from_slice(MARK.as_bytes());
    bytes
};

/// The most nodes of a bus.
pub const MOST_NODES: u8 = 32;

/// The name of the library's file.
pub const LIBRARY: &str = "libresonarm_fmu.so";

/// Error of writing an FMU.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ExportError {
    /// There is no library.
    #[error(
        "there is no {LIBRARY} in {}: build it with `cargo build --release -p resonarm-fmu`, or give its path by --library", folder.display()
    )]
    NoLibrary {
        /// Folder in which the library was looked for.
        folder: PathBuf,
    },
    /// The library can't be read.
    #[error("{}: {source}", path.display())]
    Read {
        /// Path of the library.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The file is no library for an FMU.
    #[error("{}: {reason}", path.display())]
    Library {
        /// Path of the file that can't be used as a library.
        path: PathBuf,
        /// Reason why the library is invalid.
        reason: String,
    },
    /// The structure of the scenario is an FMU already.
    #[error(
        "structure: `kind` is fmu: the structure is an FMU already; export the exciter or the bus of the scenario by --role"
    )]
    Nested,
    /// A role that the interface does not have.
    #[error("--role {role}: only the plant has the interface `signals`; use --interface can")]
    Role {
        /// Name of the role that was requested.
        role: &'static str,
    },
    /// A bus with fewer nodes than two, or with more than fit.
    #[error("--nodes {got}: a bus has from 2 to {most} nodes", most = MOST_NODES)]
    Nodes {
        /// Requested number of nodes.
        got: u8,
    },
    /// The FMU can't run its scenario.
    #[error(transparent)]
    Content(#[from] Fault),
    /// The FMU can't be written.
    #[error("{}: {source}", path.display())]
    Write {
        /// Path of the FMU that can't be written.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
}

/// A library to pack, with the folder of its machine in an FMU.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Library {
    bytes: Vec<u8>,
    /// Platform as FMI names it: `x86_64-linux` or `aarch64-linux`.
    platform: &'static str,
}

impl Library {
    /// The library beside the running program, in the folder `deps` there, where Cargo leaves it, or in the folder
    /// `lib/resonarm` beside the program's, where packages have it.
    ///
    /// # Errors
    /// [`ExportError::NoLibrary`] if there is none, else as [`Library::read`].
    pub fn beside_program() -> Result<Library, ExportError> {
        let read = |source| ExportError::Read { path: "/proc/self/exe".into(), source };
        let program = std::env::current_exe().map_err(read)?;
        let folder = program.parent().unwrap_or(Path::new(".")).to_path_buf();
        let places = ["", "deps", "../lib/resonarm"].map(|place| folder.join(place).join(LIBRARY));
        match places.iter().find(|path| path.exists()) {
            Some(path) => Library::read(path),
            None => Err(ExportError::NoLibrary { folder }),
        }
    }

    /// The library in a file.
    ///
    /// # Errors
    /// [`ExportError::Read`], and [`ExportError::Library`] for a file that is no shared library for Linux on x86-64 or
    /// AArch64, or one of another version.
    pub fn read(path: &Path) -> Result<Library, ExportError> {
        let bytes = fs::read(path).map_err(|source| ExportError::Read { path: path.to_path_buf(), source })?;
        let refused = |reason: String| Err(ExportError::Library { path: path.to_path_buf(), reason });
        // Missing bytes count as 0, which is neither a shared object nor a machine that is supported.
        let head = |at: usize| bytes.get(at..at + 2).map_or(0, |pair| u16::from_le_bytes([pair[0], pair[1]]));
        // ELF: e_type at 16, 3 of a shared object; e_machine at 18.
        let platform = match (bytes.starts_with(b"\x7fELF\x02\x01"), head(16), head(18)) {
            (true, 3, 62) => "x86_64-linux",
            (true, 3, 183) => "aarch64-linux",
            (true, kind, machine) => {
                return refused(format!(
                    "it is an ELF file of type {kind} for machine {machine}: expected type 3 for machine 62 (x86-64) \
                     or 183 (AArch64)"
                ));
            }
            (false, ..) => {
                return refused(String::from(
                    "it is not a 64-bit little-endian ELF file: expected the library for an FMU",
                ));
            }
        };
        // A library of another version would refuse the resources, but only in the importer.
        if !bytes.windows(MARK.len()).any(|window| window == MARK.as_bytes()) {
            return refused(format!(
                "it is not {LIBRARY} of version {VERSION}: expected the library of this program's version"
            ));
        }
        Ok(Library { bytes, platform })
    }
}

/// Result of an export: the FMU and its key figures.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Summary {
    /// Path of the FMU.
    pub path: PathBuf,
    /// Size of the FMU, bytes.
    pub bytes: u64,
    /// Instantiation token of the FMU.
    pub token: String,
    /// The machine that it is for, as FMI calls it.
    pub platform: &'static str,
    /// The number of its variables.
    pub variables: usize,
}

/// Writes the FMU of `content` to `path`, whose name without extension it takes.
///
/// The same content, library and name give the same bytes.
///
/// # Errors
/// [`ExportError`].
pub fn export(content: &Content, library: Library, path: &Path) -> Result<Summary, ExportError> {
    let Settings { interface, role, nodes, .. } = content.settings;
    match (interface, role) {
        (Interface::Signals, Role::Exciter) => return Err(ExportError::Role { role: "exciter" }),
        (Interface::Signals, Role::Bus) => return Err(ExportError::Role { role: "bus" }),
        (_, Role::Plant) if content.scenario.is_fmu() => return Err(ExportError::Nested),
        (_, Role::Bus) if !(2..=MOST_NODES).contains(&nodes) => return Err(ExportError::Nodes { got: nodes }),
        _ => {}
    }
    let name = path.file_stem().map_or_else(|| IDENTIFIER.into(), |stem| stem.to_string_lossy());
    let resources = content.files().map_err(Fault::from)?;
    // The token is taken of the resources as they are packed, so that the library can compute it again from what it
    // reads.
    let token = token(&resources);
    let variables = variables(content)?;
    // Builds the model once, so that an error in the scenario is reported now and not in the importer.
    build(content, &Parameters::of(&content.scenario))?;
    let scenario = content.scenario.to_toml().map_err(Fault::from)?;
    let platform = library.platform;
    let mut files: Files = resources.into_iter().map(|(name, data)| (format!("resources/{name}"), data)).collect();
    files.extend([
        (String::from("modelDescription.xml"), model_description(&name, &token, content, &variables).into_bytes()),
        (format!("binaries/{platform}/{IDENTIFIER}.so"), library.bytes),
        (String::from("documentation/index.html"), index(&name, &variables, &scenario).into_bytes()),
        (String::from("documentation/licenses/license.txt"), LICENSE.as_bytes().to_vec()),
    ]);
    if interface == Interface::Can {
        files.insert(TERMINALS.to_string(), terminals_and_icons(&content.settings).into_bytes());
        files.insert(MANIFEST.to_string(), manifest(&content.settings).into_bytes());
    }
    let written = |source| ExportError::Write { path: path.to_path_buf(), source };
    let archive = pack(&files).map_err(written)?;
    write_whole(path, &archive).map_err(written)?;
    let path = path.to_path_buf();
    let bytes = archive.len() as u64;
    Ok(Summary { path, bytes, token, platform, variables: variables.len() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use resonarm_scenario::Scenario;

    /// The head of an ELF file of this type for this machine, with `rest` behind it.
    fn elf(kind: u8, machine: u8, rest: &[u8]) -> Vec<u8> {
        let mut bytes = b"\x7fELF\x02\x01".to_vec();
        bytes.resize(16, 0);
        bytes.extend([kind, 0, machine, 0]);
        [&bytes, rest].concat()
    }

    #[test]
    fn libraries_of_other_kinds_are_refused_in_words() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("l.so");
        let read = |bytes: &[u8]| {
            fs::write(&path, bytes).unwrap();
            let name = path.display().to_string();
            Library::read(&path)
                .map(|library| library.platform)
                .map_err(|error| error.to_string().replace(&name, "l.so"))
        };
        assert_eq!(read(&elf(3, 62, MARK.as_bytes())), Ok("x86_64-linux"));
        assert_eq!(read(&elf(3, 183, MARK.as_bytes())), Ok("aarch64-linux"));
        let refused = |bytes: &[u8]| read(bytes).unwrap_err();
        insta::assert_snapshot!(refused(b"text"), @"l.so: it is not a 64-bit little-endian ELF file: expected the library for an FMU");
        insta::assert_snapshot!(refused(&elf(2, 62, MARK.as_bytes())), @"l.so: it is an ELF file of type 2 for machine 62: expected type 3 for machine 62 (x86-64) or 183 (AArch64)");
        insta::assert_snapshot!(refused(&elf(3, 62, b"")), @"l.so: it is not libresonarm_fmu.so of version 0.1.0: expected the library of this program's version");
    }

    #[test]
    fn what_an_interface_does_not_have_is_refused_before_anything_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let library = Library { bytes: elf(3, 62, MARK.as_bytes()), platform: "x86_64-linux" };
        let refused = |settings: Settings| {
            let content = Content { settings, scenario: Scenario::default() };
            let path = folder.path().join("s.fmu");
            let error = export(&content, library.clone(), &path).unwrap_err();
            assert!(!path.exists());
            error.to_string()
        };
        let bus = Settings { role: Role::Bus, nodes: 2, ..Settings::default() };
        insta::assert_snapshot!(refused(bus), @"--role bus: only the plant has the interface `signals`; use --interface can");
        let can = Settings { interface: Interface::Can, ..bus };
        insta::assert_snapshot!(refused(can), @"the scenario gives no network.bit_rate_hz: a bus on which frames take time needs it");
        insta::assert_snapshot!(refused(Settings { nodes: 33, ..can }), @"--nodes 33: a bus has from 2 to 32 nodes");
    }
}
