# SPDX-License-Identifier: GPL-3.0-or-later
"""Loaded by each worker of this machine's own cluster when it starts (``preload`` of Dask)."""

from __future__ import annotations

import signal
from typing import Any


def dask_setup(_worker: Any) -> None:
    """Leave Ctrl-C to the driver, which stops the workers: a terminal sends it to all, and each would print its stack."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
