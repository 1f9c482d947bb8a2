# SPDX-License-Identifier: GPL-3.0-or-later
"""Studies are read strictly: each mistake is one sentence that names the right word."""

import tomllib

import pytest
from study_scenes import HEAD, tiny_scene

from palpate.core.errors import PalpateError
from palpate.core.study.study_file import Frozen, FrozenFile, Runs, differences, frozen_text, plan_for, study_of

RANDOM = HEAD + 'design = "random"\nsamples = 4\n'
FOLLOWS = RANDOM + "[vary]\n'Pad.mus' = { uniform = [0.3, 0.9] }\n'Pad.mud' = "
TIED = FOLLOWS + "{ same = 'Pad.mus', factor = 0.5 }\n"


def study(text):
    return study_of(tomllib.loads(text), "study.toml")


def plan(text):
    return plan_for(study(text), tiny_scene(with_box=True))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('format = "palpate-sweep/2"', "a study begins with format"),
        (RANDOM + "sampels = 3", "did you mean 'samples'"),
        (HEAD + 'design = "sobel"\nsamples = 4', "did you mean 'sobol'"),
        (HEAD + 'design = "grid"\nsamples = 4', "leave samples out"),
        (HEAD + 'design = "random"\nsamples = 1000000000', "asks for 1e\\+09 runs"),
        (HEAD + 'design = "random"\nsamples = true', "give a whole number of runs"),
        (RANDOM + "fps = 0", "give a number above zero"),
        (RANDOM + "[vary]\n'Pad.mu' = { uniform = [0, 1] }", "did you mean 'Pad.mu[sd]'"),
        (RANDOM + "[vary]\n'Bix.mass' = { uniform = [1, 2] }", "did you mean 'Box.mass'"),
        (RANDOM + "[vary]\n'Pad.k' = { unifrom = [0, 1] }", "There is no 'Pad.k.unifrom'|did you mean"),
        (RANDOM + "[vary]\n'Pad.k' = { uniform = [-1, 1] }", "k of 'Pad' in the study is -1: give it a value above zero"),
        (RANDOM + "[vary]\n'Pad.k' = { uniform = [2, 1] }", "give the lower number first"),
        (RANDOM + "[vary]\n'Pad.k' = { uniform = [1, 2], choice = [3] }", "has 2 distributions"),
        (RANDOM + "[vary]\n'Pad.gain' = { log-uniform = [0, 1] }", "begins at 0"),
        (RANDOM + "[vary]\n'Pad.normal_law' = { choice = ['linaer'] }", "use one of linear"),
        (RANDOM + "[vary]\n'Pad.effect.creap' = { choice = [true] }", "did you mean 'creep'"),
        (RANDOM + "[vary]\n'Pad.effect.creep.amuont' = { uniform = [0, 1] }", "did you mean 'amount'"),
        (RANDOM + "[vary]\n'press.depth' = 0.1", "has no \\[press\\]"),
        (RANDOM + "[press]\ntarget = 'Bal'", "There is no target 'Bal'"),
        (RANDOM + "[press]", "does not say its target"),
        (RANDOM + "[press]\ntarget = 'Ball'\ndepht = 1", "did you mean 'depth'"),
        (RANDOM + "[press]\ntarget = 'Ball'\ndepth = 1\nforce = 1", "give one of the two"),
        (
            RANDOM + "[press]\ntarget = 'Ball'\n[vary]\n'Ball.shift.x' = { uniform = [0, 1] }",
            "has no effect, because .press. moves",
        ),
        (HEAD + "design = 'grid'\n[press]\ntarget = 'Ball'", "A grid has no random places"),
        (
            FOLLOWS + "{ same = 'Pad.mu', factor = 0.5 }",
            "follows 'Pad.mu', which the study does not vary: did you mean 'Pad.mus'",
        ),
        (FOLLOWS + "{ same = 'Pad.mud', factor = 0.5 }", "which the study does not vary"),
        (FOLLOWS + "{ same = 'Pad.mus', factor = 'half' }", "factor of Pad.mud is 'half'"),
        (FOLLOWS + "{ same = 'Pad.mus', factr = 0.5 }", "did you mean 'factor'"),
        (FOLLOWS + "{ same = 'Pad.mus', factor = -1 }", "give it a value of zero or more"),
    ],
)
def test_a_mistake_is_one_sentence(text, message):
    with pytest.raises(PalpateError, match=message) as caught:
        plan(text)
    assert "\n" not in str(caught.value)


def test_nested_tables_and_quoted_names_mean_the_same():
    nested, quoted = study(RANDOM + "[vary]\nPad.k.uniform = [1, 2]"), study(RANDOM + "[vary]\n'Pad.k' = { uniform = [1, 2] }")
    assert differences(nested, quoted) == []


def test_differences_are_named():
    one, two = study(RANDOM + "[vary]\n'Pad.k' = 3"), study(RANDOM.replace("4", "5") + "[press]\ndepth = 1")
    said = "; ".join(differences(one, two))
    for phrase in ("samples was 4 and is 5", "Pad.k was 3 and is missing", "press.depth was missing and is 1"):
        assert phrase in said


def test_the_frozen_text_is_the_study_again():
    text = RANDOM + "[vary]\n'Pad.k' = { uniform = [1, 2] }\n"
    own = Frozen("1", 4, (FrozenFile("tiny.npz", "ab", "tiny", "cd"),), (FrozenFile("ball.stl", "ef"),))
    frozen = study(frozen_text(text, own))
    assert differences(frozen, study(text)) == []
    assert frozen.frozen == own


def test_runs_have_different_digests_and_the_same_every_time():
    text = HEAD + "design = 'grid'\n[vary]\n'Pad.k' = { choice = [1, 1, 2] }"
    runs = [list(Runs(study(text), {"tiny": plan(text)}, {"tiny": "abc"})) for _ in range(2)]
    assert runs[0] == runs[1]
    assert len({run.digest for run in runs[0]}) == 3
    assert {run.digest for run in Runs(study(text), {"tiny": plan(text)}, {"tiny": "abd"})}.isdisjoint(
        run.digest for run in runs[0]
    )


def test_too_many_runs_of_a_grid_are_refused_before_they_are_made():
    text = (
        HEAD
        + "design = 'grid'\n[vary]\n"
        + "".join(f"'Pad.{name}' = {{ uniform = [1, 2], levels = 2000 }}\n" for name in ("k", "gain"))
    )
    with pytest.raises(PalpateError, match=r"asks for 4e\+06 runs"):
        Runs(study(text), {"tiny": plan(text)}, {"tiny": "abc"})


def test_several_scenes_have_a_column():
    text = RANDOM + "[vary]\n'Pad.k' = { uniform = [1, 2] }"
    plans = {"one": plan(text), "two": plan(text)}
    runs = Runs(study(text), plans, {"one": "a", "two": "b"})
    assert [run.values["scene"] for run in runs] == ["one"] * 4 + ["two"] * 4


def test_a_number_that_follows_another_has_its_values_and_adds_no_axis():
    read = study(TIED)
    found = plan(TIED)
    runs = Runs(read, {"tiny": found}, {"tiny": "0"})
    assert list(found.varied) == ["Pad.mus"]
    for run in runs:
        assert run.values["Pad.mud"] == 0.5 * run.values["Pad.mus"]
    other = Runs(study(TIED.replace("0.5", "0.4")), {"tiny": plan(TIED.replace("0.5", "0.4"))}, {"tiny": "0"})
    assert not {run.digest for run in runs} & {run.digest for run in other}
