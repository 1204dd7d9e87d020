"""The paper's statements, judged as a user has it done, with the settings that come with the program."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from processes import Programs

PRESETS = ["irb1600-table1", "irb1600-fitted"]
DOCUMENTATION = Path(__file__).parents[2] / "docs" / "paper.md"


@pytest.fixture(scope="module")
def paper(tmp_path_factory):
    folder = tmp_path_factory.mktemp("paper")
    with Programs() as programs:
        said = programs.resonarm("paper", "claims", "--json", "--out", folder).result(600)
        return SimpleNamespace(claims={claim["id"]: claim for claim in said["claims"]}, folder=folder)


def test_the_documentation_shows_what_the_program_says(paper):
    assert (paper.folder / "claims.md").read_text() in DOCUMENTATION.read_text()


def test_every_statement_is_judged_for_both_presets(paper):
    assert len(paper.claims) == 30
    for claim in paper.claims.values():
        assert [finding["preset"] for finding in claim["findings"]] == PRESETS
        for finding in claim["findings"]:
            assert finding["verdict"] != "not-computed"
            for case in finding["cases"]:
                assert case["value"] and np.isfinite([number["value"] for number in case["numbers"]]).all()


@pytest.mark.parametrize("preset", PRESETS)
def test_natural_frequencies_are_those_of_the_eigenproblem(paper, preset):
    """M and K of Eqs. (19), (22), with Table 1; I_S2 as the presets have it."""
    inertia2 = {"irb1600-table1": 0.0009, "irb1600-fitted": 1.5}[preset]
    m2, l1, lc2 = 50.58, 0.63, 0.1
    stiffness = np.diag([555_000.0, 128_000.0])
    a2, a3 = m2 * l1 * lc2, inertia2 + m2 * lc2**2
    a1 = 0.55 + inertia2 + m2 * (l1**2 + lc2**2)
    apart = []
    for beta2 in np.radians([0, 30, 60, 90, 120, 150]):
        c = np.cos(beta2)
        mass = np.array([[a1 + 2 * a2 * c, a3 + a2 * c], [a3 + a2 * c, a3]])
        squares = np.linalg.eigvals(np.linalg.solve(mass, stiffness))
        apart.append(np.diff(np.sort(np.sqrt(squares)) / (2 * np.pi))[0])
    findings = paper.claims["natural-frequencies-draw-together"]["findings"]
    numbers = findings[PRESETS.index(preset)]["cases"][0]["numbers"]
    assert [number["value"] for number in numbers] == pytest.approx(apart, rel=1e-9)
