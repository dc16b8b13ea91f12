"use strict";
/* Curves of the axes: one chart per quantity, with the limits of the robot, on the time axis of all charts. */

/* How named curves differ, as in marks.py: a colour, a mark, and beyond seven a dash too. */
const COLOURS = 7, DASHES = [[], [7, 4], [2, 3]], APART = 90; /* pixels between the marks on a curve */
const ENDS = 84, LINE = 13; /* pixels of names at the ends of curves, wide and high */
const MARKS = [
  "M-4 0A4 4 0 1 0 4 0A4 4 0 1 0 -4 0Z", "M-3.6 -3.6H3.6V3.6H-3.6Z", "M0 -4.8L4.6 3.4H-4.6Z", "M0 -5.2L5.2 0L0 5.2L-5.2 0Z",
  "M0 4.8L4.6 -3.4H-4.6Z", "M-1.4 -4.6H1.4V-1.4H4.6V1.4H1.4V4.6H-1.4V1.4H-4.6V-1.4H-1.4Z", "M-5 -2H5V2H-5Z", "M-2 -5H2V5H-2Z",
];
const look = (k) => ({ colour: `--s${k % COLOURS + 1}`, mark: MARKS[k % MARKS.length], dash: DASHES[Math.floor(k / COLOURS) % DASHES.length] });

/* A piece of a named curve, for the box that shows it. */
function sample(k) {
  const { colour, mark, dash } = look(k), key = document.createElement("span");
  key.className = "sample";
  key.style.color = `var(${colour})`;
  key.innerHTML = `<svg viewBox="-17 -7 34 14" aria-hidden="true"><path d="M-17 0H17" fill="none" stroke="currentColor" stroke-width="1.6"
    stroke-dasharray="${dash.join(" ")}"/><path d="${mark}" fill="currentColor"/></svg>`;
  return key;
}

class AxesChart extends TimeChart {
  constructor(canvas, timeline, tip, curves, shown) {
    super(canvas, timeline, tip);
    const scaled = (text) => Float32Array.from(shorts(text), (v) => v * curves.step);
    this.curves = curves;
    this.times = floats(curves.time);
    this.high = scaled(curves.high);
    this.low = curves.low ? scaled(curves.low) : this.high;
    this.shown = shown;
    this.top = 8;
    this.right = curves.few ? ENDS : 14;
  }
  /* Curves that matter, where not all do: named at their ends, the others pale and without marks. */
  matters(k) { return !this.curves.few || this.curves.few.includes(k); }
  /* Whether a value is not drawn as it lies above what is shown. */
  beyond(value) { return this.curves.most !== undefined && value >= 0.999 * this.curves.most; }
  names() {
    if (this.curves.names) return this.curves.names;
    return this.curves.series === "axes" ? Array.from({ length: this.curves.count }, (_, k) => `A${k + 1}`) : [this.curves.series];
  }
  used() { return this.names().map((_, k) => k).filter((k) => this.curves.series !== "axes" || this.shown.axes[k]); }
  draw() {
    const g = this.begin();
    this.timeAxis(g);
    const n = this.curves.count, axes = this.used(), limits = this.shown.limits ? this.curves.limits : null;
    const first = Math.max(floorIndex(this.times, this.timeline.from) - 1, 0);
    const until = Math.min(floorIndex(this.times, this.timeline.to) + 1, this.times.length - 1);
    let least = 0, most = 0;
    for (const k of axes) {
      for (let i = first; i <= until; i++) { least = Math.min(least, this.low[i * n + k]); most = Math.max(most, this.high[i * n + k]); }
      if (limits) { least = Math.min(least, limits[k][0]); most = Math.max(most, limits[k][1]); }
    }
    const room = Math.max(most - least, 1e-6) * 0.04, low = least - room, high = most + room;
    const y = (v) => this.height - this.bottom - (v - low) / (high - low) * (this.height - this.bottom - this.top);
    this.valueAxis(g, low, high, this.curves.unit, y);
    this.plot(g);
    for (const k of axes) {
      const named = this.curves.series === "axes" ? look(k) : null;
      g.strokeStyle = css(named ? named.colour : "--accent");
      if (limits) {
        g.setLineDash([6, 4]);
        for (const bound of limits[k]) line(g, this.left, y(bound), this.width - this.right, y(bound));
        g.setLineDash([]);
      }
      if (named) g.setLineDash(named.dash);
      g.globalAlpha = this.matters(k) ? 1 : 0.35;
      this.curve(g, k, first, until, y);
      g.setLineDash([]);
      g.globalAlpha = 1;
      if (named && this.matters(k)) this.marks(g, k, y, named);
    }
    g.restore();
    if (this.curves.few) this.ends(g, axes, until, y);
    this.cursor(g);
  }
  /* Names at the ends of the curves that matter, below each other. */
  ends(g, axes, until, y) {
    const n = this.curves.count, value = (k) => this.high[until * n + k], names = this.names();
    const found = axes.filter((k) => this.matters(k) && !this.beyond(value(k))).sort((a, b) => value(b) - value(a));
    const lowest = this.height - this.bottom - LINE * (found.length - 1);
    let next = this.top + LINE / 2;
    g.textAlign = "left";
    g.textBaseline = "middle";
    found.forEach((k, place) => {
      next = Math.max(next, Math.min(y(value(k)), lowest + LINE * place));
      g.fillStyle = css("--ink");
      g.fillText(names[k], this.width - this.right + 6, next);
      next += LINE;
    });
    g.textBaseline = "alphabetic";
  }
  /* One column of pixels shows the span of all values in it. */
  curve(g, k, first, until, y) {
    const n = this.curves.count;
    let column = NaN, low = 0, high = 0, begun = false;
    const put = () => {
      if (Number.isNaN(column)) return;
      if (begun) g.lineTo(column, y(high)); else g.moveTo(column, y(high));
      if (high > low) g.lineTo(column, y(low));
      begun = true;
    };
    g.lineWidth = 1.3;
    g.beginPath();
    const last = this.curves.ends ? Math.min(until, floorIndex(this.times, this.curves.ends[k])) : until;
    for (let i = first; i <= last; i++) {
      if (this.beyond(this.high[i * n + k])) { put(); column = NaN; begun = false; continue; }
      const x = Math.round(this.x(this.times[i]) * 2) / 2;
      if (x === column) { low = Math.min(low, this.low[i * n + k]); high = Math.max(high, this.high[i * n + k]); continue; }
      put();
      [column, low, high] = [x, this.low[i * n + k], this.high[i * n + k]];
    }
    put();
    g.stroke();
    g.lineWidth = 1;
  }
  /* Marks on a named curve, beside those of the others. */
  marks(g, k, y, { colour, mark }) {
    const n = this.curves.count, path = new Path2D(mark), last = this.curves.ends ? this.curves.ends[k] : Infinity;
    g.fillStyle = css(colour);
    for (let x = this.left + (0.3 + k / n) * APART; x < this.width - this.right; x += APART) {
      const time = this.time(x);
      if (time > last) break;
      const value = this.high[floorIndex(this.times, time) * n + k];
      if (this.beyond(value)) continue;
      g.save();
      g.translate(x, y(value));
      g.fill(path);
      g.restore();
    }
  }
  describe(time) {
    const i = floorIndex(this.times, time), n = this.curves.count, names = this.names();
    const rows = this.used().map((k) => `${names[k]}  ${(+this.high[i * n + k].toPrecision(4))} ${this.curves.unit}`);
    return rows.length ? [`${this.timeline.label(time)}  ${this.curves.name}`, ...rows].join("\n") : "";
  }
}

