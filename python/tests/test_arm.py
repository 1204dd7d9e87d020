"""The arm, against independent equations and against the program."""

import pickle

import numpy as np
import pytest
from linear_arm import LinearArm

import resonarm

POSES = [(0.0, 60.0), (35.0, -110.0)]


@pytest.mark.parametrize(("beta1_deg", "beta2_deg"), POSES)
def test_modes_are_those_of_independent_equations(beta1_deg, beta2_deg):
    modes = resonarm.Arm(beta1_deg=beta1_deg, beta2_deg=beta2_deg).modes()
    expected = LinearArm(beta1_deg, beta2_deg).natural_frequencies_hz()
    np.testing.assert_allclose([mode.frequency_hz for mode in modes], expected, rtol=1e-9)


@pytest.mark.parametrize(("beta1_deg", "beta2_deg"), POSES)
def test_frequency_responses_are_those_of_independent_equations(beta1_deg, beta2_deg):
    arm, linear = resonarm.Arm(beta1_deg=beta1_deg, beta2_deg=beta2_deg), LinearArm(beta1_deg, beta2_deg)
    hz = np.array([[5.0, 15.0], [30.0, 77.0]])
    found = {
        place: arm.frf(hz, drive="force-y", response=place, quantity="accelerance")
        for place in ("b-x", "b-y", "c-x", "c-y")
    }
    for index in np.ndindex(hz.shape):
        expected = linear.accelerations(hz[index], (0.0, 1.0))
        np.testing.assert_allclose([found[place][index] for place in found], expected, rtol=1e-9)
    assert arm.frf(15.0).shape == ()


def test_a_simulated_motion_is_that_of_the_program(command):
    words = ["--beta2-deg", 75, "--torque1-nm", 60, "--frequency-hz", 22.1, "--scheme", "gl6", "--duration-s", 0.5]
    document = command("simulate", *words)
    motion = resonarm.Arm(beta2_deg=75).simulate(0.5, torque1_nm=60, frequency_hz=22.1, scheme="gl6", every=7)
    assert list(motion["alpha_rad"][-1]) == document["alpha_rad"]
    assert list(motion["alpha_dot_rad_s"][-1]) == document["alpha_dot_rad_s"]
    assert motion["t_s"][-1] == document["t_s"]
    assert not motion["alpha_rad"][0].any()


def test_a_motion_can_be_continued():
    arm = resonarm.Arm()
    whole = arm.simulate(0.2, initial=(0.01, 0, 0, 0))
    middle = whole[len(whole) // 2]
    rest = arm.simulate(0.1, initial=(*middle["alpha_rad"], *middle["alpha_dot_rad_s"]))
    assert (rest["alpha_rad"][-1] == whole["alpha_rad"][-1]).all()
    assert len(arm.simulate(0.2, every=100)) == 1 + 4


def test_parameters_are_those_of_the_preset_unless_given():
    arm = resonarm.Arm("irb1600-table1", parameters={"mass2_kg": 40, "gravity": None})
    assert arm.parameters["mass2_kg"] == 40
    assert arm.parameters["inertia2_kg_m2"] == 0.0009
    assert repr(arm) == "Arm('irb1600-table1', beta1_deg=0, beta2_deg=60, parameters={'mass2_kg': 40})"
    again = pickle.loads(pickle.dumps(arm))
    assert repr(again) == repr(arm)
    assert again.modes()[0].frequency_hz == arm.modes()[0].frequency_hz


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda arm: resonarm.Arm("irb"), "there is no preset `irb`: the presets are irb1600-table1, irb1600-fitted"),
        (lambda arm: resonarm.Arm(parameters={"mas2_kg": 1}), "Did you mean `mass2_kg`?"),
        (lambda arm: resonarm.Arm(beta2_deg=400), "beta2_deg"),
        (lambda arm: arm.frf(-1), "frequency -1 Hz: it must be zero or a positive number"),
        (lambda arm: arm.frf(1, drive="torque3"), "there is no drive `torque3`: it must be one of torque1, torque2"),
        (lambda arm: arm.simulate(0.00033), "is 0.66 steps at 2000 Hz, not a whole number: take 0.0005"),
        (lambda arm: arm.simulate(-1), "duration_s is -1: it must be a positive number"),
        (lambda arm: arm.simulate(1, torque1_nm=1), "an excitation A·sin(2πft) needs a positive frequency"),
        (lambda arm: arm.simulate(1, scheme="euler"), "euler"),
        (lambda arm: arm.simulate(1, initial=(float("nan"), 0, 0, 0)), "is not finite"),
    ],
)
def test_invalid_arguments_are_value_errors(call, message):
    with pytest.raises(ValueError) as raised:
        call(resonarm.Arm())
    assert message in str(raised.value)


def test_messages_are_those_of_the_program(command):
    said = command("modes", "--preset", "irb", code=2)
    with pytest.raises(ValueError) as raised:
        resonarm.Arm("irb")
    assert str(raised.value) in said
