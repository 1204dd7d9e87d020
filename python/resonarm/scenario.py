"""Scenarios: everything about a run, in one TOML text."""

from os import PathLike
from typing import TYPE_CHECKING, Any

from . import _resonarm
from .structures import Chain, Modal, Structure

if TYPE_CHECKING:
    from typing_extensions import Self


class Scenario(_resonarm.Scenario):
    """Everything about a run, as `scenarios/README.md` describes it; keys missing in the TOML `text` have defaults.
    Scenarios are equal if all their values are.

    Raises ValueError for an invalid scenario, with the message of the command line.
    """

    def __new__(
        cls,
        text: str = "",
        *,
        path: str | PathLike[str] | None = None,
        folder: str | PathLike[str] | None = None,
    ) -> "Self":
        """Makes it from a TOML text, a load file being relative to `folder`, or from the file of a `path`."""
        is_path = isinstance(text, PathLike) or (isinstance(text, str) and text.endswith(".toml") and "\n" not in text)
        if is_path or not isinstance(text, str):
            what = f": Scenario.load({str(text)!r}) reads a file" if is_path else f", a str: this is {text!r}"
            raise (ValueError if isinstance(text, str) else TypeError)(f"Scenario() expects the TOML itself{what}")
        return super().__new__(cls, text, path=path, folder=folder)

    @classmethod
    def load(cls, path: str | PathLike[str], **sections: dict[str, Any] | None) -> "Scenario":
        """The scenario of a file, with some values replaced: see `replace`.

        Raises OSError if the file, or the load file that it names, can't be read.
        """
        scenario = cls(path=path)
        return scenario.replace(**sections) if sections else scenario

    @property
    def structure(self) -> Chain | Modal:
        """The structure under test; without a section `[structure]` it is `Chain.preset()`.
        Raises ValueError for one whose step is written in Python, and for an FMU."""
        found = Structure.from_scenario(self)
        assert isinstance(found, Chain | Modal)
        return found

    @property
    def sample_rate_hz(self) -> float:
        """Samples a second, Hz."""
        return float(self.values()["simulation"]["rate_hz"])

    def __eq__(self, other: object) -> bool:
        return self.to_toml() == other.to_toml() if isinstance(other, Scenario) else NotImplemented

    def __hash__(self) -> int:
        return hash(self.to_toml())

    def __repr__(self) -> str:
        values = self.values()
        controller = next((name for name in ("excitation", "control") if values.get(name)), "no excitation")
        duration_s = values["simulation"].get("duration_s")
        end = "" if duration_s is None else f", {duration_s:g} s"
        kind = values["structure"]["kind"]
        foreign = {"own": "a program's own structure", "fmu": "an FMU"}
        of = foreign.get(kind) or repr(self.structure)
        return f"<Scenario of {of}: {controller}, {self.sample_rate_hz:g} Hz{end}>"
