"use strict";
/* The cell in 3D as it is now: joint values as they come, the path behind the tool and the planned one before it. */

const TRAIL_SECONDS = 20;

/* Where the joint values of a record put the links and the tool. */
class LiveMotion extends Motion {
  constructor(canvas, timeline, scene, history) {
    super(canvas, timeline, scene, 0.02);
    this.history = history;
    this.show.plan = true;
  }
  frame(time) { return this.history ? this.history.index(time) : 0; }
  record(k) { return this.history ? this.history.records[k] : undefined; }
  posesOf(q) {
    const poses = [new Float32Array(this.scene.base)];
    for (let i = 0; i < this.n; i++) {
      poses.push(M4.times(poses[i], this.jointPose(i, q && q.length === this.n ? q[i] : 0)));
    }
    return poses;
  }
  linkPoses(k) { return this.posesOf((this.record(k) || {}).q); }
  /* The tool's point of a record, computed once. */
  tool(record) {
    if (!record.tool || record.toolOf !== this.scene) {
      const tcp = M4.times(this.posesOf(record.q)[this.n], this.scene.tcp);
      record.tool = [tcp[12], tcp[13], tcp[14]];
      record.toolOf = this.scene;
    }
    return record.tool;
  }
  load(time) { return (this.record(this.frame(time)) || {}).load || "none"; }
  place(part, time) { return ((this.record(this.frame(time)) || {}).lies || {})[part.name] || null; }
  draw() {
    if (this.history && this.history.records.length) super.draw();
  }
  drawTrail(k) {
    const records = this.history.records, points = [], tints = [], widths = [], now = records[k].t;
    for (let i = k; i >= 0 && now - records[i].t < TRAIL_SECONDS; i--) {
      if (!records[i].q) break;
      points.push(...this.tool(records[i]));
      const watts = records[i].w ? records[i].w[1] : 0;
      tints.push(...this.powerTint(watts));
      widths.push(this.powerWidth(watts));
    }
    this.line(points, tints, { wide: 3.5 }, true, widths);
  }
  drawPlan() {
    const path = (this.record(this.frame(this.timeline.now)) || {}).path;
    if (!path) return;
    if (this.planned !== path) { this.planned = path; this.plan = floats(path); }
    const tints = new Float32Array(this.plan.length);
    for (let i = 0; i < tints.length; i += 3) tints.set(this.tints.zone, i);
    this.line(this.plan, tints, { wide: 2, alpha: 0.75 });
  }
  drawNearest(time) {
    if (this.show.plan) this.drawPlan();
    const record = this.record(this.frame(time));
    if (!this.pairs || !record || !record.near) return;
    const tint = record.near[0] < this.bound ? this.tints.bad : this.tints.a3;
    this.line(record.near.slice(1, 7), [...tint, ...tint], { wide: 3, onTop: true }, false);
  }
  line(points, tints, how, strip = true, widths = null) {
    if (points.length < 6) return;
    const path = this.renderer.path(new Float32Array(points), new Float32Array(tints), strip, widths);
    this.renderer.drawPath(path, how);
    this.renderer.release(path);
  }
}
