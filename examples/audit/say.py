"""An operator that says a word to the controller, by the message Operator of bench.dbc: `python say.py vcan0 stop`."""

import sys
from pathlib import Path

import can
import cantools

OPERATOR = cantools.database.load_file(Path(__file__).with_name("bench.dbc")).get_message_by_name("Operator")


def main():
    channel, word = sys.argv[1:]
    data = OPERATOR.encode({"Word": word})
    with can.Bus(interface="socketcan", channel=channel) as bus:
        bus.send(can.Message(arbitration_id=OPERATOR.frame_id, data=data, is_extended_id=False))


if __name__ == "__main__":
    main()
