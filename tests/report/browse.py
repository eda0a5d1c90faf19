"""Opens a report's page in headless Chromium and uses it as a reader does.

    python3 tests/page/browse.py PAGE.html [--screenshots FOLDER]

Exits with 0 where everything holds, 1 where something does not, and 77 where no Chromium is installed (Debian: `apt-get install
chromium`), which it says. Needs nothing beyond Python: it speaks the browser's own protocol over a pipe.
"""

import base64
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

SKIPPED = 77


class Browser:
    """Chromium, told by the DevTools protocol over file descriptors 3 and 4."""

    def __init__(self, binary, profile):
        to_browser, self.out = os.pipe()
        self.inbox, from_browser = os.pipe()

        def attach():
            # Copies above 4 first: either could lie where the other must.
            ends = [os.dup2(end, 20 + index) for index, end in enumerate((to_browser, from_browser))]
            for place, end in zip((3, 4), ends):
                os.dup2(end, place)

        options = ["--headless", "--disable-gpu", "--no-first-run", "--remote-debugging-pipe", f"--user-data-dir={profile}"]
        if os.geteuid() == 0:
            options.append("--no-sandbox")  # which root cannot use
        self.process = subprocess.Popen(
            [binary, *options, "about:blank"], preexec_fn=attach, close_fds=False, stderr=subprocess.DEVNULL
        )
        os.close(to_browser)
        os.close(from_browser)
        self.buffer, self.number, self.session, self.events = b"", 0, None, []

    def message(self):
        while b"\0" not in self.buffer:
            piece = os.read(self.inbox, 1 << 20)
            if not piece:
                raise RuntimeError("the browser has gone")
            self.buffer += piece
        text, self.buffer = self.buffer.split(b"\0", 1)
        return json.loads(text)

    def call(self, method, **parameters):
        self.number += 1
        call = {"id": self.number, "method": method, "params": parameters}
        if self.session:
            call["sessionId"] = self.session
        os.write(self.out, json.dumps(call).encode() + b"\0")
        while True:
            message = self.message()
            if message.get("id") == self.number:
                if "error" in message:
                    raise RuntimeError(f"{method}: {message['error']}")
                return message["result"]
            self.events.append(message)

    def open(self, url):
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        self.call("Page.navigate", url=url)
        while self.value("document.readyState") != "complete" or self.value("location.href") == "about:blank":
            time.sleep(0.05)

    def value(self, expression):
        result = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in result:
            raise RuntimeError(f"{expression}: {result['exceptionDetails']}")
        return result["result"].get("value")

    def pointer(self, kind, x, y, **more):
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)

    def click(self, selector):
        x, y = self.middle(selector)
        self.pointer("mousePressed", x, y, button="left", clickCount=1)
        self.pointer("mouseReleased", x, y, button="left", clickCount=1)

    def middle(self, selector):
        """The middle of an element, which is scrolled to."""
        box = self.value(
            f"(() => {{ const it = document.querySelector({json.dumps(selector)}); it.scrollIntoView({{block: 'center', "
            "behavior: 'instant'}); const box = it.getBoundingClientRect(); return [box.x + box.width / 2, box.y + box.height / 2]; })()"
        )
        return box

    def key(self, name):
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=name)

    def complaints(self):
        """What the console and the network have to say: errors, violations of the policy, and whatever was fetched."""
        self.value("1")
        told = []
        for event in self.events:
            parameters = event.get("params", {})
            if event["method"] == "Log.entryAdded" and parameters["entry"]["level"] in ("error", "warning"):
                told.append(parameters["entry"]["text"])
            elif event["method"] == "Runtime.exceptionThrown":
                told.append(json.dumps(parameters["exceptionDetails"]))
            elif event["method"] == "Runtime.consoleAPICalled" and parameters["type"] in ("error", "warning", "assert"):
                told.append(json.dumps(parameters["args"]))
            elif event["method"] == "Network.requestWillBeSent" and not parameters.get("documentURL") == parameters["request"]["url"]:
                told.append(f"fetches {parameters['request']['url']}")
        return told

    def screenshot(self, path, width, height, scheme="light", media="screen"):
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        feature = {"name": "prefers-color-scheme", "value": scheme}
        self.call("Emulation.setEmulatedMedia", media=media, features=[feature])
        picture = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=True)
        Path(path).write_bytes(base64.b64decode(picture["data"]))

    def close(self):
        self.process.kill()
        self.process.wait()


