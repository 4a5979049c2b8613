#!/bin/sh
# Build what a release consists of, from the last commit, and try it. Nothing is published.
#
#   sh scripts/release.sh [PYTHON ...]
#
# A source distribution, a wheel made of that with the machine code of all shipped graphs, and their checksums
# go to dist/. In an empty folder the wheel alone is installed for every PYTHON (without any: each of 3.11 to
# 3.14 that is found), from the package index and without what is installed here. There BRUCE must jump with
# the run hash that .venv gives, without compiling a kernel, and a new project must be checked, run and pass
# its tests. Where qemu-aarch64 is installed, the wheel is tried on aarch64, too. SIGN=KEY signs what was built with that key of gpg.
set -eu
cd "$(dirname "$0")/.."
here=$PWD
version='import sys; print("%d.%d" % sys.version_info[:2])'

if [ $# -eq 0 ]; then
    for wanted in 3.11 3.12 3.13 3.14; do
        for candidate in "python$wanted" "$HOME/.pyenv/versions/$wanted".*/bin/python; do
            found=$("$candidate" -c "$version; import ensurepip" 2>/dev/null) || continue
            [ "$found" = "$wanted" ] || continue
            set -- "$@" "$candidate"
            break
        done
        [ "${found:-}" = "$wanted" ] || echo "no Python $wanted was found: the wheel is not tried there" >&2
    done
fi
[ $# -gt 0 ] || { echo "no Python from 3.11 to 3.14 was found to try the wheel with" >&2; exit 1; }

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
trap 'exit 130' INT TERM
unset PYTHONPATH

echo "== build $(git describe --always)"
[ -z "$(git status --porcelain)" ] || echo "changes that are not committed are left out" >&2
mkdir "$folder/source" "$folder/sdist" "$folder/unpacked"
git archive HEAD | tar x -C "$folder/source"
number=$(sed -n 's/^version = "\(.*\)"$/\1/p' "$folder/source/pyproject.toml")
grep -q "^## $number" CHANGELOG.md || echo "CHANGELOG.md has no section $number yet" >&2
build() {  # KIND, where the source is, where the file goes
    (cd "$2" && "$here/.venv/bin/python" -c "
from setuptools import build_meta
build_meta.build_$1('$3')" >"$folder/$1.log" 2>&1) || { cat "$folder/$1.log" >&2; return 1; }
}
rm -rf dist
mkdir dist
build sdist "$folder/source" "$folder/sdist"
tar xzf "$folder"/sdist/*.tar.gz -C "$folder/unpacked"
ln -s "aloft_robotics-$number" "$folder/unpacked/aloft"
PYTHONPATH=$folder/unpacked PYTHONDONTWRITEBYTECODE=1 \
    "$here/.venv/bin/python" "$folder/source/scripts/ship_kernels.py"
build wheel "$folder/unpacked/aloft_robotics-$number" "$folder/sdist"
cp "$folder"/sdist/* dist/

tell='import json, sys; told = json.load(sys.stdin); print(told["run_hash"] if told["success"] else told["reason"])'
jump() { (cd "$2" && "$1/aloft" jump --no-record --json 2>/dev/null | "$1/python" -c "$tell"); }  # with this bin, there
expected=$(jump "$here/.venv/bin" "$here")
compiled='
import sys
from pathlib import Path
import aloft
from aloft.mathematics.compiling.compile_calls import watchers
told = []
watchers.append(lambda done, total: told.append(total))
aloft.load(Path(aloft.__file__).parent / "graphs/jump.yaml").run(0.01)
print(max(told, default=0))'

for python in "$@"; do
    echo "== try the wheel alone with $("$python" --version)"
    rm -rf "$folder/environment" "$folder/empty"
    "$python" -m venv "$folder/environment"
    bin=$folder/environment/bin
    "$bin/python" -m pip install -qq --disable-pip-version-check dist/*.whl pytest
    mkdir "$folder/empty"
    export XDG_CACHE_HOME="$folder/environment/cache"
    count=$(cd "$folder/empty" && "$bin/python" -c "$compiled")
    [ "$count" = 0 ] || { echo "$count kernels were compiled, which the wheel should bring along" >&2; exit 1; }
    rm -rf "$XDG_CACHE_HOME"
    begin=$(date +%s)
    found=$(jump "$bin" "$folder/empty")
    [ "$found" = "$expected" ] || { echo "BRUCE jumps with $found instead of $expected" >&2; exit 1; }
    echo "its first run took $(($(date +%s) - begin)) s"
    (
        cd "$folder/empty"
        PATH=$bin:$PATH
        [ "$(aloft --version)" = "aloft $number" ]
        aloft new project first >/dev/null
        cd first
        aloft check graph.yaml
        aloft run graph.yaml --json >/dev/null
        python -m pytest -q -p no:cacheprovider
    )
done

if command -v qemu-aarch64 >/dev/null && command -v apt-get >/dev/null; then
    echo "== try the wheel on aarch64"
    sh scripts/try_aarch64.sh dist/*.whl "$bin"
fi

echo "== dist"
(cd dist && sha256sum -- * >SHA256SUMS)
if [ -n "${SIGN:-}" ]; then
    for file in dist/*; do gpg --batch --local-user "$SIGN" --armor --detach-sign "$file"; done
else
    echo "not signed: SIGN=KEY names a key of gpg" >&2
fi
cat dist/SHA256SUMS
