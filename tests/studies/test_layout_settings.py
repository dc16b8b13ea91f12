"""A layout's settings without sense are refused with the key, its value and what it may be."""

from __future__ import annotations

import json
import subprocess
from dataclasses import asdict, replace
from pathlib import Path

import pytest
import yaml

from ir_description import cell_to_yaml, load_cell
from ir_studies.errors import SettingsError
from ir_studies.layout import EXAMPLE
from ir_studies.layout.settings import read_layout
from ir_studies.studies import study_of

STUDIES = Path(__file__).parents[2] / "docs" / "studies.md"
HEAD = "format: ir_layout/1\ncell: demo\n"
MOVES = HEAD + "base: {x: [0, 1]}\n"


def test_the_example_is_read_and_names_every_key() -> None:
    settings = study_of(EXAMPLE).settings
    for name in vars(settings):
        assert f"\n{name}:" in EXAMPLE
    assert len(settings.variables) == 11


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "the file is empty"),
        ("[]", "format is ''"),
        ("format: ir_cell/1\n", "kind 'cell' is unknown; known are layout"),
        ("format: ir_layout/1\n", "cell is missing"),
        ("format: ir_layout/1\ncell: 5\n", "cell is missing"),
        ("format: ir_layout/1\ncell: dem\nbase: {x: [0, 1]}\n", "cell: "),
        ("format: ir_layout/1\ncell: /etc/passwd\nbase: {x: [0, 1]}\n", "cell: "),
        (HEAD, "nothing may move"),
        (HEAD + "base: 5\n", "base is 5: it must be names with values"),
        (HEAD + "base: {x: 5}\n", "base: x is 5: it must be [lowest, highest]"),
        (HEAD + "base: {x: [1, 0]}\n", "the lowest comes first"),
        (HEAD + "base: {x: [0, .inf]}\n", "base: x is inf: it must be a number in -100 .. 100"),
        (HEAD + "base: {w: [0, 1]}\n", "base: 'w' is unknown; known are x, y, z, turn_deg"),
        (
            HEAD + "equipment: {oven: {x: [0, 1]}}\n",
            "equipment: 'oven' is unknown; known are infeed",
        ),
        (HEAD + "equipment: [gauge]\n", "equipment is ('gauge',)"),
        (HEAD + "park: {a7_deg: [0, 1]}\n", "park: 'a7_deg' is unknown; known are a1_deg"),
        (MOVES + "carried: gauge\n", "carried is 'gauge': it must be a list"),
        (MOVES + "stations: [nowhere]\n", "stations: 'nowhere' is unknown"),
        (
            MOVES + "payloads: {gear: [0]}\n",
            "payloads: gear is 0: it must be a number in 0.001 .. 2000",
        ),
        (MOVES + "payloads: {gear: []}\n", "make 0 conditions"),
        (MOVES + f"payloads: {{gear: {list(range(1, 52))}}}\n", "make 51 conditions: 1 to 50"),
        (
            MOVES + f"cycle_times: {list(range(20_000))}\n",
            "cycle_times has 20000 values: at most 1000",
        ),
        (MOVES + "cycle_times: [-1]\n", "cycle_times is -1"),
        (MOVES + "cycle_times: []\n", "make 0 conditions"),
        (MOVES + "cycle_times: [0, 0]\n", "cycle_times names one twice"),
        (MOVES + "method: guess\n", "method is 'guess': known are spread, grid"),
        (
            MOVES + "method: grid\nsteps: 1000\npark: {a1_deg: [0, 1]}\n",
            "more than 100000 placements",
        ),
        (MOVES + "placements: 1.5\n", "placements is 1.5: it must be a whole number"),
        (MOVES + "placements: true\n", "placements is True"),
        (MOVES + f"placements: {10**400}\n", "placements is 1000"),
        (MOVES + "a: &a [1]\nb: *a\n", "anchors and aliases (& and *) are not allowed"),
        (MOVES + "x: 2026-99-99\n", "is not YAML"),
        (
            MOVES + f"placements: 0x{'f' * 6_000}\n",
            "a number has 6002 characters, must have at most 1000",
        ),
        (
            MOVES + f"? 0x{'f' * 6_000}\n: 1\n",
            "a number has 6002 characters, must have at most 1000",
        ),
        (MOVES + f"margin: 1{':1' * 400}.5\n", "is not YAML"),
        (MOVES + f"margin: 1{':1' * 40_000}.5\n", "a number has 80003 characters"),
        ("{" * 1_500, "nested more than 16 deep"),
        (MOVES + "#" * 1_000_001, "at most 1000000"),
    ],
)
def test_what_makes_no_sense_is_refused(content: str, said: str) -> None:
    with pytest.raises(SettingsError) as refused:
        study_of(content)
    assert said in str(refused.value)
    assert len(str(refused.value)) < 1000


