"""Modal structures, against sums of modes, generalised eigenproblems and motions of independent equations."""

import math
import pickle
import warnings
from pathlib import Path

import numpy as np
import pytest
import pyuff
from matplotlib.figure import Figure
from planar_chain import runge_kutta

import resonarm

EXAMPLES = Path(__file__).resolve().parents[2] / "examples/structures"
MODES = [
    resonarm.ModeShape(frequency_hz=20.0, damping_ratio=0.01, shape={"tip.x": 0.9, "tip.y": 0.2, "mid.x": 0.4}),
    resonarm.ModeShape(frequency_hz=71.0, damping_ratio=0.004, shape={"tip.x": -0.7, "tip.y": 0.6, "mid.x": 0.5}),
]
STOP = resonarm.Element(kind="contact", at="tip.x", stiffness_n_m=2e5, damping_n_s_m=20.0, gap_m=1e-4)
HARDENING = resonarm.Element(kind="cubic", at="tip.x", stiffness3_n_m3=1e7)


def by_modes(hz, drive, response):
    """Receptance: Σ φ_response φ_drive/(ω_r² − ω² + 2iζ_r ω_r ω)."""
    omega, total = math.tau * hz, 0.0
    for mode in MODES:
        own = math.tau * mode["frequency_hz"]
        residue = mode["shape"][drive] * mode["shape"][response]
        total = total + residue / (own**2 - omega**2 + 2j * mode["damping_ratio"] * own * omega)
    return total


def test_frequency_responses_are_sums_of_modes():
    hz = np.linspace(0.0, 100.0, 7)
    modal = resonarm.Modal(MODES)
    expected = by_modes(hz, "tip.x", "mid.x")
    np.testing.assert_allclose(modal.frf(hz, drive="tip.x", at="mid.x"), expected, rtol=1e-10)
    mobility = modal.frf(hz, drive="tip.x", at="mid.x", quantity="mobility")
    np.testing.assert_allclose(mobility, 2j * math.pi * hz * expected, rtol=1e-10)
    assert [mode.frequency_hz for mode in modal.modes()] == pytest.approx([20.0, 71.0], rel=1e-12)


def linear(state, load_n, drive="tip.x"):
    """The rate of q, q̇ under a load."""
    q, rate = state[:2], state[2:]
    own = math.tau * np.array([mode["frequency_hz"] for mode in MODES])
    damping = 2 * own * np.array([mode["damping_ratio"] for mode in MODES])
    shape = np.array([mode["shape"][drive] for mode in MODES])
    return np.concatenate([rate, shape * load_n - damping * rate - own**2 * q])


def test_a_motion_against_a_stop_is_that_of_independent_equations():
    shape = np.array([mode["shape"]["tip.x"] for mode in MODES])

    def rate(t_s, state):
        x, v = shape @ state[:2], shape @ state[2:]
        pressed = x - STOP["gap_m"]
        force = max(0.0, STOP["stiffness_n_m"] * pressed + STOP["damping_n_s_m"] * v) if pressed > 0 else 0.0
        return linear(state, 30.0 * math.sin(math.tau * 21.0 * t_s) - force)

    modal = resonarm.Modal(MODES, elements=[STOP])
    motion = modal.simulate(0.05, drive={"tip.x": 30.0}, frequency_hz=21.0, rate_hz=2000, every=20)
    assert motion.dtype.names == ("t_s", "q_m_sqrt_kg", "q_dot_m_sqrt_kg_s")
    # Their error is of first order where the stop is met.
    expected = runge_kutta(rate, np.zeros(4), 1 / 50_000, 2500)[::500]
    assert (expected[:, :2] @ shape).max() > 1.2 * STOP["gap_m"], "the tip presses the stop"
    np.testing.assert_allclose(motion["q_m_sqrt_kg"], expected[:, :2], rtol=0, atol=1e-8)
    np.testing.assert_allclose(motion["q_dot_m_sqrt_kg_s"], expected[:, 2:], rtol=0, atol=5e-6)


