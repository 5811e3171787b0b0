#!/bin/sh
# Installs the system packages that the build needs, where apt can; elsewhere says what to run.
set -eu

# Each needed thing: a test for it and the Debian package that brings it.
missing=""
need() { sh -c "$1" >/dev/null 2>&1 || missing="$missing $2"; }
need 'command -v c++' g++
need 'command -v python3' python3
need 'python3 -c "import ensurepip, venv"' python3-venv
need 'python3 -c "import sysconfig, os; assert os.path.exists(os.path.join(sysconfig.get_paths()[\"include\"], \"Python.h\"))"' python3-dev
need 'ls /usr/include/embree*/rtcore.h /usr/local/include/embree*/rtcore.h 2>/dev/null | grep -q .' libembree-dev
need 'ls /usr/include/gtest/gtest.h /usr/local/include/gtest/gtest.h 2>/dev/null | grep -q .' libgtest-dev
[ -n "$missing" ] || exit 0
command -v ccache >/dev/null 2>&1 || missing="$missing ccache"  # not needed, but the tests then compile the core no second time

run=""
if [ "$(id -u)" != 0 ]; then
  if sudo -n true 2>/dev/null; then run="sudo"; else run="no"; fi
fi
if ! command -v apt-get >/dev/null 2>&1 || [ "$run" = no ]; then
  echo "splitnerf needs these system packages first:$missing" >&2
  echo "  sudo apt-get install$missing" >&2
  exit 2
fi
echo "installing$missing" >&2
$run apt-get update -qq
DEBIAN_FRONTEND=noninteractive $run apt-get install -y -qq --no-install-recommends $missing >/dev/null
