"use strict";
/* The reader's own price of electricity: every amount of the page follows, rounded as money_text.py rounds. Nothing leaves the page. */
const Amounts = (() => {
  const apart = (digits) => digits.replace(/\B(?=(\d{3})+(?!\d))/g, " ");
  const fixed = (value, decimals) => {
    const [whole, part] = Math.abs(value).toFixed(decimals).split("."), shown = part ? `${apart(whole)}.${part}` : apart(whole);
    return value < 0 && /[1-9]/.test(shown) ? `-${shown}` : shown;
  };
  const significant = (value, digits) => {
    if (!value) return "0";
    const rounded = Number(value.toPrecision(digits)), decimals = Math.max(digits - 1 - Math.floor(Math.log10(Math.abs(rounded))), 0);
    const shown = fixed(rounded, decimals);
    return decimals ? shown.replace(/0+$/, "").replace(/\.$/, "") : shown;
  };
  const cents = (value) => `${value < 0 && Math.abs(value) >= 0.005 ? "-" : ""}${Math.abs(value).toFixed(2)}`;
  const digits = (value) => Math.abs(value) >= 10 ? fixed(value, 0) : Math.abs(value) >= 1 ? cents(value) : significant(value, Math.abs(value) >= 0.001 ? 3 : 2);
  const yearly = (value) => Math.abs(value) < 1 ? cents(value) : digits(value);
  const rules = {
    m: ([value]) => digits(value),
    y: ([value]) => yearly(value),
    s: ([low, high], least) => {
      const show = (value) => Math.max(Math.abs(low), Math.abs(high)) >= 10 ? fixed(value, 0) : Math.abs(value) < least ? "0" : least === 0.01 ? cents(value) : digits(value);
      return `${show(low)} to ${show(high)}`.replace(/(\d) (?=\d)/g, "$1\u00a0");
    },
    h: ([value]) => significant(value, 2),
    t: ([value]) => significant(12 / value, 2),
    p: ([value]) => String(Number(value.toPrecision(6))),
  };
  /* The text of an amount at so many times the price that it was computed with. */
  return (carried, times) => {
    const [kind, list] = carried.split(":"), values = list.split(",").map(Number), least = kind === "s" ? values.pop() : 0; /* which follows no price */
    return rules[kind](values.map((value) => value * times), least);
  };
})();

function priceField() {
  const field = document.getElementById("price");
  if (!field) return;
  const first = Number(field.dataset.price), amounts = [...document.querySelectorAll("data[value]")], before = amounts.map((each) => each.textContent);
  const show = () => {
    const typed = Number(field.value.trim().replace(",", ".")), good = field.value.trim() !== "" && Number.isFinite(typed) && typed > 0;
    field.setAttribute("aria-invalid", String(!good));
    if (!good) return;
    document.documentElement.classList.toggle("repriced", typed !== first);
    amounts.forEach((each, k) => {
      const unit = before[k].replace(/^.*\d/, ""); /* what stands behind the number */
      each.textContent = typed === first ? before[k] : typesetWords(Amounts(each.getAttribute("value"), typed / first)) + unit;
    });
  };
  field.addEventListener("input", show);
  show(); /* what a browser restored */
}
