"""The plant by its signals in an FMU: by FMPy it is the plant of `resonarm run --mode free`, bit for bit."""

import json
import random
import subprocess
import sys
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

from fmus import export, same
from processes import RESONARM
from recordings import LOAD, Recording

SAMPLES = 600
OK, ERROR = 0, 3


def follow(fmu, slave, native, step_s, samples=SAMPLES):
    """The states at the ends of steps under the recorded loads."""
    loads, references = native.states[:, 4:], fmu.of(*(f"load.{name}" for name in LOAD))
    rows, count = [], round(samples / (1000 * step_s))
    for step in range(count):
        sample = int(step * step_s * 1000 + 1e-9)
        slave.setFloat64(references, list(loads[sample]))
        slave.doStep(step * step_s, step_s)
        rows.append(slave.getFloat64(fmu.states))
    return np.array(rows)


def test_validators_find_nothing(arm, make, structures):
    fmus = [arm.fmu, *(make(structures / f"{name}.toml", name=name) for name in ("chain", "friction"))]
    for fmu in fmus:
        assert validate_fmu(str(fmu.path)) == []
    words = [Path(sys.executable).with_name("fmutool"), "-input", arm.fmu.path, "-check"]
    check = subprocess.run(words, capture_output=True, text=True)
    assert "No semantic error" in check.stdout + check.stderr, check
    names = subprocess.run(["nm", "-D", "--defined-only", arm.fmu.folder / "binaries/x86_64-linux/resonarm.so"],
                           capture_output=True, text=True, check=True).stdout
    assert sum(" T fmi3" in line for line in names.splitlines()) == 75


def test_the_same_scenario_gives_the_same_bytes(arm, library, tmp_path):
    scenario = tmp_path / "s.toml"
    scenario.write_text("structure = { angles_deg = [0, 90] }")
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        done = export(library, scenario, tmp_path / folder / "s.fmu", "--json")
        summary = json.loads(done.stdout)
    one, two = [(tmp_path / folder / "s.fmu").read_bytes() for folder in ("one", "two")]
    assert one == two and summary["bytes"] == len(one)
    with zipfile.ZipFile(tmp_path / "one/s.fmu") as archive:
        assert archive.testzip() is None
        assert archive.namelist() == sorted(archive.namelist())
        assert {"documentation/index.html", "documentation/licenses/license.txt"} <= set(archive.namelist())
    again = export(library, scenario, tmp_path / "one/s.fmu")
    assert again.returncode == 2 and "already exists" in again.stderr


@pytest.mark.parametrize("step_s", [0.00025, 0.001, 0.01])
def test_every_step_gives_the_bits_of_the_native_run(arm, step_s):
    native, each = arm.native, max(round(step_s * 1000), 1)
    for event_mode in (False, True):
        with arm.fmu.instance(event_mode=event_mode) as slave:
            rows = follow(arm.fmu, slave, native, step_s)
    ends = rows[3::4] if step_s < 0.001 else rows
    expected = native.states[each : SAMPLES + 1 : each, :4]
    assert np.abs(expected).max() > 1e-6
    assert same(ends, expected)


def test_steps_that_are_no_part_of_a_sample_and_another_start_give_the_same_samples(arm, tmp_path):
    """An importer without event mode, as OMSimulator was, and steps that don't meet the samples."""
    recorded = []
    for start_s, step_s in ((0.0, 0.001), (0.0, 0.0007), (10.0, 0.001)):
        path = tmp_path / f"{len(recorded)}.mcap"
        values = {"parameter.recording": str(path), "load.force_x_n": 10.0}
        result = fmpy.simulate_fmu(
            str(arm.fmu.path), start_time=start_s, stop_time=start_s + 0.21, output_interval=step_s, start_values=values,
            output=["sample"],
        )
        assert result["time"][0] == start_s and result["sample"][0] == 0
        recorded.append(Recording.whole(path).states)
    assert len(recorded[0]) == 211 and np.abs(recorded[0]).max() > 1e-6
    assert same(recorded[1], recorded[0]) and same(recorded[2], recorded[0])


