"""Memory that large arrays held, after these are freed with small ones left between them."""

from __future__ import annotations

import os
import platform
import subprocess
import sys

import pytest

HELD = """
import sys
import numpy as np
from freqid.core.memory import give_back_large_arrays

def resident():
    with open("/proc/self/statm") as f:
        return int(f.read().split()[1]) * 4096 / 2**20

if sys.argv[1] == "given":
    give_back_large_arrays()
whole = np.ones(30 * 2**17)
del whole  # from here on the library's own threshold is 30 MB
before, large, small = resident(), [], []
for _ in range(40):
    large.append(np.ones(8 * 2**17))
    small.append(np.ones(2**12))
del large
print(resident() - before)
"""


def held(how):
    env = {n: x for n, x in os.environ.items() if not n.startswith("MALLOC_")}
    run = subprocess.run(
        [sys.executable, "-c", HELD, how], env=env, capture_output=True, text=True, check=True
    )
    return float(run.stdout)


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another C library")
def test_what_large_arrays_held_goes_back():
    assert held("kept") > 200  # MB of 320: what this is for
    assert held("given") < 20
