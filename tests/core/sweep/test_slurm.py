# SPDX-License-Identifier: GPL-3.0-or-later
"""Jobs of SLURM: the script that each gets, and what is said where there is none."""

import re

import pytest

from palpate.core.errors import PalpateError
from palpate.sweep import slurm

pytest.importorskip("dask_jobqueue")


def test_the_script_asks_for_what_was_said_and_starts_a_worker_for_each_core():
    script = slurm.job_script(
        slurm.options_of(["queue=short", "account=tactile", "cores=8", "memory=16GB", "walltime=02:30:00"])
    )
    directives = re.findall(r"^#SBATCH (.*)$", script, re.M)
    assert {"-J palpate", "-p short", "-A tactile", "--cpus-per-task=8", "-t 02:30:00"} <= set(directives)
    (command,) = [line for line in script.splitlines() if "dask_worker" in line]
    words = command.split()
    assert words[words.index("--nworkers") + 1] == "8" and words[words.index("--nthreads") + 1] == "1"
    assert "SCHEDULER" in words
    assert "--mem=15G" in directives and words[words.index("--memory-limit") + 1] == "1.86GiB"  # of eight workers


def test_without_options_a_job_has_one_core():
    assert "--cpus-per-task=1" in slurm.job_script({})


@pytest.mark.parametrize(
    ("word", "said"),
    [("quue=short", "did you mean 'queue'"), ("cores=many", "not a whole number"), ("queue", "is not known")],
)
def test_what_is_misspelt_is_one_sentence(word, said):
    with pytest.raises(PalpateError, match=said):
        slurm.options_of([word])


def test_where_there_is_no_slurm_it_is_said(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(PalpateError, match="has no sbatch"):
        slurm.slurm_cluster({}, 2)


def test_the_jobs_of_a_cluster_have_the_same_script(monkeypatch, tmp_path):
    """A scheduler is started; no job is asked for."""
    (tmp_path / "sbatch").touch(mode=0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    with slurm.slurm_cluster({"cores": 2}, 0) as cluster:
        (command,) = [line for line in cluster.job_script().splitlines() if "dask_worker" in line]
    assert "--nworkers 2 " in command
