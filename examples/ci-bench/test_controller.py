"""What the controller must do on the bench, also when the bus and the instruments fail."""

from pathlib import Path

import pytest
from controller import HeldSine

AMPLITUDE_N = 10.0
LIMIT_N = 40.0
pytestmark = pytest.mark.scenario(Path(__file__).with_name("bench.toml"))


def test_the_force_in_the_head_is_held(bench):
    result = bench.run(HeldSine(AMPLITUDE_N))
    result.assert_completed()
    result.assert_no_refused_command()
    result.assert_no_overrun()
    result.assert_settled("head_force_x_n", 12.5, from_s=1.2, to_s=2.6, amplitude=AMPLITUDE_N, within=0.02)


def test_its_command_stays_below_its_limit_when_the_head_is_silent(bench):
    with bench.sensor_fault("head", "stuck", axis="x", from_s=0.0):
        result = bench.run(HeldSine(AMPLITUDE_N, limit_n=LIMIT_N))
    result.assert_completed()
    result.assert_force_below(1.001 * LIMIT_N)


def test_a_late_bus_does_not_disturb_it(bench):
    with bench.delay(0.002):
        result = bench.run(HeldSine(AMPLITUDE_N))
    result.assert_completed()
    result.assert_settled("head_force_x_n", 12.5, from_s=1.2, to_s=2.6, amplitude=AMPLITUDE_N, within=0.02)


def test_the_force_ends_when_its_commands_are_lost(bench):
    with bench.loss(direction="receive", ids=[0x201], probability=0.9):
        result = bench.run(HeldSine(AMPLITUDE_N))
    result.assert_faulted()
    assert result.signal("force_x_n")[1][-1] == 0.0
