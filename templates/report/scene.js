// The view from above, on a canvas.

// The colours of the page, and the paints of its pictures.
const colours = () => {
  const style = getComputedStyle(document.documentElement);
  const value = (name) => style.getPropertyValue(`--${name}`).trim();
  const named = (names, of) => Object.fromEntries(names.map((name) => [name, of(name)]));
  return { ...named(['panel', 'line', 'ink', 'muted', 'accent', 'warn', 'good'], value),
    paints: named(DRAWING.paints, (name) => ({ fill: value(`p-${name}`), line: value(`p-${name}-line`) })) };
};
const REACH_M = 80;
const RAYS = 540;

const lined = (lines, close) => {
  const path = new Path2D();
  for (const points of lines) {
    points.forEach(([x, y], k) => (k ? path.lineTo(x, y) : path.moveTo(x, y)));
    if (close) path.closePath();
  }
  return path;
};

// A shape as the report wrote it (see `report.drawing.data`), with its path.
const shapeOf = (raw) => {
  const rings = raw.rings.map(pointsOf);
  return { ...raw, rings, path: lined(rings, raw.closed) };
};

// Draws a shape; `pixel`: its length in m.
const drawShape = (ctx, shape, paint, pixel) => {
  if (shape.closed && paint.fill) {
    ctx.fillStyle = paint.fill;
    ctx.fill(shape.path, 'evenodd');
  }
  if (!paint.line || !(shape.width || shape.width_m)) return;
  const { limits } = DRAWING;
  const share = shape.width_m / limits.line_m;
  const width = Math.min(Math.max(limits.line_m, limits.thinnest_px * pixel), limits.thickest_px * pixel);
  ctx.strokeStyle = paint.line;
  ctx.lineWidth = shape.width_m ? share * width : shape.width * pixel;
  ctx.setLineDash(shape.dash.map((length) => (shape.width_m ? Math.max(length, limits.least_dash_px * pixel) : length * pixel)));
  ctx.stroke(shape.path);
  ctx.setLineDash([]);
};

// The shapes on the ground, which are those of all pictures of a road.
class Ground {
  constructor(raw) {
    this.shapes = raw.map(shapeOf);
    this.walls = this.shapes.filter((shape) => shape.paint === 'building').flatMap((shape) => shape.rings)
      .flatMap((outline) => outline.map((point, k) => [...point, ...outline[(k + 1) % outline.length]]));
  }

  // Draws the ground; `more`: further shapes on it.
  draw(ctx, c, pixel, more) {
    ctx.lineCap = 'butt';
    ctx.lineJoin = 'round';
    for (const shape of [...this.shapes, ...more]) drawShape(ctx, shape, c.paints[shape.paint], pixel);
  }
}

// The outline of the area that is visible from a point: buildings and tall bodies limit it.
const sightOutline = (x, y, walls) => {
  const near = walls.filter(([ax, ay, bx, by]) => Math.min(Math.hypot(ax - x, ay - y), Math.hypot(bx - x, by - y),
    Math.hypot((ax + bx) / 2 - x, (ay + by) / 2 - y)) < REACH_M + 40);
  const outline = [];
  for (let k = 0; k < RAYS; k += 1) {
    const angle = k * 2 * Math.PI / RAYS;
    const dx = Math.cos(angle);
    const dy = Math.sin(angle);
    let reach = REACH_M;
    for (const [ax, ay, bx, by] of near) {
      const wx = bx - ax;
      const wy = by - ay;
      const across = dx * wy - dy * wx;
      if (Math.abs(across) < 1e-9) continue;
      const way = ((ax - x) * wy - (ay - y) * wx) / across;
      const share = ((ax - x) * dy - (ay - y) * dx) / across;
      if (way > 0 && way < reach && share >= 0 && share <= 1) reach = way;
    }
    outline.push([x + dx * reach, y + dy * reach]);
  }
  return outline;
};

// Draws an actor's body at a pose: filled, or only its lines in the colour of its body.
const drawBody = (ctx, pose, actor, c, { filled, dashed, pixel }) => {
  ctx.save();
  ctx.translate(pose.x, pose.y);
  ctx.rotate(pose.heading);
  for (const shape of actor.shapes) {
    if (filled) {
      drawShape(ctx, shape, c.paints[shape.paint], pixel);
    } else {
      ctx.strokeStyle = c.paints[actor.paint].fill;
      ctx.lineWidth = 1.8 * pixel;
      ctx.setLineDash(dashed ? [4 * pixel, 3 * pixel] : []);
      ctx.stroke(shape.path);
    }
  }
  ctx.restore();
};

