"""The robot arm of the presets, against independent equations."""

import pickle

import numpy as np
import pytest
from linear_arm import LinearArm

import resonarm

POSES = [(0.0, 60.0), (35.0, -110.0)]


@pytest.mark.parametrize("angles_deg", POSES)
def test_modes_are_those_of_independent_equations(angles_deg):
    modes = resonarm.Chain.preset(angles_deg=angles_deg).modes()
    expected = LinearArm(*angles_deg).natural_frequencies_hz()
    np.testing.assert_allclose([mode.frequency_hz for mode in modes], expected, rtol=1e-9)


@pytest.mark.parametrize("angles_deg", POSES)
def test_frequency_responses_are_those_of_independent_equations(angles_deg):
    arm, linear = resonarm.Chain.preset(angles_deg=angles_deg), LinearArm(*angles_deg)
    hz = np.array([[5.0, 15.0], [30.0, 77.0]])
    found = [
        arm.frf(hz, drive="tip.y", at=at, quantity="accelerance") for at in ("joint2.x", "joint2.y", "tip.x", "tip.y")
    ]
    for index in np.ndindex(hz.shape):
        expected = linear.accelerations(hz[index], (0.0, 1.0))
        np.testing.assert_allclose([of[index] for of in found], expected, rtol=1e-9)
    assert arm.frf(15.0, drive="joint1").shape == ()


