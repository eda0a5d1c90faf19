#!/usr/bin/env bash
# Makes the peers' environment outside of the repository: in $PEERS_VENV, by default in the user's cache. PyPI's torch brings
# libraries for GPUs, 5 GB that are not used here; pip can be told of an index that has a build without.
set -euo pipefail
venv="${PEERS_VENV:-${XDG_CACHE_HOME:-$HOME/.cache}/mcpo-run-peers}"
[ -x "$venv/bin/python" ] || "${PYTHON:-python3}" -m venv "$venv"
"$venv/bin/pip" install --quiet --requirement "$(dirname "$0")/requirements.txt"
echo "$venv/bin/python"
