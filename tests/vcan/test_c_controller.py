"""The reference controller in C, `firmware-protocol/c`, shakes the plant on vcan, in lockstep and in real time."""

import os
import re

import numpy as np
import pytest
import wire
from conftest import Run, session
from processes import wait_until
from recordings import Recording, bits
from shaker import SHAKER, fundamental

CONTROLLER = os.environ.get("RESONARM_C_CONTROLLER", "firmware-protocol/c/build/controller")

ARM = """
[structure]
angles_deg = [30.0, 60.0]
"""
FORCE_N = 2.0
# An exit status of the controller, and how often it tries a frequency.
GAVE_UP, TRIES = 6, 30
# How candump logs a heartbeat of the plant.
HEARTBEAT = " vcan0 701#"
HELD = ["--frequencies-hz", "14,18", "--amplitude-n", FORCE_N, "--ramp-s", 0.3, "--settle-s", 0.3, "--window-s", 1]


def controller(programs, *arguments):
    return programs.start("controller", CONTROLLER, *arguments)


def points(program):
    """The controller's results for each frequency."""
    lines = re.findall(r"^point (.*)$", program.stdout, re.MULTILINE)
    return [{name: float(value) for name, value in (word.split("=") for word in line.split())} for line in lines]


def check_points(program, frames, rate_hz, frequencies_hz):
    """At each frequency the head's frames have the wanted amplitude, by a fit of this test's own."""
    assert program.stdout.endswith("\nfinished\n"), program.stdout + program.stderr
    found = points(program)
    assert [point["frequency_hz"] for point in found] == frequencies_hz
    first = wire.messages(frames, "ForceCommand")[0]["sample"]
    head = {message["sample"]: message["force_x_n"] for message in wire.messages(frames, "ImpedanceHead")}
    for point in found:
        window = np.array([head[first + n] for n in range(int(point["first"]), int(point["end"]))])
        force_n = fundamental(window, rate_hz, point["frequency_hz"])
        assert force_n == pytest.approx(FORCE_N, rel=0.005), point
        assert point["force_n"] == pytest.approx(force_n, rel=0.002), point
    return found


def drive(programs, folder, scenario, *arguments):
    """A run in lockstep, over when the controller has ended."""
    path = folder / "c.mcap"
    common = ["--bus", "vcan0", "--mode", "lockstep", "--scenario", scenario, "--json"]
    plant = programs.resonarm("run", *common, "--stop-on-disarm", "--record", path)
    run = controller(programs, "vcan0", "--lockstep", *arguments)
    run.wait()
    return Run(path=path, program=run, plant=plant)


def lockstep(programs, folder, scenario, *arguments):
    """The same in the classic profile, with every frame."""
    dump = programs.candump()
    run = drive(programs, folder, scenario, *arguments)
    run.frames = wire.log(dump)
    return run


def test_the_force_in_the_head_is_held_in_lockstep(tmp_path, programs):
    scenario = tmp_path / "shaker.toml"
    scenario.write_text(ARM + SHAKER.format(stroke_m=0.0127))
    # The last is near the resonance with the shaker on it.
    run = lockstep(programs, tmp_path, scenario, *HELD, "--frequencies-hz", "14,18,20.5", "--window-s", 2)
    found = check_points(run.program, run.frames, 1000.0, [14.0, 18.0, 20.5])
    assert run.program.wait() == 0
    # The command is not the force: it had to be found.
    assert any(abs(point["command_n"] / FORCE_N - 1) > 0.05 and point["tries"] > 1 for point in found), found
    assert run.plant.result()["outcome"] == "disarmed"
    wire.check(run.frames)
    # Its last word is that it leaves.
    assert wire.messages(run.frames, "ExciterEmergency")[-1]["code"] == 12


FD = ["--profile", "fd", "--base", "0x300", "--plant-id", 3, "--exciter-id", 4]
FD_NETWORK = """
[network]
profile = "fd"
base_id = 0x300
plant_id = 3
exciter_id = 4
"""


def test_the_force_in_the_head_is_held_in_the_fd_profile(tmp_path, programs):
    scenario = tmp_path / "shaker.toml"
    scenario.write_text(ARM + SHAKER.format(stroke_m=0.0127) + FD_NETWORK)
    run = drive(programs, tmp_path, scenario, *HELD, *FD)
    assert run.program.stdout.endswith("\nfinished\n"), run.program.stdout + run.program.stderr
    assert run.plant.result()["outcome"] == "disarmed"
    for point in points(run.program):
        window = run.recording.samples[int(point["first"]) : int(point["end"]), 4]
        assert fundamental(window, 1000.0, point["frequency_hz"]) == pytest.approx(FORCE_N, rel=0.005), point


SINES = """
[excitation]
amplitude = { exciter_x = 150.0 }
ramp_s = 0.5
profile = { waveform = "sine-list", frequencies_hz = [12.0, 19.7, 26.0], dwell_s = 2.0, settle_s = 0.5 }
"""
PLAYED = ["--open-loop", "--frequencies-hz", "12,19.7,26", "--amplitude-n", 150, "--dwell-s", 2, "--ramp-s", 0.5]


@pytest.mark.parametrize(("network", "flags"), [("", []), (FD_NETWORK, FD)], ids=["classic", "fd"])
def test_the_same_sines_give_the_states_of_the_emulated_controller_bit_for_bit(tmp_path, programs, network, flags):
    scenario = tmp_path / "sines.toml"
    scenario.write_text(ARM + SINES + network)
    emulated = session(tmp_path, "vcan0", "vcan0", scenario).recording
    run = drive(programs, tmp_path, scenario, *PLAYED, *flags)
    assert run.program.wait() == 0, run.program.stdout + run.program.stderr
    assert run.plant.wait() == 0
    assert np.abs(emulated.states).max(axis=0)[:4].min() > 1e-4
    # Adding 0 takes the sign off zeros: along y the emulated controller commands 0 times the sine.
    assert np.array_equal(bits(run.recording.states + 0.0), bits(emulated.states + 0.0))
    assert np.array_equal(bits(run.recording.samples + 0.0), bits(emulated.samples + 0.0))


