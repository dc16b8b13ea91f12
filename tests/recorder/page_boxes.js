(() => {
  const wide = innerWidth, faults = [];
  const shown = (e) => e.checkVisibility({ visibilityProperty: true }) && !e.closest(".unseen, .tip, thead, .stage");
  const name = (e) => `${e.tagName.toLowerCase()}${e.id ? `#${e.id}` : ""}.${e.getAttribute("class") || ""} ${e.textContent.trim().slice(0, 40)}`;
  if (document.documentElement.scrollWidth > wide) faults.push(`the page scrolls sideways: ${document.documentElement.scrollWidth} px of ${wide}`);

  /* nothing reaches beyond the page, nothing scrolls within it, nothing is cut */
  for (const e of document.querySelectorAll("header *, main *")) {
    if (e.closest("svg") || !shown(e)) continue;
    const box = e.getBoundingClientRect(), style = getComputedStyle(e);
    if (box.right > wide + 1 || box.left < -1) faults.push(`beyond the page: ${name(e)}`);
    if (e.matches(".scroll") && e.scrollWidth > e.clientWidth + 1) faults.push(`scrolls sideways by ${e.scrollWidth - e.clientWidth} px: ${name(e)}`);
    if (/hidden|clip/.test(style.overflow) && e.scrollWidth > e.clientWidth + 1) faults.push(`cut: ${name(e)}`);
  }

  /* no text lies on another one */
  const texts = [], walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walk.nextNode()) {
    const node = walk.currentNode, parent = node.parentElement;
    if (!node.textContent.trim() || parent.closest("script, style, title, select, svg.method, svg.cell") || !shown(parent)) continue;
    const range = document.createRange();
    range.selectNodeContents(node);
    for (const r of range.getClientRects()) if (r.width > 1 && r.height > 1) texts.push([r, node.textContent.trim().slice(0, 40)]);
  }
  texts.sort((a, b) => a[0].top - b[0].top);
  for (let i = 0; i < texts.length; i++) {
    for (let k = i + 1; k < texts.length && texts[k][0].top < texts[i][0].bottom - 4; k++) {
      const [a, b] = [texts[i][0], texts[k][0]];
      const across = Math.min(a.right, b.right) - Math.max(a.left, b.left), down = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
      if (across > 2 && down > 4) faults.push(`one on the other: ${texts[i][1]} | ${texts[k][1]}`);
    }
  }
  const ids = [...document.querySelectorAll("[id]")].map((e) => e.id);
  for (const id of new Set(ids.filter((id, k) => ids.indexOf(id) !== k))) faults.push(`two elements are called ${id}`);
  return [...new Set(faults)].slice(0, 12);
})()
