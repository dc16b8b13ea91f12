"use strict";
/* The cell in 3D: forward kinematics from joint values, orbiting eye, tool path coloured by power. */

const RAMP = ["#2c6fd1", "#12b5cb", "#58c45b", "#f5c211", "#e8590c", "#c92a2a"];

class Motion {
  constructor(canvas, timeline, scene, bound) {
    this.bound = bound; /* m: a nearest pair below it is drawn in red */
    this.canvas = canvas;
    this.timeline = timeline;
    this.renderer = GlRenderer.create(canvas) || new PlainRenderer(canvas);
    this.show = { zones: false, trail: true, nearest: true, capsules: false };
    this.take(scene);
    this.home = this.overview();
    this.eye = { ...this.home };
    this.recolour();
    this.listen();
    timeline.onChange(() => this.schedule());
    new ResizeObserver(() => this.schedule()).observe(canvas);
  }
  /* The scene to draw: surfaces, and the motion if it has one. */
  take(scene) {
    this.scene = scene;
    this.q = shorts(scene.jointValues);
    this.power = shorts(scene.power);
    this.n = scene.jointOrigins.length;
    this.frames = scene.frames;
    this.shapes = scene.shapes.map((s) => ({ ...s, mesh: this.upload(s) }));
    this.bodies = scene.bodies.map((b) => ({ ...b, mesh: this.upload(b) }));
    this.parts = scene.parts.map((p) => ({ ...p, meshes: p.meshes.map((m) => ({ pose: m.pose, mesh: this.upload(m) })) }));
    this.nearest = scene.nearest.map((c) => ({ time: floats(c.time), distance: floats(c.distance), a: shorts(c.a), b: shorts(c.b),
      names: c.pairs, pair: words(c.pair) }));
    this.mostPower = Math.max(this.power.reduce((a, b) => Math.max(a, b), 0), 1);
    this.path = this.toolPath();
    this.labels = this.machineLabels();
  }
  /* Another scene, or the same with a door that moved; the eye stays where it is. */
  change(scene) {
    for (const label of this.labels) label.element.remove();
    for (const { mesh } of [...this.shapes, ...this.bodies, ...this.parts.flatMap((p) => p.meshes)]) this.renderer.forget(mesh);
    this.take(scene);
    this.recolour();
  }
  upload(shape) {
    const scaled = (text, step) => Float32Array.from(shorts(text), (v) => v * step);
    return this.renderer.mesh(scaled(shape.points, 5e-4), scaled(shape.normals, 1 / 32767), words(shape.triangles));
  }
  recolour() {
    this.tints = Object.fromEntries(["robot", "robot-base", "tool", "part", "machine", "zone", "sky", "ground", "grid", "a3", "bad", "soft"]
      .map((name) => [name, colour(css(`--${name}`))]));
    this.ramp = RAMP.map(colour);
    this.pathTints = new Float32Array(this.path.length);
    for (let i = 0; i < this.frames; i++) this.pathTints.set(this.powerTint(this.power[i]), 3 * i);
    this.pathWidths = Float32Array.from({ length: this.frames }, (_, i) => this.powerWidth(this.power[i]));
    for (const name of ["trail", "grid"]) if (this[name]) { this.renderer.release(this[name]); this[name] = null; }
    this.schedule();
  }
  powerTint(watts) {
    const x = Math.min(Math.max(watts / this.mostPower, 0), 1) * (this.ramp.length - 1), k = Math.min(Math.floor(x), this.ramp.length - 2);
    return this.ramp[k].map((v, i) => v + (this.ramp[k + 1][i] - v) * (x - k));
  }
  /* Where much power is taken the path is wide too: its colour is not all that says it. */
  powerWidth(watts) { return 0.6 + 2.2 * Math.min(Math.max(watts / this.mostPower, 0), 1); }
  /* The watts of the hottest colour: the peak that the page names. */
  scale(watts) {
    this.mostPower = watts;
    this.recolour();
  }
  frame(time) { return Math.min(Math.max((time - this.scene.start) / this.scene.step, 0), this.frames - 1); }
  /* The pose of a link in the one before it, for a joint's value in rad, of a rail in m. */
  jointPose(i, value) {
    const axis = this.scene.jointAxes[i], moved = i < this.scene.slides ? M4.slide(axis, value) : M4.turn(axis, value);
    return M4.times(this.scene.jointOrigins[i], moved);
  }
  /* Poses of all links, the base first; joint values are interpolated between frames. */
  linkPoses(frame) {
    const k = Math.min(Math.floor(frame), this.frames - 2), x = frame - k, poses = [new Float32Array(this.scene.base)];
    for (let i = 0; i < this.n; i++) {
      const a = this.q[k * this.n + i], b = this.q[(k + 1) * this.n + i];
      poses.push(M4.times(poses[i], this.jointPose(i, (a + (b - a) * x) * this.scene.jointSteps[i])));
    }
    return poses;
  }
  toolPath() {
    const path = new Float32Array(3 * this.frames);
    for (let i = 0; i < this.frames; i++) {
      const tcp = M4.times(this.linkPoses(i)[this.n], this.scene.tcp);
      path.set([tcp[12], tcp[13], tcp[14]], 3 * i);
    }
    return path;
  }
  /* An eye that sees the tool's path and the machines. */
  overview() {
    const low = [-0.5, -0.5, 0], high = [0.5, 0.5, 1.8];
    const take = (p) => p.forEach((v, i) => { low[i] = Math.min(low[i], Math.max(v, -5)); high[i] = Math.max(high[i], Math.min(v, 5)); });
    for (let i = 0; i < this.path.length; i += 3) take([...this.path.subarray(i, i + 3)]);
    for (const { point } of this.scene.labels) take(point);
    const target = low.map((v, i) => (v + high[i]) / 2), radius = Math.hypot(...low.map((v, i) => (high[i] - v) / 2));
    target[2] *= 0.82;
    return { turn: -0.85, tilt: 0.42, distance: Math.max(2.75 * radius, 4), target };
  }
  look(name) {
    const views = { iso: this.home, top: { ...this.home, turn: -Math.PI / 2, tilt: 1.5533 }, side: { ...this.home, turn: -Math.PI / 2, tilt: 0.06 } };
    this.eye = { ...views[name], target: [...this.home.target] };
    this.schedule();
  }
  listen() {
    const fingers = new Map();
    const canvas = this.canvas;
    canvas.addEventListener("pointerdown", (e) => { fingers.set(e.pointerId, [e.clientX, e.clientY]); canvas.setPointerCapture(e.pointerId); });
    const gone = (e) => fingers.delete(e.pointerId);
    canvas.addEventListener("pointerup", gone);
    canvas.addEventListener("pointercancel", gone);
    canvas.addEventListener("pointermove", (e) => {
      const last = fingers.get(e.pointerId);
      if (!last) return;
      const dx = e.clientX - last[0], dy = e.clientY - last[1];
      if (fingers.size > 1) {
        const other = [...fingers].find(([id]) => id !== e.pointerId)[1];
        const before = Math.hypot(last[0] - other[0], last[1] - other[1]), now = Math.hypot(e.clientX - other[0], e.clientY - other[1]);
        this.zoom(before / Math.max(now, 1));
      } else if (e.buttons & 2 || e.shiftKey) this.pan(dx, dy);
      else this.orbit(dx, dy);
      fingers.set(e.pointerId, [e.clientX, e.clientY]);
    });
    canvas.addEventListener("contextmenu", (e) => e.preventDefault());
    canvas.addEventListener("wheel", (e) => {
      if (document.activeElement !== canvas && !e.ctrlKey) return; /* the page scrolls until the picture was clicked */
      e.preventDefault();
      this.zoom(Math.exp(e.deltaY * 0.001));
    }, { passive: false });
    canvas.addEventListener("keydown", (e) => {
      const steps = { ArrowLeft: [-30, 0], ArrowRight: [30, 0], ArrowUp: [0, -30], ArrowDown: [0, 30] };
      if (steps[e.key]) { e.preventDefault(); this.orbit(...steps[e.key]); }
      if (e.key === "+" || e.key === "-") { e.preventDefault(); this.zoom(e.key === "+" ? 0.85 : 1.18); }
    });
  }
  orbit(dx, dy) {
    this.eye.turn -= dx * 0.006;
    this.eye.tilt = Math.min(Math.max(this.eye.tilt + dy * 0.006, -0.1), 1.5533);
    this.schedule();
  }
  pan(dx, dy) {
    const { turn, tilt, distance, target } = this.eye, size = distance * 0.0012;
    const right = [-Math.sin(turn), Math.cos(turn), 0], up = [-Math.cos(turn) * Math.sin(tilt), -Math.sin(turn) * Math.sin(tilt), Math.cos(tilt)];
    for (let i = 0; i < 3; i++) target[i] += (-dx * right[i] + dy * up[i]) * size;
    this.schedule();
  }
  zoom(factor) {
    this.eye.distance = Math.min(Math.max(this.eye.distance * factor, 0.6), 40);
    this.schedule();
  }
  schedule() {
    if (this.pending) return;
    this.pending = requestAnimationFrame(() => { this.pending = 0; this.draw(); });
  }
  load(time) {
    let load = "none";
    for (const [from, name] of this.scene.loads) if (from <= time + 1e-3) load = name;
    return load;
  }
  /* Where the part lies at that time, null while it is held. */
  place(part, time) {
    let pose = null;
    for (const [from, where] of part.lies) if (from <= time + 1e-3) pose = where;
    return pose;
  }
  /* Whether a body of a machine is there at that time: a door comes and goes with its states. */
  there(shown, time) {
    let there = true;
    for (const [from, now] of shown || []) if (from <= time + 1e-3) there = now;
    return there;
  }
  draw() {
    const scale = Math.min(window.devicePixelRatio || 1, 2), box = this.canvas.getBoundingClientRect();
    const width = Math.max(Math.round(box.width * scale), 1), height = Math.max(Math.round(box.height * scale), 1);
    if (this.canvas.width !== width || this.canvas.height !== height) { this.canvas.width = width; this.canvas.height = height; }
    const { turn, tilt, distance, target } = this.eye;
    const eye = [target[0] + distance * Math.cos(tilt) * Math.cos(turn), target[1] + distance * Math.cos(tilt) * Math.sin(turn),
      target[2] + distance * Math.sin(tilt)];
    const view = M4.times(M4.perspective(0.62, width / height, 0.1, 80), M4.look(eye, target, [0, 0, 1]));
    const r = this.renderer, time = this.timeline.now, frame = this.frame(time);
    r.begin(view, eye, this.tints.sky);
    if (this.scene.floor) this.drawFloor();
    const items = this.items(time, frame);
    r.drawShadows(items.map(({ mesh, model }) => [mesh, model]), [0, 0, 0], 0.16);
    for (const { mesh, model, tint } of items) r.drawMesh(mesh, model, tint);
    if (this.show.trail) this.drawTrail(frame);
    if (this.show.nearest) this.drawNearest(time);
    if (this.show.zones) this.drawZones();
    r.end();
    this.placeLabels(view, box);
    this.canvas.parentElement.style.setProperty("--aspect", width / height); /* paper keeps the picture's shape */
  }
  /* The machines' names, above the middle of each. */
  machineLabels() {
    return this.scene.labels.map(({ name, point }) => {
      const element = document.createElement("span");
      element.className = "machine";
      element.textContent = name;
      this.canvas.parentElement.append(element);
      return { element, point };
    });
  }
  /* The nearest ones first: a name that would lie on another one stands above it, or is left out. */
  placeLabels(view, box) {
    const placed = [], seen = this.labels.map((label) => ({ label, at: M4.point(view, this.pointOf(label)) })).sort((a, b) => a.at[3] - b.at[3]);
    for (const { label: { element }, at: [x, y, , w] } of seen) {
      element.hidden = w < 0.1 || Math.abs(x) > w || Math.abs(y) > w;
      if (element.hidden) continue;
      const wide = element.offsetWidth / 2 + 2, high = element.offsetHeight + 1;
      const left = Math.min(Math.max((x / w * 0.5 + 0.5) * box.width, wide), box.width - wide);
      let top = Math.max((0.5 - y / w * 0.5) * box.height, high);
      const hit = () => placed.find(([l, t, half, h]) => Math.abs(l - left) < half + wide && top > t - h && t > top - high);
      for (let k = 0; k < 3 && hit(); k++) top = hit()[1] - hit()[3];
      element.hidden = Boolean(hit()) || top < high;
      element.style.left = `${100 * left / box.width}%`;
      element.style.top = `${100 * top / box.height}%`;
      if (!element.hidden) placed.push([left, top, wide, high]);
    }
  }
  /* Where a machine's body, zone or name is now: where the scene has it. */
  poseOf(thing) { return thing.pose; }
  pointOf(label) { return label.point; }
  items(time, frame) {
    const poses = this.linkPoses(frame), load = this.load(time).split("+"), items = [];
    const bad = (name) => name && (this.blamed || []).includes(name);
    for (const body of this.bodies) {
      const { mesh, shown, sweep, name } = body;
      const tint = bad(name) ? this.tints.bad : sweep ? this.tints.zone : this.tints.machine;
      if (this.there(shown, time)) items.push({ mesh, model: this.poseOf(body), tint });
    }
    const look = this.show.capsules ? "robot" : "capsules";
    for (const { mesh, link, kind, owner, look: own, name } of this.shapes) {
      if (own === look && !bad(name)) continue;
      if (owner && !load.includes(owner)) continue;
      const tint = bad(name) ? this.tints.bad : this.tints[{ link: "robot", base: "robot-base", joint: "robot-base", tool: "tool", part: "part" }[kind]];
      items.push({ mesh, model: poses[link], tint });
    }
    for (const part of this.parts) {
      const pose = load.includes(part.name) ? null : this.place(part, time);
      if (pose) for (const { mesh, pose: own } of part.meshes) items.push({ mesh, model: M4.times(pose, own), tint: this.tints.part });
    }
    return items;
  }
  drawFloor() {
    if (!this.floorMesh) {
      const s = 6;
      this.floorMesh = this.renderer.mesh(new Float32Array([-s, -s, -0.002, s, -s, -0.002, s, s, -0.002, -s, s, -0.002]),
        new Float32Array([0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1]), new Uint16Array([0, 1, 2, 0, 2, 3]));
      const points = [];
      for (let i = -s; i <= s; i += 0.5) points.push(-s, i, 0, s, i, 0, i, -s, 0, i, s, 0);
      this.gridPoints = new Float32Array(points);
    }
    if (this.renderer instanceof GlRenderer) this.renderer.drawMesh(this.floorMesh, IDENTITY, this.tints.ground, 1, 1);
    if (!this.grid) {
      const tints = new Float32Array(this.gridPoints.length);
      for (let i = 0; i < tints.length; i += 3) tints.set(this.tints.grid, i);
      this.grid = this.renderer.path(this.gridPoints, tints, false);
    }
    this.renderer.drawPath(this.grid, { wide: 1, alpha: 0.6 });
  }
  drawTrail(frame) {
    if (!this.trail) this.trail = this.renderer.path(this.path, this.pathTints, true, this.pathWidths);
    this.renderer.drawPath(this.trail, { wide: 2.5, alpha: 0.55 });
    this.renderer.drawPath(this.trail, { wide: 3.5, count: Math.floor(frame) });
  }
  pairAt(time) {
    for (const c of this.nearest) {
      if (time < c.time[0] || time > c.time[c.time.length - 1]) continue;
      const k = floorIndex(c.time, time);
      if (Number.isFinite(c.distance[k])) return { c, k };
    }
    return null;
  }
  drawNearest(time) {
    const hit = this.pairAt(time);
    if (!hit) return;
    const ends = (s) => [...s.subarray(3 * hit.k, 3 * hit.k + 3)].map((v) => v * 5e-4);
    const tint = hit.c.distance[hit.k] < this.bound ? this.tints.bad : this.tints.a3;
    const line = this.renderer.path(new Float32Array([...ends(hit.c.a), ...ends(hit.c.b)]), new Float32Array([...tint, ...tint]), false);
    this.renderer.drawPath(line, { wide: 3, onTop: true });
    this.renderer.release(line);
  }
  drawZones() {
    for (const zone of this.scene.zones) {
      if (!zone.mesh) zone.mesh = this.renderer.mesh(...unitBox(zone.size));
      const tint = zone.kind === "OPEN" ? this.tints.a3 : zone.kind === "CLOSED" ? this.tints.bad : this.tints.zone;
      this.renderer.drawMesh(zone.mesh, this.poseOf(zone), tint, 0.16, 1);
    }
  }
  describe() {
    const time = this.timeline.now, hit = this.pairAt(time);
    return {
      load: this.load(time),
      nearest: hit ? `${(hit.c.distance[hit.k] * 1000).toFixed(0)} mm  ${hit.c.names[hit.c.pair[hit.k]]}` : "",
    };
  }
}

function unitBox(size) {
  const points = [], normals = [], triangles = [];
  for (let axis = 0; axis < 3; axis++) for (const sign of [-1, 1]) {
    const start = points.length / 3;
    for (const [a, b] of [[-1, -1], [1, -1], [1, 1], [-1, 1]]) {
      const p = [0, 0, 0], n = [0, 0, 0];
      p[axis] = sign; p[(axis + 1) % 3] = a; p[(axis + 2) % 3] = b; n[axis] = sign;
      points.push(...p.map((v, i) => v * size[i] / 2));
      normals.push(...n);
    }
    triangles.push(...[0, 1, 2, 0, 2, 3].map((k) => start + k));
  }
  return [new Float32Array(points), new Float32Array(normals), new Uint16Array(triangles)];
}
