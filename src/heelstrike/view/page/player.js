/* A recorded run on a page: decodes its numbers, plays them, and keeps curves on the same cursor. */
"use strict";

(() => {
  const run = JSON.parse(document.getElementById("run").textContent);
  const { scene, data, plots, events, phases } = run;
  const at = (name) => document.getElementById(name);
  const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;

  /* Numbers: time (n), and columns of n rows or, where all are the same, of one. */
  const time = new Float64Array(bytes(data.time)), count = data.rows;
  const columns = new Map();
  const numbers = new Float32Array(bytes(data.numbers));
  let next = 0;
  for (const { name, width, rows } of data.columns) {
    columns.set(name, { width, rows, values: numbers.subarray(next, next + width * rows) });
    next += width * rows;
  }
  const row = (name, k) => {
    const { width, rows, values } = columns.get(name);
    const start = rows === 1 ? 0 : k * width;
    return values.subarray(start, start + width);
  };
  const MEMBERS = ["pose", "point", "normal", "force", "friction", "center", "capture", "pressure",
    "support", "push"];
  const MOVING = ["pose", "point", "center", "capture", "push"];
  const frameOf = (k) => {
    const frame = { time: time[k] };
    for (const name of MEMBERS) frame[name] = row(name, k);
    return frame;
  };

  plots.forEach((panel, i) => panel.curves.forEach((curve, k) => {
    const { rows, values } = columns.get(`curve ${i} ${k}`);
    curve.values = rows === 1 ? new Float32Array(count).fill(values[0]) : values;
  }));

  const start = time[0], end = time[count - 1];
  const impacts = events.filter((event) => event.impact).map((event) => event.time);
  const instants = [...new Set(events.map((event) => event.time))].sort((a, b) => a - b);

  const state = { now: start, row: 0, playing: false, speed: 1, slow: true, hide: {}, dark: null,
    last: 0 };
  const isDark = () => state.dark === null
    ? matchMedia("(prefers-color-scheme: dark)").matches : state.dark;

  /** Last of sorted values that is not beyond t, or -1. */
  function before(values, t) {
    let low = 0, high = values.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (values[middle] <= t) low = middle + 1;
      else high = middle;
    }
    return low - 1;
  }

  /** What is drawn at a time: places on the straight line between rows, forces of the row before. */
  function frameAt(t) {
    const k = Math.max(0, before(time, t));
    const frame = frameOf(k);
    const share = k + 1 < count ? (t - time[k]) / (time[k + 1] - time[k] || 1) : 0;
    if (share > 0) {
      const after = frameOf(k + 1);
      for (const name of MOVING)
        frame[name] = frame[name].map((value, i) => value + share * (after[name][i] - value));
    }
    return frame;
  }

  /* The camera follows the centre of mass, evenly, and holds all of the robot. */
  const camera = (() => {
    let low = Infinity, high = -Infinity, reach = 0;
    for (let k = 0; k < count; k++) {
      const center = row("center", k)[0], pose = row("pose", k);
      const ground = HeelstrikeDrawing.heightOfGround(scene.ground, center);
      for (const shape of scene.shapes) {
        const [x, z, angle] = [0, 1, 2].map((n) => pose[3 * shape.link + n]);
        for (let n = 0; n + 1 < shape.corners.length; n += 2) {
          const [a, b] = [shape.corners[n], shape.corners[n + 1]];
          const px = x + Math.cos(angle) * a + Math.sin(angle) * b;
          const pz = z + Math.cos(angle) * b - Math.sin(angle) * a;
          if (!Number.isFinite(px + pz)) continue;
          low = Math.min(low, pz - ground);
          high = Math.max(high, pz - ground);
          reach = Math.max(reach, Math.abs(px - center));
        }
      }
    }
    if (!(high > low)) [low, high, reach] = [0, 1, 1];
    const size = Math.max(high - low, scene.size);
    return { low: Math.min(low, 0) - 0.14 * size, high: high + 0.2 * size, reach: reach * 1.05 };
  })();

  /** Mean of the centre of mass within 0.3 s of a time. */
  function followed(t) {
    let total = 0, weight = 0;
    for (let n = -6; n <= 6; n++) {
      const center = frameCenter(Math.min(end, Math.max(start, t + 0.05 * n)));
      const share = 7 - Math.abs(n);
      if (Number.isFinite(center)) [total, weight] = [total + share * center, weight + share];
    }
    return weight ? total / weight : 0;
  }
  function frameCenter(t) {
    const k = Math.max(0, before(time, t)), l = Math.min(k + 1, count - 1);
    const share = time[l] > time[k] ? (t - time[k]) / (time[l] - time[k]) : 0;
    return row("center", k)[0] * (1 - share) + row("center", l)[0] * share;
  }

  function fit(canvas) {
    const width = canvas.clientWidth, height = canvas.clientHeight;
    const ratio = window.devicePixelRatio || 1;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    const context = canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    return { context, width, height };
  }

  const FLASH = 0.12; // s
  function flashes(t, frame) {
    const found = [];
    for (const event of events) {
      if (event.time > t + 1e-9) break;
      if (t - event.time > FLASH || event.contact < 0 || !event.impact) continue;
      const impulse = event.impulse ? ` ${HeelstrikeDrawing.words(event.impulse)} N s` : "";
      const same = found.find((other) => other.kind === event.kind);
      found.push({ x: frame.point[2 * event.contact], z: frame.point[2 * event.contact + 1],
        strength: 1 - (t - event.time) / FLASH, kind: event.kind,
        label: same ? "" : `${event.kind}${impulse}` });
    }
    return found;
  }

  function drawPlane() {
    const { context, width, height } = fit(at("plane"));
    if (!width || !height) return;
    const frame = frameAt(state.now), x = followed(state.now);
    const scale = Math.min(height / (camera.high - camera.low), width / (2 * camera.reach));
    const bottom = HeelstrikeDrawing.heightOfGround(scene.ground, x) + camera.low;
    const trail = [];
    for (let k = state.row; k >= 0 && state.now - time[k] < 1.5; k--) trail.push(frameOf(k));
    HeelstrikeDrawing.draw(context, scene, frame, { width, height, x, scale,
      z: bottom + (0.5 * height) / scale, dark: isDark(), hide: state.hide, trail,
      flashes: flashes(state.now, frame) });
    return frame;
  }

  const canvases = plots.map((panel) => {
    const canvas = document.createElement("canvas");
    canvas.setAttribute("role", "img");
    canvas.tabIndex = -1;
    const names = panel.curves.map((curve) => curve.label).filter(Boolean).join(", ");
    const limits = panel.limits.map(({ label, level }) =>
      `${label} ${HeelstrikeDrawing.words(level)}`).join(", ");
    canvas.setAttribute("aria-label", `${panel.group}: ${panel.title} in ${panel.unit} over time`
      + (names ? `; ${names}` : "") + (limits ? `; limits: ${limits}` : ""));
    at("curves").append(canvas);
    return canvas;
  });
  const sides = { left: 0, right: 1 };

  /* Curves are drawn once for each size and look; what moves with time is the cursor. */
  const kept = new Map();
  function drawPlots() {
    plots.forEach((panel, i) => {
      const canvas = canvases[i], dark = isDark();
      const box = canvas.getBoundingClientRect();
      if (state.playing && (box.bottom < 0 || box.top > window.innerHeight)) return;
      const { context, width, height } = fit(canvas);
      if (!width) return;
      const view = { width, height, from: start, to: end, dark, cursor: NaN };
      const key = `${canvas.width} ${canvas.height} ${dark}`;
      if (!kept.has(i) || kept.get(i).key !== key) {
        Object.assign(sides, HeelstrikeDrawing.plot(context, panel, time, view));
        const picture = document.createElement("canvas");
        [picture.width, picture.height] = [canvas.width, canvas.height];
        picture.getContext("2d").drawImage(canvas, 0, 0);
        kept.set(i, { key, picture, sides: { ...sides } });
      }
      const { picture, sides: { left, right } } = kept.get(i);
      context.drawImage(picture, 0, 0, width, height);
      const x = left + ((state.now - start) / (end - start || 1)) * (right - left);
      context.strokeStyle = HeelstrikeDrawing.palette(dark).warn;
      context.lineWidth = 1.5;
      context.beginPath();
      context.moveTo(x, 24);
      context.lineTo(x, height - 20);
      context.stroke();
    });
  }

  const KINDS = { "touchdown": "▼", "liftoff": "▲", "slip": "~", "stick": "·", "impact": "✳" };
  function drawEvents() {
    const { context, width, height } = fit(at("events"));
    if (!width) return;
    const dark = isDark(), colors = HeelstrikeDrawing.palette(dark);
    const toX = (t) => 8 + ((t - start) / (end - start || 1)) * (width - 16);
    context.clearRect(0, 0, width, height);
    const feet = scene.feet.length, tall = feet ? 12 / feet : 0;
    for (const [from, to, ...pushing] of phases)
      for (const foot of pushing) {
        context.fillStyle = HeelstrikeDrawing.footColor(colors, foot);
        context.fillRect(toX(from), height - 13 + foot * tall, toX(to) - toX(from), tall - 1);
      }
    context.font = "11px system-ui, sans-serif";
    context.textAlign = "center";
    context.textBaseline = "top";
    let last = -20;
    for (const event of events) {
      const x = toX(event.time);
      context.strokeStyle = context.fillStyle = event.impact ? colors.warn : colors.grey;
      context.beginPath();
      context.moveTo(x, event.impact ? 10 : 15);
      context.lineTo(x, height - 14);
      context.stroke();
      if (x - last > 9 && event.impact) {
        context.fillText(KINDS[event.kind] || "•", x, 0);
        last = x;
      }
    }
  }

  function tell(frame) {
    const { words } = HeelstrikeDrawing;
    at("clock").textContent = `${state.now.toFixed(3)} s`;
    at("time").value = state.row;
    at("time").setAttribute("aria-valuetext", `${state.now.toFixed(3)} seconds`);
    const near = events.filter((event) => Math.abs(event.time - state.now) < 1e-3);
    const normal = scene.feet.map((foot, i) => {
      const sum = scene.contacts.reduce((total, contact, k) => contact.foot === i
        ? total + HeelstrikeDrawing.pressed(frame, k).normal : total, 0);
      return `${foot.name} ${words(Math.abs(sum) < 1e-6 * scene.weight ? 0 : sum)} N`;
    }).join(", ");
    const told = near.map((event) => `${event.kind} ${event.where}`
      + (event.impulse ? ` ${words(event.impulse)} N s` : "")).join("; ");
    at("now").textContent = [normal, told].filter(Boolean).join(" — ");
    if (!state.playing)
      at("plane").setAttribute("aria-label",
        `${scene.robot} at ${state.now.toFixed(3)} s; ${[normal, told].filter(Boolean).join("; ")}`);
  }

  function show() {
    const frame = drawPlane();
    drawPlots();
    if (frame) tell(frame);
  }

  function go(t) {
    state.now = Math.min(end, Math.max(start, t));
    state.row = Math.max(0, before(time, state.now));
    show();
  }
  const goToRow = (k) => go(time[Math.min(count - 1, Math.max(0, k))]);

  const SLOWEST = 0.06, AROUND = 0.06; // times real time; s
  function pace() {
    if (!state.slow) return state.speed;
    const k = before(impacts, state.now);
    const since = k < 0 ? Infinity : state.now - impacts[k];
    const until = k + 1 < impacts.length ? impacts[k + 1] - state.now : Infinity;
    const near = Math.min(1, since / AROUND, until / (0.4 * AROUND));
    return state.speed * Math.max(SLOWEST, near * near);
  }

  function tick(stamp) {
    if (!state.playing) return;
    const elapsed = Math.min(0.1, (stamp - state.last) / 1000);
    state.last = stamp;
    go(state.now + elapsed * pace());
    if (state.now >= end) play(false);
    else requestAnimationFrame(tick);
  }
  function play(on) {
    if (on && state.now >= end) go(start);
    state.playing = on;
    at("play").textContent = on ? "❚❚ pause" : "▶ play";
    at("play").setAttribute("aria-label", on ? "pause" : "play");
    at("play").setAttribute("aria-pressed", String(on));
    if (on) requestAnimationFrame((stamp) => { state.last = stamp; tick(stamp); });
    else show();
  }
  function toEvent(side) {
    play(false);
    const k = before(instants, state.now + (side > 0 ? 1e-9 : -1e-9));
    const target = side > 0 ? instants[k + 1] : instants[k];
    if (target !== undefined) go(target);
  }

  at("time").max = count - 1;
  at("time").addEventListener("input", (happened) => {
    play(false);
    goToRow(Number(happened.target.value));
  });
  at("play").addEventListener("click", () => play(!state.playing));
  at("start").addEventListener("click", () => { play(false); go(start); });
  at("back").addEventListener("click", () => { play(false); stepRow(-1); });
  at("forth").addEventListener("click", () => { play(false); stepRow(1); });
  at("event-before").addEventListener("click", () => toEvent(-1));
  at("event-after").addEventListener("click", () => toEvent(1));
  at("speed").addEventListener("change", (happened) => { state.speed = Number(happened.target.value); });
  at("slow").addEventListener("change", (happened) => { state.slow = happened.target.checked; });
  function stepRow(by) {
    const between = state.now > time[state.row] + 1e-12;
    goToRow(state.row + (by < 0 && between ? by + 1 : by));
  }

  const KEYS = {
    " ": () => play(!state.playing),
    "ArrowLeft": (shift) => { play(false); stepRow(shift ? -10 : -1); },
    "ArrowRight": (shift) => { play(false); stepRow(shift ? 10 : 1); },
    "Home": () => { play(false); go(start); },
    "End": () => { play(false); go(end); },
    "n": () => toEvent(1),
    "p": () => toEvent(-1),
    "s": () => { state.slow = !state.slow; at("slow").checked = state.slow; },
    "d": () => {
      state.dark = !isDark();
      document.documentElement.className = state.dark ? "dark" : "light";
      all();
    },
  };
  document.addEventListener("keydown", (happened) => {
    const own = happened.target.tagName;
    if (happened.ctrlKey || happened.metaKey || happened.altKey || own === "SELECT") return;
    if (happened.key === " " && ["BUTTON", "SUMMARY"].includes(own)) return; // they take it
    if (happened.key === " " && happened.target.type === "checkbox") return;
    const act = KEYS[happened.key];
    if (!act) return;
    happened.preventDefault();
    act(happened.shiftKey);
  });
  at("plane").addEventListener("click", () => play(!state.playing));

  const pointed = (canvas, happened) => {
    const { left, right } = kept.get(canvases.indexOf(canvas))?.sides || sides;
    const x = happened.clientX - canvas.getBoundingClientRect().left;
    play(false);
    go(start + ((x - left) / (right - left)) * (end - start));
  };
  for (const canvas of canvases) {
    canvas.addEventListener("pointerdown", (happened) => pointed(canvas, happened));
    canvas.addEventListener("pointermove", (happened) => {
      if (happened.buttons) pointed(canvas, happened);
    });
  }

  const DRAWN = { forces: "contact forces", cones: "friction cones", pressure: "zero moment point",
    support: "support interval", center: "centre of mass", capture: "capture point",
    traces: "foot traces" };
  for (const [name, label] of Object.entries(DRAWN)) {
    const box = document.createElement("label"), tick = document.createElement("input");
    tick.type = "checkbox";
    tick.checked = true;
    tick.id = `show-${name}`;
    tick.addEventListener("change", () => { state.hide[name] = !tick.checked; show(); });
    box.append(tick, ` ${label}`);
    at("choices").append(box);
  }
  for (const event of events.slice(0, 400)) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = `${event.time.toFixed(3)} s ${event.kind} ${event.where}`
      + (event.impulse ? ` ${HeelstrikeDrawing.words(event.impulse)} N s` : "");
    button.addEventListener("click", () => { play(false); go(event.time); });
    at("list").append(button);
  }
  if (events.length > 400 || run.left_out)
    at("list").append(` and ${Math.max(0, events.length - 400) + run.left_out} more`);

  function legend() {
    const colors = HeelstrikeDrawing.palette(isDark());
    const entries = scene.feet.map((foot, i) =>
      [scene.feet.length > 1 ? foot.name : "robot", scene.feet.length > 1
        ? HeelstrikeDrawing.footColor(colors, i) : colors.ink]);
    if (scene.contacts.length)
      entries.push(["contact force (arrow at the left: the robot's weight)", colors.force],
        ["◆ zero moment point and support", colors.pressure]);
    entries.push(["● centre of mass, ✕ capture point", colors.center]);
    at("legend").replaceChildren(...entries.map(([name, color]) => {
      const span = document.createElement("span");
      span.textContent = name;
      span.style.setProperty("--mark", color);
      return span;
    }));
  }
  at("rows").textContent = `This page holds ${count} of ${run.recorded} rows of the record, those `
    + "beside events and about impacts among them; its numbers are those of the record to "
    + `${run.tolerance.toExponential(0)} of their size. Between rows places are drawn on straight `
    + "lines; forces are means from each row to the next.";

  function all() {
    kept.clear();
    legend();
    drawEvents();
    show();
  }
  new ResizeObserver(() => all()).observe(document.body);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", all);
  addEventListener("scroll", () => { if (!state.playing) drawPlots(); }, { passive: true });
  all();
  document.documentElement.dataset.ready = "yes"; // for those who wait for the first picture
})();
