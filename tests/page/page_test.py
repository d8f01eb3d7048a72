#!/usr/bin/python3
"""The live page in a real browser, beside real processes.

    page_test.py BUILD_FOLDER [SCREENSHOTS] [TEST ...]

Skipped (77) where Chromium, its driver or selenium is missing: `scripts/setup --browser` installs them.
"""

import base64
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest
import urllib.error
import urllib.request

SOURCE = pathlib.Path(__file__).resolve().parents[2]
FLIGHT = SOURCE / "data/flights/sheffield_cross"
PATIENCE_S = 300  # on a busy machine; only what hangs takes longer

try:
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys
except ImportError:
    print("skipped: no selenium; scripts/setup --browser installs it")
    sys.exit(77)
for program in ("chromium", "chromedriver"):
    if not shutil.which(program):
        print(f"skipped: no {program}; scripts/setup --browser installs it")
        sys.exit(77)

PROGRAM = None  # mapmend
SHOTS = None  # folder of screenshots


def wait_for(condition, what, seconds=PATIENCE_S):
    """The first true value of the condition."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        value = condition()
        if value:
            return value
        time.sleep(0.1)
    raise AssertionError(f"not seen within {seconds} s: {what}")


# Texts that differ too little from what they stand on (WCAG 2.1, 1.4.3: 4.5, large ones 3).
CONTRAST = """
const light = c => [0, 1, 2].map(i => c[i] / 255).map(v => v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
  .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
const read = text => (text.match(/[\\d.]+/g) ?? []).map(Number);
const ground = node => {
  for (let n = node; n; n = n.parentElement) {
    const c = read(getComputedStyle(n).backgroundColor);
    if (c.length === 3 || c[3] > 0.9) return c;
  }
  return matchMedia("(prefers-color-scheme: dark)").matches ? [18, 18, 18] : [255, 255, 255];
};
const bad = [], texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
let looked = 0;
while (texts.nextNode()) {
  const node = texts.currentNode.parentElement, style = getComputedStyle(node), box = node.getBoundingClientRect();
  if (!texts.currentNode.data.trim() || !box.width || node.closest("svg, script, style, :disabled")) continue;
  const [a, b] = [light(read(style.color)), light(ground(node))].sort((x, y) => y - x), size = parseFloat(style.fontSize);
  const ratio = (a + 0.05) / (b + 0.05), isLarge = size >= 24 || (size >= 18.66 && style.fontWeight >= 700);
  ++looked;
  if (ratio < (isLarge ? 3 : 4.5)) bad.push(`${ratio.toFixed(2)} ${node.tagName}.${node.className}: ${texts.currentNode.data.trim().slice(0, 40)}`);
}
return [looked, bad];
"""


class Command:
    """A mapmend that runs beside the test; ends with it."""

    def __init__(self, folder, *arguments, before=()):
        self.log = pathlib.Path(folder) / f"{arguments[0]}-{time.monotonic_ns()}.log"
        with open(self.log, "w") as log:
            self.process = subprocess.Popen([*before, PROGRAM, *map(str, arguments)], stdout=log, stderr=log, start_new_session=True)

    def text(self):
        return self.log.read_text(errors="replace")

    def page(self):
        def find():
            assert self.process.poll() is None or "live page" in self.text() or "http" in self.text(), self.text()
            return re.search(r"http://[0-9.:]+", self.text())
        return wait_for(find, "the address of the page")[0]

    def token(self):
        return re.search(r"token ([0-9a-f]{32})", self.text())[1]

    def wait(self):
        return self.process.wait(PATIENCE_S)

    def stop(self):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        try:
            return self.process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            os.killpg(self.process.pid, signal.SIGKILL)
            raise

    def child(self, program):
        """The process id of a child by its program's name."""
        for child in pathlib.Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children").read_text().split():
            words = pathlib.Path(f"/proc/{child}/cmdline").read_bytes().split(b"\0")
            if words[0].decode().endswith("/" + program):
                return int(child)
        return None


def open_browser(width=1400, height=900, dark=False):
    options = webdriver.ChromeOptions()
    for argument in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--hide-scrollbars",
                     "--force-device-scale-factor=1", f"--window-size={width},{height}"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    browser = webdriver.Chrome(service=Service(shutil.which("chromedriver")), options=options)
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride",
                            {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500})
    if dark:
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia",
                                {"features": [{"name": "prefers-color-scheme", "value": "dark"}]})
    return browser


