"""The excitation A·sin(2πft) of calls that take its amplitudes by keyword."""

import math
from dataclasses import dataclass

Sine = tuple[tuple[float, float], tuple[float, float], float]
"""Torques at the joints, N·m, and forces at the tip, N, at the peak; the frequency, Hz."""


@dataclass(frozen=True)
class Load:
    """Amplitudes of torques at the joints, N·m, or of forces at the tip, N; None for those not given."""

    torque1_nm: float | None = None
    torque2_nm: float | None = None
    force_x_n: float | None = None
    force_y_n: float | None = None

    @property
    def is_torque(self) -> bool:
        """Whether a torque is given."""
        return self.torque1_nm is not None or self.torque2_nm is not None

    @property
    def is_force(self) -> bool:
        """Whether a force is given."""
        return self.force_x_n is not None or self.force_y_n is not None

    @property
    def components(self) -> tuple[float, float, float, float]:
        """u1, u2, Fx, Fy."""
        return (self.torque1_nm or 0.0, self.torque2_nm or 0.0, self.force_x_n or 0.0, self.force_y_n or 0.0)

    def checked(self) -> "Load":
        """The same, if it is an excitation: either torques or forces, not all 0."""
        if self.is_torque == self.is_force:
            raise ValueError(
                "give the excitation: torque1_nm=A, or force_x_n=A and force_y_n=A; torque2_nm=A is one at joint 2"
            )
        amplitude = math.hypot(*self.components)
        if not (math.isfinite(amplitude) and amplitude > 0):
            raise ValueError(
                "the excitation's amplitude, of torque1_nm or force_x_n and force_y_n, "
                f"is {amplitude:g}: it must be a finite number other than 0"
            )
        return self

    def sine(self, frequency_hz: float) -> Sine:
        """The excitation at a frequency. Raises ValueError for an amplitude that is not finite."""
        for name, amplitude in vars(self).items():
            if amplitude is not None and not math.isfinite(amplitude):
                raise ValueError(f"{name} is {amplitude:g}: it must be a finite number")
        u1, u2, fx, fy = self.components
        return (u1, u2), (fx, fy), frequency_hz
