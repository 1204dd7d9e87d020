"""A plant and an exciter written from SPEC.md alone, each with one flaw if it is asked for: what the conformance cases
are tried on. `python3 own_node.py vcan0 plant --flaw takes-older`."""

import argparse
import math
import struct
import time

from own_wire import EXCITER, IDS, PLANT, Wire, dbc_hash

BOOT_UP, FAULT, OPERATIONAL, PRE_OPERATIONAL = 0, 4, 5, 127
ARM, DISARM, RESET = 1, 2, 3
# Codes of emergencies.
COMMAND_TIMEOUT, SENSOR_TIMEOUT, HEARTBEAT_LOST, PARTNER_FAULT, INCOMPATIBLE = 1, 2, 3, 4, 5
BUS_LOSS, SAMPLE_SEQUENCE, SLIPPED, LEAVING, SECOND_SENDER = 9, 10, 11, 12, 13
VERSION = 0x12
RATE_HZ, PERIOD_S = 200, 1 / 200
FORCE_LIMIT_N, FREQUENCY_HZ, AMPLITUDE_N = 600.0, 15.0, 20.0
COUNT_N = 0.02
# How late the flaw "late-heartbeats" is, and the flaw "slow-to-arm".
LATE_S, SLOW_S = 0.08, 3.0
CLIPPED_N = 12.0


class Node:
    """The common part of both nodes: states, heartbeats, hellos, the time listened."""

    def __init__(self, wire, lockstep):
        self.wire, self.flaw, self.lockstep = wire, wire.flaw, lockstep
        self.role, self.fd = wire.role, wire.fd
        self.title = "Plant" if self.role == PLANT else "Exciter"
        # The most that counts as listened between two looks.
        self.look_s = math.inf if self.flaw == "wall-clock" else 0.02 if lockstep else PERIOD_S
        self.timeout_s = 1.0 if lockstep else 0.35
        self.listened_s, self.looked_s = 0.0, time.monotonic()
        self.partner_hello = None
        self.partner_heard_s = 0.0
        self.late = []

    def boot(self):
        self.wire.boot()
        self.state = BOOT_UP
        self.say_state()
        self.state = PRE_OPERATIONAL
        self.say_state()
        self.hello()

    def say_state(self):
        self.heartbeat_at_s = time.monotonic() + 0.08
        for _ in range(31 if self.flaw == "heartbeat-flood" else 1):
            self.wire.send(f"{self.title}Heartbeat", bytes([self.state]))

    def change(self, state):
        self.state = state
        if self.flaw == "late-heartbeats":
            self.late.append(time.monotonic() + LATE_S)
            self.heartbeat_at_s = self.late[-1] + 0.08
        else:
            self.say_state()

    def hello(self):
        self.hello_at_s = time.monotonic() + 0.9
        own = struct.pack("<B3sH", VERSION, dbc_hash(self.fd).to_bytes(3, "little"), RATE_HZ)
        self.wire.send(f"{self.title}Hello", own, flags=int(self.fd))
        if self.fd:
            force_n = 10.0 if self.flaw == "beyond-limits" else FORCE_LIMIT_N
            self.wire.send(f"{self.title}Capabilities", 1, force_n, 0.0)

    def emergency(self, code, detail=0):
        self.wire.send(f"{self.title}Emergency", struct.pack("<HHH", code, detail, self.sample() & 0xFFFF))

    def fault(self, code, detail=0):
        if self.state != FAULT:
            self.emergency(code, detail)
            if self.flaw == "jumps-in-fault":
                self.wire.counters.update(dict.fromkeys(IDS, 7))
            self.change(FAULT)

    def mismatch(self):
        """Why the partner's hello doesn't fit, as the detail of the emergency; None if it does."""
        if self.partner_hello is None:
            return 0
        flags, content = self.partner_hello
        version, dbc, rate_hz = struct.unpack("<B3sH", content)
        if version >> 4 != VERSION >> 4:
            return 1
        if flags & 1 != self.fd:
            return 3
        if int.from_bytes(dbc, "little") != dbc_hash(self.fd):
            return 2
        return None if rate_hz == RATE_HZ else 4

    def look(self):
        now_s = time.monotonic()
        self.listened_s += min(now_s - self.looked_s, self.look_s)
        self.looked_s = now_s

    def due(self):
        """Sends the heartbeat and hello that are due, and delayed frames."""
        now_s = time.monotonic()
        if self.late and now_s >= self.late[0]:
            self.late.pop(0)
            self.say_state()
        if now_s >= self.heartbeat_at_s:
            self.say_state()
        if now_s >= self.hello_at_s:
            self.hello()

    def take(self, message):
        """Takes in a message: of a double, of the partner, or that the controller is bus-off."""
        name, flags, content = message
        self.look()
        if self.flaw == "wall-clock" and self.role == PLANT:
            # Frames that waited while it was stopped do not come first.
            self.judge()
        if name == "bus-off":
            if self.state == OPERATIONAL and self.flaw != "ignores-bus-off":
                self.lose_bus()
        elif name == "remote":
            if self.flaw == "answers-remote":
                self.say_state()
        elif name.startswith(self.title) or name in self.only_own:
            self.second_sender(name)
        elif name:
            self.partner_heard_s = self.listened_s
            self.handle(name, flags, content)


