"""Hosts and the links between them, on one machine: network namespaces, joined by a program that delays and drops packets.

Needs root, iproute2 and /dev/net/tun; no traffic control of the kernel, so that it works on small kernels too.
"""

import collections
import ctypes
import fcntl
import os
import random
import select
import struct
import subprocess
import threading
import time

_TUNSETIFF = 0x400454CA
_IFF_TUN, _IFF_NO_PI = 0x0001, 0x1000
_CLONE_NEWNET = 0x40000000
_QUEUE_S = 0.25  # what a link of limited rate holds back at most; the rest is lost, as in a radio


def missing():
    """Why hosts cannot be had here; empty if they can."""
    if os.geteuid() != 0:
        return "network namespaces need root"
    if not os.path.exists("/dev/net/tun"):
        return "there is no /dev/net/tun"
    try:
        host = Host("probe")
        try:
            os.close(_open_tun(host.name, "probe0"))
        finally:
            host.remove()
    except (OSError, subprocess.CalledProcessError, FileNotFoundError) as error:
        return f"the kernel refuses network namespaces or tun devices ({error})"
    return ""


def _open_tun(namespace, device):
    """A tun device in the namespace. Only a thread can be there for a moment without taking the others along."""
    result = []

    def work():
        libc = ctypes.CDLL(None, use_errno=True)
        with open(f"/run/netns/{namespace}", encoding="ascii") as handle:
            if libc.setns(handle.fileno(), _CLONE_NEWNET) != 0:
                result.append(OSError(ctypes.get_errno(), "setns"))
                return
        try:
            fd = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
            fcntl.ioctl(fd, _TUNSETIFF, struct.pack("16sH22x", device.encode(), _IFF_TUN | _IFF_NO_PI))
            result.append(fd)
        except OSError as error:
            result.append(error)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    if isinstance(result[0], OSError):
        raise result[0]
    return result[0]


class Host:
    """A network of its own. What runs in it is started by run()."""

    _count = 0

    def __init__(self, name):
        Host._count += 1
        self.name = f"mapmend{os.getpid()}-{Host._count}-{name}"
        subprocess.run(["ip", "netns", "add", self.name], check=True, capture_output=True)
        subprocess.run(["ip", "-n", self.name, "link", "set", "lo", "up"], check=True)

    def prefix(self):
        return ["ip", "netns", "exec", self.name]

    def remove(self):
        subprocess.run(["ip", "netns", "del", self.name], check=False, capture_output=True)


class _Direction:
    def __init__(self):
        self.packets = collections.deque()  # (due, packet)
        self.free_at = 0.0


class Link:
    """Joins two hosts. Whatever is set holds for both directions."""

    def __init__(self, seed=1):
        self.loss, self.delay_s, self.mbit_per_s, self.is_cut = 0.0, 0.0, 0.0, False
        self.num_bytes = 0
        self._random = random.Random(seed)
        self._fds = [-1, -1]
        self._directions = [_Direction(), _Direction()]
        self._lock = threading.Lock()
        self._wake_read, self._wake_write = os.pipe()
        self._ends = False
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def attach(self, end, host, address, device="link0"):
        """Plugs host in at end 0 or 1. The host that was there before is gone, with all that was on its way. device: how
        the host calls the link; another one for each of its links."""
        fd = _open_tun(host.name, device)
        subprocess.run(["ip", "-n", host.name, "address", "add", address, "dev", device], check=True)
        subprocess.run(["ip", "-n", host.name, "link", "set", device, "up"], check=True)
        with self._lock:
            old, self._fds[end] = self._fds[end], fd
            self._directions = [_Direction(), _Direction()]
        if old >= 0:
            os.close(old)
        os.write(self._wake_write, b"x")

    def close(self):
        self._ends = True
        os.write(self._wake_write, b"x")
        self._thread.join()
        for fd in self._fds + [self._wake_read, self._wake_write]:
            if fd >= 0:
                os.close(fd)

    def _run(self):
        while not self._ends:
            with self._lock:
                now = time.monotonic()
                dues = [d.packets[0][0] for d in self._directions if d.packets]
                watched = [fd for fd in self._fds if fd >= 0] + [self._wake_read]
            ready, _, _ = select.select(watched, [], [], max(0.0, min(dues) - now) if dues else 0.5)
            with self._lock:
                if self._wake_read in ready:
                    os.read(self._wake_read, 64)
                for end, fd in enumerate(self._fds):
                    if fd in ready:
                        self._take(end, fd)
                self._give()

    def _take(self, end, fd):
        direction = self._directions[end]
        for _ in range(200):
            try:
                packet = os.read(fd, 65536)
            except (BlockingIOError, OSError):
                return
            if self.is_cut or self._random.random() < self.loss:
                continue
            now = time.monotonic()
            leaves = max(now, direction.free_at)
            if self.mbit_per_s > 0:
                if leaves - now > _QUEUE_S:
                    continue
                leaves += len(packet) * 8e-6 / self.mbit_per_s
                direction.free_at = leaves
            direction.packets.append((leaves + self.delay_s, packet))

    def _give(self):
        now = time.monotonic()
        for end, direction in enumerate(self._directions):
            fd = self._fds[1 - end]
            while direction.packets and direction.packets[0][0] <= now:
                packet = direction.packets.popleft()[1]
                if self.is_cut or fd < 0:
                    continue
                self.num_bytes += len(packet)
                try:
                    os.write(fd, packet)
                except OSError:
                    pass  # its queue is full, or it is down: lost
