"""Plant, exciter and bus as CAN FMUs, joined by their terminals: the bits of `resonarm run --mode free`."""

import random
import subprocess
import zipfile
from collections import Counter
from functools import cache
from types import SimpleNamespace

import fmpy
import numpy as np
import pytest
import xmlschema
from fmpy.validation import validate_fmu

from bus_master import Master, MasterError, operations
from conftest import free_run
from fmus import export, same
from processes import RESONARM
from recordings import Recording

# Damped so that the walk over the resonance at 22.16 Hz, in three points, takes 15 s of simulated time.
WALK = """
structure.angles_deg = [30.0, 60.0]
structure.set = {{ "link1.damping_nm_s_rad" = 60.0, "link2.damping_nm_s_rad" = 60.0 }}
simulation = {{ rate_hz = {rate_hz}, seed = 2{duration} }}
network = {{ profile = "{profile}", {network} }}
[control]
law = "phase-walk"
amplitude = {{ exciter_x = 200.0 }}
points = 3
from_lag_deg = 60.0
to_lag_deg = 120.0
"""
TRANSMIT, CONFIRM, BUS_ERROR, CONFIGURATION, STATUS = 0x10, 0x20, 0x31, 0x40, 0x41
NODES, ALL = ("plant", "exciter"), ("plant", "exciter", "bus")
RATE = "bit_rate_hz = 1000000"


@pytest.fixture(scope="module")
def walk(make, tmp_path_factory):
    """Makes the FMUs of a walk and its native run."""

    @cache
    def walk(profile="classic", network="", rate_hz=1000, duration_s=0.2, clock="triggered", roles=NODES, runs=True):
        folder = tmp_path_factory.mktemp("walk")
        duration = f", duration_s = {duration_s}" if duration_s else ""
        text = WALK.format(profile=profile, network=network, rate_hz=rate_hz, duration=duration)
        (folder / "walk.toml").write_text(text)
        fmus = {}
        for role in roles:
            kind = "countdown" if role == "bus" else clock
            flags = ("--interface", "can", "--role", role, "--clock", kind)
            fmus[role] = make(folder / "walk.toml", *flags, name=role)
        if not runs:
            return SimpleNamespace(**fmus)
        native = free_run(folder / "walk.toml", folder / "native.mcap")
        # After its last sample a native run of stated length disarms the plant, while the load ramps to zero.
        samples = round(rate_hz * duration_s) + 1 if duration_s else len(native.states)
        return SimpleNamespace(**fmus, native=native.states[:samples, :4], period_ns=round(1e9 / rate_hz))

    return walk


def joined(fmus, order=NODES, **parameters):
    """A master with the FMUs joined, by the bus if there is one."""
    master = Master()
    ends = {role: master.add(getattr(fmus, role), **(parameters if role == "plant" else {})) for role in order}
    if "bus" in ends:
        for number, role in enumerate([role for role in ("plant", "exciter") if role in ends], start=1):
            master.join(ends[role]["can"], ends["bus"][f"node{number}"])
    else:
        master.join(ends["plant"]["can"], ends["exciter"]["can"])
    master.plant = ends["plant"]["can"].slave
    return master


def follow(master, fmus):
    """The states at every sample of the native run."""
    master.start()
    rows = [master.plant.getFloat64(fmus.plant.states)]
    for sample in range(1, len(fmus.native)):
        master.advance(sample * fmus.period_ns)
        rows.append(master.plant.getFloat64(fmus.plant.states))
    return np.array(rows)


@pytest.mark.parametrize(
    ("profile", "clock"), [("classic", "triggered"), ("fd", "triggered"), ("classic", "countdown")]
)
def test_plant_and_exciter_joined_give_the_bits_of_a_free_run(walk, profile, clock, tmp_path):
    fmus = walk(profile=profile, clock=clock, duration_s=0.5)
    master = joined(fmus, recording=str(tmp_path / "run.mcap"))
    rows = follow(master, fmus)
    assert np.abs(rows).max() > 1e-5 and master.plant.getUInt64(fmus.plant.of("node.state")) == [5]
    master.plant.terminate()
    master.end()
    assert same(rows, fmus.native)
    for words in (["resim"], ["resim", "--readings"]):
        done = subprocess.run([RESONARM, *words, str(tmp_path / "run.mcap"), "--json"], capture_output=True, text=True)
        assert done.returncode == 0 and '"identical":true' in done.stdout, done
    recorded = Recording.whole(tmp_path / "run.mcap")
    assert same(recorded.states[:, :4], rows) and len(recorded.frames) >= 2 * len(rows)


