"""Scenarios, plant, sessions and recordings: the same bits in every way to drive the bench."""

import math
import pickle
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import cantools
import numpy as np
import pandas
import pyarrow
import pytest
from matplotlib import pyplot
from matplotlib.figure import Figure

import resonarm
from resonarm import _arrow, _dtypes, _resonarm

ROOT = Path(__file__).resolve().parents[2]


def test_a_scenario_has_other_values_in_place_of_its_own(bench_scenario):
    assert bench_scenario.sample_rate_hz == 1000
    assert bench_scenario.values()["simulation"]["duration_s"] == 1.0
    other = bench_scenario.replace(structure={"set": {"link2.mass_kg": 40}}, simulation={"duration_s": None, "seed": 7})
    assert isinstance(other, resonarm.Scenario)
    assert other.structure.parameter("link2.mass_kg") == (40.0, "kg")
    assert "duration_s" not in other.values()["simulation"]
    assert other.replace(excitation=None).values().get("excitation") is None
    assert pickle.loads(pickle.dumps(other)).to_toml() == other.to_toml()
    assert resonarm.Scenario(other.to_toml()).values() == resonarm.Scenario(other.to_toml()).values()


def test_a_load_file_counts_from_the_scenarios_folder(tmp_path):
    (tmp_path / "load.csv").write_text("time_s,load\n" + "".join(f"{k / 100},1\n" for k in range(50)))
    text = "[excitation]\namplitude = {{ exciter_x = 1.0 }}\nprofile = {{ waveform = 'file', path = '{}' }}\n"
    path = tmp_path / "file.toml"
    path.write_text(text.format("load.csv"))
    scenario = resonarm.Scenario.load(path)
    assert resonarm.run(scenario.replace(simulation={"seed": 3})).exciter["outcome"] == "finished"
    path.write_text(text.format("none.csv"))
    with pytest.raises(FileNotFoundError, match=r"none\.csv"):
        resonarm.Scenario.load(path)


def test_a_batch_equals_samples_one_by_one(bench_scenario):
    loads = np.random.default_rng(1).normal(scale=20, size=(300, 2))
    batch = resonarm.Plant(bench_scenario).play(force_n=loads)
    plant = resonarm.Plant(bench_scenario)
    for row, load in zip(batch, loads, strict=True):
        assert plant.sample == row["sample"]
        assert plant.alpha_rad == tuple(row["alpha_rad"])
        measured = plant.measure()
        for name in ("acceleration_b_m_s2", "acceleration_c_m_s2", "head_force_n", "clipped", "sample"):
            assert np.array_equal(getattr(measured, name), row[name])
        plant.advance(tuple(load))
    assert batch["alpha_rad"][-1].any()


def test_a_recording_equals_the_plant_under_its_loads(bench_scenario, tmp_path):
    report = resonarm.run(bench_scenario, record=tmp_path / "run.mcap")
    recording = report.recording
    states, samples = recording.states, recording.samples
    assert recording.summary["integrity"]["state"] == "complete"
    assert recording.scenario.to_toml() == bench_scenario.to_toml()
    assert states["is_end"].tolist() == [False] * (len(states) - 1) + [True]
    played = resonarm.Plant(bench_scenario).play(states["force_n"], states["torque_nm"])
    np.testing.assert_array_equal(played["alpha_rad"], states["alpha_rad"])
    for name in ("acceleration_b_m_s2", "acceleration_c_m_s2", "head_force_n", "clipped"):
        np.testing.assert_array_equal(played[name], samples[name])
    assert recording.resim() | {"steps": 0} == {
        "identical": True,
        "integrity": {"state": "complete"},
        "samples": len(states),
        "steps": 0,
        "first_divergence": None,
        "max_drift_rad": 0.0,
    }


