"""The hardware of the example, driven as the acquisition and output processes of Rattlesnake drive theirs."""

import importlib.util
import multiprocessing
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import resonarm

ROOT = Path(__file__).resolve().parents[2]
SPEC = importlib.util.spec_from_file_location("rattlesnake_hardware", ROOT / "python/examples/rattlesnake.py")
hardware = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(hardware)

SCENARIO = ROOT / "scenarios/bench.toml"
WRITE, READ, FRAMES = 300, 200, 6


def parameters(**more):
    standard = {"sample_rate": 1000, "samples_per_read": READ, "samples_per_write": WRITE, "output_oversample": 1}
    return SimpleNamespace(**standard | more)


def channel(node, direction="", feedback=None):
    return SimpleNamespace(node_number=node, node_direction=direction, feedback_device=feedback)


CHANNELS = [channel("c", "X+"), channel("head", "x"), channel("force-y", "y", "virtual"), channel("b", "y")]
FORCE_N = np.random.default_rng(4).normal(scale=5, size=FRAMES * WRITE)


def output_process(queue, sync, written, commands):
    """Writes frames while the hardware is ready for them, and stops at a command."""
    output = hardware.ResonarmOutput(queue)
    output.set_up_data_output_parameters_and_channels(parameters(), CHANNELS)
    frames = iter(FORCE_N.reshape(FRAMES, 1, WRITE))
    output.write(next(frames))
    output.start()
    sync.put("started")
    count = 1
    while commands.empty():
        if output.ready_for_new_output() and count < FRAMES:
            output.write(next(frames))
            count += 1
    written.put(count)
    output.stop()
    output.close()


def test_it_is_driven_as_rattlesnakes_processes_drive_hardware():
    context = multiprocessing.get_context("fork")
    queue, sync, written, commands = (context.Queue() for _ in range(4))
    acquisition = hardware.ResonarmAcquisition(SCENARIO, queue)
    acquisition.set_up_data_acquisition_parameters_and_channels(parameters(), CHANNELS)
    # Longer than a process may be delayed: an output that is late here has not stopped.
    acquisition.frame_s = 60.0
    output = context.Process(target=output_process, args=(queue, sync, written, commands))
    output.start()
    assert sync.get(timeout=60) == "started"
    acquisition.start()
    read = [acquisition.read() for _ in range(FRAMES * WRITE // READ)]
    commands.put("stop")
    assert written.get(timeout=60) == FRAMES
    output.join(60)
    remaining = acquisition.read_remaining()
    acquisition.stop()
    acquisition.close()
    assert output.exitcode == 0
    assert acquisition.get_acquisition_delay() == WRITE
    data = np.concatenate([*read, remaining], axis=1)
    assert data.shape == (4, FRAMES * WRITE + 1)
    force_n = np.zeros((FRAMES * WRITE + 1, 2))
    force_n[:-1, 1] = FORCE_N
    expected = resonarm.Plant(resonarm.Scenario.load(SCENARIO)).play(force_n=force_n)
    np.testing.assert_array_equal(data[0], expected["acceleration_c_m_s2"][:, 0])
    np.testing.assert_array_equal(data[1], expected["head_force_n"][:, 0])
    np.testing.assert_array_equal(data[2], force_n[:, 1])
    np.testing.assert_array_equal(data[3], expected["acceleration_b_m_s2"][:, 1])


def test_without_frames_the_arm_rings_out():
    acquisition = hardware.ResonarmAcquisition(SCENARIO, multiprocessing.Queue())
    acquisition.set_up_data_acquisition_parameters_and_channels(parameters(samples_per_read=20), CHANNELS)
    acquisition.start()
    assert not acquisition.read()[2].any()


@pytest.mark.parametrize(
    ("test_data", "channels", "message"),
    [
        ({"sample_rate": 2000}, CHANNELS, "the test has 2000 Hz"),
        ({"output_oversample": 10}, CHANNELS, "10 times as much at the output"),
        ({}, [channel("d", "x")], "there is no reading 'd' 'x': expected head, b or c along x or y"),
        ({}, [channel("moment", "", "virtual")], "there is no output 'moment': expected one of force-x, force-y"),
    ],
)
def test_settings_that_the_bench_lacks_are_refused(test_data, channels, message):
    acquisition = hardware.ResonarmAcquisition(SCENARIO, multiprocessing.Queue())
    with pytest.raises(ValueError) as raised:
        acquisition.set_up_data_acquisition_parameters_and_channels(parameters(**test_data), channels)
    assert message in str(raised.value)
