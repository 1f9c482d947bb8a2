# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m palpate.commands`` is ``palpate``."""

from . import run_process

run_process()
