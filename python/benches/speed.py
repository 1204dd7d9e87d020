"""The cost of calls from Python: import, stepping in batches and one by one, a round trip on a bus.

    python3 python/benches/speed.py [INTERFACE]

With an interface of the kernel the round trip is measured on it, too: a frame sent by python-can, echoed by a thread.
"""

import subprocess
import sys
import threading
import time

import numpy as np

import resonarm

TURNS = 2000


def fastest(work, times=5):
    """The shortest time that `work` takes, s."""
    found = []
    for _ in range(times):
        begun = time.perf_counter()
        work()
        found.append(time.perf_counter() - begun)
    return min(found)


def stepping():
    loads = np.random.default_rng(1).normal(scale=10, size=(100_000, 2))
    batch = fastest(lambda: resonarm.Plant().play(force_n=loads))
    print(f"stepping in a batch: {len(loads) / batch:,.0f} samples/s")

    def one_by_one():
        plant = resonarm.Plant()
        for _ in range(20_000):
            ax, ay = plant.measure().acceleration_c_m_s2
            plant.advance((10.0 - 0.5 * ax, -0.5 * ay))

    print(f"one by one, with a controller in Python: {20_000 / fastest(one_by_one):,.0f} samples/s")


def importing():
    def seconds(code):
        timed = f"import time; begun = time.perf_counter(); {code}; print(time.perf_counter() - begun)"
        words = [sys.executable, "-c", timed]
        return min(float(subprocess.run(words, capture_output=True, text=True, check=True).stdout) for _ in range(5))

    print(f"import: {seconds('import resonarm') * 1e3:.0f} ms, of which NumPy {seconds('import numpy') * 1e3:.0f} ms")


def round_trip(name, near, far):
    """Median time from sending a frame until its echo is received, µs."""
    import can

    def echo():
        for _ in range(TURNS):
            far.send(far.recv(60))

    thread = threading.Thread(target=echo)
    thread.start()
    took = []
    for k in range(TURNS):
        message = can.Message(arbitration_id=0x7E0 + k % 2, is_extended_id=False, data=[k % 256] * 8)
        begun = time.perf_counter()
        near.send(message)
        near.recv(60)
        took.append(time.perf_counter() - begun)
    thread.join()
    print(f"round trip, {name}: median {np.median(took) * 1e6:.0f} µs, p99 {np.quantile(took, 0.99) * 1e6:.0f} µs")
    near.shutdown()
    far.shutdown()


def buses(interface):
    import can

    filters = [{"can_id": 0x7E0, "can_mask": 0x7FE}]
    for name in ("resonarm", "virtual"):
        ends = [can.Bus(interface=name, channel="speed", can_filters=filters) for _ in range(2)]
        round_trip(f"python-can's interface {name}", *ends)
    if interface:
        ends = [can.Bus(interface="socketcan", channel=interface, can_filters=filters) for _ in range(2)]
        round_trip(f"python-can's interface socketcan, {interface}", *ends)


if __name__ == "__main__":
    importing()
    stepping()
    buses(sys.argv[1] if len(sys.argv) > 1 else None)
