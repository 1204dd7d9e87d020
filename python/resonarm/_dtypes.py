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


def _rows(*fields: tuple[str, str, int]) -> np.dtype[Any]:
    """Fields of the given numbers of values; each field begins at a new word of 8 bytes."""
    little = [(np.dtype(form).newbyteorder("<"), count) for _, form, count in fields]
    formats = [np.dtype((form, (count,))) if count > 1 else form for form, count in little]
    offsets, end = [], 0
    for form in formats:
        offsets.append(end)
        end += 8 * words(form)
    names = [name for name, _, _ in fields]
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": end})


NUMBER: np.dtype[Any] = np.dtype("<f8")
COMPLEX: np.dtype[Any] = np.dtype("<c16")
OUTCOME = _rows(("motion", "i8", 1), ("periods", "u8", 1))

_COMPONENTS = dict(known_vectors())


def _vectors(vectors: Vectors) -> list[tuple[str, str, int]]:
    """A field for each vector: a vector of one component has the shape (1,), a channel alone is a scalar."""
    return [
        (vector, "f8" if components == [vector] else f"({len(components)},)f8", 1) for vector, components in vectors
    ]


RESPONSE = _rows(
    ("frequency_hz", "f8", 1),
    ("load", "f8", 1),
    ("phase_deg", "f8", 1),
    ("drift", "f8", 1),
    ("head_force_n", "c16", 2),
    ("acceleration_b_m_s2", "c16", 2),
    ("acceleration_c_m_s2", "c16", 2),
    ("settled", "?", 1),
    ("clipped", "?", 1),
    ("tries", "u8", 1),
)
PARTS = {
    "frames": _rows(
        ("sample", "u8", 1),
        ("time_ns", "u8", 1),
        ("bus_unix_ns", "u8", 1),
        ("received", "?", 1),
        ("identifier", "u4", 1),
        ("extended", "?", 1),
        ("remote", "?", 1),
        ("fd", "?", 1),
        ("bitrate_switch", "?", 1),
        ("error_state_indicator", "?", 1),
        ("length", "u1", 1),
        ("data", "u1", 64),
    ),
    "ticks": _rows(
        ("sample", "u8", 1), ("wakeup_ns", "u8", 1), ("exec_ns", "u8", 1), ("overruns", "u8", 1), ("cause", "u1", 1)
    ),
    "events": _rows(("sample", "u8", 1), ("time_ns", "u8", 1), ("value", "i8", 1)),
}


def motion(channels: Vectors) -> np.dtype[Any]:
    """The type of the rows of a structure's motion."""
    return _rows(("t_s", "f8", 1), *_vectors(channels))


def played(channels: Vectors, readings: Vectors) -> np.dtype[Any]:
    """The type of the rows that a plant plays, with the vectors of its states and of its readings."""
    return _rows(("sample", "u8", 1), *_vectors(channels), *_vectors(readings), ("clipped", "u8", 1))


def _readings(read: list[tuple[str, str]]) -> list[tuple[str, str, int]]:
    """The columns of degrees of freedom that are read, each with its unit."""
    return [
        (f"{dof.replace('.', '_')}_{name}_{unit}", form, 1)
        for dof, unit in read
        for name, form in (("largest", "f8"), ("mean", "f8"), ("harmonic1", "c16"))
    ]


def orbit(read: list[tuple[str, str]], states: int, multipliers: int) -> np.dtype[Any]:
    """The type of the rows of a branch: degrees of freedom that are read, each with its unit, and the numbers of states
    and of multipliers."""
    scalars = [("value", "f8", 1), ("frequency_hz", "f8", 1), ("drive", "f8", 1), ("stable", "?", 1)]
    counts = [("harmonics", "u8", 1), ("period", "u8", 1), ("truncation_error", "f8", 1)]
    vectors = [("state", f"({states},)f8", 1), ("multipliers", f"({multipliers},)c16", 1)]
    return _rows(*scalars, *counts, vectors[0], *_readings(read), vectors[1])


def singular(read: list[tuple[str, str]]) -> np.dtype[Any]:
    """The type of the rows of a curve of bifurcations, with the degrees of freedom that are read."""
    return _rows(("value", "f8", 1), ("value2", "f8", 1), *_readings(read))


def rows_of(recording: Recording, part: str) -> np.dtype[Any]:
    """The type of the rows of a part: for states and samples with the vectors that the recording has."""
    if part in PARTS:
        return PARTS[part]
    mark = ("is_end", "?", 1) if part == "states" else ("clipped", "u8", 1)
    return _rows(("sample", "u8", 1), ("time_s", "f8", 1), *_vectors(recording.channels(part)), mark)


def view(rows: bytearray, dtype: np.dtype[Any]) -> Array:
    """The rows as an array on the same memory."""
    return np.frombuffer(rows, dtype) if rows else np.empty(0, dtype)


def named(names: list[str], rows: Array, field: str = "kind") -> Array:
    """The rows, each with a text in front."""
    fields = [
        (field, f"U{max([1, *map(len, names)])}"),
        *((name, rows.dtype[name]) for name in rows.dtype.names or ()),
    ]
    out = np.empty(len(rows), dtype=fields)
    out[field] = names
    for name in rows.dtype.names or ():
        out[name] = rows[name]
    return out


def with_beats(bifurcations: Array, beats: list[tuple[float, float]]) -> Array:
    """The bifurcations, with the rotation number and the frequency of the beat of each after the kind."""
    (kind, form), *fields = ((name, bifurcations.dtype[name]) for name in bifurcations.dtype.names or ())
    out = np.empty(len(bifurcations), [(kind, form), ("rotation_number", NUMBER), ("beat_hz", NUMBER), *fields])
    for name in bifurcations.dtype.names or ():
        out[name] = bifurcations[name]
    out["rotation_number"] = [number for number, _ in beats]
    out["beat_hz"] = [hz for _, hz in beats]
    return out


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
