"""Clients without manners: they connect, stall, read byte by byte, send garbage and half frames, leave and come back. Each holds
its copy of the map against that of a client that only follows, at the same seq, byte for byte.

    /usr/bin/python3 wandering_clients.py --proto core/wire/roadvec.proto --socket map.sock --seed 1 --seconds 3

Exit status: 0 every whole copy was the map, or the client had been told that it was not; 1 not.
"""

import argparse
import random
import select
import socket
import struct
import subprocess
import sys
import time

from roadvec_client import Fault, Map, load_messages

HEADER = struct.Struct("<I")


class Copy(Map):
    """What a client has; `whole`: it is the map at `seq`."""

    def __init__(self):
        super().__init__()
        self.receiving = True

    @property
    def whole(self):
        return not self.receiving and not self.continued

    def reaches(self, other):
        return self.seq is not None and (other.seq is None or self.seq >= other.seq)

    def snapshot_begin(self, m):
        super().snapshot_begin(m)
        self.receiving = True

    def overrun(self, m):
        self.continued, self.receiving = False, True

    def snapshot_end(self, m):
        super().snapshot_end(m)
        self.receiving = False

    def resumed(self, m):
        if self.receiving or m.from_seq != self.seq + 1:
            raise Fault(f"resumed at {m.from_seq} after {self.seq}")


class Client:
    """A connection that never waits, and the copy that it keeps."""

    def __init__(self, path, messages):
        self.path, self.messages = path, messages
        self.socket, self.received, self.copy = None, b"", Copy()

    def connect(self, **subscribe):
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.socket.connect(self.path)
        self.socket.setblocking(False)
        self.received = b""
        self.send(hello=self.messages.Hello(proto_major=1, client_name="wandering_clients.py"))
        self.send(subscribe=self.messages.Subscribe(**subscribe))

    def disconnect(self):
        if self.socket:
            self.socket.close()
        self.socket = None

    def send(self, **message):
        body = self.messages.Envelope(**message).SerializeToString()
        self.send_bytes(HEADER.pack(len(body)) + body)

    def send_bytes(self, data):
        if not self.socket:
            return
        try:
            self.socket.sendall(data)
        except OSError:
            self.disconnect()

    def read(self, most_bytes, each):
        """Calls each(kind, message) for what came, and takes it into the copy."""
        while most_bytes > 0 and self.socket:
            try:
                data = self.socket.recv(min(most_bytes, 1 << 16))
            except BlockingIOError:
                return
            except ConnectionResetError:
                data = b""
            if not data:
                return self.disconnect()
            most_bytes -= len(data)
            self.received += data
            while self.socket and (envelope := self.next_envelope()) is not None:
                kind = envelope.WhichOneof("message")
                message = getattr(envelope, kind) if kind else None
                if kind == "bye":
                    return self.disconnect()
                if kind in ("snapshot_begin", "overrun", "tile", "snapshot_end", "resumed", "epoch_change", "delta"):
                    getattr(self.copy, kind)(message)
                each(kind, message)
        return None

    def next_envelope(self):
        if len(self.received) < HEADER.size:
            return None
        (length,) = HEADER.unpack_from(self.received)
        if len(self.received) < HEADER.size + length:
            return None
        envelope = self.messages.Envelope.FromString(self.received[HEADER.size:HEADER.size + length])
        self.received = self.received[HEADER.size + length:]
        return envelope


class Reference(Client):
    """It reads everything, and remembers the bytes of every tile at every seq at which the map was whole."""

    def __init__(self, path, messages):
        super().__init__(path, messages)
        self.now, self.states = {}, {}
        self.connect()

    def follow(self):
        if not self.socket:  # it was too slow for the server
            self.copy, self.now = Copy(), {}
            self.connect()
        self.read(1 << 30, self.remember)

    def remember(self, kind, message):
        if kind in ("tile", "delta"):
            for tile in [message] if kind == "tile" else message.tiles:
                key = tile.key.ix, tile.key.iy
                self.now[key] = self.copy.tile_bytes(key)
        if self.copy.whole and kind in ("snapshot_end", "delta", "epoch_change"):
            self.states[self.copy.seq] = self.copy.epoch, dict(self.now)


