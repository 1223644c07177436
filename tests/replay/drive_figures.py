#!/usr/bin/env python3
"""Figures of a mapped drive against its references: trajectory error, and distance of the map to surveyed kerbs.

    drive_figures.py MAP_DIR --truth poses.tum [--anchor-from DRIVE] [--lanelet2 map.osm] [--json]

MAP_DIR holds map.geojson and trajectory.tum as roadvecd --drive writes them. Trajectories are compared after one SE(2)
alignment (rotation and shift, no scale); RPE is the error of the relative pose 10 m on, over 10 m. Kerbs: every 0.25 m of
the map's lines of kind curb, distance to the nearest way of type curbstone, after the same alignment and the one rigid shift of
at most 2 m (the references are good to about 1 m each) that makes the distances smallest; samples with no such way within
1.5 m have no counterpart and are counted apart.
"""
import argparse
import json
import math
import sys
import tomllib
import xml.etree.ElementTree as xml

GATE_M = 1.5
STEP_M = 0.25


def read_tum(path):
    poses = []
    with open(path, encoding="ascii") as file:
        for line in file:
            if line.startswith("#") or not line.strip():
                continue
            t, x, y, _, _, _, qz, qw = (float(v) for v in line.split())
            poses.append((t, x, y, 2 * math.atan2(qz, qw)))
    return poses


def at_time(poses, t):
    low, high = 0, len(poses) - 1
    if t < poses[0][0] or t > poses[-1][0]:
        return None
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if poses[middle][0] <= t else (low, middle)
    a, b = poses[low], poses[high]
    u = (t - a[0]) / (b[0] - a[0]) if b[0] > a[0] else 0.0
    turn = math.remainder(b[3] - a[3], 2 * math.pi)
    return (a[1] + u * (b[1] - a[1]), a[2] + u * (b[2] - a[2]), a[3] + u * turn)


def alignment(ours, truth):
    """Motion (turn, from-centre, to-centre) that lays our path on the reference best."""
    pairs = [((x, y, h), at_time(truth, t)) for t, x, y, h in ours]
    pairs = [(a, b) for a, b in pairs if b]
    n = len(pairs)
    ax, ay = sum(a[0] for a, _ in pairs) / n, sum(a[1] for a, _ in pairs) / n
    bx, by = sum(b[0] for _, b in pairs) / n, sum(b[1] for _, b in pairs) / n
    dot = sum((a[0] - ax) * (b[0] - bx) + (a[1] - ay) * (b[1] - by) for a, b in pairs)
    cross = sum((a[0] - ax) * (b[1] - by) - (a[1] - ay) * (b[0] - bx) for a, b in pairs)
    c, s = math.cos(math.atan2(cross, dot)), math.sin(math.atan2(cross, dot))
    return pairs, lambda x, y: (c * (x - ax) - s * (y - ay) + bx, s * (x - ax) + c * (y - ay) + by)


def trajectory_figures(ours, truth):
    pairs, aligned = alignment(ours, truth)
    n = len(pairs)
    errors = [math.dist(aligned(a[0], a[1]), b[:2]) for a, b in pairs]
    way = [0.0]
    for (_, p), (_, q) in zip(pairs, pairs[1:]):
        way.append(way[-1] + math.hypot(q[0] - p[0], q[1] - p[1]))

    def relative(p, q):
        dx, dy, cp, sp = q[0] - p[0], q[1] - p[1], math.cos(p[2]), math.sin(p[2])
        return cp * dx + sp * dy, -sp * dx + cp * dy

    rpe = []
    for i in range(n):
        j = next((k for k in range(i, n) if way[k] - way[i] >= 10), None)
        if j is None:
            break
        (ux, uy), (vx, vy) = relative(pairs[i][0], pairs[j][0]), relative(pairs[i][1], pairs[j][1])
        rpe.append(math.hypot(ux - vx, uy - vy) / (way[j] - way[i]))
    return {"poses": n, "way_m": way[-1], "rms_m": math.sqrt(sum(e * e for e in errors) / n),
            "mean_m": sum(errors) / n, "max_m": max(errors),
            "rpe_10m_percent": 100 * sum(rpe) / len(rpe) if rpe else None}


class Local:
    """WGS 84 to East-North-Up metres at an anchor."""

    def __init__(self, latitude_deg, longitude_deg, height_m):
        self.lat, self.lon = math.radians(latitude_deg), math.radians(longitude_deg)
        self.origin = self.ecef(latitude_deg, longitude_deg, height_m)
        self.height_m = height_m

    @staticmethod
    def ecef(latitude_deg, longitude_deg, height_m):
        a, f = 6378137.0, 1 / 298.257223563
        e2 = f * (2 - f)
        lat, lon = math.radians(latitude_deg), math.radians(longitude_deg)
        n = a / math.sqrt(1 - e2 * math.sin(lat) ** 2)
        return ((n + height_m) * math.cos(lat) * math.cos(lon), (n + height_m) * math.cos(lat) * math.sin(lon),
                (n * (1 - e2) + height_m) * math.sin(lat))

    def enu(self, latitude_deg, longitude_deg):
        x, y, z = (p - o for p, o in zip(self.ecef(latitude_deg, longitude_deg, self.height_m), self.origin))
        sin_lat, cos_lat, sin_lon, cos_lon = math.sin(self.lat), math.cos(self.lat), math.sin(self.lon), math.cos(self.lon)
        return -sin_lon * x + cos_lon * y, -sin_lat * cos_lon * x - sin_lat * sin_lon * y + cos_lat * z


