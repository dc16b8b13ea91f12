"""Amounts of money as text, and how a page shows them at a price that its reader types.

Of a `Repriced` currency each amount carries what it was rounded from, between characters that no
font has; `with_elements` makes an element of the page of it, whose script (price.js) rounds it anew
by the same rules.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from ir_recorder.analysis.production import Amount
from ir_recorder.report.number_text import DASH, significant, span_of, text, whole

NO_CENTS = 10.0  # of a currency: no cents from here on
NOTHING = 0.01  # of a currency, a year: nobody counts less
UNSEEN = 1e-4  # of a currency, a part or a shift
NEXT_TO_NOTHING = "practically nothing"

_BEGIN, _SHOWN, _END = "\ue000", "\ue001", "\ue002"
_CARRIED = re.compile(f"{_BEGIN}([a-z]+:[-+0-9.e,]+){_SHOWN}([^{_BEGIN}{_SHOWN}{_END}]*){_END}")
_IN_TAG = re.compile(f"<[^<>]*{_BEGIN}[^<>]*>")


class Repriced(str):
    """A currency whose amounts are in proportion to a price that a page's reader may change."""

    __slots__ = ()


def with_elements(page: str) -> str:
    """The page (HTML) with an element for each amount that follows the price; in attributes, which
    have none, the text alone.
    """
    if _BEGIN not in page:
        return page
    plain = _IN_TAG.sub(lambda tag: _CARRIED.sub(r"\2", tag[0]), page)
    return _CARRIED.sub(r'<data value="\1">\2</data>', plain)


def _carried(kind: str, values: Sequence[float], shown: str, currency: str) -> str:
    if not isinstance(currency, Repriced) or not all(map(math.isfinite, values)):
        return shown
    return f"{_BEGIN}{kind}:{','.join(f'{value:.9g}' for value in values)}{_SHOWN}{shown}{_END}"


def money(value: float, currency: str) -> str:
    """An amount with its currency; small ones with three significant digits, tiny ones with
    two.
    """
    if not math.isfinite(value):
        return DASH
    return _carried("m", (value,), f"{_digits(value)} {currency}", currency)


def _digits(value: float) -> str:
    if abs(value) >= NO_CENTS:
        return whole(value)
    if abs(value) >= 1.0:
        return f"{value:.2f}"
    return significant(value, 3 if abs(value) >= 0.001 else 2)


def yearly_money(value: float, currency: str) -> str:
    """An amount of a year; in words where it is below a hundredth of the currency."""
    if 0.0 < abs(value) < NOTHING:
        return NEXT_TO_NOTHING
    if not math.isfinite(value):
        return DASH
    return _carried("y", (value,), f"{_yearly_digits(value)} {currency}", currency)


def _yearly_digits(value: float) -> str:
    return f"{value:.2f}" if abs(value) < 1.0 else _digits(value)


def money_of(amount: Amount, currency: str) -> str:
    """An amount of a year that stands beside its interval: whole where the ends are."""
    if amount.low < amount.high:
        most = max(abs(amount.low), abs(amount.high))
        shown = whole(amount.value) if most >= NO_CENTS else _yearly_digits(amount.value)
        return _carried("o", (amount.value, most), f"{shown} {currency}", currency)
    return yearly_money(amount.value, currency)


def adding_up(
    parts: Sequence[float], currency: str, most: float = 0.0, *, yearly: bool = True
) -> list[str]:
    """Parts of an amount, rounded so that what is shown adds up to their sum as it is shown, of a
    year or as `money` has it (method of the largest remainder). most: the larger end of the sum's
    interval, where it stands beside one.
    """
    shown = groups_adding_up([[part] for part in parts], currency, most, yearly=yearly)
    return [whole for whole, _ in shown]


