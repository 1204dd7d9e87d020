"""Rattlesnake, the vibration controller of Sandia National Laboratories, on the shaker of bench.dbc.

`python rattlesnake_control.py vcan0 random.toml --rattlesnake FOLDER` runs the program of that folder without its
window: all of its processes, its system identification, its control law, its level changes, aborts and stop. Two parts
are replaced. The acquisition and the output are hardware that plays each sample on the CAN bus (`Link`). The window is
`Operator`, which puts the messages into the queues that the window would put there when somebody presses its buttons.

Nothing of Rattlesnake is copied here. Its licence is the GPL, version 3.
"""

import argparse
import ctypes
import functools
import inspect
import multiprocessing
import os
import queue
import signal
import sys
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import tomllib

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from random_control import FRAME, RATE_HZ, Specification

from quick_shaker import QuickShaker

SOURCE = "https://github.com/sandialabs/rattlesnake-vibration-controller"
PACKAGES = "numpy scipy netCDF4 qtpy PyQt5 pyqtgraph openpyxl"
ENVIRONMENT = "Random"

# Values of the window that are offered when Rattlesnake starts, except for the two that it can't know.
READ_S = WRITE_S = 0.25
RAMP_S = 0.5
OVERLAP = 0.5
AVERAGES = 20
# Rms of the noise of the system identification: the default of 0.01 V is meant for an amplifier.
IDENTIFIED_N = 1.0
# The channel of the control accelerometer aborts at this many times the specified rms.
ABORT_SIGMA = 6.0

# The converter of the bus reaches 655 N, and has steps of 0.02 N.
LARGEST_N, STEP_N = 655.0, 0.02
# In lockstep the plant waits for the output. A frame that takes longer than this is one that never comes.
FRAME_WAIT_S = 5.0
# After this time without a reading the plant has left. While an operator speaks, time may stand for 30 s.
READING_WAIT_S = 40.0
# A stopped test is started again within this time, or not at all.
RESTART_S = 10.0
# Time for Rattlesnake to shut a test down, or to quit, before the script goes on without it.
PATIENCE_S = 30.0
# Samples that are played at once while there is no frame.
IDLE = 50
# Pause of a process that looks again and again whether there is something to do.
POLL_S = 0.05
POLLS = {"RUN_HARDWARE", "GENERATE_SIGNALS", "RUN_NOISE", "RUN_TRANSFER_FUNCTION", "RUN_CONTROL"}


class PlantLeft(Exception):
    """The plant no longer sends readings."""


