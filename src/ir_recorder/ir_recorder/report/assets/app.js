"use strict";
/* Puts the page together: one timeline, two charts, one picture. */
(() => {
  const find = (id) => document.getElementById(id);
  const data = JSON.parse(find("data").textContent);
  const timeline = new Timeline(data.end, data.rests);
  const power = new PowerChart(find("power"), timeline, find("tip"), data);
  const clearance = new ClearanceChart(find("clearance"), timeline, find("tip"), data);
  const axes = axesSection(find("axes"), timeline, find("tip"), data.axes);
  if (!data.axes.length) find("axes").hidden = true;
  let motion = null;
  if (data.scene) {
    motion = new Motion(find("view"), timeline, data.scene, data.safetyDistance);
    if (data.peak) motion.scale(data.peak);
    motion.blamed = data.blamed; /* bodies that a problem names: in red */
    find("trail-max").textContent = `${thousands(Math.round(motion.mostPower))} W`;
  } else {
    find("no-motion").hidden = false;
    find("trail-legend").hidden = true;
  }
  laneKey(find("lane-key"), data.lanes);
  if (!data.clearance.length) {
    for (const part of [find("clearance-head"), find("clearance").parentElement]) part.hidden = true; /* nothing was driven */
  }
  if (!data.scene && !data.power && !data.clearance.length) {
    for (const id of ["motion", "over-time"]) find(id).hidden = true; /* a plan without its trajectories */
  }

  const player = new Player(timeline);
  for (const button of document.querySelectorAll("button.go")) {
    button.addEventListener("click", () => {
      timeline.seek(Number(button.dataset.time));
      find("motion").scrollIntoView({ behavior: "smooth" });
      player.play(true);
    });
  }

  /* what is written over the picture */
  const rows = () => {
    const now = timeline.now, shown = motion ? motion.describe() : { load: "", nearest: "" };
    return [["time", `${now.toFixed(2)} s`], ["power", Number.isFinite(power.at(now)) ? `${Math.round(power.at(now))} W` : ""],
      ["mode", power.inLane("mode", now)], ["step", power.inLane("program", now)], ["load", shown.load], ["nearest", shown.nearest]];
  };
  timeline.onChange(() => {
    const hud = find("hud");
    hud.textContent = "";
    for (const [name, value] of rows()) {
      if (!value) continue;
      const item = document.createElement("div"), label = document.createElement("span"), content = document.createElement("b");
      label.textContent = name;
      content.textContent = value;
      item.append(label, content);
      hud.append(item);
    }
  });

  if (motion) {
    for (const button of document.querySelectorAll("[data-view]")) button.addEventListener("click", () => motion.look(button.dataset.view));
    for (const name of ["zones", "trail", "nearest", "capsules"]) {
      find(`show-${name}`).addEventListener("change", (e) => { motion.show[name] = e.target.checked; motion.schedule(); });
    }
  }

  themes(() => { for (const chart of [power, clearance, ...axes]) chart.schedule(); if (motion) motion.recolour(); },
    () => { for (const chart of [power, clearance, ...axes]) chart.paint(); if (motion) { motion.recolour(); motion.draw(); } });

  /* a link into what is folded away opens it */
  const unfold = () => {
    const place = location.hash.length > 1 && !location.hash.includes("=") ? document.getElementById(location.hash.slice(1)) : null;
    if (place && place.tagName === "DETAILS") { place.open = true; place.scrollIntoView(); }
  };
  addEventListener("hashchange", unfold);
  for (const link of document.querySelectorAll("a[href^='#']")) link.addEventListener("click", () => setTimeout(unfold));
  unfold();

  /* a telephone has no width for the flows: it shows their table */
  const flows = document.querySelector("#flows details");
  if (flows && matchMedia("(max-width: 700px)").matches) flows.open = true;

  exportButtons();
  foldOnPhones([...FIRST, "tending"]);
  const wanted = /[#&]t=([\d.]+)/.exec(location.hash);
  if (data.shown) timeline.zoom(...data.shown);
  timeline.seek(wanted ? Number(wanted[1]) : timeline.from);
})();
