"""Where to wait: at which of some postures a pause costs least, moving there and back included.

The movement there is the beginning of the pause. Of a pause of known length the movement back is
its end; where the end is not known, the robot is woken at the end and ready when it is back.
"""

from dataclasses import dataclass, replace

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.modes import TransitionTimes
from ir_planner.program.pause_lengths import Lengths
from ir_planner.program.standby import Standby, advice
from ir_planner.scene import PlanningScene


@dataclass(frozen=True, eq=False)
class Trip:
    """To a posture q (n,) and back: seconds and joules at the mains of both; ids of the
    trajectories.

    problem: why it isn't possible, "" where it is.
    """

    posture: str
    q: FloatArray
    there: tuple[float, float] = (0.0, 0.0)
    back: tuple[float, float] = (0.0, 0.0)
    ids: tuple[str, str] = ("", "")
    problem: str = ""

    @property
    def joules(self) -> float:
        """Energy [J] of both movements."""
        return self.there[1] + self.back[1]

    @property
    def sentence(self) -> str:
        """What the trip takes."""
        if self.problem:
            return f"{self.posture} is out of the question: {self.problem}"
        both = (("there", self.there, self.ids[0]), ("back", self.back, self.ids[1]))
        return f"{self.posture}: " + ", ".join(
            f"{joules:.0f} J in {seconds:.2f} s {where}" + (f" ({name})" if name else "")
            for where, (seconds, joules), name in both
        )


def best_posture(
    lengths: Lengths,
    q: FloatArray,
    trips: tuple[Trip, ...],
    scene: PlanningScene,
    times: TransitionTimes,
) -> Standby:
    """How to spend a pause of these lengths, and where: at q (n,), where the robot stands, or
    elsewhere.
    """
    here = advice(lengths, q, scene, times)
    options = [_after(trip, here, lengths, scene, times) for trip in trips]
    energies = tuple(float("inf") if option is None else option.energy for option in options)
    best = min(
        (here, *(option for option in options if option is not None)), key=lambda each: each.energy
    )
    return replace(best, posture_energies=energies, trips=tuple(trip.sentence for trip in trips))


def _after(
    trip: Trip, here: Standby, lengths: Lengths, scene: PlanningScene, times: TransitionTimes
) -> Standby | None:
    """The advice with a trip; None where there is none, or not the time for it."""
    back = trip.back[0] if lengths.known else 0.0
    left = lengths.less(trip.there[0] + back)
    if trip.problem or left.most <= 0.0:
        return None
    there = advice(left, trip.q, scene, times)
    late = 0.0 if lengths.known else trip.back[0]
    energy = there.energy + trip.joules
    return replace(
        there,
        energy=energy,
        expected=energy,
        worst=there.worst + trip.joules,
        clairvoyant=there.clairvoyant + trip.joules,
        saving=here.saving + here.energy - energy,
        saving_low=there.saving_low + here.saving + here.energy - energy - there.saving,
        saving_high=there.saving_high + here.saving + here.energy - energy - there.saving,
        saving_on_motors=here.saving_on_motors + here.energy - energy,
        wake_at=there.wake_at + trip.there[0],
        switch_times=tuple(at + trip.there[0] for at in there.switch_times),
        alternatives=here.alternatives,
        energies=here.energies,
        late=there.late + late,
        latest=there.latest + late,
        posture=trip.posture,
    )
