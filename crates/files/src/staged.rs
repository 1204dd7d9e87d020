//! Writes a file so that it is either complete under its name, or absent.

use std::fs::{self, File, FileType, OpenOptions, Permissions};
use std::io::{self, Write};
use std::os::unix::fs::{FileTypeExt, MetadataExt, PermissionsExt, fchown};
use std::path::{Path, PathBuf};

use tempfile::TempPath;

/// The action if the file already exists.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Existing {
    /// Return [`RecordingError::Exists`](crate::recording::RecordingError::Exists) and leave the file unchanged.
    Refuse,
    /// Replace it, at the time that [`Naming`](crate::recording::Naming) says; until then it stays unchanged. A pipe, or any other file that is
    /// not regular, is written to.
    Overwrite,
}

/// A file being written. Dropped before [`Staged::publish`], it leaves nothing, and an existing file unchanged.
pub(crate) struct Staged {
    target: PathBuf,
    existing: Existing,
    /// Where the file is until it is published: under another name in the same folder, or under its own.
    place: Place,
}

enum Place {
    /// Under a name of its own, which is removed when it is dropped.
    Temporary(TempPath),
    /// Under the target's name; the file as it was created, or `None` of a pipe or a device, which was there before.
    Growing(Option<fs::Metadata>),
    Published,
}

impl Staged {
    /// Begins a file that will be `path`, and returns it opened. With [`Existing::Overwrite`] an existing file stays
    /// unchanged until it is replaced; the new one has its mode and its owner.
    ///
    /// # Errors
    /// The error of the operating system; [`io::ErrorKind::AlreadyExists`] with [`Existing::Refuse`].
    pub fn create(path: &Path, existing: Existing) -> io::Result<(Staged, File)> {
        let mut replaced = None;
        let target = match (existing, fs::metadata(path)) {
            (Existing::Refuse, _) if fs::symlink_metadata(path).is_ok() => {
                return Err(io::ErrorKind::AlreadyExists.into());
            }
            (Existing::Overwrite, Ok(found)) if !found.is_file() => {
                let got = file_kind(found.file_type());
                return Err(io::Error::other(format!("it is {got}, expected a regular file or none")));
            }
            // Behind a symbolic link, the file it names is replaced.
            (Existing::Overwrite, Ok(found)) => {
                replaced = Some(found);
                path.canonicalize()?
            }
            (Existing::Refuse | Existing::Overwrite, _) => path.to_path_buf(),
        };
        let name = target.file_name().unwrap_or_default().to_string_lossy();
        let prefix = format!(".{name}.");
        let mut temporary = tempfile::Builder::new();
        temporary.prefix(&prefix).suffix(".part");
        if replaced.is_none() {
            // The mode of any new file, which the process's mask narrows. One that replaces another is for its owner
            // alone until it has that file's mode.
            temporary.permissions(Permissions::from_mode(0o666));
        }
        let (file, temporary) = temporary.tempfile_in(folder_of(&target)).map_err(without_path)?.into_parts();
        if let Some(replaced) = &replaced {
            take_mode_and_owner(&file, replaced)?;
        }
        Ok((Staged { target, existing, place: Place::Temporary(temporary) }, file))
    }

    /// Works like [`Staged::create`], for a file that grows under its name where no file exists, and for pipes and
    /// devices.
    ///
    /// # Errors
    /// As [`Staged::create`].
    pub fn create_growing(path: &Path, existing: Existing) -> io::Result<(Staged, File)> {
        let (file, is_new) = match (existing, fs::metadata(path)) {
            (Existing::Overwrite, Ok(found)) if found.is_file() => return Staged::create(path, existing),
            (Existing::Overwrite, Ok(_)) => (OpenOptions::new().write(true).open(path)?, false),
            (Existing::Refuse, _) | (Existing::Overwrite, Err(_)) => {
                (OpenOptions::new().write(true).create_new(true).open(path)?, true)
            }
        };
        let created = if is_new { Some(file.metadata()?) } else { None };
        Ok((Staged { target: path.to_path_buf(), existing, place: Place::Growing(created) }, file))
    }

    /// Gives the file its name, once. Content that must survive a crash of the machine must have been synchronised.
    ///
    /// # Errors
    /// The error of the operating system; [`io::ErrorKind::AlreadyExists`] if the name was taken meanwhile and must not
    /// be.
    pub fn publish(&mut self) -> io::Result<()> {
        if let Place::Temporary(temporary) = core::mem::replace(&mut self.place, Place::Published) {
            match self.existing {
                // Whoever opens the name gets the old file or the whole new one.
                Existing::Overwrite => temporary.persist(&self.target)?,
                Existing::Refuse => temporary.persist_noclobber(&self.target)?,
            }
            // The new name is an entry of the folder, which is on the disk only when the folder is. Some file systems
            // refuse to synchronise a folder; the file itself is safe by then.
            let _not_everywhere = File::open(folder_of(&self.target)).and_then(|folder| folder.sync_all());
        }
        Ok(())
    }
}

impl Drop for Staged {
    fn drop(&mut self) {
        // Never deletes a file that another process put under the name since.
        if let Place::Growing(Some(created)) = &self.place
            && is_at(created, &self.target)
        {
            let _gone = fs::remove_file(&self.target);
        }
    }
}

/// The error of the system alone. The library adds ` at path "…"` with the temporary name, which means nothing to a user,
/// and gives no other access to what it has wrapped.
fn without_path(error: io::Error) -> io::Error {
    match error.to_string().split_once(" at path ") {
        Some((cause, _)) => io::Error::new(error.kind(), cause.to_owned()),
        None => error,
    }
}

