#!/bin/sh
# Prints a number for what a wheel is made of, so that a wheel of other sources is not measured in their place.
cd "$(dirname "$0")/../.."
find cpp python third_party CMakeLists.txt pyproject.toml -type f ! -name '*.so*' ! -name '*.pyc' ! -path '*/node_modules/*' | LC_ALL=C sort |
  xargs sha256sum | sha256sum | cut -c 1-16
