"""The FD profile, several networks on one interface, and nodes that are there twice."""

import json
import socket
import struct
import subprocess
from collections import Counter

import cantools
import numpy as np
import pytest
from conftest import free
from e2e.p05 import e2e_p05_check
from processes import RESONARM, Programs, run, wait_until
from recordings import Recording, bits

SCENARIO = """
[network]
base_id = %d
plant_id = %d
exciter_id = %d
profile = "%s"
[structure]
angles_deg = [30.0, 60.0]
[excitation]
amplitude = { exciter_x = %g }
ramp_s = 0.1
profile = { waveform = "dwell", frequency_hz = 11.3, duration_s = %g, settle_s = 0.1 }
"""
# Base, node ids, profile and force of each bench.
BENCHES = [(0x200, 1, 2, "classic", 100.0), (0x300, 3, 4, "fd", 200.0)]


def flags(bench):
    base, plant_id, exciter_id, profile, _ = bench
    return ["--base", hex(base), "--plant-id", str(plant_id), "--exciter-id", str(exciter_id), "--profile", profile]


@pytest.fixture(scope="module")
def side_by_side(tmp_path_factory):
    """Two benches in lockstep on vcan0 at once: what each came to, its recording and that of a free run, and the
    log."""
    folder = tmp_path_factory.mktemp("side_by_side")
    benches = []
    with Programs() as programs:
        dump = programs.candump()
        for number, bench in enumerate(BENCHES):
            scenario, path = folder / f"{number}.toml", folder / f"{number}.mcap"
            scenario.write_text(SCENARIO % (*bench, 2.0))
            common = ["--bus", "vcan0", "--mode", "lockstep", "--scenario", scenario, "--json"]
            plant = programs.resonarm("run", *common, "--stop-on-disarm", "--record", path)
            benches.append((scenario, path, plant, programs.resonarm("exciter", *common)))
        results = [(plant.result(), exciter.result()) for *_, plant, exciter in benches]
        dump.settle()
        dump.stop()
        log = dump.stdout
    recordings = []
    for number, (scenario, path, *_) in enumerate(benches):
        (folder / f"free{number}").mkdir()
        recordings.append((Recording.whole(path), free(folder / f"free{number}", scenario).recording))
    return results, recordings, log


def test_benches_side_by_side_are_each_as_if_alone(side_by_side):
    results, recordings, _ = side_by_side
    for plant, exciter in results:
        assert exciter["outcome"] == "finished" and exciter["missed_samples"] == 0
        assert (plant["bus"]["refused"], exciter["bus"]["refused"]) == (0, 0)
    for together, alone in recordings:
        assert np.abs(together.states).max(axis=0)[:2].min() > 1e-5
        assert np.array_equal(bits(together.states), bits(alone.states))


@pytest.mark.parametrize("number", range(2))
def test_the_program_decodes_each_network_from_the_log_of_both(side_by_side, number):
    results, _, log = side_by_side
    command = [RESONARM, "protocol", "decode", "--json", *flags(BENCHES[number])]
    found = json.loads(subprocess.run(command, input=log, capture_output=True, text=True, check=True).stdout)
    counts = found["counts"]
    plant, exciter = results[number]
    assert (counts["refused"], counts["lost"]) == (0, 0)
    assert counts["taken"] == plant["bus"]["sent"] + exciter["bus"]["sent"]
    names = Counter(row.get("message") for row in found["frames"])
    assert ("Sensors" in names) == (BENCHES[number][3] == "fd") and names["ForceCommand"] > 1900


def test_cantools_and_autosar_e2e_read_the_fd_profile(side_by_side):
    _, recordings, log = side_by_side
    dbc = cantools.database.load_string(run(RESONARM, "protocol", "dbc", *flags(BENCHES[1])), "dbc", strict=True)
    sensors = dbc.get_message_by_name("Sensors")
    read = []
    for line in log.splitlines():
        identifier, _, data = line.split()[2].partition("##")
        if data and int(identifier, 16) == sensors.frame_id:
            # One digit of flags, of which the lowest is the bit rate switch.
            assert int(data[0], 16) & 1
            data = bytearray.fromhex(data[1:])
            assert e2e_p05_check(data, sensors.dbc.attributes["E2EDataId"].value)
            read.append(sensors.decode(bytes(data)))
    assert [sample["sample"] for sample in read] == list(range(len(read))) and len(read) > 2000
    forces = np.array([sample["force_x_n"] for sample in read])
    recorded = np.array(recordings[1][0].samples)[: len(forces), 4]
    # The wire rounds to singles, and nothing else is between the two.
    assert np.array_equal(recorded.astype(np.float32), forces.astype(np.float32)) and forces.max() > 190


