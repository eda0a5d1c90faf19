#!/bin/sh
# Fetches what the build links and embeds: libmujoco and its headers (third_party/mujoco), the MJCF models
# (third_party/models). Idempotent; a failed fetch leaves nothing behind.
set -u

here=$(cd "$(dirname "$0")" && pwd)
stamp=$(cat "$here/requirements.txt" "$here/fetch.sh" | cksum)
if [ -e "$here/mujoco/libmujoco.so" ] && [ -d "$here/models" ] &&
    [ -f "$here/fetched" ] && [ "$(cat "$here/fetched")" = "$stamp" ]; then
    exit 0
fi

fail() {
    echo "setup: $1" >&2
    exit 1
}

case "$(uname -s)-$(uname -m)" in
Linux-x86_64) platform=manylinux_2_28_x86_64 ;;
Linux-aarch64) platform=manylinux_2_28_aarch64 ;;
*) fail "no MuJoCo wheel is pinned for $(uname -s) $(uname -m); Linux on x86_64 or aarch64 is needed" ;;
esac
command -v python3 >/dev/null || fail "python3 is needed to fetch MuJoCo; install it and run make again"
python3 -m pip --version >/dev/null 2>&1 || fail "python3 has no pip; install it (Debian: apt install python3-pip) and run make again"

work=$(mktemp -d "$here/.fetch.XXXXXX") || fail "cannot write in $here"
trap 'rm -rf "$work"' EXIT
trap 'exit 130' INT TERM

echo "setup: fetching MuJoCo 3.17.0 and the Gymnasium 1.4.0 models (27 MB)" >&2
if ! python3 -m pip download --quiet --disable-pip-version-check --no-deps --only-binary=:all: --require-hashes \
    --platform "$platform" --python-version 3.11 --implementation cp \
    --requirement "$here/requirements.txt" --dest "$work/wheels" >"$work/log" 2>&1; then
    if grep -qi 'do not match the hashes' "$work/log"; then
        fail "a downloaded wheel does not have the SHA-256 in third_party/requirements.txt; nothing was installed"
    fi
    fail "pip could not fetch the wheels ($(grep -i error "$work/log" | tail -n 1)); check the network and run make again"
fi

python3 - "$work" <<'PY' || fail "the wheels do not hold what was expected; nothing was installed"
import os, sys, zipfile, glob
work = sys.argv[1]
def unpack(pattern, wanted):
    with zipfile.ZipFile(glob.glob(f"{work}/wheels/{pattern}")[0]) as wheel:
        for name in wheel.namelist():
            target = wanted(name)
            if target:
                path = os.path.join(work, target)
                os.makedirs(os.path.dirname(path), exist_ok=True)
                with open(path, "wb") as file:
                    file.write(wheel.read(name))
models = {"half_cheetah", "hopper", "walker2d", "ant", "inverted_pendulum", "inverted_double_pendulum", "swimmer", "reacher",
          "humanoid"}
def mujoco(name):
    if name.startswith("mujoco/libmujoco.so"):
        return name
def gymnasium(name):
    stem, ext = os.path.splitext(os.path.basename(name))
    if name.startswith("gymnasium/envs/mujoco/assets/") and ext == ".xml" and stem in models:
        return f"models/{stem}.xml"
unpack("mujoco-*.whl", mujoco)
unpack("gymnasium-*.whl", gymnasium)
library = glob.glob(f"{work}/mujoco/libmujoco.so.*")
assert len(library) == 1 and len(os.listdir(f"{work}/models")) == len(models)
os.symlink(os.path.basename(library[0]), f"{work}/mujoco/libmujoco.so")
PY

rm -rf "$here/mujoco" "$here/models"
mv "$work/mujoco" "$work/models" "$here/" || fail "cannot write in $here"
echo "$stamp" >"$here/fetched"
