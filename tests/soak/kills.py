"""Power cuts at random moments, and a long soak in which something is killed every few seconds."""

import json
import os
import pathlib
import random
import signal
import socket
import struct
import subprocess
import threading
import time

import attacks
import flight

SETTLE_S = 1.0  # what was tracked earlier than that before the power went must be in the map
SERVICES = ("hub", "submap_store", "merger", "viewer_export", "mosaic")


class _PoseCounter(threading.Thread):
    """Listens to the live poses of a run: each stands for a frame that was tracked."""

    def __init__(self, url_file):
        super().__init__(daemon=True)
        self.times = []
        self._url_file = url_file
        self.start()

    def run(self):
        while not self._url_file.exists() or not self._url_file.read_text().endswith("\n"):
            time.sleep(0.02)
        try:
            hub = socket.create_connection(("127.0.0.1", int(self._url_file.read_text().strip().rsplit(":", 1)[1])))
            hub.sendall(attacks.GREETING + attacks.subscribe("MAPMEND_FRAME_POSE"))
            stream = hub.makefile("rb")
            stream.read(8)
            while True:
                stream.read(4)  # PUBLISH
                for _ in ("channel", "data"):
                    stream.read(struct.unpack(">I", stream.read(4))[0])
                self.times.append(time.monotonic())
        except (OSError, struct.error):
            pass  # the power is gone

    def count_before(self, when):
        return sum(1 for t in self.times if t < when)


def power_cut(folder, moment_s):
    """Kills a whole run after moment_s and makes the map of what is there. Returns frames that had been tracked
    SETTLE_S before, frames in the map, and what is wrong."""
    flight.fresh(folder)
    out = folder / "out"
    run = flight.Process([flight.mapmend(), "run", str(flight.FLIGHT / "video.mp4"), *flight.SKIP, "--realtime", "--speed",
                          flight.SPEED, "--session", flight.SESSION, "--seed", "1", "--port", "0", "--out", str(out)],
                         folder / "run.txt")
    poses = _PoseCounter(out / "logs/lcm-url")
    try:
        run.popen.wait(moment_s)
    except subprocess.TimeoutExpired:
        pass
    cut = time.monotonic()
    run.kill_all()
    due = poses.count_before(cut - SETTLE_S)
    if not (out / "map.db").exists():
        return due, 0, "" if due == 0 else "there is no map.db"
    recovered = subprocess.run([flight.mapmend(), "recover", str(out)], capture_output=True, text=True, timeout=300,
                               check=False)
    summary = out / "summary.json"
    found = json.loads(summary.read_text()).get("frames_in", 0) if summary.exists() else 0
    if found < due:
        return due, found, f"{found} of {due} frames; recover says: {(recovered.stdout + recovered.stderr)[-300:]}"
    return due, found, ""


def power_cuts(folder, count, seed=1):
    """(moment, due, found, problem) of each."""
    rng = random.Random(seed)
    for i in range(count):
        moment = rng.uniform(0.2, 16.0)
        yield (moment, *power_cut(folder / f"cut{i}", moment))


NUM_FLIGHTS = 12  # of a soak


def _rss_mb(pid):
    try:
        for line in pathlib.Path(f"/proc/{pid}/status").read_text().splitlines():
            if line.startswith("VmRSS:"):
                return int(line.split()[1]) / 1024
    except OSError:
        pass
    return None


def _slope(points):
    """Least squares, per minute; 0 for too few points."""
    if len(points) < 3:
        return 0.0
    n = len(points)
    mx, my = sum(x for x, _ in points) / n, sum(y for _, y in points) / n
    spread = sum((x - mx) ** 2 for x, _ in points)
    return 60 * sum((x - mx) * (y - my) for x, y in points) / spread if spread else 0.0


def soak(folder, minutes, kill_every_s=10.0, seed=1):
    """A station that stays up, flight after flight into it, and a kill of one of its services every few seconds. Returns
    a dictionary of what was seen."""
    flight.fresh(folder)
    rng = random.Random(seed)
    # A dozen flights: each sees the same ground, so the last merge grows with their number squared.
    speed = f"{float(flight.SPEED) * min(1, flight.FLIGHT_S * NUM_FLIGHTS / (minutes * 60)):.3f}"
    port = str(flight.free_port())
    station = flight.Process([flight.mapmend(), "station", "--port", port, "--seed", "1", "--out",
                              str(folder / "ground")], folder / "ground.txt")
    start = time.monotonic()
    memory = {}  # program: [(s, MB)], of processes that were not just started
    first_seen = {}
    kills = dict.fromkeys(SERVICES, 0)
    flights, vehicle, problem = 0, None, ""
    next_kill = start + kill_every_s
    try:
        station.await_text("station: maps", 60)
        while True:
            now = time.monotonic()
            flying = vehicle is not None and vehicle.popen.poll() is None
            if not flying and vehicle is not None and vehicle.popen.returncode != 0:
                raise flight.Failure(f"flight {flights} ends with {vehicle.popen.returncode}: " + vehicle.text()[-400:])
            if now - start > minutes * 60 and not flying:
                break
            if not flying:
                flights += 1
                vehicle = flight.Process(
                    [flight.mapmend(), "fly", str(flight.FLIGHT / "video.mp4"), *flight.SKIP, "--realtime", "--speed", speed,
                     "--vehicle", f"v{flights}", "--station", f"127.0.0.1:{port}", "--out", str(folder / f"v{flights}")],
                    folder / f"v{flights}.txt")
            for program in SERVICES:
                pid = station.pid_of(program)
                if not pid:
                    continue
                age = now - first_seen.setdefault(pid, now)
                size = _rss_mb(pid)
                if age > 5 and size:
                    memory.setdefault(program, []).append((now - start, size))
            size = _rss_mb(station.popen.pid)
            if size and now - start > 20:
                memory.setdefault("station", []).append((now - start, size))
            if now >= next_kill:
                next_kill = now + kill_every_s
                program = rng.choice(SERVICES)
                pid = station.pid_of(program)
                if pid:
                    os.kill(pid, signal.SIGKILL)
                    kills[program] += 1
            if station.popen.poll() is not None:
                raise flight.Failure("the station has ended: " + station.text()[-400:])
            time.sleep(1)
        station.popen.send_signal(signal.SIGINT)
        code = station.await_end(900)
        if code != 0:
            raise flight.Failure(f"the station ends with {code}: " + station.text()[-400:])
        result = flight.read_map(folder / "ground")
        expected = sum(flight.flown(folder / f"v{i + 1}")[0] for i in range(flights))
        if result.frames_in != expected:
            problem = f"{result.frames_in} of {expected} frames are in the map"
    except flight.Failure as failure:
        problem = str(failure)
    finally:
        if vehicle:
            vehicle.kill_all()
        station.kill_all()
    return {"minutes": (time.monotonic() - start) / 60, "flights": flights, "kills": kills, "problem": problem,
            "memory": {name: (max(y for _, y in points), _slope(points)) for name, points in memory.items()}}
