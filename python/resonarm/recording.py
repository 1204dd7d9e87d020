"""Recordings: MCAP files of runs, as NumPy arrays or Arrow tables."""

from collections.abc import Iterator
from functools import cached_property
from typing import Any

import numpy as np

from . import _arrow, _extras, _resonarm
from ._dtypes import PARTS, Array, named, view
from .scenario import Scenario

_END = 2**64 - 1


class Recording(_resonarm.Recording):
    """A recording whose every checksum has been checked. Records are read from the file when they are asked for.

    A truncated or damaged file opens as well: `summary["integrity"]` says so, and what comes before the first bad
    byte can be had.

    Raises OSError if the file can't be read, ValueError if it is no recording.
    """

    @cached_property
    def scenario(self) -> Scenario:
        """The scenario of the run. Raises ValueError if the recording has none."""
        return Scenario(self.scenario_toml())

    def read(self, part: str, from_sample: int = 0, to_sample: int = _END) -> Array:
        """All rows of a part, of the samples from one to another, both among them.

        - `states`: `sample`, `time_s`, `alpha_rad`, `alpha_dot_rad_s`, and the load held from there to the next sample:
          `torque_nm`, `force_n`; `is_end` says that nothing was advanced from there.
        - `samples`: `sample`, `time_s` (when it was read: before the sample by the converters' delay), the readings
          `acceleration_b_m_s2`, `acceleration_c_m_s2`, `head_force_n`, and `clipped`: bits 0 and 1 for B, 2 and 3 for
          C, 4 and 5 for the head; 255 where the format does not say.
        - `frames`: `sample`, `time_ns` (since the start), `bus_unix_ns` (0 if unknown), `received` (by the plant),
          `identifier`, `extended`, `remote`, `fd`, `bitrate_switch`, `error_state_indicator`, `length`, `data`.
        - `ticks`: `sample`, `wakeup_ns`, `exec_ns`, `overruns`, `cause` (0 none, 1 woke late, 2 step long, 3 bus
          long), in real time alone.
        - `events`: `name`, `sample`, `time_ns`, `value`.

        Raises ResonarmError if there is no such part or samples are missing.
        """
        return next(self.chunks(part, _END, from_sample, to_sample))

    def chunks(self, part: str, rows: int = 1 << 16, from_sample: int = 0, to_sample: int = _END) -> Iterator[Array]:
        """The same in arrays of so many rows, so that a recording may be longer than the memory; one at least."""
        reader = self.reader(part, from_sample, to_sample)
        first = True
        while True:
            words, names = reader.read(rows)
            chunk = view(words, PARTS[part])
            chunk = named(names, chunk, "name") if part == "events" else chunk
            if first or len(chunk):
                yield chunk
            if len(chunk) < rows:
                return
            first = False

    def arrow(self, part: str, from_sample: int = 0, to_sample: int = _END) -> Any:
        """The same as a `pyarrow.Table`, by the extra `arrow`, with the columns of the CSV of `resonarm export`: pairs
        apart, payloads as bytes. Columns of 8-byte numbers are not copied. Each field's metadata have its `unit`, those
        of the schema the recording's `path`, `part`, `dt_s` (s) and, if it has one, `scenario` (TOML).
        """
        pyarrow = _extras.require("pyarrow", "arrow")
        return pyarrow.Table.from_batches([next(self.batches(part, _END, from_sample, to_sample))])

    def batches(self, part: str, rows: int = 1 << 16, from_sample: int = 0, to_sample: int = _END) -> Iterator[Any]:
        """The same in `pyarrow.RecordBatch`es of so many rows, so that a recording may be longer than the memory; one
        at least."""
        reader = self.reader(part, from_sample, to_sample)
        metadata = _arrow.schema_metadata(path=str(self.path), part=part, dt_s=self.dt_s)
        if self.summary["configuration"] is not None:
            metadata["scenario"] = self.scenario_toml()
        first = True
        while True:
            words, names, count = reader.read_columns(rows)
            if first or count:
                yield _arrow.batch(words, names, count, PARTS[part], metadata)
            if count < rows:
                return
            first = False

    @property
    def states(self) -> Array:
        """All states and loads, as `read` has them."""
        return self.read("states")

    @property
    def samples(self) -> Array:
        """All readings of the instruments, as `read` has them."""
        return self.read("samples")

    @property
    def frames(self) -> Array:
        """All frames on the bus, as `read` has them."""
        return self.read("frames")

    @property
    def events(self) -> Array:
        """All events, as `read` has them."""
        return self.read("events")

    def plot(self, ax: Any = None, *, from_sample: int = 0, to_sample: int = _END) -> Any:
        """Draws α1 and α2 over time on matplotlib's axes, by default the current ones; they are returned."""
        ax = _extras.axes(ax)
        states = self.read("states", from_sample, to_sample)
        lines = ax.plot(states["time_s"], states["alpha_rad"])
        for line, label in zip(lines, ("α1", "α2"), strict=True):
            line.set_label(label)
        ax.set_xlabel("time (s)")
        ax.set_ylabel("α (rad)")
        ax.legend()
        return ax

    def frame_data(self, row: np.void) -> bytes:
        """The payload of a row of `frames`."""
        return bytes(row["data"][: 0 if row["remote"] else int(row["length"])])

    def __repr__(self) -> str:
        summary = self.summary
        state = summary["integrity"]["state"]
        return f"<Recording {str(self.path)!r}: {summary['duration_s']:g} s, {state}>"
