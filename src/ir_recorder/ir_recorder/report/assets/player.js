"use strict";
/* Plays a timeline with the controls play, seek, speed and clock; what every page of a motion has. */

const REST_SECONDS = 1.5; /* that a rest which the charts show short is played in, at most */

class Player {
  constructor(timeline) {
    const find = (id) => document.getElementById(id);
    this.timeline = timeline;
    this.whole = new Timeline(timeline.end, timeline.rests); /* the slider's axis: not zoomed, long rests short */
    this.playing = false;
    this.last = 0;
    [this.button, this.slider, this.speed, this.clock] = ["play", "seek", "speed", "clock"].map(find);
    this.button.addEventListener("click", () => this.play(!this.playing));
    this.slider.addEventListener("input", () => { this.play(false); timeline.seek(this.whole.at(Number(this.slider.value) / this.whole.breaks().whole)); });
    document.addEventListener("keydown", (e) => {
      if (e.code === "Space" && !/BUTTON|INPUT|SELECT|SUMMARY/.test(e.target.tagName)) { e.preventDefault(); this.play(!this.playing); }
    });
    timeline.onChange(() => this.show());
    this.take();
  }
  /* Another motion on the same timeline. */
  take() {
    this.whole = new Timeline(this.timeline.end, this.timeline.rests);
    this.slider.max = this.whole.breaks().whole;
  }
  show() {
    const words = this.timeline.label(this.timeline.now);
    this.slider.value = this.whole.place(this.timeline.now) * this.whole.breaks().whole;
    this.slider.setAttribute("aria-valuetext", words);
    this.clock.textContent = words;
  }
  /* Seconds of the motion in a second: more in a rest that is shown short. */
  pace() {
    const now = this.timeline.now, rest = this.whole.breaks().long.find(([from, to]) => now >= from && now < to - 1e-6);
    return Math.max(Number(this.speed.value), rest ? (rest[1] - rest[0]) / REST_SECONDS : 0);
  }
  play(on) {
    this.playing = on;
    this.button.textContent = on ? "❚❚" : "▶";
    this.button.setAttribute("aria-label", on ? "pause" : "play");
    if (!on) return;
    if (this.timeline.now >= this.timeline.end - 1e-6) this.timeline.seek(0);
    this.last = performance.now();
    requestAnimationFrame((now) => this.step(now));
  }
  step(now) {
    if (!this.playing) return;
    this.timeline.seek(this.timeline.now + Math.max(now - this.last, 0) / 1000 * this.pace());
    this.last = now;
    if (this.timeline.now >= this.timeline.end - 1e-6) this.play(false); else requestAnimationFrame((next) => this.step(next));
  }
}
