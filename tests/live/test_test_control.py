"""A vibration test in the live view: what is specified, how far the test is, what it has reached, and why it is stopped."""

import os
from pathlib import Path

import numpy as np
import pytest
from live_view import open_page
from test_page import IN_ORDER

EXAMPLES = Path("examples/test-control").resolve()
# Pictures of the pages stay where this says.
PICTURES = os.environ.get("RESONARM_PICTURES")


def scenario(folder, kind, faults=""):
    """An example of test control, with faults of its sensor."""
    (folder / f"{kind}.toml").write_text((EXAMPLES / f"{kind}.toml").read_text())
    written = folder / "scenario.toml"
    written.write_text((EXAMPLES / f"{kind}-exciter.toml").read_text() + faults)
    return written


def running(programs, browser, written, speed):
    arguments = ["--mode", "free", "--speed", speed, "--live", "127.0.0.1", "--scenario", written]
    return open_page(browser, programs.resonarm("run", *arguments), height=1500)


def keep(page, folder, name):
    assert page.value(IN_ORDER) and page.errors == []
    page.picture(Path(PICTURES or folder) / name)


# The profile of random.toml by hand: straight lines between its points on logarithmic scales.
def test_a_random_test_is_shown_in_its_tolerance_and_says_why_it_is_stopped(browser, programs, tmp_path):
    # 12 s at full level, then the cable is off.
    dead = '[[rig.faults]]\ninstrument = "c"\nkind = "dropout"\nfrom_s = 70.0\n'
    page = running(programs, browser, scenario(tmp_path, "random", dead), 8)
    plan = page.value("resonarm.data.about.test")
    frequency_hz = np.arange(10, 201)
    demand = np.exp(np.interp(np.log(frequency_hz), np.log([10, 20, 100, 200]), np.log([0.02, 0.2, 0.2, 0.05])))
    assert plan["frequency_hz"] == pytest.approx(frequency_hz) and plan["demand"] == pytest.approx(demand)
    # A tolerance of 3 dB either way: the demand is a density, so tenths of the exponent are decibels.
    assert plan["low"] == pytest.approx(demand / 10**0.3) and plan["high"] == pytest.approx(demand * 10**0.3)
    reached = page.until("resonarm.data.test?.level_db === 0 && resonarm.data.test.full_level_s > 8 && resonarm.data.test")
    # At full level a line of some 30 degrees of freedom scatters by 1.1 dB; the rms of all lines by 0.1 dB.
    density = np.array(reached["reached"])
    assert density.sum() == pytest.approx(demand.sum(), rel=0.1) and reached["factor"] == 1
    assert reached["words"].startswith("rms 5.") and " of 187 lines beyond the tolerance" in reached["words"]
    keep(page, tmp_path, "random-test.png")
    stopped = page.until("document.getElementById('test-stopped').textContent")
    assert stopped.startswith("The controller stops the test: the control ")
    keep(page, tmp_path, "random-test-stopped.png")


def test_a_swept_sine_is_shown_at_the_frequencies_that_it_has_passed(browser, programs, tmp_path):
    page = running(programs, browser, scenario(tmp_path, "sine"), 8)
    assert page.value("resonarm.data.about.test.quantity") == "amplitude"
    page.until("resonarm.data.test?.reached.filter((value) => value !== null).length > 20")
    plan, test = page.value("[resonarm.data.about.test, resonarm.data.test]")
    at = [k for k, value in enumerate(test["reached"]) if value is not None]
    shares = np.array([test["reached"][k] / plan["demand"][k] for k in at])
    assert np.all(np.diff(at) > 0) and np.median(shares) == pytest.approx(1, abs=0.1)
    # Data and text in one look: the sweep goes on, and between two looks on a busy machine the frequency has changed.
    state = "document.querySelector('#test-state').textContent"
    assert page.until(f"{state}.includes(resonarm.data.test?.frequency_hz?.toFixed(2) + ' Hz')")
    keep(page, tmp_path, "sine-test.png")


def test_a_shock_is_shown_by_its_response_spectrum(browser, programs, tmp_path):
    page = running(programs, browser, scenario(tmp_path, "shock"), 8)
    test = page.until("resonarm.data.test?.words.startsWith('last shot') && resonarm.data.test")
    plan = page.value("resonarm.data.about.test")
    assert len(test["reached"]) == len(plan["demand"]) == len(plan["frequency_hz"])
    # Oscillators much slower than the pulse with its compensation hardly answer; around the pulse's own they do as specified.
    largest = int(np.argmax(plan["demand"]))
    assert test["reached"][largest] == pytest.approx(test["factor"] * plan["demand"][largest], rel=0.25)
    # The axis has labels although its lowest frequency is not round.
    labels = page.value("resonarm.views.test.plot.axes[0]._values.filter((label) => label)")
    assert len(labels) >= 3 and all(str(label)[0] in "125" for label in labels), labels
    keep(page, tmp_path, "shock-test.png")
