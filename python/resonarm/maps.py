"""Maps over pose, amplitude and frequency, over initial states and over seeds: on all cores or on a Dask cluster, with
identical bits, resumable."""

import json
import threading
from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import pairwise, product
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _chunks, _drive, _dtypes, _extras, _resonarm
from ._chunks import Arrays, Chunk
from .basins import TIME_CONSTANTS, found, grid_of, names, pair
from .continuation import Branch, EndedEarly
from .scenario import Scenario
from .session import run
from .structures import Structure

VARIABLES = {
    "stable": "number of stable periodic responses",
    "unstable": "number of unstable periodic responses",
    "least": "largest displacement in the smallest stable response",
    "largest": "largest displacement in the largest stable response",
}
UNITS = {"N·m": "N m", "m/s²": "m s-2", "°": "degree", "rad/s": "rad s-1", "m·√kg": "m kg0.5", "m·√kg/s": "m kg0.5 s-1"}
"""Units as UDUNITS has them, where ours are other."""
LARGEST_STEP = 0.05
"""Largest step along a branch, relative to the response's size: between its responses the map is linear."""
BLOCK = 256
"""Number of initial states in a chunk."""

Folder = str | PathLike[str] | None
Over = Mapping[str, Sequence[float]]
Loads = dict[str, float]


def response_map(
    structure: Structure,
    *,
    drive: _drive.Drive | str,
    amplitude: Sequence[float],
    frequency_hz: Sequence[float],
    over: Over | None = None,
    at: Sequence[str] = (),
    folder: Folder = None,
    client: Any = None,
) -> Any:
    """Computes the periodic responses at each frequency, Hz, amplitude and value of parameters.

    `drive` is the degree of freedom that is driven, as `"joint1"`, or several in a ratio, `{"tip.x": 3, "tip.y": 4}`;
    the amplitudes are those of the first, N·m at a joint, else N. `over` has values of parameters of the structure,
    `{"link2.angle_deg": [50.0, 60.0]}`; the map covers all their combinations. `at` are the degrees of freedom that
    are read, by default those that are driven.

    An `xarray.Dataset` with units: the numbers of stable and unstable responses and, at each degree of freedom, the
    largest displacement in the smallest and in the largest stable response, m or rad, as `unit` says; NaN where there
    is none. Between the responses of a branch it is linear.

    Each combination of parameters and amplitude is one branch over the frequencies, a chunk: computed by a Dask
    `client`, or on all cores of this machine without one, with identical bits. With a `folder`, which a cluster shares,
    each chunk is stored when it is finished, and a repeated call resumes from the stored chunks. `ended_early` marks
    the chunks whose branch could not be followed to its end: beyond it the map has no responses.

    Raises ValueError for frequencies that don't rise, and for values that make no structure.
    """
    hz = np.asarray(frequency_hz, dtype=np.float64)
    if hz.ndim != 1 or len(hz) < 2 or not (np.diff(hz) > 0).all() or hz[0] <= 0:
        raise ValueError("frequency_hz must have two or more positive frequencies that increase")
    loads, places = _places(structure, drive, amplitude, over)
    read = tuple(dict.fromkeys(at)) or tuple(loads)
    units = [structure.units("at", dof)[0] for dof in read]
    chunks = [
        Chunk(branch_chunk, (varied, driven, read, hz), [*_key(varied, driven), read, hz.tolist(), LARGEST_STEP])
        for varied in _varied(structure, places)
        for driven in _scaled(loads, places)
    ]
    computed = list(_chunks.computed(chunks, folder, client))
    shape, axes = tuple(len(values) for values, _unit in places.values()), tuple(places)
    data: dict[str, Any] = {}
    for variable, label in VARIABLES.items():
        values = np.stack([chunk[variable] for chunk in computed])
        # Displacements have a value for each degree of freedom, in a unit of its own; counts have neither.
        at_dofs, labels = (("at",), {}) if values.ndim == 3 else ((), {"units": "1"})
        names = (*axes, "frequency_hz", *at_dofs)
        data[variable] = (names, values.reshape(*shape, *values.shape[1:]), {**labels, "long_name": label})
    early = np.array([bool(chunk["ended_early"]) for chunk in computed]).reshape(shape)
    data["ended_early"] = (axes, early, {"long_name": "the branch could not be followed to its end"})
    places["frequency_hz"] = (hz.tolist(), "Hz")
    return _dataset(data, places, {"at": list(read), "unit": ("at", units)}, structure, loads)


