"""A station and a vehicle on two hosts, a look at the map in the end, and how long everything took."""

import dataclasses
import glob
import json
import os
import pathlib
import re
import shutil
import signal
import socket
import subprocess
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
FLIGHT = ROOT / "data/flights/sheffield_cross"
# The second half of the first flight in the bundled video and the first half of the other: two submaps.
SKIP = ("--skip-frames", "0-39,131-171")
SPEED = "60"  # of flights in real time: photographs seven seconds apart become nine frames a second
FLIGHT_S = 13.5  # how long a flight takes at that speed
SESSION = "7a0f3c52-61d4-4d0b-8f0e-0c9be5a4e101"
AIR, GROUND = "10.77.0.1", "10.77.0.2"


class Failure(Exception):
    """What was expected did not happen; says where the logs are."""


def programs():
    """The folder of the programs: the build's, unless MAPMEND_BIN says otherwise."""
    return pathlib.Path(os.environ.get("MAPMEND_BIN", ROOT / "build/bin"))


def mapmend():
    return str(programs() / "mapmend")


def with_clock(seconds):
    """Environment under which the wall clock, and only it, is off by so much. None without libfaketime."""
    if seconds == 0:
        return {}
    library = glob.glob("/usr/lib/*/faketime/libfaketimeMT.so.1")
    if not library:
        return None
    return {"LD_PRELOAD": library[0], "FAKETIME": f"{seconds:+d}s", "DONT_FAKE_MONOTONIC": "1",
            "FAKETIME_DONT_FAKE_MONOTONIC": "1"}


class Process:
    """A command in a process group of its own, on a host; output goes to a file."""

    def __init__(self, argv, log, host=None, environment=None):
        self.log = pathlib.Path(log)
        variables = {k: v for k, v in os.environ.items() if k not in ("LCM_DEFAULT_URL", "MAPMEND_TOKEN")}
        variables.update(environment or {})
        self.mark = f"MAPMEND_SOAK={os.getpid()}.{time.monotonic_ns()}"
        variables["MAPMEND_SOAK"] = self.mark.split("=")[1]
        with open(log, "ab") as output:
            self.popen = subprocess.Popen((host.prefix() if host else []) + argv, env=variables, stdout=output,
                                          stderr=output, stdin=subprocess.DEVNULL)

    def text(self):
        return self.log.read_text(errors="replace")

    def pids(self):
        """It and all that it has started (each has the mark in its environment)."""
        found = []
        for path in glob.glob("/proc/[0-9]*/environ"):
            try:
                if self.mark.encode() in pathlib.Path(path).read_bytes():
                    found.append(int(path.split("/")[2]))
            except OSError:
                pass
        return found

    def pid_of(self, program):
        """Of the process that runs this program; 0 if there is none."""
        for pid in self.pids():
            try:
                if os.path.basename(os.readlink(f"/proc/{pid}/exe")) == program:
                    return pid
            except OSError:
                pass
        return 0

    def kill_all(self):
        for _ in range(50):
            pids = self.pids()
            for pid in pids:
                try:
                    os.kill(pid, signal.SIGKILL)
                except ProcessLookupError:
                    pass
            self.popen.poll()
            if not pids:
                break
            time.sleep(0.02)
        self.popen.wait()

    def await_text(self, text, timeout_s):
        end = time.monotonic() + timeout_s
        while text not in self.text():
            if time.monotonic() > end or self.popen.poll() is not None:
                raise Failure(f"'{text}' is not said within {timeout_s} s: {self.text()[-500:]}")
            time.sleep(0.05)

    def await_end(self, timeout_s):
        try:
            return self.popen.wait(timeout_s)
        except subprocess.TimeoutExpired:
            raise Failure(f"has not ended after {timeout_s} s: {self.text()[-500:]}") from None


@dataclasses.dataclass
class Map:
    """What came out."""

    stream_hash: str = ""
    map_hash: str = ""
    frames_in: int = 0
    frames_tracked: int = 0


def flown(folder):
    """How many frames the vehicle with this folder has read, in the longest flight into it (all are of one session), and
    how many it has dropped because it was busy."""
    log = folder / "logs/frontend.log"
    text = log.read_text(errors="replace") if log.exists() else ""
    return (max([int(n) for n in re.findall(r"end: (\d+) frames", text)], default=0),
            sum(int(n) for n in re.findall(r"(\d+) frames came while the frontend was busy", text)))


def read_map(folder):
    """The hashes of the map and its figures."""
    out = subprocess.run([mapmend(), "db", "hash", str(folder / "map.db")], capture_output=True, text=True, check=False)
    result = Map()
    for line in out.stdout.splitlines():
        words = line.split()
        if words and words[0].startswith("stream"):
            result.stream_hash = words[-1]
        elif words and words[0].startswith("map"):
            result.map_hash = words[-1]
    if (folder / "summary.json").exists():
        summary = json.loads((folder / "summary.json").read_text())
        result.frames_in, result.frames_tracked = summary.get("frames_in", 0), summary.get("frames_tracked", 0)
    return result


def free_port():
    """One that nobody listens on at the moment."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def fresh(folder):
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    return folder


def station_command(folder, port=7700):
    return [mapmend(), "station", "--bind", "0.0.0.0", "--port", str(port), "--token-file", str(folder / "hub.token"),
            "--seed", "1", "--out", str(folder / "ground")]


def fly_command(folder, options=(), station=GROUND):
    return [mapmend(), "fly", str(FLIGHT / "video.mp4"), "--vehicle", "red", "--station", station, "--token-file",
            str(folder / "hub.token"), "--session", SESSION, "--seed", "1", "--out", str(folder / "air"),
            "--images", "160",  # what is measured are the records; full images take a slow link for minutes after them
            *options]
