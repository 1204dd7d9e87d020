"""Branches in any parameter, curves of their bifurcations and the branches that leave them."""

import pickle

import numpy as np
import pytest
from matplotlib.figure import Figure

import resonarm

ARM = resonarm.Chain.preset()


@pytest.fixture(scope="module")
def branch():
    return ARM.continuation("frequency", 21, 23, drive={"joint1": 60}, curves_in="amplitude", curves_to=5)


def test_a_branch_folds_and_says_so(branch):
    unstable = int((~branch.points["stable"]).sum())
    assert unstable > 5 and branch.bifurcations["kind"].tolist() == ["fold", "fold"]
    of = f"{len(branch.points)} periodic responses, {unstable} of them not stable; 2 × fold"
    assert repr(branch) == f"<Branch in frequency, driven at joint1: {of}>"
    assert (branch.drive, branch.at, set(branch.points["period"])) == ({"joint1": 60.0}, ("joint1",), {1})
    assert branch.points["multipliers"].shape == (len(branch.points), 4)
    # A small response away from the resonance is that of the linear structure.
    weak = ARM.continuation("frequency", 14, 16, drive={"joint1": 0.1}, at=["tip.y"])
    linear = 0.1 * ARM.frf(weak.points["frequency_hz"], drive="joint1", at="tip.y")
    np.testing.assert_allclose(weak.points["tip_y_harmonic1_m"], linear, rtol=1e-5)


def test_the_curve_of_the_folds_passes_through_both_and_has_a_cusp(branch):
    (curve,) = branch.curves
    assert curve.kind == "fold" and curve.parameters == ("frequency", "amplitude")
    assert curve.turns["kind"].tolist() == ["cusp"]
    ends = sorted([curve.points["value"][0], curve.points["value"][-1]])
    np.testing.assert_allclose(ends, sorted(branch.bifurcations["value"]), rtol=1e-7)
    np.testing.assert_allclose(curve.points["value2"][[0, -1]], 60.0, rtol=1e-9)
    assert 5 < curve.turns["value2"][0] < 60
    # Beyond the cusp nothing folds.
    below = ARM.continuation("frequency", 21, 23, drive={"joint1": 0.9 * curve.turns["value2"][0]})
    assert not len(below.bifurcations)
    ax = curve.plot(Figure().subplots())
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("excitation frequency (Hz)", "load at joint1 (N·m)")
    again = pickle.loads(pickle.dumps(branch))
    np.testing.assert_array_equal(again.curves[0].points, curve.points)


def test_the_amplitude_can_vary():
    branch = ARM.continuation("amplitude", 0, 80, drive="joint1", frequency_hz=22.1)
    np.testing.assert_array_equal(branch.points["value"], branch.points["drive"])
    assert branch.plot(Figure().subplots()).get_xlabel() == "load at joint1 (N·m)"
    # Loads in a ratio: the force along (3, 4) N is one of 5 N.
    both = ARM.continuation("amplitude", 0, 3, drive={"tip.x": 3, "tip.y": 4}, frequency_hz=14.0, at=["joint1"])
    apart = [
        ARM.continuation("amplitude", 0, peak, drive=at, frequency_hz=14.0, at=["joint1"])
        for at, peak in (("tip.x", 3), ("tip.y", 4))
    ]
    one, other = (of.points["joint1_harmonic1_rad"][-1] for of in apart)
    np.testing.assert_allclose(both.points["joint1_harmonic1_rad"][-1], one + other, rtol=1e-3)


def test_a_parameter_of_the_structure_can_vary():
    branch = ARM.continuation("link2.angle_deg", 60, 75, drive={"joint1": 10}, frequency_hz=15.0)
    assert branch.points["value"][[0, -1]].tolist() == [60.0, 75.0]
    turned = resonarm.Chain.preset(angles_deg=(0, 75)).continuation("frequency", 15, 16, drive={"joint1": 10})
    found = branch.points["joint1_largest_rad"][-1]
    np.testing.assert_allclose(found, turned.points["joint1_largest_rad"][0], rtol=1e-6)
    assert branch.plot(Figure().subplots()).get_xlabel() == "link2.angle_deg (°)"
    spring = resonarm.Element(kind="cubic", at="tip.x", stiffness3_n_m3=3.7e6)
    mode = resonarm.ModeShape(frequency_hz=20.0, damping_ratio=0.004, shape={"tip.x": 0.5})
    modal = resonarm.Modal([mode], elements=[spring])
    more = {"drive": {"tip.x": 10}, "curves_in": "element1.stiffness3_n_m3", "curves_to": 1e4}
    curves = modal.continuation("frequency", 19.9, 20.6, **more).curves
    assert curves and curves[0].parameters == ("frequency", "element1.stiffness3_n_m3")
    assert "cusp" in curves[0].turns["kind"]


