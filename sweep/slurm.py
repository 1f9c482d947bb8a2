# SPDX-License-Identifier: GPL-3.0-or-later
"""Workers as jobs of SLURM, by dask-jobqueue; ``pip install .[slurm]`` in a checkout.

What a cluster wants said, such as its queue and account, stands in Dask's own file ``~/.config/dask/jobqueue.yaml`` or is given
with the command.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from typing import Any

from ..core.errors import PalpateError, did_you_mean, imported

OPTIONS: dict[str, type] = {
    "queue": str,
    "account": str,
    "cores": int,
    "memory": str,
    "walltime": str,
    "interface": str,
    "local_directory": str,
    "python": str,
}
"""Words of ``--slurm-option``, which are those of dask-jobqueue."""
DEFAULTS: dict[str, Any] = {"cores": 1, "memory": "2GB"}
"""Of a job, where neither the command nor Dask's file says otherwise; half an hour is dask-jobqueue's own."""


def options_of(words: list[str]) -> dict[str, Any]:
    """Return the options that ``NAME=VALUE`` say.

    Raises
    ------
    PalpateError
        A name is not known, or a number is none.
    """
    found: dict[str, Any] = {}
    for word in words:
        name, separator, value = word.partition("=")
        if name not in OPTIONS or not separator or not value:
            advice = did_you_mean(name, OPTIONS, f"write NAME=VALUE with {', '.join(OPTIONS)}.")
            raise PalpateError(f"--slurm-option {word!r:.60} is not known: {advice}")
        if OPTIONS[name] is int and not (value.isdigit() and int(value) > 0):
            raise PalpateError(f"--slurm-option {word!r:.60} is not a whole number above zero: write {name}=4.")
        found[name] = OPTIONS[name](value)
    return found


def job_script(options: Mapping[str, Any]) -> str:
    """Return the script that SLURM would get for each job; ``SCHEDULER`` stands for the driver's address."""
    _require()
    from dask_jobqueue.slurm import SLURMJob

    return str(SLURMJob(scheduler="SCHEDULER", name="palpate", **_words(options)).job_script())


def slurm_cluster(options: Mapping[str, Any], jobs: int) -> Any:
    """Return a cluster whose workers are jobs of SLURM, and ask for the jobs; the scheduler runs in this process.

    Raises
    ------
    PalpateError
        dask-jobqueue is missing, or this machine has no SLURM.
    """
    _require()
    if shutil.which("sbatch") is None:
        raise PalpateError("This machine has no sbatch: give the command on a login node of the cluster, or leave --slurm out.")
    from dask_jobqueue import SLURMCluster

    cluster = SLURMCluster(scheduler_options={"dashboard_address": None}, **_words(options))
    cluster.scale(jobs=jobs)
    return cluster


def _words(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments of dask-jobqueue: each core gets a process of one thread, as on one machine."""
    import dask

    known = dask.config.get("jobqueue.slurm", {}) or {}
    merged = {name: value for name, value in DEFAULTS.items() if known.get(name) is None} | dict(options)
    return {"job_name": "palpate", "processes": merged.get("cores", known.get("cores")), **merged}


def _require() -> None:
    imported("dask_jobqueue", "--slurm", "run 'pip install .[slurm]' in a checkout of Palpate")
