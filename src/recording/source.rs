//! A recording as a file on disk.

use std::fs::{self, File, FileType};
use std::os::unix::fs::FileTypeExt;
use std::path::Path;
use std::sync::Arc;

use super::RecordingError;

/// Opens a recording for reading. What is no regular file is refused before it is opened: a pipe would wait for its
/// other end, a device may have none.
pub(super) fn open(path: &Path) -> Result<File, RecordingError> {
    let failed = |source| RecordingError::Open { path: path.to_path_buf(), source: Arc::new(source) };
    let found = fs::metadata(path).map_err(failed)?;
    if !found.is_file() {
        return Err(RecordingError::NotAFile { path: path.to_path_buf(), got: file_kind(found.file_type()) });
    }
    File::open(path).map_err(failed)
}

/// What a file is, in words.
pub(super) fn file_kind(kind: FileType) -> &'static str {
    match kind {
        kind if kind.is_dir() => "a folder",
        kind if kind.is_fifo() => "a named pipe",
        kind if kind.is_char_device() => "a character device",
        kind if kind.is_block_device() => "a block device",
        kind if kind.is_socket() => "a socket",
        _ => "a regular file",
    }
}
