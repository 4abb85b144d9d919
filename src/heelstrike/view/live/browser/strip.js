/* The bar of time below the picture: who stands, what happened, and where one looks.

   HeelstrikeStrip(view) returns {draw, showKinds, kinds}. */
"use strict";

var HeelstrikeStrip = (view) => {
  const at = (name) => document.getElementById(name);
  const INSET = 8; // pixels, half a thumb of the slider that lies upon it
  const IMPACTS = ["touchdown", "impact"];
  const KINDS = [...IMPACTS, "slip", "bridge"]; // that can be chosen before there was one
  const slider = at("time");
  let phases = [], counted = 0;

  const levelOf = (name) =>
    (IMPACTS.includes(name) ? 2 : name.includes("slip") || name.includes("stick") ? 1 : 0);

  /** Draw it; of who stands, what is new is found now and then only. */
  function draw(vector, { thorough }) {
    const { course, state } = view, { context, width, height } = HeelstrikeDrawing.fit(at("events"));
    const from = state.from || 0, to = Math.max(from, course.end);
    if (thorough || course.count < counted) {
      phases = course.phases(view.scene.weight);
      counted = course.count;
    }
    const wanted = at("kinds").value;
    const events = view.events.filter(([time, kind]) => time >= from
      && (!wanted || view.kinds[kind] === wanted));
    HeelstrikeDrawing.strip(context, { width, height, inset: INSET, from, to, dark: view.dark(),
      now: vector[0], seconds: true, feet: view.scene.feet.length,
      phases: phases.filter(([, end]) => end >= from).map(([begin, end, foot]) =>
        [Math.max(begin, from), Math.min(end, to), foot]),
      events: events.map(([time, kind]) => ({ time, level: levelOf(view.kinds[kind]) })) });
    slider.min = from;
    slider.max = to;
    if (!slider.dataset.held) slider.value = vector[0];
  }

  slider.oninput = () => {
    slider.dataset.held = "yes";
    view.scrub(Number(slider.value));
  };
  slider.onchange = () => {
    delete slider.dataset.held;
    view.scrubbed();
  };

  function showKinds() {
    const select = at("kinds"), chosen = select.value;
    const known = new Set([...KINDS, ...view.events.map(([, kind]) => view.kinds[kind])]);
    const options = [["", "any event"], ...[...known].filter((name) => view.kinds.includes(name))
      .map((name) => [name, name.replaceAll("_", " ")])];
    select.replaceChildren(...options.map(([value, text]) => new Option(text, value)));
    select.value = options.some(([value]) => value === chosen) ? chosen : "";
  }
  at("kinds").onchange = () => view.redraw();

  return { draw, showKinds, kinds: () => (at("kinds").value ? [at("kinds").value] : []) };
};
