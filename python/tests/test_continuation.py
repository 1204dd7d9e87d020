"""Branches in any parameter, curves of their bifurcations and the branches that leave them."""

import json
import pickle
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import resonarm

ARM = resonarm.Chain.preset()
ORACLES = Path(__file__).parents[2] / "tests" / "oracles"


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


OSCILLATOR = resonarm.ModeShape(frequency_hz=1 / (2 * np.pi), damping_ratio=0.005, shape={"tip.x": 1.0})
CUBIC = resonarm.Element(kind="cubic", at="tip.x", stiffness3_n_m3=1.0)


def test_a_branch_starts_near_a_state(branch):
    # Back from the middle of the unstable part.
    row = branch.points[np.flatnonzero(branch.points["stability"] == "unstable")[3]]
    # It turns at the fold, so that it ends where it began.
    with pytest.raises(resonarm.EndedEarly, match="left the interval at its start") as ended:
        ARM.continuation("frequency", row["value"], 21, drive={"joint1": 60}, from_state=row["state"])
    first = ended.value.branch.points[0]
    np.testing.assert_allclose(first["state"], row["state"], rtol=1e-6)
    assert (first["stability"], first["stable"]) == ("unstable", False)
    # A sub-harmonic of order 3, by another code's shooting.
    modal = resonarm.Modal([OSCILLATOR], elements=[CUBIC])
    hz, state = 4.5 / (2 * np.pi), [1.1686692211643264, 0.11509686260901884]
    third = modal.continuation("frequency", hz, 1.01 * hz, drive={"tip.x": 4}, from_state=state)
    assert set(third.points["period"]) == {3}
    assert third.points["tip_x_largest_m"][0] == pytest.approx(1.2007087, rel=1e-6)
    with pytest.raises(resonarm.ResonarmError, match="has 1 finite numbers: expected 2"):
        modal.continuation("frequency", hz, 1.01 * hz, drive={"tip.x": 4}, from_state=[1.0])


def test_a_tolerance_bounds_the_truncation_error(branch):
    assert branch.points["truncation_error"].max() < 1e-9
    modal = resonarm.Modal([OSCILLATOR], elements=[CUBIC])
    rough, fine = (
        modal.continuation("frequency", 0.1, 0.2, drive={"tip.x": 0.5}, tolerance=tolerance, stability=False)
        for tolerance in (1e-3, 1e-10)
    )
    assert rough.points["harmonics"].max() < fine.points["harmonics"].max()
    assert rough.points["truncation_error"].max() <= 1e-3 and fine.points["truncation_error"].max() <= 1e-10
    assert set(rough.points["stability"]) == {""}


def test_conservative_responses_are_drawn_as_neither_stable_nor_unstable():
    modal = resonarm.Modal([{**OSCILLATOR, "damping_ratio": 0.0}], elements=[CUBIC])
    branch = modal.continuation("frequency", 0.07, 0.1, drive={"tip.x": 0.1})
    assert set(branch.points["stability"]) == {"conservative"} and not branch.points["stable"].any()
    ax = branch.plot(Figure().subplots())
    # An unstable isola may be beside it.
    drawn = [(line.get_linestyle(), line.get_color(), line.get_label()) for line in ax.lines]
    assert drawn[0] == ("-", "black", "neither stable nor unstable")


def test_loads_have_harmonics():
    linear = resonarm.Modal([OSCILLATOR])
    load = {"drive": {"tip.x": 1}, "drive_harmonics": {2: (0.5, 90), 3: -2.0}}
    branch = linear.continuation("frequency", 0.03, 0.05, **load)
    row = branch.points[0]
    t = np.arange(400) / 400
    turns = 2j * np.pi * t
    responses = ((1, 1.0), (2, 0.5j), (3, -2.0))
    h = {k: linear.frf(k * row["frequency_hz"], drive="tip.x") for k, _ in responses}
    x = sum((h[k] * factor * np.exp(k * turns)).imag for k, factor in responses)
    assert row["tip_x_largest_m"] == pytest.approx(np.abs(x).max(), rel=1e-4)
    motion = linear.simulate(1 / 0.03, frequency_hz=0.03, initial=row["state"], rate_hz=30.0, every=1000, **load)
    np.testing.assert_allclose(motion["q_m_sqrt_kg"][-1], row["state"][:1], atol=1e-9)


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


def test_an_isola_is_found_and_what_was_searched_is_said():
    """A mass with a nonlinear absorber. Independent code has the isola between 1.574492 and 2.281309 rad/s."""
    isolas = json.loads((ORACLES / "isolas.json").read_text())["isolas"]
    case = next(case for case in isolas if case["name"] == "absorber 0.15 N")
    absorber = resonarm.Modal(
        [resonarm.ModeShape(**mode) for mode in case["modes"]],
        elements=[resonarm.Element(**element) for element in case["elements"]],
    )
    ends = [case[key] / (2 * np.pi) for key in ("from_rad_s", "to_rad_s")]
    branch = absorber.continuation("frequency", *ends, drive={case["drive"]: case["force_n"]}, at=[case["read"]])
    (isola,) = branch.isolas
    assert (isola.origin.kind, isola.origin.branch, isola.origin.period) == ("detached", None, 1)
    folds = isola.bifurcations["value"][isola.bifurcations["kind"] == "fold"]
    np.testing.assert_allclose(sorted(2 * np.pi * folds), case["isolas"][0]["folds_rad_s"], rtol=1e-6)
    assert branch.branches == () and isola.searched is None
    searched = branch.searched
    assert (searched.not_searched, len(searched.frequencies_hz), searched.starts) == (None, 5, 10)
    assert searched.loads[0] < case["force_n"] < searched.loads[1] and searched.sub_harmonics is None


def test_a_search_goes_further_if_it_is_told_to():
    oscillator = resonarm.Modal(
        [resonarm.ModeShape(frequency_hz=1 / (2 * np.pi), damping_ratio=0.005, shape={"tip.x": 1.0})],
        elements=[resonarm.Element(kind="cubic", at="tip.x", stiffness3_n_m3=1.0)],
    )
    branch = oscillator.continuation("frequency", 0.7, 0.73, drive={"tip.x": 4}, search=True)
    # The two large responses, whose fold is beyond the range, and sub-harmonic ones.
    assert [isola.origin.period for isola in branch.isolas] == [1, 1, 2, 3, 3]
    assert all(len(isola.points) for isola in branch.isolas)
    assert len(branch.searched.frequencies_hz) == 20 and len(branch.searched.sub_harmonics) == 5


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
        ({"drive": {"joint1": 1.0}, "tolerance": 0.2}, "tolerance is 0.2: it must be from 1e-14 to 0.1"),
        ({"drive": {"joint1": 1.0}, "drive_harmonics": {1: 2.0}}, "the order 1: it must be an integer from 2 to 50"),
        ({"drive": {"joint1": 1.0}, "drive_harmonics": {3: 0.0}}, "drive_harmonics[3] is 0.0: expected an amplitude"),
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
