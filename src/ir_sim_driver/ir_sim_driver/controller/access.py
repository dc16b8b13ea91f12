"""The one way to a simulation that another thread steps: under its lock, and only while it is
stepped.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from ir_msgs_py.status import StatusCode
from ir_sim_driver.controller.simulation import Simulation
from ir_sim_driver.errors import RequestRefusedError
from ir_sim_driver.notices import Level


class Access:
    """Hands out `simulation`; wake_hint: what wakes the controller, for sentences.

    failure: why the simulation is not stepped any more, "" while it is. simulation: for single
    values that are read without the lock.
    """

    def __init__(self, simulation: Simulation, wake_hint: str) -> None:
        self.simulation = simulation
        self._wake_hint = wake_hint
        self.lock = threading.Lock()
        self.failure = ""

    @contextmanager
    def reading(self) -> Iterator[Simulation]:
        """To read, or to set what counts from the next step on."""
        with self.lock:
            yield self.simulation

    @contextmanager
    def alive(self) -> Iterator[Simulation]:
        """To ask for something. Raises RequestRefusedError when nobody steps the simulation any
        more.
        """
        with self.lock:
            if self.failure:
                raise RequestRefusedError(StatusCode.FAILURE, self.failure)
            yield self.simulation

    @contextmanager
    def online(self, *, asleep_too: bool = False) -> Iterator[Simulation]:
        """To ask the controller for something. Raises also while it is off the network."""
        with self.alive() as simulation:
            if not (asleep_too or simulation.on_the_network):
                raise RequestRefusedError(
                    StatusCode.INVALID_ROBOT_STATE,
                    f"the controller is off the network ({simulation.modes.mode.name}): "
                    f"only {self._wake_hint} wakes it",
                )
            yield simulation

    @contextmanager
    def writing(self) -> Iterator[Simulation]:
        """To write PLC inputs: what is refused becomes a notice, a pressed emergency stop acts at
        once.
        """
        with self.alive() as simulation:
            try:
                yield simulation
            except RequestRefusedError as error:
                simulation.notices.add(Level.WARN, str(error))
                raise
            finally:
                simulation.heed_stop()