class Link:
    """The shaker on the bus, in a process of its own.

    While the hardware runs, each frame of drives is played and its readings are passed on. Otherwise zeros are played:
    as with a real shaker, time goes on while Rattlesnake does not acquire. It goes on at most as fast as real time.
    """

    def __init__(self, open_shaker):
        self.open_shaker = open_shaker
        self.drives, self.readings = multiprocessing.Queue(), multiprocessing.Queue(1)
        self.words = multiprocessing.Queue()
        # Each of these values has one writer at a time, and needs no lock.
        flag = functools.partial(multiprocessing.Value, "b", False, lock=False)
        # What is asked of the link: by the operator, by the acquisition, and by the output.
        self.is_enabled, self.is_running, self.is_put_out = flag(), flag(), flag()
        # What the link does.
        self.is_idle, self.is_driven, self.is_over = flag(), flag(), flag()
        # Samples played since the shaker was enabled.
        self.samples = multiprocessing.Value("q", 0, lock=False)

    def serve(self):
        """Plays until the operator disables the shaker, or the plant leaves."""
        try:
            with self.open_shaker() as shaker:
                self.play(shaker)
        except PlantLeft as left:
            print(f"the plant has left: {left}", flush=True)
        finally:
            self.is_over.value = True

    def play(self, shaker):
        while not self.is_enabled.value:
            time.sleep(0.02)
        shaker.drive(0.0, enable=True)
        # Readings from before the shaker is enabled are repeated, and not answered.
        while not self.read(shaker)["Enabled"]:
            pass
        due_s = time.monotonic()
        while self.is_enabled.value:
            is_running = bool(self.is_running.value)
            self.is_idle.value = not is_running
            drives = self.next_frame() if is_running else np.zeros(IDLE)
            self.is_driven.value = bool(np.any(drives))
            frame = np.array([self.sample(shaker, force_n) for force_n in drives.tolist()]).T
            if is_running:
                self.pass_on(frame)
            due_s = max(due_s + len(drives) / RATE_HZ, time.monotonic())
            time.sleep(max(0.0, due_s - time.monotonic()))
        shaker.drive(0.0, enable=False)

    def next_frame(self):
        """The next frame of the output; zeros if the output has stopped, and if its frame does not come."""
        until_s = time.monotonic() + FRAME_WAIT_S
        while self.is_running.value and self.is_put_out.value and time.monotonic() < until_s:
            try:
                frame = self.drives.get(timeout=0.1)
            except queue.Empty:
                continue
            # A converter can't put out what is no number.
            return np.clip(np.nan_to_num(frame[0]), -LARGEST_N, LARGEST_N)
        return np.zeros(IDLE)

    def sample(self, shaker, force_n):
        """Plays a sample, and returns a column of the channel table: control, response, force."""
        shaker.drive(force_n, enable=True)
        reading = self.read(shaker)
        if not reading["Enabled"]:
            raise PlantLeft("it has disabled the shaker")
        self.samples.value += 1
        return reading["Control"], reading["Response"], round(force_n / STEP_N) * STEP_N

    def read(self, shaker):
        reading = shaker.read(READING_WAIT_S)
        if shaker.word:
            self.words.put(str(shaker.word))
        if reading is None:
            raise PlantLeft("it sends no reading")
        return reading

    def pass_on(self, frame):
        while self.is_running.value:
            try:
                return self.readings.put(frame, timeout=0.1)
            except queue.Full:
                continue


def emptied(frames):
    """Takes everything out of a queue."""
    while True:
        try:
            frames.get(timeout=0.01)
        except queue.Empty:
            return


class BusAcquisition:
    """The acquisition of Rattlesnake, which `components/abstract_hardware.py` describes: reads frames of the link."""

    def __init__(self, link, _file, _queue):
        self.link = link

    def set_up_data_acquisition_parameters_and_channels(self, test_data, channel_data):
        self.size, self.delay = test_data.samples_per_read, test_data.samples_per_write
        self.channels = len(channel_data)
        self.pending = np.zeros((self.channels, 0))

    def start(self):
        self.pending = self.pending[:, :0]
        self.link.is_idle.value = False
        self.link.is_running.value = True

    def get_acquisition_delay(self):
        return self.delay

    def read(self):
        while self.pending.shape[1] < self.size:
            try:
                frame = self.link.readings.get(timeout=0.5)
            except queue.Empty:
                if not self.link.is_over.value:
                    continue
                frame = np.zeros((self.channels, self.size))
            self.pending = np.concatenate([self.pending, frame], axis=1)
        frame, self.pending = np.split(self.pending, [self.size], axis=1)
        return frame

    def read_remaining(self):
        return np.zeros((self.channels, 1))

    def stop(self):
        self.link.is_running.value = False
        # The frame that is played now still arrives.
        while not (self.link.is_idle.value or self.link.is_over.value):
            emptied(self.link.readings)
        emptied(self.link.readings)

    def close(self):
        """Nothing to release."""


class BusOutput:
    """The output of Rattlesnake: passes frames to the link."""

    def __init__(self, link, _queue):
        self.link = link

    def set_up_data_output_parameters_and_channels(self, test_data, channel_data):
        """Nothing to set up: there is one output."""

    def start(self):
        self.link.is_put_out.value = True

    def write(self, data):
        self.link.drives.put(np.array(data))

    def ready_for_new_output(self):
        return self.link.drives.empty()

    def stop(self):
        self.link.is_put_out.value = False
        emptied(self.link.drives)

    def close(self):
        """Nothing to release."""


