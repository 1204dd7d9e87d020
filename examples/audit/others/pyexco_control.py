"""A random test whose control law is `update_psd` of pyExCo, on the shaker of bench.dbc.

`python pyexco_control.py vcan0 random.toml --drive played` plays noise in records of a few seconds. After each record
it hands pyExCo the density of the drive, that of the response by `scipy.signal.welch`, and the specified one, and plays
the density that it gets back, as the loop in pyExCo's documentation does. The package is the law and nothing else: it
has no check of the loop and no aborts, and this loop adds none. The caller's part is the schedule, the limits of the
drive, and a ramp at the end.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
import pyExCo
import scipy.signal

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from random_control import FRAME, RATE_HZ, Noise, Specification

from quick_shaker import QuickShaker

# A record, and the time before it in which the structure settles.
RECORD_S, SETTLING_S = 4, 1
# The first drive is flat and has this rms. It is equalised at the lowest level in as many records as in the example.
SEED_N, FIRST_RECORDS = 1.0, 8
RAMP_S, RESTART_S, READING_WAIT_S = 0.1, 10, 40.0


class PlantLeft(Exception):
    """The plant no longer sends readings, or has disabled the shaker."""


class Stopped(Exception):
    """Why the test ends early."""


class RandomTest:
    """A test from its first drive to its ramp."""

    def __init__(self, shaker, specification, is_played):
        self.shaker, self.specification, self.is_played = shaker, specification, is_played
        self.noise = Noise(1)
        driven = specification.is_driven
        # The density of the drive, N²/Hz, at the level that is played.
        self.density = np.where(driven, SEED_N**2 * FRAME / RATE_HZ / driven.sum(), 0.0)

    def run(self):
        """Plays the schedule; whether it came to its end."""
        (level_db, _), *_ = self.specification.levels
        try:
            self.hold(level_db, FIRST_RECORDS * (SETTLING_S + RECORD_S))
            for next_db, seconds in self.specification.levels:
                self.density = self.density * 10 ** ((next_db - level_db) / 10)
                level_db = next_db
                self.hold(level_db, seconds)
        except Stopped as why:
            print(f"stopped: {why}", file=sys.stderr)
            return False
        finally:
            count = round(RAMP_S * RATE_HZ)
            for k in range(count):
                self.sample(self.limited(self.noise.sample(self.density)) * (1 - (k + 1) / count))
        return True

    def hold(self, level_db, seconds):
        """Holds a level, and updates the density of the drive after each record."""
        target = self.specification.density * 10 ** (level_db / 10)
        left = round(seconds * RATE_HZ)
        while left > 0:
            settling, record = (min(left, round(each * RATE_HZ)) for each in (SETTLING_S, SETTLING_S + RECORD_S))
            left -= record
            drive, response = self.record(record)[:, settling:]
            if len(drive) < RECORD_S * RATE_HZ:
                continue
            played = welch(drive) if self.is_played else self.density
            try:
                self.density = pyExCo.update_psd(played, welch(response), target, normalize=False)
            except ValueError as error:
                raise Stopped(f"pyExCo: {error}") from error

    def record(self, count):
        """Plays noise; the drive and the response."""
        rows = []
        for _ in range(count):
            force_n = self.limited(self.noise.sample(self.density))
            reading = self.sample(force_n)
            if self.shaker.word == "stop":
                raise Stopped("the operator has stopped the test")
            rows.append((force_n, reading["Control"]))
        return np.array(rows).T

    def limited(self, force_n):
        rms_n = np.sqrt(self.density.sum() * RATE_HZ / FRAME)
        most_n = min(self.specification.sigma * rms_n, self.specification.drive_peak_n)
        return float(np.clip(force_n, -most_n, most_n))

    def sample(self, force_n):
        return answered(self.shaker, force_n)


def welch(samples):
    _, density = scipy.signal.welch(samples, RATE_HZ, "hann", FRAME, FRAME // 2, detrend="constant")
    return density


def answered(shaker, force_n):
    """The reading that follows a drive."""
    shaker.drive(force_n, enable=True)
    reading = shaker.read(READING_WAIT_S)
    if reading is None or not reading["Enabled"]:
        raise PlantLeft
    return reading


def run(shaker, specification, is_played):
    """Runs the test, and after a stop those that the operator starts; whether the last one came to its end."""
    shaker.drive(0.0, enable=True)
    # Readings from before the shaker is enabled are repeated, and not answered.
    while (reading := shaker.read(READING_WAIT_S)) is not None and not reading["Enabled"]:
        pass
    if reading is None:
        raise PlantLeft
    while not (is_complete := RandomTest(shaker, specification, is_played).run()):
        if not is_told_to_start(shaker):
            break
    shaker.drive(0.0, enable=False)
    return is_complete


def is_told_to_start(shaker):
    """Waits without drive for the word to start again."""
    for _ in range(RESTART_S * RATE_HZ):
        answered(shaker, 0.0)
        if shaker.word == "start":
            return True
    return False


def main():
    parser = argparse.ArgumentParser(description="Controls a random test by pyExCo on the shaker of bench.dbc.")
    parser.add_argument("channel", help="SocketCAN interface")
    parser.add_argument("specification", help="specification of the random test, a TOML file")
    parser.add_argument(
        "--drive",
        choices=["designed", "played"],
        default="designed",
        help="density of the drive that pyExCo is given: the designed one, or an estimate of the played one",
    )
    flags = parser.parse_args()
    specification = Specification(flags.specification)
    with QuickShaker(flags.channel) as shaker:
        try:
            is_complete = run(shaker, specification, flags.drive == "played")
        except PlantLeft:
            is_complete = False
    return 0 if is_complete else 1


if __name__ == "__main__":
    sys.exit(main())
