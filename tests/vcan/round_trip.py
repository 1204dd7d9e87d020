"""What plant and controller add to a round trip on CAN: the closed loop of two processes against a bare ping-pong of
the same frames between two processes on raw sockets (ping_pong.c), on the same interface.

    tests/vcan/with-vcan target/venv/bin/python tests/vcan/round_trip.py [TURNS]

Bare and closed loop take turns, and medians stand beside each other, so that what a shared machine does meanwhile
strikes both. Two figures: in real time, both at one rate, the round trip from the sending of a sample to the kernel's
time stamp of the command, µs; in lockstep, one round at once after the other, µs a round. This measures; it fails by no
time."""

import sys
import tempfile
import time
from pathlib import Path
from statistics import median

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))
from processes import Programs, run, wait_until

INTERFACE = "vcan0"
RATE_HZ, PACED_S = 200, 4
# Rounds of a turn without pauses. What a run takes to begin and to end is in both, and in the difference no more.
FEW, MANY = 1000, 9000

SCENARIO = """
simulation = {{ rate_hz = {rate_hz} }}
network = {{ command_timeout_s = 10, partner_timeout_s = 30 }}
[excitation]
amplitude = {{ exciter_x = 50.0 }}
profile = {{ waveform = "dwell", frequency_hz = 15.0, duration_s = {duration_s}, settle_s = 0.1 }}
"""


class Bench:
    """Both kinds of turns."""

    def __init__(self, folder):
        self.folder = Path(folder)
        self.ping_pong = self.folder / "ping_pong"
        run("cc", "-O2", "-o", self.ping_pong, Path(__file__).with_name("ping_pong.c"))

    def scenario(self, rate_hz, samples):
        path = self.folder / f"{rate_hz}-{samples}.toml"
        path.write_text(SCENARIO.format(rate_hz=rate_hz, duration_s=samples / rate_hz))
        return path

    def bare(self, rounds, period_ns):
        """Seconds of all rounds, and the median round trip, µs."""
        with Programs() as programs:
            pong = programs.start("pong", self.ping_pong, "pong", INTERFACE)
            wait_until(lambda: pong.stdout, "pong")
            words = run(self.ping_pong, "ping", INTERFACE, rounds, period_ns).split()
        return float(words[0]), float(words[1])

    def closed(self, mode, rate_hz, samples):
        """Seconds from the controller's start to the plant's end, and the median round trip, µs."""
        scenario = self.scenario(rate_hz, samples)
        with Programs() as programs:
            common = ["--bus", INTERFACE, "--mode", mode, "--scenario", scenario, "--json"]
            plant = programs.resonarm("run", *common, "--stop-on-disarm")
            wait_until(lambda: "ready" in plant.stderr, "the plant")
            begin_s = time.monotonic()
            exciter = programs.resonarm("exciter", *common)
            trips, took_s = plant.result()["round_trip_us"], time.monotonic() - begin_s
            exciter.result()
        return took_s, trips and trips["p50"]

    def paced(self):
        """Round trips at the rate, µs: bare, closed loop."""
        bare = self.bare(RATE_HZ * PACED_S, 1_000_000_000 // RATE_HZ)[1]
        return bare, self.closed("real-time", RATE_HZ, RATE_HZ * PACED_S)[1]

    def at_once(self):
        """µs a round without pauses: bare, closed loop."""
        bare_us = self.bare(MANY, 0)[0] / MANY * 1e6
        few_s, many_s = (self.closed("lockstep", 1000, rounds)[0] for rounds in (FEW, MANY))
        return bare_us, (many_s - few_s) / (MANY - FEW) * 1e6


def main():
    turns = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(folder)
        kinds = {f"real time, {RATE_HZ} Hz": bench.paced, "lockstep": bench.at_once}
        figures = {kind: [] for kind in kinds}
        for _ in range(turns):
            for kind, measure in kinds.items():
                figures[kind].append(measure())
    print(f"{'µs a round trip, medians of ' + str(turns) + ' turns':40} {'bare':>8} {'closed':>8} {'ratio':>6}")
    for kind, pairs in figures.items():
        bare_us, closed_us = (median(column) for column in zip(*pairs, strict=True))
        print(f"{kind:40} {bare_us:8.1f} {closed_us:8.1f} {closed_us / bare_us:6.2f}")


if __name__ == "__main__":
    main()