def failures(browser):
    """What does not hold, a line each."""
    wrong = []

    def check(holds, what):
        if not holds:
            wrong.append(what)

    value = browser.value
    check(value("getComputedStyle(document.querySelector('main')).maxWidth") != "none", "the style is refused")
    check(value("document.querySelectorAll('main h2').length") > 0, "there are no sections")
    check(value("window.hostile === undefined"), "hostile text was run")
    check(value("document.querySelectorAll('img, iframe, b, main script, header script').length") == 0, "hostile text became elements")
    ids = value("[...document.querySelectorAll('[id]')].map((it) => it.id)")
    check(len(ids) == len(set(ids)), "two elements share an id")
    targets = value("[...document.querySelectorAll('a[href^=\"#\"]')].map((it) => decodeURIComponent(it.hash.slice(1)))")
    check(set(targets) <= set(ids), f"links lead nowhere: {set(targets) - set(ids)}")
    check(value("[...document.querySelectorAll('button, a, summary, input')].every((it) => (it.ariaLabel || it.textContent || "
                "it.closest('label')?.textContent).trim())"), "something to use has no name")

    for width in (1280, 360):
        browser.call("Emulation.setDeviceMetricsOverride", width=width, height=800, deviceScaleFactor=1, mobile=False)
        wide = value("document.documentElement.scrollWidth")
        check(wide <= width, f"at {width} pixels the page is {wide} wide")

    panel = "figure[data-figure] svg[data-panel]"
    if value(f"document.querySelector('{panel} .mean') !== null"):
        x, y = browser.middle(panel)
        browser.pointer("mouseMoved", x, y)
        shown = "(document.querySelector('figure .values:not([hidden])')?.textContent ?? '')"
        check("steps" in value(shown), f"no values under the pointer: {value(shown)!r}")
        check(value(f"document.querySelector('{panel} .cursor') !== null"), "no line under the pointer")
        # What is shown is what is in the data.
        same = value(
            "(() => { const figure = document.querySelector('figure:has(.values:not([hidden]))');"
            "const panel = JSON.parse(document.getElementById('data').textContent)[figure.dataset.figure].panels[0];"
            "const steps = Number(figure.querySelector('.values p').textContent.match(/([\\d,]+) steps/)[1].replaceAll(',', ''));"
            "const means = panel.curves.flatMap((curve) => curve.mean.filter((_, i) => curve.level || curve.x[i] === steps));"
            "const cells = [...figure.querySelectorAll('.values tr td:nth-child(2)')].map((cell) => Number(cell.textContent.replaceAll('−', '-')));"
            "return cells.length > 0 && cells.every((cell) => means.some((mean) => Math.abs(mean - cell) <= 0.01 * Math.abs(mean))); })()"
        )
        check(same, "the values under the pointer are not the figure's")
        browser.pointer("mouseMoved", 1, 1)
        check(value(shown) == "", "values stay when the pointer has gone")

        value(f"document.querySelector('{panel}').focus()")
        browser.key("End")
        check("steps" in value("document.querySelector('figure .reader').textContent"), "a key reads no value")
        browser.key("Escape")
        check(value(shown) == "", "Escape hides no values")

        key = "figure[data-figure]:has(svg[data-panel] .mean) button.key"
        series = "document.querySelector('figure[data-figure]:has(.mean) g.series[data-series=\"0\"]')"
        visible = f"{series}.getBoundingClientRect().width > 0"
        before = value(visible)
        browser.click(key)
        check(before and not value(visible), "a series cannot be switched off")
        check(value(f"document.querySelector('{key}').getAttribute('aria-pressed')") == "false", "a switch does not say that it is off")
        value(f"document.querySelector('{key}').focus()")
        browser.call("Input.dispatchKeyEvent", type="keyDown", key=" ", text=" ")
        browser.call("Input.dispatchKeyEvent", type="keyUp", key=" ")
        check(value(visible), "a series cannot be switched on by the keyboard")

        boxes = "figure[data-figure]:has(svg[data-panel] .mean) .switches input"
        value(f"document.querySelectorAll('{boxes}')[1].click()")
        singles = "document.querySelectorAll('figure path.single').length"
        drawn = value(singles)
        check(drawn > 0, "single seeds are not drawn")
        value("document.querySelector('.seeds:not([hidden]) button').click()")
        check(value(singles) < drawn, "a single seed cannot be switched off")
        value(f"document.querySelectorAll('{boxes}')[1].click()")
        check(value(singles) == 0, "single seeds cannot be switched off")

    table = "table.sortable"
    if value(f"document.querySelector('{table}') !== null"):
        column = (
            "(() => { const table = [...document.querySelectorAll('table.sortable')].find((it) => it.tBodies[0].rows.length > 1);"
            "if (!table) return null; for (let fold = table.closest('details'); fold; fold = fold.parentElement.closest('details')) fold.open = true;"
            "const at = [...table.tHead.rows[0].cells].findIndex((cell) => cell.classList.contains('n'));"
            "const read = () => [...table.tBodies[0].rows].map((row) => row.cells[at].textContent);"
            "const head = table.tHead.rows[0].cells[at]; head.querySelector('button').click(); const up = read(); const state = head.ariaSort;"
            "head.querySelector('button').click(); return [up, read(), state]; })()"
        )
        found = value(column)
        if found:
            up, down, state = found
            number = lambda text: float(text.replace("−", "-").replace("<", "").split(" ")[0].split("·")[0] or "nan")
            numbers = [number(text) for text in up if text and text[0] in "−<0123456789" and "10" not in text]
            check(numbers == sorted(numbers), f"a column is not sorted: {up}")
            check(sorted(up) == sorted(down) and state == "ascending", "sorting loses rows, or does not say how it sorts")

    square = ".grid a.run"
    if value(f"document.querySelector('{square}') !== null"):
        browser.click(square)
        time.sleep(0.2)
        row = value("document.querySelector(location.hash)?.closest('details')?.open")
        check(row, "the square of a run does not lead to its row")

    return wrong + [f"complaint: {text}" for text in browser.complaints()]


def main():
    binary = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if not binary:
        print("skipped: no Chromium is installed (Debian: apt-get install chromium)")
        return SKIPPED
    page = Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory() as profile:
        browser = Browser(binary, profile)
        try:
            browser.open(page.as_uri())
            if "--screenshots" in sys.argv:
                folder = Path(sys.argv[sys.argv.index("--screenshots") + 1])
                folder.mkdir(parents=True, exist_ok=True)
                for scheme in ("light", "dark"):
                    browser.screenshot(folder / f"wide-{scheme}.png", 1280, 900, scheme)
                    browser.screenshot(folder / f"narrow-{scheme}.png", 390, 900, scheme)
                browser.screenshot(folder / "print.png", 794, 1123, media="print")
                browser.call("Emulation.setEmulatedMedia", media="", features=[])
                pdf = browser.call("Page.printToPDF", printBackground=True)
                (folder / "print.pdf").write_bytes(base64.b64decode(pdf["data"]))
            wrong = failures(browser)
        finally:
            browser.close()
    for line in wrong:
        print(line)
    print("the page holds" if not wrong else f"{len(wrong)} do not hold")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