def imported(folder):
    """Imports what is used of Rattlesnake. Exits if it is not in the folder, or lacks a package."""
    folder = Path(folder)
    if not (folder / "components" / "random_vibration_sys_id_environment.py").is_file():
        sys.exit(f"{folder} has no Rattlesnake: expected a clone of {SOURCE}; name its folder by --rattlesnake")
    # Its modules import Qt, but show no window.
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    sys.path.insert(0, str(folder.resolve()))
    try:
        import rattlesnake
        from components import random_vibration_sys_id_environment as random
        from components import sdynpy_system_virtual_hardware, utilities
        from components.abstract_sysid_environment import SystemIdCommands
    except ImportError as error:
        sys.exit(f"Rattlesnake can't be imported: {error}; install its packages: pip install {PACKAGES}")
    return SimpleNamespace(
        program=rattlesnake,
        random=random,
        hardware=sdynpy_system_virtual_hardware,
        utilities=utilities,
        Global=utilities.GlobalCommands,
        SystemId=SystemIdCommands,
        Command=random.RandomVibrationCommands,
        laws=folder.resolve() / "control_laws" / "control_laws.py",
    )


def pausing(snake):
    """Replaces Rattlesnake's queues of commands by ones on which its processes poll with a pause.

    Its output, its signal generation and its data analysis command themselves without end to go on, and take a whole
    processor each. Where there are fewer processors, nothing else would run.
    """

    class PausingQueue(snake.utilities.VerboseMessageQueue):
        def get(self, task_name, *arguments, **options):
            message = super().get(task_name, *arguments, **options)
            if message[0].name in POLLS:
                time.sleep(POLL_S)
            return message

    snake.random.VerboseMessageQueue = snake.utilities.VerboseMessageQueue = PausingQueue


def log_task(program, folder, messages):
    """Rattlesnake's own log task, which writes into the working directory."""
    os.chdir(folder)
    program.log_file_task(messages)


class Processes:
    """The queues and processes of Rattlesnake, as its `rattlesnake.py` creates them."""

    def __init__(self, snake, folder):
        self.active = [multiprocessing.Value("i", 0) for _ in range(2)]
        log = multiprocessing.Queue()
        names = ["Controller Communication", "Acquisition Command", "Output Command", "Streaming Command"]
        verbose = [snake.utilities.VerboseMessageQueue(log, f"{name} Queue") for name in names]
        command = snake.utilities.VerboseMessageQueue(log, f"{ENVIRONMENT} Command Queue")
        data_in, data_out = multiprocessing.Queue(), multiprocessing.Queue()
        synchronized, hardware, self.window = (multiprocessing.Queue() for _ in range(3))
        self.controller, self.acquisition, self.output, self.streaming = verbose
        self.environment, self.log = command, log
        own = [{ENVIRONMENT: each} for each in (command, data_in, data_out)]
        queues = snake.utilities.QueueContainer(*verbose, log, synchronized, hardware, self.window, *own)
        environments = [[snake.program.ControlTypes.RANDOM, ENVIRONMENT]]
        program, (acquires, puts_out) = snake.program, self.active
        own = (ENVIRONMENT, command, self.window, self.controller, log, data_in, data_out, acquires, puts_out)
        self.log_process = started(log_task, program, folder, log)
        self.others = [
            started(snake.random.random_vibration_process, *own),
            started(program.acquisition_process, queues, environments, acquires),
            started(program.output_process, queues, environments, puts_out),
            started(program.streaming_process, queues),
        ]

    def end(self, snake):
        """Quits as the window does when it is closed."""
        for commands in (self.environment, self.acquisition, self.output, self.streaming):
            commands.put("UI", (snake.Global.QUIT, None))
        until_s = time.monotonic() + PATIENCE_S
        for process in self.others:
            process.join(max(0.0, until_s - time.monotonic()))
        self.log.put("quit")
        self.log_process.join(1.0)


