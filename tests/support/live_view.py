"""A viewer of the live view without a browser: it takes the page's messages (docs/live.md)."""

import json
import re
import struct
import time

import numpy as np
from processes import PATIENCE_S, wait_until
from websockets.sync.client import connect

# Some tests read nothing for a while.
OPEN = {"open_timeout": PATIENCE_S, "ping_interval": None}
# A scenario that is steered; the accelerometer at C has so small a range, m/s², that it clips.
SMALL_RANGE = """
[rig.sensors.c]
range_m_s2 = {}

[excitation]
amplitude = {{ exciter_x = 50.0 }}
profile = {{ waveform = "dwell", frequency_hz = 15.0, duration_s = 1.0, settle_s = 0.1 }}
"""


def address(program):
    """Where a program serves its page, and the token."""
    pattern = r"live view +(http://127\.0\.0\.1:\d+/)#(\w+)"
    looked = lambda: re.search(pattern, program.stderr) or not program.running()
    found = wait_until(looked, "the address of the live view")
    assert found is not True, program.stderr
    return found[1], found[2]


def free_run(programs, *arguments, live="127.0.0.1"):
    """A bench in simulated time at the speed of the clock, without end: it plays only the set-points."""
    return programs.resonarm("run", "--mode", "free", "--speed", 1, "--live", live, "--steer", *arguments)


def open_page(browser, program, **size):
    """The page of a program, once it has drawn samples: until then the page is there, and no loop that takes requests."""
    url, token = address(program)
    page = browser.page(f"{url}#{token}", **size)
    page.until("window.resonarm?.data?.frames > 3 && resonarm.data.rows.length > 0")
    return page


def update(content, channels):
    """A decoded update with rows of so many channels."""
    (length,) = struct.unpack_from("<I", content)
    head = json.loads(content[4 : 4 + length])
    numbers = np.frombuffer(content, "<f4", offset=-(-(4 + length) // 4) * 4).reshape(-1, channels)
    extremes, rows = np.split(numbers, [2 * len(head["stretches"])])
    assert len(rows) == head["rows"]
    return {"kind": "update", **head, "least": extremes[::2], "largest": extremes[1::2], "numbers": rows}


class Viewer:
    """One that takes the updates of the page, and asks with the token it is given."""

    def __init__(self, url, token="", **options):
        # Closed at the latest when the program ends.
        self.socket = connect(url.replace("http:", "ws:") + "live", max_size=None, **OPEN, **options).__enter__()
        self.token = token
        self.about = None
        self.about = self.next("about")

    def next(self, kind, holds=lambda message: True):
        """The next message of that kind that matches."""
        end = time.monotonic() + PATIENCE_S
        while True:
            assert time.monotonic() < end, f"waited {PATIENCE_S} s for {kind}"
            message = self.socket.recv(PATIENCE_S)
            binary = isinstance(message, bytes)
            message = update(message, len(self.about["channels"])) if binary else json.loads(message)
            if message["kind"] == kind and holds(message):
                return message

    def say(self, text):
        """The answer to a text."""
        self.socket.send(text)
        while True:
            message = self.socket.recv(PATIENCE_S)
            if isinstance(message, str) and (answer := json.loads(message))["kind"] in ("taken", "refused"):
                return answer

    def ask(self, request, token=None):
        """The answer to a request."""
        return self.say(json.dumps({"token": self.token if token is None else token, "request": request}))
