/* The plane on a canvas: robot, ground, forces; and curves over time beside it.

   HeelstrikeDrawing.draw(context, scene, frame, view) draws one instant.
   HeelstrikeDrawing.plot(context, panel, time, view) draws curves with a cursor.
   HeelstrikeDrawing.strip(context, view) draws a bar of time with its events.

   scene: what does not change
     shapes     [{link, foot, width, corners: [x, z, …]}] back to front, corners in link axes (m);
                two corners are a bone `width` points wide, more are an outline; foot -1: of none
     contacts   [{foot, name}]; feet: [{name}]
     size       of the robot (m); weight (N), whose arrow is WEIGHT_LENGTH of the size
     ground     [x, z, …] corners (m); the first and last segment go on forever
   frame: one instant; lists or typed arrays of numbers, NaN (or null) for what there is not
     time       s
     pose       [x, z, angle] a link (m, m, rad about +y: positive leans towards +x)
     point      [x, z] a contact point (m); normal [x, z], force [x, z] (N), friction likewise
     center     [x, z] centre of mass; capture [x, z] capture point; pressure [x, z] zero moment
                point; support [x, z, x, z] ends of the support interval (m)
     push       [x, z, fx, fz] a push: where it acts (m), and its force (N)
   view: how it is looked at
     width, height in CSS pixels; scale in pixels a metre; x, z: world point in the middle (m)
     dark       whether colours are those for a dark page
     hide       {forces, cones, center, pressure, capture, support, traces}: true hides it
     trail      earlier frames, whose contact points are drawn as traces
     flashes    [{x, z, label, strength}] of events, strength from 1 to 0
     steady     (name, text): the text to write; where it is live, one that can be read

   Everything is drawn by numbers: text from a scene is drawn as text, never as markup. */
"use strict";

