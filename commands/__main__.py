# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m palpate.commands`` is ``palpate``."""

import sys

from . import main

sys.exit(main())
