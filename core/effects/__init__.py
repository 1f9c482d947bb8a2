# SPDX-License-Identifier: GPL-3.0-or-later
"""What real sensors add to the base model: one file per effect, all of the same shape (see :mod:`.specification`)."""
