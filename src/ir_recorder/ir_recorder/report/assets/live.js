"use strict";
/* Keeps what the server sends, and shows it: now, or at the time that was clicked. */

const WINDOW = 60, KEPT_SECONDS = 600, PRUNE = 500;
const LANE_BITS = [["in", "ab", "bus off ?"], ["in", "hib", "hibernate ?"], ["in", "emergency_stop", "stop ?"], ["out", "bbs", "ready"], ["out", "ab", "bus off"],
  ["out", "drives_ready", "drives ready"]];

/* Follows the present until somebody looks at the past. */
class LiveTimeline extends Timeline {
  constructor() {
    super(0);
    this.follows = true;
    this.epoch = 0;
    this.start = 0;
  }
  advance(time) {
    this.end = time;
    if (this.follows) { this.now = time; this.to = time; this.from = Math.max(time - WINDOW, this.start); }
    this.notify();
  }
  follow() { this.follows = true; this.advance(this.end); }
  seek(time) {
    this.follows = false;
    this.now = Math.min(Math.max(time, this.start), this.end);
    this.notify();
  }
  zoom(from, to) {
    if (from <= this.start && to >= this.end) { this.follow(); return; }
    this.follows = false;
    this.from = Math.max(this.start, Math.min(from, to - 0.05));
    this.to = Math.min(this.end, Math.max(to, this.from + 0.05));
    this.notify();
  }
  tick(time) { return new Date((this.epoch + time) * 1000).toLocaleTimeString("en-GB"); }
  label(time) { return `${this.tick(time)}${this.end - time >= 0.5 ? `, ${(this.end - time).toFixed(1)} s ago` : ""}`; }
}

/* Records with all values each: a record that came holds what changed. */
class History {
  constructor() { this.records = []; this.lanes = new Map(); }
  get last() { return this.records[this.records.length - 1]; }
  index(time) {
    let low = 0, high = this.records.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.records[middle].t <= time) low = middle; else high = middle - 1;
    }
    return Math.max(low, 0);
  }
  begin(before) {
    this.records = [before];
    this.lanes = new Map();
    this.mark(before);
  }
  add(change) {
    const record = { ...this.last, ...change };
    delete record.tool;
    this.records.push(record);
    this.mark(record);
    if (this.records.length % PRUNE === 0) this.prune(record.t - KEPT_SECONDS);
  }
  prune(until) {
    this.records.splice(0, this.index(until));
    for (const [label, lane] of this.lanes) {
      lane.spans = lane.spans.filter(([, to]) => to >= until);
      if (!lane.spans.length) this.lanes.delete(label);
    }
  }
  mark(r) {
    const step = r.step && r.step.event === "started" ? r.step : null;
    this.span("program", r.t, step ? step.label : "", step ? step.kind : "");
    this.span("mode", r.t, r.w ? modeWords(r.mode) : "", `m-${r.mode}`);
    this.span("load", r.t, r.load === "none" ? "" : r.load || "", "load");
    for (const [side, bit, label] of LANE_BITS) this.span(label, r.t, (r[side] || {})[bit] ? "1" : "", "bit", true);
  }
  /* The value of a lane from now on; "" for none. */
  span(label, t, value, style, thin = false) {
    let lane = this.lanes.get(label);
    if (!lane) {
      if (!value) return;
      this.lanes.set(label, lane = { label, thin, spans: [], open: "" });
    }
    const last = lane.spans[lane.spans.length - 1];
    if (lane.open) last[1] = t;
    if (value !== lane.open) {
      if (value) lane.spans.push([t, t, value, style]);
      lane.open = value;
    }
  }
  ordered() {
    const order = ["program", "mode", "load", ...LANE_BITS.map(([, , label]) => label)];
    return order.filter((label) => this.lanes.has(label)).map((label) => this.lanes.get(label));
  }
}

