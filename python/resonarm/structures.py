"""Chains of links and modal structures: modes, frequency responses, motion under a sine, branches of periodic
responses, basins of attraction."""

import json
import warnings
from collections.abc import Mapping, Sequence
from os import PathLike, fspath
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _checks, _drive, _resonarm
from ._drive import Drive, Harmonics
from ._dtypes import COMPLEX, Array, motion, view
from .basins import basins, full_states
from .continuation import continuation
from .drawing import plot
from .tables import Element, Link, ModeShape, PosedJoint
from .words import Preset, Quantity, Scheme

if TYPE_CHECKING:
    from typing_extensions import Self

MOST_PERIODS = 2**32 - 1
_Path = str | PathLike[str]
_Section = dict[str, Any]


class AccuracyWarning(UserWarning):
    """A result is less accurate than its method usually is. The message states the reason and how to improve it."""


class Structure(_resonarm.Assembly):
    """Structure under vibration: a `Chain` of links or a `Modal` structure. Both have these methods."""

    continuation = continuation
    basins = basins
    plot = plot

    def __new__(cls, *_arguments: Any, **_named: Any) -> "Self":
        """Raises TypeError: the two kinds of structure are made by their classes."""
        raise TypeError("Structure can't be made: make a resonarm.Chain or a resonarm.Modal")

    @classmethod
    def _of(cls, section: _Section) -> "Self":
        """The structure of a section `[structure]`."""
        return super().__new__(cls, section)

    @classmethod
    def from_scenario(cls, scenario: "_Path | _resonarm.Scenario") -> "Self":
        """The structure of a scenario, or of that in a TOML file, with what it takes from other files. Without a
        section `[structure]` it is `Chain.preset()`.

        Raises ValueError if the structure is not of this class, or if its equations are not available (an FMU, or a
        structure of a program); OSError if the file can't be read.
        """
        if not isinstance(scenario, _resonarm.Scenario):
            scenario = _resonarm.Scenario(path=scenario)
        values = scenario.values()
        section = values["structure"]
        kind = section["kind"]
        if kind == "own":
            raise ValueError("structure.kind is own: the program that runs the scenario makes it, so it can't be read")
        if kind == "fmu":
            raise ValueError("structure.kind is fmu: an FMU does not show its equations; use a chain or modes")
        made = Modal if kind == "modal" else Chain
        if not (issubclass(made, cls) or issubclass(cls, made)):
            raise ValueError(f"structure.kind is {kind}: use {made.__name__}.from_scenario")
        # A subclass of a user makes itself, the base class the kind that the scenario has.
        made = cls if issubclass(cls, made) else made
        return cast("Self", made._of(section))

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpickled, (type(self), self.numbers)

    def _text(self) -> str:
        """The numbers that equal structures share: without notes of the files that they are from."""
        return json.dumps(self.numbers, sort_keys=True)

    def __eq__(self, other: object) -> bool:
        return self._text() == other._text() if isinstance(other, type(self)) else NotImplemented

    def __hash__(self) -> int:
        return hash(self._text())

    @property
    def name(self) -> str | None:
        """Name in headers and figures; for a preset without a name of its own the preset's."""
        return self.section.get("name") or self.section.get("preset")

    @property
    def elements(self) -> list[Element]:
        """Elements of the structure, with the keys of a scenario."""
        return list(self.section.get("elements", []))

    def replace(self, values: Mapping[str, float]) -> "Self":
        """The same structure with other values of some parameters, by their names, as `{"link2.mass_kg": 40}`;
        `parameters` has all names, and `parameter(name)` the value and the unit of one. Values that are only possible
        together, as gravity and the mass of a link that a preset does not state, are given together.

        Raises ValueError for an unknown name, and for values that make no structure.
        """
        section = json.loads(json.dumps(self.numbers))
        for name, value in values.items():
            self.parameter(name)  # an unknown one raises an error with the known names
            section.get("set", {}).pop(name, None)
            part, _, key = name.rpartition(".")
            kind = part.rstrip("0123456789")
            if kind == "link" and section["kind"] == "preset":
                section.setdefault("set", {})[name] = _checks.number(name, value)
                continue
            table = section[f"{kind}s"][int(part.removeprefix(kind)) - 1] if part else section
            table[key] = _checks.number(name, value)
        return self._of(section)

    def _label(self, of: str) -> str:
        name = f" {self.name!r}" if self.name else ""
        count = len(self.elements)
        elements = f", {count} element{'s' if count > 1 else ''}" if count else ""
        hz = [mode.frequency_hz for mode in self.modes()]
        return f"<{type(self).__name__}{name}: {of}{elements}; {hz[0]:.4g} to {hz[-1]:.4g} Hz>"

    def frf(
        self, frequency_hz: ArrayLike, *, drive: str, at: str | None = None, quantity: Quantity = "receptance"
    ) -> NDArray[np.complex128]:
        """Frequency response of the structure linearised at rest, with the slopes of smooth elements and without the
        others: response over drive, complex, as an array of the frequencies' shape.

        `drive` is the degree of freedom that is driven, as `tip.x` (N) or, of a chain, `joint2` (N·m), `at` the one
        whose response is taken (m, rad), by default the same. `quantity` is receptance, mobility or accelerance: the
        displacement, its first or second derivative in time, over the drive (ISO 7626-1).

        Raises ValueError for an unknown term or a negative frequency, TypeError for one that is no real number,
        ResonarmError where the response is infinite.
        """
        hz = _checks.real("frequency_hz", frequency_hz)
        terms = (drive, drive if at is None else at, quantity)
        return view(self.frf_at(hz.tobytes(), terms), COMPLEX).reshape(hz.shape)

    def simulate(
        self,
        duration_s: float,
        *,
        drive: Drive | None = None,
        frequency_hz: float | None = None,
        initial: Sequence[float] | None = None,
        rate_hz: float | None = None,
        scheme: Scheme | None = None,
        every: int = 1,
        drive_harmonics: Harmonics | None = None,
    ) -> Array:
        """The motion under A·sin(2πft), exact inside the step: rows with `t_s`, the coordinates and their rates, and
        the states of elements that have one.

        Coordinates are `alpha_rad` and `alpha_dot_rad_s` of a chain, deflections of its joints from rest, and
        `q_m_sqrt_kg` and `q_dot_m_sqrt_kg_s` of modes; states of elements `element1_m`, or `element1_rad` at a joint.
        `drive` has the amplitude A at each degree of freedom that is driven, `{"tip.x": 100}` (N, or N·m at a joint),
        `frequency_hz` is f, `drive_harmonics` harmonics of the loads, as those of `continuation`. `initial` has the
        coordinates and their rates, and may have the states of elements, to continue a motion; by default it is the
        structure's own, or rest. `rate_hz` is the integration steps a second,
        by default those of a scenario with the `scheme` (rk4, dop853, gl4, gl6, exponential, exponential8), which is
        for chains whose elements are smooth: modes alone are exact, and other elements' switches are located between
        steps of order 8, whatever the scheme. There is a row for the start, for every `every`th step and for the end.
        Ctrl-C ends it.

        Warns with AccuracyWarning if a step has more switches than are located. Raises ValueError for invalid
        arguments, and if the structure needs a higher rate; ResonarmError if a step can't be made.
        """
        loads = None
        if drive is not None:
            loads = _drive.parts(drive, _drive.frequency(frequency_hz), drive_harmonics)
        elif frequency_hz is not None:
            raise ValueError(f"frequency_hz is {frequency_hz:g}: give the drive, too, as drive={{DOF: A}}")
        if every < 1:
            raise ValueError(f"every is {every}: it must be 1 or more")
        rate = _resonarm.step_rate_hz(scheme) if rate_hz is None else rate_hz
        length = (_checks.steps(_checks.number("duration_s", duration_s), rate), every)
        state = None if initial is None else _checks.real("initial", initial).ravel().tolist()
        rows, not_located = self.motion(state, loads, (scheme, rate), length)
        if not_located:
            warnings.warn(
                f"{not_located} steps had more switches of elements than are located, so their error is of first "
                "order: raise rate_hz",
                AccuracyWarning,
                stacklevel=2,
            )
        return view(rows, motion(self.channels()))

    def ensemble(
        self,
        initial: ArrayLike,
        periods: int,
        *,
        drive: Drive,
        frequency_hz: float,
        every: int | None = None,
    ) -> Array:
        """Computes many responses under one A·sin(2πft), over all cores; those of a chain of up to three links with
        smooth elements side by side in the lanes of the processor.

        `initial` has a row for each response, at phase 0 of the excitation: coordinates and their rates, with or
        without the states of elements. `drive` has the amplitude A at each degree of freedom that is driven,
        `{"joint1": 60}`. The array has a row for the start, for every `every`th period (by default the last alone) and
        for the end, and a column for each response, with the fields of `simulate`. A response that grows beyond all
        bounds is NaN. Steps (`dop853`, so many a period that the frequency is right to 1e-8 of the damping ratio) are
        the same for all, and each response is bit-identical to the same one computed alone. Ctrl-C ends it.

        Raises ValueError for a frequency that is not positive, a structure without damping, or states that are not
        finite.
        """
        states = full_states(self, initial)
        step = periods if every is None else every
        for name, count in (("periods", periods), ("every", step)):
            if not 1 <= count <= MOST_PERIODS:
                raise ValueError(f"{name} is {count}: it must be from 1 to {MOST_PERIODS}")
        loads = _drive.parts(drive, _drive.frequency(frequency_hz))
        rows = view(_resonarm.ensemble(self, loads, states.tobytes(), (periods, step)), motion(self.channels()))
        return rows.reshape(-1, len(states))


