/* A run in space on a canvas: robot, ground, forces, seen by a camera that turns about the robot.

   HeelstrikeSpace.read(run) takes what `contents` of view/spatial/page.py returns, and answers as
   HeelstrikeRecording.read does, so that the player plays both. HeelstrikeSpace.stage(scene) draws
   single frames of a scene, which the live view has as well.

   scene: what does not change
     tree       {parent, kind, first, axis, offset, turn, reference} of the joints, as the model of
                the robot has them: kind 0 is free, 1 a ball, 2 a slide, 3 a hinge
     solids     [{link, foot, corners: [x, y, z, …], faces: [i, j, k, …]}] convex, in link axes (m)
     contacts   [{foot, name}] whose forces are shown; feet: [{name}]
     size, highest (m); weight (N)
     ground     {normal, height, boxes: [[x, y, z, …] eight corners]}
   columns: position (q), center, capture, pressure (x, y, z), support [x, y, z, …], and of each
     contact that ever presses  place, force (x, y, z), normal, friction

   Everything is drawn by numbers: text from a scene is drawn as text, never as markup. */
"use strict";

var HeelstrikeSpace = (() => {
  const { palette, footColor, fit, words } = HeelstrikeDrawing;
  const WEIGHT_LENGTH = 0.35, LONGEST = 1.1, HEAD = 0.035, CONE = 0.45; // of the robot's size
  const FAR_AWAY = 4.5, WIDE = 3, NEAREST = 0.05, TRAIL = 1.5;
  const HOME = { azimuth: -0.95, elevation: 0.24, zoom: 1, aside: 0, up: 0, stays: null };
  const SUN = unit([-0.35, -0.25, 0.9]), DARKEST = 0.55;
  const TRUNK = { light: "#5B646B", dark: "#AAB3BA" }, STONE = { light: "#C9C9C2", dark: "#4A5157" };
  const SIDES = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
  const FREE = 0, BALL = 1, SLIDE = 2;

  function dot(a, b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
  function cross(a, b) {
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  }
  function unit(a) {
    const length = Math.hypot(...a) || 1;
    return a.map((value) => value / length);
  }
  const plus = (a, b, by = 1) => [a[0] + by * b[0], a[1] + by * b[1], a[2] + by * b[2]];
  const known = (place) => place && place.every(Number.isFinite);

  /* Rotations are matrices of nine numbers, row by row. */
  const turned = (m, v) => [0, 3, 6].map((k) => m[k] * v[0] + m[k + 1] * v[1] + m[k + 2] * v[2]);
  const product = (a, b) => [0, 3, 6].flatMap((k) => [0, 1, 2].map((n) =>
    a[k] * b[n] + a[k + 1] * b[3 + n] + a[k + 2] * b[6 + n]));
  const SAME = [1, 0, 0, 0, 1, 0, 0, 0, 1];
  function ofQuaternion(given) {
    const length = Math.hypot(...given) || 1, [w, x, y, z] = given.map((value) => value / length);
    return [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
      2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
      2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)];
  }
  const about = (axis, angle) => ofQuaternion([Math.cos(angle / 2),
    ...axis.map((value) => value * Math.sin(angle / 2))]);

  /** Origins and rotations of the links at a position. */
  function placed({ parent, kind, first, axis, offset, turn, reference }, q) {
    const origin = [], rotation = [];
    kind.forEach((type, i) => {
      const at = first[i];
      if (type === FREE) {
        origin.push([q[at], q[at + 1], q[at + 2]]);
        rotation.push(ofQuaternion([0, 1, 2, 3].map((k) => q[at + 3 + k])));
        return;
      }
      const above = parent[i] < 0 ? SAME : rotation[parent[i]];
      const base = parent[i] < 0 ? [0, 0, 0] : origin[parent[i]];
      let from = offset[i], own = above;
      if (type === BALL)
        own = product(product(above, ofQuaternion(turn[i])), ofQuaternion([0, 1, 2, 3].map((k) => q[at + k])));
      else if (type === SLIDE) from = plus(from, axis[i], q[at] - reference[at]);
      else own = product(above, about(axis[i], q[at] - reference[at]));
      rotation.push(own);
      origin.push(plus(base, turned(above, from)));
    });
    return { origin, rotation };
  }

  const mixed = new Map();
  /** A colour with some brightness. */
  function lit(color, bright) {
    const level = Math.round(24 * bright), key = `${color} ${level}`;
    if (!mixed.has(key)) {
      const parts = [1, 3, 5].map((k) => parseInt(color.slice(k, k + 2), 16));
      mixed.set(key, `rgb(${parts.map((part) => Math.min(255, Math.round((part * level) / 24))).join(",")})`);
    }
    return mixed.get(key);
  }
  const bright = (across) => 1.15 * (DARKEST + (1 - DARKEST) * 0.5 * (1 + dot(across, SUN)));

  /** A camera that looks at a place from a direction, and a picture of some size about it. */
  function cameraAt(target, look, scene, width, height) {
    const [ca, sa] = [Math.cos(look.azimuth), Math.sin(look.azimuth)];
    const [ce, se] = [Math.cos(look.elevation), Math.sin(look.elevation)];
    const right = [-sa, ca, 0], up = [-se * ca, -se * sa, ce], near = [ce * ca, ce * sa, se];
    const distance = FAR_AWAY * scene.size;
    const scale = (look.zoom * Math.min(height, 1.1 * width)) / (1.35 * Math.max(scene.highest, 0.6 * scene.size));
    const middle = plus(plus(target, right, look.aside), up, look.up);
    /** Pixels a metre at some place. */
    const nearness = (place) =>
      (scale * distance) / Math.max(distance - dot(plus(place, middle, -1), near), NEAREST * distance);
    const seen = (place) => {
      const away = plus(place, middle, -1), by = nearness(place);
      return [0.5 * width + by * dot(away, right), 0.5 * height - by * dot(away, up)];
    };
    const place = plus(middle, near, distance);
    return { seen, nearness, place, right, up, near, scale,
      far: (point) => Math.hypot(...plus(point, place, -1)) };
  }

  /** The place on a triangle that is seen nearest to a place of the canvas: {place, away} (pixels). */
  function nearestOn(points, corners, [x, y]) {
    const [[ax, ay], [bx, by], [cx, cy]] = corners;
    const area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);
    const u = ((bx - x) * (cy - y) - (by - y) * (cx - x)) / area;
    const v = ((cx - x) * (ay - y) - (cy - y) * (ax - x)) / area;
    if (u >= 0 && v >= 0 && u + v <= 1) {
      const inside = [0, 1, 2].map((k) =>
        u * points[0][k] + v * points[1][k] + (1 - u - v) * points[2][k]);
      return { place: inside, away: 0 };
    }
    let best = { away: Infinity };
    for (let k = 0; k < 3; k++) {
      const [p, q] = [corners[k], corners[(k + 1) % 3]], dx = q[0] - p[0], dy = q[1] - p[1];
      const along = Math.max(0, Math.min(1,
        ((x - p[0]) * dx + (y - p[1]) * dy) / (dx * dx + dy * dy || 1)));
      const away = Math.hypot(x - p[0] - along * dx, y - p[1] - along * dy);
      if (away < best.away)
        best = { away, place: plus(points[k], plus(points[(k + 1) % 3], points[k], -1), along) };
    }
    return best;
  }

  function path(context, points) {
    context.beginPath();
    points.forEach(([x, y]) => context.lineTo(x, y));
    context.closePath();
  }

  /** What draws frames of a scene, seen by a camera that a person moves.

      frame: position (q), center, capture, pressure [x, y, z]; support [x, y, z, …]; contacts
      [{place, force, normal, friction}]; trace [[x, y, z]] of the pressure, the newest first; and,
      of a live view, flashes [{place, label, strength}] and pushes [{place, force}]. */
  function stage(scene) {
    const { normal, height, boxes } = scene.ground;
    const below = ([x, y]) => [x, y, height - (normal[0] * x + normal[1] * y) / normal[2]];
    const look = { ...HOME };
    let shown = null, redraw = () => {};

    /** Draw a frame on a canvas; the camera looks at a place, or stays where it was told to. */
    function draw(canvas, frame, place, { dark, hide, steady = (_, text) => text }) {
      const { context, width, height: tall } = fit(canvas);
      if (!width || !tall) return null;
      const colors = palette(dark), tone = dark ? "dark" : "light";
      const aim = look.stays || place, camera = cameraAt(aim, look, scene, width, tall);
      const picture = { context, camera, colors, frame, aim, steady };
      context.save();
      context.fillStyle = colors.paper;
      context.fillRect(0, 0, width, tall);
      context.lineJoin = "round";
      drawGround(picture);
      const poses = placed(scene.tree, frame.position), faces = facesOf(poses);
      shown = { canvas, camera, aim, poses, faces };
      drawShadows(picture, faces);
      drawBoxes(picture, STONE[tone]);
      if (!hide.support) drawSupport(picture);
      if (!hide.traces) drawTraces(picture);
      if (!hide.cones) drawCones(picture);
      drawFaces(picture, faces, TRUNK[tone]);
      if (!hide.forces) drawForces(picture);
      if (!hide.capture) mark(picture, frame.capture, "cross", colors.center);
      if (!hide.center) drawCenter(picture);
      if (!hide.pressure) mark(picture, frame.pressure, "diamond", colors.pressure);
      drawFlashes(picture);
      drawPushes(picture);
      if (!hide.forces && scene.contacts.length) drawScale(picture, tall);
      context.restore();
      return frame;
    }

    function drawGround({ context, camera, colors, aim }) {
      const radius = (WIDE * scene.size) / Math.min(1, look.zoom), around = [];
      for (let n = 0; n < 72; n++) {
        const angle = (n * Math.PI) / 36;
        around.push(camera.seen(below(plus(aim, [radius * Math.cos(angle), radius * Math.sin(angle), 0]))));
      }
      path(context, around);
      context.fillStyle = colors.soil;
      context.fill();
      const ten = 10 ** Math.floor(Math.log10(scene.size));
      const every = [0.2, 0.5, 1, 2].map((n) => n * ten).find((n) => n > 0.3 * scene.size);
      context.strokeStyle = colors.grey;
      context.lineWidth = 1;
      for (const axis of [0, 1])
        for (let n = Math.ceil((aim[axis] - radius) / every); n * every < aim[axis] + radius; n++) {
          const half = Math.sqrt(Math.max(0, radius ** 2 - (n * every - aim[axis]) ** 2));
          const ends = [-half, half].map((side) => {
            const place = [0, 0, 0];
            place[axis] = n * every;
            place[1 - axis] = aim[1 - axis] + side;
            return camera.seen(below(place));
          });
          context.beginPath();
          ends.forEach(([x, y]) => context.lineTo(x, y));
          context.globalAlpha = n === 0 ? 0.7 : 0.25; // the axes of the world stand out
          context.stroke();
        }
      context.globalAlpha = 1;
    }

    /** Triangles of the robot in the world with their normals. */
    function facesOf({ origin, rotation }) {
      const faces = [];
      for (const { link, foot, corners, faces: list } of scene.solids) {
        const places = [];
        for (let k = 0; k < corners.length; k += 3)
          places.push(plus(origin[link], turned(rotation[link], corners.slice(k, k + 3))));
        for (let k = 0; k < list.length; k += 3) {
          const [a, b, c] = [places[list[k]], places[list[k + 1]], places[list[k + 2]]];
          faces.push({ link, points: [a, b, c], foot, across: unit(cross(plus(b, a, -1), plus(c, a, -1))) });
        }
      }
      return faces;
    }

    function drawShadows({ context, camera, colors }, faces) {
      context.fillStyle = colors.grey;
      const slant = dot(SUN, normal);
      context.beginPath();
      for (const { points, across } of faces) {
        if (dot(across, SUN) <= 0) continue;
        points.forEach((point, n) => {
          const over = (dot(point, normal) - height * normal[2]) / slant;
          const [x, y] = camera.seen(plus(point, SUN, -over));
          if (n) context.lineTo(x, y);
          else context.moveTo(x, y);
        });
        context.closePath();
      }
      context.globalAlpha = 0.3;
      context.fill("nonzero");
      context.globalAlpha = 1;
    }

    function drawBoxes({ context, camera, colors, aim }, color) {
      const found = [];
      for (const corners of boxes) {
        const at = (k) => corners.slice(3 * k, 3 * k + 3);
        for (const side of SIDES) {
          const points = side.map(at), middle = [0, 1, 2].map((k) => points.reduce((sum, p) => sum + p[k] / 4, 0));
          const across = unit(cross(plus(points[1], points[0], -1), plus(points[2], points[0], -1)));
          if (dot(across, plus(camera.place, points[0], -1)) <= 0) continue;
          if (Math.hypot(...plus(middle, aim, -1)) > 2 * WIDE * scene.size) continue;
          found.push({ points, across, far: camera.far(middle) });
        }
      }
      found.sort((a, b) => b.far - a.far);
      context.strokeStyle = colors.rim;
      context.lineWidth = 1;
      for (const { points, across } of found) {
        path(context, points.map(camera.seen));
        context.fillStyle = lit(color, bright(across));
        context.fill();
        context.stroke();
      }
    }

    function drawFaces({ context, camera, colors }, faces, trunk) {
      const seen = [];
      for (const face of faces) {
        const [a, b, c] = face.points;
        if (dot(face.across, plus(camera.place, a, -1)) <= 0) continue;
        face.far = camera.far([0, 1, 2].map((k) => (a[k] + b[k] + c[k]) / 3));
        seen.push(face);
      }
      seen.sort((a, b) => b.far - a.far);
      context.lineWidth = 0.7;
      for (const { points, foot, across } of seen) {
        path(context, points.map(camera.seen));
        const color = foot < 0 ? trunk : footColor(colors, foot);
        context.fillStyle = context.strokeStyle = lit(color, bright(across));
        context.fill();
        context.stroke();
      }
    }

    function drawSupport({ context, camera, colors, frame }) {
      const points = [];
      for (let k = 0; k + 2 < frame.support.length; k += 3)
        if (Number.isFinite(frame.support[k])) points.push(camera.seen(frame.support.slice(k, k + 3)));
      if (points.length < 2) return;
      path(context, points);
      context.fillStyle = context.strokeStyle = colors.pressure;
      context.globalAlpha = 0.35;
      context.fill();
      context.globalAlpha = 0.8;
      context.lineWidth = 1.5;
      context.stroke();
      context.globalAlpha = 1;
    }

    function drawTraces({ context, camera, colors, frame }) {
      context.strokeStyle = colors.pressure;
      context.lineWidth = 1.2;
      context.beginPath();
      let down = false;
      for (const place of frame.trace) {
        if (!known(place)) {
          down = false;
          continue;
        }
        const [x, y] = camera.seen(place);
        if (down) context.lineTo(x, y);
        else context.moveTo(x, y);
        down = true;
      }
      context.globalAlpha = 0.6;
      context.stroke();
      context.globalAlpha = 1;
    }

    const scale = (WEIGHT_LENGTH * scene.size) / (scene.weight || Infinity);
    function drawCones({ context, camera, colors, frame }) {
      for (const { place, force, normal: up, friction } of frame.contacts) {
        if (!known(place) || !Number.isFinite(friction)) continue;  // none of two faces at once
        const pressed = dot(force, up);
        if (!(pressed * scale > 0.01 * scene.size)) continue;
        const tall = Math.min(pressed * scale, CONE * scene.size), wide = friction * tall;
        const first = unit(cross(up, Math.abs(up[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0]));
        const second = cross(up, first), top = plus(place, up, tall), rim = [];
        for (let n = 0; n < 24; n++) {
          const angle = (n * Math.PI) / 12;
          rim.push(plus(plus(top, first, wide * Math.cos(angle)), second, wide * Math.sin(angle)));
        }
        const points = rim.map(camera.seen), foot = camera.seen(place);
        const sideways = Math.hypot(...plus(force, up, -pressed));
        const near = sideways >= 0.9 * friction * pressed;
        context.fillStyle = colors.cone;
        path(context, points);
        context.fill();
        context.beginPath(); // of its side what faces the camera, once
        for (let n = 0; n < points.length; n++) {
          const [a, b] = [points[n], points[(n + 1) % points.length]];
          if ((a[0] - foot[0]) * (b[1] - foot[1]) <= (a[1] - foot[1]) * (b[0] - foot[0])) continue;
          context.moveTo(...foot);
          context.lineTo(...a);
          context.lineTo(...b);
          context.closePath();
        }
        context.fill();
        context.strokeStyle = near ? colors.warn : colors.force;
        context.lineWidth = near ? 2 : 0.8;
        path(context, points);
        context.stroke();
      }
    }

    function arrow({ context }, [x, y], [dx, dy], color) {
      const length = Math.hypot(dx, dy);
      if (!(length > 3)) return;
      const [ax, ay] = [dx / length, dy / length], head = Math.min(11, length);
      context.strokeStyle = context.fillStyle = color;
      context.lineWidth = 3;
      context.beginPath();
      context.moveTo(x, y);
      context.lineTo(x + dx - head * ax, y + dy - head * ay);
      context.stroke();
      path(context, [[x + dx, y + dy], [x + dx - head * ax - 4.5 * ay, y + dy - head * ay + 4.5 * ax],
        [x + dx - head * ax + 4.5 * ay, y + dy - head * ay - 4.5 * ax]]);
      context.fill();
    }
    function drawForces(picture) {
      const { camera, colors, frame } = picture;
      for (const { place, force } of frame.contacts) {
        if (!known(place) || !known(force)) continue;
        const newtons = Math.hypot(...force), length = Math.min(newtons * scale, LONGEST * scene.size);
        if (!(length > 0.25 * HEAD * scene.size)) continue;
        const from = camera.seen(place), to = camera.seen(plus(place, force, length / newtons));
        arrow(picture, from, [to[0] - from[0], to[1] - from[1]], colors.force);
      }
    }
    function drawScale(picture, tall) {
      const { context, camera, colors } = picture;
      arrow(picture, [26, tall - 30], [0, -WEIGHT_LENGTH * scene.size * camera.scale], colors.force);
      context.font = "13px system-ui, sans-serif";
      context.fillStyle = colors.force;
      context.textAlign = "left";
      context.textBaseline = "top";
      context.fillText(`${words(scene.weight)} N`, 8, tall - 24);
    }

    /** What happened a moment ago, at the forces of its contact points. */
    function drawFlashes({ context, camera, colors, frame }) {
      for (const { place, label, strength } of frame.flashes || []) {
        if (!known(place)) continue;
        const [x, y] = camera.seen(place);
        context.globalAlpha = strength;
        context.strokeStyle = context.fillStyle = colors.warn;
        context.lineWidth = 2.5;
        context.beginPath();
        context.arc(x, y, 6 + 14 * (1 - strength), 0, 2 * Math.PI);
        context.stroke();
        context.globalAlpha = 1;
        context.font = "600 13px system-ui, sans-serif";
        context.textAlign = "center";
        context.textBaseline = "top";
        if (label) context.fillText(label, x, y + 22);
      }
    }

    function drawPushes(picture) {
      const { context, camera, colors, frame, steady } = picture;
      (frame.pushes || []).forEach(({ place, force }, k) => {
        const newtons = Math.hypot(...force);
        if (!known(place) || !(newtons > 0)) return;
        const length = Math.min(newtons * scale, LONGEST * scene.size);
        const from = camera.seen(place), to = camera.seen(plus(place, force, length / newtons));
        arrow(picture, from, [to[0] - from[0], to[1] - from[1]], colors.push);
        context.fillStyle = colors.push;
        context.font = "600 14px system-ui, sans-serif";
        context.textAlign = to[0] < from[0] ? "right" : "left";
        context.textBaseline = "middle";
        context.fillText(steady(`push ${k}`, ` ${words(newtons)} N `), ...to);
      });
    }

    function drawCenter(picture) {
      const { context, camera, colors, frame } = picture;
      if (!known(frame.center)) return;
      const ends = [frame.center, below(frame.center)].map(camera.seen);
      context.strokeStyle = colors.center;
      context.lineWidth = 1.2;
      context.setLineDash([2, 4]);
      path(context, ends);
      context.stroke();
      context.setLineDash([]);
      mark(picture, frame.center, "disc", colors.center);
    }

    function mark({ context, camera, colors }, place, kind, color) {
      if (!known(place)) return;
      const [x, y] = camera.seen(place), r = 5.5;
      if (kind === "cross") {
        context.strokeStyle = color;
        context.lineWidth = 3;
        context.beginPath();
        for (const side of [-1, 1]) {
          context.moveTo(x - r, y - side * r);
          context.lineTo(x + r, y + side * r);
        }
        context.stroke();
        return;
      }
      context.beginPath();
      if (kind === "disc") context.arc(x, y, r, 0, 2 * Math.PI);
      else [[0, -1], [1, 0], [0, 1], [-1, 0]].forEach(([dx, dy]) =>
        context.lineTo(x + 1.2 * r * dx, y + 1.2 * r * dy));
      context.closePath();
      context.fillStyle = color;
      context.fill();
      context.strokeStyle = colors.rim;
      context.lineWidth = 1.5;
      context.stroke();
    }

    /** The part that is seen at a place of the canvas, or within some pixels of it, and where on it
        in the axes of its link; null if there is none. */
    function partAt([x, y], within) {
      if (!shown) return null;
      const { camera, faces, poses } = shown;
      let best = null;
      for (const { link, points, across } of faces) {
        if (dot(across, plus(camera.place, points[0], -1)) <= 0) continue;
        const found = nearestOn(points, points.map(camera.seen), [x, y]);
        if (found.away > within) continue;
        const far = camera.far(found.place);
        const nearer = !best || (found.away === best.away ? far < best.far : found.away < best.away);
        if (nearer) best = { link, far, ...found };
      }
      if (!best) return null;
      const { origin, rotation } = poses, back = rotation[best.link];
      const arm = plus(best.place, origin[best.link], -1);
      const point = [0, 1, 2].map((k) => back[k] * arm[0] + back[3 + k] * arm[1] + back[6 + k] * arm[2]);
      return { link: best.link, point };
    }

    /** Where a point of a link is in the world, as it was drawn last. */
    const placeOf = ({ link, point }) =>
      plus(shown.poses.origin[link], turned(shown.poses.rotation[link], point));

    /** The place that is seen at a place of the canvas and is as far away as another. */
    function placeBeside(place, [x, y]) {
      const { camera } = shown, [sx, sy] = camera.seen(place), by = camera.nearness(place);
      return plus(plus(place, camera.right, (x - sx) / by), camera.up, (sy - y) / by);
    }

    function follow() {
      look.stays = look.stays ? null : shown?.aim ?? null;
      redraw();
    }
    function home() {
      Object.assign(look, HOME);
      redraw();
    }
    function turn(dx, dy) {
      look.azimuth -= 0.008 * dx;
      look.elevation = Math.min(1.55, Math.max(-0.1, look.elevation + 0.008 * dy));
      redraw();
    }
    function move(dx, dy) {
      look.aside -= dx / shown.camera.scale;
      look.up += dy / shown.camera.scale;
      redraw();
    }
    function zoom(by) {
      look.zoom = Math.min(12, Math.max(0.2, look.zoom * by));
      redraw();
    }

    const keys = { "f": follow };
    for (const [name, angle] of [["1", HOME.azimuth], ["2", -Math.PI / 2], ["3", 0], ["4", Math.PI]])
      keys[name] = () => { look.azimuth = angle; redraw(); };

    return { draw, partAt, placeOf, placeBeside, look, keys, turn, move, zoom, home,
      /** Where a camera looks that follows a centre of mass. */
      above: (center) => plus(below(center), [0, 0, 0.46 * scene.highest]),
      /** Where something is seen on the canvas. */
      seen: (place) => shown.camera.seen(place),
      whenMoved: (then) => { redraw = then; } };
  }

  /** Hear a canvas: dragging turns the camera of the stage that there is, with Shift or two fingers
      it moves and comes nearer, as a wheel does. `hands` may take a pointer for something else:
      {grasp, pull, release, hover}. */
  function listen(canvas, stageNow, hands = {}) {
    const touches = new Map();
    let pulling = null, moved = 0;
    canvas.style.touchAction = "none";
    canvas.addEventListener("pointerdown", (happened) => {
      touches.set(happened.pointerId, [happened.clientX, happened.clientY]);
      canvas.setPointerCapture(happened.pointerId);
      moved = 0;
      if (touches.size > 1) letGo();
      else if (happened.button === 0 && !happened.shiftKey && hands.grasp?.(happened))
        pulling = happened.pointerId;
    });
    canvas.addEventListener("pointermove", (happened) => {
      const last = touches.get(happened.pointerId), stage = stageNow();
      if (!last) hands.hover?.(happened);
      if (!last || !stage) return;
      touches.set(happened.pointerId, [happened.clientX, happened.clientY]);
      if (pulling === happened.pointerId) {
        hands.pull(happened);
        return;
      }
      const [dx, dy] = [happened.clientX - last[0], happened.clientY - last[1]];
      const others = [...touches].filter(([id]) => id !== happened.pointerId).map(([, at]) => at);
      moved += Math.abs(dx) + Math.abs(dy);
      if (others.length) {
        const [x, y] = others[0];
        const was = Math.hypot(last[0] - x, last[1] - y) || 1;
        stage.zoom(Math.hypot(happened.clientX - x, happened.clientY - y) / was);
      } else if (happened.shiftKey || happened.buttons === 2) stage.move(dx, dy);
      else stage.turn(dx, dy);
    });
    function letGo() {
      if (pulling !== null) hands.release();
      pulling = null;
    }
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"])
      canvas.addEventListener(name, (happened) => {
        touches.delete(happened.pointerId);
        if (pulling === happened.pointerId) letGo();
      });
    canvas.addEventListener("wheel", (happened) => {
      happened.preventDefault();
      stageNow()?.zoom(Math.exp(-0.0015 * happened.deltaY));
    }, { passive: false });
    canvas.addEventListener("contextmenu", (happened) => happened.preventDefault());
    return { dragged: () => moved > 4 };
  }

  function read(run) {
    const { scene, data } = run;
    const { time, count, row, curve, rowAt, start, end } = HeelstrikeRecording.table(data);
    const picture = stage(scene);
    let heard = null, heardBy = null;

    const between = (name, k, share) => {
      const now = row(name, k);
      if (!(share > 0)) return Array.from(now);
      const next = row(name, k + 1);
      return Array.from(now, (value, i) => value + share * (next[i] - value));
    };
    function frameAt(t) {
      const k = rowAt(t);
      const share = k + 1 < count ? (t - time[k]) / (time[k + 1] - time[k] || 1) : 0;
      const frame = { time: t, row: k };
      for (const name of ["position", "center", "capture"]) frame[name] = between(name, k, share);
      for (const name of ["pressure", "support"]) frame[name] = Array.from(row(name, k));
      frame.contacts = scene.contacts.map((_, i) => ({ place: Array.from(row(`place ${i}`, k)),
        force: Array.from(row(`force ${i}`, k)), normal: Array.from(row(`normal ${i}`, k)),
        friction: row(`friction ${i}`, k)[0] }));
      frame.trace = [];
      for (let n = k; n >= 0 && t - time[n] < TRAIL; n--)
        frame.trace.push(Array.from(row("pressure", n)));
      return frame;
    }

    /** Where the camera looks: below the centre of mass, evened out over 0.3 s, and up from there. */
    function target(t) {
      let total = [0, 0, 0], weight = 0;
      for (let n = -6; n <= 6; n++) {
        const near = Math.min(end, Math.max(start, t + 0.05 * n));
        const k = rowAt(near), l = Math.min(k + 1, count - 1);
        const part = time[l] > time[k] ? (near - time[k]) / (time[l] - time[k]) : 0;
        const place = between("center", k, k < l ? part : 0), share = 7 - Math.abs(n);
        if (known(place)) [total, weight] = [plus(total, place, share), weight + share];
      }
      return picture.above(weight ? total.map((value) => value / weight) : [0, 0, 0]);
    }

    function draw(canvas, t, how) {
      if (heard !== canvas) {
        heard = canvas;
        canvas.style.cursor = "grab";
        heardBy = listen(canvas, () => picture);
      }
      return picture.draw(canvas, frameAt(t), target(t), how);
    }
    const keys = { ...picture.keys, "r": picture.home, "+": () => picture.zoom(1.2),
      "-": () => picture.zoom(1 / 1.2) };

    return { ...run, time, count, start, end, curve, rowAt, draw, keys, look: picture.look,
      dragged: () => Boolean(heardBy?.dragged()), whenMoved: picture.whenMoved,
      pressed: (frame, k) => {
        const { place, force, normal: up } = frame.contacts[k];
        return { normal: known(place) ? dot(force, up) : 0 };
      },
      drawn: { forces: "contact forces", cones: "friction cones", pressure: "zero moment point",
        support: "support polygon", center: "centre of mass", capture: "capture point",
        traces: "trace of the zero moment point" } };
  }

  return { read, stage, listen, placed, HOME };
})();
