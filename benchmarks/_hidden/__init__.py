# SPDX-License-Identifier: GPL-3.0-or-later
"""Recordings of sensors that do not exist, in which something is hidden, to find out whether ``palpate gap`` finds it.

Nothing of the package is imported here: contact, friction and effects are written down a second time, from their literature,
so that a mistake in the library cannot hide itself. :mod:`.world` is the sensor and the indenter, :mod:`.other` has
effects in formulas that the library does not have, :mod:`.own` in those that it has, :mod:`.third` in further ones on which no
rule was ever set, :mod:`.cases` draws cases and writes rigs.
"""
