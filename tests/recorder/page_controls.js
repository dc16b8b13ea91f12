/* the theme */
(() => { const root = document.documentElement; document.getElementById('theme').click();
  const first = root.dataset.theme; document.getElementById('theme').click();
  return first === 'dark' && root.dataset.theme === 'light'; })()

/* playing and pausing */
(async () => { const play = document.getElementById('play'); play.click(); const on = play.getAttribute('aria-label');
  play.click(); return on === 'pause' && play.getAttribute('aria-label') === 'play'; })()

/* the slider of time */
(() => { const seek = document.getElementById('seek'); seek.value = 1.5; seek.dispatchEvent(new Event('input'));
  return document.getElementById('clock').textContent === '1.50 s'; })()

/* speeds */
(() => { const speed = document.getElementById('speed'); speed.value = '5'; return speed.value === '5'; })()

/* views, zones, path, nearest pair, capsules */
(() => { for (const b of document.querySelectorAll('[data-view]')) b.click(); return true; })()

/* views, zones, path, nearest pair, capsules */
(() => { const boxes = [...document.querySelectorAll('.views input, .toggles input')];
  for (const b of boxes) { b.click(); b.click(); } return boxes.length >= 12; })()

/* a quantity of the axes that is hidden at first */
(() => { const hidden = [...document.querySelectorAll('.axis-chart')].filter((f) => f.hidden).length;
  for (const b of document.querySelectorAll('.toggles input')) if (!b.checked) b.click();
  return hidden > 0 && [...document.querySelectorAll('.axis-chart')].every((f) => !f.hidden); })()

/* a step of the table starts the motion there */
(() => { const step = document.querySelectorAll('button.go')[1]; step.click(); document.getElementById('play').click();
  return Math.abs(parseFloat(document.getElementById('clock').textContent) - Number(step.dataset.time)) < 0.5; })()

/* what is folded away */
(() => { const all = [...document.querySelectorAll('details')]; for (const d of all) d.querySelector('summary').click();
  return all.length >= 4 && all.every((d) => d.open); })()

/* what the page has on paper */
(() => { dispatchEvent(new Event('beforeprint')); const light = document.documentElement.dataset.theme;
  dispatchEvent(new Event('afterprint')); return light === 'light'; })()

/* names for those who don't see: every table, every picture, every control */
[...document.querySelectorAll('main table')].every((t) => t.caption && t.caption.textContent)

/* names for those who don't see: every table, every picture, every control */
[...document.querySelectorAll('canvas, svg')].every((c) => c.getAttribute('aria-hidden')
  || c.getAttribute('role') === 'img' && c.getAttribute('aria-label'))

/* names for those who don't see: every table, every picture, every control */
[...document.querySelectorAll('button, input, select')].every((c) => c.textContent.trim() || c.getAttribute('aria-label')
  || c.closest('label'))
