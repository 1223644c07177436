"""A roadvec client that shares no code with the daemon: Python's own protobuf, and its own WGS 84 mathematics.

    /usr/bin/python3 roadvec_client.py --proto core/wire/roadvec.proto --socket map.sock
        [--lines lines.json]       write the map at the end: {"line id": [[x_mm, y_mm, z_mm], ...]}
        [--geojson map.geojson]    compare it with this file, to the millimetre, after the daemon's Bye

Subscribes to everything, applies snapshot and changes until the daemon says Bye. Exit status: 0 the map is whole (and equal), 1 not.
"""

import argparse
import importlib
import json
import math
import os
import socket
import struct
import subprocess
import sys
import tempfile


class Fault(Exception):
    pass


def load_messages(proto):
    folder = tempfile.mkdtemp(prefix="roadvec-proto-")
    subprocess.run(["protoc", "-I", os.path.dirname(os.path.abspath(proto)), "--python_out", folder, os.path.basename(proto)], check=True)
    sys.path.insert(0, folder)
    return importlib.import_module("roadvec_pb2")


class Connection:
    def __init__(self, path, messages, timeout_s):
        self.messages = messages
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.socket.settimeout(timeout_s)
        self.socket.connect(path)

    def send(self, **message):
        body = self.messages.Envelope(**message).SerializeToString()
        self.socket.sendall(struct.pack("<I", len(body)) + body)

    def receive_bytes(self, count):
        data = b""
        while len(data) < count:
            more = self.socket.recv(count - len(data))
            if not more:
                raise Fault("the daemon closed the connection without Bye")
            data += more
        return data

    def receive(self):
        (length,) = struct.unpack("<I", self.receive_bytes(4))
        envelope = self.messages.Envelope.FromString(self.receive_bytes(length))
        kind = envelope.WhichOneof("message")
        return kind, getattr(envelope, kind) if kind else None


class Map:
    """Tiles as {(ix, iy): {line id: [Piece, ...]}}."""

    def __init__(self):
        self.tiles = {}
        self.revisions = {}
        self.seq = None
        self.epoch = None
        self.continued = False

    def next(self, seq):
        if self.seq is None or seq != self.seq + 1:
            raise Fault(f"change {seq} after {self.seq}")
        self.seq = seq

    def snapshot_begin(self, m):
        if not m.incremental:
            self.tiles, self.revisions = {}, {}
        self.continued = False

    def overrun(self, m):
        self.continued = False
        print(f"overrun: {m.first_lost_seq} to {m.last_lost_seq}", file=sys.stderr)

    def tile(self, m):
        lines = self.tiles[m.key.ix, m.key.iy] = {}
        self.revisions[m.key.ix, m.key.iy] = m.revision
        for piece in m.pieces:
            lines.setdefault(piece.line_id, []).append(piece)

    def snapshot_end(self, m):
        self.seq, self.epoch = m.as_of_seq, m.epoch

    def epoch_change(self, m):
        if m.epoch_before != self.epoch:
            raise Fault("an epoch is missing")
        self.next(m.seq)
        self.epoch = m.epoch

    def delta(self, m):
        self.next(m.seq)
        if m.epoch != self.epoch:
            raise Fault("a change of another epoch")
        self.continued = m.continued
        for tile in m.tiles:
            lines = self.tiles.setdefault((tile.key.ix, tile.key.iy), {})
            self.revisions[tile.key.ix, tile.key.iy] = tile.revision
            for line_id in list(tile.removed_line_ids) + [piece.line_id for piece in tile.upserted]:
                lines.pop(line_id, None)
            for piece in tile.upserted:
                lines.setdefault(piece.line_id, []).append(piece)

    def tile_bytes(self, key):
        """All of the tile, in bytes that can be held against those of another copy."""
        return key, self.revisions[key], tuple(piece.SerializeToString() for line_id in sorted(self.tiles[key])
                                               for piece in sorted(self.tiles[key][line_id], key=lambda p: p.first_vertex))

    def lines(self, tile_size_mm):
        whole = {}
        for (ix, iy), lines in self.tiles.items():
            for line_id, pieces in lines.items():
                for piece in pieces:
                    line = whole.setdefault(line_id, [None] * piece.line_vertex_count)
                    if len(line) != piece.line_vertex_count:
                        raise Fault(f"line {line_id}: pieces of different revisions")
                    for i, vertex in enumerate(vertices(piece, ix * tile_size_mm, iy * tile_size_mm)):
                        at = piece.first_vertex + i
                        if line[at] not in (None, vertex):
                            raise Fault(f"line {line_id}: pieces disagree about vertex {at}")
                        line[at] = vertex
        for line_id, line in whole.items():
            if None in line:
                raise Fault(f"line {line_id}: vertex {line.index(None)} is in no tile")
        return whole


