"""FMUs that `resonarm fmu` writes, unpacked and instantiated by FMPy."""

import contextlib
import os
import subprocess
import threading
from pathlib import Path

import fmpy
import numpy as np
from fmpy.fmi3 import FMU3Slave

from processes import RESONARM
from recordings import bits

# The library within the FMUs, as the Rust tests build it.
LIBRARY = os.environ.get("RESONARM_FMU_LIBRARY", "target/debug/deps/libresonarm_fmu.so")


# FMPy enters the library's folder while it loads it. The working directory belongs to the whole process, so that two
# threads that load at once would leave it wherever the slower one came from.
LOADING = threading.Lock()


def stripped(folder):
    """The library without what debuggers need, a fifth of its size."""
    library = folder / "libresonarm_fmu.so"
    subprocess.run(["strip", "--strip-debug", "-o", library, LIBRARY], check=True)
    return library


def export(library, scenario, out, *flags):
    """The FMU of a scenario file, and what the program says of it."""
    words = [RESONARM, "fmu", "--scenario", scenario, "--out", out, "--library", library, *flags]
    return subprocess.run([str(word) for word in words], capture_output=True, text=True, check=False)


class Fmu:
    """An FMU, unpacked once for all its instances."""

    def __init__(self, path, folder):
        self.path, self.folder = Path(path), Path(folder)
        fmpy.extract(str(path), str(folder))
        self.description = fmpy.read_model_description(str(path))
        self.references = {variable.name: variable.valueReference for variable in self.description.modelVariables}

    def of(self, *names):
        return [self.references[name] for name in names]

    @property
    def states(self):
        return [reference for name, reference in self.references.items() if name.startswith("state.")]

    @contextlib.contextmanager
    def instance(self, *, event_mode=False, token=None, start_s=0.0, **values):
        """An instance in step mode, with these parameters, `seed=4` for `parameter.seed`; ends and is freed."""
        slave, log = self.made(event_mode=event_mode, token=token)
        try:
            for name, value in values.items():
                setter = {bool: slave.setBoolean, int: slave.setUInt64, float: slave.setFloat64, str: slave.setString}
                setter[type(value)](self.of(f"parameter.{name}"), [value])
            slave.enterInitializationMode(startTime=start_s)
            slave.exitInitializationMode()
            if event_mode:
                slave.updateDiscreteStates()
                slave.enterStepMode()
            slave.log = log
            yield slave
        finally:
            slave.freeInstance()

    def made(self, *, event_mode=False, token=None):
        """An instance, and the messages that it logs."""
        log = []
        identifier = self.description.coSimulation.modelIdentifier
        with LOADING:
            slave = FMU3Slave(
                guid=token or self.description.instantiationToken, unzipDirectory=str(self.folder),
                modelIdentifier=identifier, instanceName=self.path.stem,
            )
        slave.instantiate(
            eventModeUsed=event_mode, logMessage=lambda _, status, category, text: log.append((status, text.decode()))
        )
        return slave, log


def same(one, other):
    """Whether numbers are the same, bit for bit."""
    return np.array_equal(bits(np.asarray(one)), bits(np.asarray(other)))
