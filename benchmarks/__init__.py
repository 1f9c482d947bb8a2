# SPDX-License-Identifier: GPL-3.0-or-later
"""Benchmarks: each module with a `run()` is a group; see `python -m benchmarks --help`."""
