//! The archive of an FMU: what is in it, and its files in a folder of an instance.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{Cursor, Read, Write};
use std::path::Path;
use std::sync::Arc;

use sha2::{Digest, Sha256};
use zip::ZipArchive;

use crate::error::ImportError;

/// The most bytes of all files of an FMU: libraries of tools have hundreds of MB.
const MOST_BYTES: u64 = 2_000_000_000;
/// An archive may unpack to this many bytes, however small it is, and to [`MOST_RATIO`] times its own size in addition.
const ALWAYS_ALLOWED: u64 = 100_000_000;
/// Libraries and tables of numbers shrink to a tenth at best; Deflate reaches 1032 with bytes that are all equal.
const MOST_RATIO: u64 = 100;
/// The most bytes of the description.
const MOST_DESCRIPTION: u64 = 100_000_000;
/// The most entries: an FMU that brings a Python environment has some thousands.
const MOST_ENTRIES: usize = 20_000;
const DESCRIPTION: &str = "modelDescription.xml";

/// The SHA-256 of bytes, in hexadecimal digits.
pub fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// An FMU as it was read, packed, and which of its files an instance needs. The names and the stated sizes are checked.
#[derive(Clone, PartialEq, Eq)]
pub struct Archive {
    packed: Arc<Vec<u8>>,
    description: String,
    /// Libraries and resources: the number of the entry by its name.
    entries: BTreeMap<String, usize>,
}

impl core::fmt::Debug for Archive {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_list().entries(self.entries.keys()).finish()
    }
}

fn of_zip(error: impl ToString) -> ImportError {
    ImportError::Zip { reason: error.to_string() }
}

/// The most bytes to which an archive of `packed` bytes may unpack.
fn most_unpacked(packed: usize) -> u64 {
    MOST_BYTES.min(ALWAYS_ALLOWED.saturating_add(MOST_RATIO.saturating_mul(packed as u64)))
}

impl Archive {
    /// Checks an archive and reads its description. The libraries and resources stay packed: they are unpacked into the
    /// folder of an instance, so that none of them is held in memory.
    ///
    /// # Errors
    /// [`ImportError`]: no archive, names that leave it, entries that are not regular files, more entries or more bytes
    /// than an FMU has, no description.
    pub fn read(packed: Vec<u8>) -> Result<Archive, ImportError> {
        let mut zip = ZipArchive::new(Cursor::new(&packed[..])).map_err(of_zip)?;
        if zip.len() > MOST_ENTRIES {
            return Err(ImportError::Entries { got: zip.len(), most: MOST_ENTRIES });
        }
        let mut left = most_unpacked(packed.len());
        let most_mb = left / 1_000_000;
        let mut entries = BTreeMap::new();
        let mut description = None;
        for index in 0..zip.len() {
            let entry = zip.by_index_raw(index).map_err(of_zip)?;
            let name = String::from_utf8_lossy(entry.name_raw()).into_owned();
            check_name(&name, entry.unix_mode())?;
            let is_description = name == DESCRIPTION;
            let is_needed = is_description || name.starts_with("binaries/") || name.starts_with("resources/");
            if name.ends_with('/') || !is_needed {
                continue;
            }
            // The size that an entry states need not be true: `unpack` counts again.
            left = left.checked_sub(entry.size()).ok_or(ImportError::TooLarge { name: name.clone(), most_mb })?;
            if is_description {
                description = Some(index);
            } else {
                entries.insert(name, index);
            }
        }
        let index = description.ok_or(ImportError::NoFile { name: DESCRIPTION })?;
        let most = MOST_DESCRIPTION.min(most_unpacked(packed.len()));
        let mut text = Vec::new();
        zip.by_index(index).map_err(of_zip)?.take(most + 1).read_to_end(&mut text).map_err(of_zip)?;
        if text.len() as u64 > most {
            return Err(ImportError::TooLarge { name: DESCRIPTION.into(), most_mb: most / 1_000_000 });
        }
        let description = String::from_utf8(text).map_err(|_| ImportError::Xml { reason: "it is not UTF-8".into() })?;
        Ok(Archive { packed: Arc::new(packed), description, entries })
    }

    /// The text of the description.
    pub fn description(&self) -> &str {
        &self.description
    }

    /// Refuses an FMU without the library `expected`.
    pub(crate) fn check_platform(&self, expected: &str) -> Result<(), ImportError> {
        if self.entries.contains_key(expected) {
            return Ok(());
        }
        let mut has: Vec<&str> = self
            .entries
            .keys()
            .filter_map(|name| name.split('/').nth(1).filter(|_| name.starts_with("binaries/")))
            .collect();
        has.dedup();
        Err(ImportError::Platform { expected: expected.to_owned(), has: has.join(", ") })
    }

    /// Unpacks the libraries for `platform`, as the folder among `binaries` is called, and the resources into `folder`,
    /// and makes the folder of resources.
    ///
    /// # Errors
    /// [`ImportError`] of files that can't be written, of damaged entries, and of more bytes than an FMU has.
    pub fn unpack(&self, platform: &str, folder: &Path) -> Result<(), ImportError> {
        let failed = |error: std::io::Error| ImportError::Unpack { reason: error.to_string() };
        let binaries = format!("binaries/{platform}/");
        fs::create_dir_all(folder.join("resources")).map_err(failed)?;
        let mut zip = ZipArchive::new(Cursor::new(&self.packed[..])).map_err(of_zip)?;
        let most = most_unpacked(self.packed.len());
        let mut left = most;
        let mut buffer = vec![0; 1 << 16];
        for (name, index) in &self.entries {
            if name.starts_with("binaries/") && !name.starts_with(&binaries) {
                continue;
            }
            let path = folder.join(name);
            if let Some(parent) = path.parent() {
                fs::create_dir_all(parent).map_err(failed)?;
            }
            let mut file = File::create(&path).map_err(failed)?;
            let mut entry = zip.by_index(*index).map_err(of_zip)?;
            loop {
                let got = entry.read(&mut buffer).map_err(of_zip)?;
                if got == 0 {
                    break;
                }
                left = left
                    .checked_sub(got as u64)
                    .ok_or_else(|| ImportError::TooLarge { name: name.clone(), most_mb: most / 1_000_000 })?;
                file.write_all(&buffer[..got]).map_err(failed)?;
            }
        }
        Ok(())
    }
}

/// Refuses names that lead out of the archive's folder, and entries that are neither files nor folders.
fn check_name(name: &str, unix_mode: Option<u32>) -> Result<(), ImportError> {
    /// The bits of a mode that say what a file is.
    const KIND: u32 = 0o170_000;
    const FOLDER: u32 = 0o040_000;
    const LINK: u32 = 0o120_000;
    const REGULAR: u32 = 0o100_000;
    let kind = unix_mode.map_or(0, |mode| mode & KIND);
    let what = if name.starts_with('/') || name.get(1..2) == Some(":") {
        "is absolute"
    } else if name.split(['/', '\\']).any(|part| part == "..") {
        "leads out of its folder"
    } else if name.contains(['\\', '\0']) {
        "has a backslash or NUL"
    } else if kind == LINK {
        "is a link"
    } else if !matches!(kind, 0 | FOLDER | REGULAR) {
        "is a device, a socket or a pipe"
    } else {
        return Ok(());
    };
    Err(ImportError::Name { name: name.to_owned(), what })
}
