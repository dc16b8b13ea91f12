"""Instances of the public benchmark (dataset.xsd of CTU's generator of robotic cells) from XML."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

from ir_studies.cells.instance import (
    Conflict,
    DynamicActivity,
    EnergyCurve,
    Handover,
    HopMovement,
    Instance,
    InstanceRobot,
    StaticActivity,
    StopLocation,
    TimeLag,
)
from ir_studies.errors import SettingsError
from ir_values.errors import FileRefusedError
from ir_values.files import read_regular_file

MOST_BYTES = 64_000_000
_MOST_S = 604_800.0  # a week
_Element = ElementTree.Element


def read_instances(path: str | Path) -> list[Instance]:
    """All instances of a file. SettingsError names what makes no sense."""
    try:
        root = ElementTree.fromstring(read_regular_file(Path(path), MOST_BYTES))
    except FileRefusedError as error:
        raise SettingsError(str(error)) from error
    except OSError as error:
        raise SettingsError(f"{path} can't be read: {error.strerror}") from error
    except ElementTree.ParseError as error:
        raise SettingsError(f"{path} is no XML: {error}") from error
    if root.tag != "dataset":
        raise SettingsError(f"{path}: the root is <{root.tag}>, must be <dataset>")
    found = root.findall("instance")
    if not found:
        raise SettingsError(f"{path} holds no <instance>")
    names = [f"{Path(path).stem}_{k}" for k in range(len(found))]
    return [
        _InstanceReader(f"{path}: instance {k}", each).instance(name)
        for k, (name, each) in enumerate(zip(names, found, strict=True))
    ]


class _InstanceReader:
    """Reads one instance; `place` begins every sentence."""

    def __init__(self, place: str, element: _Element) -> None:
        self._place = place
        self._element = element
        self._stop_of: dict[int, int] = {}  # by point
        self._choices: dict[int, set[int]] = {}  # places or movements by activity

    def instance(self, name: str) -> Instance:
        """The instance; every reference in it is known to exist."""
        cycle = self._number(self._element, "production-cycle-time", 0.0)
        if cycle <= 0.0:
            raise self._refused(f"production-cycle-time is {cycle:g} s, must be positive")
        robots = tuple(self._robot(each, k) for k, each in enumerate(self._all("robots/robot")))
        if not robots:
            raise self._refused("there is no robot")
        lags = tuple(self._lag(each) for each in self._element.iter("time-lag"))
        fits = tuple(
            handover
            for each in self._all("inter-robot-operations/operation")
            for handover in self._handovers(each)
        )
        clashes = tuple(self._conflict(each) for each in self._element.iter("collision-pair"))
        return Instance(name, cycle, robots, lags, fits, clashes)

    def _robot(self, element: _Element, k: int) -> InstanceRobot:
        name = element.findtext("name") or f"robot {k}"
        modes: dict[int, float] = {}
        usual: dict[int, float] = {}
        for each in element.findall("power-saving-modes/power-mode"):
            mode = self._whole(each.get("pid"), "pid of a power-mode")
            modes[mode] = self._number(each, "minimal-idle-time", 0.0)
            if each.find("expected-input-power") is not None:
                usual[mode] = self._number(each, "expected-input-power", 0.0)
        if not modes:
            raise self._refused(f"{name} has no power-mode")
        stops = tuple(
            self._stop(each, modes, usual) for each in element.findall("activities/static-activity")
        )
        hops = tuple(self._hop(each) for each in element.findall("activities/dynamic-activity"))
        if sum(stop.closes for stop in stops) != 1:
            raise self._refused(f"{name} must have one static-activity with last_in_cycle")
        own = {stop.number for stop in stops}
        for hop in hops:
            if not {hop.start, hop.end} <= own:
                raise self._refused(f"activity {hop.number} leads to another robot")
        return InstanceRobot(name, stops, hops, modes)

    def _stop(
        self, element: _Element, modes: dict[int, float], usual: dict[int, float]
    ) -> StaticActivity:
        number = self._activity(element)
        places = []
        for each in element.findall("locations/location"):
            power = dict(usual)
            for own in each.iter("consumption"):
                mode = self._whole(own.get("pid"), "pid of a consumption")
                power[mode] = self._real(own.get("input_power"), "input_power", 0.0)
            lid = self._choice(number, each.get("lid"))
            missing = sorted(set(modes) - set(power))
            if missing:
                raise self._refused(
                    f"activity {number}, location {lid}: no power in mode {missing[0]}"
                )
            point = self._whole(each.findtext("point"), "point")
            if point in self._stop_of:
                raise self._refused(f"point {point} is named twice")
            self._stop_of[point] = number
            places.append(StopLocation(lid, point, power))
        if not places:
            raise self._refused(f"activity {number} has no location")
        least, most = self._durations(element, number)
        closes = element.get("last_in_cycle") in ("true", "1")
        return StaticActivity(number, least, most, tuple(places), closes)

    def _hop(self, element: _Element) -> DynamicActivity:
        """A hop with its movements, all between the same two stops, and their energies as sums of
        powers.
        """
        number = self._activity(element)
        movements = []
        ends = set()
        for each in element.findall("movements/movement"):
            start = self._point(each, "from-point")
            end = self._point(each, "to-point")
            ends.add((self._stop_of[start], self._stop_of[end]))
            least, most = self._durations(each, number)
            if least <= 0.0:
                raise self._refused(f"activity {number}: min-duration is 0 s, must be positive")
            terms = tuple(
                (
                    self._whole(term.get("degree"), "degree", least=-10),
                    self._real(term.get("coeff"), "coeff"),
                )
                for term in each.findall("energy-function/monomial")
            )
            if not terms:
                raise self._refused(f"activity {number}: a movement has no energy-function")
            mid = self._choice(number, each.get("mid"))
            movements.append(HopMovement(mid, start, end, EnergyCurve(terms, least, most)))
        if len(ends) != 1:
            raise self._refused(
                f"activity {number} must have movements, all between the same two activities"
            )
        start, end = ends.pop()
        return DynamicActivity(number, start, end, tuple(movements))

    def _lag(self, element: _Element) -> TimeLag:
        earlier = self._known(element.findtext("from-activity"), "from-activity")
        later = self._known(element.findtext("to-activity"), "to-activity")
        length = self._number(element, "length")
        height = self._whole(element.findtext("height"), "height", least=-1000)
        return TimeLag(earlier, later, length, height)

    def _handovers(self, element: _Element) -> Iterator[Handover]:
        pairs: dict[tuple[int, int], set[tuple[int, int]]] = {}
        for each in element.iter("compatible-pair"):
            a, b = self._two(each)
            if a[0] > b[0]:
                a, b = b, a
            pairs.setdefault((a[0], b[0]), set()).add((a[1], b[1]))
        for stops, fits in pairs.items():
            yield Handover(stops, frozenset(fits))

    def _conflict(self, element: _Element) -> Conflict:
        return Conflict(*self._two(element))

    def _two(self, element: _Element) -> tuple[tuple[int, int], tuple[int, int]]:
        found = []
        for each in element:
            number = self._known(each.get("aid"), "aid")
            choice = self._whole(each.get("lid" if each.tag == "location" else "mid"), each.tag)
            if choice not in self._choices[number]:
                raise self._refused(f"activity {number} has no {each.tag} {choice}")
            found.append((number, choice))
        if len(found) != 2:
            raise self._refused(f"a <{element.tag}> has {len(found)} ends, must have 2")
        return found[0], found[1]

    # Values.

    def _all(self, path: str) -> list[_Element]:
        return self._element.findall(path)

    def _activity(self, element: _Element) -> int:
        number = self._whole(element.get("aid"), "aid")
        if number in self._choices:
            raise self._refused(f"activity {number} is there twice")
        self._choices[number] = set()
        return number

    def _choice(self, activity: int, text: str | None) -> int:
        number = self._whole(text, "lid or mid")
        if number in self._choices[activity]:
            raise self._refused(f"activity {activity} has {number} twice")
        self._choices[activity].add(number)
        return number

    def _known(self, text: str | None, what: str) -> int:
        number = self._whole(text, what)
        if number not in self._choices:
            raise self._refused(f"{what} {number} is no activity")
        return number

    def _point(self, element: _Element, what: str) -> int:
        point = self._whole(element.findtext(what), what)
        if point not in self._stop_of:
            raise self._refused(
                f"{what} {point} belongs to no location of this or an earlier robot"
            )
        return point

    def _durations(self, element: _Element, number: int) -> tuple[float, float]:
        least = self._number(element, "min-duration", 0.0)
        most = self._number(element, "max-duration", 0.0)
        if least > most:
            raise self._refused(
                f"activity {number}: min-duration {least:g} s exceeds max-duration {most:g} s"
            )
        return least, most

    def _number(self, element: _Element, key: str, least: float = -math.inf) -> float:
        return self._real(element.findtext(key), key, least)

    def _real(self, text: str | None, what: str, least: float = -math.inf) -> float:
        try:
            value = float(text if text is not None else "")
        except ValueError:
            value = math.nan
        if not (math.isfinite(value) and value >= least):
            bound = f" of at least {least:g}" if math.isfinite(least) else ""
            raise self._refused(f"{what} is {text!r}, must be a number{bound}")
        return value

    def _whole(self, text: str | None, what: str, least: int = 0) -> int:
        value = self._real(text, what, least)
        if value != int(value):
            raise self._refused(f"{what} is {text!r}, must be a whole number")
        return int(value)

    def _refused(self, sentence: str) -> SettingsError:
        return SettingsError(f"{self._place}: {sentence}")


def written(instances: list[Instance]) -> str:
    """The instances as a dataset that `read_instances` reads again."""
    root = _Element("dataset")
    for instance in instances:
        element = _sub(root, "instance")
        _sub(element, "name", instance.name)
        robots = _sub(element, "robots")
        for robot in instance.robots:
            _write_robot(_sub(robots, "robot"), robot)
        _write_operations(element, instance)
        zones = _sub(element, "collision-zones") if instance.conflicts else element
        for conflict in instance.conflicts:
            pair = _sub(zones, "collision-pair")
            for activity, choice in (conflict.first, conflict.second):
                _write_choice(pair, instance, activity, choice)
        _sub(element, "production-cycle-time", _decimal(instance.cycle))
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, "unicode") + "\n"


def _sub(parent: _Element, tag: str, text: str = "", **attributes: object) -> _Element:
    element = ElementTree.SubElement(parent, tag, {k: str(v) for k, v in attributes.items()})
    element.text = text or None
    return element


def _decimal(value: float) -> str:
    """A decimal without exponent, as the schema asks for, to 1e-9."""
    return f"{value:.9f}".rstrip("0").rstrip(".")


def _write_robot(element: _Element, robot: InstanceRobot) -> None:
    """Add a robot's stops, hops and power modes in the words of the published format."""
    _sub(element, "name", robot.name)
    activities = _sub(element, "activities")
    for stop in robot.stops:
        inner = _sub(activities, "static-activity", aid=stop.number)
        if stop.closes:
            inner.set("last_in_cycle", "true")
        _sub(inner, "min-duration", _decimal(stop.least))
        _sub(inner, "max-duration", _decimal(stop.most))
        places = _sub(inner, "locations")
        for place in stop.places:
            location = _sub(places, "location", lid=place.number)
            _sub(location, "point", str(place.point))
            powers = _sub(location, "location-dependent-power-consumption")
            for mode, watts in place.power.items():
                _sub(powers, "consumption", pid=mode, input_power=_decimal(watts))
    for hop in robot.hops:
        inner = _sub(activities, "dynamic-activity", aid=hop.number)
        movements = _sub(inner, "movements", from_aid=hop.start, to_aid=hop.end)
        for movement in hop.movements:
            one = _sub(movements, "movement", mid=movement.number)
            _sub(one, "from-point", str(movement.start))
            _sub(one, "to-point", str(movement.end))
            _sub(one, "min-duration", _decimal(movement.curve.least))
            _sub(one, "max-duration", _decimal(movement.curve.most))
            function = _sub(one, "energy-function")
            for degree, coefficient in movement.curve.terms:
                _sub(function, "monomial", degree=degree, coeff=_decimal(coefficient))
    modes = _sub(element, "power-saving-modes")
    for mode, shortest in robot.modes.items():
        _sub(_sub(modes, "power-mode", pid=mode), "minimal-idle-time", _decimal(shortest))


def _write_operations(element: _Element, instance: Instance) -> None:
    if not (instance.lags or instance.handovers):
        return
    operation = _sub(_sub(element, "inter-robot-operations"), "operation", oid=0)
    times = _sub(operation, "time-compatibility") if instance.lags else operation
    for lag in instance.lags:
        one = _sub(times, "time-lag")
        _sub(one, "from-activity", str(lag.earlier))
        _sub(one, "to-activity", str(lag.later))
        _sub(one, "length", _decimal(lag.length))
        _sub(one, "height", str(lag.height))
    places = _sub(operation, "spatial-compatibility") if instance.handovers else operation
    for handover in instance.handovers:
        for pair in sorted(handover.pairs):
            one = _sub(places, "compatible-pair")
            for activity, choice in zip(handover.stops, pair, strict=True):
                _sub(one, "location", aid=activity, lid=choice)


def _write_choice(pair: _Element, instance: Instance, activity: int, choice: int) -> None:
    robot = instance.robots[instance.robot_of[activity]]
    if any(stop.number == activity for stop in robot.stops):
        _sub(pair, "location", aid=activity, lid=choice)
    else:
        _sub(pair, "movement", aid=activity, mid=choice)
