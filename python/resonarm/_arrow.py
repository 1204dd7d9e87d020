"""Columns of a recording as Arrow's: the words of a column of 8 bytes are Arrow's own memory, without a copy."""

import json
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from . import _extras, _resonarm
from ._dtypes import Array, components, unit, words


def schema_metadata(**values: Any) -> dict[str, str]:
    """The metadata of a recording in a schema: texts unchanged, other values as JSON."""
    return {name: value if isinstance(value, str) else json.dumps(value) for name, value in values.items()}


def batch(
    buffer: bytearray, names: list[str], rows: int, dtype: np.dtype[Any], dt_s: float, metadata: dict[str, str]
) -> Any:
    """A `pyarrow.RecordBatch` of the columns of words that the extension passes, and of the names of events; `dt_s` is
    the sample period.

    Numbers of 8 bytes are not copied, unless the CSV has them otherwise; truth values, shorter integers and payloads,
    which Arrow packs, are.
    """
    arrow = _extras.require("pyarrow", "arrow")
    columns = np.frombuffer(buffer, "<u8").reshape(-1, rows) if rows else np.empty((dtype.itemsize // 8, 0), "<u8")
    fields, arrays = [], []
    for name, array in _named(arrow, columns, names, dtype, dt_s):
        of = unit(name)
        fields.append(arrow.field(name, array.type, metadata={"unit": of} if of else None))
        arrays.append(array)
    return arrow.RecordBatch.from_arrays(arrays, schema=arrow.schema(fields, metadata=metadata))


def _named(
    arrow: Any, columns: Array, names: list[str], dtype: np.dtype[Any], dt_s: float
) -> Iterator[tuple[str, Any]]:
    """Arrow's arrays by the names of the CSV of `resonarm export`, in its order."""
    first, known = 0, dtype.names or ()
    for name in known:
        form = dtype[name]
        own = columns[first : first + words(form)]
        first += words(form)
        if name == "data":
            length = columns[_place(dtype, "length")]
            yield name, _payloads(arrow, own, np.where(columns[_place(dtype, "remote")], 0, length))
        elif name in WORDS_OF_CSV:
            yield WORDS_OF_CSV[name](arrow, own[0])
        elif form.shape:
            for column_name, column in zip(components(name, own.T), own, strict=True):
                yield column_name, _column(arrow, column, form.base)
        else:
            yield name, _column(arrow, own[0], form)
        # What the words don't have: the times of ticks, which come after the sample, and the names of events.
        if name == "sample" and "wakeup_ns" in known:
            yield "time_s", arrow.array(own[0] * dt_s)
        elif name == "time_ns" and "value" in known:
            yield "name", arrow.array(names, arrow.string())


CAUSES = np.array(["", *_resonarm.overrun_causes()])
"""Causes of overruns by their number, none first, as `resonarm export` names them."""
WORDS_OF_CSV: dict[str, Callable[[Any, Array], tuple[str, Any]]] = {
    "time_ns": lambda arrow, ns: ("time_s", arrow.array(ns / 1e9)),
    "bus_unix_ns": lambda arrow, ns: ("bus_unix_ns", arrow.array(ns.astype(np.uint64), mask=ns == 0)),
    "received": lambda arrow, is_so: ("direction", arrow.array(np.where(is_so, "received", "sent"), arrow.string())),
    "bitrate_switch": lambda arrow, is_so: ("brs", arrow.array(is_so.astype(bool))),
    "error_state_indicator": lambda arrow, is_so: ("esi", arrow.array(is_so.astype(bool))),
    "cause": lambda arrow, cause: ("cause", arrow.array(CAUSES[cause], arrow.string(), mask=cause == 0)),
}
"""Columns whose name or values differ in the CSV."""


def _place(dtype: np.dtype[Any], name: str) -> int:
    """The index of a field's first word."""
    _form, offset = (dtype.fields or {name: (dtype, 0)})[name][:2]
    return int(offset) // 8


def _column(arrow: Any, column: Array, form: np.dtype[Any]) -> Any:
    values = column.view(form) if form.itemsize == 8 else column.astype(form)
    # Arrow's numbers are in the machine's byte order, which nearly everywhere is little-endian.
    return arrow.array(values.astype(form.newbyteorder("="), copy=False))


def _payloads(arrow: Any, own: Array, length: Array) -> Any:
    """Byte strings of the given lengths: one after the other, and the offset of each."""
    rows = np.ascontiguousarray(own.T).view(np.uint8)
    values = rows[np.arange(rows.shape[1]) < length[:, None]]
    begins = np.concatenate([[0], np.cumsum(length)]).astype(np.int32)
    buffers = [None, arrow.py_buffer(begins), arrow.py_buffer(values)]
    return arrow.Array.from_buffers(arrow.binary(), len(length), buffers)
