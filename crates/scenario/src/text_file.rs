//! Reads files of bounded size.

use std::fs::File;
use std::io::{Error, ErrorKind, Read, Result};
use std::path::Path;

/// Largest settings file, bytes. A scenario has thousands of bytes, and a device may never end.
const LIMIT: u64 = 1 << 20;

/// Largest network file, bytes. The largest public DBC files have 3 MiB.
const NETWORK_LIMIT: u64 = 1 << 24;

/// Largest file of numbers, bytes: room for millions of them.
const NUMBERS_LIMIT: u64 = 1 << 26;

/// Largest FMU archive, bytes. Those of large tools have hundreds of MiB.
const ARCHIVE_LIMIT: u64 = 1 << 30;

/// Reads a settings file or pipe as text.
///
/// # Errors
/// The error of the operating system; [`ErrorKind::FileTooLarge`] beyond 1 MiB, [`ErrorKind::InvalidData`] if
/// the text is not UTF-8.
pub fn read(path: &Path) -> Result<String> {
    read_at_most(path, LIMIT)
}

/// Reads a file or pipe of numbers as text.
///
/// # Errors
/// As [`read`], beyond 64 MiB.
pub fn read_numbers(path: &Path) -> Result<String> {
    read_at_most(path, NUMBERS_LIMIT)
}

/// Reads a network file or pipe as bytes, in any encoding.
///
/// # Errors
/// The error of the operating system; [`ErrorKind::FileTooLarge`] beyond 16 MiB.
pub fn read_network(path: &Path) -> Result<Vec<u8>> {
    bytes_at_most(path, NETWORK_LIMIT)
}

/// Reads a file or pipe of numbers as bytes.
///
/// # Errors
/// The error of the operating system; [`ErrorKind::FileTooLarge`] beyond 64 MiB.
pub fn read_bytes(path: &Path) -> Result<Vec<u8>> {
    bytes_at_most(path, NUMBERS_LIMIT)
}

/// Reads an archive of programs, which must be a regular file.
///
/// # Errors
/// The error of the operating system; [`ErrorKind::InvalidInput`] for anything but a regular file, which may
/// have no end or never begin; [`ErrorKind::FileTooLarge`] beyond 1 GiB.
pub fn read_archive(path: &Path) -> Result<Vec<u8>> {
    // The check comes before the file is opened, since opening a pipe waits for its writer.
    if !std::fs::metadata(path)?.is_file() {
        return Err(Error::new(ErrorKind::InvalidInput, "it is not a regular file"));
    }
    bytes_at_most(path, ARCHIVE_LIMIT)
}

fn read_at_most(path: &Path, limit: u64) -> Result<String> {
    String::from_utf8(bytes_at_most(path, limit)?)
        .map_err(|error| Error::new(ErrorKind::InvalidData, format!("it is no text: {error}")))
}

fn bytes_at_most(path: &Path, limit: u64) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    // One byte more than allowed is enough to tell a file that is too large, and bounds the memory whatever the
    // file's size is.
    File::open(path)?.take(limit + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit {
        return Err(Error::new(ErrorKind::FileTooLarge, format!("it is larger than {} MiB", limit >> 20)));
    }
    Ok(bytes)
}
