"""Many responses at once, and basins of attraction, against responses followed alone."""

import signal
import subprocess
import sys

import numpy as np
import pytest

import resonarm
from resonarm import _resonarm
from resonarm._dtypes import OUTCOME, view

HZ, DRIVE = 21.98, {"joint1": 600.0}
STATES = np.random.default_rng(2).normal(size=(70, 4)) * [0.2, 0.2, 30.0, 30.0]


@pytest.fixture(scope="module")
def arm():
    """The robot arm with five times the damping, so that responses settle soon."""
    return resonarm.Chain.preset().replace({"link1.damping_nm_s_rad": 4.5, "link2.damping_nm_s_rad": 4.5})


def test_cores_and_neighbours_change_no_bit(arm):
    attractors = _resonarm.Attractors(arm, ([("joint1", 1.0)], 600.0, HZ, []))
    few = STATES[:5].tobytes()
    on_cores, alone = [view(attractors.outcomes(few, 1.0, cores), OUTCOME) for cores in (True, False)]
    assert (on_cores == alone).all()
    whole = arm.ensemble(STATES, 30, frequency_hz=HZ, drive=DRIVE, every=20)
    assert whole.shape == (3, 70) and whole.dtype.names == ("t_s", "alpha_rad", "alpha_dot_rad_s")
    np.testing.assert_array_equal(whole["t_s"][:, 7], np.array([0, 20, 30]) / HZ)
    for k in (0, 37, 69):
        one = arm.ensemble(STATES[k : k + 1], 30, frequency_hz=HZ, drive=DRIVE, every=20)
        np.testing.assert_array_equal(one[:, 0], whole[:, k])


def test_an_ensemble_equals_its_motions_one_by_one(arm):
    drive = {"joint2": 30.0}
    last = arm.ensemble(STATES[:5], 8, frequency_hz=20.0, drive=drive)[-1]
    for state, end in zip(STATES[:5], last, strict=True):
        motion = arm.simulate(
            0.4, frequency_hz=20.0, initial=state, rate_hz=20_000, scheme="gl6", every=8000, drive=drive
        )
        np.testing.assert_allclose(motion["alpha_rad"][-1], end["alpha_rad"], atol=1e-9)
        np.testing.assert_allclose(motion["alpha_dot_rad_s"][-1], end["alpha_dot_rad_s"], atol=1e-7)


def test_a_stable_motion_repeats(arm):
    basins = arm.basins(HZ, drive=DRIVE, points=(2, 2), time_constants=0.1)
    assert len(basins.motions) == 2
    sections = np.array([motion.section[0] for motion in basins.motions])
    rows = arm.ensemble(sections, 3, frequency_hz=HZ, drive=DRIVE)
    np.testing.assert_allclose(rows["alpha_rad"][-1], sections[:, :2], atol=1e-9)
    assert repr(basins.motions[1]).startswith("<StableMotion of period 1, largest multiplier 0.99")
    assert repr(basins).startswith("<Basins of 4 states, alpha1_rad from -")
    assert ": 0 reach response 1, 0 reach" in repr(basins)


def test_states_of_elements_go_along():
    friction = resonarm.Element(kind="friction", at="tip.x", stiffness_n_m=1e4, slip_force_n=1.0)
    mode = resonarm.ModeShape(frequency_hz=20.0, damping_ratio=0.01, shape={"tip.x": 0.5})
    modal = resonarm.Modal([mode], elements=[friction])
    rows = modal.ensemble([(0.01, 0.0), (0.02, 0.1)], 4, frequency_hz=15.0, drive={"tip.x": 5.0}, every=1)
    assert rows.shape == (5, 2) and rows.dtype.names == ("t_s", "q_m_sqrt_kg", "q_dot_m_sqrt_kg_s", "element1_m")
    middle = rows[2]
    states = np.column_stack([middle["q_m_sqrt_kg"], middle["q_dot_m_sqrt_kg_s"], middle["element1_m"]])
    rest = modal.ensemble(states, 2, frequency_hz=15.0, drive={"tip.x": 5.0})
    np.testing.assert_array_equal(rest["q_m_sqrt_kg"][-1], rows["q_m_sqrt_kg"][-1])
    assert abs(rows["element1_m"]).max() > 0


