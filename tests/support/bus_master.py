"""A simulation master for FMUs on buses by FMI-LS-BUS 1.0, written from the standards alone: it joins terminals, lets
clocks tick, and steps from event to event."""

import ctypes
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, field

KIND, RULE = "org.fmi-ls-bus.network-terminal", "org.fmi-ls-bus.transceiver"
MEMBERS = {"Rx_Data", "Rx_Clock", "Tx_Data", "Tx_Clock"}
UNKNOWN, UNCHANGED, CHANGED = 0, 1, 2
# Iterations of one event until nodes are taken to answer each other without end.
MOST_ITERATIONS = 1000


class MasterError(Exception):
    """What is wrong with FMUs or their connections."""


@dataclass
class Member:
    """A terminal of an instance."""

    slave: object
    name: str
    references: dict
    mime: str
    counts_down: bool
    due_ns: int | None = None


@dataclass
class Master:
    """Instances, the connections between their terminals, and the time, ns."""

    slaves: list = field(default_factory=list)
    links: list = field(default_factory=list)
    now_ns: int = 0
    # Bytes carried, as pairs of the name of the terminal that sent them and them.
    carried: list = field(default_factory=list)

    def add(self, fmu, **parameters):
        """An instance of an FMU in initialization mode; returns its terminals by name."""
        slave, slave_log = fmu.made(event_mode=True)
        slave.log = slave_log
        self.slaves.append(slave)
        for name, value in parameters.items():
            setter = {bool: slave.setBoolean, int: slave.setUInt64, str: slave.setString}[type(value)]
            setter(fmu.of(f"parameter.{name}"), [value])
        slave.enterInitializationMode()
        return {name: member(slave, fmu, name, of) for name, of in terminals(fmu).items()}

    def join(self, one, other):
        if one.mime != other.mime:
            raise MasterError(f"{one.name} carries {one.mime}, {other.name} {other.mime}")
        self.links += [(one, other), (other, one)]

    def start(self):
        for slave in self.slaves:
            slave.exitInitializationMode()
        self.intervals()
        self.event()

    def event(self):
        """An event at this time, of as many iterations as it takes; ends in step mode."""
        for _ in range(MOST_ITERATIONS):
            ticks = [link for link in self.links if self.ticks(link[0])]
            for sender, _ in ticks:
                if sender.counts_down:
                    sender.slave.setClock([sender.references["Tx_Clock"]], [True])
                    sender.due_ns = None
            data = [sender.slave.getBinary([sender.references["Tx_Data"]])[0] for sender, _ in ticks]
            for (sender, receiver), content in zip(ticks, data, strict=True):
                receiver.slave.setClock([receiver.references["Rx_Clock"]], [True])
                if content:
                    receiver.slave.setBinary([receiver.references["Rx_Data"]], [content])
                    self.carried.append((sender.name, content))
            needed = [slave.updateDiscreteStates()[0] for slave in self.slaves]
            self.intervals()
            if not any(needed) and not any(self.ticks(sender) for sender, _ in self.links):
                break
        else:
            raise MasterError(f"no end of the event at {self.now_ns} ns")
        for slave in self.slaves:
            slave.enterStepMode()

    def ticks(self, sender):
        if sender.counts_down:
            return sender.due_ns is not None and sender.due_ns <= self.now_ns
        return sender.slave.getClock([sender.references["Tx_Clock"]])[0]

    def intervals(self):
        """Asks when countdown clocks tick next."""
        for sender, _ in self.links:
            if sender.counts_down:
                interval, qualifier = (ctypes.c_double * 1)(), (ctypes.c_int * 1)()
                reference = (ctypes.c_uint32 * 1)(sender.references["Tx_Clock"])
                sender.slave.getIntervalDecimal(reference, interval, qualifier)
                if qualifier[0] == CHANGED:
                    sender.due_ns = self.now_ns + round(interval[0] * 1e9)

    def advance(self, until_ns):
        """Steps to `until_ns`, a sample of triggered nodes ahead at most, with an event wherever a countdown clock or
        an FMU asks for it."""
        while self.now_ns < until_ns:
            dues = [sender.due_ns for sender, _ in self.links if sender.due_ns is not None]
            next_ns = min([until_ns, *dues])
            time_s, length_s = self.now_ns * 1e-9, next_ns * 1e-9 - self.now_ns * 1e-9
            asked = [slave.doStep(time_s, length_s)[0] for slave in self.slaves]
            self.now_ns = next_ns
            if any(asked) or next_ns in dues:
                for slave in self.slaves:
                    slave.enterEventMode()
                self.event()

    def end(self):
        for slave in self.slaves:
            slave.freeInstance()


def terminals(fmu):
    """The bus terminals of an FMU: variables by member, by name."""
    root = ElementTree.parse(fmu.folder / "terminalsAndIcons/terminalsAndIcons.xml").getroot()
    found = {}
    for terminal in root.iter("Terminal"):
        if (terminal.get("terminalKind"), terminal.get("matchingRule")) == (KIND, RULE):
            variables = terminal.iter("TerminalMemberVariable")
            members = {one.get("memberName"): one.get("variableName") for one in variables}
            if set(members) != MEMBERS:
                raise MasterError(f"{terminal.get('name')} has the members {sorted(members)}")
            found[terminal.get("name")] = members
    return found


def member(slave, fmu, name, members):
    variables = {variable.name: variable for variable in fmu.description.modelVariables}
    clock = variables[members["Tx_Clock"]]
    # FMPy does not read the media type.
    root = ElementTree.parse(fmu.folder / "modelDescription.xml").getroot()
    mime = next(one.get("mimeType") for one in root.iter("Binary") if one.get("name") == members["Rx_Data"])
    references = {key: fmu.references[variable] for key, variable in members.items()}
    return Member(slave, f"{fmu.path.stem}.{name}", references, mime, clock.intervalVariability == "countdown")


def operations(content):
    """Code and fields of each operation."""
    while content:
        code, length = (int.from_bytes(content[at : at + 4], "little") for at in (0, 4))
        yield code, content[8:length]
        content = content[length:]