# A virtual machine may hold the controller up for longer than the 20 ms that the specification allows.
REAL_TIME = """
[simulation]
rate_hz = 300
[network]
command_timeout_s = 0.5
partner_timeout_s = 2.0
"""
PATIENT = ["--rate-hz", 300, "--command-timeout-s", 0.5, "--partner-timeout-s", 2]


def real_time(programs, folder, *flags):
    scenario = folder / "real-time.toml"
    scenario.write_text(ARM + SHAKER.format(stroke_m=0.0127) + REAL_TIME)
    return programs.resonarm("run", "--bus", "vcan0", "--scenario", scenario, "--json", *flags)


# Ramp, settling and reading of a try, as HELD has them.
TRY_S = 0.3 + 0.3 + 1.0


def held_up(frames):
    """In how many of the last tries plant or controller was held up: commands came more than 3 samples apart.

    A command that is 3 samples old, at a 20th of a period a sample, spoils the force by more than the 0.3 % in which a
    reading of 300 samples has to lie.
    """
    times_s = np.array([frame.time_s for frame in frames if frame.id == 0x201])
    late_s = times_s[1:][np.diff(times_s) > 3 / 300]
    tries = np.unique((times_s[-1] - late_s) // TRY_S)
    return np.count_nonzero(tries < TRIES)


def test_the_force_in_the_head_is_held_in_real_time(tmp_path, programs):
    path = tmp_path / "run.mcap"
    dump = programs.candump()
    plant = real_time(programs, tmp_path, "--stop-on-disarm", "--record", path)
    run = controller(programs, "vcan0", *PATIENT, *HELD)
    status = run.wait()
    assert plant.result()["outcome"] == "disarmed"
    frames = wire.log(dump)
    if status == GAVE_UP:
        # While the controller is stopped the plant holds its last command, and catches up with it when it was stopped
        # itself: where one of them is stopped in every try, there is no sine to be held, and that is said.
        assert run.stdout.endswith("\ngave up: the force does not settle\n"), run.stdout
        assert held_up(frames) > TRIES / 2
    else:
        assert status == 0, run.stdout + run.stderr
        check_points(run, frames, 300.0, [14.0, 18.0])
    assert np.abs(Recording.whole(path).states[-1, 4:]).max() == 0, "disarmed at the end"


def test_a_fault_of_the_plant_ends_it(tmp_path, programs):
    scenario = tmp_path / "trips.toml"
    scenario.write_text(ARM + SHAKER.format(stroke_m=1e-6))
    run = lockstep(programs, tmp_path, scenario, *HELD)
    assert run.program.wait() == 4, run.program.stdout
    assert "fault of the plant, code 14" in run.program.stdout
    assert wire.messages(run.frames, "ExciterHeartbeat")[-1]["state"] == 4


@pytest.mark.parametrize(
    ("end", "status", "said"),
    [("kill", 5, "fault of the controller, code 2"), ("leave", 8, "the plant left"), ("stop", 7, "stopped")],
)
def test_whoever_ends_first_is_told(tmp_path, programs, end, status, said):
    dump = programs.candump()
    plant = real_time(programs, tmp_path)
    run = controller(programs, "vcan0", *PATIENT, *HELD)
    wait_until(lambda: dump.stdout.count(" vcan0 201#") > 60, "60 commands")
    if end == "kill":
        plant.kill()
    elif end == "leave":
        plant.process.terminate()
    else:
        run.process.terminate()
    assert run.wait() == status, run.stdout + run.stderr
    assert run.stdout.splitlines()[-1].startswith(said)
    if end == "stop":
        # Disarmed, and ready for another.
        before = dump.stdout.count(HEARTBEAT)
        wait_until(lambda: dump.stdout.count(HEARTBEAT) >= before + 2, "heartbeats of the plant")
        assert plant.stop() == 0, plant.stderr
        states = [message["state"] for message in wire.messages(wire.log(dump), "PlantHeartbeat")]
        assert 5 in states and states[-2:] == [127, 127], states


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        (["vcan0"], 2, "--frequencies-hz: 1 to 16 of them"),
        (["vcan0", "--frequencies-hz", "12,nan"], 2, "--frequencies-hz: 1 to 16 numbers separated by commas"),
        (["vcan0", "--frequencies-hz", "100"], 2, "--frequencies-hz: above 0.001 Hz and at most a twelfth of the rate"),
        (["vcan0", *HELD, "--base", "0x201"], 2, "--base: a multiple of 0x10 from 0x180 to 0x570"),
        (["vcan0", *HELD, "--plant-id", "2"], 2, "--plant-id, --exciter-id: two numbers from 1 to 127"),
        (["vcan0", *HELD, "--profile", "can-fd"], 2, "--profile: classic or fd"),
        (["vcan0", *HELD, "--bse", "0x200"], 2, "no such option, or not a whole number"),
        (["vcan0", *HELD, "--limit-n", "1"], 2, "--amplitude-n: up to --limit-n, which is up to 655.34"),
        (HELD, 2, "no interface"),
        (["vcan99", *HELD], 3, "vcan99: No such device"),
        (["vcan0", *HELD, "--patience-s", "0.2"], 3, "no plant was armed in time"),
    ],
)
def test_what_is_wrong_is_said(programs, arguments, status, said):
    run = controller(programs, *arguments)
    assert (run.wait(), run.stderr.splitlines()[0]) == (status, f"controller: {said}")
