#!/usr/bin/env bash
# Builds, lints and tests the studio (crates/studio), which the other scripts leave out.
#
#   bash tests/studio.sh [arguments of cargo test, such as --test window]
#
# BARYMAP_DATA=FOLDER   real models and broken files; without it the tests that need them are ignored
#
# The tests of the window run on a software Vulkan driver without a display. The last one runs the whole program by mouse and
# keyboard on a display of its own; it needs Xvfb and xdotool, which are installed where this script may (Debian and Ubuntu, as
# root), and is named as NOT RUN where they are missing.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
exec </dev/null
export CARGO_INCREMENTAL=0

has() { command -v "$1" >/dev/null; }
if ! { has Xvfb && has xdotool; } && [ "$(id -u)" = 0 ] && has apt-get; then
    echo "tests/studio.sh: installing Xvfb and xdotool"
    export DEBIAN_FRONTEND=noninteractive
    { apt-get update -q && apt-get install -y -q --no-install-recommends xvfb xdotool mesa-vulkan-drivers libvulkan1; } ||
        echo "tests/studio.sh: they could not be installed"
fi

work=$(mktemp -d)
server=
# shellcheck disable=SC2329  # the trap calls it
finish() {
    [ -z "$server" ] || kill "$server" 2>/dev/null || true
    rm -rf "$work"
}
trap finish EXIT
if [ -z "${XDG_RUNTIME_DIR:-}" ]; then
    export XDG_RUNTIME_DIR="$work/run"
    mkdir -m 700 "$XDG_RUNTIME_DIR"
fi
# Embeddings and recovery files of the user stay out of it.
export BARYMAP_CACHE="$work/cache"

options=()
if [ -n "${BARYMAP_DATA:-}" ]; then
    options+=(--include-ignored --skip sixteen_pairs_by_mouse)
else
    echo "tests/studio.sh: BARYMAP_DATA is not set: the collection of broken files is not dropped"
fi
cargo fmt -p barymap-studio --check
cargo clippy --release -p barymap-studio --all-targets --quiet -- -D warnings
cargo test --release -p barymap-studio "$@" -- "${options[@]}"

if has Xvfb && has xdotool; then
    # The server takes a free number and tells it.
    Xvfb -displayfd 3 -screen 0 1280x800x24 -nolisten tcp 3>"$work/display" 2>"$work/server" &
    server=$!
    for _ in $(seq 100); do
        [ -s "$work/display" ] && break
        sleep 0.1
    done
    DISPLAY=":$(cat "$work/display")" cargo test --release -p barymap-studio --test display -- --include-ignored --nocapture
else
    echo "NOT RUN: the whole program by mouse and keyboard: it needs Xvfb and xdotool"
fi
