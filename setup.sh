#!/usr/bin/env bash
# Makes a virtual environment with everything fishlight needs: setup.sh VENV
# or only adds what the camera's tests on a kernel driver need: setup.sh --guest
# or what the tests of the live page and its window need: setup.sh --browser
# Python packages come from requirements.lock (versions and hashes); the system's parts are
# installed where the user may (root, or sudo without a password), otherwise the line is printed.
set -euo pipefail
cd "$(dirname "$0")"
venv=$1
python=${PYTHON:-python3}

say() { printf 'setup: %s\n' "$*"; }

need_packages() { # the Debian packages among those given that are not installed
    for package in "$@"; do
        dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q 'ok installed' || echo "$package"
    done
}

install_packages() { # MEANING PACKAGE...
    local meaning=$1; shift
    local missing; missing=$(need_packages "$@" | tr '\n' ' ')
    [ -n "$missing" ] || return 0
    local line="apt-get install -y --no-install-recommends $missing"
    if [ "$(id -u)" = 0 ]; then
        say "installing $meaning: $missing"
        (apt-get update -q && DEBIAN_FRONTEND=noninteractive $line) >&2 || say "failed; type: $line"
    elif sudo -n true 2>/dev/null; then
        say "installing $meaning: $missing"
        (sudo -n apt-get update -q && sudo -n $line) >&2 || say "failed; type: sudo $line"
    else
        say "$meaning missing. Type: sudo $line"
    fi
}

if [ "$venv" = --guest ]; then
    command -v dpkg-query >/dev/null || { say "not a Debian or Ubuntu system: no guest"; exit 0; }
    install_packages "the guest of the camera's tests" qemu-system-x86 busybox-static
    exit
fi

if [ "$venv" = --browser ]; then
    command -v dpkg-query >/dev/null || { say "not a Debian or Ubuntu system: no browser"; exit 0; }
    install_packages "the browser and the screen of the live session's tests" chromium xvfb
    exit
fi

if command -v dpkg-query >/dev/null; then
    install_packages "OpenGL (EGL and Mesa's software driver)" libegl1 libgl1-mesa-dri libgl1
    "$python" -c 'import ensurepip' 2>/dev/null || install_packages "Python's venv" \
        "$("$python" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')"
else
    say "not a Debian or Ubuntu system: fishlight render needs libEGL, libGL and a Mesa driver"
fi

"$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || {
    say "Python 3.11 or later is needed, $("$python" --version) was found. Set PYTHON=/path/to/python3.11"
    exit 1
}
"$python" -m venv "$venv"
"$venv/bin/python" -m pip install -q --disable-pip-version-check --require-hashes -r requirements.lock
"$venv/bin/python" -m pip install -q --disable-pip-version-check --no-build-isolation --no-deps -e .
"$venv/bin/fishlight" doctor || say "see the remedies above"
