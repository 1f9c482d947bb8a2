# SPDX-License-Identifier: GPL-3.0-or-later
"""Look for faults of the data, and put right those that the rig asks for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..dataset.rig import Rig
from ..forward.stimulus import Stimulus, stimulus_of
from .channels import find_channel_faults
from .clocks import find_clock_faults
from .data_fault import DataFault
from .samples import find_sample_faults
from .scales import find_scale_faults


def find_faults(rig: Rig, stimuli: Sequence[Stimulus]) -> list[DataFault]:
    """Return the faults of a rig's data, in the order in which they are put right.

    Parameters
    ----------
    rig : Rig
    stimuli : sequence of Stimulus
        Of the rig's trials.
    """
    judged = [s for s in stimuli if (s.load > 0).any() and s.trial.changes]
    if not judged:
        return []
    faults = find_scale_faults(rig, judged) + find_channel_faults(rig, judged)
    if any(fault.kind == "reversed-channels" for fault in faults):
        return faults  # nothing else can be judged before the channels are those of the texels
    samples = find_sample_faults(judged)
    stuck = {name for fault in samples if fault.kind == "stuck-logger" for name in fault.trials}
    return [*faults, *find_clock_faults(rig, [s for s in judged if s.trial.name not in stuck]), *samples]


def put_right(rig: Rig, stimuli: Sequence[Stimulus]) -> tuple[Rig, list[DataFault]]:
    """Return a rig without the faults that it wants to be put right, and all faults that it had.

    Faults are corrected one by one, and the search is repeated after each, because a fault may hide another one.

    Parameters
    ----------
    rig : Rig
    stimuli : sequence of Stimulus
        Of its trials, in their order.
    """
    done: list[DataFault] = []
    while True:
        found = find_faults(rig, stimuli)
        known = [(fault.kind, name) for fault in done for name in fault.trials]
        fresh = (one for one in found if any((one.kind, name) not in known for name in one.trials))
        fault = next((one for one in fresh if one.kind in rig.correct), None)
        if fault is None:
            return rig, [*done, *found]
        trials = tuple(fault.correct(one) if one.name in fault.trials else one for one in rig.trials)
        rig = replace(rig, trials=trials)
        stimuli = [s if s.trial is trial else stimulus_of(trial, rig) for s, trial in zip(stimuli, trials, strict=True)]
        done.append(replace(fault, put_right=True))