ENDLESS = """
import resonarm
try:
    print("begun", flush=True)
    resonarm.Chain.preset().ensemble([(0.1, 0, 0, 0)] * 500, 4_000_000_000, frequency_hz=22.0, drive={"joint1": 1.0})
except KeyboardInterrupt:
    print("interrupted")
"""


def test_an_interrupt_ends_an_ensemble():
    with subprocess.Popen([sys.executable, "-c", ENDLESS], stdout=subprocess.PIPE, text=True) as run:
        assert run.stdout.readline() == "begun\n"
        run.send_signal(signal.SIGINT)
        assert run.communicate(timeout=120)[0] == "interrupted\n"


ONE = {"drive": {"joint1": 1.0}}


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda arm: arm.basins(-1.0, **ONE), "frequency_hz is -1: it must be a positive number"),
        (lambda arm: arm.basins(22.0, **ONE, points=(1, 5)), "points has 1: each must be from 2 to 1000"),
        (lambda arm: arm.basins(22.0, **ONE, points=(5,)), "points has 1 values, expected two: X,Y"),
        (lambda arm: arm.basins(22.0, **ONE, start=(1, 1), stop=(1, 2)), "invalid grid from 1 to 1"),
        (lambda arm: arm.basins(22.0, **ONE, coordinates=("a", "b")), "unknown coordinate `a`: the coord"),
        (lambda arm: arm.basins(22.0, **ONE, coordinates=["alpha1_rad"] * 2), "has alpha1_rad twice"),
        (lambda arm: arm.basins(22.0, **ONE, points=(2, 2), time_constants=0.0), "time_constants is 0"),
        (lambda arm: arm.ensemble([(0, 0, 0)], 1, frequency_hz=1.0, **ONE), "initial has the shape (1, 3)"),
        (lambda arm: arm.ensemble([(0, 0, 0, np.nan)], 1, frequency_hz=1.0, **ONE), "initial is not finite in row 0"),
        (lambda arm: arm.ensemble([(0, 0, 0, 0)], 0, frequency_hz=1.0, **ONE), "periods is 0: it must be from 1 to"),
        (lambda arm: arm.ensemble([(0, 0, 0, 0)], 1, frequency_hz=1e-9, **ONE), "a period would take"),
    ],
)
def test_invalid_arguments_are_value_errors(arm, call, message):
    with pytest.raises(ValueError) as raised:
        call(arm)
    assert message in str(raised.value)


def test_coordinates_have_the_names_of_the_channels(arm):
    """basins called the velocity of joint 1 alpha_dot1_rad_s, recordings and exports alpha1_dot_rad_s."""
    channels = {name for _vector, names in resonarm.Plant().channels() for name in names}
    basins = arm.basins(HZ, drive=DRIVE, points=(2, 2), time_constants=0.1)
    assert set(basins.known) <= channels


def test_responses_of_several_periods_are_found_from_undecided_states():
    # A sub-harmonic of order 3 of x″ + 0.01x′ + x + x³ = 4 sin 4.5t, by another code's shooting.
    mode = resonarm.ModeShape(frequency_hz=1 / (2 * np.pi), damping_ratio=0.005, shape={"tip.x": 1.0})
    cubic = resonarm.Element(kind="cubic", at="tip.x", stiffness3_n_m3=1.0)
    modal = resonarm.Modal([mode], elements=[cubic])
    around = {"start": (1.16, 0.11), "stop": (1.17, 0.12), "points": (2, 2), "time_constants": 10}
    basins = modal.basins(4.5 / (2 * np.pi), drive={"tip.x": 4}, **around)
    assert [motion.period for motion in basins.motions][-1] == 3
    assert (basins.motion == len(basins.motions)).all()
    assert "q1_m_sqrt_kg from 1.16 to 1.17" in repr(basins)
