#!/usr/bin/env bash
# Installs the Debian packages that roadvec needs and that are missing: tools/packages.sh build|package|demo|test|bench
set -euo pipefail

build=(g++ cmake ninja-build pkg-config libeigen3-dev libceres-dev libpcap-dev zlib1g-dev libzstd-dev libspdlog-dev
  libsystemd-dev libtomlplusplus-dev libcli11-dev libprotozero-dev libgeographiclib-dev libexpected-dev libpugixml-dev
  libyaml-dev libpolyclipping-dev libsqlite3-dev nlohmann-json3-dev
  libgtest-dev libgmock-dev libbenchmark-dev)
package=("${build[@]}" python3 protobuf-compiler dpkg-dev)
demo=("${build[@]}" python3)
test=("${package[@]}" python3-protobuf clang-14 libclang-rt-14-dev clang-format-14 clang-tidy-14
  xz-utils tar git user-mode-linux systemd kmod iproute2 can-utils mmdebstrap groff-base
  gdal-bin python3-gdal osmium-tool)
bench=("${build[@]}" libpcl-dev xz-utils tar)

case ${1:-} in
  build) wanted=("${build[@]}") ;;
  package) wanted=("${package[@]}") ;;
  demo) wanted=("${demo[@]}") ;;
  test) wanted=("${test[@]}") ;;
  bench) wanted=("${bench[@]}") ;;
  *) echo "usage: tools/packages.sh build|package|demo|test|bench" >&2; exit 2 ;;
esac

missing=()
for package in "${wanted[@]}"; do
  dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q '^install ok installed$' || missing+=("$package")
done
if [ ${#missing[@]} -eq 0 ]; then
  echo "packages: all there"
  exit 0
fi
if ! command -v apt-get >/dev/null; then
  echo "packages: this is not Debian; install by hand what these stand for: ${missing[*]}" >&2
  exit 1
fi
as_root=()
if [ "$(id -u)" -ne 0 ]; then
  command -v sudo >/dev/null || { echo "packages: run as root: apt-get install ${missing[*]}" >&2; exit 1; }
  as_root=(sudo)
fi
echo "packages: installing ${missing[*]}"
"${as_root[@]}" apt-get update -q >/dev/null
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends "${missing[@]}" >/dev/null
