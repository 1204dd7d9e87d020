"""The bus of a simulated plant for python-can: `can.Bus(interface="resonarm", …)`."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from os import PathLike
from typing import Any

import can

from . import _resonarm
from .protocol import Frame
from .scenario import Scenario
from .session import Node, Report
from .words import BusMode

# One for the plant, and seven for `can.Bus`.
ENDS = 8
_benches: dict[str, "_Bench"] = {}
_lock = threading.Lock()


@dataclass
class _Bench:
    """A plant on its bus in memory, running while an end of the bus is open."""

    plant: Node
    hub: _resonarm.Hub
    profile: str
    users: int = 0
    report: Report | None = field(default=None)


class ResonarmBus(can.BusABC):
    """One end of the bus of a simulated plant, which runs in this process while an end of the bus is open.

    `channel` is a name: the first end opened with it starts the plant, with the other arguments; later ones join. At
    most seven ends can be opened in a plant's life. `scenario` is a `resonarm.Scenario` or the path of one. With the
    `mode` lockstep the plant waits for the answer to each sample, so time is virtual (`speed` holds it to the
    clock); with real-time it follows the clock. `record` names an MCAP file.

    The time stamps of messages are the machine's. Remote frames and error frames can't be sent.
    """

    def __init__(
        self,
        channel: str = "resonarm",
        *,
        scenario: "Scenario | str | PathLike[str] | None" = None,
        mode: BusMode = "lockstep",
        speed: float | None = None,
        record: str | PathLike[str] | None = None,
        overwrite: bool = False,
        **kwargs: Any,
    ) -> None:
        self._is_open = False
        self.channel = str(channel)
        self.channel_info = f"resonarm {self.channel}"
        with _lock:
            bench = _benches.get(self.channel)
            if bench is None:
                bench = _start(scenario, mode, speed, record, overwrite)
                _benches[self.channel] = bench
            elif scenario is not None or record is not None:
                message = f"the plant of channel {self.channel!r} runs already: join it without scenario and record"
                raise can.CanInitializationError(message)
            self._end, self._bench = bench.hub.end(), bench
            bench.users += 1
        self._is_open = True
        self._can_protocol = can.CanProtocol.CAN_FD if bench.profile == "fd" else can.CanProtocol.CAN_20
        super().__init__(channel=channel, **kwargs)

    @property
    def dropped(self) -> int:
        """Messages lost to this end because more than 16384 messages of another end were waiting."""
        return self._end.dropped

    @property
    def plant(self) -> Node:
        """The plant: whether it runs, its events."""
        return self._bench.plant

    @property
    def report(self) -> Report | None:
        """The plant's report, available after the last end of its bus was shut down."""
        return self._bench.report

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Sends a message to every other end."""
        if msg.is_remote_frame or msg.is_error_frame:
            raise can.CanOperationError(
                "a simulated plant's bus carries no remote frames and no error frames: send a data frame"
            )
        self._check_open()
        self._end.send(Frame.of(msg))

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        self._check_open()
        parts = self._end.receive(timeout)
        if parts is None:
            return None, False
        return Frame(*parts).message(timestamp=time.time(), channel=self.channel), False

    def _check_open(self) -> None:
        if not self._is_open:
            raise can.CanOperationError("the bus is closed")

    def shutdown(self) -> None:
        """Leaves the bus; when the last end leaves, the plant stops in order."""
        super().shutdown()
        if not self._is_open:
            return
        self._is_open = False
        self._end.close()
        with _lock:
            self._bench.users -= 1
            if self._bench.users or self.channel not in _benches:
                return
            del _benches[self.channel]
        self._bench.report = self._bench.plant.end()

    @staticmethod
    def _detect_available_configs() -> list[Any]:
        return [{"interface": "resonarm", "channel": name} for name in (list(_benches) or ["resonarm"])]


@contextmanager
def served(channel: str, plant: Node, hub: _resonarm.Hub, scenario: Scenario) -> Iterator[None]:
    """Within the block `can.Bus(interface="resonarm", channel=…)` joins the bus of a running plant."""
    bench = _Bench(plant, hub, _profile(scenario), users=1)
    with _lock:
        _benches[channel] = bench
    try:
        yield
    finally:
        with _lock:
            _benches.pop(channel, None)


def _profile(scenario: Scenario) -> str:
    """Returns which frames the bus carries; a user protocol may have those of CAN FD."""
    values = scenario.values()
    return "fd" if "wire" in values else str(values["network"]["profile"])


def _start(
    scenario: "Scenario | str | PathLike[str] | None",
    mode: BusMode,
    speed: float | None,
    record: str | PathLike[str] | None,
    overwrite: bool,
) -> _Bench:
    if not isinstance(scenario, Scenario):
        scenario = Scenario() if scenario is None else Scenario.load(scenario)
    hub = _resonarm.Hub(ENDS)
    options: dict[str, Any] = {"speed": speed, "record": record, "overwrite": overwrite}
    plant = Node("plant", scenario, hub.end(), mode, **options)
    return _Bench(plant, hub, _profile(scenario))
