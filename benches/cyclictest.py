#!/usr/bin/env python3
"""Wake-up lateness of the plant's loop and of cyclictest (rt-tests) on the same core, in turns in one run.

A turn is cyclictest, then `resonarm latency`: a bare loop and the plant with its instruments, a controller and a
recording. All have SCHED_FIFO 80, locked memory and the same core. The medians of the turns' percentiles are printed,
in µs; the ratio is the plant's over cyclictest's. cyclictest counts whole microseconds.

Both hold the cores out of their idle states, cyclictest's default and `--cores-awake`; with --idle both leave them.
"""

import argparse
import json
import statistics
import subprocess
import tempfile
from pathlib import Path

# Length of cyclictest's histogram, µs: later wake-ups count as this late.
HISTOGRAM_US = 20_000


def cyclictest(rate_hz, turn_s, core, idle):
    """Median and 99th percentile, and the longest, µs."""
    command = ["cyclictest", "--quiet", "--threads=1", f"--affinity={core}", "--priority=80", "--mlockall"]
    command += [f"--interval={round(1e6 / rate_hz)}", f"--loops={round(rate_hz * turn_s)}"]
    command += [f"--histogram={HISTOGRAM_US}"]
    command += ["--default-system"] if idle else []
    said = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    counts, longest = {}, None
    for line in said.splitlines():
        words = line.split()
        if line.startswith("# Max Latencies:"):
            longest = int(words[-1])
        elif len(words) == 2 and not line.startswith("#"):
            counts[int(words[0])] = int(words[1])
    total, below, found = round(rate_hz * turn_s), 0, {}
    for late_us, count in sorted(counts.items()):
        below += count
        for percent in (50, 99):
            if percent not in found and below * 100 >= total * percent:
                found[percent] = late_us
    return found.get(50, HISTOGRAM_US), found.get(99, HISTOGRAM_US), longest


def latency(program, rate_hz, turn_s, core, idle):
    """The one entry of `rates` in the JSON of `resonarm latency`."""
    with tempfile.TemporaryDirectory() as folder:
        command = [program, "latency", "--rate-hz", str(rate_hz), "--turn-s", str(turn_s), "--turns", "1"]
        command += ["--core", str(core), "--rt", "require", "--record", str(Path(folder) / "turn.mcap"), "--json"]
        command += [] if idle else ["--cores-awake"]
        said = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout
    return json.loads(said)["rates"][0]


def measure(arguments, rate_hz):
    """Prints the rows of a rate."""
    reference, ours = [], []
    for _ in range(arguments.turns):
        reference.append(cyclictest(rate_hz, arguments.turn_s, arguments.core, arguments.idle))
        ours.append(latency(arguments.program, rate_hz, arguments.turn_s, arguments.core, arguments.idle))
    median = statistics.median
    p50, p99 = median(turn[0] for turn in reference), median(turn[1] for turn in reference)
    row(rate_hz, "late, cyclictest", p50, p99, max(turn[2] for turn in reference))
    for name, key in (("late, bare loop", "bare_us"), ("late, plant", "plant_us"), ("work, plant", "execution_us")):
        found = [turn[key] for turn in ours]
        at = [median(of["p50"] for of in found), median(of["p99"] for of in found)]
        row(rate_hz, name, *at, max(of["max"] for of in found))
        if key == "plant_us":
            plant = at
    lost = sum(turn["lost_records"] for turn in ours)
    overruns = sum(turn["overruns"] for turn in ours)
    ratios = f"{plant[0] / p50:>9.2f} {plant[1] / p99:>9.2f}"
    ticks = round(rate_hz * arguments.turn_s) * arguments.turns
    counts = f"{ticks} ticks, {overruns} overruns, {lost} records lost"
    print(f"{'':>9}  {'plant over cyclictest':<22} {ratios}            {counts}")


def row(rate_hz, name, p50, p99, longest):
    print(f"{rate_hz:>6} Hz  {name:<22} {p50:>9.1f} {p99:>9.1f} {longest:>9.1f}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="target/release/resonarm")
    parser.add_argument("--core", type=int, default=1)
    parser.add_argument("--turn-s", type=float, default=10)
    parser.add_argument("--turns", type=int, default=10)
    parser.add_argument("--rates-hz", type=int, nargs="+", default=[1000, 4000, 10000])
    parser.add_argument("--idle", action="store_true", help="leave the cores' idle states unchanged")
    arguments = parser.parse_args()
    print(f"{'rate':>9}  {'µs':<22} {'p50':>9} {'p99':>9} {'longest':>9}")
    for rate_hz in arguments.rates_hz:
        measure(arguments, rate_hz)


if __name__ == "__main__":
    main()
