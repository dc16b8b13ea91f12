"use strict";
/* Puts the page together: two pictures in 3D on one timeline, and one chart of powers. */
(() => {
  const find = (id) => document.getElementById(id), root = document.documentElement;
  const data = JSON.parse(find("data").textContent), timeline = new Timeline(data.end, data.rests);
  const sides = Object.fromEntries(data.sides.map((side) => [side.name, { ...data.cell, ...side }]));
  const charts = axesSection(find("axes"), timeline, find("tip"), data.axes);
  const today = new Motion(find("view-today"), timeline, sides.today, 0);
  const planned = new Motion(find("view-planned"), timeline, sides[data.planned], 0);
  const views = [today, planned];

  /* one scale of colours, one eye */
  const sameColours = () => {
    const most = Math.max(today.mostPower, planned.mostPower);
    for (const view of views) { view.mostPower = most; view.recolour(); }
  };
  const follow = (from, to) => {
    const schedule = from.schedule.bind(from);
    from.schedule = () => {
      schedule();
      if (JSON.stringify(from.eye) !== JSON.stringify(to.eye)) { to.eye = { ...from.eye, target: [...from.eye.target] }; to.schedule(); }
    };
  };
  planned.eye = { ...today.eye, target: [...today.eye.target] };
  sameColours();
  follow(today, planned);
  follow(planned, today);
  find("which").addEventListener("change", () => {
    const own = planned.scene.labels.length ? [...find("view-planned").parentElement.querySelectorAll(".machine")] : [];
    for (const label of own) label.remove();
    planned.take(sides[find("which").value]);
    today.mostPower = Math.max(today.power.reduce((a, b) => Math.max(a, b), 0), 1);
    sameColours();
  });

  /* playing */
  let playing = false, last = 0;
  const step = (now) => {
    if (!playing) return;
    timeline.seek(timeline.now + (now - last) / 1000 * Number(find("speed").value));
    last = now;
    if (timeline.now >= timeline.end - 1e-6) play(false); else requestAnimationFrame(step);
  };
  const play = (on) => {
    playing = on;
    find("play").textContent = on ? "❚❚" : "▶";
    find("play").setAttribute("aria-label", on ? "pause" : "play");
    if (!on) return;
    if (timeline.now >= timeline.end - 1e-6) timeline.seek(0);
    last = performance.now();
    requestAnimationFrame(step);
  };
  find("play").addEventListener("click", () => play(!playing));
  find("seek").max = timeline.end;
  find("seek").addEventListener("input", () => { play(false); timeline.seek(Number(find("seek").value)); });
  document.addEventListener("keydown", (e) => {
    if (e.code === "Space" && !/BUTTON|INPUT|SELECT|SUMMARY/.test(e.target.tagName)) { e.preventDefault(); play(!playing); }
  });
  timeline.onChange(() => {
    find("seek").value = timeline.now;
    find("clock").textContent = `${timeline.now.toFixed(2)} s`;
    find("name-today").textContent = timeline.now > sides.today.seconds ? "today: finished" : "today";
  });

  /* paper, light and dark */
  const repaint = () => { for (const chart of charts) chart.schedule(); for (const view of views) view.recolour(); };
  let theme = "";
  addEventListener("beforeprint", () => {
    theme = root.dataset.theme || "";
    root.dataset.theme = "light";
    for (const chart of charts) chart.paint();
    for (const view of views) { view.recolour(); view.draw(); }
  });
  addEventListener("afterprint", () => {
    if (theme) root.dataset.theme = theme; else delete root.dataset.theme;
    repaint();
  });
  find("theme").addEventListener("click", () => {
    const dark = root.dataset.theme ? root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
    root.dataset.theme = dark ? "light" : "dark";
    repaint();
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);
  exportButtons();
  timeline.seek(0);
})();
