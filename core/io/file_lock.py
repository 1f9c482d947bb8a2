# SPDX-License-Identifier: GPL-3.0-or-later
"""A lock on an open file, which the operating system releases when the process ends, however it ends."""

from __future__ import annotations

import os


def try_lock(handle: int) -> bool:
    """Lock an open file for this process alone.

    Parameters
    ----------
    handle : int
        File descriptor.

    Returns
    -------
    bool
        False if somebody else holds a lock on it. True where locks are not supported, as on some network file systems.
    """
    if os.name == "nt":
        import msvcrt

        try:
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
        except OSError:
            return False
        return True
    import fcntl

    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        pass
    return True
