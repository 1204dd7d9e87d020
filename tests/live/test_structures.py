"""Structures in the place of the arm in the live view: chains and modes, as they run and as they were recorded."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
import pyuff
from foxglove_schemas import published
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from live_view import Viewer, address, free_run, open_page
from mcap.reader import make_reader
from test_page import IN_ORDER
from test_stream import streamed

EXAMPLES = Path("examples/structures").resolve()
# Pictures of the pages stay where this says.
PICTURES = os.environ.get("RESONARM_PICTURES")

LENGTHS_M, ANGLES_RAD = np.array([0.5, 0.4, 0.3]), np.radians([60.0, -70.0, -50.0])
CHAIN = """
[structure]
kind = "chain"
name = "three links"
links = [
  { length_m = 0.5, mass_kg = 10.0, centre_of_mass_m = 0.2, inertia_kg_m2 = 0.3, angle_deg = 60.0,
    stiffness_nm_rad = 2e5, damping_nm_s_rad = 60.0 },
  { length_m = 0.4, mass_kg = 6.0, centre_of_mass_m = 0.2, inertia_kg_m2 = 0.1, angle_deg = -70.0,
    stiffness_nm_rad = 1e5, damping_nm_s_rad = 30.0 },
  { length_m = 0.3, mass_kg = 3.0, centre_of_mass_m = 0.1, inertia_kg_m2 = 0.05, angle_deg = -50.0,
    stiffness_nm_rad = 5e4, damping_nm_s_rad = 10.0 },
]
[excitation]
amplitude = { exciter_y = 50.0 }
profile = { waveform = "dwell", frequency_hz = 15.0, duration_s = 2.0, settle_s = 1.0 }
"""
BRACKET = f"""
[structure]
kind = "modal"
name = "bracket"
file = "{EXAMPLES}/bracket.uff"
nodes = {{ root = 1, mid = 2, knee = 3, tip = 4 }}
[[structure.elements]]
kind = "friction"
at = "mid.y"
stiffness_n_m = 2e3
slip_force_n = 0.5
[rig.sensors.b]
at = "mid"
[excitation]
amplitude = {{ exciter_y = 2.0 }}
profile = {{ waveform = "sine-list", frequencies_hz = [55.0, 60.0], dwell_s = 1.5, settle_s = 1.0 }}
"""


# The chain as an exciter draws it, which knows no coordinates.
AS_AN_EXCITER = """(() => {
    const { rows, rowsClipped, newest, about } = resonarm.data;
    const unknown = rows.map((row) => row.map((number, channel) => (channel < 10 ? number : NaN)));
    resonarm.views.structure.draw(unknown, rowsClipped, newest, about, 18, { toScale: false, slow: false });
    return document.getElementById('structure-scale').textContent;
})()"""


def chain(alpha):
    """Where the links of the chain end, by numbers of NumPy alone."""
    turned = np.cumsum(ANGLES_RAD + alpha)
    ends = np.cumsum(LENGTHS_M * np.array([np.cos(turned), np.sin(turned)]), axis=1).T
    return np.vstack([np.zeros(3), np.column_stack([ends, np.zeros(3)])])


def modal(q):
    """Where the nodes of the bracket are, as pyuff reads its file, by the names of BRACKET in their order."""
    sets = pyuff.UFF(str(EXAMPLES / "bracket.uff")).read_sets()
    (nodes,) = [one for one in sets if one["type"] == 15]
    places = np.array([nodes["x"], nodes["y"], nodes["z"]]).T
    modes = [one for one in sets if one["type"] == 55]
    for mode, q_mode in zip(modes, q, strict=True):
        places = places + q_mode / np.sqrt(mode["modal_m"]) * np.array([mode["r1"], mode["r2"], mode["r3"]]).T
    order = ["root", "mid", "knee", "tip"]
    return places[[order.index(name) for name in sorted(order)]]


def written(folder, text):
    scenario = folder / "scenario.toml"
    scenario.write_text(text)
    return scenario


def keep(page, folder, name):
    """A picture of the page, nothing of which lies on something else."""
    assert page.value(IN_ORDER) and page.errors == []
    page.picture(Path(PICTURES or folder) / name)


def drawn(page, coordinates, factor):
    """Where the page draws the points at these coordinates."""
    at = f"resonarm.views.structure.drawing.positions({json.dumps(list(coordinates))}, {factor})"
    return np.array(page.value(at))


def moves(page):
    """Waits until the followed point has been drawn at several places."""
    page.value("window.tips = new Set()")
    page.until("tips.add(resonarm.views.structure.tip.map(Math.round).join()).size > 5")


def test_a_chain_is_steered_and_drawn_where_its_kinematics_have_it(browser, programs, tmp_path):
    recording = tmp_path / "chain.mcap"
    run = free_run(programs, "--scenario", written(tmp_path, CHAIN), "--record", recording)
    page = open_page(browser, run, height=1500)
    assert page.text("#what").startswith("plant and exciter on ")
    assert "three links" in page.text("#what")
    assert page.text("#b-name") == "Acceleration of B, at joint2"
    page.value("resonarm.ask({ set: { load: 30, frequency_hz: 18, phase_deg: 0 } })")
    point = page.until("resonarm.data.points[0]")
    assert point["frequency_hz"] == 18 and abs(point["load"] - 30) < 0.1 and len(point["amplitude"]) == 4
    about = page.value("resonarm.data.about")
    assert about["channels"][10:] == ["alpha1_rad", "alpha2_rad", "alpha3_rad", "torque3_nm"]
    assert len(about["modes_hz"]) == 3
    assert [axis["label"] for axis in about["responses"]] == ["tip.x", "tip.y", "joint2.x", "joint2.y"]
    # Shown at first is what the load drives.
    assert page.value("document.querySelector('[name=response]:checked').value") == "1"
    assert [one["label"] for one in about["panels"]["coordinates"]] == ["α₁", "α₂", "α₃"]
    alpha = [2e-3, -1e-3, 3e-3]
    assert drawn(page, alpha, 50) == pytest.approx(chain(50 * np.array(alpha)), abs=1e-12)
    assert page.value(AS_AN_EXCITER) == "at rest: an exciter does not know the coordinates"
    moves(page)
    page.until("resonarm.data.times.length > 300 && resonarm.data.spectrum?.peak_hz")
    keep(page, tmp_path, "chain.png")
    assert run.stop() == 0
    # Again and again: on a busy machine the recorded seconds could be over before the page has drawn them.
    replay = programs.resonarm("replay", recording, "--live", "--loop", 0)
    replayed = open_page(browser, replay, height=1500)
    assert replayed.value("resonarm.data.about.role") == "recording"
    replayed.until("Math.max(...resonarm.data.largest[12]) > 1e-6 && resonarm.data.spectrum?.peak_hz")
    moves(replayed)
    keep(replayed, tmp_path, "chain-replayed.png")


def test_modes_of_a_uff_file_are_drawn_by_their_nodes_and_read_on_the_branch(browser, programs, tmp_path):
    recording = tmp_path / "bracket.mcap"
    run = programs.resonarm(
        "run", "--mode", "free", "--scenario", written(tmp_path, BRACKET), "--record", recording, "--json"
    )
    assert run.result()["outcome"] == "disarmed"
    page = open_page(browser, programs.resonarm("replay", recording, "--live"), height=1800)
    about = page.value("resonarm.data.about")
    assert about["drawing"]["points"] == ["knee", "mid", "root", "tip"]
    assert about["drawing"]["lines"] == [[2, 1, 0, 3]]
    assert about["modes_hz"] == pytest.approx([63.4, 212.25, 388.0])
    assert [one["unit"] for one in about["panels"]["coordinates"]] == ["m·√kg"] * 3
    assert [(one["label"], one["unit"]) for one in about["panels"]["elements"]] == [("element 1", "m")]
    q = [2e-4, -1e-4, 5e-5]
    assert drawn(page, q, 20) == pytest.approx(modal(20 * np.array(q)), abs=1e-12)
    page.until("resonarm.data.points.length === 2 && resonarm.data.branch")
    page.until("document.getElementById('play').textContent === 'Play'")
    # Of the fundamental, which is less by the held load's: sin(x)/x for x = π·60/1000.
    assert page.value("""(() => {
        const { branch, points } = resonarm.data;
        const lines = branch.stable.filter((point) => point !== null);
        const size = (hz) => {
            const k = lines.findIndex((point) => point[0] > hz);
            const [a, b] = [lines[k - 1], lines[k]];
            return a[2] + (b[2] - a[2]) * (hz - a[0]) / (b[0] - a[0]);
        };
        return points.every((point) => Math.abs(point.amplitude[1] / size(point.frequency_hz) - 1) < 0.03);
    })()""")
    page.until("resonarm.data.spectrum?.peak_hz")
    keep(page, tmp_path, "bracket.png")


def test_what_has_no_places_is_shown_without_a_drawing(browser, programs, tmp_path):
    run = free_run(programs, "--scenario", EXAMPLES / "plate.toml")
    page = open_page(browser, run, height=1500)
    assert page.value("document.getElementById('structure-choices').hidden")
    assert page.text("#structure-scale") == "not drawn" and page.pixels("#structure")["drawn"] > 0.001
    assert page.text("#modes").startswith("modes: ")
    about = page.value("resonarm.data.about")
    assert about["drawing"] is None
    # The x of an instrument at tip.z is z, and there is no y.
    assert [one["label"] for one in about["panels"]["acceleration_c"]] == ["z"]
    assert [axis["label"] for axis in about["responses"]] == ["tip.z", "middle.z"]
    page.value("resonarm.ask({ set: { load: 1, frequency_hz: 30, phase_deg: 0 } })")
    page.until("Math.max(...resonarm.data.largest[10].slice(-20)) > 1e-6 && resonarm.data.spectrum?.peak_hz")
    keep(page, tmp_path, "plate.png")


def scenes(messages, recording_states, positions, dt_ns):
    """Compares scenes with recorded states."""
    assert messages
    for time_ns, update in messages:
        published(SceneUpdate.DESCRIPTOR, update)
        (entity,) = update["entities"]
        assert entity["id"] == "structure"
        (pair,) = entity["metadata"]
        expected = positions(float(pair["value"]) * recording_states[round(time_ns / dt_ns)])
        found = np.array([[one["pose"]["position"][axis] for axis in "xyz"] for one in entity["spheres"]])
        assert found == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(("text", "positions"), [(CHAIN, chain), (BRACKET, modal)], ids=["chain", "modal"])
def test_scenes_of_structures_are_streamed_and_exported(programs, tmp_path, text, positions):
    recording, scenario = tmp_path / "run.mcap", written(tmp_path, text)
    run = programs.resonarm("run", "--mode", "free", "--scenario", scenario, "--duration-s", 0.4, "--record", recording)
    assert run.wait() == 0, run.stderr
    table = programs.resonarm("export", recording, "--to", "csv", "--parts", "states", "--out", tmp_path / "table")
    assert table.wait() == 0, table.stderr
    names, *lines = (tmp_path / "table-states.csv").read_text().splitlines()
    columns = dict(zip(names.split(","), np.genfromtxt(lines, delimiter=",").T, strict=True))
    coordinates = [name for name in columns if name.endswith(("_rad", "_m_sqrt_kg")) and not name.startswith("element")]
    states = np.array([columns[name] for name in coordinates]).T
    replay = programs.resonarm("replay", recording, "--live", "--wait", "--loop", 0)
    _, messages = streamed(replay, "foxglove.sdk.v1", "/structure", count=8)
    scenes(messages["/structure"], states, positions, 1e6)
    viewer = Viewer(*address(replay))
    # Loads beyond the first ten numbers are left out: with the last state, at which the recording ends, none is held.
    coordinates = slice(10, 10 + states.shape[1])
    assert np.isfinite(viewer.next("update", lambda update: update["rows"] > 0)["numbers"][:, coordinates]).all()
    exported = programs.resonarm(
        "export", recording, "--to", "foxglove", "--moving-arm", 20, "--to-s", 0.05, "--out", tmp_path / "x"
    )
    assert exported.wait() == 0, exported.stderr
    with (tmp_path / "x-foxglove.mcap").open("rb") as stream:
        copies = list(make_reader(stream, validate_crcs=True).iter_messages(topics=["/structure"]))
    # At 1 kHz, both ends of the range included.
    assert len(copies) == 51
    scenes([(message.log_time, json.loads(message.data)) for _, _, message in copies], states, positions, 1e6)


def test_a_load_that_nothing_takes_is_not_steered(programs, tmp_path):
    scenario = written(tmp_path, CHAIN + '[rig.exciter]\nat = "tip.x"\n')
    run = free_run(programs, "--scenario", scenario)
    assert run.wait() == 2
    assert run.stderr == (
        "resonarm: the load has `exciter_y` = 50, but the structure accepts only `joint1`, `joint2`, `joint3`, "
        "`exciter_x` at tip.x; choose one of these, or place the exciter elsewhere by `rig.exciter.at`\n"
    )
