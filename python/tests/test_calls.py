"""Calls that can't be: each is refused in words that say what was given, where, and what would do."""

import numpy as np
import pytest

import resonarm

NAN = float("nan")


def frequencies(of):
    return resonarm.Arm().frf(of)


@pytest.mark.parametrize(
    ("call", "kind", "message"),
    [
        (
            lambda: resonarm.Arm().continuation("freq", 21, 23, torque1_nm=60),
            ValueError,
            "parameter is `freq`: it must be one of frequency, amplitude, beta1_deg",
        ),
        (lambda: resonarm.Arm().continuation("freq", 21, 23), ValueError, "parameter is `freq`: it must be one of"),
        (
            lambda: resonarm.Arm().continuation("frequency", 21, 23, torque_nm=60),
            TypeError,
            "continuation() got an unexpected keyword argument 'torque_nm'",
        ),
        (
            lambda: resonarm.Arm().basins(22, torque_nm=60),
            TypeError,
            "basins() got an unexpected keyword argument 'torque_nm'",
        ),
        (
            lambda: resonarm.Decoder().decode(b"xx"),
            TypeError,
            "a frame is a resonarm.Frame or a can.Message, which say identifier and data: this is bytes",
        ),
        (lambda: resonarm.Decoder().decode((1, False, b"", False, False)), TypeError, "a frame is a resonarm.Frame or"),
        (lambda: frequencies(np.array([1 + 2j])), TypeError, "frequency_hz has complex numbers: give real ones"),
        (lambda: frequencies([1 + 2j]), TypeError, "frequency_hz has complex numbers: give real ones"),
        (lambda: frequencies(["x"]), TypeError, "frequency_hz has no numbers, but <U1: give real ones"),
        (lambda: frequencies([1, [2]]), TypeError, "frequency_hz is no array of numbers"),
        (
            lambda: resonarm.Plant().play(force_n=np.zeros((3, 2), complex)),
            TypeError,
            "force_n has complex numbers: give real ones",
        ),
        (
            lambda: resonarm.Arm().ensemble(np.zeros((3, 4), complex), 1, frequency_hz=1),
            TypeError,
            "initial has complex numbers: give real ones",
        ),
        (
            lambda: resonarm.Plant().play(force_n=[(0, 0), (1, NAN)]),
            ValueError,
            "force_n is NaN at sample 1, in column 1: it must be a finite number",
        ),
        (
            lambda: resonarm.Plant().play(torque_nm=[(float("inf"), 0)]),
            ValueError,
            "torque_nm is inf at sample 0, in column 0: it must be a finite number",
        ),
        (
            lambda: resonarm.Plant().advance(force_n=(0.0, NAN)),
            ValueError,
            "force_n is (0.0, NaN) at sample 0: it must be two finite numbers",
        ),
        (
            lambda: resonarm.Plant().advance(torque_nm=(-float("inf"), 0.0)),
            ValueError,
            "torque_nm is (-inf, 0.0) at sample 0: it must be two finite numbers",
        ),
        (
            lambda: resonarm.Arm().simulate(1, force_x_n=NAN, excitation_hz=3),
            ValueError,
            "force_x_n is nan: it must be a finite number",
        ),
        (
            lambda: resonarm.Arm().ensemble([(0, 0, 0, 0)], 1, torque2_nm=NAN, frequency_hz=3),
            ValueError,
            "torque2_nm is nan: it must be a finite number",
        ),
        (lambda: resonarm.run("scenarios/bench.toml"), TypeError, "Scenario.load('scenarios/bench.toml') reads one"),
        (lambda: resonarm.Plant("bench.toml"), TypeError, "a scenario is a resonarm.Scenario: this is str"),
        (lambda: resonarm.Node("plant", None, "vcan0"), TypeError, "a scenario is a resonarm.Scenario: this is None"),
    ],
)
def test_a_call_that_cant_be(call, kind, message):
    with pytest.raises(kind) as raised:
        call()
    assert message in str(raised.value)


@pytest.mark.parametrize("name", ["sample", "time_s", "alpha_rad", "alpha_dot_rad_s"])
def test_a_plant_goes_on_from_where_it_is(name):
    plant = resonarm.Plant()
    plant.advance()
    with pytest.raises(AttributeError) as raised:
        setattr(plant, name, getattr(plant, name))
    assert str(raised.value) == (
        f"{name} can't be set: a plant stands at sample 1 and goes on from there by advance() or play(); "
        "a new Plant(scenario) begins at sample 0"
    )
    with pytest.raises(AttributeError, match=r"'Plant' object has no attribute 'seek': a plant stands at sample 1"):
        plant.seek(100)
    with pytest.raises(AttributeError, match=r"^'Plant' object has no attribute 'colour'$"):
        _ = plant.colour


@pytest.mark.parametrize("mode", ["free", "lockstep"])
@pytest.mark.parametrize(
    ("answer", "kind", "said"),
    [
        ((NAN, 0.0), ValueError, "(nan, 0.0)"),
        ((0.0, -float("inf")), ValueError, "(0.0, -inf)"),
        ((1.0,), ValueError, "(1.0,)"),
        (5.0, TypeError, "5.0"),
        ("x", TypeError, "'x'"),
        ((1.0, "x"), TypeError, "(1.0, 'x')"),
    ],
)
def test_what_a_controller_may_not_return_is_named_with_its_sample(bench_scenario, answer, kind, said, mode):
    def controller(measured):
        return (1.0, 0.0) if measured.sample < 20 else answer

    with pytest.raises(kind) as raised:
        resonarm.run(bench_scenario, mode, controller=controller)
    assert str(raised.value) == (
        f"the controller returned {said} for sample 20: a load is two finite numbers, and None ends the work"
    )


def test_a_controller_returns_what_has_two_numbers(bench_scenario):
    for answer in ([1.0, 2.0], np.array([1.0, 2.0]), (np.float32(1), 2)):
        report = resonarm.run(bench_scenario, controller=lambda m, of=answer: of if m.sample < 20 else None)
        assert report.exciter["outcome"] == "finished"