def test_a_hardening_branch_has_the_amplitudes_of_settled_motions():
    modal = resonarm.Modal(MODES[:1], elements=[HARDENING])
    branch = modal.continuation("frequency", 16.0, 30.0, drive={"tip.x": 6.0})
    assert branch.bifurcations["kind"].tolist() == ["fold", "fold"]
    stable = branch.points[branch.points["stable"]]
    point = stable[np.argmin(abs(stable["frequency_hz"] - 19.0))]
    hz, own, shape = float(point["frequency_hz"]), math.tau * 20.0, 0.9

    def rate(t_s, state):
        q, velocity = state
        force = 6.0 * math.sin(math.tau * hz * t_s) - 1e7 * (shape * q) ** 3
        return np.array([velocity, shape * force - 0.02 * own * velocity - own**2 * q])

    settled = runge_kutta(rate, np.zeros(2), 1 / (64 * hz), 64 * 80)[-65:]
    assert point["tip_x_largest_m"] == pytest.approx(abs(shape * settled[:, 0]).max(), rel=3e-3)
    last = branch.peaks["tip_x_largest_m"][0]
    assert last > branch.points["tip_x_largest_m"].max() * (1 - 1e-9)
    assert resonarm.Modal(MODES[:1]).simulate(0.01)["q_m_sqrt_kg"].shape == (21, 1)


def test_a_branch_without_stability_has_the_same_motions():
    modal = resonarm.Modal(MODES[:1], elements=[HARDENING])
    drive = {"tip.x": 6.0}
    whole, bare = (modal.continuation("frequency", 16.0, 30.0, drive=drive, stability=on) for on in (True, False))
    assert (whole.stability, bare.stability) == (True, False)
    for name in ("value", "tip_x_largest_m", "harmonics"):
        for rows in ("points", "bifurcations", "peaks"):
            np.testing.assert_array_equal(getattr(whole, rows)[name], getattr(bare, rows)[name])
    assert bare.bifurcations["kind"].tolist() == ["fold", "fold"]
    assert not bare.points["stable"].any() and bare.points["multipliers"].size == 0
    assert f"{len(bare.points)} periodic responses, stability not computed; 2 × fold" in repr(bare)
    styles = {line.get_linestyle() for line in bare.plot(Figure().subplots()).lines if line.get_marker() == "None"}
    assert styles == {"-"}


def test_steps_with_too_many_switches_are_reported():
    gaps = [
        resonarm.Element(kind="gap", at=at, stiffness_n_m=1e6, gap_m=gap)
        for at, gap in (("tip.x", 1e-5), ("mid.x", 2e-5))
    ]
    mode = resonarm.ModeShape(frequency_hz=500.0, damping_ratio=0.001, shape={"tip.x": 1.0, "mid.x": 0.8})
    modal = resonarm.Modal([mode], elements=gaps)
    with pytest.warns(resonarm.AccuracyWarning, match="steps had more switches .* located, .*: raise rate_hz"):
        modal.simulate(0.1, initial=[1e-4, 0], rate_hz=40)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        modal.simulate(0.1, initial=[1e-4, 0], rate_hz=400)


def test_matrices_give_the_modes_of_their_eigenproblem():
    rng = np.random.default_rng(3)
    half = rng.normal(size=(5, 5))
    mass, stiffness = np.diag(rng.uniform(1, 4, 5)), 1e4 * (half @ half.T + 5 * np.eye(5))
    damping = 0.3 * mass + 2e-5 * stiffness
    modal = resonarm.Modal.from_matrices(mass, stiffness, damping, dofs={"tip.z": 4, "mid.z": 1}, modes=3)
    squares = np.sort(np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real)[:3]
    modes = modal.modes()
    np.testing.assert_allclose([mode.frequency_hz for mode in modes], np.sqrt(squares) / math.tau, rtol=1e-9)
    ratios = 0.15 / np.sqrt(squares) + 1e-5 * np.sqrt(squares)
    np.testing.assert_allclose([mode.damping_ratio for mode in modes], ratios, rtol=1e-9)
    whole = resonarm.Modal.from_matrices(mass, stiffness, damping, dofs={"tip.z": 4, "mid.z": 1})
    omega = math.tau * 25.0
    receptance = np.linalg.inv(stiffness - omega**2 * mass + 1j * omega * damping)
    np.testing.assert_allclose(whole.frf(25.0, drive="tip.z", at="mid.z"), receptance[4, 1], rtol=1e-9)


