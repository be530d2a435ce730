#!/bin/sh
# install.sh PACKAGES: on a bare Debian 12 in a root of its own, 'apt install ./ferrobench.deb && ferrobench table
# 3.13'. Needs root, debootstrap and the archive that this machine has its own packages from.
set -eu
skip() { echo "skipped: $*"; exit 77; }
[ "$(id -u)" = 0 ] || skip "making a root of its own needs root"
command -v debootstrap >/dev/null || skip "there is no debootstrap"
archives=$(apt-get indextargets --format '$(ORIGIN) $(CODENAME) $(REPO_URI) $(RELEASE)' 'Created-By: Packages' |
  sed -n 's/^Debian bookworm[^ ]* //p' | sort -u)
archive=$(printf '%s\n' "$archives" | sed -n 's/ bookworm$//p' | head -n 1)
[ -n "$archive" ] || skip "this machine knows no archive of Debian 12"

root=$1/root
rm -rf --one-file-system "$root"
mkdir -p "$root"
# What was downloaded once is not downloaded again, where apt keeps it.
debootstrap --variant=minbase --cache-dir=/var/cache/apt/archives bookworm "$root" "$archive" >"$1/debootstrap.log" 2>&1 ||
  { tail "$1/debootstrap.log"; skip "no root of its own could be made"; }
printf '%s\n' "$archives" | sed 's/.*/deb & main/' >"$root/etc/apt/sources.list"
apt-config dump | grep -E '^Acquire::(http|https|ftp|Check-Valid-Until)' >"$root/etc/apt/apt.conf.d/50machine" || true
cp /etc/resolv.conf "$root/etc/resolv.conf"
cp "$1"/ferrobench_*.deb "$root/ferrobench.deb"
inside() { env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root DEBIAN_FRONTEND=noninteractive LC_ALL=C.UTF-8 chroot "$root" "$@"; }
inside apt-get update -qq
# What it cannot do without must be among what it depends on.
inside apt-get install -y -qq --no-install-recommends ./ferrobench.deb >"$1/apt.log" 2>&1 || { cat "$1/apt.log"; exit 1; }
inside ferrobench table 3.13
[ -z "$(inside dpkg -V ferrobench)" ]
inside apt-get remove -y -qq ferrobench >"$1/apt.log" 2>&1 || { cat "$1/apt.log"; exit 1; }
[ ! -e "$root/usr/bin/ferrobench" ] && [ ! -e "$root/usr/share/ferrobench" ]
rm -rf --one-file-system "$root"
