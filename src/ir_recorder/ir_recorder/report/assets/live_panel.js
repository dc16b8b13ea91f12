"use strict";
/* What stands beside the picture: figures, bits with their buttons, machines. All texts go in as texts. */

const element = (tag, words = "", name = "") => {
  const made = document.createElement(tag);
  if (words) made.textContent = words;
  if (name) made.className = name;
  return made;
};
const STOP_WORDS = { alarm_stop: ["active", "none"] }; /* of bits whose 1 says that nothing is wrong */
const modeWords = (name) => (name || "").toLowerCase().replace(/_/g, " ");
const BIT_WORDS = { ab: "drive bus off", hib: "hibernate", ks: "cold start", emergency_stop: "emergency stop", drives_on: "drives on",
  drives_off: "drives off", conf_mess: "confirm messages", move_enable: "move enable", bbs: "ready to operate", drives_ready: "drives ready",
  alarm_stop: "emergency stop", in_home: "at machine home", moving: "moving" };

/* Figures that a person looks for first: name, value, what explains it, and whether it is bad. */
function figures(state, energy) {
  const watts = state.w ? `${thousands(Math.round(state.w[1]))} W` : "–", near = state.near, short = near && near[0] < state.bound;
  const target = state.target && state.target !== state.mode ? `changes to ${modeWords(state.target)}` : "";
  const step = state.step, total = step && step.at[1] ? `step ${step.at[0]} of ${step.at[1]}` : "";
  return [
    ["power at the mains", watts, energy === null ? "" : `${energy >= 3.6e6 ? `${(energy / 3.6e6).toFixed(2)} kWh` : `${(energy / 3600).toFixed(1)} Wh`} since this page was opened`],
    ["mode", state.w ? modeWords(state.mode) || "–" : "–", target],
    ["step of the program", step ? step.label : "–", step ? [total, step.event === "started" ? "runs" : step.event, step.event === "failed" ? "" : step.note].filter(Boolean).join(", ") : "no program was run"],
    ["nearest pair", near ? `${(near[0] * 1000).toFixed(0)} mm` : "–", near ? `${near[7]}, ${short ? "below" : "above"} the safety distance of ${+(state.bound * 1000).toFixed(1)} mm` : "", short],
    ["load", state.load === "none" ? "nothing" : state.load || "–", state.driving && state.scaling !== null && state.scaling < 1 ? `speed ${Math.round(state.scaling * 100)} %` : ""],
  ];
}

function showFigures(place, rows) {
  while (place.children.length < rows.length) {
    const tile = element("div", "", "tile");
    tile.append(element("span"), element("b"), element("small"));
    place.append(tile);
  }
  rows.forEach(([name, value, words, bad], k) => {
    const [label, figure, more] = place.children[k].children;
    for (const [part, content] of [[label, name], [figure, value], [more, words]]) if (part.textContent !== content) part.textContent = content;
    figure.classList.toggle("bad", Boolean(bad));
  });
}

/* What the bits of stop and hold mean for the robot, and what ends it; "" where it may move. */
const failure = ({ step }) => (step && step.event === "failed"
  ? `Step ${step.at[0]} of ${step.at[1]}, ${step.label}, failed${step.note ? `: ${step.note}` : ""}.` : "");
const isStopped = (state) => Boolean((state.in || {}).emergency_stop) || (state.out || {}).alarm_stop === false;
function standing(state) {
  const levels = state.in || {};
  let words = levels.move_enable === false ? "Held on the path. Press hold again to go on." : "";
  if (isStopped(state)) words = "Stopped, the button released: confirm messages, then drives on.";
  if (levels.emergency_stop) words = "Emergency stop pressed: motors off, brakes closed. Press it again to release it.";
  return [words, failure(state)].filter(Boolean).join(" ");
}

/* Buttons and lamps of bits, made when a bit is heard of first; stop and hold are there from the beginning. */
class Bits {
  constructor(inputs, outputs, stop, hold, press) {
    this.inputs = inputs;
    this.outputs = outputs;
    this.press = press;
    this.stop = stop;
    this.hold = hold;
    this.made = new Map();
    for (const button of [stop, hold]) button.addEventListener("click", () => press(button.dataset.bit, this.next(button)));
  }
  /* The level that a press of a button asks for: hold is pressed while moving is not enabled. */
  next(button) { return (button.getAttribute("aria-pressed") === "true") === (button === this.hold); }
  show(state, allowed, token) {
    for (const [side, place, levels] of [["in", this.inputs, state.in], ["out", this.outputs, state.out]]) {
      for (const [name, level] of Object.entries(levels || {})) if (side !== "in" || name !== "emergency_stop") this.bit(side, place, name, level, allowed);
    }
    this.stop.disabled = !token; /* whoever is silent may still hear it */
    this.stop.setAttribute("aria-pressed", String(Boolean(state.in && state.in.emergency_stop)));
    this.hold.disabled = !allowed || !state.in || isStopped(state);
    this.hold.setAttribute("aria-pressed", String(Boolean(state.in && state.in.move_enable === false)));
  }
  bit(side, place, name, level, allowed) {
    const key = `${side} ${name}`, switchable = side === "in" && typeof level === "boolean";
    if (!this.made.has(key)) {
      const made = element(side === "in" && switchable ? "button" : side === "in" ? "span" : "li");
      made.append(document.createTextNode(BIT_WORDS[name] || name.replace(/_/g, " ")), element("b"));
      made.title = name;
      if (switchable) {
        made.type = "button";
        made.dataset.bit = name;
        made.addEventListener("click", () => this.press(name, made.getAttribute("aria-pressed") !== "true"));
      }
      place.append(made);
      this.made.set(key, made);
    }
    const made = this.made.get(key), value = made.querySelector("b"), words = typeof level === "boolean" ? (STOP_WORDS[name] || ["0", "1"])[Number(level)] : level;
    if (value.textContent !== words) value.textContent = words;
    if (switchable) {
      made.setAttribute("aria-pressed", String(level));
      made.disabled = !allowed;
    } else made.classList.toggle("on", level === !STOP_WORDS[name]);
  }
}

function showMachines(table, machines) {
  const rows = (machines || []).filter((machine) => machine.state).map(({ name, state, next }) => {
    const row = element("tr");
    row.append(element("td", name), element("td", state), element("td", next && next !== state ? next : ""));
    return row;
  });
  table.tBodies[0].replaceChildren(...rows);
  table.parentElement.hidden = !rows.length;
}
