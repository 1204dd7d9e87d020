"""Many motions side by side, and basins of attraction, against the program and against motions followed alone."""

import signal
import subprocess
import sys

import numpy as np
import pytest
from matplotlib.figure import Figure

import resonarm
from resonarm import _resonarm
from resonarm._dtypes import OUTCOME, view
from resonarm.basins import COORDINATES

HZ, TORQUE_NM = 21.98, 600.0
DAMPED = {"damping1_nm_s_rad": 4.5, "damping2_nm_s_rad": 4.5}
STATES = np.random.default_rng(2).normal(size=(150, 4)) * [0.2, 0.2, 30.0, 30.0]


@pytest.fixture(scope="module")
def arm():
    """The arm with five times the damping, so that motions settle soon."""
    return resonarm.Arm(parameters=DAMPED)


def test_basins_are_those_of_the_program(command, tmp_path):
    file = tmp_path / "damped.toml"
    file.write_text(resonarm.Scenario().replace(arm={"parameters": DAMPED}).to_toml())
    words = ["--torque1-nm", TORQUE_NM, "--frequency-hz", HZ, "--points", "9,8", "--scenario", file]
    document = command("basins", *words)
    found = resonarm.Arm(parameters=DAMPED).basins(HZ, torque1_nm=TORQUE_NM, points=(9, 8))
    assert found.motion.shape == found.periods.shape == (8, 9)
    cells = document["cells"]
    assert found.motion.ravel().tolist() == [cell["motion"] or 0 for cell in cells]
    assert found.periods.ravel().tolist() == [cell["periods"] or 0 for cell in cells]
    at = np.stack([np.tile(found.x, 8), np.repeat(found.y, 9)], axis=1)
    np.testing.assert_array_equal(at, [cell["at"] for cell in cells])
    assert len(found.motions) == len(document["motions"]) == 2
    for motion, expected in zip(found.motions, document["motions"], strict=True):
        assert list(motion.amplitude_rad) == expected["amplitude_rad"]
        assert [list(state) for state in motion.section] == expected["section"]
        assert (motion.period, motion.largest_multiplier) == (expected["period"], expected["largest_multiplier"])
    counts = [np.count_nonzero(found.motion == k) for k in (1, 2)]
    assert min(counts) > 5
    expected = f"of 72 states {counts[0]} reach motion 1, {counts[1]} reach motion 2>"
    assert repr(found) == f"<Basins in alpha1_rad and alpha1_dot_rad_s: {expected}"
    ax = found.plot(Figure().subplots())
    # Cells that touch: one mesh a motion, and one diamond each.
    assert [mesh.get_array().count() for mesh in ax.collections] == counts
    assert [len(line.get_xdata()) for line in ax.lines] == [0, 0, 1, 1]
    names = [text.get_text() for text in ax.get_legend().get_texts()]
    assert names == ["reaches motion 1", "reaches motion 2", "stable motions"]


def test_cores_and_neighbours_change_no_bit(arm):
    sine = ((TORQUE_NM, 0.0), (0.0, 0.0), HZ)
    attractors = _resonarm.Attractors(arm, sine)
    on_cores, alone = [view(attractors.outcomes(STATES.tobytes(), 4.0, cores), OUTCOME) for cores in (True, False)]
    assert (on_cores == alone).all()
    whole = arm.ensemble(STATES, 30, frequency_hz=HZ, torque1_nm=TORQUE_NM, every=20)
    assert whole.shape == (3, 150)
    np.testing.assert_array_equal(whole["t_s"][:, 7], np.array([0, 20, 30]) / HZ)
    for k in (0, 77, 149):
        one = arm.ensemble(STATES[k : k + 1], 30, frequency_hz=HZ, torque1_nm=TORQUE_NM, every=20)
        np.testing.assert_array_equal(one[:, 0], whole[:, k])


def test_an_ensemble_equals_its_motions_one_by_one(arm):
    drive = {"torque2_nm": 30.0}
    last = arm.ensemble(STATES[:5], 8, frequency_hz=20.0, **drive)[-1]
    for state, end in zip(STATES[:5], last, strict=True):
        motion = arm.simulate(0.4, frequency_hz=20.0, initial=state, rate_hz=20_000, scheme="gl6", every=8000, **drive)
        np.testing.assert_allclose(motion["alpha_rad"][-1], end["alpha_rad"], atol=1e-9)
        np.testing.assert_allclose(motion["alpha_dot_rad_s"][-1], end["alpha_dot_rad_s"], atol=1e-7)


