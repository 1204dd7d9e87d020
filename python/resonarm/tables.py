"""The tables of a structure, with the keys of `[structure]` in a scenario, so that a type checker finds a wrong one."""

from collections.abc import Sequence
from typing import Literal, TypedDict

ElementKind = Literal["cubic", "gap", "contact", "friction", "lugre", "linear", "tanh", "polynomial"]
"""Kind of an element."""
Side = Literal["positive", "negative"]
"""Side along its axis on which a contact is."""


class _LinkOnLine(TypedDict):
    length_m: float
    """Distance from the link's joint to the next, or to the tip, m, positive."""
    mass_kg: float
    """Mass, kg, positive."""
    centre_of_mass_m: float
    """Distance of the centre of mass from the joint along the link, m."""
    inertia_kg_m2: float
    """Moment of inertia about the centre of mass, kg·m², positive."""
    angle_deg: float
    """Angle against the link before, of the first against the x axis, with the spring relaxed, degrees, −360 to 360."""
    stiffness_nm_rad: float
    """Stiffness of the link's joint, N·m/rad, positive."""
    damping_nm_s_rad: float
    """Damping of the link's joint, N·m·s/rad, not negative."""


class Link(_LinkOnLine, total=False):
    """A link of a chain, and the joint at its start: `structure.links` of a scenario."""

    centre_of_mass_off_m: float
    """Distance of the centre of mass to the left of the line from the joint to the next, or to the tip, m; default
    0."""


class _ModeOnGround(TypedDict):
    frequency_hz: float
    """Undamped natural frequency, Hz, not negative; 0 is a rigid mode."""
    damping_ratio: float
    """Damping ratio, not negative; from 1 on the mode does not oscillate."""
    shape: dict[str, float]
    """Displacement of each point along an axis, as `tip.x`, 1/√kg, of the shape of modal mass 1 kg."""


class ModeShape(_ModeOnGround, total=False):
    """A mode with its shape: `structure.modes` of a scenario."""

    participation: dict[str, float]
    """Participation factor of a base that moves along an axis, as `base.z`, √kg."""


class JointOfFile(TypedDict):
    """A joint of a URDF file that becomes one of the chain: `structure.joints` of a scenario."""

    name: str
    """Name of the joint in the file."""
    stiffness_nm_rad: float
    """Stiffness, N·m/rad, positive."""
    damping_nm_s_rad: float
    """Damping, N·m·s/rad, not negative."""


class PosedJoint(JointOfFile, total=False):
    """The same with its pose."""

    angle_deg: float
    """Angle of the joint from the file's zero, about its own axis, degrees, −360 to 360; 0 by default."""


class Term(TypedDict):
    """A term of a polynomial's potential, energy · Π x^power of its displacements."""

    powers: Sequence[int]
    """Power of each displacement; they add up to 3 to 5."""
    energy: float
    """Energy at displacements of 1, J/m³, J/m⁴ or J/m⁵ by the sum of the powers; at joints J/rad³ and so on."""


class _Kind(TypedDict):
    kind: ElementKind


class Element(_Kind, total=False):
    """A point element: `structure.elements` of a scenario (docs/structures.md). It has one of `at`, `joint` and
    `between`, and the values of its kind: with the units of an axis, or at a joint those that end in `rad` and `nm`."""

    at: str | Sequence[str]
    """Point and axis, as `tip.x`, against the ground; of a polynomial a list, also of joints, as `joint2`."""
    terms: Sequence[Term]
    """Terms of a polynomial's potential."""
    joint: int
    """The joint of a chain, from 1, about which it acts."""
    between: tuple[str, str] | list[str]
    """Both ends of the element, where neither is the ground."""
    side: Side
    """Side along its axis on which a contact is; positive by default."""
    stiffness_n_m: float
    stiffness_nm_rad: float
    stiffness3_n_m3: float
    stiffness3_nm_rad3: float
    stiffness5_n_m5: float
    stiffness5_nm_rad5: float
    stiffness_n_m1_5: float
    stiffness_nm_rad1_5: float
    gap_m: float
    gap_rad: float
    preload_n: float
    preload_nm: float
    damping_n_s_m: float
    damping_nm_s_rad: float
    dissipation_s_m: float
    dissipation_s_rad: float
    viscous_n_s_m: float
    viscous_nm_s_rad: float
    slip_force_n: float
    slip_torque_nm: float
    breakaway_n: float
    breakaway_nm: float
    stribeck_m_s: float
    stribeck_rad_s: float
    velocity_m_s: float
    velocity_rad_s: float
