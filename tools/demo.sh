#!/usr/bin/env bash
# Installs what is missing, builds roadvec, makes a short drive, maps it, and shows the map.
#
#   tools/demo.sh [OUT]      results go to OUT (default build/demo)
set -euo pipefail
cd "$(dirname "$0")/.."
case ${1:-} in -h | --help) sed -n '2,4s/^# \{0,1\}//p' "$0"; exit 0 ;; esac
out=${1:-build/demo}
bin=build/release/bin
recordings=../shared/data

echo "== packages"
tools/packages.sh demo
echo "== build (a few minutes the first time)"
cmake --preset release >/dev/null
cmake --build --preset release --target programs

map_drive() { # DRIVE OUT
  "$bin/roadvecd" --drive "$1" --out "$2"
  /usr/bin/python3 - "$2/report.json" <<'PY'
import json, sys
report = json.load(open(sys.argv[1], encoding="utf-8"))
print(f"   {report['travelled_m']:.0f} m driven, {report['map_length_m']:.0f} m of boundary in {report['map_lines']} lines, "
      f"{report['keyframes']} keyframes, {report['loops']} loops, in {report['wall_time_s']:.1f} s")
for stage in report["stages"].values():
    for step, t in stage.get("steps", {}).items():
        print(f"   {step:<13} p50 {t['p50_us'] / 1000:8.3f} ms   p99 {t['p99_us'] / 1000:8.3f} ms   max {t['max_us'] / 1000:8.3f} ms")
PY
}

mkdir -p "$out"
echo "== a made-up drive: an HDL-64E, CAN and an IMU on a car going round a block"
if [ ! -e "$out/drive/drive.toml" ]; then
  rm -rf "$out/drive"
  "$bin/roadvec-simulate" block "$out/drive"
fi
echo "== its map"
map_drive "$out/drive" "$out/map"

if [ -e "$recordings/kitti_0005_drive.tar.xz" ]; then
  echo "== a real drive: KITTI 0005, Karlsruhe (CC BY-NC-SA 3.0, for evaluation)"
  [ -e "$out/kitti_0005/drive.toml" ] || tar xf "$recordings/kitti_0005_drive.tar.xz" -C "$out"
  map_drive "$out/kitti_0005" "$out/kitti_0005-map"
fi

cat <<EOF

Look at   $out/map/map.svg   (any browser)   and   $out/map/map.geojson   (QGIS, geojson.io)
Next:
  $bin/roadvec-inspect $out/drive            what is in a recording
  $bin/roadvec-simulate --list               other streets
  $bin/roadvecd --print-config               every key, with its meaning
  README.md, "Live on the bench": play a drive into a running daemon and follow the map with a client
EOF
