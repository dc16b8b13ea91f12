"""One reader of YAML: what it refuses, it refuses with source and line."""

from __future__ import annotations

import pytest

from ir_values.errors import DescriptionFileError, IrError, UnknownNameError, unknown_name
from ir_values.yaml_tree import plain_values


def test_plain_values_are_those_of_yaml() -> None:
    text = "format: x/1\nlist: [1, 2.5, true, name]\ntable: {a: 1e-3}\n"
    assert plain_values(text, "f.yaml") == {
        "format": "x/1",
        "list": [1, 2.5, True, "name"],
        "table": {"a": "1e-3"},  # YAML 1.1 takes it for a text
    }


@pytest.mark.parametrize(
    ("text", "line", "said"),
    [
        ("", 1, "the file is empty"),
        ("a: 1\na: 2\n", 2, "'a' stands here twice, first in line 1"),
        ("a: &x 1\nb: *x\n", 1, "anchors and aliases"),
        ("a: !!python/object:os.system {}\n", 1, "the tag"),
        ("a: 1\n---\nb: 1\n", 2, "a second document starts here"),
        ("[" * 40, 1, "nested more than 16 deep"),
        (f"a: 0x{'f' * 6000}\n", 1, "a number has 6002 characters, must have at most 1000"),
        (f"a: 1\n? 0x{'f' * 6000}\n: 1\n", 2, "a number has 6002 characters"),
        ("a: 2026-99-99\n", 0, "this is not YAML"),
    ],
)
def test_a_hostile_text_is_refused_with_its_line(text: str, line: int, said: str) -> None:
    with pytest.raises(DescriptionFileError, match=r"f\.yaml") as refused:
        plain_values(text, "f.yaml")
    assert refused.value.line == line
    assert said in refused.value.sentence


def test_an_unknown_name_lists_the_known_ones() -> None:
    error = UnknownNameError("cell", "mars", ["demo", "open"])
    assert str(error) == "cell 'mars' is unknown; known are demo, open"
    assert str(error) == unknown_name("cell", "mars", ["demo", "open"])
    assert isinstance(error, IrError)
    assert isinstance(error, LookupError)


def test_a_long_list_of_known_names_is_cut() -> None:
    sentence = unknown_name("key", "x" * 100, [f"k{i}" for i in range(30)])
    assert sentence.endswith("k19 and 10 more")
    assert "..." in sentence
