# SPDX-License-Identifier: GPL-3.0-or-later
"""What every ring of tests shares: the root of the repository, and how the tiers of docs/testing.md are kept."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

if "PYTEST_XDIST_WORKER" in os.environ:  # before numpy is loaded: there is a worker for each core already
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

QUICK = 2.0
"""Seconds of a processor over which a test of the quick tier has a reason."""


@pytest.fixture(scope="session")
def repository() -> Path:
    """Root of the repository, which is also the root of the extension."""
    return Path(__file__).resolve().parents[1]


def pytest_collection_modifyitems(items):
    """Refuse a marker of a tier that says no reason."""
    for item in items:
        for marker in item.iter_markers():
            if marker.name in ("long", "slow") and not (len(marker.args) == 1 and isinstance(marker.args[0], str)):
                raise pytest.UsageError(f"{item.nodeid}: @pytest.mark.{marker.name} takes a reason, as docs/testing.md says.")


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item):
    """Note what a test takes of the processors, and what the processes take that it started and waited for."""
    item.stash[_BEGAN] = sum(os.times()[:4])
    return (yield)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_makereport(item, call):
    """Hand the time to the process that prints the summary, with the last report of the test."""
    if call.when == "teardown":
        marked = any(item.get_closest_marker(name) for name in ("long", "slow"))
        item.user_properties.append(("processor", sum(os.times()[:4]) - item.stash[_BEGAN]))
        item.user_properties.append(("has_reason", marked))


def pytest_terminal_summary(terminalreporter):
    """List tests over 2 s of a processor without a reason. Nothing fails: a busy machine and an empty cache add to a time."""
    found = []
    for reports in terminalreporter.stats.values():
        for report in reports:
            known = dict(getattr(report, "user_properties", ()))
            if known.get("processor", 0.0) > QUICK and not known["has_reason"]:
                found.append((known["processor"], report.nodeid))
    if found:
        terminalreporter.section(f"over {QUICK:g} s of a processor without a reason: docs/testing.md")
        for seconds, name in sorted(found, reverse=True):
            terminalreporter.write_line(f"{seconds:6.1f} s  {name}")


_BEGAN = pytest.StashKey[float]()
