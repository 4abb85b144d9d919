/* The picture: where the camera is, what is drawn, and what is pulled at.

   HeelstrikePicture(view) returns {draw, followPull, zoom, components, hint, ways, keys, settings,
   use}; view/spatial/picture.js is that of robots in space. */
"use strict";

var HeelstrikePicture = (view) => {
  const { draw, fit, palette, words, heightOfGround } = HeelstrikeDrawing;
  const at = (name) => document.getElementById(name);
  const WEIGHT_LENGTH = 0.35; // of the robot's size, the arrow of its weight
  const STRONGEST = 4; // weights of the robot, of a push
  const TRAIL = 2.5, FLASH = 0.5; // s
  const QUIET = ["liftoff", "stick"]; // events that go without a flash
  const NEAR = 14; // pixels within which a part is hit
  const HIGH = 1.34, WIDE = 1.1, BELOW = 0.17; // of the robot's size: what is seen of the world
  const NEAREST = 20, FARTHEST = 0.1;

  const plane = at("plane");
  const camera = { x: 0, z: 0, scale: 100, follows: true, zoom: 1 };
  let pull = null, pan = null;

  function aim(frame, width, height) {
    const { size, ground } = view.scene;
    camera.scale = camera.zoom * Math.min(height / (HIGH * size), width / (WIDE * size));
    if (!camera.follows) return;
    camera.x = frame.center[0];
    const around = [-1, -0.5, 0, 0.5, 1].map((n) => camera.x + n * size);
    const heights = around.map((x) => heightOfGround(ground, x));
    const mean = heights.reduce((sum, z) => sum + z, 0) / heights.length;
    // The ground at the bottom of a low picture, the robot in the middle of a high one.
    const seen = height / camera.scale * camera.zoom;
    camera.z = mean + Math.min((0.5 - BELOW / HIGH) * seen, 0.5 * size + 0.06 * (seen - size));
  }

  function trail(now) {
    const { course } = view, end = course.until(now + 1e-9), found = [];
    const begin = course.until(now - TRAIL), every = Math.max(1, Math.floor((end - begin) / 300));
    for (let k = begin; k < end; k += every)
      found.push({ point: course.field(course.vector(k), "point") });
    return found;
  }

  /** The newest event of each contact point, each kind named once. */
  function flashes(frame) {
    const { events, kinds } = view;
    const lasts = FLASH * Math.min(1, Math.max(view.state.rate || 1, 0.02));
    const found = new Map(), named = new Set();
    for (let k = events.length - 1; k >= 0 && k > events.length - 200; k--) {
      const [time, kind, contact] = events[k];
      if (time > frame.time + 1e-9 || time < frame.time - lasts) continue;
      if (QUIET.includes(kinds[kind])) continue;
      if (contact < 0 || 2 * contact + 1 >= frame.point.length || found.has(contact)) continue;
      const label = named.has(kind) ? "" : kinds[kind].replaceAll("_", " ");
      const alone = named.size === 0;
      named.add(kind);
      found.set(contact, { x: frame.point[2 * contact], z: frame.point[2 * contact + 1],
        label: alone ? label : "", strength: 1 - (frame.time - time) / lasts });
    }
    return [...found.values()];
  }

  /** Draw a frame of the course; return it as it is drawn. */
  function drawFrame(vector) {
    const { context, width, height } = fit(plane);
    const frame = view.course.frame(vector);
    aim(frame, width, height);
    const look = { ...camera, width, height, dark: view.dark(), hide: view.hide,
      trail: trail(frame.time), flashes: flashes(frame), steady: view.steady };
    draw(context, view.scene, frame, look);
    if (pull) drawPull(context, look, frame);
    return frame;
  }

  /** What is pulled at, and where to. */
  function drawPull(context, look, frame) {
    const colors = palette(look.dark), [px, pz] = grasped(frame), [x, z] = pulledTo();
    const toX = (metres) => 0.5 * look.width + (metres - look.x) * look.scale;
    const toY = (metres) => 0.5 * look.height - (metres - look.z) * look.scale;
    context.strokeStyle = colors.push;
    context.lineWidth = 1.5;
    context.setLineDash([4, 4]);
    context.beginPath();
    context.moveTo(toX(px), toY(pz));
    context.lineTo(toX(x), toY(z));
    context.stroke();
    context.setLineDash([]);
    context.beginPath();
    context.arc(toX(px), toY(pz), 5, 0, 2 * Math.PI);
    context.stroke();
    if (view.state.playing) return;
    context.fillStyle = colors.push;
    context.font = "600 13px system-ui, sans-serif";
    context.textAlign = "left";
    context.fillText(`${words(Math.hypot(...pull.force))} N when it goes on`, toX(x) + 8, toY(z));
  }

  /* Pushing. */
  const worldOf = ({ clientX, clientY }) => {
    const box = plane.getBoundingClientRect();
    return [camera.x + (clientX - box.left - 0.5 * box.width) / camera.scale,
      camera.z - (clientY - box.top - 0.5 * box.height) / camera.scale];
  };
  const poseOf = (frame, link) => [0, 1, 2].map((k) => frame.pose[3 * link + k]);
  const placed = ([x, z, angle], a, b) =>
    [x + Math.cos(angle) * a + Math.sin(angle) * b, z + Math.cos(angle) * b - Math.sin(angle) * a];
  const pulledTo = () => worldOf(pull); // the picture moves below the pointer, too
  const grasped = (frame) => placed(poseOf(frame, pull.link), ...pull.point);

  /** The foremost part at a place in the world, or the nearest one within reach; -1 if none. */
  function linkAt(frame, x, z) {
    let best = -1, nearest = NEAR / camera.scale;
    for (let k = view.scene.shapes.length - 1; k >= 0; k--) {
      const shape = view.scene.shapes[k], corners = [];
      const second = shape.end === undefined ? shape.link : shape.end;
      for (let n = 0; n < shape.corners.length; n += 2) {
        const link = shape.corners.length === 4 && n === 2 ? second : shape.link;
        corners.push(placed(poseOf(frame, link), shape.corners[n], shape.corners[n + 1]));
      }
      let inside = corners.length > 2;
      const sides = new Set();
      for (let n = 0; n < corners.length; n++) {
        const [ax, az] = corners[n], [bx, bz] = corners[(n + 1) % corners.length];
        const dx = bx - ax, dz = bz - az;
        const along = Math.max(0, Math.min(1,
          ((x - ax) * dx + (z - az) * dz) / (dx * dx + dz * dz || 1)));
        const distance = Math.hypot(x - ax - along * dx, z - az - along * dz);
        sides.add(Math.sign(dx * (z - az) - dz * (x - ax)));
        if (distance < nearest) [best, nearest] = [shape.link, distance];
      }
      inside = inside && !(sides.has(1) && sides.has(-1));
      if (inside) return shape.link;
    }
    return best;
  }

  /** Say again how strong the pull is: the part that is held has moved. */
  function followPull() {
    const vector = view.current();
    if (!pull || !vector) return;
    const { weight, size: length } = view.scene;
    const frame = view.course.frame(vector), [px, pz] = grasped(frame);
    const newtons = weight > 0 ? weight / (WEIGHT_LENGTH * length) : 100;
    const [x, z] = pulledTo();
    let fx = (x - px) * newtons, fz = (z - pz) * newtons;
    const size = Math.hypot(fx, fz), most = STRONGEST * (weight || 100);
    if (size > most) [fx, fz] = [(fx / size) * most, (fz / size) * most];
    if (pull.force[0] === fx && pull.force[1] === fz) return;
    pull.force = [fx, fz];
    view.ask("hold", { link: pull.link, point: pull.point, force: pull.force });
  }

  const fingers = new Map(); // two of them zoom
  const apart = () => {
    const [one, other] = [...fingers.values()];
    return Math.hypot(one.clientX - other.clientX, one.clientY - other.clientY);
  };
  let spread = 0;

  plane.addEventListener("pointerdown", (event) => {
    const vector = view.current();
    if (!vector || event.button !== 0) return;
    plane.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, event);
    if (fingers.size === 2) {
      letGo();
      spread = apart();
      return;
    }
    const frame = view.course.frame(vector), [x, z] = worldOf(event);
    const link = view.live ? linkAt(frame, x, z) : -1;
    if (link < 0) {
      pan = { clientX: event.clientX, clientY: event.clientY, x: camera.x, z: camera.z };
      return;
    }
    const [ox, oz, angle] = poseOf(frame, link), c = Math.cos(angle), s = Math.sin(angle);
    const point = [c * (x - ox) - s * (z - oz), s * (x - ox) + c * (z - oz)];
    pull = { link, point, clientX: event.clientX, clientY: event.clientY, force: [0, 0] };
    plane.classList.add("pulling");
    at("hint").classList.add("known");
  });
  plane.addEventListener("pointermove", (event) => {
    const vector = view.current();
    if (!vector) return;
    if (fingers.has(event.pointerId)) fingers.set(event.pointerId, event);
    if (fingers.size === 2) {
      const now = apart();
      zoom(now / (spread || now));
      spread = now;
    } else if (pull) {
      Object.assign(pull, { clientX: event.clientX, clientY: event.clientY });
      followPull();
    } else if (pan) {
      camera.follows = false;
      camera.x = pan.x - (event.clientX - pan.clientX) / camera.scale;
      camera.z = pan.z + (event.clientY - pan.clientY) / camera.scale;
      view.chosen();
    } else {
      if (view.live)
        plane.classList.toggle("over", linkAt(view.course.frame(vector), ...worldOf(event)) >= 0);
      return;
    }
    view.redraw();
  });
  function letGo() {
    if (pull) view.ask("release");
    pull = pan = null;
    plane.classList.remove("pulling");
    view.redraw();
  }
  for (const end of ["pointerup", "pointercancel", "lostpointercapture"])
    plane.addEventListener(end, (event) => {
      fingers.delete(event.pointerId);
      letGo();
    });
  function zoom(by) {
    camera.zoom = Math.min(NEAREST, Math.max(FARTHEST, camera.zoom * by));
    view.chosen();
    view.redraw();
  }
  plane.addEventListener("dblclick", () => {
    Object.assign(camera, { follows: true, zoom: 1 });
    view.chosen();
    view.redraw();
  });
  plane.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom(Math.exp(-0.0012 * event.deltaY));
  }, { passive: false });

  return {
    draw: drawFrame, followPull, zoom,
    components: 2, // of a place and a force
    hint: "drag a part of the robot to push it",
    ways: [["drag a part", "push it there"], ["drag the ground, wheel", "move, zoom"]],
    keys: {},
    /** How it is looked at, as numbers: what a link to it carries. */
    settings: () => ({ zoom: camera.zoom === 1 ? "" : camera.zoom.toPrecision(3),
      at: camera.follows ? "" : `${camera.x.toFixed(3)},${camera.z.toFixed(3)}` }),
    use({ zoom: nearer, at: place }) {
      const number = Number(nearer || 1), [x, z] = (place || "").split(",").map(Number);
      camera.zoom = number >= FARTHEST && number <= NEAREST ? number : 1;
      camera.follows = !(Number.isFinite(x) && Number.isFinite(z));
      if (!camera.follows) Object.assign(camera, { x, z });
    },
  };
};
