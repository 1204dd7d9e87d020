"""Pictures of chains and modal structures."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _extras, _resonarm


def plot(structure: _resonarm.Assembly, ax: Any = None, *, mode: int | None = 1) -> Any:
    """Draws the structure, grey at rest and in a natural mode, numbered from 1, or at rest alone where `mode` is None.
    A chain is drawn link by link with its turns magnified, modes by their points and the lines between them. Of points
    along z a plane is drawn from aslant. `ax` are matplotlib's axes, by default those of a new figure; they are
    returned.

    Raises ValueError for a mode that there is not, and for modes without `points`.
    """
    modes = structure.modes()
    if mode is not None and not 1 <= mode <= len(modes):
        raise ValueError(f"mode is {mode}: it must be from 1 to {len(modes)}, or None")
    shape = [0.0] * len(modes) if mode is None else list(modes[mode - 1].shape)
    drawn = structure.drawn(shape)
    if drawn is None:
        raise ValueError("the positions of the structure's points are unknown: give `points`, {'tip': (0.3, 0.0, 0.0)}")
    names, lines, rest, moved = drawn
    ax = _extras.axes(ax)
    at_rest, deflected = _flat(np.array(rest)), _flat(np.array(moved))
    joined = lines or [[k] for k in range(len(names))]
    for number, line in enumerate(joined):
        ax.plot(*at_rest[line].T, "o-", color="0.7", markersize=4, label=None if number else "at rest")
    if mode is not None:
        for number, line in enumerate(joined):
            label = None if number else f"mode {mode}"
            ax.plot(*deflected[line].T, "o-", color="C0", markersize=5, label=label)
        if not lines:
            for start, end in zip(at_rest, deflected, strict=True):
                ax.plot(*np.stack([start, end]).T, "-", color="C0", linewidth=1)
        ax.set_title(f"mode {mode}: {modes[mode - 1].frequency_hz:.4g} Hz")
    for name, place in zip(names, at_rest, strict=True):
        ax.annotate(name, place, xytext=(4, 4), textcoords="offset points", fontsize="small", color="0.4")
    ax.set_aspect("equal", adjustable="datalim")
    return _extras.labelled(ax, "x (m)", "y (m)")


def _flat(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the positions of points in the picture: x and y, and a half of z along both, as seen from aslant."""
    return np.asarray(points[:, :2] + 0.5 * points[:, 2:])
