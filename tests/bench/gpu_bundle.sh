#!/bin/sh
# Makes what tests/bench/gpu.sh takes to a machine with CUDA, Python and torch: a wheel of the checkout, and the packages it needs.
#   PYTHON_VERSION=3.12 tests/bench/gpu_bundle.sh DIR [HAVE ...]
# HAVE names packages that the other machine has already (the large ones: numpy scipy pillow); torch is never among them.
# PYTHON_VERSION is that of the other machine (default: this one's). Needs nvcc, a Python of that version (pythonX.Y, or WHEEL_PYTHON)
# and one with torch (TORCH_PYTHON, default: python3). CMAKE_OPTIONS: of the build (default: CUDA on, with kernels for sm_90).
#   tests/bench/gpu_bundle.sh sources   prints a number for the sources, so that a wheel of others is not measured in their place
set -eu
[ $# -ge 1 ] || { sed -n '2,7p' "$0"; exit 2; }
root=$(cd "$(dirname "$0")/../.." && pwd)
numbered() { # what a wheel is made of
  (cd "$root" && find cpp python third_party CMakeLists.txt pyproject.toml -type f ! -name '*.so*' ! -name '*.pyc' ! -path '*/node_modules/*' |
    LC_ALL=C sort | xargs sha256sum | sha256sum | cut -c 1-16)
}
if [ "$1" = sources ]; then numbered; exit; fi
mkdir -p "$1"
out=$(cd "$1" && pwd) && shift
python_version=${PYTHON_VERSION:-$(python3 -c 'import sys; print("%d.%d" % sys.version_info[:2])')}

# To train and to test; with what these import. Embree is in the wheel.
wheels="pip numpy scipy pillow trimesh OpenImageIO xatlas fast-simplification tomli-w tqdm jinja2 markupsafe
  pytest pluggy iniconfig packaging pygments hypothesis sortedcontainers mpmath"
[ "$python_version" != 3.10 ] || wheels="$wheels tomli exceptiongroup typing-extensions"
platforms="manylinux1_x86_64 manylinux2014_x86_64"
for minor in 17 24 27 28 31 34; do platforms="$platforms manylinux_2_${minor}_x86_64"; done
options=""
for platform in $platforms; do options="$options --platform $platform"; done

rm -rf "$out/wheels" "$out/built"
mkdir -p "$out/wheels"
wanted=""
for wheel in $wheels; do
  case " $* " in *" $wheel "*) ;; *) wanted="$wanted $wheel" ;; esac
done
# shellcheck disable=SC2086  # lists of words
python3 -m pip --disable-pip-version-check download --quiet --no-deps --only-binary=:all: --implementation cp \
  --python-version "$python_version" $options --dest "$out/wheels" $wanted

sources=$(numbered) # before the build: what changes meanwhile may not be in it
CMAKE_OPTIONS=${CMAKE_OPTIONS:-SPLITNERF_CUDA=ON CMAKE_CUDA_ARCHITECTURES=90-real} \
  sh "$root/third_party/build_wheels.sh" "$out/built" "${WHEEL_PYTHON:-python$python_version}"
echo "$sources" >"$out/built/sources"
git -C "$root" describe --always --exclude '*' --dirty=+ >"$out/built/commit"
du -sm "$out" | sed 's|\t.*| MB in all, without torch|'