def test_matrices_of_files_are_the_same():
    arrays = [np.load(EXAMPLES / f"plate-{name}.npy") for name in "mkc"]
    modal = resonarm.Modal.from_matrices(*arrays, dofs={"tip.z": 8, "middle.z": 4}, modes=4, name="plate")
    assert modal == resonarm.Modal.from_scenario(EXAMPLES / "plate.toml")


def test_modes_of_a_uff_file_are_those_that_pyuff_reads():
    modal = resonarm.Modal.from_uff(EXAMPLES / "bracket.uff", {"tip": 4})
    sets = [one for one in pyuff.UFF(str(EXAMPLES / "bracket.uff")).read_sets() if one["type"] == 55]
    for mode, one in zip(modal.mode_shapes, sets, strict=True):
        assert mode["frequency_hz"] == pytest.approx(one["freq"], rel=1e-6)
        row = one["node_nums"].tolist().index(4)
        assert mode["shape"]["tip.y"] == pytest.approx(one["r2"][row].real / math.sqrt(one["modal_m"]), rel=1e-5)
    with pytest.raises(FileNotFoundError, match=r"none\.uff"):
        resonarm.Modal.from_uff("none.uff")


def test_the_modes_of_a_chain_respond_as_the_chain():
    arm = resonarm.Chain.preset(angles_deg=(0, 75))
    modal = resonarm.Modal.from_chain(arm, name="arm by its modes")
    hz = np.linspace(1.0, 80.0, 400)
    for drive in ("tip.x", "tip.y"):
        for at in ("tip.x", "tip.y", "joint2.y"):
            expected = arm.frf(hz, drive=drive, at=at)
            found = modal.frf(hz, drive=drive, at=at)
            assert abs(found - expected).max() < 2e-3 * abs(expected).max()
    assert modal.point_names == ["joint2", "tip"]
    first = resonarm.Modal.from_chain(arm, modes=1)
    assert first.mode_shapes == modal.mode_shapes[:1]


def test_the_modes_of_a_chain_under_its_weight_have_its_frequencies():
    chain = resonarm.Chain.from_scenario(EXAMPLES / "chain.toml")
    modal = resonarm.Modal.from_chain(chain, modes=2)
    np.testing.assert_allclose(
        [mode.frequency_hz for mode in modal.modes()], [mode.frequency_hz for mode in chain.modes()[:2]], rtol=1e-12
    )
    assert len(modal.dofs) == 12


def test_identified_modes_are_those_of_the_arm(command, tmp_path):
    random = {"waveform": "random", "from_hz": 5.0, "to_hz": 80.0, "duration_s": 12.0, "seed": 3}
    scenario = resonarm.Scenario().replace(
        excitation={"amplitude": {"exciter_x": 3.0, "exciter_y": 4.0}, "ramp_s": 0.0, "profile": random}
    )
    resonarm.run(scenario, record=tmp_path / "random.mcap")
    document = command("identify", tmp_path / "random.mcap")
    modal, own = resonarm.Modal.from_identified(document), resonarm.Modal.from_chain(scenario.structure)
    for mode, expected in zip(modal.mode_shapes, own.mode_shapes, strict=True):
        assert mode["frequency_hz"] == pytest.approx(expected["frequency_hz"], rel=1e-4)
        found, shape = (np.array(list(of["shape"].values())) for of in (mode, expected))
        np.testing.assert_allclose(found * np.sign(found @ shape), shape, rtol=0, atol=2e-3 * abs(shape).max())
    document["modes"][1]["doubts"] = [{"reason": "not-white", "text": "the residual is not white"}]
    with pytest.warns(resonarm.AccuracyWarning, match=r"mode 2, at 48\.\S* Hz: the residual is not white"):
        resonarm.Modal.from_identified(document)
    document["modes"][0]["shape_per_sqrt_kg"] = None
    with pytest.raises(ValueError, match=r"mode 1, at 22\.\S* Hz, has no modal mass"):
        resonarm.Modal.from_identified(document)
    with pytest.raises(ValueError, match="the document has no modes"):
        resonarm.Modal.from_identified({"modes": []})


