"""Basins of structures, against the program, and their pictures."""

import pickle
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import resonarm

EXAMPLES = Path(__file__).resolve().parents[2] / "examples/structures"
HZ, FORCE_N, GRID = 20.17, 10.0, (7, 6)
MODES = [
    resonarm.ModeShape(frequency_hz=20.0, damping_ratio=0.004, shape={"tip.x": 0.5, "mid.x": 0.3}),
    resonarm.ModeShape(frequency_hz=57.0, damping_ratio=0.006, shape={"tip.x": -0.4, "mid.x": 0.35}),
]
SPRING = resonarm.Element(kind="cubic", at="tip.x", stiffness3_n_m3=3.711e6)


def test_basins_of_a_structure_are_those_of_the_program(command, tmp_path):
    modal = resonarm.Modal(MODES, elements=[SPRING])
    file = tmp_path / "hard.toml"
    file.write_text(resonarm.Scenario().replace(structure=modal.section).to_toml())
    words = ["--drive", f"tip.x={FORCE_N}", "--frequency-hz", HZ, "--points", "7,6", "--scenario", file]
    document = command("basins", *words)
    found = modal.basins(HZ, drive={"tip.x": FORCE_N}, points=GRID)
    assert found.coordinates == ("q1_m_sqrt_kg", "q1_dot_m_sqrt_kg_s")
    cells = document["cells"]
    assert found.motion.ravel().tolist() == [cell["motion"] or 0 for cell in cells]
    assert found.periods.ravel().tolist() == [cell["periods"] or 0 for cell in cells]
    at = np.stack([np.tile(found.x, 6), np.repeat(found.y, 7)], axis=1)
    np.testing.assert_array_equal(at, [cell["at"] for cell in cells])
    assert len(found.motions) == len(document["motions"]) == 2
    for motion, expected in zip(found.motions, document["motions"], strict=True):
        assert motion.section.tolist() == expected["section"]
        assert (motion.period, motion.largest_multiplier) == (expected["period"], expected["largest_multiplier"])
    counts = [np.count_nonzero(found.motion == k) for k in (1, 2)]
    assert min(counts) > 2
    of = "<Basins of 42 states, q1_m_sqrt_kg from -0.05876 to 0.05876, q1_dot_m_sqrt_kg_s from -7.446 to 7.446"
    assert repr(found) == f"{of}: {counts[0]} reach response 1, {counts[1]} reach response 2>"
    assert repr(pickle.loads(pickle.dumps(found))) == repr(found)
    ax = found.plot(Figure().subplots())
    # Cells that touch: one mesh for each response, and one diamond each.
    assert [mesh.get_array().count() for mesh in ax.collections] == counts
    assert [len(line.get_xdata()) for line in ax.lines] == [0, 0, 1, 1]
    names = [text.get_text() for text in ax.get_legend().get_texts()]
    assert names == ["reaches response 1", "reaches response 2", "stable responses"]
    assert ax.get_xlabel() == "q1_m_sqrt_kg"


def test_what_makes_no_basins_is_said():
    modal = resonarm.Modal(MODES, elements=[SPRING])
    drive = {"drive": {"tip.x": FORCE_N}}
    with pytest.raises(ValueError, match="frequency_hz is 0: it must be a positive number"):
        modal.basins(0.0, **drive)
    with pytest.raises(ValueError, match=r"drive top\.x: there is no `top\.x`"):
        modal.basins(HZ, drive={"top.x": FORCE_N})
    with pytest.raises(
        ValueError, match="unknown coordinate `alpha1_rad`: the coordinates are q1_m_sqrt_kg, q2_m_sqrt_kg"
    ):
        modal.basins(HZ, **drive, coordinates=("alpha1_rad", "q1_m_sqrt_kg"))
    with pytest.raises(ValueError, match=r"initial has the shape \(1, 2\): give rows of 4 numbers"):
        modal.basins(HZ, **drive, initial=(0.0, 0.0))


def ends(ax):
    """First and last points of the lines of a picture."""
    return [(line.get_xydata()[0], line.get_xydata()[-1]) for line in ax.lines]


def test_a_chain_is_drawn_at_rest_and_in_a_mode():
    chain = resonarm.Chain.from_scenario(EXAMPLES / "chain.toml")
    ax = chain.plot(Figure().subplots(), mode=2)
    assert ax.get_title() == f"mode 2: {chain.modes()[1].frequency_hz:.4g} Hz"
    (base, tip), (moved_base, moved_tip) = ends(ax)
    np.testing.assert_array_equal(base, moved_base)
    assert len(ax.lines[0].get_xdata()) == 7 and np.linalg.norm(tip - moved_tip) > 0.02
    # Its links keep their lengths.
    lengths = [np.linalg.norm(np.diff(line.get_xydata(), axis=0), axis=1) for line in ax.lines]
    np.testing.assert_allclose(lengths[1], lengths[0], rtol=1e-12)
    np.testing.assert_allclose(lengths[0], [link["length_m"] for link in chain.links], rtol=1e-12)
    assert len(chain.plot(Figure().subplots(), mode=None).lines) == 1
    with pytest.raises(ValueError, match="mode is 7: it must be from 1 to 6, or None"):
        chain.plot(Figure().subplots(), mode=7)


def test_modes_are_drawn_by_their_points():
    bracket = resonarm.Modal.from_scenario(EXAMPLES / "bracket.toml")
    ax = bracket.plot(Figure().subplots())
    assert len(ax.lines) >= 2 and {text.get_text() for text in ax.texts} >= {"tip", "mid"}
    points = {"tip": (0.4, 0.0, 0.0), "mid": (0.2, 0.0, 0.0)}
    loose = resonarm.Modal(MODES, points=points).plot(Figure().subplots(), mode=2)
    # Each point at rest, in the mode, and the way between.
    assert len(loose.lines) == 6
    np.testing.assert_allclose(loose.lines[0].get_xydata(), [points["mid"][:2]])
    with pytest.raises(ValueError, match="the positions of the structure's points are unknown: give `points`"):
        resonarm.Modal(MODES).plot(Figure().subplots())