class Wanderer(Client):
    def __init__(self, path, messages, reference, seed):
        super().__init__(path, messages)
        self.random, self.reference = random.Random(seed), reference
        self.sleep_turns = self.drip_turns = self.check_count = self.resume_count = self.overrun_count = 0

    def act(self):
        if self.sleep_turns:
            self.sleep_turns -= 1
            return
        if not self.socket:
            self.come_back()
            return
        choice = self.random.randrange(32)
        if choice == 0:
            self.disconnect()
        elif choice == 1:
            self.send_bytes(self.random.randbytes(self.random.randint(1, 40)))
        elif choice == 2:
            self.send_bytes(HEADER.pack(1000) + b"half")
        elif choice == 3:
            self.sleep_turns = self.random.randrange(100)
        elif choice == 4:
            self.drip_turns = 50
        elif choice == 5:
            self.send(get_tiles=self.messages.GetTiles())
        else:
            drips = self.drip_turns > 0
            self.drip_turns -= drips
            self.read(1 if drips else self.random.choice((10, 100, 1000, 10000)), self.check)

    def come_back(self):
        if self.random.random() < 0.1:
            self.copy = Copy()
        copy, subscribe = self.copy, {}
        if copy.whole and self.random.random() < 0.7:
            subscribe["resume"] = self.messages.Resume(epoch=copy.epoch, seq=copy.seq)
        if copy.epoch is not None and self.random.random() < 0.5:
            subscribe["known_epoch"] = copy.epoch
            subscribe["known"] = [self.messages.KnownTile(ix=ix, iy=iy, revision=revision)
                                  for (ix, iy), revision in copy.revisions.items()]
        self.connect(**subscribe)

    def check(self, kind, _):
        self.resume_count += kind == "resumed"
        self.overrun_count += kind == "overrun"
        if kind not in ("snapshot_end", "delta", "epoch_change", "resumed") or not self.copy.whole:
            return
        self.reference.follow()
        epoch, tiles = self.reference.states.get(self.copy.seq, (None, None))
        if tiles is None:
            return  # the reference was overrun itself
        self.check_count += 1
        if epoch != self.copy.epoch:
            raise Fault(f"change {self.copy.seq}: epoch {self.copy.epoch:x} in place of {epoch:x}")
        if tiles.keys() != self.copy.tiles.keys():
            raise Fault(f"change {self.copy.seq}: other tiles: {sorted(tiles.keys() ^ self.copy.tiles.keys())[:10]}")
        for key, expected in tiles.items():
            if self.copy.tile_bytes(key) != expected:
                raise Fault(f"change {self.copy.seq}: tile {key} differs")


def wander(path, messages, seed, seconds, count=8):
    """Returns what it did, for a person; raises Fault."""
    reference = Reference(path, messages)
    wanderers = [Wanderer(path, messages, reference, seed * 1000 + i) for i in range(count)]
    chance, end = random.Random(seed), time.monotonic() + seconds
    while time.monotonic() < end:
        reference.follow()
        chance.choice(wanderers).act()
    for wanderer in wanderers:
        if not wanderer.socket:
            wanderer.come_back()
        before, limit = wanderer.check_count, time.monotonic() + 20
        while wanderer.check_count == before or not wanderer.copy.reaches(reference.copy):
            if time.monotonic() > limit:
                raise Fault(f"a client did not reach change {reference.copy.seq}")
            if not wanderer.socket:
                wanderer.copy = Copy()
                wanderer.come_back()
                continue
            select.select([wanderer.socket], [], [], 0.05)
            reference.follow()
            wanderer.read(1 << 20, wanderer.check)
            if wanderer.check_count == before and wanderer.copy.whole:
                wanderer.check("delta", None)
    for client in (reference, *wanderers):
        client.disconnect()
    total = [sum(getattr(wanderer, name) for wanderer in wanderers) for name in ("check_count", "resume_count", "overrun_count")]
    return "{} checks of a whole copy, {} resumed, {} overruns, {} tiles".format(*total, len(reference.now))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--proto", required=True)
    parser.add_argument("--socket", required=True)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=3.0)
    options = parser.parse_args()
    try:
        print(wander(options.socket, load_messages(options.proto), options.seed, options.seconds), flush=True)
    except (Fault, OSError, subprocess.CalledProcessError) as error:
        print(f"wandering_clients.py: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
