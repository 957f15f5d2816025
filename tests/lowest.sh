#!/bin/sh
# Proves the lower bounds in pyproject.toml: installs the lowest version of all that oatkit names itself, the newest of
# what those need in turn, says where a bound is not what was installed, and runs the tests, or those that are named:
#   sh tests/lowest.sh tests/test_solvers.py
# The environment is .venv-lowest beside this folder unless OATKIT_VENV names another; Python is python3.11 unless PYTHON
# says.
set -eu
cd "$(dirname "$0")/.."
venv=${OATKIT_VENV:-.venv-lowest}
python=${PYTHON:-python3.11}

"$python" -m venv "$venv" "$venv-uv"
"$venv-uv/bin/python" -m pip install --quiet --disable-pip-version-check uv
"$venv-uv/bin/uv" pip install --quiet --python "$venv/bin/python" --resolution lowest-direct \
    -e '.[test]' $(printf -- '-e %s ' plugins/*/)
"$venv/bin/python" - <<'PYTHON'
import sys
import tomllib
from importlib.metadata import version
from pathlib import Path

from packaging.requirements import Requirement

project = tomllib.loads(Path("pyproject.toml").read_text())["project"]
texts = [*project["dependencies"], *sum(project["optional-dependencies"].values(), [])]
wrong = []
for wanted in map(Requirement, texts):
    bounds = [s.version for s in wanted.specifier if s.operator == ">="]
    if bounds and not f"{(found := version(wanted.name))}.".startswith(f"{bounds[0]}."):
        wrong.append(f"{wanted.name}: the bound is {bounds[0]}, the lowest that can be installed {found}")
sys.exit("\n".join(wrong) or 0)
PYTHON
# Old releases call what newer ones of others have deprecated; that is theirs to mend, and they have.
OPENBLAS_NUM_THREADS=1 exec "$venv/bin/python" -m pytest -n 2 --dist loadfile -W "ignore::DeprecationWarning" "$@"