def test_identified_modes_of_a_structure_are_at_its_points(command, tmp_path):
    random = {"waveform": "random", "from_hz": 20.0, "to_hz": 300.0, "duration_s": 4.0, "seed": 3}
    scenario = resonarm.Scenario.load(
        EXAMPLES / "bracket.toml",
        rig={"sensors": {"b": {"at": "mid"}}},
        excitation={"amplitude": {"exciter_y": 2.0}, "ramp_s": 0.0, "profile": random},
    )
    resonarm.run(scenario, record=tmp_path / "random.mcap")
    document = command("identify", tmp_path / "random.mcap")
    assert [coordinate["unit"] for coordinate in document["coordinates"]] == ["m·√kg"] * 3
    found, own = resonarm.Modal.from_identified(document), resonarm.Modal.from_scenario(scenario)
    assert found.point_names == own.point_names == ["mid", "tip"]
    for mode, expected in zip(found.mode_shapes, own.mode_shapes, strict=False):
        assert mode["frequency_hz"] == pytest.approx(expected["frequency_hz"], rel=1e-3)
        assert abs(mode["shape"]["tip.y"]) == pytest.approx(abs(expected["shape"]["tip.y"]), rel=2e-3)


def test_pyuff_reads_identified_modes(command, tmp_path):
    random = {"waveform": "random", "from_hz": 20.0, "to_hz": 300.0, "duration_s": 4.0, "seed": 3}
    scenario = resonarm.Scenario.load(
        EXAMPLES / "bracket.toml",
        rig={"sensors": {"b": {"at": "mid"}}},
        excitation={"amplitude": {"exciter_y": 2.0}, "ramp_s": 0.0, "profile": random},
    )
    resonarm.run(scenario, record=tmp_path / "random.mcap")
    document = command("identify", tmp_path / "random.mcap", "--uff", tmp_path / "found.uff")
    header, units, nodes, line, *rest = pyuff.UFF(str(tmp_path / "found.uff")).read_sets()
    assert [one["type"] for one in (header, units, nodes, line)] == [151, 164, 15, 82]
    assert header["description"].strip() == "nodes: 1 mid, 2 tip"
    assert (units["units_code"], units["length"], units["force"]) == (1, 1.0, 1.0)
    np.testing.assert_array_equal(nodes["node_nums"], [1, 2])
    # As in bracket.uff, where they are nodes 2 and 4.
    np.testing.assert_allclose(np.transpose([nodes[axis] for axis in "xyz"]), [[0.1, 0.0, 0.005], [0.3, 0.0, 0.015]])
    np.testing.assert_array_equal(line["nodes"], [1, 2])

    shapes = [one for one in rest if one["type"] == 55]
    responses = [one for one in rest if one["type"] == 58]
    assert len(shapes) + len(responses) == len(rest)
    place = {"mid": 0, "tip": 1}
    for mode, one in zip(document["modes"], shapes, strict=True):
        pole = complex(*mode["pole_rad_s"])
        assert one["eig"] == pytest.approx(pole, rel=1e-9)
        assert one["modal_a"] == pytest.approx(2j * pole.imag, rel=1e-9)
        assert one["modal_b"] == pytest.approx(-2j * pole * pole.imag, rel=1e-9)
        expected = np.zeros((2, 3), complex)
        for dof, value in zip(document["at"], mode["complex_shape_per_sqrt_kg"], strict=True):
            point, axis = dof.split(".")
            expected[place[point], "xyz".index(axis)] = complex(*value)
        found = np.transpose([one["r1"], one["r2"], one["r3"]])
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8 * abs(expected).max())

    run = document["runs"][0]
    assert [one["rsp_node"] - 1 for one in responses] == [place[of["at"].split(".")[0]] for of in run["responses"]]
    for one, of in zip(responses, run["responses"], strict=True):
        assert (one["func_type"], one["ref_node"], one["ref_dir"]) == (4, 2, 2)
        assert (one["ordinate_spec_data_type"], one["orddenom_spec_data_type"]) == (12, 13)
        np.testing.assert_allclose(one["x"], run["frequency_hz"], rtol=1e-9)
        np.testing.assert_allclose(one["data"], np.array(of["h1"]) @ [1, 1j], rtol=1e-11)
    own, read = (
        resonarm.Modal.from_identified(document),
        resonarm.Modal.from_uff(tmp_path / "found.uff", {"mid": 1, "tip": 2}),
    )
    for mode, expected in zip(read.mode_shapes, own.mode_shapes, strict=True):
        assert mode["frequency_hz"] == pytest.approx(expected["frequency_hz"], rel=1e-8)
        for dof, value in expected["shape"].items():
            assert abs(mode["shape"][dof]) == pytest.approx(abs(value), rel=1e-3, abs=1e-3)


