#!/usr/bin/env bash
# Makes the peers' environment outside of the repository, in $PEERS_VENV, by default in the user's cache, and prints the
# path of its Python (3.11 or newer; the pins are 3.11's). A program that cannot be installed is named in one line and left out.
#
# 6 minutes on two cores, and 7.4 GB, 5.2 of them torch with CUDA's libraries, which PyPI's build insists on and nothing
# here uses. Where there is an index with a build for CPUs, PIP_EXTRA_INDEX_URL tells pip of it, and about 3 GB remain.
set -euo pipefail
here="$(cd "$(dirname "$0")" && pwd)"
venv="${PEERS_VENV:-${XDG_CACHE_HOME:-$HOME/.cache}/mcpo-run-peers}"
[ -x "$venv/bin/python" ] || "${PYTHON:-python3}" -m venv "$venv"
log="$venv/setup.log"
: > "$log"
grep -v '^#' "$here/requirements.txt" | while read -r -a packages; do
    "$venv/bin/pip" install --no-cache-dir --constraint "$here/constraints.txt" "${packages[@]}" >> "$log" 2>&1 ||
        echo "left out: ${packages[*]}: $(grep ERROR "$log" | tail -n 1) (the whole story: $log)" >&2
done
echo "$venv/bin/python"