class PageTest(unittest.TestCase):
    """One flight with a break in it, flown once for all tests."""

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp(prefix="mapmend_page_")
        cls.out, cls.recording = os.path.join(cls.folder, "flown"), os.path.join(cls.folder, "log")
        subprocess.run([PROGRAM, "run", FLIGHT / "video.mp4", "--out", cls.out, "--skip-frames", "0-55,74-83,106-171", "--seed", "3",
                        "--port", "0", "--record", cls.recording, "--quiet"], check=True, timeout=PATIENCE_S)

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder, ignore_errors=True)

    def setUp(self):
        self.browser = None
        self.commands = []

    def tearDown(self):
        if self.browser:
            self.browser.quit()
        for command in self.commands:
            command.stop()

    def start(self, *arguments, **options):
        command = Command(self.folder, *arguments, **options)
        self.commands.append(command)
        return command

    def open(self, url, **options):
        self.browser = open_browser(**options)
        self.load(url)

    def load(self, url):
        self.browser.get(url)
        wait_for(lambda: self.browser.execute_script("return !!window.mapmend"), "the page's script")

    def js(self, script, *arguments):
        return self.browser.execute_script(script, *arguments)

    def state(self):
        return self.js("return mapmend.state()")

    def text(self, selector):
        return self.js("return document.querySelector(arguments[0])?.textContent ?? ''", selector)

    def shot(self, name):
        if SHOTS:
            SHOTS.mkdir(parents=True, exist_ok=True)
            self.browser.save_screenshot(str(SHOTS / f"{name}.png"))

    def check_console(self):
        """Nothing was refused by the policy, nothing is missing, no script failed."""
        bad = [entry["message"] for entry in self.browser.get_log("browser") if entry["level"] == "SEVERE"
               and "ERR_CONNECTION" not in entry["message"] and "ERR_INCOMPLETE" not in entry["message"]
               and "ERR_EMPTY" not in entry["message"] and "/edge?" not in entry["message"]  # a wrong token is refused
               and "/tiles/" not in entry["message"]]  # beyond the ground that was seen there are none
        self.assertEqual(bad, [])

    def check_contrast(self):
        looked, bad = self.js(CONTRAST)
        self.assertGreater(looked, 20)
        self.assertEqual(bad, [])

    def summary(self):
        return json.loads(pathlib.Path(self.out, "summary.json").read_text())

    def look_at_flight(self, flight):
        """A loss, a merge that moves a submap, and the words for them."""
        wait_for(lambda: self.state()["keyframes"] > 0, "a keyframe while the flight lasts")
        wait_for(lambda: self.state()["submaps"] == 2, "the second submap")
        if not self.came_late:
            wait_for(lambda: "Tracking is lost after frame 73" in self.js("return told.join()"), "the word of the loss")
            self.assertIn(330, self.js("return tones"), "a low tone on a loss")
        self.assertTrue(self.js("return mapmend.map.byNumber()[0].info.lost"))
        self.shot("1_in_flight")
        wait_for(lambda: self.js("return [...mapmend.map.edges.values()].some(e => e.tree)"), "the merge")
        wait_for(lambda: self.js("return mapmend.map.byNumber().every(s => s.isJoined)"), "one map")
        wait_for(lambda: self.js("return mapmend.map.byNumber()[1].glides > 0"), "a submap that glides")
        wait_for(lambda: "Submap 1 is joined to submap 0" in self.js("return told.join()"), "the word of the merge")
        self.assertIn(784, self.js("return tones"), "a high tone on a merge")
        self.shot("2_merged")

    def listen(self):
        """Switches the sound on, and keeps what is played."""
        self.js("""window.tones = []; const Oscillator = OscillatorNode;
            window.OscillatorNode = class extends Oscillator {constructor(context, options) {super(context, options); tones.push(options.frequency);}}""")
        self.browser.find_element(By.ID, "sound").click()
        self.assertEqual(self.text("#sound"), "Sound on")
        wait_for(lambda: self.js("return tones") == [660], "the tone that says that it can be heard")

    # Tests run in the order of their names.

    def test_1_follows_a_flight_to_its_end(self):
        out = os.path.join(self.folder, "replayed")
        self.browser = open_browser()
        flight = self.start("replay", self.recording, "--speed", 12, "--out", out)
        self.load(flight.page())
        # All that was ever told, whatever is dismissed meanwhile.
        self.js("""window.told = []; new MutationObserver(changes => changes.forEach(c => c.addedNodes.forEach(n => told.push(n.textContent))))
            .observe(document.getElementById("alarms"), {childList: true})""")
        self.listen()
        # On a busy machine the browser may be there only after the loss.
        self.came_late = self.js("return mapmend.map.byNumber().some(s => s.info.lost)")
        self.look_at_flight(flight)
        self.assertEqual(flight.wait(), 0, flight.text())
        wait_for(lambda: self.state()["run"].get("stopped"), "the word that the run has ended")
        time.sleep(8)  # longer than the patience after which a broken link is told
        self.assertIn("The run has ended", self.text("#banner b"))
        self.assertEqual(self.js("return document.getElementById('banner').dataset.state"), "whole")
        self.assertIn(os.path.join(out, "report.html"), self.text("#banner-text"))
        summary, state = self.summary(), self.state()
        self.assertEqual(state["submaps"], len(summary["submaps"]))
        self.assertEqual(state["keyframes"], summary["keyframes_total"])
        figures = self.js("return mapmend.feed.values.get('figures')")
        self.assertEqual(figures["frames_in_main"], summary["frames_in_main"])
        self.assertEqual(figures["frames_tracked"], summary["frames_tracked"])
        self.assertEqual(figures["points_in_main"], summary["points_in_main"])
        self.assertEqual(figures["losses"], summary["losses"])
        self.assertEqual(figures["connections_evaluated"], len(summary["connections"]))
        self.assertEqual(len(self.js("return mapmend.map.restoration")), len(summary["restoration"]))
        # Still of use: the view turns.
        frames = state["frames"]
        self.browser.find_element(By.ID, "canvas").send_keys(Keys.ARROW_LEFT)
        wait_for(lambda: self.state()["frames"] > frames, "a picture after the end")
        self.shot("3_ended")
        self.check_console()

    def view(self, **options):
        page = self.start("view", self.out).page()
        self.open(page, **options)
        wait_for(lambda: self.state()["upToDate"] and self.state()["run"].get("state") == "whole", "the stored map")
        wait_for(lambda: self.js("return !!mapmend.feed.values.get('figures') && !!mapmend.feed.values.get('gaps')"), "the figures")
        return page

    def test_2_views_results_with_pictures(self):
        self.view()
        summary = self.summary()
        self.assertEqual(self.state()["keyframes"], summary["keyframes_total"])
        shown = self.js("return [...mapmend.map.submaps.values()].reduce((n, s) => n + s.points.shown.slice(0, s.points.count).reduce((a, b) => a + b, 0), 0)")
        self.assertEqual(shown, summary["points_in_main"])
        # An edge by the keyboard, its picture; it cannot be switched from here.
        edge = self.browser.find_element(By.CSS_SELECTOR, "#graph .edge.tree")
        self.assertIn("in the tree", edge.get_attribute("aria-label"))
        self.js("arguments[0].focus()", edge)
        edge.send_keys(Keys.ENTER)
        width = wait_for(lambda: self.js("return document.querySelector('#dialog img')?.naturalWidth"), "the picture of the edge")
        self.assertGreater(width, 800)
        self.assertIn("mapmend edges disable", self.text("#dialog"))
        self.shot("4_edge")
        self.browser.find_element(By.ID, "dialog-close").click()
        # A keyframe by a click on the map.
        at = self.js("""const m = mapmend.map, s = m.byNumber()[0], k = s.keyframes, c = m.cameraOnPage(s, k.pose.subarray(0, 7)).center
          .project(mapmend.space.camera), r = mapmend.space.canvas.getBoundingClientRect();
          return [Math.round(r.left + (c.x + 1) / 2 * r.width), Math.round(r.top + (1 - c.y) / 2 * r.height)]""")
        for kind in ("mousePressed", "mouseReleased"):
            self.browser.execute_cdp_cmd("Input.dispatchMouseEvent", {"type": kind, "x": at[0], "y": at[1], "button": "left", "clickCount": 1})
        width = wait_for(lambda: self.js("return document.querySelector('#dialog img')?.naturalWidth"), "the image of the keyframe")
        self.assertGreater(width, 400)
        self.assertIn("Keyframe of submap", self.text("#dialog-title"))
        self.shot("5_keyframe")
        self.check_console()

    def test_3_time_line_shows_the_map_as_it_was(self):
        self.view()
        all_keyframes = self.js("return mapmend.space.map.byNumber().filter(s => s.isVisible).length")
        self.assertEqual(all_keyframes, 2)
        slide = "const t = document.getElementById('time'); t.value = arguments[0]; t.dispatchEvent(new Event('input'))"
        self.js(slide, "0.3")
        wait_for(lambda: self.js("return mapmend.map.byNumber().filter(s => s.isVisible).length") == 1, "the first submap alone")
        self.assertIn("As it was", self.js("return document.getElementById('time-text').value"))
        self.shot("6_past")
        # Begun, not connected yet: apart.
        joined = self.js("return mapmend.map.restoration.find(r => r.event === 'merge').utime")
        begun = self.js("return mapmend.map.byNumber()[1].info.begin")
        if joined > begun:
            self.js("mapmend.timeline.onTime(arguments[0])", (joined + begun) / 2)
            wait_for(lambda: self.js("return mapmend.map.byNumber().filter(s => s.isVisible && !s.isJoined).length") == 1, "a submap apart")
        self.browser.find_element(By.ID, "now").click()
        wait_for(lambda: self.js("return mapmend.map.byNumber().every(s => s.isVisible && s.isJoined)"), "the map of now")

    def test_4_the_ground_from_above(self):
        self.view()
        self.browser.find_element(By.ID, "tab-ground").click()
        wait_for(lambda: self.js("return !!document.querySelector('#ground-map .leaflet-pane canvas')"), "paths on the map")
        time.sleep(2)
        self.shot("7_ground")
        self.check_console()

    def test_5_decisions_need_the_token(self):
        out = os.path.join(self.folder, "decided")
        shutil.copytree(self.out, out, dirs_exist_ok=True)
        port = 7700 + os.getpid() % 200
        station = self.start("station", "--out", out, "--bind", "127.0.0.1", "--port", port)
        self.open(station.page())
        wait_for(lambda: self.js("return [...mapmend.map.edges.values()].some(e => e.tree)"), "the stored connection")
        wait_for(lambda: self.state()["run"]["can_decide"], "that decisions can be made")
        self.browser.find_element(By.CSS_SELECTOR, "#edges button[data-edge]").click()
        field = wait_for(lambda: self.browser.find_elements(By.ID, "token"), "the field of the token")[0]
        field.send_keys("0123456789abcdef")
        self.browser.find_element(By.ID, "decide").click()
        wait_for(lambda: "token is wrong" in self.text("#decision"), "the refusal")
        self.assertFalse(self.js("return [...mapmend.map.edges.values()].some(e => e.disabled)"))
        glides = self.js("return Math.max(...[...mapmend.map.submaps.values()].map(s => s.glides ?? 0))")
        field.clear()
        field.send_keys(station.token())
        self.browser.find_element(By.ID, "decide").click()
        wait_for(lambda: "Switched off" in self.text("#decision"), "the word that it is off")
        wait_for(lambda: self.js("return [...mapmend.map.edges.values()].some(e => e.disabled)"), "the decision on the page")
        wait_for(lambda: self.js("return mapmend.map.numGroups") == 2, "two parts")
        wait_for(lambda: self.js("return Math.max(...[...mapmend.map.submaps.values()].map(s => s.glides ?? 0))") > glides, "a submap that moves apart")
        self.shot("8_switched_off")
        # On again: a merge, which moves the submap to its place.
        glides = self.js("return mapmend.map.byNumber()[1].glides")
        self.browser.find_element(By.ID, "dialog-close").click()
        self.browser.find_element(By.CSS_SELECTOR, "#edges button[data-edge]").click()
        wait_for(lambda: "Switch on again" in self.text("#decide"), "the button that switches on")
        self.browser.find_element(By.ID, "decide").click()
        wait_for(lambda: self.js("return mapmend.map.byNumber().every(s => s.isJoined)"), "one map again")
        wait_for(lambda: self.js("return mapmend.map.byNumber()[1].glides") > glides, "a submap that glides to its place")
        wait_for(lambda: "Submap 1 is joined to submap 0" in self.text("#alarms"), "the word of the merge")
        self.kill_the_viewer(station)

    def kill_the_viewer(self, station):
        epoch = self.state()["epoch"]
        os.kill(station.child("viewer_export"), signal.SIGKILL)
        wait_for(lambda: self.state()["epoch"] != epoch, "another viewer")
        wait_for(lambda: self.state()["link"] == "open" and self.state()["submaps"] == 2 and self.state()["upToDate"], "the map again")
        self.check_console()

    def test_6_phone_and_dark(self):
        self.view(width=360, height=740)
        self.assertLessEqual(self.js("return document.documentElement.scrollWidth"), 360)
        self.shot("9_phone")
        self.js("scrollTo(0, 900)")
        self.shot("9_phone_lower")
        self.check_contrast()
        self.browser.quit()
        self.open(self.commands[-1].page(), dark=True)
        wait_for(lambda: self.state()["upToDate"] and self.state()["frames"] > 3, "the page in the dark")
        time.sleep(2)
        self.shot("10_dark")
        self.check_contrast()

    def test_7_idle_traffic(self):
        self.view()
        time.sleep(3)
        before, start = self.state()["bytes"], time.monotonic()
        time.sleep(20)
        per_minute = (self.state()["bytes"] - before) * 60 / (time.monotonic() - start)
        print(f"idle: {per_minute / 1024:.0f} KB a minute")
        self.assertLess(per_minute, 1 << 20)

    def test_8_report_on_paper_and_phone(self):
        self.browser = open_browser()
        self.browser.get("file://" + os.path.join(self.out, "report.html"))
        self.shot("11_report")
        pdf = base64.b64decode(self.browser.execute_cdp_cmd("Page.printToPDF", {"preferCSSPageSize": True, "printBackground": False})["data"])
        path = pathlib.Path(self.folder, "report.pdf")
        path.write_bytes(pdf)
        self.assertGreaterEqual(len(re.findall(rb"/MediaBox \[0 0 59[45](\.\d+)? 84[12](\.\d+)?\]", pdf)), 1, "A4")
        if shutil.which("pdftotext"):
            text = subprocess.run(["pdftotext", "-layout", path, "-"], capture_output=True, text=True, check=True).stdout
            for word in ("Ended because", "Reason", "Verdict", "end of input"):
                self.assertIn(word, text)
        if SHOTS:
            shutil.copy(path, SHOTS / "12_report.pdf")
        # What is wider than the paper would be cut.
        self.browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
        self.browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {"width": 703, "height": 1000, "deviceScaleFactor": 1, "mobile": False})
        self.assertEqual(self.js("""return [...document.querySelectorAll('.scroll, .picture, .edge, .mosaic')]
            .filter(e => e.scrollWidth > e.clientWidth + 1 || e.getBoundingClientRect().right > innerWidth).map(e => e.className)"""), [])
        self.browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "screen"})
        self.browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {"width": 390, "height": 800, "deviceScaleFactor": 1, "mobile": True})
        self.assertLessEqual(self.js("return document.documentElement.scrollWidth"), 390)
        self.shot("13_report_phone")
        self.check_contrast()
        self.browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": "dark"}]})
        self.shot("14_report_phone_dark")
        self.check_contrast()

    def test_8a_a_vehicle_on_another_host(self):
        """Whoever is on another host is told apart from those of this one."""
        host = ("unshare", "--uts", "sh", "-c", 'hostname drone-1; exec "$@"', "sh")
        if subprocess.run([*host, "true"], capture_output=True, check=False).returncode != 0:
            self.skipTest("no other host can be made here")
        port = 7900 + os.getpid() % 90
        station = self.start("station", "--out", os.path.join(self.folder, "ground"), "--port", port)
        self.open(station.page())
        wait_for(lambda: "Merger" in self.text("#health"), "the merger of this host")
        self.assertNotIn(" on ", self.js("return [...document.querySelectorAll('#health b')].map(b => b.textContent).join()"))
        vehicle = self.start("fly", FLIGHT / "video.mp4", "--station", f"127.0.0.1:{port}", "--vehicle", "kite", "--realtime", "--speed", 6,
                             "--skip-frames", "0-55,86-171", "--out", os.path.join(self.folder, "air"), before=host)
        names = lambda: self.js("return [...document.querySelectorAll('#health b')].map(b => b.textContent)")
        wait_for(lambda: "Tracking (kite) on drone-1" in names(), "the frontend of another host")
        self.assertIn(f"Merger on {os.uname().nodename}", names())
        self.shot("15_two_hosts")
        self.assertEqual(vehicle.wait(), 0, vehicle.text())
        self.check_console()

    def test_9_database_alone_and_strangers(self):
        alone = os.path.join(self.folder, "alone")
        os.makedirs(alone, exist_ok=True)
        shutil.copy(os.path.join(self.out, "map.db"), alone)
        page = self.start("view", os.path.join(alone, "map.db")).page()
        self.open(page)
        wait_for(lambda: self.state()["upToDate"] and self.state()["submaps"] == 2, "the map of the database")
        for path, headers, status in (("/", {"Host": "evil.example"}, 403), ("/events", {"Origin": "http://evil.example"}, 403),
                                      ("/files/map.db", {}, 404), ("/lib/three/build/../../../../etc/passwd", {}, 404),
                                      ("/tiles/0/0/0", {}, 404), ("/keyframe.jpg?submap=9:9&id=1", {}, 404)):
            with self.assertRaises(urllib.error.HTTPError) as refused:
                urllib.request.urlopen(urllib.request.Request(page + path, headers=headers))
            self.assertEqual(refused.exception.code, status, path)
        policy = urllib.request.urlopen(page + "/").headers["Content-Security-Policy"]
        self.assertIn("default-src 'none'", policy)
        self.assertNotIn("unsafe", policy)


def main():
    global PROGRAM, SHOTS
    build, rest = pathlib.Path(sys.argv[1]).resolve(), sys.argv[2:]
    PROGRAM = str(build / "bin/mapmend")
    if rest and "/" in rest[0]:
        SHOTS = pathlib.Path(rest.pop(0)).resolve()
    unittest.main(argv=["page_test.py", "-v", *(f"PageTest.{name}" for name in rest)])


if __name__ == "__main__":
    main()
