#!/usr/bin/python3
"""How fast the live page draws: 200,000 points and 1,000 keyframes that are made up, turned all the time.

    speed.py URL [renderer]    URL: of a page that shows any map; renderer: software or webgl

Prints frames per second and milliseconds of CPU a frame, of all processes of the browser.
"""

import pathlib
import shutil
import sys
import time

from selenium import webdriver
from selenium.webdriver.chrome.service import Service

FILL = """
const {map, space} = mapmend, submaps = map.byNumber(), points = 200000 / submaps.length, keyframes = 1000 / submaps.length;
for (const s of submaps) {
  const from = s.points.count, size = s.radius;
  s.points.reserve(Math.round(points));
  for (let i = from; i < s.points.count; ++i) {
    for (let k = 0; k < 3; ++k) s.points.xyz[3 * i + k] = s.middle.getComponent(k) + (Math.random() - 0.5) * size;
    s.points.shown[i] = 1;
    s.points.t[i] = 0;
  }
  const first = s.keyframes.count;
  s.keyframes.reserve(Math.round(keyframes));
  for (let i = first; i < s.keyframes.count; ++i) {
    s.keyframes.pose.copyWithin(7 * i, 0, 7);
    for (let k = 0; k < 3; ++k) s.keyframes.pose[7 * i + k] += (Math.random() - 0.5) * size;
    s.keyframes.shown[i] = 1;
  }
  ++s.points.version;
  ++s.keyframes.version;
}
space.isFree = true;
const turn = () => {
  const p = space.camera.position.sub(space.controls.target), c = Math.cos(0.02), n = Math.sin(0.02);
  [p.x, p.y] = [c * p.x - n * p.y, n * p.x + c * p.y];
  p.add(space.controls.target);
  space.controls.update();
  space.isDirty = true;
  requestAnimationFrame(turn);
};
turn();
"""


def cpu_seconds():
    ticks = 0
    for process in pathlib.Path("/proc").glob("[0-9]*"):
        try:
            if b"chromium" in (process / "cmdline").read_bytes().split(b"\0")[0]:
                fields = (process / "stat").read_text().rsplit(")", 1)[1].split()
                ticks += int(fields[11]) + int(fields[12])
        except (OSError, IndexError):
            pass
    return ticks / 100


def main():
    options = webdriver.ChromeOptions()
    for argument in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--enable-unsafe-swiftshader", "--window-size=1400,900"):
        options.add_argument(argument)
    browser = webdriver.Chrome(service=Service(shutil.which("chromedriver")), options=options)
    renderer = f"?renderer={sys.argv[2]}" if len(sys.argv) > 2 else ""
    browser.get(sys.argv[1] + renderer)
    while not browser.execute_script("return window.mapmend?.state().upToDate && mapmend.state().frames > 1"):
        time.sleep(0.2)
    browser.execute_script(FILL)
    time.sleep(3)
    state = browser.execute_script("return mapmend.state()")
    before, cpu, start = state["frames"], cpu_seconds(), time.monotonic()
    time.sleep(10)
    frames = browser.execute_script("return mapmend.space.frames") - before
    seconds, used = time.monotonic() - start, cpu_seconds() - cpu
    size = browser.execute_script("return [mapmend.space.renderer.width, mapmend.space.renderer.height]")
    print(f"{state['renderer']}, {state['points']} points, {state['keyframes']} keyframes, {size[0]} x {size[1]}: "
          f"{frames / seconds:.1f} frames/s, {1000 * used / max(1, frames):.1f} ms of CPU a frame")
    browser.quit()


if __name__ == "__main__":
    main()
