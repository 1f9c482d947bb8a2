# SPDX-License-Identifier: GPL-3.0-or-later
"""Write what `palpate gap` leaves behind (docs/gap.md): gap.json, sensor.toml, report.html, pictures, the next trajectory."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ...errors import PalpateError
from ...io.file_writing import write_text
from ...io.hidden_folder import FileList
from ...io.sensor_toml import write_sensor
from ...jobs import Job, Progress, part_of_job
from ..base.quantities import FORCES, READINGS, friction_kinds
from ..fitting.least_squares import BASE, RECORDING
from ..forward.predictor import Model
from ..planning.experiment_plan import PlannedExperiment, plan_after
from ..selection.check_recordings import CheckedRecording
from ..selection.findings import Diagnosis, Finding
from .amended_sensor import amended_sensor, with_mean_gain_moved
from .comparison import USES, GapErrors, check_errors, closed_share, error_location, recording_differences, recording_errors
from .html_report import html_report
from .plan_files import NEXT_TRAJECTORY, experiment_words, write_trajectory
from .plots import FILE_TYPES, draw
from .sentences import headline, next_experiment, warnings

FORMAT = "palpate-gap/1"


def summary(
    result: Diagnosis, errors: GapErrors, experiment: PlannedExperiment | None = None, notes: Sequence[str] = ()
) -> dict[str, Any]:
    """Return the contents of gap.json, with notes among its warnings."""
    model = with_mean_gain_moved(result)
    base, closed = _intervals(result, BASE), _closed(result, errors)
    without_effects = [item.name for item in result.base.free if item.effect == BASE]
    return {
        "format": FORMAT,
        "name": result.rig.name,
        "verdict": result.verdict,
        "found": [_found(one, model, result, errors) for one in result.findings],
        "between_recordings": _between(result),
        "base": {
            "parameters": {name: getattr(model.parameters, name) for name in base},
            "intervals": base,
            "without_effects": {name: getattr(result.base.model.parameters, name) for name in without_effects},
            "gap_without_friction": errors.frictionless,
        },
        "recordings": {"numbers": dict(model.recordings), "intervals": _intervals(result, RECORDING)},
        "gap": {"before": errors.base, "after": errors.amended, "noise_floor": errors.noise_floor, "closed": closed},
        "fitted": recording_errors(result, "fit"),
        "check": [_checked(one, result) for one in result.check.recordings],
        "where": error_location(result, result.base.model),
        "varies_with": {key: round(value, 4) for key, value in result.base_structure.shares.items()},
        "left_varies_with": {key: round(value, 4) for key, value in result.structure.shares.items()},
        "ruled_out": [{"effect": name, "why": why} for name, why in result.ruled_out],
        "ambiguous": [list(names) for names in result.ambiguous],
        "next_experiment": next_experiment(result),
        "planned_experiment": None if experiment is None else experiment_words(experiment, NEXT_TRAJECTORY),
        "data_faults": [
            {"kind": fault.kind, "trials": list(fault.trials), "evidence": fault.evidence, "put_right": fault.put_right}
            for fault in result.faults
        ],
        "warnings": [*result.rig.warnings, *warnings(result), *notes],
    }


def _intervals(result: Diagnosis, effect: int) -> dict[str, list[float]]:
    """Ends of the intervals of an effect's parameters, or of those of the base model or the recordings, by name."""
    return {one.name: [one.low, one.high] for one in result.intervals if one.effect == effect}


def _between(result: Diagnosis) -> dict[str, Any] | None:
    """How the recordings differ, by levels and gains of their own; None if they need none."""
    if (one := result.carried_over) is not None:
        return {"effect": one.name, "form": "one session in the order of the rig", "confidence": one.confidence}
    if (own := result.between) is None:
        return None
    return {
        "effect": None,
        "form": "a factor and a zero of each recording",
        "factors": own.factors,
        "zeros": own.zeros,
        "closes": round(own.closes, 4),
        "gap_before": own.before,
        "confidence": own.confidence,
    }


