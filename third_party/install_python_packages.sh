#!/bin/sh
# Makes the virtual environment and brings into it torch, and what third_party/requirements.lock names, which pip checks by hashes.
#   install_python_packages.sh PYTHON VENV
set -eu
python=$1 venv=$2 here=$(dirname "$0")
torch=$(cat "$here/torch_version")

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
$pip install --quiet --no-deps --require-hashes -r "$here/requirements.lock"
