/* Plays a recorded run on a page, and keeps timeline and curves on the same cursor. */
"use strict";

(() => {
  const { before, fit } = HeelstrikeRecording;
  const at = (name) => document.getElementById(name);
  const reader = typeof HeelstrikeSpace === "undefined" ? HeelstrikeRecording : HeelstrikeSpace;
  const run = reader.read(JSON.parse(at("run").textContent));
  const pressed = run.pressed || HeelstrikeDrawing.pressed;
  const { scene, plots, events, phases, time, count, start, end } = run;
  plots.forEach((panel, i) => panel.curves.forEach((curve, k) => {
    curve.values = run.curve(`curve ${i} ${k}`);
  }));

  const impacts = events.filter((event) => event.impact).map((event) => event.time);
  const instants = [...new Set(events.map((event) => event.time))].sort((a, b) => a - b);

  const state = { now: start, row: 0, playing: false, speed: 1, slow: true, hide: {}, dark: null,
    last: 0 };
  const SLIDER = 10000; // its last value
  const isDark = () => state.dark === null
    ? matchMedia("(prefers-color-scheme: dark)").matches : state.dark;

  const drawPlane = () =>
    run.draw(at("plane"), state.now, { dark: isDark(), hide: state.hide });

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

  const INSET = 8; // pixels, half a thumb of the slider: instants stand over their places on it
  const KINDS = { "touchdown": "▼", "liftoff": "▲", "slip": "~", "stick": "·", "impact": "✳" };
  const marked = events.map(({ time, kind, impact }) =>
    ({ time, level: impact ? 2 : 0, mark: impact ? KINDS[kind] || "•" : "" }));
  function drawEvents() {
    const { context, width, height } = fit(at("events"));
    if (!width) return;
    HeelstrikeDrawing.strip(context, { width, height, inset: INSET, from: start, to: end,
      dark: isDark(), phases, feet: scene.feet.length, events: marked });
  }

  const inWords = ({ kind, where, impulse, unit }) => [kind, where,
    impulse ? `${HeelstrikeDrawing.words(impulse)} ${unit}` : ""].filter(Boolean).join(" ");

  function tell(frame) {
    const { words } = HeelstrikeDrawing;
    at("clock").textContent = `${state.now.toFixed(3)} s`;
    at("time").value = Math.round((SLIDER * (state.now - start)) / (end - start || 1));
    at("time").setAttribute("aria-valuetext", `${state.now.toFixed(3)} seconds`);
    const near = events.filter((event) => Math.abs(event.time - state.now) < 1e-3);
    const normal = scene.feet.map((foot, i) => {
      const sum = scene.contacts.reduce((total, contact, k) => contact.foot === i
        ? total + pressed(frame, k).normal : total, 0);
      return `${foot.name} ${words(Math.abs(sum) < 1e-6 * scene.weight ? 0 : sum)} N`;
    }).join(", ");
    const told = near.map(inWords).join("; ");
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
    state.row = run.rowAt(state.now);
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

  at("time").addEventListener("input", (happened) => {
    const share = Number(happened.target.value) / SLIDER; // which pausing takes back
    play(false);
    go(start + share * (end - start));
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
    ...run.keys,
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
  at("plane").addEventListener("click", () => {
    if (!run.dragged || !run.dragged()) play(!state.playing);
  });

  const pointed = (canvas, happened) => {
    const { left, right } = kept.get(canvases.indexOf(canvas))?.sides || sides;
    const x = happened.clientX - canvas.getBoundingClientRect().left;
    play(false);
    go(start + ((x - left) / (right - left)) * (end - start));
  };
  const onStrip = (happened) => {
    const box = at("events").getBoundingClientRect();
    play(false);
    go(start + ((happened.clientX - box.left - INSET) / (box.width - 2 * INSET)) * (end - start));
  };
  at("events").addEventListener("pointerdown", onStrip);
  at("events").addEventListener("pointermove", (happened) => {
    if (happened.buttons) onStrip(happened);
  });
  for (const canvas of canvases) {
    canvas.addEventListener("pointerdown", (happened) => pointed(canvas, happened));
    canvas.addEventListener("pointermove", (happened) => {
      if (happened.buttons) pointed(canvas, happened);
    });
  }

  const DRAWN = run.drawn || { forces: "contact forces", cones: "friction cones", pressure: "zero moment point",
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
    button.textContent = `${event.time.toFixed(3)} s ${inWords(event)}`;
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
    + "beside events and about impacts among them; times are exact, other numbers are those of the "
    + `record to ${run.tolerance.toExponential(1)} of the range of their curve. Between rows places `
    + "are drawn on straight lines; forces are means from each row to the next.";

  if (run.whenMoved) run.whenMoved(() => { if (!state.playing) drawPlane(); });

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
  // For pages that show this one in a frame; not for people who asked their system for stillness.
  if (location.hash === "#autoplay" && !matchMedia("(prefers-reduced-motion: reduce)").matches)
    play(true);
  document.documentElement.dataset.ready = "yes"; // for those who wait for the first picture
})();
