"""scikit-build-core's backend, which asks for torch only where the target environment has none.

torch as a plain build requirement would make every isolated build download several gigabytes, and
compile against another torch than the one that will load the library. The operators need its headers alone
(stable ABI), and third_party/pytorch.cmake finds those of the environment that pip installs into.
"""

from __future__ import annotations

import subprocess
import sys

from scikit_build_core.build import *  # noqa: F403  (a build backend is the set of its hooks)
from scikit_build_core.build import get_requires_for_build_editable as _editable_requires
from scikit_build_core.build import get_requires_for_build_wheel as _wheel_requires


def _torch_requirement() -> list[str]:
    found = any(
        subprocess.run([sys.executable, *flags, "-c", "import torch"], capture_output=True).returncode == 0
        for flags in ([], ["-I"])
    )
    return [] if found else ["torch>=2.11"]


def get_requires_for_build_wheel(config_settings=None):
    return [*_wheel_requires(config_settings), *_torch_requirement()]


def get_requires_for_build_editable(config_settings=None):
    return [*_editable_requires(config_settings), *_torch_requirement()]
