"""Chains of links, against independent equations and against the program."""

import math
import pickle
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from planar_chain import PlanarChain, runge_kutta

import resonarm

EXAMPLES = Path(__file__).resolve().parents[2] / "examples/structures"


def link(length_m, mass_kg, angle_deg, stiffness_nm_rad, damping_nm_s_rad):
    return resonarm.Link(
        length_m=length_m,
        mass_kg=mass_kg,
        centre_of_mass_m=0.4 * length_m,
        inertia_kg_m2=0.1 * mass_kg * length_m**2,
        angle_deg=angle_deg,
        stiffness_nm_rad=stiffness_nm_rad,
        damping_nm_s_rad=damping_nm_s_rad,
    )


LINKS = [link(0.7, 20.0, 40.0, 4e5, 90.0), link(0.5, 12.0, -70.0, 1e5, 30.0), link(0.3, 5.0, 25.0, 2e4, 4.0)]
HARDENING = resonarm.Element(kind="cubic", joint=2, stiffness3_nm_rad3=1e7)
STOP = resonarm.Element(kind="contact", at="tip.y", stiffness_n_m=1e5, gap_m=1e-4)


@pytest.fixture(scope="module", params=[0.0, 9.81])
def pair(request):
    """A chain, and the independent one."""
    weight = request.param
    return resonarm.Chain(LINKS, gravity_m_s2=weight or None), PlanarChain(LINKS, weight)


def test_modes_are_those_of_independent_equations(pair):
    chain, own = pair
    rest = own.rest()
    mass, stiffness = own.mass(rest), own.slope(rest)
    squares = np.sort(np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real)
    modes = chain.modes()
    np.testing.assert_allclose([mode.frequency_hz for mode in modes], np.sqrt(squares) / math.tau, rtol=1e-9)
    shapes = np.array([mode.shape for mode in modes]).T
    np.testing.assert_allclose(shapes.T @ mass @ shapes, np.eye(3), atol=1e-9)
    np.testing.assert_allclose(stiffness @ shapes, mass @ shapes * squares, rtol=1e-8)


def test_frequency_responses_are_those_of_independent_equations(pair):
    chain, own = pair
    rest, hz = own.rest(), np.array([[3.0, 11.0], [40.0, 160.0]])
    mass, stiffness, [x, y] = own.mass(rest), own.slope(rest), own.tip(rest)
    found = chain.frf(hz, drive="tip.x", at="tip.y", quantity="accelerance")
    turned = chain.frf(hz, drive="joint2")
    for index in np.ndindex(hz.shape):
        omega = math.tau * hz[index]
        dynamic = stiffness - omega**2 * mass + 1j * omega * own.damping
        np.testing.assert_allclose(found[index], -(omega**2) * y @ np.linalg.solve(dynamic, x), rtol=1e-9)
        np.testing.assert_allclose(turned[index], np.linalg.inv(dynamic)[1, 1], rtol=1e-9)
    assert chain.frf(3.0, drive="tip.x").shape == ()


def test_a_motion_is_that_of_independent_equations(pair):
    chain, own = pair
    rest, hz, force_n = own.rest(), 17.0, 900.0

    def rate(t_s, state):
        alpha, alpha_dot = state[:3], state[3:]
        load = (0.0, force_n * math.sin(math.tau * hz * t_s))
        return np.concatenate([alpha_dot, own.acceleration(rest + alpha, alpha_dot, load)])

    initial = [0.01, -0.02, 0.03, 0.2, 0.0, -0.5]
    expected = runge_kutta(rate, np.array(initial), 1 / 20_000, 300)[::30]
    motion = chain.simulate(
        0.015, drive={"tip.y": force_n}, frequency_hz=hz, initial=initial, rate_hz=4000, every=6, scheme="gl6"
    )
    np.testing.assert_allclose(motion["t_s"], np.arange(11) * 0.0015, rtol=1e-12)
    np.testing.assert_allclose(motion["alpha_rad"], expected[:, :3], rtol=0, atol=1e-8)
    np.testing.assert_allclose(motion["alpha_dot_rad_s"], expected[:, 3:], rtol=0, atol=1e-5)


