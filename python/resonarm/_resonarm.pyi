from collections.abc import Callable, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, Literal, final

from numpy.typing import NDArray
from typing_extensions import Self

from .words import MessageName, NodeRole, Preset, Profile, RecordingPart, Verdict

__version__: str

class ResonarmError(Exception):
    """A valid request could not be fulfilled."""

def printable(text: str) -> str: ...

@final
class Mode:
    """A natural mode of a structure. Modes are equal if all their numbers are."""

    def __new__(cls, frequency_hz: float, damping_ratio: float, shape: Sequence[float]) -> Self: ...
    @property
    def frequency_hz(self) -> float:
        """Natural frequency of the undamped structure, Hz."""
    @property
    def damping_ratio(self) -> float:
        """Damping ratio, 1 is critical."""
    @property
    def shape(self) -> tuple[float, ...]:
        """Shape in the coordinates, normalised to the mass matrix."""

def presets() -> list[Preset]:
    """The names of the parameter sets that come with the package."""

def step_rate_hz(name: str | None = None) -> float: ...

_Load = tuple[float, float]
_Pair = Sequence[float] | NDArray[Any]
_Path = str | PathLike[str]
_FrameParts = tuple[int, bool, bytes, bool, bool]
_Drive = tuple[list[tuple[str, float]], float, float, list[tuple[int, float, float]]]
_Origin = tuple[str, float, int | None, int, bool]
_Searched = tuple[str | None, list[float], int, list[float], tuple[float, float] | None, int, list[float] | None]
_RealTime = tuple[str | None, str | None, int | None, int | None, bool, float | str | None]
_How = tuple[str, _Path | None, bool, float | None, float | None, int, bool, _RealTime]
_Controller = tuple[Callable[[Measurement], _Load | None], str]
_Structure = tuple[Any, Any, str, list[float], str | None, list[str], list[str], Any]

_Matrices = tuple[bytes, bytes, bytes | None]
_Drawn = tuple[list[str], list[list[int]], list[tuple[float, float, float]], list[tuple[float, float, float]]]

class Assembly:
    def __new__(cls, structure: dict[str, Any]) -> Self: ...
    @property
    def section(self) -> dict[str, Any]:
        """The section `[structure]` of a scenario that makes it, with the links or modes from files in it."""
    @property
    def numbers(self) -> dict[str, Any]: ...
    @property
    def parameters(self) -> list[str]:
        """The names of all its parameters, as `link2.mass_kg`, `mode1.damping_ratio` or `element1.gap_m`."""
    def parameter(self, name: str) -> tuple[float, str]:
        """The value of a parameter, and its unit, empty if it has none. Raises ValueError for an unknown name."""
    @property
    def chain_links(self) -> list[Any]: ...
    @property
    def chain_gravity_m_s2(self) -> float: ...
    @property
    def point_names(self) -> list[str]:
        """Names of the structure's points."""
    @property
    def dofs(self) -> list[str]:
        """Degrees of freedom on which a load can act, and which can be read: point and axis, or a joint."""
    def units(self, name: str, dof: str) -> tuple[str, str]: ...
    def channels(self) -> list[tuple[str, list[str]]]: ...
    def modes(self) -> list[Mode]:
        """The natural modes at rest, by frequency, with the slopes of smooth elements."""
    def drawn(self, coordinates: list[float]) -> _Drawn | None: ...
    def frf_at(self, frequency_hz: bytes, terms: tuple[str, str, str]) -> bytearray: ...
    def motion(
        self,
        initial: list[float] | None,
        drive: _Drive | None,
        stepping: tuple[str | None, float],
        length: tuple[int, int],
    ) -> tuple[bytearray, int]: ...

def ensemble(structure: Assembly, drive: _Drive, initial: bytes, length: tuple[int, int]) -> bytearray: ...

@final
class Attractors:
    def __new__(cls, structure: Assembly, drive: _Drive) -> Self: ...
    @property
    def motions(self) -> list[tuple[int, float, list[float], list[list[float]]]]: ...
    @property
    def ended_early(self) -> str | None: ...
    def with_those_of(self, initial: bytes) -> Attractors: ...
    def reach(self, index: int) -> float: ...
    def outcomes(self, initial: bytes, time_constants: float, on_cores: bool) -> bytearray: ...

@final
class TracedBranch:
    @property
    def points(self) -> bytearray: ...
    @property
    def kinds(self) -> list[str]: ...
    @property
    def bifurcations(self) -> bytearray: ...
    @property
    def beats(self) -> list[tuple[float, float]]: ...
    @property
    def peaks(self) -> bytearray: ...
    @property
    def unlocated(self) -> list[tuple[str, float, float]]: ...
    @property
    def stability(self) -> list[list[str]]:
        """The verdicts of points, peaks and bifurcations; empty where they are not computed."""
    @property
    def states(self) -> int: ...
    @property
    def multipliers(self) -> int: ...

