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
