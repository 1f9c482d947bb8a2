# SPDX-License-Identifier: GPL-3.0-or-later
"""What every ring of tests shares."""

from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def repository() -> Path:
    """Root of the repository, which is also the root of the extension."""
    return Path(__file__).resolve().parents[1]
