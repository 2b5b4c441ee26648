#!/usr/bin/env bash
# Runs the tests that need Chromium: bash tests/browser.sh
#
# BARYMAP_CHROMIUM=PROGRAM   which one; else chromium, chromium-browser or google-chrome of the path
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
cargo test --release --test cpu browser -- --nocapture
