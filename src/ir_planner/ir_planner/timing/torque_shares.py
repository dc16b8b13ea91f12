"""The shares of the torque that the reserve leaves, tried until the guaranteed bounds of torque
hold.
"""

from collections.abc import Callable

from ir_planner.request import Context
from ir_planner.scene import MotionLimits
from ir_planner.timing.movement import Movement

# Torque is sampled while a motion is timed and bounded when it is proved. Nearly always 2 % cover
# the difference; what needs more has few samples where its torque is highest.
TORQUE_SHARES = (0.98, 0.95, 0.9, 0.8)


def within_torque(
    make: Callable[[MotionLimits], Movement | None], context: Context
) -> Movement | None:
    """The movement made for the largest share of the torque with which its guaranteed bounds hold.

    Ends with what `make` returns where that is None, is too near to something, or uses the smallest
    share. Raises CancelledError when asked to stop.
    """
    for share in TORQUE_SHARES:
        context.work.check()
        movement = make(context.limits.with_torque_share(share))
        if movement is None or movement.clearance is not None or movement.torque.violation is None:
            break
    return movement
