"""The controller as a test, on a bus in memory or on a virtual one: `pytest python`. README.md says what it needs.

In pytest the controller is the function alone; the package arms the plant and joins the two.
"""

from pathlib import Path

import pytest
from controller import AMPLITUDE_N, FREQUENCY_HZ, answer

SCENARIO = Path(__file__).parents[1] / "scenario.toml"


@pytest.mark.scenario(SCENARIO)
def test_the_force_is_held_and_never_above_its_amplitude(bench):
    result = bench.run(lambda measured: answer(measured.sample, (0.0, 0.0)))
    result.assert_completed()
    result.assert_no_refused_command()
    result.assert_force_below(1.01 * AMPLITUDE_N)
    result.assert_settled("head_force_x_n", FREQUENCY_HZ, from_s=1.0, to_s=2.0, amplitude=AMPLITUDE_N, within=0.05)
