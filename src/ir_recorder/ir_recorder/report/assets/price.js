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
  const remainders = (values, total) => { /* whole numbers that add up: of the largest remainder */
    const counts = values.map(Math.floor), missing = total - counts.reduce((sum, count) => sum + count, 0), order = values.map((_, k) => k);
    for (const k of order.sort((a, b) => (counts[a] - values[a]) - (counts[b] - values[b])).slice(0, Math.max(missing, 0))) counts[k] += 1;
    for (const k of values.map((_, j) => j).sort((a, b) => (values[a] - counts[a]) - (values[b] - counts[b])).slice(0, Math.max(-missing, 0))) counts[k] -= 1;
    return counts;
  };
  const adding = (values, place, sizes, show) => { /* one of the parts of a sum, which add up as they are shown */
    const parts = values.slice(0, -1), sum = (list) => list.reduce((all, value) => all + value, 0), total = sum(parts);
    const decimals = values[values.length - 1] >= 10 ? 0 : (show(total).split(".")[1] || "").length, unit = 10 ** decimals, groups = [];
    for (const size of sizes) groups.push(parts.splice(0, size));
    const wholes = remainders(groups.map((group) => sum(group) * unit), Math.round(Number(total.toFixed(decimals)) * unit)), k = Math.floor(place / 1000), part = place % 1000;
    return fixed((part ? remainders(groups[k].map((value) => value * unit), wholes[k])[part - 1] : wholes[k]) / unit, decimals);
  };
  const rules = {
    m: ([value]) => digits(value),
    y: ([value]) => yearly(value),
    o: ([value, most]) => most >= 10 ? fixed(value, 0) : yearly(value),
    s: ([low, high], least) => {
      const show = (value) => Math.max(Math.abs(low), Math.abs(high)) >= 10 ? fixed(value, 0) : Math.abs(value) < least ? "0" : least === 0.01 ? cents(value) : digits(value);
      return `${show(low)} to ${show(high)}`.replace(/(\d) (?=\d)/g, "$1\u00a0");
    },
    a: (values, place, sizes) => adding(values, place, sizes, yearly),
    b: (values, place, sizes) => adding(values, place, sizes, digits),
    h: ([value]) => significant(value, 2),
    t: ([value]) => significant(12 / value, 2),
    p: ([value]) => String(Number(value.toPrecision(6))),
  };
  /* The text of an amount at so many times the price that it was computed with. */
  return (carried, times) => {
    const [kind, list] = carried.split(":"), values = list.split(",").map(Number), last = "sab".includes(kind) ? values.pop() : 0;
    const groups = "ab".includes(kind) ? values.pop() : 0, sizes = groups ? values.splice(-groups) : []; /* what follows no price */
    return rules[kind](values.map((value) => value * times), last, sizes);
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
