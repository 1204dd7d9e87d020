"""Plant and exciter as two processes on a real CAN interface, in lockstep, against independent tools and theory."""

import math

import numpy as np
import pytest
import wire
from conftest import free, session
from linear_arm import LinearArm, amplitudes
from recordings import RECEIVED, SENT, bits

FREQUENCIES_HZ = [12.0, 19.0, 26.0]
FORCE_N = 200.0
RATE_HZ = 1000.0
SETTLE_S = 1.0
RAMP_S = 1.0
DWELL_S = 6.0
COUNT_M_S2 = 0.05
ARM = LinearArm(beta1_deg=30, beta2_deg=60)
SENT_BY_PLANT = {message.frame_id for message in wire.DBC.messages if message.senders == ["Plant"]}


def outside(by_plant, plant):
    """How many frames of one end are before the other's first or after its last."""
    first, last = by_plant.index(not plant), len(by_plant) - by_plant[::-1].index(not plant)
    return first + len(by_plant) - last


def test_candump_sees_every_frame_of_both_ends(lockstep):
    plant, exciter = lockstep.plant["bus"], lockstep.exciter["bus"]
    assert len(lockstep.frames) == plant["sent"] + exciter["sent"]
    # Who is not there yet or no longer hears nothing, nor reads the frames that come while it leaves.
    by_plant = [frame.id in SENT_BY_PLANT for frame in lockstep.frames]
    assert plant["sent"] - outside(by_plant, True) - 3 <= exciter["received"] <= plant["sent"]
    assert exciter["sent"] - outside(by_plant, False) - 3 <= plant["received"] <= exciter["sent"]
    for end in (plant, exciter):
        assert (end["dropped"], end["refused"]) == (0, 0)


def test_every_frame_is_of_the_dbc_in_range_in_sequence_and_protected(lockstep):
    wire.check(lockstep.frames)


def test_samples_and_answers_alternate(lockstep):
    names = {0x203: "head", 0x204: "b", 0x205: "c", 0x201: "answer"}
    order = [names[frame.id] for frame in lockstep.frames if frame.id in names]
    answers = order.count("answer")
    # After the last answer come the sample at which the exciter disarms, and those of the ramp.
    assert order == ["head", "b", "c", "answer"] * answers + ["head", "b", "c"] * (lockstep.plant["samples"] - answers)
    names = ("ImpedanceHead", "ForceCommand")
    heads, answers = (wire.columns(lockstep.frames, name, "force_x_n")[:, 0] for name in names)
    # The head reads the last five holds under a B-spline of order 5, give or take its noise of 0.01 N.
    expected = np.convolve(answers, np.array([1, 26, 66, 26, 1]) / 120)[: len(answers)]
    assert np.abs(heads[1 : len(answers) + 1] - expected).max() < 0.1


def held(frequency_hz):
    """The fraction of a sine's amplitude when it is held from sample to sample: sin πf/r over πf/r."""
    return np.sinc(frequency_hz / RATE_HZ)


def linear(frequency_hz):
    """Amplitudes of B_x, B_y, C_x, C_y, m/s²."""
    return np.abs(ARM.accelerations(frequency_hz, [FORCE_N * held(frequency_hz), 0.0]))


def near(found, expected):
    return np.all(np.abs(found - expected) <= 0.005 * expected + 0.5 * COUNT_M_S2)


def test_frequencies_lie_off_resonance():
    natural_hz = ARM.natural_frequencies_hz()
    assert min(abs(f - n) for f in FREQUENCIES_HZ for n in natural_hz) > 3


@pytest.mark.parametrize("step", range(3))
def test_amplitudes_on_the_wire_are_those_of_linear_theory(lockstep, step):
    axes = ("acceleration_x_m_s2", "acceleration_y_m_s2")
    signals = np.hstack([wire.columns(lockstep.frames, f"Accelerometer{point}", *axes) for point in "BC"])
    starts_s = np.cumsum([0.0] + [math.ceil(DWELL_S * f) / f for f in FREQUENCIES_HZ])
    first, end = starts_s[step] + SETTLE_S, starts_s[step + 1] - RAMP_S
    window = signals[int(first * RATE_HZ) : int(end * RATE_HZ)]
    found = amplitudes(window, RATE_HZ, FREQUENCIES_HZ[step], ARM.natural_frequencies_hz())
    # A B-spline of order 5 lets through as much as five holds.
    expected = linear(FREQUENCIES_HZ[step]) * held(FREQUENCIES_HZ[step]) ** 5
    assert near(found, expected), (found, expected)


