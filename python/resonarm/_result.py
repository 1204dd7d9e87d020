"""The result of a bench's run, and assertions about it."""

import math
from os import PathLike
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from ._dtypes import Array
from .recording import Recording
from .session import Report
from .words import Fault, NodeState, RecordingPart, Undecided

LOADS = ("force_n", "torque_nm")
PARTS: tuple[RecordingPart, ...] = ("samples", "states")
"""The parts of a recording that have signals."""
ROWS = 8
"""Rows that a failure shows before and after the failing sample."""


class Result:
    """The result of a run, with assertions. An assertion that fails shows the signal around the failure and names the
    recording.

    No assertion passes on a run that ended by a fault or an error, whatever it is about; a test that expects a fault
    calls `assert_faulted` first.
    """

    def __init__(self, plant: Report, exciter: Report | None, output: str, path: Path) -> None:
        self.plant = plant.plant
        """The plant's report: the document of `resonarm run --json`."""
        self.exciter = exciter.exciter if exciter else {}
        """The exciter's report; empty if the controller was a program."""
        self.responses = exciter.responses if exciter else plant.responses
        """The responses that an emulated exciter read, as `Report.responses`."""
        self.output = output
        """The output of a program."""
        self.recording = Recording(path)
        """The plant's recording."""
        self._is_fault_expected = False

    def __repr__(self) -> str:
        exciter = f", exciter {self.exciter['outcome']}" if self.exciter else ""
        path = str(self.recording.path)
        return f"<Result: plant {self.plant['outcome']}{exciter}, {self.plant['samples']} samples, {path!r}>"

    def signal(self, name: str) -> tuple[Array, Array]:
        """Times, s, and values of a channel of the recording by its name in the CSV of `resonarm export`: a reading of
        any sensor, such as `acceleration_c_x_m_s2`, the held load, such as `force_x_n` or `torque1_nm`, or a state,
        such as `alpha1_rad`."""
        _samples, times, values = self._rows(name)
        return times, values

    def _rows(self, name: str) -> tuple[Array, Array, Array]:
        """The samples, times and values of a signal."""
        known: list[str] = []
        for part in PARTS:
            for vector, components in self.recording.channels(part):
                known += components
                if name not in components:
                    continue
                rows = self.recording.read(part)
                if vector in LOADS and len(rows) and rows["is_end"][-1]:
                    rows = rows[:-1]  # The state at the end of a run has no load.
                # A vector of one component, too, has two dimensions; a channel alone has one.
                values = rows[vector] if rows[vector].ndim == 1 else rows[vector][:, components.index(name)]
                return rows["sample"], rows["time_s"], values
        raise ValueError(f"there is no signal {name!r}: expected one of {', '.join(known)}")

    def _finite(self, name: str) -> tuple[Array, Array, Array]:
        """The same, if every value is a number."""
        __tracebackhide__ = True
        samples, times, values = self._rows(name)
        if len(bad := np.flatnonzero(~np.isfinite(values))):
            at = bad[0]
            what = "NaN" if np.isnan(values[at]) else f"{values[at]:g}"
            self.fail(f"{name} is {what} at sample {samples[at]} ({times[at]:g} s)", name, int(samples[at]))
        return samples, times, values

    def fail(self, message: str, name: str, at: int) -> None:
        """Raises AssertionError with a signal from some samples before the sample `at` to some after."""
        __tracebackhide__ = True
        samples, times, values = self._rows(name)
        shown = np.flatnonzero((samples + ROWS >= at) & (samples <= at + ROWS))
        lines = [
            f"{'>' if samples[k] == at else ' '} sample {samples[k]:6}  {times[k]:10.4f} s  {values[k]:+12.5g}"
            for k in shown
        ]
        raise AssertionError("\n".join([message, f"  {name}:", *lines, f"recording: {self.recording.path}"]))

    def _bad_end(self) -> str | None:
        """The fault or error that ended the run, in words; None if there was none."""
        fault, error = self.plant["fault"], self.plant["error"]
        ends = []
        if self.plant["outcome"] in ("faulted", "failed") or error:
            why = error or _in_words(fault)
            ends.append(f"the plant ended {self.plant['outcome']}: {why}")
        if self.exciter and self.exciter["outcome"] in ("faulted", "failed", "aborted"):
            ends.append(f"the exciter ended {self.exciter['outcome']}: {self.exciter['reason']}")
        if fault is not None and fault["name"] == "partner fault":
            ends.reverse()  # The fault began at the exciter, which says why.
        return "\n  ".join([*ends, *self._mistakes()]) if ends else None

    def _mistakes(self) -> list[str]:
        """Returns the mistakes of the controller: commands and frames that the plant, or either end, did not accept."""
        lines = [self.plant["cause"]] if self.plant.get("cause") else []
        refused = ", ".join(f"{count} {reason}" for reason, count in self.plant["refused"].items() if count)
        if refused:
            first = self.plant.get("first_refused_command")
            lines.append(f"commands were rejected: {refused}" + (f"; the first of them is {first}" if first else ""))
        for end, report in (("plant", self.plant), ("exciter", self.exciter)):
            if first := report.get("first_refused_frame"):
                lines.append(
                    f"frames that the {end} rejected: {report['bus']['refused']}; the first of them is {first}"
                )
        return lines

    def _fault_sample(self) -> int:
        """The sample at which the plant faulted last; the last sample if it did not."""
        events = self.recording.events
        faults = events["sample"][events["name"] == "state.fault"]
        return int(faults[-1]) if len(faults) else self.plant["samples"] - 1

    def _never_armed(self) -> str | None:
        """A message if the plant was never armed."""
        if self.plant["outcome"] == "not-armed" or not (self.recording.events["name"] == "state.operational").any():
            return "the plant was never armed: no command acted on the arm"
        return None

    def _fail_at_the_end(self, why: str) -> None:
        __tracebackhide__ = True
        self.fail(why, "force_x_n", self._fault_sample())

    def _check_end(self) -> None:
        """Fails if the run ended by a fault or an error, or if the plant was never armed."""
        __tracebackhide__ = True
        if not self._is_fault_expected and (why := self._bad_end() or self._never_armed()):
            self._fail_at_the_end(why)

    def assert_completed(self) -> None:
        """The plant was armed, and neither it nor an emulated exciter ended by a fault or an error."""
        __tracebackhide__ = True
        if why := self._bad_end() or self._never_armed():
            self._fail_at_the_end(why)
        if self.exciter and self.exciter["outcome"] not in ("finished", "plant-left"):
            self._fail_at_the_end(f"the exciter ended {self.exciter['outcome']}: {self.exciter['reason']}")

    def assert_controlled(self, *, share: float = 0.5) -> None:
        """`assert_completed`, and the controller did something: a load other than zero acted in at least this share, 0
        to 1, of the samples from arming on. A controller that arms the plant and then commands nothing, or only zeros,
        completes its run and fails here. The samples before the first command and after the last one count, too."""
        __tracebackhide__ = True
        if not 0 < share <= 1:
            raise ValueError(f"share is {share:g}: it must be above 0 and at most 1")
        self.assert_completed()
        events, states = self.recording.events, self.recording.states
        armed_at = int(events["sample"][events["name"] == "state.operational"][0])
        rows = states[:-1] if len(states) and states["is_end"][-1] else states
        armed = rows[rows["sample"] >= armed_at]
        loaded = np.zeros(len(armed), bool)
        for vector in LOADS:
            loaded |= (armed[vector] != 0).any(axis=1)
        count = int(np.count_nonzero(loaded))
        if count == 0 or count < share * len(armed):
            self._fail_at_the_end(
                f"the controller did not control the arm: a load other than zero acted in {count} of the {len(armed)} "
                f"samples from arming on, expected at least {share:.0%}. Check that it answers every sample by the "
                "load to hold"
            )

    def assert_faulted(self, fault: Fault | None = None) -> None:
        """The plant ended by a fault, of this name in the protocol's specification if one is given, such as command
        timeout. From then on the other assertions, except `assert_completed`, are about the time before the fault."""
        __tracebackhide__ = True
        found = self.plant["fault"]
        if self.plant["outcome"] != "faulted" or found is None:
            exciter = f", the exciter {self.exciter['outcome']}" if self.exciter else ""
            what = f"by the fault {fault!r}" if fault else "by a fault"
            self._fail_at_the_end(
                f"expected the run to end {what}: the plant ended {self.plant['outcome']}{exciter}",
            )
        elif fault is not None and found["name"] != fault:
            self._fail_at_the_end(f"the plant ended faulted: {_in_words(found)}; expected the fault {fault!r}")
        self._is_fault_expected = True

    def assert_no_overrun(self) -> None:
        """No deadline was missed, in real time; in simulated time there are none."""
        __tracebackhide__ = True
        self._check_end()
        if self.plant["overruns"]:
            late = self.recording.read("ticks")
            at = int(late["sample"][np.flatnonzero(late["overruns"])[0]])
            self.fail(f"{self.plant['overruns']} deadlines were missed", "force_x_n", at)

    def assert_no_refused_command(self) -> None:
        """Every command received without error acted on the arm, and every frame was valid. The answer to the last
        sample of a run that ends with its duration arrives after the plant has left, and doesn't count."""
        __tracebackhide__ = True
        self._check_end()
        refused = {reason: count for reason, count in self.plant["refused"].items() if count}
        if self.plant["outcome"] == "completed":
            refused.pop("not_armed", None)
        invalid = self.plant["bus"]["refused"]
        if not (refused or invalid):
            return
        names = [f"plant.command.{reason}" for reason in refused] + ["frame.refused"] * bool(invalid)
        events = self.recording.events
        named = events["sample"][np.isin(events["name"], names)]
        parts = [f"{count} {reason}" for reason, count in refused.items()]
        what = [f"commands were rejected: {', '.join(parts)}"] if parts else []
        if invalid:
            what.append("1 frame was invalid" if invalid == 1 else f"{invalid} frames were invalid")
        self.fail("; ".join(what), "force_x_n", int(named[0]) if len(named) else 0)

    def assert_force_below(self, limit_n: float) -> None:
        """The force that acted on the tip stayed below a limit, N, in each axis."""
        __tracebackhide__ = True
        _number("limit_n", limit_n)
        self._check_end()
        signals = {"x": "force_x_n", "y": "force_y_n"}
        for axis, name in signals.items():
            samples, _times, values = self._finite(name)
            above = np.flatnonzero(np.abs(values) >= limit_n)
            if len(above):
                message = f"the force along {axis} reaches {np.abs(values).max():g} N: limit {limit_n:g} N"
                self.fail(message, name, int(samples[above[0]]))

    def assert_state_reached(self, state: NodeState, within_s: float) -> None:
        """The plant reached a state, such as operational or fault, within this time of its samples, s."""
        __tracebackhide__ = True
        if state not in get_args(NodeState):
            raise ValueError(f"there is no state {state!r}: expected one of {', '.join(get_args(NodeState))}")
        within = round(_number("within_s", within_s) / self.recording.dt_s)
        events = self.recording.events
        reached = events["sample"][events["name"] == f"state.{state}"]
        bad_end = None if state == "fault" or self._is_fault_expected else self._bad_end()
        if not len(reached) or reached[0] > within:
            when = f"reached at {reached[0] * self.recording.dt_s:g} s" if len(reached) else "never reached"
            more = f"; {bad_end}" if bad_end else ""
            message = f"the state {state} was {when}: expected within {within_s:g} s{more}"
            self.fail(message, "force_x_n", min(within, self.plant["samples"] - 1))
        if bad_end:
            self._fail_at_the_end(bad_end)

    def amplitude(self, name: str, frequency_hz: float, from_s: float = 0.0, to_s: float = math.inf) -> float:
        """Amplitude of the sine at a frequency in a signal, by least squares together with an offset, over an interval
        of at least a period. Raises ValueError for intervals and frequencies that the run can't resolve."""
        __tracebackhide__ = True
        _samples, times, values = self._finite(name)
        chosen = self._span(times, frequency_hz, from_s, to_s)
        phase = 2 * np.pi * frequency_hz * times[chosen]
        columns = np.stack([np.cos(phase), np.sin(phase), np.ones_like(phase)], axis=1)
        fit = np.linalg.lstsq(columns, values[chosen], rcond=None)[0]
        return float(np.hypot(fit[0], fit[1]))

    def _span(self, times: Array, frequency_hz: float, from_s: float, to_s: float) -> NDArray[np.bool_]:
        """The rows of an interval, if they resolve the frequency."""
        dt_s = self.recording.dt_s
        if not (math.isfinite(frequency_hz) and frequency_hz > 0):
            raise ValueError(f"frequency_hz is {frequency_hz:g}: it must be a positive number")
        if frequency_hz >= 0.5 / dt_s:
            raise ValueError(
                f"frequency_hz is {frequency_hz:g}: at a sample rate of {1 / dt_s:g} Hz it must be below {0.5 / dt_s:g}"
            )
        if _number("from_s", from_s) > to_s or math.isnan(to_s):
            raise ValueError(f"from_s is {from_s:g} and to_s {to_s:g}: give the earlier one first")
        end_s = times[-1] if len(times) else 0.0
        if math.isfinite(to_s) and to_s > end_s + dt_s:
            raise ValueError(f"to_s is {to_s:g}: the run ends at {end_s:g} s")
        chosen = (times >= from_s) & (times <= to_s)
        if np.count_nonzero(chosen) * dt_s < 1 / frequency_hz:
            raise ValueError(
                f"from {from_s:g} s to {min(to_s, end_s):g} s are {np.count_nonzero(chosen)} samples: a period of "
                f"{frequency_hz:g} Hz has {1 / frequency_hz / dt_s:g}"
            )
        return chosen

    def _check_halves(self, times: Array, frequency_hz: float, from_s: float, to_s: float) -> None:
        """Raises ValueError, with the caller's numbers, unless both halves of an interval resolve the frequency."""
        chosen = times[self._span(times, frequency_hz, from_s, to_s)]
        middle, dt_s = (from_s + to_s) / 2, self.recording.dt_s
        fewest = min(np.count_nonzero(chosen <= middle), np.count_nonzero(chosen >= middle))
        if fewest * dt_s < 1 / frequency_hz:
            raise ValueError(
                f"from_s is {from_s:g} and to_s {to_s:g}: a half of it has {fewest} samples, a period of "
                f"{frequency_hz:g} Hz has {1 / frequency_hz / dt_s:g}"
            )

    def assert_in_specification(
        self,
        specification: str | PathLike[str],
        *channels: str,
        reference: str | None = None,
        from_s: float | None = None,
        to_s: float | None = None,
        undecided: Undecided = "fail",
    ) -> dict[str, Any]:
        """The readings meet a specification of a vibration or shock test; see
        `resonarm.testing.assert_in_specification`."""
        __tracebackhide__ = True
        self._check_end()
        return assert_in_specification(
            self.recording,
            specification,
            *channels,
            reference=reference,
            from_s=from_s,
            to_s=to_s,
            undecided=undecided,
        )

    def assert_settled(
        self,
        name: str,
        frequency_hz: float,
        *,
        from_s: float,
        to_s: float,
        amplitude: float | None = None,
        within: float = 0.02,
    ) -> None:
        """A signal vibrates evenly at a frequency, Hz: its amplitude in the second half of an interval equals that in
        the first, and an expected one if it is given, within the relative tolerance `within`."""
        __tracebackhide__ = True
        self._check_end()
        _number("within", within)
        middle = (_number("from_s", from_s) + _number("to_s", to_s)) / 2
        samples, times, _values = self._finite(name)
        self._check_halves(times, frequency_hz, from_s, to_s)
        halves = [self.amplitude(name, frequency_hz, *ends) for ends in ((from_s, middle), (middle, to_s))]
        at = int(samples[np.searchsorted(times, middle)])
        if halves[1] == 0:
            self.fail(f"{name} does not vibrate at {frequency_hz:g} Hz", name, at)
        if abs(halves[1] - halves[0]) > within * halves[1]:
            self.fail(f"{name} has not settled: its amplitude goes from {halves[0]:g} to {halves[1]:g}", name, at)
        if amplitude is not None and abs(halves[1] - _number("amplitude", amplitude)) > within * amplitude:
            self.fail(f"{name} has an amplitude of {halves[1]:g}: expected {amplitude:g} within {within:.1%}", name, at)


