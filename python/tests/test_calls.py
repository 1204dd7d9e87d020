"""Invalid calls: each is refused with a message about the argument, its place and the valid values."""

from pathlib import Path

import numpy as np
import pytest

import resonarm
from resonarm.testing import Bench

ROOT = Path(__file__).resolve().parents[2]
NAN = float("nan")


def frequencies(of):
    return resonarm.Chain.preset().frf(of, drive="joint1")


@pytest.mark.parametrize(
    ("call", "kind", "message"),
    [
        (
            lambda: resonarm.Chain.preset().continuation("frequency", 21, 23, torque_nm=60),
            TypeError,
            "continuation() got an unexpected keyword argument 'torque_nm'",
        ),
        (
            lambda: resonarm.Chain.preset().basins(22, torque_nm=60),
            TypeError,
            "basins() got an unexpected keyword argument 'torque_nm'",
        ),
        (
            lambda: resonarm.Decoder().decode(b"xx"),
            TypeError,
            "the frame is bytes: it must be a resonarm.Frame or a can.Message, which have identifier and data",
        ),
        (lambda: resonarm.Decoder().decode((1, False, b"", False, False)), TypeError, "it must be a resonarm.Frame or"),
        (
            lambda: frequencies(np.array([1 + 2j])),
            TypeError,
            "frequency_hz has complex numbers: it must have real ones",
        ),
        (lambda: frequencies([1 + 2j]), TypeError, "frequency_hz has complex numbers: it must have real ones"),
        (lambda: frequencies(["x"]), TypeError, "frequency_hz has values of the type <U1: it must have real numbers"),
        (lambda: frequencies([1, [2]]), TypeError, "frequency_hz must be an array of numbers"),
        (
            lambda: resonarm.Plant().play(force_n=np.zeros((3, 2), complex)),
            TypeError,
            "force_n has complex numbers: it must have real ones",
        ),
        (
            lambda: resonarm.Chain.preset().ensemble(np.zeros((3, 4), complex), 1, drive={"joint1": 1}, frequency_hz=1),
            TypeError,
            "initial has complex numbers: it must have real ones",
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
            "force_n is (0.0, nan) at sample 0: it must be two finite numbers, or three with z",
        ),
        (
            lambda: resonarm.Plant().advance(torque_nm=(-float("inf"), 0.0)),
            ValueError,
            "torque_nm is (-inf, 0.0) at sample 0: it must be two to 8 finite numbers",
        ),
        (
            lambda: resonarm.Chain.preset().simulate(1, drive={"tip.x": NAN}, frequency_hz=3),
            ValueError,
            "drive['tip.x'] is nan: it must be a finite number",
        ),
        (
            lambda: resonarm.Chain.preset().ensemble([(0, 0, 0, 0)], 1, drive={"joint2": NAN}, frequency_hz=3),
            ValueError,
            "drive['joint2'] is nan: it must be a finite number",
        ),
        (lambda: resonarm.run("scenarios/bench.toml"), TypeError, "Scenario.load('scenarios/bench.toml') reads one"),
        (lambda: resonarm.Plant("bench.toml"), TypeError, "scenario is str: it must be a resonarm.Scenario"),
        (lambda: resonarm.Node("plant", None, "vcan0"), TypeError, "scenario is None: it must be a resonarm.Scenario"),
        (
            lambda: resonarm.Scenario("scenarios/bench.toml"),
            ValueError,
            "Scenario() expects the TOML itself: Scenario.load('scenarios/bench.toml') reads a file",
        ),
        (
            lambda: resonarm.Scenario(Path("bench.toml")),
            TypeError,
            "Scenario() expects the TOML itself: Scenario.load('bench.toml') reads a file",
        ),
        (
            lambda: resonarm.Scenario().replace(simulation={"duration_s": NAN}),
            ValueError,
            "simulation.duration_s is NaN: it must be a number",
        ),
        (
            lambda: resonarm.Scenario().replace(rig={"faults": [{"from_s": 0.0, "to_s": NAN}]}),
            ValueError,
            "rig.faults.to_s is NaN: it must be a number",
        ),
        (
            lambda: resonarm.Chain.preset().replace({"link2.mass_kg": NAN}),
            ValueError,
            "mass_kg is NaN: it must be a number",
        ),
        (
            lambda: resonarm.Scenario().replace(simulation=3),
            ValueError,
            "`simulation` is 3: a section of a scenario is",
        ),
        (
            lambda: resonarm.Chain.preset().simulate(1, initial=(0, 0)),
            ValueError,
            "initial has 2 numbers: give 4, the coordinates and their rates",
        ),
        (lambda: resonarm.Chain.preset().simulate("1"), TypeError, "duration_s is '1': it must be a number"),
        (lambda: frequencies(None), TypeError, "frequency_hz is None: it must be an array of numbers"),
        (
            lambda: resonarm.Recording(ROOT / "recordings/fd.mcap").read("wheels"),
            ValueError,
            "part is `wheels`: it must be one of states, samples, frames, ticks, events",
        ),
        (lambda: resonarm.Network(profile="can"), ValueError, "profile is `can`: the profiles are classic and fd"),
        (lambda: resonarm.Network(base=70000), ValueError, "base is 70000: it must be from 0x180 to 0x570"),
        (lambda: resonarm.Network(plant_id=300), ValueError, "plant_id is 300: it must be from 1 to 127"),
        (lambda: resonarm.Network(exciter_id=-1), ValueError, "exciter_id is -1: it must be from 1 to 127"),
        (lambda: resonarm.Encoder("fd"), TypeError, "network is of the type str: it must be a resonarm.Network"),
        (lambda: resonarm.Decoder(3), TypeError, "network is of the type int: it must be a resonarm.Network"),
        (
            lambda: resonarm.Decoder().decode(resonarm.Frame(0x201, False, "xx", False, False)),
            TypeError,
            "data is of the type str: it must be bytes",
        ),
        (
            lambda: resonarm.Decoder().decode(resonarm.Frame(-1, False, b"", False, False)),
            ValueError,
            "identifier is -1: it must be from 0 to 0x1FFFFFFF",
        ),
        (lambda: resonarm.run(resonarm.Scenario(), rearm=-1), ValueError, "rearm is -1: it must be 0 or more"),
        (
            lambda: resonarm.run(resonarm.Scenario(), load="torque"),
            ValueError,
            "load applies only to a controller in Python, and none is given: leave it out",
        ),
        (
            lambda: resonarm.run(resonarm.Scenario(), controller=5),
            TypeError,
            "controller is 5: it must be a function of a Measure",
        ),
        (
            lambda: resonarm.Node("planet", resonarm.Scenario(), "vcan0"),
            ValueError,
            "role is `planet`: it must be plant or exciter",
        ),
        (
            lambda: resonarm.Node("plant", resonarm.Scenario(), 5),
            TypeError,
            "bus is of the type int: it must be an address such as 'vcan0'",
        ),
        (
            lambda: Bench().run("controller {bus}"),
            TypeError,
            "it must be a function of a Measurement, or a list of",
        ),
        (
            lambda: Bench().run(object()),
            TypeError,
            "it must be a function of a Measurement, or a list of the words",
        ),
    ],
)
def test_an_invalid_call_is_refused(call, kind, message):
    with pytest.raises(kind) as raised:
        call()
    assert message in str(raised.value)


