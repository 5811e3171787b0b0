#!/bin/sh
# Makes the virtual environment and brings torch and the build tools into it.
#   install_python_packages.sh PYTHON VENV
set -eu
python=$1 venv=$2 torch=2.13.0

if [ ! -x "$venv/bin/python" ]; then
  # A torch that the system's Python has already is kept.
  shared=""
  "$python" -c "import torch" 2>/dev/null && shared="--system-site-packages"
  "$python" -m venv $shared "$venv"
fi
pip="$venv/bin/python -m pip --disable-pip-version-check"

if ! "$venv/bin/python" -c "import torch" 2>/dev/null; then
  if command -v nvidia-smi >/dev/null 2>&1 && nvidia-smi >/dev/null 2>&1; then
    $pip install --quiet "torch>=2.11"
  else
    # The CPU build: from the indexes that pip is set up with, else from PyTorch's own.
    $pip install --quiet "torch==$torch+cpu" 2>/dev/null ||
      $pip install --quiet "torch==$torch" --extra-index-url https://download.pytorch.org/whl/cpu
  fi
fi
$pip install --quiet "scikit-build-core>=0.10" "pybind11>=2.13" "cmake>=3.22" ninja
