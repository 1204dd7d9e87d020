"""Scores sdypy-EMA, PolyPy of SDynPy and `resonarm identify` on the labelled data of a survey."""

import argparse
import contextlib
import importlib.metadata
import json
import os
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

# Highest order of sdypy-EMA, as in its documentation, and the orders of PolyPy, the defaults of its window.
SDYPY_ORDER = 60
POLYPY_ORDERS = range(10, 31, 2)
# Largest change of a stable pole from one order to the next, relative, of frequency and damping ratio: sdypy-EMA's.
SDYPY_STABLE = 0.001, 0.05
# A mode is found if there is a pole within this part of its frequency, and not beyond the middle to its neighbour.
NEAR = 0.02


@dataclass
class Mode:
    """A mode that was found: frequency, Hz, damping ratio, and shape at the outputs."""

    hz: float
    damping_ratio: float
    shape: np.ndarray


class Data:
    """Responses and true modes of a survey."""

    def __init__(self, folder: Path) -> None:
        import pyuff

        self.folder = folder
        labelled = json.loads((folder / "labelled.json").read_text(encoding="utf-8"))
        plan = json.loads((folder / "index.json").read_text(encoding="utf-8"))["plan"]
        self.band = plan["from_hz"], plan["to_hz"]
        # A reference for each place of the exciter, at the first level.
        level = labelled["runs"][0]["level"]
        self.files = [folder / run["responses"] for run in labelled["runs"] if run["level"] == level]
        columns = []
        for file in self.files:
            responses = {}
            for function in pyuff.UFF(str(file)).read_sets():
                if function["type"] == 58:
                    responses[function["rsp_node"], function["rsp_dir"]] = function["data"]
                    self.frequency_hz = function["x"]
                    force = function["ref_node"], function["ref_dir"]
            columns.append((force, responses))
        self.outputs = sorted(set.intersection(*(set(responses) for _, responses in columns)))
        self.inputs = [force for force, _ in columns]
        # Axes: output, input, line.
        self.responses = np.array([[responses[at] for _, responses in columns] for at in self.outputs])
        modes = [mode for mode in labelled["modes"] if mode["mode"] in labelled["in_band"]]
        nodes, axis = labelled["nodes"], {"x": 1, "y": 2, "z": 3}
        names = [name.split(".") for name in modes[0]["shape_per_sqrt_kg"]]
        by_place = {(nodes[point], axis[along]): f"{point}.{along}" for point, along in names}
        self.names = [by_place[place] for place in self.outputs]
        shape = [[mode["shape_per_sqrt_kg"][name] for name in self.names] for mode in modes]
        self.modes = [
            Mode(mode["pole_frequency_hz"], mode["pole_damping_ratio"], np.array(of))
            for mode, of in zip(modes, shape, strict=True)
        ]

    def nearest(self, found_hz) -> list[int | None]:
        """For each true mode the place of the nearest of these frequencies; None if none is near."""
        true_hz, found_hz = np.array([mode.hz for mode in self.modes]), np.asarray(found_hz)
        places: list[int | None] = []
        for hz in true_hz:
            others = np.abs(true_hz[true_hz != hz] - hz)
            reach = min([NEAR * hz, *(0.5 * others)])
            off = np.abs(found_hz - hz)
            places.append(int(off.argmin()) if len(off) and off.min() < reach else None)
        return places


def sdypy(data: Data) -> list[Mode | None]:
    """Modes by sdypy-EMA: LSCF of all responses with a common denominator, and least squares for the residues.

    Its own choice takes the mean of the stable poles within 2 Hz or more, in which there may be several modes. So of
    its stable poles of all orders the nearest to the true frequency is taken.
    """
    from sdypy import EMA

    low, high = data.band
    count = len(data.outputs) * len(data.inputs)
    # It counts lines from 0 Hz. Those below the band, which are not in the file, are left at 0.
    step_hz = (data.frequency_hz[-1] - data.frequency_hz[0]) / (len(data.frequency_hz) - 1)
    below = round(data.frequency_hz[0] / step_hz)
    responses = np.pad(data.responses.reshape(count, -1), ((0, 0), (below, 0)))
    frequency_hz = step_hz * np.arange(responses.shape[1])
    model = EMA.Model(
        responses, frequency_hz, lower=low, upper=high, pol_order_high=SDYPY_ORDER, frf_form="accelerance"
    )
    model.get_poles(show_progress=False)
    # Candidates are frequency, damping ratio, and the places of order and pole.
    before: list[tuple[float, float]] = []
    candidates = []
    for order, poles in enumerate(model.all_poles):
        own = []
        for place, pole in enumerate(poles):
            hz, damping_ratio = abs(pole) / (2 * np.pi), -pole.real / abs(pole)
            if pole.imag <= 0 or damping_ratio <= 0:
                continue
            own.append((hz, damping_ratio))
            changes = ((abs(hz / other - 1), abs(damping_ratio / of_other - 1)) for other, of_other in before)
            if any(of_hz < SDYPY_STABLE[0] and of_damping < SDYPY_STABLE[1] for of_hz, of_damping in changes):
                candidates.append((hz, damping_ratio, order, place))
        before = own
    chosen = data.nearest([hz for hz, *_ in candidates])
    poles = [candidates[place] for place in chosen if place is not None]
    model.pole_ind = [[order, place] for *_, order, place in poles]
    if not poles:
        return [None] * len(chosen)
    model.get_constants()
    # Of each mode the residues to the force that drives it best.
    residues = np.array(model.A).reshape(len(data.outputs), len(data.inputs), len(poles))
    best = np.linalg.norm(residues, axis=0).argmax(axis=0)
    found = iter(
        Mode(hz, damping_ratio, residues[:, best[place], place]) for place, (hz, damping_ratio, *_) in enumerate(poles)
    )
    return [None if place is None else next(found) for place in chosen]