class Plant(Node):
    only_own = ("ImpedanceHead", "AccelerometerB", "AccelerometerC", "Sensors")

    def __init__(self, wire, lockstep):
        super().__init__(wire, lockstep)
        self.index, self.has_been_armed = 0, False
        self.held_n, self.ramp = 0.0, None
        self.boot()

    def sample(self):
        return self.index - 1

    def second_sender(self, name):
        self.fault(SECOND_SENDER, IDS[name])

    def lose_bus(self):
        self.fault(BUS_LOSS)

    def handle(self, name, flags, content):
        if name == "OperatorCommand" and content[1] == 1:
            self.request(content[0])
        elif name == "ForceCommand":
            if self.fd:
                sample, x_n, _ = content
            else:
                x, _, sample = struct.unpack("<hhH", content)
                x_n = x * COUNT_N
            self.command(sample, x_n)
        elif name == "TorqueCommand":
            sample = content[0] if self.fd else struct.unpack("<hhH", content)[2]
            self.command(sample, 0.0)
        elif name == "ExciterHello":
            is_first, self.partner_hello = self.partner_hello is None, (flags, content)
            if is_first:
                self.hello()
        elif name == "ExciterHeartbeat":
            if content[0] == BOOT_UP:
                self.partner_hello = None
            if content[0] in (BOOT_UP, FAULT) and self.state == OPERATIONAL:
                self.fault(PARTNER_FAULT, 2)
        elif name == "ExciterEmergency" and content[0] == SENSOR_TIMEOUT:
            # In lockstep an exciter whose commands are refused gives up for lack of samples.
            if self.lockstep and self.state == OPERATIONAL and self.refused:
                self.fault(COMMAND_TIMEOUT, self.refusals())
        elif name == "ExciterEmergency" and content[0] == LEAVING:
            self.partner_hello = None
            if self.state == OPERATIONAL:
                self.change(PRE_OPERATIONAL)

    def request(self, request):
        if request == ARM and self.state == PRE_OPERATIONAL:
            if (mismatch := self.mismatch()) is not None:
                self.emergency(INCOMPATIBLE, mismatch)
                return
            self.taken, self.taken_s, self.refused, self.why = None, self.listened_s, 0, 0
            self.has_been_armed = True
            self.answered = True
            self.change(OPERATIONAL)
        elif request == DISARM and self.state == OPERATIONAL:
            self.change(PRE_OPERATIONAL)
        elif request == RESET and self.state == FAULT and self.flaw != "ignores-reset":
            self.change(PRE_OPERATIONAL)

    def change(self, state):
        if self.state == OPERATIONAL:
            # When leaving it, the load held goes to zero in so many steps.
            steps = math.ceil(0.05 * RATE_HZ)
            self.ramp = [self.held_n * (steps - n) / steps for n in range(1, steps + 1)]
        super().change(state)

    def command(self, sample, x_n):
        if reason := self.refusal(sample, x_n):
            if self.state == OPERATIONAL:
                self.refused, self.why = self.refused + 1, reason
            return
        self.taken, self.taken_s, self.refused = sample, self.listened_s, 0
        self.held_n, self.ramp, self.answered = x_n, None, True

    def refusal(self, sample, x_n):
        """The reason to refuse a command, 0 if it is accepted."""
        if self.state != OPERATIONAL:
            return 1
        age = (self.sample() - sample) % 65536
        if self.lockstep and self.flaw != "takes-others" and age:
            return 2
        if age > 0.02 * RATE_HZ and self.flaw != "takes-others":
            return 2
        if self.taken is not None:
            ahead = (sample - self.taken) % 65536
            if ahead == 0:
                return 4
            if ahead >= 0x8000 and self.flaw != "takes-older":
                return 3
        return 5 if abs(x_n) > FORCE_LIMIT_N and self.flaw != "no-limit" else 0

    def publish(self):
        """A sample: the load held in the period before."""
        index = self.index & 0xFFFF
        if self.fd:
            self.wire.send("Sensors", 0, index, self.held_n, *[0.0] * 5)
        else:
            # Rounded to the nearest count, and cut at the ends, with a flag.
            count = round(self.held_n * 50)
            cut = max(-32767, min(32767, count))
            self.wire.send("ImpedanceHead", struct.pack("<hhH", cut, 0, index), flags=int(cut != count))
            for name in ("AccelerometerB", "AccelerometerC"):
                self.wire.send(name, struct.pack("<hhH", 0, 0, index))
        self.index += 1
        self.answered = self.state != OPERATIONAL
        if self.ramp:
            self.held_n = self.ramp.pop(0)

    def refusals(self):
        """How many commands were rejected since the last accepted one, and the reason of the last refusal."""
        return min(self.refused, 255) | (self.why << 8 if self.refused else 0)

    def judge(self):
        """The timeouts of an operational plant."""
        if self.state != OPERATIONAL:
            return
        if self.listened_s - self.taken_s >= (1.0 if self.lockstep else 0.02):
            self.fault(COMMAND_TIMEOUT, self.refusals())
        elif self.listened_s - self.partner_heard_s >= self.timeout_s:
            self.fault(HEARTBEAT_LOST, 2)

    def is_due(self):
        """Whether the next sample may go: in lockstep when the last one is answered, and at once."""
        if self.lockstep and not self.has_been_armed:
            return False
        if self.lockstep and self.state == OPERATIONAL:
            return self.answered
        return time.monotonic() >= self.tick_s

    def wait(self):
        """Takes incoming frames until something is due."""
        while not self.is_due():
            wake_s = min(self.heartbeat_at_s, self.hello_at_s, *self.late, self.looked_s + self.look_for_s())
            message = self.wire.receive(wake_s - time.monotonic())
            if message is not None:
                self.take(message)
            elif self.lockstep:
                self.look()
                self.judge()
            self.due()
            if self.lockstep and self.state == OPERATIONAL:
                self.look()
                self.judge()

    def look_for_s(self):
        if self.lockstep and self.state == OPERATIONAL:
            return 0.02
        return max(self.tick_s - self.looked_s, 0.0) if self.has_been_armed or not self.lockstep else 0.02

    def run(self):
        self.tick_s = time.monotonic() + PERIOD_S
        while True:
            self.wait()
            # Waiting frames are taken before a timeout is checked.
            while (message := self.wire.receive(0)) is not None:
                self.take(message)
            self.look()
            self.judge()
            self.due()
            behind = int((time.monotonic() - self.tick_s) / PERIOD_S)
            if behind > 3 and not self.lockstep:
                self.tick_s += behind * PERIOD_S
                self.emergency(SLIPPED, min(behind, 65535))
            self.tick_s = self.tick_s + PERIOD_S if not self.lockstep else time.monotonic() + PERIOD_S
            self.publish()