def assert_in_specification(
    recording: Recording | str | PathLike[str],
    specification: str | PathLike[str],
    *channels: str,
    reference: str | None = None,
    from_s: float | None = None,
    to_s: float | None = None,
    undecided: Undecided = "fail",
) -> dict[str, Any]:
    """A recording meets a specification of a vibration or shock test, as `Recording.judge` finds. A record that does
    not decide this fails, or passes with `undecided="pass"`; a record in which no test begins always fails. Returns
    the document of the verdict."""
    __tracebackhide__ = True
    if undecided not in get_args(Undecided):
        raise ValueError(f"undecided is {undecided!r}: expected one of {', '.join(get_args(Undecided))}")
    if not isinstance(recording, Recording):
        recording = Recording(recording)
    judged = recording.judge(specification, *channels, reference=reference, from_s=from_s, to_s=to_s)
    is_begun = judged["begins_s"] is not None
    if judged["verdict"] == "out" or (judged["verdict"] == "undecided" and (undecided == "fail" or not is_begun)):
        of = judged["configuration"]
        span = f"{', '.join(of['channels'])} from {of['from_s']:g} to {of['to_s']:g} s"
        lines = [f"{span}: {judged['verdict']} by the specification {specification}", *_reasons(judged)]
        if not is_begun and undecided == "pass":
            lines.append('no test begins in the record, which undecided="pass" does not cover')
        raise AssertionError("\n  ".join(lines) + f"\nrecording: {recording.path}")
    return judged


