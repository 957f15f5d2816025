#!/bin/sh
# Installs oatkit with all that its tests need into a virtual environment of its own, and runs the checks and the tests.
# The environment is .venv-test beside this folder unless OATKIT_VENV names another; Python is python3 unless PYTHON says.
set -eu
cd "$(dirname "$0")/.."
venv=${OATKIT_VENV:-.venv-test}
python=${PYTHON:-python3}
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || {
    echo "oatkit needs Python 3.11 or later; $python is older. Set PYTHON to a newer one." >&2
    exit 1
}
"$python" -m venv "$venv" || {
    echo "python3 could not make a virtual environment. On Debian: apt-get install python3-venv" >&2
    exit 1
}
"$venv/bin/python" -m pip install --quiet --disable-pip-version-check -e '.[test]'
"$venv/bin/ruff" format --check .
"$venv/bin/ruff" check .
"$venv/bin/mypy"
exec "$venv/bin/python" -m pytest "$@"
