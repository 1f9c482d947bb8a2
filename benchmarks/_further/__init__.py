# SPDX-License-Identifier: GPL-3.0-or-later
"""Further public recordings of real sensors, models made for each by hand, and a learned one; docs/gap-real.md tells of them."""
