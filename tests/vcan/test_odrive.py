"""The PyPI client `odrive-can`, as it is, drives two joints: `[wire] preset = "odrive"`."""

import asyncio
import json
import math

import can
import numpy as np
import pytest
from odrive_can.odrive import ODriveCAN
from processes import PATIENCE_S, wait_until
from recordings import Recording

STIFFNESS_NM_RAD, GEAR = 5e5, 10.0


def scenario(timeout_s):
    """Two drives whose torques are valid for so long, on an arm that is damped so much that nothing rings."""
    return f"""
[structure.set]
"link1.stiffness_nm_rad" = {STIFFNESS_NM_RAD}
"link2.stiffness_nm_rad" = {STIFFNESS_NM_RAD}
"link1.damping_nm_s_rad" = 2000.0
"link2.damping_nm_s_rad" = 2000.0
[wire]
preset = "odrive"
timeout_s = {timeout_s}
drives = [
    {{ node_id = 0, joint = 1, gear_ratio = {GEAR}, torque_constant_nm_a = 0.5 }},
    {{ node_id = 1, joint = 2 }},
]
"""


class Client(ODriveCAN):
    """The client with patience: by itself it gives up on an answer after half a second, which a busy machine exceeds."""

    async def _request(self, msg_name, timeout=PATIENCE_S):
        return await super()._request(msg_name, timeout)


HEARTBEAT, ENCODER, CURRENTS, SUPPLY = 0x01, 0x09, 0x14, 0x17
"""The commands of an axis that are heard, each only where it is waited for. The plant sends 600 readings a second; where
the client has a fifth of a processor it would fall ever further behind them, until memory ends."""


def heard(axis, *commands):
    """Filters for commands of an axis."""
    return [{"can_id": axis << 5 | command, "can_mask": 0x7FF} for command in commands]


class Axis:
    """An axis as the client sees it."""

    def __init__(self, number):
        self.number = number
        self.bus = can.Bus(interface="socketcan", channel="vcan0", can_filters=heard(number, HEARTBEAT))
        self.drive = Client(number, self.bus)

    def hear(self, *commands):
        self.bus.set_filters(heard(self.number, HEARTBEAT, *commands))

    async def reach(self, state):
        """Asks for a state until the heartbeat says it."""
        self.drive.set_controller_mode("TORQUE_CONTROL", "PASSTHROUGH")
        self.drive.set_axis_state_no_wait(state)
        await self.until(lambda: self.drive.axis_state == state)

    async def until(self, holds):
        async with asyncio.timeout(PATIENCE_S):
            while not holds():
                await asyncio.sleep(0.02)

    async def deflection_rad(self, torque_nm, gear=1.0):
        """Of the joint, under a torque of the motor that acts for a second: the mean of what the encoder says then."""
        for _ in range(50):
            self.drive.set_input_torque(torque_nm)
            await asyncio.sleep(0.02)
        turns = []
        self.drive.feedback_callback = lambda message, _: turns.append(message.data["Pos_Estimate"])
        self.hear(ENCODER)
        await self.until(lambda: len(turns) > 20)
        self.hear()
        self.drive.feedback_callback = None
        return sum(turns) / len(turns) * 2 * math.pi / gear


@pytest.fixture
def timeout_s():
    """Validity of a torque: while one axis is read, nothing is sent to the other for as long as a busy machine takes."""
    return PATIENCE_S


@pytest.fixture
def plant(programs, tmp_path, timeout_s):
    path = tmp_path / "odrive.toml"
    path.write_text(scenario(timeout_s))
    flags = ["--record", tmp_path / "run.mcap", "--json"]
    plant = programs.resonarm("run", "--bus", "vcan0", "--scenario", path, *flags)
    wait_until(lambda: "ready on" in plant.stderr, "the plant to be on the bus")
    return plant


def torques(tmp_path):
    """At the joints, of all samples that are recorded: on a busy machine a run in real time may lose records."""
    recording = Recording.whole(tmp_path / "run.mcap")
    return np.concatenate(recording.batches("/plant/steps", ("torque1_nm", "torque2_nm")))


def test_the_client_holds_torques_at_both_joints(plant, tmp_path):
    async def work():
        first, second = Axis(0), Axis(1)
        for axis in (first, second):
            await axis.drive.start()
        first.drive.set_input_torque(5.0)
        await first.reach("CLOSED_LOOP_CONTROL")
        assert second.drive.axis_state == "IDLE", "each axis is armed by itself"
        await second.reach("CLOSED_LOOP_CONTROL")
        deflections = [await first.deflection_rad(5.0, GEAR), await second.deflection_rad(20.0)]
        second.hear(SUPPLY)
        supply = await second.drive.get_bus_voltage_current()
        # Beyond the limits of joint 1, 1600 N·m: what is held stays.
        first.drive.set_input_torque(500.0)
        await asyncio.sleep(0.1)
        kept = await first.deflection_rad(5.0, GEAR)
        # The last request: the client takes each later frame of this kind for an answer, too.
        first.hear(CURRENTS)
        currents = await first.drive.get_iq()
        for axis in (first, second):
            axis.drive.stop()
        return deflections, kept, currents, supply

    deflections, kept, currents, supply = asyncio.run(work())
    report = end(plant)
    assert deflections == pytest.approx([5.0 * GEAR / STIFFNESS_NM_RAD, 20.0 / STIFFNESS_NM_RAD], rel=1e-3)
    assert kept == pytest.approx(5.0 * GEAR / STIFFNESS_NM_RAD, rel=1e-3)
    assert currents == {"Iq_Setpoint": pytest.approx(10.0), "Iq_Measured": pytest.approx(10.0)}
    assert supply["Bus_Voltage"] == 24.0
    assert report["refused"]["not_armed"] >= 1 and report["refused"]["out_of_range"] >= 1
    acted = torques(tmp_path)
    # The ramp at the end takes 50 ms.
    assert set(acted[:, 0]) <= {0.0} | {5.0 * GEAR * (left / 50) for left in range(1, 51)}
    assert acted[-1].tolist() == [0.0, 0.0]


@pytest.mark.parametrize("timeout_s", [5.0])
def test_the_watchdog_stops_both_and_only_the_client_arms_again(plant, tmp_path):
    async def work():
        first, second = Axis(0), Axis(1)
        for axis in (first, second):
            await axis.drive.start()
            await axis.reach("CLOSED_LOOP_CONTROL")
            axis.drive.set_input_torque(2.0)
        await first.until(lambda: first.drive.axis_state == "IDLE")
        await second.until(lambda: second.drive.axis_state == "IDLE")
        said = first.drive._last_heartbeat.data["Axis_Error"]
        first.drive.set_input_torque(2.0)
        first.drive.set_axis_state_no_wait("CLOSED_LOOP_CONTROL")
        await asyncio.sleep(0.5)
        assert first.drive.axis_state == "IDLE", "the error has to be cleared first"
        first.drive.clear_errors()
        await first.until(lambda: first.drive._last_heartbeat.data["Axis_Error"] == "NONE")
        await first.reach("CLOSED_LOOP_CONTROL")
        for axis in (first, second):
            axis.drive.stop()
        return said

    assert asyncio.run(work()) == "WATCHDOG_TIMER_EXPIRED"
    end(plant)


def end(plant):
    plant.stop()
    return json.loads(plant.stdout)
