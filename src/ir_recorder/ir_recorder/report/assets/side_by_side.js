"use strict";
/* Puts the page of a comparison together: one timeline, one chart of powers. */
(() => {
  const find = (id) => document.getElementById(id);
  const data = JSON.parse(find("data").textContent), timeline = new Timeline(data.end, data.rests);
  const charts = axesSection(find("axes"), timeline, find("tip"), data.axes);
  if (!data.axes.length) find("axes").hidden = true;
  exportButtons();
  foldOnPhones([...FIRST, "paid"]);
  themes(() => { for (const chart of charts) chart.schedule(); }, () => { for (const chart of charts) chart.paint(); });
  timeline.seek(0);
})();