def _reasons(judged: dict[str, Any]) -> list[str]:
    """What a verdict found, in words: the worst value with its limit first."""
    found, test = judged["found"], judged["specification"]["test"]
    if "reason" in found:
        lines = [found["reason"]]
    elif test["kind"] == "random":
        lines = _reasons_of_random(judged)
    elif test["kind"] == "sine":
        lines = _reasons_of_sine(found, test)
    else:
        lines = _reasons_of_shots(found, test)
    for limit in found.get("limits", []):
        level = f"largest {limit['largest_db']:+.2f} dB over it, at {limit['largest_hz']:g} Hz"
        lines.append(f"limit of {limit['channel']} {limit['verdict']}: {level}")
    if judged["clipped"]:
        lines.append(f"{judged['clipped']} values are clipped, so that the record can't show that the test is in")
    return lines


def _reasons_of_random(judged: dict[str, Any]) -> list[str]:
    found, level = judged["found"], judged["level"]
    lines = []

    def deviation(line: dict[str, Any]) -> float:
        return 10 * math.log10(max(line["density"], 1e-300) / line["demand"])

    def beyond(line: dict[str, Any]) -> float:
        low, high = line["tolerance_db"]
        above, below = deviation(line) - high, low - deviation(line)
        return float(above if line["is_limited"] else max(above, below))

    worst = max(found["lines"], key=beyond, default=None)
    if worst is not None:
        (low, high), (least, most) = worst["interval_db"], worst["tolerance_db"]
        lines.append(
            f"worst line {worst['frequency_hz']:g} Hz {worst['verdict']}: {deviation(worst):+.2f} dB, with 95 % "
            f"probability {low:+.2f} to {high:+.2f} dB; tolerance {least:+g} to {most:+g} dB"
        )
    inside, open_, out = found["counts"]
    lines.append(
        f"profile {found['profile']}: {inside} lines in, {open_} undecided, {out} out; "
        f"{found['degrees_of_freedom']:.0f} degrees of freedom"
    )
    if found["deciding_dof"] is not None:
        lines.append(f"about {found['deciding_dof']:.0f} degrees of freedom would decide it")
    if found["rms"]["verdict"] is not None:
        rms = found["rms"]
        lines.append(f"rms {rms['verdict']}: {rms['rms_m_s2']:.4g} m/s², specified {rms['demand_m_s2']:.4g} m/s²")
    if judged["begins_s"] is None:
        lines.append("no stretch is within 2 dB of the specified rms: all of the record was judged")
    elif level is not None and level["verdict"] != "in":
        asked = "" if level["asked_s"] is None else f" of {level['asked_s']:g} s asked for"
        lines.append(
            f"level {level['verdict']}: {level['full_s']:g} s at full level{asked}, "
            f"at most {level['highest_db']:+.2f} dB"
        )
    return lines


