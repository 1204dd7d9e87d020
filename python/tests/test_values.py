"""Values and results: compared by their contents, and passed to other processes."""

import pickle
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

import resonarm
from resonarm.testing import Bench

ROOT = Path(__file__).resolve().parents[2]
MEASURED = {
    "head_force_n": (1.5, -2.0),
    "acceleration_b_m_s2": (0.25, 0.5),
    "acceleration_c_m_s2": (3.0, -4.0),
    "clipped": 0b10_0001,
}


@pytest.fixture(scope="module")
def processes():
    """A process that shares nothing with this one."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        yield pool


def the_same(found, expected):
    """Equality of every field, arrays by dtype and every number."""
    assert type(found) is type(expected)
    if isinstance(expected, np.ndarray):
        assert found.dtype == expected.dtype
        np.testing.assert_array_equal(found, expected)
    elif isinstance(expected, tuple | list):
        assert len(found) == len(expected)
        for one, other in zip(found, expected, strict=True):
            the_same(one, other)
    elif hasattr(expected, "__dataclass_fields__"):
        for name in expected.__dataclass_fields__:
            the_same(getattr(found, name), getattr(expected, name))
    else:
        assert found == expected


def branch(arm):
    return arm.continuation("frequency", 21, 23, drive={"joint1": 60}, curves_in="amplitude", curves_to=20)


def basins(arm):
    return arm.basins(22.1, drive={"joint1": 60}, points=(2, 2), time_constants=0.1)


def ended_early(arm):
    with pytest.raises(resonarm.EndedEarly) as raised:
        arm.continuation("frequency", 21, 23, drive={"joint1": 60}, most_points=10)
    return raised.value


def run(arm):
    return resonarm.run(resonarm.Scenario.load(ROOT / "scenarios/bench.toml", simulation={"duration_s": 0.5}))


def modes(arm):
    return arm.modes()


@pytest.mark.parametrize("work", [branch, basins, run, modes])
def test_results_come_back_from_another_process(processes, work):
    arm = resonarm.Chain.preset().replace({"link2.mass_kg": 41})
    found = processes.submit(work, arm).result(120)
    expected = work(arm)
    if work is run:  # whose thread took another time
        for result in (found, expected):
            result.plant.pop("exec_us"), result.plant.pop("wakeup_us")
    the_same(found, expected)
    assert repr(found) == repr(expected)


def test_a_branch_that_ended_early_comes_back_with_its_branch(processes):
    found, expected = (
        processes.submit(ended_early, resonarm.Chain.preset()).result(120),
        ended_early(resonarm.Chain.preset()),
    )
    assert (type(found), str(found)) == (type(expected), str(expected))
    the_same(found.branch, expected.branch)


def test_errors_come_back(processes):
    with pytest.raises(resonarm.ResonarmError, match="Newton"):
        processes.submit(fails, resonarm.Chain.preset()).result(120)


def fails(arm):
    arm.simulate(1.0, initial=(0, 0, 1e200, 0))


def test_the_result_of_a_bench_is_a_value(tmp_path):
    with Bench(ROOT / "scenarios/bench.toml", tmp_path) as bench:
        result = bench.run(lambda measured: (1.0, 0.0) if measured.sample < 50 else None)
    found = pickle.loads(pickle.dumps(result))
    assert (found.plant, found.exciter) == (result.plant, result.exciter)
    assert found.recording.path == result.recording.path
    the_same(found.recording.states, result.recording.states)
    found.assert_completed()


def test_structures_compare_by_value():
    arm = resonarm.Chain.preset(angles_deg=(0, 75)).replace({"link2.mass_kg": 40})
    same = resonarm.Chain.preset("irb1600-fitted", angles_deg=[0, 75.0]).replace({"link2.mass_kg": 40.0})
    assert arm == same and hash(arm) == hash(same) and len({arm, same}) == 1
    assert arm == pickle.loads(pickle.dumps(arm)) == resonarm.Chain(arm.links, name="irb1600-fitted")
    others = [
        resonarm.Chain.preset(angles_deg=(0, 75)),
        resonarm.Chain.preset(angles_deg=(1, 75)).replace({"link2.mass_kg": 40}),
        arm.replace({"link1.stiffness_nm_rad": 1e5}),
        resonarm.Chain(arm.links),
    ]
    for other in others:
        assert arm != other
    assert arm != "arm" and (arm == 1) is False


def test_networks_and_scenarios_compare_by_value(bench_scenario):
    network = resonarm.Network(base=0x300, plant_id=3, profile="fd")
    same = resonarm.Network(base=0x300, plant_id=3, exciter_id=2, profile="fd")
    assert network == same == pickle.loads(pickle.dumps(network)) and hash(network) == hash(same)
    assert network != resonarm.Network(base=0x300, plant_id=3) and network != 0x300
    assert bench_scenario == pickle.loads(pickle.dumps(bench_scenario)) == resonarm.Scenario(bench_scenario.to_toml())
    assert hash(bench_scenario) == hash(resonarm.Scenario(bench_scenario.to_toml()))
    assert bench_scenario != bench_scenario.replace(simulation={"seed": 99}) and bench_scenario != 1


def test_a_measurement_is_made_for_a_controller_under_test():
    measured = resonarm.Measurement(7, **MEASURED)
    assert measured.sample == 7
    for name, value in MEASURED.items():
        assert getattr(measured, name) == value
    assert measured == pickle.loads(pickle.dumps(measured)) == resonarm.Measurement(7, **MEASURED)
    assert hash(measured) == hash(resonarm.Measurement(7, **MEASURED))
    assert measured != resonarm.Measurement(8, **MEASURED) and resonarm.Measurement(0).head_force_n == (0.0, 0.0)
    assert repr(measured).endswith("acceleration_c_m_s2=(3.0, -4.0), clipped=33)")
    with pytest.raises(ValueError, match="clipped is 64: it must have at most one bit for each of the 6 readings"):
        resonarm.Measurement(7, clipped=64)
    sensed = resonarm.Measurement(7, **{**MEASURED, "clipped": 64, "sensors": [("angle_enc1_rad", 0.5)]})
    assert (sensed.sensors, sensed.clipped) == ({"angle_enc1_rad": 0.5}, 64) and measured.sensors == {}
    assert sensed == pickle.loads(pickle.dumps(sensed)) != measured
    assert repr(sensed).endswith('clipped=64, sensors=[("angle_enc1_rad", 0.5)])')
    first = resonarm.Plant().measure()
    assert first == pickle.loads(pickle.dumps(first))


def test_modes_compare_by_value():
    first, second = resonarm.Chain.preset().modes()
    assert first == resonarm.Chain.preset().modes()[0] and hash(first) == hash(resonarm.Chain.preset().modes()[0])
    assert first != second
