"use strict";
/* Puts the page together: two pictures in 3D on one timeline, and one chart of powers. */
(() => {
  const find = (id) => document.getElementById(id);
  const data = JSON.parse(find("data").textContent), timeline = new Timeline(data.end, data.rests);
  const sides = Object.fromEntries(data.sides.map((side) => [side.name, { ...data.cell, ...side }]));
  const together = new Timeline(data.curves.end, data.curves.rests); /* stop by stop */
  const charts = axesSection(find("axes"), together, find("tip"), data.axes);
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
    planned.change(sides[find("which").value]);
    today.mostPower = Math.max(today.power.reduce((a, b) => Math.max(a, b), 0), 1);
    sameColours();
  });

  new Player(timeline);
  timeline.onChange(() => {
    find("name-today").textContent = timeline.now > sides.today.seconds ? `${data.before}: finished` : data.before;
  });

  themes(() => { for (const chart of charts) chart.schedule(); for (const view of views) view.recolour(); },
    () => { for (const chart of charts) chart.paint(); for (const view of views) { view.recolour(); view.draw(); } });
  exportButtons();
  foldOnPhones([...FIRST, "changes"]);
  timeline.seek(0);
  together.seek(0);
})();