def test_a_second_exciter_and_the_first_both_stop(tmp_path, programs):
    scenario = tmp_path / "long.toml"
    scenario.write_text(SCENARIO % (*BENCHES[1], 600.0))
    common = ["--bus", "vcan0", "--mode", "lockstep", "--scenario", scenario, "--json"]
    dump = programs.candump()
    plant = programs.resonarm("run", *common, "--record", tmp_path / "twice.mcap")
    first = programs.resonarm("exciter", *common)
    wait_until(lambda: len(dump.stdout.split(" vcan0 301##")) > 60, "60 commands")
    second = programs.resonarm("exciter", *common)
    found = [exciter.result(code=1) for exciter in (first, second)]
    plant.stop()
    assert [(end["outcome"], end["fault"]["code"]) for end in found] == [("faulted", 13)] * 2
    assert "another node sends this node's messages (identifier 0x" in found[0]["reason"]
    states = Recording.whole(tmp_path / "twice.mcap").states
    assert np.abs(states[:, 4:]).max() > 190 and not states[-1, 4:].any()


def test_an_interface_without_can_fd_is_refused_with_the_way_to_mend_it(tmp_path, programs, interface):
    run("ip", "link", "set", interface, "down")
    run("ip", "link", "set", interface, "mtu", "16", "up")
    scenario = tmp_path / "fd.toml"
    scenario.write_text(SCENARIO % (*BENCHES[1], 1.0))
    plant = programs.resonarm("run", "--bus", interface, "--mode", "lockstep", "--scenario", scenario)
    assert plant.wait() == 3
    assert f"{interface} is not configured for CAN FD frames" in plant.stderr and "mtu 72" in plant.stderr


def test_two_plants_at_one_base_say_so_and_continue(tmp_path, programs):
    """Their node ids differ, so that each refuses what the other sends."""
    plants = []
    for plant_id in (1, 3):
        scenario, path = tmp_path / f"{plant_id}.toml", tmp_path / f"{plant_id}.mcap"
        scenario.write_text(SCENARIO % (0x200, plant_id, plant_id + 1, "classic", 10.0, 600.0))
        common = ["--bus", "vcan0", "--mode", "lockstep", "--scenario", scenario, "--json"]
        plants.append((programs.resonarm("run", *common, "--json-events", "--record", path), path))
    wait_until(lambda: all('"other-sender"' in plant.stderr for plant, _ in plants), "both to notice the other")
    for plant, path in plants:
        events = [json.loads(line) for line in plant.stderr.splitlines() if '"other-sender"' in line]
        # A hello a second is all that an idle plant in lockstep sends beside its heartbeats.
        assert [event["identifier"] for event in events] == [0x206]
        plant.stop()
        bus = json.loads(plant.stdout)["bus"]
        assert bus["other_sender"] == bus["refused"] > 0
        assert f"{bus['other_sender']} frames of another network" in plant.stderr
        found = programs.resonarm("inspect", path, "--json").result()
        assert found["other_sender_frames"] == bus["other_sender"]
        assert [problem["kind"] for problem in found["problems"]] == ["other sender"]


def test_what_is_neither_recorded_nor_watched_is_filtered_by_the_kernel(tmp_path, programs):
    """The recording has the frames of others; an exciter, and a plant without a recording, are not woken for them."""
    scenario = tmp_path / "short.toml"
    scenario.write_text(SCENARIO % (0x200, 1, 2, "classic", 10.0, 1.0))
    common = ["--bus", "vcan0", "--mode", "lockstep", "--scenario", scenario, "--json"]
    for record in ([], ["--record", tmp_path / "run.mcap"]):
        plant = programs.resonarm("run", *common, "--json-events", "--stop-on-disarm", *record)
        wait_until(lambda plant=plant: '"ready"' in plant.stderr, "the plant")
        with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as raw:
            raw.bind(("vcan0",))
            for _ in range(20):
                raw.send(struct.pack("=IB3x8s", 0x123, 1, bytes(8)))
        exciter = programs.resonarm("exciter", *common)
        played, ran = exciter.result(), plant.result()
        assert played["outcome"] == "finished" and ran["bus"]["sent"] > 1000
        # One end receives all that the other has sent, except frames from before it listened.
        assert ran["bus"]["received"] <= played["bus"]["sent"] + (20 if record else 0)
        foreign = Recording.whole(record[1]).frames_of(1, 0x123) if record else []
        assert (len(foreign), ran["bus"]["received"] > played["bus"]["sent"]) == ((20, True) if record else (0, False))
        assert played["bus"]["received"] <= ran["bus"]["sent"]


@pytest.mark.parametrize("record", [True, False])
def test_a_frame_that_can_t_be_one_ends_nothing(tmp_path, programs, record):
    """One of CAN FD with 9 bytes, which a virtual interface carries."""
    plant = programs.resonarm(
        "run", "--bus", "vcan0", "--mode", "lockstep", "--json", "--json-events",
        *(["--record", tmp_path / "run.mcap"] if record else []),
    )  # fmt: skip
    wait_until(lambda: '"ready"' in plant.stderr, "the plant")
    with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as raw:
        raw.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 1)
        raw.bind(("vcan0",))
        raw.send(struct.pack("=IB3x64s", 0x201, 9, bytes(9)))
    exciter = programs.resonarm("exciter", "--bus", "vcan0", "--mode", "lockstep")
    wait_until(lambda: '"armed"' in plant.stderr, "the plant to be armed")
    exciter.stop()
    assert plant.stop() == 0, plant.stderr
    assert plant.result()["bus"]["malformed"] == 1
