"""An unknown name is answered with the nearest known ones."""

from __future__ import annotations

from ir_cli.errors import nearest, unknown_name

KNOWN = [
    "/ir_planner/get_cell",
    "/ir_planner/set_cell",
    "/ir_sim_driver/recover",
    "/ir_recorder/start",
]


def test_typing_mistakes_and_missing_nodes_are_understood() -> None:
    assert nearest("/ir_planer/get_cell", KNOWN)[0] == "/ir_planner/get_cell"
    assert nearest("/recover", KNOWN) == ["/ir_sim_driver/recover"]
    assert nearest("/xyz", KNOWN) == []


def test_a_long_list_is_cut() -> None:
    sentence = unknown_name(
        "service", "/q", [f"/name_{k:02d}" for k in range(55)], "ir ros list services"
    )
    assert "and 47 more (ir ros list services shows all)" in sentence
    assert sentence.count("/name_") == 8
