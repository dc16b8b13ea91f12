"""The stops of a program in order: which steps go somewhere, and what is held where when they
do.
"""

from dataclasses import dataclass

from ir_planner.program.steps import PlacedStep, Scenes
from ir_planner.scene import PlanningScene


@dataclass(frozen=True, eq=False)
class Route:
    """All steps, and `stops`: indices of those that go somewhere; a step at the place of the one
    before stays there, but a path is driven again.
    """

    steps: tuple[PlacedStep, ...]
    scenes: Scenes
    stops: tuple[int, ...]

    @staticmethod
    def over(steps: tuple[PlacedStep, ...], scenes: Scenes) -> "Route":
        """The route that visits the targets of the steps."""
        stops = []
        here = ""
        for k, placed in enumerate(steps):
            kind = placed.step.kind
            target = placed.step.target
            if kind == "PATH" or (kind != "PAUSE" and target != here):
                stops.append(k)
                here = target
        return Route(steps, scenes, tuple(stops))

    def __len__(self) -> int:
        return len(self.stops)

    def at(self, place: int) -> PlacedStep:
        """The step of a stop."""
        return self.steps[self.stops[place]]

    def name(self, place: int) -> str:
        """Where a stop is; "": before the first."""
        return self.at(place).step.target if place >= 0 else ""

    def arriving(self, place: int) -> PlanningScene:
        """The scene in which a stop is reached."""
        return self.scenes.before(self.at(place))

    def leaving(self, place: int) -> PlanningScene:
        """The scene in which a stop is left; after the last one, the scene at the end."""
        if place + 1 == len(self.stops):
            return self.scenes.after(self.steps[-1])
        return self.scenes.before(self.at(place + 1))