class Compared(str):
    """A text that counts how often it is compared: a key looked for in a list is, with every
    entry.
    """

    times = 0
    __hash__ = str.__hash__

    def __eq__(self, other: object) -> bool:
        Compared.times += 1
        return str.__eq__(self, other)


class Node(yaml.ScalarNode):
    def __init__(self, tag: str, value: str, *place: object, **style: object) -> None:
        super().__init__(tag, Compared(value), *place, **style)  # type: ignore[arg-type]


def test_a_key_is_not_compared_with_all_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """With eight times as many keys that took thirty times as long."""
    keys = 2_000
    for room in ("composer", "resolver"):
        monkeypatch.setattr(f"yaml.{room}.ScalarNode", Node)
    monkeypatch.setattr(Compared, "times", 0)
    with pytest.raises(SettingsError, match="key 'k0' is unknown"):
        study_of(HEAD + "".join(f"k{number}: 1\n" for number in range(keys)))
    assert 0 < Compared.times < 10 * keys


def test_a_file_is_named_in_its_refusal_and_its_cell_stands_beside_it(tmp_path: Path) -> None:
    path = tmp_path / "layout.yaml"
    path.write_text("format: ir_layout/1\ncell: mine.yaml\nbase: {x: [0, 1]}\n")
    with pytest.raises(SettingsError, match=r"layout.yaml: cell: .*can't be opened"):
        read_layout(path)


def test_the_goal_in_the_documentation_carries_the_settings_as_they_are(tmp_path: Path) -> None:
    (tmp_path / "layout.yaml").write_text(EXAMPLE)
    command = next(part for part in STUDIES.read_text().split("```") if "ir ros send_goal" in part)
    shown = 'ir() { printf %s "${@: -1}"; }\n' + command
    goal = subprocess.run(
        ["bash", "-c", shown], cwd=tmp_path, capture_output=True, check=True
    ).stdout
    assert study_of(yaml.safe_load(goal)["settings"]) == study_of(EXAMPLE)


PERMUTED = """\
keep: 5
cycle_times: [0]
equipment:
  outfeed: {y: [-0.3, 0.3], x: [-0.2, 0.3]}
  gauge: {turn_deg: [-20, 20], y: [-0.4, 0.4], x: [-0.3, 0.2]}
park: {a2_deg: [-5, 30], a1_deg: [-40, 40]}
base: {turn_deg: [-20, 20], z: [0, 0.2], y: [-0.3, 0.3], x: [-0.3, 0.3]}
cell: demo
format: ir_layout/1
"""


def test_the_order_of_keys_says_nothing() -> None:
    one = study_of(PERMUTED).settings
    other = study_of(EXAMPLE).settings
    assert one == other
    assert json.dumps(asdict(one)) == json.dumps(asdict(other))
    assert one.variables == other.variables


def test_stations_may_be_visited_again_and_postures_between() -> None:
    asked = "stations: [infeed_pick, home, infeed_pick, park]\n"
    assert study_of(MOVES + asked).settings.stations == (
        "infeed_pick",
        "home",
        "infeed_pick",
        "park",
    )


def test_conditions_that_differ_a_little_are_known_apart() -> None:
    asked = "cycle_times: [2017.281, 2017.284, 13]\npayloads: {gear: [10, 10.000001]}\n"
    texts = [condition.text for condition in study_of(MOVES + asked).settings.conditions]
    assert texts[0] == "2017.281 s gear 10 kg"
    assert texts[2] == "13 s gear 10 kg"
    assert len(set(texts)) == 6


def test_many_masses_of_many_parts_are_counted_before_they_are_combined(tmp_path: Path) -> None:
    cell = load_cell("demo")
    load = replace(cell.part("gear").load, capsules=())
    others = tuple(
        replace(cell.part("gear"), load=replace(load, name=f"gear_{k}"), station="", bodies=())
        for k in range(8)
    )
    (tmp_path / "many.yaml").write_text(cell_to_yaml(replace(cell, parts=(*cell.parts, *others))))
    masses = ", ".join(f"gear_{k}: {list(range(1, 101))}" for k in range(8))
    asked = (
        f"format: ir_layout/1\ncell: {tmp_path}/many.yaml\nbase: {{x: [0, 1]}}\n"
        f"payloads: {{{masses}}}\n"
    )
    with pytest.raises(SettingsError, match="make 10000000000000000 conditions"):
        study_of(asked)
