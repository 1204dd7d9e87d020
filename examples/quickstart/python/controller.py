"""A controller in Python: a sine of force at the tip for some seconds, in answer to the plant's samples.

    python3 python/controller.py vcan0

It needs the packages `resonarm` and `python-can`: README.md says from where.

`answer` is what to change. Python is fast enough in lockstep, in which the plant waits for each answer.
"""

import math
import sys

import can
import resonarm

RATE_HZ = 1000
FREQUENCY_HZ = 14.0
AMPLITUDE_N = 20.0
RAMP_S = 0.5
LENGTH_S = 3.0

# States of the plant in its heartbeat.
PRE_OPERATIONAL = 127
FAULT = 4
# Requests of an operator, and the node that they are for.
ARM = 1
DISARM = 2
PLANT = 1
# The plant is taken to have gone if it sends no frame for this time.
SILENCE_S = 30.0


def answer(sample: int, acceleration_m_s2: tuple[float, float]) -> tuple[float, float] | None:
    """The force to hold until the next sample, N, along x and y of the base; None ends the run."""
    t_s = sample / RATE_HZ
    if t_s >= LENGTH_S:
        return None
    # It grows at the beginning and falls at the end, so that nothing jumps.
    ramp = min(t_s, LENGTH_S - t_s, RAMP_S) / RAMP_S
    return (AMPLITUDE_N * ramp * math.sin(2 * math.pi * FREQUENCY_HZ * t_s), 0.0)


def control(bus: can.BusABC) -> float:
    """Arms the plant, answers its samples, disarms it; returns the largest acceleration at the tip along x, m/s²."""
    encoder, decoder = resonarm.Encoder(), resonarm.Decoder()
    first, largest_m_s2, done = None, 0.0, False

    def send(message: str, **signals: float) -> None:
        bus.send(encoder.encode(message, **signals).message())

    while (frame := bus.recv(SILENCE_S)) is not None:
        decoded = decoder.decode(frame)
        if decoded.verdict != "taken":
            continue
        signals = decoded.signals
        if decoded.message == "PlantHello":
            # It speaks the plant's version of the protocol, expects this rate, and asks the plant to apply its force.
            same = {name: signals[name] for name in ("profile", "version_major", "version_minor", "dbc_hash")}
            send("ExciterHello", rate_hz=RATE_HZ, **same)
            send("OperatorCommand", request=ARM, target=PLANT)
        elif decoded.message == "AccelerometerC":
            # The last message of a sample. Indices have 16 bits.
            first = signals["sample"] if first is None else first
            tip = (signals["acceleration_x_m_s2"], signals["acceleration_y_m_s2"])
            largest_m_s2 = max(largest_m_s2, abs(tip[0]))
            force_n = answer(int(signals["sample"] - first) % 65536, tip)
            done = done or force_n is None
            if done:
                send("OperatorCommand", request=DISARM, target=PLANT)
            else:
                send("ForceCommand", force_x_n=force_n[0], force_y_n=force_n[1], sample=signals["sample"])
        elif decoded.message == "PlantHeartbeat" and done and signals["state"] == PRE_OPERATIONAL:
            return largest_m_s2
        elif decoded.message == "PlantHeartbeat" and signals["state"] == FAULT:
            raise SystemExit("the plant has faulted")
    raise SystemExit(f"nothing was received for {SILENCE_S:g} s")


if __name__ == "__main__":
    with can.Bus(interface="socketcan", channel=sys.argv[1] if len(sys.argv) > 1 else "vcan0") as vcan:
        print(f"the tip's largest acceleration along x: {control(vcan):.3f} m/s²")