/// The folder that a file is in.
fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Writes a file under another name in its folder, and gives it its own when it is whole: an existing file is replaced
/// at once. Pipes and devices are written to. The bytes are not synchronised: if the machine itself fails within the
/// next seconds, they may be lost.
///
/// # Errors
/// The error of the operating system; an existing file stays unchanged.
pub fn write_whole(path: &Path, bytes: &[u8]) -> io::Result<()> {
    if fs::metadata(path).is_ok_and(|found| !found.is_file() && !found.is_dir()) {
        return fs::write(path, bytes);
    }
    let (mut staged, mut file) = Staged::create(path, Existing::Overwrite)?;
    file.write_all(bytes)?;
    staged.publish()
}

/// Gives a new file the mode and the owner of the file that it will replace.
fn take_mode_and_owner(file: &File, replaced: &fs::Metadata) -> io::Result<()> {
    let new = file.metadata()?;
    let user = replaced.uid();
    let group = replaced.gid();
    if (new.uid(), new.gid()) != (user, group) {
        fchown(file, Some(user), Some(group)).map_err(|error| {
            let what = format!(
                "it belongs to user {user} and group {group}, but a new file can't ({error}); name another file, or remove \
                 it first"
            );
            io::Error::new(error.kind(), what)
        })?;
    }
    // After the owner, whose change clears the bits that set identities.
    file.set_permissions(Permissions::from_mode(replaced.mode() & 0o7777))
}

/// Opens a named pipe for writing, which waits for its reader, and keeps it open. `None` for anything else, also for a
/// missing file. Other writers to the pipe do not wait while the returned file is open.
///
/// # Errors
/// The error of the operating system.
pub fn wait_for_reader(path: &Path) -> io::Result<Option<File>> {
    match fs::metadata(path) {
        Ok(found) if found.file_type().is_fifo() => OpenOptions::new().write(true).open(path).map(Some),
        _ => Ok(None),
    }
}

/// Whether both paths lead to one file, be it by links: by its device and inode.
pub fn same_file(one: &Path, other: &Path) -> bool {
    fs::metadata(one).is_ok_and(|one| is_at(&one, other))
}

/// Says whether `path` leads to this file.
pub(crate) fn is_at(file: &fs::Metadata, path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|found| (found.dev(), found.ino()) == (file.dev(), file.ino()))
}

/// Returns the name of a kind of file, with its article, for messages.
pub(crate) fn file_kind(kind: FileType) -> &'static str {
    match kind {
        kind if kind.is_dir() => "a folder",
        kind if kind.is_fifo() => "a named pipe",
        kind if kind.is_char_device() => "a character device",
        kind if kind.is_block_device() => "a block device",
        kind if kind.is_socket() => "a socket",
        _ => "a regular file",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the names in the folder, sorted.
    fn names(folder: &Path) -> Vec<String> {
        let names = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<_> = names.collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_has_its_name_when_it_is_published() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let (mut staged, mut file) = Staged::create(&path, Existing::Refuse).unwrap();
        file.write_all(b"whole").unwrap();
        // A process that is killed here leaves no file of that name.
        assert!(!path.exists());
        staged.publish().unwrap();
        staged.publish().unwrap();
        drop(staged);
        assert_eq!((names(folder.path()), fs::read(&path).unwrap()), (vec![String::from("file")], b"whole".to_vec()));
    }

    #[test]
    fn a_file_that_is_replaced_keeps_its_mode_and_owner() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        fs::write(&path, "old").unwrap();
        fs::set_permissions(&path, Permissions::from_mode(0o640)).unwrap();
        // Only root may give files away.
        let _not_root = std::os::unix::fs::chown(&path, Some(12345), Some(23456));
        let old = fs::metadata(&path).unwrap();
        write_whole(&path, b"new").unwrap();
        let new = fs::metadata(&path).unwrap();
        assert_eq!((new.mode(), new.uid(), new.gid()), (old.mode(), old.uid(), old.gid()));
        assert_eq!(fs::read(&path).unwrap(), b"new");
    }

    #[test]
    fn a_name_that_is_taken_meanwhile_stays_with_whom_took_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let (mut staged, _file) = Staged::create(&path, Existing::Refuse).unwrap();
        fs::write(&path, "another").unwrap();
        assert_eq!(staged.publish().unwrap_err().kind(), io::ErrorKind::AlreadyExists);
        drop(staged);
        assert_eq!((names(folder.path()), fs::read(&path).unwrap()), (vec![String::from("file")], b"another".to_vec()));
        let (growing, _file) = Staged::create_growing(&folder.path().join("growing"), Existing::Refuse).unwrap();
        fs::remove_file(folder.path().join("growing")).unwrap();
        fs::write(folder.path().join("growing"), "another").unwrap();
        drop(growing);
        assert_eq!(names(folder.path()), ["file", "growing"]);
    }

    #[test]
    fn behind_a_link_the_file_is_replaced_that_it_names() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let link = folder.path().join("link");
        fs::write(&path, "old").unwrap();
        std::os::unix::fs::symlink(&path, &link).unwrap();
        for create in [Staged::create, Staged::create_growing] {
            assert_eq!(create(&link, Existing::Refuse).err().unwrap().kind(), io::ErrorKind::AlreadyExists);
            let (mut staged, mut file) = create(&link, Existing::Overwrite).unwrap();
            file.write_all(b"new").unwrap();
            staged.publish().unwrap();
            assert_eq!(
                (names(folder.path()), fs::read(&path).unwrap()),
                (vec![String::from("file"), String::from("link")], b"new".to_vec())
            );
        }
    }
}
