//! The archive of an FMU: what is in it, and its files in a folder of an instance.

use std::collections::BTreeMap;
use std::fs;
use std::io::{Cursor, Read};
use std::path::Path;

use sha2::{Digest, Sha256};
use zip::ZipArchive;

use crate::ImportError;

/// The most bytes of all files of an FMU: libraries of tools have hundreds of MB.
const MOST_BYTES: u64 = 2_000_000_000;
/// The most bytes of the description.
const MOST_DESCRIPTION: u64 = 100_000_000;
const DESCRIPTION: &str = "modelDescription.xml";

/// The SHA-256 of bytes, in hexadecimal digits.
pub fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The files of an FMU that an instance needs, checked.
#[derive(Clone, PartialEq, Eq)]
pub struct Archive {
    description: String,
    /// Libraries and resources, by their names.
    files: BTreeMap<String, Vec<u8>>,
}

impl core::fmt::Debug for Archive {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_list().entries(self.files.keys()).finish()
    }
}

fn of_zip(error: impl ToString) -> ImportError {
    ImportError::Zip { reason: error.to_string() }
}

impl Archive {
    /// Reads and checks an archive: the description, the libraries of all platforms and the resources.
    ///
    /// # Errors
    /// [`ImportError`]: no archive, names that leave it, links, more bytes than an FMU has, no description.
    pub fn read(bytes: &[u8]) -> Result<Archive, ImportError> {
        let mut zip = ZipArchive::new(Cursor::new(bytes)).map_err(of_zip)?;
        let mut files = BTreeMap::new();
        let mut description = None;
        let mut left = MOST_BYTES;
        for index in 0..zip.len() {
            let mut entry = zip.by_index(index).map_err(of_zip)?;
            let name = String::from_utf8_lossy(entry.name_raw()).into_owned();
            check_name(&name, entry.unix_mode())?;
            let is_description = name == DESCRIPTION;
            let is_needed = is_description || name.starts_with("binaries/") || name.starts_with("resources/");
            if name.ends_with('/') || !is_needed {
                continue;
            }
            let most = if is_description { MOST_DESCRIPTION.min(left) } else { left };
            let mut data = Vec::new();
            // What the entry says of its size is not trusted.
            let got = entry.by_ref().take(most + 1).read_to_end(&mut data).map_err(of_zip)? as u64;
            if got > most {
                return Err(ImportError::TooLarge { name, most_mb: most / 1_000_000 });
            }
            left -= got;
            if is_description {
                let text =
                    String::from_utf8(data).map_err(|_| ImportError::Xml { reason: "it is not UTF-8".into() })?;
                description = Some(text);
            } else {
                files.insert(name, data);
            }
        }
        let description = description.ok_or(ImportError::NoFile { name: DESCRIPTION })?;
        Ok(Archive { description, files })
    }

    /// The text of the description.
    pub fn description(&self) -> &str {
        &self.description
    }

    /// Refuses an FMU without the library `expected`.
    pub(crate) fn check_platform(&self, expected: &str) -> Result<(), ImportError> {
        if self.files.contains_key(expected) {
            return Ok(());
        }
        let mut has: Vec<&str> = self
            .files
            .keys()
            .filter_map(|name| name.split('/').nth(1).filter(|_| name.starts_with("binaries/")))
            .collect();
        has.dedup();
        Err(ImportError::Platform { expected: expected.to_owned(), has: has.join(", ") })
    }

    /// Writes the files of `platform` and the resources into `folder`, and makes the folder of resources.
    pub(crate) fn unpack(&self, platform: &str, folder: &Path) -> Result<(), ImportError> {
        let failed = |error: std::io::Error| ImportError::Unpack { reason: error.to_string() };
        let binaries = format!("binaries/{platform}/");
        fs::create_dir_all(folder.join("resources")).map_err(failed)?;
        for (name, data) in &self.files {
            if name.starts_with("binaries/") && !name.starts_with(&binaries) {
                continue;
            }
            let path = folder.join(name);
            if let Some(parent) = path.parent() {
                fs::create_dir_all(parent).map_err(failed)?;
            }
            fs::write(&path, data).map_err(failed)?;
        }
        Ok(())
    }
}

/// Refuses names that lead out of the archive's folder, and links.
fn check_name(name: &str, unix_mode: Option<u32>) -> Result<(), ImportError> {
    /// The bits of a mode that say what a file is, and those of a link.
    const KIND: u32 = 0o170_000;
    const LINK: u32 = 0o120_000;
    let what = if name.starts_with('/') || name.get(1..2) == Some(":") {
        "is absolute"
    } else if name.split(['/', '\\']).any(|part| part == "..") {
        "leads out of its folder"
    } else if name.contains(['\\', '\0']) {
        "has a backslash or NUL"
    } else if unix_mode.is_some_and(|mode| mode & KIND == LINK) {
        "is a link"
    } else {
        return Ok(());
    };
    Err(ImportError::Name { name: name.to_owned(), what })
}
