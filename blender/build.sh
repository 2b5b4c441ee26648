#!/usr/bin/env bash
# Makes the extension for Blender of the wheel that tests/python.sh built: TARGET/blender/barymap-0.1.0.zip.
#
#   bash blender/build.sh
#
# Install it in Blender 4.2 or later: Edit, Preferences, Get Extensions, Install from Disk. Where Blender or its module bpy is at hand
# (BLENDER=blender, or BPY=PYTHON with bpy), its own program validates and packs; else the files are packed as they are.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

target=${CARGO_TARGET_DIR:-target}
wheels=("$target"/wheels/barymap-*.whl)
if [ ! -f "${wheels[0]}" ]; then
    echo "blender/build.sh: there is no wheel in $target/wheels: run bash tests/python.sh first" >&2
    exit 1
fi
folder=$target/blender/barymap
rm -rf "$target/blender"
mkdir -p "$folder/wheels"
cp blender/*.py LICENSE-MIT "$folder"
cp "${wheels[0]}" "$folder/wheels"
sed "s/WHEEL/$(basename "${wheels[0]}")/" blender/blender_manifest.toml >"$folder/blender_manifest.toml"

packer=()
if [ -n "${BLENDER:-}" ]; then
    packer=("$BLENDER" --command extension)
elif [ -n "${BPY:-}" ]; then
    program=$("$BPY" -c 'import importlib.util, pathlib
where = importlib.util.find_spec("bpy").submodule_search_locations[0]
print(next(pathlib.Path(where).glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py")))')
    packer=("$BPY" "$program")
fi
if [ ${#packer[@]} -gt 0 ]; then
    "${packer[@]}" validate "$folder"
    "${packer[@]}" build --source-dir "$folder" --output-dir "$target/blender"
else
    (cd "$folder" && python3 -m zipfile -c ../barymap-0.1.0.zip ./*)
fi
ls -l "$target"/blender/*.zip