def test_simulate_fmu_gives_the_states_and_readings_of_the_native_run(arm):
    native = arm.native
    # FMPy interpolates: a load that jumps has two rows at its time.
    rows = [(k / 1000, *native.states[max(k - before, 0), 4:]) for k in range(SAMPLES + 1) for before in (1, 0)]
    signals = np.array(rows, dtype=[("time", float), *((f"load.{name}", float) for name in LOAD)])
    readings = ["acceleration_b_x_m_s2", "acceleration_c_y_m_s2", "head_force_x_n"]
    names = [f"state.{name}" for name in ("alpha1_rad", "alpha2_rad")] + [f"reading.{name}" for name in readings]
    result = fmpy.simulate_fmu(
        str(arm.fmu.path), stop_time=SAMPLES / 1000, step_size=0.001, output_interval=0.001, output=names, input=signals
    )
    assert len(result) == SAMPLES + 1
    assert same(np.stack([result[name] for name in names[:2]], axis=1), native.states[: SAMPLES + 1, :2])
    read = native.column("/plant/samples", readings)[: SAMPLES + 1]
    assert same(np.stack([result[name] for name in names[2:]], axis=1), read)


def test_a_roll_back_changes_no_bit(arm):
    fmu, chance = arm.fmu, random.Random(1)
    references = fmu.of(*(f"load.{name}" for name in LOAD))
    outputs = [variable.valueReference for variable in fmu.description.modelVariables
               if variable.causality == "output" and variable.type == "Float64"]
    with fmu.instance() as slave, fmu.instance() as straight:
        time_s = 0.0
        for _ in range(100):
            state, saved = slave.getFMUState(), None
            if chance.random() < 0.5:
                saved = slave.serializeFMUState(state)
            for _ in range(chance.randrange(1, 4)):
                slave.setFloat64(references, [0.0, 0.0, chance.uniform(-50, 50), 0.0])
                slave.doStep(time_s, chance.uniform(0.0, 0.004))
                if saved is not None:
                    slave.freeFMUState(state)
                    state = slave.deserializeFMUState(saved)
                slave.setFMUState(state)
            slave.freeFMUState(state)
            force_n, length_s = chance.uniform(-50, 50), chance.choice([0.00025, 0.001, 0.0017])
            for one in (slave, straight):
                one.setFloat64(references, [0.0, 0.0, force_n, 0.0])
                one.doStep(time_s, length_s)
            time_s += length_s
            assert same(slave.getFloat64(outputs), straight.getFloat64(outputs))


def test_instances_in_threads_give_the_same_bits(arm):
    def run(_):
        with arm.fmu.instance() as slave:
            return follow(arm.fmu, slave, arm.native, 0.001, samples=300)

    with ThreadPoolExecutor(4) as pool:
        runs = list(pool.map(run, range(4)))
    assert all(same(run, arm.native.states[1:301, :4]) for run in runs)


def test_a_thousand_instances_leave_no_memory_behind(arm):
    def memory_kb():
        with open("/proc/self/status") as status:
            return next(int(line.split()[1]) for line in status if line.startswith("VmRSS"))

    with arm.fmu.instance() as slave:
        first = slave.component

        def make():
            slave.instantiate()
            slave.enterInitializationMode()
            slave.exitInitializationMode()
            state = slave.getFMUState()
            slave.doStep(0.0, 0.002)
            slave.freeFMUState(state)
            slave.fmi3FreeInstance(slave.component)

        for _ in range(200):
            make()
        before_kb = memory_kb()
        for _ in range(800):
            make()
        slave.component = first
    # An instance has some 20 kB.
    assert memory_kb() - before_kb < 2000


def test_a_recording_is_simulated_again(arm, tmp_path):
    path = tmp_path / "run.mcap"
    with arm.fmu.instance(recording=str(path), seed=5, **{"link1.angle_deg": 10.0}) as slave:
        for step in range(400):
            state = slave.getFMUState()
            for force_n in (20.0, 3.0 + step % 7):
                slave.setFMUState(state)
                slave.setFloat64(arm.fmu.of("load.force_x_n"), [force_n])
                slave.doStep(step * 0.0015, 0.0015)
            slave.freeFMUState(state)
        states = slave.getFloat64(arm.fmu.states)
        slave.terminate()
    assert same(Recording.whole(path).states[-1, :4], states)
    for words in (["resim"], ["resim", "--readings"]):
        done = subprocess.run([RESONARM, *words, str(path), "--json"], capture_output=True, text=True)
        assert done.returncode == 0 and '"identical":true' in done.stdout, done
    with pytest.raises(Exception), arm.fmu.instance(recording=str(path)):
        pass