class Chain(Structure):
    """A planar chain of 1 to 8 links with compliant joints, with elements at its points and joints. Its points are
    `joint1`, which is fixed, to the last joint, and `tip`.

    `links` have the keys of `structure.links` in a scenario (`resonarm.Link`), from the base out; `elements` those of
    `structure.elements` (`resonarm.Element`, docs/structures.md). With `gravity_m_s2`, along −y, coordinates count from
    the equilibrium under the weight. `initial` has the deflections of the joints, rad, and their rates, rad/s, at
    which motions begin; `name` is what it is called. Chains are equal if all their numbers are.

        link = resonarm.Link(length_m=0.5, mass_kg=8, centre_of_mass_m=0.25, inertia_kg_m2=0.2, angle_deg=30,
                             stiffness_nm_rad=3e4, damping_nm_s_rad=5)
        chain = resonarm.Chain([link, link, link], gravity_m_s2=9.81)
        chain.frf(20.0, drive="tip.x")
        arm = resonarm.Chain.preset(angles_deg=(0, 75))

    Raises ValueError for an impossible structure, with the message of the command line.
    """

    def __new__(
        cls,
        links: Sequence[Link],
        *,
        gravity_m_s2: float | None = None,
        elements: Sequence[Element] = (),
        initial: Sequence[float] = (),
        name: str | None = None,
    ) -> "Self":
        section = {"kind": "chain", "links": list(links), "gravity_m_s2": gravity_m_s2}
        return cls._of({**section, **_shared(elements, initial, name)})

    @classmethod
    def from_urdf(
        cls,
        path: _Path,
        joints: Sequence[PosedJoint],
        *,
        tip: str | None = None,
        gravity_m_s2: float | None = None,
        elements: Sequence[Element] = (),
        name: str | None = None,
    ) -> "Self":
        """The chain of some joints of a robot, from its URDF, from the base out, up to the frame of the link `tip`, by
        default the only end. A joint has its `name`, stiffness, damping and pose (`structure.joints` of a scenario).

        Raises OSError if the file can't be read, ValueError if the joints make no planar chain.
        """
        section = {"kind": "chain", "file": fspath(path), "joints": list(joints), "tip": tip}
        return cls._of({**section, "gravity_m_s2": gravity_m_s2, **_shared(elements, (), name)})

    @classmethod
    def preset(
        cls,
        name: Preset = "irb1600-fitted",
        *,
        angles_deg: Sequence[float] = (0.0, 60.0),
        elements: Sequence[Element] = (),
        initial: Sequence[float] = (),
    ) -> "Self":
        """The robot arm of P. Gierlak and J. Warmiński ("Analysis of Bifurcation Vibrations of an Industrial Robot Arm
        System with Joints Compliance", Appl. Sci. 2023, 13, 11941): two rigid links with compliant joints; the elbow
        is `joint2`. `name` is one of `resonarm.presets()`, `angles_deg` the pose: the angle of link 1 against the x
        axis and that of link 2 against link 1. `replace` gives other values of its parameters. Of link 1 the presets
        state the moment of inertia about joint 1 alone, so that its mass is 1 kg at the joint. Gravity asks for
        `link1.mass_kg`, `link1.centre_of_mass_m` and `link1.inertia_kg_m2`, about the centre of mass: replace them
        together.

        Raises ValueError for an unknown name, and for other than two angles.
        """
        angles = _checks.real("angles_deg", angles_deg).ravel().tolist()
        return cls._of({"preset": name, "angles_deg": angles, **_shared(elements, initial, None)})

    @property
    def links(self) -> list[Link]:
        """Links of the chain, from the base out, with the keys of a scenario."""
        return list(self.chain_links)

    @property
    def gravity_m_s2(self) -> float:
        """Acceleration of gravity along −y, m/s²; 0 without."""
        return self.chain_gravity_m_s2

    def _text(self) -> str:
        """The numbers that equal chains share, however they are stated: as links, or as a preset with changes."""
        numbers = self.numbers
        of_elements = {key: value for key, value in numbers.get("set", {}).items() if key.startswith("element")}
        shared = (self.name, self.links, self.gravity_m_s2, self.elements, of_elements, numbers.get("initial"))
        return json.dumps(shared, sort_keys=True)

    def __repr__(self) -> str:
        count, weight = len(self.links), self.gravity_m_s2
        gravity = f", {weight:g} m/s² of gravity" if weight else ""
        return self._label(f"{count} link{'s' if count > 1 else ''}{gravity}")


