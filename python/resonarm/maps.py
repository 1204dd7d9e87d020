"""Maps over pose, amplitude and frequency, over initial states and over seeds: on all cores or on a Dask cluster, with
identical bits, resumable."""

import json
import threading
from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _checks, _chunks, _extras, _resonarm
from ._chunks import Arrays, Chunk
from ._load import Load
from .arm import Arm
from .basins import AT_REST, TIME_CONSTANTS, Grid, found, pair
from .continuation import Branch, BranchEndedEarly
from .scenario import Scenario
from .session import run
from .words import Coordinate, Preset

VARIABLES = {
    "stable": ("1", "number of stable motions"),
    "unstable": ("1", "number of unstable motions"),
    "least_rad": ("rad", "largest |α| of the smallest stable motion"),
    "largest_rad": ("rad", "largest |α| of the largest stable motion"),
}
UNITS = {
    "beta2_deg": "degree",
    "torque1_nm": "N m",
    "torque2_nm": "N m",
    "force_x_n": "N",
    "force_y_n": "N",
    "frequency_hz": "Hz",
    "alpha1_rad": "rad",
    "alpha2_rad": "rad",
    "alpha1_dot_rad_s": "rad s-1",
    "alpha2_dot_rad_s": "rad s-1",
}
LARGEST_STEP = 0.05
"""Largest step along a branch, relative to the motion's size: between its motions the map is linear."""
BLOCK = 256
"""Initial states of a chunk."""

Folder = str | PathLike[str] | None
Amplitudes = Sequence[float] | None


def response_map(
    arm: Arm,
    *,
    frequency_hz: Sequence[float],
    torque1_nm: Amplitudes = None,
    torque2_nm: Amplitudes = None,
    force_x_n: Amplitudes = None,
    force_y_n: Amplitudes = None,
    beta2_deg: Sequence[float] | None = None,
    folder: Folder = None,
    client: Any = None,
) -> Any:
    """The periodic motions at each frequency, Hz, amplitude and angle β2, degrees. The amplitudes are those
    of one load: a torque at a joint, N·m, or a force at the tip along x or y, N.

    An `xarray.Dataset` with units: the numbers of stable and unstable motions and, for each joint, the largest |α| of
    the smallest and of the largest stable motion, rad; NaN where there is none. Between the motions of a branch it is
    linear.

    Each pair of β2 and amplitude is one branch over the frequencies, a chunk: computed by a Dask `client`, or on all
    cores of this machine without one, with identical bits. With a `folder`, which a cluster shares, each chunk is
    stored when it is finished, and a repeated call resumes from the stored chunks. `ended_early` marks the chunks whose
    branch could not be followed to its end: beyond it the map has no motions.

    Raises ValueError for frequencies that don't rise, and for impossible poses.
    """
    hz = np.asarray(frequency_hz, dtype=np.float64)
    if hz.ndim != 1 or len(hz) < 2 or not (np.diff(hz) > 0).all() or hz[0] <= 0:
        raise ValueError("frequency_hz must be two or more positive frequencies that rise")
    name, amplitudes = _load(torque1_nm, torque2_nm, force_x_n, force_y_n)
    places = {"beta2_deg": _poses(arm, beta2_deg), name: amplitudes}
    chunks = [
        Chunk(branch_chunk, (posed, name, amplitude, hz), [_key(posed), name, amplitude, hz.tolist(), LARGEST_STEP])
        for posed in (_posed(arm, beta) for beta in places["beta2_deg"])
        for amplitude in amplitudes
    ]
    computed = list(_chunks.computed(chunks, folder, client))
    places["frequency_hz"] = hz.tolist()
    shape, axes = tuple(map(len, places.values())), tuple(places)
    data: dict[str, Any] = {}
    for variable, (unit, label) in VARIABLES.items():
        values = np.stack([chunk[variable] for chunk in computed])
        of_joints = values.ndim == 3
        data[variable] = (
            (*axes, "joint") if of_joints else axes,
            values.reshape((*shape, 2) if of_joints else shape),
            {"units": unit, "long_name": label},
        )
    early = np.array([bool(chunk["ended_early"]) for chunk in computed]).reshape(shape[:2])
    data["ended_early"] = (axes[:2], early, {"long_name": "the branch could not be followed to its end"})
    return _dataset(data, places, {"joint": [1, 2]}, arm)


