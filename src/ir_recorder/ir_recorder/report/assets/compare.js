"use strict";
/* Puts the page of a comparison together: one timeline, one chart of powers. */
(() => {
  const find = (id) => document.getElementById(id), root = document.documentElement;
  const data = JSON.parse(find("data").textContent), timeline = new Timeline(data.end, data.rests);
  const charts = axesSection(find("axes"), timeline, find("tip"), data.axes);
  if (!data.axes.length) find("axes").hidden = true;
  exportButtons();
  find("theme").addEventListener("click", () => {
    const dark = root.dataset.theme ? root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
    root.dataset.theme = dark ? "light" : "dark";
    for (const chart of charts) chart.schedule();
  });
  timeline.seek(0);
})();
