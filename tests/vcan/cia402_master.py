"""A CANopen master by `canopen`, unmodified: two drives of the arm in the mode cyclic synchronous torque.

As a program it commands sines until it is killed, and prints the positions of each cycle. It ends if a drive does not
answer within 5 s: one that starts later than its master, or boots anew, never will.
"""

import math
import socket
import sys
import threading
import time

import canopen
from canopen.profiles.p402 import BaseNode402

MODE = "CYCLIC SYNCHRONOUS TORQUE"
PATIENCE_S = 60
SINES_PATIENCE_S = 5
# A frame takes about 800 bytes of a socket's memory. By default it holds 270 frames, the TPDOs of two drives for 1.4 s. While a
# busy machine stops the client for longer, frames are lost, and the answer that the client waits for may be one of them.
RECEIVE_BYTES = 1 << 23
SO_RCVBUFFORCE = 33


def patient(node, patience_s=PATIENCE_S):
    """The client's own timeouts and memory, which a busy machine exceeds; the timeout of a reset always passes, and stays."""
    try:
        node.network.bus.socket.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, RECEIVE_BYTES)
    except PermissionError:
        # Only the machine's root may exceed the kernel's limit.
        node.network.bus.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BYTES)
    node.sdo.RESPONSE_TIMEOUT = patience_s
    node.TIMEOUT_CHECK_TPDO = node.TIMEOUT_SWITCH_STATE_SINGLE = node.TIMEOUT_SWITCH_STATE_FINAL = patience_s
    node.TIMEOUT_SWITCH_OP_MODE = patience_s


class Master:
    """Both drives, each with the data sheet that the program has made of it."""

    def __init__(self, interface, sheets, patience_s=PATIENCE_S):
        self.network = canopen.Network()
        self.network.connect(interface="socketcan", channel=interface)
        self.nodes = [self.network.add_node(BaseNode402(number, str(path))) for number, path in sheets.items()]
        for node in self.nodes:
            patient(node, patience_s)
        self.patience_s = patience_s
        self.received = threading.Condition()
        self.positions = {}

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.network.disconnect()

    def set_up(self):
        for node in self.nodes:
            node.nmt.state = "OPERATIONAL"
            node.setup_402_state_machine()
            node.tpdo[2].add_callback(lambda pdo, node=node: self.arrived(node.id, pdo))

    def arm(self):
        for node in self.nodes:
            node.op_mode = MODE
            node.state = "OPERATION ENABLED"

    def arrived(self, number, pdo):
        with self.received:
            self.positions[number] = pdo[0x6064].raw
            self.received.notify_all()

    def cycle(self, targets):
        """Targets by RPDO 1 and a SYNC; the positions that it asks for."""
        with self.received:
            self.positions.clear()
        for node, target in zip(self.nodes, targets, strict=True):
            node.rpdo[1][0x6040].raw = 0x0F
            node.rpdo[1][0x6071].raw = target
            node.rpdo[1].transmit()
        self.network.sync.transmit()
        with self.received:
            assert self.received.wait_for(lambda: len(self.positions) == len(self.nodes), self.patience_s)
            return [self.positions[node.id] for node in self.nodes]


def sines():
    """Commands sines until it is killed."""
    interface, *paths = sys.argv[1:]
    with Master(interface, dict(enumerate(paths, 1)), SINES_PATIENCE_S) as master:
        master.set_up()
        master.arm()
        start = time.monotonic()
        while True:
            phase = 2 * math.pi * 2.0 * (time.monotonic() - start)
            print(*master.cycle([round(500 * math.sin(phase)), round(200 * math.cos(phase))]), flush=True)
            time.sleep(0.005)


if __name__ == "__main__":
    sines()