@final
class Traced:
    @property
    def branch(self) -> TracedBranch: ...
    @property
    def isolas(self) -> list[tuple[_Origin, TracedBranch]]: ...
    @property
    def branches(self) -> list[tuple[_Origin, TracedBranch]]: ...
    @property
    def left_out(self) -> list[tuple[_Origin, str]]: ...
    @property
    def searched(self) -> _Searched: ...
    @property
    def curves(self) -> list[tuple[str, bytearray, bytearray, list[bool]]]: ...
    @property
    def ended_early(self) -> str | None: ...

def modes_of_matrices(
    matrices: _Matrices, dofs: dict[str, int], base: dict[str, list[int]], modes: int | None
) -> dict[str, Any]: ...
def modes_of_structure(structure: Assembly, modes: int | None) -> dict[str, Any]: ...
def trace_branch(
    structure: Assembly,
    drive: _Drive,
    range: tuple[str, float, float],
    at: list[str],
    settings: tuple[int, int, float, bool, float | None, list[float] | None],
    beyond: tuple[tuple[bool, bool], tuple[str, float] | None],
) -> Traced: ...

class Scenario:
    def __new__(cls, text: str = "", *, path: _Path | None = None, folder: _Path | None = None) -> Self: ...
    def replace(self, **sections: dict[str, Any] | None) -> Self:
        """The same scenario with other values: the given keys of each named section replace the scenario's; a key or
        section that is None is removed. Raises ValueError if the result is invalid."""
    def to_toml(self) -> str:
        """The scenario as TOML, with every default written out."""
    def values(self) -> dict[str, Any]:
        """All sections and their values."""
    def __getnewargs_ex__(self) -> tuple[tuple[str], dict[str, Any]]: ...

@final
class Measurement:
    """The readings of the instruments at a sample, along x and y of the base frame. A test of a controller may make one
    directly; they are equal if all their numbers are. Raises ValueError for bits of `clipped` beyond the
    readings."""

    def __new__(
        cls,
        sample: int,
        head_force_n: _Load = (0.0, 0.0),
        acceleration_b_m_s2: _Load = (0.0, 0.0),
        acceleration_c_m_s2: _Load = (0.0, 0.0),
        clipped: int = 0,
        sensors: Sequence[tuple[str, float]] = (),
    ) -> Self: ...
    @property
    def sample(self) -> int:
        """Index of the sample."""
    @property
    def head_force_n(self) -> tuple[float, float]:
        """Force in the impedance head, N."""
    @property
    def acceleration_b_m_s2(self) -> tuple[float, float]:
        """Acceleration of the elbow B, m/s²."""
    @property
    def acceleration_c_m_s2(self) -> tuple[float, float]:
        """Acceleration of the tip C, m/s²."""
    @property
    def clipped(self) -> int:
        """Readings that were beyond the range of their sensor: bits 0 and 1 for B, 2 and 3 for C, 4 and 5 for the
        head, those above for the other sensors in their order."""
    @property
    def sensors(self) -> dict[str, float]:
        """The readings of the sensors beside B and C by the names of their channels: `acceleration_m3_z_m_s2`."""

class Plant:
    def __new__(cls, scenario: Scenario, structure: _Structure | None = None) -> Self: ...
    @property
    def sample(self) -> int:
        """The index of the plant's current sample."""
    @property
    def time_s(self) -> float:
        """The time of that sample, s."""
    @property
    def alpha_rad(self) -> tuple[float, ...]:
        """The deflections of the joints there, of the arm α1 and α2, rad. Modes have none: see `states`."""
    @property
    def alpha_dot_rad_s(self) -> tuple[float, ...]:
        """Rates of the coordinates, rad/s."""
    @property
    def states(self) -> dict[str, tuple[float, ...]]:
        """All states there by their names, as `alpha_rad`, or `q_m_sqrt_kg` of modes."""
    def channels(self) -> list[tuple[str, list[str]]]: ...
    def reading_channels(self) -> list[tuple[str, list[str]]]: ...
    def measure(self) -> Measurement:
        """The readings of the instruments at the sample. Every call draws new noise: call it once a sample."""
    def advance(self, force_n: _Pair | None = None, torque_nm: _Pair | None = None) -> None:
        """Advances to the next sample with a force (Fx, Fy) of the exciter, or (Fx, Fy, Fz), N, and torques (u1, u2) at
        the joints, or of up to eight joints, N·m, held. Raises ValueError for a load that is not finite, ResonarmError
        if the structure does not take a part of it, the integrator can't continue or the shaker trips: the plant then
        stays at its sample."""
    def play_rows(self, force_n: bytes, torque_nm: bytes) -> bytearray: ...

