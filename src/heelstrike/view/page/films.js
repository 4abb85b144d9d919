/* Films of a report: recorded runs side by side, at the same time. */
"use strict";

(() => {
  const at = (name) => document.getElementById(name);
  const reader = typeof HeelstrikeSpace === "undefined" ? HeelstrikeRecording : HeelstrikeSpace;
  const runs = JSON.parse(at("runs").textContent).map(reader.read);
  const canvases = [...document.querySelectorAll(".films canvas")];
  const start = Math.min(...runs.map((run) => run.start));
  const end = Math.max(...runs.map((run) => run.end));
  // The first picture, and the printed one: where the first of them went wrong, or mid-step.
  const state = { now: Math.min(...runs.map((run) => run.shown)), playing: false, last: 0 };
  const dark = matchMedia("(prefers-color-scheme: dark)"), paper = matchMedia("print");

  function show() {
    runs.forEach((run, i) => {
      const t = Math.min(run.end, Math.max(run.start, state.now));
      run.draw(canvases[i], t, { dark: dark.matches && !paper.matches, hide: {} });
    });
    at("clock").textContent = `${state.now.toFixed(3)} s`;
    at("time").value = Math.round((1000 * (state.now - start)) / (end - start || 1));
    at("time").setAttribute("aria-valuetext", `${state.now.toFixed(3)} seconds`);
  }
  function tick(stamp) {
    if (!state.playing) return;
    const elapsed = Math.min(0.1, (stamp - state.last) / 1000) * Number(at("speed").value);
    state.last = stamp;
    state.now = Math.min(end, state.now + elapsed);
    show();
    if (state.now >= end) play(false);
    else requestAnimationFrame(tick);
  }
  function play(on) {
    if (on && state.now >= end) state.now = start;
    state.playing = on;
    at("play").textContent = on ? "❚❚ pause" : "▶ play";
    at("play").setAttribute("aria-label", on ? "pause" : "play");
    if (on) requestAnimationFrame((stamp) => { state.last = stamp; tick(stamp); });
  }
  at("play").addEventListener("click", () => play(!state.playing));
  at("time").addEventListener("input", (happened) => {
    play(false);
    state.now = start + (Number(happened.target.value) / 1000) * (end - start);
    show();
  });
  for (const button of document.querySelectorAll("button[data-time]")) {
    button.addEventListener("click", () => {
      play(false);
      state.now = Number(button.dataset.time);
      show();
      at("films").scrollIntoView({ block: "nearest" });
    });
  }
  document.addEventListener("keydown", (happened) => {
    if (happened.key !== " " || ["BUTTON", "SELECT"].includes(happened.target.tagName)) return;
    happened.preventDefault();
    play(!state.playing);
  });
  for (const run of runs) if (run.whenMoved) run.whenMoved(show);
  new ResizeObserver(show).observe(document.body);
  for (const query of [dark, paper]) query.addEventListener("change", show);
  show();
  document.documentElement.dataset.ready = "yes";
})();