@pytest.mark.parametrize("name", ["sample", "time_s", "alpha_rad", "alpha_dot_rad_s"])
def test_a_plant_cannot_be_set_to_another_sample(name):
    plant = resonarm.Plant()
    plant.advance()
    with pytest.raises(AttributeError) as raised:
        setattr(plant, name, getattr(plant, name))
    assert str(raised.value) == (
        f"{name} can't be set: a plant is at sample 1 and continues from there by advance() or play(); "
        "a new Plant(scenario) begins at sample 0"
    )
    with pytest.raises(AttributeError, match=r"'Plant' object has no attribute 'seek': a plant is at sample 1"):
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
def test_an_invalid_load_of_a_controller_is_named_with_its_sample(bench_scenario, answer, kind, said, mode):
    def controller(measured):
        return (1.0, 0.0) if measured.sample < 20 else answer

    with pytest.raises(kind) as raised:
        resonarm.run(bench_scenario, mode, controller=controller)
    assert str(raised.value) == (
        f"the controller returned {said} for sample 20: expected a load, two finite numbers, or None to end the work"
    )


def test_a_controller_returns_what_has_two_numbers(bench_scenario):
    for answer in ([1.0, 2.0], np.array([1.0, 2.0]), (np.float32(1), 2)):
        report = resonarm.run(bench_scenario, controller=lambda m, of=answer: of if m.sample < 20 else None)
        assert report.exciter["outcome"] == "finished"


def test_numbers_of_numpy_are_numbers():
    scenario = resonarm.Scenario().replace(
        simulation={"seed": np.int64(3), "duration_s": np.float32(0.5)},
        rig={"faults": [{"instrument": "head", "kind": "stuck", "from_s": np.array(0.25)}]},
        network={"faults": [{"node": "plant", "kind": "loss", "from_s": 0.0, "ids": np.array([0x201, 0x202])}]},
    )
    values = scenario.values()
    assert (values["simulation"]["seed"], values["simulation"]["duration_s"]) == (3, 0.5)
    assert values["rig"]["faults"][0]["from_s"] == 0.25 and values["network"]["faults"][0]["ids"] == [0x201, 0x202]


@pytest.mark.parametrize("force", [(1.0, 2.0), [1.0, 2.0], np.array([1.0, 2.0]), (np.float32(1), 2)])
def test_a_plant_takes_two_numbers(force):
    plant, other = resonarm.Plant(), resonarm.Plant()
    plant.advance(force)
    other.play(force_n=[(1.0, 2.0)])
    assert plant.alpha_rad == other.alpha_rad
    with pytest.raises(TypeError, match="'xy'"):
        plant.advance("xy")
    with pytest.raises(ValueError, match=r"force_n is \[1\.0\] at sample 1: it must be two finite numbers"):
        plant.advance([1.0])
