//! The archive of an FMU: what is in it, and its files in a folder of an instance.

use core::fmt::{self, Display};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{Cursor, Read, Write};
use std::path::Path;
use std::sync::Arc;

use sha2::{Digest, Sha256};
use zip::ZipArchive;

use crate::ImportError;

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

impl fmt::Debug for Archive {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.entries.keys()).finish()
    }
}

fn refused(reason: String) -> ImportError {
    ImportError::Archive { reason }
}

fn of_zip(error: impl Display) -> ImportError {
    refused(format!("not a ZIP archive, as an FMU is: {error}"))
}

fn too_large(name: &str, most: u64) -> ImportError {
    let most_mb = most / 1_000_000;
    refused(format!(
        "the archive unpacks to more than {most_mb} MB, at `{name}`: an FMU may have 2000 MB, and no more than 100 MB and 100 \
         times the size of its archive; pack its resources less densely if it really has so many"
    ))
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
            let hint = "put the files of a large folder into one archive among its resources";
            return Err(refused(format!(
                "the archive has {} entries: at most {MOST_ENTRIES} are read; {hint}",
                zip.len()
            )));
        }
        let most_unpacked = most_unpacked(packed.len());
        let mut left = most_unpacked;
        let mut entries = BTreeMap::new();
        let mut description = None;
        for index in 0..zip.len() {
            // Raw, since nothing is decompressed here: names and stated sizes are in the head of the entry.
            let entry = zip.by_index_raw(index).map_err(of_zip)?;
            let name = String::from_utf8_lossy(entry.name_raw()).into_owned();
            check_name(&name, entry.unix_mode())?;
            let is_description = name == DESCRIPTION;
            let is_needed = is_description || name.starts_with("binaries/") || name.starts_with("resources/");
            if name.ends_with('/') || !is_needed {
                continue;
            }
            // The size that an entry states need not be true: `unpack` counts again.
            left = left.checked_sub(entry.size()).ok_or_else(|| too_large(&name, most_unpacked))?;
            if is_description {
                description = Some(index);
            } else {
                entries.insert(name, index);
            }
        }
        let none = || refused(format!("no `{DESCRIPTION}` in the archive: it is no FMU"));
        let index = description.ok_or_else(none)?;
        let most = MOST_DESCRIPTION.min(most_unpacked);
        let mut text = Vec::new();
        // One byte more than is allowed, to tell a text of exactly this length from a longer one.
        zip.by_index(index).map_err(of_zip)?.take(most + 1).read_to_end(&mut text).map_err(of_zip)?;
        if text.len() as u64 > most {
            return Err(too_large(DESCRIPTION, most));
        }
        let not_utf8 = |_| ImportError::Description { reason: "it is not UTF-8".into() };
        let description = String::from_utf8(text).map_err(not_utf8)?;
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
        let has = if has.is_empty() { "has no libraries".to_owned() } else { format!("is for {}", has.join(", ")) };
        Err(ImportError::Unsuitable { reason: format!("no `{expected}` in the FMU: it {has}") })
    }

    /// Unpacks the libraries for `platform`, as the folder among `binaries` is called, and the resources into `folder`,
    /// and makes the folder of resources.
    ///
    /// # Errors
    /// [`ImportError`] of files that can't be written, of damaged entries, and of more bytes than an FMU has.
    pub fn unpack(&self, platform: &str, folder: &Path) -> Result<(), ImportError> {
        let failed = |error: std::io::Error| ImportError::Unpack { reason: error.to_string() };
        let binaries = format!("binaries/{platform}/");
        // Made for an FMU without resources, too: its instantiation names the folder in any case.
        fs::create_dir_all(folder.join("resources")).map_err(failed)?;
        let mut zip = ZipArchive::new(Cursor::new(&self.packed[..])).map_err(of_zip)?;
        let most = most_unpacked(self.packed.len());
        let mut left = most;
        let mut buffer = vec![0; 1 << 16];
        for (name, index) in &self.entries {
            // Libraries for other platforms can have hundreds of megabytes, and nothing loads them.
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
                // Counted as it is decompressed: an entry that understates its size is stopped before the disk is full.
                let got = entry.read(&mut buffer).map_err(of_zip)?;
                if got == 0 {
                    break;
                }
                left = left.checked_sub(got as u64).ok_or_else(|| too_large(name, most))?;
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
    // Archives that were not made on Unix state no mode, and other tools leave out the bits of the kind: both give 0.
    let kind = unix_mode.map_or(0, |mode| mode & KIND);
    let what = if name.starts_with('/') || name.get(1..2) == Some(":") {
        "is absolute"
    // A backslash separates folders on Windows, so that `..` may stand between two of them as well.
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
    let hint = "names must stay within the FMU; nothing of it is unpacked";
    Err(refused(format!("`{name}` in the archive {what}: {hint}")))
}
