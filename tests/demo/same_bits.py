"""Runs the demo again and again, beside busy loops or while it is stopped for a while, and says whether every run
recorded the same states, bit for bit.

    target/venv/bin/python tests/demo/same_bits.py [--runs 20] [--busy 4] [--stops 5] [--speed 1] [--at-once 1]

Exit code 1 if a run failed or differs.
"""

import argparse
import hashlib
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

from processes import RESONARM
from recordings import Recording

STOP_S = 0.3
WALK_S = 40


def demo(arguments, number):
    """The exit code of one run, and the digest of its states."""
    with tempfile.TemporaryDirectory() as folder:
        words = [RESONARM, "demo", "--json", "--speed", str(arguments.speed), "--out", folder]
        process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        # Reproducible moments, different in each run.
        chance = random.Random(number)
        for _ in range(arguments.stops):
            time.sleep(chance.uniform(0.3, 0.9) * WALK_S / max(arguments.stops, 1) / max(arguments.speed, 1))
            process.send_signal(signal.SIGSTOP)
            time.sleep(STOP_S)
            process.send_signal(signal.SIGCONT)
        _, said = process.communicate()
        if process.returncode != 0:
            return process.returncode, said.decode()
        states = np.ascontiguousarray(Recording.whole(Path(folder) / "demo.mcap").states)
        return 0, f"{len(states)} samples, sha256 {hashlib.sha256(states.tobytes()).hexdigest()[:16]}"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name, default in (("runs", 20), ("busy", 0), ("stops", 0), ("at-once", 1)):
        parser.add_argument(f"--{name}", type=int, default=default)
    parser.add_argument("--speed", type=float, default=1.0)
    arguments = parser.parse_args()
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(arguments.busy)]
    try:
        with ThreadPoolExecutor(arguments.at_once) as pool:
            results = list(pool.map(lambda number: demo(arguments, number), range(arguments.runs)))
    finally:
        for loop in busy:
            loop.kill()
    good = [said for code, said in results if code == 0]
    for code, said in results:
        print(f"exit code {code}: {said}" if code else said)
    print(f"{len(good)} of {arguments.runs} runs finished, {len(set(good))} different recordings of states")
    return 0 if len(good) == arguments.runs and len(set(good)) == 1 else 1


if __name__ == "__main__":
    os.environ.setdefault("PYTHONDONTWRITEBYTECODE", "1")
    sys.exit(main())