def groups_adding_up(
    groups: Sequence[Sequence[float]], currency: str, most: float = 0.0, *, yearly: bool = True
) -> list[tuple[str, list[str]]]:
    """The same of groups of parts: the sum of each group, and its parts. Groups add up to the
    total, parts to their group, so that a group is shown alike however it is divided.
    """
    show = _yearly_digits if yearly else _digits
    parts = [part for group in groups for part in group]
    if not all(map(math.isfinite, parts)):
        return [(DASH, [DASH for _ in group]) for group in groups]
    total = math.fsum(parts)
    decimals = 0 if most >= NO_CENTS else len(show(total).partition(".")[2])
    unit = 10.0**decimals
    sums = [math.fsum(group) * unit for group in groups]
    wholes = _largest_remainder(sums, round(float(f"{total:.{decimals}f}") * unit))
    kind = "a" if yearly else "b"
    sizes = [float(len(group)) for group in groups]

    def shown(count: int, place: int) -> str:
        words = f"{count / unit:,.{decimals}f} {currency}".replace(",", " ")
        carried = (*parts, most, *sizes, float(len(groups)), float(place))
        return _carried(kind, carried, words, currency)

    found = []
    for k, (group, sum_of) in enumerate(zip(groups, wholes, strict=True)):
        counts = _largest_remainder([part * unit for part in group], sum_of)
        own = [shown(count, _PLACES * k + j + 1) for j, count in enumerate(counts)]
        found.append((shown(sum_of, _PLACES * k), own))
    return found


def _largest_remainder(values: Sequence[float], total: int) -> list[int]:
    """Whole numbers near values (N,) that add up to a total near their sum."""
    counts = [math.floor(value) for value in values]
    missing = total - sum(counts)
    for k in sorted(range(len(values)), key=lambda k: counts[k] - values[k])[: max(missing, 0)]:
        counts[k] += 1
    for k in sorted(range(len(values)), key=lambda k: values[k] - counts[k])[: max(-missing, 0)]:
        counts[k] -= 1
    return counts


_PLACES = 1000  # more than parts: of which group, times this, and which part of it, from 1; 0: all


def larger_end(amount: Amount) -> float:
    """The larger end of an amount's interval; 0 without one."""
    return max(abs(amount.low), abs(amount.high)) if amount.low < amount.high else 0.0


def yearly_span(low: float, high: float, currency: str, least: float = NOTHING) -> str:
    """The ends of an amount of a year, without its currency: both whole where one is shown so; 0
    for one below `least`.
    """
    no_cents = max(abs(low), abs(high)) >= NO_CENTS

    def show(value: float) -> str:
        if no_cents:
            return whole(value)
        if abs(value) < least:
            return "0"
        return f"{value:.2f}" if least == NOTHING else _digits(value)

    return _carried("s", (low, high, least), span_of(low, high, show), currency)


def span_of_money(amount: Amount, currency: str) -> str:
    """The 90 % interval of an amount of a year, with its currency; "" without one."""
    if amount.low >= amount.high:
        return ""
    return f"{yearly_span(amount.low, amount.high, currency)} {currency}"


def hours_of(value: float, hour: float, currency: str) -> str:
    """How many hours at a price of their own an amount pays for."""
    return _carried("h", (value / hour,), significant(value / hour, 2), currency)


def months_of(value: float, hour: float, currency: str) -> str:
    """After how many months of a year's saving an hour at a price of its own is paid."""
    return _carried("t", (value / hour,), significant(12.0 * hour / value, 2), currency)


def price_of(value: float, currency: str) -> str:
    """The price of a kilowatt-hour, with its currency."""
    return _carried("p", (value,), f"{value:g} {currency}/kWh", currency)


def price_field(value: float, currency: str) -> str:
    """A field for the reader's own price of a kilowatt-hour (HTML); of a currency that doesn't
    follow it the price in words.
    """
    if not isinstance(currency, Repriced):
        return f"Electricity at {text(price_of(value, currency))}"
    return (
        f'<label>Electricity at <input id="price" type="text" inputmode="decimal" size="5" '
        f'value="{value:g}" data-price="{value!r}" autocomplete="off"> {text(currency)}/kWh</label>'
    )
