"""Structures whose step is written in Python, in plants and runs, against the same structure of the library."""

import math
from pathlib import Path

import numpy as np
import pytest

import resonarm
from resonarm.testing import Bench

ROOT = Path(__file__).resolve().parents[2]
HZ, RATIO, TIP, ELBOW = [24.0, 61.0], [0.01, 0.004], [[0.4, 0.3], [-0.2, 0.5]], [[0.1, 0.0], [0.3, 0.2]]
MODES = [
    {
        "frequency_hz": hz,
        "damping_ratio": ratio,
        "shape": {"tip.x": tip[0], "tip.y": tip[1], "joint2.x": elbow[0], "joint2.y": elbow[1]},
    }
    for hz, ratio, tip, elbow in zip(HZ, RATIO, TIP, ELBOW, strict=True)
]
OMEGA, DAMPING = math.tau * np.array(HZ), 2 * np.array(RATIO) * math.tau * np.array(HZ)
AT = np.array([ELBOW, TIP]).transpose(0, 2, 1)
"""Displacements x, y of B and C by the coordinates."""


def rate(state, loads):
    q, velocity = state[:2], state[2:]
    return np.concatenate([velocity, AT[1].T @ loads[2:] - DAMPING * velocity - OMEGA**2 * q])


def flow(rate, dt_s, state, loads):
    """The exact flow of ẋ = A x + b over the step, by its series."""
    change, term = np.zeros(4), dt_s * rate(state, loads)
    for order in range(2, 20):
        change, term = change + term, dt_s / order * rate(term, np.zeros(len(loads)))
    return state + change


def step(_t_s, dt_s, state, loads):
    return flow(rate, dt_s, state, loads)


def points(_t_s, state, loads):
    return AT @ state[:2], AT @ state[2:], AT @ rate(state, loads)[2:]


def own(**changes):
    parts = {"step": step, "points": points, "initial": np.zeros(4), "coordinates": "modal", "name": "by NumPy"}
    return resonarm.Stepped(**{**parts, **changes})


@pytest.mark.parametrize("converter", ["instant", "sinc3"])
def test_a_plant_reads_the_same_as_that_of_the_library(converter):
    scenario = resonarm.Scenario().replace(rig={"converter": converter})
    modal = resonarm.Plant(scenario.replace(structure=resonarm.Modal(MODES).section))
    plant = resonarm.Plant(scenario, structure=own())
    loads = 20 * np.sin(0.15 * np.arange(120))[:, None] * [1.0, -0.5]
    rows, expected = plant.play(force_n=loads), modal.play(force_n=loads)
    assert rows.dtype == expected.dtype
    assert abs(expected["q_m_sqrt_kg"]).max() > 1e-4
    for name in ("q_m_sqrt_kg", "q_dot_m_sqrt_kg_s", "acceleration_b_m_s2", "acceleration_c_m_s2", "head_force_n"):
        scale = abs(expected[name]).max()
        # The instruments' steps of resolution may fall on either side.
        np.testing.assert_allclose(rows[name], expected[name], rtol=0, atol=1e-3 * scale + 1e-9, err_msg=name)
    np.testing.assert_allclose(rows["q_m_sqrt_kg"], expected["q_m_sqrt_kg"], rtol=0, atol=1e-12)


