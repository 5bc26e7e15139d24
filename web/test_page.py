"""The page as a person meets it, in headless Chromium: test_page.py LAPSERVO RIG IMAGE ITS_RIG [FOLDER for screenshots].

Ends with 77 and the reason where Chromium is not installed.
"""
import base64
import json
import os
import pathlib
import re
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time

PATIENCE_S = 60


class Browser:
    """One tab of Chromium, by its debugging protocol over a pipe."""

    def __init__(self, program, folder):
        ours, theirs = os.pipe(), os.pipe()  # Chromium reads at 3 and writes at 4

        def redirect():
            a, b = os.dup(ours[0]), os.dup(theirs[1])
            os.dup2(a, 3)
            os.dup2(b, 4)

        self.process = subprocess.Popen(
            [program, "--headless", "--no-sandbox", "--disable-gpu", "--remote-debugging-pipe", f"--user-data-dir={folder}"],
            preexec_fn=redirect, close_fds=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(ours[0])
        os.close(theirs[1])
        self.to, self.of = os.fdopen(ours[1], "wb"), os.fdopen(theirs[0], "rb")
        self.count, self.session, self.complaints, self.buffer = 0, None, [], b""
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(domain + ".enable")

    def read(self, awaited):
        while b"\0" not in self.buffer:
            if not select.select([self.of], [], [], PATIENCE_S)[0]:
                raise RuntimeError(f"Chromium did not answer {awaited} within {PATIENCE_S} s")
            part = os.read(self.of.fileno(), 65536)
            if not part:
                raise RuntimeError("Chromium has ended")
            self.buffer += part
        message, self.buffer = self.buffer.split(b"\0", 1)
        return json.loads(message)

    def call(self, method, **params):
        self.count += 1
        message = {"id": self.count, "method": method, "params": params}
        if self.session:
            message["sessionId"] = self.session
        self.to.write(json.dumps(message).encode() + b"\0")
        self.to.flush()
        while True:
            answer = self.read(method)
            if answer.get("id") == self.count:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                return answer["result"]
            failed = answer.get("method") == "Runtime.consoleAPICalled" and answer["params"]["type"] == "error"
            if failed or answer.get("method") in ("Runtime.exceptionThrown", "Log.entryAdded"):
                self.complaints.append(json.dumps(answer["params"]))

    def value(self, expression):
        result = self.call("Runtime.evaluate", expression=expression, returnByValue=True)
        assert "exceptionDetails" not in result, result
        return result["result"].get("value")

    def holds(self, expression):
        """False also while the page loads or goes to another address."""
        try:
            return self.value(f"(() => {{ try {{ return {expression}; }} catch {{ return false; }} }})()")
        except RuntimeError as error:
            if "navigated" not in str(error):
                raise
            return False

    def wait_for(self, expression):
        end = time.monotonic() + PATIENCE_S
        while not self.holds(expression):
            assert time.monotonic() < end, f"{expression} did not become true: {self.value('document.body.innerText')}"
            time.sleep(0.05)

    def resize(self, width, height):
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 600)

    def key(self, key, code=None):
        for what in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=what, key=key, code=code or "Key" + key.upper(),
                      windowsVirtualKeyCode=32 if key == " " else 0, text=key if what == "keyDown" and len(key) == 1 else "")

    def enter(self):
        for what in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=what, key="Enter", code="Enter", windowsVirtualKeyCode=13,
                      text="\r" if what == "keyDown" else "")

    def place(self, name):
        return self.value(f"(b => ({{x: b.x + b.width / 2, y: b.y + b.height / 2}}))(document.getElementById('{name}').getBoundingClientRect())")

    def mouse(self, what, name):
        self.call("Input.dispatchMouseEvent", type=what, button="left", clickCount=1, **self.place(name))

    def click(self, name):
        for what in ("mousePressed", "mouseReleased"):
            self.mouse(what, name)

    def touch(self, what, *names):
        self.call("Input.dispatchTouchEvent", type=what, touchPoints=[self.place(name) for name in names])

    def connect(self, connected):
        self.call("Network.emulateNetworkConditions", offline=not connected, latency=0, downloadThroughput=-1, uploadThroughput=-1)

    def screenshot(self, path):
        with open(path, "wb") as file:
            file.write(base64.b64decode(self.call("Page.captureScreenshot", captureBeyondViewport=True)["data"]))

    def close(self):
        self.process.kill()
        self.process.wait()


