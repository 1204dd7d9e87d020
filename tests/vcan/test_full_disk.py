"""A recording on a file system that fills up during the run."""

import json
from pathlib import Path

import numpy as np
import pytest
from processes import RESONARM, run
from recordings import Recording, bits

# In a separate mount namespace: a file system of 128 KiB, the run, and the state of its recording.
SCRIPT = """
cd "$1" && mkdir disk && mount -t tmpfs -o size=128k tmpfs disk || exit 125
shift
"$0" "$@" --record disk/run.mcap --json >run.json 2>run.log
echo $? >code
df --output=avail disk | tail -1 >left
cp disk/run.mcap cut.mcap
"$0" recover disk/run.mcap whole.mcap >recovered.log
"""
# Seconds at 1 kHz, and how the run goes. On the bus nobody commands: the arm swings, and the plant sends its samples.
MODES = {
    "free": (20, ["--mode", "free"]),
    "real-time": (5, ["--bus", "vcan0"]),
}
SWINGING = """
[structure]
initial = [0.001, 0.0, 0.0, 0.0]
[excitation]
amplitude = { exciter_x = 50.0 }
profile = { waveform = "dwell", frequency_hz = 15.0, duration_s = 30.0, settle_s = 0.2 }
"""


@pytest.mark.parametrize("mode", MODES)
def test_a_disk_that_fills_up_ends_the_recording_and_not_the_run(tmp_path, mode):
    (tmp_path / "swinging.toml").write_text(SWINGING)
    duration_s, flags = MODES[mode]
    samples = 1000 * duration_s + 1
    flags = ["run", *flags, "--duration-s", duration_s, "--scenario", tmp_path / "swinging.toml"]
    run("unshare", "--mount", "sh", "-c", SCRIPT, Path(RESONARM).resolve(), tmp_path, *flags)
    said, cause = (tmp_path / "run.log").read_text(), "No space left on device"
    assert (tmp_path / "code").read_text() == "1\n", said
    assert "ERROR the recording failed: can't write recording `disk/run.mcap`: " + cause in said
    assert "the recording lacks the end of the run" in said
    assert json.loads((tmp_path / "run.json").read_text())["samples"] == samples
    assert int((tmp_path / "left").read_text()) == 0
    # What was flushed is there, to the last whole chunk, and is what a run on a larger disk records.
    kept, recovered = Recording.cut_off(tmp_path / "cut.mcap"), Recording.whole(tmp_path / "whole.mcap")
    assert np.array_equal(bits(recovered.states), bits(kept.states))
    assert 500 < len(recovered.states) < samples
    run(RESONARM, *flags, "--record", tmp_path / "larger.mcap")
    larger = Recording.whole(tmp_path / "larger.mcap")
    assert np.array_equal(bits(recovered.states), bits(larger.states[: len(recovered.states)]))
    assert len(np.unique(bits(recovered.states[:, 0]))) > 500
