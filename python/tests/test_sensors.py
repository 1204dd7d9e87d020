"""Rigs of many sensors: twenty accelerometers on the plate of the examples, against the modes of its matrices."""

import csv
import math
from pathlib import Path

import can
import cantools
import numpy as np
import pytest

import resonarm

EXAMPLES = Path(__file__).resolve().parents[2] / "examples/structures"
POINTS = {row: {4: "middle", 8: "tip"}.get(row, f"p{row}") for row in range(9)}
"""The masses of the plate by their rows in its matrices."""
SENSORS = {f"a{number}": number % 9 for number in range(20)}
"""The accelerometers, and the rows at which they are."""
CHANNELS = [f"acceleration_{name}_z_m_s2" for name in sorted(SENSORS)]
"""Their channels in the order of the recording, which is that of the names."""
SMALL = "a7"
"""An accelerometer that the motion drives beyond its range of 1 m/s²."""
FIRST, OTHERS = 15, 5
"""How many accelerations the two messages of the protocol carry."""


def rig(name, row):
    small = "range_m_s2 = 1.0\n" if name == SMALL else ""
    ideal = "noise_rms_m_s2 = 0.0\nresolution_m_s2 = 0.0\n"
    return f'[rig.sensors.{name}]\nat = "{POINTS[row]}.z"\n{ideal}{small}'


def plate(rest=""):
    """The scenario of the plate with all its masses as points, converters that sample instants, and the sensors."""
    text = (EXAMPLES / "plate.toml").read_text()
    dofs = "".join(f'"{point}.z" = {row}\n' for row, point in POINTS.items() if point not in ("middle", "tip"))
    for old, new in (
        ('"middle.z" = 4\n', f'"middle.z" = 4\n{dofs}'),
        ("[rig.exciter]\n", '[rig]\nconverter = "instant"\n\n[rig.exciter]\n'),
    ):
        assert old in text
        text = text.replace(old, new)
    sensors = "".join(rig(name, row) for name, row in SENSORS.items())
    return resonarm.Scenario(f"{text}\n{sensors}{rest}", folder=EXAMPLES)


def accelerations(scenario, states):
    """Those of all masses, m/s², half a sample after each state, under the load that is held.

    Mode r, of modal mass 1 kg, moves by q̈ + c q̇ + ω² q = φ(tip) F. With the displacement x = q − φ(tip) F/ω² from the
    rest under the load, σ = c/2 and ν² = ω² − σ², x(t) = e^{−σt} (x₀ cos νt + (v₀ + σ x₀)/ν sin νt).
    """
    mass, damping, stiffness = (np.load(EXAMPLES / f"plate-{name}.npy") for name in "mck")
    root = 1 / np.sqrt(np.diag(mass))
    squares, vectors = np.linalg.eigh(root[:, None] * stiffness * root)
    squares, shapes = squares[:4], root[:, None] * vectors[:, :4]
    known = np.array([mode["shape"]["tip.z"] for mode in scenario.structure.mode_shapes])
    shapes = shapes * np.sign(shapes[8] * known)
    np.testing.assert_allclose(shapes[8], known, rtol=1e-9)
    sigma = np.einsum("ir,ij,jr->r", shapes, damping, shapes) / 2
    nu, t_s = np.sqrt(squares - sigma**2), 0.5 / scenario.sample_rate_hz
    start = states["q_m_sqrt_kg"] - shapes[8] * states["force_n"][:, :1] / squares
    speed = (states["q_dot_m_sqrt_kg_s"] + sigma * start) / nu
    decay, cosine, sine = np.exp(-sigma * t_s), np.cos(nu * t_s), np.sin(nu * t_s)
    moved = decay * (start * cosine + speed * sine)
    velocity = decay * (nu * (speed * cosine - start * sine)) - sigma * moved
    return (-2 * sigma * velocity - squares * moved) @ shapes.T


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    path = tmp_path_factory.mktemp("sensors") / "run.mcap"
    resonarm.run(plate(), record=path)
    return resonarm.Recording(path)


def test_twenty_accelerometers_read_the_sum_of_the_modes(recorded):
    states, samples = recorded.states[:-1], recorded.samples[1:]
    count = min(len(states), len(samples))
    states, samples = states[:count], samples[:count]
    assert count > 1900 and (samples["sample"] == states["sample"] + 1).all()
    assert samples.dtype.names[5:] == (*CHANNELS, "clipped")
    expected = accelerations(plate(), states)
    assert abs(expected).max() > 2.0
    for place, name in enumerate(sorted(SENSORS)):
        truth, got = expected[:, SENSORS[name]], samples[f"acceleration_{name}_z_m_s2"]
        is_clipped = (samples["clipped"] >> (6 + place) & 1).astype(bool)
        if name == SMALL:
            assert is_clipped.any() and not is_clipped.all()
            assert (is_clipped == (abs(truth) > 1.0)).all()
            truth = np.clip(truth, -1.0, 1.0)
        else:
            assert not is_clipped.any(), name
        np.testing.assert_allclose(got, truth, rtol=0, atol=1e-9 * abs(expected).max(), err_msg=name)


def test_an_export_has_the_readings_of_all_sensors(recorded, command, tmp_path):
    command("export", recorded.path, "--to", "csv", "--out", tmp_path / "run")
    with (tmp_path / "run-samples.csv").open(newline="") as file:
        names, *rows = csv.reader(file)
    assert names[-21:] == [*CHANNELS, "clipped"]
    samples = recorded.samples
    assert len(rows) == len(samples)
    for name in (*CHANNELS, "clipped"):
        column = names.index(name)
        assert [float(row[column]) for row in rows] == samples[name].tolist(), name


