"""Recordings: MCAP files of runs, as NumPy arrays or Arrow tables."""

import warnings
from collections.abc import Iterator
from functools import cached_property
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import _arrow, _checks, _extras, _resonarm, spectra
from ._checks import LAST
from ._dtypes import Array, prefixed, rows_of, texts, unit, view
from .scenario import Scenario
from .spectra import FrequencyResponses, ShockSpectra, Spectra
from .words import Detrend, RecordingPart, Window

SUBSCRIPTS = "₀₁₂₃₄₅₆₇₈₉"


class RecordingWarning(UserWarning):
    """A recording is not whole: the missing records are not read."""


class Recording(_resonarm.Recording):
    """A recording, with every checksum checked. Records are read from the file on request.

    A truncated or damaged file opens as well, with a RecordingWarning: `damage` and `summary["integrity"]` say what is
    missing, and the records before the first bad byte can be read. With `strict` it is a ResonarmError.

    A recording is pickled as its path, and opened again from it. Raises OSError if the file can't be read, ValueError
    if it is not a recording.
    """

    _strict: bool

    def __new__(cls, path: str | PathLike[str], *, strict: bool = False) -> "Recording":
        """The recording of a file."""
        self = super().__new__(cls, path)
        self._strict = strict
        if self.damage is not None:
            message = (
                f"recording `{_resonarm.printable(str(self.path))}` is {self.damage}; `resonarm recover` makes a whole "
                "file of what is left, also of what follows a damaged part, which is not read here"
            )
            if strict:
                raise _resonarm.ResonarmError(message)
            warnings.warn(message, RecordingWarning, stacklevel=2)
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        # Absolute, since another process may have another working directory.
        return _opened, (str(self.path.absolute()), self._strict)

    @cached_property
    def scenario(self) -> Scenario:
        """The scenario of the run. Raises ValueError if the recording has none. Of an FMU it has the SHA-256, and not
        the file: a recording is data, and does not say which code runs."""
        return Scenario(self.scenario_toml())

    def read(self, part: RecordingPart, from_sample: int = 0, to_sample: int = LAST) -> Array:
        """All rows of a part, from one sample to another, both included.

        - `states`: `sample`, `time_s`, `alpha_rad`, `alpha_dot_rad_s`, and the load held from there to the next sample:
          `torque_nm`, `force_n`; `coil_current_a` if a shaker has a coil; `is_end` says that nothing was advanced from
          there. Modes have `q_m_sqrt_kg` and `q_dot_m_sqrt_kg_s` in place of the angles, a structure whose step
          is written in Python may have `x_m` and `x_dot_m_s`; elements have their states (`element1_m`,
          `element1_branch`).
        - `samples`: `sample`, `time_s` (when it was read: before the sample by the converters' delay), the readings
          `acceleration_b_m_s2`, `acceleration_c_m_s2`, `head_force_n`, those of other sensors by the names of their
          channels (`acceleration_m3_z_m_s2`), and `clipped`: bits 0 and 1 for B, 2 and 3 for C, 4 and 5 for the head,
          those above for the other sensors in their order.
        - `frames`: `sample`, `time_ns` (since the start), `bus_unix_ns` (0 if unknown), `received` (by the plant),
          `identifier`, `extended`, `remote`, `fd`, `bitrate_switch`, `error_state_indicator`, `length`, `data`.
        - `ticks`: `sample`, `wakeup_ns`, `exec_ns`, `overruns`, `cause` (0 none, 1 woke late, 2 step long, 3 bus
          long), in real time alone.
        - `events`: `name`, `sample`, `time_ns`, `value`.

        Raises ValueError if there is no such part, or for a range that is negative or goes back; ResonarmError if
        samples are missing.
        """
        return next(self.chunks(part, LAST, from_sample, to_sample))

    def chunks(
        self, part: RecordingPart, rows: int = 1 << 16, from_sample: int = 0, to_sample: int = LAST
    ) -> Iterator[Array]:
        """The same in arrays of at most this many rows, for recordings larger than the memory; at least one array."""
        rows = _checks.rows(rows)
        reader = self.reader(part, *_checks.samples(from_sample, to_sample))
        dtype, first = rows_of(self, part), True
        while True:
            words, names = reader.read(rows)
            chunk = view(words, dtype)
            chunk = prefixed(chunk, name=texts(names)) if part == "events" else chunk
            if first or len(chunk):
                yield chunk
            if len(chunk) < rows:
                return
            first = False

    def arrow(self, part: RecordingPart, from_sample: int = 0, to_sample: int = LAST) -> Any:
        """The same as a `pyarrow.Table`, by the extra `arrow`, with the columns of the CSV of `resonarm export`: a pair
        as two columns, times in seconds (`time_s`), `direction`, `brs` and `esi` of frames, `cause` by its name. An
        empty cell is null, truth values are booleans, payloads bytes. Readings and states are not copied. Each field's
        metadata have its `unit`, those of the schema the recording's `path`, `part`, `dt_s` (s) and, if it has one,
        `scenario` (TOML).
        """
        pyarrow = _extras.require("pyarrow", "arrow")
        return pyarrow.Table.from_batches([next(self.batches(part, LAST, from_sample, to_sample))])

    def batches(
        self, part: RecordingPart, rows: int = 1 << 16, from_sample: int = 0, to_sample: int = LAST
    ) -> Iterator[Any]:
        """The same in `pyarrow.RecordBatch`es of at most this many rows, for recordings larger than the
        memory; at least one batch."""
        rows = _checks.rows(rows)
        reader = self.reader(part, *_checks.samples(from_sample, to_sample))
        metadata = _arrow.schema_metadata(path=str(self.path), part=part, dt_s=self.dt_s)
        # As stored in the file: the numbers can be read even if the scenario is of another version.
        if scenario := self.summary["configuration"].get("scenario"):
            metadata["scenario"] = scenario
        dtype, first = rows_of(self, part), True
        while True:
            words, names, count = reader.read_columns(rows)
            if first or count:
                yield _arrow.batch(words, names, count, dtype, self.dt_s, metadata)
            if count < rows:
                return
            first = False

    def to_pandas(self, part: RecordingPart, from_sample: int = 0, to_sample: int = LAST) -> Any:
        """The same as a `pandas.DataFrame`, by the extra `pandas`: a vector, as `alpha_rad`, is a column for each
        component under the component's own name, as `alpha1_rad`, and the payloads of frames are bytes. pandas itself
        refuses the arrays of `read`, since their vectors have two dimensions."""
        pandas = _extras.require("pandas", "pandas")
        rows = self.read(part, from_sample, to_sample)
        components = dict(self.channels(part)) if part in ("states", "samples") else {}
        columns: dict[str, Any] = {}
        for field in rows.dtype.names or ():
            values = rows[field]
            if field == "data":
                columns[field] = [self.frame_data(row) for row in rows]
            elif values.ndim == 1:
                columns[field] = values
            else:
                columns.update(zip(components[field], values.T, strict=True))
        # Of the machine's byte order, in which pandas computes.
        native = {name: _native(values) for name, values in columns.items()}
        return pandas.DataFrame(native)

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

    def psd(
        self,
        *channels: str,
        from_s: float | None = None,
        to_s: float | None = None,
        segment_s: float | None = None,
        overlap: float = 0.5,
        window: Window = "hann",
        detrend: Detrend = "none",
    ) -> Spectra:
        """Power spectral densities of channels, or of vectors of them as `acceleration_b_m_s2`, between two simulated
        times, s, of the whole recording by default: one-sided, in unit²/Hz, averaged over segments as by SciPy's
        `welch` with `detrend=False` (Welch 1967). Readings are corrected for the droop of the converters that the
        recording states: densities are divided by the square of their gain.

        `segment_s` is the length of a segment, by default a power of two of samples of at most a fifth of the record;
        `overlap` the part of a segment, from 0 to below 1, that it shares with the next one.

        Raises ValueError for an unknown channel, states and readings together, and segments that don't fit;
        ResonarmError if samples are missing.
        """
        wanted = (list(channels), [from_s, to_s])
        return spectra.densities(self, wanted, (segment_s, overlap, window, detrend))

    def frf(
        self,
        *channels: str,
        reference: str,
        from_s: float | None = None,
        to_s: float | None = None,
        segment_s: float | None = None,
        overlap: float = 0.5,
        window: Window = "hann",
        detrend: Detrend = "none",
    ) -> FrequencyResponses:
        """Frequency responses H1 of channels to the channel `reference`, as `head_force_x_n`, with their coherence. The
        other arguments and the errors are those of `psd`. Between readings the droop of the converters cancels out."""
        wanted = ([reference, *channels], [from_s, to_s])
        return spectra.frequency_responses(self, wanted, (segment_s, overlap, window, detrend))

    def srs(
        self,
        *channels: str,
        quality: float = 10.0,
        frequency_hz: ArrayLike | None = None,
        from_s: float | None = None,
        to_s: float | None = None,
    ) -> ShockSpectra:
        """Shock response spectra of accelerations: the largest absolute accelerations of oscillators of the quality
        Q = 1/2ζ, above 0.5, on a base that moves as the channel says (Smallwood 1981). `frequency_hz` are their natural
        frequencies, positive and at most half of the sample rate, by default 12 in an octave up to a tenth of the
        sample rate, above which samples miss peaks. The errors are those of `psd`."""
        return spectra.shock_responses(self, (list(channels), [from_s, to_s]), quality, frequency_hz)

    def judge(
        self,
        specification: str | PathLike[str],
        *channels: str,
        reference: str | None = None,
        from_s: float | None = None,
        to_s: float | None = None,
    ) -> dict[str, Any]:
        """Judges the recording by a specification of a vibration or shock test, a TOML file or the name of a preset.
        `verdict` of the document is in, undecided or out, and `found` has what was measured, as `resonarm verdict
        --json` has it.

        `channels` are the control channels, as `c.x`, by default those of the specification; `reference` is the drive
        or the measured force, which gives the phase of a sine. A random test is judged over its longest stretch at full
        level, a sine from its sweep on and a shock from its first shot on, unless a range of simulated time, s, is
        given: `begins_s` says where the test begins.

        Raises ValueError for a specification that can't be read, an unknown channel, and a record that does not suit
        the specification.
        """
        return _resonarm.judge(self, specification, list(channels), reference, [from_s, to_s])

    def plot(self, ax: Any = None, *, from_sample: int = 0, to_sample: int = LAST) -> Any:
        """Draws the coordinates over time, of the arm α1 and α2, on matplotlib's axes, by default those of a new
        figure; they are returned."""
        ax = _extras.axes(ax)
        states = self.read("states", from_sample, to_sample)
        name = self.channels("states")[0][0]
        symbol = {"alpha_rad": "α", "q_m_sqrt_kg": "q"}.get(name, "x")
        for number, line in enumerate(ax.plot(states["time_s"], states[name]), 1):
            line.set_label(f"{symbol}{''.join(SUBSCRIPTS[int(digit)] for digit in str(number))}")
        return _extras.labelled(ax, "time (s)", f"{symbol} ({unit(name)})")

    def frame_data(self, row: np.void) -> bytes:
        """The payload of a row of `frames`."""
        return bytes(row["data"][: 0 if row["remote"] else int(row["length"])])

    def __repr__(self) -> str:
        summary = self.summary
        state = summary["integrity"]["state"]
        return f"<Recording {str(self.path)!r}: {summary['duration_s']:g} s, {state}>"


def _native(values: Any) -> Any:
    """The values in an array of its own, in the machine's byte order."""
    return values if isinstance(values, list) else np.ascontiguousarray(values, values.dtype.newbyteorder("="))


def _opened(path: str, strict: bool) -> Recording:
    """The pickled form of a recording."""
    return Recording(path, strict=strict)
