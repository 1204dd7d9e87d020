"""A controller that knows nothing of Resonarm: python-can, cantools and bench.dbc.

It enables the shaker, answers each reading of the enabled shaker with the next value of a sine, disables the shaker, and
prints what it saw as JSON: `python controller.py vcan0`.
"""

import argparse
import json
import math
import sys
import time
from pathlib import Path

import can
import cantools

DATABASE = cantools.database.load_file(Path(__file__).with_name("bench.dbc"))
DRIVE, MEAS, POSE = (DATABASE.get_message_by_name(name) for name in ("Drive", "Meas", "Pose"))
# The data ids of AUTOSAR's profile 1.
DRIVE_ID = 0x123
MEAS_ID = 0x124
OPERATIONAL = 2
FAULT = 3


def crc8(data_id, payload):
    """The checksum of profile 1: CRC-8 of SAE J1850 over the data id and the bytes before the checksum."""
    crc = 0
    for byte in [data_id & 0xFF, data_id >> 8, *payload[:7]]:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ 0x1D if crc & 0x80 else crc << 1) & 0xFF
    return crc


class Shaker:
    """The shaker on a bus."""

    def __init__(self, bus):
        self.bus, self.alive = bus, 0

    def drive(self, force_n, *, enable=True, reset=False):
        values = {"Force": force_n, "Enable": enable, "Reset": reset, "Alive": self.alive, "Crc": 0}
        payload = bytearray(DRIVE.encode(values))
        payload[7] = crc8(DRIVE_ID, payload)
        self.alive = (self.alive + 1) % 15
        self.bus.send(can.Message(arbitration_id=DRIVE.frame_id, data=payload, is_extended_id=False))

    def read(self, timeout_s):
        """The next reading or pose, with the name of its message; None after the timeout."""
        while (frame := self.bus.recv(timeout_s)) is not None:
            if frame.arbitration_id == MEAS.frame_id:
                if crc8(MEAS_ID, frame.data) != frame.data[7]:
                    raise ValueError(f"wrong checksum: {frame}")
                return "Meas", MEAS.decode(frame.data, decode_choices=False)
            if frame.arbitration_id == POSE.frame_id:
                return "Pose", POSE.decode(frame.data)
        return None


def sine(shaker, amplitude_n, frequency_hz, samples, timeout_s):
    """Plays so many samples of a sine at 1 kHz; the readings and poses that came while the shaker was enabled."""
    readings, poses, is_armed = [], [], False
    armed_by_s = time.monotonic() + timeout_s
    shaker.drive(0.0)
    while len(readings) < samples and (read := shaker.read(timeout_s)) is not None:
        name, values = read
        if name == "Pose":
            poses += [values] if is_armed else []
            continue
        was_armed, is_armed = is_armed, values["State"] == OPERATIONAL
        if values["State"] == FAULT or (was_armed and not is_armed):
            break
        if not is_armed:
            # A reading from before the command above arrived. In lockstep the shaker repeats it until it is enabled.
            if time.monotonic() > armed_by_s:
                break
            continue
        readings.append(values)
        shaker.drive(amplitude_n * math.sin(2 * math.pi * frequency_hz * len(readings) / 1000))
    shaker.drive(0.0, enable=False)
    return readings, poses


def main():
    parser = argparse.ArgumentParser(description="Plays a sine on the shaker of bench.dbc.")
    parser.add_argument("channel")
    parser.add_argument("--amplitude-n", type=float, default=20.0)
    parser.add_argument("--frequency-hz", type=float, default=5.0)
    parser.add_argument("--samples", type=int, default=2000)
    parser.add_argument("--timeout-s", type=float, default=10.0)
    flags = parser.parse_args()
    with can.Bus(interface="socketcan", channel=flags.channel, fd=True) as bus:
        played = sine(Shaker(bus), flags.amplitude_n, flags.frequency_hz, flags.samples, flags.timeout_s)
    readings, poses = played
    last = readings[-1] if readings else None
    json.dump({"readings": len(readings), "poses": len(poses), "last": last}, sys.stdout)
    return 0 if len(readings) == flags.samples else 1


if __name__ == "__main__":
    sys.exit(main())
