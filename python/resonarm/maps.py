"""Maps of the response over pose, amplitude and frequency, on all cores or on a Dask cluster, resumable."""

import hashlib
import json
import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _extras
from .arm import Arm
from .continuation import Branch, BranchEndedEarly

VARIABLES = {
    "stable": ("1", "number of stable motions"),
    "unstable": ("1", "number of unstable motions"),
    "least_rad": ("rad", "largest |α| of the smallest stable motion"),
    "largest_rad": ("rad", "largest |α| of the largest stable motion"),
}
LARGEST_STEP = 0.05
"""Largest step along a branch, relative to the motion's size: between its motions the map is linear."""


def response_map(
    arm: Arm,
    *,
    frequency_hz: Sequence[float],
    torque1_nm: Sequence[float],
    beta2_deg: Sequence[float] | None = None,
    folder: str | PathLike[str] | None = None,
    client: Any = None,
) -> Any:
    """Which periodic motions there are at each frequency, Hz, torque amplitude at joint 1, N·m, and angle β2, degrees.

    An `xarray.Dataset` with units: the numbers of stable and unstable motions and, for each joint, the largest |α| of
    the smallest and of the largest stable motion, rad; NaN where there is none. Between the motions of a branch it is
    linear.

    Each pair of β2 and amplitude is one branch over the frequencies, a chunk: computed by a Dask `client`, or on all
    cores of this machine without one, to the same bits. With a `folder`, which a cluster shares, each chunk is kept
    there as it is done, and a call that was stopped goes on from what it holds. `ended_early` tells the chunks whose
    branch could not be followed to its end: beyond there are no motions in the map.

    Raises ValueError for frequencies that don't rise, and for what no arm can have.
    """
    xarray = _extras.require("xarray", "dask")
    hz = np.asarray(frequency_hz, dtype=np.float64)
    if hz.ndim != 1 or len(hz) < 2 or not (np.diff(hz) > 0).all() or hz[0] <= 0:
        raise ValueError("frequency_hz must be two or more positive frequencies that rise")
    poses = [arm.beta2_deg] if beta2_deg is None else list(beta2_deg)
    pairs = [(float(beta), float(torque)) for beta in poses for torque in torque1_nm]
    kept = None if folder is None else Path(folder)
    if kept is not None:
        kept.mkdir(parents=True, exist_ok=True)
    arms = {beta: _posed(arm, beta) for beta in map(float, poses)}
    jobs = [
        (arms[beta], torque, hz, None if kept is None else _file(kept, arms[beta], torque, hz))
        for beta, torque in pairs
    ]
    chunks = list(_computed(jobs, client))
    shape = (len(poses), len(torque1_nm), len(hz))
    axes = ("beta2_deg", "torque1_nm", "frequency_hz")
    data: dict[str, Any] = {}
    for name, (unit, label) in VARIABLES.items():
        values = np.stack([chunk[name] for chunk in chunks])
        of_joints = values.ndim == 3
        data[name] = (
            (*axes, "joint") if of_joints else axes,
            values.reshape((*shape, 2) if of_joints else shape),
            {"units": unit, "long_name": label},
        )
    early = np.array([bool(chunk["ended_early"]) for chunk in chunks]).reshape(shape[:2])
    data["ended_early"] = (axes[:2], early, {"long_name": "the branch could not be followed to its end"})
    units = {"beta2_deg": "degree", "torque1_nm": "N m", "frequency_hz": "Hz"}
    places = {"beta2_deg": np.array(poses, float), "torque1_nm": np.array(torque1_nm, float), "frequency_hz": hz}
    coords = {name: (name, values, {"units": units[name]}) for name, values in places.items()}
    return xarray.Dataset(data, {**coords, "joint": [1, 2]}, {"arm": repr(arm)})


def _posed(arm: Arm, beta2_deg: float) -> Arm:
    return Arm(arm.preset, beta1_deg=arm.beta1_deg, beta2_deg=beta2_deg, parameters=arm.own_parameters)


def _computed(jobs: list[Any], client: Any) -> Iterator[dict[str, NDArray[Any]]]:
    """The chunks in order; threads do, as the computation lets go of the interpreter's lock."""
    if client is not None:
        yield from client.gather([client.submit(chunk, *job, pure=False) for job in jobs])
        return
    with ThreadPoolExecutor(os.cpu_count()) as threads:
        yield from threads.map(lambda job: chunk(*job), jobs)


def _file(folder: Path, arm: Arm, torque1_nm: float, hz: NDArray[np.float64]) -> Path:
    """The file of a chunk: its name holds everything that it depends on."""
    whole = json.dumps([arm.parameters, arm.beta1_deg, arm.beta2_deg, torque1_nm, hz.tolist(), LARGEST_STEP])
    return folder / f"chunk-{hashlib.sha256(whole.encode()).hexdigest()[:16]}.npz"


def chunk(arm: Arm, torque1_nm: float, hz: NDArray[np.float64], kept: Path | None) -> dict[str, NDArray[Any]]:
    """The variables of one branch at its frequencies: from the file `kept`, or computed and written there."""
    if kept is not None and kept.exists():
        with np.load(kept) as file:
            return dict(file)
    early = False
    try:
        span = (float(hz[0]), float(hz[-1]))
        branch = arm.continuation("frequency", *span, torque1_nm=torque1_nm, largest_step=LARGEST_STEP)
    except BranchEndedEarly as ended:
        branch, early = ended.branch, True
    found = {**_at(branch, hz), "ended_early": np.array(early)}
    if kept is not None:
        # Whole or not at all: who is killed while it writes leaves no half of a chunk.
        partial = kept.with_suffix(f".{os.getpid()}.part")
        with partial.open("wb") as file:
            np.savez(file, allow_pickle=False, **found)
        partial.replace(kept)
    return found


def _at(branch: Branch, hz: NDArray[np.float64]) -> dict[str, NDArray[Any]]:
    """The motions at each frequency, linear between those of the branch."""
    stable, unstable = np.zeros(len(hz), np.int64), np.zeros(len(hz), np.int64)
    least, largest = np.full((len(hz), 2), np.nan), np.full((len(hz), 2), np.nan)
    last = branch.points["value"][-1] if len(branch.points) else np.nan
    for one, other in pairwise(branch.points):
        low, high = sorted((one["value"], other["value"]))
        for k in np.flatnonzero((hz >= low) & ((hz < high) | (hz == last) & (hz <= high))):
            if high == low:
                continue
            part = (hz[k] - one["value"]) / (other["value"] - one["value"])
            amplitude = one["amplitude_rad"] * (1 - part) + other["amplitude_rad"] * part
            if one["stable"] and other["stable"]:
                stable[k] += 1
                least[k] = np.fmin(least[k], amplitude)
                largest[k] = np.fmax(largest[k], amplitude)
            else:
                unstable[k] += 1
    return {"stable": stable, "unstable": unstable, "least_rad": least, "largest_rad": largest}
