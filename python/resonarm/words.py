"""The words that calls take, as types, so that a type checker finds a wrong one."""

from typing import Literal

Preset = Literal["irb1600-table1", "irb1600-fitted"]
"""A parameter set that comes with the package."""
Quantity = Literal["receptance", "mobility", "accelerance"]
"""The quantity of a frequency response (ISO 7626-1)."""
Scheme = Literal["rk4", "dop853", "gl4", "gl6", "exponential", "exponential8"]
"""An integration scheme."""
Window = Literal["hann", "rectangular", "hamming", "blackman", "blackman-harris", "flat-top"]
"""The window of a segment."""
Detrend = Literal["none", "constant", "linear"]
"""The trend that is taken off each segment: none, its mean, or the straight line of least squares."""
Mode = Literal["free", "lockstep", "real-time"]
"""Source of the time of a run: only the simulation, the answers of a partner, or the clock."""
BusMode = Literal["lockstep", "real-time"]
"""The same for a node on a bus."""
LoadKind = Literal["force", "torque"]
"""The load that a controller commands: a force at the tip, N, or torques at the joints, N·m."""
Overrun = Literal["slip", "continue", "fault", "stop"]
"""The reaction to a missed deadline, in real time."""
RealTime = Literal["auto", "require", "off"]
"""Strictness with which a run in real time demands a real-time thread."""
Spin = Literal["auto", "off"]
"""Time for which a loop polls the clock before a deadline: as long as its sleeps are late, or not at all."""
NodeRole = Literal["plant", "exciter"]
"""A node of a network."""
Profile = Literal["classic", "fd"]
"""The CAN frames of commands and samples."""
NodeState = Literal["boot_up", "pre_operational", "operational", "fault"]
"""A state of a node."""
MessageName = Literal[
    "OperatorCommand",
    "ForceCommand",
    "TorqueCommand",
    "ImpedanceHead",
    "AccelerometerB",
    "AccelerometerC",
    "PlantHello",
    "ExciterHello",
    "PlantHeartbeat",
    "ExciterHeartbeat",
    "PlantEmergency",
    "ExciterEmergency",
    "Sensors",
    "SensorPair",
    "PlantCapabilities",
    "ExciterCapabilities",
]
"""A message, by its name in the DBC."""
Verdict = Literal["taken", "refused", "foreign"]
"""The verdict of a receiver on a frame."""
Undecided = Literal["fail", "pass"]
"""What a record does that does not decide whether a specification is met."""
Fault = Literal[
    "command timeout",
    "sensor timeout",
    "heartbeat lost",
    "partner fault",
    "incompatible",
    "command out of range",
    "simulation failed",
    "overrun",
    "bus loss",
    "sample sequence",
    "second sender",
    "exciter tripped",
    "stop requested",
]
"""A fault, by its name in the protocol's specification."""
NetworkFault = Literal[
    "loss", "delay", "jitter", "reordering", "duplication", "bit_error", "babble", "bus_off", "link_down"
]
"""A fault of the network, as in `[[network.faults]]` of a scenario."""
SensorFault = Literal["stuck", "dropout", "drift", "noise", "spike", "gain", "distortion"]
"""A fault of an instrument, as in `[[rig.faults]]` of a scenario."""
RecordingPart = Literal["states", "samples", "frames", "ticks", "events"]
"""A part of a recording: its records of one kind."""
Reading = Literal["head_force_n", "acceleration_b_m_s2", "acceleration_c_m_s2"]
"""A reading of the instruments, by its name."""
Format = Literal["parquet", "mf4", "blf"]
"""A format of export."""