class LivePowerChart extends PowerChart {
  constructor(...parts) { super(...parts); this.gap = 1.5; }
  show(history) {
    const lanes = history.ordered();
    if (lanes.length !== this.lanes.length) this.take(lanes); else this.lanes = lanes;
    const read = history.records.filter((r) => r.w);
    this.power = read.length > 1 ? { time: read.map((r) => r.t), low: read.map((r) => r.w[0]), high: read.map((r) => r.w[1]) } : null;
  }
}

class LiveClearanceChart extends ClearanceChart {
  show(history, bound) {
    this.bound = bound;
    this.load = history.lanes.get("load");
    this.parts = [];
    let part = null;
    for (const r of history.records) {
      if (!r.near) { part = null; continue; }
      if (!part) this.parts.push(part = { time: [], low: [], label: "" });
      part.time.push(r.t);
      part.low.push(r.near[0]);
      part.label = r.near[7];
      this.most = Math.min(Math.max(this.most, r.near[0]), 0.8);
    }
  }
}

(() => {
  const find = (id) => document.getElementById(id);
  const timeline = new LiveTimeline(), history = new History();
  const data = { lanes: [], power: null, clearance: [], safetyDistance: 0.02 };
  const power = new LivePowerChart(find("power"), timeline, find("tip"), data);
  const clearance = new LiveClearanceChart(find("clearance"), timeline, find("tip"), data);
  let motion = null, token = "", sceneShown = "", sceneAsked = "", energyBefore = null, mostPower = 1, heardAt = performance.now(), connected = false;

  /* the token of the address: kept for this window, and taken out of what others may see */
  const remembered = `ir_live ${location.port}`;
  token = location.hash.slice(1) || sessionStorage.getItem(remembered) || "";
  if (location.hash) {
    sessionStorage.setItem(remembered, token);
    window.history.replaceState(null, "", location.pathname);
  }

  const press = async (name, value) => {
    const said = BIT_WORDS[name] || name;
    find("answer").textContent = `${said} = ${value ? 1 : 0} …`;
    try {
      const reply = await fetch("/press", { method: "POST", headers: { "Content-Type": "application/json", "X-Live-Token": token },
        body: JSON.stringify({ name, value: { level: value, stop: (history.last || {}).stop || "" } }) });
      const words = reply.ok ? await reply.json() : { done: false, sentence: await reply.text() };
      find("answer").textContent = `${said} = ${value ? 1 : 0}: ${words.done ? "done" : "refused"}${words.sentence ? `, ${words.sentence}` : ""}`;
    } catch {
      find("answer").textContent = `${said}: the server has not answered`;
    }
  };
  const bits = new Bits(find("inputs"), find("outputs"), find("stop"), find("hold"), press);
  find("view-only").hidden = Boolean(token);

  const takeScene = async (number) => {
    sceneAsked = number;
    const reply = await fetch("/scene");
    const scene = reply.ok ? await reply.json() : null;
    if (!scene) { sceneAsked = ""; return; }
    if (motion) motion.change(scene); else {
      motion = new LiveMotion(find("view"), timeline, scene, history);
      motion.pairs = find("show-nearest").checked;
      motion.show.nearest = true; /* the planned path is drawn with it */
    }
    sceneShown = number;
    scale();
    find("no-motion").hidden = true;
    timeline.notify();
  };

  /* what is heard of whom */
  const link = () => {
    const heard = (history.last || {}).heard || {}, silent = performance.now() - heardAt > 3000;
    const lost = !connected || silent;
    const [words, kind] = lost ? ["connection lost", "bad"] : heard.driver ? (isStopped(history.last) ? ["live, stopped", "bad"] : ["live", "good"]) : ["no driver heard", "open"];
    find("link").textContent = words;
    find("link").className = `verdict ${kind}`;
    const missing = ["planner", "runner"].filter((name) => !heard[name]);
    find("subtitle").textContent = lost ? "the picture is the last that was heard" : missing.length ? `live view; not heard: ${missing.join(", ")}` : "live view of the running nodes";
    return !lost && Boolean(heard.driver);
  };

  const show = () => {
    const last = history.last;
    if (!last) return;
    const state = history.records[history.index(timeline.now)];
    if (last.energy !== undefined && energyBefore === null) energyBefore = last.energy;
    if (last.energy < energyBefore) energyBefore = last.energy; /* another driver */
    find("name").textContent = last.cell ? `${last.cell}: the running nodes` : "A cell";
    document.title = last.cell ? `${last.cell} – live` : "Live view";
    find("plant").textContent = last.plant ? `Simulated, not measured: plant ${last.plant}` : "plant not heard";
    find("problem").hidden = !last.problem;
    find("problem").textContent = last.problem || "";
    showFigures(find("tiles"), figures(state, energyBefore === null ? null : last.energy - energyBefore));
    bits.show(last, link() && Boolean(token), Boolean(token));
    const stands = standing(last);
    if (find("standing").textContent !== stands) find("standing").textContent = stands;
    find("stopping").classList.toggle("stopped", isStopped(last));
    laneKey(find("lane-key"), power.lanes);
    if (find("machines").shown !== last.machines) { find("machines").shown = last.machines; showMachines(find("machines"), last.machines); }
    if (last.contact) find("contacts").textContent = `${last.contact.number}, the last: ${last.contact.words}`;
    if (last.scene && last.scene !== sceneShown && last.scene !== sceneAsked) takeScene(last.scene).catch(() => { sceneAsked = ""; });
    find("now").setAttribute("aria-pressed", String(timeline.follows));
    find("clock").textContent = timeline.tick(timeline.now);
    find("when").textContent = timeline.follows ? "" : `${(timeline.end - timeline.now).toFixed(1)} s ago`;
  };
  const scale = () => {
    motion.mostPower = mostPower;
    find("trail-max").textContent = `${thousands(Math.round(mostPower))} W`;
  };
  const update = () => {
    power.show(history);
    clearance.show(history, history.last.bound);
    if (motion) {
      motion.bound = history.last.bound;
      mostPower = Math.max(mostPower, history.last.w ? history.last.w[1] : 0);
      scale();
    }
    timeline.start = history.records[0].t;
    timeline.advance(history.last.t);
  };
  timeline.onChange(show);

  /* events: the server sends, this page asks again when the connection broke */
  const connect = () => {
    const source = new EventSource("/events");
    const alive = () => { heardAt = performance.now(); connected = true; };
    source.addEventListener("start", (event) => {
      const content = JSON.parse(event.data);
      timeline.epoch = content.epoch;
      history.begin(content.before);
      for (const record of content.records) history.add(record);
      mostPower = history.records.reduce((most, r) => Math.max(most, r.w ? r.w[1] : 0), 1);
      alive();
      update();
    });
    source.addEventListener("records", (event) => {
      for (const record of JSON.parse(event.data)) history.add(record);
      alive();
      update();
    });
    source.addEventListener("error", () => {
      connected = false;
      show();
      if (source.readyState === EventSource.CLOSED) { source.close(); setTimeout(connect, 3000); }
    });
  };
  setInterval(show, 1000);

  find("now").addEventListener("click", () => timeline.follow());
  for (const button of document.querySelectorAll("[data-view]")) button.addEventListener("click", () => motion && motion.look(button.dataset.view));
  for (const name of ["zones", "trail", "plan", "capsules"]) {
    find(`show-${name}`).addEventListener("change", (e) => { if (motion) { motion.show[name] = e.target.checked; motion.schedule(); } });
  }
  find("show-nearest").addEventListener("change", (e) => { if (motion) { motion.pairs = e.target.checked; motion.schedule(); } });
  const painted = [power, clearance];
  themes(() => { for (const chart of painted) chart.schedule(); if (motion) motion.recolour(); },
    () => { for (const chart of painted) chart.paint(); if (motion) { motion.recolour(); motion.draw(); } });
  exportButtons();
  connect();
})();
