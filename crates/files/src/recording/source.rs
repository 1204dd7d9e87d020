//! Opens a recording as a file on disk.

use std::fs::{self, File};
use std::path::Path;
use std::sync::Arc;

use super::RecordingError;
use crate::staged::file_kind;

/// Opens a recording for reading. Anything but a regular file is rejected before it is opened: a pipe would wait for
/// its other end, a device may have none.
pub(super) fn open(path: &Path) -> Result<File, RecordingError> {
    let failed = |source| RecordingError::Open { path: path.to_path_buf(), source: Arc::new(source) };
    let found = fs::metadata(path).map_err(failed)?;
    if !found.is_file() {
        return Err(RecordingError::NotAFile { path: path.to_path_buf(), got: file_kind(found.file_type()) });
    }
    File::open(path).map_err(failed)
}
