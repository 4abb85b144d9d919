/* A live view: shows what the server says, and tells it what the person in front of it wants. */
"use strict";

(() => {
  const { draw, plot, palette, words, heightOfGround } = HeelstrikeDrawing;
  const at = (name) => document.getElementById(name);
  const WEIGHT_LENGTH = 0.35; // of the robot's size, the arrow of its weight
  const STRONGEST = 4; // weights of the robot, of a push
  const TRAIL = 2.5, FLASH = 0.25; // s
  const NEAR = 14; // pixels within which a part is hit
  const RATES = [0.01, 0.02, 0.05, 0.1, 0.25, 0.5, 1, 2, 5, 10];
  const MARKS = { forces: "↑ forces, pushes", cones: "▽ friction cones",
    pressure: "◆ zero moment point", support: "▬ support interval", center: "● centre of mass",
    capture: "✕ capture point", traces: "⌇ foot traces" };
  const LAMPS = { good: "✓", warn: "!", bad: "✗", none: "–" };
  const KIND_ROWS = ["touchdown", "impact", "slip", "bridge"];

  const state = {}; // what the server told last
  let scene = null, layout = null, kindNames = [], live = false;
  let course = null; // frames so far, one after the other
  let glance = null; // a frame that is looked at, if it is not the last
  let events = [], pull = null, dirty = true, group = null;
  const hide = {};
  const camera = { x: 0, z: 0, scale: 100, follows: true, zoom: 1 };

  /* Frames: vectors of numbers, kept in one growing array. */
  class Course {
    constructor(width) {
      this.width = width;
      this.count = 0;
      this.numbers = new Float64Array(width * 4096);
    }
    add(numbers) {
      const more = numbers.length / this.width;
      if ((this.count + more) * this.width > this.numbers.length) {
        const larger = new Float64Array(2 * (this.numbers.length + numbers.length));
        larger.set(this.numbers);
        this.numbers = larger;
      }
      this.numbers.set(numbers, this.count * this.width);
      this.count += more;
    }
    time(k) { return this.numbers[k * this.width]; }
    vector(k) { return this.numbers.subarray(k * this.width, (k + 1) * this.width); }
    /** Number of frames that are not later than t. */
    until(t) {
      let low = 0, high = this.count;
      while (low < high) {
        const middle = (low + high) >> 1;
        if (this.time(middle) <= t) low = middle + 1;
        else high = middle;
      }
      return low;
    }
    cut(t) { this.count = this.until(t); }
  }

  const field = (vector, name) => {
    const [begin, width] = layout.fields[name];
    return vector.subarray(begin, begin + width);
  };
  const frameOf = (vector) => {
    const frame = { time: vector[0] };
    for (const name of Object.keys(layout.fields))
      if (name !== "time") frame[name] = field(vector, name);
    return frame;
  };
  const current = () => glance || (course && course.count ? course.vector(course.count - 1) : null);

  /* The socket. */
  const token = new URLSearchParams(location.search).get("token");
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  const socket = new WebSocket(`${scheme}://${location.host}/live?token=${token}`);
  socket.binaryType = "arraybuffer";
  const ask = (what, more) => {
    if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify({ do: what, ...more }));
  };
  socket.onclose = () => {
    document.body.dataset.connected = "no";
    for (const each of document.querySelectorAll("button, select, input")) each.disabled = true;
    showBanner("The connection has ended: the program was stopped, or the network lost. "
      + "When it runs again, open the address that it prints.");
  };
  socket.onopen = () => { document.body.dataset.connected = "yes"; };
  socket.onmessage = ({ data }) => {
    dirty = true;
    if (data instanceof ArrayBuffer) {
      const numbers = new Float64Array(data);
      if (!course) return;
      if (numbers[0] === 1) glance = numbers.subarray(1);
      else {
        course.add(numbers.subarray(1));
        glance = null;
      }
      followPull();
      return;
    }
    const message = JSON.parse(data);
    if (message.kind === "scene") begin(message);
    else if (message.kind === "events") addEvents(message.events);
    else if (message.kind === "cut") {
      course.cut(message.time + 1e-9);
      glance = null;
      events = events.filter(([t]) => t <= message.time);
    } else if (message.kind === "state") {
      delete message.kind;
      Object.assign(state, message);
      showState(message);
    }
  };

  function begin(message) {
    ({ scene, layout, live } = message);
    kindNames = message.events;
    course = new Course(layout.width);
    glance = null;
    events = [];
    camera.follows = true;
    at("name").textContent = `${scene.robot}`;
    at("name").title = message.method;
    document.title = `${scene.robot}: heelstrike`;
    document.querySelector("main").classList.toggle("looking", !live);
    spans = new Map();
    buildPanels();
    showKinds();
  }

  function addEvents(more) {
    const known = new Set(events.map(([, kind]) => kind));
    events = events.concat(more);
    if (more.some(([, kind]) => !known.has(kind))) showKinds();
  }

  /* What is told in words. */
  function showBanner(text) {
    at("banner").textContent = text;
    at("banner").hidden = !text;
  }

  function showState(changed) {
    at("lamp").textContent = LAMPS[state.light.level];
    at("lamp").dataset.level = state.light.level;
    at("light-text").textContent = state.light.text;
    at("play").textContent = state.playing ? "❚❚ pause" : "▶ play";
    at("play").setAttribute("aria-label", state.playing ? "pause" : "play");
    at("resume").disabled = state.end || !state.returns;
    at("resume").title = state.returns ? "forget what came later, and simulate on from here (g)"
      : "the controller takes no part in snapshots: it cannot be taken back";
    at("note").textContent = state.note;
    showBanner(state.busy || state.message);
    if (changed.rate !== undefined) showRates();
    if (changed.controls !== undefined || changed.values !== undefined) showControls();
  }

  function showRates() {
    const rates = RATES.includes(state.rate) ? RATES : [...RATES, state.rate].sort((a, b) => a - b);
    at("rate").replaceChildren(...rates.map((rate) => new Option(`× ${rate}`, rate)));
    at("rate").value = state.rate;
  }

  function showKinds() {
    const chosen = at("kinds").value;
    const known = new Set([...KIND_ROWS, ...events.map(([, kind]) => kindNames[kind])]);
    const options = [["", "any event"], ...[...known].filter((name) => kindNames.includes(name))
      .map((name) => [name, name.replaceAll("_", " ")])];
    at("kinds").replaceChildren(...options.map(([value, text]) => new Option(text, value)));
    at("kinds").value = options.some(([value]) => value === chosen) ? chosen : "";
  }

  /* Controls: made once, then only their values change, so that a slider can be held. */
  let made = "";
  const inputs = new Map();

  function showControls() {
    const wanted = JSON.stringify(state.controls);
    if (wanted !== made) {
      made = wanted;
      inputs.clear();
      at("controls").replaceChildren(...state.controls.map(controlOf));
    }
    for (const [name, { input, show }] of inputs)
      if (document.activeElement !== input || !input.dataset.held) {
        input.value = state.values[name];
        show();
      }
  }

  function controlOf(control) {
    const label = document.createElement("label"), head = document.createElement("span");
    const value = document.createElement("b"), name = document.createElement("span");
    name.textContent = control.label;
    head.append(name, value);
    label.title = control.at_once ? "acts at once" : "begins anew with it";
    let input;
    if (control.options.length) {
      input = document.createElement("select");
      input.append(...control.options.map((option) => new Option(option, option)));
      input.onchange = () => ask("choose", { name: control.name, value: input.value });
    } else {
      input = document.createElement("input");
      Object.assign(input, { type: "range", min: control.low, max: control.high,
        step: control.step });
      const choose = () => ask("choose", { name: control.name, value: Number(input.value) });
      input.oninput = () => {
        input.dataset.held = "yes";
        show();
        if (control.at_once) choose();
      };
      input.onchange = () => {
        delete input.dataset.held;
        choose();
      };
    }
    input.name = control.name;
    const show = () => {
      if (!control.options.length) value.textContent = `${words(Number(input.value))} ${control.unit}`;
    };
    inputs.set(control.name, { input, show });
    label.append(head, input);
    return label;
  }

  /* The picture. */
  const plane = at("plane");
  const dark = matchMedia("(prefers-color-scheme: dark)");

  /** Let a canvas have as many pixels as it shows; return its context and size in CSS pixels. */
  function sized(canvas) {
    const ratio = window.devicePixelRatio || 1;
    const width = canvas.clientWidth, height = canvas.clientHeight;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    const context = canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    return { context, width, height };
  }

  function aim(frame, width, height) {
    const base = Math.min(height / (1.5 * scene.size), width / (1.2 * scene.size));
    camera.scale = base * camera.zoom;
    if (!camera.follows) return;
    camera.x = frame.center[0];
    const around = [-1, -0.5, 0, 0.5, 1].map((n) => camera.x + n * scene.size);
    const heights = around.map((x) => heightOfGround(scene.ground, x));
    camera.z = 0.55 * scene.size + heights.reduce((sum, z) => sum + z, 0) / heights.length;
  }

  function trail(now) {
    const end = course.until(now + 1e-9), found = [];
    const begin = course.until(now - TRAIL), every = Math.max(1, Math.floor((end - begin) / 300));
    for (let k = begin; k < end; k += every)
      found.push({ point: field(course.vector(k), "point") });
    return found;
  }

  /** The newest event of each contact point, each kind named once. */
  function flashes(frame) {
    const lasts = FLASH * Math.min(1, Math.max(state.rate || 1, 0.02));
    const found = new Map(), named = new Set();
    for (let k = events.length - 1; k >= 0 && k > events.length - 200; k--) {
      const [time, kind, contact] = events[k];
      if (time > frame.time + 1e-9 || time < frame.time - lasts) continue;
      if (contact < 0 || 2 * contact + 1 >= frame.point.length || found.has(contact)) continue;
      const label = named.size ? "" : kindNames[kind].replaceAll("_", " ");
      named.add(kind);
      found.set(contact, { x: frame.point[2 * contact], z: frame.point[2 * contact + 1], label,
        strength: 1 - (frame.time - time) / lasts });
    }
    return [...found.values()];
  }

  function drawPlane() {
    const vector = current();
    if (!vector || !scene) return;
    const frame = frameOf(vector), { context, width, height } = sized(plane);
    aim(frame, width, height);
    const view = { ...camera, width, height, dark: dark.matches, hide, trail: trail(frame.time),
      flashes: flashes(frame) };
    draw(context, scene, frame, view);
    if (pull) drawPull(context, view, frame);
    const rate = state.playing && Math.abs(state.reached - state.rate) > 0.2 * state.rate
      && state.rate >= 0.5 && !glance ? `, reaches × ${state.reached}` : "";
    at("clock").textContent = `${frame.time.toFixed(frame.time < 100 ? 4 : 3)} s${rate}`;
    plane.dataset.time = frame.time;
    plane.dataset.pushed = Array.from(frame.push).filter((_, i) => i % 4 > 1)
      .reduce((sum, f) => sum + (Number.isFinite(f) ? f * f : 0), 0) ** 0.5;
  }

  /** What is pulled at, and where to. */
  function drawPull(context, view, frame) {
    const colors = palette(view.dark), [px, pz] = grasped(frame);
    const toX = (x) => 0.5 * view.width + (x - view.x) * view.scale;
    const toY = (z) => 0.5 * view.height - (z - view.z) * view.scale;
    context.strokeStyle = colors.push;
    context.lineWidth = 1.5;
    context.setLineDash([4, 4]);
    context.beginPath();
    context.moveTo(toX(px), toY(pz));
    context.lineTo(toX(pulledTo()[0]), toY(pulledTo()[1]));
    context.stroke();
    context.setLineDash([]);
    context.beginPath();
    context.arc(toX(px), toY(pz), 5, 0, 2 * Math.PI);
    context.stroke();
    if (state.playing) return;
    context.fillStyle = colors.push;
    context.font = "600 13px system-ui, sans-serif";
    context.fillText(`${words(Math.hypot(...pull.force))} N when it goes on`,
      toX(pulledTo()[0]) + 8, toY(pulledTo()[1]));
  }

  /* Pushing. */
  const worldOf = (event) => {
    const box = plane.getBoundingClientRect();
    return [camera.x + (event.clientX - box.left - 0.5 * box.width) / camera.scale,
      camera.z - (event.clientY - box.top - 0.5 * box.height) / camera.scale];
  };
  const poseOf = (frame, link) => [0, 1, 2].map((k) => frame.pose[3 * link + k]);
  const placed = ([x, z, angle], a, b) =>
    [x + Math.cos(angle) * a + Math.sin(angle) * b, z + Math.cos(angle) * b - Math.sin(angle) * a];
  const pulledTo = () => worldOf(pull); // the picture moves below the pointer, too
  const grasped = (frame) => placed(poseOf(frame, pull.link), ...pull.point);

  /** The foremost part at a place in the world, or the nearest one within reach; -1 if none. */
  function linkAt(frame, x, z) {
    let best = -1, nearest = NEAR / camera.scale;
    for (let k = scene.shapes.length - 1; k >= 0; k--) {
      const shape = scene.shapes[k], corners = [];
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
    const vector = current();
    if (!pull || !vector) return;
    const frame = frameOf(vector), [px, pz] = grasped(frame);
    const newtons = scene.weight > 0 ? scene.weight / (WEIGHT_LENGTH * scene.size) : 100;
    const [x, z] = pulledTo();
    let fx = (x - px) * newtons, fz = (z - pz) * newtons;
    const size = Math.hypot(fx, fz), most = STRONGEST * (scene.weight || 100);
    if (size > most) [fx, fz] = [(fx / size) * most, (fz / size) * most];
    if (pull.force[0] === fx && pull.force[1] === fz) return;
    pull.force = [fx, fz];
    ask("hold", { link: pull.link, point: pull.point, force: pull.force });
  }

  let pan = null;
  plane.addEventListener("pointerdown", (event) => {
    const vector = current();
    if (!vector || event.button !== 0) return;
    plane.setPointerCapture(event.pointerId);
    const frame = frameOf(vector), [x, z] = worldOf(event);
    const link = live ? linkAt(frame, x, z) : -1;
    if (link < 0) {
      pan = { clientX: event.clientX, clientY: event.clientY, x: camera.x, z: camera.z };
      return;
    }
    const [ox, oz, angle] = poseOf(frame, link), c = Math.cos(angle), s = Math.sin(angle);
    const point = [c * (x - ox) - s * (z - oz), s * (x - ox) + c * (z - oz)];
    pull = { link, point, clientX: event.clientX, clientY: event.clientY, force: [0, 0] };
    plane.classList.add("pulling");
  });
  plane.addEventListener("pointermove", (event) => {
    const vector = current();
    if (!vector) return;
    if (pull) {
      Object.assign(pull, { clientX: event.clientX, clientY: event.clientY });
      followPull();
      dirty = true;
    } else if (pan) {
      camera.follows = false;
      camera.x = pan.x - (event.clientX - pan.clientX) / camera.scale;
      camera.z = pan.z + (event.clientY - pan.clientY) / camera.scale;
      dirty = true;
    } else if (live)
      plane.classList.toggle("over", linkAt(frameOf(vector), ...worldOf(event)) >= 0);
  });
  const letGo = () => {
    if (pull) ask("release");
    pull = pan = null;
    plane.classList.remove("pulling");
    dirty = true;
  };
  for (const end of ["pointerup", "pointercancel", "lostpointercapture"])
    plane.addEventListener(end, letGo);
  plane.addEventListener("dblclick", () => {
    camera.follows = true;
    camera.zoom = 1;
    dirty = true;
  });
  plane.addEventListener("wheel", (event) => {
    event.preventDefault();
    camera.zoom = Math.min(20, Math.max(0.1, camera.zoom * Math.exp(-0.0012 * event.deltaY)));
    dirty = true;
  }, { passive: false });

  /* The strip of events, and the time on it. */
  function drawEvents() {
    const { context, width, height } = sized(at("events")), colors = palette(dark.matches);
    const from = state.from, inner = width - 16;
    const to = course && course.count ? Math.max(from, course.time(course.count - 1)) : from;
    const toX = (t) => 8 + ((t - from) / (to - from || 1)) * inner;
    context.clearRect(0, 0, width, height);
    const wanted = at("kinds").value, last = new Map();
    context.font = "10px system-ui, sans-serif";
    for (const [time, kind] of events) {
      const name = kindNames[kind];
      if (time < from || (wanted && name !== wanted)) continue;
      const x = Math.round(toX(time));
      if (last.get(kind) === x) continue; // as many as can be seen
      last.set(kind, x);
      const major = name === "touchdown" || name === "impact";
      const slips = name.includes("slip") || name.includes("stick");
      context.strokeStyle = major ? colors.warn : slips ? colors.pressure : colors.grey;
      context.lineWidth = major ? 2 : 1;
      context.beginPath();
      context.moveTo(x, major ? 2 : slips ? 11 : 16);
      context.lineTo(x, height - 2);
      context.stroke();
    }
    const vector = current();
    if (!vector) return;
    context.fillStyle = colors.ink;
    const x = toX(vector[0]);
    context.beginPath();
    context.moveTo(x - 5, height);
    context.lineTo(x + 5, height);
    context.lineTo(x, height - 8);
    context.fill();
    const slider = at("time");
    slider.min = from;
    slider.max = to;
    if (!slider.dataset.held) slider.value = vector[0];
  }

  /* Curves. */
  let spans = new Map(), panels = [];

  function buildPanels() {
    const names = [...new Set(layout.panels.map((panel) => panel.group))];
    if (!names.includes(group)) group = names[0];
    at("groups").replaceChildren(...names.map((name) => {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = name;
      button.setAttribute("aria-pressed", name === group);
      button.onclick = () => {
        group = name;
        buildPanels();
        dirty = true;
      };
      return button;
    }));
    panels = layout.panels.filter((panel) => panel.group === group).map((panel) => {
      const canvas = document.createElement("canvas");
      canvas.setAttribute("role", "img");
      canvas.setAttribute("aria-label", `${panel.title} over time`);
      const one = { panel, canvas, view: null };
      canvas.onpointerdown = (event) => {
        const { left, right, from, to } = one.view || {};
        if (right === undefined) return;
        const share = (event.offsetX - left) / (right - left);
        ask("seek", { time: from + share * (to - from) });
      };
      return one;
    });
    at("curves").replaceChildren(...panels.map((one) => one.canvas));
  }

  /** Ends of an axis: they grow with what was seen, and shrink only with a new scene. */
  function spanOf(panel, curves) {
    if (panel.span) return panel.span;
    const kept = spans.get(panel) || [Infinity, -Infinity];
    for (const { values } of curves)
      for (const value of values)
        if (Number.isFinite(value)) {
          kept[0] = Math.min(kept[0], value);
          kept[1] = Math.max(kept[1], value);
        }
    spans.set(panel, kept);
    let [low, high] = kept;
    for (const { level } of panel.limits) {
      // A limit that is far away is not worth a flat curve.
      const room = 1.5 * (kept[1] - kept[0]);
      if (level > low - room && level < high + room)
        [low, high] = [Math.min(low, level), Math.max(high, level)];
    }
    if (!(high >= low)) return [-1, 1];
    const room = 0.06 * (high - low) || Math.max(1e-9, 0.1 * Math.abs(high));
    return [low - room, high + room];
  }

  function drawCurves() {
    const vector = current();
    if (!vector || !course.count) return;
    const cursor = vector[0], span = Number(at("span").value);
    const end = course.time(course.count - 1);
    const to = Math.max(Math.min(end, cursor + 0.5 * span), course.time(0) + span);
    const from = to - span;
    const first = Math.max(course.until(from) - 1, 0), last = course.until(to);
    const every = Math.max(1, Math.floor((last - first) / 2000));
    const rows = [];
    for (let k = first; k < last; k += every) rows.push(k);
    const time = rows.map((k) => course.time(k));
    for (const one of panels) {
      const curves = one.panel.curves.map((curve) => ({ ...curve,
        values: rows.map((k) => course.numbers[k * course.width + curve.at]) }));
      const { context, width, height } = sized(one.canvas);
      const panel = { ...one.panel, curves, span: spanOf(one.panel, curves) };
      const sides = plot(context, panel, time,
        { width, height, from, to, cursor, dark: dark.matches });
      one.view = { ...sides, from, to };
    }
  }

  let turn = 0;
  function show() {
    requestAnimationFrame(show);
    if (!dirty && !(camera.follows && state.playing)) return;
    dirty = false;
    drawPlane();
    if (turn++ % 3 === 0 || !state.playing) { // curves need not be as smooth as the robot
      drawCurves();
      drawEvents();
    } else dirty = true;
  }

  /* What is asked for. */
  const press = {
    play: () => ask("play", { on: !state.playing }),
    back: () => ask("step", { rows: -1 }),
    forth: () => ask("step", { rows: 1 }),
    "event-before": () => ask("event", { direction: -1, kinds: kinds() }),
    "event-after": () => ask("event", { direction: 1, kinds: kinds() }),
    reset: () => ask("reset"),
    random: () => ask("random push"),
    resume: () => ask("resume"),
  };
  const kinds = () => (at("kinds").value ? [at("kinds").value] : []);
  for (const [name, act] of Object.entries(press)) at(name).onclick = act;
  at("rate").onchange = () => ask("rate", { value: Number(at("rate").value) });
  at("kinds").onchange = at("span").onchange = () => { dirty = true; };
  const slider = at("time");
  slider.oninput = () => {
    slider.dataset.held = "yes";
    ask("seek", { time: Number(slider.value) });
  };
  slider.onchange = () => { delete slider.dataset.held; };
  const KEYS = { " ": "play", ArrowLeft: "back", ArrowRight: "forth", r: "reset", p: "random",
    g: "resume" };
  document.addEventListener("keydown", (event) => {
    const typing = /^(INPUT|SELECT|BUTTON)$/.test(event.target.tagName);
    if (event.ctrlKey || event.metaKey || event.altKey || (typing && event.key.length > 1)
      || (typing && event.key === " ")) return;
    let name = KEYS[event.key];
    if (event.shiftKey && event.key.startsWith("Arrow")) name = `event-${
      event.key === "ArrowLeft" ? "before" : "after"}`;
    if (!name || at(name).disabled || !at(name).offsetParent) return;
    event.preventDefault();
    press[name]();
  });
  at("marks").append(...Object.entries(MARKS).map(([name, text]) => {
    const label = document.createElement("label"), box = document.createElement("input");
    box.type = "checkbox";
    box.checked = true;
    box.onchange = () => {
      hide[name] = !box.checked;
      dirty = true;
    };
    label.append(box, ` ${text}`);
    return label;
  }));
  dark.addEventListener("change", () => { dirty = true; });
  window.addEventListener("resize", () => { dirty = true; });
  requestAnimationFrame(show);
})();
