// Shows each picture that it receives. Its host is an editor's web view (messages) or `foresee draw --watch` (server-sent events).
'use strict';

(() => {
  const host = typeof acquireVsCodeApi === 'function' ? acquireVsCodeApi() : null;
  const at = (id) => document.getElementById(id);
  const picture = at('picture');
  const colours = new CSSStyleSheet();
  document.adoptedStyleSheets = [...document.adoptedStyleSheets, colours];
  const wish = { case: '', whole: false, width: 0 };
  let zoom = null; // the visible part of the map, as a viewBox; null for the whole map
  let shown = ''; // title of the last picture
  let events = null;

  const post = (message) => {
    if (host) host.postMessage(message);
    document.dispatchEvent(new CustomEvent('foresee', { detail: message }));
  };

  const scheme = () => {
    const classes = document.body.classList;
    if (classes.contains('vscode-dark') || classes.contains('vscode-high-contrast') || classes.contains('dark')) return 'dark';
    return classes.contains('vscode-light') || classes.contains('light') ? 'light' : '';
  };

  const mapOf = () => picture.querySelector('svg.map');

  const zoomed = () => {
    const map = mapOf();
    if (!map) return;
    if (!map.dataset.whole) map.dataset.whole = map.getAttribute('viewBox');
    map.setAttribute('viewBox', zoom ? zoom.join(' ') : map.dataset.whole);
    at('fit').hidden = zoom === null;
  };

  // The new drawing replaces the old one in one step, so that the page does not flicker.
  const draw = (state) => {
    if (state.style !== undefined && state.style !== draw.style) {
      colours.replaceSync(state.style);
      draw.style = state.style;
    }
    const parsed = new DOMParser().parseFromString(state.svg, 'image/svg+xml');
    if (parsed.querySelector('parsererror')) return;
    const fresh = document.importNode(parsed.documentElement, true);
    const wanted = scheme();
    if (wanted) fresh.classList.add(wanted);
    const what = `${state.title} ${wish.whole} ${fresh.querySelector('svg.map').getAttribute('viewBox')}`;
    if (what !== shown) zoom = null;
    shown = what;
    picture.replaceChildren(fresh);
    zoomed();
  };

  // An error with a place in the last complete picture is marked there.
  const mark = (mistakes) => {
    for (const node of picture.querySelectorAll('.mistaken')) node.classList.remove('mistaken');
    let first = 0;
    for (const { path, line } of mistakes) {
      let best = null;
      for (const node of picture.querySelectorAll('[data-line]')) {
        const [from, to] = [Number(node.dataset.line), Number(node.dataset.endLine)];
        if (node.dataset.path !== path || line < from || line > to) continue;
        if (!best || to - from < Number(best.dataset.endLine) - Number(best.dataset.line)) best = node;
      }
      if (!best) continue;
      for (const node of picture.querySelectorAll('[data-line]')) {
        if (node.dataset.path === path && node.dataset.line === best.dataset.line) node.classList.add('mistaken');
      }
      first += 1;
    }
    return first;
  };

  const go = (place) => {
    if (!Number(place.line)) return;
    const message = { type: 'goto', path: place.path, line: Number(place.line), column: Number(place.column) };
    post(message);
    if (!host) at('state').textContent = `${message.path}:${message.line}:${message.column}`;
  };

  const list = (mistakes) => {
    at('mistakes').hidden = mistakes.length === 0;
    at('mistakes').replaceChildren(...mistakes.slice(0, 6).map((mistake) => {
      const item = document.createElement('li');
      const button = document.createElement('button');
      button.type = 'button';
      const name = mistake.path ? `${mistake.path.split('/').pop()}:${mistake.line}: ` : '';
      button.textContent = name + mistake.message;
      button.addEventListener('click', () => go(mistake));
      item.append(button);
      return item;
    }));
  };

  const choose = (state) => {
    const select = at('cases');
    const cases = state.cases || [];
    select.hidden = cases.length < 2;
    if (select.dataset.names !== cases.join(' ')) {
      select.dataset.names = cases.join(' ');
      select.replaceChildren(...cases.map((name) => new Option(name, name)));
    }
    select.value = state.case;
    wish.case = state.case;
  };

  const show = (state) => {
    const mistakes = state.mistakes || [];
    if (state.svg) {
      draw(state);
      choose(state);
      document.title = state.title;
    }
    picture.classList.toggle('stale', !state.svg);
    mark(state.svg ? [] : mistakes);
    list(mistakes);
    at('state').textContent = mistakes.length ? (state.svg ? 'drawn as far as it can be' : 'the last picture') : '';
    picture.dataset.drawn = String(Number(picture.dataset.drawn || 0) + 1);
  };

  const wished = () => {
    post({ type: 'wish', ...wish });
    const connect = document.body.dataset.connect;
    if (!connect) return;
    if (events) events.close();
    const asked = new URLSearchParams({ case: wish.case, whole: wish.whole ? '1' : '', width: String(wish.width) });
    events = new EventSource(`${connect}?${asked}`);
    events.onmessage = (event) => show(JSON.parse(event.data));
    events.onerror = () => { at('state').textContent = 'the command has ended'; };
  };

  // ---- clicks, keys, the wheel ----------------------------------------------------------------------------------------

  let dragged = null;
  picture.addEventListener('click', (event) => {
    const node = event.target.closest('[data-line]');
    if (node && !(dragged && dragged.far)) go(node.dataset);
  });
  picture.addEventListener('keydown', (event) => {
    if (event.key === 'Enter' && event.target.dataset && event.target.dataset.line) go(event.target.dataset);
  });
  const box = () => (zoom || mapOf().dataset.whole.split(' ').map(Number));
  picture.addEventListener('wheel', (event) => {
    const map = event.target.closest('svg.map');
    if (!map || !(event.ctrlKey || event.metaKey)) return;
    event.preventDefault();
    const [x, y, width, height] = box();
    const whole = map.dataset.whole.split(' ').map(Number);
    const factor = Math.min(Math.max(Math.exp(event.deltaY / 300), 0.5), 2);
    const rect = map.getBoundingClientRect();
    const [u, v] = [(event.clientX - rect.left) / rect.width, (event.clientY - rect.top) / rect.height];
    const wide = Math.min(width * factor, whole[2]);
    const high = wide * height / width;
    zoom = wide >= whole[2] ? null : [x + u * (width - wide), y + v * (height - high), wide, high];
    zoomed();
  }, { passive: false });
  picture.addEventListener('pointerdown', (event) => {
    dragged = zoom && event.target.closest('svg.map') ? { x: event.clientX, y: event.clientY, from: zoom, far: false } : null;
  });
  picture.addEventListener('pointermove', (event) => {
    if (!dragged || !event.buttons) return;
    const rect = mapOf().getBoundingClientRect();
    const [x, y, width, height] = dragged.from;
    const [dx, dy] = [event.clientX - dragged.x, event.clientY - dragged.y];
    dragged.far = dragged.far || Math.hypot(dx, dy) > 4;
    zoom = [x - dx * width / rect.width, y - dy * height / rect.height, width, height];
    zoomed();
  });
  at('fit').addEventListener('click', () => { zoom = null; zoomed(); });
  at('whole').addEventListener('change', (event) => { wish.whole = event.target.checked; wished(); });
  at('cases').addEventListener('change', (event) => { wish.case = event.target.value; wished(); });
  window.addEventListener('message', (event) => {
    if (event.data && event.data.type === 'picture') show(event.data.state);
    if (event.data && event.data.type === 'case') wish.case = event.data.case;
  });

  let timer = 0;
  new ResizeObserver(() => {
    const width = Math.round(document.documentElement.clientWidth);
    if (!width || width === wish.width) return;
    clearTimeout(timer);
    timer = setTimeout(() => { wish.width = width; wished(); }, wish.width ? 150 : 0);
  }).observe(document.documentElement);
  window.foresee = { show, wish };
})();
