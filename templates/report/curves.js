// Speed and distance over time, with a cursor.

const PAD = { left: 36, right: 10, top: 20, bottom: 18 };

const niceStep = (most, count) => [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100].find((step) => most / step <= count) || 200;

class Curves {
  constructor(canvas, title, unit) {
    this.canvas = canvas;
    this.title = title;
    this.unit = unit;
    this.lines = [];
    [this.least, this.most] = [0, 1];
  }

  // lines: [{name, values, colour (a paint), dashed}]
  show(run, lines, limit, smallest = 1) {
    this.run = run;
    this.lines = lines.filter((line) => line.values.some((value) => value !== null));
    const all = this.lines.flatMap((line) => line.values.filter((value) => value !== null));
    this.most = Math.max(smallest, Math.min(Math.max(0, ...all) * 1.05, limit || Infinity));
    this.least = Math.min(0, Math.max(Math.min(0, ...all) * 1.05, -(limit || Infinity)));
    if (this.least < 0) this.most = Math.max(0, ...all) * 1.05;
  }

  timeAt(pixels) {
    const width = this.canvas.clientWidth - PAD.left - PAD.right;
    return Math.max(0, Math.min(1, (pixels - PAD.left) / width)) * this.run.end;
  }

  draw(time, c) {
    const { canvas, run } = this;
    const ratio = window.devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (!width || !run) return;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    const ctx = canvas.getContext('2d');
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    ctx.fillStyle = c.panel;
    ctx.fillRect(0, 0, width, height);
    const x = (at) => PAD.left + (run.end ? at / run.end : 0) * (width - PAD.left - PAD.right);
    const y = (value) => height - PAD.bottom - (Math.max(Math.min(value, this.most), this.least) - this.least)
      / (this.most - this.least) * (height - PAD.top - PAD.bottom);
    this.axes(ctx, x, y, width, height, c);
    const mark = (at, colour, dash) => {
      ctx.strokeStyle = colour;
      ctx.setLineDash(dash);
      ctx.beginPath();
      ctx.moveTo(x(at), PAD.top - 4);
      ctx.lineTo(x(at), height - PAD.bottom);
      ctx.stroke();
      ctx.setLineDash([]);
    };
    ctx.lineWidth = 1.2;
    if (run.forecast && run.forecast[0] >= 0 && run.forecast[0] <= run.end) mark(run.forecast[0], c.paints.forecast.line, [3, 3]);
    for (const [from, until] of run.rules) { // a small flag at the top, and a bar for as long as it lasts
      mark(from, c.warn, [1, 3]);
      ctx.fillStyle = c.warn;
      ctx.beginPath();
      ctx.moveTo(x(from) - 4, PAD.top - 6);
      ctx.lineTo(x(from) + 4, PAD.top - 6);
      ctx.lineTo(x(from), PAD.top);
      ctx.fill();
      ctx.fillRect(x(from), height - PAD.bottom - 2, x(until) - x(from), 2);
    }
    if (run.contact) mark(run.contact[0], c.paints.contact.line, []);
    for (const line of this.lines) {
      ctx.strokeStyle = line.colour === 'good' ? c.good : c.paints[line.colour].fill;
      ctx.lineWidth = line.dashed ? 1.2 : 1.8;
      ctx.setLineDash(line.dashed ? [4, 3] : []);
      ctx.beginPath();
      let drawn = false;
      line.values.forEach((value, frame) => {
        if (value === null) drawn = false;
        else {
          const at = [x(run.timeOf(frame)), y(value)];
          if (drawn) ctx.lineTo(...at); else ctx.moveTo(...at);
          drawn = true;
        }
      });
      ctx.stroke();
    }
    ctx.setLineDash([]);
    ctx.lineWidth = 1.2;
    ctx.strokeStyle = c.ink;
    ctx.beginPath();
    ctx.moveTo(x(time), PAD.top - 4);
    ctx.lineTo(x(time), height - PAD.bottom);
    ctx.stroke();
    this.values(ctx, time, width, y, x, c);
  }

  axes(ctx, x, y, width, height, c) {
    ctx.font = '11px system-ui, sans-serif';
    ctx.fillStyle = c.muted;
    ctx.strokeStyle = c.line;
    ctx.lineWidth = 1;
    ctx.textAlign = 'right';
    const rise = niceStep(this.most - this.least, 4);
    for (let value = Math.ceil(this.least / rise) * rise; value <= this.most + 1e-9; value += rise) {
      ctx.beginPath();
      ctx.moveTo(PAD.left, Math.round(y(value)) + 0.5);
      ctx.lineTo(width - PAD.right, Math.round(y(value)) + 0.5);
      ctx.stroke();
      ctx.fillText(String(Math.round(value * 100) / 100), PAD.left - 5, y(value) + 4);
    }
    ctx.textAlign = 'center';
    const pace = niceStep(this.run.end, width > 500 ? 10 : 6);
    for (let at = 0; at <= this.run.end + 1e-6; at += pace) {
      ctx.fillText(String(Math.round(at * 10) / 10), x(at), height - 4);
    }
  }

  values(ctx, time, width, y, x, c) {
    const frame = this.run.nearest(time);
    ctx.textAlign = 'left';
    ctx.font = '11px system-ui, sans-serif';
    ctx.fillStyle = c.muted;
    if (this.title) ctx.fillText(`${this.title}, ${this.unit}`, 8, 13);
    ctx.textAlign = 'right';
    ctx.font = '600 11px system-ui, sans-serif';
    let right = width - PAD.right;
    for (const line of [...this.lines].reverse()) {
      const value = line.values[frame];
      if (value === null || value === undefined) continue;
      ctx.fillStyle = line.colour === 'good' ? c.good : c.paints[line.colour].fill;
      ctx.beginPath();
      ctx.arc(x(time), y(value), line.dashed ? 2 : 3, 0, 7);
      ctx.fill();
      if (line.dashed) continue;
      const text = `${line.name.length > 14 ? `${line.name.slice(0, 13)}…` : line.name} ${value.toFixed(this.decimals || 1)}`;
      ctx.fillText(text, right, 13);
      right -= ctx.measureText(text).width + 12;
    }
  }
}