def test_branches_that_leave_a_branch_belong_to_it():
    arm = resonarm.Chain.preset(angles_deg=(0, 75))
    branch = arm.continuation("frequency", 43, 46, drive={"joint1": 800}, branches=True)
    assert "period-doubling" in branch.bifurcations["kind"]
    first = branch.branches[0]
    assert (first.origin.kind, first.origin.branch, first.origin.period) == ("period-doubling", 0, 2)
    assert first.origin.value in branch.bifurcations["value"]
    assert set(first.points["period"]) == {2}
    labels = [text.get_text() for text in branch.plot(Figure().subplots()).get_legend().get_texts()]
    assert labels[:2] == ["stable", "unstable"] and "period-doubling" in labels


def test_a_branch_that_ends_early_is_kept():
    with pytest.raises(resonarm.EndedEarly, match="limit of 10 points") as raised:
        ARM.continuation("frequency", 21, 23, drive={"joint1": 60}, most_points=10)
    assert isinstance(raised.value, resonarm.ResonarmError)
    assert len(pickle.loads(pickle.dumps(raised.value)).branch.points) >= 10


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"drive": {}}, "drive is empty: give the amplitude at a degree of freedom"),
        ({"drive": {"joint1": 0.0}}, "drive['joint1'] is 0: it must be a finite number other than 0"),
        ({"drive": {"joint1": np.nan}}, "drive['joint1'] is nan: it must be a finite number"),
        ({"drive": {"joint3": 1.0}}, "drive joint3: there is no `joint3`"),
        ({"drive": {"joint1": 1.0}, "frequency_hz": 2.0}, "leave it out"),
        ({"drive": {"joint1": 1.0}, "largest_step": 0.0}, "largest_step is 0: it must be from 0.000001 to 1"),
        ({"drive": {"joint1": 1.0}, "most_harmonics": 2}, "most_harmonics is 2: it must be from 3 to 1000"),
        ({"drive": {"joint1": 1.0}, "most_points": 0}, "most_points is 0: it must be 1 or more"),
        ({"drive": {"joint1": 1.0}, "curves_in": "amplitude"}, "give both or neither"),
        ({"drive": {"joint1": 1.0}, "curves_in": "frequency", "curves_to": 1}, "give another parameter"),
        ({"drive": {"joint1": 1.0}, "curves_in": "foo", "curves_to": 1}, "curves_in foo: "),
        ({"drive": {"joint1": 1.0}, "at": ["elbow"]}, "at elbow: there is no `elbow`"),
    ],
)
def test_invalid_arguments_are_value_errors(options, message):
    with pytest.raises(ValueError) as raised:
        ARM.continuation("frequency", 21, 23, **options)
    assert message in str(raised.value)


@pytest.mark.parametrize(
    ("call", "kind", "message"),
    [
        (lambda: ARM.continuation("frequency", 0, 23, drive={"joint1": 1}), ValueError, "two different numbers"),
        (lambda: ARM.continuation("freq", 21, 23, drive={"joint1": 1}, frequency_hz=2), ValueError, "parameter freq: "),
        (
            lambda: ARM.continuation("amplitude", 0, 9, drive="joint1"),
            ValueError,
            "frequency_hz is missing: it must be",
        ),
        (
            lambda: ARM.continuation("amplitude", 0, 9, drive={"joint1": 60}, frequency_hz=9),
            ValueError,
            "the amplitude is the quantity that varies: give drive='joint1' without one",
        ),
        (
            lambda: ARM.continuation("frequency", 1, 2, drive="joint1"),
            TypeError,
            "drive is 'joint1': give the amplitude",
        ),
        (lambda: ARM.continuation("frequency", 1, 2, drive={"joint1": 1}, at="tip.x"), TypeError, "as ['tip.x']"),
        (lambda: ARM.continuation("frequency", 1, 2, drive={"joint1": "x"}), TypeError, "is 'x': it must be a number"),
    ],
)
def test_other_invalid_calls_are_refused(call, kind, message):
    with pytest.raises(kind) as raised:
        call()
    assert message in str(raised.value)


def test_a_branch_draws_itself(branch):
    ax = branch.plot(Figure().subplots())
    lines = [line for line in ax.lines if line.get_linestyle() != "None"]
    assert [line.get_linestyle() for line in lines] == ["-", "--", "-"]
    assert sum(len(line.get_xdata()) for line in lines) == len(branch.points) + 2
    assert ax.get_xlabel() == "excitation frequency (Hz)"
    assert ax.get_ylabel() == "largest displacement of joint1 (rad)"
    assert [text.get_text() for text in ax.get_legend().get_texts()][:2] == ["stable", "unstable"]
    with pytest.raises(ValueError, match=r"at is 'tip\.x': the branch is read at joint1"):
        branch.plot(Figure().subplots(), at="tip.x")
