"""The numerical tests under every kernel of OpenBLAS that this processor runs, each in a process of its own.

``python -m tests.kernels`` (make kernels) runs them all, with names of kernels or paths of tests only those. What
depends on the processor shows here on one machine: kernels round differently.
"""

from __future__ import annotations

import ctypes
import os
import re
import subprocess
import sys
from pathlib import Path

KERNELS = {  # as OPENBLAS_CORETYPE takes them: what they call themselves, and what of the processor they need
    "Prescott": ("Prescott|Katmai", "pni"),
    "Nehalem": ("Nehalem", "sse4_2"),
    "Sandybridge": ("Sandybridge", "avx"),
    "Haswell": ("Haswell", "avx2 fma"),
    "Zen": ("Zen", "avx2 fma"),
    "SkylakeX": ("SkylakeX", "avx512f avx512dq avx512bw avx512vl avx512cd"),
    "Cooperlake": ("Cooperlake", "avx512f avx512dq avx512bw avx512vl avx512cd avx512_bf16"),
}
NUMERICAL = ("tests/koopman", "tests/simulation", "tests/vehicles", "tests/stages/test_versions.py")
OTHER_KERNEL = 77  # exit status of a process that got another one


def in_use() -> set[str]:
    """The kernels in use by the libraries of numpy and of scipy, which bring an OpenBLAS each."""
    import numpy  # noqa: F401
    import scipy.linalg  # noqa: F401

    found = set()
    for path in set(re.findall(r"/\S*openblas\S*\.so\S*", Path("/proc/self/maps").read_text())):
        library = ctypes.CDLL(path)
        for name in (f"{prefix}openblas_get_corename{suffix}" for prefix in ("scipy_", "") for suffix in ("64_", "")):
            if hasattr(library, name):
                ask = getattr(library, name)
                ask.restype = ctypes.c_char_p
                found.add(ask().decode())
    return found


def here(kernel: str, tests: list[str]) -> int:
    """Run ``tests`` in this process, if it has the ``kernel``."""
    import pytest

    used = in_use()
    if not used or not all(re.fullmatch(KERNELS[kernel][0], name) for name in used):
        print(f"{kernel}: OpenBLAS takes {', '.join(sorted(used)) or 'none'} instead", flush=True)
        return OTHER_KERNEL
    return int(pytest.main(["-p", "no:cacheprovider", *tests]))


def main(names: list[str]) -> int:
    """Run the tests under each kernel; returns how many failed."""
    flags = set(re.findall(r"\S+", Path("/proc/cpuinfo").read_text()))
    said, failed = {}, 0
    tests = [name for name in names if name not in KERNELS] or list(NUMERICAL)
    for kernel in [name for name in names if name in KERNELS] or KERNELS:
        if not flags.issuperset(KERNELS[kernel][1].split()):
            said[kernel] = f"not on this processor, which lacks {KERNELS[kernel][1]}"
            continue
        print(f"{kernel}:", flush=True)
        command = [sys.executable, "-m", "tests.kernels", "--here", kernel, *tests]
        environment = {**os.environ, "OPENBLAS_CORETYPE": kernel, "OPENBLAS_NUM_THREADS": "1"}
        code = subprocess.run(command, env=environment, check=False).returncode
        said[kernel] = {0: "passed", OTHER_KERNEL: "not in this OpenBLAS"}.get(code, "FAILED")
        failed += said[kernel] == "FAILED"
    print("\n".join(f"{kernel:12} {what}" for kernel, what in said.items()))
    if "passed" not in said.values():
        print("no kernel was tried", file=sys.stderr)
        return 1
    return failed


if __name__ == "__main__":
    given = sys.argv[1:]
    sys.exit(here(given[1], given[2:]) if given[:1] == ["--here"] else main(given))
