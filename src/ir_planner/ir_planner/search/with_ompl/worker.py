"""The processes in which OMPL runs: one that has loaded it, and for each request one forked from
that.

OMPL draws from one generator per process and stops where it looks for its end, so each request gets
a process of its own: the seed decides its answer, and whatever it does it can be killed. Motions
are certified edges of the same kernel that the project's searches use; what a planner may spend is
counted in them.
"""

from __future__ import annotations

import ctypes
import os
import pickle
import select
import signal
import socket
from multiprocessing.connection import Connection
from multiprocessing.reduction import recv_handle

import numpy as np

from ir_planner.checks import FreeSpace
from ir_planner.request import Work
from ir_planner.search.with_ompl.host import OmplAnswer, OmplParameters, OmplProblem

try:
    from ompl import base, geometric, util

    _REASON = ""
except ImportError as error:  # reported to whoever asks
    _REASON = str(error)

# configurations that cost as much as one certified edge, as in the genetic search
STATES_PER_EDGE = 40
_LOOK = 64  # checks between two looks whether somebody still waits for the answer
_PR_SET_PDEATHSIG = 1  # of prctl: the signal that a process gets when its parent ends
# s beyond the ceiling: who asks ends the process at the ceiling, this is for when nobody does
_GRACE = 600.0
_JOINTS_OF_CELLS = 3  # the first joints carry the arm


def main(descriptor: int) -> None:
    """Fork a process for every connection that arrives over a socket, until its other end is
    closed.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for who asks
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody waits for the forked: no zombies
    if not _REASON:
        util.setLogLevel(util.LogLevel.LOG_NONE)
    with socket.socket(fileno=descriptor) as requests:
        while True:
            message, descriptors, _, _ = socket.recv_fds(requests, 1, 1)
            if not message:
                os._exit(0)  # without the destructors of libraries, which complain
            parent = os.getpid()
            if os.fork() == 0:
                try:
                    requests.close()
                    _answer(Connection(descriptors[0]), parent)
                finally:
                    os._exit(0)
            os.close(descriptors[0])


def _answer(connection: Connection, parent: int) -> None:
    """In the process of a request: read the problem, solve it, write the answer, and wait to be
    ended.
    """
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)  # also where this process is stopped
    if os.getppid() != parent:
        return
    connection.send(os.getpid())
    with os.fdopen(recv_handle(connection), "r+b") as sheet:
        sheet.seek(0)
        problem: OmplProblem = pickle.load(sheet)
        signal.setitimer(signal.ITIMER_REAL, problem.seconds + _GRACE)
        try:
            outcome = (
                OmplAnswer(None, 0, _REASON, unusable=True)
                if _REASON
                else solved(problem, connection)
            )
        except (
            Exception
        ) as error:  # goes to who asked, whatever it is: this process has no other voice
            outcome = OmplAnswer(None, 0, f"{type(error).__name__}: {error}")
        sheet.seek(0)
        pickle.dump(outcome, sheet)
        sheet.flush()
    connection.send(True)
    connection.poll(None)  # until who asked ends this, or is gone


class _Counted:
    """Configurations and motions, checked and counted; ends the search when its checks are spent.

    The planner asks `end` in C++, without Python's lock: PRM waits for a thread of its own that
    asks it too.
    """

    def __init__(self, problem: OmplProblem, connection: Connection) -> None:
        self._space = FreeSpace(problem.scene, problem.threshold, Work(2**62, 1.0, lambda: 0.0))
        self._most = problem.edges * STATES_PER_EDGE
        self._connection = connection
        self._n = len(problem.start)
        self._spent = 0
        self._looks = 0
        self.end = base.plannerNonTerminatingCondition()

    @property
    def edges(self) -> int:
        """What was spent."""
        return -(-self._spent // STATES_PER_EDGE)

    def state(self, state: base.State) -> bool:
        """Whether a configuration is free."""
        q = np.array([state[0 : self._n]])
        return self._affordable(1) and bool(self._space.states_free(q)[0])

    def motion(self, first: base.State, last: base.State) -> bool:
        """Whether a straight joint movement is certified free."""
        q0 = np.array([first[0 : self._n]])
        q1 = np.array([last[0 : self._n]])
        return self._affordable(STATES_PER_EDGE) and bool(self._space.edges_free(q0, q1)[0])

    def _affordable(self, states: int) -> bool:
        """Charge a check; False, and the search ends, where nothing is left."""
        if self._spent >= self._most:
            self.end.terminate()
            return False
        self._spent += states
        self._looks += 1
        if self._looks % _LOOK == 0 and select.select([self._connection], [], [], 0.0)[0]:
            self._stop()
        return True

    def _stop(self) -> None:
        """End the search; where nobody waits for its answer any more, the process."""
        try:
            self._connection.recv()
        except (EOFError, OSError):
            os._exit(1)
        self.end.terminate()


def solved(problem: OmplProblem, connection: Connection) -> OmplAnswer:
    """One planner, one problem."""
    util.RNG.setSeed(problem.seed % (2**32 - 1) + 1)
    counted = _Counted(problem, connection)
    n = len(problem.start)
    robot = problem.scene.cell.robot
    bounds = base.RealVectorBounds(n)
    for joint in range(n):
        bounds.setLow(joint, float(robot.position_min[joint]))
        bounds.setHigh(joint, float(robot.position_max[joint]))
    space = base.RealVectorStateSpace(n)
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)
    information = setup.getSpaceInformation()
    setup.setStateValidityChecker(counted.state)
    validator = _validator(information, counted)
    information.setMotionValidator(validator)
    begins = problem.start[None]
    ends = problem.goals
    if problem.parameters.reverse:
        begins, ends = ends, begins
    for configuration in begins:
        start = space.allocState()
        start[0:n] = configuration.tolist()
        setup.addStartState(start)
    goals = base.GoalStates(information)
    for configuration in ends:
        goal = space.allocState()
        goal[0:n] = configuration.tolist()
        goals.addState(goal)
    setup.setGoal(goals)
    setup.setPlanner(_planner(information, space, problem.parameters))
    setup.solve(counted.end)
    if not setup.haveExactSolutionPath():
        return OmplAnswer(None, counted.edges)
    path = np.array([state[0:n] for state in setup.getSolutionPath().getStates()])
    return OmplAnswer(path[::-1] if problem.parameters.reverse else path, counted.edges)


def _validator(information: base.SpaceInformation, counted: _Counted) -> base.MotionValidator:
    """Certified edges as OMPL's check of motions."""

    class Certified(base.MotionValidator):  # type: ignore[misc]
        def checkMotion(self, first: base.State, last: base.State) -> bool:  # noqa: N802 - OMPL's name
            return counted.motion(first, last)

    return Certified(information)


def _planner(
    information: base.SpaceInformation, space: base.StateSpace, parameters: OmplParameters
) -> base.Planner:
    planner = getattr(geometric, parameters.planner)(information)
    for name, value in parameters.values.items():
        getattr(planner, f"set{name}")(value)
    if parameters.cell > 0.0:
        joints = list(range(min(_JOINTS_OF_CELLS, space.getDimension())))
        sizes = [parameters.cell] * len(joints)
        planner.setProjectionEvaluator(
            base.RealVectorOrthogonalProjectionEvaluator(space, sizes, joints)
        )
    return planner
