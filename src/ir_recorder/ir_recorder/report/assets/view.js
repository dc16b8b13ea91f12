"use strict";
/* A cell that is planned or replayed: shows what the server sends, and asks for what a hand does. */

const ROOM = 560; /* px wide, below which names of stations would hide the robot */

/* The cell with its robot in the motion, or where a hand put it; machines stand where they were moved to. */
class CellMotion extends Motion {
  constructor(canvas, timeline, scene, state) {
    super(canvas, timeline, scene, 0.02);
    this.state = state;
    this.show = { ...this.show, stations: true, names: true, reach: false };
  }
  take(scene) {
    super.take(scene);
    this.reach = scene.reach ? floats(scene.reach) : new Float32Array(0);
    for (const { name, pose } of scene.stations || []) {
      const element = document.createElement("span");
      element.className = "station";
      element.textContent = name;
      this.canvas.parentElement.append(element);
      this.labels.push({ element, point: [pose[12], pose[13], pose[14]], station: name, owner: "" });
    }
  }
  get hand() { return this.state && this.state.hand ? this.state.q : null; }
  /* Poses of all links for joint values [rad], of a rail [m]. */
  posesOf(q) {
    const poses = [new Float32Array(this.scene.base)];
    for (let i = 0; i < this.n; i++) poses.push(M4.times(poses[i], this.jointPose(i, q[i])));
    return poses;
  }
  linkPoses(frame) { return this.hand && this.hand.length === this.n && this.drawing ? this.posesOf(this.hand) : super.linkPoses(frame); }
  draw() { this.drawing = true; super.draw(); this.drawing = false; if (this.onDrawn) this.onDrawn(); }
  load(time) { return this.hand ? this.state.held || "none" : super.load(time); }
  place(part, time) { return this.hand ? (this.state.lies || {})[part.name] || null : super.place(part, time); }
  moved(owner) { return this.state && (this.state.moved || {})[owner]; }
  poseOf(thing) {
    const by = this.moved(thing.owner || thing.name);
    return by ? M4.times(by, thing.pose) : thing.pose;
  }
  stationPose(station) { return (this.state && (this.state.stood || {})[station.name]) || station.pose; }
  pointOf(label) {
    if (label.station) {
      const pose = this.stationPose(this.scene.stations.find((s) => s.name === label.station));
      return [pose[12], pose[13], pose[14]];
    }
    const by = this.moved(label.element.textContent);
    return by ? M4.point(by, label.point).slice(0, 3) : label.point;
  }
  placeLabels(view, box) {
    this.view = view;
    this.box = box;
    const all = this.labels;
    this.labels = all.filter((label) => (label.station ? this.show.stations && box.width >= ROOM : true) && this.show.names);
    for (const label of all) if (!this.labels.includes(label)) label.element.hidden = true;
    super.placeLabels(view, box);
    this.labels = all;
  }
  drawTrail(frame) { super.drawTrail(this.hand ? 0 : frame); }
  drawNearest() {
    if (this.show.stations) this.drawStations();
    if (this.show.reach) this.pairs(this.reach, this.tints.soft, { wide: 1.2, alpha: 0.7 });
    const near = this.state && this.state.near;
    if (!near || !this.show.pair || (!this.state.nearNow && !this.hand)) return;
    this.pairs(new Float32Array(near.slice(1, 7)), near[0] < 0.02 ? this.tints.bad : this.tints.a3, { wide: 3, onTop: true });
  }
  /* Each station as three short axes, and the way to it along the tool. */
  drawStations() {
    const points = [], tints = [], colours = [[0.85, 0.2, 0.2], [0.2, 0.62, 0.25], [0.2, 0.4, 0.9]];
    for (const station of this.scene.stations || []) {
      const pose = this.stationPose(station);
      for (let axis = 0; axis < 3; axis++) {
        points.push(pose[12], pose[13], pose[14], ...[0, 1, 2].map((i) => pose[12 + i] + 0.12 * pose[4 * axis + i]));
        tints.push(...colours[axis], ...colours[axis]);
      }
      points.push(pose[12], pose[13], pose[14], ...[0, 1, 2].map((i) => pose[12 + i] - station.approach * pose[i]));
      tints.push(...this.tints.soft, ...this.tints.soft);
    }
    if (!points.length) return;
    const path = this.renderer.path(new Float32Array(points), new Float32Array(tints), false);
    this.renderer.drawPath(path, { wide: 2.5 });
    this.renderer.release(path);
  }
  pairs(points, tint, how) {
    if (points.length < 6) return;
    const tints = new Float32Array(points.length);
    for (let i = 0; i < tints.length; i += 3) tints.set(tint, i);
    const path = this.renderer.path(points, tints, false);
    this.renderer.drawPath(path, how);
    this.renderer.release(path);
  }
  /* Where a place of the picture lies at a height [m]; null: nowhere before the eye. */
  onPlane(x, y, height) {
    const { turn, tilt, distance, target } = this.eye, wide = Math.tan(0.31), { width, height: high } = this.box;
    const eye = [target[0] + distance * Math.cos(tilt) * Math.cos(turn), target[1] + distance * Math.cos(tilt) * Math.sin(turn), target[2] + distance * Math.sin(tilt)];
    const ahead = unit(minus(target, eye)), right = unit(cross(ahead, [0, 0, 1])), up = cross(right, ahead);
    const across = (2 * x / width - 1) * wide * width / high, above = (1 - 2 * y / high) * wide;
    const ray = ahead.map((v, i) => v + across * right[i] + above * up[i]), t = (height - eye[2]) / ray[2];
    return t > 0 && t < 60 ? eye.map((v, i) => v + t * ray[i]) : null;
  }
  onScreen(point) {
    const [x, y, , w] = M4.point(this.view, point);
    return w < 0.1 ? null : [(x / w * 0.5 + 0.5) * this.box.width, (0.5 - y / w * 0.5) * this.box.height];
  }
}

