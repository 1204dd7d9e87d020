//! Text files of bounded size.

use std::fs::File;
use std::io::{Error, ErrorKind, Read, Result};
use std::path::Path;

/// The largest file of settings that is read, bytes: a scenario has thousands at most, and a device may have no end.
const LIMIT: u64 = 1 << 20;

/// The largest file of a network that is read, bytes: the largest public DBC files have 3 MiB.
const NETWORK_LIMIT: u64 = 1 << 24;

/// The largest file of numbers that is read, bytes: millions of them.
const NUMBERS_LIMIT: u64 = 1 << 26;

/// The largest archive of programs that is read, bytes: those of large tools have hundreds of MiB.
const ARCHIVE_LIMIT: u64 = 1 << 30;

/// The text of a file or pipe of settings.
///
/// # Errors
/// What the system says; [`ErrorKind::FileTooLarge`] beyond 1 MiB, [`ErrorKind::InvalidData`] if it is no UTF-8.
pub fn read(path: &Path) -> Result<String> {
    read_at_most(path, LIMIT)
}

/// The text of a file or pipe of numbers.
///
/// # Errors
/// As [`read`], beyond 64 MiB.
pub fn read_numbers(path: &Path) -> Result<String> {
    read_at_most(path, NUMBERS_LIMIT)
}

/// The bytes of a file or pipe that describes a network, in any encoding of text.
///
/// # Errors
/// What the system says; [`ErrorKind::FileTooLarge`] beyond 16 MiB.
pub fn read_network(path: &Path) -> Result<Vec<u8>> {
    bytes_at_most(path, NETWORK_LIMIT)
}

/// The bytes of a file or pipe of numbers.
///
/// # Errors
/// What the system says; [`ErrorKind::FileTooLarge`] beyond 64 MiB.
pub fn read_bytes(path: &Path) -> Result<Vec<u8>> {
    bytes_at_most(path, NUMBERS_LIMIT)
}

/// The bytes of a file that is an archive of programs.
///
/// # Errors
/// What the system says; [`ErrorKind::InvalidInput`] of anything but a regular file, which may have no end or never begin;
/// [`ErrorKind::FileTooLarge`] beyond 1 GiB.
pub fn read_archive(path: &Path) -> Result<Vec<u8>> {
    // Before it is opened, which waits for the writer of a pipe.
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
    File::open(path)?.take(limit + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit {
        return Err(Error::new(ErrorKind::FileTooLarge, format!("it is larger than {} MiB", limit >> 20)));
    }
    Ok(bytes)
}
