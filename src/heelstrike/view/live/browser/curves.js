/* Curves over time beside the picture, on the same cursor.

   HeelstrikeCurves(view) returns {begin, draw, scale, canvases, settings, use}. */
"use strict";

var HeelstrikeCurves = (view) => {
  const { plot, fit } = HeelstrikeDrawing;
  const at = (name) => document.getElementById(name);
  const ALL = "all";
  const WIDE = 1700; // pixels of a window that has room for all of them
  const SAMPLES = 2000;
  const FLATTEST = 1.5; // usual ranges beyond which a limit is not worth a flat curve

  let panels = [], group = null, spans = new Map(), fitted = -1;

  function begin() {
    spans = new Map();
    fitted = -1;
    build();
  }

  function build() {
    const known = [...new Set(view.layout.panels.map((panel) => panel.group)), ALL];
    const shown = known.includes(group) ? group : innerWidth >= WIDE ? ALL : known[0];
    at("groups").replaceChildren(...known.map((name) => {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = name;
      button.setAttribute("aria-pressed", name === shown);
      button.onclick = () => {
        group = name;
        build();
        at("groups").children[known.indexOf(name)].focus();
        view.chosen();
        view.redraw();
      };
      return button;
    }));
    panels = view.layout.panels.filter((panel) => [panel.group, ALL].includes(shown)).map(made);
    at("curves").replaceChildren(...panels.map((one) => one.canvas));
    at("curves").scrollTop = 0;
  }

  function made(panel) {
    const canvas = document.createElement("canvas");
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `${panel.group}: ${panel.title} in ${panel.unit} over time`);
    const one = { panel, canvas, seen: null };
    const timeAt = (event) => {
      const { left, right, from, to } = one.seen;
      const x = event.clientX - canvas.getBoundingClientRect().left;
      return from + ((x - left) / (right - left)) * (to - from);
    };
    canvas.onpointerdown = (event) => {
      if (!one.seen || event.button !== 0) return;
      canvas.setPointerCapture(event.pointerId);
      one.held = { ...one.seen }; // the axis stays while it is dragged along
      view.scrub(timeAt(event));
    };
    canvas.onpointermove = (event) => { if (one.held) view.scrub(timeAt(event)); };
    canvas.onpointerup = canvas.onpointercancel = () => {
      one.held = null;
      view.scrubbed();
    };
    return one;
  }

  /** Ends of an axis: what is usual between impacts. They grow, and shrink only with a new scene. */
  function scale() {
    const { course } = view;
    if (!course || course.count === fitted) return;
    fitted = course.count;
    const every = Math.max(1, Math.ceil(course.count / SAMPLES));
    for (const panel of view.layout.panels) {
      if (panel.span) continue;
      const values = [];
      for (const { at: place } of panel.curves)
        for (let k = 0; k < course.count; k += every) {
          const value = course.numbers[k * course.width + place];
          if (Number.isFinite(value)) values.push(value);
        }
      if (!values.length) continue;
      values.sort((a, b) => a - b);
      const quantile = (share) => values[Math.round(share * (values.length - 1))];
      const [least, most] = panel.usual || [Infinity, -Infinity];
      const few = quantile(0.05), many = quantile(0.95);
      const usual = Math.max(many - few, panel.usual ? most - least : 0);
      // What goes far beyond the usual values leaves the axis.
      const room = usual > 0 ? (panel.usual ? 0.25 : 2) * usual : Infinity;
      const kept = spans.get(panel) || [least, most];
      spans.set(panel, [Math.min(kept[0], Math.max(values[0], few - room)),
        Math.max(kept[1], Math.min(values.at(-1), many + room))]);
    }
  }

  function spanOf(panel) {
    if (panel.span) return panel.span;
    let [low, high] = spans.get(panel) || [0, 0];
    const room = FLATTEST * (high - low);
    for (const { level } of panel.limits)
      if (level > low - room && level < high + room)
        [low, high] = [Math.min(low, level), Math.max(high, level)];
    const margin = 0.06 * (high - low) || Math.max(1e-9, 0.1 * Math.abs(high)) || 1;
    return [low - margin, high + margin];
  }

  /** Draw those that can be seen, up to the time of a frame and a little beyond. */
  function draw(vector) {
    const { course } = view, cursor = vector[0], lasts = Number(at("span").value);
    const box = at("curves").getBoundingClientRect();
    if (!course.count || !box.width) return;
    const to = Math.max(Math.min(course.end, cursor + 0.5 * lasts), course.time(0) + lasts);
    for (const one of panels) {
      const place = one.canvas.getBoundingClientRect();
      if (place.bottom < 0 || place.top > innerHeight) continue;
      const { context, width, height } = fit(one.canvas);
      const ends = one.held || { from: to - lasts, to };
      const first = Math.max(course.until(ends.from) - 1, 0), last = course.until(ends.to);
      const every = Math.max(1, Math.floor((last - first) / (2 * width)));
      const rows = [];
      for (let k = first; k < last; k += every) rows.push(k);
      const curves = one.panel.curves.map((curve) => ({ ...curve,
        values: rows.map((k) => course.numbers[k * course.width + curve.at]) }));
      const span = spanOf(one.panel);
      Object.assign(one.canvas.dataset, { span: span.join(" "), cursor });
      const sides = plot(context, { ...one.panel, curves, span },
        rows.map((k) => course.time(k)),
        { width, height, from: ends.from, to: ends.to, cursor, dark: view.dark() });
      one.seen = { ...sides, from: ends.from, to: ends.to };
    }
  }

  at("span").onchange = () => {
    view.chosen();
    view.redraw();
  };
  at("curves").onscroll = () => view.redraw();

  return {
    begin, draw, scale,
    canvases: () => panels.map((one) => one.canvas),
    settings: () => ({ curves: group || "", span: at("span").value === "3" ? "" : at("span").value }),
    use({ curves, span }) {
      group = curves || null;
      at("span").value = [...at("span").options].some(({ value }) => value === span) ? span : "3";
      spans = new Map();
      fitted = -1;
      if (view.layout) build();
    },
  };
};
