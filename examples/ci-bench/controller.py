"""A controller that shakes the tip by a sine whose amplitude in the impedance head it holds."""

import math


class HeldSine:
    """Answers each sample by a force, N, along x and y of the base; None ends the run.

    Once a period the amplitude that the head has read corrects that of the command by half of what is missing.
    """

    def __init__(self, amplitude_n=10.0, frequency_hz=12.5, length_s=3.0, rate_hz=1000, limit_n=40.0):
        self.amplitude_n, self.frequency_hz, self.limit_n = amplitude_n, frequency_hz, limit_n
        self.length, self.period, self.rate_hz = round(length_s * rate_hz), round(rate_hz / frequency_hz), rate_hz
        self.command_n = 0.0
        self.read = [0.0, 0.0]

    def __call__(self, measured):
        if measured.sample >= self.length:
            return None
        angle = 2 * math.pi * self.frequency_hz * measured.sample / self.rate_hz
        force_n = measured.head_force_n[0]
        if not math.isnan(force_n):
            self.read[0] += force_n * math.cos(angle)
            self.read[1] += force_n * math.sin(angle)
        if measured.sample % self.period == self.period - 1:
            held_n = 2 * math.hypot(*self.read) / self.period
            # An open input reads nothing: the command must not grow without end.
            self.command_n = min(self.command_n + 0.5 * (self.amplitude_n - held_n), self.limit_n)
            self.read = [0.0, 0.0]
        left = (self.length - measured.sample) / self.rate_hz
        return (self.command_n * min(1.0, left / 0.2) * math.sin(angle), 0.0)
