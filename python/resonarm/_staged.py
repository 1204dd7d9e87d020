"""Files that are whole under their names, or not there."""

import os
import stat
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import count
from pathlib import Path

from ._resonarm import printable


@contextmanager
def staged(paths: Sequence[Path], overwrite: bool, source: Path) -> Iterator[list[Path]]:
    """Creates a file in the folder of each path, for the block to write. They take the names of the paths after the
    block; after an error they are removed, and what was there before stays as it was. A file that is replaced hands
    its mode and its owner on.

    Raises FileExistsError for a file that is there, unless `overwrite`, and at any rate if it is no regular file;
    ValueError for one that is `source`, from which the block reads.
    """
    for path in paths:
        if path.exists() and path.samefile(source):
            raise ValueError(f"{printable(str(path))} can't be written over itself: name another file for the result")
    targets = [_target(path, overwrite) for path in paths]
    partial: list[Path] = []
    try:
        for path, target in zip(paths, targets, strict=True):
            with writing(path):
                partial.append(_created(target))
        yield partial
        for path, part in zip(paths, partial, strict=True):
            _target(path, overwrite)
            with writing(path):
                _synchronise(part)
        for path, part, target in zip(paths, partial, targets, strict=True):
            with writing(path):
                os.replace(part, target)
    finally:
        for part in partial:
            part.unlink(missing_ok=True)


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Names the file in the system's refusal to write it. Errors with a message of their own have no `errno`."""
    try:
        yield
    except OSError as error:
        if error.errno is None:
            raise
        message = f"can't write {printable(str(path))}: {os.strerror(error.errno)}"
        raise OSError(error.errno, message) from error


def _target(path: Path, overwrite: bool) -> Path:
    """The file to be replaced: behind a symbolic link, the one that it names."""
    if not overwrite:
        if os.path.lexists(path):
            hint = "name another stem, or allow overwriting it (--overwrite)"
            raise FileExistsError(f"{printable(str(path))} already exists: {hint}")
        return path
    if path.exists() and not path.is_file():
        raise FileExistsError(f"{printable(str(path))} is not a regular file: give another stem")
    return path.resolve()


def _created(target: Path) -> Path:
    """A new file beside another. One that a killed process has left may have the same number."""
    for number in count():
        part = target.with_name(f".{target.name}.{os.getpid()}.{number}.part")
        try:
            part.open("xb").close()
        except FileExistsError:
            continue
        if target.exists():
            found = target.stat()
            try:
                os.chown(part, found.st_uid, found.st_gid)
                os.chmod(part, stat.S_IMODE(found.st_mode))
            except OSError:
                part.unlink()
                raise
        return part
    raise AssertionError("some number is free")


def _synchronise(path: Path) -> None:
    """A disk may refuse only now what it has taken into its cache."""
    with path.open("rb") as file:
        os.fsync(file.fileno())
