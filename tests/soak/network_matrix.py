"""One vehicle in the air, its station on the ground, and a link between them that delays, loses, is cut, or loses its
hosts. What reaches the ground must be what was seen in the air, and soon."""

import dataclasses
import signal
import time

import flight
import network

CATCH_UP_S = 10.0


@dataclasses.dataclass
class Cell:
    loss: float = 0.0
    delay_ms: int = 0  # each way
    cut_s: float = 0.0
    reboot: str = ""  # air, ground
    skew_s: int = 0  # of the wall clock in the air
    realtime: bool = False
    mbit_per_s: float = 10.0

    def name(self):
        parts = [f"{self.loss:.0%} loss", f"{self.delay_ms} ms"]
        parts += [f"cut {self.cut_s:.0f} s"] if self.cut_s else []
        parts += [f"reboot of {self.reboot}"] if self.reboot else []
        parts += [f"clock {self.skew_s / 3600:+.0f} h"] if self.skew_s else []
        parts += ["real time"] if self.realtime else []
        return ", ".join(parts)


@dataclasses.dataclass
class Outcome:
    map: flight.Map
    flown_s: float = 0.0  # from the start to the landing, catching up included
    event_end_s: float = 0.0  # when the last disturbance was over
    backlog_bytes: int = 0  # what waited then
    frames_read: int = 0  # in the air
    frames_dropped: int = 0
    problem: str = ""


def _outbox_bytes(folder):
    path = folder / "air/outbox"
    return path.stat().st_size if path.exists() else 0


class _Stage:
    """The two hosts and what runs on them."""

    def __init__(self, cell, folder):
        self.cell, self.folder = cell, flight.fresh(folder)
        self.link = network.Link()
        self.link.loss, self.link.delay_s, self.link.mbit_per_s = cell.loss, cell.delay_ms / 1000, cell.mbit_per_s
        self.hosts, self.processes = {}, {}
        self.boot("ground")
        self.boot("air")

    def boot(self, name):
        """A new host with nothing on it: what was connected to the old one hears no more of it."""
        is_air = name == "air"
        old = self.hosts.get(name)
        self.hosts[name] = network.Host(name)
        self.link.attach(0 if is_air else 1, self.hosts[name], (flight.AIR if is_air else flight.GROUND) + "/24")
        if old:
            old.remove()

    def start(self, name, argv, environment=None):
        self.processes[name] = flight.Process(argv, self.folder / f"{name}.txt", self.hosts[name], environment)
        return self.processes[name]

    def start_station(self):
        said = self.folder / "ground.txt"
        before = said.read_text().count("station: maps") if said.exists() else 0
        station = self.start("ground", flight.station_command(self.folder))
        end = time.monotonic() + 60
        while station.text().count("station: maps") <= before:
            if time.monotonic() > end or station.popen.poll() is not None:
                raise flight.Failure("the station does not start: " + station.text()[-500:])
            time.sleep(0.05)

    def start_flight(self):
        options = list(flight.SKIP)
        if self.cell.realtime:
            options += ["--realtime", "--speed", flight.SPEED]
        self.start("air", flight.fly_command(self.folder, options), flight.with_clock(self.cell.skew_s))

    def close(self):
        for process in self.processes.values():
            process.kill_all()
        self.link.close()
        for host in self.hosts.values():
            host.remove()


def _disturb(stage, cell):
    if cell.cut_s:
        stage.link.is_cut = True
        time.sleep(cell.cut_s)
        stage.link.is_cut = False
    if cell.reboot:
        stage.link.is_cut = True  # a host that has lost power says nothing
        stage.processes[cell.reboot].kill_all()
        stage.boot(cell.reboot)
        time.sleep(3)
        stage.link.is_cut = False
        if cell.reboot == "ground":
            stage.start_station()
        else:
            stage.start_flight()


def fly(cell, folder, flight_s=0.0, timeout_s=420):
    """One flight under the conditions of a cell. flight_s: how long it takes undisturbed."""
    outcome = Outcome(flight.Map())
    stage = _Stage(cell, folder)
    try:
        stage.start_station()
        start = time.monotonic()
        stage.start_flight()
        if cell.cut_s or cell.reboot:
            stage.processes["air"].await_text("frames", 60)
            time.sleep(max(2.0, flight_s / 3))
            _disturb(stage, cell)
        time.sleep(max(0.0, start + flight_s - time.monotonic()))
        outcome.event_end_s = time.monotonic() - start
        outcome.backlog_bytes = _outbox_bytes(folder)
        code = stage.processes["air"].await_end(timeout_s)
        outcome.flown_s = time.monotonic() - start
        if code != 0:
            raise flight.Failure(f"the flight ends with {code}: " + stage.processes["air"].text()[-500:])
        stage.processes["ground"].popen.send_signal(signal.SIGINT)
        code = stage.processes["ground"].await_end(timeout_s)
        if code != 0:
            raise flight.Failure(f"the station ends with {code}: " + stage.processes["ground"].text()[-500:])
        outcome.map = flight.read_map(folder / "ground")
        outcome.frames_read, outcome.frames_dropped = flight.flown(folder / "air")
    except flight.Failure as failure:
        outcome.problem = str(failure)
    finally:
        stage.close()
    return outcome


def judge(cell, outcome, undisturbed, judge_time=True):
    """What is wrong with the outcome; empty if nothing. A busy machine takes its time."""
    if outcome.problem:
        return outcome.problem
    found, expected = outcome.map, undisturbed.map
    if cell.reboot == "air" or cell.realtime:
        # What was seen depends on the moment; but all that was seen must be there.
        if found.frames_in < outcome.frames_read:
            return f"{found.frames_in} of {outcome.frames_read} frames"
    elif found.stream_hash != expected.stream_hash:
        return "another stream"
    elif found.map_hash != expected.map_hash:
        return "another map"
    late = outcome.flown_s - outcome.event_end_s
    allowed = CATCH_UP_S + 2 * outcome.backlog_bytes * 8e-6 / cell.mbit_per_s
    if judge_time and cell.loss < 0.2 and late > allowed:
        return f"caught up after {late:.0f} s instead of {allowed:.0f} s"
    return ""
