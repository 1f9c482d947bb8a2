# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene becomes the Scenario that a person would write down by hand."""

import math

import bpy
import numpy as np
import pytest
from blender_scenes import ball, cube, grid, keyframe, press, reading_of, scenario_of
from mathutils import Quaternion

from palpate.addon.scene import scene_fingerprint
from palpate.addon.session import transforms
from palpate.core.errors import SceneError
from palpate.core.geometry.mesh import face_normals
from palpate.core.solver.simulation import run


def of(scenario, name):
    index = next(i for i, body in enumerate(scenario.bodies) if body.name == name)
    target = next((t for t in scenario.targets if t.body == index), None)
    sensor = next((s for s in scenario.sensors if s.body == index), None)
    return scenario.bodies[index], target or sensor


def test_roles_parameters_and_motion():
    scene, pad, target = press(frames=5)
    pad.palpate.k, pad.palpate.cn, pad.palpate.unit = 1000.0, 10.0, "mV"
    scene.render.fps, scene.render.fps_base = 30, 1.001
    scene.frame_set(3)
    reading = reading_of(scene)
    scenario = reading.scenario
    assert scene.frame_current == 3
    assert [s.name for s in scenario.sensors] == ["Pad"] and [t.name for t in scenario.targets] == ["Ball"]
    parameters = scenario.sensors[0].parameters
    assert (parameters.k, parameters.cn, parameters.unit) == (1000.0, 10.0, "mV")
    assert parameters.sigma1 == 0.1  # what was typed, not its 32-bit neighbour
    assert scenario.gravity.tolist() == [0.0, 0.0, -9.81]
    assert scenario.fps == pytest.approx(29.97003, abs=1e-5)
    body, _ = of(scenario, "Ball")
    assert body.motion.times == pytest.approx(np.arange(5) / scenario.fps)
    heights = []
    for frame in range(1, 6):
        scene.frame_set(frame)
        heights.append(target.matrix_world.translation.z)
    assert body.motion.positions[:, 2].tolist() == heights
    assert reading.objects(scene) == [pad, target]


@pytest.mark.parametrize("scale", [(2.0, 2.0, 2.0), (1.0, 2.0, 0.5), (-1.0, 1.0, 1.0), (1.0, -2.0, 3.0), (-1.0, -1.0, -1.0)])
@pytest.mark.parametrize("of_parent", [(1.0, 1.0, 1.0), (2.0, 0.5, 1.0)], ids=["", "sheared"])
def test_scale_and_shear_are_in_the_vertices(scale, of_parent):
    """Wherever the scale is split off, the world position of every vertex stays, and normals point outwards."""
    scene, _, target = press()
    target.animation_data_clear()
    bpy.ops.object.empty_add(rotation=(0.0, 0.0, 0.7))
    target.parent = bpy.context.object
    target.parent.scale = of_parent
    target.scale = scale
    target.rotation_euler = (0.3, -0.2, 0.9)
    scene.view_layers[0].update()
    reading = reading_of(scene)
    assert ("mirrors" in " ".join(reading.warnings)) == (np.prod(scale) < 0)
    body, found = of(reading.scenario, "Ball")
    world = found.mesh.vertices @ transforms.rotation(body.motion.quaternions[0]).T + body.motion.positions[0]
    expected = np.array([target.matrix_world @ vertex.co for vertex in target.data.vertices])
    assert world == pytest.approx(expected, abs=1e-7)
    centres = found.mesh.vertices[found.mesh.triangles].mean(axis=1)
    assert (np.einsum("ij,ij->i", face_normals(found.mesh), centres) > 0).all()


