"""Wires between a player and roadvecd that can be cut and disturbed: what comes in is handed on, or what `fault` makes of it.

A fault is a function from one piece of data to the pieces that go on; None: the wire is sound.
"""

import os
import pathlib
import select
import socket
import struct
import termios
import threading
import tty

DEVICE_TIME = slice(1200, 1204)  # of a Velodyne's data packet: microseconds past the hour
HOUR_US = 3_600_000_000


class Wire(threading.Thread):
    """Reads until the test ends."""

    def __init__(self):
        super().__init__(daemon=True)
        self.fault = None
        self.ended = threading.Event()

    def run(self):
        while not self.ended.is_set():
            if select.select([self.source()], [], [], 0.1)[0]:
                for data in self.take():
                    for piece in [data] if self.fault is None else self.fault(data):
                        self.hand_on(piece)

    def close(self):
        self.ended.set()
        self.join()


class UdpWire(Wire):
    """The LiDAR's. A drive that is played again goes on in the sensor's time, as a sensor does."""

    def __init__(self, port):
        super().__init__()
        self.target = ("127.0.0.1", port)
        self.inward = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.inward.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 8 << 20)
        self.inward.bind(("127.0.0.1", 0))
        self.outward = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.port = self.inward.getsockname()[1]
        self.ahead_us = self.last_us = self.extra_us = 0

    def source(self):
        return self.inward

    def take(self):
        packet = bytearray(self.inward.recv(2048))
        (device_us,) = struct.unpack("<I", packet[DEVICE_TIME])
        if device_us < self.last_us - 1_000_000:
            self.ahead_us += self.last_us - device_us + 288
        self.last_us = device_us
        packet[DEVICE_TIME] = struct.pack("<I", (device_us + self.ahead_us + self.extra_us) % HOUR_US)
        return [bytes(packet)]

    def hand_on(self, piece):
        self.outward.sendto(piece, self.target)

    def close(self):
        super().close()
        self.inward.close()
        self.outward.close()


class LineWire(Wire):
    """A bus, as candump lines from one FIFO to another."""

    def __init__(self, inward, outward):
        super().__init__()
        for path in (inward, outward):
            os.mkfifo(path)
        self.inward = os.open(inward, os.O_RDWR | os.O_NONBLOCK)  # never at its end, whoever plays
        self.outward = os.open(outward, os.O_RDWR)
        self.rest = b""

    def source(self):
        return self.inward

    def take(self):
        *lines, self.rest = (self.rest + os.read(self.inward, 65536)).split(b"\n")
        return [line + b"\n" for line in lines]

    def hand_on(self, piece):
        os.write(self.outward, piece)

    def close(self):
        super().close()
        os.close(self.inward)
        os.close(self.outward)


class SerialWire(Wire):
    """A serial line: what the player's pseudo-terminal says goes on to another, which can be pulled and put back."""

    def __init__(self, inward, outward):
        super().__init__()
        self.inward_path, self.outward_path = pathlib.Path(inward), pathlib.Path(outward)
        self.inward = self.master = self.slave = None
        self.plug()

    def plug(self):
        self.master, self.slave = os.openpty()
        tty.setraw(self.slave, termios.TCSANOW)
        os.set_blocking(self.master, False)
        self.outward_path.symlink_to(os.ttyname(self.slave))

    def unplug(self):
        self.outward_path.unlink(missing_ok=True)
        master, slave, self.master, self.slave = self.master, self.slave, None, None
        for end in (slave, master):
            if end is not None:
                os.close(end)

    def begin(self):
        """Once the player has made its end."""
        self.inward = os.open(self.inward_path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        tty.setraw(self.inward, termios.TCSANOW)
        self.start()

    def source(self):
        return self.inward

    def take(self):
        return [os.read(self.inward, 4096)]

    def hand_on(self, piece):
        master = self.master
        if master is not None:
            try:
                os.write(master, piece)
            except OSError:  # full, because the daemon is stopped, or just being pulled
                pass

    def close(self):
        super().close()
        os.close(self.inward)
        self.unplug()