var HeelstrikeDrawing = (() => {
  const WEIGHT_LENGTH = 0.35, LONGEST = 0.9, HEAD_LENGTH = 0.035, HEAD_WIDTH = 0.022;
  const HIGHEST_CONE = 0.45; // of the size of the robot
  const NEAR_EDGE = 0.9; // share of the friction cone from which it warns
  const POINT = 100 / 72 / 540; // of the height of the picture
  const LETTERS = "13px system-ui, \"Segoe UI\", Roboto, sans-serif";

  // Okabe and Ito's palette, lighter on dark pages. Feet also differ by dashes in plots.
  const LIGHT = {
    paper: "#ffffff", ink: "#222222", grey: "#6b6b6b", soil: "#e8e8e4", grid: "#dededa",
    feet: ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00"],
    force: "#00785A", pressure: "#A9447F", center: "#E69F00", cone: "rgba(0,120,90,0.14)",
    warn: "#C23B00", push: "#B00020", rim: "#ffffff", bar: "#efefec",
  };
  const DARK = {
    paper: "#15181b", ink: "#e8e8e6", grey: "#a3a9ae", soil: "#2c3136", grid: "#363c42",
    feet: ["#4FA9E2", "#F08B4B", "#35C79D", "#E3A3C6", "#9AD4F5", "#F2C14E"],
    force: "#35C79D", pressure: "#E3A3C6", center: "#F2C14E", cone: "rgba(53,199,157,0.18)",
    warn: "#FF8A4C", push: "#FF7B8A", rim: "#15181b", bar: "#23282d",
  };
  const DASHES = [[], [7, 4], [2, 3], [9, 3, 2, 3]];

  const palette = (dark) => (dark ? DARK : LIGHT);
  const footColor = (colors, foot) =>
    foot < 0 ? colors.ink : colors.feet[foot % colors.feet.length];
  const known = (number) => number !== null && Number.isFinite(number);

  /** Number with three digits, as people write it. */
  function words(value) {
    if (!known(value)) return "–";
    const size = Math.abs(value);
    const text = size === 0 ? "0" : size >= 1e5 || size < 1e-3 ? value.toExponential(1)
      : String(Number(value.toPrecision(size >= 1e3 ? 4 : 3)));
    return text.replace("-", "−");
  }

  /** Text with a rim of the page's colour, so that it is read over anything. */
  function label({ context, colors }, text, x, y, { color, weight = "", align = "center", base }) {
    context.font = `${weight} ${LETTERS}`;
    context.textAlign = align;
    context.textBaseline = base || "middle";
    context.lineWidth = 3;
    context.strokeStyle = colors.paper;
    context.strokeText(text, x, y);
    context.fillStyle = color;
    context.fillText(text, x, y);
  }

  function heightOfGround(ground, x) {
    let k = 0;
    while (k < ground.length - 4 && ground[k + 2] <= x) k += 2;
    const run = ground[k + 2] - ground[k];
    return ground[k + 1] + (run > 0 ? ((ground[k + 3] - ground[k + 1]) / run) * (x - ground[k]) : 0);
  }

  function draw(context, scene, frame, view) {
    const colors = palette(view.dark), hide = view.hide || {};
    const toX = (x) => 0.5 * view.width + (x - view.x) * view.scale;
    const toY = (z) => 0.5 * view.height - (z - view.z) * view.scale;
    const steady = view.steady || ((_, text) => text);
    const plane = { context, scene, frame, view, colors, toX, toY, steady };
    context.save();
    context.fillStyle = colors.paper;
    context.fillRect(0, 0, view.width, view.height);
    context.lineJoin = context.lineCap = "round";
    drawGround(plane);
    if (!hide.support) drawSupport(plane);
    if (!hide.traces) drawTraces(plane);
    if (!hide.cones) drawCones(plane);
    drawRobot(plane);
    if (!hide.forces) drawForces(plane);
    if (!hide.capture) drawMark(plane, frame.capture, "cross", colors.center);
    if (!hide.center) drawMark(plane, frame.center, "disc", colors.center);
    if (!hide.pressure) drawMark(plane, frame.pressure, "diamond", colors.pressure);
    for (const flash of view.flashes || []) drawFlash(plane, flash);
    if (!hide.forces && scene.weight > 0 && scene.contacts.length) drawScale(plane);
    context.restore();
  }

  function drawGround({ context, scene, view, colors, toX, toY }) {
    const ground = scene.ground;
    const left = view.x - (0.5 * view.width) / view.scale;
    const right = view.x + (0.5 * view.width) / view.scale;
    const path = [left, heightOfGround(ground, left)];
    for (let k = 0; k < ground.length; k += 2)
      if (ground[k] > left && ground[k] < right) path.push(ground[k], ground[k + 1]);
    path.push(right, heightOfGround(ground, right));
    context.beginPath();
    context.moveTo(-5, view.height + 5);
    for (let k = 0; k < path.length; k += 2) context.lineTo(toX(path[k]), toY(path[k + 1]));
    context.lineTo(view.width + 5, view.height + 5);
    context.closePath();
    context.fillStyle = colors.soil;
    context.strokeStyle = colors.grey;
    context.lineWidth = 1;
    context.fill();
    context.stroke();
    context.fillStyle = colors.grey;
    context.font = LETTERS;
    context.textAlign = "center";
    context.textBaseline = "top";
    // Marks at whole multiples of a length of which some five are in the picture.
    const wanted = (right - left) / 5, ten = 10 ** Math.floor(Math.log10(wanted));
    const every = [1, 2, 5, 10].map((n) => n * ten).find((n) => n >= 0.7 * wanted);
    const digits = Math.max(0, -Math.floor(Math.log10(every) + 1e-9));
    for (let n = Math.ceil(left / every); n * every <= right; n++) {
      const x = toX(n * every), y = toY(heightOfGround(ground, n * every));
      context.beginPath();
      context.moveTo(x, y);
      context.lineTo(x, y + 8);
      context.stroke();
      context.fillText(`${(n * every).toFixed(digits).replace("-", "−")} m`, x, y + 11);
    }
  }

  function drawRobot({ context, scene, frame, view, colors, toX, toY }) {
    for (const shape of scene.shapes) {
      const [x, z, angle] = [0, 1, 2].map((k) => frame.pose[3 * shape.link + k]);
      const cos = Math.cos(angle), sin = Math.sin(angle), corners = shape.corners;
      const bone = corners.length === 4;
      // The other end of a bone may be on another link.
      const end = shape.end === undefined ? shape.link : shape.end;
      const [ex, ez, turn] = [0, 1, 2].map((k) => frame.pose[3 * end + k]);
      context.beginPath();
      for (let k = 0; k < corners.length; k += 2) {
        const last = bone && k === 2;
        const c = last ? Math.cos(turn) : cos, s = last ? Math.sin(turn) : sin;
        context.lineTo(
          toX((last ? ex : x) + c * corners[k] + s * corners[k + 1]),
          toY((last ? ez : z) + c * corners[k + 1] - s * corners[k]),
        );
      }
      const color = footColor(colors, shape.foot);
      context.lineWidth = Math.max(1, shape.width * POINT * view.height);
      if (bone) {
        context.strokeStyle = color;
      } else {
        context.closePath();
        context.fillStyle = color;
        context.fill();
        context.strokeStyle = colors.rim;
      }
      context.stroke();
    }
  }

  function drawSupport({ context, frame, colors, toX, toY }) {
    const ends = frame.support;
    if (!ends || !known(ends[0])) return;
    context.strokeStyle = colors.pressure;
    context.lineWidth = 4;
    context.globalAlpha = 0.6;
    context.beginPath();
    context.moveTo(toX(ends[0]), toY(ends[1]) + 3);
    context.lineTo(toX(ends[2]), toY(ends[3]) + 3);
    context.stroke();
    context.globalAlpha = 1;
  }

  function drawTraces({ context, scene, view, colors, toX, toY }) {
    const trail = view.trail || [];
    context.lineWidth = 1.2;
    context.globalAlpha = 0.7;
    scene.contacts.forEach((contact, i) => {
      context.strokeStyle = footColor(colors, contact.foot);
      context.beginPath();
      for (const past of trail) context.lineTo(toX(past.point[2 * i]), toY(past.point[2 * i + 1]));
      context.stroke();
    });
    context.globalAlpha = 1;
  }

  /** Normal and tangential force at a contact point, and the share of the cone that it uses. */
  function pressed(frame, i) {
    const nx = frame.normal[2 * i], nz = frame.normal[2 * i + 1];
    const fx = frame.force[2 * i], fz = frame.force[2 * i + 1];
    const normal = fx * nx + fz * nz, tangent = fx * nz - fz * nx;
    const allowed = frame.friction[i] * normal;
    return { nx, nz, normal, tangent, use: allowed > 0 ? Math.abs(tangent) / allowed : 0 };
  }

  function drawCones({ context, scene, frame, colors, toX, toY, steady }) {
    const scale = (WEIGHT_LENGTH * scene.size) / (scene.weight || Infinity);
    scene.contacts.forEach((_, i) => {
      const { nx, nz, normal, use } = pressed(frame, i);
      if (!(normal * scale > 0.01 * scene.size)) return;
      const x = frame.point[2 * i], z = frame.point[2 * i + 1];
      const height = Math.min(normal * scale, HIGHEST_CONE * scene.size);
      const width = height * frame.friction[i];
      const edge = (side) => [toX(x + height * nx + side * width * nz),
        toY(z + height * nz - side * width * nx)];
      context.beginPath();
      context.moveTo(...edge(-1));
      context.lineTo(toX(x), toY(z));
      context.lineTo(...edge(1));
      context.fillStyle = colors.cone;
      context.fill();
      const near = use >= NEAR_EDGE;
      context.strokeStyle = near ? colors.warn : colors.force;
      context.lineWidth = near ? 2.5 : 0.8;
      context.setLineDash(near ? [] : [4, 3]);
      context.stroke();
      context.setLineDash([]);
      if (near) {
        const told = use > 1 - 1e-6 ? "edge of friction" : `${Math.floor(100 * use)} % of friction`;
        label({ context, colors }, steady(`cone ${i}`, told), toX(x + height * nx), toY(z + height * nz) - 2,
          { color: colors.warn, weight: "600", base: "bottom" });
      }
    });
  }

  function drawForces({ context, scene, frame, colors, toX, toY, view, steady }) {
    const size = scene.size, scale = (WEIGHT_LENGTH * size) / (scene.weight || Infinity);
    const arrow = (name, x, z, fx, fz, color) => {
      const newtons = Math.hypot(fx, fz), whole = newtons * scale;
      const length = Math.min(whole, LONGEST * size);
      if (!(length > 0.25 * HEAD_LENGTH * size)) return;
      drawArrow({ context, toX, toY }, { x, z, ax: fx / newtons, az: fz / newtons, length, size,
        color, cut: whole > length, width: Math.max(2, 2.5 * POINT * view.height) });
      if (name && whole > length) {
        const told = steady(name, `${words(newtons)} N`);
        const right = name.at(-1) % 2; // those of a heel and its toe stand apart
        label({ context, colors }, told, toX(x + (0.6 * length * fx) / newtons) + (right ? 8 : -8),
          toY(z + (0.6 * length * fz) / newtons), { color, align: right ? "left" : "right" });
      }
    };
    for (let i = 0; i < scene.contacts.length; i++)
      arrow(`force ${i}`, ...[0, 1].map((k) => frame.point[2 * i + k]),
        ...[0, 1].map((k) => frame.force[2 * i + k]), colors.force);
    const push = frame.push || [];
    for (let k = 0; k + 3 < push.length; k += 4) {
      const newtons = Math.hypot(push[k + 2], push[k + 3]);
      if (!(newtons > 0)) continue;
      arrow("", push[k], push[k + 1], push[k + 2], push[k + 3], colors.push);
      const told = steady(`push ${k}`, ` ${words(newtons)} N `);
      label({ context, colors }, told, toX(push[k]), toY(push[k + 1]),
        { color: colors.push, weight: "600", align: push[k + 2] > 0 ? "right" : "left" });
    }
  }

  function drawArrow({ context, toX, toY }, { x, z, ax, az, length, size, color, cut, width }) {
    const head = Math.min(HEAD_LENGTH * size, length), neck = length - head;
    const across = 0.5 * HEAD_WIDTH * size;
    context.strokeStyle = context.fillStyle = color;
    context.lineWidth = width;
    context.lineCap = "butt";
    context.setLineDash(cut ? [10, 4] : []); // longer than it is drawn
    context.beginPath();
    context.moveTo(toX(x), toY(z));
    context.lineTo(toX(x + neck * ax), toY(z + neck * az));
    context.stroke();
    context.setLineDash([]);
    context.lineCap = "round";
    context.beginPath();
    context.moveTo(toX(x + length * ax), toY(z + length * az));
    for (const side of [-1, 1])
      context.lineTo(toX(x + neck * ax + side * across * az), toY(z + neck * az - side * across * ax));
    context.closePath();
    context.fill();
  }

  /** The arrow of the robot's weight, by which the others are read. */
  function drawScale({ context, scene, view, colors }) {
    const length = WEIGHT_LENGTH * scene.size, x = 26 / view.scale, size = scene.size;
    const toX = (metres) => metres * view.scale, bottom = 0.5 * view.height;
    const toY = (metres) => bottom - metres * view.scale;
    drawArrow({ context, toX, toY }, { x, z: 0, ax: 0, az: 1, length, size, color: colors.force,
      cut: false, width: Math.max(2, 2.5 * POINT * view.height) });
    context.fillStyle = colors.force;
    context.font = LETTERS;
    context.textAlign = "left";
    context.textBaseline = "top";
    context.fillText(`${words(scene.weight)} N`, 8, bottom + 4);
  }

  function drawMark({ context, colors, toX, toY, view }, place, kind, color) {
    if (!place || !known(place[0]) || !known(place[1])) return;
    const x = toX(place[0]), y = toY(place[1]), r = Math.max(4.5, 0.01 * view.height);
    context.beginPath();
    if (kind === "disc") context.arc(x, y, r, 0, 2 * Math.PI);
    else if (kind === "diamond")
      for (const [dx, dy] of [[0, -1], [1, 0], [0, 1], [-1, 0]])
        context.lineTo(x + 1.2 * r * dx, y + 1.2 * r * dy);
    else {
      for (const side of [-1, 1]) {
        context.moveTo(x - r, y - side * r);
        context.lineTo(x + r, y + side * r);
      }
      context.strokeStyle = color;
      context.lineWidth = 3;
      context.stroke();
      return;
    }
    context.closePath();
    context.fillStyle = color;
    context.fill();
    context.strokeStyle = colors.rim;
    context.lineWidth = 1.5;
    context.stroke();
  }

  function drawFlash({ context, colors, toX, toY }, { x, z, label: told, strength }) {
    context.globalAlpha = Math.max(0, Math.min(1, strength));
    context.strokeStyle = colors.warn;
    context.lineWidth = 2.5;
    context.beginPath();
    context.arc(toX(x), toY(z), 10 + 14 * (1 - strength), 0, 2 * Math.PI);
    context.stroke();
    if (told) {
      label({ context, colors }, told, toX(x), toY(z) + 30,
        { color: colors.ink, weight: "600", base: "top" });
    }
    context.globalAlpha = 1;
  }

  /* panel: {title, unit, note, curves: [{label, foot, dash, values}], limits: [{label, level}],
             span: [low, high], steps} of which limits are dashed lines; steps: held from row to row;
             what leaves the span, as impacts do, is marked with its value where it does
     time:  of the values (s)
     view:  {width, height, from, to, cursor} in CSS pixels and s, and dark
     Returns the x pixels of the span, for pointers. */
  function plot(context, panel, time, view) {
    const colors = palette(view.dark);
    const left = 58, right = view.width - 10, top = 24, bottom = view.height - 20;
    const [low, high] = panel.span || spanOf(panel);
    const toX = (t) => left + ((t - view.from) / (view.to - view.from || 1)) * (right - left);
    const toY = (value) => bottom - ((value - low) / (high - low)) * (bottom - top);
    context.save();
    context.fillStyle = colors.paper;
    context.fillRect(0, 0, view.width, view.height);
    drawAxes(context, colors, { left, right, top, bottom, low, high, toX, toY, view, panel });
    context.beginPath();
    context.rect(left, top - 1, right - left, bottom - top + 2);
    context.clip();
    for (const { level } of panel.limits || []) {
      context.strokeStyle = colors.ink;
      context.lineWidth = 1;
      context.setLineDash([5, 4]);
      context.beginPath();
      context.moveTo(left, toY(level));
      context.lineTo(right, toY(level));
      context.stroke();
    }
    panel.curves.forEach((curve, i) => {
      context.strokeStyle = curveColor(colors, curve);
      context.setLineDash(DASHES[(curve.dash || 0) % DASHES.length]);
      context.lineWidth = 1.5 + 0.4 * (panel.curves.length - 1 - i); // none hides another
      strokeCurve(context, time, curve, toX, toY, panel.steps);
    });
    context.setLineDash([]);
    context.strokeStyle = colors.warn;
    context.lineWidth = 1.5;
    context.beginPath();
    context.moveTo(toX(view.cursor), top);
    context.lineTo(toX(view.cursor), bottom);
    context.stroke();
    drawPeaks(context, colors, panel, time, { low, high, left, right, top, bottom, toX });
    context.restore();
    return { left, right };
  }

  /** Where curves leave the axis: an arrow each time, and as many of the values as have room. */
  function drawPeaks(context, colors, panel, time, { low, high, left, right, top, bottom, toX }) {
    const found = [];
    for (const curve of panel.curves) {
      let peak = null;
      curve.values.forEach((value, k) => {
        const side = !known(value) ? 0 : value > high ? 1 : value < low ? -1 : 0;
        if (peak && side !== peak.side) peak = null;
        if (!side || toX(time[k]) < left || toX(time[k]) > right) return;
        if (!peak) found.push(peak = { curve, side, value, x: toX(time[k]) });
        else if (side * value > side * peak.value) Object.assign(peak, { value, x: toX(time[k]) });
      });
    }
    found.sort((a, b) => Math.abs(b.value) - Math.abs(a.value));
    const taken = [];
    for (const { curve, side, value, x } of found) {
      const y = side > 0 ? top : bottom;
      context.fillStyle = curveColor(colors, curve);
      context.beginPath();
      context.moveTo(x, y);
      context.lineTo(x - 5, y + 8 * side);
      context.lineTo(x + 5, y + 8 * side);
      context.fill();
      const beyond = x > right - 50, begin = beyond ? x - 50 : x - 6, end = begin + 56;
      if (taken.some((other) => other.side === side && other.begin < end && begin < other.end))
        continue;
      taken.push({ side, begin, end });
      label({ context, colors }, words(value), x + (beyond ? -8 : 8), y + 6 * side,
        { color: colors.ink, align: beyond ? "right" : "left" });
    }
  }

  /* A bar of time.
     view: {width, height, inset, from, to, now, dark, seconds: whether it names them,
            phases: [[from, to, feet…]] in which feet press,
            events: [{time, level, mark}] of level 2 (an impact), 1 (slip and stick) or 0}
     All times in s; `inset` pixels at either end are left, for the thumb of a slider upon it. */
  function strip(context, view) {
    const { width, height, inset, from, to } = view, colors = palette(view.dark);
    const toX = (t) => inset + ((t - from) / (to - from || 1)) * (width - 2 * inset);
    const foot = view.seconds ? height - 19 : height, feet = view.feet || 0;
    const tall = feet ? 12 / feet : 0, bars = foot - 1 - (feet ? 12 : 0);
    context.clearRect(0, 0, width, height);
    context.fillStyle = colors.bar;
    context.fillRect(inset, 8, width - 2 * inset, bars - 8);
    for (const [begin, end, ...pressing] of view.phases)
      for (const each of pressing) {
        context.fillStyle = footColor(colors, each);
        context.fillRect(toX(begin), bars + each * tall, toX(end) - toX(begin), tall - 1);
      }
    context.font = LETTERS;
    context.textAlign = "center";
    context.textBaseline = "top";
    let last = -20;
    const drawn = new Set(); // no more than can be seen
    for (const { time, level, mark } of view.events) {
      const x = toX(time), place = 4 * Math.round(x) + level;
      if (drawn.has(place)) continue;
      drawn.add(place);
      context.strokeStyle = context.fillStyle =
        level === 2 ? colors.warn : level === 1 ? colors.pressure : colors.grey;
      context.lineWidth = level === 2 ? 2 : 1;
      context.beginPath();
      context.moveTo(x, level === 2 ? 10 : 15);
      context.lineTo(x, bars - 1);
      context.stroke();
      if (mark && x - last > 11) {
        context.fillText(mark, x, -2);
        last = x;
      }
    }
    if (view.seconds) {
      context.fillStyle = context.strokeStyle = colors.grey;
      context.lineWidth = 1;
      for (const value of ticks(from, to, Math.max(2, width / 110))) {
        const told = `${Number(value.toPrecision(6))} s`, half = context.measureText(told).width / 2;
        const x = Math.min(Math.max(toX(value), half), width - half);
        context.fillText(told, x, foot + 4);
        context.fillRect(Math.round(toX(value)), foot, 1, 4);
      }
    }
    if (!known(view.now)) return;
    const x = toX(view.now);
    context.fillStyle = colors.ink;
    context.fillRect(x - 1, 4, 2, foot - 4);
    context.beginPath();
    context.arc(x, 6, 6, 0, 2 * Math.PI);
    context.fill();
  }

  const curveColor = (colors, curve) =>
    curve.color === undefined ? footColor(colors, curve.foot) : colors.feet[curve.color];

  function strokeCurve(context, time, { values }, toX, toY, steps) {
    context.beginPath();
    let down = false, y = 0;
    for (let k = 0; k < time.length; k++) {
      if (!known(values[k])) {
        down = false;
        continue;
      }
      const x = toX(time[k]);
      if (down && steps) context.lineTo(x, y);
      y = toY(values[k]);
      if (down) context.lineTo(x, y);
      else context.moveTo(x, y);
      down = true;
    }
    context.stroke();
  }

  function spanOf(panel) {
    let low = Infinity, high = -Infinity;
    const hold = (value) => {
      if (known(value)) [low, high] = [Math.min(low, value), Math.max(high, value)];
    };
    for (const curve of panel.curves) for (const value of curve.values) hold(value);
    for (const { level } of panel.limits || []) hold(level);
    if (!(high >= low)) return [-1, 1];
    const room = 0.06 * (high - low) || Math.max(1e-9, 0.1 * Math.abs(high));
    return [low - room, high + room];
  }

  function drawAxes(context, colors, at) {
    const { left, right, top, bottom, low, high, toX, toY, view, panel } = at;
    context.font = LETTERS;
    context.fillStyle = colors.grey;
    context.strokeStyle = colors.grid;
    context.lineWidth = 1;
    context.textAlign = "right";
    context.textBaseline = "middle";
    for (const value of ticks(low, high, Math.max(2, (bottom - top) / 34))) {
      const y = toY(value);
      context.beginPath();
      context.moveTo(left, y);
      context.lineTo(right, y);
      context.stroke();
      context.fillText(words(value), left - 5, y);
    }
    context.textAlign = "center";
    context.textBaseline = "top";
    for (const value of ticks(view.from, view.to, Math.max(2, (right - left) / 70))) {
      context.beginPath();
      context.moveTo(toX(value), bottom);
      context.lineTo(toX(value), bottom + 4);
      context.stroke();
      context.fillText(`${Number(value.toPrecision(6))} s`, toX(value), bottom + 6);
    }
    context.textAlign = "left";
    context.textBaseline = "middle";
    context.fillStyle = colors.ink;
    context.font = `600 ${LETTERS}`;
    const title = panel.unit === "1" ? panel.title : `${panel.title} (${panel.unit})`;
    context.fillText(title, 4, 11);
    let x = 4 + context.measureText(title).width + 14;
    context.font = LETTERS;
    for (const curve of panel.curves) {
      if (!curve.label) continue;
      const wide = context.measureText(curve.label).width + 32;
      if (x + wide > view.width) break;
      context.strokeStyle = curveColor(colors, curve);
      context.setLineDash(DASHES[(curve.dash || 0) % DASHES.length]);
      context.lineWidth = 2;
      context.beginPath();
      context.moveTo(x, 11);
      context.lineTo(x + 20, 11);
      context.stroke();
      context.setLineDash([]);
      context.fillText(curve.label, x + 24, 11);
      x += wide;
    }
    if (panel.note && x + context.measureText(panel.note).width < view.width) {
      context.fillStyle = colors.grey;
      context.fillText(panel.note, x, 11);
    }
  }

  function ticks(low, high, most) {
    const wanted = (high - low) / most;
    if (!(wanted > 0)) return [];
    const ten = 10 ** Math.floor(Math.log10(wanted));
    const every = [1, 2, 5, 10].map((n) => n * ten).find((n) => n >= wanted * 0.999);
    const found = [];
    for (let n = Math.ceil(low / every - 1e-9); n * every <= high + 1e-9 * every; n++)
      found.push(n * every);
    return found;
  }

  /** Give a canvas the pixels of its screen; return its context and size in CSS pixels. */
  function fit(canvas) {
    const width = canvas.clientWidth, height = canvas.clientHeight;
    const ratio = window.devicePixelRatio || 1;
    const [wide, high] = [Math.round(width * ratio), Math.round(height * ratio)];
    if (canvas.width !== wide || canvas.height !== high) [canvas.width, canvas.height] = [wide, high];
    const context = canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    return { context, width, height };
  }

  return { draw, plot, strip, fit, palette, footColor, words, heightOfGround, pressed };
})();
