#!/bin/sh
# The checklist of a release, each point tried: `sh release.sh`. Exits with 1 if one failed. It uploads nothing.
# Environments are made in a temporary folder, far from this one; Python is python3 unless PYTHON says.
set -u
cd "$(dirname "$0")" || exit 1
root=$PWD
python=${PYTHON:-python3}
far=$(mktemp -d)
trap 'rm -rf "$far"' EXIT
failed=0

step() { # a sentence, and the command that must succeed
    sentence=$1
    shift
    if "$@" >"$far/log" 2>&1; then
        echo "ok      $sentence"
    else
        echo "FAILED  $sentence"
        tail -n 15 "$far/log" | sed 's/^/            /'
        failed=$((failed + 1))
    fi
}

said() { sed -n "s/^$2[:= ]*\"\{0,1\}\([0-9][^\"]*\)\"\{0,1\}\$/\1/p" "$1" | head -n 1; }
version=$(said pyproject.toml version)

nothing_uncommitted() { git status --short && test -z "$(git status --porcelain)"; }
versions_agree() {
    for pair in "src/oatkit/__init__.py __version__" "CITATION.cff version" "conda/recipe.yaml   version"; do
        found=$(said ${pair%% *} "${pair#* }")
        test "$found" = "$version" || { echo "${pair%% *} says '$found', pyproject.toml '$version'"; return 1; }
    done
}
changes_are_named() {
    grep -q "^## \[\{0,1\}$version" CHANGELOG.md || { echo "CHANGELOG.md has no heading '## $version'"; return 1; }
}
tools() { "$python" -m venv "$far/tools" && "$far/tools/bin/python" -m pip install -q build twine; }
build() { rm -rf dist && "$far/tools/bin/python" -m build --outdir dist .; }
upload_would_pass() { "$far/tools/bin/twine" check --strict dist/*; }
install() { # an environment and what to install there
    environment=$1
    shift
    "$python" -m venv "$far/$environment" && "$far/$environment/bin/python" -m pip install -q "$@"
}
inside() { # an environment and one of its commands, run far from the repository
    environment=$1
    shift
    (cd "$far" && "$far/$environment/bin/$@")
}
says_version() { inside "$1" oatkit --version | grep -qx "oatkit $version"; }
no_plugin_is_broken() {
    inside "$1" oatkit plugins >"$far/plugins" && cat "$far/plugins" && ! grep -q 'broken\|ambiguous' "$far/plugins"
}
demo() { inside wheel oatkit demo -o "$far/demo" && test -s "$far/demo/demo.png" && test -s "$far/demo/oxygen.png"; }
tutorial_plugin() {
    "$far/tools/bin/python" -m build --wheel --outdir "$far/sirt" plugins/oatkit-sirt &&
        "$far/wheel/bin/python" -m pip install -q "$far"/sirt/*.whl
}
runs_with_it() {
    inside wheel oatkit simulate disc -o "$far/scan.h5" &&
        inside wheel oatkit run lsqr "$far/scan.h5" --set reconstruct.use=sirt -o "$far/out.zarr" &&
        inside wheel oatkit verify "$far/out.zarr"
}

echo "oatkit $version"
step "everything is committed" nothing_uncommitted
step "pyproject.toml, oatkit.__version__, CITATION.cff and the conda recipe have one version" versions_agree
step "CHANGELOG.md says what is new in $version" changes_are_named
step "tools to build with" tools
step "wheel and sdist are built" build
step "an index would accept them (twine check --strict)" upload_would_pass
step "the wheel is installed in a bare environment" install wheel "$(echo "$root"/dist/*.whl)[report]"
step "oatkit --version" says_version wheel
step "oatkit plugins: none is broken" no_plugin_is_broken wheel
step "oatkit demo" demo
step "the tutorial's plugin is built and installed beside it" tutorial_plugin
step "oatkit plugins, with it" no_plugin_is_broken wheel
step "a scan is simulated, reconstructed by the tutorial's plugin, and verified" runs_with_it
step "the sdist is installed in another environment" install sdist "$(echo "$root"/dist/*.tar.gz)"
step "oatkit --version, from the sdist" says_version sdist
step "oatkit plugins, from the sdist" no_plugin_is_broken sdist

if [ "$failed" -gt 0 ]; then
    echo "$failed failed; mend it, and run this again."
    exit 1
fi
echo "All is well. What is left to type:"
echo "    git tag v$version && $python -m twine upload dist/*"