class Exciter(Node):
    only_own = ("ForceCommand", "TorqueCommand")

    def __init__(self, wire, lockstep):
        super().__init__(wire, lockstep)
        self.answered, self.stale, self.n, self.is_over = None, 0, 0, False
        self.indices, self.plant_state, self.retry_s = {}, None, 0.0
        self.could_ask_s = None
        self.boot()

    def sample(self):
        return self.answered or 0

    def second_sender(self, name):
        self.stop(FAULT, SECOND_SENDER, IDS[name])

    def lose_bus(self):
        self.stop(FAULT, BUS_LOSS)

    def stop(self, state, code=None, detail=0):
        """The work is over: the node says so, and leaves."""
        if self.is_over:
            return
        self.is_over = True
        if code is not None:
            self.fault(code, detail)
        else:
            self.change(state)

    def handle(self, name, flags, content):
        if name == "PlantHello":
            is_first, self.partner_hello = self.partner_hello is None, (flags, content)
            if (mismatch := self.mismatch()) is not None:
                self.stop(FAULT, INCOMPATIBLE, mismatch)
            elif is_first:
                self.hello()
                self.ask()
        elif name == "PlantHeartbeat":
            self.watch(content[0])
        elif name == "PlantEmergency":
            self.heed(content)
        elif name == "Sensors":
            self.whole(content[1])
        elif name in ("ImpedanceHead", "AccelerometerB", "AccelerometerC"):
            self.take_frame(name, struct.unpack("<hhH", content)[2])

    def watch(self, state):
        self.plant_state = state
        if state == BOOT_UP:
            self.partner_hello = None
        if self.state == OPERATIONAL:
            if state in (BOOT_UP, FAULT):
                self.stop(FAULT, PARTNER_FAULT, 1)
            elif state == PRE_OPERATIONAL:
                self.stop(PRE_OPERATIONAL)
        elif state == OPERATIONAL and self.state == PRE_OPERATIONAL and self.partner_hello and not self.is_over:
            self.sampled_s = self.listened_s
            self.change(OPERATIONAL)

    def heed(self, content):
        code = struct.unpack("<HHH", content)[0]
        if code == LEAVING and self.state == OPERATIONAL:
            self.stop(PRE_OPERATIONAL)
        elif code == LEAVING:
            self.partner_hello = None
        elif code not in (SLIPPED, INCOMPATIBLE) and self.state == OPERATIONAL and self.flaw != "deaf-to-emergencies":
            self.stop(FAULT, PARTNER_FAULT, 1)

    def ask(self):
        """Asks the plant to arm, and again in 100 ms."""
        self.retry_s = time.monotonic() + 0.1
        # From when it could have asked, not from its start: the tester may begin late.
        self.could_ask_s = self.could_ask_s or time.monotonic()
        if self.flaw == "slow-to-arm" and time.monotonic() < self.could_ask_s + SLOW_S:
            return
        if self.plant_state == FAULT:
            self.wire.send("OperatorCommand", bytes([RESET, 1, 0, 0, 0, 0]))
        self.wire.send("OperatorCommand", bytes([ARM, 1, 0, 0, 0, 0]))

    def take_frame(self, name, index):
        """Takes a frame of a sample, which is whole when it has all three, in their order."""
        self.indices[name] = index
        missing = {"without-head": "ImpedanceHead", "without-b": "AccelerometerB"}.get(self.flaw)
        needed = [frame for frame in ("ImpedanceHead", "AccelerometerB", "AccelerometerC") if frame != missing]
        last = "AccelerometerC"
        if self.flaw == "without-c":
            needed, last = needed[:2], "AccelerometerB"
        if name == last and all(self.indices.get(frame) == index for frame in needed):
            self.whole(index)

    def whole(self, index):
        if self.state != OPERATIONAL:
            return
        if self.answered is not None:
            ahead, window = (index - self.answered) % 65536, max(16, int(0.35 * RATE_HZ))
            if ahead == 0 or ahead >= 65536 - window:
                self.stale += 1
                if self.stale == 10:
                    self.stop(FAULT, SAMPLE_SEQUENCE, index)
                return
            if ahead > window:
                self.stop(FAULT, SAMPLE_SEQUENCE, index)
                return
            self.n += ahead
        self.answered, self.sampled_s = index, self.listened_s
        if self.flaw != "skips-tenth" or index % 10:
            self.answer(index)

    def answer(self, index):
        time_s = self.n * PERIOD_S
        x_n = min(time_s / 0.1, 1.0) * AMPLITUDE_N * math.sin(2 * math.pi * FREQUENCY_HZ * time_s)
        if self.flaw == "opposite-sign":
            x_n = -x_n
        elif self.flaw == "clips":
            x_n = max(-CLIPPED_N, min(x_n, CLIPPED_N))
        if self.fd:
            self.wire.send("ForceCommand", index, x_n, 0.0)
            return
        count = round(x_n if self.flaw == "unscaled" else x_n * 50)
        content = struct.pack("<hhH", count, 0, index)
        self.wire.send("ForceCommand", content[1::-1] + content[2:] if self.flaw == "swapped" else content)

    def is_ready(self):
        return self.state == PRE_OPERATIONAL and not self.is_over and self.partner_hello is not None

    def run(self):
        while not self.is_over or self.late:
            wake_s = min(self.heartbeat_at_s, self.hello_at_s, *self.late, self.looked_s + PERIOD_S)
            message = self.wire.receive(wake_s - time.monotonic())
            while message is not None:
                self.take(message)
                message = self.wire.receive(0)
            self.look()
            self.due()
            if self.state == OPERATIONAL and self.listened_s - self.sampled_s >= self.timeout_s:
                self.stop(FAULT, SENSOR_TIMEOUT, self.sample())
            elif self.is_ready() and time.monotonic() >= self.retry_s:
                self.ask()
        if self.flaw != "never-leaves":
            self.emergency(LEAVING)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("interface")
    parser.add_argument("role", choices=[PLANT, EXCITER])
    parser.add_argument("--flaw")
    parser.add_argument("--fd", action="store_true")
    parser.add_argument("--lockstep", action="store_true")
    given = parser.parse_args()
    wire = Wire(given.interface, given.role, given.fd, given.flaw)
    if given.role == PLANT:
        Plant(wire, given.lockstep).run()
    # An exciter is started again whenever it has ended.
    while True:
        Exciter(wire, given.lockstep).run()


if __name__ == "__main__":
    main()
