"""The conformance tool against the program's own nodes and the controller in C, as processes."""

import json
import time
import xml.etree.ElementTree as ElementTree
from collections import Counter

import pytest
import wire
from processes import PATIENCE_S, receivers, run, wait_until
from recordings import RECEIVED, SENT, Recording
from test_c_controller import controller

RATE_HZ = 200

SCENARIO = f"""
[simulation]
rate_hz = {RATE_HZ}
[rig.gate]
force_rate_limit_n_per_s = 4000.0
travel_limit_m = 0.001
[excitation]
amplitude = {{ exciter_x = 20.0 }}
ramp_s = 0.1
profile = {{ waveform = "dwell", frequency_hz = 15.0, duration_s = 60.0, settle_s = 0.2 }}
"""

# The arm yields by 3.3 µm/N.
BEYOND = ["--beyond-n", 650, "--beyond-n-per-s", 20_000, "--beyond-travel-n", 500]

LOAD = ["--bit-rate-hz", 250_000, "--soak-s", 2]

SINE = ["--expect-frequency-hz", 15, "--expect-force-n", 20]

# Cases that need the FD profile, or a reading beyond its range.
SKIPPED = ("-pairs", "-own-limits", "plant-saturation")

# A machine that stops a process makes a case inconclusive, never failed, and such a case is run again. With both
# processes stopped for 150 ms twice a second that is one case in twenty, so after six rounds there is none.
ROUNDS = 6


def ended(tool):
    """Its report; the exit code says whether every case was passed."""
    status = tool.wait()
    report = json.loads(tool.stdout)
    assert status == (report["failed"] + report["inconclusive"] + report["not_run"] > 0), report
    return report


def passes_every_case(start, run_out=ended, skipped_too=SKIPPED):
    """Runs the cases by `start(flags)`, and again those that held-up processes left open. The first report."""
    first, flags = None, []
    for _ in range(ROUNDS):
        report = run_out(start(flags))
        first = first or report
        wrong = [case for case in report["cases"] if case["verdict"] in ("failed", "not run")]
        assert not wrong, json.dumps(wrong, indent=1)
        skipped = [case["case"] for case in report["cases"] if case["verdict"] == "skipped"]
        assert all(name.endswith(skipped_too) for name in skipped), report
        left = [case["case"] for case in report["cases"] if case["verdict"] == "inconclusive"]
        if not left:
            return first
        flags = [flag for case in left for flag in ("--case", case)]
    raise AssertionError(f"{left} are inconclusive {ROUNDS} times: {report}")


def judged(start, run_out=ended):
    """The verdict on the first case that `start()` runs, and runs again while held-up processes leave it open."""
    for _ in range(ROUNDS):
        found = run_out(start())["cases"][0]
        if found["verdict"] != "inconclusive":
            break
    return found


def test_our_plant_passes_every_case(tmp_path, programs):
    scenario, junit = tmp_path / "scenario.toml", tmp_path / "report.xml"
    scenario.write_text(SCENARIO)
    plant = programs.resonarm("run", "--bus", "vcan0", "--scenario", scenario)
    common = ["--bus", "vcan0", "--role", "plant", *BEYOND, *LOAD, "--pid", plant.process.pid, "--json"]
    first = passes_every_case(
        lambda flags: programs.resonarm("conformance", *common, *flags, *([] if flags else ["--junit", junit]))
    )
    suite = ElementTree.parse(junit).getroot().find("testsuite")
    assert len(suite.findall("testcase")) == int(suite.get("tests")) == len(first["cases"])
    undecided = first["inconclusive"] + first["skipped"]
    assert len(suite.findall("testcase/skipped")) == int(suite.get("skipped")) == undecided


def kept_alive(start):
    """Waits for the tool's report, while a controller is started again whenever it ends."""

    def run_out(tool):
        node = start()
        while tool.running():
            if not node.running():
                node = start()
            time.sleep(0.02)
        node.end()
        return ended(tool)

    return run_out


@pytest.mark.parametrize("language", ["rust", "c"])
def test_our_exciters_pass_every_case(tmp_path, programs, language):
    scenario = tmp_path / "scenario.toml"
    scenario.write_text(SCENARIO)
    sine = ["--open-loop", "--frequencies-hz", 15, "--amplitude-n", 20, "--dwell-s", 60, "--rate-hz", RATE_HZ]
    node = {
        "rust": lambda: programs.resonarm("exciter", "--bus", "vcan0", "--scenario", scenario),
        "c": lambda: controller(programs, "vcan0", *sine),
    }[language]
    common = ["--bus", "vcan0", "--role", "exciter", *LOAD, *SINE, "--json"]
    report = passes_every_case(lambda flags: programs.resonarm("conformance", *common, *flags), kept_alive(node))
    # The sine is not sampled at its peaks.
    least, most = report["commands"]["force_x_n"]
    assert -20.0 <= least < -19.0 and 19.0 < most <= 20.0, report["commands"]