def accelerance(hz, modes, response, force):
    """The accelerance of modes: frequency, damping ratio, and shapes of modal mass 1 kg at two nodes."""
    ratio = hz[:, None] / [mode[0] for mode in modes]
    damping = np.array([mode[1] for mode in modes])
    product = np.array([mode[2 + response] * mode[2 + force] for mode in modes])
    return np.sum(-(ratio**2) * product / (1 - ratio**2 + 2j * damping * ratio), axis=1)


def test_a_file_of_pyuff_brings_its_geometry(command, tmp_path):
    """Responses in mm/s² per N with nodes of dataset 2411 and elements of 2412, as pyuff writes them."""
    modes, hz = [(20.0, 0.01, 0.5, 0.9), (55.0, 0.02, -0.8, 0.6)], np.arange(10.0, 80.0, 0.1)
    nodes = {3: [100.0, 0.0, 0.0], 7: [200.0, 50.0, 0.0], 8: [300.0, 0.0, -25.0]}
    noise = np.random.default_rng(1)
    written = pyuff.UFF(str(tmp_path / "measured.uff"))
    units = pyuff.prepare_164(
        units_code=5, units_description="mm", temp_mode=2, length=1000.0, force=1.0, temp=1.0, temp_offset=0.0
    )
    places = np.transpose(list(nodes.values()))
    grid = pyuff.prepare_2411(
        node_nums=list(nodes), def_cs=[0] * 3, disp_cs=[0] * 3, color=[1] * 3, x=places[0], y=places[1], z=places[2]
    )
    sets = [units, grid]
    for response, node in enumerate([3, 7]):
        values = accelerance(hz, modes, response, 1)
        values = values + 1e-4 * np.abs(values) * (noise.standard_normal((len(hz), 2)) @ [1, 1j])
        sets.append(
            pyuff.prepare_58(
                func_type=4,
                rsp_node=node,
                rsp_dir=3,
                ref_node=7,
                ref_dir=-3,
                ord_data_type=6,
                abscissa_spacing=1,
                abscissa_min=hz[0],
                abscissa_inc=0.1,
                num_pts=len(hz),
                abscissa_spec_data_type=18,
                ordinate_spec_data_type=12,
                orddenom_spec_data_type=13,
                x=hz,
                data=-1000.0 * values,
            )
        )
    written.write_sets(sets, mode="overwrite")
    document = command("identify", tmp_path / "measured.uff", "--uff", tmp_path / "again.uff")
    expected = {f"node{node}": [value / 1000.0 for value in at] for node, at in nodes.items()}
    assert document["positions_m"] == expected and document["at"] == ["node3.z", "node7.z"]
    for mode, (frequency_hz, damping_ratio, *shape) in zip(document["modes"], modes, strict=True):
        assert mode["pole_frequency_hz"] == pytest.approx(frequency_hz, rel=1e-4)
        assert mode["pole_damping_ratio"] == pytest.approx(damping_ratio, rel=1e-2)
        np.testing.assert_allclose(np.abs(mode["shape_per_sqrt_kg"]), np.abs(shape), rtol=1e-2)
    modal = resonarm.Modal.from_identified(document)
    assert modal.section["points"] == expected
    (again,) = (one for one in pyuff.UFF(str(tmp_path / "again.uff")).read_sets() if one["type"] == 15)
    np.testing.assert_array_equal(again["node_nums"], list(nodes))
    np.testing.assert_allclose([again[axis] for axis in "xyz"], 0.001 * places, atol=1e-12)


