"""The simulated bench as hardware of Rattlesnake, the controller of vibration tests of Sandia National Laboratories.

Rattlesnake's acquisition and output are processes, each with an object of hardware that has the methods below
(`components/abstract_hardware.py` there; releases from 4 on call the two set-ups `initialize_hardware`). Virtual
hardware steps its model in `read`, by the samples that `write` has put into a queue between the two.

    queue = multiprocessing.Queue()
    acquisition = ResonarmAcquisition("scenarios/bench.toml", queue)
    output = ResonarmOutput(queue)

Channels are those of Rattlesnake's channel table: one that has a feedback device is an output, `force-x` or `force-y`
at the tip by its node, in N; each other one is a reading by its node and direction: `head x`, `b y`, `c x`, in N or
m/s². The sample rate of the test is the scenario's.
"""

import queue as queues
from multiprocessing.queues import Queue
from os import PathLike
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

import resonarm

OUTPUTS = {"force-x": 0, "force-y": 1}
READINGS = {"head": "head_force_n", "b": "acceleration_b_m_s2", "c": "acceleration_c_m_s2"}
AXES = {"x": 0, "y": 1}


class Channel(Protocol):
    """The columns of the channel table that are used."""

    node_number: str
    node_direction: str
    feedback_device: str | None


class Parameters(Protocol):
    """The parts of a test's `DataAcquisitionParameters` that are used."""

    sample_rate: float
    samples_per_read: int
    samples_per_write: int
    output_oversample: int


class ResonarmAcquisition:
    """Reads the plant's instruments, and steps the plant meanwhile."""

    def __init__(self, scenario: str | PathLike[str], queue: "Queue[NDArray[np.float64]]") -> None:
        self.scenario, self.queue = resonarm.Scenario.load(scenario), queue
        self.plant = resonarm.Plant(self.scenario)

    def set_up_data_acquisition_parameters_and_channels(self, test_data: Parameters, channel_data: list[Any]) -> None:
        """Checks rate and channels. Raises ValueError for those that the bench does not have."""
        if test_data.sample_rate != self.scenario.sample_rate_hz or test_data.output_oversample != 1:
            raise ValueError(
                f"the test has {test_data.sample_rate:g} Hz, {test_data.output_oversample} times as much at the "
                f"output: the scenario has {self.scenario.sample_rate_hz:g} Hz at both"
            )
        self.samples_per_read, self.delay = test_data.samples_per_read, test_data.samples_per_write
        self.frame_s = self.samples_per_read / test_data.sample_rate
        self.channels = [_channel(channel) for channel in channel_data]
        self.outputs = [axis for name, axis in self.channels if name == "force"]
        self.pending = np.zeros((len(self.outputs), 0))

    def start(self) -> None:
        """Restarts with the arm in the scenario's initial state."""
        self.plant = resonarm.Plant(self.scenario)
        self.pending = self.pending[:, :0]

    def get_acquisition_delay(self) -> int:
        """Samples from the writing of a frame to the end of its playing."""
        return self.delay

    def read(self) -> NDArray[np.float64]:
        """The next frame, a row for each channel, while the arm moves under the forces written; under no force if no
        frame is written within the duration of a frame, as when the output has stopped."""
        while self.pending.shape[1] < self.samples_per_read:
            try:
                written = self.queue.get(timeout=self.frame_s)
            except queues.Empty:
                written = np.zeros((len(self.outputs), self.samples_per_read))
            self.pending = np.concatenate([self.pending, written], axis=1)
        frame, self.pending = np.split(self.pending, [self.samples_per_read], axis=1)
        return self._played(frame)

    def read_remaining(self) -> NDArray[np.float64]:
        """One more sample, under no force."""
        return self._played(np.zeros((len(self.outputs), 1)))

    def _played(self, frame: NDArray[np.float64]) -> NDArray[np.float64]:
        force_n = np.zeros((frame.shape[1], 2))
        force_n[:, self.outputs] = frame.T
        rows = self.plant.play(force_n=force_n)
        return np.stack([force_n[:, axis] if name == "force" else rows[name][:, axis] for name, axis in self.channels])

    def stop(self) -> None:
        """Drops frames that were written and not played."""
        self.pending = self.pending[:, :0]

    def close(self) -> None:
        """Nothing to release."""


class ResonarmOutput:
    """Passes the frames that Rattlesnake writes to the acquisition."""

    def __init__(self, queue: "Queue[NDArray[np.float64]]") -> None:
        self.queue = queue

    def set_up_data_output_parameters_and_channels(self, test_data: Parameters, channel_data: list[Any]) -> None:
        """Counts the outputs."""
        self.count = sum(bool(channel.feedback_device) for channel in channel_data)

    def start(self) -> None:
        """Nothing to do: the acquisition starts by itself."""

    def write(self, data: NDArray[np.float64]) -> None:
        """Writes a frame, a row for each output, N. Raises ValueError for another number of rows."""
        if data.shape[0] != self.count:
            raise ValueError(f"{data.shape[0]} rows were written for {self.count} outputs")
        self.queue.put(np.array(data, np.float64))

    def ready_for_new_output(self) -> bool:
        """Whether every frame written has been taken."""
        return self.queue.empty()

    def stop(self) -> None:
        """Takes back the frames that were not taken."""
        while True:
            try:
                self.queue.get(timeout=0.01)
            except queues.Empty:
                return

    def close(self) -> None:
        """Nothing to release."""


def _channel(channel: Channel) -> tuple[str, int]:
    """The column of a channel, and its axis."""
    node, direction = str(channel.node_number).lower(), str(channel.node_direction or "").lower().strip("+")
    if channel.feedback_device:
        if node not in OUTPUTS:
            raise ValueError(f"there is no output {node!r}: expected one of {', '.join(OUTPUTS)}")
        return "force", OUTPUTS[node]
    if node not in READINGS or direction not in AXES:
        raise ValueError(f"there is no reading {node!r} {direction!r}: expected head, b or c along x or y")
    return READINGS[node], AXES[direction]
