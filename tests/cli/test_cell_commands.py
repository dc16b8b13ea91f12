"""`ir cell`: what is wrong with a cell file is said in one sentence, with the line."""

from __future__ import annotations

from pathlib import Path

import pytest

from ir_cli.main import main
from ir_cli.output import kilowatt_hours
from ir_description import bundled_cells, cell_to_yaml, load_cell
from ir_description.library import bundled_robot_cells


@pytest.mark.parametrize("name", bundled_cells())
def test_a_bundled_cell_passes_the_check(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["cell", "check", name]) == 0
    assert capsys.readouterr().out.startswith(f"cell {name}: robot {load_cell(name).robot.name}")


def test_a_broken_cell_file_is_refused_with_its_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = cell_to_yaml(load_cell("demo"))
    line = next(k for k, row in enumerate(text.splitlines(), 1) if row.startswith("robot:"))
    path = tmp_path / "broken.yaml"
    path.write_text(text.replace("robot: kr210_r2700_extra", "robot: kr211"))
    assert main(["cell", "check", str(path)]) == 1
    error = capsys.readouterr().err
    assert f"broken.yaml:{line}:" in error
    assert "kr210_r2700_extra" in error


def test_an_unknown_cell_lists_the_known_ones(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["cell", "check", "nowhere"]) == 2
    assert "deep_box" in capsys.readouterr().err


def test_a_file_without_its_ending_is_meant_before_a_bundled_cell(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "Zelle Süd"
    folder.mkdir()
    monkeypatch.chdir(folder)
    (folder / "oven.yaml").touch()
    assert main(["plan", "oven"]) == 2
    assert capsys.readouterr().err == "ir: no cell oven: did you mean oven.yaml?\n"
    assert main(["plan", "../Zelle Süd"]) == 2
    assert "ir: ../Zelle Süd: file '../Zelle Süd' is not a regular file" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("joules", "shown"),
    [
        (0.0, "0 Wh"),
        (12.0, "0.00333 Wh"),
        (629.0, "0.175 Wh"),
        (44e3, "12.2 Wh"),
        (4.4e6, "1.22 kWh"),
    ],
)
def test_the_energy_of_a_small_robot_is_more_than_zeros(joules: float, shown: str) -> None:
    assert kilowatt_hours(joules / 3.6e6) == shown


def test_list_prints_every_bundled_cell(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["cell", "list"]) == 0
    assert set(capsys.readouterr().out.split()) == {
        *bundled_cells(),
        *bundled_robot_cells(),
    }


def test_searches_that_nobody_has_are_errors_with_their_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "cell.yaml"
    text = cell_to_yaml(load_cell("demo")).replace("planner: genetic", "planner: gentic")
    path.write_text(text)
    assert main(["cell", "check", str(path)]) == 1
    out = capsys.readouterr().out
    line = next(k for k, row in enumerate(text.splitlines(), 1) if "planner: gentic" in row)
    assert f"cell.yaml:{line}: error: step 4: planner 'gentic' is unknown: known are " in out
    assert "genetic" in out


def test_a_step_s_planner_that_is_not_installed_is_an_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Law 9: what the check calls fine is not refused later for want of OMPL."""
    path = tmp_path / "cell.yaml"
    path.write_text(cell_to_yaml(load_cell("demo")).replace("planner: genetic", "planner: kpiece"))
    assert main(["cell", "check", str(path)]) == 0
    monkeypatch.setattr("ir_planner.search.with_ompl.host.find_spec", lambda name: None)
    capsys.readouterr()
    assert main(["cell", "check", str(path)]) == 1
    assert "step 4: planner 'kpiece': OMPL is missing: pip install" in capsys.readouterr().out
