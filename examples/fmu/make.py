"""Builds the FMU of mass.c: `make.py OUT.fmu`, of FMI 2.0 `make.py OUT.fmu 2`; needs gcc, on Linux."""

import platform
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

HERE = Path(__file__).parent
MACHINE = {"x86_64": ("linux64", "x86_64-linux"), "aarch64": ("aarch64-linux", "aarch64-linux")}


def make(out, version=3, library=()):
    """The FMU; `library` are more words for gcc."""
    folder = MACHINE[platform.machine()][version - 2]
    with tempfile.TemporaryDirectory() as built:
        path = Path(built) / "mass.so"
        words = ["gcc", "-O1", "-shared", "-fPIC", f"-DFMI{version}", "-Wall", "-Wextra", "-Werror", *library]
        subprocess.run([*words, str(HERE / "mass.c"), "-lm", "-o", str(path)], check=True)
        with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.write(HERE / f"fmi{version}.xml", "modelDescription.xml")
            archive.write(path, f"binaries/{folder}/mass.so")


if __name__ == "__main__":
    make(sys.argv[1], *(int(version) for version in sys.argv[2:]))
