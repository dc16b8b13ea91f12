"""The loop of measuring for any robot: excite, fit, plan with what was found."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from ir_cli.main import main
from ir_description import RobotModel, data_sheet_of, load_cell, load_robot, robot_urdf
from ir_recorder.measure import PowerModel, Samples

OWN = {"ur10e": "first", "kr6_r900_2": "second"}  # whose URDF makes an own robot of that name


@pytest.fixture(
    scope="module",
    params=[
        "kr6_bench",
        pytest.param("ur10e_bench", marks=pytest.mark.long),
        pytest.param("kr300_pallets", marks=pytest.mark.long),
        pytest.param("ur10e", marks=pytest.mark.long),
        pytest.param("kr6_r900_2", marks=pytest.mark.long),
    ],
)
def cell(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> str:
    """A bundled cell, or one around a robot that was made from a URDF."""
    from ir_description.files.making import TEMPLATE

    if request.param not in OWN:
        return str(request.param)
    folder = tmp_path_factory.mktemp("own")
    original = load_robot(request.param)
    name = OWN[request.param]
    (folder / "robot.urdf").write_text(robot_urdf(original))
    home = np.round(np.degrees(original.machine_home), 6).tolist()
    sheet = TEMPLATE.replace("name: my_robot", f"name: {name}")
    sheet = sheet.replace("[0, -90, 90, 0, 0, 0]", str(home))
    (folder / "drives.yaml").write_text(sheet)
    words = ["--urdf", str(folder / "robot.urdf"), "--drives", str(folder / "drives.yaml")]
    assert main(["robot", "new", *words, "-o", str(folder / f"{name}.yaml")]) == 0
    page = folder / "cell.yaml"
    page.write_text(f"format: ir_cell/1\nname: bench\nrobot: {name}.yaml\npark_deg: {home}\n")
    return str(page)


def motion(robot: RobotModel, seconds: float = 20.0) -> Samples:
    """Movements about home with rests between them."""
    rng = np.random.default_rng(2)
    step = 0.01
    time = (np.arange(int(seconds / step)) + 0.5) * step
    q = np.tile(robot.machine_home, (len(time), 1))
    qd = np.zeros_like(q)
    qdd = np.zeros_like(q)
    for begin in np.arange(0.5, seconds - 2.0, 2.0):
        rows = (time >= begin) & (time < begin + 1.6)
        x = 2.0 * np.pi * (time[rows] - begin)[:, None] / 1.6
        size = rng.uniform(-0.4, 0.4, robot.n)
        rate = 2.0 * np.pi / 1.6
        q[rows] += size * (1.0 - np.cos(x))
        qd[rows] = size * np.sin(x) * rate
        qdd[rows] = size * np.cos(x) * rate**2
    n = len(time)
    none = np.zeros(n, int)
    return Samples(step, time, q, qd, qdd, none, none, np.ones(n, bool), np.full(n, np.nan), ((),))


def written(folder: Path, robot: RobotModel, standing: float) -> tuple[Path, Path]:
    """A log of volts, amperes and torques of a robot whose friction is 1.6 times its data's, with a
    wrist that has turned once more, and its mapping.
    """
    prior = data_sheet_of(robot, robot.controller)
    model = PowerModel(robot, robot.controller.dc_link, np.eye(4), prior)
    truth = prior.mean.copy()
    for term in ("viscous", "coulomb"):
        truth[prior.places(term)] *= 1.6
    samples = motion(robot)
    prepared = model.prepare(samples)
    watts = model.watts(truth, prepared) + standing
    volts = 48.0 + 0.1 * np.sin(samples.time)
    torque = model.torque(truth, prepared)
    q = samples.q.copy()
    if robot.position_max[5] - robot.position_min[5] > 6.28:
        q[:, 5] += 2.0 * np.pi
    heads = ["t [ms]", "bus_voltage", "bus_current"]
    heads += [f"actual_q_{k}" for k in range(6)] + [f"torque_{k} (Nm)" for k in range(6)]
    rows = np.column_stack([1e3 * samples.time, volts, watts / volts, q, torque])
    log = folder / "log.csv"
    np.savetxt(log, rows, "%.7g", ",", header=",".join(heads), comments="")
    lines = ["format: ir_trace/1", "columns:", "  time: 't [ms]'"]
    lines.append("  power: {product: [bus_voltage, bus_current]}")
    lines += [f"  {name}: actual_q_{k}" for k, name in enumerate(robot.joint_names)]
    lines += [f"  {name}_effort: 'torque_{k} (Nm)'" for k, name in enumerate(robot.joint_names)]
    mapping = folder / "log.yaml"
    mapping.write_text("\n".join(lines) + "\n")
    return log, mapping


@pytest.mark.long
@pytest.mark.parametrize("by", ["meter", "motors"])
def test_a_log_is_fitted_and_planned_with(
    cell: str, by: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    robot = load_cell(cell).robot
    log, mapping = written(tmp_path, robot, 35.0)
    out = tmp_path / "power.yaml"
    words = [str(log), "--mapping", str(mapping), "--cell", cell, "--load", "none", "--by", by]
    assert main(["energy", "fit", *words, "--name", "mine", "-o", str(out), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    value = {row["parameter"]: row["value"] for row in found["parameters"]}
    if by == "meter":
        at_rest = ("watts.STAND_ON_MOTORS", "drives_watts", "idle_watts")
        sheet = data_sheet_of(robot, robot.controller)
        said = sum(sheet.value(name) for name in at_rest)
        assert sum(value[name] for name in at_rest) == pytest.approx(said + 35.0, rel=0.2)
    first = f"coulomb.{robot.joint_names[0]}"
    known = data_sheet_of(robot, robot.controller).value(first)
    assert value[first] / known == pytest.approx(1.6, rel=0.25)
    assert {row["method"] for row in found["left_out"]} == {"fit", "data sheet", "regression"}
    assert any("plan with the fit" in sentence for sentence in found["sentences"])
    home = " ".join(f"A{k + 1} {v:.1f}" for k, v in enumerate(np.degrees(robot.machine_home)))
    goal = re.sub(r"A1 \S+", "A1 20", home)
    words = ["ask", "move", cell, "home", goal, "--power-parameters", str(out)]
    assert main(words) == 0
    answer = capsys.readouterr().out
    assert "by mine" in answer
    if by == "meter":
        assert "from the mains" in answer  # whether a table or the fit says so
        words = [str(log), "--mapping", str(mapping), "--cell", cell, "--load", "none", "--json"]
        assert main(["energy", "compare", *words, "--power-parameters", str(out)]) == 0
        both = json.loads(capsys.readouterr().out)
        assert abs(both["difference"]["mean"]) < 0.05


def test_parameters_of_another_robot_are_refused_with_both_names(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "power.yaml"
    page.write_text(
        "format: ir_description/power_parameters/1\nname: x\nrobot: somebody\n"
        "controller: no_table\nparameters: []\n"
    )
    assert main(["ask", "move", "kr6_bench", "home", "park", "--power-parameters", str(page)]) == 2
    said = capsys.readouterr().err
    assert "are of robot somebody: the cell has kr6_r900_2" in said


@pytest.mark.long
def test_movements_are_planned_that_identify_an_own_robot(cell: str, tmp_path: Path) -> None:
    words = [cell, "--seconds", "3", "--postures", "1", "-o", str(tmp_path / "out")]
    assert main(["energy", "excite", *words]) == 0
    assert (tmp_path / "out" / "programme.yaml").is_file()


def rtde_log(folder: Path, *, timed: bool) -> Path:
    """What a UR-like controller logs of movements of a KR 6 at 100 Hz: positions, speeds, power."""
    samples = motion(load_cell("kr6_bench").robot, 8.0)
    watts = 200.0 + 50.0 * np.abs(samples.qd).sum(axis=1)
    columns = [samples.q, samples.qd, np.full(len(watts), 48.0), watts / 48.0]
    heads = [f"actual_q_{k}" for k in range(6)] + [f"actual_qd_{k}" for k in range(6)]
    heads += ["actual_robot_voltage", "actual_robot_current"]
    if timed:
        columns = [samples.time, *columns]
        heads = ["timestamp", *heads]
    path = folder / f"log_{timed}.csv"
    np.savetxt(path, np.column_stack(columns), "%.9g", ",", header=",".join(heads), comments="")
    return path


def compared(capsys: pytest.CaptureFixture[str], *words: str) -> list[dict[str, float]]:
    words = ("energy", "compare", *words, "--cell", "kr6_bench", "--load", "none", "--json")
    assert main(list(words)) == 0
    rows: list[dict[str, float]] = json.loads(capsys.readouterr().out)["movements"]
    return rows


def test_a_log_without_time_is_compared_by_its_rate(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    timed = compared(capsys, str(rtde_log(tmp_path, timed=True)))
    bare = compared(capsys, str(rtde_log(tmp_path, timed=False)), "--rate", "100")
    assert len(bare) == len(timed) > 2
    for one, other in zip(bare, timed, strict=True):
        assert one["seconds"] == pytest.approx(other["seconds"], abs=0.02)
        assert one["direct"] == pytest.approx(other["direct"], rel=0.01)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "ir energy --rate"),
        (["--rate", "0"], "--rate is 0 Hz"),
        (["--rate", "nan"], "--rate is nan Hz"),
        (["--rate", "25"], "times as fast as its recorded speed says"),
        (["--rate", "400"], "times as fast as its recorded speed says"),
    ],
)
def test_a_rate_that_is_missing_or_wrong_is_refused(
    words: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = rtde_log(tmp_path, timed=False)
    asked = ["energy", "compare", str(path), "--cell", "kr6_bench", "--load", "none", *words]
    assert main(asked) != 0
    assert said in capsys.readouterr().err


def test_a_rate_beside_a_mapping_of_the_time_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mapping = tmp_path / "map.yaml"
    mapping.write_text("format: ir_trace/1\ncolumns: {time: {step: 10, unit: ms}}\n")
    path = str(rtde_log(tmp_path, timed=False))
    words = ["--cell", "kr6_bench", "--mapping", str(mapping)]
    assert main(["energy", "compare", path, "--load", "none", *words]) == 0
    assert main(["energy", "compare", path, *words, "--rate", "100"]) != 0
    assert "the mapping (--mapping) has one" in capsys.readouterr().err