def test_recordings_are_read_in_parts():
    recording = resonarm.Recording(ROOT / "recordings/free-sweep.mcap")
    for part in ("states", "samples", "frames", "events"):
        whole = recording.read(part)
        chunks = list(recording.chunks(part, rows=1000))
        assert len(chunks) == -(-len(whole) // 1000) or len(whole) % 1000 == 0
        np.testing.assert_array_equal(np.concatenate([chunk["sample"] for chunk in chunks]), whole["sample"])
        some = recording.read(part, 100, 199)
        np.testing.assert_array_equal(some, whole[(whole["sample"] >= 100) & (whole["sample"] <= 199)])
    assert not len(recording.read("ticks")), "in real time alone"
    with pytest.raises(ValueError, match="it must be one of states, samples"):
        recording.read("wheels")


def test_frames_of_a_recording_are_taken_by_the_codec():
    recording = resonarm.Recording(ROOT / "recordings/fd.mcap")
    frames, decoder = recording.frames, resonarm.Decoder(resonarm.Network(profile="fd"))
    verdicts = {"taken": 0, "refused": 0, "foreign": 0}
    for row in frames:
        fd, switch = bool(row["fd"]), bool(row["bitrate_switch"])
        frame = resonarm.Frame(int(row["identifier"]), False, recording.frame_data(row), fd, switch)
        verdicts[decoder.decode(frame).verdict] += 1
    assert verdicts == {"taken": len(frames), "refused": 0, "foreign": 0}
    assert decoder.lost == 0


def test_rows_say_their_order_of_bytes():
    recording, plant = resonarm.Recording(ROOT / "recordings/fd.mcap"), resonarm.Plant()
    parts = [_dtypes.rows_of(recording, part) for part in ("states", "samples", *_dtypes.PARTS)]
    played, orbit = _dtypes.played(plant.channels(), plant.reading_channels()), _dtypes.orbit([("tip.x", "m")], 4, 4)
    dtypes = [*parts, _dtypes.singular([("joint1", "rad")]), _dtypes.RESPONSE, _dtypes.OUTCOME, played, orbit]
    for dtype in dtypes:
        for name in dtype.names:
            form = dtype[name].base
            assert form.str[0] == ("<" if form.itemsize > 1 else "|"), name


CAUSES = [None, "woke-late", "step-long", "bus-long"]
NAMED = {
    "time_ns": ("time_s", lambda ns: (ns / 1e9).tolist()),
    "bus_unix_ns": ("bus_unix_ns", lambda ns: [int(k) or None for k in ns]),
    "received": ("direction", lambda received: np.where(received, "received", "sent").tolist()),
    "bitrate_switch": ("brs", lambda marks: marks.tolist()),
    "error_state_indicator": ("esi", lambda marks: marks.tolist()),
    "cause": ("cause", lambda causes: [CAUSES[k] for k in causes]),
}
"""Columns that Arrow has in the words of the CSV."""


def test_arrow_has_ticks_in_the_words_of_the_csv():
    """A missed deadline of each cause, as the extension passes it: a column of words after the other."""
    ticks = {"sample": [0, 1, 2, 7], "wakeup_ns": [9] * 4, "exec_ns": [8] * 4, "overruns": [0, 1, 2, 1]}
    columns = bytearray(np.array([*ticks.values(), [0, 1, 2, 3]], "<u8").tobytes())
    table = _arrow.batch(columns, [], 4, _dtypes.PARTS["ticks"], 0.002, {}).to_pydict()
    assert table == ticks | {"time_s": [0.0, 0.002, 0.004, 0.014], "cause": CAUSES}
    assert list(table) == ["sample", "time_s", "wakeup_ns", "exec_ns", "overruns", "cause"]


@pytest.mark.parametrize("part", ["states", "samples", "frames", "events", "ticks"])
def test_arrow_has_the_numbers_of_numpy(part):
    recording = resonarm.Recording(ROOT / "recordings/faulty-bus.mcap")
    rows, table = recording.read(part), recording.arrow(part)
    assert table.num_rows == len(rows)
    for name in rows.dtype.names:
        if name in NAMED:
            column, expected = NAMED[name]
            assert table[column].to_pylist() == expected(rows[name]), name
        elif name == "data":
            assert table["data"].to_pylist() == [recording.frame_data(row) for row in rows]
        elif rows.dtype[name].shape:
            for k, column in enumerate(_dtypes.components(name, rows[name])):
                np.testing.assert_array_equal(table[column].to_numpy(), rows[name][:, k])
        else:
            np.testing.assert_array_equal(table[name].to_numpy(), rows[name])
    batches = list(recording.batches(part, 100))
    assert pyarrow.Table.from_batches(batches) == table
    assert all(batch.num_rows <= 100 for batch in batches)
    metadata = table.schema.metadata
    assert (metadata[b"part"], metadata[b"dt_s"]) == (part.encode(), b"0.001")
    assert resonarm.Scenario(metadata[b"scenario"].decode()).to_toml() == recording.scenario.to_toml()


def test_arrow_has_units_and_copies_no_numbers():
    table = resonarm.Recording(ROOT / "recordings/free-sweep.mcap").arrow("states", 100, 399)
    units = {field.name: (field.metadata or {}).get(b"unit", b"").decode() for field in table.schema}
    assert units == {
        "sample": "",
        "time_s": "s",
        "alpha1_rad": "rad",
        "alpha2_rad": "rad",
        "alpha1_dot_rad_s": "rad/s",
        "alpha2_dot_rad_s": "rad/s",
        "torque1_nm": "N·m",
        "torque2_nm": "N·m",
        "force_x_n": "N",
        "force_y_n": "N",
        "is_end": "",
    }
    # The columns one after the other, in the memory that the extension filled.
    numbers = [table[name].chunk(0).buffers()[1].address for name in table.column_names[:-1]]
    assert np.diff(numbers).tolist() == [8 * 300] * 9


def test_a_recording_draws_itself():
    recording = resonarm.Recording(ROOT / "recordings/free-sweep.mcap")
    ax = recording.plot(Figure().subplots(), to_sample=99)
    assert [len(line.get_xdata()) for line in ax.lines] == [100, 100]
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["α₁", "α₂"]


def test_a_plot_without_axes_is_a_figure_of_its_own():
    """Drawn into the current axes, a second plot covered the first."""
    recording = resonarm.Recording(ROOT / "recordings/free-sweep.mcap")
    first, second = recording.plot(to_sample=9), recording.plot(to_sample=9)
    assert first.figure is not second.figure
    assert [len(ax.lines) for ax in (first, second)] == [2, 2]
    for ax in (first, second):
        pyplot.close(ax.figure)


def test_a_recording_is_a_data_frame_of_single_columns():
    """pandas refuses the vectors of `states` in `pandas.DataFrame(recording.states)`."""
    recording = resonarm.Recording(ROOT / "recordings/free-sweep.mcap")
    states = recording.to_pandas("states", to_sample=99)
    assert {"sample", "time_s", "alpha1_rad", "alpha2_rad", "force_x_n", "is_end"} <= set(states.columns)
    np.testing.assert_array_equal(states["alpha2_rad"], recording.read("states", 0, 99)["alpha_rad"][:, 1])
    for part in ("samples", "frames", "ticks", "events"):
        assert len(recording.to_pandas(part)) == len(recording.read(part))
    assert isinstance(recording.to_pandas("frames")["data"][0], bytes)
    # The documents name pandas' own words for what it can't take.
    with pytest.raises(ValueError, match="must be 1-dimensional"):
        pandas.DataFrame(recording.states)


def test_a_report_draws_its_responses(bench_scenario):
    excitation = bench_scenario.values()["excitation"]
    profile = {"waveform": "stepped-sine", "from_hz": 14, "to_hz": 16, "steps": 2, "dwell_s": 0.5, "settle_s": 0.1}
    scenario = bench_scenario.replace(
        simulation={"duration_s": None}, excitation={**excitation, "ramp_s": 0.05, "profile": profile}
    )
    report = resonarm.run(scenario)
    ax = report.plot(Figure().subplots(), quantity="head_force_n")
    assert sum(len(line.get_xdata()) for line in ax.lines) == 2 * len(report.responses) == 4
    assert ax.get_ylabel() == "amplitude of the head force (N)"
    with pytest.raises(ValueError, match="there is no reading 'alpha': expected one of head_force_n"):
        report.plot(quantity="alpha")


def test_files_are_refused_with_the_programs_messages(tmp_path, bench_scenario, command):
    with pytest.raises(FileNotFoundError) as raised:
        resonarm.Recording(tmp_path / "none.mcap")
    assert str(raised.value) in command("resim", tmp_path / "none.mcap", code=2)
    (tmp_path / "text.mcap").write_text("no recording")
    with pytest.raises(ValueError, match="is not an MCAP file"):
        resonarm.Recording(tmp_path / "text.mcap")
    with pytest.raises(FileExistsError, match="already exists"):
        resonarm.run(bench_scenario, record=tmp_path / "text.mcap")
    with pytest.raises(FileNotFoundError, match="can't read the scenario"):
        resonarm.Scenario.load(tmp_path / "none.toml")
    with pytest.raises(ValueError, match="Did you mean `preset`"):
        resonarm.Scenario("[structure]\nprest = 'x'")


class Dwell:
    """Ten newtons for half a second. Restarts only after a fault."""

    def __init__(self):
        self.restarts = 0

    def restart(self):
        self.restarts += 1

    def __call__(self, measured):
        return (10.0, 0.0) if measured.sample < 500 else None


@pytest.mark.parametrize("mode", ["free", "lockstep"])
def test_a_controller_in_python_drives_the_bench(bench_scenario, tmp_path, mode):
    dwell = Dwell()
    report = resonarm.run(bench_scenario.replace(excitation=None), mode, controller=dwell, record=tmp_path / "run.mcap")
    assert (report.exciter["outcome"], report.outcome, dwell.restarts) == ("finished", "disarmed", 0)
    states = report.recording.states
    held = states["force_n"][:, 0]
    assert (held[:500] == 10).all()
    assert held[-1] == 0
    played = resonarm.Plant(bench_scenario).play(states["force_n"])
    np.testing.assert_array_equal(played["alpha_rad"], states["alpha_rad"])


def test_an_exception_of_a_controller_ends_the_run(bench_scenario):
    def controller(measured):
        raise KeyError(measured.sample)

    with pytest.raises(KeyError, match="0"):
        resonarm.run(bench_scenario, controller=controller)
    with pytest.raises(ValueError, match="it must be force or torque"):
        resonarm.run(bench_scenario, controller=controller, load="weight")


ENDLESS = """
import sys, resonarm
try:
    resonarm.run(resonarm.Scenario(), controller=lambda measured: (1.0, 0.0), record=sys.argv[1])
except KeyboardInterrupt:
    print("interrupted")
"""


def test_an_interrupt_ends_a_run_in_order(tmp_path):
    path = tmp_path / "run.mcap"
    words = [sys.executable, "-c", ENDLESS, str(path)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as run:
        # The first records are flushed: the run is under way.
        while run.poll() is None and not (path.exists() and path.stat().st_size > 50_000):
            time.sleep(0.01)
        run.send_signal(signal.SIGINT)
        assert run.communicate(timeout=120)[0] == "interrupted\n"
    recording = resonarm.Recording(path)
    assert recording.summary["integrity"]["state"] == "complete"
    assert recording.states["is_end"][-1]


# In a separate process, all of whose memory is locked.
REAL_TIME = """
import logging, os, sys, resonarm
logging.basicConfig(format="%(name)s: %(message)s")
# However late this machine runs a thread, the nodes don't consider each other lost.
network = {"command_timeout_s": 60.0, "partner_timeout_s": 60.0}
scenario = resonarm.Scenario.load(sys.argv[1], simulation={"duration_s": 0.3}, network=network)
options = {"overrun": "continue", "priority": 10, "core": max(os.sched_getaffinity(0))}
report = resonarm.run(scenario, "real-time", record=sys.argv[2], **options)
assert report.plant["outcome"] in ("completed", "disarmed"), report.plant
assert report.plant["slipped"] == 0, "which continue never does"
assert report.recording.read("ticks")["sample"][-1] >= 300
thread = report.plant["thread"]
assert thread["core"] == options["core"] or thread["shortfalls"], thread
del options["priority"]
try:
    required = resonarm.run(scenario, "real-time", rt="require", **options).plant["thread"]
    assert (required["priority"], required["shortfalls"], thread["shortfalls"]) == (80, [], []), required
except PermissionError as error:
    assert thread["shortfalls"] and "the run needs a real-time thread, but has " in str(error), error
"""


def test_a_run_in_real_time_asks_for_its_thread(tmp_path):
    words = [sys.executable, "-c", REAL_TIME, str(ROOT / "scenarios/bench.toml"), str(tmp_path / "run.mcap")]
    run = subprocess.run(words, capture_output=True, text=True, timeout=120, check=False)
    assert run.returncode == 0, run.stderr
    # Standard error names what this machine does not permit, and nothing else.
    for line in run.stderr.splitlines():
        assert line.startswith("resonarm: ") and ("priority 10" in line or "memory" in line), line


def test_a_missing_core_is_logged(bench_scenario, caplog):
    resonarm.run(bench_scenario.replace(simulation={"duration_s": 0.1}), "real-time", core=1000)
    assert any("1000" in record.getMessage() for record in caplog.records if record.name == "resonarm"), caplog.text


@pytest.mark.parametrize(
    ("mode", "options", "message"),
    [
        ("real-time", {"overrun": "panic"}, "unknown overrun policy `panic`"),
        ("real-time", {"priority": 100}, "the real-time priority is 100; it must be from 1 to 99"),
        ("real-time", {"priority": 300}, "the real-time priority is 300; it must be from 1 to 99"),
        ("real-time", {"spin_s": "on"}, "spin_s is `on`: it must be auto, off, or a time in seconds, above 0"),
        ("real-time", {"spin_s": 0.0}, "spin_s is 0: it must be auto, off, or a time in seconds, above 0"),
        ("real-time", {"spin_s": math.nan}, "spin_s is NaN: it must be auto, off, or a time in seconds"),
        ("real-time", {"spin_s": 0.251e-3}, "spinning for 251 µs before each deadline: at 1000 Hz at most 250 µs"),
        ("real-time", {"rt": "maybe"}, "rt is `maybe`: it must be one of auto, require, off"),
        (
            "lockstep",
            {"priority": 10},
            "priority applies only to the mode real-time, but the mode is lockstep: leave it out",
        ),
        ("lockstep", {"cores_awake": True}, "cores_awake applies only to the mode real-time, but the mode is lockstep"),
        ("free", {"spin_s": "off"}, "spin_s applies only to the mode real-time, but the mode is free: leave it out"),
        ("free", {"overrun": "slip"}, "overrun applies only to the mode real-time, but the mode is free: leave it out"),
    ],
)
def test_invalid_real_time_options_are_refused(bench_scenario, tmp_path, mode, options, message):
    path = tmp_path / "run.mcap"
    with pytest.raises(ValueError) as raised:
        resonarm.run(bench_scenario, mode, record=path, **options)
    assert message in str(raised.value)
    assert not path.exists()


@pytest.mark.parametrize(("spin_s", "spin_us"), [(0.12e-3, 120.0), ("auto", None), ("off", 0.0), (None, 0.0)])
def test_how_long_the_loop_spins_is_reported(bench_scenario, spin_s, spin_us):
    scenario = bench_scenario.replace(simulation={"duration_s": 0.05})
    spin = resonarm.run(scenario, "real-time", spin_s=spin_s).plant.get("spin")
    if spin_us == 0.0:
        assert spin is None
    elif spin_us is None:
        assert spin["slept_p99_us"] > 0 and 0 <= spin["spin_us"] <= spin["most_us"] == 250.0, spin
    else:
        assert spin == {"spin_us": spin_us, "slept_p99_us": None, "most_us": 250.0}


def test_an_exciter_does_not_spin(bench_scenario):
    with pytest.raises(ValueError, match="spin_s applies only to a plant: leave it out for an exciter"):
        resonarm.Node("exciter", bench_scenario, _resonarm.Hub(2).end(), spin_s="auto")


def test_cores_are_kept_awake_or_a_warning_is_logged(bench_scenario):
    thread = resonarm.run(bench_scenario.replace(simulation={"duration_s": 0.05}), "real-time", cores_awake=True).plant[
        "thread"
    ]
    assert (thread["priority"], thread["memory"], thread["core"]) == (None, "none", None), thread
    assert thread["cores_awake"] != bool(thread["shortfalls"]), thread


def test_both_nodes_on_a_separate_bus(bench_scenario):
    hub = _resonarm.Hub(3)
    listener, decoder = hub.end(), resonarm.Decoder()
    with resonarm.Node("plant", bench_scenario, hub.end(), "lockstep", end_on_disarm=True) as plant:
        exciter = resonarm.Node("exciter", bench_scenario, hub.end(), "lockstep").wait()
        report = plant.wait()
    assert exciter.outcome in {"finished", "plant-left"}
    assert report.plant["samples"] >= 1000
    assert [event["event"] for event in plant.take_events()][:2] == ["ready", "armed"]
    verdicts = set()
    while (frame := listener.receive(0.0)) is not None:
        verdicts.add(decoder.decode(resonarm.Frame(*frame)).verdict)
    assert verdicts == {"taken"}
    with pytest.raises(resonarm.ResonarmError, match="taken before"):
        plant.wait()


def test_long_calls_let_other_threads_run(bench_scenario):
    counted, done = 0, threading.Event()

    def count():
        nonlocal counted
        while not done.is_set():
            counted += 1

    thread = threading.Thread(target=count)
    thread.start()
    resonarm.Plant(bench_scenario).play(np.zeros((20_000, 2)))
    before = counted
    resonarm.Plant(bench_scenario).play(np.zeros((50_000, 2)))
    done.set()
    thread.join()
    assert counted > before


@pytest.mark.parametrize("profile", ["classic", "fd"])
def test_a_frame_encoded_is_decoded(profile):
    network = resonarm.Network(base=0x300, plant_id=3, profile=profile)
    encoder, decoder = resonarm.Encoder(network), resonarm.Decoder(network)
    for sample in range(40):
        frame = encoder.encode("ForceCommand", force_x_n=-12.5, force_y_n=0.5, sample=sample)
        decoded = decoder.decode(frame)
        assert decoded.verdict == "taken"
        assert decoded.signals == {"force_x_n": -12.5, "force_y_n": 0.5, "sample": sample}
        assert decoder.decode(frame.message()).verdict == "refused", "the same counter again"
    broken = frame._replace(data=bytes([frame.data[0] ^ 1]) + frame.data[1:])
    assert "CRC" in decoder.decode(broken).reason
    assert decoder.decode(frame._replace(identifier=5)) == resonarm.Decoded("foreign")
    with pytest.raises(ValueError, match="ForceCommand has no value for force_y_n: give one"):
        encoder.encode("ForceCommand", force_x_n=1)
    with pytest.raises(ValueError, match="has no signal foo"):
        encoder.encode("ForceCommand", force_x_n=1, force_y_n=1, sample=1, foo=1)
    with pytest.raises(ValueError, match="is not a multiple of 0x10: take 0x200"):
        resonarm.Network(base=0x205)


@pytest.mark.parametrize("profile", ["classic", "fd"])
def test_cantools_reads_our_frames_by_our_dbc(profile):
    network = resonarm.Network(base=0x340, profile=profile)
    database = cantools.database.load_string(network.dbc())
    encoder = resonarm.Encoder(network)
    signals = {"force_x_n": 12.5, "force_y_n": -0.02, "sample": 77}
    frame = encoder.encode("ForceCommand", **signals)
    message = database.get_message_by_frame_id(frame.identifier)
    decoded = message.decode(frame.data)
    assert message.name == "ForceCommand"
    assert message.is_fd == frame.fd
    assert {name: decoded[name] for name in signals} == pytest.approx(signals, abs=1e-6)