def start(tool, *arguments):
    """lapservo and its page's address."""
    process = subprocess.Popen([tool, *arguments], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    impatience = threading.Timer(PATIENCE_S, process.kill)
    impatience.start()
    said = []
    for line in process.stdout:
        said.append(line)
        if found := re.match(r"page: (\S+)", line):
            impatience.cancel()
            return process, found[1]
    raise AssertionError(f"lapservo {' '.join(arguments)} gave no page within {PATIENCE_S} s: {''.join(said)}")


def state(browser, text):
    browser.wait_for(f"document.getElementById('state').textContent.includes({json.dumps(text)})")


def follow(browser, url):
    """A link on another site's page."""
    browser.call("Page.navigate", url=f"data:text/html,<a id=link href='{url}'>lapservo</a>")
    browser.wait_for("document.getElementById('link') !== null")
    browser.value("document.getElementById('link').click()")


def look(browser, folder, name):
    for width, height in ((1280, 800), (390, 844)):
        browser.resize(width, height)
        time.sleep(0.3)
        assert browser.value("document.documentElement.scrollWidth") <= width, f"{name} is wider than {width} px"
        small = browser.value("[...document.querySelectorAll('button')].filter(b => b.offsetHeight && b.offsetHeight < 44).length")
        assert small == 0, "a button is too small for a finger"
        if folder:
            browser.screenshot(os.path.join(folder, f"{name}_{width}.png"))


def see_no_stray_start(browser):
    browser.resize(1280, 800)
    for start in (lambda: browser.click("start"), browser.enter):  # by the mouse, by the keyboard
        browser.key("h")
        state(browser, "hold: held")
        if start == browser.enter:
            browser.value("document.getElementById('start').focus()")
        start()
        state(browser, "track")
        browser.key("h")
        state(browser, "hold: held")
        for key, code in (("s", "KeyS"), (" ", "Space")):
            browser.key(key, code)
        browser.enter()
        time.sleep(1)
        state(browser, "hold: held")
        browser.click("start")
        state(browser, "track")


def stop_process(process):
    """Returns when none of its threads runs any more."""
    process.send_signal(signal.SIGSTOP)
    tasks = pathlib.Path(f"/proc/{process.pid}/task")
    states = lambda: [stat.read_text().rpartition(")")[2].split()[0] for stat in tasks.glob("*/stat")]
    end = time.monotonic() + PATIENCE_S
    while any(one != "T" for one in states()):
        assert time.monotonic() < end, f"lapservo's threads did not stop: {states()}"
        time.sleep(0.01)


def see_no_late_start(browser, lapservo):
    browser.key("h")
    state(browser, "hold: held")
    stop_process(lapservo)
    browser.click("start")
    browser.wait_for("document.getElementById('note').textContent === 'start: no answer, it may have arrived'")
    lapservo.send_signal(signal.SIGCONT)
    time.sleep(1)
    state(browser, "hold: held")
    browser.click("start")
    state(browser, "track")


def see_no_start_of_an_arm_that_is_not_ready(browser):
    shown = "(showState({ ...last, loop: { ...last.loop, can_start: %s } }), document.getElementById('start').disabled)"
    assert browser.value(shown % "false") and not browser.value(shown % "true")


def see_the_loop(browser, tool, rig, folder):
    # A simulation that is watched for long enough; it ends by the page's button.
    lapservo, url = start(tool, "servo", "--rig", rig, "--robot", "sim", "--duration", "3600", "--web", "0", "--listen", "0.0.0.0")
    try:
        browser.call("Page.navigate", url=url.replace("0.0.0.0", "127.0.0.1").split("?")[0])
        browser.wait_for("document.body.innerText.includes('token')")  # refused
        browser.call("Page.navigate", url="about:blank")  # its further requests is refused, too
        time.sleep(1)
        browser.value("1")
        browser.complaints.clear()
        follow(browser, url.replace("0.0.0.0", "127.0.0.1"))
        browser.wait_for("location.search === '' && document.getElementById('picture').naturalWidth > 0")
        state(browser, "track")
        look(browser, folder, "servo")
        for key, code in (("h", "KeyH"), ("h", "KeyD"), ("р", "KeyH"), ("Process", "KeyH")):  # other layouts, an input method
            browser.key(key, code)
            state(browser, "hold: held")
            browser.value("document.getElementById('start').focus()")
            browser.enter()
            state(browser, "track")
        see_no_start_of_an_arm_that_is_not_ready(browser)
        see_no_stray_start(browser)
        see_no_late_start(browser, lapservo)
        assert not browser.complaints, browser.complaints
        browser.value("document.getElementById('stop').click()")
        assert lapservo.wait(PATIENCE_S) in (0, 1)
        said = lapservo.stdout.read()
        assert re.search("held for [0-9]+ of [0-9]+ ticks: held\n", said) and "arm_not_enabled" not in said, said
        state(browser, "not connected")
        assert browser.value("document.getElementById('picture').classList.contains('old')"), "an old image looks new"
        assert browser.value("!document.getElementById('alert').hidden")
        see_the_end(browser)
        look(browser, folder, "ended")
    finally:
        lapservo.kill()
        lapservo.wait()


def open_anew(browser, url):
    browser.call("Page.navigate", url="about:blank")  # the page of the run before still polls
    time.sleep(1)
    browser.value("1")
    browser.complaints.clear()
    browser.call("Page.navigate", url=url)
    browser.resize(1280, 800)


def see_the_tip(browser, tool, rig, folder):
    """Shift and a click, confirmed, move it; a click alone, or one that is cancelled, does not."""
    with tempfile.NamedTemporaryFile("w", suffix=".yaml") as with_tool:
        with_tool.write(pathlib.Path(rig).read_text() + "    tool: {tip_in_marker_m: [0, 0, 0.045]}\n")
        with_tool.flush()
        lapservo, url = start(tool, "servo", "--rig", with_tool.name, "--robot", "sim", "--duration", "3600", "--web", "0")

    def click(shift, right, down):
        box = browser.value("(b => ({x: b.x, y: b.y, w: b.width, h: b.height}))(document.getElementById('picture').getBoundingClientRect())")
        for what in ("mousePressed", "mouseReleased"):
            browser.call("Input.dispatchMouseEvent", type=what, button="left", clickCount=1, modifiers=8 if shift else 0,
                         x=box["x"] + right * box["w"], y=box["y"] + down * box["h"])

    try:
        open_anew(browser, url)
        state(browser, "track")
        browser.wait_for("document.getElementById('picture').naturalWidth > 0")
        asked = "!document.getElementById('tip').hidden"
        click(False, 0.6, 0.6)
        assert not browser.value(asked), "a click alone is a goal"
        click(True, 0.6, 0.6)
        browser.wait_for(asked)
        place = browser.value("(r => [r.x + r.width / 2, r.y + r.height / 2])(document.getElementById('target').getBoundingClientRect())")
        box = browser.value("(b => [b.x + 0.6 * b.width, b.y + 0.6 * b.height])(document.getElementById('picture').getBoundingClientRect())")
        assert max(abs(a - b) for a, b in zip(place, box)) < 2, (place, box)
        look(browser, folder, "tip")
        browser.resize(1280, 800)
        browser.click("cancel")
        assert not browser.value(asked) and browser.value("last.loop.answer") == ""
        for right, down, words in ((0.01, 0.01, "refused: tip_goal: "), (0.6, 0.6, "a goal of the tip came")):
            answered = f"document.getElementById('note').textContent.startsWith('tip: {words}')"
            end = time.monotonic() + PATIENCE_S
            while not browser.holds(answered):  # a page that lost lapservo for a moment takes its question back
                assert time.monotonic() < end, f"no '{words}': {browser.value('document.body.innerText')}"
                click(True, right, down)
                if browser.holds(asked):
                    browser.click("move")
                time.sleep(2)
            assert not browser.value(asked)
        assert not browser.complaints, browser.complaints
        browser.value("document.getElementById('stop').click()")
        assert lapservo.wait(PATIENCE_S) in (0, 1)
        said = lapservo.stdout.read()
        assert "a goal of the tip came" in said, said
    finally:
        lapservo.kill()
        lapservo.wait()


def goes_on_tracking(browser, press):
    browser.value("document.getElementById('run').focus()")
    press()
    tracks = lambda: browser.value("document.getElementById('state').textContent") == "track"
    begin = time.monotonic()
    while not tracks() and time.monotonic() < begin + 3:
        time.sleep(0.05)
    time.sleep(0.5)
    return tracks()


def see_the_run_button(browser, tool, rig):
    """Nothing moves unless it is pressed, however it is released."""
    lapservo, url = start(tool, "servo", "--rig", rig, "--robot", "sim", "--duration", "3600", "--web", "0", "--operator-present", "page")
    press_key = lambda what, key: browser.call("Input.dispatchKeyEvent", type=what, key=key, code="Space" if key == " " else "Enter",
                                               windowsVirtualKeyCode=32 if key == " " else 13, text=key if what == "keyDown" and key == " " else "")
    ways = {
        "mouse": (lambda: browser.mouse("mousePressed", "run"), lambda: browser.mouse("mouseReleased", "run")),
        "mouse that leaves": (lambda: browser.mouse("mousePressed", "run"), lambda: browser.mouse("mouseMoved", "title")),
        "finger": (lambda: browser.touch("touchStart", "run"), lambda: browser.touch("touchEnd")),
        "finger that slides off": (lambda: browser.touch("touchStart", "run"), lambda: browser.touch("touchMove", "title")),
        "space": (lambda: press_key("keyDown", " "), lambda: press_key("keyUp", " ")),
        "enter": (lambda: press_key("keyDown", "Enter"), lambda: press_key("keyUp", "Enter")),
        "focus": (lambda: press_key("keyDown", " "), lambda: browser.value("document.getElementById('run').blur()")),
        "h": (lambda: press_key("keyDown", " "), lambda: browser.key("h")),
        "a page that hangs": (lambda: press_key("keyDown", " "), lambda: browser.value("for (const end = Date.now() + 500; Date.now() < end;);")),
        "a network that is gone": (lambda: press_key("keyDown", " "), lambda: browser.connect(False)),
    }
    try:
        open_anew(browser, url)
        state(browser, "hold: operator_absent")
        assert browser.value("document.getElementById('start').hidden"), "there are two buttons that start"
        for name, (press, let_go) in ways.items():
            # On a computer that is busy with other things a press may be late, which is a release.
            end = time.monotonic() + PATIENCE_S
            while not goes_on_tracking(browser, press):
                assert time.monotonic() < end, f"{name}: does not go on: {browser.value('document.body.innerText')}"
                browser.value("release()")
            let_go()
            gone = name == "a network that is gone"
            if gone:
                time.sleep(0.5)
                browser.connect(True)
                browser.complaints.clear()
            # For good: what is still pressed does not start again.
            state(browser, "hold: held" if name == "h" else "hold: operator_absent")
            time.sleep(0.5)
            assert "track" not in browser.value("document.getElementById('state').textContent"), name
            # A press that was late, and what Chromium reports late of the network that is gone.
            allowed = ["409 (Conflict)"] + ["ERR_INTERNET_DISCONNECTED"] * gone
            others = [complaint for complaint in browser.complaints if not any(text in complaint for text in allowed)]
            assert not others, (name, others)
            browser.complaints.clear()
            press_key("keyUp", " ")
            browser.mouse("mouseReleased", "run")
            if "slides" in name:
                browser.touch("touchEnd")
        browser.value("document.getElementById('stop').click()")
        assert lapservo.wait(PATIENCE_S) in (0, 1)
    finally:
        lapservo.kill()
        lapservo.wait()


def see_the_end(browser):
    assert browser.value("document.getElementById('buttons').hidden"), "a button has nothing to act on"
    assert browser.value("document.getElementById('state').className") != "track", "what has ended looks alive"


def see_units(browser):
    """A page of an image: angles are in rad as in files, and nothing is minus zero."""
    rows = browser.value("[...document.querySelectorAll('#instruments th')].map(th => th.textContent).join()")
    assert "psi [rad]" in rows and "mrad" not in rows, rows
    shown = [browser.value(f"shown({json.dumps(name)}, {value})") for name, value in
             (("psi_rad", -1.23456), ("psi_rad", -0.00004), ("rho_m", -1e-6), ("r_px", -0.04), ("r_px", -10.04))]
    assert shown == ["-1.2346", "0.0000", "0.00", "0.0", "-10.0"], shown


def see_no_broken_image(browser):
    """Where no image has come yet, its place is empty."""
    visibility = """(image => { image.removeAttribute('src'); document.body.append(image);
        const found = getComputedStyle(image).visibility; image.remove(); return found; })"""
    picture = "document.getElementById('picture')"
    assert browser.value(f"{visibility}({picture}.cloneNode())") == "hidden"
    assert browser.value(f"getComputedStyle({picture}).visibility") == "visible"


def see_a_picture(browser, tool, rig, picture, folder):
    lapservo, url = start(tool, "view", picture, "--rig", rig, "--web", "0")
    try:
        browser.complaints.clear()
        browser.call("Page.navigate", url=url)
        browser.wait_for("document.getElementById('picture').naturalWidth > 0")
        state(browser, "ended: 1 of 1 seen")
        see_the_end(browser)
        see_units(browser)
        see_no_broken_image(browser)
        assert browser.value("document.getElementById('start').hidden"), "nothing here can be started"
        assert browser.value("document.getElementById('note').textContent") == ""
        assert not browser.complaints, browser.complaints
        look(browser, folder, "view")
        time.sleep(1)
        assert not browser.value("document.getElementById('picture').classList.contains('old')"), "a file's image gets old"
    finally:
        lapservo.terminate()
        assert lapservo.wait(PATIENCE_S) in (0, 1)


def main():
    tool, rig, picture, picture_rig = sys.argv[1:5]
    folder = sys.argv[5] if len(sys.argv) > 5 else None
    program = shutil.which("chromium")
    if not program:
        print("skipped: chromium is not installed")
        return 77
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        browser = Browser(program, profile)
        try:
            see_a_picture(browser, tool, picture_rig, picture, folder)
            see_the_loop(browser, tool, rig, folder)
            see_the_tip(browser, tool, rig, folder)
            see_the_run_button(browser, tool, rig)
        finally:
            browser.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