class Recording:
    def __new__(cls, path: _Path) -> Self: ...
    @property
    def path(self) -> Path:
        """File of the recording."""
    @property
    def summary(self) -> dict[str, Any]:
        """Returns the summary: the document of `resonarm inspect --json`."""
    @property
    def dt_s(self) -> float:
        """Time from one sample to the next, s."""
    @property
    def damage(self) -> str | None:
        """Reason why the recording is not whole, in words; None if it is whole."""
    def count(self, part: RecordingPart) -> int:
        """The number of records of a part."""
    def channels(self, part: str) -> list[tuple[str, list[str]]]: ...
    def scenario_toml(self) -> str: ...
    def resim(self, *, fmu: _Path | None = None) -> dict[str, Any]:
        """Simulates the run again from its recorded loads: the document of `resonarm resim --json`, `identical` and
        the first differences. A recording is data: the run of an FMU is simulated again with the file `fmu`, whose
        SHA-256 must be the recorded one, and never with the file that the recording names. Raises ResonarmError if the
        run can't be simulated, or is one of an FMU and `fmu` is missing or another one."""
    def reader(self, part: str, from_sample: int, to_sample: int) -> Reader: ...

@final
class Reader:
    def read(self, most_rows: int) -> tuple[bytearray, list[str]]: ...
    def read_columns(self, most_rows: int) -> tuple[bytearray, list[str], int]: ...

def known_vectors() -> list[tuple[str, list[str]]]: ...
def overrun_causes() -> list[str]: ...

_Wanted = tuple[list[str], list[float | None]]
_Cut = tuple[float | None, float, str, str]
_Channels = list[tuple[str, str, int]]
_Average = tuple[int, float, float, list[float]]

def densities(recording: Recording, wanted: _Wanted, cut: _Cut) -> tuple[_Channels, _Average, bytearray]: ...
def frequency_responses(recording: Recording, wanted: _Wanted, cut: _Cut) -> tuple[_Channels, _Average, bytearray]: ...
def shock_responses(
    recording: Recording, wanted: _Wanted, quality: float, frequency_hz: bytes
) -> tuple[_Channels, bytearray]: ...
def judge(
    recording: Recording,
    specification: _Path,
    channels: list[str],
    reference: str | None,
    range_s: list[float | None],
) -> dict[str, Any]: ...

@final
class LogWriter:
    def __new__(cls, path: _Path) -> Self: ...
    def write(self, frame: _FrameParts, unix_ns: int, received: bool, interface: str) -> None: ...
    def finish(self) -> int: ...

def import_log(
    log: _Path,
    format: str,
    output: _Path,
    original: tuple[_Path, str],
    *,
    scenario: Scenario | None,
    interface: str | None,
    by_sync: bool,
    overwrite: bool,
) -> dict[str, Any]: ...

class Network:
    def __new__(
        cls, *, base: int = 0x200, plant_id: int = 1, exciter_id: int = 2, profile: Profile = "classic"
    ) -> Self: ...
    @property
    def base(self) -> int: ...
    @property
    def plant_id(self) -> int: ...
    @property
    def exciter_id(self) -> int: ...
    @property
    def profile(self) -> Profile: ...
    def dbc(self) -> str:
        """The DBC of the network."""
    @staticmethod
    def messages() -> list[MessageName]:
        """The names of the messages."""

class Encoder:
    def __new__(cls, network: Network) -> Self: ...
    def encode_parts(self, message: str, signals: dict[str, float]) -> _FrameParts: ...

_Verdict = tuple[Verdict, MessageName | Literal[""], NodeRole | Literal[""], dict[str, float], str]

class Decoder:
    def __new__(cls, network: Network) -> Self: ...
    @property
    def lost(self) -> int: ...
    def decode_parts(self, frame: _FrameParts) -> _Verdict: ...
    def decode_remote(self, identifier: int, extended: bool) -> _Verdict: ...

@final
class Hub:
    def __new__(cls, ends: int) -> Self: ...
    def end(self) -> BusEnd: ...

@final
class BusEnd:
    def send(self, frame: _FrameParts) -> None: ...
    def receive(self, timeout_s: float | None = None) -> _FrameParts | None: ...
    @property
    def dropped(self) -> int: ...
    def close(self) -> None: ...

class NodeRun:
    def __new__(
        cls,
        role: str,
        scenario: Scenario,
        how: _How,
        bus: BusEnd | str,
        controller: _Controller | None = None,
        structure: _Structure | None = None,
    ) -> Self: ...
    @property
    def is_running(self) -> bool:
        """Whether it is still running."""
    @property
    def sample(self) -> int:
        """Index of the node's current sample."""
    def take_events(self) -> list[dict[str, Any]]:
        """The events since the last call: `event` (ready, armed, disarmed, faulted, …) and its details."""
    def stop(self) -> None:
        """Asks the node to end in order, without waiting."""
    def join(self) -> tuple[dict[str, Any], bytearray]: ...

def run_both(
    scenario: Scenario, how: _How, controller: _Controller | None = None, structure: _Structure | None = None
) -> tuple[dict[str, Any], dict[str, Any], bytearray]: ...
