# SPDX-License-Identifier: GPL-3.0-or-later
"""Studies of many runs, in Python that has no Blender; ``pip install .[sweep]`` in a checkout.

The driver (:mod:`.driver`) gives batches of runs to Dask workers; a worker (:mod:`.worker`) passes them to a process of its own
(:mod:`.child`), so that what ends a run ends neither a worker nor the study. What is done is known from files
(:mod:`..core.study.run_files`).

From these files :mod:`.dataset` makes the dataset and the table of runs, :mod:`.report` the page about them, :mod:`.exports`
other formats.
"""
