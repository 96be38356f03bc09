// Draws the plan of the junction ahead: heading up, the car below the middle, metres to pixels.

const AHEAD = 0.8;              // where the car stands, of the height from above
const NEAR_M = 28, FAR_M = 105; // how far ahead of the car the junction's centre is kept in sight
const PERIOD_MS = 100;
const CAR = { front: 3.55, back: 0.95, half: 0.9 };
const MOST_AHEAD_S = 0.5;
const COLOURS = ["ground", "road", "middle", "line", "paint", "building", "island", "own", "text",
  "quiet", "panel", "watch", "danger", "road-user", "twin"];

export class Plan {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.colours = {};
    this.frame = null;
    this.at = 0;
    this.paths = null;
    this.world = null;
    this.wanted = null;
    this.reach = FAR_M;
    this.yaw = null;
    this.drawn = 0;
  }

  recolour() {
    const style = getComputedStyle(document.documentElement);
    for (const name of COLOURS) this.colours[name] = style.getPropertyValue(`--${name}`).trim();
    this.draw(performance.now());
  }

  take(frame, at) {
    this.frame = frame;
    this.at = at;
    if (frame.world_id !== this.wanted) this.load(frame.world_id);
  }

  async load(world) {
    this.wanted = world;
    if (world === null) { this.world = this.paths = null; return; }
    try {
      const answer = await fetch(`plan/${encodeURIComponent(world)}`);
      if (!answer.ok) throw new Error(`${answer.status}`);
      const found = await answer.json();
      if (this.wanted !== world) return;
      this.world = found;
      this.paths = pathsOf(found);
    } catch { if (this.wanted === world) this.wanted = undefined; }
  }

  // One picture of a frame that stays.
  async still() {
    if (this.frame.world_id !== null) { this.wanted = undefined; await this.load(this.frame.world_id); }
    this.yaw = null;
    this.draw(this.at);
  }

  run() {
    const turn = (now) => {
      if (now - this.drawn >= PERIOD_MS) { this.drawn = now; this.draw(now); }
      requestAnimationFrame(turn);
    };
    requestAnimationFrame(turn);
  }

  draw(now) {
    const { canvas, context: pen, frame, colours } = this;
    const box = canvas.getBoundingClientRect(), dense = Math.min(devicePixelRatio || 1, 2);
    const wide = Math.round(box.width * dense), high = Math.round(box.height * dense);
    if (!wide || !high) return;
    if (canvas.width !== wide || canvas.height !== high) { canvas.width = wide; canvas.height = high; }
    pen.setTransform(1, 0, 0, 1, 0, 0);
    pen.fillStyle = colours.ground;
    pen.fillRect(0, 0, wide, high);
    if (!frame || !frame.pose) return;
    let [x, y, yaw, speed] = frame.pose;
    const ahead = Math.min(Math.max((now - this.at) / 1000, 0), MOST_AHEAD_S) * speed;
    x += Math.cos(yaw) * ahead;
    y += Math.sin(yaw) * ahead;
    this.yaw = this.yaw === null ? yaw : this.yaw + 0.35 * Math.atan2(Math.sin(yaw - this.yaw), Math.cos(yaw - this.yaw));
    const scale = this.scale(x, y, high);
    const turn = Math.PI / 2 - this.yaw;
    // Metres, y up, to pixels, y down.
    const [c, s] = [Math.cos(turn) * scale, Math.sin(turn) * scale];
    const place = [c, -s, -s, -c, wide / 2 - c * x + s * y, high * AHEAD + s * x + c * y];
    pen.setTransform(...place);
    this.pixel = 1 / scale;
    this.ground();
    this.future();
    this.users(turn);
    this.car(x, y, yaw);
    pen.setTransform(1, 0, 0, 1, 0, 0);
    this.labels((at) => [place[0] * at[0] + place[2] * at[1] + place[4], place[1] * at[0] + place[3] * at[1] + place[5]], dense);
  }

  scale(x, y, high) {
    let away = NEAR_M;
    if (this.world) away = Math.hypot(this.world.centre[0] - x, this.world.centre[1] - y) + 8;
    const wanted = Math.min(Math.max(away, NEAR_M), FAR_M);
    this.reach = this.yaw === null || Math.abs(wanted - this.reach) > 40 ? wanted : this.reach + 0.12 * (wanted - this.reach);
    return (high * (AHEAD - 0.3)) / this.reach;
  }

  ground() {
    const { context: pen, colours, paths, frame } = this;
    if (!paths) return;
    const fill = (path, colour) => { pen.fillStyle = colour; pen.fill(path, "evenodd"); };
    const line = (path, colour, width) => {
      pen.strokeStyle = colour;
      pen.lineWidth = Math.max(width, this.pixel);
      pen.stroke(path);
    };
    pen.lineCap = pen.lineJoin = "round";
    fill(paths.buildings, colours.building);
    for (const one of paths.surface) fill(one, colours.road);
    fill(paths.junction, colours.middle);
    fill(paths.islands, colours.island);
    pen.globalAlpha = 0.55;
    line(paths.edges, colours.line, 0.12);
    pen.globalAlpha = 1;
    line(paths.kerbs, colours.line, 0.25);
    for (const [from, to, width] of this.world.crossings) this.zebra(from, to, width);
    line(paths.stops, colours.paint, 0.5);
    for (const head of this.world.signals) this.lamp(head.at, frame.lights[head.group]);
  }

  zebra(from, to, width) {
    const { context: pen, colours } = this;
    pen.strokeStyle = colours.paint;
    pen.lineCap = "butt";
    pen.lineWidth = width;
    pen.globalAlpha = 0.8;
    pen.setLineDash([0.5, 0.6]);
    pen.beginPath();
    pen.moveTo(...from);
    pen.lineTo(...to);
    pen.stroke();
    pen.setLineDash([]);
    pen.globalAlpha = 1;
    pen.lineCap = "round";
  }

  // Three lamps, of which the lit one tells by its place, not by its colour alone.
  lamp(at, colour) {
    const { context: pen, colours } = this, size = Math.max(0.9, 7 * this.pixel);
    const up = [Math.cos(this.yaw), Math.sin(this.yaw)];
    const lit = { red: [1], "red and amber": [1, 0], amber: [0], green: [-1] }[colour] ?? [];
    const fills = { 1: colours.danger, 0: colours.watch, "-1": colours.text };
    for (const step of [1, 0, -1]) {
      pen.beginPath();
      pen.arc(at[0] + up[0] * step * size * 2, at[1] + up[1] * step * size * 2, size, 0, 2 * Math.PI);
      pen.fillStyle = lit.includes(step) ? fills[step] : colours.panel;
      pen.fill();
      pen.strokeStyle = colours.text;
      pen.lineWidth = 2 * this.pixel;
      pen.stroke();
    }
  }

  trace(points, colour, width, dash = []) {
    if (points.length < 2) return;
    const pen = this.context;
    pen.strokeStyle = colour;
    pen.lineWidth = Math.max(width, 2 * this.pixel);
    pen.setLineDash(dash);
    pen.beginPath();
    pen.moveTo(...points[0]);
    for (const point of points.slice(1)) pen.lineTo(...point);
    pen.stroke();
    pen.setLineDash([]);
  }

  future() {
    const { frame, colours, context: pen } = this, danger = frame.danger;
    pen.globalAlpha = 0.35;
    for (const path of frame.others) this.trace(path, colours.quiet, 0.4);
    pen.globalAlpha = 1;
    this.trace(frame.nominal, colours.own, 1.1);
    this.arrow(frame.nominal, colours.own, 2.2);
    if (!danger) return;
    const colour = frame.level === "calm" ? colours.quiet : colours[frame.level] || colours.quiet;
    this.trace(danger.path, colour, 0.9, [2.4, 1.6]);
    this.trace(danger.other, colours["road-user"], 0.9);
    this.arrow(danger.other, colours["road-user"], 2.4);
    const end = danger.path.at(-1);
    if (!end) return;
    // Where they meet: a cross where they touch, a ring where they pass.
    const size = Math.max(2.2, 14 * this.pixel);
    pen.strokeStyle = colour;
    pen.lineWidth = Math.max(0.8, 5 * this.pixel);
    pen.beginPath();
    if (danger.hits) {
      for (const [a, b] of [[1, 1], [1, -1]]) {
        pen.moveTo(end[0] - a * size, end[1] - b * size);
        pen.lineTo(end[0] + a * size, end[1] + b * size);
      }
    } else pen.arc(end[0], end[1], size, 0, 2 * Math.PI);
    pen.stroke();
  }

  arrow(points, colour, size) {
    const end = points.at(-1), before = points.findLast((one) => end && Math.hypot(one[0] - end[0], one[1] - end[1]) > 0.8);
    if (!end || !before) return;
    const pen = this.context, along = Math.atan2(end[1] - before[1], end[0] - before[0]);
    size = Math.max(size, 9 * this.pixel);
    pen.fillStyle = colour;
    pen.beginPath();
    for (const [turn, far] of [[0, 1.3], [2.5, 1], [-2.5, 1]]) {
      pen.lineTo(end[0] + far * size * Math.cos(along + turn), end[1] + far * size * Math.sin(along + turn));
    }
    pen.fill();
  }

  box(x, y, yaw, front, back, half) {
    const pen = this.context, [c, s] = [Math.cos(yaw), Math.sin(yaw)];
    pen.beginPath();
    for (const [a, b] of [[front, half], [front, -half], [-back, -half], [-back, half]]) {
      pen.lineTo(x + c * a - s * b, y + s * a + c * b);
    }
    pen.closePath();
  }

  users() {
    const { frame, colours, context: pen } = this;
    for (const one of frame.seen) {
      this.box(one.at[0], one.at[1], one.yaw, one.size[0] / 2, one.size[0] / 2, one.size[1] / 2);
      pen.fillStyle = colours.quiet;
      pen.fill();
    }
    if (!frame.danger || !frame.danger.other.length) return;
    const [from] = frame.danger.other;
    pen.fillStyle = colours["road-user"];
    pen.beginPath();
    pen.arc(from[0], from[1], Math.max(1.3, 8 * this.pixel), 0, 2 * Math.PI);
    pen.fill();
  }

  car(x, y, yaw) {
    const { frame, colours, context: pen } = this, least = Math.max(1, 26 * this.pixel / (CAR.front + CAR.back));
    if (frame.twin_pose) {
      const [tx, ty, turned] = frame.twin_pose;
      this.box(tx, ty, turned, CAR.front * least, CAR.back * least, CAR.half * least);
      pen.strokeStyle = colours.twin;
      pen.lineWidth = 3 * this.pixel;
      pen.stroke();
    }
    this.box(x, y, yaw, CAR.front * least, CAR.back * least, CAR.half * least);
    pen.fillStyle = colours.own;
    pen.fill();
    pen.strokeStyle = colours.ground;
    pen.lineWidth = 2 * this.pixel;
    pen.stroke();
  }

  labels(pixelOf, dense) {
    const { frame, colours, context: pen, canvas } = this;
    if (!frame.danger || !frame.danger.other.length) return;
    const text = frame.danger.what.split(" ")[0], size = 22 * dense;
    let [x, y] = pixelOf(frame.danger.other[0]);
    pen.font = `700 ${size}px system-ui, sans-serif`;
    const wide = pen.measureText(text).width, pad = 6 * dense;
    x = Math.min(Math.max(x - wide / 2, pad), canvas.width - wide - pad);
    y = Math.min(Math.max(y - 18 * dense, size + pad), canvas.height - 30 * dense);
    pen.fillStyle = colours.panel;
    pen.fillRect(x - pad, y - size, wide + 2 * pad, size * 1.3);
    pen.fillStyle = colours.text;
    pen.fillText(text, x, y);
  }
}

function pathsOf(world) {
  const path = (lines, close) => {
    const made = new Path2D();
    for (const line of lines) {
      line.forEach((point, place) => (place ? made.lineTo(...point) : made.moveTo(...point)));
      if (close) made.closePath();
    }
    return made;
  };
  return {
    surface: world.surface.map((rings) => path(rings, true)),
    junction: path(world.junction, true), islands: path(world.islands, true),
    buildings: path(world.buildings, true), kerbs: path(world.kerbs, false),
    edges: path(world.edges, false), stops: path(world.stop_lines, false),
  };
}
