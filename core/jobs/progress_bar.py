# SPDX-License-Identifier: GPL-3.0-or-later
"""Progress bars in terminals and notebooks."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from .progress import Progress


def progress_bar(label: str, total: int | None, unit: str = "frame") -> Any:
    """Return a bar of tqdm, a count without a total: a widget in notebooks that have them, else on a terminal, else none."""
    if "ipykernel" in sys.modules:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # without ipywidgets the bar is text, which needs no advice
            from tqdm.auto import tqdm
        return tqdm(total=total, desc=label, unit=unit, leave=False)
    from tqdm import tqdm

    return tqdm(total=total, desc=label, unit=unit, file=sys.stderr, leave=False, disable=None, dynamic_ncols=True)


@contextmanager
def shown_progress(
    label: str,
    unit: str = "step",
    describe: Callable[[Progress], str] = lambda progress: progress.stage,
    check: Callable[[], object] = lambda: None,
) -> Iterator[Callable[[Progress], None]]:
    """Give a function that shows the progress of a job as a bar.

    Parameters
    ----------
    label : str
        Before the first progress.
    unit : str
        What the job counts.
    describe : callable
        Makes the words beside the bar out of a :class:`.Progress`; the default is its stage.
    check : callable
        Called with each progress, and may raise to stop the job.
    """
    with progress_bar(label, 1, unit) as bar:

        def show(progress: Progress) -> None:
            check()
            bar.total = progress.total
            bar.set_description(describe(progress), refresh=False)
            bar.update(progress.done - bar.n)

        yield show
