// Events of a run in words. The names are those of recordings (docs/recording.md).

const times = (value) => value / 1000;
const hex = (value) => `0x${value.toString(16).toUpperCase()}`;
const counted = (count, noun) => `${count} ${noun}${count === 1 ? "" : "s"}`;

// The words for each name; functions of the event's number and the unit of the load.
const WORDS = {
  "state.boot_up": "the plant starts",
  "state.pre_operational": "the plant is ready (pre-operational)",
  "state.operational": "the plant is armed (operational)",
  "state.fault": "the plant is in the fault state",
  "emergency": (value) => `the plant reports emergency ${hex(value)}`,
  "partner.emergency": (value) => `the exciter reports emergency ${hex(value)}`,
  "plant.leaving": "the plant leaves the bus",
  "exciter.leaving": "the exciter leaves the bus",
  "schedule.slipped": (value) => `the schedule slipped by ${counted(value, "sample period")}`,
  "overrun.stolen": (value) => `${counted(value, "deadline")} missed while the host had the core`,
  "overrun.preempted": (value) => `${counted(value, "deadline")} missed while other threads had the core`,
  "plant.command.not_armed": "a command was rejected: the plant is not armed",
  "plant.command.late": "a command was rejected: it came too late",
  "plant.command.out_of_order": "a command was rejected: it is older than the one before",
  "plant.command.repeated": "a command was rejected: it was repeated",
  "plant.command.out_of_range": "a command was rejected: the load is beyond its limit",
  "plant.command.rate_of_change": "a command was rejected: the load changes too fast",
  "plant.command.travel": "a command was rejected: the travel is at its limit",
  "frame.refused": "a frame was rejected",
  "frame.format": (id) => `a frame was rejected: wrong format, identifier ${hex(id)}`,
  "frame.length": (id) => `a frame was rejected: wrong length, identifier ${hex(id)}`,
  "frame.checksum": (id) => `a frame was rejected: wrong checksum, identifier ${hex(id)}`,
  "frame.counter": (id) => `a frame was rejected: wrong counter, identifier ${hex(id)}`,
  "frame.value": (id) => `a frame was rejected: invalid value, identifier ${hex(id)}`,
  "frame.other_sender": "another node sends frames that only the plant may send",
  "events.lost": (value) => `${counted(value, "event")} dropped: too many came at once`,
  "bus.error_active": "the CAN controller is error-active",
  "bus.error_warning": "the CAN controller has reached its warning limit",
  "bus.error_passive": "the CAN controller is error-passive",
  "bus.off": "the CAN controller is bus-off",
  "bus.lost": (value) => (value === 1 ? "the bus is lost: bus-off" : "the bus is lost"),
  "bus.back": "the bus is back",
  "request.arm": "arming was requested in the live view",
  "request.disarm": "disarming was requested in the live view",
  "request.reset": "a reset was requested in the live view",
  "request.load_thousandths": (value, unit) => `set-point requested: load ${times(value)} ${unit}`,
  "request.frequency_mhz": (value) => `set-point requested: frequency ${times(value)} Hz`,
  "request.phase_mdeg": (value) => `set-point requested: phase ${times(value)}°`,
  "request.refused": "the controller refused the set-point",
};

// Events that are marked as bad.
const BAD = ["emergency", "partner.emergency", "state.fault", "bus.lost", "bus.off", "schedule.slipped"];

export const isBad = (name) => BAD.includes(name) || name.startsWith("overrun.");

// An event in words; one without words here has its name and number.
export function eventInWords({ name, value, text }, unit) {
  if (text) return text;
  const words = WORDS[name];
  if (words === undefined) return value === 0 ? name : `${name} ${value}`;
  return typeof words === "function" ? words(value, unit) : words;
}
