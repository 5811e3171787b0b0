#!/bin/sh
# Builds wheels for Linux on aarch64 on a Debian of another processor, with its cross compiler (apt-get install g++-aarch64-linux-gnu).
#   build_aarch64_wheels.sh DIR [PYTHON ...]   (as build_wheels.sh)
# Embree comes from this Debian's arm64 packages, torch from PyPI; both go to a temporary folder, and nothing is installed.
# TORCH: the release of torch whose headers serve all wheels (default: that of torch_version).
set -eu
[ $# -ge 1 ] || { sed -n '2,5p' "$0"; exit 2; }
third_party=$(cd "$(dirname "$0")" && pwd)
command -v aarch64-linux-gnu-g++ >/dev/null || { echo "the cross compiler is missing: apt-get install g++-aarch64-linux-gnu" >&2; exit 2; }
CROSS=$(mktemp -d)
export CROSS
trap 'rm -rf "$CROSS"' EXIT

# An apt of its own: this machine's packages and architectures stay as they are. An empty status brings all that Embree needs.
mkdir -p "$CROSS/apt/lists/partial" "$CROSS/apt/archives/partial"
: >"$CROSS/apt/status"
apt() {
  apt-get -qq -o APT::Architecture=arm64 -o APT::Architectures=arm64 -o APT::Sandbox::User=root -o Dir::State::status="$CROSS/apt/status" \
    -o Dir::State::Lists="$CROSS/apt/lists" -o Dir::Cache="$CROSS/apt" "$@"
}
apt update
apt install --yes --download-only --no-install-recommends libembree-dev
for package in "$CROSS"/apt/archives/*.deb; do dpkg -x "$package" "$CROSS"; done

"${2:-python3}" -m pip --disable-pip-version-check install --quiet --no-deps --only-binary :all: --platform manylinux_2_28_aarch64 \
  --python-version 3.12 --target "$CROSS" "torch==${TORCH:-$(cat "$third_party/torch_version")}"
sh "$third_party/build_wheels.sh" "$@"
