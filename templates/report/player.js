// Plays one run: canvas, slider, curves, and the story's sentences beside it.

const grounds = new Map();
const groundOf = (id) => {
  if (!grounds.has(id)) grounds.set(id, new Ground(read(id)));
  return grounds.get(id);
};

class Player {
  constructor() {
    this.node = document.getElementById('player').content.firstElementChild.cloneNode(true);
    this.find = (selector) => this.node.querySelector(selector);
    this.canvas = this.find('.scene');
    this.slider = this.find('.time');
    this.speed = new Curves(this.find('.speed'), 'speed', 'km/h');
    this.gap = new Curves(this.find('.gap'), '', '');
    this.measure = this.find('.measure');
    this.curve = 'gap'; // the measure that the reader chose last
    this.show = { follow: false, ghosts: true, sight: true };
    this.time = 0;
    this.playing = false;
    this.rate = 1;
    this.run = null;
    this.colours = colours();
    this.listen();
  }

  listen() {
    const actions = { play: () => this.toggle(), back: () => this.go(-1), on: () => this.go(1), in: () => this.zoom(1.3),
      out: () => this.zoom(1 / 1.3), fit: () => this.fit() };
    this.node.addEventListener('click', (event) => {
      const button = event.target.closest('[data-do]');
      if (button) actions[button.dataset.do]();
    });
    this.slider.addEventListener('input', () => { this.pause(); this.seek(Number(this.slider.value)); });
    this.measure.addEventListener('change', () => { this.curve = this.measure.value; this.choose(); this.draw(); });
    this.find('.other').addEventListener('change', (event) => this.accompany(Number(event.target.value)));
    this.find('.rate').addEventListener('change', (event) => { this.rate = Number(event.target.value); });
    for (const box of this.node.querySelectorAll('[data-switch]')) {
      box.addEventListener('change', () => this.change(box.dataset.switch, box.checked));
    }
    for (const curve of [this.speed, this.gap]) {
      const seek = (event) => {
        if (event.type === 'pointermove' && !event.buttons) return;
        this.pause();
        this.seek(curve.timeAt(event.offsetX));
      };
      curve.canvas.addEventListener('pointerdown', seek);
      curve.canvas.addEventListener('pointermove', seek);
    }
    this.drag();
    new ResizeObserver(() => { if (this.run && !this.moved) this.view = fitted(this.run, this.canvas); this.draw(); }).observe(this.canvas);
  }

