# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of files become dataclasses; each mistake is one sentence that names the word, the table and what to write."""

import dataclasses
import importlib
import json
import pkgutil
from dataclasses import dataclass, field
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import msgspec
import pytest

import palpate.core.gap.dataset
import palpate.core.gap.logs
import palpate.core.io
import palpate.core.study
from palpate.core.errors import FileError
from palpate.core.io.schema import WORD, Name, Positive, Switch, known_words, read_json, read_words, wanted


@dataclass(frozen=True)
class Words:
    files: Annotated[tuple[str, ...], wanted("write a list of names", names=True, min_length=1)]
    name: Name = ""
    tared: Switch = False
    fps: Positive | None = None
    use: Literal["fit", "check"] = "fit"
    begin: Annotated[float, wanted("write seconds", ge=-10.0, le=10.0)] = field(default=0.0, metadata={WORD: "from"})
    trial: Annotated[list[dict[str, Any]], wanted("write [[trial]]")] = field(default_factory=list)
    why: str = ""


def read(**table):
    return read_words({"files": ["a.csv"], **table}, Words, "Trial 1 of 'rig.toml'", besides=("format",), why="given")


def test_values_have_the_types_of_their_annotations():
    found = read(fps=24, **{"from": 1}, format="x", trial=[{"a": 1}])
    assert found == Words(("a.csv",), fps=24.0, begin=1.0, trial=[{"a": 1}], why="given")
    assert (type(found.fps), type(found.begin)) == (float, float)


@pytest.mark.parametrize(
    ("table", "sentence"),
    [
        ({"tared": "yes"}, "tared of Trial 1 of 'rig.toml' is 'yes': write true or false."),
        ({"tared": 1}, "tared of Trial 1 of 'rig.toml' is 1: write true or false."),
        ({"fps": True}, "fps of Trial 1 of 'rig.toml' is True: give a number above zero."),
        ({"fps": 0}, "fps of Trial 1 of 'rig.toml' is 0: give a number above zero."),
        ({"fps": float("nan")}, "fps of Trial 1 of 'rig.toml' is nan: give a number above zero."),
        ({"fps": float("inf")}, "fps of Trial 1 of 'rig.toml' is inf: give a number above zero."),
        ({"fps": 10**400}, f"fps of Trial 1 of 'rig.toml' is 1{'0' * 59}: give a number above zero."),
        ({"from": 11.0}, "from of Trial 1 of 'rig.toml' is 11.0: write seconds."),
        ({"use": "chek"}, "use of Trial 1 of 'rig.toml' is 'chek': write \"fit\" or \"check\" (did you mean 'check'?)."),
        ({"files": []}, "files of Trial 1 of 'rig.toml' is []: write a list of names."),
        ({"files": "a.csv"}, "files of Trial 1 of 'rig.toml' is 'a.csv': write a list of names."),
        ({"files": ["a", "\n"]}, "The name in files of Trial 1 of 'rig.toml' is '\\n': write a text."),
        ({"name": ""}, "The name in Trial 1 of 'rig.toml' is '': write a text."),
        ({"trial": {"a": 1}}, "Trial 1 of 'rig.toml' has no [[trial]], but trial = {'a': 1}: write [[trial]]."),
        (
            {"begin": 1.0},
            "'begin' in Trial 1 of 'rig.toml' is not a word of this format: it knows files, name, tared, fps, use, from, "
            "trial, format.",
        ),
    ],
)
def test_a_mistake_is_one_sentence(table, sentence):
    with pytest.raises(FileError) as caught:
        read(**table)
    assert str(caught.value) == sentence


def test_what_is_missing_or_no_table_is_said():
    with pytest.raises(FileError, match="^'a.toml' has no files: write a list of names.$"):
        read_words({}, Words, "'a.toml'")
    with pytest.raises(FileError, match=r"^'a.toml' is \[1\]: write a table.$"):
        read_words([1], Words, "'a.toml'")


def test_the_nearest_word_is_named():
    with pytest.raises(FileError, match=r"not a word of a study \(did you mean 'seed'\?\): it knows seed, fps"):
        known_words({"sed": 1}, ("seed", "fps"), "'a.toml'", "a study")


def test_damage_of_a_json_file_is_named(tmp_path):
    path = tmp_path / "words.json"
    for content, fault in [
        ({"format": "a/1", "files": ["a"], "tared": 3}, "is damaged (tared is 3): bake again."),
        ({"format": "a/1", "files": ["a", 3]}, "is damaged (files[1]: Expected `str`, got `int`): bake again."),
        ({"format": "a/1"}, "is damaged ('files' is missing): bake again."),
        ({"files": ["a"]}, "is damaged (it says no format): bake again."),
        ([], "is damaged (it says no format): bake again."),
        ({"format": "a/2"}, "is not a 'a/1' file but 'a/2': bake again with this version."),
    ]:
        path.write_text(json.dumps(content), encoding="utf-8")
        with pytest.raises(FileError) as caught:
            read_json(path, Words, "a/1", "bake again")
        assert str(caught.value) == f"'{path}' {fault}"
    path.write_text(json.dumps({"format": "a/1", "files": ["a"], "other": 1}), encoding="utf-8")
    found, content = read_json(path, Words, "a/1", "bake again")
    assert found.files == ("a",) and content["other"] == 1


def unions(hint):
    if get_origin(hint) in (Union, UnionType):
        yield get_args(hint)
    for part in get_args(hint):
        yield from unions(part)


def is_limited_number(part):
    limits = [meta for meta in getattr(part, "__metadata__", ()) if isinstance(meta, msgspec.Meta)]
    return any(getattr(meta, name) is not None for meta in limits for name in ("ge", "gt", "le", "lt"))


def is_fixed_tuple(part):
    kind = getattr(part, "__origin__", part) if get_origin(part) is Annotated else part
    return get_origin(kind) is tuple and Ellipsis not in get_args(kind)


def annotated_classes():
    for package in (palpate.core.io, palpate.core.study, palpate.core.gap.dataset, palpate.core.gap.logs):
        for module in pkgutil.iter_modules(package.__path__):
            for found in vars(importlib.import_module(f"{package.__name__}.{module.name}")).values():
                if isinstance(found, type) and dataclasses.is_dataclass(found):
                    yield found


def test_no_union_has_a_limited_number_and_a_fixed_tuple():
    """With such a union msgspec 0.22 reads memory that is not its own, and the process may end."""
    assert is_fixed_tuple(Annotated[tuple[int, int], wanted("")]) and is_limited_number(Positive)
    count = 0
    for kind in annotated_classes():
        for hint in get_type_hints(kind, include_extras=True).values():
            for parts in unions(hint):
                count += 1
                assert not (any(map(is_limited_number, parts)) and any(map(is_fixed_tuple, parts))), kind
    assert count > 10