def basin_map(
    structure: Structure,
    *,
    drive: _drive.Drive | str,
    amplitude: Sequence[float],
    frequency_hz: Sequence[float],
    start: Sequence[float],
    stop: Sequence[float],
    over: Over | None = None,
    coordinates: Sequence[str] | None = None,
    points: Sequence[int] = (41, 41),
    initial: Sequence[float] | None = None,
    time_constants: float = TIME_CONSTANTS,
    folder: Folder = None,
    client: Any = None,
) -> Any:
    """Computes which initial states reach which stable periodic response, as `basins` of a structure has it, at each
    frequency, Hz, amplitude and value of parameters, over the same grid from `start` to `stop`; `drive`, `amplitude`
    and `over` are those of `response_map`.

    An `xarray.Dataset` with units: `motion` is the number, from 1, of the stable response that each state reaches, in
    the order of the largest displacements where the structure is driven first; it is 0 where this is undecided and −1
    where the state grows beyond all bounds. `periods` of the excitation pass until this is certain; `largest` is the
    largest magnitude of each coordinate in each stable response, NaN beyond their number; `ended_early` is true where
    not all may be known.

    256 states are a chunk; `folder` and `client` are those of `response_map`.

    Raises ValueError for invalid arguments.
    """
    loads, places = _places(structure, drive, amplitude, over)
    known = names(structure)
    two = pair("coordinates", (known[0], known[len(known) // 2]) if coordinates is None else coordinates)
    grid = grid_of(structure, two, start, stop, points, initial)
    states = grid.states()
    blocks = [states[k : k + BLOCK] for k in range(0, len(states), BLOCK)]
    frequencies = [_drive.frequency(hz) for hz in frequency_hz]
    chunks = []
    for varied in _varied(structure, places):
        for driven in _scaled(loads, places):
            for hz in frequencies:
                case, key = (varied, driven, hz), [*_key(varied, driven), hz]
                chunks.append(Chunk(motions_chunk, case, key))
                for own in blocks:
                    arguments = (*case, own, time_constants)
                    chunks.append(Chunk(block_chunk, arguments, [*key, own.tolist(), time_constants]))
    places["frequency_hz"] = (frequencies, "Hz")
    computed = list(_chunks.computed(chunks, folder, client))
    each = [computed[k : k + len(blocks) + 1] for k in range(0, len(computed), len(blocks) + 1)]
    shape, axes = tuple(len(values) for values, _unit in places.values()), tuple(places)
    x, y = grid.coordinates
    data: dict[str, Any] = {}
    for variable, label in (("motion", "number of the response reached, from 1"), ("periods", "periods until certain")):
        values = np.stack([np.concatenate([block[variable] for block in of[1:]]) for of in each])
        data[variable] = (
            (*axes, y, x),
            values.reshape(*shape, grid.points[1], grid.points[0]),
            {"units": "1", "long_name": label},
        )
    moving = known[: len(known) // 2]
    most = max((len(of[0]["largest"]) for of in each), default=0)
    padded = np.full((len(each), most, len(moving)), np.nan)
    for row, of in zip(padded, each, strict=True):
        row[: len(of[0]["largest"])] = of[0]["largest"]
    labels = {"units": _unit(moving[0]), "long_name": "largest magnitude of the coordinate in the stable response"}
    data["largest"] = ((*axes, "stable_motion", "coordinate"), padded.reshape(*shape, most, len(moving)), labels)
    early = np.array([bool(of[0]["ended_early"]) for of in each]).reshape(shape)
    data["ended_early"] = (axes, early, {"long_name": "not all stable responses may be known"})
    places |= {y: (grid.axis(1).tolist(), _unit(y)), x: (grid.axis(0).tolist(), _unit(x))}
    more = {"coordinate": list(moving), "stable_motion": list(range(1, most + 1))}
    return _dataset(data, places, more, structure, loads)


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


Places = dict[str, tuple[list[float], str]]
"""Axes of a map by their names: values, and their unit."""


def _unit(coordinate: str) -> str:
    """The unit of a coordinate or a rate, as UDUNITS has it."""
    own = _dtypes.unit(coordinate)
    return UNITS.get(own, own)


def _dataset(data: dict[str, Any], places: Places, more: dict[str, Any], structure: Structure, loads: Loads) -> Any:
    coords = {name: (name, np.array(values, float), {"units": unit}) for name, (values, unit) in places.items()}
    attributes = {"structure": repr(structure), "drive": json.dumps(loads)}
    return _extras.require("xarray", "dask").Dataset(data, {**coords, **more}, attributes)


def _places(
    structure: Structure, drive: _drive.Drive | str, amplitude: Sequence[float], over: Over | None
) -> tuple[Loads, Places]:
    """The loads for the amplitude 1, and the axes of a map: parameters, then amplitudes."""
    loads = {drive: 1.0} if isinstance(drive, str) else _drive.checked(drive)
    first = next(iter(loads.values()))
    loads = {name: share / first for name, share in loads.items()}
    places: Places = {}
    for name, values in (over or {}).items():
        own = structure.parameter(name)[1]
        places[name] = ([float(value) for value in values], UNITS.get(own, own or "1"))
    own = structure.units("drive", next(iter(loads)))[1]
    places["amplitude"] = ([float(value) for value in amplitude], UNITS.get(own, own))
    return loads, places


def _varied(structure: Structure, places: Places) -> list[Structure]:
    """The structure with each combination of the parameters of a map."""
    over = {name: values for name, (values, _unit) in places.items() if name != "amplitude"}
    return [structure.replace(dict(zip(over, values, strict=True))) for values in product(*over.values())]


def _scaled(loads: Loads, places: Places) -> list[Loads]:
    """The loads with each amplitude of a map."""
    return [{name: share * amplitude for name, share in loads.items()} for amplitude in places["amplitude"][0]]


def _key(structure: Structure, drive: Loads) -> list[Any]:
    return [type(structure).__name__, structure.numbers, drive]


def branch_chunk(structure: Structure, drive: Loads, at: Sequence[str], hz: NDArray[np.float64]) -> Arrays:
    """The variables of one branch at its frequencies."""
    early, ends = False, (float(hz[0]), float(hz[-1]))
    try:
        branch = structure.continuation("frequency", *ends, drive=drive, at=at, largest_step=LARGEST_STEP)
    except EndedEarly as ended:
        branch, early = ended.branch, True
    return {**_at(branch, hz), "ended_early": np.array(early)}


_attractors_lock = threading.Lock()


@lru_cache(maxsize=64)
def _attractors_of(structure: Structure, drive: str, hz: float) -> _resonarm.Attractors:
    return _resonarm.Attractors(structure, _drive.parts(json.loads(drive), hz))


def _attractors(structure: Structure, drive: Loads, hz: float) -> _resonarm.Attractors:
    """Returns the stable responses, computed once in each process."""
    # Without the lock, threads that miss the cache at the same time would all compute the same responses.
    with _attractors_lock:
        return _attractors_of(structure, json.dumps(drive), hz)


def motions_chunk(structure: Structure, drive: Loads, hz: float) -> Arrays:
    """Computes the stable responses under a load."""
    attractors = _attractors(structure, drive, hz)
    largest = [motion[2] for motion in attractors.motions]
    return {
        "largest": np.array(largest, np.float64).reshape(len(largest), -1),
        "ended_early": np.array(attractors.ended_early is not None),
    }


def block_chunk(
    structure: Structure, drive: Loads, hz: float, states: NDArray[np.float64], time_constants: float
) -> Arrays:
    """Computes the responses that some initial states reach."""
    rows = found(_attractors(structure, drive, hz), states, time_constants, False)
    return {"motion": np.ascontiguousarray(rows["motion"]), "periods": np.ascontiguousarray(rows["periods"])}


def run_chunk(scenario: Scenario, seed: int) -> Arrays:
    """The responses that the exciter reads in a run with a seed."""
    report = run(scenario.replace(simulation={"seed": seed}))
    responses = report.responses
    columns = {name: np.ascontiguousarray(responses[name]) for name in responses.dtype.names or ()}
    return {**columns, "outcome": np.array(report.exciter["outcome"])}


def _at(branch: Branch, hz: NDArray[np.float64]) -> Arrays:
    """Returns the responses at each frequency, linear between those of the branch."""
    displacements = np.stack([branch.points[branch.column(at)] for at in branch.at], axis=1)
    stable, unstable = np.zeros(len(hz), np.int64), np.zeros(len(hz), np.int64)
    least, largest = (np.full((len(hz), len(branch.at)), np.nan) for _ in range(2))
    last = branch.points["value"][-1] if len(branch.points) else np.nan
    for (one, from_one), (other, to_other) in pairwise(zip(branch.points, displacements, strict=True)):
        low, high = sorted((one["value"], other["value"]))
        # Half-open, so that a frequency at which two stretches meet counts once. The last one has its end as well.
        for k in np.flatnonzero((hz >= low) & ((hz < high) | (hz == last) & (hz <= high))):
            if high == low:
                continue
            part = (hz[k] - one["value"]) / (other["value"] - one["value"])
            displacement = from_one * (1 - part) + to_other * part
            if one["stable"] and other["stable"]:
                stable[k] += 1
                least[k] = np.fmin(least[k], displacement)
                largest[k] = np.fmax(largest[k], displacement)
            else:
                unstable[k] += 1
    return {"stable": stable, "unstable": unstable, "least": least, "largest": largest}
