"""Two vehicles in the air at once, each with a link of its own to the one station: what both have seen must end in one
map, the same one whatever happens to the links."""

import dataclasses
import json
import signal
import threading
import time

import flight
import network

# The bundled video holds two flights over one park: each vehicle flies one of them.
LEFT_OUT = {"red": "81-171", "blue": "0-80"}
NUM_FRAMES = 172
SESSIONS = {"red": "7a0f3c52-61d4-4d0b-8f0e-0c9be5a4e101", "blue": "7a0f3c52-61d4-4d0b-8f0e-0c9be5a4e102"}
NETS = {"red": "10.77.0", "blue": "10.78.0"}  # the vehicle is .1, the station .2
PORT = 7700


@dataclasses.dataclass
class Outcome:
    """What reached the ground."""

    map: flight.Map
    num_components: int = 0
    landed_s: float = 0.0  # until the station had all of both
    problem: str = ""


@dataclasses.dataclass
class Links:
    """Both are of the same kind; they are cut one after the other, with a while in which both are."""

    loss: float = 0.0
    delay_ms: int = 0  # each way
    cut_s: float = 0.0
    mbit_per_s: float = 10.0

    def name(self):
        parts = [f"{self.loss:.0%} loss", f"{self.delay_ms} ms"]
        return ", ".join(parts + ([f"cut {self.cut_s:.0f} s, one after the other"] if self.cut_s else []))


def _fly_command(vehicle, folder):
    return [flight.mapmend(), "fly", str(flight.FLIGHT / "video.mp4"), "--skip-frames", LEFT_OUT[vehicle], "--vehicle",
            vehicle, "--station", f"{NETS[vehicle]}.2", "--token-file", str(folder / "hub.token"), "--session",
            SESSIONS[vehicle], "--seed", "1", "--out", str(folder / vehicle), "--images", "160"]


def _cut(link, seconds):
    link.is_cut = True
    time.sleep(seconds)
    link.is_cut = False


def _read(folder):
    outcome = Outcome(flight.read_map(folder / "ground"))
    summary = json.loads((folder / "ground/summary.json").read_text())
    outcome.num_components = len(summary["components"])
    if len(summary["sessions"]) != len(LEFT_OUT):
        outcome.problem = f"{len(summary['sessions'])} flights are in the map"
    return outcome


def fly(links, folder, timeout_s=600):
    """Both flights, from start to the report on the ground."""
    flight.fresh(folder)
    hosts = {name: network.Host(name) for name in ("ground", *LEFT_OUT)}
    wires, processes = {}, {}
    try:
        for i, vehicle in enumerate(LEFT_OUT):
            wires[vehicle] = wire = network.Link(seed=i + 1)
            wire.loss, wire.delay_s, wire.mbit_per_s = links.loss, links.delay_ms / 1000, links.mbit_per_s
            wire.attach(0, hosts[vehicle], f"{NETS[vehicle]}.1/24")
            wire.attach(1, hosts["ground"], f"{NETS[vehicle]}.2/24", f"link{i}")
        processes["ground"] = station = flight.Process(flight.station_command(folder, PORT), folder / "ground.txt",
                                                       hosts["ground"])
        station.await_text("station: maps", 60)
        start = time.monotonic()
        for vehicle in LEFT_OUT:
            processes[vehicle] = flight.Process(_fly_command(vehicle, folder), folder / f"{vehicle}.txt", hosts[vehicle])
        if links.cut_s:
            for vehicle in LEFT_OUT:
                processes[vehicle].await_text("frames", 60)
            time.sleep(2)
            cuts = [threading.Thread(target=_cut, args=(wire, links.cut_s)) for wire in wires.values()]
            for cut in cuts:
                cut.start()
                time.sleep(links.cut_s / 2)
            for cut in cuts:
                cut.join()
        for vehicle in LEFT_OUT:
            code = processes[vehicle].await_end(timeout_s)
            if code != 0:
                raise flight.Failure(f"{vehicle} ends with {code}: " + processes[vehicle].text()[-500:])
        landed = time.monotonic() - start
        station.popen.send_signal(signal.SIGINT)
        code = station.await_end(timeout_s)
        if code != 0:
            raise flight.Failure(f"the station ends with {code}: " + station.text()[-500:])
        outcome = _read(folder)
        outcome.landed_s = landed
    except flight.Failure as failure:
        outcome = Outcome(flight.Map(), problem=str(failure))
    finally:
        for process in processes.values():
            process.kill_all()
        for wire in wires.values():
            wire.close()
        for host in hosts.values():
            host.remove()
    return outcome


def judge(outcome, undisturbed):
    """What is wrong with the outcome; empty if nothing."""
    if outcome.problem:
        return outcome.problem
    if outcome.num_components != 1:
        return f"{outcome.num_components} parts instead of one"
    if outcome.map.frames_in != NUM_FRAMES:
        return f"{outcome.map.frames_in} of {NUM_FRAMES} frames"
    if outcome.map.stream_hash != undisturbed.map.stream_hash:
        return "another stream"
    return "" if outcome.map.map_hash == undisturbed.map.map_hash else "another map"
