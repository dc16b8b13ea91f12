"use strict";
/* Every table as CSV, every canvas as PNG, every drawing as SVG: files that the browser writes, nothing leaves it. */

function download(name, type, content) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(content instanceof Blob ? content : new Blob([content], { type }));
  link.download = name;
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

const fileName = (words, ending) => `${words.toLowerCase().replace(/[^a-z0-9]+/g, "_").replace(/^_|_$/g, "") || "figure"}.${ending}`;

const QUOTE = String.fromCharCode(34);

/* A spreadsheet takes a text that begins with = + - @ for a formula: such a text gets an apostrophe, a number none. */
function csvCell(cell) {
  const parts = [...cell.childNodes].map((node) => node.textContent.trim()).filter(Boolean);
  const words = parts.join("; ").replace(/\s+/g, " ").replace(/\u2212(?=\d)/g, "-");
  const safe = /^[=+\-@\t]/.test(words) && !/^[+-]?[\d.]/.test(words) ? `'${words}` : words;
  return QUOTE + safe.split(QUOTE).join(QUOTE + QUOTE) + QUOTE;
}
const csvOf = (table) => [...table.rows].map((row) => [...row.cells].map(csvCell).join(",")).join("\r\n") + "\r\n";

const SVG = (() => {
  const template = document.createElement("template");
  template.innerHTML = "<svg></svg>";
  return template.content.firstChild.namespaceURI;
})();

/* A drawing with the colours it has on the page, and the font. */
function svgOf(svg) {
  const copy = svg.cloneNode(true), from = [svg, ...svg.querySelectorAll("*")], to = [copy, ...copy.querySelectorAll("*")];
  from.forEach((element, k) => {
    const style = getComputedStyle(element);
    for (const name of ["fill", "stroke", "opacity", "font-size", "font-weight", "font-family"]) to[k].style.setProperty(name, style.getPropertyValue(name));
  });
  const { width, height } = svg.getAttribute("viewBox") ? svg.viewBox.baseVal : svg.getBoundingClientRect(), style = getComputedStyle(svg);
  copy.setAttribute("width", width);
  copy.setAttribute("height", height);
  if (svg.getAttribute("viewBox")) return new XMLSerializer().serializeToString(copy);
  /* names stand in the padding */
  const [left, right] = [parseFloat(style.paddingLeft), parseFloat(style.paddingRight)], whole = document.createElementNS(SVG, "svg");
  for (const [key, value] of Object.entries({ x: left, width: width - left - right, overflow: "visible" })) copy.setAttribute(key, value);
  for (const [key, value] of Object.entries({ width, height, viewBox: `0 0 ${width} ${height}` })) whole.setAttribute(key, value);
  whole.append(copy);
  return new XMLSerializer().serializeToString(whole);
}

/* Bars, which are boxes of the page, as a drawing. */
function barsToSvg(place) {
  const make = (name, values) => {
    const element = document.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(values)) element.setAttribute(key, value);
    return element;
  };
  const rows = [...place.querySelectorAll(".row")], wide = 560, left = 220, ink = getComputedStyle(place).color;
  const svg = make("svg", { viewBox: `0 0 ${left + wide + 120} ${rows.length * 26 + 8}` });
  rows.forEach((row, k) => {
    const y = 4 + k * 26, put = (words, x, anchor) => {
      const text = make("text", { x, y: y + 16, "text-anchor": anchor, "font-size": 12, fill: ink, "font-family": "sans-serif" });
      text.textContent = words;
      svg.append(text);
    };
    put(row.querySelector(".label").textContent, left - 10, "end");
    const value = row.querySelector(".value b");
    if (value) put(value.textContent, left + wide + 10, "start");
    for (const piece of row.querySelectorAll(".track > *")) {
      const x = left + parseFloat(piece.style.left) / 100 * wide, style = getComputedStyle(piece);
      if (piece.tagName === "SPAN") put(piece.textContent, x, "middle");
      else if (piece.matches(".whisker")) {
        const span = parseFloat(piece.style.width) / 100 * wide;
        svg.append(make("path", { d: `M${x} ${y + 7}v10m0 -5h${span}m0 -5v10`, stroke: ink, "stroke-width": 2, fill: "none" }));
      } else svg.append(make("rect", { x, y: y + 2, width: piece.style.width ? parseFloat(piece.style.width) / 100 * wide : 2, height: 20, fill: style.backgroundColor, opacity: style.opacity }));
    }
  });
  return svg;
}

/* What is folded on a screen and belongs on paper. */
const folded = () => [...document.querySelectorAll("details.paper")];
let unfolded = [];
addEventListener("beforeprint", () => {
  unfolded = folded().filter((part) => !part.open);
  for (const part of unfolded) part.open = true;
});
addEventListener("afterprint", () => { for (const part of unfolded) part.open = false; });

/* Numbers have a minus, and none is broken from its thousands or its unit at the end of a line. */
const typesetWords = (words) => words.replace(/(^|\s|\u0028)-(?=\d)/g, "$1\u2212").replace(/(\d) (?=\d{3}(?!\d)|%|(?:[kM]?Wh|k?[JW]|min|h|s|mm|m|kg|EUR|deg)(?!\w))/g, "$1\u00a0");

function typeset() {
  const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walk.nextNode()) {
    const node = walk.currentNode, words = typesetWords(node.data);
    if (words !== node.data && !node.parentElement.closest("script, style, code, pre")) node.data = words;
  }
}

function exportButtons() {
  typeset();
  if (typeof priceField === "function") priceField();
  const button = (label, name, act) => {
    const element = document.createElement("button");
    element.type = "button";
    element.className = "export";
    element.textContent = label;
    element.setAttribute("aria-label", `${name} as ${label}`);
    element.addEventListener("click", act);
    return element;
  };
  for (const table of document.querySelectorAll("main table")) {
    const name = table.caption ? table.caption.textContent : "table";
    table.parentElement.after(button("CSV", name, () => download(fileName(name, "csv"), "text/csv", csvOf(table))));
  }
  for (const canvas of document.querySelectorAll("main canvas")) {
    const name = canvas.dataset.name || canvas.getAttribute("aria-label");
    canvas.parentElement.after(button("PNG", name, () => canvas.toBlob((blob) => blob && download(fileName(name, "png"), "image/png", blob))));
  }
  for (const svg of document.querySelectorAll("main .figure > svg")) {
    const name = svg.id || "figure";
    svg.parentElement.after(button("SVG", name, () => download(fileName(name, "svg"), "image/svg+xml", svgOf(svg))));
  }
  for (const bars of document.querySelectorAll("main .bars")) {
    const name = bars.dataset.name;
    const save = () => download(fileName(name, "svg"), "image/svg+xml", new XMLSerializer().serializeToString(barsToSvg(bars)));
    bars.after(button("SVG", name, save));
  }
}

/* On a telephone: what comes after the answer opens when its heading is chosen, curves over time too; the cell in 3D stays. Paper has what a desk has. */
const FIRST = ["answer", "year", "moved", "measurements", "ranking"];
function foldOnPhones(kept) {
  if (!matchMedia("(max-width: 700px)").matches) return;
  for (const section of document.querySelectorAll("main > section[id]")) {
    const head = section.querySelector(":scope > h2");
    if (!head || kept.includes(section.id) || section.querySelector(".stage")) continue;
    const part = document.createElement("details"), summary = document.createElement("summary");
    part.className = "part paper";
    part.id = section.id;
    summary.append(head);
    part.append(summary, ...section.childNodes);
    section.replaceWith(part);
  }
}