def test_an_empty_bus_is_no_success(programs):
    flags = ["--role", "plant", "--case", "plant-h", "--patience-s", 0.1]
    tool = programs.resonarm("conformance", "--bus", "vcan0", *flags, "--json")
    report = ended(tool)
    assert tool.wait() == 1
    assert [case["verdict"] for case in report["cases"]] == ["inconclusive"] * 2, report


def test_a_bus_that_is_lost_leaves_a_report(tmp_path, programs, interface):
    junit = tmp_path / "report.xml"
    flags = ["--role", "exciter", "--case", "exciter-hello", "--case", "exciter-plant", "--patience-s", PATIENCE_S]
    tool = programs.resonarm("conformance", "--bus", interface, *flags, "--junit", junit)
    wait_until(lambda: interface in receivers(), "the first case")
    run("ip", "link", "set", interface, "down")
    assert tool.wait() == 3
    assert tool.stderr.startswith(f"resonarm: {interface} is down"), tool.stderr
    verdicts = [line.split("  ")[0] for line in tool.stdout.splitlines() if not line.startswith(" ")]
    assert verdicts == ["inconclusive", *["not run"] * 6, "0 passed, 0 failed, 1 inconclusive, 0 skipped, 6 not run"]
    suite = ElementTree.parse(junit).getroot().find("testsuite")
    said = [case.find("skipped").get("message") for case in suite]
    assert said[0].startswith(f"inconclusive: {interface} is down")
    assert said[1:] == ["not run: the bus was lost before"] * 6
    assert int(suite.get("skipped")) == 7


def test_a_recording_is_evidence(tmp_path, programs):
    scenario, path = tmp_path / "scenario.toml", tmp_path / "evidence.mcap"
    scenario.write_text(SCENARIO)
    plant = programs.resonarm("run", "--bus", "vcan0", "--scenario", scenario)
    dump = programs.candump()
    cases = ["plant-hello", "plant-states"]
    flags = [flag for case in cases for flag in ("--case", case)]
    tool = programs.resonarm(
        "conformance", "--bus", "vcan0", "--role", "plant", *flags, "--seed", 7, "--record", path, "--json"
    )
    report = ended(tool)
    plant.stop()
    assert report["recording"]["path"] == str(path) and sum(report["recording"]["lost"].values()) == 0, report
    recording = Recording.whole(path)
    # Two events per case: its name, and its verdict.
    verdicts = [case["verdict"] for case in report["cases"]]
    events = [(event.name, event.value) for event in recording.topics["/events"]]
    assert events == [
        event for n, case in enumerate(cases, 1) for event in ((case, n), (f"verdict.{verdicts[n - 1]}", n))
    ]
    said = recording.metadata["resonarm.statistics"]
    assert [said[case].split(":")[0] for case in cases] == verdicts
    assert recording.metadata["resonarm.configuration"]["seed"] == "7"
    # An independent listener heard all that the tester sent, and all that the tester heard was on the bus.
    frames = wire.log(dump)
    ours = [frame.content for frame in frames if wire.DBC.get_message_by_frame_id(frame.id).senders == ["Exciter"]]
    assert [(frame.id, frame.data) for frame in recording.frames if frame.direction == RECEIVED] == ours
    heard = Counter((frame.id, frame.data) for frame in recording.frames if frame.direction == SENT)
    assert heard and heard <= Counter(frame.content for frame in frames)
    # Each case has frames of both directions, in the order of their times.
    times = [event.time_ns for event in recording.topics["/events"]]
    for begin, end in zip(times[::2], times[1::2], strict=True):
        assert {frame.direction for frame in recording.frames if begin <= frame.time_ns <= end} == {SENT, RECEIVED}
    assert sorted(frame.time_ns for frame in recording.frames) == [frame.time_ns for frame in recording.frames]


def test_two_samples_a_frame(tmp_path, programs):
    scenario = tmp_path / "scenario.toml"
    scenario.write_text(SCENARIO + '[network]\nprofile = "fd"\nsamples_per_frame = 2\n')
    common = ["--bus", "vcan0", "--profile", "fd", "--json"]

    def start(role):
        flags = ["--role", role, "--case", f"{role}-pairs"]
        return lambda _: programs.resonarm("conformance", *common, *flags)

    plant = programs.resonarm("run", "--bus", "vcan0", "--scenario", scenario)
    assert passes_every_case(start("plant"))["skipped"] == 0
    plant.stop()
    node = kept_alive(lambda: programs.resonarm("exciter", "--bus", "vcan0", "--scenario", scenario))
    assert passes_every_case(start("exciter"), node)["skipped"] == 0
