#!/bin/sh
# Installs oatkit with all that its tests need into a virtual environment of its own, and runs the checks and the tests.
# The environment is .venv-test beside this folder unless OATKIT_VENV names another; Python is python3 unless PYTHON says.
set -eu
cd "$(dirname "$0")/.."
venv=${OATKIT_VENV:-.venv-test}
python=${PYTHON:-python3}

"$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || {
    echo "oatkit needs Python 3.11 or later; '$python' is none. Set PYTHON to one." >&2
    exit 1
}
# Debian keeps the module that makes virtual environments in a package of its own.
if ! "$python" -c 'import ensurepip, venv' 2>/dev/null; then
    if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
        apt-get update -qq && apt-get install -y -qq python3-venv
    else
        echo "Python cannot make virtual environments here. On Debian: sudo apt-get install python3-venv" >&2
        exit 1
    fi
fi
"$python" -m venv "$venv"
# Tests of the window draw on Xvfb, a display in memory, with the libraries that Qt takes from the system.
packages="xvfb libfontconfig1 libgl1 libegl1 libglib2.0-0 libdbus-1-3 libxkbcommon0 libxkbcommon-x11-0 libxcb-cursor0
libxcb-icccm4 libxcb-keysyms1 libxcb-shape0"
if command -v dpkg >/dev/null && ! dpkg -s $packages >/dev/null 2>&1; then
    if ! { [ "$(id -u)" = 0 ] && apt-get update -qq && apt-get install -y -qq --no-install-recommends $packages; }; then
        echo "Tests of the window cannot run: Debian packages are missing that could not be installed here." >&2
        echo "They need: apt-get install" $packages >&2
        [ -n "${CI:-}" ] || export OATKIT_NO_WINDOWS=1 # skipped; with CI they fail
    fi
fi
# The packages in plugins/ come in as anybody's do: by their entry points.
"$venv/bin/python" -m pip install --quiet --disable-pip-version-check -e '.[test]' $(printf -- '-e %s ' plugins/*/)
"$venv/bin/ruff" format --check .
"$venv/bin/ruff" check .
"$venv/bin/mypy"
# Tests on small dense matrices are several times slower where the BLAS competes with our own threads. A file of tests
# goes to one process, so that what its tests share is made once.
OPENBLAS_NUM_THREADS=1 exec "$venv/bin/python" -m pytest -n 2 --dist loadfile "$@"