def test_a_motion_can_be_continued():
    arm = resonarm.Chain.preset()
    whole = arm.simulate(0.2, initial=(0.01, 0, 0, 0))
    middle = whole[len(whole) // 2]
    rest = arm.simulate(0.1, initial=(*middle["alpha_rad"], *middle["alpha_dot_rad_s"]))
    assert (rest["alpha_rad"][-1] == whole["alpha_rad"][-1]).all()
    assert len(arm.simulate(0.2, every=100)) == 1 + 4


def test_parameters_are_those_of_the_preset_unless_replaced():
    arm = resonarm.Chain.preset("irb1600-table1", angles_deg=(10, 75))
    assert arm.parameter("link2.inertia_kg_m2") == (0.0009, "kg·m²")
    assert [arm.parameter(f"link{k}.angle_deg") for k in (1, 2)] == [(10.0, "°"), (75.0, "°")]
    heavier = arm.replace({"link2.mass_kg": 40, "link1.damping_nm_s_rad": 2.5})
    assert (heavier.parameter("link2.mass_kg"), heavier.links[0]["damping_nm_s_rad"]) == ((40.0, "kg"), 2.5)
    assert heavier != arm and heavier.replace(dict.fromkeys(["link2.mass_kg"], arm.links[1]["mass_kg"])) != arm
    assert heavier.replace({name: arm.parameter(name)[0] for name in arm.parameters}).modes() == arm.modes()
    assert repr(heavier).startswith("<Chain 'irb1600-table1': 2 links; ")
    again = pickle.loads(pickle.dumps(heavier))
    assert (again, again.modes()) == (heavier, heavier.modes())


def test_gravity_asks_for_what_a_preset_does_not_state():
    arm = resonarm.Chain.preset()
    for values in ({"gravity_m_s2": 9.81}, {"link1.centre_of_mass_m": 0.1}):
        with pytest.raises(ValueError, match=r"give .*link1\.mass_kg, .*link1\.inertia_kg_m2; .*0\.55 kg·m²"):
            arm.replace(values)
    link1 = {"link1.mass_kg": 40, "link1.centre_of_mass_m": 0.1, "link1.inertia_kg_m2": 0.15}
    heavy = arm.replace({"gravity_m_s2": 9.81, **link1})
    assert (heavy.gravity_m_s2, heavy.links[0]["mass_kg"]) == (9.81, 40.0)
    # What is stated once stays, and a chain of the same links is the same.
    light = heavy.replace({"gravity_m_s2": 0})
    assert light == resonarm.Chain(light.links, name="irb1600-fitted")
    np.testing.assert_allclose(
        [mode.frequency_hz for mode in light.modes()], [mode.frequency_hz for mode in arm.modes()], rtol=1e-12
    )


def test_parameters_of_elements_and_modes_are_replaced():
    stop = resonarm.Element(kind="contact", at="tip.x", stiffness_n_m=1e5, gap_m=1e-4)
    mode = resonarm.ModeShape(frequency_hz=20.0, damping_ratio=0.01, shape={"tip.x": 1.0})
    modal = resonarm.Modal([mode], elements=[stop]).replace({"element1.gap_m": 0.002, "mode1.damping_ratio": 0.02})
    assert modal == resonarm.Modal([{**mode, "damping_ratio": 0.02}], elements=[{**stop, "gap_m": 0.002}])
    with pytest.raises(ValueError, match=r"mode1\.frequency_hz, mode1\.damping_ratio, element1\.stiffness_n_m"):
        modal.replace({"link1.mass_kg": 1.0})


def test_a_value_that_a_scenario_sets_is_replaced():
    section = {**resonarm.Chain.preset().section, "set": {"link2.mass_kg": 40.0}}
    chain = resonarm.Scenario().replace(structure=section).structure
    assert chain.parameter("link2.mass_kg") == (40.0, "kg")
    assert chain.replace({"link2.mass_kg": 45}).parameter("link2.mass_kg") == (45.0, "kg")


def test_a_scenario_without_a_structure_has_the_arm():
    scenario = resonarm.Scenario()
    assert scenario.structure == resonarm.Chain.preset() == resonarm.Structure.from_scenario(scenario)
    section = {"angles_deg": [0, 75], "set": {"link2.mass_kg": 40}, "initial": [0.1, 0, 0, 0]}
    chain = scenario.replace(structure=section).structure
    assert chain.name == "irb1600-fitted" and chain.section["initial"] == [0.1, 0.0, 0.0, 0.0]
    expected = resonarm.Chain.preset(angles_deg=(0, 75)).replace({"link2.mass_kg": 40})
    assert chain.links == expected.links
    spring = resonarm.Element(kind="cubic", joint=2, stiffness3_nm_rad3=1e7)
    with_element = scenario.replace(structure={"elements": [spring]}).structure
    assert with_element == resonarm.Chain.preset(elements=[spring])
    # The section of a chain is whole: what was set before does not stay.
    assert scenario.replace(structure=section).replace(structure=with_element.section).structure == with_element
    run = scenario.replace(structure=with_element.section, simulation={"duration_s": 0.1})
    assert run.structure == with_element
    rows = resonarm.Plant(run).play(force_n=np.full((20, 2), 10.0))
    assert rows["alpha_rad"].shape == (20, 2) and rows["alpha_rad"][-1].any()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: resonarm.Chain.preset("irb"), "there is no preset `irb`: expected one of irb1600-table1, irb1600-fit"),
        (lambda: resonarm.Chain.preset(angles_deg=(0, 400)), "angle_deg"),
        (lambda: resonarm.Chain.preset(angles_deg=(0, 1, 2)), "angles_deg has 3 numbers: give 2"),
        (lambda: resonarm.Chain.preset().replace({"link3.mass_kg": 1}), "link1.length_m, link1.mass_kg"),
        (lambda: resonarm.Chain.preset().replace({"link2.mass_kg": -1}), "link 2: `mass_kg` is -1: it must be"),
    ],
)
def test_invalid_arguments_are_value_errors(call, message):
    with pytest.raises(ValueError) as raised:
        call()
    assert message in str(raised.value)


def test_a_structure_is_a_chain_or_a_modal():
    with pytest.raises(TypeError, match=r"make a resonarm\.Chain or a resonarm\.Modal"):
        resonarm.Structure()
    with pytest.raises(TypeError, match="must be a number"):
        resonarm.Chain.preset().replace({"link2.mass_kg": "forty"})
