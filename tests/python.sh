#!/usr/bin/env bash
# Builds the wheel for Python, installs it into a new virtual environment and runs its tests: types, examples of the documentation,
# bad inputs, signals, memory, the same bytes as the command line, and a cluster whose worker is killed.
#
#   bash tests/python.sh [arguments of pytest, such as -k cage]
#
# Needs Python 3.9 or later with venv, and a package index for what crates/python/tests/requirements.txt names. The wheel lies in
# TARGET/wheels then, the environment in TARGET/python. The first build compiles the library once more (10 to 25 minutes on two cores):
# pyo3 switches on parts of a shared dependency.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

target=$(mkdir -p "${CARGO_TARGET_DIR:-target}" && cd "${CARGO_TARGET_DIR:-target}" && pwd)
export CARGO_TARGET_DIR=$target PIP_DISABLE_PIP_VERSION_CHECK=1
python=${PYTHON:-python3}
venv=$target/python
tests=crates/python/tests
if [ -z "${XDG_RUNTIME_DIR:-}" ]; then
    export XDG_RUNTIME_DIR=/nonexistent
fi

# Tools stay from run to run; the package is installed anew.
if ! cmp -s "$tests/requirements.txt" "$venv/requirements.txt"; then
    rm -rf "$venv"
    "$python" -m venv "$venv"
    "$venv/bin/pip" install --quiet --requirement "$tests/requirements.txt"
    cp "$tests/requirements.txt" "$venv/requirements.txt"
fi
rm -rf "$target/wheels"
"$venv/bin/maturin" build --release --locked --out "$target/wheels" --manifest-path crates/python/Cargo.toml
"$venv/bin/pip" install --quiet --force-reinstall --no-deps "$target"/wheels/barymap-*.whl

root=$PWD
echo "tests/python.sh: types"
(cd crates/python && "$venv/bin/mypy")
# As a user has it: the installed package, by its mark.
(cd "$venv" && "$venv/bin/mypy" --strict --config-file= "$root/$tests/typed.py")
echo "tests/python.sh: tests"
# From another folder, so that the installed package is what is tested.
cd "$venv"
BARYMAP_CACHE=$(mktemp -d)
export BARYMAP_CACHE
trap 'rm -rf "$BARYMAP_CACHE"' EXIT
"$venv/bin/python" -m pytest -q -p no:cacheprovider --doctest-modules --pyargs barymap "$root/$tests" "$@"

echo "tests/python.sh: the four lines of README.md in an environment with nothing else"
rm -rf "$target/fresh"
"$python" -m venv "$target/fresh"
"$target/fresh/bin/pip" install --quiet "$target"/wheels/barymap-*.whl
cd "$target/fresh"
./bin/python -m barymap demo --size 256 --quiet
awk '/^```python$/ { on = 1; next } /^```$/ { on = 0 } on' "$root/README.md" >lines.py
test "$(wc -l <lines.py)" = 4
./bin/python lines.py
test -s new.png
ls -l "$target"/wheels/*.whl
