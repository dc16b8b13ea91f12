"""Predicted against measured energy on typical plants, before and after a fit on a programme of
excitation.

Each plant drives the programme that `ir energy excite` plans for the cell; its watts are fitted.
Then it
drives movements that the fit has not seen: those of the cell's program. Everything that is called
measured is measured on the simulated plant. The plants follow their commands exactly
(`_tracked_run`: seconds each instead of minutes); STEPPED of them are stepped with controller and
encoders as well, and compared.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from _cell_movements import movements_of, planner_in
from _over_seeds import over_seeds
from _results import Claim, at_least, at_most
from _tracked_run import TrackedRun
from _truth_section import Asked, Found

from ir_cli.excitation_programme import ExcitationRequest as Excitation
from ir_cli.excitation_programme import Programme, plan_programme
from ir_description import Cell, Load, PowerParameters, data_sheet, load_power_data
from ir_description.robot import centre_deviations, interval_over
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import Goal, Planner, PlannerSettings
from ir_recorder.fit import fit
from ir_recorder.measure import PowerModel, Samples, planned_samples, samples_of
from ir_sim_driver.plant import typical_plant
from ir_studies.simulated_run import SimulatedRun
from ir_values.arrays import FloatArray

TITLE = "energy before and after a fit, on plants drawn at random"
CELL = "demo"
FULL = Excitation(seconds=180.0)
QUICK = Excitation(seconds=25.0, postures=1)
DRAWS = 200
STEPPED = 1  # plants
# s after a movement: a charge of 120 J goes to idle inverters and holding torque of 50 W
SETTLING = 3.0
STEPPED_WITHIN = 1.0  # % of the energy of a movement
WINDOW = 0.1  # s: of the root mean square of the power's error
# %
MEDIAN = 2.0
WORST = 5.0
POWER = 4.0
COVERED = (80.0, 97.0)


@dataclass(frozen=True)
class Test:
    """A movement with its load that no fit sees."""

    trajectory: JointTrajectory
    load: str


def measured(asked: Asked) -> Found:
    """Errors of energies and powers over the plants, and how often the interval holds."""
    return driven(asked)[0]


def driven(asked: Asked) -> tuple[Found, list[bool]]:
    """The same, and of every movement whether its interval after the fit holds."""
    planner = planner_in(CELL, PlannerSettings())
    prior = data_sheet()
    programme = plan_programme(planner, prior, QUICK if asked.quick else FULL)
    tests = [Test(m.trajectory, m.load) for m in movements_of(planner)]
    tests = [_to_first(planner, tests[0]), *tests]
    loads = {*(test.load for test in tests), *(step.load for step in programme.steps)}
    robot = planner.cell.robot
    fitted = prior.with_centres(centre_deviations(robot))  # as `ir energy fit` does
    rig = _Rig(
        planner.cell, fitted, programme, tests, {load: planner.scene(load).loads for load in loads}
    )
    plants: list[Plant] = over_seeds(rig.plant, range(asked.seeds))
    off = [] if asked.quick else over_seeds(rig.stepped, range(min(STEPPED, asked.seeds)))
    found = Found([plant.row() for plant in plants], [*_claims(plants), *_stepped_claims(off)])
    return found, [inside for plant in plants for inside in plant.covered["after"]]


def _to_first(planner: Planner, first: Test) -> Test:
    """The movement from machine home to where the cell's program begins."""
    goal = Goal(configuration=first.trajectory.positions[0])
    plan = planner.plan_regional(
        start=planner.cell.machine_home, goal=goal, options=PlanOptions(load=first.load)
    )
    assert plan.trajectory is not None  # both are free in the bundled cell
    return Test(plan.trajectory, first.load)


@dataclass(frozen=True)
class Plant:
    """One typical plant: its tests before and after the fit, errors as shares of what was
    measured.
    """

    seed: int
    seconds: float
    errors: dict[str, list[float]]
    covered: dict[str, list[bool]]
    power: list[float]
    width: float
    determined: int

    def row(self) -> dict[str, Any]:
        """What is printed of this plant."""
        row: dict[str, Any] = {"plant": f"typical:{self.seed}", "fitted s": self.seconds}
        for name, errors in self.errors.items():
            sizes = 100.0 * np.abs(errors)
            row |= {
                f"{name} median %": float(np.median(sizes)),
                f"{name} worst %": float(sizes.max()),
            }
            row[f"{name} covered %"] = 100.0 * float(np.mean(self.covered[name]))
        row |= {"power rms %": 100.0 * float(np.median(self.power)), "width %": 100.0 * self.width}
        return row | {"determined": self.determined}


