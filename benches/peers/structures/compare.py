"""Runs the peers by turns, and prints a table. `compare` beside it says how."""

import json
import math
import os
import shlex
import shutil
import statistics
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

from integrated import largest

HERE = Path(__file__).resolve().parent
RAD_S = 2.0 * math.pi
# The drive's peak, N, at tip.x, and the ends of the branch, Hz.
CASES = {
    "contact": (100.0, 2.0 / RAD_S, 15.0 / RAD_S),
    "friction": (1.0, 24.0 / RAD_S, 28.0 / RAD_S),
    "cubic": (10.0, 18.0, 26.0),
}


def lines(command, **options):
    said = subprocess.run(command, check=True, capture_output=True, text=True, **options).stdout
    return [json.loads(line.removeprefix("AUTO ")) for line in said.splitlines() if line.startswith(("{", "AUTO {"))]


def ours(program):
    for case, numbers in CASES.items():
        for line in lines([program, HERE / f"{case}.toml", "tip.x", *map(str, numbers)]):
            stability = "with" if line["stability"] else "without"
            yield case, f"Resonarm, {stability} stability, up to {line['harmonics']} harmonics", line


def pyharm(_program):
    for line in lines([sys.executable, HERE / "pyharm_branches.py", "--turns", "1"]):
        yield line["case"], f"pyHarm, {line['harmonics']} harmonics", line


def auto(_program):
    command = shlex.split(os.environ.get("AUTO", "auto-07p"))
    if shutil.which(command[0]) is None:
        return
    with tempfile.TemporaryDirectory() as folder:
        for name in ("cubic.f90", "c.cubic", "cubic.auto"):
            shutil.copy(HERE / name, folder)
        # The starting orbit: at rest, the excitation on its circle.
        with Path(folder, "cubic.dat").open("w", encoding="ascii") as out:
            for k in range(201):
                phase = RAD_S * k / 200
                print(k / 200 * 100 / 18, 0, 0, 0, 0, math.sin(phase), math.cos(phase), file=out)
        for line in lines([*command, "cubic.auto"], cwd=folder):
            yield "cubic", f"AUTO, {line['intervals']} intervals", line


def main():
    program, turns = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 5
    seconds, last = defaultdict(list), {}
    for _ in range(turns):
        for tool in (ours, pyharm, auto):
            for case, name, line in tool(program):
                seconds[case, name].append(line["seconds"])
                last[case, name] = line
    print(f"{'':9} {'':50} {'ms':>9} {'points':>7} {'time':>8}  peak (Hz, m) and folds (Hz)")
    for case in CASES:
        of = {name: times for (of_case, name), times in seconds.items() if of_case == case}
        reference = next(times for name, times in of.items() if name.startswith("Resonarm, with stability"))
        for name, times in of.items():
            line = last[case, name]
            ratio = statistics.median(time / ours for time, ours in zip(times, reference, strict=True))
            peak = " ".join(f"{number:.8g}" for number in line.get("peak", []))
            folds = ", ".join(f"{hz:.10g}" for hz in sorted(line["folds_hz"]))
            cells = f"{case:9} {name:50} {1e3 * min(times):9.2f} {line['points']:7} {ratio:7.2f}x"
            print(f"{cells}  {peak or '-'}; {folds or 'none'}")
            if "judge" in sys.argv and name.startswith("Resonarm, without") and case != "cubic":
                hz = line["peak"][0]
                print(f"{case:9} {'integrated in time at that peak':50} {'':26}   {hz:.8g} {largest(case, hz):.8g}")


main()