def test_a_stable_motion_repeats(arm):
    attractors = _resonarm.Attractors(arm, ((TORQUE_NM, 0.0), (0.0, 0.0), HZ))
    sections = np.array([motion.section[0] for motion in attractors.motions])
    rows = arm.ensemble(sections, 3, frequency_hz=HZ, torque1_nm=TORQUE_NM)
    np.testing.assert_allclose(rows["alpha_rad"][-1], sections[:, :2], atol=1e-9)
    assert repr(attractors.motions[1]).startswith("StableMotion(period=1, largest_multiplier=0.99")


@pytest.mark.parametrize(
    ("load", "drive"),
    [("torque2_nm", "torque2"), ("force_x_n", "force-x"), ("force_y_n", "force-y")],
)
def test_every_load_has_its_branch(load, drive):
    arm, hz = resonarm.Arm(), np.linspace(12, 18, 5)
    branch = arm.continuation("frequency", 12, 18, **{load: 0.1})
    for joint in (0, 1):
        found = np.interp(hz, branch.points["value"], branch.points["harmonic1_rad"][:, joint])
        linear = 0.1 * abs(arm.frf(hz, drive=drive, response=f"alpha{joint + 1}"))
        np.testing.assert_allclose(found, linear, rtol=2e-3)


ENDLESS = """
import resonarm
try:
    print("begun", flush=True)
    resonarm.Arm().ensemble([(0.1, 0, 0, 0)] * 500, 4_000_000_000, frequency_hz=22.0)
except KeyboardInterrupt:
    print("interrupted")
"""


def test_an_interrupt_ends_an_ensemble():
    with subprocess.Popen([sys.executable, "-c", ENDLESS], stdout=subprocess.PIPE, text=True) as run:
        assert run.stdout.readline() == "begun\n"
        run.send_signal(signal.SIGINT)
        assert run.communicate(timeout=120)[0] == "interrupted\n"


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda arm: arm.basins(-1.0, torque1_nm=1.0), "excitation frequency -1 Hz: it must be a positive number"),
        (lambda arm: arm.basins(22.0), "give the excitation: torque1_nm=A, or force_x_n=A"),
        (lambda arm: arm.basins(22.0, torque1_nm=1.0, points=(1, 5)), "points has 1: it must be from 2 to 1000"),
        (lambda arm: arm.basins(22.0, torque1_nm=1.0, points=(5,)), "points has 1 values: it needs two, X,Y"),
        (lambda arm: arm.basins(22.0, torque1_nm=1.0, start=(1, 1), stop=(1, 2)), "the grid goes from 1 to 1"),
        (lambda arm: arm.basins(22.0, torque1_nm=1.0, coordinates=("a", "b")), "there is no coordinate `a`: the coord"),
        (lambda arm: arm.basins(22.0, torque1_nm=1.0, coordinates=["alpha1_rad"] * 2), "has alpha1_rad twice"),
        (lambda arm: arm.basins(22.0, torque1_nm=1.0, points=(2, 2), time_constants=0.0), "time_constants is 0"),
        (lambda arm: arm.ensemble([(0, 0, 0)], 1, frequency_hz=1.0), "initial has the shape (1, 3)"),
        (lambda arm: arm.ensemble([(0, 0, 0, np.nan)], 1, frequency_hz=1.0), "is not finite"),
        (lambda arm: arm.ensemble([(0, 0, 0, 0)], 0, frequency_hz=1.0), "periods is 0: it must be from 1 to"),
        (lambda arm: arm.ensemble([(0, 0, 0, 0)], 1, frequency_hz=1e-9), "a period would take"),
    ],
)
def test_invalid_arguments_are_value_errors(arm, call, message):
    with pytest.raises(ValueError) as raised:
        call(arm)
    assert message in str(raised.value)


def test_coordinates_have_the_names_of_the_channels():
    """basins called the velocity of joint 1 alpha_dot1_rad_s, recordings and exports alpha1_dot_rad_s."""
    channels = {name for _vector, names in _resonarm.arm_channels("states") for name in names}
    assert set(COORDINATES) <= channels
