"use strict";
/* Numbers out of base64, and time charts that share one zoom and one cursor. */

function bytes(text) {
  const raw = atob(text), out = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) out[i] = raw.charCodeAt(i);
  return out.buffer;
}
const floats = (text) => new Float32Array(bytes(text));
const shorts = (text) => new Int16Array(bytes(text));
const words = (text) => new Uint16Array(bytes(text));
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/* Index of the last element that is not beyond `value`, 0 at least. */
function floorIndex(times, value) {
  let low = 0, high = times.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= value) low = middle; else high = middle - 1;
  }
  return low;
}

/* Time shown by everything, and the part of it that the charts show. */
class Timeline {
  /* rests [[from, to]] s, in their order: stretches without a movement, that charts show short */
  constructor(end, rests = []) {
    this.rests = rests;
    this.end = Math.max(end, 1e-3);
    this.now = 0;
    this.from = 0;
    this.to = this.end;
    this.listeners = [];
  }
  onChange(listener) { this.listeners.push(listener); }
  seek(time) { this.now = Math.min(Math.max(time, 0), this.end); this.notify(); }
  zoom(from, to) {
    const least = Math.min(0.05, this.end);
    this.from = Math.max(0, Math.min(from, to - least));
    this.to = Math.min(this.end, Math.max(to, this.from + least));
    this.notify();
  }
  /* Rests that take much of what is shown, and the seconds of the axis that each of them takes. */
  breaks() {
    if (this.broken && this.broken.from === this.from && this.broken.to === this.to) return this.broken;
    let left = this.to - this.from;
    const inside = this.rests.filter(([from, to]) => from >= this.from && to <= this.to);
    const long = inside.sort((a, b) => b[1] - b[0] - (a[1] - a[0])).filter(([from, to]) => {
      if (to - from <= 0.15 * left) return false;
      left -= to - from;
      return true;
    }).sort((a, b) => a[0] - b[0]);
    const short = Math.max(left, 1e-3) * 0.07;
    this.broken = { from: this.from, to: this.to, long, short, whole: left + long.length * short };
    return this.broken;
  }
  /* Place of a time on the axis, 0 to 1, and back. */
  place(time) {
    const { long, short, whole } = this.breaks();
    let at = time - this.from;
    for (const [from, to] of long) if (time > from) at -= (Math.min(time, to) - from) * (1 - short / (to - from));
    return at / whole;
  }
  at(place) {
    const { long, short, whole } = this.breaks();
    let time = this.from + place * whole;
    for (const [from, to] of long) {
      if (time <= from) break;
      time = time - from < short ? from + (time - from) * (to - from) / short : time + to - from - short;
      if (time <= to) break;
    }
    return time;
  }
  notify() { for (const listener of this.listeners) listener(); }
  /* A time as people read it. */
  label(time) { return `${time.toFixed(2)} s`; }
  /* The same below an axis. */
  tick(time) { return `${+time.toFixed(3)} s`; }
}

const MODE_STYLE = /^m-/;
const SPAN_COLOURS = { pause: "--m-transition", regional: "--a1", service_entry: "--a2", service_exit: "--a5", cartesian: "--a4", load: "--part",
  none: "--line", bit: "--accent", moving: "--m-transition", contact: "--m-EMERGENCY_STOP" };
/* The variable of the page's style that colours a span. */
function spanVariable(style) {
  if (MODE_STYLE.test(style)) return css(`--${style}`) ? `--${style}` : "--m-transition";
  return SPAN_COLOURS[style] || "--a1";
}
const spanColour = (style) => css(spanVariable(style));