def test_a_motion_with_a_contact_can_be_continued():
    chain = resonarm.Chain(
        LINKS, elements=[STOP, resonarm.Element(kind="friction", joint=3, stiffness_nm_rad=1e4, slip_torque_nm=1.0)]
    )
    whole = chain.simulate(0.04, initial=[0, 0, 0, 0, 0, 1.0])
    assert whole.dtype.names == ("t_s", "alpha_rad", "alpha_dot_rad_s", "element2_rad")
    assert abs(whole["element2_rad"]).max() == pytest.approx(1e-4), "the friction slips at its torque"
    middle = whole[len(whole) // 2]
    state = [*middle["alpha_rad"], *middle["alpha_dot_rad_s"], middle["element2_rad"]]
    rest = chain.simulate(0.02, initial=state)
    np.testing.assert_allclose(rest["alpha_rad"][-1], whole["alpha_rad"][-1], rtol=1e-9)


def test_a_branch_is_that_of_the_program(command):
    words = ["--drive", "tip.x=0.5", "--from-hz", 22.1, "--to-hz", 22.3, "--at", "joint2,tip.y"]
    document = command("continue", "--scenario", EXAMPLES / "hardening.toml", *words)
    chain = resonarm.Chain.from_scenario(EXAMPLES / "hardening.toml")
    branch = chain.continuation("frequency", 22.1, 22.3, drive={"tip.x": 0.5}, at=["joint2", "tip.y"])
    points = branch.points
    for name in ("value", "frequency_hz", "drive", "stable", "harmonics"):
        np.testing.assert_array_equal(points[name], [point[name] for point in document["points"]])
    read = [point["readings"]["joint2"] for point in document["points"]]
    np.testing.assert_array_equal(points["joint2_largest_rad"], [reading["largest"] for reading in read])
    harmonic = points["joint2_harmonic1_rad"]
    np.testing.assert_allclose(abs(harmonic), [reading["amplitude"] for reading in read], rtol=1e-12)
    np.testing.assert_allclose(np.angle(harmonic, deg=True), [reading["phase_deg"] for reading in read], rtol=1e-12)
    multipliers = np.array([point["multipliers"] for point in document["points"]]) @ [1, 1j]
    np.testing.assert_array_equal(points["multipliers"], multipliers)
    assert branch.bifurcations["kind"].tolist() == [found["kind"] for found in document["bifurcations"]]
    assert branch.bifurcations["kind"].tolist() == ["fold", "fold"]
    assert [peak["value"] for peak in document["peaks"]] == branch.peaks["value"].tolist()
    ax = branch.plot(Figure().subplots(), at="tip.y")
    assert ax.get_ylabel() == "largest displacement of tip.y (m)"
    assert repr(branch).startswith(f"<Branch in frequency, driven at tip.x: {len(points)} periodic responses")


def test_a_branch_that_ends_early_is_kept():
    chain = resonarm.Chain(LINKS, elements=[HARDENING])
    with pytest.raises(resonarm.EndedEarly, match="limit of 5 points") as raised:
        chain.continuation("amplitude", 0, 100, drive="joint1", frequency_hz=9.0, most_points=5)
    assert len(pickle.loads(pickle.dumps(raised.value)).branch.points) >= 5


def test_a_chain_from_urdf_is_that_of_the_scenario():
    section = resonarm.Scenario.load(EXAMPLES / "chain.toml").values()["structure"]
    chain = resonarm.Chain.from_urdf(
        EXAMPLES / "arm6.urdf", section["joints"], tip="tool0", gravity_m_s2=9.81, name="six-joint robot"
    )
    assert chain == resonarm.Chain.from_scenario(EXAMPLES / "chain.toml")
    assert repr(chain).startswith("<Chain 'six-joint robot': 6 links, 9.81 m/s² of gravity; 15.77 to ")
    with pytest.raises(FileNotFoundError, match=r"none\.urdf"):
        resonarm.Chain.from_urdf("none.urdf", section["joints"])


def test_a_run_has_the_states_of_the_chain(tmp_path):
    chain = resonarm.Chain.from_scenario(EXAMPLES / "chain.toml")
    profile = {"waveform": "dwell", "frequency_hz": 15.0, "duration_s": 0.2, "settle_s": 0.0}
    scenario = resonarm.Scenario.load(EXAMPLES / "chain.toml").replace(excitation={"profile": profile})
    assert scenario.structure == chain
    report = resonarm.run(scenario, record=tmp_path / "chain.mcap")
    recording, states = report.recording, report.recording.states
    assert states["alpha_rad"].shape == (len(states), 6)
    assert recording.resim()["identical"]
    table = recording.arrow("states")
    np.testing.assert_array_equal(table["alpha6_dot_rad_s"].to_numpy(), states["alpha_dot_rad_s"][:, 5])
    assert table.schema.field("alpha6_dot_rad_s").metadata == {b"unit": b"rad/s"}
    plant = resonarm.Plant(scenario)
    rows = plant.play(force_n=states["force_n"][:-1], torque_nm=states["torque_nm"][:-1])
    np.testing.assert_array_equal(rows["alpha_rad"], states["alpha_rad"][:-1])
    assert plant.states["alpha_rad"] == plant.alpha_rad == tuple(states["alpha_rad"][-1])
    assert len(recording.plot(Figure().subplots()).lines) == 6
    assert "6 links" in repr(scenario)


def test_a_plant_takes_torques_at_every_joint():
    scenario = resonarm.Scenario.load(EXAMPLES / "chain.toml")
    torque = np.zeros((40, 6))
    torque[:, 5] = 2 * np.sin(0.1 * np.arange(40))
    one_by_one = resonarm.Plant(scenario)
    for values in torque:
        one_by_one.advance(torque_nm=values)
    still = resonarm.Plant(scenario)
    still.play(torque_nm=np.zeros((40, 2)))
    assert one_by_one.alpha_rad != still.alpha_rad
    played = resonarm.Plant(scenario)
    played.play(torque_nm=torque)
    assert played.alpha_rad == one_by_one.alpha_rad
    with pytest.raises(resonarm.ResonarmError, match="torque7_nm is 1: nothing of the structure takes this load"):
        one_by_one.advance(torque_nm=(0, 0, 0, 0, 0, 0, 1))
    with pytest.raises(resonarm.ResonarmError, match="force_z_n is -2: nothing of the structure takes this load"):
        one_by_one.advance(force_n=(0, 0, -2))
    with pytest.raises(ValueError, match="it must be two to 8 finite numbers"):
        one_by_one.advance(torque_nm=(0,) * 9)
    with pytest.raises(ValueError, match=r"shape \(40, 9\): it must be \(samples, 2\), or up to \(samples, 8\)"):
        one_by_one.play(torque_nm=np.zeros((40, 9)))
    assert one_by_one.sample == 40


def test_a_plant_of_modes_has_no_angles():
    plant = resonarm.Plant(resonarm.Scenario.load(EXAMPLES / "friction.toml"))
    assert list(plant.states) == ["q_m_sqrt_kg", "q_dot_m_sqrt_kg_s", "element1_m", "element1_branch"]
    rows = plant.play(force_n=np.full((50, 2), [0.0, 40.0]))
    assert rows["q_m_sqrt_kg"].shape == (50, 2)
    assert rows["element1_m"].shape == (50,)
    assert repr(plant).startswith("<Plant at sample 50 (0.05 s): q = (")
    with pytest.raises(AttributeError, match="has no alpha_rad: its states are q_m_sqrt_kg, q_dot"):
        plant.alpha_rad  # noqa: B018


def test_chains_are_values():
    chain = resonarm.Chain(LINKS, elements=[STOP], initial=[0.1, 0, 0, 0, 0, 0], name="stop")
    again = pickle.loads(pickle.dumps(chain))
    assert (again, hash(again), again.name) == (chain, hash(chain), "stop")
    assert chain != resonarm.Chain(LINKS, elements=[STOP])
    assert chain.links == LINKS
    assert chain.dofs[-4:] == ["tip.y", "joint1", "joint2", "joint3"]
    assert chain.point_names == ["joint1", "joint2", "joint3", "tip"]
    assert chain.simulate(0.001)["alpha_rad"][0][0] == 0.1


def chain(**changes):
    return resonarm.Chain([{**LINKS[0], **changes}])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: resonarm.Chain([]), "`links` are missing"),
        (lambda: resonarm.Chain(LINKS * 3), "the structure has 9 links: it must have 1 to 8"),
        (lambda: chain(mass_kg=0), "link 1: `mass_kg` is 0: it must be"),
        (lambda: chain(mass=1), "Did you mean `mass_kg`?"),
        (lambda: chain(mass_kg=math.nan), "structure.links.mass_kg is NaN: it must be a number"),
        (lambda: resonarm.Chain(LINKS, elements=[{"kind": "gap", "at": "tip.x"}]), "`stiffness_n_m` is missing"),
        (lambda: resonarm.Chain(LINKS, initial=[1.0]), "structure.initial has 1 numbers: give 6"),
        (
            lambda: chain().frf(1.0, drive="tip.z"),
            "drive tip.z: there is no `tip.z` in this structure: expected one of tip.x",
        ),
        (lambda: chain().frf(1.0, drive="tip.x", at="elbow"), "at elbow: there is no `elbow`"),
        (lambda: chain().frf(-1.0, drive="tip.x"), "frequency -1 Hz: it must be zero or a positive number"),
        (lambda: chain().simulate(0.00033), "is 0.66 steps at 2000 Hz, not a whole number: choose 0.0005"),
        (lambda: chain().simulate(0.1, frequency_hz=3.0), "frequency_hz is 3: give the drive, too"),
        (
            lambda: chain().simulate(0.1, drive={"tip.x": 0}, frequency_hz=3),
            "drive['tip.x'] is 0: it must be a finite number other than 0",
        ),
        (lambda: chain().simulate(0.1, drive={"tip.x": 1}), "frequency_hz is missing: it must be a positive number"),
        (
            lambda: chain().simulate(0.1, initial=[0.0]),
            "initial has 1 numbers: give 2, the coordinates and their rates",
        ),
        (lambda: chain().simulate(0.1, initial=[0.0, math.inf]), "initial is inf at index 1"),
        (lambda: chain().simulate(1, rate_hz=5, scheme="rk4"), "its fastest mode needs a rate of at least"),
        (lambda: chain().continuation("mass", 1, 2, drive={"tip.x": 1}, frequency_hz=1), "parameter mass: "),
        (lambda: resonarm.Chain.from_scenario(EXAMPLES / "plate.toml"), "use Modal.from_scenario"),
    ],
)
def test_invalid_arguments_are_value_errors(call, message):
    with pytest.raises(ValueError) as raised:
        call()
    assert message in str(raised.value)
