#!/usr/bin/env bash
# Installs what is missing and runs the benchmarks: one per step, and packet decoding against PCL's HDL grabber in one process.
#   tools/bench.sh [FILTER]     FILTER: a benchmark's name or part of it
set -euo pipefail
cd "$(dirname "$0")/.."
case ${1:-} in -h | --help) sed -n '2,3s/^# \{0,1\}//p' "$0"; exit 0 ;; esac
tools/packages.sh bench
cmake --preset release >/dev/null
cmake --build --preset release --target benchmarks
for bench in build/release/bin/bench_*; do
  "$bench" --benchmark_filter="${1:-.}" --benchmark_repetitions=3 --benchmark_report_aggregates_only=true 2>/dev/null
done
