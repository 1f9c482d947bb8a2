# SPDX-License-Identifier: GPL-3.0-or-later
"""A simulation that goes on from its packed state gives, bit for bit, what it would have given without a break.

Whatever else stands in the place of a state is refused before anything of the simulation has changed.
"""

import copy
import json
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from solver_scenes import box, cube_on_pad, gripper, pressed, shape

from palpate.core.compiled.thread_team import YIELD_ADDRESS
from palpate.core.effects.engine.registry import effect
from palpate.core.jobs.job_runner import run_job
from palpate.core.model.deformation import Deformation
from palpate.core.model.recording import SENSOR_FIELDS
from palpate.core.solver import checkpoint
from palpate.core.solver.simulation import Simulation, solve


def slipping_cube():
    return cube_on_pad(mass=0.3, tilt=0.1, frames=20, sigma0=5.0)


def grasp():
    return gripper(box(0.03, 0.03, 0.04), 0.1, 3.0, np.linspace(0.02, 0.05, 16))


def with_effects():
    """All kinds of memory, chance and mixing."""
    scenario = slipping_cube()
    chosen = (
        effect("load-spreading"),
        effect("hysteresis", "play"),
        effect("creep"),
        effect("gain-mismatch", seed=1),
        effect("lag", "dead-time", time=0.07),
        effect("lag", "second-order", time=0.1),
        effect("drift", "random-walk", seed=2),
        effect("noise", seed=3),
    )
    return replace(scenario, sensors=tuple(replace(sensor, effects=chosen) for sensor in scenario.sensors))


def grasp_of_what_swells():
    """Controllers read their sensors at the beginning of a frame, from surfaces that are where the last frame left them."""
    scenario = gripper(box(0.03, 0.03, 0.04), 0.1, 3.0, np.linspace(0.02, 0.05, 16))
    mesh = shape(trimesh.creation.icosphere(2, 0.018))
    scale = 1.0 + 0.1 * np.sin(np.arange(16))
    swelling = Deformation(np.arange(16) / scenario.fps, scale[:, None, None] * mesh.vertices)
    target = replace(scenario.targets[0], mesh=replace(mesh, vertices=swelling.values[0]), deformation=swelling, smooth=True)
    return replace(scenario, targets=(target,))


def plate_that_is_too_fast(frames=8):
    """It goes through one pad in frame 2 and through the same pad again later; it is said once."""
    path = np.zeros((frames, 3))
    path[:, 2] = np.where(np.arange(frames) % 2 == 0, 0.05, -0.05)
    return pressed(box(0.05, 0.05, 0.002), path, dt=0.01)


def steps_that_are_too_long():
    """There is a warning before the first frame."""
    scenario = cube_on_pad(mass=1e-3, frames=12, dt=5e-3, k=1e5)
    assert len(Simulation(scenario).warnings) == 1
    return scenario


@pytest.mark.parametrize(
    "make", [steps_that_are_too_long, slipping_cube, grasp, with_effects, grasp_of_what_swells, plate_that_is_too_fast]
)
@pytest.mark.parametrize("at", [1, 6])
def test_a_run_goes_on_where_it_was(make, at, tmp_path):
    scenario = make()
    whole = run_job(solve(scenario))
    before = Simulation(scenario)
    frames = [before.observe()]
    frames += [before.advance() for _ in range(at)]
    np.savez(tmp_path / "state.npz", **checkpoint.pack(before))
    after = Simulation(scenario)
    with np.load(tmp_path / "state.npz", allow_pickle=False) as packed:
        checkpoint.unpack(after, packed)
    found = run_job(solve(scenario, after, frames))
    assert found.frames.tolist() == whole.frames.tolist() and found.warnings == whole.warnings
    assert found.poses.tobytes() == whole.poses.tobytes() and found.velocities.tobytes() == whole.velocities.tobytes()
    for name, felt in whole.sensors.items():
        for key in SENSOR_FIELDS:
            assert getattr(found.sensors[name], key).tobytes() == getattr(felt, key).tobytes(), key
    assert whole.sensors and np.isfinite(whole.poses).all()


def test_what_is_packed_is_no_longer_the_simulations():
    """Advancing does not change a state that was packed before."""
    simulation = Simulation(slipping_cube())
    packed = {name: np.array(value) for name, value in checkpoint.pack(simulation).items()}
    again = Simulation(slipping_cube())
    checkpoint.unpack(again, packed)
    for _ in range(3):
        simulation.advance()
    assert again.frame == 1 and again.advance().poses.tobytes() != simulation.observe().poses.tobytes()


def test_a_packed_state_does_not_depend_on_the_threads():
    """The queue of the threads holds the address of a function of this process: it never comes from a file."""
    scenario = slipping_cube()
    alone, together = Simulation(scenario, threads=1), Simulation(scenario, threads=3)
    for simulation in (alone, together):
        simulation.observe()
        simulation.advance()
    packed = checkpoint.pack(together)
    assert checkpoint.digest(packed) == checkpoint.digest(checkpoint.pack(alone))
    again = Simulation(scenario, threads=3)
    before = again.arrays[3].queue[YIELD_ADDRESS : YIELD_ADDRESS + 1].tolist()
    checkpoint.unpack(again, packed)
    assert again.arrays[3].queue[YIELD_ADDRESS : YIELD_ADDRESS + 1].tolist() == before
    assert again.advance().poses.tobytes() == alone.advance().poses.tobytes()