/* What the colours of the lanes of program and mode mean, of those that occur. */
function laneKey(place, lanes) {
  const KINDS = { regional: "regional movement", service_entry: "service movement to a station", service_exit: "service movement from a station",
    cartesian: "Cartesian movement", pause: "pause" };
  const meanings = new Map();
  for (const lane of lanes.filter((each) => each.label === "program" || each.label === "mode")) {
    for (const [, , label, style] of lane.spans) {
      const variable = spanVariable(style), mode = MODE_STYLE.test(style);
      const words = KINDS[style] || (mode && variable !== "--m-transition" ? label : mode ? "between two modes" : "");
      if (words && !meanings.has(words)) meanings.set(words, [variable, style, lane.label]);
    }
  }
  place.hidden = !meanings.size;
  const shown = [...meanings.keys()].join();
  if (place.shown === shown) return;
  place.shown = shown;
  place.replaceChildren();
  let named = "";
  for (const [words, [variable, style, lane]] of meanings) {
    if (lane !== named) place.append(Object.assign(document.createElement("b"), { textContent: `${lane}: ` }));
    named = lane;
    const item = document.createElement("span"), key = document.createElement("i");
    key.className = "key";
    key.style.background = `var(${variable})`;
    if (style === "pause") key.style.opacity = 0.45;
    item.append(key, words);
    place.append(item);
  }
  if (lanes.some((lane) => lane.label.endsWith(" ?"))) {
    place.append(Object.assign(document.createElement("span"), { textContent: "PLC: with ? what it asks of the controller (bus off: of the drives), without what the controller answers" }));
  }
}

