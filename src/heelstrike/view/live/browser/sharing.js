/* What leaves the page: a picture, a film, and the address of what one sees.

   HeelstrikeSharing(view, parts) returns {shot, film, link, remember, recall, reset, paint}; each of
   `parts` has settings(), the words that an address carries, and use(settings). */
"use strict";

var HeelstrikeSharing = (view, parts) => {
  const { palette } = HeelstrikeDrawing;
  const at = (name) => document.getElementById(name);
  const CAPTION = 34, MARGIN = 10; // pixels
  const FRAMES = 30, BITS = 8e6; // a second
  const LONGEST = 600; // s of a film
  const TYPES = ["video/webm;codecs=vp9", "video/webm;codecs=vp8", "video/webm", "video/mp4"];

  /** The canvases that are seen, and where; the picture first. */
  function seen() {
    const inside = at("curves").getBoundingClientRect();
    const found = [{ canvas: at("plane"), box: at("plane").getBoundingClientRect() }];
    for (const canvas of view.curves()) {
      const box = canvas.getBoundingClientRect();
      const visible = box.width && box.top >= inside.top - 1 && box.bottom <= inside.bottom + 1
        && box.top >= 0 && box.bottom <= innerHeight;
      if (visible) found.push({ canvas, box });
    }
    return found;
  }

  /** A canvas for what is seen now, and how to paint it: the picture, its curves, a line of words. */
  function frameOf() {
    const pieces = seen(), ratio = window.devicePixelRatio || 1;
    const left = Math.min(...pieces.map(({ box }) => box.left)) - MARGIN;
    const top = Math.min(...pieces.map(({ box }) => box.top)) - MARGIN;
    const right = Math.max(...pieces.map(({ box }) => box.right)) + MARGIN;
    const bottom = Math.max(...pieces.map(({ box }) => box.bottom)) + CAPTION;
    const canvas = document.createElement("canvas");
    const even = (length) => 2 * Math.round(0.5 * length * ratio); // as codecs want them
    [canvas.width, canvas.height] = [even(right - left), even(bottom - top)];
    const context = canvas.getContext("2d");
    function paint() {
      const colors = palette(view.dark()), vector = view.current();
      context.setTransform(ratio, 0, 0, ratio, 0, 0);
      context.fillStyle = colors.paper;
      context.fillRect(0, 0, right - left, bottom - top);
      for (const { canvas: piece, box } of pieces)
        if (piece.width && piece.height)
          context.drawImage(piece, box.left - left, box.top - top, box.width, box.height);
      context.font = "600 15px system-ui, sans-serif";
      context.textBaseline = "middle";
      context.fillStyle = colors.ink;
      const y = bottom - top - 0.5 * CAPTION, when = vector ? `${vector[0].toFixed(3)} s` : "";
      context.textAlign = "left";
      context.fillText(`${view.scene.robot}   ${when}`, MARGIN + 4, y);
      context.textAlign = "right";
      context.fillStyle = colors.grey;
      context.fillText("heelstrike", right - left - MARGIN - 4, y);
    }
    paint();
    return { canvas, paint };
  }

  function save(blob, name) {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = name.replaceAll(/[^\w.-]+/g, "_");
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60000);
  }
  const when = () => `${view.current()[0].toFixed(3)}s`;

  function shot() {
    if (!view.current()) return;
    frameOf().canvas.toBlob((blob) => save(blob, `${view.scene.robot}-${when()}.png`));
  }

  /* A film of what is seen, for as long as it is on. */
  let recording = null;

  function film() {
    if (recording) {
      recording.recorder.stop();
      return;
    }
    if (!view.current()) return;
    const type = window.MediaRecorder && TYPES.find((each) => MediaRecorder.isTypeSupported(each));
    if (!type) {
      view.tell("this browser cannot record a film: it has no MediaRecorder for WebM or MP4");
      return;
    }
    const { canvas, paint } = frameOf(), pieces = [];
    const recorder = new MediaRecorder(canvas.captureStream(FRAMES),
      { mimeType: type, videoBitsPerSecond: BITS });
    recorder.ondataavailable = ({ data }) => { if (data.size) pieces.push(data); };
    recorder.onstop = () => {
      const ending = type.includes("mp4") ? "mp4" : "webm";
      if (pieces.length)
        save(new Blob(pieces, { type }), `${view.scene.robot}-${when()}.${ending}`);
      recording = null;
      tellFilm();
    };
    recorder.onerror = () => view.tell("the film could not be recorded");
    recording = { recorder, paint, began: performance.now() };
    recorder.start(1000);
    tellFilm();
  }
  function tellFilm() {
    const seconds = recording ? Math.floor((performance.now() - recording.began) / 1000) : 0;
    at("recording").hidden = !recording;
    at("recorded").textContent = `${Math.floor(seconds / 60)}:${String(seconds % 60).padStart(2, "0")}`;
    at("film").setAttribute("aria-pressed", String(Boolean(recording)));
    at("film").title = recording ? "end the film and save it (v)" : "record a film (v)";
    if (seconds >= LONGEST && recording.recorder.state === "recording") recording.recorder.stop();
  }
  /** Take a picture for the film, if there is one. */
  function paint() {
    if (!recording) return;
    recording.paint();
    tellFilm();
  }

  /* The address: what differs from the usual view. */
  let wait = 0;
  function words() {
    const found = new URLSearchParams();
    for (const part of parts)
      for (const [name, value] of Object.entries(part.settings())) if (value) found.set(name, value);
    return found.toString().replaceAll("%2C", ",");
  }
  function remember() {
    clearTimeout(wait);
    wait = setTimeout(() => {
      const told = words();
      history.replaceState(null, "", location.pathname + location.search + (told ? `#${told}` : ""));
    }, 150);
  }
  function use(settings) {
    for (const part of parts) part.use(settings);
    view.redraw();
  }
  const recall = () => use(Object.fromEntries(new URLSearchParams(location.hash.slice(1))));
  function reset() {
    use({});
    remember();
  }
  async function link() {
    const told = words(), address = location.origin + location.pathname + location.search
      + (told ? `#${told}` : "");
    try {
      await navigator.clipboard.writeText(address);
      view.tell("the address of this view is copied; it lets in whoever has it");
    } catch {
      view.tell("this browser does not let a page copy: the address above is that of this view");
    }
  }
  addEventListener("hashchange", recall);

  return { shot, film, link, remember, recall, reset, paint };
};