@pytest.mark.parametrize("converter", ["instant", "sinc3"])
def test_other_sensors_and_a_force_along_z_are_those_of_the_library(converter):
    z = np.array([0.2, 0.7])
    modes = [{**mode, "shape": {**mode["shape"], "tip.z": along}} for mode, along in zip(MODES, z, strict=True)]
    sensors = {"a": {"at": "tip"}, "v": {"at": "tip.z", "measures": "velocity"}}
    scenario = resonarm.Scenario().replace(rig={"converter": converter, "sensors": sensors})
    tip = np.vstack([AT[1], z])

    def rate_z(state, loads):
        q, velocity = state[:2], state[2:]
        return np.concatenate([velocity, tip.T @ loads - DAMPING * velocity - OMEGA**2 * q])

    def at_tip(_t_s, state, loads):
        return tip @ state[:2], tip @ state[2:], tip @ rate_z(state, loads)[2:]

    structure = own(
        step=lambda _t_s, dt_s, state, loads: flow(rate_z, dt_s, state, loads),
        points=lambda _t_s, state, loads: (AT @ state[:2], AT @ state[2:], AT @ rate_z(state, loads)[2:]),
        loads=("exciter_x", "exciter_y", "exciter_z"),
        sensed=("tip.x", "tip.y", "tip.z"),
        sensors=at_tip,
    )
    modal = resonarm.Plant(scenario.replace(structure=resonarm.Modal(modes).section))
    plant = resonarm.Plant(scenario, structure=structure)
    forces = 20 * np.sin(0.15 * np.arange(120))[:, None] * [1.0, -0.5, 2.0]
    rows, expected = plant.play(force_n=forces), modal.play(force_n=forces)
    for name in ("q_m_sqrt_kg", "acceleration_a_z_m_s2", "acceleration_a_x_m_s2", "velocity_v_z_m_s"):
        scale = abs(expected[name]).max()
        assert scale > 0
        np.testing.assert_allclose(rows[name], expected[name], rtol=0, atol=1e-3 * scale + 1e-9, err_msg=name)
    with pytest.raises(resonarm.ResonarmError, match="torque1_nm is 1: nothing of the structure takes this load"):
        plant.advance(torque_nm=(1.0, 0.0))


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"sensed": ["tip.z"]}, "only one of sensed and sensors is given"),
        ({"loads": ["joint9"]}, 'loads: there is no load "joint9"'),
    ],
)
def test_what_a_structure_can_not_have_is_refused(changes, said):
    with pytest.raises(ValueError, match=said):
        resonarm.Plant(resonarm.Scenario(), structure=own(**changes))


@pytest.fixture
def scenario():
    """A bench that leaves its structure to the program."""
    return resonarm.Scenario.load(ROOT / "scenarios/bench.toml", simulation={"duration_s": 0.2}, structure=None)


def test_free_and_lockstep_runs_have_the_same_bits(scenario, tmp_path):
    recordings = []
    for mode in ("free", "lockstep"):
        report = resonarm.run(scenario, mode, structure=own(), record=tmp_path / f"{mode}.mcap")
        assert report.outcome == "completed"
        recordings.append(report.recording)
    # Then the load ramps to zero from the last one that came.
    free, lockstep = (recording.states[:200] for recording in recordings)
    np.testing.assert_array_equal(free, lockstep)
    assert free["q_m_sqrt_kg"].shape == (len(free), 2)
    assert abs(free["q_m_sqrt_kg"]).max() > 0
    assert recordings[0].scenario.values()["structure"] == {"kind": "own", "name": "by NumPy"}
    with pytest.raises(ValueError, match=r"structure\.kind is own"):
        recordings[0].scenario.structure  # noqa: B018
    with pytest.raises(resonarm.ResonarmError, match="no program provides the structure"):
        recordings[0].resim()


def test_a_controller_closes_the_loop_on_it(scenario):
    def brake(measured):
        return (-2.0 * measured.acceleration_c_m_s2[0], 0.0) if measured.sample < 150 else None

    report = resonarm.run(
        scenario.replace(excitation=None, control=None), controller=brake, structure=own(initial=[0.01, 0, 0, 0])
    )
    assert report.exciter["outcome"] == "finished"


