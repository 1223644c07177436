#!/usr/bin/env bash
# tests/vm/make_root.sh PACKAGE.deb ROOT: makes ROOT the root of a fresh machine, of this machine's Debian release, with systemd
# and can-utils, nothing of roadvec, and what PACKAGE depends on downloaded but not installed: there apt installs PACKAGE without a
# network. Kept as it is while the package's dependencies and this script stay the same. Root's work (sudo); about a minute.
set -euo pipefail
package=$(realpath "$1")
root=$2
key=$(dpkg-deb -f "$package" Depends; cksum <"$0")
[ "$(cat "$root.key" 2>/dev/null)" != "$key" ] || exit 0
as_root=()
[ "$(id -u)" -eq 0 ] || as_root=(sudo)
. /etc/os-release
sources=/etc/apt/sources.list.d/debian.sources
[ -e "$sources" ] || sources=/etc/apt/sources.list
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

"${as_root[@]}" rm -rf "$root" "$root.key"
mkdir -p "$(dirname "$root")"
# Manuals and the like are left out of the base system alone: the package's own are to be found there.
"${as_root[@]}" mmdebstrap --quiet --variant=minbase --skip=cleanup/apt \
  --aptopt='APT::Install-Recommends "false"' --aptopt='Acquire::Languages "none"' --aptopt='APT::Sandbox::User "root"' \
  --dpkgopt='path-exclude=/usr/share/man/*' --dpkgopt='path-exclude=/usr/share/locale/*' --dpkgopt='path-exclude=/usr/share/doc/*' \
  --include=systemd,systemd-sysv,kmod,iproute2,can-utils,man-db,python3 \
  --customize-hook='rm "$1"/etc/dpkg/dpkg.cfg.d/99mmdebstrap' \
  --customize-hook="cp '$package' \"\$1/roadvec.deb\"" \
  --customize-hook='chroot "$1" apt-get install --quiet --yes --download-only /roadvec.deb >/dev/null' \
  --customize-hook='rm "$1/roadvec.deb"' \
  "$VERSION_CODENAME" "$root" "$sources"
"${as_root[@]}" cp -a --parents /usr/lib/uml "$root"
"${as_root[@]}" install -d -o "$(id -u)" "$root/guest"  # for run.sh
# The guest's files are those of the user who starts it.
"${as_root[@]}" chmod -R a+rX "$root"
printf '%s\n' "$key" >"$root.key"
