"""`ir study arena`: what is asked by its options."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import pytest

from ir_cli.errors import InputError
from ir_cli.studies import add_arena, asked
from ir_studies.arena import EXAMPLE, read_settings


def parsed(*words: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    add_arena(parser)
    return parser.parse_args(list(words))


def test_a_quick_one_needs_no_settings_and_has_a_folder_of_its_own(tmp_path: Path) -> None:
    (tmp_path / "arena.yaml").write_text(EXAMPLE)
    whole = read_settings(tmp_path / "arena.yaml")
    settings, folder = asked(parsed("--quick"))
    assert settings == replace(whole, seeds=1, seconds=0.2)
    assert folder == "out/arena_quick"


def test_a_quick_one_of_settings_keeps_the_rest(tmp_path: Path) -> None:
    path = tmp_path / "arena.yaml"
    path.write_text("format: ir_arena/1\ncells: [deep_box]\nplanners: [sbl]\nseeds: 7\n")
    settings, folder = asked(parsed(str(path), "--quick", "-o", "here"))
    assert (settings.cells, settings.planners, settings.seeds, settings.seconds) == (
        ("deep_box",),
        ("sbl",),
        1,
        0.2,
    )
    assert folder == "here"
    assert asked(parsed(str(path)))[0].seeds == 7


def test_settings_that_are_missing_are_asked_for() -> None:
    with pytest.raises(
        InputError, match=r"SETTINGS\.yaml is missing: ir study arena --example prints one"
    ):
        asked(parsed())
