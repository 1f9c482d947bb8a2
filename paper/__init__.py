# SPDX-License-Identifier: GPL-3.0-or-later
"""The paper's experiments, run again: each module here is one of them, and :mod:`.page` puts our numbers beside the print."""
