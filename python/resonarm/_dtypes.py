"""The types through which NumPy reads the rows of words from the extension (`python/src/rows.rs`): each word is
little-endian, whatever the machine."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._resonarm import Recording, known_vectors

Array = NDArray[Any]
Vectors = list[tuple[str, list[str]]]
"""Vectors of channels: the name of each, and those of its components."""


def words(form: np.dtype[Any]) -> int:
    """The number of words of a value."""
    return -(-form.itemsize // 8)


def _rows(*fields: tuple[str, str]) -> np.dtype[Any]:
    """Fields with their types; each field begins at a new word of 8 bytes."""
    formats = [np.dtype(form).newbyteorder("<") for _, form in fields]
    offsets, end = [], 0
    for form in formats:
        offsets.append(end)
        end += 8 * words(form)
    names = [name for name, _ in fields]
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": end})


NUMBER: np.dtype[Any] = np.dtype("<f8")
COMPLEX: np.dtype[Any] = np.dtype("<c16")
OUTCOME = _rows(("motion", "i8"), ("periods", "u8"))

_COMPONENTS = dict(known_vectors())


def _vectors(vectors: Vectors) -> list[tuple[str, str]]:
    """A field for each vector: a vector of one component has the shape (1,), a channel alone is a scalar."""
    return [(vector, "f8" if components == [vector] else f"({len(components)},)f8") for vector, components in vectors]


RESPONSE = _rows(
    ("frequency_hz", "f8"),
    ("load", "f8"),
    ("phase_deg", "f8"),
    ("drift", "f8"),
    ("head_force_n", "(2,)c16"),
    ("acceleration_b_m_s2", "(2,)c16"),
    ("acceleration_c_m_s2", "(2,)c16"),
    ("settled", "?"),
    ("clipped", "?"),
    ("tries", "u8"),
)
PARTS = {
    "frames": _rows(
        ("sample", "u8"),
        ("time_ns", "u8"),
        ("bus_unix_ns", "u8"),
        ("received", "?"),
        ("identifier", "u4"),
        ("extended", "?"),
        ("remote", "?"),
        ("fd", "?"),
        ("bitrate_switch", "?"),
        ("error_state_indicator", "?"),
        ("length", "u1"),
        ("data", "(64,)u1"),
    ),
    "ticks": _rows(("sample", "u8"), ("wakeup_ns", "u8"), ("exec_ns", "u8"), ("overruns", "u8"), ("cause", "u1")),
    "events": _rows(("sample", "u8"), ("time_ns", "u8"), ("value", "i8")),
}


def motion(channels: Vectors) -> np.dtype[Any]:
    """The type of the rows of a structure's motion."""
    return _rows(("t_s", "f8"), *_vectors(channels))


def played(channels: Vectors, readings: Vectors) -> np.dtype[Any]:
    """The type of the rows that a plant plays, with the vectors of its states and of its readings."""
    return _rows(("sample", "u8"), *_vectors(channels), *_vectors(readings), ("clipped", "u8"))


def _readings(read: list[tuple[str, str]]) -> list[tuple[str, str]]:
    """The columns of degrees of freedom that are read, each with its unit."""
    return [
        (f"{dof.replace('.', '_')}_{name}_{unit}", form)
        for dof, unit in read
        for name, form in (("largest", "f8"), ("mean", "f8"), ("harmonic1", "c16"))
    ]


def orbit(read: list[tuple[str, str]], states: int, multipliers: int) -> np.dtype[Any]:
    """The type of the rows of a branch: degrees of freedom that are read, each with its unit, and the numbers of states
    and of multipliers."""
    scalars = [("value", "f8"), ("frequency_hz", "f8"), ("drive", "f8"), ("stable", "?")]
    counts = [("harmonics", "u8"), ("period", "u8"), ("truncation_error", "f8")]
    state, last = ("state", f"({states},)f8"), ("multipliers", f"({multipliers},)c16")
    return _rows(*scalars, *counts, state, *_readings(read), last)


def singular(read: list[tuple[str, str]]) -> np.dtype[Any]:
    """The type of the rows of a curve of bifurcations, with the degrees of freedom that are read."""
    return _rows(("value", "f8"), ("value2", "f8"), *_readings(read))


def rows_of(recording: Recording, part: str) -> np.dtype[Any]:
    """The type of the rows of a part: for states and samples with the vectors that the recording has."""
    if part in PARTS:
        return PARTS[part]
    mark = ("is_end", "?") if part == "states" else ("clipped", "u8")
    return _rows(("sample", "u8"), ("time_s", "f8"), *_vectors(recording.channels(part)), mark)


def view(rows: bytearray, dtype: np.dtype[Any]) -> Array:
    """The rows as an array on the same memory."""
    return np.frombuffer(rows, dtype) if rows else np.empty(0, dtype)


def texts(names: list[str]) -> Array:
    """Texts as a column, of the length of the longest."""
    return np.array(names, f"U{max([1, *map(len, names)])}")


def prefixed(rows: Array, **columns: Array) -> Array:
    """The rows, with more columns in front."""
    own = rows.dtype.names or ()
    fields = [(name, column.dtype) for name, column in columns.items()]
    out = np.empty(len(rows), [*fields, *((name, rows.dtype[name]) for name in own)])
    for name, column in columns.items():
        out[name] = column
    for name in own:
        out[name] = rows[name]
    return out


# Endings that others end with come first: `_m_sqrt_kg_s` before `_s`.
_UNITS = {
    "_m_sqrt_kg_s": "m·√kg/s",
    "_m_sqrt_kg": "m·√kg",
    "_m_s2": "m/s²",
    "_m_s": "m/s",
    "_rad_s": "rad/s",
    "_rad": "rad",
    "_a": "A",
    "_nm": "N·m",
    "_n": "N",
    "_hz": "Hz",
    "_deg": "°",
    "_unix_ns": "ns",
    "_ns": "ns",
    "_s": "s",
    "_m": "m",
    "_branch": "1",
}


def unit(name: str) -> str:
    """The unit of a column, from the end of its name; empty if it has none."""
    return next((unit for ending, unit in _UNITS.items() if name.endswith(ending)), "")


def components(name: str, column: Array) -> list[str]:
    """The names of the columns of a vector: `alpha_rad` is `alpha1_rad`, `alpha2_rad` and so on, `force_n` `force_x_n`
    and `force_y_n`."""
    return _COMPONENTS[name][: column.shape[1]]