const drawTrail = (ctx, run, way, time, colour, pixel, dashed) => {
  ctx.strokeStyle = colour;
  ctx.lineWidth = 1.6 * pixel;
  ctx.globalAlpha = 0.6;
  ctx.setLineDash(dashed ? [3 * pixel, 4 * pixel] : []);
  ctx.beginPath();
  let drawn = false;
  for (let at = Math.max(0, time - 4); at <= time + 1e-6; at += 0.1) {
    const pose = run.pose(way, at);
    if (pose === null) drawn = false;
    else if (drawn) ctx.lineTo(pose.x, pose.y);
    else ctx.moveTo(pose.x, pose.y);
    if (pose !== null) drawn = true;
  }
  ctx.stroke();
  ctx.setLineDash([]);
  ctx.globalAlpha = 1;
};

const drawSignals = (ctx, run, time, c, pixel) => {
  for (const head of run.signals) {
    const [[ax, ay], [bx, by]] = head.at;
    const colour = c.paints[run.colour(head, time)].line;
    ctx.strokeStyle = colour;
    ctx.fillStyle = colour;
    ctx.lineWidth = Math.max(0.5, 3 * pixel);
    ctx.beginPath();
    if (ax === bx && ay === by) {
      ctx.arc(ax, ay, Math.max(0.35, 2.5 * pixel), 0, 7);
      ctx.fill();
    } else {
      ctx.moveTo(ax, ay);
      ctx.lineTo(bx, by);
      ctx.stroke();
    }
  }
};

// Draws the scene at a time. `view`: {x, y, scale (px/m)}; `show`: {ghosts, sight, other}.
const drawScene = (canvas, run, ground, time, view, show, c) => {
  const ratio = window.devicePixelRatio || 1;
  const width = canvas.clientWidth || canvas.width;
  const height = canvas.clientHeight || canvas.height;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const ctx = canvas.getContext('2d');
  ctx.setTransform(1, 0, 0, 1, 0, 0);
  ctx.globalAlpha = 1;
  ctx.fillStyle = c.paints.grass.fill;
  ctx.fillRect(0, 0, canvas.width, canvas.height);
  const scale = view.scale * ratio;
  ctx.setTransform(scale, 0, 0, -scale, canvas.width / 2 - view.x * scale, canvas.height / 2 + view.y * scale);
  const pixel = 1 / view.scale;
  ground.draw(ctx, c, pixel, run.shapes);

  const ego = run.pose(run.ego.way, time);
  const poses = run.actors.map((actor) => run.pose(actor.way, time));
  if (show.sight && ego) {
    // Bodies lower than the ego's sensors hide nothing in this picture.
    const tall = run.actors.filter((actor, k) => k && poses[k] && actor.size[2] > DRAWING.eye_m);
    const sides = tall.flatMap((actor) => {
      const box = corners(poses[actor.index], actor.size[0], actor.size[1]);
      return box.map((point, k) => [...point, ...box[(k + 1) % 4]]);
    });
    const [reachX, reachY] = [canvas.width / scale, canvas.height / scale];
    const hidden = lined([sightOutline(ego.x, ego.y, [...ground.walls, ...sides])], true);
    hidden.rect(view.x - reachX, view.y - reachY, 2 * reachX, 2 * reachY);
    ctx.save();
    ctx.fillStyle = c.paints.shade.fill;
    ctx.fill(hidden, 'evenodd');
    ctx.restore();
  }
  drawSignals(ctx, run, time, c, pixel);
  drawTrail(ctx, run, run.ego.way, time, c.paints.ego.fill, pixel);
  if (run.opponent) drawTrail(ctx, run, run.opponent.way, time, c.paints.opponent.fill, pixel);
  if (show.ghosts) {
    for (const ghost of run.ghosts) {
      const actor = run.actors[ghost.of];
      const pose = run.pose(ghost.way, time);
      if (actor === run.ego || actor === run.opponent) drawTrail(ctx, run, ghost.way, time, c.paints[actor.paint].fill, pixel, true);
      ctx.globalAlpha = 0.75;
      if (pose) drawBody(ctx, pose, actor, c, { filled: false, dashed: true, pixel });
      ctx.globalAlpha = 1;
    }
  }
  run.actors.forEach((actor, k) => {
    const pose = poses[k];
    if (pose && actor.kind === 'pedestrian') { // a person of 0.5 m is a few pixels wide: a disc makes it visible
      ctx.fillStyle = c.paints[`${actor.paint}-halo`].fill;
      ctx.beginPath();
      ctx.arc(pose.x, pose.y, Math.max(0.8, 6 * pixel), 0, 7);
      ctx.fill();
    }
    if (pose) drawBody(ctx, pose, actor, c, { filled: run.seen(actor, time), dashed: false, pixel });
  });
  if (show.other) { // the ego of another driver in the same situation
    const pose = run.pose(show.other.way, time);
    drawTrail(ctx, run, show.other.way, time, c.good, pixel);
    if (pose) drawBody(ctx, pose, run.ego, { ...c, paints: { ...c.paints, [run.ego.paint]: { fill: c.good } } }, { filled: false, dashed: false, pixel });
  }
  if (ego && run.opponent && poses[run.opponent.index]) {
    const other = poses[run.opponent.index];
    ctx.strokeStyle = c.paints.opponent.fill;
    ctx.lineWidth = 1.2 * pixel;
    ctx.globalAlpha = 0.8;
    ctx.setLineDash(run.seen(run.opponent, time) ? [] : [2 * pixel, 5 * pixel]);
    ctx.stroke(lined([[[ego.x, ego.y], [other.x, other.y]]]));
    ctx.setLineDash([]);
    ctx.globalAlpha = 1;
  }
  if (run.forecast && run.forecast.length > 2) {
    const [at, x, y] = run.forecast;
    ctx.strokeStyle = c.paints.forecast.line;
    ctx.lineWidth = (Math.abs(at - time) < 0.3 ? 4 : 2) * pixel;
    ctx.beginPath();
    ctx.arc(x, y, Math.max(1.2, 9 * pixel), 0, 7);
    ctx.stroke();
  }
  if (run.contact && run.contact.length > 2) {
    const [at, x, y] = run.contact;
    const now = Math.abs(at - time) < 0.06;
    ctx.fillStyle = c.paints.contact.fill;
    ctx.strokeStyle = c.paints.contact.line;
    ctx.lineWidth = 2 * pixel;
    ctx.beginPath();
    ctx.arc(x, y, (now ? 4 : 3) * pixel, 0, 7);
    ctx.fill();
    if (now) {
      ctx.beginPath();
      ctx.arc(x, y, 11 * pixel, 0, 7);
      ctx.stroke();
    }
  }
  drawLabels(ctx, canvas, run, poses, view, ratio, c);
};