def basin_map(
    arm: Arm,
    *,
    frequency_hz: Sequence[float],
    start: Sequence[float],
    stop: Sequence[float],
    torque1_nm: Amplitudes = None,
    torque2_nm: Amplitudes = None,
    force_x_n: Amplitudes = None,
    force_y_n: Amplitudes = None,
    beta2_deg: Sequence[float] | None = None,
    coordinates: Sequence[Coordinate] = ("alpha1_rad", "alpha1_dot_rad_s"),
    points: Sequence[int] = (41, 41),
    initial: Sequence[float] = AT_REST,
    time_constants: float = TIME_CONSTANTS,
    folder: Folder = None,
    client: Any = None,
) -> Any:
    """Which initial states reach which stable motion, as `Arm.basins`, at each frequency, Hz, amplitude of one load and
    angle β2, degrees, over the same grid from `start` to `stop`.

    An `xarray.Dataset` with units: `motion` is which of the stable motions, by their largest |α1|, each state reaches,
    from 1; 0 where this is undecided, −1 where it grows beyond all bounds; `periods` of the excitation until this was
    certain; `amplitude_rad` the largest |α| of each stable motion, NaN beyond their number; `ended_early` where not all
    may be known.

    256 states are a chunk; `folder` and `client` are those of `response_map`.

    Raises ValueError for invalid arguments.
    """
    name, amplitudes = _load(torque1_nm, torque2_nm, force_x_n, force_y_n)
    first, last = pair("start", start), pair("stop", stop)
    grid = Grid(pair("coordinates", coordinates), first, last, pair("points", points), _checks.four("initial", initial))
    states = grid.states()
    blocks = [states[k : k + BLOCK] for k in range(0, len(states), BLOCK)]
    places: dict[str, list[float]] = {"beta2_deg": _poses(arm, beta2_deg), name: amplitudes}
    places["frequency_hz"] = [float(hz) for hz in frequency_hz]
    chunks = []
    for posed in (_posed(arm, beta) for beta in places["beta2_deg"]):
        for amplitude in amplitudes:
            for hz in places["frequency_hz"]:
                case = (posed, name, amplitude, hz)
                key = [_key(posed), name, amplitude, hz]
                chunks.append(Chunk(motions_chunk, case, key))
                for own in blocks:
                    arguments = (*case, own, time_constants)
                    chunks.append(Chunk(block_chunk, arguments, [*key, own.tolist(), time_constants]))
    computed = list(_chunks.computed(chunks, folder, client))
    each = [computed[k : k + len(blocks) + 1] for k in range(0, len(computed), len(blocks) + 1)]
    shape, axes = tuple(map(len, places.values())), tuple(places)
    x, y = grid.coordinates
    data: dict[str, Any] = {}
    for variable, label in (("motion", "motion that the state reaches, from 1"), ("periods", "periods until certain")):
        values = np.stack([np.concatenate([block[variable] for block in of[1:]]) for of in each])
        data[variable] = (
            (*axes, y, x),
            values.reshape(*shape, grid.points[1], grid.points[0]),
            {"units": "1", "long_name": label},
        )
    most = max((len(of[0]["amplitude_rad"]) for of in each), default=0)
    padded = np.full((len(each), most, 2), np.nan)
    for row, of in zip(padded, each, strict=True):
        row[: len(of[0]["amplitude_rad"])] = of[0]["amplitude_rad"]
    labels = {"units": "rad", "long_name": "largest |α| of the stable motion"}
    data["amplitude_rad"] = ((*axes, "stable_motion", "joint"), padded.reshape(*shape, most, 2), labels)
    early = np.array([bool(of[0]["ended_early"]) for of in each]).reshape(shape)
    data["ended_early"] = (axes, early, {"long_name": "not all stable motions may be known"})
    places |= {y: grid.axis(1).tolist(), x: grid.axis(0).tolist()}
    return _dataset(data, places, {"joint": [1, 2], "stable_motion": list(range(1, most + 1))}, arm)


def seed_map(scenario: Scenario, seeds: Sequence[int], *, folder: Folder = None, client: Any = None) -> Any:
    """The responses that the exciter reads in free runs of a scenario, one run for each seed of the instruments'
    noise.

    An `xarray.Dataset` over `seed` and `point`, NaN beyond a run's points: `frequency_hz`, `load` (N or N·m),
    `phase_deg`, complex `head_force_n`, `acceleration_b_m_s2` and `acceleration_c_m_s2` by `axis`, `settled`, and the
    `outcome` of each run. A run is a chunk; `folder` and `client` are those of `response_map`.

    Raises ValueError for a scenario that can't run.
    """
    text = scenario.to_toml()
    chunks = [Chunk(run_chunk, (scenario, int(seed)), [text, int(seed)]) for seed in seeds]
    computed = list(_chunks.computed(chunks, folder, client))
    most = max((len(chunk["frequency_hz"]) for chunk in computed), default=0)
    amplitude = _amplitude(scenario)
    units = {
        "frequency_hz": "Hz",
        "load": "N m" if any(key.startswith("torque") for key in amplitude) else "N",
        "phase_deg": "degree",
        "head_force_n": "N",
        "acceleration_b_m_s2": "m s-2",
        "acceleration_c_m_s2": "m s-2",
        "settled": "1",
    }
    data: dict[str, Any] = {}
    for name, unit in units.items():
        columns = [chunk[name] for chunk in computed]
        values = np.full((len(columns), most, *columns[0].shape[1:]), np.nan, np.result_type(columns[0], np.float64))
        for row, column in zip(values, columns, strict=True):
            row[: len(column)] = column
        data[name] = (("seed", "point", "axis") if values.ndim == 3 else ("seed", "point"), values, {"units": unit})
    data["outcome"] = ("seed", np.array([str(chunk["outcome"]) for chunk in computed]))
    coords = {"seed": list(map(int, seeds)), "point": list(range(most)), "axis": ["x", "y"]}
    return _extras.require("xarray", "dask").Dataset(data, coords, {"scenario": text})


