"""Optional packages."""

from importlib import import_module
from types import ModuleType
from typing import Any


def require(module: str, extra: str) -> ModuleType:
    """The module, or an error that says which extra of this package installs it."""
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        message = f"{module} is missing: python3 -m pip install 'resonarm[{extra}]'"
        raise ModuleNotFoundError(message, name=module) from error


def axes(ax: Any) -> Any:
    """The given matplotlib axes, or the current ones."""
    return require("matplotlib.pyplot", "plot").gca() if ax is None else ax
