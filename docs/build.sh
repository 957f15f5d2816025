#!/bin/sh
# Builds the documentation into docs/_build/html, in a virtual environment of its own, and runs all scripts of the gallery.
# The environment is .venv-docs beside this folder unless OATKIT_VENV names another; Python is python3 unless PYTHON says.
# Arguments go to Sphinx: `sh docs/build.sh -D plot_gallery=0` leaves the gallery out.
set -eu
cd "$(dirname "$0")/.."
venv=${OATKIT_VENV:-.venv-docs}

"${PYTHON:-python3}" -m venv "$venv"
# The packages in plugins/ come in as anybody's do: by their entry points.
"$venv/bin/python" -m pip install --quiet --disable-pip-version-check -e '.[docs]' $(printf -- '-e %s ' plugins/*/)
"$venv/bin/python" -m sphinx -W --keep-going "$@" docs docs/_build/html
echo "open docs/_build/html/index.html"