def _closed(result: Diagnosis, errors: GapErrors) -> dict[str, Any] | None:
    """Shares of the squared gap that are closed, of readings or else of forces; None without a gap, or if nothing was found.

    They are those of the quantity by which an effect was judged. Levels and gains of recordings count as found: the shares are
    then those of the errors, and nothing is known of left-out parts.
    """
    if result.between is not None:
        shares = {use: closed_share(errors.base[use], errors.amended[use], errors.noise_floor) for use in USES}
        known = [share for share in shares.values() if share is not None]
        return {"fit": shares["fit"], "left_out": None, "check": shares["check"], "least": min(known)} if known else None
    only_friction = all(one.name in friction_kinds() for one in result.findings)
    order = (FORCES, READINGS) if only_friction else (READINGS, FORCES)
    quantity = next((q for q in order if result.closed.least(q) is not None), None)
    if quantity is None or not result.findings:
        return None
    parts = {"fit": result.closed.fitted, "left_out": result.closed.left_out, "check": result.closed.check}
    shares = {name: None if part[quantity] is None else round(float(part[quantity] or 0.0), 4) for name, part in parts.items()}
    return shares | {"least": min(share for share in shares.values() if share is not None)}


def _checked(one: CheckedRecording, result: Diagnosis) -> dict[str, Any]:
    """One entry under ``check`` in gap.json: errors of one check recording, and what differs if it speaks against the model."""
    names = {"readings": READINGS, "forces": FORCES}
    errors = {name: check_errors(result, one, quantity)[:2] for name, quantity in names.items() if one.count[quantity]}
    against = one.is_worse(READINGS) or one.is_worse(FORCES)
    differs = recording_differences(result, one.name) if against and result.findings else []
    return {"trial": one.name, "errors": errors, "worse": against, "differs": differs}


def _found(one: Finding, model: Model, result: Diagnosis, errors: GapErrors) -> dict[str, Any]:
    """One entry under ``found`` in gap.json."""
    effect = model.effects[one.effect]
    return {
        "effect": one.name,
        "form": one.form,
        "parameters": {key: list(value) if isinstance(value, tuple) else value for key, value in effect.values.items()},
        "intervals": _intervals(result, one.effect),
        "confidence": one.confidence,
        "closes": one.closes,
        "unsettled": list(one.unsettled),
        "doubts": list(one.doubts),
        "gap_before": errors.stages[one.effect],
        "gap_after": errors.stages[one.effect + 1],
        "next_best": {"effect": one.next_best, "leaves": round(one.leaves, 3)} if one.next_best else None,
    }


def write_report(result: Diagnosis, folder: Path, errors: GapErrors) -> Job[None]:
    """Write everything into a folder. All files of an earlier report there are replaced together (:class:`.FileList`).

    Parameters
    ----------
    result : Diagnosis
    folder : Path
    errors : GapErrors
        Of the result.

    Yields
    ------
    Progress

    Raises
    ------
    FileError
        The folder cannot be written to.
    """
    files = FileList(folder)
    with files.new_files("report") as new:
        yield Progress("writing the amended sensor", 0, 1000)
        write_sensor(new / "sensor.toml", amended_sensor(result))
        pictures = yield from part_of_job(
            draw(result, errors, new), lambda step: Progress(step.stage, 100 + 500 * step.done // step.total, 1000)
        )
        notes: list[str] = []
        try:
            experiment = yield from part_of_job(
                plan_after(result), lambda step: Progress(step.stage, 600 + 300 * step.done // step.total, 1000)
            )
        except PalpateError as error:  # what was found stands without a plan
            experiment, notes = None, [f"No further recording was planned: {error}"]
        yield Progress("writing the report", 900, 1000)
        found = summary(result, errors, experiment, notes)
        write_text(new / "report.html", html_report(result, found, headline(result, errors), pictures, new))
        write_text(new / "gap.json", json.dumps(found, indent=2, ensure_ascii=False, allow_nan=False) + "\n")
        made = [f"{name}.{kind}" for name in pictures for kind in FILE_TYPES]
        if experiment is not None:
            write_trajectory(experiment.trajectory, new / NEXT_TRAJECTORY)
            made.append(NEXT_TRAJECTORY)
        files.replace(new, {"gap": [new / name for name in ("sensor.toml", *made, "report.html", "gap.json")]})
    yield Progress("done", 1000, 1000)
