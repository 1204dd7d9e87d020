"""Programs started, waited for and, whatever happens, ended."""

import json
import os
import signal
import socket
import subprocess
import tempfile
import time
from pathlib import Path

# Until a program that does not end is taken to hang, and what one waits for not to come, s. Machines differ by a factor
# of ten, and a busy one stops a process again and again.
PATIENCE_S = 300

# Characters of each output of a program that the report of a failed test shows.
LAST_CHARACTERS = 2000

RESONARM = os.environ.get("RESONARM_BIN", "target/release/resonarm")


class Program:
    """A running program. Its output goes to files, so that no pipe can fill up."""

    def __init__(self, folder, name, arguments):
        self.name = name
        self.paths = [folder / f"{name}.{stream}" for stream in ("stdout", "stderr")]
        with self.paths[0].open("wb") as out, self.paths[1].open("wb") as err:
            words = [str(argument) for argument in arguments]
            self.process = subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=out, stderr=err)

    @property
    def stdout(self):
        return self.paths[0].read_text()

    @property
    def stderr(self):
        return self.paths[1].read_text()

    def running(self):
        return self.process.poll() is None

    def wait(self, timeout_s=PATIENCE_S):
        """The exit code."""
        try:
            return self.process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            self.end()
            raise AssertionError(f"{self.name} did not end within {timeout_s} s: {self.stderr}") from None

    def result(self, timeout_s=PATIENCE_S, code=0):
        """Its one JSON document, after it has ended with `code`."""
        ended = self.wait(timeout_s)
        assert ended == code, f"{self.name} ended with {ended}: {self.stdout}{self.stderr}"
        return json.loads(self.stdout)

    def settle(self):
        """Waits until, for half a second, its output has not grown and it has slept, which it does not while it has
        work: on a busy machine it may have work and no core."""
        size, since = -1, time.monotonic()
        while time.monotonic() - since < 0.5:
            if (now := self.paths[0].stat().st_size) != size or not self.asleep():
                size, since = now, time.monotonic()
            time.sleep(0.05)

    def asleep(self):
        """Whether it waits for something, according to the kernel; one that has ended does, too."""
        state = Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()[0]
        return state in "SZ"

    def kill(self):
        """SIGKILL: it can't do anything about it."""
        self.process.kill()
        assert self.process.wait(PATIENCE_S) == -signal.SIGKILL

    def stop(self, timeout_s=PATIENCE_S):
        """SIGTERM; the exit code."""
        self.process.terminate()
        return self.wait(timeout_s)

    def end(self):
        if self.running():
            self.process.kill()
            self.process.wait(PATIENCE_S)

    def last_words(self):
        """Whether it still runs, else its exit code, and the end of its outputs: for the report of a failed test."""
        code = "still running" if self.running() else f"ended with {self.process.returncode}"
        texts = [path.read_bytes().decode(errors="replace")[-LAST_CHARACTERS:].strip() for path in self.paths]
        return "\n".join([f"{self.name}: {code}", *filter(None, texts)])


class Programs:
    """Starts programs; at the end of a `with` block none of them is left."""

    def __init__(self):
        self.started = []

    def __enter__(self):
        # In memory: candump writes every frame by itself.
        self.folder = tempfile.TemporaryDirectory(dir="/dev/shm")
        return self

    def __exit__(self, *_):
        for program in self.started:
            # pytest shows what is printed here where the test has failed, and only there.
            print(program.last_words())
            program.end()
        self.folder.cleanup()

    def start(self, name, *arguments):
        program = Program(Path(self.folder.name), f"{len(self.started)}-{name}", arguments)
        self.started.append(program)
        return program

    def resonarm(self, command, *arguments):
        return self.start(command, RESONARM, command, *arguments)

    def candump(self, interface="vcan0"):
        """Logs every frame from now on; see `wire.log`."""
        dump = self.start("candump", "candump", "-L", "-d", "-r", 32 << 20, interface)
        wait_until(lambda: interface in receivers(), "candump to listen")
        return dump

    def null_modem(self, folder):
        """The paths of two pseudo-terminals, joined as two serial ports are by a null modem."""
        ends = [folder / name for name in ("plant", "exciter")]
        self.start("socat", "socat", *(f"pty,raw,echo=0,link={end}" for end in ends))
        wait_until(lambda: all(end.exists() for end in ends), "socat to make the pseudo-terminals")
        return ends

    def tls(self, folder, port):
        """The address of a server that ends TLS, as one stands before programs that have none: it hands on what comes
        to a port."""
        certificate, own = folder / "certificate.pem", free_port()
        request = ("openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", 1, "-subj", "/CN=127.0.0.1")
        run(*request, "-keyout", folder / "key.pem", "-out", certificate)
        listen = f"openssl-listen:{own},bind=127.0.0.1,fork,verify=0,cert={certificate},key={folder / 'key.pem'}"
        self.start("socat", "socat", listen, f"tcp:127.0.0.1:{port}")
        return f"https://127.0.0.1:{own}"


def free_port():
    """A free port of 127.0.0.1."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


def receivers():
    """The interfaces on which a socket receives every frame, according to the kernel."""
    lists = Path("/proc/net/can/rcvlist_all").read_text()
    return {line.split()[0] for line in lists.splitlines() if line[:3] == "   " and "device" not in line}


def wait_until(holds, what, timeout_s=PATIENCE_S):
    """Polls until `holds()` is true, and returns its value."""
    end = time.monotonic() + timeout_s
    while not (value := holds()):
        assert time.monotonic() < end, f"waited {timeout_s} s for {what}"
        time.sleep(0.02)
    return value


def run(*arguments, timeout_s=PATIENCE_S):
    """A command that must succeed; its standard output."""
    words = [str(argument) for argument in arguments]
    done = subprocess.run(words, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=timeout_s)
    assert done.returncode == 0, f"{words} ended with {done.returncode}: {done.stderr}"
    return done.stdout
