"""What the machine's dgemm does on one thread: ``python dgemm.py`` prints its best rate as JSON."""

from __future__ import annotations

import json
import time

import numpy as np

SIZE, TRIES = 2000, 7

a = np.random.default_rng(0).standard_normal((SIZE, SIZE))
b = a[::-1].copy()
seconds = []
for _ in range(TRIES):
    begin = time.process_time()
    np.matmul(a, b)
    seconds.append(time.process_time() - begin)
print(json.dumps({"rate": 2 * SIZE**3 / min(seconds)}))
