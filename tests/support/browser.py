"""Chromium without a screen, led over its protocol on 127.0.0.1 (chromedevtools.github.io/devtools-protocol)."""

import base64
import itertools
import json
import os
import shutil
import signal
import subprocess
import tempfile
import urllib.request
from pathlib import Path

from processes import PATIENCE_S, wait_until
from websockets.sync.client import connect

# Keeps Chromium from using a sandbox, a graphics card and its maker's servers.
FLAGS = (
    "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run", "--mute-audio",
    "--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-default-apps",
    "--disable-features=Translate,MediaRouter,OptimizationHints", "--remote-debugging-port=0",
)  # fmt: skip


class Browser:
    """A running Chromium; at the end of a `with` block it is gone."""

    def __enter__(self):
        self.folder = Path(tempfile.mkdtemp())
        arguments = [shutil.which("chromium"), *FLAGS, f"--user-data-dir={self.folder}", "about:blank"]
        # A separate session, so that its helpers end with it.
        nowhere = {stream: subprocess.DEVNULL for stream in ("stdin", "stdout", "stderr")}
        self.process = subprocess.Popen(arguments, **nowhere, start_new_session=True)
        port_file = self.folder / "DevToolsActivePort"
        lines = wait_until(lambda: port_file.exists() and port_file.read_text().splitlines()[:1], "Chromium to listen")
        self.url = f"http://127.0.0.1:{lines[0]}"
        return self

    def __exit__(self, *_):
        os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait(PATIENCE_S)
        shutil.rmtree(self.folder, ignore_errors=True)

    def page(self, url, width=1280, height=1500, scale=1, dark=False, still=False, touch=False, any_certificate=False):
        """A page of that size in CSS pixels, each of `scale` pixels of the screen, whose viewer prefers dark colours or
        less motion, or has a phone, or takes a server for what it says it is."""
        request = urllib.request.Request(f"{self.url}/json/new?about:blank", method="PUT")
        with urllib.request.urlopen(request, timeout=PATIENCE_S) as answer:
            page = Page(json.load(answer)["webSocketDebuggerUrl"])
        size = {"width": width, "height": height, "deviceScaleFactor": scale, "mobile": touch}
        page.call("Emulation.setDeviceMetricsOverride", **size)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        motion = {"name": "prefers-reduced-motion", "value": "reduce" if still else "no-preference"}
        page.call("Emulation.setEmulatedMedia", features=[scheme, motion])
        if any_certificate:
            page.call("Security.setIgnoreCertificateErrors", ignore=True)
        page.load(url)
        return page


class Page:
    """A page, and its errors."""

    def __init__(self, url):
        # Closed at the latest when the browser ends.
        self.socket = connect(url, max_size=None, open_timeout=PATIENCE_S, ping_interval=None).__enter__()
        self.numbers = itertools.count(1)
        self.errors = []
        self.loaded = False
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def call(self, method, **parameters):
        """The browser's answer; its messages meanwhile are searched for errors."""
        number = next(self.numbers)
        self.socket.send(json.dumps({"id": number, "method": method, "params": parameters}))
        while (said := json.loads(self.socket.recv(PATIENCE_S))).get("id") != number:
            self.heed(said)
        assert "error" not in said, said
        return said["result"]

    def load(self, url):
        """Opens a page, and waits for it: what is asked while the browser changes pages fails."""
        self.loaded = False
        self.call("Page.navigate", url=url)
        while not self.loaded:
            self.heed(json.loads(self.socket.recv(PATIENCE_S)))

    def heed(self, said):
        match said:
            case {"method": "Runtime.exceptionThrown", "params": {"exceptionDetails": details}}:
                self.errors.append(details)
            case {"method": "Runtime.consoleAPICalled", "params": {"type": "error" | "warning" | "assert"} as call}:
                self.errors.append(call)
            case {"method": "Log.entryAdded", "params": {"entry": {"level": "error" | "warning"} as entry}}:
                self.errors.append(entry)
            case {"method": "Page.loadEventFired"}:
                self.loaded = True
            case {"method": "Network.requestWillBeSent", "params": {"request": {"url": url}}}:
                if not url.startswith(("http://127.0.0.1", "https://127.0.0.1", "data:", "about:")):
                    self.errors.append(f"asked for {url}")

    def value(self, expression):
        """The value of a JavaScript expression, waited for if it is a promise."""
        options = {"returnByValue": True, "awaitPromise": True}
        result = self.call("Runtime.evaluate", expression=expression, **options)
        assert "exceptionDetails" not in result, result
        return result["result"].get("value")

    def until(self, expression):
        """Waits until it holds, and returns its value."""
        return wait_until(lambda: self.value(expression), expression)

    def text(self, selector):
        return self.value(f"document.querySelector({json.dumps(selector)}).textContent")

    def press(self, *keys):
        """Presses keys, one after the other, as a keyboard does."""
        codes = {"Tab": 9, "Enter": 13, " ": 32, "PageUp": 33, "End": 35, "Home": 36, "ArrowLeft": 37, "ArrowRight": 39}
        for key in keys:
            text = {"Enter": "\r"}.get(key, key if len(key) == 1 else "")
            for kind in ("keyDown", "keyUp"):
                typed = {"text": text} if text and kind == "keyDown" else {}
                code = codes.get(key, 0)
                self.call("Input.dispatchKeyEvent", type=kind, key=key, windowsVirtualKeyCode=code, **typed)

    def drag(self, start, end, shift=False):
        """Presses the mouse at `start`, moves it to `end` and lets it go."""
        options = {"button": "left", "modifiers": 8 if shift else 0, "clickCount": 1}
        moves = [("mouseMoved", start), ("mousePressed", start), ("mouseMoved", end), ("mouseReleased", end)]
        for kind, (x, y) in moves:
            pressed = {"buttons": 1} if kind == "mouseMoved" and (x, y) == end else {}
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **options, **pressed)

    def point(self, x, y):
        """Moves the mouse there."""
        self.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)

    def picture(self, path):
        """Saves a screenshot as PNG, and returns its bytes."""
        picture = base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])
        Path(path).write_bytes(picture)
        return picture

    def pixels(self, selector):
        """How many different colours a canvas shows, and how much of it is drawn on."""
        return self.value(f"""(() => {{
            const canvas = document.querySelector({json.dumps(selector)});
            const pixels = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
            const words = new Uint32Array(pixels.buffer);
            return {{ colours: new Set(words).size, drawn: words.reduce((n, w) => n + (w !== 0), 0) / words.length }};
        }})()""")
