"""Chunks of a map: computed on all cores or on a Dask cluster, kept as they are done.

A chunk is initial states only: each process finds the stable motions itself, which takes a second.
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
    """A part of a map that is computed, and kept, as one."""

    work: Callable[..., Arrays]
    """What computes it; a function of a module, which a cluster can import."""
    arguments: tuple[Any, ...]
    key: list[Any]
    """Everything that it depends on, as JSON has it."""


def computed(chunks: Sequence[Chunk], folder: str | PathLike[str] | None, client: Any) -> Iterator[Arrays]:
    """The chunks in order: by a Dask client, or on all cores, as the computation lets go of the interpreter's lock."""
    kept = None if folder is None else Path(folder).absolute()
    if kept is not None:
        kept.mkdir(parents=True, exist_ok=True)
    if client is not None:
        yield from client.gather([client.submit(_done, chunk, kept, pure=False) for chunk in chunks])
        return
    threads = ThreadPoolExecutor(os.cpu_count())
    try:
        yield from threads.map(lambda chunk: _done(chunk, kept), chunks)
    finally:
        # Who is interrupted waits for what is being computed, and not for the rest.
        threads.shutdown(cancel_futures=True)


@lru_cache(maxsize=1)
def _code() -> str:
    """What computes in this process: the extension and the modules of the package, byte by byte."""
    package, extension = Path(__file__).parent, Path(_resonarm.__file__)
    digest = hashlib.sha256()
    for file in [*sorted(package.glob("*.py")), extension]:
        digest.update(f"{file.name} {file.stat().st_size}\n".encode())
        digest.update(file.read_bytes())
    return digest.hexdigest()


def _file(folder: Path, chunk: Chunk) -> Path:
    """The file of a chunk: its name holds everything that it depends on, the code of this process above all."""
    whole = json.dumps([_code(), chunk.work.__name__, chunk.key])
    return folder / f"chunk-{hashlib.sha256(whole.encode()).hexdigest()[:16]}.npz"


def _done(chunk: Chunk, folder: Path | None) -> Arrays:
    """A chunk: from its file, or computed and written there. A worker of a cluster names the file by its own code."""
    kept = None if folder is None else _file(folder, chunk)
    if kept is not None and kept.exists():
        try:
            with np.load(kept) as file:
                return dict(file)
        except (ValueError, OSError) as error:
            raise ValueError(
                f"{kept} is no whole chunk of a map ({error}): remove it, and it is computed anew"
            ) from error
    found = chunk.work(*chunk.arguments)
    if kept is not None:
        # Whole or not at all: who is killed while it writes leaves no half of a chunk.
        partial = kept.with_suffix(f".{os.getpid()}.part")
        with partial.open("wb") as file:
            np.savez(file, allow_pickle=False, **found)
        partial.replace(kept)
    return found
