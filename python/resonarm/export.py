"""Recordings in the formats that Python's libraries write best, row group by row group, so that a recording may be
larger than the memory."""

from collections.abc import Iterator
from datetime import datetime, timezone
from itertools import chain
from os import PathLike
from pathlib import Path
from typing import Any, get_args

import numpy as np

from . import _extras
from ._dtypes import Array, components, unit
from ._staged import staged, writing
from .recording import Recording
from .words import Format, RecordingPart

FORMATS: tuple[Format, ...] = get_args(Format)
PARTS: tuple[RecordingPart, ...] = get_args(RecordingPart)
ROWS = 1 << 16


def export(
    recording: str | PathLike[str], to: Format, stem: str | PathLike[str], *, overwrite: bool = False
) -> list[Path]:
    """Writes a recording: to `parquet` a table a part, `STEM-PART.parquet`; to `mf4` (MDF 4.10) states and samples as
    channel groups of one file, `STEM.mf4`; to `blf` the frames, `STEM.blf`. Returns the files.

    The start of an MF4 is that of the run; a run in simulated time alone has no date, and starts at 1970-01-01 UTC.
    Truth values are 0 and 1 there.

    Columns are those of the CSV of `resonarm export`: a pair as two columns with `1` and `2` of the joints or `x` and
    `y` of the axes. In Parquet they are as `Recording.arrow` has them.

    Files take their names when all are whole; after an error nothing is left, and files that were there are unchanged.

    Raises ModuleNotFoundError if the extra `export` is missing, FileExistsError for an existing file, ValueError
    for another format and for a file that is the recording, OSError for a file that can't be read or written.
    """
    return of_recording(Recording(recording), to, Path(stem), overwrite)


def of_recording(recording: Recording, to: Format, stem: Path, overwrite: bool) -> list[Path]:
    """The same of a recording that is open."""
    writers = {"parquet": _parquet, "mf4": _mf4, "blf": _blf}
    if to not in writers:
        raise ValueError(f"there is no format {to!r}: it must be one of {', '.join(FORMATS)}")
    return writers[to](recording, stem, overwrite)


def columns(rows: Array) -> dict[str, Array]:
    """The columns of rows of states or samples by the names of the CSV of `resonarm export`: pairs as two columns."""
    found: dict[str, Any] = {}
    for name in rows.dtype.names or ():
        column = rows[name]
        if column.ndim == 2:
            for k, component in enumerate(components(name, column)):
                found[component] = np.ascontiguousarray(column[:, k])
        else:
            found[name] = np.ascontiguousarray(column)
    return found


def _parts(recording: Recording, parts: tuple[RecordingPart, ...]) -> Iterator[RecordingPart]:
    """The parts that have records."""
    return (part for part in parts if recording.count(part))


def _named(stem: Path, ending: str) -> Path:
    return stem.with_name(stem.name + ending)


def _parquet(recording: Recording, stem: Path, overwrite: bool) -> list[Path]:
    parquet = _extras.require("pyarrow", "export") and _extras.require("pyarrow.parquet", "export")
    parts = list(_parts(recording, PARTS))
    paths = [_named(stem, f"-{part}.parquet") for part in parts]
    with staged(paths, overwrite, recording.path) as partial:
        for part, path, target in zip(parts, paths, partial, strict=True):
            batches = recording.batches(part, ROWS)
            first = next(batches)
            with (
                writing(path),
                target.open("wb") as file,
                parquet.ParquetWriter(file, first.schema, compression="zstd") as writer,
            ):
                for batch in chain([first], batches):
                    writer.write_batch(batch)
    return paths


def _mf4(recording: Recording, stem: Path, overwrite: bool) -> list[Path]:
    mdf = _extras.require("asammdf", "export")
    path = _named(stem, ".mf4")
    with (
        staged([path], overwrite, recording.path) as (target,),
        writing(path),
        mdf.MDF(version="4.10") as measured,
    ):
        measured.header.start_time = datetime.fromtimestamp(0, timezone.utc)
        # After `start_time`, which sets the time zone, too: a datetime has no nanoseconds, and this does.
        measured.header.abs_time = recording.summary["origin"]["start_unix_ns"] or 0
        for group, part in enumerate(_parts(recording, ("states", "samples"))):
            _append(mdf, measured, group, part, recording)
        with target.open("wb+") as file:
            measured.save(file)
    return [path]


def _append(mdf: Any, measured: Any, group: int, part: RecordingPart, recording: Recording) -> None:
    """Appends a part of a recording as a channel group."""
    for first, rows in enumerate(recording.chunks(part, ROWS)):
        # Readers of MDF know no truth values.
        channels = {
            name: values.astype("u1") if values.dtype == bool else values for name, values in columns(rows).items()
        }
        times = channels.pop("time_s")
        if first == 0:
            signals = [mdf.Signal(values, times, name=name, unit=unit(name)) for name, values in channels.items()]
            measured.append(signals, acq_name=part, comment=str(recording.path))
        else:
            measured.extend(group, [(times, None), *((values, None) for values in channels.values())])


def _blf(recording: Recording, stem: Path, overwrite: bool) -> list[Path]:
    can = _extras.require("can", "export")
    messages = _extras.require("resonarm.can_log", "export").messages
    path = _named(stem, ".blf")
    with (
        staged([path], overwrite, recording.path) as (target,),
        writing(path),
        target.open("wb") as file,
        can.BLFWriter(file) as log,
    ):
        for message in messages(recording):
            message.channel = 0
            log(message)
    return [path]
