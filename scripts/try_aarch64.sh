#!/bin/sh
# Try a wheel on aarch64, in emulation:
#
#   sh scripts/try_aarch64.sh WHEEL BIN
#
# BIN is the folder of programs of an environment with that wheel. It records a jump here. Debian's Python 3.11
# and all packages for aarch64 go to a folder of their own, and nothing is installed here. There the controller
# runs again on the recorded inputs, and every byte must be the same, without compiling a kernel. The table of the
# plan is the one made here, because Pinocchio rounds otherwise on aarch64. It takes some minutes and 2 GB. Needs
# qemu-aarch64 and apt-get.
set -eu
wheel=$(realpath "$1") bin=$(realpath "$2")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
trap 'exit 130' INT TERM
unset PYTHONPATH
cd "$folder"
export XDG_CACHE_HOME="$folder/cache"

cat >here.py <<'PROGRAM'
import sys
from pathlib import Path

from aloft.cli import main
from aloft.mathematics import kept_arrays

kept_arrays.LIBRARIES = ()  # those of another Python may be of other versions
Path("processor").write_bytes(kept_arrays.processor())
sys.argv[1:] = ["run", "aloft:jump.yaml", "--record", "jump.rrd", "--quiet"]
main()
PROGRAM
"$bin/python" here.py >/dev/null
rm -r cache/aloft/kernels

mkdir -p state/lists/partial archives/partial debs root
: >status
echo "deb [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] http://deb.debian.org/debian bookworm main" >sources.list
apt() {
    apt-get -qq -o Dir::State="$folder/state" -o Dir::State::status="$folder/status" -o Dir::Cache="$folder" \
        -o Dir::Etc::sourcelist="$folder/sources.list" -o Dir::Etc::sourceparts=- -o APT::Sandbox::User=root \
        -o APT::Architecture=arm64 -o APT::Architectures=arm64 "$@"
}
apt update
(cd debs && apt download libc6 libgcc-s1 libstdc++6 libgomp1 libbz2-1.0 liblzma5 zlib1g libssl3 libexpat1 libffi8 \
    libuuid1 libsqlite3-0 libpython3.11-minimal libpython3.11-stdlib python3.11-minimal python3.11)
for file in debs/*.deb; do dpkg -x "$file" root; done

platforms=
for name in manylinux2014 manylinux_2_17 manylinux_2_24 manylinux_2_26 manylinux_2_27 manylinux_2_28; do
    platforms="$platforms --platform ${name}_aarch64"
done
"$bin/python" -m pip install -qq --disable-pip-version-check --target site --only-binary :all: --python-version 3.11 \
    --implementation cp --abi cp311 --abi cp310 --abi abi3 --abi none $platforms --platform any "$wheel"

cat >run.py <<'PROGRAM'
import platform
import site
import sys
from pathlib import Path

site.addsitedir("site")  # with the folders that its .pth files name
from aloft.cli import main
from aloft.mathematics import kept_arrays
from aloft.mathematics.compiling.compile_calls import watchers

assert platform.machine() == "aarch64"
kept_arrays.LIBRARIES = ()
kept_arrays.processor = Path("processor").read_bytes
told = []
watchers.append(lambda done, total: told.append(total))
sys.argv[1:] = ["replay", "jump.rrd", "--check", "--inputs", "recorded"]
try:
    main()
except SystemExit as end:
    code = end.code
print(f"on aarch64 {max(told, default=0)} kernels were compiled, which the wheel should bring along")
sys.exit(code or bool(told))
PROGRAM
env -i PATH=/usr/bin:/bin HOME="$folder" XDG_CACHE_HOME="$XDG_CACHE_HOME" PYTHONDONTWRITEBYTECODE=1 OMP_NUM_THREADS=1 \
    OPENBLAS_NUM_THREADS=1 qemu-aarch64 -L root root/usr/bin/python3.11 run.py
