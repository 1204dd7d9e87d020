"""Resonarm: the vibration of a robot arm with compliant joints, of other chains and of structures known by their modes,
simulated on a bench and computed by analysis.

SI units throughout, angles of the pose in degrees; a name that is not a typed quantity carries its unit. Vibration
angles α are deflections of the joints about the pose β. Invalid values raise `ValueError`, arguments of the wrong type
`TypeError`, refusals of the system `OSError`, and valid requests that fail `ResonarmError`.
"""

from ._resonarm import Measurement, Mode, ResonarmError, StableMotion, __version__, presets
from .arm import Arm
from .basins import Basins
from .continuation import Branch, BranchEndedEarly, Curve
from .log_import import import_log
from .own_structure import Structure
from .plant import Plant
from .protocol import Decoded, Decoder, Encoder, Frame, Network
from .recording import Recording, RecordingWarning
from .scenario import Scenario
from .session import Node, Report, run
from .structure_basins import StructureBasins, StructureMotion
from .structure_branch import StructureBranch, StructureBranchEndedEarly
from .structure_words import Element, Link, ModeShape
from .structures import AccuracyWarning, Chain, Modal

__all__ = [
    "AccuracyWarning",
    "Arm",
    "Basins",
    "Branch",
    "BranchEndedEarly",
    "Chain",
    "Curve",
    "Decoded",
    "Decoder",
    "Element",
    "Encoder",
    "Frame",
    "Link",
    "Measurement",
    "Modal",
    "Mode",
    "ModeShape",
    "Network",
    "Node",
    "Plant",
    "Recording",
    "RecordingWarning",
    "Report",
    "ResonarmError",
    "Scenario",
    "StableMotion",
    "Structure",
    "StructureBasins",
    "StructureBranch",
    "StructureBranchEndedEarly",
    "StructureMotion",
    "__version__",
    "import_log",
    "presets",
    "run",
]