@pytest.mark.parametrize("step", range(3))
def test_amplitudes_that_the_exciter_reads_are_those_of_linear_theory(lockstep, step):
    response = lockstep.exciter["responses"][step]
    assert response["frequency_hz"] == FREQUENCIES_HZ[step] and not response["clipped"]
    found = np.array([np.hypot(*phasor) for point in "bc" for phasor in response[f"acceleration_{point}_m_s2"]])
    expected = linear(FREQUENCIES_HZ[step])
    assert near(found, expected), (found, expected)
    assert np.hypot(*response["head_force_n"][0]) == pytest.approx(FORCE_N * held(FREQUENCIES_HZ[step]), abs=0.02)


def test_the_recording_is_whole_and_says_what_the_bus_saw(lockstep):
    recording = lockstep.recording
    assert recording.messages == sum(len(messages) for messages in recording.topics.values())
    assert set(recording.topics) == {
        "/plant/steps", "/plant/samples", "/plant/state", "/plant/command", "/plant/sensors", "/can/frames", "/events",
    }  # fmt: skip
    assert len(recording.states) == lockstep.plant["samples"]
    for direction, by_plant, count in ((SENT, True, "sent"), (RECEIVED, False, "received")):
        recorded = [(frame.id, frame.data) for frame in recording.frames if frame.direction == direction]
        seen = [frame.content for frame in lockstep.frames if (frame.id in SENT_BY_PLANT) == by_plant]
        assert len(recorded) == lockstep.plant["bus"][count] and recorded == seen[: len(recorded)]
    assert recording.metadata["resonarm.lost"] == {"plant": "0"}
    assert "seed = 2" in recording.metadata["resonarm.configuration"]["scenario"]


def test_states_are_those_of_a_free_run_bit_for_bit(lockstep, free_run):
    assert np.abs(lockstep.recording.states).max(axis=0)[:4].min() > 1e-4
    assert np.array_equal(bits(lockstep.recording.states), bits(free_run.recording.states))
    assert np.array_equal(bits(lockstep.recording.samples), bits(free_run.recording.samples))


def test_a_free_run_gives_the_same_file_twice(tmp_path, three_frequencies, free_run):
    assert free(tmp_path, three_frequencies).path.read_bytes() == free_run.path.read_bytes()


# An exciter on a bus corrects readings for the converter that the scenario states, and for no other.
WALK = """
[structure]
angles_deg = [30.0, 60.0]
[network]
plant_converter = "sinc5"
[control]
law = "phase-walk"
amplitude = { exciter_x = 5.0 }
points = 4
"""
# The coil's current and the armature are states of the plant beside the arm's.
SHAKER = """
[rig.shaker]
amplifier = "voltage"
moving_mass_kg = 0.05
stiffness_n_m = 500.0
damping_n_s_m = 5.0
force_factor_n_a = 20.0
resistance_ohm = 40.0
inductance_h = 1e-5
stroke_m = 0.2
current_limit_a = 30.0
voltage_limit_v = 1600.0
"""


@pytest.mark.parametrize("shaker", ["", SHAKER], ids=["ideal", "shaker"])
def test_a_closed_loop_of_two_processes_is_the_free_one_bit_for_bit(tmp_path, shaker):
    scenario = tmp_path / "walk.toml"
    scenario.write_text(WALK + shaker)
    both = session(tmp_path, "vcan0", "vcan0", scenario)
    alone = free(tmp_path, scenario)
    assert both.exciter["outcome"] == "finished" and all(point["settled"] for point in both.exciter["responses"])
    assert both.exciter["responses"] == alone.plant["responses"] and len(alone.plant["responses"]) == 4
    assert np.array_equal(bits(both.recording.states), bits(alone.recording.states))
    assert np.array_equal(bits(both.recording.samples), bits(alone.recording.samples))