def test_a_plant_plays_the_readings_of_a_run(recorded):
    plant = resonarm.Plant(plate())
    rows = plant.play(force_n=recorded.states["force_n"][:500])
    for name in (*CHANNELS, "clipped"):
        assert rows[name].tolist() == recorded.samples[name][:500].tolist(), name
    measured = plant.measure()
    assert measured.sensors == {name: recorded.samples[name][500] for name in CHANNELS}
    assert measured.clipped == recorded.samples["clipped"][500]


def database():
    """The user's protocol: a command, and two messages with the accelerations, their marks and the plant's state."""
    names, floats = sorted(SENSORS), [(256, "Force")]
    lines = ['VERSION ""\n\nNS_ :\n\nBS_:\n\nBU_: Shaker Controller\n', "BO_ 256 Drive: 8 Controller"]
    lines.append(' SG_ Force : 0|32@1- (1,0) [0|0] "N" Shaker')
    lines.append(' SG_ Enable : 32|1@1+ (1,0) [0|1] "" Shaker')
    for number, length, carried in ((512, 64, names[:FIRST]), (513, 32, names[FIRST:])):
        lines.append(f"\nBO_ {number} Part{number - 511}: {length} Shaker")
        for place, name in enumerate(carried):
            lines.append(f' SG_ {name.upper()} : {32 * place}|32@1- (1,0) [0|0] "m/s2" Controller')
            floats.append((number, name.upper()))
    bit = 32 * OTHERS
    for place, name in enumerate(names):
        lines.append(f' SG_ C{name.upper()} : {bit + place}|1@1+ (1,0) [0|1] "" Controller')
    lines.append(f' SG_ State : {bit + 20}|4@1+ (1,0) [0|15] "" Controller')
    lines.append(f' SG_ Sample : {bit + 24}|16@1+ (1,0) [0|65535] "" Controller\n')
    lines += [f"SIG_VALTYPE_ {number} {name} : 1;" for number, name in floats]
    formats = ",".join(f'"{name}"' for name in ("StandardCAN", "ExtendedCAN", "reserved", "J1939PG"))
    others = ",".join(f'"r{number}"' for number in range(4, 14))
    lines.append(f'BA_DEF_ BO_ "VFrameFormat" ENUM {formats},{others},"StandardCAN_FD","ExtendedCAN_FD";')
    lines.append('BA_DEF_DEF_ "VFrameFormat" "StandardCAN";')
    lines += [f'BA_ "VFrameFormat" BO_ {number} 14;' for number in (512, 513)]
    return "\n".join(lines) + "\n"


def wire(dbc):
    """What the messages of this database mean."""
    names = sorted(SENSORS)

    def quantities(carried):
        return "".join(f'{name.upper()} = {{ quantity = "acceleration_{name}_z_m_s2" }}\n' for name in carried)

    marks = "".join(f'C{name.upper()} = {{ clipped = "acceleration_{name}_z_m_s2" }}\n' for name in names)
    return f"""
[wire]
dbc = '{dbc}'
node = "Shaker"
lockstep = "command"
[[wire.commands]]
message = "Drive"
force_x_n = {{ signal = "Force" }}
timeout_s = 0.1
[[wire.events]]
message = "Drive"
signal = "Enable"
arm = [1]
disarm = [0]
[[wire.readings]]
message = "Part1"
every = 1
[wire.readings.signals]
{quantities(names[:FIRST])}
[[wire.readings]]
message = "Part2"
every = 1
[wire.readings.signals]
{quantities(names[FIRST:])}{marks}
State = {{ state = {{ pre-operational = 1, operational = 2, fault = 3 }} }}
Sample = {{ sample = true }}
"""


def test_a_protocol_of_the_user_carries_all_sensors(tmp_path):
    dbc, path = tmp_path / "sensors.dbc", tmp_path / "run.mcap"
    dbc.write_text(database())
    messages = cantools.database.load_file(dbc)
    heard = {}
    arguments = {"scenario": plate(wire(dbc)), "mode": "lockstep", "record": path}
    with can.Bus(interface="resonarm", channel="sensors", **arguments) as bus:

        def drive(force_n, enable):
            data = messages.encode_message("Drive", {"Force": force_n, "Enable": enable})
            bus.send(can.Message(arbitration_id=256, data=data, is_extended_id=False))

        first, answered = None, 0
        drive(0.0, 1)
        while answered < 400:
            message = bus.recv(60.0)
            assert message is not None, f"no reading after {answered} commands"
            if message.arbitration_id == 512:
                first = messages.decode_message(512, message.data)
            elif message.arbitration_id == 513:
                assert first is not None
                values = {**first, **messages.decode_message(513, message.data)}
                heard[values["Sample"]] = values
                assert values["State"] != 3
                answered += 1
                drive(math.sin(math.tau * 0.036 * answered), 1)
        drive(0.0, 0)
    samples = resonarm.Recording(path).samples
    marked = set()
    for sample, values in heard.items():
        row = samples[samples["sample"] == sample][0]
        for place, name in enumerate(sorted(SENSORS)):
            assert values[name.upper()] == np.float32(row[f"acceleration_{name}_z_m_s2"]), (sample, name)
            assert values[f"C{name.upper()}"] == row["clipped"] >> (6 + place) & 1, (sample, name)
            if values[f"C{name.upper()}"]:
                marked.add(name)
    assert len(heard) > 300 and marked == {SMALL}
    largest = max(abs(values[name.upper()]) for values in heard.values() for name in SENSORS)
    assert largest > 1.5