def vertices(piece, x_mm, y_mm):
    """Undoes the differences; missing ones at the end are 0."""
    z_mm = 0
    for i in range(len(piece.x_mm)):
        x_mm += piece.x_mm[i]
        y_mm += piece.y_mm[i]
        z_mm += piece.z_mm[i] if i < len(piece.z_mm) else 0
        yield [x_mm, y_mm, z_mm]


class Enu:
    """WGS 84 to East-North-Up at an anchor."""

    A_M, F = 6378137.0, 1 / 298.257223563

    def __init__(self, latitude_deg, longitude_deg, height_m):
        self.phi, self.lam = math.radians(latitude_deg), math.radians(longitude_deg)
        self.origin = self.ecef(latitude_deg, longitude_deg, height_m)

    def ecef(self, latitude_deg, longitude_deg, height_m):
        phi, lam = math.radians(latitude_deg), math.radians(longitude_deg)
        e2 = self.F * (2 - self.F)
        n = self.A_M / math.sqrt(1 - e2 * math.sin(phi) ** 2)
        ring = (n + height_m) * math.cos(phi)
        return ring * math.cos(lam), ring * math.sin(lam), (n * (1 - e2) + height_m) * math.sin(phi)

    def mm(self, latitude_deg, longitude_deg, height_m):
        x, y, z = (a - b for a, b in zip(self.ecef(latitude_deg, longitude_deg, height_m), self.origin))
        sp, cp, sl, cl = math.sin(self.phi), math.cos(self.phi), math.sin(self.lam), math.cos(self.lam)
        east = -sl * x + cl * y
        north = -sp * cl * x - sp * sl * y + cp * z
        up = cp * cl * x + cp * sl * y + sp * z
        return [round(1000 * east), round(1000 * north), round(1000 * up)]


def compare(lines, path, anchor):
    with open(path, encoding="utf-8") as file:
        features = json.load(file)["features"]
    enu = Enu(anchor.latitude_deg, anchor.longitude_deg, anchor.height_m)
    found = {}
    for feature in features:
        coordinates = feature["geometry"]["coordinates"]
        found[feature["properties"]["id"]] = [enu.mm(latitude, longitude, height) for longitude, latitude, height in coordinates]
    drawn = {line_id: line for line_id, line in lines.items() if len(line) >= 2}
    if found.keys() != drawn.keys():
        raise Fault(f"{path}: lines differ: {sorted(found.keys() ^ drawn.keys())[:10]}")
    for line_id, line in drawn.items():
        if found[line_id] != line:
            raise Fault(f"{path}: line {line_id} differs")


def run(options):
    messages = load_messages(options.proto)
    connection = Connection(options.socket, messages, options.timeout)
    connection.send(hello=messages.Hello(proto_major=1, client_name="roadvec_client.py"))
    kind, welcome = connection.receive()
    if kind != "welcome":
        raise Fault(f"{kind} in place of Welcome: {welcome}")
    connection.send(subscribe=messages.Subscribe())
    copy, change_count = Map(), 0
    while True:
        kind, message = connection.receive()
        if kind == "bye":
            if message.reason != messages.Bye.SHUTDOWN:
                raise Fault(f"Bye: {message.text}")
            break
        if kind == "error":
            raise Fault(f"Error: {message.text}")
        if kind in ("snapshot_begin", "overrun", "tile", "snapshot_end", "epoch_change", "delta"):
            getattr(copy, kind)(message)
            change_count += kind in ("delta", "epoch_change")
        if kind == "snapshot_end":
            print("following", flush=True)
    if copy.continued:
        raise Fault("the last change is not whole")
    lines = copy.lines(welcome.tile_size_mm)
    if options.lines:
        with open(options.lines, "w", encoding="utf-8") as file:
            json.dump({str(line_id): line for line_id, line in sorted(lines.items())}, file)
    if options.geojson:
        compare(lines, options.geojson, welcome.anchor)
    print(f"{change_count} changes, {len(copy.tiles)} tiles, {len(lines)} lines, {sum(map(len, lines.values()))} vertices")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--proto", required=True)
    parser.add_argument("--socket", required=True)
    parser.add_argument("--timeout", type=float, default=30.0)
    parser.add_argument("--lines")
    parser.add_argument("--geojson")
    try:
        run(parser.parse_args())
    except (Fault, OSError, subprocess.CalledProcessError) as error:
        print(f"roadvec_client.py: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
