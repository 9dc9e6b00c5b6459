#!/usr/bin/env bash
# The systemd units are sound and hardened. Usage: units_test.sh SOURCE
set -euo pipefail
cd "$1/deploy/systemd"
command -v systemd-analyze >/dev/null || { echo "skipped: systemd-analyze is not installed"; exit 77; }

# The programs need not be installed for that.
if systemd-analyze verify ./*.service ./*.timer 2>&1 | grep -v 'is not executable'; then
  echo "systemd-analyze verify complains (see above)"; exit 1
fi
for unit in flamefield-{dispatchd,acquired,worker@,gatewayd,serve,reprocess@}.service; do
  [ -f "$unit" ] || { echo "$unit is missing"; exit 1; }
  grep -q '^User=flamefield$' "$unit" || { echo "$unit does not run as an unprivileged user"; exit 1; }
  grep -q '^ProtectSystem=strict$' "$unit" || { echo "$unit may write to the system"; exit 1; }
  # "OK" and better is below 2.5; 10 is a service without any protection.
  level=$(systemd-analyze security --offline=yes "$unit" 2>/dev/null | sed -n 's/.*exposure level for .*: \([0-9.]*\) .*/\1/p')
  echo "$unit: exposure $level"
  awk -v level="$level" 'BEGIN { exit !(level != "" && level < 2.5) }' || { echo "$unit is exposed"; exit 1; }
done
