"""The kernel that these tests run on, often User-Mode Linux, keeps the registers of each process apart: numbers can be
trusted."""

import subprocess
from pathlib import Path

HOLD_REGISTERS = Path(__file__).parent.parent / "uml" / "hold_registers.c"


def test_registers_survive_other_processes(tmp_path):
    program = tmp_path / "hold_registers"
    subprocess.run(["cc", "-O2", "-Wall", "-Wextra", "-Werror", "-o", program, HOLD_REGISTERS], check=True)
    running = [subprocess.Popen([program, str(byte), "5000"]) for byte in (1, 2, 3, 4)]
    assert [process.wait(timeout=120) for process in running] == [0, 0, 0, 0]
