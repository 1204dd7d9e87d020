"""Optional packages."""

import re
from importlib import import_module
from importlib.metadata import PackageNotFoundError, requires
from types import ModuleType
from typing import Any


def require(module: str, extra: str) -> ModuleType:
    """The module, or an error that says how to install what this extra of the package brings."""
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        words = " ".join(f"'{package}'" for package in _packages(extra) or [module])
        message = f"{module} is missing: python3 -m pip install {words}"
        raise ModuleNotFoundError(message, name=module) from error


def _packages(extra: str) -> list[str]:
    """Packages that an extra of this package installs. The package is on no index, so it can't be named to pip."""
    try:
        declared = requires("resonarm") or []
    except PackageNotFoundError:
        return []
    marked = re.compile(rf"""extra\s*==\s*['"]{extra}['"]""")
    return [line.partition(";")[0].strip() for line in declared if marked.search(line)]


def axes(ax: Any) -> Any:
    """The given matplotlib axes, or those of a new figure."""
    return require("matplotlib.pyplot", "plot").subplots()[1] if ax is None else ax


def labelled(ax: Any, x: str, y: str) -> Any:
    """The axes, with their labels and a legend."""
    ax.set_xlabel(x)
    ax.set_ylabel(y)
    ax.legend()
    return ax
