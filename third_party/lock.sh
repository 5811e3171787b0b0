#!/bin/sh
# Writes third_party/requirements.lock: what `make install` brings, with versions and hashes, for Python 3.10 and newer.
#   lock.sh PYTHON   (a Python with uv)
# torch and what its CUDA build needs are left out: install_python_packages.sh chooses the build of torch for each machine.
set -eu
cd "$(dirname "$0")/.."
python=$1 wanted=$(mktemp)
trap 'rm -f "$wanted"' EXIT
printf '%s\n' 'cmake>=3.22' 'ninja' "torch==$(cat third_party/torch_version)" >"$wanted"
"$python" -c 'import sys
if sys.version_info < (3, 11): import tomli as toml
else: import tomllib as toml
print(*toml.load(open("pyproject.toml", "rb"))["build-system"]["requires"], sep="\n")' >>"$wanted"
left_out=""
for package in torch triton $("$python" -m uv pip compile "$wanted" --universal --python-version 3.10 --no-header --no-annotate --quiet |
  grep -oE '^(nvidia|cuda)-[a-z0-9-]+' | sort -u); do
  left_out="$left_out --no-emit-package $package"
done
# shellcheck disable=SC2086  # a list of words
"$python" -m uv pip compile pyproject.toml "$wanted" --extra test --universal --python-version 3.10 --prerelease disallow \
  --generate-hashes $left_out --no-annotate --custom-compile-command "make lock" --quiet --output-file third_party/requirements.lock