def _amplitude(scenario: Scenario) -> dict[str, Any]:
    """The amplitude of the scenario's excitation or control law."""
    values = scenario.values()
    for section in ("excitation", "control"):
        if values.get(section):
            return {key: value for key, value in values[section].get("amplitude", {}).items() if value}
    return {}


def _dataset(data: dict[str, Any], places: dict[str, list[float]], more: dict[str, Any], arm: Arm) -> Any:
    coords = {name: (name, np.array(values, float), {"units": UNITS[name]}) for name, values in places.items()}
    return _extras.require("xarray", "dask").Dataset(data, {**coords, **more}, {"arm": repr(arm)})


def _load(*amplitudes: Amplitudes) -> tuple[str, list[float]]:
    """The load whose amplitudes the map covers: its name and its amplitudes."""
    names = ("torque1_nm", "torque2_nm", "force_x_n", "force_y_n")
    given = [(name, values) for name, values in zip(names, amplitudes, strict=True) if values is not None]
    if len(given) != 1:
        raise ValueError(f"a map goes over the amplitudes of one load: give one of {', '.join(names)}")
    name, values = given[0]
    return name, [float(value) for value in values]


def _poses(arm: Arm, beta2_deg: Sequence[float] | None) -> list[float]:
    return [arm.beta2_deg] if beta2_deg is None else [float(beta) for beta in beta2_deg]


def _posed(arm: Arm, beta2_deg: float) -> Arm:
    return Arm(arm.preset, beta1_deg=arm.beta1_deg, beta2_deg=beta2_deg, parameters=arm.own_parameters)


def _key(arm: Arm) -> list[Any]:
    return [arm.parameters, arm.beta1_deg, arm.beta2_deg]


def branch_chunk(arm: Arm, load: str, amplitude: float, hz: NDArray[np.float64]) -> Arrays:
    """The variables of one branch at its frequencies."""
    early, excitation = False, Load(**{load: amplitude})
    try:
        branch = arm.continuation(
            "frequency", float(hz[0]), float(hz[-1]), largest_step=LARGEST_STEP, **vars(excitation)
        )
    except BranchEndedEarly as ended:
        branch, early = ended.branch, True
    return {**_at(branch, hz), "ended_early": np.array(early)}


_attractors_lock = threading.Lock()


@lru_cache(maxsize=64)
def _attractors_of(
    preset: Preset, pose: tuple[float, float], parameters: str, load: str, a: float, hz: float
) -> _resonarm.Attractors:
    arm = Arm(preset, beta1_deg=pose[0], beta2_deg=pose[1], parameters=json.loads(parameters))
    return _resonarm.Attractors(arm, Load(**{load: a}).checked().sine(hz))


def _attractors(arm: Arm, load: str, amplitude: float, hz: float) -> _resonarm.Attractors:
    """The stable motions, computed once in each process."""
    own = json.dumps(arm.own_parameters)
    with _attractors_lock:
        return _attractors_of(arm.preset, (arm.beta1_deg, arm.beta2_deg), own, load, amplitude, hz)


def motions_chunk(arm: Arm, load: str, amplitude: float, hz: float) -> Arrays:
    """The stable motions under a load."""
    attractors = _attractors(arm, load, amplitude, hz)
    amplitudes = [motion.amplitude_rad for motion in attractors.motions]
    return {
        "amplitude_rad": np.array(amplitudes, np.float64).reshape(-1, 2),
        "ended_early": np.array(attractors.ended_early is not None),
    }


def block_chunk(
    arm: Arm, load: str, amplitude: float, hz: float, states: NDArray[np.float64], time_constants: float
) -> Arrays:
    """The motions that some initial states reach."""
    rows = found(_attractors(arm, load, amplitude, hz), states, time_constants, False)
    return {"motion": np.ascontiguousarray(rows["motion"]), "periods": np.ascontiguousarray(rows["periods"])}


def run_chunk(scenario: Scenario, seed: int) -> Arrays:
    """The responses that the exciter reads in a run with a seed."""
    report = run(scenario.replace(simulation={"seed": seed}))
    responses = report.responses
    columns = {name: np.ascontiguousarray(responses[name]) for name in responses.dtype.names or ()}
    return {**columns, "outcome": np.array(report.exciter["outcome"])}


def _at(branch: Branch, hz: NDArray[np.float64]) -> Arrays:
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
