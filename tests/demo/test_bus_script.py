"""The script of a quickstart that makes a virtual bus says what a machine without one lacks."""

import os
import subprocess
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[2] / "examples/quickstart/bus.sh"


def run(tmp_path, reason):
    """The script where `ip link add` fails for this reason."""
    ip = f"#!/bin/sh\n[ $2 = show ] && exit 1\n[ $2 = add ] && {{ echo '{reason}' >&2; exit 2; }}\nexit 0\n"
    for name, text in (("ip", ip), ("modprobe", "#!/bin/sh\nexit 1\n")):
        (tmp_path / name).write_text(text)
        (tmp_path / name).chmod(0o755)
    path = f"{tmp_path}:{os.environ['PATH']}"
    return subprocess.run(["sh", SCRIPT], capture_output=True, text=True, timeout=60, env=os.environ | {"PATH": path})


@pytest.mark.parametrize("reason", ["Error: Unknown device type.", "RTNETLINK answers: Operation not supported"])
def test_a_kernel_without_vcan_is_named(tmp_path, reason):
    """It printed the words of `ip` alone."""
    done = run(tmp_path, reason)
    assert (done.returncode, done.stdout) == (3, "")
    first, *rest = done.stderr.splitlines()
    assert first == f"bus.sh: the kernel {os.uname().release} lacks vcan, the virtual CAN bus (ip: {reason})."
    assert f"sudo apt install linux-modules-extra-{os.uname().release}" in rest[0]
    assert "`pytest python`" in rest[2]


def test_missing_privileges_are_named(tmp_path):
    done = run(tmp_path, "RTNETLINK answers: Operation not permitted")
    assert done.returncode == 3
    assert done.stderr == f"bus.sh: vcan0 can't be made without privileges: sudo {SCRIPT} vcan0\n"


def test_an_interface_that_can_be_made_is_up(tmp_path):
    for name, text in (("ip", "#!/bin/sh\n[ $2 = show ] && exit 1\nexit 0\n"), ("modprobe", "#!/bin/sh\n")):
        (tmp_path / name).write_text(text)
        (tmp_path / name).chmod(0o755)
    path = f"{tmp_path}:{os.environ['PATH']}"
    done = subprocess.run(["sh", SCRIPT], capture_output=True, text=True, timeout=60, env=os.environ | {"PATH": path})
    assert (done.returncode, done.stdout) == (0, "vcan0 is up\n")
