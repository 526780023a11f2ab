#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Open a report page in headless Chromium and check it (needs chromium and chromedriver; Debian: chromium-driver).

usage: browser_check.py REPORT.html [--screenshots FOLDER]
Checks: nothing on the console, no network, the numbers in the page are those of the data in it (and of report.json
beside it), zooming, panning, error jumps, address search and sorting work by keyboard, wheel, drag and touch, nothing
is wider than a narrow window. Prints one line per check; exit 1 when one fails.
"""
import argparse
import base64
import json
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "host/python"))
from asi.trace import PROBE, REQUEST_OK, ROW  # noqa: E402

START_S = 30
ENTER, ESCAPE, HOME = "\ue007", "\ue00c", "\ue011"


def missing() -> str | None:
    """Why this cannot run here, None when it can."""
    lacking = [name for name in ("chromium", "chromedriver") if not shutil.which(name)]
    return f"{' and '.join(lacking)} not installed" if lacking else None


class Browser:
    """Headless Chromium behind chromedriver (WebDriver is plain HTTP). A context manager."""

    def __init__(self, width: int = 1280, height: int = 900):
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        self._profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        self._driver = subprocess.Popen([shutil.which("chromedriver"), f"--port={port}"], stdout=subprocess.DEVNULL,
                                        stderr=subprocess.DEVNULL)
        self._base = f"http://127.0.0.1:{port}"
        try:
            deadline = time.monotonic() + START_S
            while True:
                try:
                    if self._call("GET", "/status")["ready"]:
                        break
                except OSError:
                    if time.monotonic() > deadline:
                        raise
                    time.sleep(0.1)
            options = {"binary": shutil.which("chromium"), "args": [
                "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--hide-scrollbars",
                "--no-first-run", f"--user-data-dir={self._profile.name}", f"--window-size={width},{height}"]}
            session = self._call("POST", "/session", {"capabilities": {"alwaysMatch": {
                "goog:chromeOptions": options, "goog:loggingPrefs": {"browser": "ALL", "performance": "ALL"}}}})
            self._base += f"/session/{session['sessionId']}"
            self._call("POST", "/url", {"url": "about:blank"})  # off the browser's own first page, which loads things
            self.settle()
        except BaseException:
            self._stop()
            raise

    def _call(self, method: str, path: str, body: dict | None = None):
        data = None if method == "GET" else json.dumps(body or {}).encode()
        request = urllib.request.Request(self._base + path, data, {"Content-Type": "application/json"}, method=method)
        try:
            with urllib.request.urlopen(request, timeout=120) as answer:
                return json.load(answer)["value"]
        except urllib.error.HTTPError as error:
            raise RuntimeError(f"{path}: {json.load(error)['value']['message'].splitlines()[0]}") from None

    def __enter__(self) -> "Browser":
        return self

    def __exit__(self, *exc: object) -> None:
        try:
            self._call("DELETE", "")
        finally:
            self._stop()

    def _stop(self) -> None:
        self._driver.terminate()
        self._driver.wait(10)
        self._profile.cleanup()

    def open(self, path: Path) -> None:
        self._call("POST", "/url", {"url": path.resolve().as_uri()})

    def run(self, script: str, *args):
        """Run the body of a function in the page; -> what it returns."""
        return self._call("POST", "/execute/sync", {"script": script, "args": list(args)})

    def settle(self) -> None:
        """Until what was asked for is drawn."""
        self._call("POST", "/execute/async", {
            "script": "requestAnimationFrame(() => requestAnimationFrame(arguments[0]))", "args": []})

    def devtools(self, command: str, **params):
        return self._call("POST", "/goog/cdp/execute", {"cmd": command, "params": params})

    def log(self, kind: str) -> list[dict]:
        return self._call("POST", "/se/log", {"type": kind})

    def keys(self, *keys: str) -> None:
        actions = [{"type": kind, "value": key} for key in keys for kind in ("keyDown", "keyUp")]
        self._call("POST", "/actions", {"actions": [{"type": "key", "id": "keys", "actions": actions}]})
        self.settle()

    def wheel(self, x: int, y: int, delta: int) -> None:
        self._call("POST", "/actions", {"actions": [{"type": "wheel", "id": "wheel", "actions": [
            {"type": "scroll", "x": x, "y": y, "deltaX": 0, "deltaY": delta, "duration": 0}]}]})
        self.settle()

    def press_and_move(self, kind: str, *paths: tuple[tuple[int, int], tuple[int, int]]) -> None:
        """kind 'mouse' or 'touch': each pointer goes down at the first point of its path and up at the second."""
        self._call("POST", "/actions", {"actions": [{
            "type": "pointer", "id": f"{kind}{k}", "parameters": {"pointerType": kind}, "actions": [
                {"type": "pointerMove", "x": a[0], "y": a[1], "duration": 0}, {"type": "pointerDown", "button": 0},
                {"type": "pointerMove", "x": b[0], "y": b[1], "duration": 50}, {"type": "pointerUp", "button": 0}]}
            for k, (a, b) in enumerate(paths)]})
        self.settle()

    def size(self, width: int, height: int, touch: bool = False) -> None:
        self.devtools("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1,
                      mobile=touch)
        self.devtools("Emulation.setTouchEmulationEnabled", enabled=touch)
        self.settle()

    def scheme(self, name: str) -> None:
        """'light' or 'dark'."""
        self.devtools("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": name}])
        self.settle()

    def screenshot(self, path: Path, whole: bool = False) -> None:
        options = {"captureBeyondViewport": whole, "format": "png"}
        if whole:
            size = self.devtools("Page.getLayoutMetrics")["cssContentSize"]
            options["clip"] = {"x": 0, "y": 0, "width": size["width"], "height": size["height"], "scale": 1}
        path.write_bytes(base64.b64decode(self.devtools("Page.captureScreenshot", **options)["data"]))


class Failed(AssertionError):
    """A check of the page failed."""


def _true(condition: object, what: str) -> None:
    if not condition:
        raise Failed(what)


_VIEW = "const d = document.getElementById('chart').dataset; return [+d.from, +d.to, +d.chosen]"


def _chart(browser: Browser) -> tuple[int, int, int, int]:
    """Scroll the chart into the window and give it the focus; -> its box."""
    return tuple(map(int, browser.run(
        "const c = document.getElementById('chart'); c.scrollIntoView({block: 'center'}); c.focus(); "
        "const b = c.getBoundingClientRect(); return [b.left, b.top, b.width, b.height]")))


def check_quiet(browser: Browser) -> str:
    """Nothing on the console, nothing asked of the network but the file itself."""
    console = [entry["message"] for entry in browser.log("browser")]
    _true(not console, f"console: {console[:3]}")
    urls = [event["params"]["request"]["url"] for entry in browser.log("performance")
            for event in [json.loads(entry["message"])["message"]] if event["method"] == "Network.requestWillBeSent"]
    outside = [url[:100] for url in urls if not url.startswith(("file:", "data:"))]
    files = [url for url in urls if url.startswith("file:")]
    _true(not outside and len(files) == 1, f"requests: {outside or files}")
    return "console silent, one file read, no network"


def check_numbers(browser: Browser, report: dict) -> str:
    """Every number in the page that has a path is the one in the report."""
    embedded = browser.run("return JSON.parse(document.getElementById('data').textContent).report")
    _true(embedded == report, "the data in the page is not the report")
    shown = browser.run("return [...document.querySelectorAll('[data-path]')].map(e => [e.dataset.path, e.dataset.v])")
    for path, value in shown:
        have: object = report
        for key in path.split("."):
            have = have[int(key)] if isinstance(have, list) else have[key]
        _true(json.loads(value) == have, f"{path}: {value} in the page, {have} in the report")
    rows = browser.run("return [...document.querySelectorAll('#slaves tbody tr')].map(r => [r.dataset.index, "
                       "[...r.querySelectorAll('td.num')].map(c => [c.dataset.key, c.dataset.v])])")
    cells = 0
    slaves = {"" if row["index"] is None else str(row["index"]): row for row in report["slaves"]}
    for index, row in rows:
        for key, value in row:
            have = slaves[index]
            for part in key.split("."):
                have = have.get(part, 0)
            _true(json.loads(value) == have, f"slave {index}: {key}: {value} in the page, {have} in the report")
            cells += 1
    _true(len(shown) > 10 and cells > 5, "numbers are missing")
    return f"{len(shown)} numbers and {cells} cells of the slave table equal the report"


def check_time_line(browser: Browser) -> str:
    """Keyboard, wheel and mouse move the view; error jumps land on errors; searching finds the address."""
    left, top, width, height = _chart(browser)
    x, y = left + width // 2, top + height // 2
    view = lambda: browser.run(_VIEW)  # noqa: E731
    browser.keys(HOME)
    whole = view()
    browser.keys("+", "+", "+")
    near = view()
    _true(abs((near[1] - near[0]) * 8 / (whole[1] - whole[0]) - 1) < .01, f"three times + : {whole} to {near}")
    browser.keys("\ue014")
    right = view()
    _true(right[0] > near[0] and abs((right[1] - right[0]) - (near[1] - near[0])) < 1, "arrow key pans")
    browser.wheel(x, y, -300)
    wheel = view()
    _true(wheel[1] - wheel[0] < .7 * (right[1] - right[0]), "wheel zooms in")
    browser.press_and_move("mouse", ((x, y), (x - 150, y)))
    drag = view()
    moved = (drag[0] - wheel[0]) / (wheel[1] - wheel[0]) * width
    _true(140 < moved < 160, f"dragging 150 pixels moved {moved:.0f}")
    for _ in range(40):
        browser.keys("+")
    deep = view()
    _true(deep[1] - deep[0] <= 31_000, f"deepest zoom {deep}")
    browser.keys(HOME, ESCAPE)
    facts = _facts(browser)
    errors = [i for i, bad in enumerate(facts["errors"]) if bad]
    for k in range(min(3, len(errors))):
        browser.keys("n")
        at = view()
        _true(at[2] == errors[k], f"error jump {k}: telegram {at[2]}, not {errors[k]}")
        _true(at[0] <= facts["times"][errors[k]] <= at[1], "the error is on screen")
        text = browser.run("return document.getElementById('detail').textContent")
        _true(facts["classes"][errors[k]] in text, f"'{text}' names the class")
    if len(errors) > 1:
        browser.keys("p")
        _true(view()[2] == errors[min(3, len(errors)) - 2], "one error back")
    shown = int(browser.run("return document.getElementById('counter').dataset.errors"))
    _true(shown == len(errors), f"{shown} errors counted, {len(errors)} there")
    browser.keys(ENTER)
    buttons = browser.run("const b = [...document.querySelectorAll('button.find')]; "
                          "return b.length ? [b[b.length - 1].dataset.find, (b[b.length - 1].click(), 1)] : null")
    if buttons and int(buttons[0]) in facts["indices"]:
        browser.settle()
        browser.keys(".")
        chosen = view()[2]
        _true(facts["indices"][chosen] == int(buttons[0]), "the next telegram is one of the address")
        browser.run("const a = document.getElementById('address'); a.value = ''; a.dispatchEvent(new Event('change'))")
    browser.keys(HOME, ESCAPE)
    return f"zoom, pan, drag, {len(errors)} errors, address search"


def check_touch(browser: Browser) -> str:
    """On a narrow window with touch: nothing sticks out, one finger pans, two zoom."""
    browser.size(390, 800, touch=True)
    wide = browser.run("return [document.documentElement.scrollWidth, innerWidth]")
    _true(wide[0] <= wide[1], f"page is {wide[0]} wide in a window of {wide[1]}")
    left, top, width, height = _chart(browser)
    y = top + height // 2
    browser.keys(HOME, "+", "+")
    before = browser.run(_VIEW)
    browser.press_and_move("touch", ((left + 250, y), (left + 100, y)))
    panned = browser.run(_VIEW)
    _true(panned[0] > before[0], f"one finger pans: {before} {panned}")
    browser.press_and_move("touch", ((left + 160, y), (left + 40, y)), ((left + 200, y), (left + 320, y)))
    apart = browser.run(_VIEW)
    _true(apart[1] - apart[0] < .5 * (panned[1] - panned[0]), f"two fingers zoom: {panned} {apart}")
    browser.keys(HOME)
    browser.size(1280, 900)
    return "narrow window fits, touch pans and zooms"


def check_sorting(browser: Browser) -> str:
    """A click on a head sorts by its exact values, a second one the other way round, and says so."""
    column = ("const head = document.querySelector('#slaves th[data-key=requests]'); "
              "head.querySelector('button').click(); "
              "const k = head.cellIndex; return [head.getAttribute('aria-sort'), "
              "[...document.querySelectorAll('#slaves tbody tr')].map(r => +r.cells[k].dataset.v)]")
    down, values = browser.run(column)
    _true(down == "descending" and values == sorted(values, reverse=True), f"{down}: {values}")
    up, values = browser.run(column)
    _true(up == "ascending" and values == sorted(values), f"{up}: {values}")
    browser.run("document.querySelector('#slaves th[data-key=address] button').click()")
    return f"{len(values)} rows sorted both ways"


def check_contrast(browser: Browser) -> str:
    """Text and its background differ by at least 4.5 to 1 (WCAG AA), light and dark."""
    script = """
      const rgb = (c) => c.match(/[\\d.]+/g).map(Number);
      const linear = v => (v /= 255) <= .03928 ? v / 12.92 : ((v + .055) / 1.055) ** 2.4;
      const light = (c) => { const [r, g, b] = c.slice(0, 3).map(linear);
        return .2126 * r + .7152 * g + .0722 * b; };
      const out = [];
      for (const e of document.querySelectorAll('body *')) {
        if (!e.checkVisibility() || e.closest('svg, script') ||
            ![...e.childNodes].some(n => n.nodeType === 3 && n.textContent.trim())) continue;
        let back = e;
        while (back && (rgb(getComputedStyle(back).backgroundColor)[3] ?? 1) === 0) back = back.parentElement;
        const a = light(rgb(getComputedStyle(e).color));
        const b = light(rgb(getComputedStyle(back || document.body).backgroundColor));
        out.push([(Math.max(a, b) + .05) / (Math.min(a, b) + .05),
                  e.tagName + ' ' + e.className + ' ' + e.textContent.slice(0, 30)]);
      }
      return out.sort((a, b) => a[0] - b[0]).slice(0, 1)[0];"""
    worst = []
    for scheme in ("light", "dark"):
        browser.scheme(scheme)
        ratio, where = browser.run(script)
        _true(ratio >= 4.5, f"{scheme}: contrast {ratio:.2f} at {where}")
        worst.append(ratio)
    browser.scheme("light")
    return f"least contrast {worst[0]:.1f} light, {worst[1]:.1f} dark"


def _facts(browser: Browser) -> dict:
    """Per telegram in the page, from its raw data, not from the script of the page."""
    line = browser.run("return JSON.parse(document.getElementById('data').textContent).timeline")
    rows = list(ROW.iter_unpack(base64.b64decode(line["rows"])))
    return {"times": [row[0] for row in rows], "indices": [line["calls"][row[4]][2] for row in rows],
            "classes": [line["classes"][str(row[5])] for row in rows],
            "errors": [(row[5] != 0 or not row[8] & REQUEST_OK) and not row[8] & PROBE for row in rows]}


def check_page(browser: Browser, page: Path, report: dict) -> list[str]:
    """All checks of one page; -> one line per check. Failed names the first that is not met."""
    browser.log("browser"), browser.log("performance")
    started = time.monotonic()
    browser.open(page)
    _true(browser.run("return document.documentElement.dataset.ready") == "1", "the script of the page did not finish")
    timing = browser.run("const n = performance.getEntriesByType('navigation')[0]; return n.loadEventEnd || n.duration")
    lines = [f"loaded in {timing:.0f} ms ({time.monotonic() - started:.1f} s with the driver), "
             f"{page.stat().st_size} bytes",
             check_numbers(browser, report), check_time_line(browser), check_touch(browser), check_sorting(browser),
             check_contrast(browser)]
    return [*lines, check_quiet(browser)]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("page", type=Path)
    parser.add_argument("--screenshots", type=Path, help="write wide, dark, narrow and close pictures there")
    args = parser.parse_args()
    if reason := missing():
        print(reason, file=sys.stderr)
        return 2
    beside = args.page.with_suffix(".json")
    with Browser() as browser:
        browser.open(args.page)
        report = json.loads(beside.read_text()) if beside.exists() else browser.run(
            "return JSON.parse(document.getElementById('data').textContent).report")
        try:
            print("\n".join(check_page(browser, args.page, report)))
        except Failed as error:
            print(f"failed: {error}", file=sys.stderr)
            return 1
        if args.screenshots:
            screenshots(browser, args.page, args.screenshots)
    return 0


def screenshots(browser: Browser, page: Path, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    browser.open(page)
    for name, width, scheme, keys, whole in (
            ("wide", 1280, "light", (), True), ("dark", 1280, "dark", ("n",), True), ("narrow", 390, "light", (), True),
            ("near", 1280, "light", ("n", "-"), False), ("close", 1280, "dark", ("n", ENTER), False)):
        browser.size(width, 900)
        browser.scheme(scheme)
        _chart(browser)
        browser.keys(HOME, ESCAPE, *keys)
        browser.run("scrollTo(0, 0)")
        browser.settle()
        browser.screenshot(folder / f"{name}.png", whole)


if __name__ == "__main__":
    sys.exit(main())
