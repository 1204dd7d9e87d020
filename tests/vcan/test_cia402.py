"""The plant as CANopen drives, commanded by the package `canopen`, which knows nothing of Resonarm."""

import math
import sys
import threading
from pathlib import Path

import canopen
import numpy as np
import pytest
from canopen.profiles.p402 import BaseNode402
from cia402_master import MODE, PATIENCE_S, Master, patient
from linear_arm import LinearArm
from processes import RESONARM, run, wait_until
from recordings import LOAD, Recording
from wire import log

GEAR, COUNTS = 100.0, 1 << 20
COUNTS_PER_RAD = GEAR * COUNTS / (2 * math.pi)
# A target of 1 is a thousandth of 1 N·m of the motor.
STEP_NM = 1e-3 * GEAR
# Control word and target, and position and velocity, of the drive of joint 1.
RPDO1, TPDO2 = 0x201, 0x281

# A busy machine may stop either end for 150 ms at any moment.
SCENARIO = f"""
[simulation]
rate_hz = %s
[network]
lockstep_timeout_s = 60.0
command_timeout_s = 5.0
[wire]
preset = "cia402"
timeout_s = 5.0
lockstep = "sync"
drives = [
    {{ node_id = 1, joint = 1, gear_ratio = {GEAR}, rated_torque_nm = 1.0, encoder_counts_per_turn = {COUNTS} }},
    {{ node_id = 2, joint = 2, gear_ratio = {GEAR}, rated_torque_nm = 1.0, encoder_counts_per_turn = {COUNTS} }},
]
"""


@pytest.fixture
def drives(tmp_path):
    """Makes a scenario of a sample rate; its path, and the data sheets of its drives by their node ids."""

    def make(rate_hz):
        scenario = tmp_path / "scenario.toml"
        scenario.write_text(SCENARIO % rate_hz)
        sheets = {number: tmp_path / f"{number}.eds" for number in (1, 2)}
        for number, path in sheets.items():
            path.write_text(run(RESONARM, "protocol", "eds", "--scenario", scenario, "--node-id", number))
        return scenario, sheets

    return make


def start(programs, scenario, mode, path):
    dump = programs.candump()
    plant = programs.resonarm(
        "run", "--bus", "vcan0", "--mode", mode, "--scenario", scenario, "--record", path, "--json", "--json-events"
    )
    # Its boot-up messages.
    wait_until(lambda: "701#00" in dump.stdout and "702#00" in dump.stdout, "the drives to boot")
    return plant


def torques_of(path):
    """Torques at the joints, a row a sample."""
    return Recording.whole(path).states[:, 4:6]


def test_a_master_drives_both_joints_sample_by_sample(programs, drives, tmp_path):
    scenario, sheets = drives(1000)
    plant = start(programs, scenario, "lockstep", tmp_path / "run.mcap")
    held = np.array([500, 200])
    # A slow rise and a rest, so that nothing swings; then a sine.
    rise = [0.5 - 0.5 * math.cos(math.pi * n / 400) for n in range(400)] + [1.0] * 200
    sine = [(round(300 * math.sin(0.1 * n)), round(-100 * math.sin(0.07 * n))) for n in range(200)]
    with Master("vcan0", sheets) as master:
        master.set_up()
        master.arm()
        assert [node.op_mode for node in master.nodes] == [MODE] * 2
        rested = [master.cycle([round(part * target) for target in held]) for part in rise][-200:]
        for targets in sine:
            master.cycle(targets)
        # Refused: beyond the exciter's limit. It never acts.
        master.cycle([30000, 0])
        for node in master.nodes:
            node.state = "SWITCH ON DISABLED"
    assert plant.stop() == 0
    report = plant.result()
    assert {name for name, count in report["refused"].items() if count} == {"out_of_range"}
    deflection = np.mean(rested, axis=0) / COUNTS_PER_RAD
    expected = held * STEP_NM / np.diag(LinearArm(0.0, 60.0).stiffness)
    assert deflection == pytest.approx(expected, rel=1e-3)
    torques = torques_of(tmp_path / "run.mcap")
    first = next(n for n, row in enumerate(torques) if row.any())
    wanted = STEP_NM * np.array([[round(part * target) for target in held] for part in rise] + list(sine))
    skipped = next(n for n, row in enumerate(wanted) if row.any())
    wanted = wanted[skipped:]
    assert np.abs(torques[first : first + len(wanted)] - wanted).max() < 1e-9
    assert np.abs(torques).max() <= 50.0 + 1e-9


