#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
# What `pip install` cannot bring: Python's venv module and the shared libraries Blender's Python module links to.
# Installs what is missing when run as root on Debian or Ubuntu; otherwise says in one sentence what to install.
set -euo pipefail

python=${1:-python3.11}

if ! command -v "$python" >/dev/null; then
    echo "$python was not found: bpy 4.5 and 5.0 run on Python 3.11 only; install it, or name it with \`make PYTHON=/path/to/python3.11\`." >&2
    exit 1
fi
if ! "$python" -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))'; then
    echo "$python is $("$python" -V), but bpy 4.5 and 5.0 run on Python 3.11 only; name one with \`make PYTHON=/path/to/python3.11\`." >&2
    exit 1
fi

missing=()
"$python" -c 'import ensurepip, venv' 2>/dev/null || missing+=(python3.11-venv)
if [ "$(uname -s)" = Linux ]; then
    # soname → Debian package, as `ldd` lists them for bpy, and what rendering opens at run time (GL, EGL)
    libraries=(
        libX11.so.6:libx11-6 libXext.so.6:libxext6 libXrender.so.1:libxrender1 libXfixes.so.3:libxfixes3
        libXi.so.6:libxi6 libxkbcommon.so.0:libxkbcommon0 libSM.so.6:libsm6 libICE.so.6:libice6
        libGL.so.1:libgl1 libEGL.so.1:libegl1 libGLX_mesa.so.0:libglx-mesa0 libEGL_mesa.so.0:libegl-mesa0
    )
    known=$(PATH="$PATH:/sbin:/usr/sbin" ldconfig -p)
    for pair in "${libraries[@]}"; do
        grep -qF "${pair%%:*} " <<<"$known" || missing+=("${pair##*:}")
    done
    # Mesa's software renderer has no soname of its own to ask for.
    if command -v dpkg >/dev/null && ! dpkg -s libgl1-mesa-dri >/dev/null 2>&1; then
        missing+=(libgl1-mesa-dri)
    fi
fi
[ ${#missing[@]} -eq 0 ] && exit 0

if ! command -v apt-get >/dev/null; then
    echo "Missing system libraries; install your system's equivalent of these Debian packages: ${missing[*]}." >&2
    exit 1
elif [ "$(id -u)" -ne 0 ]; then
    echo "Missing system packages; please run: sudo apt-get install ${missing[*]}" >&2
    exit 1
fi
echo "Installing missing system packages: ${missing[*]}"
apt-get update -q
DEBIAN_FRONTEND=noninteractive apt-get install -qy --no-install-recommends "${missing[@]}"