def test_nothing_else_is_carried_from_frame_to_frame():
    """Working memory full of numbers from elsewhere changes nothing."""
    scenario = replace(with_effects(), frame_end=8)
    clean, spoiled = Simulation(scenario), Simulation(scenario)
    for _ in range(3):
        clean.advance(), spoiled.advance()
    again = Simulation(scenario)
    checkpoint.unpack(again, checkpoint.pack(spoiled))
    work = again.arrays[3]
    for part in (work.system, work.pairs, work.drives):
        for array in part:
            array[...] = 0.37
    for array in (work.energy.force, work.energy.work, work.contacts.rows, work.bodies.velocity_before, work.bodies.inertia):
        array[...] = 0.37
    for _ in range(4):
        assert again.advance().poses.tobytes() == clean.advance().poses.tobytes()


# --- what is no state of the simulation


def change_tree(change):
    def damage(packed):
        tree = json.loads(str(packed["tree"]))
        change(tree["object"])
        packed["tree"] = np.array(json.dumps(tree))

    return damage


def change_field(name, change):
    """Change an array of the state."""

    def damage(packed):
        key = json.loads(str(packed["tree"]))["object"]["_state"]["fields"][name]["array"]
        packed[key] = change(packed[key].copy())

    return damage


def put(value, at=0):
    def change(array):
        array.flat[at] = value
        return array

    return change


DAMAGE = {
    "no tree": lambda packed: packed.pop("tree"),
    "not JSON": lambda packed: packed.update(tree=np.array("{")),
    "a list": lambda packed: packed.update(tree=np.array("[]")),
    "deep": lambda packed: packed.update(tree=np.array('{"items":[' * 50_000)),
    "an array missing": lambda packed: packed.pop("array_0"),
    "a part missing": change_tree(lambda tree: tree.pop("_readers")),
    "a part more": change_tree(lambda tree: tree.update(_workspace={"object": {}})),
    "another kind": change_tree(lambda tree: tree.update(_state={"items": []})),
    "readers missing": change_tree(lambda tree: tree.update(_readers={"items": []})),
    "a frame that is none": change_tree(lambda tree: tree.update(frame=10**9)),
    "a frame that is huge": change_tree(lambda tree: tree.update(frame=10**300)),
    "a frame that is text": change_tree(lambda tree: tree.update(frame="4")),
    "a frame that is true": change_tree(lambda tree: tree.update(frame=True)),
    "warnings that are none": change_tree(lambda tree: tree.update(warnings={"items": [7]})),
    "NaN": change_field("position", put(np.nan)),
    "infinite": change_field("velocity", put(-np.inf)),
    "huge": change_field("bristle", put(1e308)),
    "an energy that is none": change_field("stored_energy", put(np.nan)),
    "no rotation": change_field("quaternion", lambda array: 0.0 * array),
    "a triangle far away": change_field("triangle", put(2**40)),
    "one triangle too far": change_field("triangle", put(12, at=3)),
    "a triangle below": change_field("triangle", put(-3)),
    "fewer slots": change_field("triangle", lambda array: array[:-1]),
    "no slots": change_field("bristle", lambda array: array[:0]),
    "more slots": change_field("pressed_share", lambda array: np.append(array, 0.0)),
    "another axis": change_field("position", lambda array: array[..., None]),
    "float32": change_field("position", lambda array: array.astype("f4")),
    "big-endian": change_field("position", lambda array: array.astype(">f8")),
    "text": change_field("position", lambda array: array.astype("U8")),
    "complex": change_field("effect_memory", lambda array: array.astype(complex)),
    "drives that are not there": change_field("drives", lambda array: np.zeros((3, 3))),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_what_is_no_state_is_refused_and_changes_nothing(damage):
    simulation = Simulation(slipping_cube())
    for _ in range(3):
        simulation.advance()
    packed = {name: np.array(value) for name, value in checkpoint.pack(simulation).items()}
    DAMAGE[damage](packed)
    again = Simulation(slipping_cube())
    before = copy.deepcopy(checkpoint.pack(again))
    with pytest.raises((ValueError, KeyError, TypeError, AttributeError, RecursionError)):
        checkpoint.unpack(again, packed)
    assert checkpoint.digest(before) == checkpoint.digest(checkpoint.pack(again))
    assert again.advance().poses.tobytes() == Simulation(slipping_cube()).advance().poses.tobytes()


def test_memory_of_effects_is_checked():
    """A delay whose samples and times are not as many, and a law whose memory is of other texels."""
    simulation = Simulation(with_effects())
    for _ in range(3):
        simulation.advance()
    links = json.loads(str(checkpoint.pack(simulation)["tree"]))["object"]["_readers"]["items"][0]["object"]["_links"]["items"]
    delay = next(link["object"] for link in links if "signal" in link["object"])
    law = next(link["object"] for link in links if "memory" in link["object"])
    for name, change in ((delay["time"]["array"], lambda a: a[:-1]), (law["memory"]["array"], lambda a: a[:-1])):
        packed = checkpoint.pack(simulation)
        packed[name] = change(packed[name])
        with pytest.raises(ValueError):
            checkpoint.unpack(Simulation(with_effects()), packed)
    packed = checkpoint.pack(simulation)
    packed[delay["time"]["array"]] = packed[delay["time"]["array"]][::-1]
    with pytest.raises(ValueError, match="do not follow one another"):
        checkpoint.unpack(Simulation(with_effects()), packed)


def test_a_state_of_another_frame_is_refused():
    simulation = Simulation(slipping_cube())
    simulation.advance()
    with pytest.raises(ValueError, match="is of frame 2, not 5"):
        checkpoint.unpack(Simulation(slipping_cube()), checkpoint.pack(simulation), frame=5)
