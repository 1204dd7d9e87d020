"""Recordings as logs of python-can: `can.LogReader("run.mcap")` and `can.Logger("log.mcap")`."""

from collections.abc import Iterator
from typing import Any

import can
from can.io.generic import MessageReader, MessageWriter
from can.typechecking import StringPathLike

from . import _resonarm
from .protocol import Frame
from .recording import Recording

CHUNK = 4096


def messages(recording: Recording) -> Iterator[can.Message]:
    """The frames of a recording as messages, as `McapReader` has them."""
    origin = recording.summary["origin"]
    start_ns = origin["start_unix_ns"] or 0
    for chunk in recording.chunks("frames", CHUNK):
        for row in chunk:
            yield can.Message(
                timestamp=int(row["bus_unix_ns"] or start_ns + int(row["time_ns"])) * 1e-9,
                arbitration_id=int(row["identifier"]),
                is_extended_id=bool(row["extended"]),
                is_remote_frame=bool(row["remote"]),
                is_rx=bool(row["received"]),
                is_fd=bool(row["fd"]),
                bitrate_switch=bool(row["bitrate_switch"]),
                error_state_indicator=bool(row["error_state_indicator"]),
                dlc=int(row["length"]),
                data=recording.frame_data(row),
                channel=origin["interface"],
            )


class McapReader(MessageReader):
    """The frames of a recording as messages, in the order of the file. A message that the plant received has `is_rx`.

    The time stamp is that of the bus if there is one, otherwise the time when the run loop handled the frame, s of the
    UNIX epoch; in a run in simulated time alone it counts from the start of the run.
    """

    def __init__(self, file: StringPathLike, **kwargs: Any) -> None:
        self._recording = Recording(str(file))

    def __iter__(self) -> Iterator[can.Message]:
        return messages(self._recording)

    def stop(self) -> None:
        """Nothing to close."""


class McapWriter(MessageWriter):
    """Writes messages into a recording that has only frames, as `resonarm import` makes one; replaces an existing
    file.

    The file is created after messages of a quarter of a second, or at the end; without messages there is no file. Error
    frames and remote frames are left out. The file is complete after `stop`. A message may be up to a quarter of a
    second earlier than the first one; the recording begins with the earliest.
    """

    def __init__(self, file: StringPathLike, *, append: bool = False, **kwargs: Any) -> None:
        if append:
            raise ValueError(
                f"{file}: nothing can be appended to a recording: write another; "
                "`resonarm merge` joins parts of one run"
            )
        self._log: _resonarm.LogWriter | None = _resonarm.LogWriter(str(file))

    def on_message_received(self, msg: can.Message) -> None:
        """Writes a message into the log."""
        if self._log is None:
            raise ValueError("the log is closed")
        if not (msg.is_error_frame or msg.is_remote_frame):
            channel = "" if msg.channel is None else str(msg.channel)
            self._log.write(Frame.of(msg), round(msg.timestamp * 1e9), msg.is_rx, channel)

    def stop(self) -> None:
        """Ends the recording."""
        if self._log is not None:
            log, self._log = self._log, None
            log.finish()
