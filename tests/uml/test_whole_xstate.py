"""User-Mode Linux gets floating point right on processors whose registers it doesn't know; whole_xstate.c says how.

What it meets there, a short buffer, is made here on whatever processor this is: the same outcome is asked of all of
them.
"""

import os
import subprocess
from pathlib import Path

import pytest

HERE = Path(__file__).parent
COMPILE = ["cc", "-O2", "-Wall", "-Wextra", "-Werror"]


@pytest.fixture(scope="module")
def programs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("programs")
    library, tracer = folder / "whole_xstate.so", folder / "set_part_of_xstate"
    subprocess.run([*COMPILE, "-shared", "-fPIC", "-o", library, HERE / "whole_xstate.c"], check=True)
    subprocess.run([*COMPILE, "-o", tracer, HERE / "set_part_of_xstate.c"], check=True)
    return library, tracer


def set_part(tracer, length, preloaded=None):
    environment = {**os.environ, "LD_PRELOAD": str(preloaded)} if preloaded else os.environ
    run = subprocess.run([tracer, str(length)], env=environment, capture_output=True, text=True, timeout=60)
    assert run.returncode in (0, 1), run.stderr
    return run.stdout.split(" bytes, ", 1)[1].strip()


def area(tracer):
    """The bytes of this processor's XSAVE area: 832 with AVX, more with later extensions."""
    run = subprocess.run([tracer, "65536"], capture_output=True, text=True, timeout=60, check=True)
    return int(run.stdout.split()[1])


# The legacy region and the header (576 bytes), and all but the end of what this processor has.
@pytest.mark.parametrize("length", [lambda _: 576, lambda tracer: area(tracer) - 64], ids=["legacy", "all-but-the-end"])
def test_the_kernel_refuses_a_part_and_gets_the_whole(programs, length):
    library, tracer = programs
    part = length(tracer)
    assert set_part(tracer, part) == "set: errno 14"
    assert set_part(tracer, part, library) == "set: done, xmm0 22 22, upper half 11 11"


def test_a_buffer_that_is_long_enough_is_passed_on(programs):
    library, tracer = programs
    for preloaded in (None, library):
        assert set_part(tracer, 65536, preloaded) == "set: done, xmm0 22 22, upper half 11 11"
