/* What can be set: the controls of the simulation, the joints of the halted robot, what is drawn.

   HeelstrikeSettings(view) returns {show, begin, showJoints, paint, settings, use}. */
"use strict";

var HeelstrikeSettings = (view) => {
  const { palette, words } = HeelstrikeDrawing;
  const at = (name) => document.getElementById(name);
  const MARKS = { forces: ["↑", "forces", "force"], cones: ["▽", "friction cones", "force"],
    pressure: ["◆", "zero moment point", "pressure"], support: ["▬", "support", "pressure"],
    center: ["●", "centre of mass", "center"], capture: ["✕", "capture point", "center"],
    traces: ["⌇", "foot traces", "grey"] };

  const element = (name, properties = {}, ...children) => {
    const made = Object.assign(document.createElement(name), properties);
    made.append(...children);
    return made;
  };
  const option = (each) => new Option(each, each);

  /** A slider with its value in words; `choose` gets the number, and whether it is let go. */
  function slider(label, unit, range, choose, told = words) {
    const value = element("b");
    const input = element("input", { type: "range", ...range });
    const show = () => {
      const text = `${told(Number(input.value))}${unit ? ` ${unit}` : ""}`;
      if (value.textContent !== text) value.textContent = text;
    };
    input.oninput = () => {
      input.dataset.held = "yes";
      show();
      choose(Number(input.value), false);
    };
    input.onchange = () => {
      delete input.dataset.held;
      choose(Number(input.value), true);
    };
    const line = element("label", {}, element("span", { textContent: label, title: label }), input,
      value);
    /** Show another value, unless somebody holds it. */
    const set = (number) => {
      if (input.dataset.held) return;
      input.value = number;
      show();
    };
    return { line, input, set };
  }

  /* Controls: made once, then only their values change, so that a slider can be held. */
  let made = "";
  const sets = new Map();

  function show({ controls, values }) {
    if (!controls) return;
    const wanted = JSON.stringify(controls);
    if (wanted !== made) {
      const focused = document.activeElement?.name;
      made = wanted;
      sets.clear();
      at("controls").replaceChildren(...controls.map(controlOf));
      if (focused) at("controls").querySelector(`[name="${CSS.escape(focused)}"]`)?.focus();
    }
    for (const [name, set] of sets) set(values[name]);
  }

  function controlOf(control) {
    const choose = (value) => view.ask("choose", { name: control.name, value });
    let line;
    if (control.options.length) {
      const input = element("select", { name: control.name }, ...control.options.map(option));
      input.onchange = () => choose(input.value);
      sets.set(control.name, (value) => { input.value = value; });
      line = element("label", {}, element("span", { textContent: control.label }), input);
    } else {
      const { low: min, high: max, step } = control;
      const one = slider(control.label, control.unit, { name: control.name, min, max, step },
        (value, letGo) => { if (control.at_once || letGo) choose(value); });
      sets.set(control.name, one.set);
      line = one.line;
    }
    line.title = control.at_once ? "acts at once" : "starts again with it";
    return line;
  }

  /* Joints. */
  let joints = [];

  function begin() {
    const known = view.layout.joints || [];
    const digits = (low, high) => (high - low) / 500;
    joints = known.map(({ name, label, unit, low, high, at: place }) => {
      const step = 10 ** Math.floor(Math.log10(digits(low, high)));
      const one = slider(label, unit, { name, min: low, max: high, step },
        (value) => view.ask("pose", { joint: name, value }),
        (value) => value.toFixed(3).replace("-", "−"));
      return { place, ...one };
    });
    at("sliders").replaceChildren(...joints.map(({ line }) => line));
    showJoints();
  }

  /** Joints of the frame that is seen; they can be moved where the simulation is halted. */
  function showJoints() {
    const vector = view.current(), halted = view.live && !view.state.playing && !view.closed;
    for (const { input, place, set } of joints) {
      input.disabled = !halted;
      if (vector) set(vector[place].toFixed(4));
    }
    at("joints-note").textContent =
      !view.live ? "" : halted ? "move them, then play" : "halt to move them";
  }

  /* What is drawn. */
  const boxes = Object.entries(MARKS).map(([name, [mark, text, color]]) => {
    const box = element("input", { type: "checkbox", checked: true, name: `show-${name}` });
    box.onchange = () => {
      view.hide[name] = !box.checked;
      view.chosen();
      view.redraw();
    };
    const sign = element("i", { textContent: mark, ariaHidden: "true" });
    const called = view.names?.[name] || text; // what the picture draws there
    at("boxes").append(element("label", {}, box, element("span", {}, sign, called)));
    return { name, box, sign, color };
  });
  /** The signs have the colours of what they stand for. */
  function paint() {
    for (const { sign, color } of boxes) sign.style.color = palette(view.dark())[color];
  }

  return {
    show, begin, showJoints, paint,
    settings: () => ({ hide: boxes.filter(({ box }) => !box.checked).map(({ name }) => name).join() }),
    use({ hide }) {
      const hidden = new Set((hide || "").split(","));
      for (const { name, box } of boxes) {
        box.checked = !hidden.has(name);
        view.hide[name] = hidden.has(name);
      }
    },
  };
};