def test_a_killed_master_is_a_fault_of_both_drives(programs, drives, tmp_path):
    scenario, sheets = drives(200)
    plant = start(programs, scenario, "real-time", tmp_path / "run.mcap")
    script = Path(__file__).with_name("cia402_master.py")
    master = programs.start("master", sys.executable, script, "vcan0", *sheets.values())
    wait_until(lambda: master.stdout.count("\n") > 100, "100 cycles of the master")
    emergencies, both = {}, threading.Event()
    with canopen.Network() as network:
        network.connect(interface="socketcan", channel="vcan0")
        nodes = [network.add_node(BaseNode402(number, str(path))) for number, path in sheets.items()]
        for node in nodes:
            patient(node)

            def arrived(entry, number=node.id):
                emergencies.setdefault(number, entry)
                if len(emergencies) == 2:
                    both.set()

            node.emcy.add_callback(arrived)
        master.kill()
        assert both.wait(PATIENCE_S)
        # The RPDO timeout of CiA 301.
        assert [emergencies[number].code for number in (1, 2)] == [0x8250] * 2
        for node in nodes:
            wait_until(lambda node=node: node.sdo[0x6041].raw & 0x4F == 0x08, "the end of the fault reaction")
            assert node.sdo[0x603F].raw == 0x8250
            assert node.sdo[0x6077].raw == 0
            # Enabling is no way out of a fault.
            for controlword in (0x06, 0x07, 0x0F):
                node.sdo[0x6040].raw = controlword
            assert node.sdo[0x6041].raw & 0x4F == 0x08
        for node in nodes:
            node.nmt.state = "OPERATIONAL"
            node.setup_402_state_machine()
            node.check_statusword()
            assert node.is_faulted()
            node.reset_from_fault()
            assert node.state == "OPERATION ENABLED"
            node.state = "SWITCH ON DISABLED"
            assert node.sdo[0x603F].raw == 0
    assert plant.stop() == 0
    torques = torques_of(tmp_path / "run.mcap")
    assert np.abs(torques[:, 0]).max() > 30.0
    assert not torques[-10:].any()


def test_what_a_master_may_not_do_is_aborted(programs, drives, tmp_path):
    scenario, sheets = drives(200)
    plant = start(programs, scenario, "real-time", tmp_path / "run.mcap")
    with Master("vcan0", sheets) as master:
        node = master.nodes[0]
        assert node.sdo[0x1008].raw == "Resonarm joint 1"
        assert node.sdo[0x1000].raw == 0x0002_0192
        for index, value, code in [
            (0x6041, 1, 0x0601_0002),
            (0x6060, 8, 0x0609_0030),
        ]:
            with pytest.raises(canopen.SdoAbortedError) as aborted:
                node.sdo[index].raw = value
            assert aborted.value.code == code
        with pytest.raises(canopen.SdoAbortedError) as aborted:
            node.sdo.upload(0x2000, 0)
        assert aborted.value.code == 0x0602_0000
        # A mapping of the master's own.
        node.nmt.state = "OPERATIONAL"
        node.tpdo.read()
        node.tpdo[3].clear()
        node.tpdo[3].add_variable(0x6077)
        node.tpdo[3].add_variable(0x6064)
        node.tpdo[3].trans_type = 2
        node.tpdo[3].enabled = True
        node.tpdo[3].save()
        arrived = []
        node.tpdo[3].add_callback(lambda pdo: arrived.append(len(pdo.data)))
        for _ in range(2):
            master.network.sync.transmit()
        wait_until(lambda: arrived == [6], "the PDO")
    assert plant.stop() == 0


def test_the_example_of_the_documents_runs(programs, tmp_path):
    text = (Path(__file__).parents[2] / "docs" / "canopen.md").read_text()
    blocks = {name: text.split(f"```{name}\n")[1].split("```")[0] for name in ("toml", "python")}
    scenario, example = tmp_path / "drives.toml", tmp_path / "example.py"
    # The example as it stands, but for the patience of a test with a busy machine.
    assert "timeout_s = 0.5" in blocks["toml"]
    scenario.write_text(blocks["toml"].replace("timeout_s = 0.5", "timeout_s = 20.0"))
    sheet = run(RESONARM, "protocol", "eds", "--scenario", scenario, "--node-id", 1)
    (tmp_path / "joint1.eds").write_text(sheet)
    code = blocks["python"].replace('"can0"', '"vcan0"').replace("joint1.eds", str(tmp_path / "joint1.eds"))
    folder = Path(__file__).parent
    code = f"import sys\nsys.path.insert(0, {str(folder)!r})\n" + code
    code = code.replace("drive.nmt.state =", "from cia402_master import patient\npatient(drive)\ndrive.nmt.state =", 1)
    example.write_text(code)
    dump = programs.candump()
    plant = start(programs, scenario, "real-time", tmp_path / "run.mcap")
    master = programs.start("example", sys.executable, example)
    assert master.wait() == 0, master.stderr
    assert plant.stop() == 0
    assert plant.result()["fault"] is None
    frames = log(dump)
    sent = [int.from_bytes(frame.data[:4], "little", signed=True) for frame in frames if frame.id == TPDO2]
    positions = {int(line) for line in master.stdout.split()}
    assert positions <= {*sent, 0}, "each is of a PDO of the drive"
    # A target, N·m/10, acts until the next one, and no other torque does.
    targets = [int.from_bytes(frame.data[2:4], "little", signed=True) for frame in frames if frame.id == RPDO1]
    loads = np.concatenate(Recording.whole(tmp_path / "run.mcap").batches("/plant/steps", LOAD))
    assert 0.0 < np.abs(loads[:, 0]).max() < 0.1 * max(map(abs, targets)) + 1e-9
    # 50 N·m turn joint 1 by 90 µrad, 1503 counts, and it swings beyond. How many targets the master sends in 5 s, and how near
    # to the peaks of its sine, depends on the machine. The last one acts after the last position.
    for largest in (max, min):
        assert abs(largest(sent)) > 0.8 * 3.006 * abs(largest(targets[:-1])) > 0.0
