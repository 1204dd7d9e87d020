"""The memory for reading a recording does not depend on its length."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from processes import RESONARM

SHORT_S, LONG_S = 10, 100
# Additional memory allowed for ten times the file, MiB: `resim` holds blocks of 32768 states of 72 bytes in a vector
# that grows by doubling, old and new at once, 7 MiB, which a short file doesn't fill; the memory that an allocator
# keeps varies from run to run.
MORE_MIB = 12

SCENARIO = """
[simulation]
duration_s = {duration_s}
[excitation]
amplitude = {{ exciter_x = 100.0 }}
profile = {{ waveform = "dwell", frequency_hz = 18.0, duration_s = 1000.0, settle_s = 1.0 }}
"""


# A process inherits the peak of its parent, so the parent is small.
MEASURE = """
import os, subprocess, sys
process = subprocess.Popen(sys.argv[1:], stdout=subprocess.DEVNULL)
_, status, usage = os.wait4(process.pid, 0)
process.returncode = os.waitstatus_to_exitcode(status)
print(process.returncode, usage.ru_maxrss)
"""


def peak_mib(folder, *arguments):
    """The program's exit code, and its peak memory (getrusage(2), `ru_maxrss`), MiB."""
    words = [sys.executable, "-c", MEASURE, Path(RESONARM).resolve(), *arguments]
    said = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=600, check=True).stdout
    code, peak_kib = map(int, said.split())
    return code, peak_kib / 1024


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """A short and a long recording, and each of them without its end."""
    folder = tmp_path_factory.mktemp("memory")
    for name, duration_s in (("short", SHORT_S), ("long", LONG_S)):
        (folder / f"{name}.toml").write_text(SCENARIO.format(duration_s=float(duration_s)))
        code, _ = peak_mib(folder, "run", "--mode", "free", "--scenario", f"{name}.toml", "--record", f"{name}.mcap")
        assert code == 0
        whole = (folder / f"{name}.mcap").read_bytes()
        (folder / f"{name}-cut.mcap").write_bytes(whole[:-1000])
    # The comparison means little if the longer run does not make the larger file.
    assert os.path.getsize(folder / "long.mcap") > 9 * os.path.getsize(folder / "short.mcap")
    return folder


@pytest.mark.parametrize(
    "command",
    [
        ("inspect", "{}.mcap"),
        ("resim", "{}.mcap"),
        ("recover", "{}-cut.mcap", "{}-repaired.mcap"),
        ("replay", "{}.mcap", "--bus", "python-can:interface=virtual,channel=memory", "--speed", "0"),
    ],
    ids=lambda command: command[0],
)
def test_memory_does_not_grow_with_the_file(recordings, command):
    code, short_mib = peak_mib(recordings, *(word.format("short") for word in command))
    long_code, long_mib = peak_mib(recordings, *(word.format("long") for word in command))
    assert (code, long_code) == (0, 0)
    assert long_mib < short_mib + MORE_MIB, f"{short_mib:.1f} and {long_mib:.1f} MiB"
