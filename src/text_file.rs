//! Text files of bounded size.

use std::fs::File;
use std::io::{Error, ErrorKind, Read, Result};
use std::path::Path;

/// The largest text file that is read, bytes: a scenario has thousands at most, and a device may have no end.
const LIMIT: u64 = 1 << 20;

/// The text of a file or pipe.
///
/// # Errors
/// What the system says; [`ErrorKind::FileTooLarge`] beyond 1 MiB, [`ErrorKind::InvalidData`] if it is no UTF-8.
pub(crate) fn read(path: &Path) -> Result<String> {
    let mut bytes = Vec::new();
    File::open(path)?.take(LIMIT + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > LIMIT {
        return Err(Error::new(ErrorKind::FileTooLarge, "it is larger than 1 MiB"));
    }
    String::from_utf8(bytes).map_err(|error| Error::new(ErrorKind::InvalidData, format!("it is no text: {error}")))
}