def _reasons_of_sine(found: dict[str, Any], test: dict[str, Any]) -> list[str]:
    worst = max(range(2), key=lambda end: abs(found["extremes"][end] - 1))
    lines = [
        f"amplitude {found['amplitude']}: worst {100 * (found['extremes'][worst] - 1):+.1f} % at "
        f"{found['extremes_hz'][worst]:.4g} Hz; tolerance {100 * test['tolerance']:g} %"
    ]
    if found["whole"] < found["asked"]:
        lines.append(f"{found['whole']} of {found['asked']} sweeps are whole")
    if found["rate"] is not None:
        rates = ", ".join(f"{sweep['rate']:.4g}" for sweep in found["passes"])
        lines.append(f"sweep rate {found['rate']}: {rates}")
    if found["is_continuous"] is False:
        lines.append("the sweep is stepped")
    return lines


def _reasons_of_shots(found: dict[str, Any], test: dict[str, Any]) -> list[str]:
    full = [shot for shot in found["shots"] if shot["is_full"]]
    lines = []
    if full and test["kind"] == "shock":
        worst = max(full, key=lambda shot: shot["error"])
        lines.append(
            f"worst shot at {worst['t_s']:.4g} s: error {worst['error']:.1%} of the peak; limit {test['band']:.1%}"
        )
        for name, limit, words in (
            ("velocity_change", test["velocity_tolerance"], "velocity change off by"),
            ("end_velocity", test["end_velocity_tolerance"], "velocity at the end over the velocity change"),
            ("outside", test["outside"], "beside the pulse over the peak"),
        ):
            most = max(abs(shot[name] or 0.0) for shot in full)
            if limit is not None and most > limit:
                lines.append(f"{words} {most:.1%}; limit {limit:.1%}")
    elif full:
        at, line = max(
            ((shot["t_s"], line) for shot in full for line in shot["lines"]),
            key=lambda found: abs(found[1]["deviation_db"]),
        )
        lines.append(
            f"worst line {line['frequency_hz']:.4g} Hz of the shot at {at:.4g} s {line['verdict']}: "
            f"{line['response_m_s2']:.4g} m/s², {line['deviation_db']:+.2f} dB of the specified "
            f"{line['demand_m_s2']:.4g} m/s²"
        )
    lines.append(f"shots at full level: {len(full)} of {found['asked']}")
    if found.get("is_first_low") is False:
        lines.append("the first shot is more than 10 % above its level")
    return lines


def _number(name: str, given: float) -> float:
    """Raises ValueError unless this is a number."""
    if not math.isfinite(given):
        raise ValueError(f"{name} is {given:g}: it must be a number")
    return given


def _in_words(fault: dict[str, Any] | None) -> str:
    """A fault of a report, in words."""
    if fault is None:
        return "a fault that was not latched"
    detail = f", detail {fault['detail']}" if fault["detail"] else ""
    return f"{fault['name']} (code {fault['code']}{detail}) at sample {fault['sample']}"
