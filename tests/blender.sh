#!/usr/bin/env bash
# Builds, validates and installs the extension for Blender and tests it inside the module bpy, without a window.
#
#   bash tests/python.sh && bash tests/blender.sh [arguments of pytest]
#
# Needs the wheel of tests/python.sh, Python 3.11, 1.5 GB of disk and a package index for bpy 4.5.15. With PICTURES=FOLDER it renders the
# pictures of docs/blender.md there.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

target=$(mkdir -p "${CARGO_TARGET_DIR:-target}" && cd "${CARGO_TARGET_DIR:-target}" && pwd)
export CARGO_TARGET_DIR=$target PIP_DISABLE_PIP_VERSION_CHECK=1
venv=${BPY_VENV:-$target/bpy}
if [ ! -x "$venv/bin/python" ]; then
    "${PYTHON:-python3.11}" -m venv "$venv"
fi
"$venv/bin/pip" install --quiet bpy==4.5.15 pytest==9.2.0

BPY=$venv/bin/python bash blender/build.sh
BLENDER_USER_RESOURCES=$(mktemp -d)
BARYMAP_CACHE=$(mktemp -d)
export BLENDER_USER_RESOURCES BARYMAP_CACHE XDG_RUNTIME_DIR=${XDG_RUNTIME_DIR:-/nonexistent}
trap 'rm -rf "$BLENDER_USER_RESOURCES" "$BARYMAP_CACHE"' EXIT
BARYMAP_EXTENSION=$(ls "$target"/blender/barymap-*.zip)
export BARYMAP_EXTENSION
"$venv/bin/python" -m pytest -q -s -p no:cacheprovider blender/tests "$@"
