"""The protocol's codec, with E2E protection, as `firmware-protocol/SPEC.md` specifies it."""

from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

from . import _extras, _resonarm
from .words import MessageName, NodeRole, Verdict

LARGEST_IDENTIFIER = 0x1FFF_FFFF
ERROR_FRAME = "an error frame is a report of the local CAN controller, and was never on the bus"


class Frame(NamedTuple):
    """A CAN frame of data."""

    identifier: int
    extended: bool
    data: bytes
    fd: bool
    bitrate_switch: bool

    @classmethod
    def of(cls, message: Any) -> "Frame":
        """The frame of a `can.Message` with data.

        Raises ValueError for a remote frame and an error frame, TypeError for anything else.
        """
        try:
            identifier, extended = message.arbitration_id, message.is_extended_id
            frame = cls(identifier, extended, bytes(message.data), message.is_fd, message.bitrate_switch)
            is_error, is_remote = message.is_error_frame, message.is_remote_frame
        except AttributeError:
            what = type(message).__name__
            raise TypeError(
                f"the frame is {what}: it must be a resonarm.Frame or a can.Message, which have identifier and data"
            ) from None
        if is_error or is_remote:
            kind = "an error frame" if is_error else "a remote frame"
            raise ValueError(f"the message is {kind}, of identifier 0x{identifier:X}: it must be a data frame")
        return frame

    def message(self, **more: Any) -> Any:
        """The frame as a `can.Message`; `more` are its other arguments, such as `timestamp`."""
        return _extras.require("can", "can").Message(
            arbitration_id=self.identifier,
            is_extended_id=self.extended,
            data=self.data,
            is_fd=self.fd,
            bitrate_switch=self.bitrate_switch,
            **more,
        )


@dataclass(frozen=True)
class Decoded:
    """The content of a frame, and the verdict of a receiver."""

    verdict: Verdict
    """`taken`; `refused`, for the `reason`; or `foreign`: of another network or protocol."""
    message: MessageName | Literal[""] = ""
    """The message, by its name in the DBC."""
    sender: NodeRole | Literal[""] = ""
    """Node that sends the message: `plant` or `exciter`."""
    signals: dict[str, float] = field(default_factory=dict)
    """Values by the signals' names in the DBC, in their units; only of a frame that is taken."""
    reason: str = ""
    """Reason why the frame is rejected, or why it is foreign if it is an error frame."""


class Network(_resonarm.Network):
    """A plant and an exciter on a bus: `base` identifier (a multiple of 0x10 from 0x180 to 0x570), node ids (1 to
    127), and the `profile` of commands and samples, classic or fd. Networks are equal if all of these are.

    Raises ValueError for invalid identifiers and profiles.
    """

    def _value(self) -> tuple[int, int, int, str]:
        return (self.base, self.plant_id, self.exciter_id, self.profile)

    def __eq__(self, other: object) -> bool:
        return self._value() == other._value() if isinstance(other, Network) else NotImplemented

    def __hash__(self) -> int:
        return hash(self._value())

    def __repr__(self) -> str:
        ids = f"plant_id={self.plant_id}, exciter_id={self.exciter_id}"
        return f"Network(base={self.base:#x}, {ids}, profile={self.profile!r})"


def _checked(network: Network | None) -> Network:
    """The network, by default the usual one. Raises TypeError for anything else."""
    if network is not None and not isinstance(network, _resonarm.Network):
        raise TypeError(f"network is of the type {type(network).__name__}: it must be a resonarm.Network")
    return Network() if network is None else network


class Encoder(_resonarm.Encoder):
    """Makes frames of a network, each message with its own counter, from 0 on."""

    def __new__(cls, network: Network | None = None) -> "Encoder":
        return super().__new__(cls, _checked(network))

    def encode(self, message: MessageName, **signals: float) -> Frame:
        """The next frame of a message by its name in the DBC, protected; marks of saturation that are left out are 0.

        Raises ValueError for an unknown message or signal, one that is missing, or a value that the wire can't carry.
        """
        return Frame(*self.encode_parts(message, signals))


class Decoder(_resonarm.Decoder):
    """Decodes the frames of a network as a receiver does: checks form, E2E protection and content of each, and
    supervises the counters. `lost` is the number of lost frames according to the counters."""

    def __new__(cls, network: Network | None = None) -> "Decoder":
        return super().__new__(cls, _checked(network))

    def decode(self, frame: Any) -> Decoded:
        """Decodes a `Frame`, or a `can.Message`: an error frame is foreign, a remote frame never holds a message.

        Raises TypeError for anything else, ValueError for a frame that no bus carries.
        """
        if getattr(frame, "is_error_frame", False):
            return Decoded("foreign", reason=ERROR_FRAME)
        if getattr(frame, "is_remote_frame", False):
            return Decoded(*self.decode_remote(frame.arbitration_id, frame.is_extended_id))
        parts = frame if isinstance(frame, Frame) else Frame.of(frame)
        if not isinstance(parts.data, bytes | bytearray):
            raise TypeError(f"data is of the type {type(parts.data).__name__}: it must be bytes")
        if not 0 <= parts.identifier <= LARGEST_IDENTIFIER:
            raise ValueError(f"identifier is {parts.identifier}: it must be from 0 to 0x{LARGEST_IDENTIFIER:X}")
        return Decoded(*self.decode_parts(parts))