def started(task, *arguments):
    process = multiprocessing.Process(target=task, args=arguments)
    process.start()
    return process


def end_with_parent():
    """Ends this process when the one that forked it ends, however that ends: an audit may kill the script."""
    SET_PARENT_DEATH_SIGNAL = 1
    ctypes.CDLL(None).prctl(SET_PARENT_DEATH_SIGNAL, signal.SIGKILL)


def channels(snake, specification):
    """Rows of the channel table. Only an output has a feedback device."""
    names = list(inspect.signature(snake.utilities.Channel).parameters)
    acceleration = {"physical_device": "Virtual", "channel_type": "Accel", "unit": "m/s2", "node_direction": "X+"}
    force = {"physical_device": "Virtual", "channel_type": "Force", "unit": "N", "node_direction": "X+"}
    rows = [
        acceleration | {"node_number": "1", "abort_level": str(ABORT_SIGMA * specification.rms)},
        acceleration | {"node_number": "2"},
        force | {"node_number": "1", "feedback_device": "Virtual", "abort_level": str(specification.drive_peak_n)},
    ]
    return [snake.utilities.Channel(**(dict.fromkeys(names) | row)) for row in rows]


def acquisition_parameters(snake, specification):
    rows = channels(snake, specification)
    return snake.utilities.DataAcquisitionParameters(
        rows,
        RATE_HZ,
        round(RATE_HZ * READ_S),
        round(RATE_HZ * WRITE_S),
        6,  # SDynPy System Integration, which is replaced by the bus
        None,
        [ENVIRONMENT],
        np.ones((len(rows), 1), bool),
        1,
        1,
    )