  drag() {
    const { canvas } = this;
    let from = null;
    canvas.addEventListener('pointerdown', (event) => { from = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); });
    canvas.addEventListener('pointerup', () => { from = null; });
    canvas.addEventListener('pointercancel', () => { from = null; });
    canvas.addEventListener('pointermove', (event) => {
      if (!this.run) return;
      if (from && (event.pointerType === 'mouse' || event.pointerType === 'pen')) {
        if (this.show.follow) this.change('follow', false);
        this.view.x -= (event.clientX - from[0]) / this.view.scale;
        this.view.y += (event.clientY - from[1]) / this.view.scale;
        from = [event.clientX, event.clientY];
        this.moved = true;
        this.draw();
      } else this.hover(event);
    });
    canvas.addEventListener('pointerleave', () => { this.find('.tip').hidden = true; });
    canvas.addEventListener('wheel', (event) => {
      if (!event.ctrlKey && !event.metaKey && document.activeElement !== document.body && !event.shiftKey) return;
      if (!event.ctrlKey && !event.metaKey && !event.shiftKey) return; // the page scrolls
      event.preventDefault();
      this.zoom(event.deltaY < 0 ? 1.15 : 1 / 1.15);
    }, { passive: false });
  }

  hover(event) {
    const tip = this.find('.tip');
    const [x, y] = [this.view.x + (event.offsetX - this.canvas.clientWidth / 2) / this.view.scale,
      this.view.y - (event.offsetY - this.canvas.clientHeight / 2) / this.view.scale];
    const over = this.run.actors.find((actor) => {
      const pose = this.run.pose(actor.way, this.time);
      return pose && Math.hypot(pose.x - x, pose.y - y) < Math.max(actor.size[0] / 2, 8 / this.view.scale);
    });
    tip.hidden = !over;
    if (!over) return;
    const { speed } = this.run.pose(over.way, this.time);
    const seen = over.index === 0 || this.run.seen(over, this.time) ? '' : ', not seen by the ego';
    tip.textContent = `${over.id}: ${over.model}, ${(speed * 3.6).toFixed(0)} km/h${seen}`;
    tip.style.left = `${Math.min(event.offsetX + 12, this.canvas.clientWidth - tip.offsetWidth - 4)}px`;
    tip.style.top = `${event.offsetY + 14}px`;
  }

  // Show a run in a place of the page; `section` holds its sentences.
  load(id, stage, section) {
    this.pause();
    this.section = section;
    this.run = new Run(read(id));
    this.ground = groundOf(this.run.raw.roads);
    const { run } = this;
    stage.prepend(this.node);
    const other = run.opponent ? run.opponent.id : 'the other';
    const measures = DRAWING.measures.filter(([name]) => name in run.raw.curves);
    this.measure.replaceChildren(...[['gap', `distance to ${other}`, 'm'], ...measures].map(([name, words, unit]) => {
      const option = document.createElement('option');
      [option.value, option.textContent] = [name, `${words}, ${unit}`];
      return option;
    }));
    this.choose();
    this.find('.chosen-curve').hidden = !run.raw.gap.length;
    this.find('.ruled').hidden = !run.rules.length;
    for (const part of this.node.querySelectorAll('.ghosted')) part.hidden = !run.ghosts.length;
    this.find('.foreseen').hidden = !run.forecast;
    this.beside = this.find('.other');
    this.beside.replaceChildren(...['no other driver', ...run.others.map((one) => one.driver)].map((words, k) => {
      const option = document.createElement('option');
      [option.value, option.textContent] = [k, words];
      return option;
    }));
    this.find('.besides').hidden = !run.others.length;
    this.slider.max = run.end;
    this.moved = false;
    this.view = fitted(run, this.canvas);
    this.accompany(0);
    this.change('follow', run.end > 20);
    this.seek(keyTime(run));
  }

  // Show the run of another driver beside this one: the first for 1; none for 0.
  accompany(number) {
    const { run } = this;
    this.show.other = run.others[number - 1] || null;
    this.beside.value = this.show.other ? number : 0;
    this.find('.accompanied').hidden = !this.show.other;
    const answer = this.show.other && this.section.querySelector(`.references [data-driver="${CSS.escape(this.show.other.driver)}"]`);
    this.find('.besides .answer').textContent = answer ? answer.textContent.trim().replace(/\s+/g, ' ') : '';
    this.speeds();
    this.draw();
  }

  // The speeds of ego and opponent, in the parent's run too, and of the ego of the run beside it.
  speeds() {
    const { run } = this;
    const other = run.opponent ? run.opponent.id : 'the other';
    const ghostly = (actor) => run.ghosts.filter((ghost) => actor && ghost.of === actor.index);
    this.speed.show(run, [
      ...ghostly(run.ego).map((ghost) => ({ name: '', values: run.speeds(ghost.way), colour: 'ego', dashed: true })),
      ...ghostly(run.opponent).map((ghost) => ({ name: '', values: run.speeds(ghost.way), colour: 'opponent', dashed: true })),
      { name: 'ego', values: run.speeds(run.ego.way), colour: 'ego' },
      ...(run.opponent ? [{ name: other, values: run.speeds(run.opponent.way), colour: 'opponent' }] : []),
      ...(this.show.other ? [{ name: this.show.other.driver, values: run.speeds(this.show.other.way), colour: 'good' }] : []),
    ]);
  }

  // Show the chosen curve, or the distance if this run has no values of it.
  choose() {
    const { run } = this;
    const measure = DRAWING.measures.find(([name]) => name === this.curve && name in run.raw.curves);
    this.measure.value = measure ? measure[0] : 'gap';
    const other = run.opponent ? run.opponent.id : 'the other';
    if (measure) {
      const [name, words, unit, decimals] = measure;
      this.gap.decimals = decimals;
      this.gap.show(run, [{ name: '', values: run.measure(name, decimals), colour: 'opponent' }], unit === 'm' ? 100 : 15,
        unit === 'share' ? 0.1 : 1);
      this.gap.canvas.setAttribute('aria-label', `${words} over time`);
      return;
    }
    this.gap.decimals = 1;
    this.gap.show(run, [
      { name: 'parent', values: run.gaps(run.raw.ghost_gap), colour: 'other', dashed: true },
      { name: other, values: run.gaps(run.raw.gap), colour: 'opponent' },
    ], 40);
    this.gap.canvas.setAttribute('aria-label', 'Distance over time');
  }

  // Show the next curve of the list, the first after the last.
  next() {
    if (!this.measure.length) return;
    this.curve = this.measure.options[(this.measure.selectedIndex + 1) % this.measure.length].value;
    this.choose();
    this.draw();
  }

  change(name, on) {
    this.show[name] = on;
    this.find(`[data-switch="${name}"]`).checked = on;
    if (name === 'follow' && !on && !this.moved) this.view = fitted(this.run, this.canvas);
    this.draw();
  }

  zoom(by) {
    this.view.scale = Math.max(1.5, Math.min(60, this.view.scale * by));
    this.moved = true;
    this.draw();
  }

  fit() {
    this.moved = false;
    this.view = fitted(this.run, this.canvas);
    this.change('follow', false);
  }

  seek(time) {
    this.time = Math.max(0, Math.min(time, this.run.end));
    this.slider.value = this.time;
    this.slider.setAttribute('aria-valuetext', `${this.time.toFixed(2)} seconds`);
    this.find('.now').textContent = `${this.time.toFixed(2)} s`;
    this.tell();
    this.draw();
  }

  // The driver's own reasons at the cursor, if the page has them.
  because() {
    const { reasons } = this.run.raw;
    this.find('.because').hidden = !reasons.length;
    const texts = (reasons.filter(([at]) => at <= this.time + 0.011).pop() || [0, []])[1];
    this.find('.because ul').replaceChildren(...(texts.length ? texts : ['none: it drives freely']).map((text) => {
      const item = document.createElement('li');
      item.textContent = text;
      return item;
    }));
  }

  tell() {
    this.because();
    const past = this.run.moments.filter(([at]) => at <= this.time + 0.011);
    const last = past[past.length - 1];
    const near = last && this.time - last[0] < 1.5 ? last[1] : '';
    this.find('.event').textContent = near.length > 90 ? `${near.slice(0, 89)}…` : near;
    const buttons = [...this.section.querySelectorAll('.moments button')];
    buttons.forEach((button, k) => {
      button.classList.toggle('past', k < past.length);
      button.classList.toggle('at', k === past.length - 1);
    });
  }

  // Move by a number of frames, forward or back.
  go(frames) {
    this.pause();
    this.seek(this.run.timeOf(Math.max(0, Math.min(this.run.frames - 1, this.run.nearest(this.time) + frames))));
  }

  toggle() { if (this.playing) this.pause(); else this.play(); }

  play() {
    if (!this.run) return;
    if (this.time >= this.run.end - 1e-3) this.seek(this.run.end > 20 ? this.run.end - 10 : 0);
    this.playing = true;
    this.find('.play').textContent = 'Pause';
    let before = null;
    const tick = (now) => {
      if (!this.playing) return;
      if (before !== null) this.seek(this.time + Math.min(now - before, 100) / 1000 * this.rate);
      before = now;
      if (this.time >= this.run.end - 1e-6) this.pause();
      else requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  pause() {
    this.playing = false;
    this.find('.play').textContent = 'Play';
  }

  draw() {
    if (!this.run || !this.node.isConnected) return;
    if (this.show.follow) {
      const ego = this.run.pose(this.run.ego.way, this.time);
      if (ego) [this.view.x, this.view.y] = [ego.x, ego.y];
    }
    drawScene(this.canvas, this.run, this.ground, this.time, this.view, this.show, this.colours);
    this.speed.draw(this.time, this.colours);
    if (this.run.raw.gap.length) this.gap.draw(this.time, this.colours);
  }

  repaint() {
    this.colours = colours();
    this.draw();
  }
}
