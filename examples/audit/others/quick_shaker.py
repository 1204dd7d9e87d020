"""The shaker of bench.dbc by bare sockets: the messages of `random_control.Shaker`, sent and read in less time.

An audit plays a million samples in lockstep, and each waits for the script. python-can and cantools take most of it.
"""

import socket
import struct
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from random_control import DRIVE, MEAS, OPERATOR, Shaker

# A frame of SocketCAN: identifier, length, three bytes of padding, eight bytes of data.
FRAME = struct.Struct("=IB3x8s")
# The messages as bench.dbc has them.
DRIVE_DATA = struct.Struct("<hBB4x")
MEAS_DATA = struct.Struct("<hhB3x")
FORCE_N, ACCELERATION_M_S2 = 0.02, 0.005
WORDS = {1: "stop", 2: "start", 3: "level"}


class QuickShaker(Shaker):
    """The shaker on a SocketCAN interface."""

    def __init__(self, channel):
        bus = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        bus.bind((channel,))
        super().__init__(bus)
        self.timeout_s = None

    def drive(self, force_n, *, enable):
        data = DRIVE_DATA.pack(round(force_n / FORCE_N), enable, self.alive)
        self.alive = (self.alive + 1) % 256
        self.bus.send(FRAME.pack(DRIVE.frame_id, DRIVE.length, data))

    def read(self, timeout_s):
        """The next reading; None after the timeout."""
        self.word = None
        if timeout_s != self.timeout_s:
            # The kernel keeps the timeout, which spares a call to wait for each frame.
            seconds, part = divmod(timeout_s, 1.0)
            self.bus.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, struct.pack("ll", int(seconds), int(part * 1e6)))
            self.timeout_s = timeout_s
        while True:
            try:
                identifier, _, data = FRAME.unpack(self.bus.recv(FRAME.size))
            except BlockingIOError:
                return None
            if identifier == MEAS.frame_id:
                control, response, flags = MEAS_DATA.unpack(data)
                return {
                    "Control": control * ACCELERATION_M_S2,
                    "Response": response * ACCELERATION_M_S2,
                    "Enabled": flags & 1,
                    "Clipped": flags >> 1 & 1,
                }
            if identifier == OPERATOR.frame_id:
                self.word = WORDS.get(data[0])

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.bus.close()
