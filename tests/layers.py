#!/usr/bin/env python3
"""Reads every #include and says which ones go upwards: core <- drivers <- daemon <- tools, tests; and inside core each folder
only sees those below it. Exit status 1 when any does."""
import pathlib
import re
import sys

# Folder -> folders (of this project) it may include besides itself.
BASE = ["core/base", "core/geometry", "core/sensor", "core/ring"]
ALLOWED = {
    "core/base": [],
    "core/ring": ["core/base"],
    "core/geometry": ["core/base"],
    "core/sensor": ["core/base"],
    "core/odometry": BASE,
    "core/boundary": BASE,
    "core/map": BASE + ["core/boundary"],
    "core/graph": BASE + ["core/map", "core/boundary", "core/pipeline/keyframe.h"],
    "core/wire": BASE + ["core/map"],
    "core/pipeline": BASE + ["core/odometry", "core/boundary", "core/map", "core/graph"],
    "drivers": ["core/base", "core/sensor", "drivers"],
    "daemon/store": ["core", "daemon/server", "daemon/store"],
    "daemon/config": ["core", "drivers", "daemon/config"],
    "daemon/server": ["core", "daemon/server"],
    "daemon/stages": ["core", "drivers", "daemon/config", "daemon/server", "daemon/stages", "daemon/store"],
    "daemon": ["core", "drivers", "daemon"],
    "tools": ["core", "drivers", "daemon", "tools"],
    "tests": ["core", "drivers", "daemon", "tools", "tests"],
}
# System and library headers that a layer must not touch.
FORBIDDEN = {
    "core": r"(sys/|netinet/|arpa/|linux/|unistd\.h|poll\.h|thread|mutex|chrono|condition_variable|fstream|filesystem|"
            r"spdlog/|pcap|systemd/|toml|CLI/|sqlite|ctime|random)",
    "drivers": r"(spdlog/|systemd/|toml|CLI/|ceres/|thread|mutex|condition_variable)",
}
INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]')


def layer_of(path):
    parts = path.split("/")
    for depth in (2, 1):
        folder = "/".join(parts[:depth])
        if folder in ALLOWED:
            return folder
    return None


def faults_in(root, file):
    name = file.relative_to(root).as_posix()
    layer = layer_of(name)
    for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), 1):
        match = INCLUDE.match(line)
        if not match:
            continue
        quoted, header = match.group(1) == '"', match.group(2)
        if quoted:
            if not (root / header).exists() and not header.endswith(".inc"):
                yield f"{name}:{number}: \"{header}\" is not a path from the root"
            allowed = [layer] + ALLOWED[layer]
            if not any(header == a or header.startswith(a + "/") for a in allowed):
                yield f"{name}:{number}: {layer} may not include {header}"
        else:
            pattern = FORBIDDEN.get(name.split("/")[0])
            if pattern and re.match(pattern + "$" if not header.endswith("/") else pattern, header):
                yield f"{name}:{number}: {name.split('/')[0]} may not include <{header}>"
            elif pattern and re.match(pattern, header) and "/" in header:
                yield f"{name}:{number}: {name.split('/')[0]} may not include <{header}>"


def main():
    root = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else ".").resolve()
    files = sorted(f for top in ("core", "drivers", "daemon", "tools", "tests") for f in (root / top).rglob("*")
                   if f.suffix in (".h", ".cpp"))
    faults = [fault for file in files for fault in faults_in(root, file)]
    print("\n".join(faults) if faults else f"{len(files)} files keep to their layers")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
