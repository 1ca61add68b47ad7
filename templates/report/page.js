// The page: its parts, the list with its filters, the keyboard, light and dark.

const root = document.documentElement;
root.classList.add('js');
const all = (selector, within = document) => [...within.querySelectorAll(selector)];
const items = all('.items li').map((node) => ({ node, link: node.querySelector('a'), text: '' }));
const articles = new Map(all('.finding').map((node) => [node.id, node]));
const player = articles.size ? new Player() : null;
let current = null;

const idOf = (link) => decodeURIComponent(link.getAttribute('href').slice(1));
for (const item of items) {
  item.id = idOf(item.link);
  item.text = `${item.node.textContent} ${articles.get(item.id).textContent}`.toLowerCase();
}

// ---- one finding ----

const choose = (article, index) => {
  const runs = all('.run', article);
  runs.forEach((run, k) => { run.hidden = k !== index; });
  const stage = article.querySelector('.stage');
  const run = runs[index];
  if (run.dataset.run) player.load(run.dataset.run, stage, run);
  else if (player.node.isConnected) {
    player.pause();
    player.node.remove();
    player.run = null;
  }
};

const open = (id) => {
  const article = articles.get(id);
  if (!article) return false;
  if (current !== article) {
    current = article;
    for (const other of articles.values()) other.classList.toggle('current', other === article);
    const select = article.querySelector('.runs');
    choose(article, select ? select.selectedIndex : 0);
  }
  for (const item of items) {
    if (item.id === id) {
      item.link.setAttribute('aria-current', 'true');
      item.link.scrollIntoView({ block: 'nearest' });
    } else item.link.removeAttribute('aria-current');
  }
  return true;
};

for (const article of articles.values()) {
  const select = article.querySelector('.runs');
  if (select) select.addEventListener('change', () => choose(article, select.selectedIndex));
  article.addEventListener('click', (event) => {
    const moment = event.target.closest('[data-time]');
    if (moment && player.run) {
      player.pause();
      player.seek(Number(moment.dataset.time));
    }
  });
}

// ---- parts, by the address ----

const parts = all('.part');
const wide = () => window.matchMedia('(min-width: 821px)').matches;
const route = () => {
  let id = '';
  try { id = decodeURIComponent(location.hash.slice(1)); } catch { /* the hash is not an id of this page */ }
  if (document.querySelector('#findings.single') && !parts.some((one) => one.id === id && one.id !== 'findings')) [id] = articles.keys();
  const chosen = articles.has(id);
  const part = chosen ? 'findings' : parts.some((one) => one.id === id) ? id : 'findings';
  for (const one of parts) one.classList.toggle('current', one.id === part);
  for (const link of all('.top nav a')) {
    if (link.getAttribute('href') === `#${part}`) link.setAttribute('aria-current', 'page'); else link.removeAttribute('aria-current');
  }
  document.getElementById('findings').classList.toggle('chosen', chosen);
  document.body.classList.toggle('chosen-finding', chosen);
  if (chosen) open(id);
  else if (part === 'findings' && wide()) {
    const first = items.find((item) => !item.node.hidden);
    if (current) open(current.id); else if (first) open(first.id);
  }
  if (part !== 'findings' && player) player.pause();
  if (!chosen || !wide()) { // the browser has scrolled to the finding
    requestAnimationFrame(() => setTimeout(() => window.scrollTo(0, 0), 0));
  }
  if (player) player.draw();
};
window.addEventListener('hashchange', route);

const step = (by) => {
  const shown = items.filter((item) => !item.node.hidden);
  if (!shown.length) return;
  const at = shown.findIndex((item) => current && item.id === current.id);
  const next = shown[Math.max(0, Math.min(shown.length - 1, at < 0 ? 0 : at + by))];
  location.hash = next.link.getAttribute('href');
};

// ---- filters ----

const search = document.getElementById('search');
const selects = all('[data-filter]');
const clear = document.getElementById('clear');
const filter = () => {
  const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
  const folded = document.querySelector('.folded');
  if (folded && (words.length || selects.some((select) => select.value))) folded.open = true;
  let count = 0;
  for (const item of items) {
    const fits = selects.every((select) => !select.value || item.node.dataset[select.dataset.filter] === select.value);
    item.node.hidden = !(fits && words.every((word) => item.text.includes(word)));
    count += item.node.hidden ? 0 : 1;
  }
  document.getElementById('matches').textContent = `${count} of ${items.length}`;
  document.querySelector('.list .none').hidden = count > 0;
  clear.hidden = !words.length && selects.every((select) => !select.value);
};
if (search) {
  search.addEventListener('input', filter);
  search.form.addEventListener('submit', (event) => event.preventDefault());
  for (const select of selects) select.addEventListener('change', filter);
  clear.addEventListener('click', () => {
    search.value = '';
    for (const select of selects) select.value = '';
    filter();
    search.focus();
  });
}

// ---- light and dark, help, copying ----

