"""The conformance tool against a plant and an exciter that were written in Python from SPEC.md alone: right they pass,
and with one flaw they are failed by the case for it."""

import sys
from pathlib import Path

import pytest
from test_conformance import SKIPPED, judged, passes_every_case

NODE = Path(__file__).parents[1] / "support" / "own_node.py"
SINE = ["--expect-frequency-hz", 15, "--expect-force-n", 20]

# The case that must fail a node with the flaw, and its reason.
CRC = {flaw: ("hello", "its hello is wrong: ") for flaw in ("wrong-polynomial", "wrong-start", "wrong-data-id")}
BOTH = {
    "counter-by-2": ("counters", "a step of 2, not 1"),
    "counter-by-4": ("counters", "a step of 4, not 1"),
    "one-counter": ("counters", "counter"),
    "ignores-bus-off": ("bus-off", "bus-off"),
    "heartbeat-flood": ("heartbeats", "at most 20 a second are allowed"),
    "answers-remote": ("remote-frames", "it answers remote frames"),
    **CRC,
}
FLAWS = {
    "plant": {
        **BOTH,
        "any-base": ("foreign-base", "it arms in spite of the mismatch: no hello seen"),
        "takes-older": ("older-command", "it acts: the head reads -5.00 N"),
        "late-heartbeats": ("states", "not at once"),
        "ignores-reset": ("reset", "in fault it ignores the reset"),
        "wall-clock": ("stopped", "its own silence for its partner's"),
        "no-limit": ("too-large", "it acts: the head reads -606.00 N"),
    },
    "exciter": {
        **BOTH,
        "any-base": ("foreign-base", "for a hello with another base"),
        "without-head": ("incomplete", "it answers sample"),
        "without-b": ("incomplete", "it answers sample"),
        "without-c": ("incomplete", "it answers sample"),
        "late-heartbeats": ("state-changes", "before its heartbeat operational"),
        "never-leaves": ("leaves", "did not say before that it leaves"),
        "beyond-limits": ("own-limits", "beyond the 10 N of its capabilities"),
        "unscaled": ("sine", "Is it sent without the factor of its counts?"),
        "swapped": ("sine", "Is its byte order wrong?"),
        "opposite-sign": ("sine", "Is a sign wrong?"),
        "clips": ("sine", "they are clipped at -12 and 12 N"),
        "slow-to-arm": ("asks-to-arm", "it asks for arming"),
        "deaf-to-emergencies": ("plant-emergency", "no heartbeat fault"),
        "skips-tenth": ("answers", "at a regular distance of 10 samples"),
        "jumps-in-fault": ("bus-off", "(R-2.1)"),
    },
}
FD = ("no-limit", "beyond-limits")

# The node has no limits of rate and travel, and the bus no bit rate.
NOT_TRIED = ("-too-fast", "-too-far", "-load-hello", "-load-wrong-crc", "-load-states", "-load-plant-disarmed")


class Bench:
    """A node under test, and the tool's flags for it."""

    def __init__(self, programs, role, *flags):
        self.programs, self.role, self.flags = programs, role, flags
        self.node = programs.start("node", sys.executable, NODE, "vcan0", role, *flags)

    def conformance(self, *flags):
        common = ["--bus", "vcan0", "--role", self.role, "--patience-s", 5, "--json", "--pid", self.node.process.pid]
        common += SINE if self.role == "exciter" else []
        common += ["--profile", "fd"] if "--fd" in self.flags else []
        common += ["--mode", "lockstep"] if "--lockstep" in self.flags else []
        return self.programs.resonarm("conformance", *common, *flags)

    def judged(self, case):
        found = judged(lambda: self.conformance("--case", case))
        assert self.node.running(), self.node.stderr
        return found


@pytest.mark.parametrize("role, flaw", [(role, flaw) for role, flaws in FLAWS.items() for flaw in flaws])
def test_a_node_with_a_flaw_is_failed_by_the_case_for_it(programs, role, flaw):
    case, why = FLAWS[role][flaw]
    bench = Bench(programs, role, "--flaw", flaw, *(["--fd"] if flaw in FD else []))
    found = bench.judged(f"{role}-{case}")
    assert found["verdict"] == "failed" and why in found["reason"], found
    if flaw in CRC:
        hello = next(row for row in found["refused"] if row["message"] == f"{role.title()}Hello")
        came, right = (bytes.fromhex(hello[name].split("#")[1]) for name in ("frame", "expected_frame"))
        assert came[0] != right[0] and came[1:] == right[1:], hello
        assert hello["reason"].endswith(f"CRC 0x{came[0]:02X} instead of 0x{right[0]:02X}"), hello


@pytest.mark.parametrize("flags", [[], ["--lockstep"]], ids=["real-time", "lockstep"])
@pytest.mark.parametrize("role", FLAWS)
def test_the_node_without_a_flaw_passes_every_case(programs, role, flags):
    bench = Bench(programs, role, *flags)
    beyond = ["--beyond-n", 650] if role == "plant" else []
    passes_every_case(lambda more: bench.conformance("--soak-s", 1, *beyond, *more), skipped_too=SKIPPED + NOT_TRIED)


def test_a_plant_that_takes_the_answer_to_another_sample_is_failed_in_lockstep(programs):
    bench = Bench(programs, "plant", "--lockstep", "--flaw", "takes-others")
    found = bench.judged("lockstep-plant-other-samples")
    assert found["verdict"] == "failed" and "continues with" in found["reason"], found
