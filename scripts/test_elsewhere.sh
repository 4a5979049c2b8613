#!/bin/sh
# Run some fast tests in another environment than .venv, which has the newest packages:
#
#   sh scripts/test_elsewhere.sh newest [PYTHON]   another Python: those of what reads, compiles and runs blocks
#   sh scripts/test_elsewhere.sh oldest [PYTHON]   the oldest minor versions that pyproject.toml allows: those that
#                                                  call the packages
#
# Without PYTHON, `newest` takes the newest one it finds whose version is not that of .venv, and does
# nothing if there is none; `oldest` takes the one that .venv was made with. The environment goes to
# build/ and is used again. `.ci/run` runs both beside each other, so each has no more processes than there
# are cores. LIMIT bounds the seconds of the installation and of the tests, each.
set -e
cd "$(dirname "$0")/.."
which=$1
limit=${LIMIT:-1200}
version='import sys; print("%d.%d" % sys.version_info[:2])'
ours=$(.venv/bin/python -c "$version")

python=$2
if [ -z "$python" ] && [ "$which" = oldest ]; then
    python=.venv/bin/python
elif [ -z "$python" ]; then
    for wanted in 3.14 3.13 3.12 3.11; do
        [ "$wanted" != "$ours" ] || continue
        for candidate in "python$wanted" "$HOME/.pyenv/versions/$wanted".*/bin/python; do
            found=$("$candidate" -c "$version; import ensurepip" 2>/dev/null) || continue
            if [ "$found" = "$wanted" ]; then
                python=$candidate
                break 2
            fi
        done
    done
fi
if [ -z "$python" ]; then
    echo "no Python from 3.11 to 3.14 but the $ours of .venv was found; nothing is tested elsewhere"
    exit 0
fi

folder=build/elsewhere-$which-$("$python" -c "$version")
"$python" -m venv "$folder"
.venv/bin/python - "$which" > "$folder/wanted.txt" <<'PROGRAM'
import re
import sys
import tomllib

with open("pyproject.toml", "rb") as file:
    told = tomllib.load(file)
extras = told["project"]["optional-dependencies"]
for text in [*told["project"]["dependencies"], *extras["plan"]]:
    name, oldest = re.match(r"([\w.-]+)>=([\d.]+)", text).groups()
    exact = f"{name}~={oldest}.0" if oldest.count(".") == 1 else f"{name}=={oldest}"
    print(exact if sys.argv[1] == "oldest" else text)
for_tests = "pytest", "pytest-xdist", "hypothesis", "mpmath", "jsonschema", "quadprog", "scipy"
for_tests += "setuptools", "example-robot-data"
for text in told["dependency-groups"]["dev"]:
    if text.partition(">=")[0] in for_tests:
        print(text)
PROGRAM
pip="$folder/bin/python -m pip install -qq --disable-pip-version-check"
editable="$pip --no-deps --no-build-isolation --editable ."
# one after the other: setuptools writes what it knows of a checkout into the checkout
if ! timeout "$limit" $pip -r "$folder/wanted.txt" 2>"$folder/pip.log" || ! { flock 9 || true; $editable; } 9>build/lock; then
    cat "$folder/pip.log" >&2
    if grep -q ResolutionImpossible "$folder/pip.log"; then
        echo "versions that pyproject.toml allows exclude each other: raise a lower bound"
        exit 1
    fi
    echo "the packages could not be installed within $limit s: nothing is tested with $which on $python"
    exit 0
fi
# where the environment forbids to write bytecode, every process of the tests would compile all sources
"$folder/bin/python" -m compileall -q -x '/(\.venv|build|tests)/' .
echo "all tests run on Python $ours of .venv; these run on $("$folder/bin/python" --version), the $which packages:"
# what may differ with another Python, or with an older package, and a run from end to end with either
if [ "$which" = oldest ]; then
    tests="tests/runtime/language tests/runtime/loading/test_schema.py tests/files tests/blocks/control
        tests/planner/solving/test_solve.py::test_ipopt_finds_the_same_optimum
        tests/hal/simulated/test_mujoco_robot.py tests/logs/file tests/logs/recording/test_writer.py
        tests/cli/test_view.py"
else
    tests="tests/runtime/language tests/runtime/running tests/studies/batch/test_jobs.py"
fi
PYTHONDONTWRITEBYTECODE= OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 PYTEST_XDIST_AUTO_NUM_WORKERS=$(getconf _NPROCESSORS_ONLN) \
    timeout "$limit" "$folder/bin/python" -m pytest --numprocesses auto --dist worksteal -m "not long" -p no:cacheprovider \
    $tests tests/mathematics/compiling tests/cli/test_run.py