def test_displacements_and_angles_are_recorded_by_their_names(scenario, tmp_path):
    still = own(
        coordinates="displacements",
        initial=[0.0, 0.0],
        step=lambda *_: [1e-3, 0.5],
        points=lambda *_: np.zeros((3, 2, 2)),
    )
    report = resonarm.run(scenario, structure=still, record=tmp_path / "x.mcap")
    states = report.recording.states
    assert states["x_m"][1:].tolist() == [[1e-3]] * (len(states) - 1)
    assert report.recording.arrow("states").schema.field("x1_dot_m_s").metadata == {b"unit": b"m/s"}
    plant = resonarm.Plant(scenario, structure=own(coordinates="angles"))
    assert (plant.alpha_rad, list(plant.states)) == ((0.0, 0.0), ["alpha_rad", "alpha_dot_rad_s"])


def broken(t_s, _dt_s, state, _loads):
    if t_s > 0.05:
        raise LookupError("no such stiffness")
    return state


CASES = [
    (lambda run: run(structure=own(step=broken)), LookupError, "no such stiffness"),
    (lambda run: run(structure=own(step=lambda *_: [1.0])), ValueError, "has the shape (1,): it must be (4,)"),
    (lambda run: run(structure=own(step=lambda *_: [math.nan] * 4)), ValueError, "all must be finite numbers"),
    (lambda run: run(structure=own(step=lambda *_: "x")), TypeError, "the state that step returned for t = 0.0005 s"),
    (lambda run: run(structure=own(points=lambda *_: [1.0])), ValueError, "what points returned for t = 0 s"),
    (lambda run: run(structure=own(step=None)), TypeError, "step is None: it must be a function"),
    (lambda run: run(structure=own(initial=[0.0])), ValueError, "initial has 1 numbers: give the modal and"),
    (lambda run: run(structure=own(coordinates="x")), ValueError, "must be one of angles, displacements, modal"),
    (lambda run: run("real-time", structure=own()), ValueError, "use the mode free or lockstep"),
    (lambda run: run(structure=resonarm.Modal(MODES)), TypeError, "scenario.replace(structure=chain.section)"),
    (
        lambda run: run(sections={"structure": resonarm.Modal(MODES).section}, structure=own()),
        ValueError,
        "`kind` is modal, but the program has its own structure",
    ),
    (
        lambda run: run(sections={"rig": {"exciter": {"at": "tip"}}}, structure=own()),
        ValueError,
        "rig.exciter: `at` is given, and the program that makes the structure says where it is",
    ),
    (lambda run: run(sections={"structure": {"kind": "own"}}), ValueError, "no program provides the structure"),
    (
        lambda _run: resonarm.Node("exciter", resonarm.Scenario(), "vcan0", structure=own()),
        ValueError,
        "structure applies only to a plant: leave it out for an exciter",
    ),
]


@pytest.mark.parametrize(("call", "kind", "message"), CASES, ids=[message for _, _, message in CASES])
def test_what_is_wrong_is_said(call, kind, message, scenario):
    def run(*words, sections=None, **options):
        return resonarm.run(scenario.replace(**(sections or {})), *words, **options)

    with pytest.raises(kind) as raised:
        call(run)
    assert message in str(raised.value)


def test_a_plant_stays_at_a_sample_that_could_not_be_finished():
    plant = resonarm.Plant(structure=own(step=broken, initial=[1e-3, 0, 0, 0]))
    with pytest.raises(LookupError, match="no such stiffness"):
        plant.play(force_n=np.zeros((100, 2)))
    assert (plant.sample, plant.states["q_m_sqrt_kg"]) == (50, (1e-3, 0.0))


@pytest.mark.parametrize("mode", ["free", "lockstep"])
def test_a_bench_runs_it_in_place_of_the_arm(tmp_path, mode):
    def pulse(measured):
        return (20.0, 0.0) if measured.sample < 50 else None

    with Bench(resonarm.Scenario(), tmp_path, mode=mode, structure=own()) as bench:
        rows = bench.run(pulse).recording.states
    assert "q_m_sqrt_kg" in rows.dtype.names and abs(rows["q_m_sqrt_kg"]).max() > 1e-6
