"""Branches, against the program."""

import numpy as np
import pytest
from matplotlib.figure import Figure

import resonarm


@pytest.fixture(scope="module")
def branch():
    return resonarm.Arm().continuation("frequency", 21, 23, torque1_nm=60)


def test_a_branch_is_that_of_the_program(branch, command):
    document = command("continue", "--torque1-nm", 60, "--from-hz", 21, "--to-hz", 23)
    for name in ("frequency_hz", "amplitude_rad", "harmonic1_rad", "stable"):
        np.testing.assert_array_equal(branch.points[name], [point[name] for point in document["points"]])
    multipliers = np.array([point["multipliers"] for point in document["points"]]) @ [1, 1j]
    np.testing.assert_array_equal(branch.points["multipliers"], multipliers)
    assert branch.bifurcations["kind"].tolist() == [found["kind"] for found in document["bifurcations"]]
    hz = [found["frequency_hz"] for found in document["bifurcations"]]
    np.testing.assert_array_equal(branch.bifurcations["value"], hz)
    assert (
        repr(branch)
        == f"<Branch in frequency: {len(branch.points)} motions, {_unstable(branch)} of them unstable; 2 × fold>"
    )


def _unstable(branch):
    return int((~branch.points["stable"]).sum())


def test_curves_of_folds_are_those_of_the_program(command):
    words = ["--curves-in", "amplitude", "--curves-to", 5]
    document = command("continue", "--torque1-nm", 60, "--from-hz", 21, "--to-hz", 23, *words)
    branch = resonarm.Arm().continuation("frequency", 21, 23, torque1_nm=60, curves_in="amplitude", curves_to=5)
    assert [curve.kind for curve in branch.curves] == [curve["kind"] for curve in document["curves"]]
    for curve, expected in zip(branch.curves, document["curves"], strict=True):
        np.testing.assert_array_equal(curve.points["value"], [point["frequency_hz"] for point in expected["points"]])
        np.testing.assert_array_equal(curve.points["value2"], [point["torque1_nm"] for point in expected["points"]])
        assert curve.turns["kind"].tolist() == [turn["kind"] for turn in expected["turns"]]
    ax = branch.curves[0].plot(Figure().subplots())
    assert len(ax.lines[0].get_xdata()) == len(branch.curves[0].points)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("excitation frequency (Hz)", "A (N or N·m)")


def test_the_amplitude_can_vary(command):
    document = command("continue", "--parameter", "amplitude", "--frequency-hz", 22.1, "--from-nm", 0, "--to-nm", 80)
    branch = resonarm.Arm().continuation("amplitude", 0, 80, frequency_hz=22.1)
    np.testing.assert_array_equal(branch.points["value"], [point["torque1_nm"] for point in document["points"]])


def test_doubled_branches_belong_to_their_branch():
    branch = resonarm.Arm(beta2_deg=75).continuation("frequency", 43, 46, torque1_nm=800, doubled=True)
    assert "period-doubling" in branch.bifurcations["kind"]
    assert branch.doubled
    assert set(branch.doubled[0].points["period"]) == {2}


def test_a_branch_that_ends_early_is_kept():
    with pytest.raises(resonarm.BranchEndedEarly, match="more than 10 points") as raised:
        resonarm.Arm().continuation("frequency", 21, 23, torque1_nm=60, most_points=10)
    assert isinstance(raised.value, resonarm.ResonarmError)
    assert len(raised.value.branch.points) >= 10


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "give the excitation: torque1_nm=A, or force_x_n=A and force_y_n=A"),
        ({"torque1_nm": 0.0}, "force_x_n and force_y_n, is 0: it must be a finite number other than 0"),
        ({"torque1_nm": 1.0, "force_x_n": 1.0}, "give the excitation"),
        ({"torque1_nm": 1.0, "frequency_hz": 2.0}, "leave it out"),
        ({"torque1_nm": 1.0, "largest_step": 0.0}, "largest_step is 0: it must be from 0.000001 to 1"),
        ({"torque1_nm": 1.0, "curves_in": "amplitude"}, "give both or neither"),
        ({"torque1_nm": 1.0, "curves_in": "foo", "curves_to": 1}, "curves_in is `foo`: it must be one of frequency"),
    ],
)
def test_invalid_arguments_are_value_errors(options, message):
    with pytest.raises(ValueError) as raised:
        resonarm.Arm().continuation("frequency", 21, 23, **options)
    assert message in str(raised.value)
    with pytest.raises(ValueError, match="can't be walked: both ends must be numbers"):
        resonarm.Arm().continuation("frequency", 0, 23, torque1_nm=1)


def test_a_branch_draws_itself(branch):
    figure = Figure()
    ax = branch.plot(figure.subplots(), joint=2)
    lines = [line for line in ax.lines if line.get_linestyle() != "None"]
    assert [line.get_linestyle() for line in lines] == ["-", "--", "-"]
    assert sum(len(line.get_xdata()) for line in lines) == len(branch.points) + 2
    assert ax.get_xlabel() == "excitation frequency (Hz)"
    assert ax.get_ylabel() == "largest |α₂| (rad)"
    assert [text.get_text() for text in ax.get_legend().get_texts()][:2] == ["stable", "unstable"]
