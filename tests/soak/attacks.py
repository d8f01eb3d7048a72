"""What strangers do to a hub and a live page, each beside a flight: the map must be the same, and tracking as quick."""

import json
import pathlib
import socket
import struct
import threading
import time

import flight


def _u32(value):
    return struct.pack(">I", value)


def _text(text):
    data = text if isinstance(text, bytes) else text.encode()
    return _u32(len(data)) + data


GREETING = _u32(0x287617FB) + _u32(0x0100)


def subscribe(pattern):
    return _u32(2) + _text(pattern)


def publish(channel, data):
    return _u32(1) + _text(channel) + _text(data)


class Attack(threading.Thread):
    """Goes on until stop() is called. Each attack is a function of the hub's port, the page's port and this object."""

    def __init__(self, work, hub, page):
        super().__init__(daemon=True)
        self._work, self._hub, self._page = work, hub, page
        self.ends = threading.Event()
        self.open = []
        self.start()

    def run(self):
        while not self.ends.is_set():
            try:
                self._work(self, self._hub, self._page)
            except OSError:
                pass  # thrown out: try again
            self.ends.wait(0.2)

    def connect(self, port):
        client = socket.create_connection(("127.0.0.1", port), timeout=5)
        self.open.append(client)
        if len(self.open) > 1500:
            self.open.pop(0).close()
        return client

    def stop(self):
        self.ends.set()
        self.join(20)
        for client in self.open:
            client.close()


def expressions(attack, hub, _page):
    """Expressions that take a backtracking matcher for ever."""
    for pattern in ("(a*)*b", "(.*)*(.*)*(.*)*b", "(" * 340 + "a" + ")" * 340, "((a{1,30}){1,30}){1,30}b"):
        client = attack.connect(hub)
        client.sendall(GREETING + subscribe(pattern) + publish("a" * 60, b"bait") * 20)
    attack.ends.wait(1)


def idle_clients(attack, hub, _page):
    """More connections than there is room for, none of which ever says a word."""
    while len(attack.open) < 1082 and not attack.ends.is_set():
        attack.connect(hub)
    attack.ends.wait(1)


def large_announcements(attack, hub, _page):
    """Clients that announce 64 MB and send 20."""
    part = b"x" * (1 << 20)
    for _ in range(10):
        client = attack.connect(hub)
        client.sendall(GREETING + _u32(1) + _text("A") + _u32(64 << 20))
        for _ in range(20):
            client.sendall(part)
    attack.ends.wait(10)


def deaf_subscriber(attack, hub, _page):
    """Subscribes to everything and never reads."""
    client = attack.connect(hub)
    client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    client.sendall(GREETING + subscribe(".*"))
    attack.ends.wait(60)


def flood(attack, hub, _page):
    """Small messages on ever new channels, as fast as they are taken, for a bounded number of bytes."""
    client = attack.connect(hub)
    client.sendall(GREETING)
    for i in range(40):
        if attack.ends.is_set():
            break
        client.sendall(b"".join(publish(f"NOISE_{i}_{k}", b"") for k in range(500)))
        time.sleep(0.05)
    attack.ends.wait(2)


def garbage(attack, hub, _page):
    """Bytes that mean nothing."""
    for i in range(20):
        client = attack.connect(hub)
        client.sendall((GREETING if i % 2 else b"") + bytes((i * 37 + k * k) % 256 for k in range(2000)))
    attack.ends.wait(0.5)


def slow_page(attack, _hub, page):
    """Forty readers of the page that send a byte now and then."""
    while len(attack.open) < 40:
        attack.connect(page).sendall(b"GET /state.json HTTP/1.1\r\nX: ")
    for client in attack.open:
        try:
            client.sendall(b"x")
        except OSError:
            attack.open.remove(client)
            break
    attack.ends.wait(0.5)


def idle_page(attack, _hub, page):
    """More connections to the page than there is room for."""
    while len(attack.open) < 1100 and not attack.ends.is_set():
        attack.connect(page)
    attack.ends.wait(1)


ALL = (expressions, idle_clients, large_announcements, deaf_subscriber, flood, garbage, slow_page, idle_page)


def fly(attacked_by, folder):
    """One flight on one host, under any number of attacks at once; returns the map and the latency of tracking in ms (median, 95 %)."""
    flight.fresh(folder)
    page_port = flight.free_port()
    run = flight.Process([flight.mapmend(), "run", str(flight.FLIGHT / "video.mp4"), *flight.SKIP, "--session", flight.SESSION,
                          "--seed", "1", "--port", str(page_port), "--out", str(folder / "out")], folder / "run.txt")
    attackers = []
    try:
        url = folder / "out/logs/lcm-url"
        end = time.monotonic() + 60
        while not url.exists() or not url.read_text().endswith("\n"):
            if time.monotonic() > end:
                raise flight.Failure("the run does not start: " + run.text()[-500:])
            time.sleep(0.02)
        hub_port = int(url.read_text().strip().rsplit(":", 1)[1])
        attackers = [Attack(attack, hub_port, page_port) for attack in attacked_by]
        code = run.await_end(300)
        if code != 0:
            raise flight.Failure(f"the flight ends with {code}: " + run.text()[-500:])
    finally:
        for attacker in attackers:
            attacker.stop()
        run.kill_all()
    summary = json.loads((folder / "out/summary.json").read_text())
    frontend = summary.get("frontend") or {}
    memory = {p["name"]: p["peak_rss_mb"] for p in summary.get("processes", [])}
    return (flight.read_map(pathlib.Path(folder / "out")), frontend.get("track_ms_median", 0.0),
            frontend.get("track_ms_p95", 0.0), memory.get("hub", 0))