def test_by_the_bus_they_walk_over_the_resonance_with_the_bits_of_a_free_run(walk):
    fmus = walk(profile="fd", network=RATE, rate_hz=250, duration_s=None, roles=ALL)
    master = joined(fmus, ALL)
    rows = follow(master, fmus)
    exciter = master.slaves[1]
    assert exciter.getUInt64(fmus.exciter.of("node.responses")) == [3] and len(rows) > 3000
    master.end()
    # Once the walk is done the native loop ends, and the FMUs go on.
    assert same(rows[:-100], fmus.native[:-100])


@pytest.mark.parametrize(("clock", "order"), [("triggered", ("bus", "exciter", "plant")), ("countdown", ALL)])
def test_every_frame_on_the_bus_comes_and_is_confirmed(walk, clock, order):
    fmus = walk(network=RATE, duration_s=0.4, clock=clock, roles=ALL)
    master = joined(fmus, order)
    rows = follow(master, fmus)
    frames, errors = master.slaves[order.index("bus")].getUInt64(fmus.bus.of("bus.frames", "bus.error_frames"))
    master.end()
    assert same(rows, fmus.native) and np.abs(rows).max() > 1e-5
    sent = Counter(code for name, content in master.carried if "bus" not in name for code, _ in operations(content))
    came = Counter(code for name, content in master.carried if "bus" in name for code, _ in operations(content))
    # But for what is on its way at the end.
    assert came[TRANSMIT] == came[CONFIRM] == frames and 0 <= sent[TRANSMIT] - came[CONFIRM] <= 8
    assert errors == 0 and sent[CONFIGURATION] == 4


def test_bit_errors_are_error_frames_and_repeated(walk):
    fmus = walk(network=f"{RATE}, bit_error_rate = 1e-3", duration_s=0.3, roles=ALL)
    master = joined(fmus, ALL)
    rows = follow(master, fmus)
    frames, errors = master.slaves[2].getUInt64(fmus.bus.of("bus.frames", "bus.error_frames"))
    master.end()
    assert same(rows, fmus.native)
    fields = [data for _, content in master.carried for code, data in operations(content) if code == BUS_ERROR]
    assert frames > 500 and 20 < errors == sum(data[-1] for data in fields)


def test_a_node_with_many_errors_is_bus_off_says_so_and_comes_back(walk):
    fmus = walk(network=f"{RATE}, bit_error_rate = 0.01", roles=ALL, runs=False)
    master = joined(fmus, ALL)
    master.start()
    for sample in range(1, 61):
        master.advance(sample * 1_000_000)
    logged = [line for slave in master.slaves for line in slave.log]
    master.end()
    states = [data[0] for name, content in master.carried for code, data in operations(content) if code == STATUS]
    # 1 is active, 2 passive, 3 bus-off; from bus-off a node comes back as active.
    assert logged == [] and {1, 2, 3} == set(states)


def test_a_terminal_that_is_not_joined_acknowledges(walk):
    fmus = walk(network=RATE, duration_s=0.4, roles=ALL)
    master = Master()
    plant, bus = master.add(fmus.plant), master.add(fmus.bus)
    master.join(plant["can"], bus["node1"])
    master.start()
    for sample in range(1, 21):
        master.advance(sample * 1_000_000)
    frames = bus["node1"].slave.getUInt64(fmus.bus.of("bus.frames", "bus.error_frames"))
    master.end()
    assert frames[0] > 60 and frames[1] == 0


def test_a_roll_back_of_the_node_changes_no_bit(walk):
    fmus = walk(duration_s=0.5)
    master = joined(fmus)
    chance, slave = random.Random(3), master.plant
    master.start()
    rows = [slave.getFloat64(fmus.plant.states)]
    for sample in range(1, 301):
        state = slave.getFMUState()
        slave.doStep(master.now_ns * 1e-9, chance.choice([0.0003, 0.001, 0.0042]))
        slave.setFMUState(state)
        slave.freeFMUState(state)
        master.advance(sample * 1_000_000)
        rows.append(slave.getFloat64(fmus.plant.states))
    master.end()
    assert same(rows, fmus.native[:301])