def random_parameters(snake, specification, path, law, is_updated):
    """The page of the environment and that of the system identification, filled in."""
    limits = tomllib.loads(Path(path).read_text())["random"]

    def band(name):
        """Lower and upper limits of the lines, which are no numbers where there are none."""
        factors = [10 ** (db / 10) for db in limits.get(name, [np.nan, np.nan])]
        values = [np.where(specification.is_driven, factor * specification.density, np.nan) for factor in factors]
        return np.array(values)[:, :, np.newaxis]

    parameters = snake.random.RandomVibrationMetadata(
        number_of_channels=3,
        sample_rate=RATE_HZ,
        samples_per_frame=FRAME,
        test_level_ramp_time=RAMP_S,
        cola_window="Tukey",
        cola_overlap=OVERLAP,
        cola_window_exponent=0.5,
        update_tf_during_control=is_updated,
        frames_in_cpsd=AVERAGES,
        cpsd_window="Hann",
        cpsd_overlap=OVERLAP,
        allow_automatic_aborts=True,
        control_python_script=str(snake.laws),
        control_python_function=law,
        control_python_function_type=0,
        control_python_function_parameters="",
        control_channel_indices=[0],
        output_channel_indices=[2],
        specification_frequency_lines=np.arange(FRAME // 2 + 1) * RATE_HZ / FRAME,
        specification_cpsd_matrix=specification.density.astype(complex)[:, np.newaxis, np.newaxis],
        specification_warning_matrix=band("tolerance_db"),
        specification_abort_matrix=band("abort_db"),
        response_transformation_matrix=None,
        output_transformation_matrix=None,
    )
    identification = {
        "frame_size": FRAME,
        "averaging_type": "Linear",
        "noise_averages": AVERAGES,
        "averages": AVERAGES,
        "exponential_averaging_coefficient": 0.01,
        "estimator": "H1",
        "level": IDENTIFIED_N,
        "level_ramp_time": RAMP_S,
        "signal_type": "Random",
        "window": "Hann",
        "overlap": OVERLAP,
        "burst_on": 0.5,
        "pretrigger": 0.05,
        "burst_ramp_fraction": 0.05,
    }
    for name, value in identification.items():
        setattr(parameters, f"sysid_{name}", value)
    return parameters


class Operator:
    """Somebody at the window, and the window: presses its buttons, and passes on what the processes ask of it."""

    def __init__(self, snake, processes, link, specification):
        self.snake, self.processes, self.link, self.specification = snake, processes, link, specification
        self.is_armed = self.is_identified = self.can_identify = self.can_start = False
        # The last word said on the bus.
        self.word = None

    def fill_in(self, acquisition, parameters):
        """Presses the buttons that initialise the data acquisition and the environment."""
        everything = {ENVIRONMENT: list(range(len(acquisition.channel_list)))}
        message = self.snake.Global.INITIALIZE_DATA_ACQUISITION
        self.processes.environment.put("UI", (message, acquisition))
        self.processes.acquisition.put("UI", (message, (acquisition, everything)))
        self.processes.output.put("UI", (message, (acquisition, everything)))
        self.parameters = parameters
        self.processes.environment.put("UI", (self.snake.Global.INITIALIZE_ENVIRONMENT_PARAMETERS, parameters))

    def identify(self):
        """Starts the system identification, and waits for its end."""
        self.processes.environment.put("UI", (self.snake.SystemId.START_SYSTEM_ID, (self.parameters, None)))
        while not (self.is_identified and self.can_identify):
            self.wait()

    def arm(self):
        self.is_armed = True
        self.processes.controller.put("UI", (self.snake.Global.RUN_HARDWARE, None))
        while not all(each.value for each in self.processes.active):
            self.wait()

    def disarm(self):
        self.is_armed = False
        self.processes.controller.put("UI", (self.snake.Global.STOP_HARDWARE, None))
        self.stop()

    def stop(self):
        self.processes.environment.put("UI", (self.snake.Command.STOP_CONTROL, None))

    def control(self):
        """Controls the schedule; whether it came to its end."""
        if not self.is_armed:
            self.arm()
        self.word, self.can_start = None, False
        (first_db, _), *_ = self.specification.levels
        self.processes.controller.put("UI", (self.snake.Global.START_ENVIRONMENT, ENVIRONMENT))
        self.processes.environment.put("UI", (self.snake.Command.START_CONTROL, 10 ** (first_db / 20)))
        # The schedule begins with the first drive, or soon if there is none.
        at = self.link.samples.value + round(FRAME_WAIT_S * RATE_HZ)
        while not self.link.is_driven.value and self.link.samples.value < at:
            self.wait()
        at = self.link.samples.value
        for number, (level_db, seconds) in enumerate(self.specification.levels):
            if number > 0:
                self.processes.environment.put("UI", (self.snake.Command.ADJUST_TEST_LEVEL, 10 ** (level_db / 20)))
            at += round((RAMP_S + seconds) * RATE_HZ)
            while self.link.samples.value < at:
                self.wait()
                if self.word == "stop":
                    print("stopped by the operator", flush=True)
                    self.word = None
                    self.stop()
                    self.wait_for_end()
                if self.can_start:
                    print("the test has ended early", flush=True)
                    return False
        self.stop()
        self.wait_for_end()
        return True

    def wait_for_end(self):
        """Waits until Rattlesnake has shut the test down, which an error may keep it from."""
        until_s = time.monotonic() + PATIENCE_S
        while not self.can_start and time.monotonic() < until_s:
            self.wait()
        self.can_start = True

    def is_told_to_start(self):
        """Waits for the word to start again."""
        until = self.link.samples.value + round(RESTART_S * RATE_HZ)
        while self.word != "start" and self.link.samples.value < until:
            self.wait()
        return self.word == "start"

    def wait(self):
        """Does what the window does for messages, and waits a little. Raises PlantLeft."""
        for message, data in taken(functools.partial(self.processes.controller.get, "UI", block=False)):
            self.instructed(message, data)
        for message, data in taken(functools.partial(self.processes.window.get, block=False)):
            self.shown(message, data)
        for word in taken(functools.partial(self.link.words.get, block=False)):
            self.word = word
        if self.link.is_over.value:
            raise PlantLeft
        time.sleep(POLL_S)

    def instructed(self, message, data):
        """Passes on an instruction of a process to the acquisition and the output."""
        known = self.snake.Global
        if message in (known.RUN_HARDWARE, known.STOP_HARDWARE):
            self.processes.acquisition.put("UI", (message, data))
            self.processes.output.put("UI", (message, data))
        elif message == known.START_ENVIRONMENT:
            self.processes.output.put("UI", (message, data))
        elif message == known.STOP_ENVIRONMENT:
            self.processes.acquisition.put("UI", (message, data))
        elif message == known.UPDATE_METADATA:
            _, self.parameters = data
        elif message == known.COMPLETED_SYSTEM_ID:
            self.is_identified = True

    def shown(self, message, data):
        """Heeds what a process shows in the window."""
        if message == "error":
            print("error:", *data, flush=True)
        elif message == "stop":
            # A channel has reached its abort level.
            self.disarm()
        elif message == ENVIRONMENT:
            what, shown = data
            if what == "enable_system_id":
                self.can_identify = True
            elif what == "enable_control":
                self.can_start = True
            elif what == "control_predictions":
                print(f"predicted drive: {shown[4]} N rms, error {shown[5]} dB rms", flush=True)


def taken(get):
    """Everything that is in a queue."""
    while True:
        try:
            yield get()
        except queue.Empty:
            return


def run(snake, link, specification, acquisition, parameters, folder):
    """Runs the test, and after a stop those that the operator starts; whether the last one came to its end."""
    pausing(snake)
    snake.hardware.SDynPySystemAcquisition = functools.partial(BusAcquisition, link)
    snake.hardware.SDynPySystemOutput = functools.partial(BusOutput, link)
    processes = Processes(snake, folder)
    serving = started(link.serve)
    operator = Operator(snake, processes, link, specification)
    is_complete = False
    try:
        operator.fill_in(acquisition, parameters)
        link.is_enabled.value = True
        operator.identify()
        is_complete = operator.control()
        while not is_complete and operator.is_told_to_start():
            is_complete = operator.control()
        if operator.is_armed:
            operator.disarm()
            until_s = time.monotonic() + PATIENCE_S
            while any(each.value for each in processes.active) and time.monotonic() < until_s:
                operator.wait()
        link.is_enabled.value = False
        serving.join(PATIENCE_S)
    except PlantLeft:
        is_complete = False
    processes.end(snake)
    return is_complete


def main():
    parser = argparse.ArgumentParser(description="Runs Rattlesnake without its window on the shaker of bench.dbc.")
    parser.add_argument("channel", help="SocketCAN interface")
    parser.add_argument("specification", help="specification of the random test, a TOML file")
    parser.add_argument("--rattlesnake", required=True, metavar="FOLDER", help=f"clone of {SOURCE}")
    parser.add_argument("--law", default="match_trace_pseudoinverse", help="function of control_laws/control_laws.py")
    parser.add_argument("--update", action="store_true", help="update the transfer function during control")
    parser.add_argument("--log", metavar="FOLDER", help="keep Rattlesnake.log in this folder")
    flags = parser.parse_args()
    # Processes inherit the hardware that is put in the place of Rattlesnake's.
    multiprocessing.set_start_method("fork")
    os.register_at_fork(after_in_child=end_with_parent)
    snake = imported(flags.rattlesnake)
    specification = Specification(flags.specification)
    acquisition = acquisition_parameters(snake, specification)
    parameters = random_parameters(snake, specification, flags.specification, flags.law, flags.update)

    with tempfile.TemporaryDirectory() as folder:
        is_complete = run(
            snake,
            Link(functools.partial(QuickShaker, flags.channel)),
            specification,
            acquisition,
            parameters,
            flags.log or folder,
        )
    sys.stdout.flush()
    # Queues of processes that were ended may still hold messages, for which an ordinary exit would wait.
    os._exit(0 if is_complete else 1)


if __name__ == "__main__":
    main()