class TimeChart {
  constructor(canvas, timeline, tip) {
    this.canvas = canvas;
    this.timeline = timeline;
    this.tip = tip;
    this.left = 96;
    this.right = 14;
    this.bottom = 24;
    this.drag = null;
    timeline.onChange(() => this.schedule());
    new ResizeObserver(() => this.schedule()).observe(canvas);
    canvas.addEventListener("pointerdown", (e) => this.down(e));
    canvas.addEventListener("pointermove", (e) => this.move(e));
    canvas.addEventListener("pointerup", (e) => this.up(e));
    for (const gone of ["pointerleave", "blur"]) canvas.addEventListener(gone, () => { this.tip.hidden = true; });
    canvas.addEventListener("dblclick", () => timeline.zoom(0, timeline.end));
    canvas.addEventListener("pointercancel", () => { this.drag = null; this.schedule(); });
    canvas.addEventListener("wheel", (e) => this.wheel(e), { passive: false });
    canvas.addEventListener("keydown", (e) => this.key(e));
  }
  /* Names left of the chart: all charts of a timeline have room for the longest. */
  rows() { return []; }
  schedule() {
    if (this.pending) return;
    this.pending = requestAnimationFrame(() => { this.pending = 0; this.paint(); });
  }
  /* Draws what is on the page; what is folded away is drawn when it opens. */
  paint() { if (this.canvas.offsetParent) this.draw(); }
  x(time) { return this.left + this.timeline.place(time) * (this.width - this.left - this.right); }
  time(x) { return this.timeline.at((x - this.left) / (this.width - this.left - this.right)); }
  position(event) { return event.clientX - this.canvas.getBoundingClientRect().left; }
  down(event) {
    this.drag = { start: this.position(event), now: this.position(event) };
    this.canvas.setPointerCapture(event.pointerId);
  }
  move(event) {
    const x = this.position(event);
    if (this.drag) { this.drag.now = x; this.schedule(); }
    const words = x >= this.left && x <= this.width - this.right ? this.describe(this.time(x)) : "";
    this.tip.hidden = !words;
    this.tip.textContent = words;
    this.tip.style.left = `${Math.min(event.clientX + 14, innerWidth - this.tip.offsetWidth - 8)}px`;
    this.tip.style.top = `${event.clientY + 16}px`;
  }
  up(event) {
    const drag = this.drag;
    this.drag = null;
    if (!drag) return;
    if (Math.abs(drag.now - drag.start) < 5) this.timeline.seek(this.time(drag.start));
    else this.timeline.zoom(this.time(Math.min(drag.start, drag.now)), this.time(Math.max(drag.start, drag.now)));
    this.schedule();
    this.move(event);
  }
  wheel(event) {
    if (!event.ctrlKey && !event.metaKey) return;
    event.preventDefault();
    const centre = this.time(this.position(event)), factor = Math.exp(event.deltaY * 0.002);
    this.timeline.zoom(centre - (centre - this.timeline.from) * factor, centre + (this.timeline.to - centre) * factor);
  }
  key(event) {
    const { from, to, now, end } = this.timeline, span = to - from;
    const acts = {
      ArrowLeft: () => this.timeline.seek(now - span / 50), ArrowRight: () => this.timeline.seek(now + span / 50),
      "+": () => this.timeline.zoom(now - span / 4, now + span / 4), "-": () => this.timeline.zoom(from - span / 2, to + span / 2),
      0: () => this.timeline.zoom(0, end),
    };
    if (!acts[event.key] || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    acts[event.key]();
    this.say(this.timeline.now);
  }
  /* The values at a time beside the cursor: what the pointer would show. */
  say(time) {
    const box = this.canvas.getBoundingClientRect();
    this.tip.textContent = this.describe(time);
    this.tip.hidden = !this.tip.textContent;
    this.tip.style.left = `${Math.min(box.left + this.x(time) + 10, innerWidth - this.tip.offsetWidth - 8)}px`;
    this.tip.style.top = `${box.top + 20}px`;
  }
  begin() {
    const scale = window.devicePixelRatio || 1, box = this.canvas.getBoundingClientRect();
    this.width = box.width;
    this.height = box.height;
    const compact = box.width < 520;
    if (this.canvas.width !== Math.round(box.width * scale)) this.canvas.width = Math.round(box.width * scale);
    if (this.canvas.height !== Math.round(box.height * scale)) this.canvas.height = Math.round(box.height * scale);
    const g = this.canvas.getContext("2d");
    g.setTransform(scale, 0, 0, scale, 0, 0);
    g.clearRect(0, 0, this.width, this.height);
    g.font = `12px ${getComputedStyle(document.body).fontFamily}`;
    g.textBaseline = "middle";
    for (const name of this.rows()) this.timeline.margin = Math.max(this.timeline.margin || 0, g.measureText(name).width + 12);
    this.left = Math.max(compact ? 68 : 96, this.timeline.margin || 0);
    return g;
  }
  timeAxis(g) {
    const { long, whole } = this.timeline.breaks(), wide = Math.min(8, this.width / 80), low = this.height - this.bottom / 2 + 2;
    const step = tickStep(whole / wide);
    g.textAlign = "center";
    let last = -Infinity;
    for (const [from, to] of long) this.rest(g, this.x(from), this.x(to), to - from);
    g.strokeStyle = css("--line");
    g.fillStyle = css("--soft");
    for (let t = Math.ceil(this.timeline.from / step) * step; t <= this.timeline.to + 1e-9; t += step) {
      const x = this.x(t), words = this.timeline.tick(t), half = g.measureText(words).width / 2;
      if (long.some(([from, to]) => t > from && t < to) || x - half < last + 8) continue;
      last = x + half;
      line(g, x, this.top, x, this.height - this.bottom);
      g.fillText(words, Math.min(x, this.width - half - 1), low);
    }
  }
  /* A rest that is shown short: a band with two strokes, and along it how long it is. */
  rest(g, from, to, seconds) {
    const middle = (from + to) / 2, bottom = this.height - this.bottom;
    g.fillStyle = css("--sky");
    g.fillRect(from, this.top, to - from, bottom - this.top);
    g.strokeStyle = css("--soft");
    for (const x of [middle - 3, middle + 3]) line(g, x - 3, bottom + 5, x + 3, bottom - 5);
    g.fillStyle = css("--ink");
    if (bottom - this.top < 130) return; /* no height for words: the chart above has them */
    const words = seconds < 600 ? `${Math.round(seconds)} s` : `${Math.round(seconds / 60)} min`;
    g.save();
    g.translate(middle, this.top + 6);
    g.rotate(-Math.PI / 2);
    g.textAlign = "right";
    g.fillText(`${words} cut`, 0, 0);
    g.restore();
  }
  valueAxis(g, low, high, unit, y) {
    const step = tickStep((high - low) / 5);
    g.textAlign = "right";
    for (let v = Math.ceil(low / step) * step; v <= high + 1e-9; v += step) {
      g.strokeStyle = css("--line");
      line(g, this.left, y(v), this.width - this.right, y(v));
      g.fillStyle = css("--soft");
      g.fillText(`${thousands(v)} ${unit}`, this.left - 8, y(v));
    }
  }
  /* What a line says, on the paper's colour, below the line: curves stay above it. */
  named(g, words, y) {
    const wide = g.measureText(words).width, down = Math.min(y + 10, this.height - this.bottom - 8);
    g.globalAlpha = 0.85;
    g.fillStyle = css("--card");
    g.fillRect(this.left + 2, down - 8, wide + 8, 16);
    g.globalAlpha = 1;
    g.fillStyle = css("--bad");
    g.textAlign = "left";
    g.fillText(words, this.left + 6, down);
  }
  cursor(g) {
    const x = this.x(this.timeline.now);
    if (x >= this.left - 1 && x <= this.width - this.right + 1) {
      g.strokeStyle = css("--accent");
      g.lineWidth = 1.5;
      line(g, x, 0, x, this.height - this.bottom);
      g.lineWidth = 1;
    }
    if (this.drag && Math.abs(this.drag.now - this.drag.start) >= 5) {
      g.globalAlpha = 0.18;
      g.fillStyle = css("--accent");
      g.fillRect(Math.min(this.drag.start, this.drag.now), 0, Math.abs(this.drag.now - this.drag.start), this.height - this.bottom);
      g.globalAlpha = 1;
    }
  }
  /* Clips what follows to the plot. */
  plot(g) {
    g.save();
    g.beginPath();
    g.rect(this.left, 0, this.width - this.left - this.right, this.height - this.bottom);
    g.clip();
  }
}

const thousands = (value) => value.toLocaleString("en", { maximumFractionDigits: 6 }).replaceAll(",", " ").replace(/^-0$/, "0");
function line(g, x0, y0, x1, y1) { g.beginPath(); g.moveTo(x0, y0); g.lineTo(x1, y1); g.stroke(); }
function tickStep(raw) {
  const power = 10 ** Math.floor(Math.log10(raw));
  return [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw * 0.999);
}

/* Program, modes, loads and PLC bits as lanes above the power curve. */
class PowerChart extends TimeChart {
  constructor(canvas, timeline, tip, data) {
    super(canvas, timeline, tip);
    this.power = data.power && { time: floats(data.power.time), low: floats(data.power.low), high: floats(data.power.high) };
    this.most = this.power ? this.power.high.reduce((a, b) => Math.max(a, b), 100) : 100;
    this.gap = Infinity; /* s: readings that are further apart are not joined */
    this.take(data.lanes);
  }
  rows() { return this.lanes.map((lane) => lane.label); }
  /* The lanes to draw; the chart grows with them. */
  take(lanes) {
    this.lanes = lanes;
    const tall = lanes.reduce((sum, lane) => sum + (lane.thin ? 15 : 26), 0);
    this.top = tall + 16;
    this.canvas.style.height = `${tall + 320}px`;
  }
  draw() {
    const g = this.begin();
    this.timeAxis(g);
    this.drawBands(g);
    this.drawLanes(g);
    if (this.power) this.drawPower(g);
    this.cursor(g);
  }
  /* The modes as a tint behind the power curve. */
  drawBands(g) {
    const lane = this.lanes.find((l) => l.label === "mode");
    this.plot(g);
    g.globalAlpha = 0.11;
    for (const [from, to, , style] of lane ? lane.spans : []) {
      if (to < this.timeline.from || from > this.timeline.to) continue;
      g.fillStyle = spanColour(style);
      g.fillRect(this.x(from), this.top, this.x(to) - this.x(from), this.height - this.bottom - this.top);
    }
    g.restore();
  }
  drawLanes(g) {
    let y = 2;
    for (const lane of this.lanes) {
      const height = lane.thin ? 11 : 21;
      g.fillStyle = css("--soft");
      g.textAlign = "right";
      g.fillText(lane.label, this.left - 8, y + height / 2 + 1);
      this.plot(g);
      for (const [from, to, label, style] of lane.spans) {
        if (to < this.timeline.from || from > this.timeline.to) continue;
        const x = Math.max(this.x(from), this.left - 2), wide = Math.max(Math.min(this.x(to), this.width) - x, 1);
        g.fillStyle = spanColour(style);
        g.globalAlpha = style === "pause" ? 0.45 : lane.thin ? 0.9 : 1;
        g.fillRect(x, y, Math.max(wide - 1, 1), height);
        g.globalAlpha = 1;
        if (!lane.thin) this.label(g, label, x, y + height / 2 + 1, wide, style);
      }
      g.restore();
      y += lane.thin ? 15 : 26;
    }
  }
  label(g, label, x, y, wide, style) {
    let shown = label;
    while (shown.length > 1 && g.measureText(shown).width > wide - 8) shown = shown.slice(0, -1);
    if (shown !== label) shown = shown.length > 3 ? `${shown.slice(0, -1)}…` : "";
    g.fillStyle = ["none", "pause", "moving"].includes(style) ? css("--ink") : "#fff";
    g.textAlign = "left";
    g.fillText(shown, x + 4, y);
  }
  drawPower(g) {
    const { time, low, high } = this.power, last = time.length - 1;
    const first = Math.max(floorIndex(time, this.timeline.from) - 1, 0);
    const until = Math.min(floorIndex(time, this.timeline.to) + 1, last);
    let most = 0;
    for (let i = first; i <= until; i++) most = Math.max(most, high[i]);
    most = Math.max(most * 1.08, 50);
    const y = (watts) => this.height - this.bottom - watts / most * (this.height - this.bottom - this.top);
    this.valueAxis(g, 0, most, "W", y);
    this.plot(g);
    /* one column of pixels shows the span of all readings in it, between the first and the last of them */
    const columns = [];
    for (let i = first; i <= until; i++) {
      const x = Math.round(this.x(time[i]) * 2) / 2, end = columns[columns.length - 1];
      if (end && end.x === x) { end.low = Math.min(end.low, low[i]); end.high = Math.max(end.high, high[i]); end.last = high[i]; }
      else columns.push({ x, low: low[i], high: high[i], first: high[i], last: high[i], apart: i > first && time[i] - time[i - 1] > this.gap });
    }
    g.beginPath();
    g.moveTo(columns[0].x, y(0));
    for (const c of columns) for (const watts of [c.first, c.high, c.last]) g.lineTo(c.x, y(watts));
    g.lineTo(columns[columns.length - 1].x, y(0));
    g.fillStyle = css("--accent");
    g.globalAlpha = 0.13;
    g.fill();
    g.globalAlpha = 1;
    g.strokeStyle = css("--accent");
    g.lineWidth = 1.3;
    g.beginPath();
    columns.forEach((c, k) => {
      if (k === 0 || c.apart) g.moveTo(c.x, y(c.first)); else g.lineTo(c.x, y(c.first));
      if (c.high > c.low) for (const watts of [c.high, c.low, c.last]) g.lineTo(c.x, y(watts));
    });
    g.stroke();
    g.lineWidth = 1;
    g.restore();
  }
  at(time) {
    if (!this.power) return NaN;
    return this.power.high[floorIndex(this.power.time, time)];
  }
  inLane(label, time) {
    const lane = this.lanes.find((l) => l.label === label);
    const span = lane && lane.spans.find(([from, to]) => time >= from && time <= to);
    return span ? span[2] : "";
  }
  describe(time) {
    const rows = [this.timeline.label(time)];
    if (this.power) rows.push(`${Math.round(this.at(time))} W`);
    for (const label of ["mode", "program", "load"]) {
      const words = this.inLane(label, time);
      if (words) rows.push(`${label}: ${words}`);
    }
    return rows.join("\n");
  }
}

class ClearanceChart extends TimeChart {
  constructor(canvas, timeline, tip, data) {
    super(canvas, timeline, tip);
    this.bound = data.safetyDistance;
    this.parts = data.clearance.map((c) => ({ time: floats(c.time), low: floats(c.low), label: c.label }));
    this.load = data.lanes.find((lane) => lane.label === "load");
    this.most = 0.1;
    for (const part of this.parts) for (const d of part.low) this.most = Math.max(this.most, d);
    this.most = Math.min(this.most, 0.8);
    this.top = 22; /* names of contacts stand above the curves */
  }
  draw() {
    const g = this.begin();
    this.timeAxis(g);
    let least = 0;
    for (const part of this.parts) for (const d of part.low) least = Math.min(least, d);
    const y = (d) => this.height - this.bottom - (d - least) / (this.most * 1.05 - least) * (this.height - this.bottom - this.top);
    this.valueAxis(g, least * 1000, this.most * 1000, "mm", (v) => y(v / 1000));
    this.plot(g);
    g.setLineDash([5, 4]);
    g.strokeStyle = css("--bad");
    line(g, this.left, y(this.bound), this.width, y(this.bound));
    g.setLineDash([]);
    for (const part of this.parts) {
      if (part.time[part.time.length - 1] < this.timeline.from || part.time[0] > this.timeline.to) continue;
      g.beginPath();
      part.time.forEach((t, i) => { const v = y(part.low[i]); if (i) g.lineTo(this.x(t), v); else g.moveTo(this.x(t), v); });
      g.strokeStyle = css("--a3");
      g.lineWidth = 1.6;
      g.stroke();
      g.lineWidth = 1;
    }
    this.contacts(g);
    g.restore();
    this.named(g, `safety distance ${+(this.bound * 1000).toFixed(1)} mm`, y(this.bound));
    this.cursor(g);
  }
  /* Between two curves the load may change: the hand touches the part, and no distance is drawn. */
  contacts(g) {
    const held = (part) => ((this.load ? this.load.spans : []).find(([from, to]) => from <= part.middle && part.middle <= to) || [0, 0, ""])[2];
    const known = this.parts.map((part) => ({ from: part.time[0], to: part.time[part.time.length - 1], middle: (part.time[0] + part.time[part.time.length - 1]) / 2 }));
    let free = this.left;
    g.textAlign = "center";
    g.fillStyle = css("--soft");
    for (let k = 1; k < known.length; k++) {
      const before = held(known[k - 1]), after = held(known[k]), middle = this.x((known[k - 1].to + known[k].from) / 2);
      if (before === after) continue;
      const words = after.length > before.length ? "grips" : "releases", wide = g.measureText(words).width;
      if (middle - wide / 2 < free || middle + wide / 2 > this.width) continue;
      g.fillText(words, middle, this.top + 8);
      free = middle + wide / 2 + 4;
    }
  }
  describe(time) {
    const part = this.parts.find((p) => time >= p.time[0] && time <= p.time[p.time.length - 1]);
    return part ? `${this.timeline.label(time)}\n${(part.low[floorIndex(part.time, time)] * 1000).toFixed(1)} mm\n${part.label}` : "";
  }
}

/* Light and dark, and paper in light: `repaint` draws everything anew, `paint` at once. */
function themes(repaint, paint) {
  const root = document.documentElement, scheme = matchMedia("(prefers-color-scheme: dark)");
  let theme = "";
  addEventListener("beforeprint", () => { theme = root.dataset.theme || ""; root.dataset.theme = "light"; paint(); });
  addEventListener("afterprint", () => {
    if (theme) root.dataset.theme = theme; else delete root.dataset.theme;
    repaint();
  });
  document.getElementById("theme").addEventListener("click", () => {
    const dark = root.dataset.theme ? root.dataset.theme === "dark" : scheme.matches;
    root.dataset.theme = dark ? "light" : "dark";
    repaint();
  });
  scheme.addEventListener("change", repaint);
}