const KEY = 'foresee-report-theme';
const dark = () => (root.dataset.theme ? root.dataset.theme === 'dark' : window.matchMedia('(prefers-color-scheme: dark)').matches);
const theme = document.getElementById('theme');
const label = () => { theme.textContent = dark() ? 'Light' : 'Dark'; };
const setTheme = (name) => {
  root.dataset.theme = name;
  try { localStorage.setItem(KEY, name); } catch { /* a file's page may have no storage */ }
  label();
  if (player) player.repaint();
};
try {
  const stored = localStorage.getItem(KEY);
  if (stored === 'dark' || stored === 'light') root.dataset.theme = stored;
} catch { /* as above */ }
theme.addEventListener('click', () => setTheme(dark() ? 'light' : 'dark'));
window.matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => { label(); if (player) player.repaint(); });
label();
if (player) player.repaint();

const keys = document.getElementById('keys');
const help = document.getElementById('help');
const toggleHelp = (on) => {
  keys.hidden = !on;
  help.setAttribute('aria-expanded', String(on));
};
help.addEventListener('click', () => toggleHelp(keys.hidden));

const copied = (button, text) => {
  const said = (word) => {
    button.textContent = word;
    setTimeout(() => { button.textContent = 'Copy'; }, 1500);
  };
  const byHand = () => { // a file's page may have no clipboard
    const area = document.createElement('textarea');
    area.value = text;
    document.body.append(area);
    area.select();
    const done = document.execCommand('copy');
    area.remove();
    said(done ? 'Copied' : 'Select it');
  };
  if (navigator.clipboard) navigator.clipboard.writeText(text).then(() => said('Copied'), byHand); else byHand();
};
for (const button of all('.copy')) {
  button.addEventListener('click', () => copied(button, button.previousElementSibling.textContent));
}

// ---- keyboard ----

const pressed = {
  ' ': () => player.toggle(),
  ArrowLeft: (event) => player.go(event.shiftKey ? -Math.round(0.5 / player.run.step) : -1),
  ArrowRight: (event) => player.go(event.shiftKey ? Math.round(0.5 / player.run.step) : 1),
  Home: () => { player.pause(); player.seek(0); },
  End: () => { player.pause(); player.seek(player.run.end); },
  c: () => player.next(),
  o: () => player.accompany((Number(player.beside.value) + 1) % player.beside.length),
  f: () => player.change('follow', !player.show.follow),
  g: () => player.change('ghosts', !player.show.ghosts),
  s: () => player.change('sight', !player.show.sight),
  '+': () => player.zoom(1.3),
  '=': () => player.zoom(1.3),
  '-': () => player.zoom(1 / 1.3),
  0: () => player.fit(),
};
document.addEventListener('keydown', (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.key === 'Escape') {
    toggleHelp(false);
    if (document.activeElement === search) search.blur();
    return;
  }
  const at = document.activeElement;
  const tag = at ? at.tagName : '';
  if ((tag === 'INPUT' && at.type === 'search') || tag === 'SELECT' || tag === 'TEXTAREA') return;
  if (event.key === ' ' && (tag === 'BUTTON' || tag === 'SUMMARY' || tag === 'INPUT' && at.type === 'checkbox')) return;
  if (event.key === 'j' || event.key === 'k') step(event.key === 'j' ? 1 : -1);
  else if (event.key === '/' && search) search.focus();
  else if (event.key === '?') toggleHelp(keys.hidden);
  else if (event.key === 't') theme.click();
  else if (player && player.run && player.node.offsetParent && pressed[event.key]) pressed[event.key](event);
  else return;
  event.preventDefault();
});

// ---- paper ----

window.addEventListener('beforeprint', () => {
  const chosen = root.dataset.theme;
  root.dataset.theme = 'light';
  const light = colours();
  if (chosen) root.dataset.theme = chosen; else delete root.dataset.theme;
  for (const article of articles.values()) {
    const stage = article.querySelector('.stage');
    const id = article.querySelector('.run').dataset.run;
    if (!id || stage.querySelector('.still')) continue;
    const run = new Run(read(id));
    const canvas = document.createElement('canvas');
    [canvas.width, canvas.height] = [640, 400];
    drawScene(canvas, run, groundOf(run.raw.roads), keyTime(run), fitted(run, canvas),
      { ghosts: true, sight: false }, light);
    const still = document.createElement('img');
    still.className = 'still';
    still.alt = 'The run from above at its last moment';
    still.src = canvas.toDataURL('image/jpeg', 0.8);
    stage.append(still);
  }
});

// Access for tests and for users of the browser's console.
window.foresee = {
  get player() { return player; },
  get current() { return current && current.id; },
  box(name) {
    const actor = player.run.actors.find((one) => one.id === name);
    const pose = actor && player.run.pose(actor.way, player.time);
    return pose && corners(pose, actor.size[0], actor.size[1]);
  },
};
route();
