#!/usr/bin/env bash
# The Debian package: built, complete, and its scripts run. Usage: package_test.sh BUILD
set -euo pipefail
build=$1
command -v dpkg-deb >/dev/null || { echo "skipped: dpkg-deb is not installed"; exit 77; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

(cd "$build" && cpack -G DEB -B "$work" >"$work/log" 2>&1) || { tail -n 20 "$work/log"; exit 1; }
deb=$(ls "$work"/flamefield_*.deb)
dpkg-deb --info "$deb" >"$work/info"
dpkg-deb --contents "$deb" >"$work/contents"

for path in usr/bin/flamefield usr/bin/flamefield-{acquired,dispatchd,worker,gatewayd} \
    lib/systemd/system/flamefield-{acquired,dispatchd,worker@,gatewayd,serve,reprocess@}.service \
    lib/systemd/system/flamefield-reprocess@.timer lib/sysusers.d/flamefield.conf lib/tmpfiles.d/flamefield.conf \
    etc/flamefield/lab.toml usr/share/doc/flamefield/copyright usr/share/flamefield/grafana/flamefield.json; do
  grep -q " \./\(usr/\)\?$path\$" "$work/contents" || { echo "the package lacks $path"; exit 1; }
done
if grep -q 'root/root' "$work/contents" && grep -v 'root/root' "$work/contents"; then echo "files of another owner"; exit 1; fi
dpkg-deb --control "$deb" "$work/control"
grep -q '^/etc/flamefield/lab.toml$' "$work/control/conffiles" || { echo "lab.toml is no conffile: upgrades would overwrite it"; exit 1; }
for library in libzmq5 libsqlite3-0 libhdf5 libaravis libopencv-core; do
  grep -q "^ Depends:.*$library" "$work/info" || { echo "the package does not depend on $library"; exit 1; }
done
for script in postinst prerm postrm; do
  [ -x "$work/control/$script" ] || { echo "$script is not executable"; exit 1; }
  sh -n "$work/control/$script"
done

# Unpacked elsewhere, the program runs, and knows its version.
dpkg-deb --extract "$deb" "$work/root"
version=$(dpkg-deb --field "$deb" Version)
"$work/root/usr/bin/flamefield" --version | grep -qF "$version" || { echo "flamefield --version is not $version"; exit 1; }
# Users and directories come about in a fresh root.
if command -v systemd-sysusers >/dev/null && [ "$(id -u)" = 0 ]; then
  mkdir -p "$work/root/etc"
  systemd-sysusers --root="$work/root" flamefield.conf
  grep -q '^flamefield:' "$work/root/etc/passwd" || { echo "no user flamefield"; exit 1; }
  systemd-tmpfiles --root="$work/root" --create flamefield.conf
  [ "$(stat -c %a "$work/root/var/lib/flamefield")" = 750 ] || { echo "the data directory is not 0750"; exit 1; }
fi
echo "$(basename "$deb"): $(stat -c %s "$deb") bytes, $(wc -l <"$work/contents") entries"
