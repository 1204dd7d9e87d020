"""Resonarm: the vibration of a robot arm with compliant joints, of other chains and of structures known by their modes,
simulated on a bench and computed by analysis.

SI units throughout, angles of the pose in degrees; a name that is not a typed quantity carries its unit. Vibration
angles α are deflections of the joints about the pose. Invalid values raise `ValueError`, arguments of the wrong type
`TypeError`, refusals of the system `OSError`, and valid requests that fail `ResonarmError`.
"""

from ._resonarm import Measurement, Mode, ResonarmError, __version__, presets
from .basins import Basins, StableMotion
from .continuation import Branch, Curve, EndedEarly, Origin, Searched
from .log_import import import_log
from .own_structure import Stepped
from .plant import Plant
from .protocol import Decoded, Decoder, Encoder, Frame, Network
from .recording import Recording, RecordingWarning
from .scenario import Scenario
from .session import Node, Report, run
from .spectra import FrequencyResponses, ShockSpectra, Spectra
from .structures import AccuracyWarning, Chain, Modal, Structure
from .tables import Element, Link, ModeShape, Term

__all__ = [
    "AccuracyWarning",
    "Basins",
    "Branch",
    "Chain",
    "Curve",
    "Decoded",
    "Decoder",
    "Element",
    "Encoder",
    "EndedEarly",
    "Frame",
    "FrequencyResponses",
    "Link",
    "Measurement",
    "Modal",
    "Mode",
    "ModeShape",
    "Network",
    "Node",
    "Origin",
    "Plant",
    "Recording",
    "RecordingWarning",
    "Report",
    "ResonarmError",
    "Scenario",
    "Searched",
    "ShockSpectra",
    "Spectra",
    "StableMotion",
    "Stepped",
    "Structure",
    "Term",
    "__version__",
    "import_log",
    "presets",
    "run",
]
