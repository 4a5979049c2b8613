#!/bin/sh
# Print the Python to build the virtual environment with: the one given, or the first on PATH that
# will do. A name on PATH may be a shim that cannot run, so each candidate is tried.
suitable='import sys; raise SystemExit(not (3, 11) <= sys.version_info[:2] <= (3, 14))'

if [ $# -gt 0 ]; then
    candidates=$*
else
    candidates="python3 python3.12 python3.13 python3.11 python3.14 python"
fi
for candidate in $candidates; do
    "$candidate" -c "$suitable" >/dev/null 2>&1 || continue
    if ! "$candidate" -c 'import venv, ensurepip' >/dev/null 2>&1; then
        without_venv=$candidate
        continue
    fi
    command -v "$candidate"
    exit 0
done
if [ -n "$without_venv" ]; then
    echo "$without_venv cannot make virtual environments; on Debian: apt-get install python3-venv" >&2
else
    echo "Python 3.11 to 3.14 is needed and none of these is one: $candidates" >&2
    echo "install it, or say where it is: make PYTHON=/path/to/python" >&2
fi
exit 1
