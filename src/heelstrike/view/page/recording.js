/* A recorded run: decodes the numbers of a page, and draws it at any time between its rows.

   HeelstrikeRecording.read(run) takes what `contents` of page.py returns. */
"use strict";

var HeelstrikeRecording = (() => {
  const { fit } = HeelstrikeDrawing;
  const MEMBERS = ["pose", "point", "normal", "force", "friction", "center", "capture", "pressure",
    "support", "push"];
  const MOVING = ["pose", "point", "center", "capture", "push"];
  const FLASH = 0.12, TRAIL = 1.5; // s
  const FLASHES = 4;

  const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;

  /** Numbers of the columns by their names, as `packed` of columns.py has them. */
  function unpacked({ columns, numbers }) {
    const coded = new Uint8Array(bytes(numbers)), plain = new DataView(coded.buffer);
    const found = new Map();
    let next = 0;
    function code() {
      let value = 0, unit = 1, byte = 128;
      for (; byte > 127; unit *= 128) {
        byte = coded[next++];
        value += (byte & 127) * unit;
      }
      return value;
    }
    for (const { name, width, rows, least, step } of columns) {
      const values = new Float32Array(width * rows);
      for (let n = 0; n < width; n++) {
        let change = 0, slope = 0, steps = 0;
        for (let k = n; k < values.length; k += width) {
          if (!step[n]) {
            values[k] = plain.getFloat32(next, true);
            next += 4;
            continue;
          }
          const sign = code() - 1;
          if (sign >= 0) {
            change += sign % 2 ? -(sign + 1) / 2 : sign / 2;
            slope += change;
            steps += slope;
          }
          values[k] = sign < 0 ? NaN : least[n] + step[n] * steps;
        }
      }
      found.set(name, { width, rows, values });
    }
    return found;
  }

  /** Index of the last of sorted values that is not beyond t, or -1. */
  function before(values, t) {
    let low = 0, high = values.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (values[middle] <= t) low = middle + 1;
      else high = middle;
    }
    return low - 1;
  }

  /** Time (n), and columns of n rows or, where all are the same, of one. */
  function table(data) {
    const time = new Float64Array(bytes(data.time)), count = data.rows;
    const columns = unpacked(data);
    const row = (name, k) => {
      const { width, rows, values } = columns.get(name);
      const first = rows === 1 ? 0 : k * width;
      return values.subarray(first, first + width);
    };
    const curve = (name) => {
      const { rows, values } = columns.get(name);
      return rows === 1 ? new Float32Array(count).fill(values[0]) : values;
    };
    const rowAt = (t) => Math.max(0, before(time, t));
    return { time, count, row, curve, rowAt, start: time[0], end: time[count - 1] };
  }

  function read(run) {
    const { scene, data, events } = run;
    const { time, count, row, curve, rowAt, start, end } = table(data);

    function frameOf(k) {
      const frame = { time: time[k] };
      for (const name of MEMBERS) frame[name] = row(name, k);
      return frame;
    }

    /** What is drawn at a time: places on straight lines between rows, forces of the row before. */
    function frameAt(t) {
      const k = rowAt(t), frame = frameOf(k);
      const share = k + 1 < count ? (t - time[k]) / (time[k + 1] - time[k] || 1) : 0;
      if (share > 0) {
        const after = frameOf(k + 1);
        for (const name of MOVING)
          frame[name] = frame[name].map((value, i) => value + share * (after[name][i] - value));
      }
      return frame;
    }

    const extent = extentOf(scene, count, row);

    /** Where the camera looks: the mean place of the centre of mass within 0.3 s. */
    function followed(t) {
      let total = 0, weight = 0;
      for (let n = -6; n <= 6; n++) {
        const near = Math.min(end, Math.max(start, t + 0.05 * n));
        const k = rowAt(near), l = Math.min(k + 1, count - 1);
        const part = time[l] > time[k] ? (near - time[k]) / (time[l] - time[k]) : 0;
        const x = row("center", k)[0] * (1 - part) + row("center", l)[0] * part;
        const share = 7 - Math.abs(n);
        if (Number.isFinite(x)) [total, weight] = [total + share * x, weight + share];
      }
      return weight ? total / weight : 0;
    }

    function flashes(t, frame) {
      const found = [];
      for (const event of events) {
        if (event.time > t + 1e-9) break;
        if (t - event.time > FLASH || event.contact < 0 || !event.impact) continue;
        const strength = 1 - (t - event.time) / FLASH;
        const [x, z] = [0, 1].map((k) => frame.point[2 * event.contact + k]);
        // The impulses of one instant are told together.
        const same = found.find((one) => one.time === event.time && one.label);
        if (same) same.impulse += event.impulse;
        found.push({ x, z, strength, time: event.time, impulse: event.impulse,
          unit: event.unit, label: same ? "" : event.kind });
      }
      // Of feet that chatter the last touches are shown, and the last one is told.
      const shown = found.slice(-FLASHES), last = shown.length ? shown.at(-1).time : 0;
      for (const flash of shown) {
        if (flash.time !== last) flash.label = "";
        else if (flash.label && flash.impulse)
          flash.label += ` ${HeelstrikeDrawing.words(flash.impulse)} ${flash.unit}`;
      }
      return shown;
    }

    /** Draw it on a canvas at a time; return what is shown. */
    function draw(canvas, t, { dark, hide }) {
      const { context, width, height } = fit(canvas);
      if (!width || !height) return null;
      const frame = frameAt(t), x = followed(t);
      const scale = Math.min(height / (extent.high - extent.low), width / (2 * extent.reach));
      const bottom = HeelstrikeDrawing.heightOfGround(scene.ground, x) + extent.low;
      const trail = [];
      for (let k = rowAt(t); k >= 0 && t - time[k] < TRAIL; k--) trail.push(frameOf(k));
      HeelstrikeDrawing.draw(context, scene, frame, { width, height, x, scale,
        z: bottom + (0.5 * height) / scale, dark, hide, trail, flashes: flashes(t, frame) });
      return frame;
    }

    return { ...run, time, count, start, end, curve, rowAt, draw };
  }

  /** What a camera that follows the centre of mass has to hold (m). */
  function extentOf(scene, count, row) {
    let low = Infinity, high = -Infinity, reach = 0;
    for (let k = 0; k < count; k++) {
      const center = row("center", k)[0], pose = row("pose", k);
      const ground = HeelstrikeDrawing.heightOfGround(scene.ground, center);
      for (const { link, corners } of scene.shapes) {
        const [x, z, angle] = [0, 1, 2].map((n) => pose[3 * link + n]);
        const cos = Math.cos(angle), sin = Math.sin(angle);
        for (let n = 0; n + 1 < corners.length; n += 2) {
          const px = x + cos * corners[n] + sin * corners[n + 1];
          const pz = z + cos * corners[n + 1] - sin * corners[n];
          if (!Number.isFinite(px + pz)) continue;
          low = Math.min(low, pz - ground);
          high = Math.max(high, pz - ground);
          reach = Math.max(reach, Math.abs(px - center));
        }
      }
    }
    if (!(high > low)) [low, high, reach] = [0, 1, 1];
    const size = Math.max(high - low, scene.size);
    return { low: Math.min(low, 0) - 0.14 * size, high: high + 0.2 * size,
      reach: Math.max(1.05 * reach, 1e-3) };
  }

  return { read, table, before, fit };
})();