/* Server-sent events by fetch, which can carry the token. */
async function events(url, headers, take) {
  const reply = await fetch(url, { headers });
  if (!reply.ok) throw new Error(await reply.text());
  const reader = reply.body.getReader(), decoder = new TextDecoder();
  let text = "";
  for (;;) {
    const { value, done } = await reader.read();
    if (done) return;
    text += decoder.decode(value, { stream: true });
    for (let at = text.indexOf("\n\n"); at >= 0; at = text.indexOf("\n\n")) {
      const lines = text.slice(0, at).split("\n");
      text = text.slice(at + 2);
      const of = (key) => lines.filter((line) => line.startsWith(`${key}: `)).map((line) => line.slice(key.length + 2)).join("\n");
      take(of("event"), of("data"));
    }
  }
}

(() => {
  const find = (id) => document.getElementById(id), state = {}, timeline = new Timeline(1);
  const data = { lanes: [], power: null, clearance: [], safetyDistance: 0.02 };
  const power = new PowerChart(find("power"), timeline, find("tip"), data);
  const clearance = new ClearanceChart(find("clearance"), timeline, find("tip"), data);
  const player = new Player(timeline);
  let motion = null, shownScene = "", heardAt = 0, lost = "";

  /* the token of the address: kept for this window, and taken out of what others may see */
  const remembered = `ir_view ${location.port}`, token = location.hash.slice(1) || sessionStorage.getItem(remembered) || "";
  if (location.hash) {
    sessionStorage.setItem(remembered, token);
    window.history.replaceState(null, "", location.pathname);
  }
  const headers = { "X-Live-Token": token };
  find("view-only").hidden = Boolean(token);

  /* One request at a time for each name: of a quick hand the last counts. */
  const waiting = new Map();
  const ask = async (name, value) => {
    if (waiting.has(name)) { waiting.set(name, { value }); return; }
    waiting.set(name, null);
    try {
      const reply = await fetch("/press", { method: "POST", headers: { ...headers, "Content-Type": "application/json" }, body: JSON.stringify({ name, value }) });
      const words = reply.ok ? await reply.json() : { done: false, sentence: await reply.text() };
      find("answer").textContent = words.done ? "" : words.sentence;
    } catch {
      find("answer").textContent = "the server has not answered";
    }
    const next = waiting.get(name);
    waiting.delete(name);
    if (next) ask(name, next.value);
  };

  const takeScene = async (number) => {
    shownScene = number;
    const reply = await fetch("/scene", { headers });
    if (!reply.ok) { shownScene = ""; return; }
    const shown = await reply.json();
    timeline.end = Math.max(shown.end, 1e-3);
    timeline.rests = shown.rests || [];
    timeline.broken = null;
    timeline.from = 0;
    timeline.to = timeline.end;
    player.take();
    power.power = shown.power && { time: floats(shown.power.time), low: floats(shown.power.low), high: floats(shown.power.high) };
    power.take(shown.lanes || []);
    laneKey(find("lane-key"), shown.lanes || []);
    clearance.parts = (shown.clearance || []).map((c) => ({ time: floats(c.time), low: floats(c.low), label: c.label }));
    clearance.load = (shown.lanes || []).find((lane) => lane.label === "load");
    clearance.bound = shown.safetyDistance;
    for (const part of document.querySelectorAll("#clearance")) {
      part.parentElement.hidden = part.parentElement.previousElementSibling.hidden = !clearance.parts.length;
    }
    find("over-time").hidden = !power.power;
    if (motion) motion.change(shown.scene); else {
      motion = new CellMotion(find("view"), timeline, shown.scene, state);
      motion.show.pair = true;
      motion.show.nearest = true; /* stations and reach are drawn with it */
      motion.onDrawn = placeHandle;
    }
    if (shown.peak) motion.scale(shown.peak);
    find("no-motion").hidden = true;
    find("trail-legend").hidden = !power.power;
    find("trail-max").textContent = `${thousands(Math.round(motion.mostPower))} W`;
    sliders(shown.joints);
    timeline.seek(Math.min(timeline.now, timeline.end));
  };

  /* joints by hand */
  const sliders = (joints) => {
    if (find("sliders").childElementCount === joints.length) return;
    axes = joints;
    find("sliders").replaceChildren(...joints.map(({ name, unit, low, high }, k) => {
      const label = element("label"), input = element("input"), output = element("output");
      Object.assign(input, { type: "range", min: low, max: high, step: unit === "m" ? 0.001 : 0.1, value: 0 });
      input.setAttribute("aria-label", `axis ${name}, ${unit === "m" ? "metres" : "degrees"}`);
      input.addEventListener("input", () => {
        output.textContent = axisText(k, Number(input.value));
        state.hand = true;
        const values = [...find("sliders").querySelectorAll("input")].map((each) => Number(each.value));
        state.q = values.map((value, j) => value / perUnit(j));
        motion.schedule();
        ask("joints", values);
      });
      label.append(element("span", name), input, output);
      return label;
    }));
  };
  /* How a joint's value is shown: degrees for each radian, metres as they are. */
  let axes = [];
  const perUnit = (k) => axes[k].unit === "m" ? 1 : 180 / Math.PI;
  const axisText = (k, value) => axes[k].unit === "m" ? `${value.toFixed(3)} m` : `${value.toFixed(1)}°`;
  const showJoints = () => {
    [...find("sliders").querySelectorAll("label")].forEach((label, k) => {
      const [input, output] = [label.querySelector("input"), label.querySelector("output")];
      if (document.activeElement !== input && state.q) {
        input.value = state.q[k] * perUnit(k);
        output.textContent = axisText(k, state.q[k] * perUnit(k));
      }
    });
  };

  /* machines and stations by hand */
  const NAMES = ["x mm", "y mm", "z mm", "A °", "B °", "C °"];
  const handle = element("button", "✥", "handle");
  handle.type = "button";
  handle.hidden = true;
  handle.setAttribute("aria-label", "move what is chosen: arrow keys by 10 mm, page up and down for the height");
  find("view").parentElement.append(handle);
  const chosen = () => find("target").value;
  const poseOf = () => (state.poses || {})[chosen()];
  const moveTo = (pose) => {
    state.poses[chosen()] = pose;
    placeHandle();
    fields();
    ask("move", [chosen(), ...pose]);
  };
  const fields = () => {
    const pose = poseOf();
    find("pose").hidden = !pose;
    if (!pose) return;
    if (find("pose").childElementCount !== 6) {
      find("pose").replaceChildren(...NAMES.map((name, k) => {
        const label = element("label"), input = element("input");
        Object.assign(input, { type: "number", step: k < 3 ? 1 : 0.1 });
        input.addEventListener("change", () => {
          const now = [...poseOf()];
          now[k] = Number(input.value) / (k < 3 ? 1000 : 1);
          moveTo(now);
        });
        label.append(element("span", name), input);
        return label;
      }));
    }
    [...find("pose").querySelectorAll("input")].forEach((input, k) => {
      if (document.activeElement !== input) input.value = +(pose[k] * (k < 3 ? 1000 : 1)).toFixed(1);
    });
  };
  function placeHandle() {
    const pose = poseOf(), at = pose && motion && motion.view ? motion.onScreen(pose) : null;
    handle.hidden = !at;
    if (at) { handle.style.left = `${at[0]}px`; handle.style.top = `${at[1]}px`; }
  }
  let grabbed = null;
  handle.addEventListener("pointerdown", (e) => {
    handle.setPointerCapture(e.pointerId);
    const box = find("view").getBoundingClientRect(), pose = poseOf(), at = motion.onPlane(e.clientX - box.left, e.clientY - box.top, pose[2]);
    grabbed = at && { off: [pose[0] - at[0], pose[1] - at[1]] };
  });
  handle.addEventListener("pointermove", (e) => {
    if (!grabbed) return;
    const box = find("view").getBoundingClientRect(), pose = [...poseOf()], at = motion.onPlane(e.clientX - box.left, e.clientY - box.top, pose[2]);
    if (at) moveTo([at[0] + grabbed.off[0], at[1] + grabbed.off[1], ...pose.slice(2)]);
  });
  for (const gone of ["pointerup", "pointercancel"]) handle.addEventListener(gone, () => { grabbed = null; });
  handle.addEventListener("keydown", (e) => {
    const steps = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [1, 1], ArrowDown: [1, -1], PageUp: [2, 1], PageDown: [2, -1] };
    if (!steps[e.key]) return;
    e.preventDefault();
    const pose = [...poseOf()], [axis, sign] = steps[e.key];
    pose[axis] += 0.01 * sign;
    moveTo(pose);
  });
  find("target").addEventListener("change", () => { fields(); if (motion) motion.schedule(); });
  const targets = () => {
    const names = Object.keys(state.poses || {}), select = find("target");
    if (select.options.length === names.length + 1 && names.every((name, k) => select.options[k + 1].value === name)) return;
    const before = select.value;
    select.replaceChildren(new Option("nothing", ""), ...names.map((name) => new Option(name, name)));
    select.value = names.includes(before) ? before : "";
  };

  /* what the server says */
  const VERDICTS = { planned: "good", failed: "bad", planning: "open", cancelled: "open", none: "open", recorded: "good" };
  const show = () => {
    document.title = state.name ? `${state.name} – ir view` : "ir view";
    find("subtitle").textContent = state.source || "";
    find("plant").textContent = state.origin || "Predicted, not driven";
    const plan = state.plan || { state: "none", lines: [] };
    const shows = plan.state !== "recorded" ? "cell and plan" : (state.origin || "").startsWith("Predicted") ? "the plan that was written" : "the recorded run";
    find("name").textContent = state.name ? `${state.name}: ${shows}` : "A cell";
    const gone = lost || (performance.now() - heardAt > 4000 ? "connection lost" : "");
    find("link").textContent = gone || { planned: "planned", failed: "not planned", planning: "planning", cancelled: "planning was cancelled", none: "nothing planned", recorded: "recorded" }[plan.state];
    find("link").className = `verdict ${gone ? "bad" : VERDICTS[plan.state]}`;
    const problems = [...(state.errors || [])];
    find("problem").hidden = !problems.length;
    find("problem").replaceChildren(...problems.map((words) => element("div", words)));
    showFigures(find("tiles"), state.tiles || []);
    find("tiles").hidden = !(state.tiles || []).length;
    find("plan-lines").replaceChildren(...(plan.lines || []).map((words) => element("p", words, plan.state === "failed" ? "bad" : "")));
    find("progress").hidden = find("cancel").hidden = plan.state !== "planning";
    find("progress").value = plan.share || 0;
    for (const id of ["plan", "compare"]) find(id).disabled = plan.state === "planning" || !token;
    find("recorded").hidden = !state.recorded || plan.state === "recorded";
    find("stations").replaceChildren(...(state.stations || []).map(([station, load, words, good, why]) => {
      const item = element("li"), button = element("button", "", good ? "good" : "bad");
      button.type = "button";
      button.disabled = !token;
      button.append(element("b", `${station} with ${load}`), element("small", words), ...(why ? [element("small", why)] : []));
      button.addEventListener("click", () => ask("at", station));
      item.append(button);
      return item;
    }), ...(state.checked === false ? [element("li", "checking …", "hint")] : []));
    find("snippet").hidden = find("undo").hidden = !state.snippet;
    find("save").hidden = !state.snippet;
    find("snippet").textContent = state.snippet || "";
    const near = state.near && (state.hand || state.nearNow) ? `nearest ${state.near[7]}` : "";
    find("now-shown").textContent = [state.note, near].filter(Boolean).join("; ");
    find("now-shown").className = `hint${near && state.near[0] < 0.02 ? " bad" : ""}`;
    find("compared").hidden = !state.compared;
    if (find("compared").shown !== state.compared) {
      find("compared").shown = state.compared;
      find("compared-tables").innerHTML = state.compared || ""; /* made by the page of `ir compare`, every text escaped */
    }
    targets();
    fields();
    if (motion) { motion.blamed = state.blamed || []; motion.schedule(); }
  };
  const take = (changes) => {
    const before = state.q;
    Object.assign(state, changes);
    if (changes.q) { state.q = changes.q; state.hand = changes.hand !== false; }
    if (state.q !== before) showJoints();
    if (state.scene && state.scene !== shownScene) takeScene(state.scene).catch(() => { shownScene = ""; });
  };
  const connect = async () => {
    try {
      await events("/events", headers, (name, text) => {
        heardAt = performance.now();
        lost = "";
        if (name === "start") { const { before, records } = JSON.parse(text); for (const each of [before, ...records]) take(each); }
        if (name === "records") for (const each of JSON.parse(text)) take(each);
        if (name) show();
      });
      lost = "connection lost";
    } catch (error) {
      lost = token ? "connection lost" : "open the whole address";
    }
    show();
    setTimeout(connect, 2000);
  };
  setInterval(show, 2000);

  /* the motion instead of the hand; the server says what is near there */
  let askedAt = 0;
  timeline.onChange(() => {
    if (!motion) return;
    if (state.hand && (player.playing || timeline.now !== state.since)) state.hand = false;
    if (performance.now() - askedAt < 250 && player.playing) return;
    askedAt = performance.now();
    if (timeline.now !== state.since) ask("time", timeline.now);
    state.since = timeline.now;
  });
  for (const id of ["plan", "cancel", "compare", "undo", "save", "recorded"]) find(id).addEventListener("click", () => ask(id, true));
  for (const button of document.querySelectorAll("[data-view]")) button.addEventListener("click", () => motion && motion.look(button.dataset.view));
  for (const [id, key] of [["zones", "zones"], ["trail", "trail"], ["nearest", "pair"], ["capsules", "capsules"], ["stations", "stations"], ["names", "names"], ["reach", "reach"]]) {
    find(`show-${id}`).addEventListener("change", (e) => { if (motion) { motion.show[key] = e.target.checked; motion.schedule(); } });
  }
  const charts = [power, clearance];
  themes(() => { for (const chart of charts) chart.schedule(); if (motion) motion.recolour(); },
    () => { for (const chart of charts) chart.paint(); if (motion) { motion.recolour(); motion.draw(); } });
  exportButtons();
  connect();
})();
