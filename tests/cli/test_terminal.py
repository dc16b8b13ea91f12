"""What a person sees at the terminal."""

from __future__ import annotations

import io

from ir_cli.output import Progress, table


def test_columns_line_up_first_to_the_left_the_rest_to_the_right() -> None:
    text = table(["movement", "J"], [["home", "7"], ["a longer name", "1234"]])
    assert text.splitlines() == [
        "movement          J",
        "-------------  ----",
        "home              7",
        "a longer name  1234",
    ]


def test_where_the_output_is_a_file_only_finished_steps_are_written() -> None:
    stream = io.StringIO()
    progress = Progress(stream)
    progress.begin("plan")
    progress.update("1/2")
    progress.end("2 steps")
    assert stream.getvalue().endswith("s  plan: 2 steps\n")
    assert "1/2" not in stream.getvalue()