/* Toggles for axes, quantities and limits, and a chart for each quantity. */
function axesSection(place, timeline, tip, list) {
  const shown = { axes: Array(list.reduce((n, c) => Math.max(n, c.count), 0)).fill(true), limits: false }, charts = [];
  const bar = place.querySelector(".toggles"), most = list.reduce((n, c) => Math.max(n, c.series === "axes" ? c.count : 0), 0);
  const toggle = (label, checked, change, style) => {
    const box = document.createElement("label"), input = document.createElement("input");
    input.type = "checkbox";
    input.checked = checked;
    input.addEventListener("change", () => { change(input.checked); for (const c of charts) c.schedule(); });
    box.append(input);
    if (typeof style === "number") box.append(sample(style));
    else if (style) { const key = document.createElement("i"); key.className = `key ${style}`; box.append(key); }
    box.append(label);
    bar.append(box);
  };
  const names = list.length && list[0].names;
  for (let k = 0; k < most; k++) toggle(names ? names[k] : `A${k + 1}`, true, (on) => { shown.axes[k] = on; }, k);
  if (list.some((c) => c.limits)) toggle("limits", false, (on) => { shown.limits = on; });
  for (const curves of list) {
    const figure = document.createElement("figure"), caption = document.createElement("figcaption"), canvas = document.createElement("canvas");
    figure.className = "chart axis-chart";
    caption.textContent = `${curves.name} [${curves.unit}]`;
    canvas.tabIndex = 0;
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `${curves.name} over time`);
    canvas.dataset.name = curves.name;
    figure.append(caption, canvas);
    figure.hidden = !curves.shown;
    place.append(figure);
    charts.push(new AxesChart(canvas, timeline, tip, curves, shown));
    if (list.length > 1) toggle(curves.name, curves.shown, (on) => { figure.hidden = !on; });
  }
  return charts;
}
