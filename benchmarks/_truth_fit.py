"""Predicted against measured energy on typical plants, before and after a fit on a programme of excitation.

Each plant drives the programme that `ir energy excite` plans for the cell; its watts are fitted. Then it
drives movements that the fit has not seen: those of the cell's program.
Everything that is called measured is measured on the simulated plant.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from _cell_movements import movements_of, planner_in
from _metered_run import MeteredRun
from _results import Claim, at_least, at_most
from _truth_section import Asked, Found

from ir_cli.excitation.programme import Asked as Excitation
from ir_cli.excitation.programme import Programme, plan_programme
from ir_description import Load, PowerParameters, data_sheet, load_power_data
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import Goal, Planner, PlannerSettings
from ir_recorder.fit import fit
from ir_recorder.measure import PowerModel, planned_samples

TITLE = "energy before and after a fit, on plants drawn at random"
CELL = "demo"
FULL, QUICK = Excitation(seconds=180.0), Excitation(seconds=25.0, postures=1)
DRAWS = 100
WINDOW = 0.1  # s: of the root mean square of the power's error
MEDIAN, WORST, POWER, COVERED = 2.0, 5.0, 4.0, (80.0, 97.0)  # %


@dataclass(frozen=True)
class Test:
    """A movement with its load that no fit sees."""

    trajectory: JointTrajectory
    load: str


def measured(asked: Asked) -> Found:
    """Errors of energies and powers over the plants, and how often the interval holds."""
    planner, prior = planner_in(CELL, PlannerSettings()), data_sheet()
    programme = plan_programme(planner, prior, QUICK if asked.quick else FULL)
    tests = [Test(m.trajectory, m.load) for m in movements_of(planner)]
    tests = [_to_first(planner, tests[0]), *tests]
    held = {load: planner.scene(load).loads for load in {*(t.load for t in tests), *_loads(programme)}}
    plants = [_Plant(planner, prior, programme, tests, held, seed) for seed in range(asked.seeds)]
    rows = [plant.row() for plant in plants]
    return Found(rows, _claims(plants))


def _to_first(planner: Planner, first: Test) -> Test:
    """The movement from machine home to where the cell's program begins."""
    goal = Goal(configuration=first.trajectory.positions[0])
    plan = planner.plan_regional(planner.cell.machine_home, goal, PlanOptions(load=first.load))
    assert plan.trajectory is not None  # both are free in the bundled cell
    return Test(plan.trajectory, first.load)


def _loads(programme: Programme) -> set[str]:
    return {step.load for step in programme.steps}


class _Plant:
    """One typical plant: its fit, and its tests before and after, as shares of what was measured."""

    def __init__(
        self,
        planner: Planner,
        prior: PowerParameters,
        programme: Programme,
        tests: list[Test],
        held: dict[str, tuple[Load, ...]],
        seed: int,
    ) -> None:
        cell, link = planner.cell, load_power_data(prior.controller).dc_link
        self.seed, self._model = seed, PowerModel(cell.robot, link, cell.base_pose, prior)
        run = MeteredRun(cell, f"typical:{seed}", programme.steps[0].load)
        for step in programme.steps:
            run.follow(step, held[step.load])
        self.found = fit(run.samples(prior.modes), self._model, prior)
        self.seconds = run.simulation.time
        before = prior.draws(DRAWS, 0), prior.mean
        after = self.found.parameters.draws(DRAWS, 0), self.found.parameters.mean
        spans = _drive_tests(run, programme, tests, held)
        samples = run.samples(prior.modes)
        self.errors: dict[str, list[float]] = {"before": [], "after": []}
        self.covered: dict[str, list[bool]] = {"before": [], "after": []}
        self.power: list[float] = []
        for test, (start, end) in zip(tests, spans, strict=True):
            part = samples.part(start, end)
            watts = part.watts
            prepared = self._model.prepare(planned_samples(test.trajectory, held[test.load], prior.modes))
            for name, (draws, mean) in (("before", before), ("after", after)):
                energy = self._model.watts(mean, prepared).mean() / watts.mean() - 1.0
                drawn = [self._model.watts(each, prepared).mean() / watts.mean() - 1.0 for each in draws]
                low, high = np.percentile(drawn, [5.0, 95.0])
                self.errors[name].append(float(energy))
                self.covered[name].append(bool(low <= 0.0 <= high))
            by_positions = self._model.watts(after[1], self._model.prepare(part))
            self.power.append(_rms(by_positions - watts, part.step) / float(watts.mean()))

    def row(self) -> dict[str, Any]:
        """What is printed of this plant."""
        row: dict[str, Any] = {"plant": f"typical:{self.seed}", "fitted s": self.seconds}
        for name, errors in self.errors.items():
            sizes = 100.0 * np.abs(errors)
            row |= {f"{name} median %": float(np.median(sizes)), f"{name} worst %": float(sizes.max())}
            row[f"{name} covered %"] = 100.0 * float(np.mean(self.covered[name]))
        return row | {
            "power rms %": 100.0 * float(np.median(self.power)),
            "determined": int(self.found.determined.sum()),
            "inflation": self.found.inflation,
        }


def _drive_tests(
    run: MeteredRun, programme: Programme, tests: list[Test], held: dict[str, tuple[Load, ...]]
) -> list[tuple[float, float]]:
    """Drive the tests in their order; from start to end [s] of each."""
    spans = []
    for test in tests:
        gap = float(np.abs(test.trajectory.positions[0] - run.simulation.executor.command).max())
        if gap > 1e-3:
            raise RuntimeError(f"the next movement starts {gap:.3f} rad from where the robot stands")
        run.hold(test.load, held[test.load])
        spans.append(run.drive(test.trajectory))
    return spans


def _rms(error: FloatArray, step: float) -> float:
    """Root mean square of means over WINDOW."""
    width = round(WINDOW / step)
    count = len(error) // width
    means = error[: count * width].reshape(count, width).mean(axis=1)
    return float(np.sqrt(np.mean(means**2)))


def _claims(plants: list[_Plant]) -> list[Claim]:
    after = 100.0 * np.abs(np.concatenate([plant.errors["after"] for plant in plants]))
    covered = 100.0 * float(np.mean(np.concatenate([plant.covered["after"] for plant in plants])))
    power = 100.0 * float(np.median(np.concatenate([plant.power for plant in plants])))
    return [
        at_most("energy of a movement after the fit, median", float(np.median(after)), "%", MEDIAN),
        at_most("energy of a movement after the fit, worst", float(after.max()), "%", WORST),
        at_most(f"power rms over {WINDOW:g} s after the fit, of the mean", power, "%", POWER),
        at_least("movements within the 90 % interval after the fit", covered, "%", COVERED[0]),
        at_most("movements within the 90 % interval after the fit, not more", covered, "%", COVERED[1]),
    ]
