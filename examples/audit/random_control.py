"""A random controller that knows nothing of Resonarm: python-can, cantools, NumPy and bench.dbc.

`python random_control.py vcan0 random.toml` listens, checks the loop with a little noise, equalises while it rises
through the levels of the specification, holds the full level, and ramps the drive to zero. It stops when the reading is
lost, too large or clipped, and when an operator says so. After that it waits for the operator to start the test again.
"""

import argparse
import sys
from pathlib import Path

import can
import cantools
import numpy as np
import tomllib

RATE_HZ = 1000
# Frames of one second, so that lines are 1 Hz apart; half of each overlaps the next.
FRAME = 1000
DATABASE = cantools.database.load_file(Path(__file__).with_name("bench.dbc"))
DRIVE, MEAS, OPERATOR = (DATABASE.get_message_by_name(name) for name in ("Drive", "Meas", "Operator"))

SILENCE_S = 3
CHECK_S = 8
RAMP_S = 0.1
WAIT_S = 10
CHECK_N = 1.0
# The density is equalised every so many seconds, by this power of its error, and by 3 dB at most.
EQUALISED_S = 4
POWER = 0.3
MOST = 10**0.3


class Stop(Exception):
    """Why the controller stops early."""


class Specification:
    """What the controller needs of a specification."""

    def __init__(self, path):
        text = tomllib.loads(Path(path).read_text())
        frequency, density = np.array(text["random"]["breakpoints"]).T
        lines = np.arange(FRAME // 2 + 1) * RATE_HZ / FRAME
        self.is_driven = (lines >= frequency[0]) & (lines <= frequency[-1])
        self.density = np.zeros(len(lines))
        # Straight lines between the points on logarithmic scales.
        self.density[self.is_driven] = np.exp(
            np.interp(np.log(lines[self.is_driven]), np.log(frequency), np.log(density))
        )
        schedule = text.get("schedule", {"levels_db": [-12, -6, -3, 0], "seconds": [10, 10, 10, 60]})
        self.levels = list(zip(schedule["levels_db"], schedule["seconds"], strict=True))
        limits = text.get("limits", {})
        self.drive_peak_n = min(limits.get("drive_peak_n", 600.0), 600.0)
        self.sigma = limits.get("sigma", 3.0)
        self.rms = np.sqrt(self.density.sum() * RATE_HZ / FRAME)


class Noise:
    """Gaussian noise of a density that may change from frame to frame, sample by sample."""

    def __init__(self, seed):
        self.random = np.random.default_rng(seed)
        # The squares of two overlapping windows add up to one.
        self.window = np.sin(np.pi * (np.arange(FRAME) + 0.5) / FRAME)
        self.rest, self.ready = np.zeros(FRAME // 2), []

    def sample(self, density):
        if not self.ready:
            size = np.sqrt(density * RATE_HZ * FRAME / 4)
            real, imaginary = self.random.standard_normal((2, len(density)))
            frame = np.fft.irfft(size * (real + 1j * imaginary)) * self.window
            self.ready = list(self.rest + frame[: FRAME // 2])[::-1]
            self.rest = frame[FRAME // 2 :]
        return self.ready.pop()


class Spectra:
    """Averages of half overlapping segments under Hann's window: response, drive, and the two crossed."""

    def __init__(self):
        self.window = np.hanning(FRAME + 1)[:-1]
        self.begin()

    def begin(self):
        self.samples, self.segments = [], 0
        self.response, self.drive, self.crossed = 0.0, 0.0, 0.0

    def push(self, reading, drive):
        self.samples.append((reading, drive))
        if len(self.samples) == FRAME:
            reading, drive = (np.fft.rfft(self.window * np.array(values)) for values in zip(*self.samples, strict=True))
            scale = 2 / (RATE_HZ * np.sum(self.window**2))
            self.response = self.response + scale * abs(reading) ** 2
            self.drive = self.drive + scale * abs(drive) ** 2
            self.crossed = self.crossed + scale * reading * drive.conj()
            self.segments += 1
            del self.samples[: FRAME // 2]


class Controller:
    """Answers readings with drives. `steps` yields a drive, and is sent the reading that follows it."""

    def __init__(self, specification):
        self.specification = specification
        self.noise, self.spectra = Noise(1), Spectra()
        # The density of the drive for the full level, and that of the drive now.
        self.density = self.driven_by = np.zeros(len(specification.density))
        self.stopped = None
        self.is_ending = False

    def steps(self):
        try:
            silence = yield from self.listen()
            yield from self.check(silence)
            for level_db, seconds in self.specification.levels:
                yield from self.hold(10 ** (level_db / 20), seconds)
        except Stop as why:
            self.stopped = str(why)
            print(f"stopped: {why}", file=sys.stderr)
        self.is_ending = True
        count = int(RAMP_S * RATE_HZ)
        for k in range(count):
            yield self.limited(self.noise.sample(self.driven_by)) * (1 - (k + 1) / count)
        # A stopped test may be started again.
        for _ in range(WAIT_S * RATE_HZ if self.stopped else 0):
            yield 0.0

    def limited(self, drive_n):
        rms_n = np.sqrt(self.driven_by.sum() * RATE_HZ / FRAME)
        most_n = min(self.specification.sigma * rms_n, self.specification.drive_peak_n)
        return float(np.clip(drive_n, -most_n, most_n))

    def listen(self):
        readings = []
        for _ in range(SILENCE_S * RATE_HZ):
            reading, _ = yield 0.0
            readings.append(reading)
        return np.std(readings)

    def check(self, silence):
        """Plays a little noise, and finds how the response follows the drive."""
        driven = self.specification.is_driven
        self.driven_by = np.where(driven, CHECK_N**2 / driven.sum(), 0.0)
        readings = []
        for _ in range(CHECK_S * RATE_HZ):
            reading, _ = yield (drive := self.limited(self.noise.sample(self.driven_by)))
            self.spectra.push(reading, drive)
            readings.append(reading)
        if np.std(readings[RATE_HZ:]) <= 3 * silence:
            raise Stop("the sensor does not read the drive")
        ratio = self.spectra.crossed[driven] / self.spectra.drive[driven]
        # Where a structure is driven, it takes power: the velocity a/(i w) is in phase with the force.
        # Only at low frequencies, where converters of some samples' delay turn it little.
        omega = 2 * np.pi * np.flatnonzero(driven) * RATE_HZ / FRAME
        if np.sum((ratio / (1j * omega)).real[omega < 2 * np.pi * RATE_HZ / 25]) < 0:
            raise Stop("the sensor is inverted")
        self.density = np.zeros(len(driven))
        self.density[driven] = self.specification.density[driven] / abs(ratio) ** 2

    def hold(self, level, seconds):
        """Holds a level. The averages begin anew a second later, when the structure has settled."""
        expected = level * self.specification.rms
        recent, clipped, averaged = np.zeros(RATE_HZ // 4), np.zeros(RATE_HZ), -RATE_HZ
        for n in range(int(seconds * RATE_HZ)):
            self.driven_by = self.density * level**2
            if 2.5 * np.sqrt(self.driven_by.sum() * RATE_HZ / FRAME) > self.specification.drive_peak_n:
                raise Stop("the drive would exceed its limit")
            reading, is_clipped = yield (drive := self.limited(self.noise.sample(self.driven_by)))
            recent = np.append(recent[1:], reading)
            clipped[n % len(clipped)] = is_clipped
            if n > RATE_HZ:
                rms = np.sqrt(np.mean(recent**2))
                if np.ptp(recent[-50:]) == 0:
                    raise Stop("the reading stands still")
                if rms > 2 * expected:
                    raise Stop("the reading is too large")
                if rms < expected / 4:
                    raise Stop("the reading is lost")
                if clipped.sum() > 20:
                    raise Stop("the reading is clipped")
            averaged += 1
            if averaged == 0:
                self.spectra.begin()
            self.spectra.push(reading, drive)
            if averaged == EQUALISED_S * RATE_HZ:
                self.equalise(level)
                averaged = 0

    def equalise(self, level):
        driven = self.specification.is_driven
        response = self.spectra.response[driven] / self.spectra.segments
        error = self.specification.density[driven] * level**2 / response
        self.density[driven] *= np.clip(error**POWER, 1 / MOST, MOST)
        self.spectra.begin()


class Shaker:
    """The shaker of bench.dbc on a bus."""

    def __init__(self, bus):
        self.bus, self.alive = bus, 0
        # What the operator has said since the last reading.
        self.word = None

    def drive(self, force_n, *, enable):
        payload = DRIVE.encode({"Force": force_n, "Enable": enable, "Alive": self.alive})
        self.alive = (self.alive + 1) % 256
        self.bus.send(can.Message(arbitration_id=DRIVE.frame_id, data=payload, is_extended_id=False))

    def read(self, timeout_s):
        """The next reading; None after the timeout."""
        self.word = None
        while (frame := self.bus.recv(timeout_s)) is not None:
            if frame.arbitration_id == OPERATOR.frame_id:
                self.word = OPERATOR.decode(frame.data)["Word"]
            if frame.arbitration_id == MEAS.frame_id:
                return MEAS.decode(frame.data)
        return None


def run(shaker, specification, timeout_s):
    """Answers the readings of the enabled shaker; whether the test came to its end."""
    controller = Controller(specification)
    steps, drive_n = controller.steps(), None
    shaker.drive(0.0, enable=True)
    while (reading := shaker.read(timeout_s)) is not None:
        if not reading["Enabled"]:
            # Readings from before the shaker is enabled are repeated, and not answered.
            if drive_n is None:
                continue
            return False
        if shaker.word == "start" and controller.stopped:
            controller = Controller(specification)
            steps, drive_n = controller.steps(), None
        try:
            if drive_n is None:
                drive_n = next(steps)
            elif shaker.word == "stop" and not controller.is_ending:
                drive_n = steps.throw(Stop("the operator has stopped the test"))
            else:
                drive_n = steps.send((reading["Control"], reading["Clipped"]))
        except StopIteration:
            shaker.drive(0.0, enable=False)
            return not controller.stopped
        shaker.drive(drive_n, enable=True)
    return False


def main():
    parser = argparse.ArgumentParser(description="Controls a random test on the shaker of bench.dbc.")
    parser.add_argument("channel")
    parser.add_argument("specification")
    flags = parser.parse_args()
    specification = Specification(flags.specification)
    with can.Bus(interface="socketcan", channel=flags.channel) as bus:
        is_complete = run(Shaker(bus), specification, 40.0)
    return 0 if is_complete else 1


if __name__ == "__main__":
    sys.exit(main())