def test_structures_are_values():
    drawn = {"points": {"mid": [0.1, 0.0, 0.0], "tip": [0.3, 0.0, 0.0]}, "lines": [("mid", "tip")]}
    modal = resonarm.Modal(MODES, elements=[STOP], name="bracket", **drawn)
    again = pickle.loads(pickle.dumps(modal))
    assert (again, hash(again), again.elements) == (modal, hash(modal), [STOP])
    assert (modal.mode_shapes, modal.section["lines"]) == (MODES, [["mid", "tip"]])
    assert modal != resonarm.Modal(MODES)
    assert repr(modal) == "<Modal 'bracket': 2 modes, points mid, tip, 1 element; 20 to 71 Hz>"


SLACK = {**MODES[0], "damping_ratio": -0.5}
COUPLED = np.array([[3.0, -2.9], [-2.9, 3.0]])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: resonarm.Modal([]), "`modes` are missing"),
        (lambda: resonarm.Modal([SLACK]), "mode 1: `damping_ratio` is -0.5: it must be"),
        (lambda: resonarm.Modal([*MODES, {**MODES[0], "shape": {"tip.x": 1}}]), "number 3: `shape` lacks `mid.x`"),
        (lambda: resonarm.Modal(MODES, elements=[{**STOP, "at": "end.x"}]), "there is no `end.x` in this structure"),
        (
            lambda: resonarm.Modal.from_matrices([[1, 2]], [[1]], dofs={}),
            "mass: its shape is (1, 2): it must be square",
        ),
        (
            lambda: resonarm.Modal.from_matrices(np.eye(2), np.eye(3), dofs={"a.x": 0}),
            "stiffness: it has 3 rows",
        ),
        (
            lambda: resonarm.Modal.from_matrices(np.eye(2), [[2, 1], [0, 2]], dofs={"a.x": 0}),
            "stiffness: it is not symmetric",
        ),
        (
            lambda: resonarm.Modal.from_matrices(np.eye(2), np.diag([1, 4]), COUPLED, dofs={"a.x": 0}),
            "damping: its damping couples modes 1 and 2",
        ),
        (lambda: resonarm.Modal.from_matrices(np.eye(2), np.eye(2), dofs={"a.x": 2}), "`a.x` is row 2"),
        (
            lambda: resonarm.Modal.from_chain(resonarm.Chain.preset(), modes=3),
            "3 modes can't be kept: it must be from 1 to 2, the modes of the structure",
        ),
        (
            lambda: resonarm.Modal.from_chain(resonarm.Chain.preset().replace({"link1.damping_nm_s_rad": 1000.0})),
            "its damping couples modes 1 and 2",
        ),
        (
            lambda: resonarm.Modal.from_chain(resonarm.Chain.from_scenario(EXAMPLES / "hardening.toml")),
            "the structure has elements (1), but only its linear part has modes",
        ),
        (lambda: resonarm.Modal.from_scenario(EXAMPLES / "chain.toml"), "use Chain.from_scenario"),
        (
            lambda: resonarm.Modal.from_scenario(resonarm.Scenario()),
            "structure.kind is preset: use Chain.from_scenario",
        ),
    ],
)
def test_invalid_arguments_are_value_errors(call, message):
    with pytest.raises(ValueError) as raised:
        call()
    assert message in str(raised.value)
