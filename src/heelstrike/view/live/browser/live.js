/* A live view: shows what the server says, and tells it what the person in front of it wants. */
"use strict";

(() => {
  const at = (name) => document.getElementById(name);
  const MOST_EVENTS = 20000; // the oldest go, as on the server
  const READ_FOR = 250; // ms that a number stays which changes all the time
  const SAID_FOR = 6000; // ms that words of the page itself stay
  const ASKED_EVERY = 30; // ms between two seeks of one drag
  const RATES = [0.01, 0.02, 0.05, 0.1, 0.25, 0.5, 1, 2, 5, 10];
  const LAMPS = { good: "✓", warn: "!", bad: "✗", none: "–" };

  const system = matchMedia("(prefers-color-scheme: dark)");
  let dirty = true, glance = null, wanted = null, asked = 0, told = 0, dark = null;

  /* What the parts of the page share. */
  const view = {
    state: {}, // what the server told last
    scene: null, layout: null, course: null, kinds: [], events: [], hide: {},
    live: false, closed: false,
    redraw() { dirty = true; },
    chosen() { sharing.remember(); },
    dark: () => (dark === null ? system.matches : dark),
    /** The frame that is seen: one that is looked at, or the last one. */
    current: () => glance
      || (view.course && view.course.count ? view.course.vector(view.course.count - 1) : null),
    ask(what, more) {
      if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify({ do: what, ...more }));
    },
    /** Look at a time: what is here at once, and what the server makes of it when it comes. */
    scrub(time) {
      if (!view.course?.count) return;
      const inside = Math.min(Math.max(time, view.course.time(0)), view.course.end);
      glance = view.course.vector(Math.max(view.course.until(inside) - 1, 0)).slice();
      wanted = inside;
      dirty = true;
    },
    scrubbed() {
      if (wanted !== null) view.ask("seek", { time: wanted });
      wanted = null;
    },
    /** A number that changes all the time, as it can be read. */
    steady(name, text) {
      const now = performance.now(), old = texts.get(name);
      if (view.state.playing && old && now - old.since < READ_FOR) return old.text;
      texts.set(name, { text, since: now });
      return text;
    },
    /** Say something below the picture; what the page says itself goes away again. */
    tell(text, { stays = false } = {}) {
      clearTimeout(told);
      at("note").textContent = text;
      if (!stays) told = setTimeout(() => { at("note").textContent = view.state.note; }, SAID_FOR);
    },
    curves: () => curves.canvases(),
  };
  const texts = new Map();
  const picture = HeelstrikePicture(view), curves = HeelstrikeCurves(view);
  const settings = HeelstrikeSettings(view), strip = HeelstrikeStrip(view);
  const theme = {
    settings: () => ({ theme: dark === null ? "" : dark ? "dark" : "light" }),
    use(how) {
      dark = { dark: true, light: false }[how.theme] ?? null;
      document.documentElement.className = dark === null ? "" : how.theme;
      settings.paint();
    },
  };
  at("hint").textContent = picture.hint;
  const sharing = HeelstrikeSharing(view, [picture, curves, settings, theme]);

  /* The socket. */
  const token = new URLSearchParams(location.search).get("token");
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  const socket = new WebSocket(`${scheme}://${location.host}/live?token=${token}`);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => {
    document.body.dataset.connected = "yes";
    waitFor("loading");
  };
  socket.onclose = () => {
    document.body.dataset.connected = "no";
    view.closed = true;
    view.state.playing = false;
    for (const each of document.querySelectorAll("main button, main select, main input"))
      each.disabled = !each.closest("#tabs, #plots, #marks");
    showBanner("The connection has ended: the program was stopped, or the network lost. "
      + "When it runs again, open the address that it prints.");
    at("waiting").hidden = true;
  };
  socket.onmessage = ({ data }) => {
    dirty = true;
    if (data instanceof ArrayBuffer) {
      if (view.course) take(new Float64Array(data));
      return;
    }
    const message = JSON.parse(data);
    if (message.kind === "scene") begin(message);
    else if (message.kind === "events") addEvents(message.events);
    else if (message.kind === "cut") {
      view.course.cut(message.time + 1e-9);
      glance = null;
      view.events = view.events.filter(([t]) => t <= message.time);
    } else if (message.kind === "state") {
      delete message.kind;
      Object.assign(view.state, message);
      showState(message);
    }
  };

  function take(numbers) {
    const kept = numbers[0] !== 1;
    if (kept) view.course.add(numbers.subarray(1));
    if (wanted === null) glance = kept ? null : numbers.subarray(1);
    at("waiting").hidden = true;
    picture.followPull();
  }

  function begin(message) {
    Object.assign(view, { scene: message.scene, layout: message.layout, live: message.live,
      kinds: message.events, course: new HeelstrikeCourse(message.layout), events: [] });
    glance = wanted = null;
    texts.clear();
    at("name").textContent = view.scene.robot;
    at("name").title = message.method;
    document.title = `${view.scene.robot}: heelstrike`;
    document.querySelector("main").classList.toggle("looking", !view.live);
    if (!view.live && tab() === "settings") open("plots");
    curves.begin();
    settings.begin();
    strip.showKinds();
  }

  function addEvents(more) {
    const known = new Set(view.events.map(([, kind]) => kind));
    view.events = view.events.concat(more).slice(-MOST_EVENTS);
    if (more.some(([, kind]) => !known.has(kind))) strip.showKinds();
  }

  /* What is told in words. */
  function showBanner(text, busy) {
    at("told").textContent = text;
    at("banner").hidden = !text;
    at("banner").classList.toggle("busy", Boolean(busy));
  }

  /** Until there is a picture: what is done, and how much of it where that is known. */
  function waitFor(text) {
    if (at("waiting").hidden) return;
    const bar = at("waiting").querySelector(".bar"), share = text.match(/(\d+) ?%/);
    at("waiting-for").textContent = text;
    if (share) bar.setAttribute("aria-valuenow", share[1]);
    else bar.removeAttribute("aria-valuenow");
    bar.firstElementChild.style.width = share ? `${share[1]}%` : "";
  }

  function showState(changed) {
    const { state } = view;
    if (changed.light) {
      at("lamp").textContent = LAMPS[state.light.level];
      at("lamp").dataset.level = state.light.level;
      at("light-text").textContent = at("light").title = state.light.text;
    }
    const doing = state.playing ? "pause" : "play";
    at("play").querySelector("span").textContent = doing;
    at("play").querySelector("use").setAttribute("href", `#icon-${doing}`);
    at("resume").disabled = view.closed || state.end || !state.returns;
    at("resume").title = state.returns ? "forget what came later, and simulate on from here (g)"
      : "the controller takes no part in snapshots: it cannot be taken back";
    if (changed.note !== undefined) view.tell(state.note, { stays: true });
    if (at("waiting").hidden) showBanner(state.busy || state.message, state.busy);
    else if (state.busy) waitFor(state.busy);
    else if (state.note) waitFor(state.note);
    if (changed.rate !== undefined) showRates();
    // What was chosen and refused goes back to what there is.
    const refused = changed.note || changed.busy === "";
    if (changed.controls || changed.values || refused) settings.show(state);
    settings.showJoints();
  }

  function showRates() {
    const { rate } = view.state;
    const rates = RATES.includes(rate) ? RATES : [...RATES, rate].sort((a, b) => a - b);
    at("rate").replaceChildren(...rates.map((each) => new Option(`× ${each}`, each)));
    at("rate").value = rate;
  }

  /** Numbers beside the picture, as often as they can be read. */
  function showTime(time) {
    const { state } = view, digits = state.playing ? 1 : 4;
    const told = view.steady("clock", `${time.toFixed(digits)} s`);
    if (at("clock").textContent !== told) at("clock").textContent = told;
    const slower = state.playing && state.rate >= 0.5 && !glance
      && Math.abs(state.reached - state.rate) > 0.2 * state.rate;
    const pace = !state.playing ? "" : slower ? `× ${state.rate}, reaches × ${state.reached}`
      : `× ${state.rate}`;
    const steady = view.steady("pace", pace);
    if (at("pace").textContent !== steady) at("pace").textContent = steady;
    at("time").setAttribute("aria-valuetext", told);
  }

  /** Keep on the picture what is drawn: its time, frames so far, force of all pushes. */
  function noteDrawn({ time, push }) {
    const { components } = picture, { dataset } = at("plane");
    const forces = Array.from(push).filter((_, i) => i % (2 * components) >= components);
    dataset.time = time;
    dataset.frames = view.course.count;
    dataset.pushed = Math.hypot(...forces.filter(Number.isFinite));
  }

  let turn = 0, looked = 0, was = null, due = true;
  function show(now) {
    requestAnimationFrame(show);
    if (wanted !== null && now - asked > ASKED_EVERY) {
      asked = now;
      view.ask("seek", { time: wanted });
    }
    const { playing } = view.state, vector = view.current();
    if (!dirty || !vector) {
      sharing.paint();
      return;
    }
    dirty = false;
    noteDrawn(picture.draw(vector));
    showTime(vector[0]);
    const thorough = now - looked > READ_FOR || !playing || was !== playing;
    if (thorough) {
      due = true; // until a turn of the strip comes
      looked = now;
      was = playing;
      curves.scale();
      settings.showJoints();
    }
    if (turn++ % 4 === 0 || !playing) { // curves need not be as smooth as the robot
      curves.draw(vector);
      strip.draw(vector, { thorough: due });
      due = false;
    } else dirty = true;
    sharing.paint();
  }

  /* What is asked for. */
  const press = {
    play: () => view.ask("play", { on: !view.state.playing }),
    back: () => view.ask("step", { rows: -1 }),
    forth: () => view.ask("step", { rows: 1 }),
    "event-before": () => view.ask("event", { direction: -1, kinds: strip.kinds() }),
    "event-after": () => view.ask("event", { direction: 1, kinds: strip.kinds() }),
    reset: () => view.ask("reset"),
    random: () => view.ask("random push"),
    resume: () => view.ask("resume"),
    "view-reset": sharing.reset, link: sharing.link, shot: sharing.shot, film: sharing.film,
    theme() {
      theme.use({ theme: view.dark() ? "light" : "dark" });
      view.chosen();
      dirty = true;
    },
    help: () => at("keys").showModal(),
  };
  for (const [name, act] of Object.entries(press)) at(name).onclick = act;
  at("keys-close").onclick = () => at("keys").close();
  at("rate").onchange = () => view.ask("rate", { value: Number(at("rate").value) });
  const tab = () => document.querySelector("main").dataset.tab;
  for (const each of document.querySelectorAll("#tabs button"))
    each.onclick = () => open(each.dataset.tab);
  /** Show one thing below the picture; the same again leaves the room to the picture. */
  function open(name) {
    const { dataset } = document.querySelector("main");
    dataset.tab = tab() === name ? "" : name;
    for (const each of document.querySelectorAll("#tabs button"))
      each.setAttribute("aria-pressed", String(each.dataset.tab === tab()));
    dirty = true;
  }
  if (innerWidth <= 640) open("settings"); // a telephone: the picture first

  const KEYS = { " ": "play", ArrowLeft: "back", ArrowRight: "forth", r: "reset", p: "random",
    g: "resume", i: "shot", v: "film", l: "link", d: "theme", 0: "view-reset", "?": "help" };
  const WAYS = [...picture.ways, ["double click, 0", "the usual view"], ["space", "play, pause"],
    ["← →", "one step back, forth"], ["shift ← →", "event before, next event"],
    ["+ −", "zoom"], ["g", "go on from the time that is looked at"], ["r", "start again"],
    ["p", "random push"], ["i, v", "save the picture; record a film"], ["l", "copy a link"],
    ["d", "light or dark"]];
  at("key-list").append(...WAYS.flatMap(([key, what]) => {
    const term = document.createElement("dt"), means = document.createElement("dd");
    term.textContent = key;
    means.textContent = what;
    return [term, means];
  }));
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || at("keys").open) return;
    const { tagName, id } = event.target;
    const typing = /^(INPUT|SELECT|BUTTON)$/.test(tagName) && id !== "time";
    if (typing && (event.key.length > 1 || event.key === " ")) return;
    if (tagName === "SELECT") return; // it looks for what begins so
    if (["+", "-", "="].includes(event.key)) {
      picture.zoom(event.key === "-" ? 1 / 1.25 : 1.25);
      return;
    }
    if (picture.keys[event.key]) {
      picture.keys[event.key]();
      return;
    }
    let name = KEYS[event.key];
    if (event.shiftKey && event.key.startsWith("Arrow")) name = `event-${
      event.key === "ArrowLeft" ? "before" : "after"}`;
    // A button that is behind a tab can be pressed by its key; one that a run has not cannot.
    if (!name || at(name).disabled || (!view.live && at(name).closest(".change"))) return;
    event.preventDefault();
    press[name]();
  });
  system.addEventListener("change", () => {
    settings.paint();
    dirty = true;
  });
  new ResizeObserver(() => { dirty = true; }).observe(at("plane"));
  addEventListener("resize", () => { dirty = true; });
  sharing.recall();
  requestAnimationFrame(show);
})();
