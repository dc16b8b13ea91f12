"""`ir cell check --deep`: what it suggests, pasted into the cell, makes the cell plan."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from ir_cli.main import main
from ir_cli.offline.deep import suggestions_of
from ir_description import AllowedContact, Cell, Station, cell_to_yaml, load_cell


def changed(cell: Cell, name: str, **fields: object) -> Cell:
    stations = tuple(
        replace(station, **fields) if station.name == name else station  # type: ignore[arg-type]
        for station in cell.stations
    )
    return replace(cell, stations=stations)


def pasted(cell: Cell, name: str, text: str) -> Cell:
    """The cell with the suggested lines in a station."""
    fields = yaml.safe_load(text)
    if "allowed_contacts" in fields:
        contacts = [AllowedContact(*c["between"], c["safety_distance"]) for c in fields["allowed_contacts"]]
        fields["allowed_contacts"] = tuple(contacts)
    return changed(cell, name, **fields)


@pytest.mark.parametrize(
    ("name", "missing"),
    [("infeed_pick", {"allowed_contacts": ()}), ("gauge_measure", {"approach_distance": 0.0}),
     ("outfeed_place", {"allowed_contacts": ()})],
)  # fmt: skip
def test_what_is_suggested_makes_the_station_work(name: str, missing: dict[str, object]) -> None:
    demo = replace(load_cell("demo"), program=load_cell("demo").program[:6])
    broken = changed(demo, name, **missing)
    found = [each for each in suggestions_of(broken) if each.subject == name]
    assert len(found) == 1
    assert found[0].yaml.startswith(next(iter(missing)))
    mended = pasted(broken, name, found[0].yaml)
    assert [each for each in suggestions_of(mended) if each.severity == "error"] == []


def test_a_station_in_a_body_is_to_be_moved(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cell = load_cell("open")
    station: Station = cell.stations[0]
    pose = station.pose.copy()
    pose[2, 3] -= 0.3
    path = tmp_path / "deep.yaml"
    inside = station.pose_in_equipment.copy()
    inside[:3, 3] += station.pose_in_equipment[:3, :3] @ station.pose[:3, :3].T @ (pose - station.pose)[:3, 3]
    path.write_text(cell_to_yaml(changed(cell, station.name, pose=pose, pose_in_equipment=inside)))
    assert main(["cell", "check", str(path), "--deep", "--json"]) == 1
    found = json.loads(capsys.readouterr().out)["suggestions"]
    errors = [each for each in found if each["severity"] == "error"]
    assert [each["subject"] for each in errors] == [station.name]
    assert "move the station" in errors[0]["sentence"]
    assert errors[0]["yaml"] == ""
