# SPDX-License-Identifier: GPL-3.0-or-later
"""Targets get their shapes from mesh files, which the study's folder keeps."""

import numpy as np
import pytest
import trimesh
from study_scenes import BALL_RADIUS, HEAD, tiny_scene

from palpate.core.errors import PalpateError, ParameterError
from palpate.core.geometry.mesh import mass_properties
from palpate.core.io.input_files import load_mesh
from palpate.core.study.design import columns_of, find_meshes, freeze_meshes
from palpate.core.study.study_file import Runs, plan_for, read_study
from palpate.core.study.variation import varied_scenario

STUDY = HEAD + 'design = "grid"\n[vary]\n"Ball.mesh" = { choice = ["shapes/*.stl", "cone.ply"] }\n'


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "shapes").mkdir()
    trimesh.creation.icosphere(2, BALL_RADIUS).export(tmp_path / "shapes" / "ball.stl")
    trimesh.creation.box((0.01, 0.02, 0.03)).export(tmp_path / "shapes" / "box.stl")
    trimesh.creation.cone(0.01, 0.02).export(tmp_path / "cone.ply")
    (tmp_path / "study.toml").write_text(STUDY, encoding="utf-8")
    return tmp_path


def plan_in(folder):
    study = read_study(folder / "study.toml")
    return study, plan_for(study, tiny_scene(), meshes=freeze_meshes(find_meshes(study.vary, folder), folder / "kept"))


def test_a_pattern_stands_for_its_files_and_runs_do_not_need_them(folder):
    study, plan = plan_in(folder)
    names = columns_of(study.design, plan.varied)["Ball.mesh"].tolist()
    assert names == ["shapes/ball.stl", "shapes/box.stl", "cone.ply"]
    for file in ("shapes/ball.stl", "shapes/box.stl", "cone.ply"):
        (folder / file).unlink()
    box = varied_scenario(plan.scenario, {"Ball.mesh": "shapes/box.stl", "Ball.scale": 0.5}, None, plan.meshes).targets[0].mesh
    np.testing.assert_allclose(np.ptp(box.vertices, axis=0), (0.005, 0.01, 0.015), rtol=1e-6)  # STL has 32-bit numbers
    assert len(box.vertices) == 8  # STL repeats them for each face


def test_a_free_body_gets_the_mass_properties_of_its_shape(folder):
    _, plan = plan_in(folder)
    scene = tiny_scene(with_box=True)
    changed = varied_scenario(scene, {"Box.mesh": "cone.ply"}, None, plan.meshes)
    center, inertia, _ = mass_properties(load_mesh(folder / "cone.ply"), 0.05, "Box")
    np.testing.assert_array_equal(changed.bodies[2].center_of_mass, center)
    np.testing.assert_array_equal(changed.bodies[2].inertia, inertia)
    assert center[2] == pytest.approx(0.005, rel=1e-3)  # a cone's is at a quarter of its height


def test_a_shape_whose_faces_point_inwards_is_turned(folder):
    inverted = trimesh.creation.cone(0.01, 0.02)
    inverted.invert()
    inverted.export(folder / "cone.ply")
    with pytest.warns(UserWarning, match="faces of 'cone.ply' point inwards"):
        _, plan = plan_in(folder)
    mesh = varied_scenario(plan.scenario, {"Ball.mesh": "cone.ply"}, None, plan.meshes).targets[0].mesh
    assert trimesh.Trimesh(mesh.vertices, mesh.triangles).volume == pytest.approx(-inverted.volume, rel=1e-6)


def test_another_content_makes_other_runs(folder):
    study, plan = plan_in(folder)
    before = [run.digest for run in Runs(study, {"tiny": plan}, {"tiny": "0"})]
    trimesh.creation.box((0.01, 0.02, 0.02)).export(folder / "shapes" / "box.stl")
    study, plan = plan_in(folder)
    assert not set(before) & {run.digest for run in Runs(study, {"tiny": plan}, {"tiny": "0"})}


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ('["shapes/*.obj"]', "No file next to the study matches the meshes 'shapes/\\*.obj'"),
        ('["shapes/bal.stl"]', "There is no mesh file"),
        ('["study.toml"]', "is not a mesh file: give one that ends with .stl"),
        ('["broken.ply"]', "'.*broken.ply' could not be read as a mesh"),
        ('["empty.obj"]', "empty.obj"),
    ],
)
def test_what_is_no_mesh_is_one_sentence(folder, words, sentence):
    (folder / "broken.ply").write_bytes(b"ply\nformat ascii 1.0\nelement vertex 9\n")
    (folder / "empty.obj").write_text("v 0 0 0\n")
    text = STUDY.replace('["shapes/*.stl", "cone.ply"]', words)
    (folder / "study.toml").write_text(text, encoding="utf-8")
    with pytest.raises(PalpateError, match=sentence) as raised:
        plan_in(folder)
    assert "\n" not in str(raised.value)


def test_a_pattern_that_is_one_value_is_one_sentence(folder):
    text = STUDY.replace('{ choice = ["shapes/*.stl", "cone.ply"] }', '"shapes/*.stl"')
    assert text != STUDY
    (folder / "study.toml").write_text(text, encoding="utf-8")
    with pytest.raises(ParameterError, match=r"'Ball.mesh' is the pattern 'shapes/\*.stl': write { choice = "):
        plan_in(folder)
