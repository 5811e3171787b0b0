#!/bin/sh
# Downloads what tests/bench/gpu.sh needs and a machine with CUDA, Python, torch and a C++ compiler may lack.
#   PYTHON_VERSION=3.12 tests/bench/gpu_bundle.sh DIR [HAVE ...]
# HAVE names wheels that the other machine has already (the large ones: numpy scipy pillow cmake ninja); torch is never
# among them. PYTHON_VERSION is that of the other machine (default: this one's). Embree comes as Debian packages, for a
# C library at least as new as this machine's. Where this machine has nvcc, torch and a Python of that version (pythonX.Y, or
# WHEEL_PYTHON), a built wheel of the checkout goes along, with kernels for CUDA_ARCHITECTURES (default: 90).
set -eu
[ $# -ge 1 ] || { sed -n '2,7p' "$0"; exit 2; }
root=$(cd "$(dirname "$0")/../.." && pwd)
mkdir -p "$1"
out=$(cd "$1" && pwd) && shift
python_version=${PYTHON_VERSION:-$(python3 -c 'import sys; print("%d.%d" % sys.version_info[:2])')}

# To build, to train, to test; with what these import. Embree stands for embreex, scikit-image is for `splitnerf relight`.
wheels="pip scikit-build-core pybind11 pathspec packaging cmake ninja
  numpy scipy pillow trimesh OpenImageIO xatlas fast-simplification tomli-w shtab tqdm jinja2 markupsafe
  pytest pluggy iniconfig pygments hypothesis sortedcontainers mpmath"
[ "$python_version" != 3.10 ] || wheels="$wheels tomli exceptiongroup typing-extensions"
platforms="manylinux1_x86_64 manylinux2014_x86_64"
for minor in 17 24 27 28 31 34; do platforms="$platforms manylinux_2_${minor}_x86_64"; done
options=""
for platform in $platforms; do options="$options --platform $platform"; done

rm -rf "$out/wheels" "$out/built" "$out/embree.tar.xz"
mkdir -p "$out/wheels"
wanted=""
for wheel in $wheels; do
  case " $* " in *" $wheel "*) ;; *) wanted="$wanted $wheel" ;; esac
done
# shellcheck disable=SC2086  # lists of words
python3 -m pip --disable-pip-version-check download --quiet --no-deps --only-binary=:all: --implementation cp \
  --python-version "$python_version" $options --dest "$out/wheels" $wanted

packages=$(mktemp -d)
trap 'rm -rf "$packages"' EXIT
needs="--recurse --no-recommends --no-suggests --no-conflicts --no-breaks --no-replaces --no-enhances"
# shellcheck disable=SC2086  # lists of words
embree=$(apt-cache depends $needs libembree-dev | grep -xE 'lib(embree|tbb)[a-z0-9-]*' | sort -u)
# shellcheck disable=SC2086
(cd "$packages" && apt-get download -qq $embree 2>"$packages/said") ||
  { cat "$packages/said" >&2; exit 1; }
for package in "$packages"/*.deb; do dpkg -x "$package" "$packages/unpacked"; done
rm -rf "$packages/unpacked/usr/share" "$packages/unpacked/usr/bin"
(cd "$packages/unpacked" && XZ_OPT=-9 tar cJf "$out/embree.tar.xz" usr)

build_wheel() {
  CMAKE_OPTIONS="SPLITNERF_CUDA=ON CMAKE_CUDA_ARCHITECTURES=${CUDA_ARCHITECTURES:-90-real}" \
    sh "$root/third_party/build_wheels.sh" "$out/built" "$wheel_python"
  "$root/tests/bench/gpu_sources.sh" >"$out/built/sources"
}
wheel_python=$(command -v "${WHEEL_PYTHON:-python$python_version}") || wheel_python=
if [ -n "$wheel_python" ] && python3 -c 'import torch' 2>/dev/null; then build_wheel; else
  echo "no wheel of splitnerf: it takes python$python_version and torch on this machine; the other machine will build it" >&2
fi

ls -s --block-size=K "$out"/wheels/* "$out"/built/*.whl "$out/embree.tar.xz" 2>/dev/null | sort -n | sed "s|$out/||"
du -sm "$out" | sed 's|\t.*| MB in all, without torch|'