@dataclass(frozen=True, eq=False)
class _Rig:
    """What all plants drive: the programme, then the tests, with loads by their texts."""

    cell: Cell
    prior: PowerParameters
    programme: Programme
    tests: list[Test]
    held: dict[str, tuple[Load, ...]]

    def plant(self, seed: int) -> Plant:
        """Drive, fit, and judge the fit by the tests."""
        samples, end, spans, energies = self.followed(seed)
        model = self.model()
        found = fit(samples.part(0.0, end), model, self.prior)
        errors: dict[str, list[float]] = {"before": [], "after": []}
        covered: dict[str, list[bool]] = {"before": [], "after": []}
        power = []
        widths = []
        for test, span, energy in zip(self.tests, spans, energies, strict=True):
            part = samples.part(*span)
            watts = energy / (span[1] - span[0])  # samples need not begin when a movement does
            planned = planned_samples(test.trajectory, self.held[test.load], self.prior.modes)
            prepared = model.prepare(planned)
            for name, each in (("before", self.prior), ("after", found.parameters)):
                drawn = np.array(
                    [model.watts(draw, prepared).mean() for draw in each.draws(DRAWS, 0)]
                )
                expected = float(model.watts(each.mean, prepared).mean())
                low, high = interval_over(expected, drawn - expected)
                errors[name].append(expected / watts - 1.0)
                covered[name].append(bool(low <= watts <= high))
            widths.append((high - low) / watts)
            by_positions = model.watts(found.parameters.mean, model.prepare(part))
            power.append(_rms(by_positions - part.watts, part.step) / watts)
        determined = int(found.determined.sum())
        return Plant(seed, end, errors, covered, power, float(np.median(widths)), determined)

    def model(self) -> PowerModel:
        """What is fitted."""
        link = load_power_data(self.prior.controller).dc_link
        return PowerModel(self.cell.robot, link, self.cell.base_pose, self.prior)

    def followed(self, seed: int) -> tuple[Samples, float, list[tuple[float, float]], list[float]]:
        """What a plant that follows exactly shows, when the programme ended, and from start to end
        of each test [s] with what the meter counted meanwhile [J].
        """
        plant = typical_plant(self.cell.robot, load_power_data(self.prior.controller), seed)
        run = TrackedRun(self.cell, plant, self.programme.steps[0].load)
        for step in self.programme.steps:
            run.follow(step, self.held[step.load])
        end = run.time
        spans = []
        for test in self.tests:
            run.hold(test.load, self.held[test.load])
            spans.append(run.drive(test.trajectory))
            run.advance(SETTLING)
        energies = [run.metered(*span) for span in spans]
        return run.samples(self.prior.modes), end, spans, energies

    def stepped(self, seed: int) -> list[float]:
        """The same by the stepped driver: how far the energies of the tests are off [share]."""
        run = SimulatedRun(self.cell, f"typical:{seed}", self.programme.steps[0].load)
        for step in self.programme.steps:
            run.follow(step)
        spans = []
        for test in self.tests:
            run.hold(test.load)
            spans.append(run.drive(test.trajectory))
            run.advance(SETTLING)
        trace = run.trace()
        runs = [(-np.inf, np.inf, ())]
        stepped = samples_of(trace, trace, self.prior.joints, self.prior.modes, runs)
        samples, _, others, _ = self.followed(seed)
        return [
            float(stepped.part(*one).watts.mean() / samples.part(*other).watts.mean() - 1.0)
            for one, other in zip(spans, others, strict=True)
        ]


def _rms(error: FloatArray, step: float) -> float:
    """Root mean square of means over WINDOW."""
    width = round(WINDOW / step)
    count = len(error) // width
    means = error[: count * width].reshape(count, width).mean(axis=1)
    return float(np.sqrt(np.mean(means**2)))


def _claims(plants: list[Plant]) -> list[Claim]:
    after = 100.0 * np.abs(np.concatenate([plant.errors["after"] for plant in plants]))
    covered = 100.0 * float(np.mean(np.concatenate([plant.covered["after"] for plant in plants])))
    power = 100.0 * float(np.median(np.concatenate([plant.power for plant in plants])))
    return [
        at_most("energy of a movement after the fit, median", float(np.median(after)), "%", MEDIAN),
        at_most("energy of a movement after the fit, worst", float(after.max()), "%", WORST),
        at_most(f"power rms over {WINDOW:g} s after the fit, of the mean", power, "%", POWER),
        at_least("movements within the 90 % interval after the fit", covered, "%", COVERED[0]),
        at_most(
            "movements within the 90 % interval after the fit, not more", covered, "%", COVERED[1]
        ),
    ]


def _stepped_claims(off: list[list[float]]) -> list[Claim]:
    if not off:
        return []
    worst = 100.0 * float(np.abs(np.concatenate(off)).max())
    name = "energy of a movement, stepped with its controller against followed exactly"
    return [at_most(name, worst, "%", STEPPED_WITHIN)]