def test_a_target_with_faces_that_point_inwards_presses_as_one_without():
    """Before, it read 0 N, and the advice was to reduce the depth."""
    scene, _, target = press(4)
    before = run(scenario_of(scene)).sensors["Pad"].normal_force[-1].sum()
    target.data.flip_normals()
    reading = reading_of(scene)
    assert "The faces of 'Ball' point inwards" in " ".join(reading.warnings)
    assert before > 0.01 and run(reading.scenario).sensors["Pad"].normal_force[-1].sum() == pytest.approx(before, rel=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_quaternions_agree_with_blenders(seed):
    rng = np.random.default_rng(seed)
    q = rng.normal(size=4)
    q /= np.linalg.norm(q)
    matrix = transforms.as_array(Quaternion(q).to_matrix().to_4x4())
    location, found, stretch = transforms.decompose(matrix)
    assert found == pytest.approx(q if q[0] >= 0 else -q, abs=1e-6)
    assert stretch == pytest.approx(np.eye(3), abs=1e-6)
    assert transforms.rotation(found) == pytest.approx(matrix[:3, :3], abs=1e-6)


def test_flat_matrices_are_told_by_their_smallest_size():
    rng = np.random.default_rng(2)
    for _ in range(300):
        left, _, right = np.linalg.svd(rng.normal(size=(3, 3)))
        size = 10.0 ** rng.uniform(-3, 3) * 10.0 ** np.array([0.0, rng.uniform(-6, 0), rng.uniform(-9, 0)])
        matrix = np.eye(4)
        matrix[:3, :3] = left @ np.diag(size) @ right
        share = size.min() / size.max()
        if not 0.99e-6 < share < 1.01e-6:
            assert transforms.is_singular(matrix) == (share < 1e-6)
    assert transforms.is_singular(np.zeros((4, 4)))


@pytest.mark.parametrize("axis", range(3))
def test_half_turns_have_a_quaternion(axis):
    expected = np.zeros(4)
    expected[1 + axis] = 1.0
    assert np.abs(transforms.decompose(transforms.pose_matrix(np.zeros(3), expected))[1]) == pytest.approx(expected)


def test_scale_that_changes_for_no_known_reason_is_named_with_its_frame():
    scene, _, target = press(frames=5)
    bpy.ops.object.empty_add()
    empty = bpy.context.object
    keyframe(empty, "scale", {1: (1.0, 1.0, 1.0), 5: (2.0, 1.0, 1.0)})
    target.constraints.new("COPY_SCALE").target = empty
    scene.frame_set(4)
    with pytest.raises(SceneError, match=r"scale of 'Ball' changes \(frame 2\)"):
        reading_of(scene)
    assert scene.frame_current == 4


def test_hidden_objects_take_no_part_and_are_mentioned():
    scene, _, target = press()
    other = ball("Hidden")
    other.palpate.role = "TARGET"
    for hide in (lambda on: other.hide_set(on), lambda on: setattr(other, "hide_viewport", on)):
        hide(True)
        reading = reading_of(scene)
        assert [t.name for t in reading.scenario.targets] == ["Ball"]
        assert reading.warnings == ("'Hidden' is hidden and is not part of the simulation.",)
        hide(False)
    assert len(scenario_of(scene).targets) == 2


def test_modifiers_count():
    scene, pad, target = press()
    target.modifiers.new("Half", "DECIMATE").ratio = 0.5
    wave = pad.modifiers.new("Bend", "SIMPLE_DEFORM")
    wave.deform_method, wave.deform_axis, wave.angle = "BEND", "Z", math.radians(30)
    reading = reading_of(scene)
    scenario = reading.scenario
    assert len(of(scenario, "Ball")[1].mesh.vertices) < len(target.data.vertices)
    assert np.ptp(scenario.sensors[0].texels.position[:, 2]) + np.ptp(scenario.sensors[0].texels.position[:, 1]) != 0.05
    assert reading.warnings == ()
    pad.modifiers.new("More", "SUBSURF")
    reading = reading_of(scene)
    assert len(reading.scenario.sensors[0].texels) == 84
    assert "number of vertices of sensor 'Pad'" in reading.warnings[0]


def test_a_free_body_has_mass_and_inertia():
    scene, _, target = press()
    box = cube(size=0.02)
    box.palpate.role, box.palpate.body, box.palpate.mass = "TARGET", "FREE", 3.0
    box.palpate.velocity = (0.0, 0.0, -1.0)
    body, _ = of(scenario_of(scene), "Cube")
    assert body.free and body.mass == 3.0
    assert body.inertia == pytest.approx(np.eye(3) * 3.0 * 0.02**2 / 6, rel=1e-6, abs=1e-12)
    assert body.velocity.tolist() == [0.0, 0.0, -1.0]


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda pad, box: box.keyframe_insert("location", frame=1), "'Cube' has keyframes"),
        (lambda pad, box: setattr(pad, "parent", box), "'Pad' is a child of free body 'Cube': set its body to Part of Parent"),
    ],
    ids=["keyframes", "child"],
)
def test_what_forces_cannot_move_is_refused(spoil, says):
    scene, pad, _ = press()
    box = cube()
    box.palpate.role, box.palpate.body = "TARGET", "FREE"
    spoil(pad, box)
    with pytest.raises(SceneError, match=says):
        reading_of(scene)


def test_a_pad_is_not_read_out():
    scene, *_ = press()
    table = grid("Table", (0.1, 0.0, 0.0))
    table.palpate.role = "PAD"
    assert [(s.name, s.readout) for s in scenario_of(scene).sensors] == [("Pad", True), ("Table", False)]


def pushed_down(obj):
    """Move the action of an object to an NLA strip, and return the strip's track."""
    data = obj.animation_data
    action, slot = data.action, getattr(data, "action_slot", None)
    track = data.nla_tracks.new()
    strip = track.strips.new("Strip", 1, action)
    if slot is not None:
        strip.action_slot = slot
    data.action = None
    return track


@pytest.mark.parametrize(
    ("setting", "is_refused"), [({}, True), ({"mute": True}, False), ({"mute": True, "is_solo": True}, True)]
)
def test_a_free_body_that_an_nla_strip_moves_is_refused(setting, is_refused):
    scene, _, target = press(frames=4)
    target.animation_data_clear()
    target.palpate.body, target.palpate.mass = "FREE", 0.1
    target.keyframe_insert("location", frame=1)
    track = pushed_down(target)
    for name, value in setting.items():
        setattr(track, name, value)
    if is_refused:
        with pytest.raises(SceneError, match="keyframes, drivers or NLA strips of its .delta. location"):
            reading_of(scene)
    else:
        reading_of(scene)


@pytest.mark.parametrize("path", ["location", "rotation_euler", "delta_location", "delta_rotation_quaternion"])
def test_a_free_body_that_keyframes_move_is_refused(path):
    scene, _, target = press(frames=4)
    target.animation_data_clear()
    target.palpate.body, target.palpate.mass = "FREE", 0.1
    reading_of(scene)
    target.keyframe_insert(path, frame=1)
    with pytest.raises(SceneError, match="keyframes, drivers or NLA strips of its .delta. location"):
        reading_of(scene)


def test_a_scale_that_an_nla_strip_animates_is_that_of_its_keyframes():
    scene, _, target = press(frames=6)
    keyframe(target, "scale", {1: (1.0, 1.0, 1.0), 6: (1.2, 0.9, 1.4)})
    scene.frame_set(1)
    keyed = scenario_of(scene).targets[0].deformation.values
    pushed_down(target)
    np.testing.assert_array_equal(scenario_of(scene).targets[0].deformation.values, keyed)
    fingerprints = set()
    for frame in (1, 4):
        scene.frame_set(frame)
        fingerprints.add(scene_fingerprint.fingerprint(scene))
    assert len(fingerprints) == 1