class Modal(Structure):
    """A structure known by 1 to 32 vibration modes, with elements at its points.

    `modes` have the keys of `structure.modes` in a scenario (`resonarm.ModeShape`): the shapes, of modal mass 1 kg,
    name points and axes, as `tip.x`. `elements` have those of `structure.elements` (`resonarm.Element`,
    docs/structures.md), `points` where points are, m, and `lines` lists of points to join, for pictures. `initial` has
    the modal coordinates, m·√kg, and their rates, m·√kg/s, at which motions begin; `name` is what it is called.
    Structures are equal if all their numbers are.

    Raises ValueError for an impossible structure, with the message of the command line.
    """

    def __new__(
        cls,
        modes: Sequence[ModeShape],
        *,
        elements: Sequence[Element] = (),
        points: Mapping[str, Sequence[float]] | None = None,
        lines: Sequence[Sequence[str]] = (),
        initial: Sequence[float] = (),
        name: str | None = None,
    ) -> "Self":
        section = {"kind": "modal", "modes": list(modes), "points": _points(points), "lines": [*map(list, lines)]}
        return cls._of({**section, **_shared(elements, initial, name)})

    @classmethod
    def from_uff(
        cls,
        path: _Path,
        nodes: Mapping[str, int] | None = None,
        *,
        modal_mass_kg: float | None = None,
        elements: Sequence[Element] = (),
        name: str | None = None,
    ) -> "Self":
        """The modes of a UFF file, datasets 55 or 2414, 15 or 2411, 82, and 164 for its units: `nodes` names those that
        are points, `{"tip": 12}`; by default all are, as `node12`. Modes whose modal mass the file leaves at 0 have
        `modal_mass_kg`.

        Raises OSError if the file can't be read, ValueError for what docs/structures.md says is refused, such as
        complex modes.
        """
        section = {"kind": "modal", "file": fspath(path), "nodes": dict(nodes or {}), "modal_mass_kg": modal_mass_kg}
        return cls._of({**section, **_shared(elements, (), name)})

    @classmethod
    def from_matrices(
        cls,
        mass: ArrayLike,
        stiffness: ArrayLike,
        damping: ArrayLike | None = None,
        *,
        dofs: Mapping[str, int],
        base: Mapping[str, Sequence[int]] | None = None,
        modes: int | None = None,
        elements: Sequence[Element] = (),
        name: str | None = None,
    ) -> "Self":
        """The lowest `modes` of the mass (kg), stiffness (N/m) and damping matrices (N·s/m), all if there are not more
        than 32. `dofs` are degrees of freedom by their rows, from 0: `{"tip.x": 0}`. `base` has the rows that move by 1
        with the base along an axis, `{"base.z": [2, 5]}`: then that can be driven, by its acceleration, and
        displacements are relative to it.

        The structure may be free. Degrees of freedom without mass, rows of zeros, are condensed statically. Raises
        ValueError for matrices that are not square, symmetric or positive (semi)definite, and for damping that is not
        modal.
        """
        damped = None if damping is None else _matrix("damping", damping)
        matrices = (_matrix("mass", mass), _matrix("stiffness", stiffness), damped)
        rows = {name: list(moved) for name, moved in (base or {}).items()}
        section = _resonarm.modes_of_matrices(matrices, dict(dofs), rows, modes)
        return cls._of({**section, **_shared(elements, (), name)})

    @classmethod
    def from_chain(
        cls, chain: Chain, *, modes: int | None = None, elements: Sequence[Element] = (), name: str | None = None
    ) -> "Self":
        """The lowest `modes` of a chain about its rest, all by default. Points are those of the chain.

        The modal structure is linear, in its displacements too, and neglects how damping couples the modes. Raises
        ValueError if the chain has elements, or if the coupling moves one by more than 0.01 of the motion of another.
        """
        section = _resonarm.modes_of_structure(chain, modes)
        return cls._of({**section, **_shared(elements, (), name)})

    @classmethod
    def from_identified(
        cls, document: Mapping[str, Any], *, elements: Sequence[Element] = (), name: str | None = None
    ) -> "Self":
        """The modes that `resonarm identify --json` found, as its document has them. Points are those of the
        accelerometers, with positions and lines if the document has them.

        Warns with AccuracyWarning of modes for which no deviations could be stated, with the reasons. Raises ValueError
        if the document has no modes, or one without its modal mass: it needs an accelerometer where the force acts.
        """
        found = document.get("modes")
        if not found:
            raise ValueError("the document has no modes: give a document of resonarm identify --json that has some")
        modes: list[ModeShape] = []
        for number, mode in enumerate(found, 1):
            shape, hz = mode.get("shape_per_sqrt_kg"), mode["pole_frequency_hz"]
            if shape is None:
                raise ValueError(
                    f"mode {number}, at {hz:g} Hz, has no modal mass (shape_per_sqrt_kg): place an accelerometer where "
                    "the force acts"
                )
            for doubt in mode["doubts"]:
                warnings.warn(f"mode {number}, at {hz:g} Hz: {doubt['text']}", AccuracyWarning, stacklevel=2)
            of = {name: amount for name, amount in zip(document["at"], shape, strict=True) if amount is not None}
            modes.append({"frequency_hz": hz, "damping_ratio": mode["pole_damping_ratio"], "shape": of})
        points, lines = document.get("positions_m"), document.get("lines", ())
        return cls(modes, elements=elements, points=points, lines=lines, name=name)

    @property
    def mode_shapes(self) -> list[ModeShape]:
        """The modes with their shapes at the points, with the keys of a scenario."""
        return list(self.section["modes"])

    def __repr__(self) -> str:
        count = len(self.mode_shapes)
        return self._label(f"{count} mode{'s' if count > 1 else ''}, points {', '.join(self.point_names)}")


def _unpickled(cls: type[Structure], section: _Section) -> Structure:
    """The pickled form of a structure."""
    return cls._of(section)


def _matrix(name: str, given: ArrayLike) -> bytes:
    """Returns a matrix by rows, as bytes."""
    matrix = _checks.real(name, given)
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
        raise ValueError(f"{name}: its shape is {matrix.shape}: it must be square, with 1 to 1000 rows")
    return np.ascontiguousarray(matrix).tobytes()


def _points(points: Mapping[str, Sequence[float]] | None) -> dict[str, list[float]]:
    return {name: list(at) for name, at in (points or {}).items()}


def _shared(elements: Sequence[Element], initial: Sequence[float], name: str | None) -> _Section:
    """The keys that all structures have."""
    return {"elements": list(elements), "initial": list(initial), "name": name}
