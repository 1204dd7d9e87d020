"""Chunks of a map: computed on all cores or on a Dask cluster, stored as they are finished.

A chunk is initial states only: each process finds the stable responses itself, which takes a second.
"""

import hashlib
import json
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from . import _resonarm

Arrays = dict[str, NDArray[Any]]


class Chunk(NamedTuple):
    """A section of a map that is computed and stored as one."""

    work: Callable[..., Arrays]
    """The function that computes it, in a module, so that a cluster can import it."""
    arguments: tuple[Any, ...]
    key: list[Any]
    """Everything that the result depends on, as JSON."""


def computed(chunks: Sequence[Chunk], folder: str | PathLike[str] | None, client: Any) -> Iterator[Arrays]:
    """The chunks in order: by a Dask client, or on all cores, since the computation releases the interpreter's lock."""
    kept = None if folder is None else Path(folder).absolute()
    if kept is not None:
        kept.mkdir(parents=True, exist_ok=True)
    if client is not None:
        # Not pure: Dask then need not hash the arguments. Chunks are kept in files, by keys of their own.
        yield from client.gather([client.submit(_done, chunk, kept, pure=False) for chunk in chunks])
        return
    threads = ThreadPoolExecutor(os.cpu_count())
    try:
        yield from threads.map(lambda chunk: _done(chunk, kept), chunks)
    finally:
        # An interrupt waits for the chunks being computed, and not for the rest.
        threads.shutdown(cancel_futures=True)


@lru_cache(maxsize=1)
def _code() -> str:
    """The code of this process: the extension and the modules of the package, byte by byte."""
    package, extension = Path(__file__).parent, Path(_resonarm.__file__)
    digest = hashlib.sha256()
    for file in [*sorted(package.glob("*.py")), extension]:
        digest.update(f"{file.name} {file.stat().st_size}\n".encode())
        digest.update(file.read_bytes())
    return digest.hexdigest()


def _file(folder: Path, chunk: Chunk) -> Path:
    """The file of a chunk. Its name holds everything that the chunk depends on, including the code of this process."""
    whole = json.dumps([_code(), chunk.work.__name__, chunk.key])
    # 64 bits of the hash tell the chunks of a folder apart, in names that stay short.
    return folder / f"chunk-{hashlib.sha256(whole.encode()).hexdigest()[:16]}.npz"


def _done(chunk: Chunk, folder: Path | None) -> Arrays:
    """A chunk: read from its file, or computed and written there. A worker names the file by its own code."""
    kept = None if folder is None else _file(folder, chunk)
    if kept is not None and kept.exists():
        try:
            with np.load(kept) as file:
                return dict(file)
        except (ValueError, OSError) as error:
            raise ValueError(
                f"{kept} is not a whole chunk of a map ({error}): remove it, so that it is computed again"
            ) from error
    found = chunk.work(*chunk.arguments)
    if kept is not None:
        # Whole or not at all: a process killed while it writes leaves no incomplete chunk.
        partial = kept.with_suffix(f".{os.getpid()}.part")
        with partial.open("wb") as file:
            np.savez(file, allow_pickle=False, **found)
        partial.replace(kept)
    return found
