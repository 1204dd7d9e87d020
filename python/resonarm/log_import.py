"""Logs of other tools as recordings."""

from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from . import _extras, _resonarm
from .scenario import Scenario

# What the program reads itself.
FORMATS = {".log": "candump", ".asc": "asc", ".blf": "blf"}


def import_log(
    log: str | PathLike[str],
    output: str | PathLike[str],
    *,
    scenario: Scenario | None = None,
    interface: str | None = None,
    by_sync: bool = False,
    overwrite: bool = False,
) -> dict[str, Any]:
    """Makes the recording `output` of a log, as `resonarm import` does, and returns what that prints with `--json`.

    `.log` of candump, `.asc` and `.blf` are read directly. All other formats, such as `.trc`, `.mf4` and python-can's
    own `.csv`, are read by python-can, which takes asammdf for MF4: the extras `can` and `export` install them.
    Error frames are left out.

    `scenario` says what was logged: network and rate, or the protocol of `[wire]`. `interface` chooses the channel,
    that of the first frame if it is None. With `by_sync` each SYNC begins a sample of CANopen drives.

    Raises ValueError for a log that can't be read or has no frames, OSError if a file can't be read or written.
    """
    path = Path(log)
    suffix = path.suffix.lower()
    keywords: dict[str, Any] = {
        "scenario": scenario,
        "interface": interface,
        "by_sync": by_sync,
        "overwrite": overwrite,
    }
    if suffix in FORMATS:
        name = FORMATS[suffix]
        return _resonarm.import_log(path, name, Path(output), (path, name), **keywords)
    can = _extras.require("can", "can")
    if suffix == ".mf4":
        _extras.require("asammdf", "export")
    with TemporaryDirectory(prefix="resonarm-") as folder:
        converted = Path(folder) / "converted.log"
        with can.LogReader(path) as messages, converted.open("w", encoding="utf-8") as lines:
            # The CSV of python-can has no column for the direction.
            error_frames = _write_candump(messages, lines, has_directions=suffix != ".csv")
        imported = _resonarm.import_log(converted, "candump", Path(output), (path, suffix[1:]), **keywords)
    imported["others"] += error_frames
    return imported


def _write_candump(messages: Iterable[Any], lines: Any, *, has_directions: bool) -> int:
    """Writes messages of python-can as lines of `candump -L`; returns the number of error frames, left out of it."""
    error_frames = 0
    for message in messages:
        if message.is_error_frame:
            error_frames += 1
            continue
        identifier = f"{message.arbitration_id:0{8 if message.is_extended_id else 3}X}"
        data = bytes(message.data).hex().upper()
        if message.is_remote_frame:
            # The codes 9 to 15 mean 8 bytes in a classical frame.
            content = f"#R{min(message.dlc, 8)}"
        elif message.is_fd:
            # The digit has the flags of `struct canfd_frame`: bit 0 is BRS, bit 1 ESI.
            content = f"##{message.bitrate_switch + 2 * message.error_state_indicator}{data}"
        else:
            content = f"#{data}"
        seconds, nanoseconds = divmod(round(message.timestamp * 1e9), 1_000_000_000)
        channel = "" if message.channel is None else "".join(str(message.channel).split())
        direction = f" {'R' if message.is_rx else 'T'}" if has_directions else ""
        lines.write(f"({seconds}.{nanoseconds:09}) {channel or 'can'} {identifier}{content}{direction}\n")
    return error_frames