const drawLabels = (ctx, canvas, run, poses, view, ratio, c) => {
  ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
  ctx.font = '600 12px system-ui, sans-serif';
  ctx.textAlign = 'center';
  ctx.lineJoin = 'round';
  const width = canvas.width / ratio;
  const height = canvas.height / ratio;
  for (const actor of [run.ego, run.opponent]) {
    const pose = actor && poses[actor.index];
    if (!pose) continue;
    const text = actor.id.length > 24 ? `${actor.id.slice(0, 23)}…` : actor.id;
    const x = width / 2 + (pose.x - view.x) * view.scale;
    const other = actor === run.ego ? run.opponent && poses[run.opponent.index] : poses[0];
    const below = other ? pose.y < other.y : false;
    const room = Math.hypot(...actor.size.slice(0, 2)) / 2 * view.scale;
    const y = height / 2 - (pose.y - view.y) * view.scale + (below ? room + 14 : -room - 6);
    ctx.lineWidth = 3;
    ctx.strokeStyle = c.paints.plate.fill;
    ctx.strokeText(text, x, y);
    ctx.fillStyle = c.paints[actor.paint].fill;
    ctx.fillText(text, x, y);
  }
  drawScale(ctx, height, view, c);
};

const drawScale = (ctx, height, view, c) => {
  const metres = [2, 5, 10, 20, 50].find((m) => m * view.scale > 40) || 50;
  ctx.strokeStyle = c.paints.ink.fill;
  ctx.fillStyle = c.paints.ink.fill;
  ctx.lineWidth = 1.5;
  ctx.font = '11px system-ui, sans-serif';
  ctx.textAlign = 'left';
  ctx.beginPath();
  ctx.moveTo(12, height - 14);
  ctx.lineTo(12, height - 10);
  ctx.lineTo(12 + metres * view.scale, height - 10);
  ctx.lineTo(12 + metres * view.scale, height - 14);
  ctx.stroke();
  ctx.fillText(`${metres} m`, 16, height - 15);
};

// The time of the contact, else of the smallest gap, else of the end.
const keyTime = (run) => {
  if (run.contact) return run.contact[0];
  const there = run.raw.gap.filter((value) => value >= 0);
  return there.length ? run.timeOf(run.raw.gap.indexOf(Math.min(...there))) : run.end;
};

// A view that contains ego and opponent during the last seconds before the contact (or the end).
const fitted = (run, canvas) => {
  const key = keyTime(run);
  let [left, right, low, high] = [Infinity, -Infinity, Infinity, -Infinity];
  for (let at = Math.max(0, key - DRAWING.view_s); at <= key + 1e-6; at += 0.25) {
    for (const actor of [run.ego, run.opponent]) {
      const pose = actor && run.pose(actor.way, at);
      if (!pose) continue;
      [left, right] = [Math.min(left, pose.x), Math.max(right, pose.x)];
      [low, high] = [Math.min(low, pose.y), Math.max(high, pose.y)];
    }
  }
  if (left > right) return { x: 0, y: 0, scale: 8 };
  const width = canvas.clientWidth || canvas.width;
  const height = canvas.clientHeight || canvas.height;
  const scale = Math.min(width / (right - left + 18), height / (high - low + 14), 22);
  return { x: (left + right) / 2, y: (low + high) / 2, scale: Math.max(scale, 3) };
};