def map_samples(geojson, local):
    samples = []
    for feature in geojson["features"]:
        if feature["properties"].get("kind") != "curb" or feature["geometry"]["type"] != "LineString":
            continue
        points = [local.enu(c[1], c[0]) for c in feature["geometry"]["coordinates"]]
        for p, q in zip(points, points[1:]):
            steps = max(1, int(math.dist(p, q) / STEP_M))
            samples += [(p[0] + (q[0] - p[0]) * (k + 0.5) / steps, p[1] + (q[1] - p[1]) * (k + 0.5) / steps)
                        for k in range(steps)]
    return samples


class Kerbs:
    """Segments of the curbstone ways, in buckets of 4 m."""

    def __init__(self, osm, local):
        root = xml.parse(osm).getroot()
        nodes = {n.get("id"): local.enu(float(n.get("lat")), float(n.get("lon"))) for n in root.iter("node")}
        self.buckets = {}
        for way in root.iter("way"):
            if not any(t.get("k") == "type" and t.get("v") == "curbstone" for t in way.iter("tag")):
                continue
            points = [nodes[r.get("ref")] for r in way.iter("nd")]
            for segment in zip(points, points[1:]):
                self.add(segment)

    def add(self, segment):
        (x0, y0), (x1, y1) = segment
        for i in range(int((min(x0, x1) - 2) // 4), int((max(x0, x1) + 2) // 4) + 1):
            for j in range(int((min(y0, y1) - 2) // 4), int((max(y0, y1) + 2) // 4) + 1):
                self.buckets.setdefault((i, j), []).append(segment)

    def distance(self, x, y):
        best = GATE_M
        for (x0, y0), (x1, y1) in self.buckets.get((int(x // 4), int(y // 4)), ()):
            dx, dy = x1 - x0, y1 - y0
            length2 = dx * dx + dy * dy
            u = max(0.0, min(1.0, ((x - x0) * dx + (y - y0) * dy) / length2)) if length2 else 0.0
            best = min(best, math.hypot(x - x0 - u * dx, y - y0 - u * dy))
        return best


def kerb_figures(samples, kerbs):
    def cost(shift, points):
        return sum(min(kerbs.distance(x + shift[0], y + shift[1]), 1.0) for x, y in points)

    best, step = (0.0, 0.0), 0.4
    for level in range(5):
        reach = range(-4, 5) if level == 0 else range(-2, 3)
        best = min(((best[0] + i * step, best[1] + j * step) for i in reach for j in reach),
                   key=lambda shift: cost(shift, samples))
        step /= 2
    distances = [kerbs.distance(x + best[0], y + best[1]) for x, y in samples]
    near = sorted(d for d in distances if d < GATE_M)
    return {"shift_east_m": best[0], "shift_north_m": best[1],
            "curb_length_m": len(samples) * STEP_M, "with_counterpart_m": len(near) * STEP_M,
            "median_m": near[len(near) // 2] if near else None,
            "within_0.3m_percent": 100 * sum(d <= 0.3 for d in near) / len(near) if near else None}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("map_dir")
    parser.add_argument("--truth", help="poses.tum of the drive")
    parser.add_argument("--anchor-from", help="drive folder whose drive.toml gives the anchor")
    parser.add_argument("--lanelet2", help="OSM XML with ways of type curbstone")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    figures = {}
    if arguments.truth:
        figures["trajectory"] = trajectory_figures(read_tum(f"{arguments.map_dir}/trajectory.tum"), read_tum(arguments.truth))
    if arguments.lanelet2:
        with open(f"{arguments.anchor_from}/drive.toml", "rb") as file:
            anchor = tomllib.load(file)["anchor"]
        local = Local(anchor["latitude_deg"], anchor["longitude_deg"], anchor["height_m"])
        with open(f"{arguments.map_dir}/map.geojson", encoding="utf-8") as file:
            samples = map_samples(json.load(file), local)
        if not samples:
            sys.exit("no lines of kind curb in the map")
        if arguments.truth:
            _, aligned = alignment(read_tum(f"{arguments.map_dir}/trajectory.tum"), read_tum(arguments.truth))
            samples = [aligned(x, y) for x, y in samples]
        figures["kerbs"] = kerb_figures(samples, Kerbs(arguments.lanelet2, local))
    if arguments.json:
        print(json.dumps(figures))
    else:
        for name, values in figures.items():
            for key, value in values.items():
                print(f"{name}.{key} = {value:.3f}" if isinstance(value, float) else f"{name}.{key} = {value}")


if __name__ == "__main__":
    main()