def polypy(data: Data) -> list[Mode | None]:
    """Modes by PolyPy of SDynPy: polyreference LSCF of all responses. Of the stable poles the nearest is taken, too."""
    import sdynpy

    nodes = np.array([node for node, _ in data.outputs + data.inputs])
    directions = np.array([direction for _, direction in data.outputs + data.inputs])
    places = sdynpy.coordinate_array(nodes, directions)
    outputs, inputs = places[: len(data.outputs)], places[len(data.outputs) :]
    pairs = sdynpy.coordinate.outer_product(outputs, inputs)
    kind = sdynpy.data.FunctionTypes.FREQUENCY_RESPONSE_FUNCTION
    responses = sdynpy.data_array(kind, data.frequency_hz, data.responses, pairs)
    fit = sdynpy.PolyPy(responses, *data.band, displacement_derivative=2)
    fit.compute_poles(np.array(POLYPY_ORDERS))
    stable = [
        (order, place)
        for order, poles in enumerate(fit.pole_list)
        for place, pole in enumerate(poles)
        if pole["damp_stable"] and pole["zeta"] > 0
    ]
    chosen = data.nearest([fit.pole_list[order][place]["omega"] / (2 * np.pi) for order, place in stable])
    poles = fit.pole_list_from_indices([stable[place] for place in chosen if place is not None])
    if not len(poles):
        return [None] * len(chosen)
    fit.compute_shapes(poles)
    rows = zip(poles["omega"] / (2 * np.pi), poles["zeta"], fit.shapes[outputs], strict=True)
    found = iter(Mode(float(hz), float(ratio), shape) for hz, ratio, shape in rows)
    return [None if place is None else next(found) for place in chosen]


def resonarm(data: Data, program: str, source: Path, names: list[str]) -> list[Mode | None]:
    """Modes by `resonarm identify` of recordings or of a file with responses, in which the outputs have these names."""
    # The band is that of the file, or of the survey's plan.
    ended = subprocess.run([program, "-q", "identify", source, "--json"], stdout=subprocess.PIPE, check=True)
    document = json.loads(ended.stdout)
    places = [document["at"].index(name) for name in names]
    modes = document["modes"]
    found: list[Mode | None] = []
    for place in data.nearest([mode["pole_frequency_hz"] for mode in modes]):
        if place is None:
            found.append(None)
            continue
        shape = modes[place]["shape_per_sqrt_kg"] or modes[place]["shape"]
        # A component that is unknown counts as 0.
        shape = np.array([0.0 if shape[at] is None else shape[at] for at in places])
        found.append(Mode(modes[place]["pole_frequency_hz"], modes[place]["pole_damping_ratio"], shape))
    return found


def of_responses(data: Data, program: str) -> list[Mode | None]:
    """Modes by `resonarm identify` of the responses that the other programs read, in one file."""
    names = [f"node{node}.{'xyz'[direction - 1]}" for node, direction in data.outputs]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "all.uff"
        file.write_bytes(b"".join(file.read_bytes() for file in data.files))
        return resonarm(data, program, file, names)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="folder of `resonarm survey --labelled`")
    parser.add_argument("--resonarm", default="resonarm", metavar="PROGRAM", help="the program [default: resonarm]")
    arguments = parser.parse_args()
    # SDynPy makes windows only on demand, but its libraries look for a screen.
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    data, program = Data(arguments.folder), arguments.resonarm
    version = importlib.metadata.version
    programs = {
        f"sdypy-EMA {version('sdypy-EMA')}": lambda: sdypy(data),
        f"SDynPy {version('sdynpy')} PolyPy": lambda: polypy(data),
        "resonarm, responses": lambda: of_responses(data, program),
        "resonarm, recordings": lambda: resonarm(data, program, data.folder, data.names),
    }
    print("| program | true frequency (Hz) | error of frequency (%) | error of damping ratio (%) | 1 − MAC |")
    print("| --- | ---: | ---: | ---: | ---: |")
    for name, identify in programs.items():
        # Both packages print their progress.
        with open(os.devnull, "w") as nothing, contextlib.redirect_stdout(nothing), contextlib.redirect_stderr(nothing):
            found = identify()
        for true, mode in zip(data.modes, found, strict=True):
            if mode is None:
                print(f"| {name} | {true.hz:.3f} | not found | | |")
                continue
            overlap = abs(np.vdot(mode.shape, true.shape)) ** 2
            overlap /= np.vdot(mode.shape, mode.shape).real * np.vdot(true.shape, true.shape).real
            off_hz, off = 100 * (mode.hz / true.hz - 1), 100 * (mode.damping_ratio / true.damping_ratio - 1)
            print(f"| {name} | {true.hz:.3f} | {off_hz:+.5f} | {off:+.3f} | {max(0.0, 1 - overlap):.1e} |")


if __name__ == "__main__":
    main()
