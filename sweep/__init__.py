# SPDX-License-Identifier: GPL-3.0-or-later
"""Studies of many runs, in Python that has no Blender; ``pip install .[sweep]`` in a checkout.

The driver (:mod:`.driver`) gives batches of runs to Dask workers. A worker (:mod:`.worker`) writes the runs of a batch into a
file (:mod:`.parts`), so what ends a worker ends neither the study nor other runs.

From these files :mod:`.dataset` makes the dataset and the table of runs, :mod:`.report` the page about them, :mod:`.exports`
other formats.
"""
