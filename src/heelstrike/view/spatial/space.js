/* A run in space on a canvas: robot, ground, forces, seen by a camera that turns about the robot.

   HeelstrikeSpace.read(run) takes what `contents` of view/spatial/page.py returns, and answers as
   HeelstrikeRecording.read does, so that the player plays both.

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
  const { unpacked, bytes, before } = HeelstrikeRecording;
  const WEIGHT_LENGTH = 0.35, LONGEST = 1.1, HEAD = 0.035, CONE = 0.45; // of the robot's size
  const FAR_AWAY = 4.5, WIDE = 3, NEAREST = 0.05;
  const HOME = { azimuth: -0.95, elevation: 0.24, zoom: 1, aside: 0, up: 0 };
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
    const seen = (place) => {
      const away = plus(place, middle, -1);
      const by = (scale * distance) / Math.max(distance - dot(away, near), NEAREST * distance);
      return [0.5 * width + by * dot(away, right), 0.5 * height - by * dot(away, up)];
    };
    const place = plus(middle, near, distance);
    return { seen, place, right, up, near, scale,
      far: (point) => Math.hypot(...plus(point, place, -1)) };
  }

  function path(context, points) {
    context.beginPath();
    points.forEach(([x, y]) => context.lineTo(x, y));
    context.closePath();
  }

  function read(run) {
    const { scene, data } = run;
    const time = new Float64Array(bytes(data.time)), count = data.rows;
    const columns = unpacked(data);
    const row = (name, k) => {
      const { width, rows, values } = columns.get(name);
      const first = rows === 1 ? 0 : k * width;
      return values.subarray(first, first + width);
    };
    const curve = (name) => {
      const { rows, values } = columns.get(name);
      return rows === 1 ? new Float32Array(count).fill(values[0]) : values;
    };
    const rowAt = (t) => Math.max(0, before(time, t));
    const start = time[0], end = time[count - 1];
    const { normal, height, boxes } = scene.ground;
    const below = ([x, y]) => [x, y, height - (normal[0] * x + normal[1] * y) / normal[2]];
    const look = { ...HOME, follow: true };
    let shown = null, moved = 0, redraw = () => {};

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
      return frame;
    }

    /** Where the camera looks: below the centre of mass, evened out over 0.3 s, and up from there. */
    function target(t) {
      let total = [0, 0, 0], weight = 0;
      for (let n = -6; n <= 6; n++) {
        const near = look.follow ? Math.min(end, Math.max(start, t + 0.05 * n)) : start;
        const k = rowAt(near), l = Math.min(k + 1, count - 1);
        const part = time[l] > time[k] ? (near - time[k]) / (time[l] - time[k]) : 0;
        const place = between("center", k, k < l ? part : 0), share = 7 - Math.abs(n);
        if (known(place)) [total, weight] = [plus(total, place, share), weight + share];
      }
      const middle = weight ? total.map((value) => value / weight) : [0, 0, 0];
      return plus(below(middle), [0, 0, 0.46 * scene.highest]);
    }

    function draw(canvas, t, { dark, hide }) {
      listen(canvas);
      const { context, width, height: tall } = fit(canvas);
      if (!width || !tall) return null;
      const frame = frameAt(t), colors = palette(dark), tone = dark ? "dark" : "light";
      const aim = target(t), camera = cameraAt(aim, look, scene, width, tall);
      const picture = { context, camera, colors, frame, aim };
      shown = { canvas, camera };
      context.save();
      context.fillStyle = colors.paper;
      context.fillRect(0, 0, width, tall);
      context.lineJoin = "round";
      drawGround(picture);
      const faces = facesOf(frame);
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
    function facesOf(frame) {
      const { origin, rotation } = placed(scene.tree, frame.position), faces = [];
      for (const { link, foot, corners, faces: list } of scene.solids) {
        const places = [];
        for (let k = 0; k < corners.length; k += 3)
          places.push(plus(origin[link], turned(rotation[link], corners.slice(k, k + 3))));
        for (let k = 0; k < list.length; k += 3) {
          const [a, b, c] = [places[list[k]], places[list[k + 1]], places[list[k + 2]]];
          faces.push({ points: [a, b, c], foot, across: unit(cross(plus(b, a, -1), plus(c, a, -1))) });
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
      for (let k = frame.row; k >= 0 && frame.time - time[k] < 1.5; k--) {
        const place = row("pressure", k);
        if (!known(Array.from(place))) {
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
        if (!known(place)) continue;
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

    /* The camera: dragging turns it, with Shift or two buttons it moves, a wheel comes nearer. */
    let heard = null;
    const touches = new Map();
    function listen(canvas) {
      if (heard === canvas) return;
      heard = canvas;
      canvas.style.touchAction = "none";
      canvas.style.cursor = "grab";
      canvas.addEventListener("pointerdown", (happened) => {
        touches.set(happened.pointerId, [happened.clientX, happened.clientY]);
        canvas.setPointerCapture(happened.pointerId);
        moved = 0;
      });
      canvas.addEventListener("pointermove", (happened) => {
        const last = touches.get(happened.pointerId);
        if (!last) return;
        const [dx, dy] = [happened.clientX - last[0], happened.clientY - last[1]];
        const others = [...touches].filter(([id]) => id !== happened.pointerId).map(([, at]) => at);
        touches.set(happened.pointerId, [happened.clientX, happened.clientY]);
        moved += Math.abs(dx) + Math.abs(dy);
        if (others.length) {
          const [x, y] = others[0];
          const was = Math.hypot(last[0] - x, last[1] - y) || 1;
          zoom(Math.hypot(happened.clientX - x, happened.clientY - y) / was);
        } else if (happened.shiftKey || happened.buttons === 2) {
          look.aside -= dx / shown.camera.scale;
          look.up += dy / shown.camera.scale;
        } else {
          look.azimuth -= 0.008 * dx;
          look.elevation = Math.min(1.55, Math.max(-0.1, look.elevation + 0.008 * dy));
        }
        redraw();
      });
      for (const name of ["pointerup", "pointercancel"])
        canvas.addEventListener(name, (happened) => touches.delete(happened.pointerId));
      canvas.addEventListener("wheel", (happened) => {
        happened.preventDefault();
        zoom(Math.exp(-0.0015 * happened.deltaY));
        redraw();
      }, { passive: false });
      canvas.addEventListener("contextmenu", (happened) => happened.preventDefault());
    }
    function zoom(by) { look.zoom = Math.min(12, Math.max(0.2, look.zoom * by)); }

    const keys = {
      "f": () => { look.follow = !look.follow; redraw(); },
      "r": () => { Object.assign(look, HOME); redraw(); },
      "+": () => { zoom(1.2); redraw(); },
      "-": () => { zoom(1 / 1.2); redraw(); },
    };
    for (const [name, angle] of [["1", HOME.azimuth], ["2", -Math.PI / 2], ["3", 0], ["4", Math.PI]])
      keys[name] = () => { look.azimuth = angle; redraw(); };

    return { ...run, time, count, start, end, curve, rowAt, draw, keys, look,
      dragged: () => moved > 4,
      whenMoved: (then) => { redraw = then; },
      pressed: (frame, k) => {
        const { place, force, normal: up } = frame.contacts[k];
        return { normal: known(place) ? dot(force, up) : 0 };
      },
      drawn: { forces: "contact forces", cones: "friction cones", pressure: "zero moment point",
        support: "support polygon", center: "centre of mass", capture: "capture point",
        traces: "trace of the zero moment point" } };
  }

  return { read, placed };
})();
