// Decodes a run of the page, and returns its state at any time.

const read = (id) => JSON.parse(document.getElementById(id).textContent);
const DRAWING = read('drawing'); // names of the paints, limits of lines on the ground, and other constants

const sums = (list, count) => {
  const values = new Float64Array(count);
  let value = 0;
  for (let k = 0; k < count; k += 1) {
    value += k < list.length ? list[k] : 0;
    values[k] = value;
  }
  return values;
};

// Values of a way: the first one, its first difference, and then by how much the difference changes.
const track = (list, count) => {
  const values = new Float64Array(count);
  let value = list[0];
  let change = 0;
  for (let k = 0; k < count; k += 1) {
    if (k > 0) {
      change += k < list.length ? list[k] : 0;
      value += change;
    }
    values[k] = value;
  }
  return values;
};

// Converts a line or an outline from [x, y, dx, dy, ...] in cm to [[x, y], ...] in m.
const pointsOf = (list) => {
  const points = [];
  let x = 0;
  let y = 0;
  for (let k = 0; k < list.length; k += 2) {
    x += list[k];
    y += list[k + 1];
    points.push([x / 100, y / 100]);
  }
  return points;
};

const wayOf = (stretches) => stretches.map(([first, count, x, y, heading, speed]) => (
  { first, count, x: track(x, count), y: track(y, count), heading: track(heading, count), speed: track(speed, count) }));

class Run {
  constructor(raw) {
    this.raw = raw;
    this.step = raw.step;
    this.frames = raw.frames;
    this.end = raw.end;
    this.shapes = raw.shapes.map(shapeOf);
    this.actors = raw.actors.map((actor, index) => ({ ...actor, index, way: wayOf(actor.way), shapes: actor.shapes.map(shapeOf) }));
    this.ego = this.actors[0];
    this.opponent = this.actors.find((actor) => actor.id === raw.opponent && actor.index > 0) || null;
    this.ghosts = raw.ghosts.map((ghost) => ({ of: ghost.of, way: wayOf(ghost.way) }));
    this.signals = raw.signals.map((head) => ({ at: pointsOf(head.at), colours: head.colours }));
    this.gap = sums(raw.gap, 0);
    this.contact = raw.contact;
    this.forecast = raw.forecast;
    this.moments = raw.moments;
    this.rules = raw.rules;
    this.others = raw.others.map((other) => ({ driver: other.driver, way: wayOf(other.way) }));
  }

  timeOf(frame) { return Math.min(frame * this.step, this.end); }

  // The frame before a time, and the share of the interval to the next frame that has passed.
  place(time) {
    const at = Math.max(0, Math.min(time, this.end));
    const frame = Math.max(0, Math.min(Math.floor(at / this.step + 1e-6), this.frames - 2));
    const begin = this.timeOf(frame);
    const length = this.timeOf(frame + 1) - begin;
    return [frame, length > 0 ? Math.min(Math.max((at - begin) / length, 0), 1) : 0];
  }

  nearest(time) {
    const [frame, share] = this.place(time);
    return Math.min(share < 0.5 ? frame : frame + 1, this.frames - 1);
  }

  // The pose of an actor or a ghost at a time: m, rad, m/s; null if it is absent.
  pose(way, time) {
    const [frame, share] = this.place(time);
    const at = share > 0.999 ? frame + 1 : frame;
    for (const part of way) {
      const k = at - part.first;
      if (k >= 0 && k < part.count) {
        const next = Math.min(k + 1, part.count - 1);
        const part_ = at === frame ? share : 0;
        const mix = (list) => list[k] + (list[next] - list[k]) * part_;
        return { x: mix(part.x) / 100, y: mix(part.y) / 100, heading: mix(part.heading) / 1000, speed: mix(part.speed) / 100 };
      }
    }
    return null;
  }

  seen(actor, time) {
    const frame = this.nearest(time);
    let seen = false;
    for (const toggle of actor.seen) {
      if (toggle > frame) break;
      seen = !seen;
    }
    return seen;
  }

  // A curve's values by frame; null for a frame without a value.
  gaps(list) { return list.map((value) => (value < 0 ? null : value / 100)); }

  // The values of a measure of criticality by frame.
  measure(name, decimals) {
    const values = new Array(this.frames).fill(null);
    for (const [first, steps] of this.raw.curves[name]) {
      sums(steps, steps.length).forEach((value, k) => { values[first + k] = value / 10 ** decimals; });
    }
    return values;
  }

  speeds(way) {
    const values = new Array(this.frames).fill(null);
    for (const part of way) for (let k = 0; k < part.count; k += 1) values[part.first + k] = part.speed[k] * 0.036;
    return values;
  }

  colour(head, time) {
    const frame = this.nearest(time);
    let colour = 'off';
    for (let k = 0; k < head.colours.length && head.colours[k] <= frame; k += 2) colour = head.colours[k + 1];
    return colour;
  }
}

const corners = (pose, length, width) => {
  const cos = Math.cos(pose.heading);
  const sin = Math.sin(pose.heading);
  return [[1, 1], [-1, 1], [-1, -1], [1, -1]].map(([a, b]) => [
    pose.x + cos * a * length / 2 - sin * b * width / 2, pose.y + sin * a * length / 2 + cos * b * width / 2]);
};
