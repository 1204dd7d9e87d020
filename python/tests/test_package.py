"""The package: its types match the extension, and it needs only NumPy."""

import ast
import subprocess
import sys
from importlib.metadata import distribution
from pathlib import Path

import tomllib

import resonarm
from resonarm import _resonarm

PACKAGE = Path(resonarm.__file__).parent
SOURCE = Path(__file__).resolve().parents[1]


def test_types_are_those_of_the_extension():
    stub = ast.parse((PACKAGE / "_resonarm.pyi").read_text())
    typed = {node.name: node for node in stub.body if isinstance(node, ast.ClassDef | ast.FunctionDef)}
    there = {name for name in dir(_resonarm) if not name.startswith("__")}
    assert set(typed) == there
    for name in there:
        if isinstance(typed[name], ast.ClassDef) and name != "ResonarmError":
            members = {node.name for node in typed[name].body if isinstance(node, ast.FunctionDef)}
            public = {member for member in vars(getattr(_resonarm, name)) if not member.startswith("__")}
            assert {member for member in members if not member.startswith("__")} == public, name


def test_everything_public_is_documented():
    for name in resonarm.__all__:
        thing = getattr(resonarm, name)
        assert name == "__version__" or thing.__doc__, name


def test_the_wheel_says_what_it_needs():
    metadata = distribution("resonarm").metadata
    project = tomllib.loads((SOURCE / "pyproject.toml").read_text())["project"]
    assert metadata["Version"] == resonarm.__version__
    assert [need for need in metadata.get_all("Requires-Dist") if "extra" not in need] == project["dependencies"]
    assert set(metadata.get_all("Provides-Extra")) == set(project["optional-dependencies"])
    assert (PACKAGE / "py.typed").exists()


def test_nothing_but_numpy_is_imported():
    code = "import sys, resonarm; print(*{name.partition('.')[0] for name in sys.modules})"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert {"numpy", "resonarm"} <= set(loaded)
    assert not {"can", "matplotlib", "pyarrow", "asammdf", "pytest", "dask", "xarray", "pandas"} & set(loaded)