def test_validators_and_schemas_find_nothing(walk):
    fmus = walk(network=RATE, duration_s=0.4, roles=ALL)
    schema = xmlschema.XMLSchema(f"{fmpy.__path__[0]}/schema/fmi3/fmi3TerminalsAndIcons.xsd")
    for fmu in (fmus.plant, fmus.exciter, fmus.bus):
        assert validate_fmu(str(fmu.path)) == []
        schema.validate(str(fmu.folder / "terminalsAndIcons/terminalsAndIcons.xml"))
        with zipfile.ZipFile(fmu.path) as archive:
            manifest = archive.read("extra/org.fmi-standard.fmi-ls-bus/fmi-ls-manifest.xml").decode()
        assert f'isBusSimulationFMU="{str(fmu is fmus.bus).lower()}"' in manifest


def test_bad_calls_are_errors_in_words(walk):
    fmus = walk(duration_s=0.5)
    terminal, clock = fmus.plant.of("can.Rx_Data", "can.Rx_Clock"), fmus.plant.of("can.Tx_Clock")[0]
    bad = {
        "the operation at byte 0 has 20 bytes, expected 24":
            lambda slave: slave.setBinary(terminal[:1], [bytes.fromhex("1000000018000000") + bytes(12)]),
        "`can.Rx_Data` is of the type Binary": lambda slave: slave.getClock(terminal[:1]),
        "no variable has the value reference 77": lambda slave: slave.setClock([77], [True]),
        "`can.Tx_Clock` can't be set in event mode": lambda slave: slave.setClock([clock], [True]),
        "fmi3DoStep is not allowed in event mode": lambda slave: slave.doStep(0.0, 0.001),
    }
    for message, call in bad.items():
        slave, log = fmus.plant.made(event_mode=True)
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        with pytest.raises(Exception):
            call(slave)
        slave.freeInstance()
        assert len(log) == 1 and message in log[0][1], log
    said = []
    with pytest.raises(Exception, match="instantiate"):
        fmpy.simulate_fmu(str(fmus.plant.path), stop_time=0.01, logger=lambda *words: said.append(words[3]))
    assert b"the FMU exchanges frames only in event mode; set eventModeUsed to true" in said[0]


def test_a_malformed_operation_is_answered(walk):
    fmus = walk(duration_s=0.5)
    slave, _ = fmus.plant.made(event_mode=True)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    wrong = bytes.fromhex("1000000011000000" "0100000002000100" "07")
    slave.setClock(fmus.plant.of("can.Rx_Clock"), [True])
    slave.setBinary(fmus.plant.of("can.Rx_Data"), [wrong])
    slave.updateDiscreteStates()
    answer = list(operations(slave.getBinary(fmus.plant.of("can.Tx_Data"))[0]))[0]
    slave.freeInstance()
    assert answer == (0x01, len(wrong).to_bytes(2, "little") + wrong)


def test_what_does_not_fit_is_not_joined(walk, library, tmp_path):
    fmus = walk(duration_s=0.5)
    master = Master()
    one, other = master.add(fmus.plant)["can"], master.add(fmus.exciter)["can"]
    other.mime = other.mime.replace(".can", ".lin")
    with pytest.raises(MasterError, match="carries application/org.fmi-standard.fmi-ls-bus.can"):
        master.join(one, other)
    master.end()
    (tmp_path / "s.toml").write_text("")
    for flags, message in [
        (("--role", "bus"), "use --interface can"),
        (("--interface", "can", "--role", "bus"), "gives no network.bit_rate_hz"),
        (("--interface", "can", "--role", "exciter"), "neither"),
        (("--interface", "can", "--role", "bus", "--nodes", "1"), "from 2 to 32 nodes"),
    ]:
        done = export(library, tmp_path / "s.toml", tmp_path / "s.fmu", *flags)
        assert done.returncode == 2 and message in done.stderr, done
