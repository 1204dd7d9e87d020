"""Columns of a recording as Arrow's: the words of a column of 8 bytes are Arrow's own memory, without a copy."""

import json
from collections.abc import Iterator
from typing import Any

import numpy as np

from . import _extras
from ._dtypes import Array, components, unit, words


def schema_metadata(**values: Any) -> dict[str, str]:
    """The metadata of a recording in a schema: texts unchanged, other values as JSON."""
    return {name: value if isinstance(value, str) else json.dumps(value) for name, value in values.items()}


def batch(buffer: bytearray, names: list[str], rows: int, dtype: np.dtype[Any], metadata: dict[str, str]) -> Any:
    """A `pyarrow.RecordBatch` of the columns of words that the extension passes, and of the names of events.

    Numbers of 8 bytes are not copied; truth values, shorter integers and payloads, which Arrow packs, are.
    """
    arrow = _extras.require("pyarrow", "arrow")
    columns = np.frombuffer(buffer, "<u8").reshape(-1, rows) if rows else np.empty((dtype.itemsize // 8, 0), "<u8")
    fields, arrays = [], []
    if dtype.names and len(names) == rows and "value" in dtype.names:
        fields.append(arrow.field("name", arrow.string()))
        arrays.append(arrow.array(names, arrow.string()))
    for name, array in _named(arrow, columns, dtype):
        of = unit(name)
        fields.append(arrow.field(name, array.type, metadata={"unit": of} if of else None))
        arrays.append(array)
    return arrow.RecordBatch.from_arrays(arrays, schema=arrow.schema(fields, metadata=metadata))


def _named(arrow: Any, columns: Array, dtype: np.dtype[Any]) -> Iterator[tuple[str, Any]]:
    """Arrow's arrays by the names of the CSV of `resonarm export`."""
    first = 0
    for name in dtype.names or ():
        form = dtype[name]
        own = columns[first : first + words(form)]
        first += words(form)
        if name == "data":
            length = columns[_place(dtype, "length")]
            yield name, _payloads(arrow, own, np.where(columns[_place(dtype, "remote")], 0, length))
        elif form.shape:
            for column_name, column in zip(components(name, own.T), own, strict=True):
                yield column_name, _column(arrow, column, form.base)
        else:
            yield name, _column(arrow, own[0], form)


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
