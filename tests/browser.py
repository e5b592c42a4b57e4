"""A headless Chromium for tests, driven over two pipes by the DevTools protocol: no other package is needed.

Messages are JSON, each ended by a zero byte; the browser reads file descriptor 3 and writes 4.
"""

import base64
import fcntl
import json
import os
import select
import shutil
import subprocess
import sys
import time

PROGRAM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
FLAGS = ["--headless=new", "--remote-debugging-pipe", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
         "--no-first-run", "--disable-background-networking", "--hide-scrollbars"]  # fmt: skip
PATIENCE = 60.0  # s
# Puts the pipes where the browser looks for them, and becomes the browser.
BECOME = (
    "import os, sys; os.dup2(int(sys.argv[1]), 3); os.dup2(int(sys.argv[2]), 4); os.execv(sys.argv[3], sys.argv[3:])"
)


class Browser:
    """One page of one browser."""

    def __init__(self, folder, width=1100, height=900):
        to_read, self._out = os.pipe()
        self._in, to_write = os.pipe()
        high = [fcntl.fcntl(end, fcntl.F_DUPFD, 10) for end in (to_read, to_write)]
        command = [sys.executable, "-c", BECOME, *map(str, high), PROGRAM, *FLAGS, f"--user-data-dir={folder}",
                   f"--window-size={width},{height}", "about:blank"]  # fmt: skip
        self._process = subprocess.Popen(
            command, pass_fds=high, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, stdin=subprocess.DEVNULL
        )
        for end in (to_read, to_write, *high):
            os.close(end)
        self._number, self._rest, self.events, self._session = 0, b"", [], None
        targets = self.call("Target.getTargets")["targetInfos"]
        target = next(one["targetId"] for one in targets if one["type"] == "page")
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def call(self, method, **parameters):
        """The result of a command."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._out, json.dumps(message).encode() + b"\0")
        deadline = time.monotonic() + PATIENCE
        while True:
            found = self._message(deadline)
            if found.get("id") == self._number:
                assert "error" not in found, found["error"]
                return found["result"]
            self.events.append(found)

    def _message(self, deadline):
        while b"\0" not in self._rest:
            ready, _, _ = select.select([self._in], [], [], max(0.0, deadline - time.monotonic()))
            assert ready, "the browser does not answer"
            more = os.read(self._in, 1 << 20)
            assert more, "the browser has ended"
            self._rest += more
        text, self._rest = self._rest.split(b"\0", 1)
        return json.loads(text)

    def open(self, path, dark=False, still=False, ready="document.documentElement.dataset.ready === 'true'"):
        """Load a file for a reader who likes it dark, or still, and wait until it is ready, as its script says."""
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        motion = {"name": "prefers-reduced-motion", "value": "reduce" if still else "no-preference"}
        self.call("Emulation.setEmulatedMedia", features=[scheme, motion])
        self.events.clear()
        done = self.call("Page.navigate", url=path.resolve().as_uri())
        assert "errorText" not in done, done["errorText"]
        self.wait(f"document.readyState === 'complete' && {ready}")

    def wait(self, expression):
        """Wait until an expression of the page is true."""
        deadline = time.monotonic() + PATIENCE
        while self.value(f"Boolean({expression})") is not True:
            assert time.monotonic() < deadline, self.complaints
            assert not self.complaints, self.complaints

    def value(self, expression):
        """What an expression gives in the page."""
        found = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    def key(self, name, code=0, text=""):
        """Press and release a key."""
        for kind in ("keyDown", "keyUp"):
            more = {"text": text} if text and kind == "keyDown" else {}
            self.call("Input.dispatchKeyEvent", type=kind, key=name, windowsVirtualKeyCode=code, **more)

    def mouse(self, *places, button="left"):
        """Press at the first place (x, y), move over the others, and release."""
        (x, y), *others = places
        self.call("Input.dispatchMouseEvent", type="mousePressed", x=x, y=y, button=button, buttons=1, clickCount=1)
        for x, y in others:
            self.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y, button=button, buttons=1)
        self.call("Input.dispatchMouseEvent", type="mouseReleased", x=x, y=y, button=button, clickCount=1)

    def middle(self, selector, which=0):
        """The middle of an element, which is scrolled into view."""
        return tuple(
            self.value(
                f"(() => {{ const one = document.querySelectorAll({json.dumps(selector)})[{which}]; "
                "one.scrollIntoView({block: 'center', behavior: 'instant'}); const box = one.getBoundingClientRect(); "
                "return [box.x + box.width / 2, box.y + box.height / 2]; })()"
            )
        )

    def click(self, selector, which=0):
        """Click on the middle of an element."""
        self.mouse(self.middle(selector, which))

    def picture(self, path, whole=True):
        """Write a screenshot."""
        data = self.call("Page.captureScreenshot", captureBeyondViewport=whole)["data"]
        path.write_bytes(base64.b64decode(data))

    @property
    def nameless(self):
        """How many elements that act, or are pictures, have no name that is read out."""
        return self.value("""[...document.querySelectorAll('button, select, input, canvas, svg, table')].filter((one) =>
            !(one.ariaLabel || one.textContent.trim() || one.closest('label')?.textContent.trim())).length""")

    @property
    def heading_levels(self):
        """The levels of the headings in their order."""
        return self.value("[...document.querySelectorAll('h1, h2, h3')].map((one) => Number(one.tagName[1]))")

    @property
    def complaints(self):
        """Errors and warnings of the console, exceptions, and what was asked of the network."""
        found = []
        for event in self.events:
            method, told = event["method"], event["params"]
            if method == "Runtime.exceptionThrown":
                found.append(told["exceptionDetails"])
            if method == "Runtime.consoleAPICalled" and told["type"] in ("error", "warning", "assert"):
                found.append(told["args"])
            if method == "Log.entryAdded" and told["entry"]["level"] in ("error", "warning"):
                found.append(told["entry"])
            if method == "Network.requestWillBeSent" and not told["request"]["url"].startswith(("file:", "data:")):
                found.append(told["request"]["url"])
        return found

    def close(self):
        """End the browser."""
        try:
            self._session = None
            self.call("Browser.close")
        finally:
            for end in (self._in, self._out):
                os.close(end)
            try:
                self._process.wait(10)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
