"""A client by `odrive-can`, unmodified: one axis in torque control, which plays a sine until the axis stops.

`python odrive_client.py vcan0 NODE_ID` ends when the axis leaves closed-loop control.
"""

import asyncio
import math
import sys

import can
from odrive_can.odrive import ODriveCAN

CLOSED_LOOP = "CLOSED_LOOP_CONTROL"
# Between two commands.
PERIOD_S = 0.02


async def work(interface, node_id):
    drive = ODriveCAN(node_id, can.Bus(interface="socketcan", channel=interface))
    await drive.start()
    drive.clear_errors()
    drive.set_controller_mode("TORQUE_CONTROL", "PASSTHROUGH")
    while drive.axis_state != CLOSED_LOOP:
        drive.set_axis_state_no_wait(CLOSED_LOOP)
        drive.set_input_torque(0.0)
        await asyncio.sleep(0.05)
    # By the number of commands, and from the first one on: a client that is held up has commanded a torque, too.
    commands = 0
    while drive.axis_state == CLOSED_LOOP:
        commands += 1
        drive.set_input_torque(math.sin(2 * math.pi * 2.0 * PERIOD_S * commands))
        await asyncio.sleep(PERIOD_S)
    drive.stop()


if __name__ == "__main__":
    asyncio.run(work(sys.argv[1], int(sys.argv[2])))
