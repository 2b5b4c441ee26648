#!/usr/bin/env bash
# Runs the tests that need Chromium: bash tests/browser.sh
#
# BARYMAP_CHROMIUM=PROGRAM   which one; else chromium, chromium-browser or google-chrome of the path
#
# The library runs in a page if the target wasm32-unknown-unknown of Rust and wasm-bindgen are there.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

for name in ${BARYMAP_CHROMIUM:+"$BARYMAP_CHROMIUM"} chromium chromium-browser google-chrome; do
    if BARYMAP_CHROMIUM=$(command -v "$name"); then break; fi
done
if [ -z "$BARYMAP_CHROMIUM" ]; then
    echo "tests/browser.sh: no Chromium: install it (Debian and Ubuntu: apt-get install chromium), or name it by BARYMAP_CHROMIUM" >&2
    exit 1
fi
export BARYMAP_CHROMIUM

target=wasm32-unknown-unknown
version=$(awk '/^name = "wasm-bindgen"$/ { getline; gsub(/[^0-9.]/, ""); print }' Cargo.lock)
if ! rustup target list --installed 2>/dev/null | grep -qx "$target"; then
    echo "tests/browser.sh: no page: rustup target add $target"
elif [ "$(wasm-bindgen --version 2>/dev/null)" != "wasm-bindgen $version" ]; then
    echo "tests/browser.sh: no page: cargo install wasm-bindgen-cli --version $version"
else
    folder=$(mkdir -p "${CARGO_TARGET_DIR:-target}" && cd "${CARGO_TARGET_DIR:-target}" && pwd)
    cargo build --release --package barymap-browser --target "$target"
    export BARYMAP_WEB="$folder/web"
    wasm-bindgen --target web --no-typescript --out-dir "$BARYMAP_WEB" \
        "$folder/$target/release/barymap_browser.wasm"
    cp tests/browser/*.js "$BARYMAP_WEB"
fi
cargo test --release --test cpu browser -- --nocapture
