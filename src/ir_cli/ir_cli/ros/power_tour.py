"""Tour of the power modes at machine home, by PLC bits and Wake-on-LAN: the paper's Table II.

For each load the robot rests on motors, on brakes, with the drive bus off and in hibernation, long
enough for the mains meter to show a plateau. Hibernation takes the controller off the network: only
Wake-on-LAN brings it back.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence

from ir_cli.errors import CommandError
from ir_msgs.msg import PlcInputs, PowerMode, PowerState
from ir_msgs.srv import SetLoad, SetPlcInput
from ir_msgs_py import names
from ir_msgs_py.ros.client import Client

MODE_SECONDS = 30.0
"""Longest wait for a mode [s]; transitions of the demonstration take a few seconds."""
_TRIES = 5  # to stay on motors: brakes that close by themselves while one begins are no fault


class PowerWatch:
    """The last message of the mains meter, and waiting for a mode or for time on the meter's own
    clock.
    """

    def __init__(self, client: Client, patience: float = MODE_SECONDS) -> None:
        self._patience = patience
        self._changed = threading.Condition()
        self._state: PowerState | None = None
        self._clock = client.node.get_clock()
        client.subscribe("/" + names.POWER_STATE, PowerState, self._take)

    def wait_for_mode(self, mode: int) -> None:
        """Wait until the controller rests in a mode; CommandError after `patience` [s] of the
        meter.
        """
        self._wait(lambda state: state.mode == mode, f"power mode {mode}")

    def rest(self, mode: int, seconds: float) -> None:
        """Wait for a mode, and that it stays for so long."""
        self.wait_for_mode(mode)
        self.stays(mode, seconds)

    def stays(self, mode: int, seconds: float) -> bool:
        """Wait until the meter has measured in this mode for so long since its last reading; False
        as soon as it shows another: a controller that stands for long closes its brakes by itself.

        The plant may lag behind the node's clock by any time: what it rests, it rests on its own.
        """
        self._wait(lambda state: True, "the mains meter")
        end = _seconds(self._last()) + seconds
        self._wait(
            lambda state: state.mode != mode or _seconds(state) >= end,
            f"{seconds:g} s on the mains meter",
        )
        return self._last().mode == mode

    def _wait(self, condition: Callable[[PowerState], bool], what: str) -> None:
        """Until a reading meets the condition; CommandError where the meter is silent for
        `patience` [s], or has measured for as long: it counts its own time, since on a busy machine
        it lags behind.
        """
        with self._changed:
            heard = self._state
            until = max(self._now(), 0.0 if heard is None else _seconds(heard)) + self._patience
            while heard is None or not condition(heard):
                late = heard is not None and _seconds(heard) > until
                if late or not self._news(heard):
                    mode = "nothing" if heard is None else f"mode {heard.mode}"
                    raise CommandError(
                        f"waited {self._patience:g} s for {what}; the mains meter says {mode}"
                    )
                heard = self._state

    def _news(self, heard: PowerState | None) -> bool:
        """Whether a reading comes that isn't the one heard."""
        return self._changed.wait_for(lambda: self._state is not heard, self._patience)

    def _now(self) -> float:
        return float(self._clock.now().nanoseconds) * 1e-9

    def _last(self) -> PowerState:
        with self._changed:
            assert self._state is not None
            return self._state

    def _take(self, state: PowerState) -> None:
        with self._changed:
            self._state = state
            self._changed.notify_all()


def _seconds(state: PowerState) -> float:
    return float(state.header.stamp.sec) + float(state.header.stamp.nanosec) * 1e-9


def tour(
    client: Client,
    watch: PowerWatch,
    loads: Sequence[str],
    stay: float,
    wake: Callable[[], None],
    progress: Callable[[str], None],
) -> None:
    """Visit the four modes with each load (load texts), staying `stay` seconds in each; ends on
    motors.
    """
    for load in loads:
        progress(f"load {load}: on motors")
        motors_on(client, watch)
        client.ask("/" + names.SET_LOAD, SetLoad.Request(load=load))
        stand_on_motors(client, watch, stay)
        progress(f"load {load}: on brakes")
        set_bit(client, "drives_off", True)
        watch.rest(PowerMode.STAND_ON_BRAKES, stay)
        set_bit(client, "drives_off", False)
        motors_on(client, watch)
        progress(f"load {load}: drive bus off")
        set_bit(client, "ab", True)
        watch.rest(PowerMode.BUS_POWER_OFF, stay)
        set_bit(client, "ab", False)
        watch.wait_for_mode(PowerMode.STAND_ON_MOTORS)
        progress(f"load {load}: hibernation")
        set_bit(client, "hib", True)
        watch.rest(PowerMode.HIBERNATION, stay)
        wake()
        watch.wait_for_mode(PowerMode.STAND_ON_MOTORS)
        set_bit(client, "hib", False)


def stand_on_motors(client: Client, watch: PowerWatch, stay: float) -> None:
    """Stay `stay` [s] on motors; CommandError where the controller's own timer closes the brakes
    before, again and again.
    """
    for _ in range(_TRIES):
        if watch.stays(PowerMode.STAND_ON_MOTORS, stay):
            return
        motors_on(client, watch)
    raise CommandError(
        f"the controller closed its brakes {_TRIES} times before the robot had stood {stay:g} s on "
        "motors"
    )


def motors_on(client: Client, watch: PowerWatch) -> None:
    """Release the brakes: they close by themselves after a while, as during planning."""
    set_bit(client, names.END_REST, True)
    watch.wait_for_mode(PowerMode.STAND_ON_MOTORS)


def set_bit(client: Client, name: str, value: bool) -> PlcInputs:
    """Set one level of the PLC, the others stay."""
    return client.ask("/" + names.SET_PLC_INPUT, SetPlcInput.Request(name=name, value=value)).inputs
