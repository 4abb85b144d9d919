/* The picture of a live view in space: where the camera is, what is drawn, and what is pulled at.

   HeelstrikePicture(view) answers as that of the plane (live/browser/picture.js). */
"use strict";

var HeelstrikePicture = (view) => {
  const at = (name) => document.getElementById(name);
  const WEIGHT_LENGTH = 0.35; // of the robot's size, the pull that is its weight
  const STRONGEST = 4; // weights of the robot, of a push
  const TRAIL = 1.5, FLASH = 0.5, EVENS = 0.4; // s
  const QUIET = ["liftoff", "stick"]; // events that go without a flash
  const NEAR = 14; // pixels within which a part is hit
  const plane = at("plane");
  const plus = (a, b, by = 1) => a.map((value, k) => value + by * b[k]);
  const threes = (numbers) =>
    Array.from({ length: numbers.length / 3 }, (_, k) => Array.from(numbers.subarray(3 * k, 3 * k + 3)));

  view.names = { support: "support polygon", traces: "path of the zero moment point" };
  let stage = null, of = null, pull = null, wished = null;

  /** What draws the scene that there is; the camera stays as it was in the one before. */
  function stageNow() {
    if (of === view.scene) return stage;
    const look = wished || stage?.look;
    [stage, of, wished] = [HeelstrikeSpace.stage(view.scene), view.scene, null];
    if (look) Object.assign(stage.look, look);
    stage.whenMoved(() => {
      view.chosen();
      view.redraw();
    });
    return stage;
  }

  /** Frames of the last so many seconds up to a time, the newest first, not more than `most`. */
  function before(time, lasts, most) {
    const { course } = view, found = [], end = course.until(time + 1e-9);
    const begin = course.until(time - lasts), every = Math.max(1, Math.ceil((end - begin) / most));
    for (let k = end - 1; k >= begin; k -= every) found.push(course.vector(k));
    return found;
  }

  /** Where the camera looks: above the ground below the centre of mass, evened out over the past. */
  function target(frame) {
    let total = Array.from(frame.center), weight = 1;
    for (const vector of before(frame.time, EVENS, 16)) {
      const center = Array.from(view.course.field(vector, "center"));
      const share = 1 - (frame.time - vector[0]) / EVENS;
      if (!center.every(Number.isFinite) || !(share > 0)) continue;
      [total, weight] = [plus(total, center, share), weight + share];
    }
    return stage.above(total.map((value) => value / weight));
  }

  /** The newest event of each force that is drawn, each kind named once. */
  function flashes(frame, contacts) {
    const { events, kinds } = view;
    const lasts = FLASH * Math.min(1, Math.max(view.state.rate || 1, 0.02));
    const found = new Map(), named = new Set();
    for (let k = events.length - 1; k >= 0 && k > events.length - 200; k--) {
      const [time, kind, contact] = events[k];
      if (time > frame.time + 1e-9 || time < frame.time - lasts) continue;
      if (QUIET.includes(kinds[kind]) || !contacts[contact] || found.has(contact)) continue;
      const label = named.size ? "" : kinds[kind].replaceAll("_", " ");
      named.add(kind);
      found.set(contact, { place: contacts[contact].place, label,
        strength: 1 - (frame.time - time) / lasts });
    }
    return [...found.values()];
  }

  function frameOf(vector) {
    const raw = view.course.frame(vector), frame = { time: raw.time, push: raw.push };
    for (const name of ["position", "center", "capture", "pressure", "support"])
      frame[name] = Array.from(raw[name]);
    const [places, forces, normals] = [raw.place, raw.force, raw.normal].map(threes);
    frame.contacts = places.map((place, i) =>
      ({ place, force: forces[i], normal: normals[i], friction: raw.friction[i] }));
    frame.trace = before(raw.time, TRAIL, 150)
      .map((each) => Array.from(view.course.field(each, "pressure")));
    frame.flashes = flashes(frame, frame.contacts);
    const pushes = threes(raw.push);
    frame.pushes = pushes.flatMap((place, k) => (k % 2 ? [] : [{ place, force: pushes[k + 1] }]))
      .filter(({ place }) => place.every(Number.isFinite));
    return frame;
  }

  /** Draw a frame of the course; return it as it is drawn. */
  function draw(vector) {
    stageNow();
    const frame = frameOf(vector);
    stage.draw(plane, frame, target(frame),
      { dark: view.dark(), hide: view.hide, steady: view.steady });
    if (pull) drawPull();
    return frame;
  }

  /* Pushing. */
  const onCanvas = ({ clientX, clientY }) => {
    const box = plane.getBoundingClientRect();
    return [clientX - box.left, clientY - box.top];
  };

  function drawPull() {
    const context = plane.getContext("2d"), colors = HeelstrikeDrawing.palette(view.dark());
    const [px, py] = stage.seen(stage.placeOf(pull)), [x, y] = onCanvas(pull.pointer);
    context.strokeStyle = context.fillStyle = colors.push;
    context.lineWidth = 1.5;
    context.setLineDash([4, 4]);
    context.beginPath();
    context.moveTo(px, py);
    context.lineTo(x, y);
    context.stroke();
    context.setLineDash([]);
    context.beginPath();
    context.arc(px, py, 5, 0, 2 * Math.PI);
    context.stroke();
    if (view.state.playing) return;
    context.font = "600 13px system-ui, sans-serif";
    context.textAlign = "left";
    context.textBaseline = "middle";
    const newtons = HeelstrikeDrawing.words(Math.hypot(...pull.force));
    context.fillText(`${newtons} N when it goes on`, x + 8, y);
  }

  /** Say again how strong the pull is: the part that is held has moved. */
  function followPull() {
    if (!pull || !view.current()) return;
    const { weight, size } = view.scene, place = stage.placeOf(pull);
    const newtons = weight > 0 ? weight / (WEIGHT_LENGTH * size) : 100;
    let force = plus(stage.placeBeside(place, onCanvas(pull.pointer)), place, -1)
      .map((value) => value * newtons);
    const strength = Math.hypot(...force), most = STRONGEST * (weight || 100);
    if (strength > most) force = force.map((value) => (value / strength) * most);
    if (force.every((value, k) => value === pull.force[k])) return;
    pull.force = force;
    view.ask("hold", { link: pull.link, point: pull.point, force });
  }

  const hands = {
    grasp(event) {
      const part = view.live && view.current() ? stage?.partAt(onCanvas(event), NEAR) : null;
      if (!part) return false;
      pull = { ...part, force: [0, 0, 0], pointer: event };
      plane.classList.add("pulling");
      at("hint").classList.add("known");
      return true;
    },
    pull(event) {
      pull.pointer = event;
      followPull();
      view.redraw();
    },
    release() {
      view.ask("release");
      pull = null;
      plane.classList.remove("pulling");
      view.redraw();
    },
    hover(event) {
      plane.classList.toggle("over", Boolean(view.live && stage?.partAt(onCanvas(event), NEAR)));
    },
  };
  HeelstrikeSpace.listen(plane, () => stage, hands);
  plane.addEventListener("dblclick", () => stage?.home());

  const LOOK = ["azimuth", "elevation", "zoom", "aside", "up"];
  const turned = (name) => () => stage?.keys[name]();
  return {
    draw, followPull,
    zoom: (by) => stage?.zoom(by),
    components: 3,
    hint: "drag a part of the robot to push it, drag beside it to look from elsewhere",
    ways: [["drag a part", "push it there"], ["drag beside it", "turn the view"],
      ["shift and drag, wheel", "move, zoom"], ["1 to 4", "from aslant, the right, ahead, behind"],
      ["f", "let the camera stay, or follow"]],
    keys: Object.fromEntries(["f", "1", "2", "3", "4"].map((name) => [name, turned(name)])),
    /** How it is looked at, as numbers: what a link to it carries. */
    settings() {
      const { HOME } = HeelstrikeSpace, look = stage?.look || wished || HOME;
      const same = LOOK.every((name) => look[name] === HOME[name]);
      return { look: same ? "" : LOOK.map((name) => Number(look[name].toFixed(4))).join(),
        stays: look.stays ? look.stays.map((value) => value.toFixed(3)).join() : "" };
    },
    use({ look, stays }) {
      const numbers = (words, count) => {
        const found = (words || "").split(",").map(Number);
        return words && found.length === count && found.every(Number.isFinite) ? found : null;
      };
      const seen = numbers(look, LOOK.length), place = numbers(stays, 3);
      wished = { ...HeelstrikeSpace.HOME, stays: place };
      if (seen) LOOK.forEach((name, k) => { wished[name] = seen[k]; });
      if (stage) [, wished] = [Object.assign(stage.look, wished), null];
    },
  };
};
