#!/usr/bin/env bash
# Runs every test: library, command line, CPU, GPU and the examples of the documentation.
#
#   bash tests/run.sh [arguments of cargo test, such as --test cli]
#
# BARYMAP_DATA=FOLDER        real models; without it the tests that need them are counted as ignored
# BARYMAP_REQUIRE_GPU=1      a machine without an adapter fails, instead of skipping the GPU tests
# BARYMAP_REQUIRE_GLTF_VALIDATOR=1  the same where the glTF validator cannot be had
#
# Installs a software Vulkan driver where the system has none and this script may (Debian and Ubuntu, as root), and the glTF
# validator of Khronos beside the build where node and npm are: tests run it over the files that they write.
# Closes with the sum over all test binaries: N passed, N failed.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

has_vulkan() {
    # Other systems bring Metal or Direct3D 12 along.
    [ "$(uname -s)" = Linux ] || return 0
    local loader
    loader=$(ldconfig -p 2>/dev/null || /sbin/ldconfig -p 2>/dev/null || true)
    case $loader in *libvulkan.so.1*) ;; *) return 1 ;; esac
    [ -z "${VK_DRIVER_FILES:-}${VK_ICD_FILENAMES:-}" ] || return 0
    local folder
    for folder in /usr/share/vulkan/icd.d /usr/local/share/vulkan/icd.d /etc/vulkan/icd.d; do
        if compgen -G "$folder/*.json" >/dev/null; then return 0; fi
    done
    return 1
}

if ! has_vulkan; then
    if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
        echo "tests/run.sh: no Vulkan driver: installing Mesa's"
        export DEBIAN_FRONTEND=noninteractive
        { apt-get update -q && apt-get install -y -q --no-install-recommends mesa-vulkan-drivers libvulkan1; } </dev/null ||
            echo "tests/run.sh: the driver could not be installed; GPU tests will be skipped"
    else
        echo "tests/run.sh: no Vulkan driver: GPU tests will be skipped. Install one to run them:"
        echo "    Debian, Ubuntu: sudo apt-get install mesa-vulkan-drivers libvulkan1"
        echo "    Fedora: sudo dnf install mesa-vulkan-drivers vulkan-loader"
        echo "    Arch: sudo pacman -S vulkan-swrast vulkan-icd-loader"
    fi
fi

validator=${CARGO_TARGET_DIR:-target}/gltf-validator
if ! command -v node >/dev/null || ! command -v npm >/dev/null; then
    echo "tests/run.sh: no node or npm: the glTF files that tests write are not validated"
elif [ ! -d "$validator/node_modules/gltf-validator" ] ||
    ! cmp -s tests/gltf_validator/package-lock.json "$validator/package-lock.json"; then
    mkdir -p "$validator"
    cp tests/gltf_validator/package.json tests/gltf_validator/package-lock.json "$validator"
    (cd "$validator" && npm ci --no-audit --no-fund --loglevel=error) </dev/null ||
        echo "tests/run.sh: the glTF validator could not be installed; files are not validated"
fi

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# Mesa warns, and some loaders fail, where there is no folder for run-time files.
if [ -z "${XDG_RUNTIME_DIR:-}" ]; then
    export XDG_RUNTIME_DIR="$work/run"
    mkdir -m 700 "$XDG_RUNTIME_DIR"
fi

# The output of passing tests is shown, so that skipped tests are heard and can be counted.
options=(--show-output)
if [ -n "${BARYMAP_DATA:-}" ]; then
    BARYMAP_DATA=$(cd "$BARYMAP_DATA" && pwd)
    export BARYMAP_DATA
    options+=(--include-ignored)
else
    echo "tests/run.sh: BARYMAP_DATA is not set: tests on real models are ignored and counted below"
fi

status=0
cargo test --release --no-fail-fast "$@" -- "${options[@]}" </dev/null 2>&1 | tee "$work/log" || status=$?

read -r passed failed ignored < <(awk '
    /^test result: / {
        for (i = 2; i <= NF; i++) {
            if ($i == "passed;") p += $(i - 1)
            if ($i == "failed;") f += $(i - 1)
            if ($i == "ignored;") g += $(i - 1)
        }
    }
    END { print p + 0, f + 0, g + 0 }' "$work/log")
skipped=$(grep '^SKIPPED:' "$work/log" | grep -vc 'glTF validator\|no Chromium' || true)
browsers=$(grep -c '^SKIPPED: no Chromium' "$work/log" || true)
unvalidated=$(grep -c '^SKIPPED: no glTF validator' "$work/log" || true)
echo
[ "$ignored" = 0 ] || echo "$ignored tests ignored: they need the real models that BARYMAP_DATA names"
[ "$skipped" = 0 ] || echo "$skipped times a GPU test was skipped: no adapter (see barymap devices)"
[ "$browsers" = 0 ] || echo "$browsers tests in a browser were skipped: bash tests/browser.sh runs them"
[ "$unvalidated" = 0 ] || echo "$unvalidated times the files of a command were not validated: no glTF validator"
# A build that fails, or a binary that crashes, reports no failed test.
if [ "$status" != 0 ] && [ "$failed" = 0 ]; then
    echo "tests/run.sh: cargo test failed (exit code $status) before a test could report"
    failed=1
fi
echo "$passed passed, $failed failed"
if [ "$failed" != 0 ] || [ "$passed" = 0 ]; then exit 1; fi