@pytest.mark.parametrize("name", ["chain", "contact", "friction", "hardening", "plate"])
def test_structures_have_their_coordinates_and_loads(make, structures, name, tmp_path):
    fmu = make(structures / f"{name}.toml", name=name)
    inputs = [reference for key, reference in fmu.references.items() if key.startswith("load.")]
    assert inputs and fmu.states
    path = tmp_path / "run.mcap"
    rows = []
    for step_s in (0.001, 0.01):
        record = {"recording": str(path)} if step_s == 0.001 else {}
        with fmu.instance(**record) as slave:
            slave.setFloat64(inputs[-1:], [2.5])
            for step in range(round(0.2 / step_s)):
                slave.doStep(step * step_s, step_s)
            rows.append(slave.getFloat64(fmu.states))
            slave.terminate()
    assert same(rows[0], rows[1]) and np.abs(rows[0]).max() > 0
    done = subprocess.run([RESONARM, "resim", str(path), "--json"], capture_output=True, text=True)
    assert '"identical":true' in done.stdout, done


def test_parameters_change_what_they_say(arm):
    def readings(**parameters):
        with arm.fmu.instance(**parameters) as slave:
            slave.doStep(0.0, 0.05)
            return slave.getFloat64(arm.fmu.of("reading.acceleration_b_x_m_s2", "reading.acceleration_c_y_m_s2"))

    assert readings() == readings() != readings(seed=8)
    assert readings(noise=False) == readings(noise=False, seed=8)


BAD = {
    "the length of the step is -0.001 s": lambda slave: slave.doStep(0.0, -0.001),
    "the length of the step is NaN s": lambda slave: slave.doStep(0.0, float("nan")),
    "the step begins at 0.5 s: it must begin at 0 s, the time of the FMU": lambda slave: slave.doStep(0.5, 0.001),
    "not allowed in step mode: it is allowed in event mode": lambda slave: slave.enterStepMode(),
    "not allowed in step mode: it is allowed in initialization mode": lambda slave: slave.exitInitializationMode(),
    "eventModeUsed": lambda slave: slave.enterEventMode(),
    "no variable has the value reference 99: it must be from 0 to 33": lambda slave: slave.getFloat64([99]),
    "`sample` is of the type UInt64": lambda slave: slave.getFloat64([27]),
    "fmi3SetInt32: `load.torque1_nm` is of the type Float64: use the function": lambda slave: slave.setInt32([1], [1]),
    "`state.alpha1_rad` can't be set in step mode: it is calculated": lambda slave: slave.setFloat64([23], [1.0]),
    "parameters are fixed once": lambda slave: slave.setUInt64([30], [1]),
    "`load.force_x_n` is NaN: it must be a finite number": lambda slave: slave.setFloat64([3], [float("nan")]),
    "not a state of this FMU: it does not begin as a state": lambda slave: slave.deserializeFMUState(b"garbage1"),
    "providesDirectionalDerivatives is false": lambda slave: slave.getDirectionalDerivative([5], [1], [1.0], 1),
    "fmi3SetTime": lambda slave: slave.fmi3SetTime(slave.component, 1.0),
}


@pytest.mark.parametrize("message", BAD)
def test_bad_calls_are_errors_in_words(arm, message):
    with arm.fmu.instance() as slave:
        state = slave.getFMUState()
        with pytest.raises(Exception):
            BAD[message](slave)
        assert len(slave.log) == 1 and slave.log[0][0] == ERROR and message in slave.log[0][1], slave.log
        # Nothing but a reset or an earlier state is possible then.
        with pytest.raises(Exception):
            slave.doStep(0.0, 0.001)
        slave.setFMUState(state)
        slave.freeFMUState(state)
        slave.doStep(0.0, 0.001)


def test_a_load_beyond_the_exciter_and_a_step_that_time_can_not_see_are_errors(arm):
    with arm.fmu.instance() as slave:
        slave.setFloat64(arm.fmu.of("load.force_x_n"), [1e4])
        with pytest.raises(Exception):
            slave.doStep(0.0, 0.001)
        assert "the exciter can't produce it" in slave.log[0][1]
        slave.reset()
        slave.enterInitializationMode(startTime=1e6)
        slave.exitInitializationMode()
        slave.doStep(1e6, 0.0)
        with pytest.raises(Exception):
            slave.doStep(1e6, 1e-12)
        assert "too small" in slave.log[-1][1]


def test_a_wrong_token_or_edited_resources_make_no_instance(arm, make, tmp_path):
    with pytest.raises(Exception, match="instantiate"):
        arm.fmu.made(token="{0}")
    (tmp_path / "s.toml").write_text("")
    fmu = make(tmp_path / "s.toml", name="edited")
    edited = fmu.folder / "resources/scenario.toml"
    edited.write_text(edited.read_text().replace("angles_deg = [0.0, 60.0]", "angles_deg = [0.0, 61.0]"))
    with pytest.raises(Exception, match="instantiate"):
        fmu.made()
